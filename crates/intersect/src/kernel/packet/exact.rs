//! The exact test for several pairs of a ray and a triangle at once.
//!
//! The same operations in the same order as in [`super::super::triangle::exact_hit`], so the same bits. What is rare there (ties, rays in
//! the plane of the triangle, points outside of its box by rounding) is not decided here but handed back.

use super::super::triangle::{PLACE_TOLERANCE, TriangleBlock};
use super::bundle::Bundle;
use crate::precision::Real;
use snell_math::simd::{Lanes4, WideLanes};

/// Pairs that are tested together.
pub(super) const PAIRS: usize = 8;

/// Rays of a bundle, by their lanes, and triangles, by their places: eight times the number of the block and the lane there.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Pairs {
    pub triangles: [u32; PAIRS],
    pub rays: [u32; PAIRS],
    pub count: usize,
    /// The rays, a bit for each.
    pub waiting: u32,
}

impl Pairs {
    pub const NONE: Self = Self { triangles: [0; PAIRS], rays: [0; PAIRS], count: 0, waiting: 0 };

    /// Adds a pair. There must be room.
    #[inline(always)]
    pub fn push(&mut self, ray: u32, triangle: u32) {
        self.push_if(ray, triangle, true);
    }

    /// The same if it `is_one`: written in any case, so that nothing branches on it.
    #[inline(always)]
    pub fn push_if(&mut self, ray: u32, triangle: u32, is_one: bool) {
        self.rays[self.count & (PAIRS - 1)] = ray;
        self.triangles[self.count & (PAIRS - 1)] = triangle;
        self.count += usize::from(is_one);
        self.waiting |= u32::from(is_one) << ray;
    }

    /// Forgets all.
    #[inline(always)]
    pub fn clear(&mut self) {
        (self.count, self.waiting) = (0, 0);
    }

    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.count == PAIRS
    }

    /// The block of the triangle of a pair, and its lane there.
    #[inline(always)]
    pub fn place(&self, pair: usize) -> (usize, usize) {
        let triangle = self.triangles[pair & (PAIRS - 1)] as usize;
        (triangle >> 3, triangle & 7)
    }
}

/// What became of the pairs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found<R> {
    pub t: [R; PAIRS],
    pub b1: [R; PAIRS],
    pub b2: [R; PAIRS],
    /// One bit per pair that is a hit.
    pub hits: u32,
    /// One bit per pair that is not decided.
    pub unsure: u32,
}

impl<R: Real> Found<R> {
    pub const NONE: Self = Self { t: [R::ZERO; PAIRS], b1: [R::ZERO; PAIRS], b2: [R::ZERO; PAIRS], hits: 0, unsure: 0 };
}

/// Tests up to eight pairs. Unused ones must be copies of others or those of [`Pairs::NONE`]; their results mean nothing.
///
/// # Safety
/// The machine must have the instructions of `L`; the triangles must be of these blocks. All rays of the bundle must be drawn along its z
/// axis ([`Bundle::is_aligned`]).
#[inline(always)]
pub(crate) unsafe fn exact_hits<L: WideLanes>(
    blocks: &[TriangleBlock],
    bundle: &Bundle,
    pairs: &Pairs,
    found: &mut Found<f32>,
) {
    // SAFETY: passed on to the caller.
    unsafe {
        let start = blocks.as_ptr();
        let t = &pairs.triangles;
        let triangles = [
            triangle(start, t[0]),
            triangle(start, t[1]),
            triangle(start, t[2]),
            triangle(start, t[3]),
            triangle(start, t[4]),
            triangle(start, t[5]),
            triangle(start, t[6]),
            triangle(start, t[7]),
        ];
        let corners = [corner::<L>(&triangles, 0), corner::<L>(&triangles, 1), corner::<L>(&triangles, 2)];
        let frame = Frame::<L>::new(bundle, pairs);
        let drawn = [frame.draw(&corners[0]), frame.draw(&corners[1]), frame.draw(&corners[2])];
        let four = Four::<L::Doubles> {
            drawn: [first(drawn[0]), first(drawn[1]), first(drawn[2])],
            corners: [first3(corners[0]), first3(corners[1]), first3(corners[2])],
        };
        four.test(bundle, pairs, 0, found);
        if pairs.count > 4 {
            let four = Four::<L::Doubles> {
                drawn: [last(drawn[0]), last(drawn[1]), last(drawn[2])],
                corners: [last3(corners[0]), last3(corners[1]), last3(corners[2])],
            };
            four.test(bundle, pairs, 4, found);
        }
    }
}

