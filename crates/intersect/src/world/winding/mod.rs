//! The surfaces of a world, prepared for questions about inside and outside.

mod bodies;
mod boxes;
mod crossings;
pub(crate) mod sign;
mod solid;
mod tree;

use super::double::DWorld;
use super::{Geometry, GroupId, World};
use crate::geometry::PrimitiveSet;
use crate::mesh::{DTriangleMesh, TriangleMesh};
use crate::search::GeometryOptions;
use crate::shape::{Metric, Shape};
use boxes::Boxes;
use rayon::prelude::*;
use snell_math::{Bounds3d, DAffine3, DVec3, Transform};
use solid::Solid;
use std::cell::Cell;
use std::sync::Arc;
use tree::{Moments, Tree, View};

/// A patch is approximated at distances greater than this many times its radius. (Barill et al.
/// 2018 use 2, with one more term of the expansion.)
pub(crate) const ACCURACY: f64 = 3.0;

/// For decisions whether a winding number is more than a half: accuracies, each with an assumed
/// bound on the error of the approximation. If the number differs from a half by less, the next
/// accuracy decides.
pub(crate) const ACCURACIES: [(f64, f64); 2] = [(ACCURACY, 0.02), (9.0, 0.0)];

/// Where a point is with respect to everything that has an inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Outside,
    Inside,
    /// Exactly on the surface of something that has an inside.
    OnSurface,
}

/// All groups of a world, prepared for points.
#[derive(Debug)]
pub(crate) struct Winding {
    groups: Vec<Group>,
}

/// A group.
#[derive(Debug, Default)]
struct Group {
    objects: Vec<Object>,
    /// Objects without moments, which are never approximated: open or unbounded shapes, and
    /// instances that have some.
    always: Vec<u32>,
    tree: Tree,
    /// The bits that the masks of all objects have in common.
    mask: u64,
    /// Bounds of everything that a point can be inside.
    inside: Bounds3d,
    /// The boxes of objects that have an inside, and the number of each object.
    boxes: Boxes,
    with_inside: Vec<u32>,
}

/// A mesh in single or double precision.
#[derive(Debug)]
enum Triangles {
    Single(Arc<TriangleMesh>),
    Double(Arc<DTriangleMesh>),
}

impl Triangles {
    fn indices(&self) -> &[[u32; 3]] {
        match self {
            Self::Single(mesh) => &mesh.indices,
            Self::Double(mesh) => &mesh.indices,
        }
    }

    fn len(&self) -> usize {
        self.indices().len()
    }

    fn vertex_count(&self) -> usize {
        match self {
            Self::Single(mesh) => mesh.positions.len(),
            Self::Double(mesh) => mesh.positions.len(),
        }
    }

    fn position(&self, vertex: usize) -> DVec3 {
        match self {
            Self::Single(mesh) => mesh.positions[vertex].as_dvec3(),
            Self::Double(mesh) => mesh.positions[vertex],
        }
    }

    fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.indices()[triangle].map(|i| self.position(i as usize))
    }
}

/// Something in a group; the number is that of its geometry.
#[derive(Debug)]
enum Object {
    Mesh(u32, Arc<Solid>),
    Shape(u32, Arc<dyn Shape>, DAffine3),
    Primitive(u32, Arc<dyn PrimitiveSet>, u32),
    /// An instance of a group, with its mask.
    Instance(usize, DAffine3, u64),
}

/// What is asked about a point.
struct Question<'a> {
    options: &'a [GeometryOptions],
    mask: u64,
    accuracy: f64,
    /// Set if the point is found to be on a surface.
    is_on_surface: Cell<bool>,
}

impl Question<'_> {
    fn admits(&self, geometry: u32) -> bool {
        self.options[geometry as usize].mask & self.mask != 0
    }
}

impl Winding {
    /// Prepares a world, with the meshes of `double` if it is given.
    pub fn of(world: &World, double: Option<&DWorld>) -> Self {
        let mut groups: Vec<Group> = (0..world.group_count()).map(|_| Group::default()).collect();
        for group in world.children_first() {
            groups[group] = Group::of(world, double, group, &groups);
        }
        Self { groups }
    }

    /// Where a point is among the geometries and instances that share a bit with the mask; outside
    /// if it is not finite. Each geometry is asked by itself.
    pub fn side(&self, options: &[GeometryOptions], point: DVec3, mask: u64) -> Side {
        if !point.is_finite() {
            return Side::Outside;
        }
        let is_on_surface = Cell::new(false);
        self.side_in_group(0, &Question { options, mask, accuracy: ACCURACY, is_on_surface }, point)
    }

