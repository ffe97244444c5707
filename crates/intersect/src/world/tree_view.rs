//! A read-only view of the tree of a world, for programs with their own traversal.

use super::{Structure, World};
use crate::exact::ray::LocalRay;
use crate::group::{Object, Placement, test_triangle};
use crate::hit::Hit;
use crate::search::{AcceptAll, Closest, Context, Search};
use crate::tree::node::{ChildRef, WideNode};
use crate::tree::{Forest, GroupTree};
use snell_math::{Bounds3, DAffine3, DRay, Ray, Vec3};
use std::mem::MaybeUninit;

/// The eight-wide bounding volume hierarchies of the groups of a [`World`]; group 0 is the root.
#[derive(Clone, Copy, Debug)]
pub struct TreeView<'w> {
    world: &'w World,
    forest: &'w Forest,
}

/// The child in a slot of a node, numbered within its group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TreeChild {
    /// An inner node; see [`TreeView::node`].
    Node(u32),
    /// A leaf of triangles; see [`TreeView::triangles`].
    Triangles {
        /// The number of the block that holds the triangles.
        block: u32,
        /// The number of triangles in the block, from 1 to 8.
        count: u32,
    },
    /// A shape, an instance, or a primitive of a set; see [`TreeView::instance`].
    Object(u32),
}

impl TreeChild {
    fn of(child: ChildRef) -> Option<Self> {
        if child == ChildRef::NONE {
            None
        } else if child.is_node() {
            Some(Self::Node(child.index() as u32))
        } else if child.is_triangles() {
            Some(Self::Triangles { block: child.block() as u32, count: child.count() })
        } else {
            Some(Self::Object(child.index() as u32))
        }
    }
}

/// An inner node: eight slots, of which some may be empty.
#[derive(Clone, Copy, Debug)]
pub struct TreeNode<'w>(&'w WideNode);

impl<'w> TreeNode<'w> {
    /// The bounds of all slots, by side (minimum, maximum), axis and slot. The bounds of an empty
    /// slot are inverted: a minimum of infinity and a maximum of minus infinity.
    pub fn planes(&self) -> &'w [[[f32; 8]; 3]; 2] {
        &self.0.bounds
    }

    /// The box of a slot from 0 to 7, in the coordinates of the group.
    pub fn bounds(&self, slot: usize) -> Bounds3 {
        self.0.slot_bounds(slot)
    }

    /// The child in a slot from 0 to 7; `None` if the slot is empty.
    pub fn child(&self, slot: usize) -> Option<TreeChild> {
        TreeChild::of(self.0.children[slot])
    }
}

/// An instance of a group that does not move.
#[derive(Clone, Copy, Debug)]
pub struct TreeInstance {
    /// The instanced group.
    pub child: usize,
    /// The difference between the occurrence numbers of the instanced group and of the group that
    /// holds the instance.
    pub offset: u32,
    /// The map from the group that holds the instance to the instanced one.
    pub child_from_group: DAffine3,
}

impl<'w> TreeView<'w> {
    /// A view of the trees of a world; `None` if the world has another acceleration structure.
    pub fn new(world: &'w World) -> Option<Self> {
        let Structure::Bvh(forest) = &world.structure else { return None };
        Some(Self { world, forest })
    }

    /// The world.
    pub fn world(&self) -> &'w World {
        self.world
    }

    /// The number of groups.
    pub fn group_count(&self) -> usize {
        self.forest.trees.len()
    }

    fn tree(&self, group: usize) -> &'w GroupTree {
        &self.forest.trees[group]
    }

    /// Where the traversal of a group starts; `None` if nothing in it has finite bounds.
    pub fn root(&self, group: usize) -> Option<TreeChild> {
        TreeChild::of(self.tree(group).root)
    }

    /// An inner node of a group.
    pub fn node(&self, group: usize, node: u32) -> TreeNode<'w> {
        TreeNode(&self.tree(group).nodes[node as usize])
    }

    /// Visits the triangles of a leaf: the number of each within the group, and its corners in the
    /// coordinates of the group.
    pub fn triangles(
        &self,
        group: usize,
        block: u32,
        count: u32,
        mut visit: impl FnMut(u32, [Vec3; 3]),
    ) {
        let mut room = MaybeUninit::uninit();
        let block = self.tree(group).blocks.get(block as usize, &mut room);
        for lane in 0..count as usize {
            visit(block.ids[lane], block.corners(lane).map(Vec3::from_array));
        }
    }

    /// The geometry and the primitive of a triangle that is numbered within its group.
    pub fn triangle(&self, group: usize, triangle: u32) -> (u32, u32) {
        self.tree(group).triangle(triangle)
    }

    /// The number of shapes, instances and primitives of sets in a group.
    pub fn object_count(&self, group: usize) -> usize {
        self.tree(group).objects.len()
    }

    /// An object of a group, if it is an instance that does not move.
    pub fn instance(&self, group: usize, object: u32) -> Option<TreeInstance> {
        match self.tree(group).objects.placed().get(object as usize)? {
            Object::Instance { child, offset, child_from_group: Placement::Still(map), .. } => {
                Some(TreeInstance { child: *child, offset: *offset, child_from_group: *map })
            }
            _ => None,
        }
    }

    /// Tests one triangle by the exact test that every structure uses. `ray` is the ray in world
    /// space, whose interval applies; `local` is the same ray in the coordinates of `corners`;
    /// `ids` are the instance, geometry and primitive that the hit gets.
    pub fn test_triangle(
        &self,
        ray: &Ray,
        local: &DRay,
        corners: &[Vec3; 3],
        ids: [u32; 3],
    ) -> Option<Hit> {
        let context =
            Context { filter: &AcceptAll, options: &self.world.options, data: &(), cancel: None };
        let mut search = Search::new(ray.into(), &context, Closest::new(ray));
        test_triangle(&mut search, &LocalRay::new(local), &corners.map(|p| p.to_array()), || ids);
        let hit = search.goal.result();
        hit.is_hit().then_some(hit)
    }
}
