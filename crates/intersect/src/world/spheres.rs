//! Batches of hits on spheres: the result of [`World::shape_point`] for each, with the same bits.

use super::interaction::MAP_ERROR;
use super::triangles::{HitLanes, HitVectors, TRIANGLE_HITS as LANES, TrianglePoints};
use super::{Geometry, GeometryId, GroupId, World};
use crate::hit::Hit;
use snell_math::simd::{Wide, mask_select};
use snell_math::{DAffine3, DMat3, DVec3, Ray, at_level};

/// A number in double precision for each hit.
type Doubles = [f64; LANES];
/// An affine map for each hit: columns, the translation last, by axis.
type Maps = [[Doubles; 3]; 4];

/// Hits on spheres, gathered one by one by [`World::gather_sphere`] and evaluated together by
/// [`Self::points`].
#[derive(Clone, Debug)]
pub struct SphereHits {
    origin: HitVectors,
    direction: HitVectors,
    /// Ray parameter.
    t: HitLanes,
    world_from_sphere: Maps,
    sphere_from_world: Maps,
    radius: Doubles,
    /// 1 where there is a hit.
    is_there: [u32; LANES],
    is_empty: bool,
}

impl Default for SphereHits {
    fn default() -> Self {
        let (zero, maps) = ([[0.0; LANES]; 3], [[[0.0; LANES]; 3]; 4]);
        Self {
            origin: zero,
            direction: zero,
            t: [0.0; LANES],
            world_from_sphere: maps,
            sphere_from_world: maps,
            radius: [0.0; LANES],
            is_there: [0; LANES],
            is_empty: true,
        }
    }
}

impl World {
    /// Puts a hit into a lane. Returns false, and does nothing, unless the hit is on a sphere that
    /// is not instanced.
    pub fn gather_sphere(&self, ray: &Ray, hit: &Hit, lane: usize, hits: &mut SphereHits) -> bool {
        if self.step(GroupId(0), hit.instance).is_some() {
            return false;
        }
        let Geometry::Shape(shape, placed) = self.geometry(GeometryId(hit.geometry)) else {
            return false;
        };
        let Some(sphere) = shape.as_sphere() else { return false };
        for axis in 0..3 {
            hits.origin[axis][lane] = ray.origin[axis];
            hits.direction[axis][lane] = ray.direction[axis];
        }
        hits.t[lane] = hit.t;
        put(&mut hits.world_from_sphere, lane, placed.matrix());
        put(&mut hits.sphere_from_world, lane, placed.inverse_matrix());
        hits.radius[lane] = sphere.radius;
        hits.is_there[lane] = 1;
        hits.is_empty = false;
        true
    }
}

impl SphereHits {
    /// Removes all hits.
    pub fn clear(&mut self) {
        if !self.is_empty {
            self.is_there = [0; LANES];
            self.is_empty = true;
        }
    }

    /// Computes the points of the lanes that hold hits; those of other lanes are unchanged.
    pub fn points(&self, to: &mut TrianglePoints, wide: Option<Wide>) {
        if !self.is_empty {
            at_level!(wide, points, (hits: &SphereHits = self, to: &mut TrianglePoints = to));
        }
    }
}

#[inline(always)]
fn put(to: &mut Maps, lane: usize, map: &DAffine3) {
    let DAffine3 { matrix3: DMat3 { x_axis, y_axis, z_axis }, translation } = *map;
    for (to, column) in to.iter_mut().zip([x_axis, y_axis, z_axis, translation]) {
        (to[0][lane], to[1][lane], to[2][lane]) = (column.x, column.y, column.z);
    }
}

