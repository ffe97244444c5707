//! From the contents of a group to its tree: binary divisions, of which up to seven make one 8-wide node.

use super::GroupTree;
use super::split::{Primitive, extent, split};
use crate::accel::brute_force::GroupList;
use crate::kernel::node::{ChildRef, WideNode};
use crate::kernel::triangle::TriangleBlock;
use rayon::prelude::*;
use snell_math::{Bounds3, Vec3};

/// Sets larger than this are built by several threads.
const PARALLEL: usize = 4096;

/// Below this depth sets are halved instead of divided by cost, so that no tree is deeper than some 60 nodes.
const MAX_COST_DEPTH: usize = 48;

/// Builds the tree of one group. `boxes` are those of its objects, in order.
pub(super) fn build_group(list: &GroupList, boxes: &[Bounds3]) -> Result<GroupTree, String> {
    let triangles: usize = list.meshes.iter().map(|(_, mesh)| mesh.indices.len()).sum();
    if triangles > ChildRef::MAX_BLOCKS || list.objects.len() > ChildRef::MAX_NODES {
        return Err(format!(
            "a group holds {triangles} triangles and {} shapes and instances; the limits are {} and {}: spread them over several groups",
            list.objects.len(),
            ChildRef::MAX_BLOCKS,
            ChildRef::MAX_NODES
        ));
    }
    let mut meshes = Vec::with_capacity(list.meshes.len());
    let mut first = 0;
    for (geometry, mesh) in &list.meshes {
        meshes.push((first, *geometry));
        first += mesh.indices.len() as u32;
    }
    let mut primitives = triangle_primitives(list, &meshes);
    let mut unbounded = Vec::new();
    for (id, b) in boxes.iter().enumerate() {
        if b.is_finite() {
            primitives.push(Primitive { min: b.min, id: id as u32, max: b.max, is_object: true });
        } else if !b.is_empty() {
            unbounded.push(id as u32);
        }
    }
    let mut tree = GroupTree {
        nodes: Vec::new(),
        blocks: Vec::new(),
        root: ChildRef::NONE,
        objects: list.objects.clone(),
        unbounded,
        meshes,
        depth: 0,
    };
    if !primitives.is_empty() {
        let mut part = Part::default();
        tree.root = Builder { list, meshes: &tree.meshes }.subtree(&mut primitives, 0, &mut part);
        tree.depth = depth(&part.nodes);
        tree.nodes = part.nodes;
        tree.blocks = part.blocks;
    }
    Ok(tree)
}

/// The triangles that can be hit.
fn triangle_primitives(list: &GroupList, meshes: &[(u32, u32)]) -> Vec<Primitive> {
    let mut primitives = Vec::new();
    for ((_, mesh), &(first, _)) in list.meshes.iter().zip(meshes) {
        let primitive = |i: usize| {
            let [a, b, c] = mesh.corners(i);
            (!mesh.is_degenerate(i)).then(|| Primitive {
                min: a.min(b).min(c),
                id: first + i as u32,
                max: a.max(b).max(c),
                is_object: false,
            })
        };
        primitives.par_extend((0..mesh.indices.len()).into_par_iter().with_min_len(PARALLEL).filter_map(primitive));
    }
    primitives
}

/// Nodes on the longest way down. Children come after their parents.
fn depth(nodes: &[WideNode]) -> usize {
    let mut depths = vec![1; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in node.children.iter().filter(|c| c.is_node()) {
            depths[child.index()] = depths[i] + 1;
        }
    }
    depths.into_iter().max().unwrap_or(0)
}

/// A piece of a tree, with references of its own.
#[derive(Default)]
struct Part {
    nodes: Vec<WideNode>,
    blocks: Vec<TriangleBlock>,
}

impl Part {
    /// Appends a piece and returns its root as seen from here.
    fn append(&mut self, part: Self, root: ChildRef) -> ChildRef {
        let (nodes, blocks) = (self.nodes.len() as u32, self.blocks.len() as u32);
        let moved = |child: ChildRef| {
            if child.is_node() {
                ChildRef(child.0 + nodes)
            } else if child.is_triangles() {
                ChildRef(child.0 + blocks)
            } else {
                child
            }
        };
        self.nodes.extend(part.nodes.into_iter().map(|n| WideNode { children: n.children.map(moved), ..n }));
        self.blocks.extend(part.blocks);
        moved(root)
    }
}

