//! Convex polygons in the plane of a [`super::View`].

use snell_math::DVec2;
use snell_math::real;
use snell_math::rotation;
use std::f64::consts::PI;

/// Maximum number of vertices of a polygon.
const CAPACITY: usize = 12;

/// Polygons with more vertices are halved before a facet cuts them, because its three edges and a
/// line of equal depth add a vertex each.
const LARGE: usize = CAPACITY - 4;

/// A convex polygon with few vertices, counter-clockwise.
#[derive(Clone, Copy, Debug)]
pub struct ConvexPolygon {
    vertices: [DVec2; CAPACITY],
    len: u8,
}

/// A line, where `normal . p + offset` is 0, or any affine function of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine {
    pub normal: DVec2,
    pub offset: f64,
}

impl Affine {
    pub fn at(&self, p: DVec2) -> f64 {
        self.normal.dot(p) + self.offset
    }

    pub fn minus(&self, other: &Self) -> Self {
        Self { normal: self.normal - other.normal, offset: self.offset - other.offset }
    }

    /// Distance to the left of the line from `a` to `b`. Swapping `a` and `b` exactly negates it.
    pub fn left_of(a: DVec2, b: DVec2) -> Self {
        let scale = 1.0 / (b - a).length();
        Self { normal: DVec2::new(a.y - b.y, b.x - a.x) * scale, offset: a.perp_dot(b) * scale }
    }
}

/// The position of a polygon relative to a line.
#[expect(clippy::large_enum_variant, reason = "matched at once, never stored")]
pub(super) enum Cut {
    /// Nothing is on the negative side.
    Inside,
    /// Nothing is on the positive side.
    Outside,
    /// The parts on the positive and on the negative side.
    Both(ConvexPolygon, ConvexPolygon),
}

