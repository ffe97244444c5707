//! Area subdivision (Warnock, A Hidden Surface Algorithm for Computer Generated Halftone Pictures,
//! University of Utah 1969).
//!
//! A simple window of pixels is drawn; any other is divided into four. The facets of a window are
//! those of its parent window, of which each is now *disjoint* and dropped, *surrounding*, or
//! *contained* in the window or *intersecting* it. A window is simple if it is empty, if it has a
//! single facet, if a surrounding facet is in front of all others, or if it is a single pixel.
//! Facets behind a surrounding facet are dropped too.
//!
//! A window consists of its pixels' centres, so it is tested at the centres of its corner pixels,
//! and the decisions are exact.

use super::canvas::{Canvas, Seen};
use super::facet::{Facet, centre};
use super::{NOTHING, Screen};

/// A rectangle of pixels, with exclusive ends.
#[derive(Clone, Copy)]
struct Window {
    low: [u32; 2],
    end: [u32; 2],
}

/// A facet and its relation to a window; disjoint facets are not stored.
#[derive(Clone, Copy)]
struct Guest {
    item: u32,
    is_surrounding: bool,
}

#[derive(Default)]
struct Work {
    windows: u64,
    empty: u64,
    single: u64,
    surrounded: u64,
    pixels: u64,
    classifications: u64,
}

/// Divides the picture recursively.
pub(super) fn run(screen: &Screen, with_cost: bool) -> Seen {
    let mut canvas = Canvas::new(screen, with_cost);
    let mut work = Work::default();
    // The facets of the enclosing windows, each list after that of its parent window.
    let mut guests: Vec<Guest> =
        screen.sampled.iter().map(|&item| Guest { item, is_surrounding: false }).collect();
    let mut most = guests.len();
    let all = Window { low: [0; 2], end: screen.size };
    if !canvas.items.is_empty() {
        let inherited = guests.len();
        let mut draw = Subdivision {
            screen,
            canvas: &mut canvas,
            work: &mut work,
            guests: &mut guests,
            most: &mut most,
        };
        draw.window(all, 0, inherited);
    }
    let done = vec![
        ("windows", work.windows),
        ("empty", work.empty),
        ("one facet", work.single),
        ("surrounded", work.surrounded),
        ("pixels", work.pixels),
        ("classifications", work.classifications),
    ];
    canvas.seen(done, most * size_of::<Guest>())
}

struct Subdivision<'a> {
    screen: &'a Screen,
    canvas: &'a mut Canvas,
    work: &'a mut Work,
    guests: &'a mut Vec<Guest>,
    most: &'a mut usize,
}

impl Subdivision<'_> {
    /// Draws a window whose candidates are `guests[from..to]`. Its depth is at most about 14, one
    /// for each bit of the picture's side.
    fn window(&mut self, w: Window, from: usize, to: usize) {
        self.work.windows += 1;
        self.canvas.charge_window(w.low, w.end);
        let start = self.guests.len();
        let in_front = self.classify(&w, from, to);
        *self.most = (*self.most).max(self.guests.len());
        let count = self.guests.len() - start;
        let is_pixel = w.end[0] - w.low[0] == 1 && w.end[1] - w.low[1] == 1;
        if count == 0 {
            self.work.empty += 1;
        } else if count == 1 {
            self.work.single += 1;
            self.draw_facet(&w, self.guests[start].item);
        } else if in_front != NOTHING {
            self.work.surrounded += 1;
            (w.low[1]..w.end[1]).for_each(|y| self.canvas.fill(y, [w.low[0], w.end[0]], in_front));
        } else if is_pixel {
            self.work.pixels += 1;
            let [x, y] = w.low;
            let nearest = self.screen.nearest_of(self.guests[start..].iter().map(|g| g.item), x, y);
            self.canvas.fill(y, [x, x + 1], nearest);
        } else {
            let end = self.guests.len();
            quarters(&w).into_iter().flatten().for_each(|part| self.window(part, start, end));
        }
        self.guests.truncate(start);
    }

    /// Appends the facets of a window, except those certainly hidden by a surrounding one. Returns
    /// the surrounding facet that certainly hides all others, if there is one.
    fn classify(&mut self, w: &Window, from: usize, to: usize) -> u32 {
        let corners = [
            [w.low[0], w.low[1]],
            [w.end[0] - 1, w.low[1]],
            [w.low[0], w.end[1] - 1],
            [w.end[0] - 1, w.end[1] - 1],
        ];
        let start = self.guests.len();
        // The surrounding facet with the greatest minimum nearness.
        let (mut front, mut floor) = (NOTHING, f64::NEG_INFINITY);
        for i in from..to {
            let guest = self.guests[i];
            let facet = &self.screen.facets[guest.item as usize];
            self.work.classifications += 1;
            let is_surrounding = guest.is_surrounding
                || match relation(facet, w, &corners) {
                    Relation::Disjoint => continue,
                    Relation::Surrounding => true,
                    Relation::Other => false,
                };
            let (farthest, nearest) = range(facet, &corners);
            if nearest + facet.slack < floor {
                continue;
            }
            if is_surrounding && farthest - facet.slack > floor {
                (front, floor) = (guest.item, farthest - facet.slack);
            }
            self.guests.push(Guest { is_surrounding, ..guest });
        }
        if front == NOTHING {
            return NOTHING;
        }
        let surrounding = &self.screen.facets[front as usize];
        // Facets that were added before the surrounding one may be hidden by it.
        let (screen, mut kept) = (self.screen, start);
        let mut hides_all = true;
        for i in start..self.guests.len() {
            let guest = self.guests[i];
            let facet = &screen.facets[guest.item as usize];
            if guest.item != front {
                if range(facet, &corners).1 + facet.slack < floor {
                    continue;
                }
                hides_all &= is_surely_before(surrounding, facet, &corners)
                    || (surrounding.nearness == facet.nearness && front < guest.item);
            }
            self.guests[kept] = guest;
            kept += 1;
        }
        self.guests.truncate(kept);
        if hides_all { front } else { NOTHING }
    }

    /// Draws the only facet of a window.
    fn draw_facet(&mut self, w: &Window, item: u32) {
        let facet = &self.screen.facets[item as usize];
        for y in w.low[1].max(facet.rows[0])..w.end[1].min(facet.rows[1]) {
            let [low, end] = facet.span(y);
            self.canvas.fill(y, [low.max(w.low[0]), end.min(w.end[0])], item);
        }
    }
}

