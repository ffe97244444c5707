//! Depth sort, the painter's algorithm with all its tests (Newell, Newell and Sancha, A Solution to
//! the Hidden Surface Problem, ACM Annual Conference 1972).
//!
//! Facets are sorted by their farthest point and painted from the back. Before the last facet `p`
//! of the list is painted, it is compared with each facet `q` whose depths overlap those of `p`.
//! `p` may be painted before `q` if any of five tests succeeds:
//!
//! 1. the extents of `p` and `q` in x do not overlap,
//! 2. their extents in y do not overlap,
//! 3. `p` is behind the plane of `q`,
//! 4. `q` is in front of the plane of `p`,
//! 5. their outlines do not overlap.
//!
//! If no test succeeds, `q` is tried next, before `p`. If `q` was moved in this way before, `p` and
//! `q` overlap in a cycle or intersect, and one is cut by the plane of the other. Where the planes
//! do not cut them (in a cycle of three or more, none of which reaches through the plane of its
//! neighbour), one is cut along an edge of the other's outline. The number of cuts is limited;
//! pairs that are still undecided after that are painted in list order, and counted.

use super::canvas::{Canvas, Seen};
use super::facet::Edge;
use super::pieces::{self, CutNode, Divider, Drawn, LEAST, LEAST_PIXELS, WHOLE};
use super::{Screen, VisibleError};
use snell_math::DVec2;

/// Maximum number of pairs compared by their extents.
const MOST_PAIRS: u64 = 1_500_000_000;
/// The cost of a comparison by planes, in units of comparisons by extents.
const PLANE_EFFORT: u64 = 12;
/// The cost of a comparison by outlines, in units of comparisons by extents.
const OUTLINE_EFFORT: u64 = 40;

/// Maximum number of cuts per facet, on average.
const MOST_CUTS: u64 = 16;

/// The least extent that is worth a cut along a line, like [`LEAST`] for planes: twice the overlap
/// that disjoint outlines may have.
const LEAST_ALONG_LINES: f64 = 160.0;

/// A facet or a part of one.
#[derive(Clone, Debug)]
struct Part {
    item: u32,
    cuts: u32,
    outline: Vec<DVec2>,
    low: DVec2,
    high: DVec2,
    farthest: f64,
    nearest: f64,
    /// True if the part was moved out of order, to the end of the list.
    is_moved: bool,
    /// The number of parts that were painted when this one was last moved.
    moved_at: u64,
}

#[derive(Default)]
struct Work {
    pairs: u64,
    by_extent: u64,
    by_plane: u64,
    by_outline: u64,
    moves: u64,
    cuts: u64,
    undecided: u64,
    painted: u64,
    written: u64,
}

struct Sort<'a> {
    screen: &'a Screen,
    size: DVec2,
    /// The parts to paint, sorted with the nearest first; the last is painted next. Moved parts are
    /// at the end.
    list: Vec<Part>,
    cuts: Vec<CutNode<Divider>>,
    work: Work,
    most_cuts: u64,
}

/// What to do with the last part of the list.
enum Verdict {
    Paint,
    /// The part with this index in the list must be painted first.
    After(usize),
}

