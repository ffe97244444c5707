//! The outliers of a group, as a list that is tested beside the tree of the group.

use super::{List, ListObject};
use crate::tree::GroupTree;
use snell_math::Bounds3;

/// Large primitives and unbounded planes of a group, and the bounds of the rest of the group.
#[derive(Clone, Debug)]
pub(crate) struct Outliers {
    /// The list of the outliers.
    pub(crate) list: Box<List>,
    /// The box around the rest of the group.
    pub(crate) bounds: Bounds3,
}

impl Outliers {
    /// The outliers of a group; `None` if there are none, or they are not suitable for a list.
    pub fn of(tree: &GroupTree) -> Option<Self> {
        let root = tree.nodes.first()?;
        let is_divided = tree.rest != tree.root;
        if !tree.rest.is_node() || !is_divided && tree.unbounded.is_empty() {
            return None;
        }
        // Outliers are the leaves below all children of the root except the first, which holds the
        // rest.
        let mut around = vec![];
        if is_divided {
            around.extend((1..8).map(|slot| (root.children[slot], root.slot_bounds(slot))));
        }
        let mut leaves = vec![];
        while let Some((child, bounds)) = around.pop() {
            if child.is_node() {
                let node = &tree.nodes[child.index()];
                around.extend((0..8).map(|slot| (node.children[slot], node.slot_bounds(slot))));
            } else {
                leaves.push((child, bounds));
            }
        }
        let bounds = if is_divided { root.slot_bounds(0) } else { root.bounds() };
        let list = List::of_leaves(tree, &leaves, &bounds)?;
        let is_tested_in_lanes = |object: &ListObject| object.shape.is_some();
        list.objects.iter().all(is_tested_in_lanes).then_some(Self { list, bounds })
    }
}
