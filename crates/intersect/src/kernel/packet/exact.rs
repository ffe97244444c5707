//! The exact test for several pairs of a ray and a triangle at once.
//!
//! The operations and their order are those of [`crate::exact::triangle::exact_hit`], so the
//! results have the same bits. The rare cases of that function (ties, rays in the plane of the
//! triangle, hits outside its box by rounding) are reported as undecided.

use super::frustum::{Packet, PerRay};
use crate::exact::ray::Axes;
use crate::exact::triangle::PLACE_TOLERANCE;
use crate::precision::Real;
use crate::tree::Blocks;
use crate::tree::block::TriangleBlock;
use snell_math::simd::{DoubleLanes, DoublesOf, Lanes16, WideLanes};
use std::mem::MaybeUninit;

/// The number of pairs that are tested together.
pub(super) const PAIRS: usize = 8;

/// Pairs of rays, given by their lanes, and triangles, given by their places: eight times the
/// number of the block plus the lane in it.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Pairs {
    pub triangles: [u32; PAIRS],
    pub rays: [u32; PAIRS],
    pub count: usize,
    /// A bit for each ray that is in a pair.
    pub mask: u32,
}

impl Pairs {
    pub const NONE: Self = Self { triangles: [0; PAIRS], rays: [0; PAIRS], count: 0, mask: 0 };

    /// Adds a pair. The pairs must not be full.
    #[inline(always)]
    pub fn push(&mut self, ray: u32, triangle: u32) {
        self.push_if(ray, triangle, true);
    }

    /// Adds a pair if `is_one`. The pair is stored in any case, so that nothing branches on the
    /// condition.
    #[inline(always)]
    pub fn push_if(&mut self, ray: u32, triangle: u32, is_one: bool) {
        self.rays[self.count & (PAIRS - 1)] = ray;
        self.triangles[self.count & (PAIRS - 1)] = triangle;
        self.count += usize::from(is_one);
        self.mask |= u32::from(is_one) << ray;
    }

    /// Removes all pairs.
    #[inline(always)]
    pub fn clear(&mut self) {
        (self.count, self.mask) = (0, 0);
    }

    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.count == PAIRS
    }

    /// The block of the triangle of a pair, and its lane in the block.
    #[inline(always)]
    pub fn place(&self, pair: usize) -> (usize, usize) {
        let triangle = self.triangles[pair & (PAIRS - 1)] as usize;
        (triangle >> 3, triangle & 7)
    }
}

/// The results of tested pairs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found<R> {
    pub t: [R; PAIRS],
    pub b1: [R; PAIRS],
    pub b2: [R; PAIRS],
    /// A bit for each pair that is a hit.
    pub hits: u32,
    /// A bit for each pair that is not decided.
    pub uncertain: u32,
}

impl<R: Real> Found<R> {
    pub const NONE: Self = Self {
        t: [R::ZERO; PAIRS],
        b1: [R::ZERO; PAIRS],
        b2: [R::ZERO; PAIRS],
        hits: 0,
        uncertain: 0,
    };
}

/// Tests up to eight pairs, at least one. The results of unused pairs are meaningless.
#[inline(always)]
pub(crate) fn exact_hits<W: Lanes16>(
    token: W::Token,
    blocks: &Blocks,
    packet: &Packet,
    pairs: &Pairs,
    found: &mut Found<f32>,
) {
    let half = W::half_token(token);
    let corners = corners::<W::Half>(half, blocks, pairs);
    let frame = Frame::<W::Half>::new::<W>(token, packet, pairs);
    let projected =
        [frame.project(&corners[0]), frame.project(&corners[1]), frame.project(&corners[2])];
    let mut first = 0;
    while first < pairs.count {
        test::<W>(
            token,
            [&projected[0], &projected[1], &projected[2]],
            &corners,
            packet,
            pairs,
            first,
            found,
        );
        first += W::HalfDoubles::LANES;
    }
}

/// The corners of the triangles of pairs. (Mostly these are in a few blocks, so one or two
/// permutations for each row of a block are enough, instead of a load for each number.)
#[inline(always)]
fn corners<L: WideLanes>(token: L::Token, blocks: &Blocks, pairs: &Pairs) -> [[L; 3]; 3] {
    let (places, numbers) = (&pairs.triangles, pairs.triangles.map(|place| place >> 3));
    let mut number = numbers[0];
    let mut room = MaybeUninit::uninit();
    let mut corners =
        rows::<L>(token, blocks.unpacked::<L>(token, number as usize, &mut room), places);
    let mut rest = u32::MAX >> (32 - pairs.count) & !L::places_of(token, number, &numbers);
    while rest != 0 {
        number = numbers[rest.trailing_zeros() as usize & (PAIRS - 1)];
        let own = L::places_of(token, number, &numbers);
        rest &= !own;
        let others =
            rows::<L>(token, blocks.unpacked::<L>(token, number as usize, &mut room), places);
        for (corner, other) in corners.iter_mut().zip(others) {
            *corner = [
                corner[0].replace(own, other[0]),
                corner[1].replace(own, other[1]),
                corner[2].replace(own, other[2]),
            ];
        }
    }
    corners
}