/// Paints from the back.
pub(super) fn run(screen: &Screen, with_cost: bool) -> Result<Seen, VisibleError> {
    let mut canvas = Canvas::new(screen, with_cost);
    let size = DVec2::new(screen.size[0].into(), screen.size[1].into());
    let count = screen.sampled.len();
    let mut sort = Sort {
        screen,
        size,
        list: Vec::with_capacity(count),
        cuts: Vec::new(),
        work: Work::default(),
        most_cuts: MOST_CUTS * count as u64 + 1000,
    };
    for &item in &screen.sampled {
        let outline = pieces::whole(&screen.facets[item as usize], size);
        sort.list.extend(sort.part(item, WHOLE, outline));
    }
    let outlines: usize = sort.list.iter().map(|part| size_of_val(&part.outline[..])).sum();
    sort.list.sort_by(|a, b| b.farthest.total_cmp(&a.farthest).then(a.item.cmp(&b.item)));
    while let Some(last) = sort.list.last() {
        let (verdict, tests) = sort.verdict(last);
        sort.count(tests);
        let w = &sort.work;
        if w.pairs + PLANE_EFFORT * w.by_plane + OUTLINE_EFFORT * (w.by_outline + w.moves + w.cuts)
            > MOST_PAIRS
        {
            return Err(VisibleError::TooMuchWork {
                what: "comparisons of facets",
                limit: MOST_PAIRS,
            });
        }
        match verdict {
            Verdict::Paint => sort.list.pop().iter().for_each(|part| sort.paint(&mut canvas, part)),
            Verdict::After(i) => sort.conflict(i, &mut canvas),
        }
    }
    let w = &sort.work;
    let work = vec![
        ("facets", count as u64),
        ("pairs", w.pairs),
        ("apart by extent", w.by_extent),
        ("by plane", w.by_plane),
        ("by outline", w.by_outline),
        ("moved", w.moves),
        ("cuts", w.cuts),
        ("undecided", w.undecided),
        ("painted", w.painted),
        ("written", w.written),
    ];
    let memory =
        count * size_of::<Part>() + outlines + sort.cuts.len() * size_of::<CutNode<Divider>>();
    Ok(canvas.seen(work, memory))
}

/// Numbers of compared pairs: in total, and separated by extents, by planes, and by outlines.
type Tests = [u64; 4];

