//! Parameters of queries besides their rays: the grouping of rays, and the filter of hits.

use crate::precision::{Precision, Single};

/// The coherence of the rays of a batch. This and the kind of query determine the kernel; the other
/// rays of the batch do not, so a ray's result never depends on its neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grouping {
    /// Rays without coherence.
    #[default]
    None,
    /// Coherent rays: those of each run of 16, counted from the start of the batch (the last may be
    /// shorter), have a common origin or target, and similar directions. Examples are the samples
    /// of a pixel or of 4x4 pixels seen by a pinhole camera, and the shadow rays from these to a
    /// point light. Runs that are not coherent are traced like incoherent rays.
    Coherent,
}

/// Decides about hits on geometries marked by [`crate::WorldBuilder::set_filtered`] (cut-out and
/// blended surfaces). Implementations must be pure functions of their arguments.
pub trait HitFilter<P: Precision = Single>: Sync {
    /// Returns false if the ray passes through the surface at this hit. `ray` is in world space;
    /// its `t_max` is unspecified.
    fn accept(&self, ray: &P::Ray, hit: &P::Hit) -> bool;

    /// [`Self::accept`] for a ray with a time from 0 to 1. By default it ignores the time and calls
    /// [`Self::accept`].
    fn accept_at(&self, ray: &P::Ray, time: f32, hit: &P::Hit) -> bool {
        let _ = time;
        self.accept(ray, hit)
    }

    /// True if the filter decides about hits on all geometries, not only on marked ones. False by
    /// default.
    fn decides_everywhere(&self) -> bool {
        false
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

/// Properties of a geometry that decide whether hits on it count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GeometryOptions {
    /// Only rays whose mask has a bit in common with this mask hit the geometry.
    pub mask: u64,
    /// True if the query's [`crate::HitFilter`] may reject hits.
    pub filtered: bool,
    /// True if the triangles of the geometry are halves of quads.
    pub(crate) quads: bool,
}

impl Default for GeometryOptions {
    fn default() -> Self {
        Self { mask: u64::MAX, filtered: false, quads: false }
    }
}
