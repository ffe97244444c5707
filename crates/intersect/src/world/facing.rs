//! The side from which a ray meets a surface.

use super::double::DWorld;
use super::{Geometry, GeometryId, GroupId, World};
use crate::exact::double::plane::turning;
use crate::hit::{DHit, Hit};
use crate::precision::Double;
use crate::search::rays::{RayQuery, clamped_time};
use snell_math::{DRay, DVec3, Vec2};

/// A hit in the form in which both precisions ask about it.
struct Place {
    t: f64,
    uv: Vec2,
    instance: u32,
    geometry: GeometryId,
    primitive: usize,
    time: f32,
}

impl World {
    /// True if the ray comes from the outer side of the surface at `hit`, against its geometric
    /// normal (for a triangle: right-hand rule on its vertices). For triangles the answer is exact.
    ///
    /// # Panics
    /// If `hit` is a miss or does not belong to this world.
    pub fn is_entering<'a>(&self, ray: impl Into<RayQuery<'a>>, hit: &Hit) -> bool {
        let RayQuery { ray, time, .. } = ray.into();
        let place = Place {
            t: hit.t.into(),
            uv: hit.uv,
            instance: hit.instance,
            geometry: GeometryId(hit.geometry),
            primitive: hit.primitive as usize,
            time: clamped_time(time),
        };
        let corners = || match self.geometry(place.geometry) {
            Geometry::Mesh(mesh) => mesh.corners(place.primitive).map(|p| p.as_dvec3()),
            // Queries in single precision round the corners.
            Geometry::Heightfield(field) => {
                field.corners(place.primitive).unwrap_or_default().map(|p| p.as_vec3().as_dvec3())
            }
            _ => [DVec3::ZERO; 3],
        };
        self.against_normal(&place, &DRay::from(ray), corners) < 0.0
    }

    /// The product of direction and normal at a hit, with the right sign but of any length.
    /// `corners` has those of a triangle of a mesh or heightfield.
    fn against_normal(
        &self,
        place: &Place,
        ray: &DRay,
        corners: impl FnOnce() -> [DVec3; 3],
    ) -> f64 {
        let (mut ray, mut group, mut rest) = (*ray, GroupId(0), place.instance);
        while let Some((step, left)) = self.step(group, rest) {
            let instance = &self.group(group).instances[step];
            // Normals are mapped by the inverse transpose, so that the product stays the same.
            ray = instance.at(place.time).inverse().ray(&ray);
            (group, rest) = (instance.child, left);
        }
        match self.geometry(place.geometry) {
            Geometry::Mesh(_) | Geometry::Heightfield(_) => turning(&ray.direction, &corners()),
            Geometry::Quads(quads) => {
                let hit = Hit {
                    t: place.t as f32,
                    uv: place.uv,
                    instance: place.instance,
                    geometry: place.geometry.0,
                    primitive: place.primitive as u32,
                };
                let triangle = quads.triangle_hit(&hit).primitive as usize;
                let corners = quads.triangles().corners(triangle).map(|p| p.as_dvec3());
                turning(&ray.direction, &corners)
            }
            Geometry::MovingMesh(mesh) => {
                let corners = mesh.corners(place.primitive, place.time);
                turning(&ray.direction, &corners.map(|p| p.as_dvec3()))
            }
            Geometry::Shape(shape, placed) => {
                let ray = placed.inverse().ray(&ray);
                shape.normal(ray.at(place.t), place.primitive as u32).1.dot(ray.direction)
            }
            Geometry::Set(set) => {
                let at = ray.at(place.t);
                set.surface(place.primitive, at, place.uv, place.time).normal.dot(ray.direction)
            }
        }
    }
}

impl DWorld {
    /// True if the ray comes from the outer side of the surface at `hit`; see
    /// [`World::is_entering`].
    ///
    /// # Panics
    /// If `hit` is a miss or does not belong to this world.
    pub fn is_entering<'a>(&self, ray: impl Into<RayQuery<'a, Double>>, hit: &DHit) -> bool {
        let RayQuery { ray, time, .. } = ray.into();
        let place = Place {
            t: hit.t,
            uv: hit.uv.as_vec2(),
            instance: hit.instance,
            geometry: GeometryId(hit.geometry),
            primitive: hit.primitive as usize,
            time: clamped_time(time),
        };
        let corners = || match self.world.geometry(place.geometry) {
            Geometry::Heightfield(field) => field.corners(place.primitive).unwrap_or_default(),
            _ => *self.data.corners(hit.geometry, hit.primitive),
        };
        self.world.against_normal(&place, ray, corners) < 0.0
    }
}
