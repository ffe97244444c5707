//! Lists: the contents of a small root group, prepared for tests without a tree.

pub(crate) mod faces;
mod outliers;
pub(crate) mod shape;

pub(crate) use outliers::Outliers;
pub(crate) use shape::ListShape;

use super::GroupTree;
use super::node::ChildRef;
use crate::exact::ray::wide;
use crate::group::Object;
use faces::{Faces, shapes};
use snell_math::{Bounds3, DVec3, Vec3};

/// The largest number of triangles in a list.
pub(crate) const MAX_TRIANGLES: usize = 64;

/// The largest number of shapes in a list.
pub(crate) const MAX_OBJECTS: usize = 8;
/// The least number of triangles for each shape of a list that is not tested in lanes.
const TRIANGLES_PER_OBJECT: usize = 2;

/// The first index in [`List::triangles`] that belongs to an object.
pub(crate) const FIRST_OBJECT: usize = 2 * MAX_TRIANGLES;

/// Length of [`List::triangles`], at least the number of triangles and objects. A power of two, so
/// that masked indices need no bounds check.
const NUMBERS: usize = 2 * FIRST_OBJECT;

/// Sizes for which nothing overflows or vanishes; groups of other sizes are left to the tree.
const SIZES: std::ops::RangeInclusive<f64> = 1e-9..=1e9;

/// The largest distance from the origin relative to the size. Groups farther away are left to the
/// tree, because there the accuracy of `f64` is not much better than that of `f32`.
const FARTHEST: f64 = 65536.0;

/// The contents of a small root group.
#[derive(Clone, Debug)]
pub(crate) struct List {
    /// The centre of the contents, relative to which positions are computed.
    pub(crate) center: Vec3,
    /// The largest distance of a vertex from the centre along an axis.
    pub(crate) reach: f32,
    /// Faces by the axis along which they are projected.
    pub(crate) faces: [Faces; 3],
    /// For each face, in their order, the triangle on the positive side of its diagonal and the
    /// triangle on the other side. From [`FIRST_OBJECT`] on, entries that identify the objects
    /// tested in lanes.
    pub(crate) triangles: [Triangle; NUMBERS],
    pub(crate) objects: Vec<ListObject>,
}

/// The data of a triangle that the exact computation of its hit needs.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Triangle {
    /// The nine coordinates of the corners; then the least product of the normal with a direction
    /// whose largest component is 1 for which the hit needs no clamping (see [`STEEPEST`]); then
    /// geometry and primitive as bits.
    pub numbers: [[f32; 8]; 2],
}

/// A shape or a primitive of a set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ListObject {
    /// The number of the object in the tree.
    pub number: usize,
    /// Bounds in the coordinates of the group; `None` if they are not known.
    pub bounds: Option<Bounds3>,
    /// The shape, if it is tested in lanes.
    pub shape: Option<ListShape>,
}

/// Inverse of the least slope at which a hit needs no clamping: the error of the projection is 8.5
/// units of `2^-24`, relative to the farthest vertex, so hits are within
/// [`crate::exact::triangle::PLACE_TOLERANCE`] up to an inverse slope of 98.
const STEEPEST: f64 = 64.0;

impl Triangle {
    const NONE: Self = Self { numbers: [[0.0; 8]; 2] };

    /// Data that only identifies the shape that is hit.
    fn of_shape(geometry: u32) -> Self {
        let mut numbers = Self::NONE.numbers;
        numbers[1][2] = f32::from_bits(geometry);
        Self { numbers }
    }

    fn new(corners: &Corners, (geometry, primitive): (u32, u32)) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = *corners;
        let steep = ((normal(corners).length() / STEEPEST) as f32).max(f32::MIN_POSITIVE);
        let ids = [f32::from_bits(geometry), f32::from_bits(primitive)];
        Self { numbers: [[a, b, c, d, e, f, g, h], [i, steep, ids[0], ids[1], 0.0, 0.0, 0.0, 0.0]] }
    }

    /// The numbers of the geometry and the primitive.
    #[inline(always)]
    pub fn ids(&self) -> (u32, u32) {
        (self.numbers[1][2].to_bits(), self.numbers[1][3].to_bits())
    }
}

pub(crate) type Corners = [[f32; 3]; 3];

/// The unnormalised normal of a triangle, computed as in the exact test.
pub(crate) fn normal(corners: &Corners) -> DVec3 {
    let [a, b, c] = corners.map(wide);
    (b - a).cross(c - a)
}

/// True if a shape may be tested in lanes.
pub(crate) fn is_for_lists(object: &Object) -> bool {
    ListShape::of(object).is_some()
}

/// The contents of a list to be made.
struct Primitives {
    /// Triangles with their numbers in the group.
    triangles: Vec<(u32, Corners)>,
    objects: Vec<ListObject>,
}

impl Primitives {
    /// True if there are no primitives.
    fn is_empty(&self) -> bool {
        self.triangles.is_empty() && self.objects.is_empty()
    }

    /// The unbounded objects of a group.
    fn unbounded_of(tree: &GroupTree) -> Self {
        let objects = tree
            .unbounded
            .iter()
            .map(|&number| ListObject::new(tree, number as usize, None))
            .collect();
        Self { triangles: Vec::new(), objects }
    }

