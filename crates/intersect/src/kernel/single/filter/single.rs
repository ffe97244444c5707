//! The conservative filter of triangles with single-precision vertices, itself computed in `f32`.

use crate::exact::prepared::PreparedRay;
use crate::exact::ray::{Axes, LocalRay};
use crate::tree::block::TriangleBlock;
use snell_math::simd::Lanes8;

/// Bound on the rounding error of an edge value, relative to the largest projected |x| times the
/// largest projected |y|: the error of two products and a difference is at most `2^-22` of that;
/// doubled.
const EDGE_ERROR: f32 = 4.76837158203125e-7;

/// The triangles of a block that the ray may hit between `t_min` and `cull` (inclusive), a bit for
/// each. `cull` must be padded by the rounding of a depth (a relative `1e-6`).
#[inline(always)]
pub(crate) fn candidates<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    ray: &LocalRay,
    t_min: f32,
    cull: f32,
) -> u32 {
    let ([x0, y0, z0], [x1, y1, z1], [x2, y2, z2], zero, bound_scale, tiny) = {
        let frame = ProjectionFrame::<L>::new(token, ray);
        let [v0, v1, v2] = &block.vertices;
        (
            frame.project(token, v0),
            frame.project(token, v1),
            frame.project(token, v2),
            L::splat(token, 0.0),
            L::splat(token, EDGE_ERROR),
            L::splat(token, f32::MIN_POSITIVE),
        )
    };
    let u = x1.mul(y2).sub(y1.mul(x2));
    let v = x2.mul(y0).sub(y2.mul(x0));
    let w = x0.mul(y1).sub(y0.mul(x1));
    // A ray is certainly outside if two edges have signs that are certain and differ. NaN is never
    // certain.
    let (x, y) = (x0.abs().max(x1.abs()).max(x2.abs()), y0.abs().max(y1.abs()).max(y2.abs()));
    let bound = x.mul(y).mul(bound_scale).add(tiny);
    let outside = u.min(v).min(w).add(bound).lt(zero) & bound.lt(u.max(v).max(w));
    // A triangle is certainly too near or too far if all three corners are. (With `depth_scale` 0
    // all depths are 0 and decide nothing.)
    if ray.depth_scale == 0.0 {
        return !outside & 0xff;
    }
    let (scale, cull, start) = (
        L::splat(token, ray.depth_scale),
        L::splat(token, cull),
        L::splat(token, t_min - t_min.abs() * 1e-6),
    );
    let (d0, d1, d2) = (z0.mul(scale), z1.mul(scale), z2.mul(scale));
    let (nearest, farthest) = (d0.min(d1).min(d2), d0.max(d1).max(d2));
    let margin = place_margin(token, nearest.abs().max(farthest.abs()), x.add(y), ray.depth_scale);
    let beyond = cull.add(margin).lt(nearest) | farthest.add(margin).lt(start);
    !(outside | beyond) & 0xff
}

/// How far before the nearest or beyond the farthest corner a hit may be.
/// [`crate::exact::triangle::clamp_to_box`] clamps a hit to the box of the triangle, padded by a
/// share of the box's size. That size is at most twice the sum of the projected size (`sides`) and
/// the largest distance of a corner (`depth`).
#[inline(always)]
pub(crate) fn place_margin<L: Lanes8>(token: L::Token, depth: L, sides: L, depth_scale: f32) -> L {
    sides.mul(L::splat(token, depth_scale.abs())).add(depth).mul(L::splat(token, 4e-6))
}

/// Bound on the rounding error of an edge value, which is a difference of two products, relative to
/// the product that is rounded first: half a unit in the last place if the other product is not
/// rounded, otherwise one and a half; doubled.
pub(crate) const fn edge_error(is_fused: bool) -> f32 {
    if is_fused { f32::EPSILON } else { 2.0 * f32::EPSILON }
}

/// The triangles of a block that the line of an ordinary ray may pass through, a bit for each: all
/// except those with two edges whose signs are certain and differ. Unused lanes are unspecified.
#[inline(always)]
pub(crate) fn lines_through<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    ray: &PreparedRay,
) -> u32 {
    let [x, y, z] = ray.axes.of(&ray.origin);
    let frame = MirroredFrame {
        axes: ray.axes,
        origin: [L::splat(token, *x), L::splat(token, *y), L::splat(token, *z)],
        shear: [L::splat(token, ray.shear[0]), L::splat(token, ray.shear[1])],
    };
    let [v0, v1, v2] = &block.vertices;
    let ([x0, y0], [x1, y1], [x2, y2]) =
        (frame.project(token, v0), frame.project(token, v1), frame.project(token, v2));
    let (pu, pv, pw) = (y1.mul(x2), y2.mul(x0), y0.mul(x1));
    let (u, v, w) = (x1.mul_sub(y2, pu), x2.mul_sub(y0, pv), x0.mul_sub(y1, pw));
    let error = L::splat(token, edge_error(L::FUSED));
    let bound =
        pu.abs().max(pv.abs()).max(pw.abs()).mul_add(error, L::splat(token, f32::MIN_POSITIVE));
    // The least distance of all three values from zero on their common side; negative if the signs
    // differ.
    let inside = u.min(v).min(w).max(L::splat(token, 0.0).sub(u.max(v).max(w)));
    !inside.add(bound).signs() & 0xff
}

