//! The input of ray queries: rays, with an optional mask and time for each.

use crate::precision::{Double, Precision, Single};
use snell_math::{DRay, Ray, Vec3};
use std::sync::atomic::AtomicBool;

/// One ray with its mask and time. A `&Ray` converts into a query with all mask bits set and time
/// 0.
#[derive(Clone, Copy, Debug)]
pub struct RayQuery<'a, P: Precision = Single> {
    /// The ray, in world space.
    pub ray: &'a P::Ray,
    /// The ray hits a geometry or enters an instance only if their masks have a bit in common with
    /// this one.
    pub mask: u64,
    /// Time from 0 (start of the motion) to 1 (its end). Only moving geometry depends on it.
    pub time: f32,
}

impl<'a> From<&'a Ray> for RayQuery<'a> {
    #[inline(always)]
    fn from(ray: &'a Ray) -> Self {
        Self { ray, mask: u64::MAX, time: 0.0 }
    }
}

impl<'a> From<&'a DRay> for RayQuery<'a, Double> {
    #[inline(always)]
    fn from(ray: &'a DRay) -> Self {
        Self { ray, mask: u64::MAX, time: 0.0 }
    }
}

/// The time of a ray as searches use it: clamped to 0 to 1, and 0 for NaN.
#[inline(always)]
pub(crate) fn clamped_time(time: f32) -> f32 {
    if time.is_nan() { 0.0 } else { time.clamp(0.0, 1.0) }
}

/// A batch of rays. A slice of rays converts into a batch with all mask bits set and time 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rays<'a, P: Precision = Single> {
    rays: &'a [P::Ray],
    /// Masks, one per ray, or empty.
    masks: &'a [u64],
    /// Times, one per ray, or empty.
    times: &'a [f32],
    /// Ends the search early when it is set.
    cancel: Option<&'a AtomicBool>,
}

impl<'a, P: Precision> Rays<'a, P> {
    /// A batch with all mask bits set and time 0.
    pub fn new(rays: &'a [P::Ray]) -> Self {
        Self { rays, masks: &[], times: &[], cancel: None }
    }

    /// Sets a mask for each ray ([`RayQuery::mask`]).
    ///
    /// # Panics
    /// If there are not as many masks as rays.
    pub fn with_masks(self, masks: &'a [u64]) -> Self {
        assert_eq!(masks.len(), self.rays.len(), "one mask per ray");
        Self { masks, ..self }
    }

    /// Sets a time for each ray ([`RayQuery::time`]). Times are clamped to 0 to 1; NaN counts as 0.
    ///
    /// # Panics
    /// If there are not as many times as rays.
    pub fn with_times(self, times: &'a [f32]) -> Self {
        assert_eq!(times.len(), self.rays.len(), "one time per ray");
        Self { times, ..self }
    }

    /// Sets a flag that ends the query soon after it becomes true. The search reads the flag often,
    /// also within one ray. The results of a query that was ended this way are meaningless.
    pub fn with_cancel(self, cancel: &'a AtomicBool) -> Self {
        Self { cancel: Some(cancel), ..self }
    }

    /// The flag that ends the query, if one is set.
    pub(crate) fn cancel(&self) -> Option<&'a AtomicBool> {
        self.cancel
    }

    /// The number of rays.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// True if the batch has no rays.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    /// The rays without their masks and times.
    pub fn rays(&self) -> &'a [P::Ray] {
        self.rays
    }

    /// True if rays have masks of their own.
    pub(crate) fn has_masks(&self) -> bool {
        !self.masks.is_empty()
    }

    /// True if rays have times of their own.
    pub(crate) fn has_times(&self) -> bool {
        !self.times.is_empty()
    }

    /// The ray with this index, its mask and its time.
    ///
    /// # Panics
    /// If the index is out of range.
    #[inline(always)]
    pub fn get(&self, index: usize) -> RayQuery<'a, P> {
        let mask = if self.masks.is_empty() { u64::MAX } else { self.masks[index] };
        let time = if self.times.is_empty() { 0.0 } else { self.times[index] };
        RayQuery { ray: &self.rays[index], mask, time }
    }

    /// The mask bits that all rays of a part have in common.
    ///
    /// # Panics
    /// If the range reaches beyond the batch.
    #[inline(always)]
    pub(crate) fn common_mask(&self, range: std::ops::Range<usize>) -> u64 {
        if self.masks.is_empty() {
            u64::MAX
        } else {
            self.masks[range].iter().fold(u64::MAX, |all, mask| all & mask)
        }
    }

    /// The batch with other rays, and the same masks and times.
    pub(crate) fn with_rays(self, rays: &'a [P::Ray]) -> Self {
        debug_assert_eq!(rays.len(), self.rays.len());
        Self { rays, ..self }
    }

    /// A part of the batch, with its masks and times.
    ///
    /// # Panics
    /// If the range reaches beyond the batch.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Self {
        let masks = if self.masks.is_empty() { self.masks } else { &self.masks[range.clone()] };
        let times = if self.times.is_empty() { self.times } else { &self.times[range.clone()] };
        Self { rays: &self.rays[range], masks, times, ..*self }
    }
}

/// Numbers of rays of a batch that are invalid and hit nothing. Each ray is counted once, in the
/// first field that applies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InvalidRays {
    /// A coordinate of the origin or direction is infinite or NaN.
    pub not_finite: usize,
    /// The direction is zero.
    pub without_direction: usize,
    /// `t_min < t_max` does not hold, or one of them is NaN.
    pub empty_interval: usize,
}

impl InvalidRays {
    /// The number of all invalid rays.
    pub fn total(&self) -> usize {
        self.not_finite + self.without_direction + self.empty_interval
    }
}

impl Rays<'_> {
    /// Counts the invalid rays, which every query reports as misses without a search
    /// ([`Ray::is_valid`]).
    pub fn count_invalid(&self) -> InvalidRays {
        let mut counts = InvalidRays::default();
        for ray in self.rays.iter().filter(|ray| !ray.is_valid()) {
            if !ray.origin.is_finite() || !ray.direction.is_finite() {
                counts.not_finite += 1;
            } else if ray.direction == Vec3::ZERO {
                counts.without_direction += 1;
            } else {
                counts.empty_interval += 1;
            }
        }
        counts
    }
}

impl<'a> From<&'a [Ray]> for Rays<'a> {
    fn from(rays: &'a [Ray]) -> Self {
        Self::new(rays)
    }
}

impl<'a> From<&'a Vec<Ray>> for Rays<'a> {
    fn from(rays: &'a Vec<Ray>) -> Self {
        Self::new(rays)
    }
}

impl<'a, const N: usize> From<&'a [Ray; N]> for Rays<'a> {
    fn from(rays: &'a [Ray; N]) -> Self {
        Self::new(rays)
    }
}

impl<'a> From<&'a [DRay]> for Rays<'a, Double> {
    fn from(rays: &'a [DRay]) -> Self {
        Self::new(rays)
    }
}

impl<'a> From<&'a Vec<DRay>> for Rays<'a, Double> {
    fn from(rays: &'a Vec<DRay>) -> Self {
        Self::new(rays)
    }
}

impl<'a, const N: usize> From<&'a [DRay; N]> for Rays<'a, Double> {
    fn from(rays: &'a [DRay; N]) -> Self {
        Self::new(rays)
    }
}
