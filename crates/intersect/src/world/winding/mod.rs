//! The surfaces of a world, prepared for the computation of winding numbers.

mod tree;

use super::double::DWorld;
use super::{Geometry, GroupId, World};
use crate::geometry::PrimitiveSet;
use crate::mesh::{DTriangleMesh, TriangleMesh};
use crate::shape::winding::of_triangle;
use crate::shape::{Metric, Shape};
use rayon::prelude::*;
use snell_math::{DAffine3, DMat3, DVec3, Transform};
use std::sync::Arc;
use tree::{Moments, Tree, View};

/// A patch is approximated at distances greater than this many times its radius. (Barill et al.
/// 2018 use 2, with one more term of the expansion.)
pub(crate) const ACCURACY: f64 = 3.0;

/// Assumed bound on the error of the approximation: if the result differs from a half by less than
/// this, all triangles are summed exactly.
pub(crate) const DOUBT: f64 = 0.2;

/// All groups of a world, prepared for winding numbers.
#[derive(Debug)]
pub(crate) struct Winding {
    groups: Vec<Group>,
}

/// A group: a single numbering covers its triangles and then its objects.
#[derive(Debug, Default)]
struct Group {
    meshes: Vec<(u32, Triangles)>,
    triangles: u32,
    objects: Vec<Object>,
    /// Open or unbounded objects, which are never approximated.
    always: Vec<u32>,
    tree: Tree,
}

/// A mesh in single or double precision.
#[derive(Debug)]
enum Triangles {
    Single(Arc<TriangleMesh>),
    Double(Arc<DTriangleMesh>),
}

impl Triangles {
    fn len(&self) -> usize {
        match self {
            Self::Single(mesh) => mesh.indices.len(),
            Self::Double(mesh) => mesh.indices.len(),
        }
    }

    fn corners(&self, triangle: usize) -> [DVec3; 3] {
        match self {
            Self::Single(mesh) => mesh.corners(triangle).map(|c| c.as_dvec3()),
            Self::Double(mesh) => mesh.corners(triangle),
        }
    }
}

#[derive(Debug)]
enum Object {
    Shape(Arc<dyn Shape>, DAffine3),
    Instance(usize, DAffine3),
    Primitive(Arc<dyn PrimitiveSet>, u32),
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

    /// True if the winding number around a point is more than a half. Where the approximation is
    /// near a half, the exact sum decides.
    pub fn is_inside(&self, point: DVec3) -> bool {
        let fast = self.around(point, ACCURACY);
        let number =
            if (fast - 0.5).abs() < DOUBT { self.around(point, f64::INFINITY) } else { fast };
        number > 0.5
    }

    /// The winding number around a point; 0 if the point is not finite. Patches are approximated at
    /// distances greater than `accuracy` times their radius.
    pub fn around(&self, point: DVec3, accuracy: f64) -> f64 {
        if !point.is_finite() {
            return 0.0;
        }
        self.in_group(0, &View::new(point, DMat3::IDENTITY), accuracy)
    }

    fn in_group(&self, group: usize, view: &View, accuracy: f64) -> f64 {
        let group = &self.groups[group];
        let mut exact = |item: u32| match item.checked_sub(group.triangles) {
            None => {
                of_triangle(group.corners(item).map(|c| view.linear * (c - view.point)))
                    * view.orientation
            }
            Some(object) => self.around_object(&group.objects[object as usize], view, accuracy),
        };
        let always: f64 = group.always.iter().map(|&item| exact(item)).sum();
        always + group.tree.winding_number(view, accuracy, &mut exact)
    }

    fn around_object(&self, object: &Object, view: &View, accuracy: f64) -> f64 {
        let placed = |map: &DAffine3| {
            let point = map.transform_point3(view.point);
            point.is_finite().then(|| (point, view.linear * map.matrix3.inverse()))
        };
        let number = match object {
            Object::Primitive(set, primitive) => {
                Some(f64::from(set.contains(*primitive as usize, view.point)))
            }
            Object::Shape(shape, map) => {
                placed(map).map(|(point, linear)| shape.winding_number(point, &Metric::new(linear)))
            }
            Object::Instance(child, map) => placed(map)
                .map(|(point, linear)| self.in_group(*child, &View::new(point, linear), accuracy)),
        };
        number.unwrap_or(0.0)
    }
}

impl Group {
    fn of(world: &World, double: Option<&DWorld>, number: usize, groups: &[Self]) -> Self {
        let contents = world.group(GroupId(number as u32));
        let mut group = Self::default();
        let add = |group: &mut Self, mesh: Triangles| {
            let first = group.triangles;
            group.triangles += mesh.len() as u32;
            group.meshes.push((first, mesh));
        };
        let mut shapes: Vec<(Arc<dyn Shape>, Transform)> = Vec::new();
        let mut sets = Vec::new();
        for &id in &contents.geometries {
            match world.geometry(id) {
                Geometry::Mesh(mesh) => match double.and_then(|world| world.mesh(id)) {
                    Some(mesh) => add(&mut group, Triangles::Double(mesh.clone())),
                    None => add(&mut group, Triangles::Single(mesh.clone())),
                },
                Geometry::Quads(quads) => {
                    add(&mut group, Triangles::Single(quads.triangles().clone()))
                }
                Geometry::MovingMesh(mesh) => {
                    add(&mut group, Triangles::Single(mesh.first().clone()))
                }
                Geometry::Shape(shape, placed) => shapes.push((shape.clone(), *placed)),
                Geometry::Set(set) => sets.push(set.clone()),
            }
        }
        let mut items: Vec<(u32, Moments)> = (0..group.triangles)
            .into_par_iter()
            .map(|i| (i, Moments::of_triangle(group.corners(i))))
            .filter(|(_, m)| m.area > 0.0 && m.area.is_finite())
            .collect();
        for (shape, placed) in shapes {
            let item = group.triangles + group.objects.len() as u32;
            if shape.is_closed() && shape.bounds().is_finite() {
                items.push((item, Moments::of_closed(placed.bounds(&shape.bounds()))));
            } else {
                group.always.push(item);
            }
            group.objects.push(Object::Shape(shape, *placed.inverse_matrix()));
        }
        for instance in &contents.instances {
            let item = group.triangles + group.objects.len() as u32;
            let (child, map) = (instance.child.0 as usize, &instance.group_from_child);
            let below = &groups[child];
            // The tree holds both kinds of objects, so an exact sum needs only the tree.
            if !below.always.is_empty() {
                group.always.push(item);
            } else if let Some(moments) = below.tree.moments() {
                items.push((item, moments.placed(map)));
            }
            group.objects.push(Object::Instance(child, *map.inverse_matrix()));
        }
        for set in sets {
            for (primitive, bounds) in
                (0..set.len()).map(|i| (i, set.bounds(i))).filter(|(_, b)| !b.is_empty())
            {
                let item = group.triangles + group.objects.len() as u32;
                if bounds.is_finite() {
                    items.push((item, Moments::of_closed(bounds)));
                } else {
                    group.always.push(item);
                }
                group.objects.push(Object::Primitive(set.clone(), primitive as u32));
            }
        }
        group.tree = Tree::build(&items);
        group
    }

    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        let mesh = self.meshes.partition_point(|m| m.0 <= triangle).saturating_sub(1);
        let (first, mesh) = &self.meshes[mesh];
        mesh.corners((triangle - first) as usize)
    }
}
