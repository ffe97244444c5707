//! The watertight ray-triangle test: a quick filter over eight triangles, and the exact test for
//! those that pass it.
//!
//! The vertices are drawn on a plane across the ray in `f32` (Woop, Benthin and Wald, Watertight
//! Ray/Triangle Intersection, JCGT 2013). The drawing is a little inexact but the same for every
//! triangle of a vertex, and on it every decision is exact: `f32` products have no error in `f64`,
//! and where the ray meets an edge or vertex of the drawing, a symbolic shift of the ray decides.
//! So a ray through a closed mesh crosses each fan exactly once.
//!
//! The filter may pass too much but never too little, so the hits are the same at every SIMD level,
//! and with any structure.

use super::quick::QuickRay;
use super::ray::{Axes, LocalRay, wide};
use snell_math::simd::Lanes8;
use snell_math::{Bounds3, DVec3, Mat4, Vec2, Vec3, Vec4};

/// Up to eight triangles, ready for [`candidates`].
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct TriangleBlock {
    /// By vertex, axis, triangle.
    pub vertices: [[[f32; 8]; 3]; 3],
    /// Number of the triangle within its group.
    pub ids: [u32; 8],
}

impl TriangleBlock {
    pub const EMPTY: Self = Self { vertices: [[[0.0; 8]; 3]; 3], ids: [u32::MAX; 8] };

    /// The box of its first triangles.
    pub fn bounds(&self, count: u32) -> Bounds3 {
        Bounds3::of((0..count as usize).flat_map(|lane| self.corners(lane)).map(Vec3::from_array))
    }

    /// The box around its first triangles, each padded as by [`crate::mesh::padded_bounds`]. All
    /// vertices must be finite.
    #[inline]
    pub fn padded_bounds(&self, count: usize) -> Bounds3 {
        let (mut low, mut high) = ([Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]);
        for (half, lanes) in
            [Vec4::new(0.0, 1.0, 2.0, 3.0), Vec4::new(4.0, 5.0, 6.0, 7.0)].into_iter().enumerate()
        {
            let used = lanes.cmplt(Vec4::splat(count as f32));
            let row = |vertex: usize, axis: usize| {
                Vec4::from_slice(&self.vertices[vertex][axis][4 * half..])
            };
            let rows = |axis: usize| [row(0, axis), row(1, axis), row(2, axis)];
            let sides = [0, 1, 2].map(|axis| {
                let [a, b, c] = rows(axis);
                (a.min(b).min(c), a.max(b).max(c))
            });
            let [x, y, z] = sides.map(|(l, h)| h - l);
            let padding = x.max(y).max(z) * 1e-6 + f32::MIN_POSITIVE;
            for (axis, (l, h)) in sides.into_iter().enumerate() {
                let l = (l - (l.abs() * f32::EPSILON + padding)).max(Vec4::MIN);
                let h = (h + (h.abs() * f32::EPSILON + padding)).min(Vec4::MAX);
                low[axis] = low[axis].min(Vec4::select(used, l, Vec4::INFINITY));
                high[axis] = high[axis].max(Vec4::select(used, h, Vec4::NEG_INFINITY));
            }
        }
        let across = |x: [Vec4; 3]| Mat4::from_cols(x[0], x[1], x[2], x[2]).transpose();
        let (low, high) = (across(low), across(high));
        let least = low.x_axis.min(low.y_axis).min(low.z_axis.min(low.w_axis));
        let most = high.x_axis.max(high.y_axis).max(high.z_axis.max(high.w_axis));
        Bounds3 { min: least.truncate(), max: most.truncate() }
    }

    /// The corners of one of the triangles.
    #[inline(always)]
    pub fn corners(&self, lane: usize) -> [[f32; 3]; 3] {
        let (lane, v) = (lane & 7, &self.vertices);
        let corner = |i: usize| [v[i][0][lane], v[i][1][lane], v[i][2][lane]];
        [corner(0), corner(1), corner(2)]
    }

    /// Puts triangles into all lanes: their corners by vertex and lane.
    #[inline]
    pub fn set_all(&mut self, corners: &[[Vec4; 8]; 3], ids: [u32; 8]) {
        for (vertex, [a, b, c, d, e, f, g, h]) in self.vertices.iter_mut().zip(*corners) {
            // In registers: numbers written one by one and read as rows (by `padded_bounds`) would
            // have to wait.
            let (low, high) =
                (Mat4::from_cols(a, b, c, d).transpose(), Mat4::from_cols(e, f, g, h).transpose());
            for (axis, row) in vertex.iter_mut().enumerate() {
                let (low, high) = (low.col(axis).to_array(), high.col(axis).to_array());
                *row = [low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]];
            }
        }
        self.ids = ids;
    }

    /// Puts a triangle into a lane.
    pub fn set(&mut self, lane: usize, corners: &[[f32; 3]; 3], id: u32) {
        for (vertex, corner) in self.vertices.iter_mut().zip(corners) {
            for (axis, &x) in vertex.iter_mut().zip(corner) {
                axis[lane] = x;
            }
        }
        self.ids[lane] = id;
    }
}

