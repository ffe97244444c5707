//! All lights in one table: lights without a surface, emissive surfaces, the environment.

use super::surfaces::SurfaceTable;
use snell_intersect::{Geometry, GeometryId, GroupId, World};
use snell_math::Transform;
use snell_scene::light::area::{AreaLight, EmissiveGeometry};
use snell_scene::light::environment::EnvironmentLight;
use snell_scene::{Light, Material, MaterialId, Scene};
use std::collections::HashMap;
use std::f64::consts::PI;

/// Work and memory for the table of emissive surfaces: a small file may place an emissive mesh billions of times.
const BUDGET: u64 = 1 << 28;
const COST_OF_INSTANCE: u64 = 256;
const COST_OF_TRIANGLE: u64 = 64;

/// One light of the table.
#[derive(Debug)]
pub enum CompiledLight {
    /// A light without a surface.
    Light(Light),
    /// An emissive surface at one place.
    Area(AreaLight),
    /// The environment.
    Environment,
}

/// The lights of a scene.
#[derive(Debug, Default)]
pub struct LightTable {
    pub lights: Vec<CompiledLight>,
    /// Approximate power of each, W.
    pub powers: Vec<f64>,
    /// Position of the environment.
    pub environment: Option<usize>,
    by_surface: HashMap<(u32, u32), usize>,
    spent: u64,
}

impl LightTable {
    pub fn new(
        scene: &Scene,
        world: &World,
        surfaces: &SurfaceTable,
        materials: &[Material],
        environment: Option<&EnvironmentLight>,
        scene_radius: f64,
    ) -> Self {
        let mut table = Self::default();
        let radius = if scene_radius > 0.0 { scene_radius } else { 1.0 };
        for light in &scene.lights {
            table.push(CompiledLight::Light(light.clone()), light.power(radius));
        }
        let emissive = EmissiveGroups::new(world, surfaces, materials);
        if !emissive.is_empty() {
            table.add_surfaces(world, surfaces, materials, &emissive, GroupId(0), 0, &Transform::IDENTITY);
        }
        if let Some(environment) = environment {
            table.environment = Some(table.lights.len());
            // Power through a disk of the scene's size from every direction (pbrt, section 12.5).
            table.push(CompiledLight::Environment, 4.0 * PI * PI * radius * radius * environment.mean_luminance());
        }
        table
    }

    /// False if the scene has more emissive surfaces than the table lists. The others give light too, but only to rays that find
    /// them by chance.
    pub fn is_complete(&self) -> bool {
        self.spent <= BUDGET
    }

    fn push(&mut self, light: CompiledLight, power: f64) {
        self.lights.push(light);
        self.powers.push(if power.is_finite() && power > 0.0 { power } else { 0.0 });
    }

    pub fn of_surface(&self, instance: u32, geometry: u32) -> Option<usize> {
        self.by_surface.get(&(instance, geometry)).copied()
    }

    fn add_surfaces(
        &mut self,
        world: &World,
        surfaces: &SurfaceTable,
        materials: &[Material],
        emissive: &EmissiveGroups,
        group: GroupId,
        instance: u32,
        world_from_group: &Transform,
    ) {
        let contents = world.group(group);
        self.spent += COST_OF_INSTANCE;
        for &id in &contents.geometries {
            let material = |primitive| &materials[surfaces.material(world, instance, id.0, primitive).index()];
            if emissive.geometries[id.0 as usize] && self.is_complete() {
                self.add_surface(world, id, instance, world_from_group, material);
            }
        }
        let mut next = instance + 1;
        for child in &contents.instances {
            if !self.is_complete() {
                return;
            }
            if emissive.groups[child.child.0 as usize] {
                let placed = world_from_group.compose(&child.group_from_child);
                self.add_surfaces(world, surfaces, materials, emissive, child.child, next, &placed);
            }
            next += world.occurrences_below(child.child);
        }
    }

    fn add_surface<'a>(
        &mut self,
        world: &World,
        id: GeometryId,
        instance: u32,
        world_from_group: &Transform,
        material: impl Fn(u32) -> &'a Material,
    ) {
        let (geometry, placed, brightest) = match world.geometry(id) {
            Geometry::Mesh(mesh) => {
                let emits = |t: &u32| is_light(material(*t));
                let triangles: Vec<u32> = (0..mesh.indices.len() as u32).filter(emits).collect();
                self.spent += mesh.indices.len() as u64 + COST_OF_TRIANGLE * triangles.len() as u64;
                let luminance = |m: &&Material| f64::from(m.emission.factor.luminance());
                let materials = triangles.iter().map(|&t| material(t));
                let Some(brightest) = materials.max_by(|a, b| luminance(a).total_cmp(&luminance(b))) else { return };
                let geometry = EmissiveGeometry::Mesh { mesh: mesh.clone(), triangles };
                (geometry, *world_from_group, brightest)
            }
            Geometry::Shape(shape, group_from_shape) => {
                let material = material(0);
                if !is_light(material) {
                    return;
                }
                (EmissiveGeometry::Shape(shape.clone()), world_from_group.compose(group_from_shape), material)
            }
            // Shine when they are hit, but are not sampled.
            Geometry::Quads(_) | Geometry::MovingMesh(_) | Geometry::Set(_) => return,
        };
        let Some(light) = AreaLight::new(geometry, placed, (instance, id.0)) else { return };
        let sides = if brightest.emits_on_both_sides { 2.0 } else { 1.0 };
        let power = light.area() * PI * sides * f64::from(brightest.emission.factor.luminance());
        self.by_surface.insert((instance, id.0), self.lights.len());
        self.push(CompiledLight::Area(light), power);
    }
}

fn is_light(material: &Material) -> bool {
    material.is_emissive() && material.illuminates
}

/// Where emissive surfaces may be, so that millions of dark instances need not be walked.
struct EmissiveGroups {
    geometries: Vec<bool>,
    groups: Vec<bool>,
}

impl EmissiveGroups {
    fn new(world: &World, surfaces: &SurfaceTable, materials: &[Material]) -> Self {
        let emits = |id: MaterialId| is_light(&materials[id.index()]);
        let handed_down = surfaces.handed_down().any(emits);
        let geometries: Vec<bool> = (0..world.geometry_count() as u32)
            .map(|g| surfaces.own_materials(g).any(emits) || (handed_down && surfaces.inherits(g)))
            .collect();
        let mut groups = vec![false; world.group_count()];
        // To the fixed point: as many rounds as groups are nested.
        let mut changed = true;
        while changed {
            changed = false;
            for group in 0..groups.len() {
                let contents = world.group(GroupId(group as u32));
                let emissive = contents.geometries.iter().any(|g| geometries[g.0 as usize])
                    || contents.instances.iter().any(|i| groups[i.child.0 as usize]);
                changed |= emissive && !groups[group];
                groups[group] |= emissive;
            }
        }
        Self { geometries, groups }
    }

    fn is_empty(&self) -> bool {
        !self.groups[0]
    }
}
