//! Emissive surfaces as lights: a part (a triangle, or a whole shape) is chosen by its power, then a point of it.

use super::LightBounds;
use snell_intersect::{Shape, SurfaceInteraction, TriangleMesh};
use snell_math::distribution::Distribution1D;
use snell_math::robust::gamma;
use snell_math::{Bounds3d, DVec2, DVec3, Frame, Transform, UVec2, Vec2, Vec3, sampling};
use std::sync::Arc;

/// The geometry of an emissive surface.
#[derive(Clone, Debug)]
pub enum EmissiveGeometry {
    /// These triangles of a mesh.
    Mesh {
        /// The mesh.
        mesh: Arc<TriangleMesh>,
        /// Which triangles emit. Numbers past the mesh's triangles are ignored.
        triangles: Vec<u32>,
    },
    /// A whole shape.
    Shape(Arc<dyn Shape>),
}

/// A point on an emissive surface.
#[derive(Clone, Debug)]
pub struct AreaSample {
    /// The point as an interaction in the world (`t` is 0 and meaningless, ids are those given to [`AreaLight::new`]).
    /// `position_error` bounds how far the surface that rays hit may be from `position`: a shadow ray has to end before.
    pub surface: SurfaceInteraction,
    /// Density per unit of world area.
    pub pdf_area: f32,
}

/// A point on an emissive surface as seen from somewhere.
#[derive(Clone, Debug)]
pub struct DirectedSample {
    /// The point, as in [`AreaSample`].
    pub surface: SurfaceInteraction,
    /// Unit direction towards it.
    pub direction: Vec3,
    /// Density per steradian of the direction.
    pub pdf: f32,
}

/// An emissive surface at one place in the world.
#[derive(Debug)]
pub struct AreaLight {
    /// What emits. Of a mesh, the triangles are ascending, each once.
    pub geometry: EmissiveGeometry,
    /// Where it is.
    pub world_from_geometry: Transform,
    /// Ids for the sampled interactions: instance and geometry.
    pub ids: (u32, u32),
    table: Table,
    area: f64,
    /// Mean luminance of each part, W / (m^2 sr); empty if all shine alike.
    radiance: Vec<f32>,
}

#[derive(Debug)]
enum Table {
    /// Choice among the triangles by area in the world, and each of them as it lies there.
    Mesh { choice: Distribution1D, placed: Vec<PlacedTriangle> },
    /// Density in the shape's own coordinates.
    Shape { pdf: f64 },
}

/// An emissive triangle in the world, ready to be sampled.
#[derive(Clone, Copy, Debug)]
struct PlacedTriangle {
    corner: Vec3,
    edges: [Vec3; 2],
    normal: Vec3,
    /// Bound of the error of each coordinate of a point.
    error: Vec3,
    /// Tangents by the first texture coordinates, or any.
    tangents: [Vec3; 2],
    /// Density per unit of area, choice included.
    pdf: f32,
}

impl PlacedTriangle {
    fn new(mesh: &TriangleMesh, triangle: u32, place: &Transform, pdf: f32) -> Self {
        let own = mesh.corners(triangle as usize).map(|p| p.as_dvec3());
        let corners = own.map(|p| place.point(p));
        let normal = place.normal((own[1] - own[0]).cross(own[2] - own[0])).normalize_or(DVec3::Z).as_vec3();
        // Corners and edges are rounded once and blended, a hit is found with a few roundings more.
        let reach = corners.into_iter().fold(DVec3::ZERO, |m, p| m.max(p.abs()));
        let indices = mesh.indices[triangle as usize].map(|i| i as usize);
        let tangents = uv_derivatives(mesh, indices, corners).unwrap_or_else(|| {
            let frame = Frame::from_z(normal);
            [frame.x, frame.y]
        });
        Self {
            corner: corners[0].as_vec3(),
            edges: [(corners[1] - corners[0]).as_vec3(), (corners[2] - corners[0]).as_vec3()],
            normal,
            error: (reach * f64::from(gamma(8))).as_vec3(),
            tangents,
            pdf,
        }
    }
}