/// Where the numbers of a triangle are: one in each row of eight.
///
/// # Safety
/// The triangle must be one of the blocks.
#[inline(always)]
unsafe fn triangle(blocks: *const TriangleBlock, place: u32) -> *const f32 {
    // SAFETY: as promised by the caller.
    unsafe { (&raw const (*blocks.add(place as usize >> 3)).vertices).cast::<f32>().add(place as usize & 7) }
}

/// A corner of each of the triangles.
///
/// # Safety
/// The machine must have the instructions of `L`; the corner must be below 3.
#[inline(always)]
unsafe fn corner<L: WideLanes>(triangles: &[*const f32; PAIRS], corner: usize) -> [L; 3] {
    // SAFETY: passed on to the caller.
    unsafe { [row(triangles, 3 * corner), row(triangles, 3 * corner + 1), row(triangles, 3 * corner + 2)] }
}

/// The number in a row of each of the triangles.
///
/// # Safety
/// The machine must have the instructions of `L`; the row must be below 9.
#[inline(always)]
unsafe fn row<L: WideLanes>(triangles: &[*const f32; PAIRS], row: usize) -> L {
    let [a, b, c, d, e, f, g, h] = triangles;
    let at = 8 * row;
    // SAFETY: passed on to the caller.
    unsafe {
        L::load(&[*a.add(at), *b.add(at), *c.add(at), *d.add(at), *e.add(at), *f.add(at), *g.add(at), *h.add(at)])
    }
}

#[inline(always)]
fn first<L: WideLanes>(v: [L; 2]) -> [L::Doubles; 2] {
    [v[0].first_doubles(), v[1].first_doubles()]
}

#[inline(always)]
fn last<L: WideLanes>(v: [L; 2]) -> [L::Doubles; 2] {
    [v[0].last_doubles(), v[1].last_doubles()]
}

#[inline(always)]
fn first3<L: WideLanes>(v: [L; 3]) -> [L::Doubles; 3] {
    [v[0].first_doubles(), v[1].first_doubles(), v[2].first_doubles()]
}

#[inline(always)]
fn last3<L: WideLanes>(v: [L; 3]) -> [L::Doubles; 3] {
    [v[0].last_doubles(), v[1].last_doubles(), v[2].last_doubles()]
}

/// The planes that the rays of the pairs draw on: [`super::super::ray::LocalRay::draw`].
struct Frame<L> {
    axes: [usize; 3],
    origin: [L; 3],
    shear: [L; 2],
}

impl<L: WideLanes> Frame<L> {
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    unsafe fn new(bundle: &Bundle, pairs: &Pairs) -> Self {
        // SAFETY: passed on to the caller; axes are below 3, and `of_pairs` bounds the rays.
        unsafe {
            let [x, y, z] = bundle.axes;
            let sign = L::splat(bundle.sign);
            let shear =
                [of_pairs::<L>(&bundle.slope[0], pairs).mul(sign), of_pairs::<L>(&bundle.slope[1], pairs).mul(sign)];
            let origin = if bundle.kind.common {
                let apex = &bundle.kind.apex;
                [L::splat(*apex.get_unchecked(x)), L::splat(*apex.get_unchecked(y)), L::splat(*apex.get_unchecked(z))]
            } else {
                let origin = &bundle.drawn_origin;
                [of_pairs(&origin[0], pairs), of_pairs(&origin[1], pairs), of_pairs(&origin[2], pairs)]
            };
            Self { axes: bundle.axes, origin, shear }
        }
    }

    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    unsafe fn draw(&self, v: &[L; 3]) -> [L; 2] {
        let [kx, ky, kz] = self.axes;
        // SAFETY: axes are below 3.
        unsafe {
            let x = v.get_unchecked(kx).sub(self.origin[0]);
            let y = v.get_unchecked(ky).sub(self.origin[1]);
            let z = v.get_unchecked(kz).sub(self.origin[2]);
            [x.sub(self.shear[0].mul(z)), y.sub(self.shear[1].mul(z))]
        }
    }
}

/// The values of the rays of the pairs.
///
/// # Safety
/// The machine must have the instructions of `L`.
#[inline(always)]
unsafe fn of_pairs<L: WideLanes>(values: &[f32; 16], pairs: &Pairs) -> L {
    let r = &pairs.rays;
    let pick = |i: usize| values[r[i] as usize & 15];
    // SAFETY: passed on to the caller.
    unsafe { L::load(&[pick(0), pick(1), pick(2), pick(3), pick(4), pick(5), pick(6), pick(7)]) }
}

/// Four of the pairs in double precision.
struct Four<D> {
    drawn: [[D; 2]; 3],
    corners: [[D; 3]; 3],
}

