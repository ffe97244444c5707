//! Points on emissive surfaces: first with the data that rays need, then with all that materials
//! may need.

use super::near::barycentrics;
use super::{AreaLight, AreaPoint, EmissiveGeometry, PlacedTriangle, Table};
use snell_intersect::{Shape, SurfaceInteraction, TriangleMesh};
use snell_math::robust::gamma;
use snell_math::{DVec3, Vec2, Vec3, sampling};

/// A position on one part (a triangle, or the whole shape) of an emissive surface.
pub(super) enum Place {
    /// Barycentric coordinates in a triangle.
    Triangle(Vec2),
    /// A point in the coordinates of a shape.
    Shape { position: DVec3, face: u32 },
}

impl AreaLight {
    /// Samples a [`Place`] on a part, uniform by area. For a shape, the area is that in the shape's
    /// own coordinates.
    pub(super) fn place(&self, part: u32, u: Vec2) -> Option<Place> {
        match (&self.geometry, &self.table) {
            (EmissiveGeometry::Mesh { .. }, Table::Mesh { placed, .. }) => {
                placed.get(part as usize)?;
                Some(Place::Triangle(sampling::uniform_triangle(u)))
            }
            (EmissiveGeometry::Shape(shape), _) => {
                let sample = shape.sample(u.as_dvec2())?;
                Some(Place::Shape { position: sample.position, face: sample.face })
            }
            _ => None,
        }
    }

    /// The [`Place`] on a part of `p`, a point in the world that must lie on the surface within
    /// rounding. `None` if `p` is not on the shape; for a triangle this is not checked.
    pub(super) fn place_at(&self, part: u32, p: DVec3) -> Option<Place> {
        match &self.table {
            Table::Mesh { placed, .. } => {
                let flat = &placed[part as usize].flat;
                let b = barycentrics(p - flat.corner.as_dvec3(), flat.edges.map(|e| e.as_dvec3()));
                Some(Place::Triangle(b))
            }
            Table::Shape { outline, .. } => {
                let position = self.world_from_geometry.inverse().point(p);
                outline.holds(p).then_some(Place::Shape { position, face: 0 })
            }
        }
    }

    /// The point in the world, with error bound and normal, at `place` on a part. `None` if the
    /// place does not fit the geometry, or the point has no normal.
    pub(super) fn point(&self, part: u32, place: &Place) -> Option<AreaPoint> {
        match (place, &self.geometry, &self.table) {
            (Place::Triangle(b), _, Table::Mesh { placed, .. }) => {
                let flat = &placed[part as usize].flat;
                let position = flat.corner + flat.edges[0] * b.x + flat.edges[1] * b.y;
                Some(AreaPoint { position, position_error: flat.error, normal: flat.normal })
            }
            (Place::Shape { position, face }, EmissiveGeometry::Shape(shape), _) => {
                self.shape_point(&**shape, *position, *face)
            }
            _ => None,
        }
    }

    fn shape_point(&self, shape: &dyn Shape, position: DVec3, face: u32) -> Option<AreaPoint> {
        let place = &self.world_from_geometry;
        let (own, normal) = shape.normal(position, face);
        let position = place.point(own);
        // The position is rounded once to single precision. The rounding errors of double precision
        // are negligible.
        let reach = place.matrix().matrix3.abs() * own.abs() + place.matrix().translation.abs();
        Some(AreaPoint {
            position: position.as_vec3(),
            position_error: (position.abs() * f64::from(gamma(1)) + reach * 1e-14).as_vec3(),
            normal: place.normal(normal).try_normalize()?.as_vec3(),
        })
    }