/// Performs [`LocalRay::project`] for eight vertices at a time, mirrored at the origin. All
/// differences are reversed (which saves a load each), so all coordinates have the opposite sign,
/// and the edge values, which are products of two coordinates, are the same.
pub(crate) struct MirroredFrame<L> {
    axes: Axes,
    origin: [L; 3],
    shear: [L; 2],
}

impl<L: Lanes8> MirroredFrame<L> {
    #[inline(always)]
    fn project(&self, token: L::Token, v: &[[f32; 8]; 3]) -> [L; 2] {
        let [x, y, z] = self.axes.of(v);
        let x = self.origin[0].sub(L::load(token, x));
        let y = self.origin[1].sub(L::load(token, y));
        let z = self.origin[2].sub(L::load(token, z));
        [x.sub(self.shear[0].mul(z)), y.sub(self.shear[1].mul(z))]
    }
}

/// Performs [`LocalRay::project`] for eight vertices at a time, by the same operations. (Plain
/// functions instead of closures, which are not always inlined; vectors must not pass through
/// calls.)
pub(crate) struct ProjectionFrame<L> {
    axes: Axes,
    origin: [L; 3],
    shear: [L; 2],
}

impl<L: Lanes8> ProjectionFrame<L> {
    #[inline(always)]
    pub fn new(token: L::Token, ray: &LocalRay) -> Self {
        Self::of(token, ray.axes, &ray.origin, &ray.shear)
    }

    #[inline(always)]
    pub fn of_prepared(token: L::Token, ray: &PreparedRay) -> Self {
        Self::of(token, ray.axes, &ray.origin, &ray.shear)
    }

    #[inline(always)]
    fn of(token: L::Token, axes: Axes, origin: &[f32; 3], shear: &[f32; 2]) -> Self {
        let [x, y, z] = axes.of(origin);
        Self {
            axes,
            origin: [L::splat(token, *x), L::splat(token, *y), L::splat(token, *z)],
            shear: [L::splat(token, shear[0]), L::splat(token, shear[1])],
        }
    }

    #[inline(always)]
    pub fn project(&self, token: L::Token, v: &[[f32; 8]; 3]) -> [L; 3] {
        let [x, y, z] = self.axes.of(v);
        let x = L::load(token, x).sub(self.origin[0]);
        let y = L::load(token, y).sub(self.origin[1]);
        let z = L::load(token, z).sub(self.origin[2]);
        [x.sub(self.shear[0].mul(z)), y.sub(self.shear[1].mul(z)), z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::ray::wide;
    use crate::exact::triangle::{exact_hit, exact_hit_on};
    use proptest::prelude::*;
    use snell_math::DRay;
    use snell_math::simd::{Level, Portable, Portable8, Wide8, WideToken};

    fn ray(o: [f32; 3], d: [f32; 3]) -> LocalRay {
        LocalRay::new(&DRay::new(wide(o), wide(d)))
    }

    fn lines_through_at_all_levels(block: &TriangleBlock, ray: &PreparedRay) -> Vec<u32> {
        let mut all = vec![lines_through::<Portable8>(Portable, block, ray)];
        if let Some(wide) = Level::best().wide() {
            all.push(lines_through::<Wide8>(WideToken::from(wide), block, ray));
        }
        all
    }

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![-4i32..=4, -4i32..=4]
            .prop_map(|i| i as f32 * 0.25)
            .boxed()
            .prop_union((-2.0f32..2.0).boxed())
    }

    fn point() -> impl Strategy<Value = [f32; 3]> {
        [coordinate(), coordinate(), coordinate()]
    }

    proptest! {
        #[test]
        fn the_filter_never_drops_a_hit(
            corners in [point(), point(), point()],
            o in point(), d in point(), scale in -30i32..30,
        ) {
            prop_assume!(d != [0.0; 3]);
            let scale = 2.0f32.powi(scale);
            let corners = corners.map(|v| v.map(|x| x * scale));
            let ray = ray(o.map(|x| x * scale), d);
            let mut block = TriangleBlock::EMPTY;
            block.set(3, &corners, 0);
            let mask = candidates::<Portable8>(Portable, &block, &ray, 0.0, f32::INFINITY);
            let mut prepared = PreparedRay::UNSET;
            let (origin, direction) = (ray.exact.origin, ray.exact.direction);
            let is_prepared = prepared.set_from_exact::<Portable8>(&origin, &direction);
            if exact_hit(&ray, &corners, 0.0).is_some() {
                prop_assert!(mask & 8 != 0);
                let is_found = |lanes: &u32| lanes & 8 != 0;
                prop_assert!(
                    !is_prepared
                        || lines_through_at_all_levels(&block, &prepared).iter().all(is_found)
                );
            }
            if is_prepared {
                let again = exact_hit_on(&prepared.exact(origin, direction), &corners, 0.0);
                prop_assert_eq!(again, exact_hit(&ray, &corners, 0.0));
            }
        }
    }
}