impl PlacedTriangle {
    fn area(&self) -> f64 {
        let area = self.edges[0].as_dvec3().cross(self.edges[1].as_dvec3()).length() * 0.5;
        if area.is_finite() { area } else { 0.0 }
    }

    fn bounds(&self) -> Bounds3d {
        let corner = self.corner.as_dvec3();
        Bounds3d::of([corner, corner + self.edges[0].as_dvec3(), corner + self.edges[1].as_dvec3()])
    }
}

impl AreaLight {
    /// Prepares sampling. `None` if the surface has no finite positive area. Triangles without area are never chosen.
    pub fn new(geometry: EmissiveGeometry, world_from_geometry: Transform, ids: (u32, u32)) -> Option<Self> {
        match geometry {
            EmissiveGeometry::Mesh { mesh, triangles } => Self::new_mesh(mesh, triangles, world_from_geometry, ids),
            EmissiveGeometry::Shape(shape) => Self::new_shape(shape, world_from_geometry, ids),
        }
    }

    fn new_mesh(mesh: Arc<TriangleMesh>, mut triangles: Vec<u32>, placed: Transform, ids: (u32, u32)) -> Option<Self> {
        triangles.retain(|&t| (t as usize) < mesh.indices.len());
        triangles.sort_unstable();
        triangles.dedup();
        let area_of = |&t: &u32| {
            let [a, b, c] = mesh.corners(t as usize).map(|p| placed.point(p.as_dvec3()));
            let area = (b - a).cross(c - a).length() * 0.5;
            if area.is_finite() { area } else { 0.0 }
        };
        let areas: Vec<f64> = triangles.iter().map(area_of).collect();
        let area: f64 = areas.iter().sum();
        // Weights relative to the whole: areas may be too small or large for single precision.
        let choice = Distribution1D::new(&areas.iter().map(|a| (a / area) as f32).collect::<Vec<_>>());
        let pdf = areas.iter().enumerate().map(|(i, &a)| density(choice.probability(i), a));
        let placed_triangle = |(&t, pdf): (&u32, f32)| PlacedTriangle::new(&mesh, t, &placed, pdf);
        let placed_triangles = triangles.iter().zip(pdf).map(placed_triangle).collect();
        let table = Table::Mesh { choice, placed: placed_triangles };
        let geometry = EmissiveGeometry::Mesh { mesh, triangles };
        let usable = area > 0.0 && area.is_finite();
        usable.then_some(Self { geometry, world_from_geometry: placed, ids, table, area, radiance: Vec::new() })
    }

    fn new_shape(shape: Arc<dyn Shape>, placed: Transform, ids: (u32, u32)) -> Option<Self> {
        let own_area = shape.area();
        if !(own_area > 0.0 && own_area.is_finite()) {
            return None;
        }
        let area = own_area * mean_area_scale(&*shape, &placed)?;
        let table = Table::Shape { pdf: 1.0 / own_area };
        let geometry = EmissiveGeometry::Shape(shape);
        let usable = area > 0.0 && area.is_finite();
        usable.then_some(Self { geometry, world_from_geometry: placed, ids, table, area, radiance: Vec::new() })
    }

    /// A point with density [`AreaSample::pdf_area`] per unit of world area.
    pub fn sample(&self, u: Vec2) -> Option<AreaSample> {
        let (surface, pdf_area) = match (&self.geometry, &self.table) {
            (EmissiveGeometry::Mesh { mesh, triangles }, Table::Mesh { choice, placed }) => {
                let (i, rest) = choice.sample(u.x);
                let b = sampling::uniform_triangle(Vec2::new(rest, u.y));
                (self.mesh_surface(mesh, triangles[i], &placed[i], b), placed[i].pdf)
            }
            (EmissiveGeometry::Shape(shape), Table::Shape { pdf }) => {
                let surface = self.shape_surface(&**shape, u.as_dvec2())?;
                let pdf_area = self.shape_pdf(*pdf, surface.geometric_normal);
                (surface, pdf_area)
            }
            _ => return None,
        };
        (pdf_area > 0.0 && pdf_area.is_finite()).then_some(AreaSample { surface, pdf_area })
    }

