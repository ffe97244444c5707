//! The z-buffer: facets in any order, and for each pixel the nearest facet so far (Catmull, A
//! Subdivision Algorithm for Computer Display of Curved Surfaces, University of Utah 1974, section
//! 3.3; Strasser, Berlin 1974).

use super::Screen;
use super::canvas::{Canvas, Seen};

/// Draws the facets one after the other.
pub(super) fn run(screen: &Screen, with_cost: bool) -> Seen {
    let mut canvas = Canvas::new(screen, with_cost);
    let width = screen.size[0] as usize;
    let mut depth = vec![0.0f64; canvas.len()];
    let (mut tested, mut written) = (0, 0);
    for &item in &screen.sampled {
        let [first, end] = screen.facets[item as usize].rows;
        for y in first..end {
            let row = &mut depth[y as usize * width..][..width];
            let [t, w] = canvas.keep_nearest(screen, item, y, row);
            (tested, written) = (tested + t, written + w);
        }
    }
    let memory = size_of_val(&depth[..]);
    canvas.seen(
        vec![("facets", screen.sampled.len() as u64), ("tested", tested), ("written", written)],
        memory,
    )
}
