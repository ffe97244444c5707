//! Scan lines and sample spans (Watkins, A Real Time Visible Surface Algorithm, University of Utah
//! 1970; Sutherland, Sproull and Schumacker, A Characterization of Ten Hidden-Surface Algorithms,
//! Computing Surveys 1974, section on Watkins).
//!
//! A row of pixels intersects each facet in a *segment*. Segments are sorted by their left ends,
//! starting from the order of the row above, so that few have to move. From left to right, a
//! *sample span* reaches from one begin or end of a segment to the next. The same segments cross
//! all pixels of a span; a segment that is in front at both ends is visible in the whole span. If
//! no segment is certainly in front, because segments cross or nearly touch, the span is halved.
//! The segment that was visible on the row above is tried first.

use super::canvas::{Canvas, Seen};
use super::facet::{centre, is_nearer};
use super::rows::ActiveRows;
use super::{NOTHING, Screen};

/// The pixels of a row that a facet covers: columns `low..end`.
#[derive(Clone, Copy)]
struct Segment {
    low: u32,
    end: u32,
    item: u32,
}

impl Segment {
    fn key(&self) -> (u32, u32) {
        (self.low, self.item)
    }
}

#[derive(Default)]
struct Work {
    segments: u64,
    /// The total number of places by which segments moved from the order of the row above.
    moves: u64,
    spans: u64,
    /// The number of spans in which the facet that was visible on the row above is in front.
    guessed: u64,
    halvings: u64,
    comparisons: u64,
}

/// Resolves rows from the top.
pub(super) fn run(screen: &Screen, with_cost: bool) -> Seen {
    let mut canvas = Canvas::new(screen, with_cost);
    let mut active = ActiveRows::new(screen);
    let mut work = Work::default();
    let (mut segments, mut open): (Vec<Segment>, Vec<Segment>) = (Vec::new(), Vec::new());
    // For each facet the last row that intersected it.
    let mut met = vec![u32::MAX; screen.facets.len()];
    // Facets in the order in which the row above intersected them, active facets that it did not
    // intersect, and new segments.
    let (mut order, mut waiting, mut fresh): (Vec<u32>, Vec<u32>, Vec<Segment>) =
        Default::default();
    for y in 0..screen.size[1] {
        let items = active.advance(y);
        waiting.extend(items.iter().filter(|&&item| screen.facets[item as usize].rows[0] == y));
        segments.clear();
        fresh.clear();
        for (items, segments) in [(&order, &mut segments), (&waiting, &mut fresh)] {
            for &item in items {
                let facet = &screen.facets[item as usize];
                let [low, end] = if facet.rows[1] > y { facet.span(y) } else { [0; 2] };
                if low < end {
                    segments.push(Segment { low, end, item });
                }
            }
        }
        // New segments are sorted separately, and merged into the rest.
        fresh.sort_by_key(Segment::key);
        work.moves += sort_from_left(&mut segments);
        merge(&mut segments, &fresh);
        work.segments += segments.len() as u64;
        waiting.extend_from_slice(&order);
        waiting.retain(|&item| screen.facets[item as usize].rows[1] > y + 1);
        order.clear();
        for segment in &segments {
            order.push(segment.item);
            met[segment.item as usize] = y;
        }
        waiting.retain(|&item| met[item as usize] != y);
        let mut row = Row { screen, canvas: &mut canvas, work: &mut work, y };
        row.sweep(&segments, &mut open);
    }
    let memory = active.memory()
        + (order.capacity() + waiting.capacity() + met.len()) * 4
        + segments.capacity() * size_of::<Segment>();
    let done = vec![
        ("segments", work.segments),
        ("moves", work.moves),
        ("spans", work.spans),
        ("guessed", work.guessed),
        ("halvings", work.halvings),
        ("comparisons", work.comparisons),
    ];
    canvas.seen(done, memory)
}

/// Insertion sort, which is fast for nearly sorted segments; if that takes too many moves, a full
/// sort. Returns a measure of the work: the number of moves.
fn sort_from_left(segments: &mut [Segment]) -> u64 {
    let (mut moves, most) = (0, 16 * segments.len() as u64);
    for i in 1..segments.len() {
        let mut j = i;
        while j > 0 && segments[j - 1].key() > segments[j].key() {
            segments.swap(j - 1, j);
            j -= 1;
            moves += 1;
        }
        if moves > most {
            segments.sort_by_key(Segment::key);
            return moves + segments.len() as u64;
        }
    }
    moves
}

