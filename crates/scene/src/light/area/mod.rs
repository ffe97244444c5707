//! Emissive surfaces as lights. A part (a triangle, or a whole shape) is chosen by its power, then
//! a point of the part is sampled.

mod flat;
mod moving;
mod near;
mod outline;
mod surface;
#[cfg(test)]
mod tests;

pub use flat::{FlatPart, PartSample};
pub use moving::MovingAreaLight;
pub use near::{NearPart, NearRectangle, NearSample, NearSphere, NearTriangle, RoundSample};

use super::LightBounds;
use outline::{Outline, Seen};
use snell_intersect::{Shape, SurfaceInteraction, TriangleMesh};
use snell_math::distribution::Distribution1D;
use snell_math::{Bounds3d, DVec2, DVec3, Frame, Transform, UVec2, Vec2, Vec3};
use std::sync::Arc;
use surface::Place;

/// The geometry of an emissive surface.
#[derive(Clone, Debug)]
pub enum EmissiveGeometry {
    /// Some triangles of a mesh.
    Mesh {
        /// The mesh.
        mesh: Arc<TriangleMesh>,
        /// The numbers of the triangles that emit. Numbers past the mesh's triangles are ignored.
        triangles: Vec<u32>,
    },
    /// A whole shape.
    Shape(Arc<dyn Shape>),
}

/// A sampled point on an emissive surface.
#[derive(Clone, Debug)]
pub struct AreaSample {
    /// The point as an interaction in the world. `t` is 0 and meaningless; the ids are those given
    /// to [`AreaLight::new`]. `position_error` bounds how far the surface that rays hit may be from
    /// `position`, so a shadow ray must end before that.
    pub surface: SurfaceInteraction,
    /// Density per unit of world area.
    pub pdf_area: f32,
}

/// A sampled point on an emissive surface, as seen from another point.
#[derive(Clone, Debug)]
pub struct DirectedSample {
    /// The point; see [`AreaSample::surface`].
    pub surface: SurfaceInteraction,
    /// Unit direction towards the point.
    pub direction: Vec3,
    /// Density per steradian of the direction.
    pub pdf: f32,
}

/// A point on an emissive surface, with the data that rays need.
#[derive(Clone, Copy, Debug)]
pub struct AreaPoint {
    /// Position of the point in the world.
    pub position: Vec3,
    /// Bound, for each coordinate, of the distance of the surface that rays hit from the position.
    pub position_error: Vec3,
    /// Unit normal of the surface.
    pub normal: Vec3,
}

/// An [`AreaPoint`] as seen from another point.
#[derive(Clone, Copy, Debug)]
pub struct DirectedPoint {
    /// The sampled point.
    pub point: AreaPoint,
    /// Unit direction towards the point.
    pub direction: Vec3,
    /// Density per steradian of the direction.
    pub pdf: f32,
}

/// An emissive surface at one place in the world.
#[derive(Debug)]
pub struct AreaLight {
    /// The geometry that emits. The triangle numbers of a mesh are ascending and unique.
    pub geometry: EmissiveGeometry,
    /// The transform of the geometry to the world.
    pub world_from_geometry: Transform,
    /// Instance and geometry ids for the sampled interactions.
    pub ids: (u32, u32),
    table: Table,
    area: f64,
    /// Mean luminance of each part, W / (m^2 sr); empty if all parts have the same.
    radiance: Vec<f32>,
}

#[derive(Debug)]
enum Table {
    /// The choice among the emissive triangles by their power, and the triangles in the world.
    Mesh { choice: Distribution1D, placed: Vec<PlacedTriangle> },
    /// A shape, with the density of its points in the shape's own coordinates.
    Shape { pdf: f64, outline: Outline, flat: Option<FlatPart> },
}

/// An emissive triangle in the world, ready to be sampled.
#[derive(Clone, Copy, Debug)]
struct PlacedTriangle {
    flat: FlatPart,
    /// Tangents along the first texture coordinates, or arbitrary ones if there are none.
    tangents: [Vec3; 2],
    /// Density per unit of area, including the probability of choosing the triangle.
    pdf: f32,
}

