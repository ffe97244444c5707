//! The table of all lights: lights without a surface, emissive surfaces, emissive media, the
//! environment.

use super::surfaces::SurfaceTable;
use super::volumes::VolumeTable;
use crate::light_sampler::LightSummary;
use snell_intersect::{Geometry, GeometryId, GroupId, Instance, World};
use snell_math::spectrum::{Color, RgbSpectrum};
use snell_math::{ColorMode, Rgb, SampledSpectrum, Transform, Vec2, Vec3};
use snell_scene::light::area::{AreaLight, EmissiveGeometry, MovingAreaLight};
use snell_scene::light::environment::EnvironmentLight;
use snell_scene::light::punctual::PunctualLight;
use snell_scene::light::{LightBounds, LightSample};
use snell_scene::material::{AlphaMode, ShadingPoint};
use snell_scene::medium::Glow;
use snell_scene::{Light, Material, MaterialId, MediumId, Scene, TextureSet};
use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// Limits of the work and memory for listing emissive surfaces, in units of looking at one
/// triangle: a small file may instance an emissive mesh billions of times.
const BUDGET: u64 = 1 << 28;
const COST_OF_INSTANCE: u64 = 4096;
const COST_OF_TRIANGLE: u64 = 64;

/// One light of the table.
#[derive(Debug)]
pub enum CompiledLight {
    /// A light without a surface.
    Light(Box<BareLight>),
    /// One occurrence of an emissive surface in the scene.
    Area(Box<AreaLight>),
    /// An emissive surface that moves while the shutter is open.
    Moving(Box<MovingAreaLight>),
    /// An emissive medium.
    Medium(MediumId, Box<Glow>),
    /// The environment.
    Environment,
}

/// A light without a surface, with precomputed data.
#[derive(Debug)]
pub struct BareLight {
    /// The light as the scene holds it.
    pub light: Light,
    /// The light in the form for batches, if it is punctual.
    pub punctual: Option<PunctualLight>,
    /// The light's colour as a spectrum, computed at first use.
    spectrum: OnceLock<LightSpectrum>,
}

impl BareLight {
    fn new(light: Light) -> Self {
        let punctual = light.punctual();
        Self { light, punctual, spectrum: OnceLock::new() }
    }

    /// Samples the light; see [`Light::sample`].
    pub fn sample(&self, p: Vec3, u: Vec2, mode: ColorMode) -> Option<LightSample> {
        match &self.punctual {
            Some(light) => LightSample::of_punctual(light.sample(p), self.color_of(light, mode)),
            None => self.light.sample(p, u, mode),
        }
    }

    /// The colour of the punctual light as a spectrum.
    pub fn spectrum(&self, light: &PunctualLight) -> LightSpectrum {
        *self.spectrum.get_or_init(|| LightSpectrum::new(light.color.into()))
    }

    fn color_of(&self, light: &PunctualLight, mode: ColorMode) -> SampledSpectrum {
        if mode == ColorMode::Rgb {
            mode.illuminant(light.color)
        } else {
            self.spectrum(light).at(mode)
        }
    }
}

/// The emission of an opaque surface with uniform emission.
#[derive(Clone, Debug)]
pub struct PlainEmission {
    /// The material of the surface.
    pub material: MaterialId,
    /// The emitted radiance.
    pub radiance: Color,
    /// The emitted radiance in RGB mode.
    pub rgb: SampledSpectrum,
    /// The emitted radiance as a spectrum, computed at first use.
    spectrum: OnceLock<LightSpectrum>,
    /// True if the surface emits on both sides.
    pub on_both_sides: bool,
}

impl PlainEmission {
    fn of(materials: &[Material], ids: impl Iterator<Item = MaterialId>) -> Option<Self> {
        let mut ids = ids;
        let id = ids.next()?;
        let material = &materials[id.index()];
        let radiance = material.uniform_emission().filter(|_| ids.all(|other| other == id))?;
        let rgb = ColorMode::Rgb.illuminant(radiance);
        let on_both_sides = material.emits_on_both_sides;
        Some(Self { material: id, radiance, rgb, spectrum: OnceLock::new(), on_both_sides })
    }

