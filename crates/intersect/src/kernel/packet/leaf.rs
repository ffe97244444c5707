//! The triangles of a block that the rays of a packet may hit or certainly hit, and the distances
//! of the hits.
//!
//! Relative to a point near the ray origins, the signed area of a ray and an edge is the dot
//! product of the ray's direction with a vector that depends on the edge alone (Plücker
//! coordinates; for a common origin as in Benthin, Realtime Ray Tracing on Current CPU
//! Architectures, 2006). So the vectors of the edges of eight triangles are computed together, and
//! then each triangle is tested against all rays together. The test is conservative: no hit of the
//! exact test is rejected, and certain hits are hits of the exact test.

use super::edges::{Areas, LineLanes, PlaneLanes, TriangleLanes, of};
use super::frustum::Packet;
use super::planes::{Planes, SeenCorners};
use super::rays::PacketRays;
use crate::exact::ray::Axes;
use crate::kernel::packet::PacketTests;
use crate::tree::GroupTree;
use crate::tree::block::TriangleBlock;
use crate::tree::node::ChildRef;
use snell_math::simd::{Lanes8, Lanes16};
use std::mem::MaybeUninit;

/// Half a unit in the last place of 1.
pub(super) const ROUNDING: f32 = f32::EPSILON / 2.0;

/// Bound on the errors of signed areas, relative to the distance of the triangle (from the common
/// point and from the starts of rays) times the length of the longer of two of its edges. The
/// errors are the differences both from the true areas and from those that the exact test projects.
///
/// With unit `2^-24`, distances up to `R` and edges up to `L`: the errors of the coordinates of `r`
/// and `e` are 1 of `R` and `L`, so those of a product of both are 8 `RL`. Slopes are at most 1.25
/// with an error of 1, so the error of an area is 50 `RL`, and 60 with the contribution of the
/// position of the ray; that of the third area, from the sum of all (with an error of 50 `LL`), is
/// 160. The exact test projects vertices with an error of 4.75 `R`. A projected triangle around the
/// ray has its corners, and edges, within 4.5 `L`, in both coordinates: the errors of its areas are
/// 4.75 times 4 times 4.5, about 86 `RL`.
const AREA_ERROR: f32 = 320.0 * ROUNDING;

/// Bound on the errors of signed areas that come from the error of vertices and rays
/// ([`PacketRays::margin`]), through the projection and the subtraction of the common point.
const MARGIN_ERROR: f32 = 16.0;

/// The ratio of the sum of areas to the error bound of an area from which on depths are certain.
/// `z` is the mean of the depths of the corners weighted by areas. If the sum is ten times the
/// bound, the error of `z` is less than ten times the bound, relative to that sum, of the depth of
/// the triangle: three errors, each for a corner at most 1.3 times the depth away, over a sum that
/// is at least 0.7 of its computed value. (Inside, a sum of six times the bound suffices: over
/// half, for corners within the depth.)
const CLEAR: f32 = 10.0;

/// The choice of data of a block that are needed besides areas.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    /// Planes are needed if rays have no common origin, or for occlusion queries.
    pub planes: bool,
    /// Depths are needed except for occlusion queries.
    pub depths: bool,
}

/// A block of triangles relative to the common point of a packet; arrays are indexed by triangle.
#[repr(C, align(64))]
pub(super) struct SeenBlock {
    /// Vectors of two edges whose dot product with a direction is a signed area, by axis of the
    /// packet.
    pub(super) areas: [[[f32; 8]; 3]; 2],
    /// The two edges, by axis of the packet.
    pub(super) edges: [[[f32; 8]; 3]; 2],
    /// The vector whose dot product with a direction is the sum of all three areas.
    pub(super) normal: [[f32; 8]; 3],
    /// Bound on the errors of areas.
    pub(super) bound: [f32; 8],
    /// Lower bound on the `z` of a hit.
    pub(super) nearest: [f32; 8],
    /// Upper bound on the `z` of a hit.
    pub(super) farthest: [f32; 8],
    /// The planes; unset unless they are wanted.
    planes: MaybeUninit<Planes>,
    /// The depths; unset unless they are wanted.
    depths: MaybeUninit<Depths>,
    wanted: Wanted,
}

