//! Medium quality: a top-down build that divides sets by the surface area heuristic.

use super::binary::{Costs, PartBuilder, Tree};
use super::binning::{Binning, Primitive};
use super::bins::{Extent, best_plane, bins_of};
use super::partition::partition;
use super::primitive::{Numbered, OBJECT};
use rayon::join;
use snell_math::simd::Wide;

/// Sets of up to this number of primitives become one part of the tree, built by one thread.
pub(super) const PART: usize = 4096;

/// Below this depth sets are halved instead of divided by cost, which limits the depth of trees to
/// about 90 nodes.
pub(super) const MAX_COST_DEPTH: usize = 60;

/// Options of the build.
#[derive(Clone, Copy, Debug)]
pub(super) struct Medium {
    /// The SIMD instructions to use.
    pub wide: Option<Wide>,
    /// False if all primitives are triangles.
    pub has_objects: bool,
}

impl Medium {
    /// Builds the tree of at least one primitive.
    pub fn build(self, primitives: &mut [Primitive]) -> Tree<'_, Primitive> {
        let extent = Extent::of(primitives);
        self.build_within(primitives, &extent)
    }

    /// Builds the tree of at least one primitive, whose extent is given.
    pub fn build_within<'a>(
        self,
        primitives: &'a mut [Primitive],
        extent: &Extent,
    ) -> Tree<'a, Primitive> {
        self.subtree(primitives, extent, 0)
    }

    fn subtree<'a>(
        self,
        set: &'a mut [Primitive],
        extent: &Extent,
        depth: usize,
    ) -> Tree<'a, Primitive> {
        if set.len() <= PART {
            let mut part = PartBuilder::new(set.len());
            let costs = self.node(&mut part, 0, set, extent, depth);
            return part.finish(set, costs);
        }
        let (at, extents) = self.divide(set, extent, depth);
        let (a, b) = set.split_at_mut(at);
        let (a, b) = join(
            || self.subtree(a, &extents[0], depth + 1),
            || self.subtree(b, &extents[1], depth + 1),
        );
        Tree::inner(extent.bounds, [a, b])
    }

    /// Builds a subtree within a part. `first` is the index of the set's first primitive in the
    /// part.
    fn node(
        self,
        part: &mut PartBuilder,
        first: usize,
        set: &mut [Primitive],
        extent: &Extent,
        depth: usize,
    ) -> Costs {
        if is_leaf(set, self.has_objects) {
            return part.leaf(&extent.bounds, first, set.len());
        }
        let (at, extents) = self.divide(set, extent, depth);
        let (a, b) = set.split_at_mut(at);
        part.inner(
            &extent.bounds,
            |part| self.node(part, first, a, &extents[0], depth + 1),
            |part| self.node(part, first + at, b, &extents[1], depth + 1),
        )
    }

    /// Reorders a set of at least two primitives into two parts that are not empty. Returns the
    /// size of the first part, and the extents of both.
    fn divide(self, set: &mut [Primitive], extent: &Extent, depth: usize) -> (usize, [Extent; 2]) {
        let binning = Binning::new(&extent.centers);
        let plane = if depth < MAX_COST_DEPTH {
            best_plane(&bins_of(self.wide, &binning, set))
        } else {
            None
        };
        let Some(plane) = plane else {
            let middle = set.len() / 2;
            let (a, b) = set.split_at(middle);
            return (middle, [Extent::of(a), Extent::of(b)]);
        };
        let parts = partition(self.wide, &binning, plane.at, set);
        let extent = |i: usize| Extent { bounds: plane.bounds[i], centers: parts.centers[i] };
        (parts.first, [extent(0), extent(1)])
    }
}

/// True for one primitive, or up to eight triangles.
pub(super) fn is_leaf<P: Numbered>(set: &[P], has_objects: bool) -> bool {
    set.len() == 1 || (set.len() <= 8 && !(has_objects && set.iter().any(|p| p.id() & OBJECT != 0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec3;

    const MEDIUM: Medium = Medium { wide: None, has_objects: false };

    fn at(x: f32, id: u32) -> Primitive {
        Primitive::new(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 0.1, 1.0, 1.0), id)
    }

    #[test]
    fn two_clusters_are_divided_between_them() {
        let mut set: Vec<_> =
            (0..20).map(|i| at(if i % 2 == 0 { 0.0 } else { 50.0 } + i as f32 * 0.1, i)).collect();
        let extent = Extent::of(&set);
        let (n, extents) = MEDIUM.divide(&mut set, &extent, 0);
        assert_eq!(n, 10);
        assert!(set[..n].iter().all(|p| p.id() % 2 == 0));
        assert!(extents[0].bounds.bounds().max.x < extents[1].bounds.bounds().min.x);
    }

    #[test]
    fn equal_and_extreme_primitives_are_divided_somewhere() {
        for x in [0.0, 3e38, -3e38, 1e-45] {
            let mut set = vec![at(x, 0), at(x, 1), at(x, 2)];
            let extent = Extent::of(&set);
            let (n, _) = MEDIUM.divide(&mut set, &extent, 0);
            assert!(n > 0 && n < 3);
        }
        let mut set = vec![at(-3e38, 0), at(3e38, 1)];
        let extent = Extent::of(&set);
        assert_eq!(MEDIUM.divide(&mut set, &extent, 0).0, 1);
    }

    #[test]
    fn the_box_of_a_tree_holds_all() {
        let mut set: Vec<_> = (0..10_000).map(|i| at(i as f32, i)).collect();
        let all = Extent::of(&set).bounds;
        let tree = MEDIUM.build(&mut set);
        assert_eq!(tree.root().bounds(), all.bounds());
    }
}
