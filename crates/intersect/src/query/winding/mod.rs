//! Inside or outside: winding numbers, occupancy and signed distances, right for open meshes and
//! soups too.
//!
//! The generalised winding number of a point (Jacobson, Kavan and Sorkine-Hornung 2013) is the
//! signed solid angle of all surfaces seen from it, over `4 pi`: 1 inside a closed surface, 0
//! outside, 2 inside of two. Around open surfaces it passes smoothly between, and a half is the
//! natural border. Outer sides are those of normals (right-hand rule for triangles), also under
//! mirroring instances; a closed mesh turned inside out counts -1, so that one inside another is a
//! cavity.

#[cfg(test)]
mod tests;
mod tree;

use super::nearest::{DNearestPoint, NearestPoint, Points, Space};
use crate::geometry::PrimitiveSet;
use crate::mesh::{DTriangleMesh, TriangleMesh};
use crate::precision::{Double, Precision};
use crate::shape::winding::of_triangle;
use crate::shape::{Metric, Shape};
use crate::world::double::DWorld;
use crate::world::{Geometry, World};
use rayon::prelude::*;
use snell_math::{DAffine3, DMat3, DVec3, Transform, Vec3};
use std::sync::Arc;
use tree::{Moments, Tree, View};

/// A patch counts as far away beyond this many times its radius. (The paper has 2, with one more
/// term.)
const ACCURACY: f64 = 3.0;

/// The largest error of the approximation that is reckoned with: nearer to a half than this,
/// everything is summed up.
const DOUBT: f64 = 0.2;

impl World {
    /// The generalised winding number of all surfaces around each point; 0 for points that are not
    /// finite.
    ///
    /// Far-away triangles are seen as one in groups (Barill et al. 2018), which costs up to some
    /// hundredths next to large open surfaces and much less elsewhere;
    /// [`Self::winding_number_exact`] sums up all of them. Closed analytic shapes count exactly, 1
    /// inside and 0 outside, however they are placed. The same holds for each sphere and curve
    /// segment of sets. Masks are not asked.
    ///
    /// The first call prepares a tree, kept with the world: some 40 bytes a triangle.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn winding_number(&self, points: &[Vec3], numbers: &mut [f64]) {
        assert_eq!(points.len(), numbers.len(), "one answer per point");
        let winding = self.winding();
        points
            .iter()
            .zip(numbers)
            .for_each(|(&point, number)| *number = winding.around(point.as_dvec3(), ACCURACY));
    }

    /// [`Self::winding_number`] of a point in double precision, which is not rounded.
    pub fn winding_number_at(&self, point: DVec3) -> f64 {
        self.winding().around(point, ACCURACY)
    }

    /// [`Self::occupancy`] of a point in double precision, which is not rounded.
    pub fn is_inside(&self, point: DVec3) -> bool {
        self.winding().is_inside(point)
    }

    /// The generalised winding number without approximations: as long as there are triangles, to
    /// rounding.
    pub fn winding_number_exact(&self, point: Vec3) -> f64 {
        self.winding().around(point.as_dvec3(), f64::INFINITY)
    }

    /// For each point whether it is inside: its winding number is more than a half. Where the
    /// approximation of [`Self::winding_number`] is near a half, it is not used. Points that are
    /// not finite are outside.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occupancy(&self, points: &[Vec3], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer per point");
        let winding = self.winding();
        points
            .iter()
            .zip(inside)
            .for_each(|(&point, inside)| *inside = winding.is_inside(point.as_dvec3()));
    }

    /// The distance of each point to the nearest surface, in world units, negative inside
    /// ([`Self::occupancy`]); 0 on a surface, `max_distance` with the right sign where no surface
    /// is as near, infinite in an empty world and for points that are not finite. The mask of the
    /// points chooses what distances are taken to; the sign comes from everything.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn signed_distance<'a>(&self, points: impl Into<Points<'a>>, distances: &mut [f32]) {
        let points = points.into();
        let mut nearest = vec![NearestPoint::NONE; points.len()];
        self.nearest_point(points, &mut nearest);
        let found = nearest.iter().map(|near| near.is_found().then(|| near.distance.into()));
        self.space().signed(points, found, distances, |x| x as f32);
    }

    fn winding(&self) -> &Winding {
        self.space().winding()
    }
}

