//! Tests of the exact test against arithmetic on big integers.

use super::plane::{Estimate, exact_plane_distance};
use super::triangle::exact_hit;
use crate::exact::prepared::PreparedRay;
use crate::kernel::single::boxes::{box_distances, prepared_distances};
use crate::kernel::single::filter::double::{candidates, lines_through};
use crate::mesh::DTriangleMesh;
use crate::precision::Real;
use crate::precision::frame::Frame;
use crate::search::padded;
use crate::tree::block::TriangleBlock;
use crate::tree::node::{ChildRef, WideNode};
use num_bigint::{BigInt, Sign};
use proptest::prelude::*;
use snell_math::simd::{Lanes8, Portable, Portable8};
use snell_math::{Bounds3, DRay, DVec3};

/// Pseudo-random numbers from a counter (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A uniform number in [-1, 1).
    fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    /// A power of ten with a random exponent between the two.
    fn size(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(low + (high - low) * (self.signed() * 0.5 + 0.5))
    }
}

/// Number of bits of fixed-point numbers after the binary point.
const PLACES: i32 = 330;

/// Converts `x` to fixed point without loss of a bit.
fn fixed(x: f64) -> BigInt {
    let bits = x.to_bits();
    let exponent = (bits >> 52 & 0x7ff) as i32;
    if x == 0.0 {
        return BigInt::ZERO;
    }
    let significand = BigInt::from(bits & ((1 << 52) - 1) | 1 << 52);
    let shift = exponent - 1075 + PLACES;
    assert!(exponent > 0 && shift >= 0, "{x:e} is below the fixed point of this test");
    let value: BigInt = significand << shift;
    if x < 0.0 { -value } else { value }
}

fn fixed3(v: DVec3) -> [BigInt; 3] {
    v.to_array().map(fixed)
}

fn minus(a: &[BigInt; 3], b: &[BigInt; 3]) -> [BigInt; 3] {
    std::array::from_fn(|i| &a[i] - &b[i])
}

fn determinant(a: &[BigInt; 3], b: &[BigInt; 3], c: &[BigInt; 3]) -> BigInt {
    (0..3)
        .map(|k| (&a[(k + 1) % 3] * &b[(k + 2) % 3] - &a[(k + 2) % 3] * &b[(k + 1) % 3]) * &c[k])
        .sum()
}

/// The ray parameter of the plane as a quotient of integers, and whether the line passes through
/// the closed triangle.
fn exact(ray: &DRay, corners: &[DVec3; 3]) -> (BigInt, BigInt, bool) {
    let (o, d) = (fixed3(ray.origin), fixed3(ray.direction));
    let v = corners.map(|v| minus(&fixed3(v), &o));
    let (e1, e2) = (minus(&v[1], &v[0]), minus(&v[2], &v[0]));
    let sides = [0, 1, 2].map(|i| determinant(&v[(i + 1) % 3], &v[(i + 2) % 3], &d).sign());
    let inside = !(sides.contains(&Sign::Plus) && sides.contains(&Sign::Minus));
    (determinant(&e1, &e2, &v[0]), determinant(&e1, &e2, &d), inside)
}

/// The error of `t` in quarters of a unit in its last place, rounded up.
fn error(t: f64, height: &BigInt, speed: &BigInt) -> u64 {
    let difference = (height << PLACES as usize) - fixed(t) * speed;
    let unit = fixed(t.abs().next_up() - t.abs()) * speed;
    let (difference, unit) = (difference.magnitude() << 2usize, unit.magnitude());
    u64::try_from((difference + unit - 1u32) / unit).unwrap_or(u64::MAX)
}