/// The extents of the triangles of a block along the axis of a packet.
#[repr(C, align(32))]
struct Depths {
    /// The depth of the first corner, and the differences of the depths of the other two from it.
    corners: [[f32; 8]; 3],
    /// The sum of areas from which on depths are certain.
    clear: [f32; 8],
    /// The error of `z` times the sum of areas.
    error: [f32; 8],
    /// Other errors of `z`.
    other_error: [f32; 8],
}

/// A block of triangles relative to the common origin of all rays of a packet. Testing a ray takes
/// two products per edge, so sharing work between rays is not worthwhile; and since nothing else is
/// needed, all of it stays in registers.
#[derive(Clone, Copy)]
pub(super) struct SharedOrigin<L> {
    /// Vectors of all edges whose dot product with a direction is a signed area, by axis of the
    /// packet.
    areas: [[L; 3]; 3],
    /// Bound on the errors of areas.
    bound: L,
    /// Lower bound on the `z` of a hit.
    nearest: L,
}

impl<L: Lanes8> SharedOrigin<L> {
    #[inline(always)]
    pub fn new<P: PacketTests>(
        token: L::Token,
        block: &TriangleBlock,
        packet_rays: &PacketRays,
        axes: Axes,
    ) -> Self {
        let (forward, corners) =
            (L::splat(token, packet_rays.forward), corners(token, block, axes));
        let point = [
            L::splat(token, packet_rays.point[0]),
            L::splat(token, packet_rays.point[1]),
            L::splat(token, packet_rays.point[2]),
        ];
        let [v0, v1, v2] = corners;
        let (r0, r1, r2) =
            (minus(v0, point, forward), minus(v1, point, forward), minus(v2, point, forward));
        let (e0, e1, e2) = (minus(v2, v1, forward), minus(v0, v2, forward), minus(v1, v0, forward));
        let length = size(e1).max(size(e2));
        // The first edge may be as long as both others together.
        let length = length.add(length);
        let far = size(r0).add(length).add(L::splat(token, packet_rays.spread));
        let bound = bound::<L, P>(token, far, length, packet_rays.margin);
        let nearest = nearest(
            token,
            r0[2].min(r1[2]).min(r2[2]),
            far,
            other_error(token, far, packet_rays.margin),
        );
        Self { areas: [cross(r1, e0), cross(r2, e1), cross(r0, e2)], bound, nearest }
    }

    /// The triangles that a ray may hit and that are not certainly beyond its end.
    #[inline(always)]
    pub fn candidates(&self, token: L::Token, packet_rays: &PacketRays, ray: usize) -> u32 {
        let (sx, sy, zero) = (
            L::splat(token, packet_rays.slope[0][ray]),
            L::splat(token, packet_rays.slope[1][ray]),
            L::splat(token, 0.0),
        );
        let end = L::splat(token, packet_rays.end[ray]);
        let [[ux, uy, uz], [vx, vy, vz], [wx, wy, wz]] = self.areas;
        let u = ux.mul_add(sx, uy.mul_add(sy, uz));
        let v = vx.mul_add(sx, vy.mul_add(sy, vz));
        let w = wx.mul_add(sx, wy.mul_add(sy, wz));
        // A ray is certainly outside if two edges have signs that are certain and differ. NaN is
        // never certain.
        let inside = u.min(v).min(w).max(zero.sub(u.max(v).max(w)));
        !(inside.add(self.bound).lt(zero) | end.lt(self.nearest)) & 0xff
    }
}

/// A leaf visited by packets with a common point: the data of its triangles are computed once for
/// all of them.
pub(super) struct Leaf<'t, W: Lanes16> {
    pub block: &'t TriangleBlock,
    /// The place of the first triangle: eight times the number of the block.
    pub place: u32,
    /// A bit for each triangle in the block.
    pub used: u32,
    seen: MaybeUninit<SeenBlock>,
    is_seen: bool,
    of_origin: Option<SharedOrigin<W::Half>>,
}

