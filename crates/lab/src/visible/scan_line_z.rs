//! The scan-line z-buffer: row by row, with a depth buffer for one row (Myers, An Efficient Visible
//! Surface Program, Ohio State University 1975). It visits all facets that cover a pixel of the
//! row, as Wylie, Romney, Evans and Erdahl did (Half-tone perspective drawings by computer, AFIPS
//! 1967), and compares them by the row's depth buffer.

use super::Screen;
use super::canvas::{Canvas, Seen};
use super::rows::ActiveRows;

/// Draws the rows from the top.
pub(super) fn run(screen: &Screen, with_cost: bool) -> Seen {
    let mut canvas = Canvas::new(screen, with_cost);
    let mut depth = vec![0.0f64; screen.size[0] as usize];
    let mut active = ActiveRows::new(screen);
    let (mut spans, mut tested, mut written) = (0, 0, 0);
    for y in 0..screen.size[1] {
        for &item in active.advance(y) {
            let [t, w] = canvas.keep_nearest(screen, item, y, &mut depth);
            spans += u64::from(t > 0);
            (tested, written) = (tested + t, written + w);
        }
    }
    let memory = size_of_val(&depth[..]) + active.memory();
    let work = vec![
        ("most active", active.most as u64),
        ("spans", spans),
        ("tested", tested),
        ("written", written),
    ];
    canvas.seen(work, memory)
}