/// A triangle and a ray aimed at it; each kind is difficult in a different way.
fn aimed(random: &mut Random, kind: usize) -> (DRay, [DVec3; 3]) {
    let utm = DVec3::new(500_000.123, 4_649_776.22, 300.0);
    let (center, size, distance) = match kind {
        // Around the origin; a room whose walls are as large as their distance; far away; in a
        // city.
        0 => (DVec3::ZERO, 1.0, 3.0),
        1 => (random.vector(), 10.0, 2.0),
        2 => (random.vector() * 1e3, 1.0, random.size(3.0, 9.0)),
        3 => (utm + random.vector() * 1e3, 1e-3, random.size(-3.0, 4.0)),
        // Slivers, grazing rays, a start close to the surface, and an arbitrary scale.
        4 | 5 => (random.vector(), 1.0, 2.0),
        6 => (utm, 1.0, random.size(-9.0, 0.0)),
        _ => (DVec3::ZERO, random.size(-40.0, 40.0), 0.0),
    };
    let mut v: [DVec3; 3] = std::array::from_fn(|_| center + random.vector() * size);
    if kind == 4 {
        v[2] = v[1] + (v[1] - v[0]) * random.signed() + random.vector() * random.size(-17.0, -3.0);
    }
    let (a, b) = (random.signed().abs(), random.signed().abs());
    let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
    let target = v[0] + (v[1] - v[0]) * a + (v[2] - v[0]) * b;
    let mut away = random.vector() * if distance == 0.0 { size } else { distance };
    if kind == 5 {
        away = (v[1] - v[0]) * random.signed()
            + (v[2] - v[0]) * random.signed()
            + away * random.size(-17.0, -1.0);
    }
    let origin = target + away;
    (DRay::new(origin, (target - origin) * random.size(-3.0, 3.0)), v)
}

#[test]
fn distances_are_within_two_units_in_the_last_place_of_exact_arithmetic() {
    let mut random = Random(1);
    let (mut hits, mut grazed, mut worst) = (0, 0, 0);
    let mut kinds = [0; 8];
    while hits < 100_000 {
        let kind = (hits + grazed) % 8;
        let (ray, corners) = aimed(&mut random, kind);
        let found = exact_hit(&ray, &corners, f64::NEG_INFINITY);
        let (height, speed, inside) = exact(&ray, &corners);
        if speed == BigInt::ZERO {
            grazed += 1;
            continue;
        }
        let plane = Estimate::of(&ray, &corners, f64::NEG_INFINITY).expect("a distance").distance(
            &ray,
            &corners,
            f64::NEG_INFINITY,
        );
        let off = error(plane, &height, &speed);
        assert!(off <= 8, "{off} quarters of a unit: {ray:?} {corners:?}");
        if (hits + grazed) % 16 < 8 {
            let off = error(exact_plane_distance(&ray, &corners), &height, &speed);
            assert!(off <= 3, "{off} quarters of a unit: {ray:?} {corners:?}");
        }
        match found {
            Some((t, _)) if inside => {
                hits += 1;
                kinds[kind] += 1;
                worst = worst.max(off);
                assert_eq!(
                    t, plane,
                    "the box moves no distance of a triangle that is met: {ray:?} {corners:?}"
                );
            }
            // By rounding, the projected triangle is hit and the true one is not, or the reverse.
            _ => grazed += 1,
        }
    }
    eprintln!(
        "{hits} hits, {grazed} beside the triangle, largest error {} units",
        worst as f64 / 4.0
    );
    assert!(kinds.iter().all(|&n| n > 5_000), "{kinds:?}");
    assert!(grazed < hits);
}

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![-4i32..=4, -4i32..=4]
        .prop_map(|i| f64::from(i) * 0.25)
        .boxed()
        .prop_union((-2.0f64..2.0).boxed())
}

fn point() -> impl Strategy<Value = DVec3> {
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| DVec3::new(x, y, z))
}

