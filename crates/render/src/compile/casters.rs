//! The surfaces of a scene that cast caustics ([`Material::is_caster`]), and the spheres around
//! them at which lights aim photons.

use super::{CompiledScene, index};
use crate::compile::surfaces::SurfaceTable;
use snell_intersect::{Geometry, GeometryId, GroupId, Hit, Instance, World};
use snell_math::{Bounds3d, Transform, Vec3};
use snell_scene::{Material, MaterialId};
use std::collections::HashMap;

/// The largest number of targets. Where there are more surfaces, neighbours share one.
const MOST_TARGETS: usize = 32;
/// The largest number of surfaces that are listed. Where there are more, as in crowds of instances,
/// the whole scene is one target.
const MOST_SURFACES: usize = 1 << 16;

/// The surfaces that cast caustics.
#[derive(Debug, Default)]
pub struct Casters {
    /// By material: whether it casts caustics.
    of_material: Vec<bool>,
    /// The spheres at which photons are aimed.
    pub targets: Vec<Target>,
    /// The target of each surface, by instance and geometry; `None` if there is only one target.
    owners: Option<HashMap<(u32, u32), u32>>,
    /// True if some caster disperses light.
    pub disperses: bool,
}

/// A sphere around casters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Its centre.
    pub center: Vec3,
    /// Its radius.
    pub radius: f32,
}

/// A surface that casts caustics.
struct Found {
    ids: (u32, u32),
    bounds: Bounds3d,
    /// The radius of a sphere around the middle of the bounds that holds the surface.
    radius: f64,
}

impl Casters {
    /// Finds the casters of a scene. There are no targets if it has none.
    pub fn new(scene: &CompiledScene) -> Self {
        let of_material: Vec<bool> = scene.materials.iter().map(Material::is_caster).collect();
        let none = Self { of_material, ..Self::default() };
        if !none.of_material.contains(&true) {
            return none;
        }
        let (world, surfaces) = (&*scene.world, &*scene.surfaces);
        let mut search = Search::new(world, surfaces, &none.of_material);
        search.add_group(GroupId(0), 0, &[Transform::IDENTITY]);
        let Search { mut found, is_whole, .. } = search;
        let whole = Target { center: scene.center, radius: scene.radius };
        let disperses = scene.materials.iter().any(|m| m.is_caster() && m.is_dispersive());
        if !is_whole {
            return Self { targets: vec![whole], owners: None, disperses, ..none };
        }
        let (mut targets, mut owners) = (Vec::new(), HashMap::new());
        let mut parts: Vec<&mut [Found]> = Vec::new();
        if !found.is_empty() {
            parts.push(&mut found);
        }
        // The part with the most surfaces is halved, until there are enough.
        while parts.len() < MOST_TARGETS
            && let Some(largest) = (0..parts.len()).max_by_key(|&i| (parts[i].len(), !i))
            && parts[largest].len() > 1
        {
            let part = parts.swap_remove(largest);
            let all = Bounds3d::of(part.iter().map(|found| found.bounds.center()));
            let size = all.size();
            let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
            part.sort_by(|a, b| {
                a.bounds.center()[axis].total_cmp(&b.bounds.center()[axis]).then(a.ids.cmp(&b.ids))
            });
            let (low, high) = part.split_at_mut(part.len() / 2);
            parts.extend([low, high]);
        }
        for part in parts {
            let bounds = part.iter().fold(Bounds3d::EMPTY, |all, found| all.union(&found.bounds));
            let center = bounds.center();
            let reach = |found: &Found| found.bounds.center().distance(center) + found.radius;
            let radius = part.iter().map(reach).fold(0.0, f64::max).min(bounds.radius());
            for found in part.iter() {
                owners.insert(found.ids, targets.len() as u32);
            }
            // What is infinite is as large as the finite part of the scene.
            let is_finite = center.is_finite() && radius.is_finite();
            let radius = radius as f32 * 1.0001 + 1e-6 * center.length() as f32;
            let own = Target { center: center.as_vec3(), radius };
            targets.push(if is_finite { own } else { whole });
        }
        Self { targets, owners: Some(owners), disperses, ..none }
    }

    /// True if the scene has casters.
    pub fn exist(&self) -> bool {
        !self.targets.is_empty()
    }

    /// True if the material casts caustics.
    #[inline]
    pub fn is_caster(&self, material: MaterialId) -> bool {
        self.of_material[material.index()]
    }

    /// The number of the target that holds the surface of a hit; `None` if none does.
    pub fn owner(&self, hit: &Hit) -> Option<u32> {
        match &self.owners {
            Some(owners) => owners.get(&(hit.instance, hit.geometry)).copied(),
            None => Some(0),
        }
    }
}

/// The walk over the world that finds casters.
struct Search<'a> {
    world: &'a World,
    surfaces: &'a SurfaceTable,
    of_material: &'a [bool],
    /// By geometry: whether some part of it may be a caster.
    geometries: Vec<bool>,
    /// By group: whether it may hold a caster.
    groups: Vec<bool>,
    found: Vec<Found>,
    /// False if there are more casters than are listed.
    is_whole: bool,
}