/// Bound of the rounding of an edge value, relative to the largest drawn |x| times the largest
/// drawn |y|: two products and a difference are off by at most `2^-22` of it. Doubled.
const EDGE_ERROR: f32 = 4.76837158203125e-7;

/// Which triangles of the block the ray may hit between `t_min` and `cull` (inclusive). `cull` must
/// be padded by the rounding of a depth (a relative `1e-6`).
#[inline(always)]
pub(crate) fn candidates<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    ray: &LocalRay,
    t_min: f32,
    cull: f32,
) -> u32 {
    let ([x0, y0, z0], [x1, y1, z1], [x2, y2, z2], zero, bound_scale, tiny) = {
        let frame = DrawingFrame::<L>::new(token, ray);
        let [v0, v1, v2] = &block.vertices;
        (
            frame.draw(token, v0),
            frame.draw(token, v1),
            frame.draw(token, v2),
            L::splat(token, 0.0),
            L::splat(token, EDGE_ERROR),
            L::splat(token, f32::MIN_POSITIVE),
        )
    };
    let u = x1.mul(y2).sub(y1.mul(x2));
    let v = x2.mul(y0).sub(y2.mul(x0));
    let w = x0.mul(y1).sub(y0.mul(x1));
    // Surely outside: two edges whose signs are certain and differ. NaN is never sure.
    let (x, y) = (x0.abs().max(x1.abs()).max(x2.abs()), y0.abs().max(y1.abs()).max(y2.abs()));
    let bound = x.mul(y).mul(bound_scale).add(tiny);
    let outside = u.min(v).min(w).add(bound).lt(zero) & bound.lt(u.max(v).max(w));
    // Surely too near or too far: all three corners are. (With `depth_scale` 0 all depths are 0 and
    // prove nothing.)
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

/// How far before the nearest or beyond the farthest corner a hit may be placed: [`clamp_to_box`]
/// keeps it in the box of the triangle, padded by a share of its size, which is at most twice the
/// drawn size (`sides`) and the largest distance of a corner (`depth`) together.
#[inline(always)]
pub(crate) fn place_margin<L: Lanes8>(token: L::Token, depth: L, sides: L, depth_scale: f32) -> L {
    sides.mul(L::splat(token, depth_scale.abs())).add(depth).mul(L::splat(token, 4e-6))
}

/// Bound of the rounding of an edge value, the difference of two products, relative to the product
/// that is rounded first: half a unit in the last place if the other is not rounded, else one and a
/// half. Doubled.
pub(crate) const fn edge_error(is_fused: bool) -> f32 {
    if is_fused { f32::EPSILON } else { 2.0 * f32::EPSILON }
}

/// Which triangles of the block the line of an ordinary ray may pass through: all except those with
/// two edges whose signs are certain and differ. Unused lanes are unspecified.
#[inline(always)]
pub(crate) fn lines_through<L: Lanes8>(
    token: L::Token,
    block: &TriangleBlock,
    ray: &QuickRay,
) -> u32 {
    let [x, y, z] = ray.axes.of(&ray.origin);
    let frame = MirroredFrame {
        axes: ray.axes,
        origin: [L::splat(token, *x), L::splat(token, *y), L::splat(token, *z)],
        shear: [L::splat(token, ray.shear[0]), L::splat(token, ray.shear[1])],
    };
    let [v0, v1, v2] = &block.vertices;
    let ([x0, y0], [x1, y1], [x2, y2]) =
        (frame.draw(token, v0), frame.draw(token, v1), frame.draw(token, v2));
    let (pu, pv, pw) = (y1.mul(x2), y2.mul(x0), y0.mul(x1));
    let (u, v, w) = (x1.mul_sub(y2, pu), x2.mul_sub(y0, pv), x0.mul_sub(y1, pw));
    let error = L::splat(token, edge_error(L::FUSED));
    let bound =
        pu.abs().max(pv.abs()).max(pw.abs()).mul_add(error, L::splat(token, f32::MIN_POSITIVE));
    // How far all of them are on one side, on the better side.
    let inside = u.min(v).min(w).max(L::splat(token, 0.0).sub(u.max(v).max(w)));
    !inside.add(bound).signs() & 0xff
}

/// [`LocalRay::draw`] for eight vertices at a time, mirrored at the origin: all differences are the
/// other way round (a load less each), so all coordinates have the opposite sign, and the edge
/// values, products of two, are the same.
pub(crate) struct MirroredFrame<L> {
    axes: Axes,
    origin: [L; 3],
    shear: [L; 2],
}

impl<L: Lanes8> MirroredFrame<L> {
    #[inline(always)]
    fn draw(&self, token: L::Token, v: &[[f32; 8]; 3]) -> [L; 2] {
        let [x, y, z] = self.axes.of(v);
        let x = self.origin[0].sub(L::load(token, x));
        let y = self.origin[1].sub(L::load(token, y));
        let z = self.origin[2].sub(L::load(token, z));
        [x.sub(self.shear[0].mul(z)), y.sub(self.shear[1].mul(z))]
    }
}

/// [`LocalRay::draw`] for eight vertices at a time: the same operations. (Plain functions instead
/// of closures, which are not always inlined, and vectors must not pass through calls.)
pub(crate) struct DrawingFrame<L> {
    axes: Axes,
    origin: [L; 3],
    shear: [L; 2],
}

impl<L: Lanes8> DrawingFrame<L> {
    #[inline(always)]
    pub fn new(token: L::Token, ray: &LocalRay) -> Self {
        Self::of(token, ray.axes, &ray.origin, &ray.shear)
    }

    #[inline(always)]
    pub fn of_quick(token: L::Token, ray: &QuickRay) -> Self {
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
    pub fn draw(&self, token: L::Token, v: &[[f32; 8]; 3]) -> [L; 3] {
        let [x, y, z] = self.axes.of(v);
        let x = L::load(token, x).sub(self.origin[0]);
        let y = L::load(token, y).sub(self.origin[1]);
        let z = L::load(token, z).sub(self.origin[2]);
        [x.sub(self.shear[0].mul(z)), y.sub(self.shear[1].mul(z)), z]
    }
}

/// Twice the signed area of the drawn triangle (ray, p, q), and its exact sign after the symbolic
/// shift of the ray: 0 only if the edge is a point or not a number.
#[inline(always)]
fn edge(p: [f32; 2], q: [f32; 2]) -> (f64, i32) {
    let (a, b) = (f64::from(p[0]) * f64::from(q[1]), f64::from(p[1]) * f64::from(q[0]));
    let sign = |less: bool, greater: bool| i32::from(greater) - i32::from(less);
    let decided = if a != b {
        sign(a < b, a > b)
    } else if p[1] != q[1] {
        sign(p[1] < q[1], p[1] > q[1])
    } else {
        sign(q[0] < p[0], q[0] > p[0])
    };
    (a - b, decided)
}

/// A ray as the exact test wants it: what decides distances, and what decides which triangles cover
/// it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExactRay {
    pub origin: DVec3,
    pub direction: DVec3,
    /// See [`LocalRay`].
    pub drawing: Drawing,
}

/// The plane across the ray that vertices are drawn on; see [`LocalRay`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawing {
    pub origin: [f32; 3],
    pub axes: Axes,
    pub shear: [f32; 2],
}