    /// The emitted radiance as a spectrum.
    pub fn spectrum(&self) -> LightSpectrum {
        *self.spectrum.get_or_init(|| LightSpectrum::new(self.radiance))
    }

    /// The lanes of the emitted radiance in this mode.
    pub fn radiance_in(&self, mode: ColorMode) -> SampledSpectrum {
        if mode == ColorMode::Rgb { self.rgb } else { self.spectrum().at(mode) }
    }
}

/// The colour of a light, prepared for [`Self::at`]: the values are those of
/// [`ColorMode::illuminant`].
#[derive(Clone, Copy, Debug)]
pub enum LightSpectrum {
    /// A colour of red, green and blue.
    Rgb(RgbSpectrum),
    /// A colour with a spectrum of its own.
    Given(Color),
}

impl Default for LightSpectrum {
    fn default() -> Self {
        Self::Given(Rgb::BLACK.into())
    }
}

impl LightSpectrum {
    fn new(color: Color) -> Self {
        match color.spectrum {
            None => Self::Rgb(RgbSpectrum::of_light(color.rgb)),
            Some(_) => Self::Given(color),
        }
    }

    /// The lanes of the colour in this mode.
    pub fn at(&self, mode: ColorMode) -> SampledSpectrum {
        match (self, mode) {
            (Self::Rgb(spectrum), ColorMode::Spectral(wavelengths)) => {
                ColorMode::light_at(&wavelengths, spectrum)
            }
            (Self::Rgb(_), ColorMode::Rgb) => SampledSpectrum::ZERO,
            (Self::Given(color), mode) => mode.illuminant(*color),
        }
    }
}

/// The lights of a scene.
#[derive(Debug, Default)]
pub struct LightTable {
    pub lights: Vec<CompiledLight>,
    /// Approximate power of each light in W.
    pub powers: Vec<f64>,
    /// The position of the environment among the lights.
    pub environment: Option<usize>,
    by_surface: HashMap<(u32, u32), usize>,
    /// The lights that are media, with their positions.
    media: Vec<(MediumId, usize)>,
    /// Whether each light emits on both sides.
    two_sided: Vec<bool>,
    /// The emission of each light that is a surface with uniform emission.
    plain: Vec<Option<PlainEmission>>,
    /// The power of the environment's constant part, as a fraction of the power of all lights.
    even_share: f64,
    spent: u64,
    /// True if curves emit light. Curves are not sampled.
    has_glowing_curves: bool,
}

impl LightTable {
    pub fn new(
        scene: &Scene,
        world: &World,
        surfaces: &SurfaceTable,
        materials: &[Material],
        textures: &TextureSet,
        environment: Option<&EnvironmentLight>,
        volumes: Option<&VolumeTable>,
        scene_radius: f64,
    ) -> Self {
        let mut table = Self::default();
        let radius = if scene_radius > 0.0 { scene_radius } else { 1.0 };
        for light in &scene.lights {
            table.push(
                CompiledLight::Light(Box::new(BareLight::new(light.clone()))),
                light.power(radius),
            );
        }
        let emissive = EmissiveGroups::new(world, surfaces, materials);
        if !emissive.is_empty() {
            let parts = Parts { world, surfaces, materials, textures, emissive: &emissive };
            table.add_surfaces(&parts, GroupId(0), 0, &Place::default());
        }
        for (medium, glow) in volumes.iter().flat_map(|v| v.glows()) {
            table.media.push((medium, table.lights.len()));
            let power = 4.0 * PI * glow.intensity();
            table.push(CompiledLight::Medium(medium, Box::new(glow)), power);
        }
        if let Some(environment) = environment {
            table.environment = Some(table.lights.len());
            // The power is that through a disk of the scene's size from every direction (pbrt,
            // section 12.5).
            table.push(
                CompiledLight::Environment,
                4.0 * PI * PI * radius * radius * environment.mean_luminance(),
            );
            let total: f64 = table.powers.iter().sum();
            let even = table.powers[table.powers.len() - 1] * (1.0 - environment.excess());
            table.even_share = if total > 0.0 { even / total } else { 0.0 };
        }
        table
    }

    /// True if most light comes uniformly from all directions.
    pub fn is_even(&self) -> bool {
        self.even_share > 0.5
    }