impl<'t, W: Lanes16> Leaf<'t, W> {
    #[inline(always)]
    pub fn new(
        token: W::Token,
        tree: &'t GroupTree,
        child: ChildRef,
        room: &'t mut MaybeUninit<TriangleBlock>,
    ) -> Self {
        // SAFETY: `child` is a reference of the tree, which has its block (`GroupTree`) and is
        // borrowed for as long as the block.
        let block =
            unsafe { tree.blocks.at().block::<W::Half>(W::half_token(token), child.block(), room) };
        let (place, used) = (child.block() as u32 * 8, (2 << (child.count() - 1)) - 1);
        Self { block, place, used, seen: MaybeUninit::uninit(), is_seen: false, of_origin: None }
    }

    /// The triangles relative to the common point of this packet, computed at the first call. Later
    /// calls must be for packets with the same point and ask for the same data.
    #[inline(always)]
    pub fn seen<P: PacketTests>(
        &mut self,
        token: W::Token,
        packet: &Packet,
        wanted: Wanted,
    ) -> &SeenBlock {
        if !self.is_seen {
            self.is_seen = true;
            self.seen.write(SeenBlock::new::<W, P>(
                token,
                self.block,
                &packet.packet_rays,
                packet.axes,
                wanted,
            ));
        }
        // SAFETY: `is_seen` is set only here, beside the write.
        unsafe { self.seen.assume_init_ref() }
    }

    /// The triangles relative to the common origin of this packet's rays, computed at the first
    /// call.
    #[inline(always)]
    pub fn of_origin<P: PacketTests>(
        &mut self,
        token: W::Token,
        packet: &Packet,
    ) -> SharedOrigin<W::Half> {
        if let Some(seen) = self.of_origin {
            return seen;
        }
        let seen = SharedOrigin::new::<P>(
            W::half_token(token),
            self.block,
            &packet.packet_rays,
            packet.axes,
        );
        self.of_origin = Some(seen);
        seen
    }
}

/// The corners of a block, by axis of the packet.
#[inline(always)]
fn corners<L: Lanes8>(token: L::Token, block: &TriangleBlock, axes: Axes) -> [[L; 3]; 3] {
    let [v0, v1, v2] = &block.vertices;
    let ([x0, y0, z0], [x1, y1, z1], [x2, y2, z2]) = (axes.of(v0), axes.of(v1), axes.of(v2));
    [
        [L::load(token, x0), L::load(token, y0), L::load(token, z0)],
        [L::load(token, x1), L::load(token, y1), L::load(token, z1)],
        [L::load(token, x2), L::load(token, y2), L::load(token, z2)],
    ]
}

/// Bound on the errors of areas, from distances and lengths of edges; see [`AREA_ERROR`].
#[inline(always)]
fn bound<L: Lanes8, P: PacketTests>(token: L::Token, far: L, mut length: L, margin: f32) -> L {
    let margin = L::splat(token, margin);
    let error = far.mul(L::splat(token, AREA_ERROR)).add(margin.mul(L::splat(token, MARGIN_ERROR)));
    if P::TRIANGLES_ELSEWHERE {
        // Triangles that are hit have their vertices no farther from the ray than this.
        length = length.add(margin.mul(L::splat(token, 8.0)));
    }
    error.mul(length).add(L::splat(token, f32::MIN_POSITIVE))
}

/// Bound on the errors of depths, besides the errors that come from areas.
#[inline(always)]
fn other_error<L: Lanes8>(token: L::Token, far: L, margin: f32) -> L {
    far.mul(L::splat(token, 32.0 * ROUNDING)).add(L::splat(token, margin * 8.0))
}

/// A lower bound on the `z` of a hit on a triangle whose nearest corner is at `low`. The exact test
/// clamps hits to a box that is padded by less.
#[inline(always)]
fn nearest<L: Lanes8>(token: L::Token, low: L, far: L, other_error: L) -> L {
    low.sub(far.mul(L::splat(token, 4e-6))).sub(other_error)
}