/// Merges sorted segments into other sorted segments, from the right.
fn merge(segments: &mut Vec<Segment>, fresh: &[Segment]) {
    let (mut old, mut new) = (segments.len(), fresh.len());
    segments.extend_from_slice(fresh);
    while new > 0 {
        if old > 0 && segments[old - 1].key() > fresh[new - 1].key() {
            segments[old + new - 1] = segments[old - 1];
            old -= 1;
        } else {
            segments[old + new - 1] = fresh[new - 1];
            new -= 1;
        }
    }
}

struct Row<'a> {
    screen: &'a Screen,
    canvas: &'a mut Canvas,
    work: &'a mut Work,
    y: u32,
}

impl Row<'_> {
    /// Advances from the left end of one segment to the next event, and resolves the span between.
    fn sweep(&mut self, segments: &[Segment], open: &mut Vec<Segment>) {
        open.clear();
        let mut next = 0;
        let mut x = 0;
        while next < segments.len() || !open.is_empty() {
            if open.is_empty() {
                x = segments[next].low;
            }
            while next < segments.len() && segments[next].low == x {
                open.push(segments[next]);
                next += 1;
            }
            let ends = open.iter().map(|s| s.end).min().unwrap_or(x);
            let end = segments.get(next).map_or(ends, |s| ends.min(s.low));
            self.resolve(open, x, end);
            x = end;
            open.retain(|s| s.end > x);
        }
    }

    /// Fills the span `low..end`, which all these segments cross.
    fn resolve(&mut self, open: &[Segment], low: u32, end: u32) {
        self.work.spans += 1;
        if let [only] = open {
            self.canvas.fill(self.y, [low, end], only.item);
            return;
        }
        let above =
            self.y.checked_sub(1).map_or(NOTHING, |y| self.canvas.items[self.canvas.pixel(low, y)]);
        if open.iter().any(|s| s.item == above) && self.is_in_front(above, open, low, end - 1) {
            self.work.guessed += 1;
            self.canvas.fill(self.y, [low, end], above);
            return;
        }
        self.divide(open, low, end);
    }

    fn divide(&mut self, open: &[Segment], low: u32, end: u32) {
        let first = self.nearest(open, low);
        if end - low == 1 || self.is_in_front(first, open, low, end - 1) {
            self.canvas.fill(self.y, [low, end], first);
            return;
        }
        self.work.halvings += 1;
        let middle = low + (end - low) / 2;
        self.divide(open, low, middle);
        self.divide(open, middle, end);
    }

    /// The nearest item at a pixel.
    fn nearest(&mut self, open: &[Segment], x: u32) -> u32 {
        self.charge(x, open.len());
        let near = |s: &Segment| (s.item, self.screen.nearness(s.item, x, self.y));
        let start = near(&open[0]);
        open[1..]
            .iter()
            .map(near)
            .fold(start, |best, new| if is_nearer(new, best) { new } else { best })
            .0
    }

    /// True if an item is certainly in front of all others at both ends of a span, whatever the
    /// rounding between the ends, or if the span is one pixel and the item is in front there.
    fn is_in_front(&mut self, item: u32, open: &[Segment], low: u32, last: u32) -> bool {
        let facets = &self.screen.facets;
        let me = &facets[item as usize];
        let ends = [centre(low, self.y), centre(last, self.y)];
        let mine = ends.map(|p| me.nearness.at(p));
        let mut compared = 0;
        let all = open.iter().all(|s| {
            let other = &facets[s.item as usize];
            compared += 1;
            // For exactly equal planes the number decides, as in all comparisons.
            let is_same = me.nearness == other.nearness;
            let surely = || {
                (0..2)
                    .all(|i| mine[i] - other.nearness.at(ends[i]) > 3.0 * (me.slack + other.slack))
            };
            let alone =
                || low == last && is_nearer((item, mine[0]), (s.item, other.nearness.at(ends[0])));
            s.item == item || (is_same && item < s.item) || surely() || alone()
        });
        self.charge(low, compared);
        all
    }

    fn charge(&mut self, x: u32, comparisons: usize) {
        self.work.comparisons += comparisons as u64;
        self.canvas.charge_more(x, self.y, comparisons as u32);
    }
}