impl PlacedTriangle {
    fn new(mesh: &TriangleMesh, triangle: u32, place: &Transform, pdf: f32) -> Self {
        let own = mesh.corners(triangle as usize).map(|p| p.as_dvec3());
        let corners = own.map(|p| place.point(p));
        let normal =
            place.normal((own[1] - own[0]).cross(own[2] - own[0])).normalize_or(DVec3::Z).as_vec3();
        let indices = mesh.indices[triangle as usize].map(|i| i as usize);
        let tangents = uv_derivatives(mesh, indices, corners).unwrap_or_else(|| {
            let frame = Frame::from_z(normal);
            [frame.x, frame.y]
        });
        Self { flat: FlatPart::triangle(corners, normal), tangents, pdf }
    }

    fn area(&self) -> f64 {
        self.flat.area()
    }

    fn bounds(&self) -> Bounds3d {
        let corner = self.flat.corner.as_dvec3();
        Bounds3d::of([
            corner,
            corner + self.flat.edges[0].as_dvec3(),
            corner + self.flat.edges[1].as_dvec3(),
        ])
    }
}

impl AreaLight {
    /// Prepares sampling; `None` if the surface has no finite positive area. Triangles without area
    /// are never chosen.
    pub fn new(
        geometry: EmissiveGeometry,
        world_from_geometry: Transform,
        ids: (u32, u32),
    ) -> Option<Self> {
        match geometry {
            EmissiveGeometry::Mesh { mesh, triangles } => {
                Self::new_mesh(mesh, triangles, world_from_geometry, ids)
            }
            EmissiveGeometry::Shape(shape) => Self::new_shape(shape, world_from_geometry, ids),
        }
    }

    fn new_mesh(
        mesh: Arc<TriangleMesh>,
        mut triangles: Vec<u32>,
        placed: Transform,
        ids: (u32, u32),
    ) -> Option<Self> {
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
        // Weights are relative to the whole, because areas may be too small or large for single
        // precision.
        let choice =
            Distribution1D::new(&areas.iter().map(|a| (a / area) as f32).collect::<Vec<_>>());
        let pdf = areas.iter().enumerate().map(|(i, &a)| density(choice.probability(i), a));
        let placed_triangle = |(&t, pdf): (&u32, f32)| PlacedTriangle::new(&mesh, t, &placed, pdf);
        let placed_triangles = triangles.iter().zip(pdf).map(placed_triangle).collect();
        let table = Table::Mesh { choice, placed: placed_triangles };
        let geometry = EmissiveGeometry::Mesh { mesh, triangles };
        let usable = area > 0.0 && area.is_finite();
        usable.then_some(Self {
            geometry,
            world_from_geometry: placed,
            ids,
            table,
            area,
            radiance: Vec::new(),
        })
    }

    fn new_shape(shape: Arc<dyn Shape>, placed: Transform, ids: (u32, u32)) -> Option<Self> {
        let own_area = shape.area();
        if !(own_area > 0.0 && own_area.is_finite()) {
            return None;
        }
        let area = own_area * mean_area_scale(&*shape, &placed)?;
        let (outline, flat) = (Outline::of(&*shape, &placed), FlatPart::of(&*shape, &placed));
        let table = Table::Shape { pdf: 1.0 / own_area, outline, flat };
        let geometry = EmissiveGeometry::Shape(shape);
        let usable = area > 0.0 && area.is_finite();
        usable.then_some(Self {
            geometry,
            world_from_geometry: placed,
            ids,
            table,
            area,
            radiance: Vec::new(),
        })
    }

    /// Samples a point, with density [`AreaSample::pdf_area`] per unit of world area.
    pub fn sample(&self, u: Vec2) -> Option<AreaSample> {
        let (part, _, rest) = self.choose_part(u.x);
        let surface = self.part_surface(part, Vec2::new(rest, u.y))?;
        let pdf_area = match &self.table {
            Table::Mesh { placed, .. } => placed[part as usize].pdf,
            Table::Shape { pdf, .. } => self.shape_pdf(*pdf, surface.geometric_normal),
        };
        (pdf_area > 0.0 && pdf_area.is_finite()).then_some(AreaSample { surface, pdf_area })
    }