    /// False if the scene has more emissive surfaces than the table lists. The rest emit light too,
    /// but only rays that hit them by chance find it.
    pub fn is_complete(&self) -> bool {
        self.spent <= BUDGET
    }

    /// True if some curves emit light. Only rays that hit them by chance find it.
    pub fn has_glowing_curves(&self) -> bool {
        self.has_glowing_curves
    }

    /// The lights as input of light samplers, without the light `left_out`. `with_parts` adds the
    /// bounds of all parts.
    pub fn summaries(&self, with_parts: bool, left_out: Option<usize>) -> Vec<LightSummary> {
        let parts = |i: usize| match &self.lights[i] {
            CompiledLight::Light(bare) => bare.light.bounds().into_iter().collect(),
            CompiledLight::Area(area) => (0..area.part_count())
                .map(|part| area.part_bounds(part, self.two_sided[i]))
                .collect(),
            CompiledLight::Moving(light) => (0..light.first.part_count())
                .map(|part| light.part_bounds(part, self.two_sided[i]))
                .collect(),
            CompiledLight::Medium(_, glow) => vec![LightBounds {
                bounds: glow.bounds(),
                axis: Vec3::Z,
                cos_spread: -1.0,
                cos_emission: 0.0,
                is_two_sided: false,
                intensity: glow.intensity(),
            }],
            CompiledLight::Environment => Vec::new(),
        };
        let summary = |i: usize| LightSummary {
            power: self.powers[i],
            parts: if with_parts { parts(i) } else { Vec::new() },
            is_sampled: left_out != Some(i),
        };
        (0..self.lights.len()).map(summary).collect()
    }

    fn push(&mut self, light: CompiledLight, power: f64) {
        self.lights.push(light);
        self.two_sided.push(false);
        self.plain.push(None);
        self.powers.push(if power.is_finite() && power > 0.0 { power } else { 0.0 });
    }

    pub fn of_surface(&self, instance: u32, geometry: u32) -> Option<usize> {
        self.by_surface.get(&(instance, geometry)).copied()
    }

    pub fn plain(&self, light: usize) -> Option<&PlainEmission> {
        self.plain[light].as_ref()
    }

    pub fn of_medium(&self, medium: MediumId) -> Option<usize> {
        self.media.iter().find(|(id, _)| *id == medium).map(|(_, light)| *light)
    }

    fn add_surfaces(&mut self, parts: &Parts, group: GroupId, instance: u32, place: &Place) {
        let contents = parts.world.group(group);
        self.spent += COST_OF_INSTANCE;
        for &id in &contents.geometries {
            if parts.emissive.geometries[id.0 as usize] && self.is_complete() {
                self.add_surface(parts, id, instance, place);
            }
        }
        let mut next = instance + 1;
        for child in &contents.instances {
            if !self.is_complete() {
                return;
            }
            if parts.emissive.groups[child.child.0 as usize] {
                self.add_surfaces(parts, child.child, next, &place.within(child));
            }
            next += parts.world.occurrences_below(child.child);
        }
    }

