//! Converts a binary tree to the 8-wide nodes and triangle blocks that kernels traverse. The nodes
//! and blocks of each part are counted first; then all threads write, each into its own range.
//!
//! Nodes and blocks are in preorder: those of a subtree are contiguous, and children come after
//! their parents.

use super::binary::{Cursor, PartCursor, Tree};
use super::primitive::{Numbered, OBJECT, Triangles};
use crate::tree::Blocks;
use crate::tree::block::TriangleBlock;
use crate::tree::compact::{Line, MAX_ID, SPARE_LINES, lines_of, pack};
use crate::tree::node::{ChildRef, WideNode};
use crate::tree::storage::Storage;
use rayon::prelude::*;
use snell_math::{Bounds3, Vec4};

/// The finished tree.
pub(crate) struct Wide {
    pub nodes: Storage<WideNode>,
    pub blocks: Blocks,
    pub root: ChildRef,
    /// Where the traversal of everything except outliers starts; see
    /// [`crate::tree::GroupTree::rest`].
    pub rest: ChildRef,
    /// The number of nodes on the longest path from the root.
    pub depth: usize,
}

/// Numbers of nodes and blocks, as counts or as the next indices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Place {
    nodes: usize,
    blocks: usize,
}

/// The output of one job.
enum Step<'t, P> {
    /// A wide node above the parts, with its children and the steps that write them.
    Node(Vec<(Cursor<'t, P>, usize)>),
    /// A subtree in one part.
    Piece(PartCursor<'t, P>),
}

/// Writes the tree. `written` are the blocks of its leaves, if the builder has already filled them.
pub(crate) fn write<P: Numbered>(
    tree: &Tree<'_, P>,
    triangles: &Triangles,
    written: Option<Storage<TriangleBlock>>,
) -> Result<Wide, String> {
    let mut steps = Vec::new();
    plan(tree.root(), &mut steps);
    let sizes: Vec<Place> = steps
        .par_iter()
        .map(|step| match step {
            Step::Node(_) => Place { nodes: 1, blocks: 0 },
            Step::Piece(cursor) => count(*cursor),
        })
        .collect();
    let mut end = Place::default();
    let places: Vec<Place> = sizes
        .iter()
        .map(|size| {
            let start = end;
            end = Place { nodes: end.nodes + size.nodes, blocks: end.blocks + size.blocks };
            start
        })
        .collect();
    if end.nodes > ChildRef::MAX_NODES || end.blocks > ChildRef::MAX_BLOCKS {
        return Err(format!(
            "a group needs {} nodes and {} blocks of triangles; the limits are {} and {}: spread \
                it over several groups",
            end.nodes,
            end.blocks,
            ChildRef::MAX_NODES,
            ChildRef::MAX_BLOCKS
        ));
    }
    let mut nodes = Storage::unset(end.nodes);
    let write_blocks = written.is_none();
    let mut blocks = written.unwrap_or_else(|| Storage::unset(end.blocks));
    let reference = |step: usize, cursor: Cursor<P>| match cursor.leaf() {
        None => ChildRef::node(places[step].nodes),
        Some(leaf) => leaf_reference(leaf, places[step].blocks),
    };
    let mut jobs = Vec::with_capacity(steps.len());
    let (mut nodes_left, mut blocks_left) = (&mut nodes[..], &mut blocks[..]);
    for ((step, size), place) in steps.iter().zip(&sizes).zip(&places) {
        let (nodes, others) = nodes_left.split_at_mut(size.nodes);
        nodes_left = others;
        let (blocks, others) = blocks_left.split_at_mut(size.blocks);
        blocks_left = others;
        jobs.push((
            step,
            Writer {
                triangles,
                write_blocks,
                nodes,
                blocks,
                start: *place,
                used: Place::default(),
            },
        ));
    }
    let run = |(step, mut writer): (&Step<P>, Writer)| match step {
        Step::Piece(cursor) => writer.subtree(*cursor).1,
        Step::Node(children) => {
            let mut node = WideNode::EMPTY;
            for (slot, (cursor, step)) in children.iter().enumerate() {
                node.set(slot, &cursor.bounds(), reference(*step, *cursor));
            }
            node.sort_octants();
            writer.nodes[0] = node;
            0
        }
    };
    let mut depths: Vec<usize> = jobs.into_par_iter().map(run).collect();
    for (i, step) in steps.iter().enumerate().rev() {
        if let Step::Node(children) = step {
            depths[i] = 1 + children.iter().map(|(_, step)| depths[*step]).max().unwrap_or(0);
        }
    }
    let root = reference(0, tree.root());
    let rest = if tree.is_beside() { nodes[root.index()].children[0] } else { root };
    Ok(Wide { root, rest, depth: depths[0], nodes, blocks: Blocks::Plain(blocks) })
}

/// Adds the steps of a subtree, in preorder. Returns the index of the first.
fn plan<'t, P>(cursor: Cursor<'t, P>, steps: &mut Vec<Step<'t, P>>) -> usize {
    let index = steps.len();
    if let Cursor::Part(part) = cursor {
        steps.push(Step::Piece(part));
        return index;
    }
    steps.push(Step::Node(Vec::new()));
    let children =
        cursor.wide_children().into_iter().map(|child| (child, plan(child, steps))).collect();
    steps[index] = Step::Node(children);
    index
}

/// The number of nodes and blocks of a subtree.
fn count<P: Numbered>(cursor: PartCursor<P>) -> Place {
    if let Some(leaf) = cursor.leaf() {
        return Place { nodes: 0, blocks: usize::from(leaf[0].id() & OBJECT == 0) };
    }
    cursor.wide_children().iter().map(count).fold(Place { nodes: 1, blocks: 0 }, |a, b| Place {
        nodes: a.nodes + b.nodes,
        blocks: a.blocks + b.blocks,
    })
}

fn leaf_reference<P: Numbered>(leaf: &[P], block: usize) -> ChildRef {
    let id = leaf[0].id();
    if id & OBJECT != 0 {
        ChildRef::object((id & !OBJECT) as usize)
    } else {
        ChildRef::triangles(block, leaf.len())
    }
}

/// Writes a subtree into its range of the tree.
struct Writer<'a> {
    triangles: &'a Triangles<'a>,
    write_blocks: bool,
    nodes: &'a mut [WideNode],
    blocks: &'a mut [TriangleBlock],
    /// The start of the range in the tree.
    start: Place,
    /// How much of the range is written.
    used: Place,
}

