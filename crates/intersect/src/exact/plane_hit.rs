//! The intersections of sixteen rays with one triangle each.
//!
//! The operations and their order are those of [`super::triangle::exact_hit_on`], so the results
//! have the same bits. The rare cases of that function (ties, rays along the plane of the triangle,
//! hits outside its box by rounding) are not handled; callers must exclude them.

use snell_math::simd::{Doubles16, Lanes16};

/// Three corners by axis, with one lane per ray.
pub(crate) type Corners<W> = [[W; 3]; 3];

/// The intersections of rays with the planes of triangles.
pub(crate) struct PlaneHit<D: Doubles16> {
    pub normal: [D; 3],
    /// The dot product of the ray's direction with the unnormalised normal.
    pub slope: D,
    pub t: D,
}

impl<D: Doubles16> PlaneHit<D> {
    #[inline(always)]
    pub fn new([a, b, c]: &Corners<D::Singles>, origin: [D; 3], direction: [D; 3]) -> Self {
        let exact_a = doubles::<D>(*a);
        let [ux, uy, uz] = minus(doubles::<D>(*b), exact_a);
        let [vx, vy, vz] = minus(doubles::<D>(*c), exact_a);
        let normal =
            [uy.mul(vz).sub(vy.mul(uz)), uz.mul(vx).sub(vz.mul(ux)), ux.mul(vy).sub(vx.mul(uy))];
        let slope = dot(normal, direction);
        let t = dot(normal, minus(exact_a, origin)).div(slope);
        Self { normal, slope, t }
    }
}

/// The positions of rays in the projected triangles.
pub(crate) struct ProjectedHit<D> {
    /// A bit for each ray that is certainly inside.
    pub inside: u32,
    /// Barycentrics, valid for the rays inside.
    pub b1: D,
    pub b2: D,
}

impl<D: Doubles16> ProjectedHit<D> {
    /// Tests projected triangles. Corners and origins are given in the order of the axes on which
    /// the rays project.
    #[inline(always)]
    pub fn new(
        token: D::Token,
        [a, b, c]: Corners<D::Singles>,
        origin: [D::Singles; 3],
        shear: [D::Singles; 2],
    ) -> Self {
        let (p0, p1, p2) =
            (project(a, origin, shear), project(b, origin, shear), project(c, origin, shear));
        let (w0, w1, w2): (D, D, D) = (edge(p1, p2), edge(p2, p0), edge(p0, p1));
        let (zero, one) = (D::splat(token, 0.0), D::splat(token, 1.0));
        let inside =
            (zero.lt(w0) & zero.lt(w1) & zero.lt(w2)) | (w0.lt(zero) & w1.lt(zero) & w2.lt(zero));
        let scale = one.div(w0.add(w1).add(w2));
        Self { inside, b1: w1.mul(scale), b2: w2.mul(scale) }
    }
}

/// Converts vectors to double precision, exactly.
#[inline(always)]
pub(crate) fn doubles<D: Doubles16>(v: [D::Singles; 3]) -> [D; 3] {
    [D::of(v[0]), D::of(v[1]), D::of(v[2])]
}

#[inline(always)]
pub(crate) fn dot<D: Doubles16>(a: [D; 3], b: [D; 3]) -> D {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}

#[inline(always)]
fn minus<D: Doubles16>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

/// Projects vertices by the operations of [`super::triangle::Projection::project`].
#[inline(always)]
fn project<D: Doubles16>(v: [D::Singles; 3], o: [D::Singles; 3], shear: [D::Singles; 2]) -> [D; 2] {
    let (x, y, z) = (v[0].sub(o[0]), v[1].sub(o[1]), v[2].sub(o[2]));
    [D::of(x.sub(shear[0].mul(z))), D::of(y.sub(shear[1].mul(z)))]
}

/// The signed area of the edge test, by the operations of the function with this name in
/// [`super::triangle`] but without the symbolic shift: the sign of zero is left undecided.
#[inline(always)]
fn edge<D: Doubles16>(p: [D; 2], q: [D; 2]) -> D {
    p[0].mul(q[1]).sub(p[1].mul(q[0]))
}