    /// Measures how strongly each part shines, so that parts are chosen by power and not by area alone. `radiance` gives the
    /// luminance at a point of the surface, averaged over about this width; it is asked for `points^2` points of each part (1 is
    /// enough where the parts are uniform). Every part keeps some chance to be chosen.
    pub fn measured(mut self, points: u32, radiance: impl Fn(&SurfaceInteraction, f32) -> f32) -> Self {
        const DIM: f32 = 1e-3;
        let (count, points) = (self.part_count(), points.max(1));
        let mean_of = |part: u32| {
            let width = (self.part_area(part).sqrt() / f64::from(points)) as f32;
            let grid =
                (0..points * points).map(|k| (UVec2::new(k % points, k / points).as_vec2() + 0.5) / points as f32);
            let sum: f32 = grid.filter_map(|u| self.part_surface(part, u)).map(|s| finite(radiance(&s, width))).sum();
            finite(sum / (points * points) as f32)
        };
        self.radiance = (0..count).map(mean_of).collect();
        let powers: Vec<f64> = (0..count).map(|k| self.part_area(k) * f64::from(self.radiance[k as usize])).collect();
        let power: f64 = powers.iter().sum();
        let areas: Vec<f64> = (0..count).map(|k| self.part_area(k)).collect();
        if let Table::Mesh { choice, placed } = &mut self.table
            && power > 0.0
        {
            let least = f64::from(DIM) / self.area;
            let weight = |(&p, &a): (&f64, &f64)| (p / power).max(a * least) as f32;
            *choice = Distribution1D::new(&powers.iter().zip(&areas).map(weight).collect::<Vec<_>>());
            for (i, (triangle, &area)) in placed.iter_mut().zip(&areas).enumerate() {
                triangle.pdf = density(choice.probability(i), area);
            }
        }
        self
    }

    /// Mean luminance of the whole surface's emitted radiance, W / (m^2 sr); 1 before [`Self::measured`].
    pub fn mean_radiance(&self) -> f64 {
        if self.radiance.is_empty() {
            return 1.0;
        }
        let sum: f64 = (0..).zip(&self.radiance).map(|(part, &l)| self.part_area(part) * f64::from(l)).sum();
        sum / self.area
    }

    /// Where a part is, and how strongly it shines which way.
    pub fn part_bounds(&self, part: u32, is_two_sided: bool) -> LightBounds {
        let radiance = f64::from(self.radiance.get(part as usize).copied().unwrap_or(1.0));
        let (bounds, axis, cos_spread, facing_area) = match (&self.geometry, &self.table) {
            (EmissiveGeometry::Shape(shape), _) => {
                let bounds = self.world_from_geometry.bounds(&shape.bounds());
                match self.part_surface(0, Vec2::splat(0.5)) {
                    // Shapes without an inside are flat. The shadow of a convex body is a quarter of its surface on average.
                    Some(surface) if !shape.is_closed() => (bounds, surface.geometric_normal, 1.0, self.area),
                    _ => (bounds, Vec3::Z, -1.0, self.area * 0.25),
                }
            }
            (_, Table::Mesh { placed, .. }) => {
                let triangle = &placed[part as usize];
                (triangle.bounds(), triangle.normal, 1.0, triangle.area())
            }
            _ => (Bounds3d::EMPTY, Vec3::Z, -1.0, 0.0),
        };
        let intensity = radiance * facing_area;
        let intensity = if intensity > 0.0 { intensity.min(1e300) } else { 0.0 };
        LightBounds { bounds, axis, cos_spread, cos_emission: 0.0, is_two_sided, intensity }
    }

    fn part_area(&self, part: u32) -> f64 {
        match &self.table {
            Table::Mesh { placed, .. } => placed[part as usize].area(),
            Table::Shape { .. } => self.area,
        }
    }