impl<'a> Search<'a> {
    fn new(world: &'a World, surfaces: &'a SurfaceTable, of_material: &'a [bool]) -> Self {
        let casts = |id: MaterialId| of_material[id.index()];
        let handed_down = surfaces.handed_down().any(casts);
        let may_cast =
            |g: u32| surfaces.own_materials(g).any(casts) || (handed_down && surfaces.inherits(g));
        let geometries: Vec<bool> = (0..world.geometry_count() as u32).map(may_cast).collect();
        let mut groups = vec![false; world.group_count()];
        // Iterated until nothing changes: one round per level of nesting.
        let mut changed = true;
        while changed {
            changed = false;
            for group in 0..groups.len() {
                let contents = world.group(GroupId(group as u32));
                let casts = contents.geometries.iter().any(|&g| geometries[index(g)])
                    || contents.instances.iter().any(|i| groups[i.child.0 as usize]);
                changed |= casts && !groups[group];
                groups[group] |= casts;
            }
        }
        let (found, is_whole) = (Vec::new(), true);
        Self { world, surfaces, of_material, geometries, groups, found, is_whole }
    }

    /// Adds the casters of an occurrence of a group. `places` are its maps to the world at all keys
    /// of motion.
    fn add_group(&mut self, group: GroupId, instance: u32, places: &[Transform]) {
        let (world, contents) = (self.world, self.world.group(group));
        for &id in &contents.geometries {
            if self.geometries[index(id)] {
                self.add_geometry(group, id, instance, places);
            }
        }
        let mut next = instance + 1;
        for child in &contents.instances {
            if self.found.len() > MOST_SURFACES {
                self.is_whole = false;
                return;
            }
            if self.groups[child.child.0 as usize] {
                self.add_group(child.child, next, &within(places, child));
            }
            next += world.occurrences_below(child.child);
        }
    }

    fn add_geometry(
        &mut self,
        group: GroupId,
        id: GeometryId,
        instance: u32,
        places: &[Transform],
    ) {
        let casts = |primitive: u32| {
            let material = self.surfaces.material(self.world, instance, id.0, primitive);
            self.of_material[material.index()]
        };
        let mut is_ball = false;
        let own = match self.world.geometry(id) {
            Geometry::Mesh(mesh) if mesh.material_slots.is_empty() => {
                let bounds = mesh.bounds();
                let [min, max] = [bounds.min, bounds.max].map(Vec3::as_dvec3);
                if casts(0) { Bounds3d { min, max } } else { Bounds3d::EMPTY }
            }
            Geometry::Mesh(mesh) => {
                let triangles = (0..mesh.indices.len()).filter(|&t| casts(t as u32));
                let corners = triangles.flat_map(|t| mesh.corners(t));
                Bounds3d::of(corners.map(|p| p.as_dvec3()).filter(|p| p.is_finite()))
            }
            Geometry::Shape(shape, placed) if casts(0) => {
                is_ball = shape.as_sphere().is_some();
                placed.bounds(&shape.bounds())
            }
            _ if casts(0) => self.world.group_bounds(group),
            _ => Bounds3d::EMPTY,
        };
        if own.is_empty() {
            return;
        }
        let images = places.iter().map(|place| place.bounds(&own));
        let bounds = images.fold(Bounds3d::EMPTY, |all, image| all.union(&image));
        // The largest half-side is the radius of a ball that does not move.
        let radius = match is_ball && places.len() == 1 {
            true => bounds.size().max_element() * 0.5,
            false => bounds.radius(),
        };
        self.found.push(Found { ids: (instance, id.0), bounds, radius });
    }
}

/// The maps to the world of an instance, given those of the group that holds it. Between keys,
/// points move on straight lines.
fn within(places: &[Transform], child: &Instance) -> Vec<Transform> {
    let keys = || std::iter::once(&child.group_from_child).chain(&child.later);
    // Of nested motions, more keys than these would add little to the bounds.
    const MOST: usize = 64;
    places.iter().flat_map(|place| keys().map(|key| place.compose(key))).take(MOST).collect()
}

impl Target {
    /// 1 less the cosine of the half-angle under which the sphere is seen from a point; `None` from
    /// inside and from very near.
    pub fn cap_seen_from(&self, point: Vec3) -> Option<f32> {
        let distance_squared = f64::from(point.distance_squared(self.center));
        let radius_squared = f64::from(self.radius) * f64::from(self.radius);
        let sin_squared = radius_squared / distance_squared;
        (distance_squared > 1.001 * radius_squared)
            .then(|| (sin_squared / (1.0 + (1.0 - sin_squared).sqrt())) as f32)
    }

    /// The fraction of all directions from a point in which the sphere is seen.
    pub fn share_seen_from(&self, point: Vec3) -> f32 {
        self.cap_seen_from(point).map_or(1.0, |cap| 0.5 * cap)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::BuildOptions;
    use snell_math::DVec3;
    use snell_scene::builtin::builtin;

    fn casters(name: &str) -> Casters {
        let scene = builtin(name).expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        Casters::new(&compiled)
    }

    /// The middle of all targets.
    fn middle(targets: &[Target]) -> DVec3 {
        targets.iter().map(|t| t.center.as_dvec3()).sum::<DVec3>() / targets.len() as f64
    }

    #[test]
    fn balls_of_glass_and_metal_are_targets_of_their_size() {
        let found = casters("caustic");
        assert_eq!(found.targets.len(), 2);
        let mut radii: Vec<f32> = found.targets.iter().map(|target| target.radius).collect();
        radii.sort_by(f32::total_cmp);
        assert!((radii[0] - 0.5).abs() < 1e-3 && (radii[1] - 1.0).abs() < 1e-3, "{radii:?}");
        assert!(middle(&found.targets).distance(DVec3::new(0.7, 0.75, 0.45)) < 1e-3);
        assert!(found.targets[0].share_seen_from(found.targets[0].center) == 1.0);
        assert!(!casters("cornell-box").exist());
        assert!(casters("prism").disperses);
    }
}