    fn side_in_group(&self, group: usize, question: &Question, point: DVec3) -> Side {
        let group = &self.groups[group];
        let mut side = Side::Outside;
        group.boxes.around(point, |item| {
            side = match &group.objects[group.with_inside[item as usize] as usize] {
                Object::Mesh(geometry, _)
                | Object::Shape(geometry, ..)
                | Object::Primitive(geometry, ..)
                    if !question.admits(*geometry) =>
                {
                    Side::Outside
                }
                Object::Mesh(_, solid) => solid.side(point),
                Object::Shape(_, shape, map) => {
                    of_solid(shape.contains(map.transform_point3(point)))
                }
                Object::Primitive(_, set, primitive) => {
                    of_solid(set.contains(*primitive as usize, point))
                }
                Object::Instance(child, map, mask) => {
                    let inner = map.transform_point3(point);
                    if mask & question.mask != 0 && inner.is_finite() {
                        self.side_in_group(*child, question, inner)
                    } else {
                        Side::Outside
                    }
                }
            };
            side != Side::Outside
        });
        side
    }

    /// True if the winding number of all surfaces around a point is more than a half, or the point
    /// is on one of them. Where the approximation is near a half, a better one decides.
    pub fn exceeds_half(&self, options: &[GeometryOptions], point: DVec3, mask: u64) -> bool {
        for (accuracy, doubt) in ACCURACIES {
            let (number, is_on_surface) = self.winding(options, point, mask, accuracy);
            if is_on_surface {
                return true;
            }
            if (number - 0.5).abs() >= doubt {
                return number > 0.5;
            }
        }
        false
    }

    /// The winding number around a point; 0 if the point is not finite. Patches are approximated at
    /// distances greater than `accuracy` times their radius.
    pub fn around(
        &self,
        options: &[GeometryOptions],
        point: DVec3,
        mask: u64,
        accuracy: f64,
    ) -> f64 {
        self.winding(options, point, mask, accuracy).0
    }

    /// The winding number around a point, and whether the point is on a mesh.
    fn winding(
        &self,
        options: &[GeometryOptions],
        point: DVec3,
        mask: u64,
        accuracy: f64,
    ) -> (f64, bool) {
        if !point.is_finite() {
            return (0.0, false);
        }
        let question = Question { options, mask, accuracy, is_on_surface: Cell::new(false) };
        let number = self.in_group(0, &View::world(point), &question);
        (number, question.is_on_surface.get())
    }

    fn in_group(&self, group: usize, view: &View, question: &Question) -> f64 {
        let group = &self.groups[group];
        let mut exact =
            |item: u32| self.around_object(&group.objects[item as usize], view, question);
        let always: f64 = group.always.iter().map(|&item| exact(item)).sum();
        always + group.tree.winding_number(view, question.accuracy, question.mask, &mut exact)
    }

    fn around_object(&self, object: &Object, view: &View, question: &Question) -> f64 {
        let placed = |map: &DAffine3| {
            let point = map.transform_point3(view.point);
            point.is_finite().then(|| (point, view.linear * map.matrix3.inverse()))
        };
        let number = match object {
            Object::Mesh(geometry, _)
            | Object::Shape(geometry, ..)
            | Object::Primitive(geometry, ..)
                if !question.admits(*geometry) =>
            {
                None
            }
            Object::Mesh(_, solid) => {
                Some(solid.winding_number(view, question.accuracy, &question.is_on_surface))
            }
            Object::Primitive(_, set, primitive) => {
                Some(f64::from(set.contains(*primitive as usize, view.point)))
            }
            Object::Shape(_, shape, map) if shape.is_closed() => {
                Some(f64::from(shape.contains(map.transform_point3(view.point))))
            }
            Object::Shape(_, shape, map) => {
                placed(map).map(|(point, linear)| shape.winding_number(point, &Metric::new(linear)))
            }
            Object::Instance(_, _, mask) if mask & question.mask == 0 => None,
            Object::Instance(child, map, _) => placed(map)
                .map(|(point, linear)| self.in_group(*child, &View::new(point, linear), question)),
        };
        number.unwrap_or(0.0)
    }
}

/// The side of a solid that contains a point or not.
fn of_solid(contains: bool) -> Side {
    if contains { Side::Inside } else { Side::Outside }
}

/// An object of a group with what its group must know of it.
struct Entry {
    object: Object,
    /// The moments; `None` if it must not be approximated.
    moments: Option<Moments>,
    /// The bounds of what a point can be inside.
    inside: Bounds3d,
    /// The bits that the masks of all that is in the object have in common.
    mask: u64,
}