    fn add_surface(&mut self, parts: &Parts, id: GeometryId, instance: u32, place: &Place) {
        let world_from_group = &place.world_from_group;
        let material_id = |primitive| parts.material_id(instance, id, primitive);
        let material = |primitive| &parts.materials[material_id(primitive).index()];
        let mut group_from_geometry = Transform::IDENTITY;
        let (geometry, emitting, plain) = match parts.world.geometry(id) {
            Geometry::Mesh(mesh) => {
                let emits = |t: &u32| is_light(material(*t));
                let triangles: Vec<u32> = (0..mesh.indices.len() as u32).filter(emits).collect();
                self.spent += mesh.indices.len() as u64 + COST_OF_TRIANGLE * triangles.len() as u64;
                let emitting = Emitting::of(triangles.iter().map(|&t| material(t)));
                let plain =
                    PlainEmission::of(parts.materials, triangles.iter().map(|&t| material_id(t)));
                (EmissiveGeometry::Mesh { mesh: mesh.clone(), triangles }, emitting, plain)
            }
            Geometry::Shape(shape, group_from_shape) => {
                let emitting = Emitting::of(Some(material(0)).filter(|m| is_light(m)).into_iter());
                group_from_geometry = *group_from_shape;
                let plain = PlainEmission::of(parts.materials, std::iter::once(material_id(0)));
                (EmissiveGeometry::Shape(shape.clone()), emitting, plain)
            }
            Geometry::Set(_) => {
                self.has_glowing_curves |= is_light(material(0));
                return;
            }
            // Quads, heightfields, and meshes that deform while the shutter is open, emit when they
            // are hit, but are not sampled.
            Geometry::Quads(_) | Geometry::MovingMesh(_) | Geometry::Heightfield(_) => return,
        };
        if !emitting.any {
            return;
        }
        let placed = world_from_group.compose(&group_from_geometry);
        let Some(light) = AreaLight::new(geometry, placed, (instance, id.0)) else { return };
        let points = match (emitting.varies, light.part_count()) {
            (false, _) => 1,
            (true, 257..) => 2,
            (true, 9..) => 16,
            (true, _) => 64,
        };
        let light = light.measured(points, |surface, width| {
            let point = ShadingPoint {
                surface,
                footprint: width,
                textures: parts.textures,
                mode: ColorMode::Rgb,
                outside_ior: 1.0,
            };
            let material = material(surface.primitive);
            let emitted = material.emitted(&point, surface.geometric_normal);
            ColorMode::Rgb.to_rgb(emitted).luminance() * material.opacity(&point)
        });
        let sides = if emitting.both_sides { 2.0 } else { 1.0 };
        let power = light.area() * PI * sides * light.mean_radiance();
        let number = self.lights.len();
        self.by_surface.insert((instance, id.0), number);
        let compiled = match place.is_moving() {
            true => {
                let carriers = place.carriers.clone();
                CompiledLight::Moving(Box::new(MovingAreaLight::new(
                    light,
                    carriers,
                    group_from_geometry,
                )))
            }
            false => CompiledLight::Area(Box::new(light)),
        };
        self.push(compiled, power);
        (self.two_sided[number], self.plain[number]) = (emitting.both_sides, plain);
    }
}

/// The placement of a group in the world.
#[derive(Clone, Default)]
struct Place {
    /// The placement when the shutter opens.
    world_from_group: Transform,
    /// The instances that hold the group, outermost first.
    carriers: Vec<Instance>,
}

impl Place {
    /// The placement of the group that `instance` holds.
    fn within(&self, instance: &Instance) -> Self {
        let mut carriers = self.carriers.clone();
        carriers.push(instance.clone());
        Self {
            world_from_group: self.world_from_group.compose(&instance.group_from_child),
            carriers,
        }
    }

    fn is_moving(&self) -> bool {
        self.carriers.iter().any(|instance| !instance.later.is_empty())
    }
}

/// The traversal of the world that finds emissive surfaces.
struct Parts<'a> {
    world: &'a World,
    surfaces: &'a SurfaceTable,
    materials: &'a [Material],
    textures: &'a TextureSet,
    emissive: &'a EmissiveGroups,
}

impl Parts<'_> {
    fn material_id(&self, instance: u32, geometry: GeometryId, primitive: u32) -> MaterialId {
        self.surfaces.material(self.world, instance, geometry.0, primitive)
    }
}

/// Properties of the materials of an emissive surface, over all of its parts.
#[derive(Default)]
struct Emitting {
    any: bool,
    /// True if some part emits on both sides.
    both_sides: bool,
    /// True if some part has non-uniform emission.
    varies: bool,
}

impl Emitting {
    fn of<'a>(materials: impl Iterator<Item = &'a Material>) -> Self {
        materials.fold(Self::default(), |all, m| Self {
            any: true,
            both_sides: all.both_sides || m.emits_on_both_sides,
            varies: all.varies
                || m.emission.texture.is_some()
                || m.emission_takes_vertex_color
                || m.alpha_mode != AlphaMode::Opaque,
        })
    }
}

fn is_light(material: &Material) -> bool {
    material.is_emissive() && material.illuminates
}

/// Which geometries and groups hold emissive surfaces, so that millions of dark instances need not
/// be walked.
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
        // Iterated until nothing changes: one round per level of nesting.
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