impl Drawing {
    /// The vertex as drawn. It has the same bits in every triangle and at every SIMD level: rounded
    /// subtraction, product, subtraction, never fused.
    #[inline(always)]
    pub fn draw(&self, v: &[f32; 3]) -> [f32; 2] {
        let ([vx, vy, vz], [ox, oy, oz]) = (self.axes.of(v), self.axes.of(&self.origin));
        let (x, y, z) = (vx - ox, vy - oy, vz - oz);
        [x - self.shear[0] * z, y - self.shear[1] * z]
    }
}

/// The exact test: distance and barycentrics `(b1, b2)` if the line of the ray passes through the
/// triangle at `t > t_min`.
///
/// The distance comes from the plane of the triangle in `f64`, so it has the right sign for any
/// start that is more than a few units in the last place (of `f64`) off the plane. It is then moved
/// into the interval in which the ray is inside the triangle's box (it leaves that only by
/// rounding), so that skipping boxes can never lose it, and near the point of the triangle that was
/// drawn where the ray is, so that skipping boxes of its pieces cannot either.
#[inline(always)]
pub(crate) fn exact_hit(
    ray: &LocalRay,
    corners: &[[f32; 3]; 3],
    t_min: f64,
) -> Option<(f64, Vec2)> {
    exact_hit_on(&ray.exact_ray(), corners, t_min)
}