/// The four parts of a window; fewer if it is narrow.
fn quarters(w: &Window) -> [Option<Window>; 4] {
    let middle = [0, 1].map(|axis| w.low[axis] + (w.end[axis] - w.low[axis]).div_ceil(2));
    std::array::from_fn(|i| {
        let is_high = [i & 1 == 1, i & 2 == 2];
        let pick = |axis: usize| {
            if is_high[axis] { [middle[axis], w.end[axis]] } else { [w.low[axis], middle[axis]] }
        };
        let ([x0, x1], [y0, y1]) = (pick(0), pick(1));
        (x0 < x1 && y0 < y1).then_some(Window { low: [x0, y0], end: [x1, y1] })
    })
}

enum Relation {
    Disjoint,
    Surrounding,
    /// Contained or intersecting; the two are distinguished only when the window is divided.
    Other,
}

/// The relation of a facet to a window with these corner pixels.
fn relation(facet: &Facet, w: &Window, corners: &[[u32; 2]; 4]) -> Relation {
    let extent = [facet.columns, facet.rows];
    if (0..2).any(|axis| extent[axis][1] <= w.low[axis] || extent[axis][0] >= w.end[axis]) {
        return Relation::Disjoint;
    }
    let mut is_surrounding =
        (0..2).all(|axis| extent[axis][0] <= w.low[axis] && extent[axis][1] >= w.end[axis]);
    for edge in facet.edges() {
        let held = corners.iter().filter(|c| edge.holds(centre(c[0], c[1]))).count();
        if held == 0 {
            return Relation::Disjoint;
        }
        is_surrounding &= held == 4;
    }
    if is_surrounding { Relation::Surrounding } else { Relation::Other }
}

/// The minimum and maximum nearness of a facet's plane at the corners, clamped to the facet's own
/// range.
fn range(facet: &Facet, corners: &[[u32; 2]; 4]) -> (f64, f64) {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let near = corners.iter().map(|c| facet.nearness.at(centre(c[0], c[1])));
    let (low, high) = near.fold(start, |(low, high), n| (low.min(n), high.max(n)));
    (low.max(facet.farthest), high.min(facet.nearest))
}

/// True if the plane of `a` is certainly nearer than that of `b` at all corners and anywhere
/// between them, whatever the rounding.
fn is_surely_before(a: &Facet, b: &Facet, corners: &[[u32; 2]; 4]) -> bool {
    let slack = 3.0 * (a.slack + b.slack);
    corners
        .iter()
        .all(|c| a.nearness.at(centre(c[0], c[1])) - b.nearness.at(centre(c[0], c[1])) > slack)
}