impl Sort<'_> {
    /// A part with this outline; `None` if it is empty.
    fn part(&self, item: u32, cuts: u32, outline: Vec<DVec2>) -> Option<Part> {
        if outline.len() < 3 {
            return None;
        }
        let nearness = &self.screen.facets[item as usize].nearness;
        let (low, high) = pieces::extent(&outline);
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        let near = outline.iter().map(|&p| nearness.at(p));
        let (farthest, nearest) = near.fold(start, |(low, high), n| (low.min(n), high.max(n)));
        Some(Part {
            item,
            cuts,
            outline,
            low,
            high,
            farthest,
            nearest,
            is_moved: false,
            moved_at: 0,
        })
    }

    fn count(&mut self, [pairs, by_extent, by_plane, by_outline]: Tests) {
        self.work.pairs += pairs;
        self.work.by_extent += by_extent;
        self.work.by_plane += by_plane;
        self.work.by_outline += by_outline;
    }

    /// Compares the last part of the list with those that it might hide.
    fn verdict(&self, p: &Part) -> (Verdict, Tests) {
        let mut tests = [0; 4];
        for i in (0..self.list.len() - 1).rev() {
            let q = &self.list[i];
            if !q.is_moved && q.farthest >= p.nearest {
                break;
            }
            tests[0] += 1;
            if p.high.x <= q.low.x
                || q.high.x <= p.low.x
                || p.high.y <= q.low.y
                || q.high.y <= p.low.y
            {
                tests[1] += 1;
            } else if self.is_behind(p, q) {
                tests[2] += 1;
            } else if are_apart(p, q) {
                tests[3] += 1;
            } else {
                return (Verdict::After(i), tests);
            }
        }
        (Verdict::Paint, tests)
    }

    /// The third and the fourth of the five tests.
    fn is_behind(&self, p: &Part, q: &Part) -> bool {
        let (facet_p, facet_q) =
            (&self.screen.facets[p.item as usize], &self.screen.facets[q.item as usize]);
        if facet_p.nearness == facet_q.nearness {
            return p.item >= q.item;
        }
        let slack = LEAST * (facet_p.slack + facet_q.slack);
        let is_nearer =
            |place: &DVec2| facet_q.nearness.at(*place) - facet_p.nearness.at(*place) >= -slack;
        p.outline.iter().all(is_nearer) || q.outline.iter().all(is_nearer)
    }

    /// Resolves a conflict of the last part of the list with part `i`.
    fn conflict(&mut self, i: usize, canvas: &mut Canvas) {
        let was_tried = self.list[i].is_moved && self.list[i].moved_at == self.work.painted;
        if !was_tried {
            let mut q = self.list.remove(i);
            (q.is_moved, q.moved_at) = (true, self.work.painted);
            self.list.push(q);
            self.work.moves += 1;
            return;
        }
        let last = self.list.len() - 1;
        if self.work.cuts < self.most_cuts
            && let Some((cut_last, divider)) = self.divider(&self.list[last], &self.list[i])
        {
            let part = if cut_last { self.list.remove(last) } else { self.list.remove(i) };
            self.cut(&part, divider);
            return;
        }
        self.work.undecided += 1;
        if let Some(part) = self.list.pop() {
            self.paint(canvas, &part);
        }
    }

    /// A divider that separates two parts in conflict. The flag is true if the divider cuts the
    /// first part, false if it cuts the second.
    fn divider(&self, p: &Part, q: &Part) -> Option<(bool, Divider)> {
        let plane = |part: &Part| {
            Divider::Plane(self.screen.facets[part.item as usize].nearness, part.item)
        };
        let is_parted = |part: &Part, divider: &Divider, least: f64| {
            let facet = &self.screen.facets[part.item as usize];
            let values = part.outline.iter().map(|&place| divider.value(facet, place, self.size));
            let (low, high) = values.fold((false, false), |(low, high), (value, slack)| {
                (low | (value < -least * slack), high | (value > least * slack))
            });
            low && high
        };
        let by_lines = |p: &Part, q: &Part| {
            let lines = edges(&q.outline).map(Divider::Line);
            lines.into_iter().find(|line| is_parted(p, line, LEAST_ALONG_LINES))
        };
        None.or_else(|| is_parted(p, &plane(q), LEAST).then(|| (true, plane(q))))
            .or_else(|| is_parted(q, &plane(p), LEAST).then(|| (false, plane(p))))
            .or_else(|| by_lines(p, q).map(|line| (true, line)))
            .or_else(|| by_lines(q, p).map(|line| (false, line)))
    }

    /// Divides a part, and puts both sides back into the list.
    fn cut(&mut self, part: &Part, divider: Divider) {
        self.work.cuts += 1;
        for side in [true, false] {
            let facet = &self.screen.facets[part.item as usize];
            let outline = pieces::clipped(&part.outline, facet, &divider, side, self.size);
            self.cuts.push(CutNode { before: part.cuts, divider, side });
            let Some(new) = self.part(part.item, self.cuts.len() as u32 - 1, outline) else {
                continue;
            };
            let is_later = |q: &Part| {
                q.is_moved
                    || q.farthest < new.farthest
                    || (q.farthest == new.farthest && q.item > new.item)
            };
            let at = self.list.iter().rposition(|q| !is_later(q)).map_or(0, |i| i + 1);
            self.list.insert(at, new);
        }
    }

    fn paint(&mut self, canvas: &mut Canvas, part: &Part) {
        self.work.painted += 1;
        let cuts: Vec<_> = pieces::chain(&self.cuts, part.cuts).collect();
        let drawn = Drawn { item: part.item, extent: (part.low, part.high), cuts: &cuts };
        self.work.written += drawn.paint(self.screen, canvas);
    }
}

/// The edges of an outline, without degenerate ones.
fn edges(outline: &[DVec2]) -> impl Iterator<Item = Edge> + '_ {
    let pairs = outline.iter().enumerate().map(|(i, &a)| (a, outline[(i + 1) % outline.len()]));
    pairs.filter(|(a, b)| a.distance(*b) > LEAST_PIXELS).map(|(a, b)| Edge::new(a, b))
}

/// The fifth test: one part has an edge with the whole other part on its outer side (for convex
/// outlines, no other lines need to be tried).
fn are_apart(p: &Part, q: &Part) -> bool {
    let parts = |a: &Part, b: &Part| {
        edges(&a.outline)
            .any(|edge| b.outline.iter().all(|&place| edge.inside(place) <= LEAST_PIXELS))
    };
    parts(p, q) || parts(q, p)
}