/// The results of the rays for one triangle; masks have a bit for each ray.
pub(super) struct TriangleHits<W> {
    /// The rays that may hit the triangle within their limits.
    pub possible: u32,
    /// The rays that certainly hit the triangle within their intervals, nearer than all previous
    /// hits.
    pub certain: u32,
    /// The rays for which the hit is certainly nearer than all previous hits, if they hit the
    /// triangle or its projection at all.
    pub nearer: u32,
    /// Lower bound on the `z` of the hits.
    pub low: W,
    /// Upper bound on the `z` of the hits.
    pub high: W,
}

impl SeenBlock {
    #[inline(always)]
    pub fn new<W: Lanes16, P: PacketTests>(
        token: W::Token,
        block: &TriangleBlock,
        packet_rays: &PacketRays,
        axes: Axes,
        wanted: Wanted,
    ) -> Self {
        let half = W::half_token(token);
        // SAFETY: everything is written except planes and depths that are not wanted, which are
        // `MaybeUninit`.
        unsafe {
            let [px, py, pz] = packet_rays.point;
            let (point, forward) = (
                [W::Half::splat(half, px), W::Half::splat(half, py), W::Half::splat(half, pz)],
                W::Half::splat(half, packet_rays.forward),
            );
            let [v0, v1, v2] = corners::<W::Half>(half, block, axes);
            let (r0, r1, r2) =
                (minus(v0, point, forward), minus(v1, point, forward), minus(v2, point, forward));
            let (e1, e2) = (minus(v0, v2, forward), minus(v1, v0, forward));
            let (low, high) = (r0[2].min(r1[2]).min(r2[2]), r0[2].max(r1[2]).max(r2[2]));
            let sizes = [size(e1), size(e2)];
            let length = sizes[0].max(sizes[1]);
            let far = size(r0).add(length).add(W::Half::splat(half, packet_rays.spread));
            let bound = bound::<W::Half, P>(half, far, length, packet_rays.margin);
            let other = other_error(half, far, packet_rays.margin);
            let nearest = nearest(half, low, far, other);
            let mut seen = MaybeUninit::<Self>::uninit();
            let to = &mut *seen.as_mut_ptr();
            to.wanted = wanted;
            store3(cross(r2, e1), &mut to.areas[0]);
            store3(cross(r0, e2), &mut to.areas[1]);
            store3(e1, &mut to.edges[0]);
            store3(e2, &mut to.edges[1]);
            // The cross product of the edges with the opposite sign, so that all edges turn the
            // same way.
            let normal = cross(e1, e2);
            store3(normal, &mut to.normal);
            if wanted.planes {
                let seen = SeenCorners::<W::Half> {
                    corners: [v0, v1, v2],
                    point,
                    forward,
                    first: r0,
                    normal,
                    sizes,
                };
                seen.write::<W, P>(
                    token,
                    packet_rays,
                    &mut to.normal,
                    &mut *to.planes.as_mut_ptr(),
                );
            }
            if wanted.depths {
                let to = &mut *to.depths.as_mut_ptr();
                store3([r0[2], r1[2].sub(r0[2]), r2[2].sub(r0[2])], &mut to.corners);
                let clear = bound.mul(W::Half::splat(half, CLEAR));
                clear.store(&mut to.clear);
                clear.mul(high.sub(low)).store(&mut to.error);
                other.store(&mut to.other_error);
            }
            bound.store(&mut to.bound);
            nearest.store(&mut to.nearest);
            high.add(other).store(&mut to.farthest);
            seen.assume_init()
        }
    }

    /// # Panics
    /// If planes were not wanted.
    #[inline(always)]
    pub(super) fn planes(&self) -> &Planes {
        assert!(self.wanted.planes, "planes were wanted");
        // SAFETY: `new` has written the planes if `wanted.planes`, which is asserted above.
        unsafe { self.planes.assume_init_ref() }
    }

