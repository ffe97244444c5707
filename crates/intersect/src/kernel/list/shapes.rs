//! Spheres and flat shapes of a list, each tested against sixteen rays at a time.
//!
//! The operations in `f64` and their order are those of the scalar code of the shapes, so the
//! results have the same bits. Two steps are left out without effect: directions are not scaled by
//! a power of two, because [`is_moderate`] excludes overflow and underflow; and parameters in `f64`
//! are not compared with the interval, because the parameters rounded to `f32` must lie in it
//! anyway.

use super::packet::ListPacket;
use crate::exact::plane_hit::dot;
use crate::tree::list::ListShape;
use crate::tree::list::shape::{Kind, Outline};
use snell_math::simd::{Doubles16, Lanes16};

impl ListShape {
    /// The nearest hits of rays with the shape within their intervals; infinite for misses. The
    /// result is valid only for the selected lanes and for ordinary rays.
    #[inline(always)]
    pub(super) fn meet<D: Doubles16>(
        &self,
        token: D::Token,
        packet: &ListPacket<D>,
        lanes: u32,
    ) -> D::Singles {
        match self.kind {
            Kind::Sphere { radius } => self.meet_sphere(token, packet, lanes, radius),
            Kind::Flat(outline) => self.meet_flat(token, packet, lanes, outline),
        }
    }

    /// Intersects rays with a flat shape, by the operations of `closest_in_z0`.
    #[inline(always)]
    fn meet_flat<D: Doubles16>(
        &self,
        token: D::Token,
        packet: &ListPacket<D>,
        lanes: u32,
        outline: Outline,
    ) -> D::Singles {
        let exact = D::splat(token, 0.0)
            .sub(self.origin(token, packet, 2))
            .div(self.direction(token, packet, 2));
        let t = exact.rounded();
        let mut hits = lanes & packet.t_min.lt(t) & t.lt(packet.t_max);
        if hits != 0 {
            let x = self.origin(token, packet, 0).add(self.direction(token, packet, 0).mul(exact));
            let y = self.origin(token, packet, 1).add(self.direction(token, packet, 1).mul(exact));
            hits &= !match outline {
                Outline::Rectangle { half_size } => {
                    D::splat(token, half_size.x).lt(x.abs())
                        | D::splat(token, half_size.y).lt(y.abs())
                }
                Outline::Ring { inner, outer } => {
                    let square = x.mul(x).add(y.mul(y));
                    square.lt(D::splat(token, inner)) | D::splat(token, outer).lt(square)
                }
            };
        }
        D::Singles::splat(token, f32::INFINITY).replace(hits, t)
    }

    /// Intersects rays with a sphere, by the operations of the scalar code.
    #[inline(always)]
    fn meet_sphere<D: Doubles16>(
        &self,
        token: D::Token,
        packet: &ListPacket<D>,
        lanes: u32,
        radius: f64,
    ) -> D::Singles {
        let (zero, radius, infinity) = (
            D::splat(token, 0.0),
            D::splat(token, radius),
            D::Singles::splat(token, f32::INFINITY),
        );
        let o = [
            self.origin(token, packet, 0),
            self.origin(token, packet, 1),
            self.origin(token, packet, 2),
        ];
        let d = [
            self.direction(token, packet, 0),
            self.direction(token, packet, 1),
            self.direction(token, packet, 2),
        ];
        let a = dot(d, d);
        let moment = cross(o, d, zero);
        let (reach, distance) = (radius.mul(a.sqrt()), dot(moment, moment).sqrt());
        let meets = lanes & !reach.lt(distance);
        if meets == 0 {
            return infinity;
        }
        let (b, from_center) = (dot(o, d), dot(o, o).sqrt());
        let c = from_center.sub(radius).mul(from_center.add(radius));
        let root = reach.sub(distance).mul(reach.add(distance)).sqrt();
        // The sign of zero matters, and rounding preserves it.
        let q = zero.sub(b.add(root)).replace(b.rounded().signs(), root.sub(b));
        // If `q` is zero, the roots are zero or NaN, and lie in no interval.
        let (t0, t1) = (q.div(a).rounded(), c.div(q).rounded());
        let first = meets & packet.t_min.lt(t0) & t0.lt(packet.t_max);
        let second = meets & packet.t_min.lt(t1) & t1.lt(packet.t_max);
        infinity.replace(first, t0).min(infinity.replace(second, t1))
    }

    /// A coordinate of the ray origins, in the coordinates of the shape.
    #[inline(always)]
    fn origin<D: Doubles16>(&self, token: D::Token, packet: &ListPacket<D>, axis: usize) -> D {
        self.product(token, packet.exact_origin, axis)
            .add(D::splat(token, self.shape_from_group.translation[axis]))
    }