/// The corners of eight triangles, as if all were in one block.
#[inline(always)]
fn rows<L: WideLanes>(token: L::Token, block: &TriangleBlock, lanes: &[u32; PAIRS]) -> [[L; 3]; 3] {
    let [a, b, c] = &block.vertices;
    [
        [
            L::load_permuted(token, &a[0], lanes),
            L::load_permuted(token, &a[1], lanes),
            L::load_permuted(token, &a[2], lanes),
        ],
        [
            L::load_permuted(token, &b[0], lanes),
            L::load_permuted(token, &b[1], lanes),
            L::load_permuted(token, &b[2], lanes),
        ],
        [
            L::load_permuted(token, &c[0], lanes),
            L::load_permuted(token, &c[1], lanes),
            L::load_permuted(token, &c[2], lanes),
        ],
    ]
}

/// The projections of the rays of the pairs; see [`crate::exact::triangle::Projection::project`].
struct Frame<L> {
    axes: Axes,
    origin: [L; 3],
    shear: [L; 2],
}

impl<L: WideLanes> Frame<L> {
    #[inline(always)]
    fn new<W: Lanes16<Half = L>>(token: W::Token, packet: &Packet, pairs: &Pairs) -> Self {
        let half = W::half_token(token);
        let sign = L::splat(half, packet.sign);
        let rays = &pairs.rays;
        let shear = [
            W::gather(token, &packet.slope[0], rays).mul(sign),
            W::gather(token, &packet.slope[1], rays).mul(sign),
        ];
        let origin = if packet.kind.common {
            let [x, y, z] = packet.axes.of(&packet.kind.apex);
            [L::splat(half, *x), L::splat(half, *y), L::splat(half, *z)]
        } else {
            let origin = &packet.projected_origin;
            [
                W::gather(token, &origin[0], rays),
                W::gather(token, &origin[1], rays),
                W::gather(token, &origin[2], rays),
            ]
        };
        Self { axes: packet.axes, origin, shear }
    }

    #[inline(always)]
    fn project(&self, v: &[L; 3]) -> [L; 2] {
        let [x, y, z] = self.axes.of(v);
        let x = x.sub(self.origin[0]);
        let y = y.sub(self.origin[1]);
        let z = z.sub(self.origin[2]);
        [x.sub(self.shear[0].mul(z)), y.sub(self.shear[1].mul(z))]
    }
}

/// Origins and directions of some of the pairs, by axis of the group.
#[inline(always)]
fn rays_of<W: Lanes16>(
    token: W::Token,
    packet: &Packet,
    pairs: &Pairs,
    first: usize,
) -> [[W::HalfDoubles; 3]; 2] {
    let (exact, rays) = (&packet.exact, &pairs.rays);
    if packet.kind.rounded {
        return [
            picked3::<W>(token, &exact[0], rays, first),
            picked3::<W>(token, &exact[1], rays, first),
        ];
    }
    let [dx, dy, dz] = &packet.direction;
    let direction = [
        W::HalfDoubles::of(token, W::gather(token, dx, rays), first),
        W::HalfDoubles::of(token, W::gather(token, dy, rays), first),
        W::HalfDoubles::of(token, W::gather(token, dz, rays), first),
    ];
    if packet.kind.common {
        let [x, y, z] = packet.kind.apex;
        let origin = [
            W::HalfDoubles::splat(token, x.into()),
            W::HalfDoubles::splat(token, y.into()),
            W::HalfDoubles::splat(token, z.into()),
        ];
        return [origin, direction];
    }
    let [x, y, z] = &packet.projected_origin;
    let origin = packet.axes.back([
        W::HalfDoubles::of(token, W::gather(token, x, rays), first),
        W::HalfDoubles::of(token, W::gather(token, y, rays), first),
        W::HalfDoubles::of(token, W::gather(token, z, rays), first),
    ]);
    [origin, direction]
}

/// The values of the given rays, by axis.
#[inline(always)]
fn picked3<W: Lanes16>(
    token: W::Token,
    [x, y, z]: &[PerRay<f64>; 3],
    rays: &[u32; PAIRS],
    first: usize,
) -> [W::HalfDoubles; 3] {
    [
        W::HalfDoubles::gather(token, x, rays, first),
        W::HalfDoubles::gather(token, y, rays, first),
        W::HalfDoubles::gather(token, z, rays, first),
    ]
}