impl Writer<'_> {
    /// Writes a subtree. Returns the reference to it, and its depth.
    fn subtree<P: Numbered>(&mut self, cursor: PartCursor<P>) -> (ChildRef, usize) {
        if let Some(leaf) = cursor.leaf() {
            return (self.leaf(leaf), 0);
        }
        let index = self.used.nodes;
        self.used.nodes += 1;
        let mut node = WideNode::EMPTY;
        let mut depth = 0;
        for (slot, child) in cursor.wide_children().iter().enumerate() {
            let (reference, below) = self.subtree(child);
            node.set(slot, &child.bounds(), reference);
            depth = depth.max(below);
        }
        node.sort_octants();
        self.nodes[index] = node;
        (ChildRef::node(self.start.nodes + index), depth + 1)
    }

    fn leaf<P: Numbered>(&mut self, leaf: &[P]) -> ChildRef {
        let reference = leaf_reference(leaf, self.start.blocks + self.used.blocks);
        if reference.is_triangles() {
            if self.write_blocks {
                fill(&mut self.blocks[self.used.blocks], leaf, self.triangles);
            }
            self.used.blocks += 1;
        }
        reference
    }
}

/// Fills the block of a leaf. Returns the box around the block.
#[inline]
pub(crate) fn fill<P: Numbered>(
    block: &mut TriangleBlock,
    leaf: &[P],
    triangles: &Triangles,
) -> Bounds3 {
    let mut corners = [[Vec4::ZERO; 8]; 3];
    let mut ids = TriangleBlock::EMPTY.ids;
    for (lane, p) in leaf.iter().take(8).enumerate() {
        let [a, b, c] = triangles.corners(p.id()).map(|v| v.extend(0.0));
        (corners[0][lane], corners[1][lane], corners[2][lane]) = (a, b, c);
        ids[lane] = p.id();
    }
    block.set_all(&corners, ids);
    block.padded_bounds(leaf.len())
}

/// The number of blocks that a thread packs at a time.
const PIECE: usize = 1 << 10;

impl Wide {
    /// Converts the tree to compact blocks. Returns an error if there are too many triangles for
    /// them.
    pub fn compact(self, triangles: usize) -> Result<Self, String> {
        let Blocks::Plain(blocks) = &self.blocks else { return Ok(self) };
        let counts: Vec<u8> = blocks.par_iter().map(|block| lines_of(block) as u8).collect();
        let mut end = 0;
        let starts: Vec<usize> = counts
            .iter()
            .map(|&count| {
                let start = end;
                end += usize::from(count);
                start
            })
            .collect();
        if end > ChildRef::MAX_BLOCKS || triangles > MAX_ID as usize {
            return Err(format!(
                "a compact group needs {end} lines of memory for {triangles} triangles; the limits \
                    are {} and {MAX_ID}: spread it over several groups, or build it without \
                    `compact`",
                ChildRef::MAX_BLOCKS
            ));
        }
        let mut lines = Storage::unset(if end == 0 { 0 } else { end + SPARE_LINES });
        let mut pieces = Vec::new();
        let mut rest = &mut lines[..];
        for (blocks, counts) in blocks.chunks(PIECE).zip(counts.chunks(PIECE)) {
            let (own, others) =
                rest.split_at_mut(counts.iter().map(|&count| usize::from(count)).sum());
            rest = others;
            pieces.push((blocks, counts, own));
        }
        rest.fill(Line([0; 16]));
        pieces.into_par_iter().for_each(|(blocks, counts, mut own)| {
            for (block, &count) in blocks.iter().zip(counts) {
                let (record, others) = own.split_at_mut(count.into());
                let fits = pack(block, record);
                debug_assert!(fits);
                own = others;
            }
        });
        let moved = |child: ChildRef| {
            if child.is_triangles() {
                ChildRef::triangles(starts[child.block()], child.count() as usize)
            } else {
                child
            }
        };
        let mut nodes = self.nodes;
        nodes.par_iter_mut().for_each(|node| node.children = node.children.map(moved));
        Ok(Self {
            root: moved(self.root),
            rest: moved(self.rest),
            depth: self.depth,
            nodes,
            blocks: Blocks::Compact(lines, counts.len()),
        })
    }
}
