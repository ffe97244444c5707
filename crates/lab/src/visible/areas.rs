//! Visible areas as polygons, sampled at the pixels (Weiler and Atherton, Hidden Surface Removal
//! Using Polygon Area Sorting, SIGGRAPH 1977).
//!
//! Weiler and Atherton cut all polygons by the outline of the nearest polygon, and the remainder by
//! those behind it, until the picture consists of polygons that do not overlap. Here
//! [`BeamTracer::visible`] does this, with convex pieces, and with the bounding volume hierarchy in
//! place of the sorted list. The pieces are exact areas, at any resolution; they are sampled at the
//! pixel centres only for comparison with the other methods.

use super::canvas::{Canvas, Seen};
use super::facet::centre;
use super::{NOTHING, Screen, VisibleError};
use crate::coherence::{BeamTracer, ConvexPolygon};
use snell_intersect::World;
use snell_math::DVec2;

/// Distance in pixels within which a pixel centre may be in a piece; the common test then decides.
const TOLERANCE: f64 = 1e-7;

/// Cuts the picture into its visible pieces.
pub(super) fn run(screen: &Screen, world: &World, with_cost: bool) -> Result<Seen, VisibleError> {
    let mut canvas = Canvas::new(screen, with_cost);
    let mut tracer = BeamTracer::new(world).map_err(|_| VisibleError::NotBvh)?;
    let size = DVec2::new(screen.size[0].into(), screen.size[1].into());
    let (mut pieces, mut tested, mut vertices) = (0u64, 0u64, 0u64);
    if !canvas.items.is_empty() {
        tracer.visible(&screen.view, &ConvexPolygon::rectangle(DVec2::ZERO, size), |piece| {
            pieces += 1;
            vertices += piece.polygon.vertices().len() as u64;
            let item = piece.primitive.map_or(NOTHING, |id| screen.item(id));
            let (low, high) = piece.polygon.extent();
            let bound = |x: f64, most: f64| x.clamp(0.0, most) as u32;
            let (low, high) = (low - 0.5 - TOLERANCE, high + 0.5 + TOLERANCE);
            for y in bound(low.y.ceil(), size.y)..bound(high.y.floor(), size.y) {
                for x in bound(low.x.ceil(), size.x)..bound(high.x.floor(), size.x) {
                    tested += 1;
                    let pixel = canvas.pixel(x, y);
                    canvas.charge(pixel);
                    if item != NOTHING && piece.polygon.contains(centre(x, y), TOLERANCE) {
                        canvas.items[pixel] = match canvas.items[pixel] {
                            NOTHING => screen.nearest_of([item].into_iter(), x, y),
                            old => screen.nearest_of([old, item].into_iter(), x, y),
                        };
                    }
                }
            }
        });
    }
    let work = tracer.work();
    let done = vec![
        ("regions", work.regions),
        ("nodes", work.nodes),
        ("triangles", work.triangles),
        ("pieces", pieces),
        ("vertices", vertices),
        ("samples", tested),
    ];
    Ok(Seen { memory: None, ..canvas.seen(done, 0) })
}