    /// A point of a part, uniform by its area (of a shape: in its own coordinates).
    fn part_surface(&self, part: u32, u: Vec2) -> Option<SurfaceInteraction> {
        match (&self.geometry, &self.table) {
            (EmissiveGeometry::Mesh { mesh, triangles }, Table::Mesh { placed, .. }) => {
                let (triangle, placed) = (*triangles.get(part as usize)?, placed.get(part as usize)?);
                Some(self.mesh_surface(mesh, triangle, placed, sampling::uniform_triangle(u)))
            }
            (EmissiveGeometry::Shape(shape), _) => self.shape_surface(&**shape, u.as_dvec2()),
            _ => None,
        }
    }

    /// How many parts can be chosen apart from each other: emissive triangles, or 1 for a shape.
    pub fn part_count(&self) -> u32 {
        match &self.table {
            Table::Mesh { placed, .. } => placed.len() as u32,
            Table::Shape { .. } => 1,
        }
    }

    /// A part chosen by its power, its probability, and a uniform number that is left of `u`.
    pub fn choose_part(&self, u: f32) -> (u32, f32, f32) {
        match &self.table {
            Table::Mesh { choice, .. } => {
                let (part, rest) = choice.sample(u);
                (part as u32, choice.probability(part), rest)
            }
            Table::Shape { .. } => (0, 1.0, u),
        }
    }

    /// The probability with which [`Self::choose_part`] gives a part.
    pub fn part_probability(&self, part: u32) -> f32 {
        match &self.table {
            Table::Mesh { choice, .. } if (part as usize) < choice.len() => choice.probability(part as usize),
            Table::Mesh { .. } => 0.0,
            Table::Shape { .. } => 1.0,
        }
    }

    /// The part that a primitive of the geometry is; `None` if it does not emit.
    pub fn part_of(&self, primitive: u32) -> Option<u32> {
        let EmissiveGeometry::Mesh { triangles, .. } = &self.geometry else { return Some(0) };
        // If all triangles emit, their numbers are their positions.
        if triangles.get(primitive as usize) == Some(&primitive) {
            return Some(primitive);
        }
        triangles.binary_search(&primitive).ok().map(|part| part as u32)
    }

    /// A point of a part as seen from `from`. `None` where the part cannot be seen or sampled.
    pub fn sample_from(&self, part: u32, from: Vec3, u: Vec2) -> Option<DirectedSample> {
        let surface = self.part_surface(part, u)?;
        let to_light = surface.position - from;
        let direction = to_light.try_normalize()?;
        let pdf = self.pdf_from(part, from, &surface, direction, to_light.length_squared());
        (pdf > 0.0 && pdf.is_finite()).then_some(DirectedSample { surface, direction, pdf })
    }