impl<D: Lanes4> Four<D> {
    /// # Safety
    /// The machine must have the instructions of `D`; `from` must be 0 or 4.
    #[inline(always)]
    unsafe fn test(&self, bundle: &Bundle, pairs: &Pairs, from: usize, found: &mut Found<f32>) {
        let [p0, p1, p2] = self.drawn;
        let (w0, s0) = edge(p1, p2);
        let (w1, s1) = edge(p2, p0);
        let (w2, s2) = edge(p0, p1);
        let inside = (s0[0] & s1[0] & s2[0]) | (s0[1] & s1[1] & s2[1]);
        // Ties, and what is not a number.
        let mut unsure = !((s0[0] | s0[1]) & (s1[0] | s1[1]) & (s2[0] | s2[1])) & 0xf;
        if inside | unsure == 0 {
            return;
        }
        // SAFETY: passed on to the caller.
        unsafe {
            let row = |i: usize| pairs.rays[from + i] as usize & 15;
            let rows = [row(0), row(1), row(2), row(3)];
            let (o, d) = (&bundle.rays.origin, &bundle.rays.direction);
            let [ox, oy, oz, t_min] = D::load_columns([&o[rows[0]], &o[rows[1]], &o[rows[2]], &o[rows[3]]]);
            let [dx, dy, dz, _] = D::load_columns([&d[rows[0]], &d[rows[1]], &d[rows[2]], &d[rows[3]]]);
            let [c0, c1, c2] = self.corners;
            let relative = [minus(c0, [ox, oy, oz]), minus(c1, [ox, oy, oz]), minus(c2, [ox, oy, oz])];
            let normal = cross(minus(c1, c0), minus(c2, c0));
            let direction = [dx, dy, dz];
            let t = dot(normal, relative[0]).div(dot(normal, direction));
            unsure |= !t.abs().lt(D::splat(f64::INFINITY)) & 0xf;
            let beyond = t_min.lt(t);
            if inside & beyond | unsure == 0 {
                return;
            }
            let scale = D::splat(1.0).div(w0.add(w1).add(w2));
            let (b1, b2) = (w1.mul(scale), w2.mul(scale));
            let [r0, r1, r2] = relative;
            let low = [r0[0].min(r1[0]).min(r2[0]), r0[1].min(r1[1]).min(r2[1]), r0[2].min(r1[2]).min(r2[2])];
            let high = [r0[0].max(r1[0]).max(r2[0]), r0[1].max(r1[1]).max(r2[1]), r0[2].max(r1[2]).max(r2[2])];
            let size = high[0].sub(low[0]).max(high[1].sub(low[1])).max(high[2].sub(low[2]));
            // Surely near the drawn place: without divisions, so a little stricter.
            let z = *bundle.axes.get_unchecked(2);
            let b0 = D::splat(1.0).sub(b1).sub(b2);
            let place = r0.get_unchecked(z).mul(b0).add(r1.get_unchecked(z).mul(b1)).add(r2.get_unchecked(z).mul(b2));
            let reach = place.abs().add(size).mul(D::splat(PLACE_TOLERANCE * (1.0 - 1e-9)));
            let mut in_place = place.sub(t.mul(*direction.get_unchecked(z))).abs().le(reach);
            let padding = size.mul(D::splat(0.8e-6));
            for axis in 0..3 {
                let point = direction[axis].mul(t);
                let margin = point.abs().mul(D::splat(1e-8));
                in_place &=
                    low[axis].sub(padding).le(point.add(margin)) & point.sub(margin).le(high[axis].add(padding));
            }
            unsure |= inside & beyond & !in_place;
            found.hits |= (inside & beyond & !unsure) << from;
            found.unsure |= unsure << from;
            t.store_rounded(&mut *found.t.as_mut_ptr().add(from).cast::<[f32; 4]>());
            b1.store_rounded(&mut *found.b1.as_mut_ptr().add(from).cast::<[f32; 4]>());
            b2.store_rounded(&mut *found.b2.as_mut_ptr().add(from).cast::<[f32; 4]>());
        }
    }
}

/// As the function of the same name of the exact test: the area, and where it is surely positive and negative.
#[inline(always)]
fn edge<D: Lanes4>(p: [D; 2], q: [D; 2]) -> (D, [u32; 2]) {
    let (a, b) = (p[0].mul(q[1]), p[1].mul(q[0]));
    (a.sub(b), [b.lt(a), a.lt(b)])
}

#[inline(always)]
fn minus<D: Lanes4>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[0].sub(b[0]), a[1].sub(b[1]), a[2].sub(b[2])]
}

#[inline(always)]
fn cross<D: Lanes4>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[1].mul(b[2]).sub(b[1].mul(a[2])), a[2].mul(b[0]).sub(b[2].mul(a[0])), a[0].mul(b[1]).sub(b[0].mul(a[1]))]
}

#[inline(always)]
fn dot<D: Lanes4>(a: [D; 3], b: [D; 3]) -> D {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]))
}