impl Group {
    fn of(world: &World, double: Option<&DWorld>, number: usize, groups: &[Self]) -> Self {
        let contents = world.group(GroupId(number as u32));
        let mut entries: Vec<Entry> = Vec::new();
        for &id in &contents.geometries {
            let mask = world.options[id.0 as usize].mask;
            let mesh = |mesh: Triangles| Entry::of_mesh(id.0, mesh, mask);
            match world.geometry(id) {
                Geometry::Mesh(single) => {
                    entries.extend(mesh(match double.and_then(|world| world.mesh(id)) {
                        Some(double) => Triangles::Double(double.clone()),
                        None => Triangles::Single(single.clone()),
                    }))
                }
                Geometry::Quads(quads) => {
                    entries.extend(mesh(Triangles::Single(quads.triangles().clone())));
                }
                Geometry::MovingMesh(moving) => {
                    entries.extend(mesh(Triangles::Single(moving.first().clone())));
                }
                Geometry::Shape(shape, placed) => {
                    entries.push(Entry::of_shape(id.0, shape.clone(), placed, mask));
                }
                // A sheet has no inside.
                Geometry::Heightfield(_) => {}
                Geometry::Set(set) => {
                    let primitive = |i: usize| Entry::of_primitive(id.0, set, i, mask);
                    entries.par_extend((0..set.len()).into_par_iter().filter_map(primitive));
                }
            }
        }
        for instance in &contents.instances {
            let (child, map) = (instance.child.0 as usize, &instance.group_from_child);
            let below = &groups[child];
            let is_empty = below.objects.is_empty();
            let moments = below.tree.moments().filter(|_| below.always.is_empty());
            let inside = &below.inside;
            entries.extend((!is_empty).then(|| Entry {
                object: Object::Instance(child, *map.inverse_matrix(), instance.mask),
                moments: moments.map(|moments| moments.placed(map)),
                inside: if inside.is_empty() { *inside } else { grown(&map.bounds(inside)) },
                mask: instance.mask & below.mask,
            }));
        }
        Self::of_entries(entries)
    }

    fn of_entries(entries: Vec<Entry>) -> Self {
        let mut group = Self { inside: Bounds3d::EMPTY, ..Self::default() };
        let numbered = || (0..).zip(&entries);
        group.always = numbered().filter(|(_, e)| e.moments.is_none()).map(|(i, _)| i).collect();
        let items: Vec<(u32, Moments)> =
            numbered().filter_map(|(i, e)| Some((i, e.moments?))).collect();
        group.tree = Tree::build(&items, |i| entries[i as usize].mask);
        group.mask = entries.iter().fold(u64::MAX, |all, e| all & e.mask);
        let (inside, boxes): (Vec<u32>, Vec<Bounds3d>) =
            numbered().filter(|(_, e)| !e.inside.is_empty()).map(|(i, e)| (i, e.inside)).unzip();
        group.inside = boxes.iter().fold(Bounds3d::EMPTY, |all, b| all.union(b));
        let (tree, order) = Boxes::build(&boxes);
        group.with_inside = order.iter().map(|&i| inside[i as usize]).collect();
        group.boxes = tree;
        group.objects = entries.into_iter().map(|e| e.object).collect();
        group
    }
}

/// A box that is larger by more than the rounding of a point that is mapped into it.
fn grown(bounds: &Bounds3d) -> Bounds3d {
    let margin = (bounds.min.abs().max(bounds.max.abs()) + bounds.size()) * 1e-12;
    Bounds3d { min: bounds.min - margin, max: bounds.max + margin }
}

impl Entry {
    fn of_mesh(geometry: u32, mesh: Triangles, mask: u64) -> Option<Self> {
        if mesh.len() == 0 {
            return None;
        }
        let solid = Solid::of(mesh);
        let (moments, inside) = (Some(solid.moments()), *solid.inside());
        Some(Self { object: Object::Mesh(geometry, Arc::new(solid)), moments, inside, mask })
    }

    fn of_shape(geometry: u32, shape: Arc<dyn Shape>, placed: &Transform, mask: u64) -> Self {
        let bounds = shape.bounds();
        let in_group = placed.bounds(&bounds);
        let is_solid = shape.is_closed();
        let moments =
            (is_solid && bounds.is_finite()).then(|| Moments::of_closed(grown(&in_group)));
        let inside = if is_solid { grown(&in_group) } else { Bounds3d::EMPTY };
        let object = Object::Shape(geometry, shape, *placed.inverse_matrix());
        Self { object, moments, inside, mask }
    }

    fn of_primitive(
        geometry: u32,
        set: &Arc<dyn PrimitiveSet>,
        primitive: usize,
        mask: u64,
    ) -> Option<Self> {
        let bounds = set.bounds(primitive);
        (!bounds.is_empty()).then(|| Self {
            object: Object::Primitive(geometry, set.clone(), primitive as u32),
            moments: bounds.is_finite().then(|| Moments::of_closed(bounds)),
            inside: bounds,
            mask,
        })
    }
}