#[inline(always)]
fn points(hits: &SphereHits, to: &mut TrianglePoints) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| DVec3::new(v[0][i].into(), v[1][i].into(), v[2][i].into());
        let column = |v: &[Doubles; 3]| DVec3::new(v[0][i], v[1][i], v[2][i]);
        let matrix = |m: &Maps| DMat3::from_cols(column(&m[0]), column(&m[1]), column(&m[2]));
        let (out, back) = (matrix(&hits.world_from_sphere), matrix(&hits.sphere_from_world));
        let (out_by, back_by) =
            (column(&hits.world_from_sphere[3]), column(&hits.sphere_from_world[3]));
        // From here on in the coordinates of the sphere.
        let origin = back * vector(&hits.origin) + back_by;
        let met = origin + back * vector(&hits.direction) * f64::from(hits.t[i]);
        let scale = 1.0 / met.length();
        let normal = met * scale;
        let local = normal * hits.radius[i];
        let size = greater(greater(local.x.abs(), local.y.abs()), local.z.abs());
        let rounding = DVec3::splat(size * 4.0 * MAP_ERROR);
        // From here on in world space.
        let grow = magnitudes(&out);
        let position = out * local + out_by;
        let up = (grow * local.abs() + out_by.abs()) * MAP_ERROR;
        let down = (magnitudes(&back) * position.abs() + back_by.abs()) * MAP_ERROR;
        let error = grow * (rounding + down) + up;
        let mapped =
            DVec3::new(back.x_axis.dot(normal), back.y_axis.dot(normal), back.z_axis.dot(normal));
        let mapped_scale = 1.0 / mapped.length();
        let unit = mapped * mapped_scale;
        let unit = unit * (1.0 / unit.length());
        let is_there = hits.is_there[i];
        let mut is_sound = (scale > 0.0)
            & (scale < f64::INFINITY)
            & (mapped_scale > 0.0)
            & (mapped_scale < f64::INFINITY)
            & (error.x + error.y + error.z < f64::from(f32::MAX) * 1e-10);
        let (position, error, unit) = (position.to_array(), error.to_array(), unit.to_array());
        for axis in 0..3 {
            let single = position[axis] as f32;
            let off = ((position[axis] - f64::from(single)).abs() + error[axis]) as f32;
            is_sound &= off < f32::MAX;
            // The next larger `f32` of a number that is not negative.
            let off = f32::from_bits(off.to_bits() + 1);
            to.position[axis][i] = mask_select(is_there, single, to.position[axis][i]);
            to.position_error[axis][i] = mask_select(is_there, off, to.position_error[axis][i]);
            to.geometric_normal[axis][i] =
                mask_select(is_there, unit[axis] as f32, to.geometric_normal[axis][i]);
            to.shading_normal[axis][i] =
                mask_select(is_there, unit[axis] as f32, to.shading_normal[axis][i]);
        }
        to.is_sound[i] = mask_select(is_there, u32::from(is_sound), to.is_sound[i]);
    }
}

#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn magnitudes(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Sphere;
    use crate::{BuildOptions, WorldBuilder};
    use snell_math::simd::Level;
    use snell_math::{Transform, Vec3, rng};
    use std::sync::Arc;

    fn vector(i: u32, k: u32) -> Vec3 {
        let (a, b) = (rng::uniform2([i, k, 1, 5]), rng::uniform2([i, k, 2, 5]));
        Vec3::new(a.x, a.y, b.x) * 2.0 - 1.0
    }

    #[test]
    fn many_points_are_those_of_single_interactions_at_every_level() {
        let mut builder = WorldBuilder::default();
        for i in 0..9 {
            let [x, y, z] = [0, 1, 2].map(|k| vector(i, k).as_dvec3());
            let matrix = DMat3::from_cols(x, y, z) + DMat3::IDENTITY * 1.5;
            let map = DAffine3::from_mat3_translation(
                matrix,
                vector(i, 3).as_dvec3() * 10f64.powi(i as i32 - 3),
            );
            let map = Transform::new(map).expect("an invertible map");
            builder.add_shape(
                WorldBuilder::ROOT,
                Arc::new(Sphere { radius: 0.3 * f64::from(i + 1) }),
                map,
            );
        }
        let world = builder.build(&BuildOptions::default()).expect("a world");
        let hits: Vec<(Ray, Hit)> = (0..LANES as u32)
            .map(|i| {
                let ray = Ray::new(vector(i, 10) * 9.0, vector(i, 11));
                (
                    ray,
                    Hit {
                        t: vector(i, 12).x + 1.0,
                        instance: 0,
                        geometry: i % 9,
                        primitive: 0,
                        ..Hit::MISS
                    },
                )
            })
            .collect();
        let mut gathered = SphereHits::default();
        // One lane stays empty.
        for (lane, (ray, hit)) in hits.iter().enumerate().skip(1) {
            assert!(world.gather_sphere(ray, hit, lane, &mut gathered));
        }
        for level in Level::ALL {
            let mut points = TrianglePoints::default();
            gathered.points(&mut points, level.wide());
            assert_eq!(points.is_sound[0], 0);
            for (i, (ray, hit)) in hits.iter().enumerate().skip(1) {
                let (single, point) = (world.interaction(ray, hit), world.point(ray, hit));
                let at = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
                assert_eq!(points.is_sound[i], 1);
                for position in [single.position, point.position] {
                    assert_eq!(at(&points.position), position);
                }
                for error in [single.position_error, point.position_error] {
                    assert_eq!(at(&points.position_error), error);
                }
                for normal in [single.geometric_normal, point.geometric_normal] {
                    assert_eq!(at(&points.geometric_normal), normal);
                }
                assert_eq!(at(&points.shading_normal), single.shading_normal);
            }
        }
    }
}
