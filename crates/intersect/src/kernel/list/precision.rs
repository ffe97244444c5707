//! The precisions that lists support: single precision only.

use super::{Unresolved, is_suitable, search_list};
use crate::hit::{DHit, Hit};
use crate::kernel::Goal;
use crate::kernel::stream::interleave::Batch;
use crate::precision::{Double, Facts, Single};
use crate::tree::Forest;
use snell_math::simd::Wide;
use snell_math::{DRay, Ray};

/// Searches in lists, for the precisions that have them.
pub(crate) trait ListSearch: Facts {
    /// Searches for the first rays of a batch, or for all, in the list of the forest
    /// ([`search_list`]). Returns the number of rays processed.
    fn search_list<G: Goal<Precision = Self>>(
        forest: &Forest,
        wide: Option<Wide>,
        batch: &Batch<Self>,
        unresolved: &mut Vec<Unresolved<Self::Hit>>,
        start: impl Fn(&Self::Ray) -> G,
        finish: impl FnMut(usize, G),
    ) -> usize;
}

impl ListSearch for Single {
    #[inline(always)]
    fn search_list<G: Goal<Precision = Self>>(
        forest: &Forest,
        wide: Option<Wide>,
        batch: &Batch<Self>,
        unresolved: &mut Vec<Unresolved<Hit>>,
        start: impl Fn(&Ray) -> G,
        finish: impl FnMut(usize, G),
    ) -> usize {
        if is_suitable(forest, batch.rays.len()) {
            search_list(forest, wide, batch, unresolved, start, finish)
        } else {
            0
        }
    }
}

impl ListSearch for Double {
    /// Processes no rays, because lists exist in single precision only.
    fn search_list<G: Goal<Precision = Self>>(
        _: &Forest,
        _: Option<Wide>,
        _: &Batch<Self>,
        _: &mut Vec<Unresolved<DHit>>,
        _: impl Fn(&DRay) -> G,
        _: impl FnMut(usize, G),
    ) -> usize {
        0
    }
}
