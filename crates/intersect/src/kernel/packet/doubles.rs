//! The exact test in double precision for four pairs of a ray and a triangle at once.
//!
//! The operations and their order are those of [`crate::exact::double::triangle::exact_hit`], so
//! the results have the same bits. The rare cases of that function (hits on edges, rays in the
//! plane of the triangle, numbers out of range) are reported as undecided.

use super::exact::{Found, Pairs, cross, dot, minus};
use super::frustum::Packet;
use crate::exact::double::plane::{CERTAIN, LARGE, ROUGH, TINY, determinants};
use crate::precision::DoubleData;
use crate::tree::GroupTree;
use snell_math::DVec3;
use snell_math::simd::Lanes4;

/// Tests up to eight pairs, like [`super::exact::exact_hits`]. In contrast to that function, unused
/// pairs are read too: they must be valid for this tree, or those of [`Pairs::NONE`].
#[inline(always)]
pub(crate) fn exact_hits<D: Lanes4>(
    token: D::Token,
    data: &DoubleData,
    tree: &GroupTree,
    packet: &Packet,
    pairs: &Pairs,
    found: &mut Found<f64>,
) {
    let mut from = 0;
    while from < pairs.count {
        let corners = [
            corners(data, tree, pairs, from),
            corners(data, tree, pairs, from + 1),
            corners(data, tree, pairs, from + 2),
            corners(data, tree, pairs, from + 3),
        ];
        test::<D>(token, corners, packet, pairs, from, found);
        from += 4;
    }
}

/// The corners of the triangle of a pair, as nine numbers.
#[inline(always)]
fn corners<'a>(
    data: &'a DoubleData,
    tree: &GroupTree,
    pairs: &Pairs,
    pair: usize,
) -> &'a [DVec3; 3] {
    let (block, lane) = pairs.place(pair);
    let (geometry, triangle) = tree.triangle(tree.blocks.id(block, lane));
    data.corners(geometry, triangle)
}

/// Four of the nine coordinates of three corners, from index `first`.
#[inline(always)]
fn four(corners: &[DVec3; 3], first: usize) -> &[f64; 4] {
    const { assert!(size_of::<[DVec3; 3]>() == 9 * size_of::<f64>()) };
    let first = first.min(5);
    // SAFETY: three vectors are nine contiguous numbers (`repr(C)`), and four remain from the sixth
    // at the latest.
    unsafe { &*corners.as_ptr().cast::<f64>().add(first).cast::<[f64; 4]>() }
}

/// Four of the nine coordinates of each of four triangles, from index `first`.
#[inline(always)]
fn columns<D: Lanes4>(token: D::Token, corners: &[&[DVec3; 3]; 4], first: usize) -> [D; 4] {
    let [a, b, c, d] = corners;
    let rows = [four(a, first), four(b, first), four(c, first), four(d, first)];
    D::load_columns(token, rows)
}

