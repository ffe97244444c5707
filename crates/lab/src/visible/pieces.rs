//! Parts of facets, for methods that cut them.
//!
//! A part has two descriptions. Its *cuts* decide about pixels: each states the side of a plane on
//! which the pixel centre is, by the common comparison of nearness, so that each pixel is in
//! exactly one of two parts. Its *outline* is a slightly enlarged polygon around these pixels,
//! which bounds the search and gives the position relative to other parts.

use super::Screen;
use super::canvas::Canvas;
use super::facet::{Edge, Facet, Nearness, centre, is_nearer};
use snell_math::DVec2;

/// The end of a list of cuts.
pub(super) const WHOLE: u32 = u32::MAX;

/// A divider between two parts.
#[derive(Clone, Copy, Debug)]
pub(super) enum Divider {
    /// A plane, and the number that decides ties: `true` for the part in front of the plane.
    Plane(Nearness, u32),
    /// A plane through the eye, which appears as a line: `true` where the function is positive.
    EdgeOn(Nearness, f64),
    /// A line: `true` on its inner side.
    Line(Edge),
}

/// Enlargement of outlines, in units of the rounding error of nearness.
const MARGIN: f64 = 8.0;

/// The least extent that is worth a cut, in units of the rounding error of nearness.
pub(super) const LEAST: f64 = 16.0;

/// Enlargement of outlines at lines, in pixels.
const LINE_MARGIN: f64 = 1e-9;
/// Edges of outlines shorter than this, in pixels, are ignored, and outlines that overlap by no
/// more than this count as disjoint.
pub(super) const LEAST_PIXELS: f64 = 1e-8;

impl Divider {
    /// The side of the divider on which a pixel of a facet is.
    #[inline]
    fn side(&self, item: u32, facet: &Facet, place: DVec2) -> bool {
        match self {
            Self::Plane(plane, rank) => {
                is_nearer((item, facet.nearness.at(place)), (*rank, plane.at(place)))
            }
            Self::EdgeOn(line, _) => line.at(place) >= 0.0,
            Self::Line(edge) => edge.holds(place),
        }
    }

    /// A function that is positive on the `true` side, and its tolerance around zero.
    pub fn value(&self, facet: &Facet, place: DVec2, size: DVec2) -> (f64, f64) {
        match self {
            Self::Plane(plane, _) => {
                (facet.nearness.at(place) - plane.at(place), facet.slack + plane.slack(size))
            }
            Self::EdgeOn(line, slack) => (line.at(place), *slack),
            Self::Line(edge) => (edge.inside(place), LINE_MARGIN / MARGIN),
        }
    }
}

/// A cut, and the index of the cut before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct CutNode<D> {
    pub before: u32,
    pub divider: D,
    pub side: bool,
}

/// The part of a convex outline on one side of a divider, slightly enlarged, with the same
/// orientation.
pub(super) fn clipped(
    outline: &[DVec2],
    facet: &Facet,
    divider: &Divider,
    side: bool,
    size: DVec2,
) -> Vec<DVec2> {
    let value = |p: DVec2| {
        let (value, slack) = divider.value(facet, p, size);
        (if side { value } else { -value }) + MARGIN * slack
    };
    let mut part: Vec<DVec2> = Vec::with_capacity(outline.len() + 1);
    let mut push = |p: DVec2| {
        if part.last() != Some(&p) {
            part.push(p);
        }
    };
    for (i, &a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        let (va, vb) = (value(a), value(b));
        if va >= 0.0 {
            push(a);
        }
        if (va >= 0.0) != (vb >= 0.0) {
            push(a + (b - a) * (va / (va - vb)));
        }
    }
    if part.len() > 1 && part.first() == part.last() {
        part.pop();
    }
    part
}

/// Maximum distance of corners in units of the picture's size. Up to that distance, rounding does
/// not affect where an edge enters the picture.
const FAR: f64 = 1e5;

/// The outline of a facet within the picture; the whole picture for a facet whose corners are too
/// far away.
pub(super) fn whole(facet: &Facet, size: DVec2) -> Vec<DVec2> {
    let mut outline: Vec<DVec2> = facet.corners().iter().map(|c| c.truncate()).collect();
    if outline.iter().any(|p| p.abs().max_element() > FAR * size.max_element()) {
        return vec![DVec2::ZERO, DVec2::new(size.x, 0.0), size, DVec2::new(0.0, size.y)];
    }
    for (normal, offset) in
        [(DVec2::X, 0.0), (DVec2::NEG_X, size.x), (DVec2::Y, 0.0), (DVec2::NEG_Y, size.y)]
    {
        let mut part = Vec::with_capacity(outline.len() + 1);
        for (i, &a) in outline.iter().enumerate() {
            let b = outline[(i + 1) % outline.len()];
            let (va, vb) = (normal.dot(a) + offset, normal.dot(b) + offset);
            if va >= 0.0 {
                part.push(a);
            }
            if (va >= 0.0) != (vb >= 0.0) {
                part.push(a + (b - a) * (va / (va - vb)));
            }
        }
        outline = part;
    }
    outline
}

/// The bounding rectangle of an outline.
pub(super) fn extent(outline: &[DVec2]) -> (DVec2, DVec2) {
    let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    outline.iter().fold(start, |(low, high), &p| (low.min(p), high.max(p)))
}

/// The list of a cut and all cuts before it.
pub(super) fn chain<D: Copy>(
    all: &[CutNode<D>],
    last: u32,
) -> impl Iterator<Item = (D, bool)> + '_ {
    let node = move |at: u32| all.get(at as usize);
    std::iter::successors(node(last), move |cut| node(cut.before))
        .map(|cut| (cut.divider, cut.side))
}

/// A part that is ready to be drawn.
pub(super) struct Drawn<'a> {
    pub item: u32,
    pub extent: (DVec2, DVec2),
    pub cuts: &'a [(Divider, bool)],
}

impl Drawn<'_> {
    /// The ranges of columns and rows that contain the part's pixels.
    pub fn window(&self, facet: &Facet) -> [std::ops::Range<u32>; 2] {
        // Far more than rounding errors of places.
        let pad = 1e-6;
        let (low, high) = (self.extent.0 - pad - 0.5, self.extent.1 + pad - 0.5);
        let bound = |low: f64, high: f64, [first, end]: [u32; 2]| {
            (low.ceil().max(0.0) as u32).max(first)..((high.floor() + 1.0).max(0.0) as u32).min(end)
        };
        [bound(low.x, high.x, facet.columns), bound(low.y, high.y, facet.rows)]
    }

    /// True if a pixel of the facet is on the part's side of all cuts.
    #[inline]
    pub fn holds(&self, facet: &Facet, x: u32, y: u32) -> bool {
        let place = centre(x, y);
        self.cuts.iter().all(|(divider, side)| divider.side(self.item, facet, place) == *side)
    }

    /// Overpaints the pixels of the part. Returns their number.
    pub fn paint(&self, screen: &Screen, canvas: &mut Canvas) -> u64 {
        let facet = &screen.facets[self.item as usize];
        let [columns, rows] = self.window(facet);
        let mut written = 0;
        for y in rows {
            let [first, end] = facet.span(y);
            for x in first.max(columns.start)..end.min(columns.end) {
                if self.holds(facet, x, y) {
                    let pixel = canvas.pixel(x, y);
                    canvas.charge(pixel);
                    canvas.items[pixel] = self.item;
                    written += 1;
                }
            }
        }
        written
    }
}