impl ConvexPolygon {
    /// The rectangle with these minimum and maximum corners.
    pub fn rectangle(low: DVec2, high: DVec2) -> Self {
        Self::of(&[low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)])
    }

    /// The triangle with these corners, in either orientation.
    pub fn triangle(a: DVec2, b: DVec2, c: DVec2) -> Self {
        if (b - a).perp_dot(c - a) < 0.0 { Self::of(&[a, c, b]) } else { Self::of(&[a, b, c]) }
    }

    fn of(vertices: &[DVec2]) -> Self {
        let mut polygon = Self { vertices: [DVec2::ZERO; CAPACITY], len: vertices.len() as u8 };
        polygon.vertices[..vertices.len()].copy_from_slice(vertices);
        polygon
    }

    /// The vertices, counter-clockwise where y grows upwards.
    pub fn vertices(&self) -> &[DVec2] {
        &self.vertices[..usize::from(self.len)]
    }

    /// The edges, each with the polygon on its left.
    fn edges(&self) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
        let all = self.vertices();
        all.iter().enumerate().map(|(i, &a)| (a, all[(i + 1) % all.len()]))
    }

    /// The area.
    pub fn area(&self) -> f64 {
        let first = self.vertices[0];
        self.edges().map(|(a, b)| (a - first).perp_dot(b - first)).sum::<f64>() * 0.5
    }

    /// The area inside the unit circle around the origin.
    pub fn area_in_unit_disk(&self) -> f64 {
        self.edges().map(|(a, b)| signed_area_in_disk(a, b)).sum()
    }

    /// The area inside the rectangle with these minimum and maximum corners.
    pub fn area_in_rectangle(&self, low: DVec2, high: DVec2) -> f64 {
        if let Some((a, b)) = self.halved() {
            return a.area_in_rectangle(low, high) + b.area_in_rectangle(low, high);
        }
        let side = |normal: DVec2, corner: DVec2| Affine { normal, offset: -normal.dot(corner) };
        let sides = [
            side(DVec2::X, low),
            side(DVec2::Y, low),
            side(DVec2::NEG_X, high),
            side(DVec2::NEG_Y, high),
        ];
        let inside = sides.iter().try_fold(*self, |polygon, side| polygon.clipped(side, 0.0));
        inside.map_or(0.0, |polygon| polygon.area())
    }

    /// The minimum and maximum corner of the polygon's bounding rectangle.
    pub fn extent(&self) -> (DVec2, DVec2) {
        let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        self.vertices().iter().fold(start, |(low, high), &p| (low.min(p), high.max(p)))
    }

    /// True if the point is inside, or less than about `tolerance` outside.
    pub fn contains(&self, p: DVec2, tolerance: f64) -> bool {
        self.edges().all(|(a, b)| (b - a).perp_dot(p - a) >= -tolerance * (b - a).length())
    }

    /// The minimum and maximum of an affine function over the polygon.
    pub(super) fn range(&self, of: &Affine) -> (f64, f64) {
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        self.vertices()
            .iter()
            .map(|&p| of.at(p))
            .fold(start, |(low, high), x| (low.min(x), high.max(x)))
    }

    /// Cuts along a line; values up to `tolerance` count as 0.
    pub(super) fn cut(&self, line: &Affine, tolerance: f64) -> Cut {
        let mut values = [0.0; CAPACITY];
        match self.values(line, tolerance, &mut values) {
            (false, _) => Cut::Outside,
            (true, false) => Cut::Inside,
            (true, true) => {
                let (mut inside, mut outside) = (Self::of(&[]), Self::of(&[]));
                self.walk_around(&values, |p, side| {
                    if side >= 0.0 {
                        inside.push(p);
                    }
                    if side <= 0.0 {
                        outside.push(p);
                    }
                });
                Cut::Both(inside, outside)
            }
        }
    }

    /// The part on the positive side of a line, if there is one.
    pub(super) fn clipped(&self, line: &Affine, tolerance: f64) -> Option<Self> {
        let mut values = [0.0; CAPACITY];
        match self.values(line, tolerance, &mut values) {
            (false, _) => None,
            (true, false) => Some(*self),
            (true, true) => {
                let mut inside = Self::of(&[]);
                self.walk_around(&values, |p, side| {
                    if side >= 0.0 {
                        inside.push(p);
                    }
                });
                Some(inside)
            }
        }
    }

    /// Writes the function's value at each vertex to `values`; magnitudes up to `tolerance` count
    /// as 0. Returns whether any are positive, and whether any are negative.
    fn values(&self, line: &Affine, tolerance: f64, values: &mut [f64; CAPACITY]) -> (bool, bool) {
        let (mut any_in, mut any_out) = (false, false);
        for (value, &p) in values.iter_mut().zip(self.vertices()) {
            let d = line.at(p);
            *value = if d.abs() <= tolerance { 0.0 } else { d };
            any_in |= *value > 0.0;
            any_out |= *value < 0.0;
        }
        (any_in, any_out)
    }

    /// Visits the vertices with their values, and the zero crossings on edges between them.
    fn walk_around(&self, values: &[f64; CAPACITY], mut each: impl FnMut(DVec2, f64)) {
        let count = usize::from(self.len);
        for i in 0..count {
            let j = if i + 1 == count { 0 } else { i + 1 };
            let (a, b, da, db) = (self.vertices[i], self.vertices[j], values[i], values[j]);
            each(a, da);
            if (da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0) {
                each(a + (b - a) * (da / (da - db)), 0.0);
            }
        }
    }

    fn push(&mut self, p: DVec2) {
        self.vertices[usize::from(self.len)] = p;
        self.len += 1;
    }

    /// The mean of the vertices.
    pub fn middle(&self) -> DVec2 {
        self.vertices().iter().sum::<DVec2>() / f64::from(self.len)
    }

    /// The regular octagon around the unit disk.
    pub(super) fn around_unit_disk() -> Self {
        let radius = 1.0 / real::cos(PI / 8.0);
        let vertex = |i: u8| rotation::unit_vector((f64::from(i) + 0.5) * PI / 4.0) * radius;
        Self::of(&std::array::from_fn::<_, 8, _>(|i| vertex(i as u8)))
    }

    /// The two halves, if the polygon has so many vertices that a cut might exceed the capacity.
    pub(super) fn halved(&self) -> Option<(Self, Self)> {
        let all = self.vertices();
        if all.len() <= LARGE {
            return None;
        }
        let middle = all.len() / 2;
        let mut second = Self::of(&all[middle..]);
        second.push(all[0]);
        Some((Self::of(&all[..=middle]), second))
    }
}

/// The signed area of the intersection of the unit disk and the triangle of the origin, `a` and
/// `b`: parts of the edge inside the circle give triangles, the others sectors.
fn signed_area_in_disk(a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let (qa, qb, qc) = (along.length_squared(), a.dot(along), a.length_squared() - 1.0);
    let sector = |p: DVec2, q: DVec2| 0.5 * real::atan2(p.perp_dot(q), p.dot(q));
    let discriminant = qb * qb - qa * qc;
    if qa == 0.0 || discriminant <= 0.0 {
        return sector(a, b);
    }
    let root = discriminant.sqrt();
    let (enter, leave) = ((-qb - root) / qa, (-qb + root) / qa);
    if enter >= 1.0 || leave <= 0.0 {
        return sector(a, b);
    }
    let (p, q) = (a + along * enter.max(0.0), a + along * leave.min(1.0));
    let before = if enter > 0.0 { sector(a, p) } else { 0.0 };
    let after = if leave < 1.0 { sector(q, b) } else { 0.0 };
    before + 0.5 * p.perp_dot(q) + after
}