#[inline(always)]
fn test<D: Lanes4>(
    token: D::Token,
    corners: [&[DVec3; 3]; 4],
    packet: &Packet,
    pairs: &Pairs,
    from: usize,
    found: &mut Found<f64>,
) {
    let r = &pairs.rays;
    let rows = [
        r[from] as usize & 15,
        r[from + 1] as usize & 15,
        r[from + 2] as usize & 15,
        r[from + 3] as usize & 15,
    ];
    let (o, d) = (&packet.rays.origin, &packet.rays.direction);
    let [ox, oy, oz, t_min] =
        D::load_columns(token, [&o[rows[0]], &o[rows[1]], &o[rows[2]], &o[rows[3]]]);
    let [dx, dy, dz, _] =
        D::load_columns(token, [&d[rows[0]], &d[rows[1]], &d[rows[2]], &d[rows[3]]]);
    let ([x0, y0, z0, x1], [y1, z1, x2, y2], [.., z2]) = (
        columns::<D>(token, &corners, 0),
        columns::<D>(token, &corners, 4),
        columns::<D>(token, &corners, 5),
    );
    let corners = [[x0, y0, z0], [x1, y1, z1], [x2, y2, z2]];
    let (origin, direction) = ([ox, oy, oz], [dx, dy, dz]);
    let relative =
        [minus(corners[0], origin), minus(corners[1], origin), minus(corners[2], origin)];
    // Most rays leave a surface, and the surface's plane is behind their start; the estimate is
    // that of [`crate::exact::double::plane::Estimate`].
    let (e1, e2) = (minus(corners[1], corners[0]), minus(corners[2], corners[0]));
    let (normal, zero) = (cross(e1, e2), D::splat(token, 0.0));
    let (height, speed) = (dot(normal, relative[0]), dot(normal, direction));
    let (e1, e2, r, pace) = (abs(e1), abs(e2), abs(relative[0]), abs(direction));
    let sizes = [
        e1[1].mul(e2[2]).add(e1[2].mul(e2[1])),
        e1[2].mul(e2[0]).add(e1[0].mul(e2[2])),
        e1[0].mul(e2[1]).add(e1[1].mul(e2[0])),
    ];
    let (heights, speeds) = (dot(sizes, r), dot(sizes, pace));
    let sum = add(add(add(r, pace), e1), e2);
    let in_range = D::splat(token, TINY).lt(heights.min(speeds))
        & sum[0].add(sum[1]).add(sum[2]).lt(D::splat(token, LARGE));
    let error = heights.add(t_min.abs().mul(speeds)).mul(D::splat(token, ROUGH));
    let ahead = height.sub(t_min.mul(speed));
    let forward = zero.lt(speed);
    let behind = (ahead.lt(error.negated()) & forward) | (error.lt(ahead) & !forward);
    let behind = behind & in_range & speeds.mul(D::splat(token, ROUGH)).lt(speed.abs());
    if behind == 0xf {
        return;
    }
    // The sheared projection along the ray.
    let [x, y, z] = packet.axes.of(&direction);
    let per_z = D::splat(token, 1.0).div(*z);
    let shear = [x.mul(per_z), y.mul(per_z)];
    let projected = [
        project(&relative[0], packet, shear),
        project(&relative[1], packet, shear),
        project(&relative[2], packet, shear),
    ];
    let (w0, up0, down0) = edge(token, projected[1], projected[2]);
    let (w1, up1, down1) = edge(token, projected[2], projected[0]);
    let (w2, up2, down2) = edge(token, projected[0], projected[1]);
    let inside = (up0 & up1 & up2) | (down0 & down1 & down2);
    let outside = (up0 | up1 | up2) & (down0 | down1 | down2);
    let hopeful = inside & !behind;
    let mut uncertain = !(inside | outside | behind) & 0xf;
    if hopeful != 0 {
        let [w0, w1, w2] = [w0.abs(), w1.abs(), w2.abs()];
        let scale = D::splat(token, 1.0).div(w0.add(w1).add(w2));
        let (height, speed) = determinants(&corners, &origin, &direction);
        let t = height.divided_by(speed);
        let infinite = D::splat(token, f64::INFINITY);
        let mut certain = in_range & heights.mul(D::splat(token, CERTAIN)).lt(height.high.abs());
        certain &= speeds.mul(D::splat(token, CERTAIN)).lt(speed.high.abs());
        certain &= zero.lt(scale)
            & scale.lt(infinite)
            & t.abs().lt(infinite)
            & in_box(token, &relative, &direction, t);
        uncertain |= hopeful & !certain;
        found.hits |= (hopeful & certain & t_min.lt(t)) << from;
        // Adding 0 turns -0 into +0.
        t.add(zero).store(&mut found.t.as_chunks_mut::<4>().0[usize::from(from >= 4)]);
        w1.mul(scale).store(&mut found.b1.as_chunks_mut::<4>().0[usize::from(from >= 4)]);
        w2.mul(scale).store(&mut found.b2.as_chunks_mut::<4>().0[usize::from(from >= 4)]);
    }
    found.uncertain |= uncertain << from;
}

/// The pairs whose point at `t` is in the box of the corners, by the operations of
/// [`crate::exact::triangle::clamp_to_box`].
#[inline(always)]
fn in_box<D: Lanes4>(token: D::Token, [r0, r1, r2]: &[[D; 3]; 3], direction: &[D; 3], t: D) -> u32 {
    let low =
        [r0[0].min(r1[0]).min(r2[0]), r0[1].min(r1[1]).min(r2[1]), r0[2].min(r1[2]).min(r2[2])];
    let high =
        [r0[0].max(r1[0]).max(r2[0]), r0[1].max(r1[1]).max(r2[1]), r0[2].max(r1[2]).max(r2[2])];
    let size = high[0].sub(low[0]).max(high[1].sub(low[1])).max(high[2].sub(low[2]));
    let padding = size.mul(D::splat(token, 0.8e-6));
    let mut inside = 0xf;
    for axis in 0..3 {
        let point = direction[axis].mul(t);
        let margin = point.abs().mul(D::splat(token, 1e-8));
        inside &= low[axis].sub(padding).le(point.add(margin))
            & point.sub(margin).le(high[axis].add(padding));
    }
    inside
}

/// Projects a vertex as the exact test does.
#[inline(always)]
fn project<D: Lanes4>(relative: &[D; 3], packet: &Packet, shear: [D; 2]) -> [D; 2] {
    let [x, y, z] = packet.axes.of(relative);
    [x.sub(shear[0].mul(*z)), y.sub(shear[1].mul(*z))]
}

/// The signed area of the edge test, by the operations of the function with this name in the exact
/// test. The masks have the lanes where the area is certainly positive and certainly negative.
#[inline(always)]
fn edge<D: Lanes4>(token: D::Token, p: [D; 2], q: [D; 2]) -> (D, u32, u32) {
    let (a, b) = (p[0].mul(q[1]), p[1].mul(q[0]));
    let value = a.sub(b);
    let bound = a
        .abs()
        .add(b.abs())
        .mul(D::splat(token, f64::EPSILON))
        .add(D::splat(token, f64::MIN_POSITIVE));
    (value, bound.lt(value), value.lt(bound.negated()))
}

#[inline(always)]
fn add<D: Lanes4>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[0].add(b[0]), a[1].add(b[1]), a[2].add(b[2])]
}

#[inline(always)]
fn abs<D: Lanes4>(a: [D; 3]) -> [D; 3] {
    [a[0].abs(), a[1].abs(), a[2].abs()]
}