    /// Density per steradian with which [`Self::sample_from`] gives `direction`, in which `surface` was met on this part.
    pub fn pdf_from(
        &self,
        part: u32,
        _from: Vec3,
        surface: &SurfaceInteraction,
        direction: Vec3,
        distance_squared: f32,
    ) -> f32 {
        let pdf_area = match &self.table {
            Table::Mesh { placed, .. } => density(1.0, placed[part as usize].area()),
            Table::Shape { pdf } => self.shape_pdf(*pdf, surface.geometric_normal),
        };
        let pdf = pdf_area * distance_squared / direction.dot(surface.geometric_normal).abs();
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// Density per unit of world area with which [`Self::sample`] gives the point of this interaction on this light. 0 for
    /// triangles that do not emit. Only the triangle or the normal is looked at, not the position.
    pub fn pdf_area(&self, surface: &SurfaceInteraction) -> f32 {
        match &self.table {
            Table::Mesh { placed, .. } => self.part_of(surface.primitive).map_or(0.0, |part| placed[part as usize].pdf),
            Table::Shape { pdf } => self.shape_pdf(*pdf, surface.geometric_normal),
        }
    }

    /// Area in the world. For shapes under transforms that stretch, an estimate good to about a percent.
    pub fn area(&self) -> f64 {
        self.area
    }

    fn shape_pdf(&self, own_pdf: f64, world_normal: Vec3) -> f32 {
        let n = self.world_from_geometry.matrix().matrix3.transpose() * world_normal.as_dvec3();
        let pdf = own_pdf / self.world_from_geometry.area_scale(n.normalize_or_zero());
        if pdf.is_finite() { pdf.min(f64::from(f32::MAX)) as f32 } else { 0.0 }
    }

    fn shape_surface(&self, shape: &dyn Shape, u: DVec2) -> Option<SurfaceInteraction> {
        let place = &self.world_from_geometry;
        let sample = shape.sample(u)?;
        let surface = shape.surface(sample.position, sample.face);
        let position = place.point(surface.position);
        // The position is rounded once; the rounding of double precision is far below.
        let reach = place.matrix().matrix3.abs() * surface.position.abs() + place.matrix().translation.abs();
        let error = (position.abs() * f64::from(gamma(1)) + reach * 1e-14).as_vec3();
        let normal = place.normal(surface.normal).try_normalize()?.as_vec3();
        Some(SurfaceInteraction {
            position: position.as_vec3(),
            position_error: error,
            geometric_normal: normal,
            shading_normal: normal,
            uv: [surface.uv.as_vec2(); 2],
            dpdu: place.vector(surface.dpdu).as_vec3(),
            dpdv: place.vector(surface.dpdv).as_vec3(),
            tangent: None,
            color: [1.0; 4],
            t: 0.0,
            primitive_uv: Vec2::ZERO,
            instance: self.ids.0,
            geometry: self.ids.1,
            primitive: sample.face,
        })
    }

    fn mesh_surface(&self, mesh: &TriangleMesh, triangle: u32, placed: &PlacedTriangle, b: Vec2) -> SurfaceInteraction {
        let indices = mesh.indices[triangle as usize].map(|i| i as usize);
        let weights = [1.0 - b.x - b.y, b.x, b.y];
        let uv_of = |set: usize| interpolate(&mesh.uvs[set], indices, weights, |uv| *uv).unwrap_or(Vec2::ZERO);
        SurfaceInteraction {
            position: placed.corner + placed.edges[0] * b.x + placed.edges[1] * b.y,
            position_error: placed.error,
            geometric_normal: placed.normal,
            shading_normal: self.shading_normal(mesh, indices, weights, placed.normal),
            uv: [uv_of(0), uv_of(1)],
            dpdu: placed.tangents[0],
            dpdv: placed.tangents[1],
            tangent: self.tangent(mesh, indices, weights),
            color: interpolate(&mesh.colors, indices, weights, |&c| snell_math::Vec4::from(c))
                .map_or([1.0; 4], |c| c.to_array()),
            t: 0.0,
            primitive_uv: b,
            instance: self.ids.0,
            geometry: self.ids.1,
            primitive: triangle,
        }
    }

    fn shading_normal(&self, mesh: &TriangleMesh, indices: [usize; 3], weights: [f32; 3], normal: Vec3) -> Vec3 {
        let Some(own) = interpolate(&mesh.normals, indices, weights, |n| n.normalize_or_zero()) else { return normal };
        match self.world_from_geometry.normal(own.as_dvec3()).try_normalize().map(|n| n.as_vec3()) {
            Some(n) if n.dot(normal) >= 0.0 => n,
            Some(n) => -n,
            None => normal,
        }
    }

    fn tangent(&self, mesh: &TriangleMesh, indices: [usize; 3], weights: [f32; 3]) -> Option<(Vec3, f32)> {
        let own = interpolate(&mesh.tangents, indices, weights, |t| t.truncate())?;
        let tangent = self.world_from_geometry.vector(own.as_dvec3()).try_normalize()?.as_vec3();
        let sign = mesh.tangents[indices[0]].w;
        Some((tangent, if self.world_from_geometry.is_mirrored() { -sign } else { sign }))
    }
}

/// Density per unit of area; 0 for triangles without area.
fn density(probability: f32, area: f64) -> f32 {
    if area > 0.0 { (f64::from(probability) / area).min(f64::from(f32::MAX)) as f32 } else { 0.0 }
}

fn finite(x: f32) -> f32 {
    if x > 0.0 { x.min(1e30) } else { 0.0 }
}

/// The mean factor by which the transform stretches the shape's area: exact for similarities and flat shapes.
fn mean_area_scale(shape: &dyn Shape, placed: &Transform) -> Option<f64> {
    const N: u32 = 32;
    let mut sum = 0.0;
    for i in 0..N {
        for j in 0..N {
            let u = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) / f64::from(N);
            sum += placed.area_scale(shape.sample(u)?.normal);
        }
    }
    Some(sum / f64::from(N * N))
}