/// Tests one register of pairs in double precision.
#[inline(always)]
fn test<W: Lanes16>(
    token: W::Token,
    [a, b, c]: [&[W::Half; 2]; 3],
    corners: &[[W::Half; 3]; 3],
    packet: &Packet,
    pairs: &Pairs,
    first: usize,
    found: &mut Found<f32>,
) {
    let all = (1 << W::HalfDoubles::LANES) - 1;
    let (p0, p1, p2) =
        (exact2::<W>(token, a, first), exact2::<W>(token, b, first), exact2::<W>(token, c, first));
    let (w0, s0) = edge(p1, p2);
    let (w1, s1) = edge(p2, p0);
    let (w2, s2) = edge(p0, p1);
    let inside = (s0[0] & s1[0] & s2[0]) | (s0[1] & s1[1] & s2[1]);
    // Ties and NaN are uncertain.
    let mut uncertain = !((s0[0] | s0[1]) & (s1[0] | s1[1]) & (s2[0] | s2[1])) & all;
    if inside | uncertain == 0 {
        return;
    }
    let [c0, c1, c2] = [
        exact3::<W>(token, &corners[0], first),
        exact3::<W>(token, &corners[1], first),
        exact3::<W>(token, &corners[2], first),
    ];
    let [origin, direction] = rays_of::<W>(token, packet, pairs, first);
    let t_min = W::HalfDoubles::of(token, W::gather(token, &packet.t_min, &pairs.rays), first);
    let relative = [minus(c0, origin), minus(c1, origin), minus(c2, origin)];
    let normal = cross(minus(c1, c0), minus(c2, c0));
    let t = dot(normal, relative[0]).div(dot(normal, direction));
    uncertain |= !t.abs().lt(W::HalfDoubles::splat(token, f64::INFINITY)) & all;
    let beyond = t_min.lt(t);
    if inside & beyond | uncertain == 0 {
        return;
    }
    let scale = W::HalfDoubles::splat(token, 1.0).div(w0.add(w1).add(w2));
    let (b1, b2) = (w1.mul(scale), w2.mul(scale));
    let [r0, r1, r2] = relative;
    let low =
        [r0[0].min(r1[0]).min(r2[0]), r0[1].min(r1[1]).min(r2[1]), r0[2].min(r1[2]).min(r2[2])];
    let high =
        [r0[0].max(r1[0]).max(r2[0]), r0[1].max(r1[1]).max(r2[1]), r0[2].max(r1[2]).max(r2[2])];
    let size = high[0].sub(low[0]).max(high[1].sub(low[1])).max(high[2].sub(low[2]));
    // Certainly near the projected point: decided without divisions, so a little stricter than
    // necessary.
    let [[.., z0], [.., z1], [.., z2]] =
        [packet.axes.of(&r0), packet.axes.of(&r1), packet.axes.of(&r2)];
    let b0 = W::HalfDoubles::splat(token, 1.0).sub(b1).sub(b2);
    let place = z0.mul(b0).add(z1.mul(b1)).add(z2.mul(b2));
    let reach =
        place.abs().add(size).mul(W::HalfDoubles::splat(token, PLACE_TOLERANCE * (1.0 - 1e-9)));
    let mut in_place = place.sub(t.mul(*packet.axes.of(&direction)[2])).abs().le(reach);
    let padding = size.mul(W::HalfDoubles::splat(token, 0.8e-6));
    for axis in 0..3 {
        let point = direction[axis].mul(t);
        let margin = point.abs().mul(W::HalfDoubles::splat(token, 1e-8));
        in_place &= low[axis].sub(padding).le(point.add(margin))
            & point.sub(margin).le(high[axis].add(padding));
    }
    uncertain |= inside & beyond & !in_place;
    found.hits |= (inside & beyond & !uncertain) << first;
    found.uncertain |= uncertain << first;
    t.store_rounded_from(&mut found.t, first);
    b1.store_rounded_from(&mut found.b1, first);
    b2.store_rounded_from(&mut found.b2, first);
}

/// The 2D values of some of the pairs in double precision.
#[inline(always)]
fn exact2<W: Lanes16>(token: W::Token, v: &[W::Half; 2], first: usize) -> [W::HalfDoubles; 2] {
    [W::HalfDoubles::of(token, v[0], first), W::HalfDoubles::of(token, v[1], first)]
}

/// The 3D values of some of the pairs in double precision.
#[inline(always)]
pub(super) fn exact3<W: Lanes16>(
    token: W::Token,
    v: &[W::Half; 3],
    first: usize,
) -> [W::HalfDoubles; 3] {
    [
        W::HalfDoubles::of(token, v[0], first),
        W::HalfDoubles::of(token, v[1], first),
        W::HalfDoubles::of(token, v[2], first),
    ]
}

/// The signed area of the edge test, by the operations of the function with this name in the exact
/// test. The masks have the lanes where the area is certainly positive and certainly negative.
#[inline(always)]
fn edge<D: DoubleLanes>(p: [D; 2], q: [D; 2]) -> (D, [u32; 2]) {
    let (a, b) = (p[0].mul(q[1]), p[1].mul(q[0]));
    (a.sub(b), [b.lt(a), a.lt(b)])
}

#[inline(always)]
pub(super) fn minus<D: DoubleLanes>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

#[inline(always)]
pub(super) fn cross<D: DoubleLanes>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [
        a[1].mul(b[2]).sub(b[1].mul(a[2])),
        a[2].mul(b[0]).sub(b[2].mul(a[0])),
        a[0].mul(b[1]).sub(b[0].mul(a[1])),
    ]
}

#[inline(always)]
pub(super) fn dot<D: DoubleLanes>(a: [D; 3], b: [D; 3]) -> D {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}