/// [`exact_hit`] for a ray from elsewhere.
#[inline(always)]
pub(crate) fn exact_hit_on(
    ray: &ExactRay,
    corners: &[[f32; 3]; 3],
    t_min: f64,
) -> Option<(f64, Vec2)> {
    let plane = plane_distance(&ray.origin, &ray.direction, corners);
    if is_behind(plane, t_min) { None } else { hit_in_plane(ray, corners, plane, t_min) }
}

/// Where the ray meets the plane of a triangle: the first part of [`exact_hit`]. Infinite or NaN if
/// that is not known.
#[inline(always)]
pub(crate) fn plane_distance(origin: &DVec3, direction: &DVec3, corners: &[[f32; 3]; 3]) -> f64 {
    let [height, speed] = height_and_speed(origin, direction, corners);
    height / speed
}

/// How high the plane of a triangle is above the origin, and how fast the ray rises to it, both
/// times the normal.
#[inline(always)]
pub(crate) fn height_and_speed(
    origin: &DVec3,
    direction: &DVec3,
    corners: &[[f32; 3]; 3],
) -> [f64; 2] {
    let corners = [wide(corners[0]), wide(corners[1]), wide(corners[2])];
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    [normal.dot(corners[0] - *origin), normal.dot(*direction)]
}

/// True if a triangle with this [`plane_distance`] cannot be hit beyond `t_min`. Most triangles
/// that are tested exactly are of this kind: the ones that the ray starts on.
#[inline(always)]
pub(crate) fn is_behind(plane: f64, t_min: f64) -> bool {
    plane <= t_min && plane > f64::NEG_INFINITY
}

/// The second part of [`exact_hit`].
#[inline(always)]
pub(crate) fn hit_in_plane(
    ray: &ExactRay,
    corners: &[[f32; 3]; 3],
    plane: f64,
    t_min: f64,
) -> Option<(f64, Vec2)> {
    let [p0, p1, p2] = [
        ray.drawing.draw(&corners[0]),
        ray.drawing.draw(&corners[1]),
        ray.drawing.draw(&corners[2]),
    ];
    let (w0, s0) = edge(p1, p2);
    let (w1, s1) = edge(p2, p0);
    let (w2, s2) = edge(p0, p1);
    if s0 == 0 || s0 != s1 || s0 != s2 {
        return None;
    }
    let sum = w0 + w1 + w2;
    let scale = 1.0 / sum;
    let (b1, b2) = if sum != 0.0 { (w1 * scale, w2 * scale) } else { (1.0 / 3.0, 1.0 / 3.0) };
    let relative = corners.map(|corner| wide(corner) - ray.origin);
    let z = ray.drawing.axes.z();
    let place = (relative[0][z] * (1.0 - b1 - b2) + relative[1][z] * b1 + relative[2][z] * b2)
        / ray.direction[z];
    let t = if plane.is_finite() { plane } else { place };
    if t.is_nan() || t <= t_min {
        return None;
    }
    let t = near_place(t, place, ray.direction[z], &relative);
    let t = clamp_to_box(&ray.direction, &relative, t);
    Some((t, Vec2::new(b1 as f32, b2 as f32)))
}

/// How far along the ray a hit may be from the point of the triangle that was drawn there, relative
/// to the distance and to the size of the triangle. Only the drawing is inexact, by some `1e-7`, so
/// only rays at less than about a tenth of a degree to the triangle get this far.
pub(crate) const PLACE_TOLERANCE: f64 = 5e-5;

/// The value nearest to `t` that is within [`PLACE_TOLERANCE`] of `place`. `z` is the largest
/// component of the direction.
#[inline(always)]
fn near_place(t: f64, place: f64, z: f64, relative: &[DVec3; 3]) -> f64 {
    let low = relative[0].min(relative[1]).min(relative[2]);
    let high = relative[0].max(relative[1]).max(relative[2]);
    let reach = (place.abs() + (high - low).max_element() / z.abs()) * PLACE_TOLERANCE;
    // `max` and `min` pass over what is not a number.
    if (t - place).abs() <= reach { t } else { t.max(place - reach).min(place + reach) }
}

