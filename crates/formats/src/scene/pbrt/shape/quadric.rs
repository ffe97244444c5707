//! Quadrics: whole spheres, cylinders and disks become analytic shapes, parts of them and the
//! others triangles.

use super::super::Builder;
use super::super::options::is_kind;
use super::super::params::Params;
use super::{Lamps, Made};
use crate::scene::fault::Fault;
use crate::scene::shapes::{ALONG, AROUND, around_z, swept};
use snell_intersect::shape::{Cylinder, Disk, Sphere};
use snell_math::{DAffine3, DVec2, DVec3, real, rotation};
use std::f64::consts::PI;

impl Builder<'_> {
    pub(super) fn quadric(&mut self, params: &Params) -> Result<Made, Fault> {
        let radius = params.float_or("radius", 1.0)?;
        let turn = params.float_or("phimax", 360.0)?.clamp(0.0, 360.0);
        if radius <= 0.0 {
            return Err(params.fault(format!("a radius of {radius}"), "give a positive number"));
        }
        self.note_common(params);
        let arc = turn.to_radians();
        let is_whole = turn == 360.0 && !self.is_reversed();
        if is_kind(params, "sphere") {
            let (low, high) = (params.float_or("zmin", -radius)?, params.float_or("zmax", radius)?);
            if is_whole && low <= -radius && high >= radius {
                return Ok(Made::shape(Sphere { radius }, DAffine3::from_mat3(around_z())));
            }
            let angle = |z: f64| real::acos((z / radius).clamp(-1.0, 1.0));
            let (bottom, top) = (angle(low.min(high)), angle(high.max(low)));
            let height = radius * (real::cos(bottom) - real::cos(top)).abs();
            return Ok(self.swept(params, turn, arc * radius * height, ALONG, |phi, v| {
                let (sin, cos) = real::sin_cos(bottom + (top - bottom) * v);
                let normal = DVec3::new(sin * real::cos(phi), sin * real::sin(phi), cos);
                (normal * radius, normal)
            }));
        }
        if is_kind(params, "disk") {
            return self.disk(params, radius, turn, is_whole);
        }
        if !is_kind(params, "cylinder") {
            return self.old_quadric(params, radius, turn);
        }
        let (low, high) = (params.float_or("zmin", -1.0)?, params.float_or("zmax", 1.0)?);
        if high <= low {
            return Err(params
                .fault(format!("a cylinder from {low} to {high}"), "make zmax larger than zmin"));
        }
        if is_whole {
            let cylinder = Cylinder { radius, height: high - low, caps: false };
            let middle = DVec3::Z * ((low + high) * 0.5);
            return Ok(Made::shape(cylinder, DAffine3::from_mat3_translation(around_z(), middle)));
        }
        let area = arc * radius * (high - low);
        Ok(self.swept(params, turn, area, 1, |phi, v| {
            let normal = DVec3::new(real::cos(phi), real::sin(phi), 0.0);
            (normal * radius + DVec3::Z * (low + (high - low) * v), normal)
        }))
    }

    fn disk(
        &mut self,
        params: &Params,
        radius: f64,
        turn: f64,
        is_whole: bool,
    ) -> Result<Made, Fault> {
        let height = params.float_or("height", 0.0)?;
        let inner_radius = params.float_or("innerradius", 0.0)?;
        if !(inner_radius >= 0.0 && inner_radius < radius) {
            let problem = format!("an inner radius of {inner_radius} within {radius}");
            return Err(params.fault(problem, "give one from 0 to below the radius"));
        }
        // Texture coordinates of our disks grow inwards in the image, those of pbrt outwards.
        if is_whole && !self.is_textured() {
            let place = DAffine3::from_translation(DVec3::Z * height);
            return Ok(Made::shape(Disk { radius, inner_radius }, place));
        }
        let area = turn.to_radians() * 0.5 * (radius * radius - inner_radius * inner_radius);
        Ok(self.swept(params, turn, area, 1, |phi, v| {
            let r = radius + (inner_radius - radius) * v;
            (DVec3::new(r * real::cos(phi), r * real::sin(phi), height), DVec3::Z)
        }))
    }

    /// Cones and paraboloids of pbrt-v3.
    fn old_quadric(&mut self, params: &Params, radius: f64, turn: f64) -> Result<Made, Fault> {
        if is_kind(params, "cone") {
            let height = params.float_or("height", 1.0)?;
            let area = turn.to_radians() * 0.5 * radius * real::hypot(radius, height);
            return Ok(self.swept(params, turn, area, 1, |phi, v| {
                let around = DVec3::new(real::cos(phi), real::sin(phi), 0.0);
                let normal = (around * height + DVec3::Z * radius).normalize_or(DVec3::Z);
                (around * (radius * (1.0 - v)) + DVec3::Z * (height * v), normal)
            }));
        }
        let (low, high) = (params.float_or("zmin", 0.0)?, params.float_or("zmax", 1.0)?);
        // Paraboloid::Area of pbrt-v3.
        let bound = |z: f64| real::powf(1.0 + 4.0 * high * z / (radius * radius), 1.5);
        let area = turn.to_radians() * real::powi(radius, 4) / (12.0 * high * high)
            * (bound(high) - bound(low)).abs();
        Ok(self.swept(params, turn, area, ALONG, |phi, v| {
            let z = low + (high - low) * v;
            let (r, around) = (
                radius * (z / high).max(0.0).sqrt(),
                DVec3::new(real::cos(phi), real::sin(phi), 0.0),
            );
            let slope = radius * radius / (2.0 * high);
            (around * r + DVec3::Z * z, (around * r - DVec3::Z * slope).normalize_or(DVec3::NEG_Z))
        }))
    }

    /// The surface that a segment sweeps around the z axis (`Hyperboloid` of pbrt-v3).
    pub(super) fn hyperboloid(&mut self, params: &Params) -> Result<Made, Fault> {
        let turn = params.float_or("phimax", 360.0)?.clamp(0.0, 360.0);
        let mut ends =
            [params.point("p1")?.unwrap_or(DVec3::ZERO), params.point("p2")?.unwrap_or(DVec3::ONE)];
        self.note_common(params);
        // As in pbrt; v and the outer side follow the order.
        if ends[1].z == 0.0 {
            ends.swap(0, 1);
        }
        let [start, end] = ends;
        let along = end - start;
        let at = |v: f64| start.lerp(end, v);
        let as_in_pbrt = hyperboloid_of_pbrt(start, end);
        // The radius, and the radius times its change along v.
        let radius = |v: f64| match as_in_pbrt {
            Some([a, c]) => {
                let z = at(v).z;
                [((1.0 + c * z * z) / a).sqrt(), c / a * z * along.z]
            }
            None => {
                let across = at(v).truncate();
                [across.length(), across.dot(along.truncate())]
            }
        };
        let normal = |v: f64| {
            let [radius, change] = radius(v);
            let outwards = at(v).truncate().normalize_or(DVec2::X) * radius * along.z;
            outwards.extend(-change).try_normalize()
        };
        let heights: Vec<f64> =
            (0..=ALONG).map(|i| radius(f64::from(i) / f64::from(ALONG))[0]).collect();
        let step = along.z / f64::from(ALONG);
        let strip = |ends: &[f64]| 0.5 * (ends[0] + ends[1]) * real::hypot(ends[1] - ends[0], step);
        let area = turn.to_radians() * heights.windows(2).map(strip).sum::<f64>();
        Ok(self.swept(params, turn, area, ALONG, |phi, v| {
            let turned = rotation::about(DVec3::Z, phi);
            let outwards = at(v).truncate().normalize_or(DVec2::X) * radius(v)[0];
            // The tip of a cone has no normal: the one of the middle is used.
            let normal = normal(v).or_else(|| normal(0.5)).unwrap_or(DVec3::Z);
            (turned * outwards.extend(at(v).z), turned * normal)
        }))
    }

    /// Tessellates a surface of points and normals over longitude (radians) and v from 0 to 1, for
    /// a turn in degrees. `area` is that of the surface.
    fn swept(
        &mut self,
        params: &Params,
        turn: f64,
        area: f64,
        along: u32,
        surface: impl Fn(f64, f64) -> (DVec3, DVec3),
    ) -> Made {
        let around = ((turn / 360.0 * f64::from(AROUND)).ceil() as u32).clamp(1, AROUND);
        if !self.may_make(params, (2 * around * along) as usize) {
            return Made::Nothing;
        }
        let mesh = swept(turn, [around, along], surface);
        debug_assert!(turn <= 2.0 * PI.to_degrees());
        self.finish_mesh(mesh, Lamps::Whole(area))
    }
}

/// The factors of pbrt-v3's equation a (x^2 + y^2) - c z^2 = 1 for the segment. The surface goes
/// through the end, and is that of the segment only if its waist is at z = 0; nevertheless it is
/// what pbrt draws, between the heights of the ends. `None` if it is not there at these heights.
fn hyperboloid_of_pbrt(start: DVec3, end: DVec3) -> Option<[f64; 2]> {
    let mut beyond = start;
    for _ in 0..8 {
        beyond += 2.0 * (end - start);
        let [far, near] = [beyond, end].map(|p| p.truncate().length_squared());
        let ratio = real::powi(beyond.z / end.z, 2) / far;
        let a = (1.0 / far - ratio) / (1.0 - near * ratio);
        let c = (a * near - 1.0) / (end.z * end.z);
        if a.is_finite() {
            let is_there = |z: f64| {
                let square = (1.0 + c * z * z) / a;
                square > 0.0 && square.is_finite()
            };
            // Between the ends the quotient is least at one of them or at z = 0.
            let lowest = start.z.min(end.z).max(0.0f64.min(start.z.max(end.z)));
            return [start.z, end.z, lowest].into_iter().all(is_there).then_some([a, c]);
        }
    }
    None
}
