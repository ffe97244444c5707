//! Which bodies lie within others: pbrt wants the medium on the outside of each surface, which in
//! Snell follows from the way of the light.

use super::File;
use crate::write::AROUND;
use snell_intersect::{Shape, TriangleMesh};
use snell_math::{Bounds3d, DVec3};
use snell_scene::Geometry;
use snell_scene::placed::Placed;
use std::sync::Arc;

/// Maximum number of triangles that are looked at for one scene.
const MOST_TRIANGLES: usize = 500_000_000;

/// A closed surface with something inside.
struct Body<'s> {
    /// The number of its surface.
    surface: usize,
    placed: &'s Placed<'s>,
    bounds: Bounds3d,
    triangles: Arc<TriangleMesh>,
}

impl Body<'_> {
    /// A point of the surface, in the world.
    fn point(&self) -> Option<DVec3> {
        let triangle = self.triangles.indices.first()?;
        let corner = self.triangles.positions[triangle[0] as usize].as_dvec3();
        Some(self.placed.world_from_surface.matrix().transform_point3(corner))
    }

    /// True if a point lies within: a ray from it goes through the surface an odd number of times.
    fn contains(&self, point: DVec3) -> bool {
        let inverse = self.placed.world_from_surface.inverse_matrix();
        let origin = inverse.transform_point3(point);
        // No edge of a made object is likely to lie along this direction.
        let direction = DVec3::new(0.434_591, 0.738_207, 0.516_113);
        let crossings = self.triangles.indices.iter().filter(|triangle| {
            let [a, b, c] =
                triangle.map(|i| self.triangles.positions[i as usize].as_dvec3() - origin);
            let volume = |p: DVec3, q: DVec3| direction.dot(p.cross(q));
            let (u, v, w) = (volume(b, c), volume(c, a), volume(a, b));
            let is_crossed = (u > 0.0) == (v > 0.0) && (v > 0.0) == (w > 0.0);
            let normal = (b - a).cross(c - a);
            is_crossed && a.dot(normal) * direction.dot(normal) > 0.0
        });
        crossings.count() % 2 == 1
    }
}

impl File<'_, '_> {
    /// The name of the medium outside of each surface that lies within another; `None` for other
    /// surfaces. The name may be empty.
    pub(super) fn exteriors(&mut self, surfaces: &[Placed]) -> Vec<Option<String>> {
        let mut exteriors = vec![None; surfaces.len()];
        let is_body = |surface: &&Placed| {
            let slots = surface.slots();
            let material = |id: snell_scene::MaterialId| self.scene.materials.get(id.index());
            let interior = |(_, id): &(u16, Option<_>)| material((*id)?)?.bounded_interior();
            !slots.is_empty() && slots.iter().all(|slot| interior(slot).is_some())
        };
        let bodies = surfaces.iter().enumerate().filter(|(_, surface)| is_body(surface));
        let bodies: Vec<_> = bodies
            .filter_map(|(surface, placed)| {
                let triangles = match &placed.surface.geometry {
                    Geometry::Mesh(mesh) => mesh.clone(),
                    Geometry::Shape(shape) => Arc::new(shape.tessellate(AROUND)?),
                    Geometry::Curves(_) => return None,
                };
                let bounds = placed.world_from_surface.bounds(&placed.surface.geometry.bounds());
                Some(Body { surface, placed, bounds, triangles })
            })
            .collect();
        let mut seen = 0;
        for inner in &bodies {
            let Some(point) = inner.point() else { continue };
            let mut around: Option<&Body> = None;
            for outer in bodies.iter().filter(|outer| outer.surface != inner.surface) {
                let (low, high) = (inner.bounds.min, inner.bounds.max);
                if !(outer.bounds.contains(low) && outer.bounds.contains(high)) {
                    continue;
                }
                let extent = |body: &Body| body.bounds.size().length();
                if around.is_some_and(|known| extent(known) <= extent(outer)) {
                    continue;
                }
                seen += outer.triangles.indices.len();
                if seen > MOST_TRIANGLES {
                    self.output.lose(
                        "there are too many bodies within others to find the medium around each",
                    );
                    return exteriors;
                }
                if outer.contains(point) {
                    around = Some(outer);
                }
            }
            if let Some(outer) = around {
                let (_, id) = outer.placed.slots()[0];
                let [inside, _] = self.material(id).interface.unwrap_or_default();
                exteriors[inner.surface] = Some(inside);
            }
        }
        exteriors
    }
}
