//! Parameters of queries besides their rays: the grouping of rays, and the filter of hits.

use crate::precision::{Precision, Single};

/// Which rays of a batch belong together. The kernel follows from this and from the kind of query,
/// never from what happens to share a batch, so a ray's result never depends on its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grouping {
    /// Unrelated rays.
    #[default]
    None,
    /// Rays that are much like their neighbours: each run of 16, counted from the start of the
    /// batch (the last may be shorter), leaves one point or goes to one point, in similar
    /// directions. Such are the samples of a pixel or of 4x4 pixels seen by a pinhole, and the
    /// shadow rays from them to a point light. Where it is not so, such runs are traced like
    /// unrelated rays.
    Coherent,
}

/// Decides about hits on geometries marked by [`crate::WorldBuilder::set_filtered`] (cut-out and
/// blended surfaces). Must be a pure function of its arguments.
pub trait HitFilter<P: Precision = Single>: Sync {
    /// False if the ray passes through at this hit. `ray` is in world space; its `t_max` is
    /// unspecified.
    fn accept(&self, ray: &P::Ray, hit: &P::Hit) -> bool;

    /// The same for a ray with a time from 0 to 1. For those to whom the time means nothing, as
    /// [`Self::accept`].
    fn accept_at(&self, ray: &P::Ray, time: f32, hit: &P::Hit) -> bool {
        let _ = time;
        self.accept(ray, hit)
    }
}

/// The filter that keeps every hit.
#[derive(Clone, Copy, Debug)]
pub struct AcceptAll;

impl<P: Precision> HitFilter<P> for AcceptAll {
    fn accept(&self, _: &P::Ray, _: &P::Hit) -> bool {
        true
    }
}

/// What queries ask about a geometry before a hit on it counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeometryOptions {
    /// Only rays whose mask shares a bit with this meet it.
    pub mask: u32,
    /// The query's [`crate::HitFilter`] may reject hits.
    pub filtered: bool,
    /// Its triangles are halves of quads.
    pub(crate) quads: bool,
}

impl Default for GeometryOptions {
    fn default() -> Self {
        Self { mask: u32::MAX, filtered: false, quads: false }
    }
}
