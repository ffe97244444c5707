//! Which triangles of a block each ray of a bundle may hit.
//!
//! Seen from the apex, the signed area of a ray and an edge is the product of the ray's direction with a vector that belongs to
//! the edge alone (Plücker coordinates; for a shared origin as in Benthin, Realtime Ray Tracing on Current CPU Architectures, 2006).
//! So the vectors of all edges are worked out once, and each ray costs two products an edge. The filter of single rays
//! costs three times as much. As there, nothing that the exact test takes is dropped.

use super::super::triangle::TriangleBlock;
use super::bundle::Bundle;
use crate::precision::Rules;
use snell_math::simd::Lanes8;

/// Bound of the errors of a signed area, relative to the distance of the triangle and the length of its longest edge. The drawing of
/// the exact test and the products here come to less than `100 * 2^-24`.
const AREA_ERROR: f32 = 256.0 / 16_777_216.0;

/// Bound of the errors of heights above planes, relative to the distance of the triangle and the square of the length of its longest edge.
/// It is less than `200 * 2^-24`.
const HEIGHT_ERROR: f32 = 1024.0 / 16_777_216.0;

/// The same for what vertices may be off by, relative to the distance of the triangle together with the length of its longest edge.
/// (Normals are off by `8 slack (edge + slack)` along each axis, and the slopes of rays are 2 at most.)
const SLACK_ERROR: f32 = 40.0;

/// A block of triangles seen from the apex of a bundle.
pub(super) struct SeenBlock<L> {
    /// Per edge and axis of the bundle.
    areas: [[L; 3]; 3],
    edges: [[L; 3]; 3],
    bound: L,
    /// Unless the rays share their origin: across the triangles, and how far they are from where the rays start in units of that.
    normal: [L; 3],
    height: L,
    /// Bounds of the errors of heights, and of products of the normal and directions.
    height_error: L,
    normal_error: L,
    /// How far from the apex the triangles begin and end.
    low: L,
    high: L,
}

impl<L: Lanes8> SeenBlock<L> {
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn new<P: Rules>(block: &TriangleBlock, bundle: &Bundle) -> Self {
        // SAFETY: passed on to the caller; axes are below 3.
        unsafe {
            let [x, y, z] = bundle.axes;
            let sign = L::splat(bundle.sign);
            let [v0, v1, v2] = &block.vertices;
            let v0 =
                [L::load(v0.get_unchecked(x)), L::load(v0.get_unchecked(y)), L::load(v0.get_unchecked(z)).mul(sign)];
            let v1 =
                [L::load(v1.get_unchecked(x)), L::load(v1.get_unchecked(y)), L::load(v1.get_unchecked(z)).mul(sign)];
            let v2 =
                [L::load(v2.get_unchecked(x)), L::load(v2.get_unchecked(y)), L::load(v2.get_unchecked(z)).mul(sign)];
            let apex = &bundle.kind.apex;
            let apex = [
                L::splat(*apex.get_unchecked(x)),
                L::splat(*apex.get_unchecked(y)),
                L::splat(*apex.get_unchecked(z)).mul(sign),
            ];
            let edges = [minus(v2, v1), minus(v0, v2), minus(v1, v0)];
            let (r0, r1, r2) = (minus(v0, apex), minus(v1, apex), minus(v2, apex));
            let length = size(edges[1]).max(size(edges[2]));
            // The first edge may be as long as both others.
            let (length, far) = (length.add(length), size(r0).add(length).add(L::splat(bundle.distance)));
            let mut error = far.mul(L::splat(AREA_ERROR)).add(L::splat(8.0 * bundle.margin));
            let (mut long, slack) = (length, bundle.kind.slack);
            if P::TRIANGLES_ELSEWHERE {
                // Triangles that are met have their vertices no farther from the ray than this.
                error = error.add(L::splat(8.0 * slack));
                long = length.add(L::splat(8.0 * slack));
            }
            let mut relative = length.mul(L::splat(HEIGHT_ERROR));
            if P::TRIANGLES_ELSEWHERE {
                // Both edges of the normal are off by twice the slack.
                relative = relative.add(L::splat(SLACK_ERROR * slack));
            }
            let (mut normal, mut height, mut height_error, normal_error) =
                (edges[0], length, length, long.mul(relative).add(L::splat(f32::MIN_POSITIVE)));
            if !bundle.kind.common {
                let start = &bundle.start_point;
                let start = [L::splat(start[0]), L::splat(start[1]), L::splat(start[2]).mul(sign)];
                let from_start = minus(v0, start);
                normal = cross(edges[2], minus(v2, v0));
                height = dot(normal, from_start);
                let mut reach = size(from_start).add(L::splat(bundle.start_spread));
                if P::TRIANGLES_ELSEWHERE {
                    reach = reach.add(length);
                }
                height_error = reach.mul(normal_error).add(L::splat(f32::MIN_POSITIVE));
            }
            let low = r0[2].min(r1[2]).min(r2[2]);
            let high = r0[2].max(r1[2]).max(r2[2]);
            Self {
                low,
                high,
                normal,
                height,
                height_error,
                normal_error,
                areas: [cross(r1, edges[0]), cross(r2, edges[1]), cross(r0, edges[2])],
                edges,
                bound: error.mul(long).add(L::splat(f32::MIN_POSITIVE)),
            }
        }
    }

