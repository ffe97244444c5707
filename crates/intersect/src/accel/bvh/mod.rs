//! The 8-wide bounding volume hierarchy of each group, and all groups together.

mod build;
mod split;

use super::brute_force::GroupList;
use super::group::{Object, Objects};
use crate::kernel::node::{ChildRef, WideNode};
use crate::kernel::triangle::TriangleBlock;
use snell_math::{Bounds3, Bounds3d};

/// The tree of one group.
#[derive(Debug)]
pub(crate) struct GroupTree {
    pub nodes: Vec<WideNode>,
    pub blocks: Vec<TriangleBlock>,
    /// Where the walk starts; [`ChildRef::NONE`] for a group without bounded contents.
    pub root: ChildRef,
    /// Shapes, instances and primitives of sets, as the leaves number them.
    pub objects: Objects,
    /// Objects without finite bounds: always tested.
    pub unbounded: Vec<u32>,
    /// For each mesh the number of its first triangle within the group, and its geometry; ascending.
    pub meshes: Vec<(u32, u32)>,
    /// Nodes on the longest way down.
    pub depth: usize,
}

impl GroupTree {
    /// Geometry and triangle of a triangle numbered within the group.
    #[inline(always)]
    pub fn triangle(&self, id: u32) -> (u32, u32) {
        let (first, geometry) = match self.meshes.as_slice() {
            [only] => *only,
            all => all[all.partition_point(|m| m.0 <= id).saturating_sub(1)],
        };
        (geometry, id - first)
    }

    /// Entries a walk through this group alone may need at once.
    fn stack_size(&self) -> usize {
        7 * self.depth + 8
    }

    /// Memory of the tree.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.blocks.as_slice()) + self.objects.memory_bytes()
    }
}

/// The trees of all groups; group 0 is the root.
#[derive(Debug)]
pub(crate) struct Forest {
    pub trees: Vec<GroupTree>,
    /// Entries a walk needs on the deepest way through all groups.
    pub stack_size: usize,
}

impl Forest {
    /// Builds all trees. `order` lists the groups with children before parents; `bounds` are the boxes of the objects of each group
    /// in the coordinates of the group.
    pub fn build(lists: &[GroupList], order: &[usize], bounds: &[Vec<Bounds3d>]) -> Result<Self, String> {
        let mut trees = Vec::with_capacity(lists.len());
        for (list, bounds) in lists.iter().zip(bounds) {
            let boxes: Vec<Bounds3> = bounds.iter().map(Bounds3d::outward_f32).collect();
            trees.push(build::build_group(list, &boxes)?);
        }
        let mut sizes = vec![0; lists.len()];
        for &group in order {
            let below = |object: &Object| match object {
                Object::Instance { child, .. } => sizes[*child],
                Object::Shape { .. } => 0,
            };
            let tree: &GroupTree = &trees[group];
            sizes[group] = tree.stack_size() + tree.objects.placed().iter().map(below).max().unwrap_or(0);
        }
        Ok(Self { trees, stack_size: sizes[0] })
    }

    /// Memory of all trees.
    pub fn memory_bytes(&self) -> usize {
        self.trees.iter().map(GroupTree::memory_bytes).sum()
    }
}