    /// A coordinate of the ray directions, in the coordinates of the shape.
    #[inline(always)]
    fn direction<D: Doubles16>(&self, token: D::Token, packet: &ListPacket<D>, axis: usize) -> D {
        let [x, y, z] = packet.direction;
        self.product(token, [D::of(x), D::of(y), D::of(z)], axis)
    }

    #[inline(always)]
    fn product<D: Doubles16>(&self, token: D::Token, v: [D; 3], axis: usize) -> D {
        let map = &self.shape_from_group.matrix3;
        let row = [
            D::splat(token, map.x_axis[axis]),
            D::splat(token, map.y_axis[axis]),
            D::splat(token, map.z_axis[axis]),
        ];
        dot(row, v)
    }
}

/// The cross product, with the bits of `accurate_cross` of shapes except for the sign of zero.
#[inline(always)]
fn cross<D: Doubles16>(a: [D; 3], b: [D; 3], zero: D) -> [D; 3] {
    [
        minor(a[1], b[2], a[2], b[1], zero),
        minor(a[2], b[0], a[0], b[2], zero),
        minor(a[0], b[1], a[1], b[0], zero),
    ]
}

/// The difference of products `a b - c d`, with the bits of
/// [`snell_math::robust::difference_of_products`] except for the sign of zero.
#[inline(always)]
fn minor<D: Doubles16>(a: D, b: D, c: D, d: D, zero: D) -> D {
    let minus_cd = zero.sub(c.mul(d));
    a.fused(b, minus_cd).sub(c.fused(d, minus_cd))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hit::Hit;
    use crate::kernel::list::packet::{PerRay, RAYS};
    use crate::kernel::list::tests::{list_of, quads};
    use crate::search::AcceptAll;
    use crate::shape::AnyShape;
    use crate::shape::Shape;
    use crate::tree::list::List;
    use crate::world::AcceleratorKind;
    use crate::world::WorldBuilder;
    use crate::world::tests::{build, levels};
    #[cfg(target_arch = "x86_64")]
    use snell_math::simd::Wide;
    use snell_math::simd::{Level, PairDoubles, Portable, Portable8, Wide8, WideToken};
    use snell_math::{DAffine3, DVec2};
    use snell_math::{DMat3, DVec3, Ray, Transform, rng};
    use std::sync::Arc;

    fn number(i: u32, k: u32) -> f64 {
        f64::from(rng::to_unit(rng::pcg4d([i, k, 5, 11])[0])) * 2.0 - 1.0
    }

    fn vector(i: u32, k: u32) -> DVec3 {
        DVec3::new(number(i, k), number(i, k + 1), number(i, k + 2))
    }

    /// The hits of many rays with a shape, in batches of sixteen.
    fn meet<D: Doubles16>(
        token: D::Token,
        list: &List,
        shape: &ListShape,
        rays: &[Ray],
    ) -> (Vec<f32>, Vec<bool>) {
        let (mut all, mut ordinary) = (Vec::new(), Vec::new());
        for sixteen in rays.as_chunks::<RAYS>().0 {
            let (t, lanes) = {
                let packet = ListPacket::<D>::new(token, list, sixteen, RAYS);
                (shape.meet(token, &packet, 0xffff), packet.ordinary)
            };
            let mut stored: PerRay<f32> = [0.0; RAYS];
            t.store(&mut stored);
            all.extend(stored);
            ordinary.extend((0..RAYS).map(|lane| lanes >> lane & 1 == 1));
        }
        (all, ordinary)
    }

    fn meet_at(
        level: Level,
        list: &List,
        shape: &ListShape,
        rays: &[Ray],
    ) -> (Vec<f32>, Vec<bool>) {
        match level.wide() {
            #[cfg(target_arch = "x86_64")]
            Some(Wide::Avx512(token)) => {
                meet::<snell_math::simd::Avx16Doubles>(token, list, shape, rays)
            }
            Some(wide) => meet::<PairDoubles<Wide8>>(WideToken::from(wide), list, shape, rays),
            None => meet::<PairDoubles<Portable8>>(Portable, list, shape, rays),
        }
    }

    /// Rays that hit a shape, pass it, run along it, and start on and in it. Sizes are relative to
    /// the size of the shape.
    fn rays_about(shape: &AnyShape, placed: &Transform, size: f64, count: u32) -> Vec<Ray> {
        let ray = |i: u32| {
            let on = |k: u32| {
                let u = DVec2::new(number(i, k), number(i, k + 1)) * 0.5 + 0.5;
                let sample = shape.sample(u).map(|sample| (sample.position, sample.normal));
                sample.unwrap_or((vector(i, k).with_z(0.0) * size, DVec3::Z))
            };
            let ((target, normal), outside) = (on(0), vector(i, 2) * size * 3.0);
            let (origin, target) = match i % 8 {
                0 => (outside, vector(i, 5) * size * 1.5),
                1 => (outside, target),
                2 => (on(8).0, target),
                3 => (on(8).0, vector(i, 5) * size),
                4 => (vector(i, 5) * 0.5 * size, target),
                // Along the surface, and along the edges of a flat shape.
                5 => (
                    target - normal.any_orthonormal_vector() * size,
                    target * (1.0 + 1e-7 * number(i, 6)),
                ),
                6 => (target.with_z(0.0) - DVec3::X * size, target.with_z(0.0)),
                _ => (outside, target.signum() * shape.bounds().max.min(DVec3::splat(size))),
            };
            let (origin, target) = (placed.point(origin).as_vec3(), placed.point(target).as_vec3());
            let length = [1.0, 1e-9, 1e9, 0.25][i as usize / 8 % 4];
            Ray::new(origin, (target - origin) * length)
        };
        (0..count).map(ray).collect()
    }

    #[test]
    fn lanes_meet_shapes_where_the_shapes_say() {
        let (mut hits, mut compared) = (0, 0);
        for shape in AnyShape::examples() {
            let bounds = shape.bounds();
            let size = if bounds.max.is_finite() { bounds.max.max_element() } else { 1.0 };
            for (turn, stretch, offset) in [
                (0.0, DVec3::ONE, DVec3::ZERO),
                (0.0, DVec3::splat(1e-3), DVec3::ONE),
                (1.0, DVec3::new(1.0, 3.0, -0.2), DVec3::new(0.5, -20.0, 3.0)),
                (2.5, DVec3::new(40.0, 700.0, 900.0), DVec3::ZERO),
            ] {
                let map = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), turn)
                    * DMat3::from_diagonal(stretch);
                let placed = Transform::new(DAffine3::from_mat3_translation(map, offset * size))
                    .expect("invertible");
                let wide = (stretch.abs().max_element() * size * 2.0) as f32;
                let at = (offset * size).as_vec3();
                let corners = [[-wide, -wide], [wide, -wide], [wide, wide], [-wide, wide]];
                let mesh = quads(&[corners.map(|[x, y]| [x + at.x, y + at.y, at.z])]);
                let mut builder = WorldBuilder::default();
                builder.add_shape(WorldBuilder::ROOT, Arc::new(shape.clone()), placed);
                let oracle = build(builder.clone(), AcceleratorKind::None, Level::Scalar);
                builder.add_mesh(WorldBuilder::ROOT, mesh);
                let world = build(builder, AcceleratorKind::Bvh, Level::Scalar);
                let list = list_of(&world).expect("a list");
                let is_for_lanes = ["sphere", "rectangle", "disk", "plane"].contains(&shape.name());
                let lane_shape = list.objects[0].shape.as_ref();
                assert_eq!(lane_shape.is_some(), is_for_lanes, "{shape:?}");
                let Some(lane_shape) = lane_shape else { continue };
                let mut rays = rays_about(&shape, &placed, size, 2000);
                // Some rays end before, at or behind the hit; other rays start there.
                for i in 0..rays.len() {
                    let t = oracle.closest_one(&rays[i], &AcceptAll).t;
                    let at_end = [t * 0.9999, t.next_down(), t, t.next_up(), t * 1.0001][i % 5];
                    let ray = rays[i];
                    rays.push(if i % 2 == 0 {
                        ray.with_t_max(at_end)
                    } else {
                        Ray { t_min: at_end, ..ray }
                    });
                }
                let expected: Vec<Hit> =
                    rays.iter().map(|ray| oracle.closest_one(ray, &AcceptAll)).collect();
                for level in levels() {
                    let (found, ordinary) = meet_at(level, list, lane_shape, &rays);
                    for ((ray, hit), (t, is_ordinary)) in
                        rays.iter().zip(&expected).zip(found.iter().zip(&ordinary))
                    {
                        if *is_ordinary {
                            assert_eq!(
                                t.to_bits(),
                                hit.t.to_bits(),
                                "{level} {shape:?} {placed:?} {ray:?} {hit:?} {t}"
                            );
                            hits += u32::from(hit.is_hit());
                            compared += 1;
                        }
                    }
                }
            }
        }
        assert!(hits > compared / 3 && compared > 100_000, "{hits} of {compared}");
    }
}
