//! Triangles of which two corners are at one position. No ray hits them, so they are not in the
//! trees; but they have a distance, like triangles whose three corners lie on a line.
//!
//! Nearly all of them lie on an edge of a sound triangle of their mesh, which has the same distance
//! and stands for them. The others are found here, in a tree that is built at the first query.

use super::double::DWorld;
use super::{Geometry, GroupId, World};
use snell_math::{Bounds3d, DVec3};
use std::collections::HashSet;

/// The largest number of triangles in a leaf.
const LEAF: usize = 4;

/// The loose triangles of a group.
#[derive(Debug, Default)]
pub(crate) struct Loose {
    triangles: Vec<Triangle>,
    /// The nodes; the first child of an inner node follows it directly.
    nodes: Vec<Node>,
}

/// A loose triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// The number of its mesh.
    pub geometry: u32,
    /// Its number in the mesh.
    pub number: u32,
    /// Its corners in the coordinates of the group.
    pub corners: [DVec3; 3],
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds3d,
    first: u32,
    count: u32,
    /// The second child; 0 for a leaf.
    second: u32,
}

/// The two ends of an edge, in an order that does not depend on its direction.
type Edge = [[u64; 3]; 2];

fn edge(a: DVec3, b: DVec3) -> Edge {
    // Both signs of zero are one position.
    let key = |p: DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
    let (a, b) = (key(a), key(b));
    if a < b { [a, b] } else { [b, a] }
}

/// The edges of a triangle, and its corners as edges without length.
fn edges([a, b, c]: [DVec3; 3]) -> [Edge; 6] {
    [edge(a, b), edge(b, c), edge(c, a), edge(a, a), edge(b, b), edge(c, c)]
}

/// The edge on which a triangle with two equal corners lies.
fn line([a, b, c]: [DVec3; 3]) -> Edge {
    if a == b { edge(b, c) } else { edge(a, b) }
}

impl Loose {
    /// The loose triangles of each group, with the meshes of `double` if it is given; empty if no
    /// triangle was skipped in the build.
    pub fn of(world: &World, double: Option<&DWorld>) -> Vec<Self> {
        if world.stats().skipped_triangles == 0 {
            return Vec::new();
        }
        let of_group = |group: usize| {
            let mut triangles = Vec::new();
            for &id in &world.group(GroupId(group as u32)).geometries {
                let mut add = |count: usize, corners: &dyn Fn(usize) -> [DVec3; 3]| {
                    add_loose(&mut triangles, id.0, count, corners);
                };
                let single = match world.geometry(id) {
                    Geometry::Mesh(mesh) => mesh,
                    Geometry::Quads(quads) => quads.triangles(),
                    _ => continue,
                };
                match double.and_then(|world| world.mesh(id)) {
                    Some(mesh) => add(mesh.indices.len(), &|i| mesh.corners(i)),
                    None => add(single.indices.len(), &|i| single.corners(i).map(|c| c.as_dvec3())),
                }
            }
            let mut this = Self { triangles, nodes: Vec::new() };
            if !this.triangles.is_empty() {
                this.build(0, this.triangles.len());
            }
            this
        };
        (0..world.group_count()).map(of_group).collect()
    }

    /// Calls `each` for the triangles in boxes for which `wants` is true.
    pub fn visit<S>(
        &self,
        state: &mut S,
        wants: impl Fn(&S, &Bounds3d) -> bool,
        each: impl Fn(&mut S, &Triangle),
    ) {
        let mut stack: Vec<u32> = (0..self.nodes.len().min(1) as u32).collect();
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !wants(state, &node.bounds) {
                continue;
            }
            if node.second != 0 {
                stack.extend([node.second, index + 1]);
                continue;
            }
            let (first, end) = (node.first as usize, (node.first + node.count) as usize);
            self.triangles[first..end].iter().for_each(|triangle| each(state, triangle));
        }
    }

    /// Builds the nodes of a range of triangles.
    fn build(&mut self, first: usize, end: usize) {
        let part = &mut self.triangles[first..end];
        let bounds =
            part.iter().fold(Bounds3d::EMPTY, |all, t| all.union(&Bounds3d::of(t.corners)));
        let node = self.nodes.len();
        let count = (end - first) as u32;
        self.nodes.push(Node { bounds, first: first as u32, count, second: 0 });
        if part.len() <= LEAF {
            return;
        }
        let axis = bounds.size().max_position();
        let middle = part.len() / 2;
        let by_center = |a: &Triangle, b: &Triangle| {
            let center = |t: &Triangle| t.corners[0][axis] + t.corners[1][axis];
            let key = |t: &Triangle| (t.geometry, t.number);
            center(a).total_cmp(&center(b)).then_with(|| key(a).cmp(&key(b)))
        };
        part.select_nth_unstable_by(middle, by_center);
        self.build(first, first + middle);
        self.nodes[node].second = self.nodes.len() as u32;
        self.build(first + middle, end);
    }
}

/// Adds the triangles of a mesh that are flat and do not lie on an edge of a sound one.
fn add_loose(
    triangles: &mut Vec<Triangle>,
    geometry: u32,
    count: usize,
    corners: &dyn Fn(usize) -> [DVec3; 3],
) {
    let is_flat = |[a, b, c]: [DVec3; 3]| a == b || b == c || c == a;
    let is_finite = |i: &usize| corners(*i).iter().all(|p| p.is_finite());
    let (flat, sound): (Vec<usize>, Vec<usize>) =
        (0..count).filter(is_finite).partition(|&i| is_flat(corners(i)));
    if flat.is_empty() {
        return;
    }
    let mut lines: HashSet<Edge> = flat.iter().map(|&i| line(corners(i))).collect();
    for i in sound {
        for edge in edges(corners(i)) {
            lines.remove(&edge);
        }
    }
    let loose = flat.into_iter().filter(|&i| lines.contains(&line(corners(i))));
    triangles.extend(loose.map(|i| Triangle { geometry, number: i as u32, corners: corners(i) }));
}
