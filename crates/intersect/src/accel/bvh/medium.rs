//! Medium quality: sets are divided where the surface area heuristic says, from the top down.

use super::binary::{Costs, PartBuilder, Tree};
use super::bins::{Binning, Bins, Extent};
use super::partition::partition;
use super::primitive::{Numbered, OBJECT, Primitive};
use rayon::join;

/// Sets up to this size become one part of the tree, built by one thread.
const PART: usize = 4096;

/// Below this depth sets are halved instead of divided by cost, so that no tree is deeper than some 90 nodes.
const MAX_COST_DEPTH: usize = 60;

/// Builds the tree of some primitives, at least one.
pub(super) fn build(primitives: &mut [Primitive], has_objects: bool) -> Tree<'_, Primitive> {
    let extent = Extent::of(primitives);
    subtree(Set { primitives, extent, depth: 0 }, has_objects)
}

/// Primitives that become a subtree.
struct Set<'a> {
    primitives: &'a mut [Primitive],
    extent: Extent,
    depth: usize,
}

fn subtree(set: Set<'_>, has_objects: bool) -> Tree<'_, Primitive> {
    if set.primitives.len() <= PART {
        let mut part = PartBuilder::new(set.primitives.len());
        let costs = Small { has_objects, part: &mut part }.node(0, set.primitives, &set.extent, set.depth);
        return part.finish(set.primitives, costs);
    }
    let (bounds, depth) = (set.extent.bounds, set.depth + 1);
    let (at, extents) = divide(set.primitives, &set.extent, set.depth);
    let (a, b) = set.primitives.split_at_mut(at);
    let child = |primitives, extent| subtree(Set { primitives, extent, depth }, has_objects);
    let (a, b) = join(|| child(a, extents[0]), || child(b, extents[1]));
    Tree::inner(bounds, [a, b])
}

/// Reorders a set of at least two into two parts that are not empty. Returns the size of the first, and what both extend over.
fn divide(primitives: &mut [Primitive], extent: &Extent, depth: usize) -> (usize, [Extent; 2]) {
    let binning = Binning::new(&extent.centers);
    let plane = if depth < MAX_COST_DEPTH { Bins::of(&binning, primitives).best_plane() } else { None };
    let Some(plane) = plane else {
        let middle = primitives.len() / 2;
        let (a, b) = primitives.split_at(middle);
        return (middle, [Extent::of(a), Extent::of(b)]);
    };
    let parts = partition(primitives, |center2| binning.is_first(&plane, center2));
    let extent = |i: usize| Extent { bounds: plane.bounds[i], centers: parts.centers[i] };
    (parts.first, [extent(0), extent(1)])
}

/// The builder of one part.
struct Small<'a> {
    has_objects: bool,
    part: &'a mut PartBuilder,
}

impl Small<'_> {
    /// `first` is where the set starts in the part.
    fn node(&mut self, first: usize, set: &mut [Primitive], extent: &Extent, depth: usize) -> Costs {
        if is_leaf(set, self.has_objects) {
            return self.part.leaf(&extent.bounds, first, set.len());
        }
        let (at, extents) = divide(set, extent, depth);
        let (a, b) = set.split_at_mut(at);
        let has_objects = self.has_objects;
        self.part.inner(
            &extent.bounds,
            |part| Small { has_objects, part }.node(first, a, &extents[0], depth + 1),
            |part| Small { has_objects, part }.node(first + at, b, &extents[1], depth + 1),
        )
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

    fn at(x: f32, id: u32) -> Primitive {
        Primitive::new(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 0.1, 1.0, 1.0), id)
    }

    #[test]
    fn two_clusters_are_divided_between_them() {
        let mut set: Vec<_> = (0..20).map(|i| at(if i % 2 == 0 { 0.0 } else { 50.0 } + i as f32 * 0.1, i)).collect();
        let extent = Extent::of(&set);
        let (n, extents) = divide(&mut set, &extent, 0);
        assert_eq!(n, 10);
        assert!(set[..n].iter().all(|p| p.id() % 2 == 0));
        assert!(extents[0].bounds.high.x < extents[1].bounds.low.x);
    }

    #[test]
    fn equal_and_extreme_primitives_are_divided_somewhere() {
        for x in [0.0, 3e38, -3e38, 1e-45] {
            let mut set = vec![at(x, 0), at(x, 1), at(x, 2)];
            let extent = Extent::of(&set);
            let (n, _) = divide(&mut set, &extent, 0);
            assert!(n > 0 && n < 3);
        }
        let mut set = vec![at(-3e38, 0), at(3e38, 1)];
        let extent = Extent::of(&set);
        assert_eq!(divide(&mut set, &extent, 0).0, 1);
    }

    #[test]
    fn the_box_of_a_tree_holds_all() {
        let mut set: Vec<_> = (0..10_000).map(|i| at(i as f32, i)).collect();
        let all = Extent::of(&set).bounds;
        let tree = build(&mut set, false);
        assert_eq!(tree.root().bounds().bounds(), all.bounds());
    }
}