proptest! {
    /// The ray may start far away, and the shadow may be that of a mesh much larger than the
    /// triangle.
    #[test]
    fn the_filter_never_drops_a_hit(
        v in [point(), point(), point()],
        (o, d) in (point(), point()),
        (far, scale, around) in (-20i32..40, -300i32..300, 0i32..30),
    ) {
        prop_assume!(d != DVec3::ZERO);
        let (far, scale) = (2f64.powi(far), 2f64.powi(scale));
        let place = DVec3::new(500_000.123, 4_649_776.22, 300.0);
        let corners = v.map(|v| (v + place) * scale);
        let origin = (o + d * -far + place) * scale;
        let mesh = DTriangleMesh {
            positions: [&corners[..], &[(place + 2f64.powi(around)) * scale]].concat(),
            indices: vec![[0, 1, 2], [0, 1, 3]],
        };
        let mut frame = Frame::of(&mesh.bounds());
        let shadow = frame.shadow(&mesh);
        let ray = DRay::new(origin, d);
        let local = frame.local_ray(&ray);
        let mut block = TriangleBlock::EMPTY;
        block.set(3, &shadow.corners(0).map(|p| p.to_array()), 0);
        let mask = candidates::<Portable8>(Portable, &block, &local, 0.0, f32::INFINITY);
        let hit = exact_hit(&ray, &mesh.corners(0), 0.0);
        if let Some((t, _)) = hit.filter(|_| !mesh.is_degenerate(0)) {
            prop_assert!(mask & 8 != 0);
            // The filter must keep the hit also with the smallest limit that includes it.
            let cull = padded(t.above());
            let mask = candidates::<Portable8>(Portable, &block, &local, t.below(), cull);
            prop_assert!(mask & 8 != 0);
            // The box test must keep the hit.
            let corners = shadow.corners(0);
            let bounds = Bounds3::of(corners);
            let mut node = WideNode::EMPTY;
            node.set(2, &bounds, ChildRef::triangles(0, 1));
            let (enter, leave) =
                box_distances::<Portable8>(Portable, &node, &local, t.below(), cull);
            prop_assert_eq!(enter.le(leave), 4);
            // The fast kernels must keep the hit.
            let mut prepared = PreparedRay::UNSET;
            if frame.prepare::<Portable8>(&mut prepared, &ray) {
                let (lanes, (enter, leave)) = (
                        lines_through::<Portable8>(Portable, &block, &prepared),
                        prepared_distances::<Portable8>(
                            Portable, &node, &prepared, t.below(), cull
                        ),
                    );
                prop_assert!(lanes & 8 != 0 && enter.le(leave) == 4);
            }
        }
    }

    /// Rays through the middle vertex of a closed fan, or through its edges, hit the fan exactly
    /// once.
    #[test]
    fn a_fan_holds_a_ray_through_its_middle_once(
        (middle, o) in (point(), point()),
        (n, phase) in (3usize..9, 0.0f64..1.0),
        (far, at) in (-20i32..40, 0.0f64..1.0),
    ) {
        let offset = DVec3::new(1.0, -0.7, 0.3) * 2f64.powi(far);
        let middle = middle + offset;
        let origin = o + offset;
        prop_assume!((middle - origin).length() > 0.1);
        let z = (middle - origin).normalize();
        let (x, y) = z.any_orthonormal_pair();
        let rim: Vec<DVec3> = (0..n).map(|i| {
            let angle = (i as f64 + phase) / n as f64 * std::f64::consts::TAU;
            middle + x * angle.cos() + y * angle.sin() + z * (phase - 0.5)
        }).collect();
        // On an edge, a ray may leave the fan only at its rim. Hits behind the origin do not count:
        // if the fan opens towards the origin, the line of the ray also passes through its other
        // side.
        for target in rim.iter().map(|r| middle + (*r - middle) * (at * 0.9)).chain([middle]) {
            let ray = DRay::new(origin, target - origin);
            let count = (0..n)
                .filter(|&i| exact_hit(&ray, &[middle, rim[i], rim[(i + 1) % n]], 0.0).is_some())
                .count();
            prop_assert_eq!(count, 1);
        }
    }
}
