//! Where sixteen rays hit a triangle each that they surely hit.
//!
//! The same operations in the same order as in [`super::super::triangle::exact_hit_on`], so the same bits.

use super::super::columns::columns;
use super::bundle::{Bundle, PerRay, RAYS};
use super::contents::Triangle;
use super::shapes::dot;
use snell_math::simd::{Doubles16, Lanes16};

/// What became of sixteen rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub t: PerRay<f32>,
    pub b1: PerRay<f32>,
    pub b2: PerRay<f32>,
    /// The rays that hit their triangle within their interval, and those that do so beyond it.
    pub hits: u32,
    pub beyond: u32,
}

/// Tests sixteen rays, each with a triangle whose plane it meets ahead, and within whose outline or that of its neighbour in the plane it surely is. Hits
/// are at less than `limit`. Those that are told no hit nor beyond are not decided.
///
/// # Safety
/// The machine must have the instructions of `D`.
#[inline(always)]
pub(super) unsafe fn test<D: Doubles16>(bundle: &Bundle<D>, triangles: &PerRay<&Triangle>, limit: D::Singles) -> Found {
    // SAFETY: passed on to the caller.
    unsafe {
        let [ax, ay, az, bx, by, bz, cx, cy] = columns::<D::Singles>(half(triangles, 0, 0), half(triangles, 8, 0));
        let [cz, steep, ..] = columns::<D::Singles>(half(triangles, 0, 1), half(triangles, 8, 1));
        let (a, b, c) = ([ax, ay, az], [bx, by, bz], [cx, cy, cz]);
        let (o, d) = (bundle.origin, bundle.direction);

        // The distance of the plane.
        let (exact_a, direction) = (doubles::<D>(a), doubles::<D>(d));
        let [ux, uy, uz] = minus(doubles::<D>(b), exact_a);
        let [vx, vy, vz] = minus(doubles::<D>(c), exact_a);
        let normal = [uy.mul(vz).sub(vy.mul(uz)), uz.mul(vx).sub(vz.mul(ux)), ux.mul(vy).sub(vx.mul(uy))];
        let slope = dot(normal, direction);
        let distance = dot(normal, minus(exact_a, doubles::<D>(o))).div(slope);
        let t = distance.rounded();
        let least = D::of(steep).mul(D::of(bundle.size));
        let is_steep = least.mul(least).lt(slope.mul(slope));

        // The drawing: along the largest component of the direction.
        let (dx, dy, dz) = (d[0].abs(), d[1].abs(), d[2].abs());
        let along_x = dy.le(dx) & dz.le(dx);
        let along_y = dz.le(dy) & !along_x;
        let d = turned(d, along_x, along_y);
        let o = turned(o, along_x, along_y);
        let shear = [d[0].div(d[2]), d[1].div(d[2])];
        let p0 = draw::<D>(turned(a, along_x, along_y), o, shear);
        let p1 = draw::<D>(turned(b, along_x, along_y), o, shear);
        let p2 = draw::<D>(turned(c, along_x, along_y), o, shear);
        let (w0, w1, w2) = (edge(p1, p2), edge(p2, p0), edge(p0, p1));
        let zero = D::splat(0.0);
        let inside = (zero.lt(w0) & zero.lt(w1) & zero.lt(w2)) | (w0.lt(zero) & w1.lt(zero) & w2.lt(zero));
        let scale = D::splat(1.0).div(w0.add(w1).add(w2));

        let sure = inside & is_steep & bundle.t_min.lt(t) & t.lt(limit);
        let hits = sure & t.lt(bundle.t_max);
        let mut found = Found { t: [0.0; RAYS], b1: [0.0; RAYS], b2: [0.0; RAYS], hits, beyond: sure & !hits };
        t.store(&mut found.t);
        w1.mul(scale).rounded().store(&mut found.b1);
        w2.mul(scale).rounded().store(&mut found.b2);
        found
    }
}

/// A part of the numbers of eight triangles.
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

#[inline(always)]
fn doubles<D: Doubles16>(v: [D::Singles; 3]) -> [D; 3] {
    [D::of(v[0]), D::of(v[1]), D::of(v[2])]
}

#[inline(always)]
fn minus<D: Doubles16>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

/// The coordinates in the order of the axes that a ray draws on, by its largest component.
#[inline(always)]
fn turned<W: Lanes16>([x, y, z]: [W; 3], along_x: u32, along_y: u32) -> [W; 3] {
    [
        x.replace(along_x, y).replace(along_y, z),
        y.replace(along_x, z).replace(along_y, x),
        z.replace(along_x, x).replace(along_y, y),
    ]
}

/// As [`super::super::triangle::Drawing::draw`].
#[inline(always)]
fn draw<D: Doubles16>(v: [D::Singles; 3], o: [D::Singles; 3], shear: [D::Singles; 2]) -> [D; 2] {
    let (x, y, z) = (v[0].sub(o[0]), v[1].sub(o[1]), v[2].sub(o[2]));
    [D::of(x.sub(shear[0].mul(z))), D::of(y.sub(shear[1].mul(z)))]
}

/// As the function of the same name of the exact test, but for the symbolic shift: zero is not decided here.
#[inline(always)]
fn edge<D: Doubles16>(p: [D; 2], q: [D; 2]) -> D {
    p[0].mul(q[1]).sub(p[1].mul(q[0]))
}