/// The nearest value to `t` at which the ray is in the box of the three corners (given relative to
/// its origin), padded by a little less than structures pad it ([`crate::mesh::padded_bounds`]);
/// `t` itself if it is there up to an error that the padding of distances covers.
#[inline(always)]
pub(crate) fn clamp_to_box(direction: &DVec3, relative: &[DVec3; 3], t: f64) -> f64 {
    let low = relative[0].min(relative[1]).min(relative[2]);
    let high = relative[0].max(relative[1]).max(relative[2]);
    let padding = (high - low).max_element() * 0.8e-6;
    let (low, high) = (low - padding, high + padding);
    let point = *direction * t;
    let margin = point.abs() * 1e-8;
    if (point + margin).cmpge(low).all() && (point - margin).cmple(high).all() {
        return t;
    }
    clamp_to_slabs(direction, low, high, t)
}

/// The slow part of [`clamp_to_box`], for rays that graze the triangle.
#[cold]
fn clamp_to_slabs(direction: &DVec3, low: DVec3, high: DVec3, t: f64) -> f64 {
    let inverse = direction.recip();
    let (low, high) = (low * inverse, high * inverse);
    // An axis the ray does not move along says nothing: 0 / 0 and x / 0.
    let usable = inverse.is_finite_mask();
    let enter = DVec3::select(usable, low.min(high), DVec3::NEG_INFINITY).max_element();
    let leave = DVec3::select(usable, low.max(high), DVec3::INFINITY).min_element();
    t.min(leave).max(enter)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use snell_math::DRay;
    use snell_math::simd::{Portable, Portable8};

    fn ray(o: [f32; 3], d: [f32; 3]) -> LocalRay {
        LocalRay::new(&DRay::new(wide(o), wide(d)))
    }

    #[test]
    fn an_edge_shared_by_two_triangles_belongs_to_one_of_them() {
        let (a, b, c, d) = ([0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]);
        for i in 0..=16 {
            let s = i as f32 / 16.0;
            // The vertices a and c have other neighbours outside, so only the inner points must
            // count once.
            let ray = ray([s, s, 0.0], [0.0, 0.0, 1.0]);
            let count =
                [[a, b, c], [a, c, d]].iter().filter(|t| exact_hit(&ray, t, 0.0).is_some()).count();
            assert!(count == 1 || ((i == 0 || i == 16) && count == 0), "{i}: {count}");
        }
    }

    proptest! {
        #[test]
        fn boxes_around_blocks_are_those_around_their_triangles(
            corners in prop::collection::vec(
                prop::array::uniform3(prop::array::uniform3(-1e3f32..1e3)), 1..=8
            ),
            exponent in -60..36,
        ) {
            let scale = 2f32.powi(3 * exponent);
            let (mut block, mut expected) = (TriangleBlock::EMPTY, Bounds3::EMPTY);
            for (lane, corners) in corners.iter().enumerate() {
                let corners = corners.map(|v| Vec3::from_array(v) * scale);
                block.set(lane, &corners.map(|v| v.to_array()), lane as u32);
                expected = expected.union(&crate::mesh::padded_bounds(&corners));
            }
            prop_assert_eq!(block.padded_bounds(corners.len()), expected);
        }
    }

    #[test]
    fn distance_and_barycentrics_describe_the_point() {
        let t = [[0.0, 0.0, 2.0], [4.0, 0.0, 2.0], [0.0, 4.0, 2.0]];
        let (distance, uv) =
            exact_hit(&ray([1.0, 2.0, 0.0], [0.0, 0.0, 0.5]), &t, 0.0).expect("a hit");
        assert_eq!((distance, uv), (4.0, Vec2::new(0.25, 0.5)));
        assert!(
            exact_hit(&ray([1.0, 2.0, 0.0], [0.0, 0.0, 0.5]), &t, 4.0).is_none(),
            "the interval is open"
        );
    }

    fn lines_through_at_all_levels(block: &TriangleBlock, ray: &QuickRay) -> Vec<u32> {
        let mut all = vec![lines_through::<Portable8>(Portable, block, ray)];
        #[cfg(target_arch = "x86_64")]
        if let Some(token) = snell_math::simd::Avx2::new() {
            all.push(lines_through::<snell_math::simd::Avx8>(token, block, ray));
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
            let mut quick = QuickRay::UNSET;
            let (origin, direction) = (ray.exact.origin, ray.exact.direction);
            let is_quick = quick.set_from_exact::<Portable8>(&origin, &direction);
            if exact_hit(&ray, &corners, 0.0).is_some() {
                prop_assert!(mask & 8 != 0);
                let is_found = |lanes: &u32| lanes & 8 != 0;
                prop_assert!(
                    !is_quick || lines_through_at_all_levels(&block, &quick).iter().all(is_found)
                );
            }
            if is_quick {
                let again = exact_hit_on(&quick.exact(origin, direction), &corners, 0.0);
                prop_assert_eq!(again, exact_hit(&ray, &corners, 0.0));
            }
        }
    }
}
