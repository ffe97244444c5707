//! The hit points of sixteen rays, each on a triangle that it certainly hits.
//!
//! The computation is that of [`crate::exact::plane_hit`], so the results have the bits of the
//! exact test.

use super::packet::{ListPacket, PerRay, RAYS};
use crate::exact::plane_hit::{PlaneHit, ProjectedHit, doubles};
use crate::kernel::columns::columns;
use crate::tree::list::Triangle;
use snell_math::simd::{Doubles16, Lanes16};

/// The results of sixteen rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub t: PerRay<f32>,
    pub b1: PerRay<f32>,
    pub b2: PerRay<f32>,
    /// The rays that hit their triangle within their interval.
    pub hits: u32,
    /// The rays that hit their triangle beyond their interval.
    pub beyond: u32,
}

/// Tests sixteen rays, each with one triangle. The ray must cross the triangle's plane ahead,
/// certainly inside the outline of the triangle or of its neighbour in that plane. Hits at `limit`
/// or beyond are not reported. Rays reported neither as a hit nor as beyond are undecided.
#[inline(always)]
pub(super) fn test<D: Doubles16>(
    token: D::Token,
    packet: &ListPacket<D>,
    triangles: &PerRay<&Triangle>,
    limit: D::Singles,
) -> Found {
    let [ax, ay, az, bx, by, bz, cx, cy] =
        columns::<D::Singles>(token, half(triangles, 0, 0), half(triangles, 8, 0));
    let [cz, steep, ..] =
        columns::<D::Singles>(token, half(triangles, 0, 1), half(triangles, 8, 1));
    let (a, b, c) = ([ax, ay, az], [bx, by, bz], [cx, cy, cz]);
    let (o, d) = (packet.origin, packet.direction);

    let direction = doubles::<D>(d);
    let PlaneHit { slope, t, .. } = PlaneHit::new(&[a, b, c], doubles::<D>(o), direction);
    let t = t.rounded();
    let least = D::of(steep).mul(D::of(packet.size));
    let is_steep = least.mul(least).lt(slope.mul(slope));

    // The projection is along the largest component of the direction.
    let (dx, dy, dz) = (d[0].abs(), d[1].abs(), d[2].abs());
    let along_x = dy.le(dx) & dz.le(dx);
    let along_y = dz.le(dy) & !along_x;
    let d = turned(d, along_x, along_y);
    let shear = [d[0].div(d[2]), d[1].div(d[2])];
    let corners =
        [turned(a, along_x, along_y), turned(b, along_x, along_y), turned(c, along_x, along_y)];
    let ProjectedHit { inside, b1, b2 } =
        ProjectedHit::<D>::new(token, corners, turned(o, along_x, along_y), shear);

    let certain = inside & is_steep & packet.t_min.lt(t) & t.lt(limit);
    let hits = certain & t.lt(packet.t_max);
    let mut found =
        Found { t: [0.0; RAYS], b1: [0.0; RAYS], b2: [0.0; RAYS], hits, beyond: certain & !hits };
    t.store(&mut found.t);
    b1.rounded().store(&mut found.b1);
    b2.rounded().store(&mut found.b2);
    found
}

/// Half of the numbers (`part` 0 or 1) of eight triangles, starting at triangle `from`.
#[inline(always)]
fn half<'a>(triangles: &PerRay<&'a Triangle>, from: usize, part: usize) -> [&'a [f32; 8]; 8] {
    [
        &triangles[from].numbers[part],
        &triangles[from + 1].numbers[part],
        &triangles[from + 2].numbers[part],
        &triangles[from + 3].numbers[part],
        &triangles[from + 4].numbers[part],
        &triangles[from + 5].numbers[part],
        &triangles[from + 6].numbers[part],
        &triangles[from + 7].numbers[part],
    ]
}

/// The coordinates in the order of the axes on which a ray projects. The masks have the rays that
/// project along x and along y.
#[inline(always)]
fn turned<W: Lanes16>([x, y, z]: [W; 3], along_x: u32, along_y: u32) -> [W; 3] {
    [
        x.replace(along_x, y).replace(along_y, z),
        y.replace(along_x, z).replace(along_y, x),
        z.replace(along_x, x).replace(along_y, y),
    ]
}