    /// Adds the primitives of a leaf.
    fn add(&mut self, tree: &GroupTree, child: ChildRef, bounds: Option<Bounds3>) {
        if child == ChildRef::NONE || child.is_node() {
        } else if child.is_triangles() {
            for lane in 0..child.count() as usize {
                let (id, corners @ [a, b, c]) =
                    (tree.blocks.id(child.block(), lane), tree.blocks.corners(child.block(), lane));
                // Pieces of a triangle may be in several blocks. A triangle with two equal corners
                // cannot be hit.
                let is_known = self.triangles.iter().any(|(known, _)| *known == id);
                if !is_known && a != b && b != c && c != a {
                    self.triangles.push((id, corners));
                }
            }
        } else {
            self.objects.push(ListObject::new(tree, child.index(), bounds));
        }
    }
}

impl ListObject {
    fn new(tree: &GroupTree, number: usize, bounds: Option<Bounds3>) -> Self {
        Self { number, bounds, shape: tree.objects.placed().get(number).and_then(ListShape::of) }
    }
}

impl List {
    /// The list of a group; `None` if the group is not suitable for a list.
    pub fn of(tree: &GroupTree) -> Option<Box<Self>> {
        let is_instance = |object: &Object| matches!(object, Object::Instance { .. });
        if tree.objects.len() > MAX_OBJECTS
            || tree.blocks.count() > MAX_TRIANGLES
            || tree.objects.placed().iter().any(is_instance)
        {
            return None;
        }
        let mut found = Primitives::unbounded_of(tree);
        found.add(tree, tree.root, None);
        for node in tree.nodes.iter() {
            (0..8).for_each(|slot| {
                found.add(tree, node.children[slot], Some(node.slot_bounds(slot)))
            });
        }
        let slow = found.objects.iter().filter(|object| object.shape.is_none()).count();
        if found.is_empty() || found.triangles.len() < slow * TRIANGLES_PER_OBJECT {
            return None;
        }
        Self::new(tree, found, Bounds3::EMPTY)
    }

    /// The list of a group's unbounded objects and of the contents of some leaves, to be tested
    /// beside a tree with the bounds `rest`; `None` if they are not suitable for a list.
    pub(crate) fn of_leaves(
        tree: &GroupTree,
        leaves: &[(ChildRef, Bounds3)],
        rest: &Bounds3,
    ) -> Option<Box<Self>> {
        let mut found = Primitives::unbounded_of(tree);
        leaves.iter().for_each(|&(leaf, bounds)| found.add(tree, leaf, Some(bounds)));
        Self::new(tree, found, *rest)
    }

    /// The list of some primitives of a group; rays are also tested against the bounds `others`.
    fn new(tree: &GroupTree, found: Primitives, others: Bounds3) -> Option<Box<Self>> {
        let Primitives { triangles, objects } = found;
        if triangles.len() > MAX_TRIANGLES || objects.len() > MAX_OBJECTS {
            return None;
        }
        let corners = triangles.iter().flat_map(|(_, corners)| corners.map(Vec3::from_array));
        let mut all = Bounds3::of(corners).union(&others);
        objects
            .iter()
            .filter_map(|object| object.bounds)
            .for_each(|bounds| all = all.union(&bounds));
        let center = all.min * 0.5 + all.max * 0.5;
        let middle = center.as_dvec3();
        let reach = (all.max.as_dvec3() - middle).max(middle - all.min.as_dvec3()).max_element();
        let far = f64::from(center.abs().max_element());
        if !SIZES.contains(&reach) || !SIZES.contains(&far.max(1.0)) || far > reach * FARTHEST {
            return None;
        }
        let mut list = Box::new(Self {
            center,
            reach: (reach as f32).next_up(),
            faces: Default::default(),
            triangles: [Triangle::NONE; NUMBERS],
            objects,
        });
        let corners: Vec<Corners> = triangles.iter().map(|(_, corners)| *corners).collect();
        let mut shapes = shapes(&corners)?;
        shapes.sort_by_key(|shape| (shape.axis, shape.is_tilted));
        for (number, shape) in shapes.iter().enumerate() {
            let faces = &mut list.faces[shape.axis];
            let faces = if shape.is_tilted { &mut faces.tilted } else { &mut faces.across };
            faces.push(shape.face(middle));
            for (side, &of_side) in shape.triangles.iter().enumerate() {
                let (id, corners) = &triangles[of_side];
                list.triangles[2 * number + side] = Triangle::new(corners, tree.triangle(*id));
            }
        }
        for (shape, of_shape) in list.objects.iter().zip(&mut list.triangles[FIRST_OBJECT..]) {
            if let Some(shape) = &shape.shape {
                *of_shape = Triangle::of_shape(shape.geometry);
            }
        }
        Some(list)
    }

    /// The triangle (or object) with this index, which is given as the bits of a float.
    #[inline(always)]
    pub(crate) fn triangle(&self, bits: f32) -> &Triangle {
        &self.triangles[bits.to_bits() as usize % NUMBERS]
    }

    /// The number of faces.
    pub(crate) fn len(&self) -> usize {
        self.faces.iter().map(|faces| faces.across.len() + faces.tilted.len()).sum()
    }

    /// The geometries of everything that is tested in lanes, with repetitions.
    pub(crate) fn geometries(&self) -> impl Iterator<Item = u32> {
        let shapes = self.objects.iter().filter_map(|object| Some(object.shape.as_ref()?.geometry));
        self.triangles[..2 * self.len()].iter().map(|triangle| triangle.ids().0).chain(shapes)
    }
}