    /// Measures the emission of each part, so that parts are chosen by power and not only by area.
    /// `radiance` gives the luminance at a point of the surface, averaged over about this width (0:
    /// at the point alone, as paths find it); it is called for `points^2` points of each part (1 is
    /// enough where the parts are uniform). Where all of these are dark, means over the cells
    /// between them find a bright spot. Every part keeps a positive probability.
    pub fn measured(
        mut self,
        points: u32,
        radiance: impl Fn(&SurfaceInteraction, f32) -> f32,
    ) -> Self {
        const DIM: f32 = 1e-3;
        let (count, points) = (self.part_count(), points.max(1));
        let mean_of = |part: u32| {
            let width = (self.part_area(part).sqrt() / f64::from(points)) as f32;
            let sum_over = |width: f32| -> f32 {
                (0..points * points)
                    .map(|k| (UVec2::new(k % points, k / points).as_vec2() + 0.5) / points as f32)
                    .filter_map(|u| self.part_surface(part, u))
                    .map(|s| finite(radiance(&s, width)))
                    .sum()
            };
            let at_points = sum_over(0.0);
            let sum = if at_points > 0.0 { at_points } else { sum_over(width) };
            finite(sum / (points * points) as f32)
        };
        self.radiance = (0..count).map(mean_of).collect();
        let powers: Vec<f64> =
            (0..count).map(|k| self.part_area(k) * f64::from(self.radiance[k as usize])).collect();
        let power: f64 = powers.iter().sum();
        let areas: Vec<f64> = (0..count).map(|k| self.part_area(k)).collect();
        if let Table::Mesh { choice, placed } = &mut self.table
            && power > 0.0
        {
            let least = f64::from(DIM) / self.area;
            let weight = |(&p, &a): (&f64, &f64)| (p / power).max(a * least) as f32;
            *choice =
                Distribution1D::new(&powers.iter().zip(&areas).map(weight).collect::<Vec<_>>());
            for (i, (triangle, &area)) in placed.iter_mut().zip(&areas).enumerate() {
                triangle.pdf = density(choice.probability(i), area);
            }
        }
        self
    }

    /// Mean luminance of the radiance that the whole surface emits, W / (m^2 sr); 1 before
    /// [`Self::measured`] is called.
    pub fn mean_radiance(&self) -> f64 {
        if self.radiance.is_empty() {
            return 1.0;
        }
        let sum: f64 =
            (0..).zip(&self.radiance).map(|(part, &l)| self.part_area(part) * f64::from(l)).sum();
        sum / self.area
    }