/// A set of primitives that becomes a child.
struct Set<'a> {
    primitives: &'a mut [Primitive],
    bounds: Bounds3,
    centers: Bounds3,
}

impl<'a> Set<'a> {
    fn new(primitives: &'a mut [Primitive]) -> Self {
        let [bounds, centers] = extent(primitives);
        Self { primitives, bounds, centers }
    }

    /// One object, or up to eight triangles.
    fn is_leaf(&self) -> bool {
        self.primitives.len() == 1 || (self.primitives.len() <= 8 && !self.primitives.iter().any(|p| p.is_object))
    }

    fn divide(self, depth: usize) -> [Self; 2] {
        let at = if depth < MAX_COST_DEPTH { split(self.primitives, &self.centers) } else { self.primitives.len() / 2 };
        let (a, b) = self.primitives.split_at_mut(at);
        [Self::new(a), Self::new(b)]
    }
}

struct Builder<'a> {
    list: &'a GroupList,
    meshes: &'a [(u32, u32)],
}

impl Builder<'_> {
    /// Builds the tree of a set and returns its root.
    fn subtree(&self, primitives: &mut [Primitive], depth: usize, part: &mut Part) -> ChildRef {
        let set = Set::new(primitives);
        if set.is_leaf() { self.leaf(set.primitives, part) } else { self.node(set, depth, part) }
    }

    fn leaf(&self, primitives: &mut [Primitive], part: &mut Part) -> ChildRef {
        if let [Primitive { is_object: true, id, .. }] = primitives {
            return ChildRef::object(*id as usize);
        }
        primitives.sort_unstable_by_key(|p| p.id);
        let mut block = TriangleBlock::EMPTY;
        for (lane, p) in primitives.iter().enumerate() {
            block.set(lane, &self.corners(p.id).map(|v| v.to_array()), p.id);
        }
        part.blocks.push(block);
        ChildRef::triangles(part.blocks.len() - 1, primitives.len())
    }

    fn corners(&self, id: u32) -> [Vec3; 3] {
        let mesh = self.meshes.partition_point(|m| m.0 <= id).saturating_sub(1);
        self.list.meshes[mesh].1.corners((id - self.meshes[mesh].0) as usize)
    }

    fn node(&self, set: Set, depth: usize, part: &mut Part) -> ChildRef {
        let size = set.primitives.len();
        let sets = eight_children(set, depth);
        let index = part.nodes.len();
        part.nodes.push(WideNode::EMPTY);
        let mut node = WideNode::EMPTY;
        if size > PARALLEL {
            let build = |set: Set| {
                let mut piece = Part::default();
                let root = self.subtree(set.primitives, depth + 1, &mut piece);
                (set.bounds, piece, root)
            };
            let built: Vec<_> = sets.into_par_iter().map(build).collect();
            for (slot, (bounds, piece, root)) in built.into_iter().enumerate() {
                let child = part.append(piece, root);
                node.set(slot, &bounds, child);
            }
        } else {
            for (slot, set) in sets.into_iter().enumerate() {
                let bounds = set.bounds;
                let child = self.subtree(set.primitives, depth + 1, part);
                node.set(slot, &bounds, child);
            }
        }
        node.sort_octants();
        part.nodes[index] = node;
        ChildRef::node(index)
    }
}

/// Divides a set, always the part with the largest area, until there are eight parts or only leaves.
fn eight_children(set: Set, depth: usize) -> Vec<Set> {
    let mut sets = vec![set];
    while sets.len() < 8 {
        let open = sets.iter().enumerate().filter(|(_, s)| !s.is_leaf());
        // The first of the largest.
        let largest = open.reduce(|a, b| if b.1.bounds.half_area() > a.1.bounds.half_area() { b } else { a });
        let Some((i, _)) = largest else { break };
        let [a, b] = sets.swap_remove(i).divide(depth);
        sets.push(a);
        sets.push(b);
    }
    sets
}