impl DWorld {
    /// As [`World::winding_number`]: of the meshes as they are, not rounded.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn winding_number(&self, points: &[DVec3], numbers: &mut [f64]) {
        assert_eq!(points.len(), numbers.len(), "one answer per point");
        let winding = self.space().winding();
        points
            .iter()
            .zip(numbers)
            .for_each(|(&point, number)| *number = winding.around(point, ACCURACY));
    }

    /// As [`World::winding_number_exact`].
    pub fn winding_number_exact(&self, point: DVec3) -> f64 {
        self.space().winding().around(point, f64::INFINITY)
    }

    /// As [`World::occupancy`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occupancy(&self, points: &[DVec3], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer per point");
        let winding = self.space().winding();
        points.iter().zip(inside).for_each(|(&point, inside)| *inside = winding.is_inside(point));
    }

    /// As [`World::signed_distance`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn signed_distance<'a>(
        &self,
        points: impl Into<Points<'a, Double>>,
        distances: &mut [f64],
    ) {
        let points = points.into();
        let mut nearest = vec![DNearestPoint::NONE; points.len()];
        self.nearest_point(points, &mut nearest);
        let found = nearest.iter().map(|near| near.is_found().then_some(near.distance));
        self.space().signed(points, found, distances, |x| x);
    }
}

impl<'a> Space<'a> {
    fn winding(&self) -> &'a Winding {
        // Not prepared while the cell is locked: a thread that waits for its part of the work may
        // take up another query meanwhile, and would then wait for itself.
        if self.world.winding.get().is_none() {
            // Another thread may have been quicker.
            let _ = self.world.winding.set(Winding::of(self));
        }
        self.world.winding.get_or_init(|| Winding::of(self))
    }

    /// Gives the distances that were found a sign; `round` gives them the precision of the answers.
    fn signed<P: Precision>(
        &self,
        points: Points<P>,
        found: impl Iterator<Item = Option<f64>>,
        distances: &mut [P::Distance],
        round: impl Fn(f64) -> P::Distance,
    ) {
        assert_eq!(points.len(), distances.len(), "one answer per point");
        let winding = self.winding();
        for (i, (distance, found)) in distances.iter_mut().zip(found).enumerate() {
            let limit = points.limit(i);
            let far = if limit.is_nan() || limit < 0.0 { f64::INFINITY } else { limit };
            let size = found.unwrap_or(far);
            let is_inside = size > 0.0 && winding.is_inside(points.points[i].into());
            *distance = round(if is_inside { -size } else { size });
        }
    }
}

/// All groups, ready for winding numbers.
#[derive(Debug)]
pub(crate) struct Winding {
    groups: Vec<Group>,
}

/// A group: its triangles, then its objects, under one numbering.
#[derive(Debug, Default)]
struct Group {
    meshes: Vec<(u32, Triangles)>,
    triangles: u32,
    objects: Vec<Object>,
    /// Objects that are open or unbounded: never seen from afar.
    always: Vec<u32>,
    tree: Tree,
}

/// A mesh in either precision.
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
    fn of(space: &Space) -> Self {
        let mut groups: Vec<Group> =
            (0..space.world.group_count()).map(|_| Group::default()).collect();
        for group in space.world.children_first() {
            groups[group] = Group::of(space, group, &groups);
        }
        Self { groups }
    }

    fn is_inside(&self, point: DVec3) -> bool {
        let fast = self.around(point, ACCURACY);
        let number =
            if (fast - 0.5).abs() < DOUBT { self.around(point, f64::INFINITY) } else { fast };
        number > 0.5
    }

    fn around(&self, point: DVec3, accuracy: f64) -> f64 {
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
    fn of(space: &Space, number: usize, groups: &[Self]) -> Self {
        let world = space.world;
        let contents = world.group(crate::GroupId(number as u32));
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
                Geometry::Mesh(mesh) => match space.double.and_then(|world| world.mesh(id)) {
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
            // Once for what can be seen from afar and what cannot: the tree leads to all of it, if
            // it is to be seen from near.
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