/// The weighted mean of a vertex attribute; `None` if the mesh does not have it.
fn interpolate<T, V>(values: &[T], indices: [usize; 3], weights: [f32; 3], get: impl Fn(&T) -> V) -> Option<V>
where
    V: std::ops::Mul<f32, Output = V> + std::ops::Add<Output = V>,
{
    let [a, b, c] = indices.map(|i| values.get(i).map(&get));
    Some(a? * weights[0] + b? * weights[1] + c? * weights[2])
}

/// Derivatives of the position by the first texture coordinates; `None` if there are none or they are degenerate.
fn uv_derivatives(mesh: &TriangleMesh, indices: [usize; 3], [p0, p1, p2]: [DVec3; 3]) -> Option<[Vec3; 2]> {
    if mesh.uvs[0].is_empty() {
        return None;
    }
    let [a, b, c] = indices.map(|i| mesh.uvs[0][i].as_dvec2());
    let (d1, d2) = (b - a, c - a);
    let determinant = d1.perp_dot(d2);
    let (e1, e2) = (p1 - p0, p2 - p0);
    let dpdu = ((e1 * d2.y - e2 * d1.y) / determinant).as_vec3();
    let dpdv = ((e2 * d1.x - e1 * d2.x) / determinant).as_vec3();
    let usable = |v: Vec3| v.is_finite() && v != Vec3::ZERO;
    (usable(dpdu) && usable(dpdv)).then_some([dpdu, dpdv])
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::AnyShape;
    use snell_intersect::shape::Sphere;
    use snell_math::rng::uniform2;
    use snell_math::{DAffine3, DMat3};
    use std::f64::consts::PI;

    /// Two triangles of areas 1 and 3, one without area, and one that does not emit.
    fn mesh() -> Arc<TriangleMesh> {
        let p = [[0., 0., 0.], [2., 0., 0.], [0., 1., 0.], [0., 0., 5.], [0., 3., 5.], [0., 0., 7.]];
        Arc::new(TriangleMesh {
            positions: p.map(Vec3::from).to_vec(),
            indices: vec![[0, 1, 2], [0, 1, 1], [0, 1, 5], [3, 4, 5]],
            normals: vec![Vec3::new(0.6, 0.0, -0.8); 6],
            uvs: [p.map(|[x, y, z]| Vec2::new(x, y + z)).to_vec(), vec![]],
            colors: (0..6).map(|i| [i as f32, 0.0, 0.0, 1.0]).collect(),
            ..TriangleMesh::default()
        })
    }

    fn stretched() -> Transform {
        let matrix = DMat3::from_cols(DVec3::new(2.0, 0.5, 0.0), DVec3::new(0.0, -1.0, 0.3), DVec3::new(0.0, 0.0, 0.5));
        Transform::new(DAffine3::from_mat3_translation(matrix, DVec3::new(1.0, 2.0, 3.0))).expect("invertible")
    }

    fn mesh_light(place: Transform) -> AreaLight {
        let geometry = EmissiveGeometry::Mesh { mesh: mesh(), triangles: vec![3, 1, 0, 3, 99] };
        AreaLight::new(geometry, place, (7, 8)).expect("it has area")
    }

    fn sphere_light(place: Transform) -> AreaLight {
        AreaLight::new(EmissiveGeometry::Shape(Arc::new(Sphere { radius: 2.0 })), place, (7, 8)).expect("area")
    }

    #[test]
    fn mesh_points_are_uniform_by_world_area() {
        for place in [Transform::IDENTITY, stretched()] {
            let light = mesh_light(place);
            let area = |t: usize| {
                let [a, b, c] = mesh().corners(t).map(|p| place.point(p.as_dvec3()));
                (b - a).cross(c - a).length() / 2.0
            };
            assert!((light.area() - area(0) - area(3)).abs() < 1e-9);
            let (n, mut first, mut center) = (20_000, 0, DVec3::ZERO);
            for i in 0..n {
                let s = light.sample(uniform2([i, 1, 0, 0])).expect("a point");
                assert!((f64::from(s.pdf_area) * light.area() - 1.0).abs() < 1e-5);
                assert_eq!(s.pdf_area, light.pdf_area(&s.surface));
                if s.surface.primitive == 0 {
                    first += 1;
                    center += place.inverse().point(s.surface.position.as_dvec3());
                } else {
                    assert_eq!(s.surface.primitive, 3);
                }
            }
            let p = area(0) / light.area();
            let sigma = (p * (1.0 - p) / f64::from(n)).sqrt();
            assert!((f64::from(first) / f64::from(n) - p).abs() < 4.0 * sigma);
            // The centroid; the standard deviation of a coordinate is below 0.5.
            let mean = center / f64::from(first);
            assert!((mean - DVec3::new(2.0 / 3.0, 1.0 / 3.0, 0.0)).length() < 3.0 / f64::from(first).sqrt());
        }
    }

    #[test]
    fn the_density_of_triangles_that_do_not_emit_is_zero() {
        let light = mesh_light(Transform::IDENTITY);
        let mut surface = light.sample(Vec2::splat(0.3)).expect("a point").surface;
        for (primitive, positive) in [(0, true), (1, false), (2, false), (3, true), (99, false), (u32::MAX, false)] {
            surface.primitive = primitive;
            assert_eq!(light.pdf_area(&surface) > 0.0, positive, "{primitive}");
        }
    }

    #[test]
    fn a_mesh_point_carries_everything_that_emission_may_look_at() {
        let light = mesh_light(Transform::IDENTITY);
        for i in 0..100 {
            let s = light.sample(uniform2([i, 3, 3, 3])).expect("a point").surface;
            let p = s.position;
            assert!((s.uv[0] - Vec2::new(p.x, p.y + p.z)).length() < 1e-5 && s.uv[1] == Vec2::ZERO);
            assert_eq!((s.instance, s.geometry), (7, 8));
            let (n, color) = if s.primitive == 0 { (Vec3::Z, p.x / 2.0 + 2.0 * p.y) } else { (Vec3::X, 0.0) };
            assert!((s.geometric_normal - n).length() < 1e-6 && s.shading_normal.dot(n) > 0.0);
            assert!((s.shading_normal.length() - 1.0).abs() < 1e-6);
            if s.primitive == 0 {
                assert!((s.color[0] - color).abs() < 1e-5);
                assert!((s.dpdu - Vec3::X).length() < 1e-5 && (s.dpdv - Vec3::Y).length() < 1e-5);
            }
            assert!(s.position_error.cmpge(Vec3::ZERO).all() && s.position_error.max_element() < 1e-5);
        }
    }

    #[test]
    fn a_mirrored_mesh_keeps_its_outer_side() {
        let mirror = Transform::new(DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0))).expect("invertible");
        let s = mesh_light(mirror).sample(Vec2::new(0.01, 0.5)).expect("a point").surface;
        assert_eq!((s.primitive, s.geometric_normal), (0, Vec3::NEG_Z));
    }

    #[test]
    fn shape_densities_integrate_to_one_under_any_transform() {
        for place in [Transform::IDENTITY, stretched()] {
            let light = sphere_light(place);
            // Integrates the density over the ellipsoid by the sphere's longitude and height.
            let (n, mut integral, mut area) = (300, 0.0, 0.0);
            for i in 0..n {
                for j in 0..n {
                    let (z, phi) = (1.0 - 2.0 * (i as f64 + 0.5) / n as f64, 2.0 * PI * (j as f64 + 0.5) / n as f64);
                    let r = (1.0 - z * z).sqrt();
                    let normal = DVec3::new(r * phi.cos(), r * phi.sin(), z);
                    let mut surface = light.sample(Vec2::ZERO).expect("a point").surface;
                    surface.geometric_normal = place.normal(normal).normalize().as_vec3();
                    let patch = 16.0 * PI / f64::from(n * n) * place.area_scale(normal);
                    integral += f64::from(light.pdf_area(&surface)) * patch;
                    area += patch;
                }
            }
            assert!((integral - 1.0).abs() < 1e-5, "{integral}");
            assert!((light.area() / area - 1.0).abs() < 0.01, "{} {area}", light.area());
        }
    }

    #[test]
    fn shape_samples_estimate_the_world_area_without_bias() {
        let light = sphere_light(stretched());
        let n = 50_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..n {
            let s = light.sample(uniform2([i, 2, 2, 2])).expect("a point");
            assert_eq!(s.pdf_area, light.pdf_area(&s.surface));
            let local = stretched().inverse().point(s.surface.position.as_dvec3());
            assert!((local.length() - 2.0).abs() < 1e-5);
            let x = 1.0 / f64::from(s.pdf_area);
            sum += x;
            squares += x * x;
        }
        let mean = sum / f64::from(n);
        let error = ((squares / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
        assert!((mean - light.area()).abs() < 3.0 * error + 0.01 * mean, "{mean} {error} {}", light.area());
    }

    #[test]
    fn stratified_numbers_stay_stratified_over_the_triangles() {
        let light = mesh_light(Transform::IDENTITY);
        let first = (0..400).filter(|i| {
            let s = light.sample(Vec2::new((*i as f32 + 0.5) / 400.0, 0.5)).expect("a point");
            s.surface.primitive == 0
        });
        assert_eq!(first.count(), 100);
    }

    #[test]
    fn surfaces_without_area_are_no_lights() {
        let light =
            |triangles| AreaLight::new(EmissiveGeometry::Mesh { mesh: mesh(), triangles }, Transform::IDENTITY, (0, 0));
        assert!(light(vec![1]).is_none() && light(vec![]).is_none() && light(vec![99]).is_none());
        let point = EmissiveGeometry::Shape(Arc::new(Sphere { radius: 0.0 }));
        assert!(AreaLight::new(point, Transform::IDENTITY, (0, 0)).is_none());
        let mut broken = (*mesh()).clone();
        broken.positions[2] = Vec3::NAN;
        let geometry = EmissiveGeometry::Mesh { mesh: Arc::new(broken), triangles: vec![0] };
        assert!(AreaLight::new(geometry, Transform::IDENTITY, (0, 0)).is_none());
    }

    #[test]
    fn every_shape_with_area_can_be_a_light() {
        for shape in AnyShape::examples() {
            for place in [Transform::IDENTITY, stretched()] {
                let Some(light) = AreaLight::new(EmissiveGeometry::Shape(Arc::new(shape.clone())), place, (0, 0))
                else {
                    assert!(!shape.area().is_finite() || shape.area() == 0.0, "{shape:?}");
                    continue;
                };
                for i in 0..50 {
                    let s = light.sample(uniform2([i, 6, 6, 6])).expect("a point");
                    assert!(s.pdf_area > 0.0 && s.pdf_area.is_finite() && s.surface.position.is_finite());
                    assert!(s.surface.geometric_normal.is_normalized(), "{shape:?}");
                    let again = light.pdf_area(&s.surface);
                    assert!((again / s.pdf_area - 1.0).abs() < 1e-5);
                }
            }
        }
    }
}
