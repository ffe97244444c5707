//! What a list holds, ready to be tested.

use crate::accel::bvh::GroupTree;
use crate::accel::group::Object;
use crate::kernel::node::ChildRef;
use crate::kernel::ray::wide;
use snell_math::{Bounds3, DVec3, Vec3};

/// Most triangles of a list.
pub(super) const MAX_TRIANGLES: usize = 64;

/// Most shapes of a list, and least triangles for each of them: shapes gain nothing here.
const MAX_OBJECTS: usize = 2;
const TRIANGLES_PER_OBJECT: usize = 8;

/// Triangles smaller than this, relative to the whole list, count as this large where errors are bounded.
const LEAST_SIZE: f64 = 1.0 / 16384.0;

/// Lists of extraordinary size are left to the tree: nothing may overflow or vanish.
const SIZES: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// The contents of a small root group.
#[derive(Clone, Debug)]
pub(crate) struct List {
    /// The middle: edges are lines seen from here.
    pub(super) center: Vec3,
    /// Around all but what is unbounded.
    pub(super) bounds: Bounds3,
    /// No vertex is farther from the centre along any axis.
    pub(super) reach: f32,
    /// What each triangle needs at first, in three arrays by how often they are used.
    pub(super) edges: Vec<EdgeLines>,
    pub(super) planes: Vec<Plane>,
    pub(super) triangles: Vec<Triangle>,
    pub(super) objects: Vec<ListObject>,
}

/// The lines of the edges of a triangle: the moments, then the directions (Plücker coordinates), by axis and edge, divided by the size of the
/// triangle.
pub(super) type EdgeLines = [[f32; 3]; 6];

/// The plane of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    /// As the exact test has it.
    pub normal: DVec3,
    /// The first vertex.
    pub corner: DVec3,
    /// Times the size of a direction: the least product with the normal for the distance to be of use.
    pub steep: f64,
}

/// A vector as `x y z x y`, so that it can be read from any axis on, and one number more.
pub(super) type Row = [f64; 6];

pub(super) fn row(v: DVec3) -> Row {
    [v.x, v.y, v.z, v.x, v.y, 0.0]
}

/// What the exact test wants to know.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub rows: [Row; 3],
    pub corners: [[f32; 3]; 3],
    /// Geometry and primitive.
    pub ids: (u32, u32),
}

/// A shape or a primitive of a set.
#[derive(Clone, Copy, Debug)]
pub(super) struct ListObject {
    /// As the tree numbers it.
    pub number: usize,
    /// In the coordinates of the group, if it is known.
    pub bounds: Option<Bounds3>,
}

impl List {
    /// The list of a group; `None` if it is not for lists.
    pub fn of(tree: &GroupTree) -> Option<Self> {
        let is_instance = |object: &Object| matches!(object, Object::Instance { .. });
        if tree.objects.len() > MAX_OBJECTS
            || tree.blocks.len() > MAX_TRIANGLES
            || tree.objects.placed().iter().any(is_instance)
        {
            return None;
        }
        let mut objects: Vec<ListObject> =
            tree.unbounded.iter().map(|&number| ListObject { number: number as usize, bounds: None }).collect();
        let mut triangles: Vec<(u32, [[f32; 3]; 3])> = Vec::new();
        let mut add = |child: ChildRef, bounds: Option<Bounds3>| {
            if child == ChildRef::NONE || child.is_node() {
            } else if child.is_triangles() {
                let block = &tree.blocks[child.block()];
                for lane in 0..child.count() as usize {
                    let corners = block.corners(lane);
                    // Pieces of a triangle are in several blocks; those in one point can not be hit.
                    let is_known = triangles.iter().any(|(id, _)| *id == block.ids[lane]);
                    if !is_known && (corners[0] != corners[1] || corners[0] != corners[2]) {
                        triangles.push((block.ids[lane], corners));
                    }
                }
            } else {
                objects.push(ListObject { number: child.index(), bounds });
            }
        };
        add(tree.root, None);
        for node in tree.nodes.iter() {
            (0..8).for_each(|slot| add(node.children[slot], Some(node.slot_bounds(slot))));
        }
        if triangles.len() > MAX_TRIANGLES || triangles.len() < objects.len() * TRIANGLES_PER_OBJECT {
            return None;
        }
        let mut all = Bounds3::EMPTY;
        for (_, corners) in &triangles {
            corners.iter().for_each(|&corner| all = all.union(&Bounds3 { min: corner.into(), max: corner.into() }));
        }
        objects.iter().filter_map(|object| object.bounds).for_each(|bounds| all = all.union(&bounds));
        let center = all.min * 0.5 + all.max * 0.5;
        let middle = center.as_dvec3();
        let reach = (all.max.as_dvec3() - middle).max(middle - all.min.as_dvec3()).max_element();
        if !SIZES.contains(&reach) || !SIZES.contains(&center.abs().max_element().max(1.0).into()) {
            return None;
        }
        let mut list = Self {
            center,
            bounds: all,
            reach: (reach as f32).next_up(),
            edges: Vec::new(),
            planes: Vec::new(),
            triangles: Vec::new(),
            objects,
        };
        for (id, corners) in triangles {
            list.push(&corners, middle, reach * LEAST_SIZE);
            let rows = corners.map(|corner| row(wide(corner)));
            list.triangles.push(Triangle { rows, corners, ids: tree.triangle(id) });
        }
        Some(list)
    }

    /// Works out edges and plane of a triangle.
    fn push(&mut self, corners: &[[f32; 3]; 3], center: DVec3, least: f64) {
        let [a, b, c] = corners.map(wide);
        let sides = [c - b, a - c, b - a];
        let size = sides.map(|side| side.abs().max_element()).into_iter().fold(least, f64::max);
        let mut lines = [[0.0; 3]; 6];
        for (i, (start, side)) in [b, c, a].into_iter().zip(sides).enumerate() {
            let moment = (start - center).cross(side) / size;
            let direction = side / size;
            for axis in 0..3 {
                (lines[axis][i], lines[axis + 3][i]) = (moment[axis] as f32, direction[axis] as f32);
            }
        }
        self.edges.push(lines);
        // In the order of `plane_distance`.
        let normal = (b - a).cross(c - a);
        let largest = normal.abs().max_element();
        // The normal of a sliver is not well known: it is never steep.
        let is_known = largest > size * size / f64::from(1 << 20);
        let steep = if is_known { largest * super::MIN_SLOPE } else { f64::INFINITY };
        self.planes.push(Plane { normal, corner: a, steep });
    }

    pub(super) fn has_objects(&self) -> bool {
        !self.objects.is_empty()
    }
}
