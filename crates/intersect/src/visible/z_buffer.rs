//! The z-buffer: facets in any order, and for each pixel the nearest so far (Catmull, A Subdivision Algorithm for Computer Display of Curved
//! Surfaces, University of Utah 1974, section 3.3; Strasser, Berlin 1974).

use super::canvas::{Canvas, Seen};
use super::facet::{centre, is_nearer};
use super::{NOTHING, Screen};

/// Draws the facets one after the other.
pub(super) fn run(screen: &Screen, with_cost: bool) -> Seen {
    let mut canvas = Canvas::new(screen, with_cost);
    let mut depth = vec![0.0f64; canvas.len()];
    let (mut tested, mut written) = (0, 0);
    for &item in &screen.sampled {
        let facet = &screen.facets[item as usize];
        for y in facet.rows[0]..facet.rows[1] {
            let [low, end] = facet.span(y);
            for x in low..end {
                let (near, pixel) = (facet.nearness.at(centre(x, y)), canvas.pixel(x, y));
                tested += 1;
                canvas.charge(pixel);
                let old = canvas.items[pixel];
                if old == NOTHING || is_nearer((item, near), (old, depth[pixel])) {
                    (canvas.items[pixel], depth[pixel]) = (item, near);
                    written += 1;
                }
            }
        }
    }
    let memory = size_of_val(&depth[..]);
    canvas.seen(vec![("facets", screen.sampled.len() as u64), ("tested", tested), ("written", written)], memory)
}
