//! A triangle in the picture: a convex polygon in pixels, with its nearness.
//!
//! All methods use the same two functions of a pixel, which are defined only here:
//! [`Facet::covers`] decides whether the pixel's centre is in the polygon, and [`Nearness::at`]
//! gives the nearness of the plane there. Both are evaluated by the same operations in the same
//! order, so that all methods get the same bits. Both are also *monotonic* along rows and columns,
//! rounding included: an offset is subtracted, a factor multiplied and a number added, which
//! preserves order. So results at the corners of a rectangle of pixels hold for all of it, and a
//! row of pixels intersects a polygon in one piece.

use snell_math::{DVec2, DVec3};

/// The centre of a pixel.
#[inline(always)]
pub(super) fn centre(x: u32, y: u32) -> DVec2 {
    DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)
}

/// A directed line, from the smaller of two points to the greater (by x, then y), with a polygon on
/// one side.
///
/// Two polygons that share an edge have the same line with opposite sides, and a point on the line
/// belongs to the polygon on the left: as if all points were moved slightly along y, and far less
/// back along x. So a point belongs to exactly one polygon, also where many edges meet.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Edge {
    from: DVec2,
    along: DVec2,
    is_left: bool,
}

impl Edge {
    /// The edge from `a` to `b` of a polygon on its left.
    pub fn new(a: DVec2, b: DVec2) -> Self {
        let is_forward = (a.x, a.y) < (b.x, b.y);
        let (from, to) = if is_forward { (a, b) } else { (b, a) };
        Self { from, along: to - from, is_left: is_forward }
    }

    /// The distance from the line times the line's length, positive to the left of the directed
    /// line.
    #[inline(always)]
    fn left(&self, p: DVec2) -> f64 {
        self.along.x * (p.y - self.from.y) - self.along.y * (p.x - self.from.x)
    }

    /// True if a point is on the side of the polygon.
    #[inline(always)]
    pub fn holds(&self, p: DVec2) -> bool {
        (self.left(p) >= 0.0) == self.is_left
    }

    /// The distance from the line in pixels, positive on the side of the polygon.
    pub fn inside(&self, p: DVec2) -> f64 {
        let left = self.left(p) / self.along.length();
        if self.is_left { left } else { -left }
    }

    /// Narrows the columns `low..end` to those whose centres in this row are on the side of the
    /// polygon. They are contiguous, because the test is monotonic.
    #[inline]
    fn clip(&self, row: f64, low: &mut u32, end: &mut u32) {
        // `left` falls with x where the line rises.
        let holds_later =
            if self.along.y == 0.0 { None } else { Some((self.along.y < 0.0) == self.is_left) };
        let holds = |x: u32| self.holds(DVec2::new(f64::from(x) + 0.5, row));
        let Some(holds_later) = holds_later else {
            if !holds(*low) {
                *end = *low;
            }
            return;
        };
        let crossing = self.from.x + self.along.x * ((row - self.from.y) / self.along.y);
        let guess = (crossing - 0.5).ceil().clamp(f64::from(*low), f64::from(*end)) as u32;
        // Searches for the first column that is on the other side from `low`, if the estimate is
        // off: by one, or for huge numbers by any amount.
        let is_before = |x: u32| holds(x) != holds_later;
        let is_right = |x: u32| (x <= *low || is_before(x - 1)) && (x >= *end || !is_before(x));
        let first = match [guess, guess.saturating_sub(1), guess + 1]
            .into_iter()
            .find(|&x| x >= *low && x <= *end && is_right(x))
        {
            Some(x) => x,
            None => {
                let (mut a, mut b) = (*low, *end);
                while a < b {
                    let middle = a + (b - a) / 2;
                    if is_before(middle) { a = middle + 1 } else { b = middle }
                }
                a
            }
        };
        if holds_later { *low = first } else { *end = first }
    }
}

/// The reciprocal of the depth on a plane: an affine function of the place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Nearness {
    pub anchor: DVec2,
    pub slope: DVec2,
    /// The nearness at the anchor.
    pub value: f64,
}

impl Nearness {
    /// The nearness at a place.
    #[inline(always)]
    pub fn at(&self, p: DVec2) -> f64 {
        self.slope.x * (p.x - self.anchor.x) + (self.slope.y * (p.y - self.anchor.y) + self.value)
    }

    /// A bound on the rounding error of nearness in a picture of this size.
    pub fn slack(&self, size: DVec2) -> f64 {
        let reach = self.anchor.abs().max((size - self.anchor).abs()) + self.anchor.abs();
        (self.slope.abs().dot(reach) + self.value.abs()) * 8.0 * f64::EPSILON
    }
}

/// A triangle in the picture, or the part of it behind the near plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    /// The index of the triangle in [`super::Screen::triangles`], which are sorted by ids.
    pub triangle: u32,
    corners: [DVec3; 4],
    edges: [Edge; 4],
    count: u8,
    pub nearness: Nearness,
    /// A bound on the rounding error of the nearness.
    pub slack: f64,
    /// The columns whose centres are within the facet's extent, as first and exclusive end. Empty
    /// for a facet that lies between pixel centres.
    pub columns: [u32; 2],
    /// The rows whose centres are within the facet's extent, as first and exclusive end.
    pub rows: [u32; 2],
    /// The minimum nearness.
    pub farthest: f64,
    /// The maximum nearness.
    pub nearest: f64,
}

