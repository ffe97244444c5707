//! An emissive surface that moves while the shutter is open. At each time it is the surface with
//! the transform of that time.

use super::{
    AreaLight, AreaSample, DirectedSample, EmissiveGeometry, FlatPart, Outline, PlacedTriangle,
    Table,
};
use crate::light::LightBounds;
use snell_intersect::{Instance, SurfaceInteraction};
use snell_math::distribution::Distribution1D;
use snell_math::{Bounds3d, Transform, Vec2, Vec3};

/// Number of times between two keys at which bounds are taken, because of rotations between the
/// keys.
const MOMENTS: u32 = 9;
/// Margin of the cone of normals, in cosines.
const WIDENING: f32 = 0.02;

/// An emissive surface that moves as a whole.
#[derive(Debug)]
pub struct MovingAreaLight {
    /// The surface when the shutter opens.
    pub first: AreaLight,
    /// The instances that hold the surface, outermost first.
    carriers: Vec<Instance>,
    /// Map from the surface's own coordinates to those of the innermost instance.
    carrier_from_geometry: Transform,
}

impl MovingAreaLight {
    /// The moving surface. `first` is the surface when the shutter opens; `carriers` are the
    /// instances that hold it, outermost first; `carrier_from_geometry` is its place in the
    /// innermost.
    pub fn new(
        first: AreaLight,
        carriers: Vec<Instance>,
        carrier_from_geometry: Transform,
    ) -> Self {
        Self { first, carriers, carrier_from_geometry }
    }

    /// The map to the world at a time from 0 (the shutter opens) to 1 (it closes). `None` if the
    /// map is singular, so that rays cannot hit the surface.
    fn place(&self, time: f32) -> Option<Transform> {
        let mut place = Transform::IDENTITY;
        for carrier in &self.carriers {
            place = place.compose(&carrier.at_time(time)?);
        }
        Some(place.compose(&self.carrier_from_geometry))
    }

    /// A single part of the surface, with the transform of this time.
    fn part_at(&self, part: u32, time: f32) -> Option<AreaLight> {
        let (place, first) = (self.place(time)?, &self.first);
        let (geometry, table, area) = match (&first.geometry, &first.table) {
            (EmissiveGeometry::Mesh { mesh, triangles }, _) => {
                let triangle = *triangles.get(part as usize)?;
                let mut placed = PlacedTriangle::new(mesh, triangle, &place, 0.0);
                let area = placed.area();
                placed.pdf = super::density(1.0, area);
                let table =
                    Table::Mesh { choice: Distribution1D::new(&[1.0]), placed: vec![placed] };
                (
                    EmissiveGeometry::Mesh { mesh: mesh.clone(), triangles: vec![triangle] },
                    table,
                    area,
                )
            }
            (EmissiveGeometry::Shape(shape), Table::Shape { pdf, .. }) => {
                let (outline, flat) =
                    (Outline::of(&**shape, &place), FlatPart::of(&**shape, &place));
                let table = Table::Shape { pdf: *pdf, outline, flat };
                (EmissiveGeometry::Shape(shape.clone()), table, first.area)
            }
            _ => return None,
        };
        let radiance = first.radiance.get(part as usize).map(|&l| vec![l]).unwrap_or_default();
        Some(AreaLight {
            geometry,
            world_from_geometry: place,
            ids: first.ids,
            table,
            area,
            radiance,
        })
    }

    /// [`AreaLight::sample`] for the surface at this time.
    pub fn sample(&self, time: f32, u: Vec2) -> Option<AreaSample> {
        let (part, probability, rest) = self.first.choose_part(u.x);
        let sample = self.part_at(part, time)?.sample(Vec2::new(rest, u.y))?;
        Some(AreaSample { pdf_area: sample.pdf_area * probability, ..sample })
    }

    /// [`AreaLight::sample_from`] for the surface at this time.
    pub fn sample_from(&self, part: u32, time: f32, from: Vec3, u: Vec2) -> Option<DirectedSample> {
        self.part_at(part, time)?.sample_from(0, from, u)
    }

    /// [`AreaLight::pdf_from`] for the surface at this time.
    pub fn pdf_from(
        &self,
        part: u32,
        time: f32,
        from: Vec3,
        surface: &SurfaceInteraction,
        direction: Vec3,
    ) -> f32 {
        self.part_at(part, time).map_or(0.0, |at| at.pdf_from(0, from, surface, direction))
    }

    /// Bounds of a part over the whole time that the shutter is open.
    pub fn part_bounds(&self, part: u32, is_two_sided: bool) -> LightBounds {
        let bounds_at = |time| Some(self.part_at(part, time)?.part_bounds(0, is_two_sided));
        let keys = self.carriers.iter().map(|c| c.later.len() as u32).max().unwrap_or(0);
        let moments = MOMENTS.max(keys * 2 + 1);
        let all: Vec<LightBounds> =
            (0..moments).filter_map(|k| bounds_at(k as f32 / (moments - 1) as f32)).collect();
        let Some(middle) = all.get(all.len() / 2) else {
            return self.first.part_bounds(part, is_two_sided);
        };
        let cos = all.iter().map(|b| b.axis.dot(middle.axis).min(b.cos_spread)).fold(1.0, f32::min);
        LightBounds {
            bounds: all.iter().fold(Bounds3d::EMPTY, |all, b| all.union(&b.bounds)),
            cos_spread: if cos < 1.0 - 1e-6 { (cos - WIDENING).max(-1.0) } else { cos },
            intensity: all.iter().map(|b| b.intensity).fold(0.0, f64::max),
            ..*middle
        }
    }
}
