//! The scan-line z-buffer: row by row, with depths of one row only (Myers, An Efficient Visible Surface Program, Ohio State University 1975). It
//! looks at all facets of a row at each pixel they cover, as Wylie, Romney, Evans and Erdahl did (Half-tone perspective drawings by computer,
//! AFIPS 1967), and lets the row's own depths do the comparison.

use super::canvas::{Canvas, Seen};
use super::facet::{centre, is_nearer};
use super::rows::ActiveRows;
use super::{NOTHING, Screen};

/// Draws the rows from the top.
pub(super) fn run(screen: &Screen, with_cost: bool) -> Seen {
    let mut canvas = Canvas::new(screen, with_cost);
    let mut depth = vec![0.0f64; screen.size[0] as usize];
    let mut active = ActiveRows::new(screen);
    let (mut spans, mut tested, mut written) = (0, 0, 0);
    for y in 0..screen.size[1] {
        for &item in active.advance(y) {
            let facet = &screen.facets[item as usize];
            let [low, end] = facet.span(y);
            spans += u64::from(low < end);
            for x in low..end {
                let (near, pixel) = (facet.nearness.at(centre(x, y)), canvas.pixel(x, y));
                tested += 1;
                canvas.charge(pixel);
                let old = canvas.items[pixel];
                if old == NOTHING || is_nearer((item, near), (old, depth[x as usize])) {
                    (canvas.items[pixel], depth[x as usize]) = (item, near);
                    written += 1;
                }
            }
        }
    }
    let memory = size_of_val(&depth[..]) + active.memory();
    let work = vec![("most active", active.most as u64), ("spans", spans), ("tested", tested), ("written", written)];
    canvas.seen(work, memory)
}
