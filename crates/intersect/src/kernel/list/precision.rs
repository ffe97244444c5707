//! Lists are for single precision.

use super::{Begun, is_suitable, search_list};
use crate::hit::{DHit, Hit};
use crate::kernel::Goal;
use crate::kernel::stream::interleave::Batch;
use crate::precision::{Double, Facts, Single};
use crate::tree::Forest;
use snell_math::simd::Wide;
use snell_math::{DRay, Ray};

/// The list of a forest, in precisions that have lists.
pub(crate) trait ListSearch: Facts {
    /// Searches for the first rays of a batch, or all, in the list of the forest
    /// ([`search_list`]); returns how many.
    fn search_list<G: Goal<Precision = Self>>(
        forest: &Forest,
        wide: Option<Wide>,
        batch: &Batch<Self>,
        begun: &mut Vec<Begun<Self::Hit>>,
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
        begun: &mut Vec<Begun<Hit>>,
        start: impl Fn(&Ray) -> G,
        finish: impl FnMut(usize, G),
    ) -> usize {
        if is_suitable(forest, batch.rays.len()) {
            search_list(forest, wide, batch, begun, start, finish)
        } else {
            0
        }
    }
}

impl ListSearch for Double {
    /// None: lists are in single precision.
    fn search_list<G: Goal<Precision = Self>>(
        _: &Forest,
        _: Option<Wide>,
        _: &Batch<Self>,
        _: &mut Vec<Begun<DHit>>,
        _: impl Fn(&DRay) -> G,
        _: impl FnMut(usize, G),
    ) -> usize {
        0
    }
}
