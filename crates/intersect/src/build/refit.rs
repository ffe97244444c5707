//! New boxes for a tree whose vertices have moved. The topology of the tree stays, so refitting is
//! much faster than a build, and tracing becomes slower the more the vertices have moved relative
//! to each other.

use super::primitive::Triangles;
use crate::group::GroupList;
use crate::mesh::padded_bounds;
use crate::tree::block::TriangleBlock;
use crate::tree::node::WideNode;
use crate::tree::{CacheUse, GroupTree};
use rayon::prelude::*;
use snell_math::{Bounds3, Bounds3d};

/// Subtrees with more nodes than this are refitted by several threads.
const PARALLEL: usize = 512;

impl GroupTree {
    /// Refits the tree to new positions of the same triangles and new boxes of the same objects
    /// (`bounds`, as for [`Self::build`]).
    ///
    /// `None` if refitting is impossible and the tree must be rebuilt: the numbers of triangles,
    /// objects or unbounded objects differ, a triangle that could not be hit before now can, or
    /// vertices that coincided no longer do and do not fit into a compact block. Triangles that can
    /// no longer be hit are taken out, until a later refit brings them back.
    pub fn refit(&self, list: &GroupList, bounds: &[Bounds3d]) -> Option<Self> {
        let mut first = 0;
        let same =
            |((_, mesh), m): (&(u32, std::sync::Arc<crate::mesh::TriangleMesh>), &(u32, u32))| {
                let start = first;
                first += mesh.indices.len() as u32;
                m.0 == start
            };
        let triangles: usize = list.meshes.iter().map(|(_, mesh)| mesh.indices.len()).sum();
        let same_contents = list.meshes.len() == self.meshes.len()
            && list.meshes.iter().zip(&self.meshes).all(same)
            && triangles == self.triangles
            && list.objects.len() == self.objects.len();
        let boxes: Vec<Bounds3> = bounds.iter().map(Bounds3d::outward_f32).collect();
        let (mut unbounded, mut is_empty) = (Vec::new(), Vec::new());
        for (id, b) in boxes.iter().enumerate() {
            if b.is_empty() {
                is_empty.push(id as u32);
            } else if !b.is_finite() {
                unbounded.push(id as u32);
            }
        }
        let meshes: Vec<_> = self
            .meshes
            .iter()
            .zip(&list.meshes)
            .map(|(m, (geometry, _))| (m.0, *geometry))
            .collect();
        let source = Triangles::new(list, &meshes);
        let appears = |id: &u32| !source.is_degenerate(*id);
        if !same_contents
            || unbounded != self.unbounded
            || is_empty != self.empty
            || self.skipped.par_iter().any(appears)
        {
            return None;
        }
        let (blocks, block_bounds) = self.blocks.changed(|block| refill(block, &source))?;
        let mut nodes = self.nodes.clone();
        if !nodes.is_empty() {
            Refit { boxes: &boxes, blocks: &block_bounds }.subtree(&mut nodes, 0);
        }
        Some(Self {
            sah_cost: super::sah_cost(&nodes),
            nodes,
            blocks,
            objects: list.objects.clone(),
            meshes,
            unbounded,
            empty: is_empty,
            skipped: self.skipped.clone(),
            cache: CacheUse::None,
            ..*self
        })
    }
}

/// Stores the new corners of a block's triangles. Returns the box around those that can be hit.
fn refill(block: &mut TriangleBlock, triangles: &Triangles) -> Bounds3 {
    let mut bounds = Bounds3::EMPTY;
    for lane in 0..8 {
        let id = block.ids[lane];
        if id == u32::MAX {
            continue;
        }
        if triangles.is_degenerate(id) {
            // A triangle whose corners coincide is never hit.
            block.set(lane, &[[0.0; 3]; 3], id);
        } else {
            let corners = triangles.corners(id);
            block.set(lane, &corners.map(|v| v.to_array()), id);
            bounds = bounds.union(&padded_bounds(&corners));
        }
    }
    bounds
}

struct Refit<'a> {
    /// The new boxes of the objects.
    boxes: &'a [Bounds3],
    blocks: &'a [Bounds3],
}

impl Refit<'_> {
    /// Refits the subtree with these nodes, of which the first has the number `start`. Returns the
    /// box of the subtree.
    fn subtree(&self, nodes: &mut [WideNode], start: usize) -> Bounds3 {
        let size = nodes.len();
        let Some((node, mut rest)) = nodes.split_first_mut() else { return Bounds3::EMPTY };
        // The nodes below each child that is a node. The nodes of a subtree are contiguous.
        let mut children: [Option<(&mut [WideNode], usize)>; 8] = Default::default();
        let mut end = start + size;
        for slot in (0..8).rev().filter(|&slot| node.children[slot].is_node()) {
            let at = node.children[slot].index();
            let (before, own) = rest.split_at_mut(at - start - 1);
            debug_assert_eq!(own.len(), end - at);
            (children[slot], rest, end) = (Some((own, at)), before, at);
        }
        let references = node.children;
        let refit = |(slot, child): (usize, Option<(&mut [WideNode], usize)>)| match child {
            Some((own, at)) => self.subtree(own, at),
            None => self.leaf(references[slot]),
        };
        let mut all = [Bounds3::EMPTY; 8];
        if size > PARALLEL {
            all.par_iter_mut()
                .zip(children)
                .enumerate()
                .for_each(|(slot, (b, child))| *b = refit((slot, child)));
        } else {
            all.iter_mut()
                .zip(children)
                .enumerate()
                .for_each(|(slot, (b, child))| *b = refit((slot, child)));
        }
        for (slot, b) in all.iter().enumerate() {
            node.set(slot, b, references[slot]);
        }
        node.sort_octants();
        all.iter().fold(Bounds3::EMPTY, |a, b| a.union(b))
    }

    fn leaf(&self, child: crate::tree::node::ChildRef) -> Bounds3 {
        if child == crate::tree::node::ChildRef::NONE {
            Bounds3::EMPTY
        } else if child.is_triangles() {
            self.blocks[child.block()]
        } else {
            self.boxes[child.index()]
        }
    }
}