/// The area of the unit disk.
pub(super) const DISK_AREA: f64 = PI;

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng;

    fn random(i: u32, k: u32) -> DVec2 {
        rng::uniform2([i, k, 7, 0]).as_dvec2() * 3.0 - 1.5
    }

    #[test]
    fn areas_of_known_polygons_are_exact() {
        assert_eq!(
            ConvexPolygon::rectangle(DVec2::new(-1.0, 2.0), DVec2::new(3.0, 4.0)).area(),
            8.0
        );
        assert_eq!(ConvexPolygon::triangle(DVec2::ZERO, DVec2::Y * 2.0, DVec2::X).area(), 1.0);
        let whole = ConvexPolygon::rectangle(DVec2::splat(-1.0), DVec2::ONE);
        assert!((whole.area_in_unit_disk() - PI).abs() < 1e-14);
        let quarter = ConvexPolygon::rectangle(DVec2::ZERO, DVec2::splat(5.0));
        assert!((quarter.area_in_unit_disk() - PI / 4.0).abs() < 1e-14);
        let inner = ConvexPolygon::rectangle(DVec2::splat(-0.5), DVec2::splat(0.5));
        assert!((inner.area_in_unit_disk() - 1.0).abs() < 1e-14);
        // The half plane x > 1/2 cuts a segment off.
        let segment = ConvexPolygon::rectangle(DVec2::new(0.5, -2.0), DVec2::new(2.0, 2.0));
        let expected = PI / 3.0 - 0.5 * (0.75f64).sqrt();
        assert!((segment.area_in_unit_disk() - expected).abs() < 1e-14);
    }

    #[test]
    fn areas_in_the_cells_of_a_grid_add_up() {
        for i in 0..200 {
            let polygon = ConvexPolygon::triangle(random(i, 0), random(i, 1), random(i, 2));
            let corner = |k: u32| DVec2::new(f64::from(k % 6), f64::from(k / 6)) * 0.5 - 1.5;
            let sum: f64 =
                (0..36).map(|k| polygon.area_in_rectangle(corner(k), corner(k) + 0.5)).sum();
            assert!((sum - polygon.area()).abs() < 1e-12);
        }
        assert_eq!(
            ConvexPolygon::around_unit_disk().area_in_rectangle(DVec2::ZERO, DVec2::splat(0.5)),
            0.25
        );
    }

    #[test]
    fn the_parts_of_a_cut_polygon_add_up() {
        for i in 0..2000 {
            let polygon = ConvexPolygon::triangle(random(i, 0), random(i, 1), random(i, 2));
            let line = Affine::left_of(random(i, 3), random(i, 4));
            if let Cut::Both(inside, outside) = polygon.cut(&line, 1e-14) {
                assert!((inside.area() + outside.area() - polygon.area()).abs() < 1e-12);
                let (a, b) = (inside.area_in_unit_disk(), outside.area_in_unit_disk());
                assert!((a + b - polygon.area_in_unit_disk()).abs() < 1e-12);
                assert!(a <= inside.area() + 1e-12 && b <= outside.area() + 1e-12);
                assert!(inside.range(&line).0 > -1e-12 && outside.range(&line).1 < 1e-12);
            }
        }
    }

    #[test]
    fn areas_in_the_disk_agree_with_counting_points() {
        for i in 0..40 {
            let polygon = ConvexPolygon::triangle(random(i, 0), random(i, 1), random(i, 2));
            let n = 200;
            let point = |k: u32| {
                (DVec2::new(f64::from(k % n), f64::from(k / n)) + 0.5) * (2.0 / f64::from(n)) - 1.0
            };
            let inside = (0..n * n)
                .map(point)
                .filter(|p| p.length() < 1.0 && polygon.contains(*p, 0.0))
                .count();
            let counted = 4.0 * inside as f64 / f64::from(n * n);
            assert!((counted - polygon.area_in_unit_disk()).abs() < 0.02, "{i}");
        }
    }

    #[test]
    fn halves_of_large_polygons_add_up() {
        let mut polygon = ConvexPolygon::rectangle(DVec2::splat(-1.0), DVec2::ONE);
        for k in 0..6 {
            let (sin, cos) = (f64::from(k) + 0.4).sin_cos();
            let line = Affine { normal: DVec2::new(cos, sin), offset: 1.0 };
            polygon = polygon.clipped(&line, 0.0).expect("the middle stays");
        }
        let (a, b) = polygon.halved().expect("many vertices");
        assert!((a.area() + b.area() - polygon.area()).abs() < 1e-14);
    }
}