    /// Bounds of a part in space and direction.
    pub fn part_bounds(&self, part: u32, is_two_sided: bool) -> LightBounds {
        let radiance = f64::from(self.radiance.get(part as usize).copied().unwrap_or(1.0));
        let (bounds, axis, cos_spread, facing_area) = match (&self.geometry, &self.table) {
            (EmissiveGeometry::Shape(shape), _) => {
                let bounds = self.world_from_geometry.bounds(&shape.bounds());
                match self.part_surface(0, Vec2::splat(0.5)) {
                    // A shape that is not closed is flat. For a convex body, the mean projected
                    // area is a quarter of its surface.
                    Some(surface) if !shape.is_closed() => {
                        (bounds, surface.geometric_normal, 1.0, self.area)
                    }
                    _ => (bounds, Vec3::Z, -1.0, self.area * 0.25),
                }
            }
            (_, Table::Mesh { placed, .. }) => {
                let triangle = &placed[part as usize];
                (triangle.bounds(), triangle.flat.normal, 1.0, triangle.area())
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

    /// Number of parts that can be chosen: emissive triangles, or 1 for a shape.
    pub fn part_count(&self) -> u32 {
        match &self.table {
            Table::Mesh { placed, .. } => placed.len() as u32,
            Table::Shape { .. } => 1,
        }
    }

    /// Chooses a part by its power. Returns the part, its probability, and a new uniform number
    /// made from `u`.
    pub fn choose_part(&self, u: f32) -> (u32, f32, f32) {
        match &self.table {
            Table::Mesh { choice, .. } => {
                let (part, rest) = choice.sample(u);
                (part as u32, choice.probability(part), rest)
            }
            Table::Shape { .. } => (0, 1.0, u),
        }
    }

    /// The probability with which [`Self::choose_part`] chooses a part.
    pub fn part_probability(&self, part: u32) -> f32 {
        match &self.table {
            Table::Mesh { choice, .. } if (part as usize) < choice.len() => {
                choice.probability(part as usize)
            }
            Table::Mesh { .. } => 0.0,
            Table::Shape { .. } => 1.0,
        }
    }

    /// The primitive of the geometry that a part is.
    pub fn primitive_of(&self, part: u32) -> u32 {
        match &self.geometry {
            EmissiveGeometry::Mesh { triangles, .. } => {
                triangles.get(part as usize).copied().unwrap_or(0)
            }
            EmissiveGeometry::Shape(_) => 0,
        }
    }

    /// The part that a primitive of the geometry is; `None` if the primitive does not emit.
    pub fn part_of(&self, primitive: u32) -> Option<u32> {
        let EmissiveGeometry::Mesh { triangles, .. } = &self.geometry else { return Some(0) };
        // If all triangles emit, their numbers are their positions in the list.
        if triangles.get(primitive as usize) == Some(&primitive) {
            return Some(primitive);
        }
        triangles.binary_search(&primitive).ok().map(|part| part as u32)
    }

    /// Samples a point of a part as seen from `from`: uniform by solid angle where that can be
    /// sampled, by area elsewhere. `None` where the part cannot be seen or sampled, or the sample
    /// misses the part.
    pub fn sample_from(&self, part: u32, from: Vec3, u: Vec2) -> Option<DirectedSample> {
        let (place, DirectedPoint { point, direction, pdf }) = self.place_from(part, from, u)?;
        Some(DirectedSample { surface: self.surface(part, &place, &point), direction, pdf })
    }

    /// [`Self::sample_from`] without the attributes that only some materials need.
    pub fn sample_point_from(&self, part: u32, from: Vec3, u: Vec2) -> Option<DirectedPoint> {
        Some(self.place_from(part, from, u)?.1)
    }

    fn place_from(&self, part: u32, from: Vec3, u: Vec2) -> Option<(Place, DirectedPoint)> {
        if let Some(seen) = self.seen_from(part, from) {
            let offset = seen.sample(u.as_dvec2())?;
            let place = self.place_at(part, from.as_dvec3() + offset)?;
            let (point, direction) = (self.point(part, &place)?, offset.normalize().as_vec3());
            return Some((place, DirectedPoint { point, direction, pdf: seen.pdf() }));
        }
        let place = self.place(part, u)?;
        let point = self.point(part, &place)?;
        let to_light = point.position - from;
        let direction = to_light.try_normalize()?;
        let pdf = self.pdf_by_area(part, point.normal, direction, to_light.length_squared());
        (pdf > 0.0 && pdf.is_finite()).then_some((place, DirectedPoint { point, direction, pdf }))
    }

    /// Density per steradian with which [`Self::sample_from`] samples `surface`, a point of this
    /// part that is visible from `from` in `direction` (unit).
    pub fn pdf_from(
        &self,
        part: u32,
        from: Vec3,
        surface: &SurfaceInteraction,
        direction: Vec3,
    ) -> f32 {
        if let Some(seen) = self.seen_from(part, from) {
            // Only the near side of a sphere is sampled.
            let is_far_side = seen.is_sphere() && direction.dot(surface.geometric_normal) >= 0.0;
            return if is_far_side { 0.0 } else { seen.pdf() };
        }
        self.pdf_by_area(
            part,
            surface.geometric_normal,
            direction,
            (surface.position - from).length_squared(),
        )
    }

    fn pdf_by_area(&self, part: u32, normal: Vec3, direction: Vec3, distance_squared: f32) -> f32 {
        let pdf_area = match &self.table {
            Table::Mesh { placed, .. } => placed[part as usize].flat.pdf,
            Table::Shape { flat: Some(flat), .. } => flat.pdf,
            Table::Shape { pdf, .. } => self.shape_pdf(*pdf, normal),
        };
        let pdf = pdf_area * distance_squared / direction.dot(normal).abs();
        if pdf.is_finite() { pdf } else { 0.0 }
    }

    /// The part as a flat one with straight sides, if it is one.
    #[inline]
    pub fn flat(&self, part: u32) -> Option<&FlatPart> {
        match &self.table {
            Table::Mesh { placed, .. } => placed.get(part as usize).map(|placed| &placed.flat),
            Table::Shape { flat, .. } => flat.as_ref(),
        }
    }

    /// The part in the form for sampling by solid angle, if it has one: a rectangle or a triangle
    /// of a mesh, which are sampled so where [`FlatPart::is_far`] is false, or a sphere.
    #[inline]
    pub fn near(&self, part: u32) -> Option<NearPart> {
        match &self.table {
            Table::Mesh { placed, .. } => placed
                .get(part as usize)
                .map(|placed| NearPart::Triangle(NearTriangle::of(&placed.flat))),
            Table::Shape { outline: Outline::Rectangle(rectangle), flat: Some(_), .. } => {
                Some(NearPart::Rectangle(*rectangle))
            }
            Table::Shape { outline: Outline::Sphere(sphere), .. } => {
                Some(NearPart::Sphere(*sphere))
            }
            _ => None,
        }
    }

    /// [`Self::sample_from`] for spheres and for flat parts, far or [near](Self::near), without the
    /// attributes that only some materials need; `None` for other parts.
    #[inline]
    pub fn sample_simple(&self, part: u32, from: Vec3, u: Vec2) -> Option<PartSample> {
        let (flat, near) = (self.flat(part), self.near(part));
        if let Some(flat) = flat.filter(|flat| flat.is_far(from)) {
            return Some(flat.sample(from, u));
        }
        let near = match near? {
            NearPart::Rectangle(rectangle) => rectangle.sample(from, u),
            NearPart::Triangle(triangle) => triangle.sample(from, u),
            NearPart::Sphere(sphere) => {
                let RoundSample { seen, normal, error } = sphere.sample(from, u);
                return Some(PartSample::of(seen, normal, error));
            }
        };
        Some(flat?.near_or_by_area(near, from, u))
    }

    /// A part prepared for sampling by solid angle from a point; `None` if it is sampled by area.
    fn seen_from(&self, part: u32, from: Vec3) -> Option<Seen> {
        if self.flat(part).is_some_and(|flat| flat.is_far(from)) {
            return None;
        }
        let outline = match &self.table {
            Table::Mesh { placed, .. } => {
                let FlatPart { corner, edges, .. } = placed[part as usize].flat;
                Outline::Triangle { corner: corner.as_dvec3(), edges: edges.map(|e| e.as_dvec3()) }
            }
            Table::Shape { outline, .. } => *outline,
        };
        outline.seen_from(from.as_dvec3())
    }

    /// Density per unit of world area with which [`Self::sample`] samples the point of this
    /// interaction on this light; 0 for triangles that do not emit. Only the number of the
    /// triangle, or the normal, is used, not the position.
    pub fn pdf_area(&self, surface: &SurfaceInteraction) -> f32 {
        match &self.table {
            Table::Mesh { placed, .. } => {
                self.part_of(surface.primitive).map_or(0.0, |part| placed[part as usize].pdf)
            }
            Table::Shape { pdf, .. } => self.shape_pdf(*pdf, surface.geometric_normal),
        }
    }

    /// The area in the world. For shapes under non-uniform scaling it is an estimate, within about
    /// one percent.
    pub fn area(&self) -> f64 {
        self.area
    }

    fn shape_pdf(&self, own_pdf: f64, world_normal: Vec3) -> f32 {
        let n = self.world_from_geometry.matrix().matrix3.transpose() * world_normal.as_dvec3();
        let pdf = own_pdf / self.world_from_geometry.area_scale(n.normalize_or_zero());
        if pdf.is_finite() { pdf.min(f64::from(f32::MAX)) as f32 } else { 0.0 }
    }
}

/// Density per unit of area, given the probability of a part; 0 for triangles without area.
fn density(probability: f32, area: f64) -> f32 {
    if area > 0.0 { (f64::from(probability) / area).min(f64::from(f32::MAX)) as f32 } else { 0.0 }
}

fn finite(x: f32) -> f32 {
    if x > 0.0 { x.min(1e30) } else { 0.0 }
}

/// The mean factor by which the transform stretches the shape's area: exact for similarities and
/// flat shapes.
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

/// Derivatives of the position with respect to the first texture coordinates; `None` if there are
/// no texture coordinates or they are degenerate.
fn uv_derivatives(
    mesh: &TriangleMesh,
    indices: [usize; 3],
    [p0, p1, p2]: [DVec3; 3],
) -> Option<[Vec3; 2]> {
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
