//! The planes of the triangles of a block, which decide whether a ray starts in front of a triangle
//! or behind it.
//!
//! Areas give an inaccurate distance to a sliver, which is hardly wider than their error. Its plane
//! is accurate for all triangles near the ray origins: the remaining rounding is relative to the
//! distance of the origins from the packet's common point.

use super::exact::{cross, dot, exact3};
use super::leaf::{ROUNDING, size};
use super::rays::PacketRays;
use crate::kernel::packet::PacketTests;
use snell_math::simd::{DoubleLanes, DoublesOf, Lanes8, Lanes16};

/// Triangles are processed in double precision if the length of their normal is this many times
/// smaller than the product of two edges, because of cancellation.
const SLIVER: f32 = 8.0;

/// The planes of eight triangles.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
pub(super) struct Planes {
    /// The dot product of the normal with a corner.
    pub height: [f32; 8],
    /// Bounds on the errors of [heights of rays](super::edges::TriangleLanes), each times the
    /// length of the normal.
    ///
    /// The unit is `u = 2^-24`. Lengths are largest coordinates; `n` is the length of a normal and
    /// `dn` its error. Rays begin up to `s` from the common point and up to `b` from the plane
    /// through it perpendicular to the axis, and corners are up to `r` from the point. Then the
    /// height of a corner is off by `3 r dn + 15 u r n`. The position of a line (at most `3 s`
    /// away) is off by `8 u s` on each axis, so its height is off by `6 s dn + 16 u s n`. The
    /// product of the normal with a direction (of slopes up to 1.25) is off by `4 dn + 10 u n`,
    /// which counts `b` times, and the sums are off by `u` times their magnitudes. Together that is
    /// less than `(r + s + b) (6 dn + 64 u n)`. `dn` is `8 u` times the product of the lengths of
    /// two edges, and `n` is at most twice that product. In double precision `dn` is at most `u n`,
    /// and the rounding of the height of a corner is relative to that height instead of `r n`.
    pub error: [f32; 8],
    /// The least magnitude of the dot product of normal and direction whose sign is certain.
    pub upright: [f32; 8],
}

/// The data from which [`Planes`] are computed.
pub(super) struct SeenCorners<L> {
    pub corners: [[L; 3]; 3],
    /// The common point of the packet.
    pub point: [L; 3],
    /// [`PacketRays::forward`] in all lanes.
    pub forward: L,
    /// The first corner relative to the point.
    pub first: [L; 3],
    /// The cross product of the edges from the first corner to the second and third.
    pub normal: [L; 3],
    /// The sizes of these two edges.
    pub sizes: [L; 2],
}

impl<L: Lanes8> SeenCorners<L> {
    /// Writes the planes, and more accurate normals if there are slivers.
    #[inline(always)]
    pub fn write<W: Lanes16<Half = L>, P: PacketTests>(
        &self,
        token: W::Token,
        packet_rays: &PacketRays,
        normals: &mut [[f32; 8]; 3],
        to: &mut Planes,
    ) {
        let half = self.forward.token();
        let product = self.sizes[0].mul(self.sizes[1]);
        let (near, tiny) = (
            L::splat(half, packet_rays.spread + packet_rays.latest),
            L::splat(half, f32::MIN_POSITIVE),
        );
        let reach = size(self.first).add(near);
        let mut length = size(self.normal);
        let (mut error, mut upright);
        if length.mul(L::splat(half, SLIVER)).lt(product) == 0 {
            let ([nx, ny, nz], [x, y, z]) = (self.normal, self.first);
            nx.mul_add(x, ny.mul_add(y, nz.mul(z))).store(&mut to.height);
            let product = product.add(tiny);
            error = product.mul(reach).mul(L::splat(half, 192.0 * ROUNDING));
            upright = product.mul(L::splat(half, 64.0 * ROUNDING));
        } else {
            self.write_exactly::<W>(token, normals, to);
            length = size([
                L::load(half, &normals[0]),
                L::load(half, &normals[1]),
                L::load(half, &normals[2]),
            ]);
            let rest = product.mul(L::splat(half, 2e-14)).add(L::splat(half, 1e-44));
            let of_height = L::load(half, &to.height).abs().mul(L::splat(half, 8.0 * ROUNDING));
            error = length
                .mul(near)
                .mul_add(L::splat(half, 64.0 * ROUNDING), rest.mul_add(reach, of_height));
            upright = length.mul_add(L::splat(half, 16.0 * ROUNDING), rest);
        }
        if packet_rays.margin > 0.0 {
            let margin = L::splat(half, packet_rays.margin);
            error = length.mul(margin).mul_add(L::splat(half, 8.0), error);
            if P::TRIANGLES_ELSEWHERE {
                // The corners and edges of the true triangles differ from the stored ones; edges of
                // triangles that are hit are at most this long.
                let edge = self.sizes[0].max(self.sizes[1]).add(margin.mul(L::splat(half, 8.0)));
                let off = edge.mul(margin);
                error = off.mul(reach).mul_add(L::splat(half, 64.0), error);
                upright = off.mul_add(L::splat(half, 16.0), upright);
            }
        }
        error.add(tiny).store(&mut to.error);
        upright.add(tiny).store(&mut to.upright);
    }

    /// Writes normals and heights that were computed in double precision.
    #[inline(always)]
    fn write_exactly<W: Lanes16<Half = L>>(
        &self,
        token: W::Token,
        normals: &mut [[f32; 8]; 3],
        to: &mut Planes,
    ) {
        let mut from = 0;
        while from < 8 {
            let [v0, v1, v2] = &self.corners;
            let (v0, v1, v2) = (
                exact3::<W>(token, v0, from),
                exact3::<W>(token, v1, from),
                exact3::<W>(token, v2, from),
            );
            let forward = W::HalfDoubles::of(token, self.forward, from);
            let first = minus(v0, exact3::<W>(token, &self.point, from), forward);
            let normal = cross(minus(v0, v2, forward), minus(v1, v0, forward));
            let height = dot(normal, first);
            normal[0].store_rounded_from(&mut normals[0], from);
            normal[1].store_rounded_from(&mut normals[1], from);
            normal[2].store_rounded_from(&mut normals[2], from);
            height.store_rounded_from(&mut to.height, from);
            from += W::HalfDoubles::LANES;
        }
    }
}

#[inline(always)]
fn minus<D: DoubleLanes>(a: [D; 3], b: [D; 3], forward: D) -> [D; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2]).mul(forward)]
}
