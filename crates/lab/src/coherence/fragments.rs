//! The visible surfaces of a region: convex pieces that do not overlap, each with its triangle.

use super::polygon::{Affine, ConvexPolygon, Cut};
use super::view::{Facet, Window};
use snell_math::DVec2;

/// A triangle: the frame ([`super::walk::Walk`]) of its group's occurrence, and its number in the
/// group. Sources are ordered by their ids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Source {
    pub frame: u32,
    pub triangle: u32,
    /// Occurrence number of the group: the first criterion between equally near triangles.
    pub instance: u32,
}

impl Source {
    fn rank(&self) -> (u32, u32) {
        (self.instance, self.triangle)
    }
}

/// A visible piece of a triangle, or of the background.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fragment {
    pub polygon: ConvexPolygon,
    pub nearness: Affine,
    pub source: Option<Source>,
    low: DVec2,
    high: DVec2,
    /// The minimum nearness on the piece.
    farthest: f64,
}

impl Fragment {
    fn new(polygon: ConvexPolygon, nearness: Affine, source: Option<Source>) -> Self {
        let (low, high) = polygon.extent();
        Self { polygon, nearness, source, low, high, farthest: polygon.range(&nearness).0 }
    }

    /// True for a place inside the piece, or less than about `tolerance` outside.
    pub fn contains(&self, p: DVec2, tolerance: f64) -> bool {
        let is_near = p.cmpge(self.low - tolerance).all() && p.cmple(self.high + tolerance).all();
        is_near && self.polygon.contains(p, tolerance)
    }

    /// A part of the piece.
    fn part(&self, polygon: ConvexPolygon) -> Self {
        Self::new(polygon, self.nearness, self.source)
    }
}

/// Nearness values whose relative difference is less than this count as equal.
const EQUAL: f64 = 1e-12;

/// The pieces of a region. Each inserted triangle cuts the part that it hides from the pieces;
/// triangles may intersect, and may come in any order.
#[derive(Clone, Debug)]
pub(super) struct Fragments {
    pub list: Vec<Fragment>,
    /// Distances in the plane up to this count as zero.
    pub tolerance: f64,
}

impl Fragments {
    /// A region in which only the background is visible.
    pub fn new(region: &ConvexPolygon, window: &Window, mut list: Vec<Fragment>) -> Self {
        list.clear();
        let size = window.low.abs().max(window.high.abs()).max_element();
        let nearness = Affine { normal: DVec2::ZERO, offset: window.floor };
        list.push(Fragment::new(*region, nearness, None));
        Self { list, tolerance: size * 1e-14 }
    }

    /// The least nearness of all pieces; surfaces with less are hidden.
    pub fn farthest(&self) -> f64 {
        self.list.iter().map(|f| f.farthest).fold(f64::INFINITY, f64::min)
    }

    /// Inserts a facet where it is nearer than the present pieces. Returns true if the facet
    /// overlaps the region, visible or not.
    pub fn insert(&mut self, facet: &Facet, source: Source) -> bool {
        let new = Fragment::new(facet.polygon, facet.nearness, Some(source));
        let nearest = new.polygon.range(&new.nearness).1;
        let v = facet.polygon.vertices();
        let edges =
            [Affine::left_of(v[0], v[1]), Affine::left_of(v[1], v[2]), Affine::left_of(v[2], v[0])];
        let mut i = 0;
        while i < self.list.len() {
            while let Some((a, b)) = self.list[i].polygon.halved() {
                let old = self.list[i];
                self.list[i] = old.part(a);
                self.list.push(old.part(b));
            }
            i += 1;
        }
        let mut touched = false;
        for i in 0..self.list.len() {
            let old = &self.list[i];
            if new.low.cmpge(old.high).any() || new.high.cmple(old.low).any() {
                continue;
            }
            // Most facets are hidden or beside the piece and need no cut.
            let beside = |edge: &Affine| {
                old.polygon.vertices().iter().all(|p| edge.at(*p) <= self.tolerance)
            };
            if edges.iter().any(beside) {
                continue;
            }
            touched = true;
            if nearest < old.farthest {
                continue;
            }
            let ahead = new.nearness.minus(&old.nearness);
            if old.source.is_some() && old.polygon.range(&ahead).1 < -EQUAL * nearest.abs() {
                continue;
            }
            let Some(common) =
                edges.iter().try_fold(old.polygon, |p, e| p.clipped(e, self.tolerance))
            else {
                continue;
            };
            self.hide(i, &edges, &common, &new);
        }
        touched
    }

    /// Assigns to `new` the part of a piece where `new` is nearer; `common` is the part that both
    /// cover.
    fn hide(&mut self, index: usize, edges: &[Affine; 3], common: &ConvexPolygon, new: &Fragment) {
        let old = self.list[index];
        let ahead = new.nearness.minus(&old.nearness);
        let (low, high) = common.range(&ahead);
        let equal = EQUAL * common.range(&new.nearness).1.abs();
        let is_first = old.source.zip(new.source).is_some_and(|(old, new)| new.rank() < old.rank());
        if high <= equal && !(is_first && low >= -equal) {
            return;
        }
        let crosses = low < -equal && high > equal;
        let mut rest = old.polygon;
        for edge in edges {
            match rest.cut(edge, self.tolerance) {
                Cut::Inside => {}
                Cut::Outside => return,
                Cut::Both(inside, outside) => {
                    rest = inside;
                    self.list.push(old.part(outside));
                }
            }
        }
        if crosses && let Cut::Both(nearer, farther) = rest.cut(&ahead, 0.0) {
            rest = nearer;
            self.list.push(old.part(farther));
        }
        self.list[index] = Fragment::new(rest, new.nearness, new.source);
    }
}