    /// # Panics
    /// If depths were not wanted.
    #[inline(always)]
    fn depths(&self) -> &Depths {
        assert!(self.wanted.depths, "depths were wanted");
        // SAFETY: `new` has written the depths if `wanted.depths`, which is asserted above.
        unsafe { self.depths.assume_init_ref() }
    }

    /// Removes two rays from `rays` (or the last one) and returns the triangles that they may hit
    /// within their limits, a bit for each: eight for the first ray, then eight for the second.
    /// Efficient for few rays.
    #[inline(always)]
    pub fn near_two<W: Lanes16>(
        &self,
        token: W::Token,
        packet_rays: &PacketRays,
        rays: &mut u32,
    ) -> u32 {
        let (a, b) = (rays.trailing_zeros(), 31 - rays.leading_zeros());
        *rays &= !(1 << a | 1 << b);
        let mask = if a == b { 0xff } else { 0xffff };
        !TriangleLanes::<W>::all(token, self).missed(
            token,
            &PlaneLanes::all(token, self),
            &LineLanes::two(token, packet_rays, a as usize, b as usize),
        ) & mask
    }

    /// The triangles that any ray of a packet may hit, by the ranges of the slopes and positions of
    /// its rays.
    #[inline(always)]
    pub fn near_packet<L: Lanes8>(&self, token: L::Token, packet: &Packet) -> u32 {
        let [[x, y], [half_x, half_y]] = packet.slopes();
        let (middle, half) = (
            [L::splat(token, x), L::splat(token, y)],
            [L::splat(token, half_x), L::splat(token, half_y)],
        );
        let (normal, n1, n2): ([L; 3], [L; 3], [L; 3]) = (
            load3(token, &self.normal),
            load3(token, &self.areas[0]),
            load3(token, &self.areas[1]),
        );
        let n0 = [
            normal[0].sub(n1[0]).sub(n2[0]),
            normal[1].sub(n1[1]).sub(n2[1]),
            normal[2].sub(n1[2]).sub(n2[2]),
        ];
        let (mut a0, mut a1, mut a2) =
            (range(n0, middle, half), range(n1, middle, half), range(n2, middle, half));
        if packet.packet_rays.separate {
            let [middle, half] = [
                splat3::<L>(token, &packet.packet_rays.moments[0]),
                splat3::<L>(token, &packet.packet_rays.moments[1]),
            ];
            let (e1, e2): ([L; 3], [L; 3]) =
                (load3(token, &self.edges[0]), load3(token, &self.edges[1]));
            // The first edge closes the triangle, and its area is the sum less the other two areas.
            let e0 = [e1[0].add(e2[0]), e1[1].add(e2[1]), e1[2].add(e2[2])];
            a0 = moved(a0, e0, middle, half, L::splat(token, -1.0));
            a1 = moved(a1, e1, middle, half, L::splat(token, 1.0));
            a2 = moved(a2, e2, middle, half, L::splat(token, 1.0));
        }
        let (zero, bound) = (L::splat(token, 0.0), L::load(token, &self.bound));
        let inside = a0[1].min(a1[1]).min(a2[1]).max(zero.sub(a0[0].max(a1[0]).max(a2[0])));
        // The bound counts twice, to cover the roundings here.
        !inside.add(bound).add(bound).lt(zero)
    }