impl Facet {
    /// The facet with three or four corners (place and nearness, in either orientation). `None` if
    /// it has no area in the picture's plane, or is so thin that its plane cannot be determined.
    pub fn new(
        triangle: u32,
        polygon: &[DVec3],
        nearness: Nearness,
        size: [u32; 2],
    ) -> Option<Self> {
        let mut facet = Self {
            triangle,
            corners: [DVec3::ZERO; 4],
            edges: [Edge::default(); 4],
            count: 0,
            nearness,
            slack: nearness.slack(DVec2::new(size[0].into(), size[1].into())),
            columns: [0; 2],
            rows: [0; 2],
            farthest: f64::INFINITY,
            nearest: f64::NEG_INFINITY,
        };
        for p in polygon {
            let before = facet.corners().last().map(|p| p.truncate());
            if before != Some(p.truncate()) && facet.count < 4 {
                facet.corners[usize::from(facet.count)] = *p;
                facet.count += 1;
            }
        }
        if facet.count > 1
            && facet.corners[0].truncate() == facet.corners[usize::from(facet.count) - 1].truncate()
        {
            facet.count -= 1;
        }
        let count = usize::from(facet.count);
        let places: Vec<DVec2> = facet.corners().iter().map(|p| p.truncate()).collect();
        let first = places.first()?;
        let area: f64 =
            (0..count).map(|i| (places[i] - first).perp_dot(places[(i + 1) % count] - first)).sum();
        if count < 3 || area == 0.0 || !area.is_finite() {
            return None;
        }
        if area < 0.0 {
            facet.corners[..count].reverse();
        }
        for i in 0..count {
            let [a, b] = [facet.corners[i], facet.corners[(i + 1) % count]].map(|p| p.truncate());
            facet.edges[i] = Edge::new(a, b);
        }
        for p in &facet.corners[..count] {
            (facet.farthest, facet.nearest) = (facet.farthest.min(p.z), facet.nearest.max(p.z));
        }
        let is_off =
            |p: &DVec3| (nearness.at(p.truncate()) - p.z).abs() > 1e-6 * facet.nearest.abs();
        if !facet.slack.is_finite() || facet.corners().iter().any(is_off) {
            return None;
        }
        let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = places.iter().fold(start, |(low, high), &p| (low.min(p), high.max(p)));
        facet.columns = centres_within(low.x, high.x, size[0]);
        facet.rows = centres_within(low.y, high.y, size[1]);
        Some(facet)
    }

    /// Places (x, y) and nearness (z), counter-clockwise where y grows upwards.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners[..usize::from(self.count)]
    }

    /// The edges, each starting at the corner of the same index.
    pub fn edges(&self) -> &[Edge] {
        &self.edges[..usize::from(self.count)]
    }

    /// True if the facet's extent contains a pixel centre.
    pub fn has_pixels(&self) -> bool {
        self.columns[0] < self.columns[1] && self.rows[0] < self.rows[1]
    }

    /// True if the facet contains the centre of the pixel.
    #[inline(always)]
    pub fn covers(&self, x: u32, y: u32) -> bool {
        let is_near = (self.columns[0]..self.columns[1]).contains(&x)
            && (self.rows[0]..self.rows[1]).contains(&y);
        is_near && self.edges().iter().all(|edge| edge.holds(centre(x, y)))
    }

    /// The columns of a row whose centres are in the facet, as first and exclusive end; empty if
    /// there are none. The row must be one of [`Self::rows`].
    #[inline]
    pub fn span(&self, y: u32) -> [u32; 2] {
        let [mut low, mut end] = self.columns;
        let row = f64::from(y) + 0.5;
        for edge in self.edges() {
            if low >= end {
                break;
            }
            edge.clip(row, &mut low, &mut end);
        }
        [low, end]
    }

    /// The distance in pixels by which a place is inside (positive) or outside (negative) the
    /// facet. For a place outside, it is a lower bound.
    pub fn inside(&self, p: DVec2) -> f64 {
        self.edges().iter().map(|edge| edge.inside(p)).fold(f64::INFINITY, f64::min)
    }
}

/// The range of pixels, of `count`, whose centres are from `low` to `high`.
fn centres_within(low: f64, high: f64, count: u32) -> [u32; 2] {
    let bound = |x: f64| x.clamp(0.0, f64::from(count)) as u32;
    [bound((low - 0.5).ceil()), bound((high - 0.5).floor() + 1.0)]
}

/// True if the plane of `a` is nearer at a place than that of `b`; at equal nearness the number
/// decides. All methods use this comparison.
#[inline(always)]
pub(super) fn is_nearer((a, near_a): (u32, f64), (b, near_b): (u32, f64)) -> bool {
    near_a > near_b || (near_a == near_b && a < b)
}