    /// The triangles that a ray may hit, somewhere on its line after its start; and those that it surely hits within its interval, if
    /// `ANY` of these is asked for.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn candidates<const ANY: bool>(&self, bundle: &Bundle, ray: usize) -> (u32, u32) {
        let slope = [bundle.slope[0][ray], bundle.slope[1][ray]];
        // SAFETY: passed on to the caller.
        let (sx, sy, zero) = unsafe { (L::splat(slope[0]), L::splat(slope[1]), L::splat(0.0)) };
        let mut areas = [self.area(0, sx, sy), self.area(1, sx, sy), self.area(2, sx, sy)];
        let mut behind = 0;
        if !bundle.kind.common {
            // What the ray's place beside the apex adds.
            let offset = [bundle.offset[0][ray], bundle.offset[1][ray]];
            // SAFETY: as above.
            let (ox, oy, oz) = unsafe {
                (L::splat(-offset[0]), L::splat(offset[1]), L::splat(slope[1] * offset[0] - slope[0] * offset[1]))
            };
            for (area, [x, y, z]) in areas.iter_mut().zip(&self.edges) {
                *area = oy.mul_add(*x, ox.mul_add(*y, oz.mul_add(*z, *area)));
            }
            let begin = &bundle.begin;
            // SAFETY: as above.
            let (bx, by, bz) = unsafe { (L::splat(begin[0][ray]), L::splat(begin[1][ray]), L::splat(begin[2][ray])) };
            let [nx, ny, nz] = self.normal;
            let height = bx.mul_add(nx, by.mul_add(ny, bz.mul_add(nz, self.height)));
            let speed = sx.mul_add(nx, sy.mul_add(ny, nz));
            // Surely behind: both signs are certain, and say that the ray goes away from the plane.
            let error = self.height_error.mul_add(speed.abs(), self.normal_error.mul(height.abs()));
            let product = height.mul(speed);
            behind = if bundle.kind.reversed { error.lt(product) } else { product.add(error).lt(zero) };
        }
        let [u, v, w] = areas;
        // Surely outside: two edges whose signs are certain and differ. NaN is never sure.
        let inside = u.min(v).min(w).max(zero.sub(u.max(v).max(w)));
        let outside = inside.add(self.bound).lt(zero);
        let mut sure = 0;
        if ANY {
            // SAFETY: as above.
            let (near, far) = unsafe { (L::splat(bundle.sure_near[ray]), L::splat(bundle.sure_far[ray])) };
            sure = self.bound.lt(inside) & near.lt(self.low) & self.high.lt(far);
        }
        (!(outside | behind) & 0xff, sure)
    }

    /// The signed area of an edge and a ray through the apex.
    #[inline(always)]
    fn area(&self, edge: usize, sx: L, sy: L) -> L {
        let [x, y, z] = self.areas[edge];
        x.mul_add(sx, y.mul_add(sy, z))
    }
}

#[inline(always)]
fn minus<L: Lanes8>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

#[inline(always)]
fn cross<L: Lanes8>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    [a[1].mul(b[2]).sub(a[2].mul(b[1])), a[2].mul(b[0]).sub(a[0].mul(b[2])), a[0].mul(b[1]).sub(a[1].mul(b[0]))]
}

#[inline(always)]
fn dot<L: Lanes8>(a: [L; 3], b: [L; 3]) -> L {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

/// The largest coordinate.
#[inline(always)]
fn size<L: Lanes8>(a: [L; 3]) -> L {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}