    /// Intersects some of the rays with a triangle.
    #[inline(always)]
    pub fn hits<W: Lanes16>(
        &self,
        token: W::Token,
        packet_rays: &PacketRays,
        triangle: usize,
        rays: u32,
    ) -> TriangleHits<W> {
        let (i, zero) = (triangle, W::splat(token, 0.0));
        let depths = self.depths();
        let (of_triangle, of_rays) =
            (TriangleLanes::<W>::one(token, self, triangle), LineLanes::all(token, packet_rays));
        let bound = of_triangle.bound;
        let areas = of_triangle.areas(&of_rays, zero);
        let too_far = of_rays.end.lt(of_triangle.nearest);
        let mut possible = rays & !of_triangle.outside(token, &areas) & !too_far;
        if packet_rays.separate {
            let planes = PlaneLanes::one(token, self, triangle);
            possible &= !planes.behind(token, &of_triangle, &areas, &of_rays);
        }
        if possible == 0 {
            return TriangleHits { possible, certain: 0, nearer: 0, low: zero, high: zero };
        }
        let Areas { sum, a1, a2, inside } = areas;
        let size = sum.abs();
        let inverse = W::splat(token, 1.0).div(sum);
        let [z0, z1, z2] = &depths.corners;
        let z = a1
            .mul_add(of(token, z1, i), a2.mul(of(token, z2, i)))
            .mul_add(inverse, of(token, z0, i));
        let error = of::<W>(token, &depths.error, i)
            .mul_add(inverse.abs(), of(token, &depths.other_error, i));
        let (low, high) = (z.sub(error), z.add(error));
        let clear = of::<W>(token, &depths.clear, i).lt(size);
        let behind = high.lt(W::load(token, &packet_rays.begin)) & clear;
        let certainly_inside = bound.add(bound).lt(inside);
        let beyond = W::load(token, &packet_rays.end).lt(low) & certainly_inside;
        let possible = possible & !behind & !beyond;
        let nearer = possible
            & W::load(token, &packet_rays.certain_begin).lt(low)
            & high.lt(W::load(token, &packet_rays.certain_end));
        TriangleHits {
            possible,
            certain: nearer & certainly_inside,
            nearer: nearer & clear,
            low,
            high,
        }
    }
}

/// The range of the dot products of a vector with directions in a range of slopes.
#[inline(always)]
fn range<L: Lanes8>([x, y, z]: [L; 3], middle: [L; 2], half: [L; 2]) -> [L; 2] {
    let (at, reach) = (
        x.mul_add(middle[0], y.mul_add(middle[1], z)),
        x.abs().mul_add(half[0], y.abs().mul(half[1])),
    );
    [at.sub(reach), at.add(reach)]
}

/// The range of areas after adding the contribution of the positions of rays, with this sign.
#[inline(always)]
fn moved<L: Lanes8>(
    [low, high]: [L; 2],
    e: [L; 3],
    middle: [L; 3],
    half: [L; 3],
    sign: L,
) -> [L; 2] {
    let at = e[0].mul_add(middle[0], e[1].mul_add(middle[1], e[2].mul(middle[2]))).mul(sign);
    let reach = e[0].abs().mul_add(half[0], e[1].abs().mul_add(half[1], e[2].abs().mul(half[2])));
    [low.add(at).sub(reach), high.add(at).add(reach)]
}

/// A vector, repeated for all triangles.
#[inline(always)]
fn splat3<L: Lanes8>(token: L::Token, &[x, y, z]: &[f32; 3]) -> [L; 3] {
    [L::splat(token, x), L::splat(token, y), L::splat(token, z)]
}

/// Loads the vectors of all triangles.
#[inline(always)]
fn load3<L: Lanes8>(token: L::Token, [x, y, z]: &[[f32; 8]; 3]) -> [L; 3] {
    [L::load(token, x), L::load(token, y), L::load(token, z)]
}

#[inline(always)]
fn minus<L: Lanes8>(a: [L; 3], b: [L; 3], forward: L) -> [L; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2]).mul(forward)]
}

#[inline(always)]
fn store3<L: Lanes8>(v: [L; 3], to: &mut [[f32; 8]; 3]) {
    v[0].store(&mut to[0]);
    v[1].store(&mut to[1]);
    v[2].store(&mut to[2]);
}

#[inline(always)]
fn cross<L: Lanes8>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [
        a[1].mul(b[2]).sub(a[2].mul(b[1])),
        a[2].mul(b[0]).sub(a[0].mul(b[2])),
        a[0].mul(b[1]).sub(a[1].mul(b[0])),
    ]
}

/// The largest magnitude of the coordinates.
#[inline(always)]
pub(super) fn size<L: Lanes8>(a: [L; 3]) -> L {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}
