//! Outliers: the few large primitives of a group, such as the floor below a model or the wall
//! behind it. Nearly every ray hits their boxes, and a box around them and the model is much larger
//! than the model. So the rest of the group gets a separate tree below the root, whose other
//! children lead to the outliers. Kernels test sixteen rays at a time against the outliers, and
//! only the rays that come near the rest traverse its tree.

use super::binary::Tree;
use super::binning::Primitive;
use super::bins::{CHUNK, Extent};
use super::medium::Medium;
use super::primitive::{Numbered, OBJECT};
use crate::group::GroupList;
use crate::tree::list::is_for_lists;
use rayon::prelude::*;

/// The largest number of outliers in a group, since every ray is tested against each of them.
const MAX_OUTLIERS: usize = 16;

/// The least area of an outlier's box, relative to the area of the box around everything.
const MIN_AREA: f32 = 1.0 / 32.0;

/// The largest area of the box around the rest, relative to the area of the box around everything.
/// If the rest were larger, most rays would come near it anyway.
const MAX_REST: f32 = 0.5;

/// The least number of primitives that are not outliers. A group with fewer is small enough, or
/// nearly so, to be searched as a list.
const MIN_REST: usize = 64;

/// Moves the outliers to the end. Returns the number of other primitives and their extent. If
/// outliers are not worth a separate treatment, all primitives count as others.
pub(super) fn divide(primitives: &mut [Primitive], list: &GroupList) -> (usize, Extent) {
    let (all, extent) = (primitives.len(), Extent::of(primitives));
    let area = extent.bounds.half_area();
    let may_be_outlier = |p: &Primitive| {
        let is_object = p.id() & OBJECT != 0;
        !is_object
            || list.objects.placed().get((p.id() & !OBJECT) as usize).is_some_and(is_for_lists)
    };
    let is_large = |p: &Primitive| p.bounds().half_area() >= MIN_AREA * area && may_be_outlier(p);
    if !area.is_finite() || area <= 0.0 {
        return (all, extent);
    }
    let large: Vec<usize> = primitives
        .par_chunks(CHUNK)
        .enumerate()
        .flat_map_iter(|(i, chunk)| {
            let found = (i * CHUNK..).zip(chunk).filter(|(_, p)| is_large(p)).map(|(at, _)| at);
            found.take(MAX_OUTLIERS + 1).collect::<Vec<_>>()
        })
        .collect();
    let rest = all - large.len();
    if large.is_empty() || large.len() > MAX_OUTLIERS || rest < MIN_REST {
        return (all, extent);
    }
    // The last outlier is moved first, so that none that is still to be moved is overwritten.
    for (i, &from) in large.iter().rev().enumerate() {
        primitives.swap(from, all - 1 - i);
    }
    let around = Extent::of(&primitives[..rest]);
    if around.bounds.half_area() <= MAX_REST * area { (rest, around) } else { (all, extent) }
}

/// The tree of a group, made of the tree of the rest and the outliers.
pub(super) fn join<'a>(
    rest: Tree<'a, Primitive>,
    outliers: &'a mut [Primitive],
    medium: Medium,
) -> Tree<'a, Primitive> {
    match outliers {
        [] => rest,
        outliers => Tree::beside(rest, medium.build(outliers)),
    }
}