    /// The full surface interaction at `place` on a part; `point` is the result of [`Self::point`].
    pub(super) fn surface(
        &self,
        part: u32,
        place: &Place,
        point: &AreaPoint,
    ) -> SurfaceInteraction {
        let &AreaPoint { position, position_error, normal } = point;
        let plain = SurfaceInteraction {
            position_error,
            instance: self.ids.0,
            geometry: self.ids.1,
            primitive: 0,
            ..SurfaceInteraction::plain(position, normal)
        };
        match (place, &self.geometry, &self.table) {
            (
                Place::Triangle(b),
                EmissiveGeometry::Mesh { mesh, triangles },
                Table::Mesh { placed, .. },
            ) => {
                self.mesh_surface(mesh, triangles[part as usize], &placed[part as usize], *b, plain)
            }
            (&Place::Shape { position, face }, EmissiveGeometry::Shape(shape), _) => {
                let (place, surface) = (&self.world_from_geometry, shape.surface(position, face));
                SurfaceInteraction {
                    uv: [surface.uv.as_vec2(); snell_intersect::UV_SETS],
                    dpdu: place.vector(surface.dpdu).as_vec3(),
                    dpdv: place.vector(surface.dpdv).as_vec3(),
                    primitive: face,
                    ..plain
                }
            }
            _ => plain,
        }
    }

    /// Samples a point of a part, uniform by area. For a shape, the area is that in the shape's own
    /// coordinates.
    pub(super) fn part_surface(&self, part: u32, u: Vec2) -> Option<SurfaceInteraction> {
        let place = self.place(part, u)?;
        Some(self.surface(part, &place, &self.point(part, &place)?))
    }

    fn mesh_surface(
        &self,
        mesh: &TriangleMesh,
        triangle: u32,
        placed: &PlacedTriangle,
        b: Vec2,
        plain: SurfaceInteraction,
    ) -> SurfaceInteraction {
        let indices = mesh.indices[triangle as usize].map(|i| i as usize);
        let weights = [1.0 - b.x - b.y, b.x, b.y];
        let uv_of = |set: usize| {
            interpolate(&mesh.uvs[set], indices, weights, |uv| *uv).unwrap_or(Vec2::ZERO)
        };
        SurfaceInteraction {
            shading_normal: self.shading_normal(mesh, indices, weights, plain.geometric_normal),
            uv: std::array::from_fn(uv_of),
            dpdu: placed.tangents[0],
            dpdv: placed.tangents[1],
            tangent: self.tangent(mesh, indices, weights),
            color: interpolate(&mesh.colors, indices, weights, |&c| snell_math::Vec4::from(c))
                .map_or([1.0; 4], |c| c.to_array()),
            primitive_uv: b,
            primitive: triangle,
            ..plain
        }
    }

    fn shading_normal(
        &self,
        mesh: &TriangleMesh,
        indices: [usize; 3],
        weights: [f32; 3],
        normal: Vec3,
    ) -> Vec3 {
        let Some(own) = interpolate(&mesh.normals, indices, weights, |n| n.normalize_or_zero())
        else {
            return normal;
        };
        match self.world_from_geometry.normal(own.as_dvec3()).try_normalize().map(|n| n.as_vec3()) {
            Some(n) if n.dot(normal) >= 0.0 => n,
            Some(n) => -n,
            None => normal,
        }
    }

    fn tangent(
        &self,
        mesh: &TriangleMesh,
        indices: [usize; 3],
        weights: [f32; 3],
    ) -> Option<(Vec3, f32)> {
        let own = interpolate(&mesh.tangents, indices, weights, |t| t.truncate())?;
        let tangent = self.world_from_geometry.vector(own.as_dvec3()).try_normalize()?.as_vec3();
        let sign = mesh.tangents[indices[0]].w;
        Some((tangent, if self.world_from_geometry.is_mirrored() { -sign } else { sign }))
    }
}

/// The weighted mean of a vertex attribute; `None` if the mesh does not have it.
fn interpolate<T, V>(
    values: &[T],
    indices: [usize; 3],
    weights: [f32; 3],
    get: impl Fn(&T) -> V,
) -> Option<V>
where
    V: std::ops::Mul<f32, Output = V> + std::ops::Add<Output = V>,
{
    let [a, b, c] = indices.map(|i| values.get(i).map(&get));
    Some(a? * weights[0] + b? * weights[1] + c? * weights[2])
}
