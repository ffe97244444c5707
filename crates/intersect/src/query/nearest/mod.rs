//! The point of the world nearest to a query point.
//!
//! Distances are measured in world space, however geometry is scaled or sheared. Each distance
//! depends on the point and the primitive only and is computed in `f64`; boxes only cull; at equal
//! distances the lowest (instance, geometry, primitive) wins. So every structure gives the same
//! bits. Moving geometry is taken at time 0.

mod place;
#[cfg(test)]
mod tests;

use crate::geometry::Heightfield;
use crate::group::{Bulk, BulkContents, GroupList, Object, ObjectRef, Objects};
use crate::hit::{DHit, DNearestPoint, Hit, NearestPoint};
use crate::mesh::are_degenerate;
use crate::precision::{Double, DoubleData, Facts};
use crate::search::GeometryOptions;
use crate::search::points::Points;
use crate::shape::Shape;
use crate::shape::nearest::on_triangle;
use crate::tree::block::TriangleBlock;
use crate::tree::node::ChildRef;
use crate::tree::{Forest, GroupTree};
use crate::world::double::DWorld;
use crate::world::loose::Loose;
use crate::world::winding::sign::is_on;
use crate::world::{Structure, World};
use place::Place;
use snell_math::{Bounds3d, DAffine3, DVec2, DVec3, Vec3};
use std::mem::MaybeUninit;

impl World {
    /// For each point, finds the nearest point of any surface, on either side. The result is
    /// [`NearestPoint::NONE`] where no surface is within the limit, the point is not finite, or the
    /// limit is negative or NaN.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn nearest_point<'a>(&self, points: impl Into<Points<'a>>, nearest: &mut [NearestPoint]) {
        let points = points.into();
        points.check(nearest.len());
        let mut stack = Vec::new();
        for (i, answer) in nearest.iter_mut().enumerate() {
            let point = points.points[i].as_dvec3();
            *answer = self.space().nearest(point, points.limit(i), points.mask, &mut stack).into();
        }
    }

    /// The nearest point of any surface to one point.
    pub fn nearest_point_one(&self, point: Vec3) -> NearestPoint {
        self.space().nearest(point.as_dvec3(), f64::INFINITY, u64::MAX, &mut Vec::new()).into()
    }

    /// The nearest point of any surface to a point in double precision, within `max_distance` and
    /// among geometries and instances with a bit in common with `mask`. Neither the point nor the
    /// result is rounded. (The vertices of meshes are in single precision, except in a
    /// [`crate::DWorld`].)
    pub fn nearest_point_at(&self, point: DVec3, max_distance: f64, mask: u64) -> DNearestPoint {
        self.space().nearest(point, max_distance, mask, &mut Vec::new())
    }

    pub(super) fn space(&self) -> Space<'_> {
        Space { world: self, double: None }
    }
}

impl DWorld {
    /// For each point, finds the nearest point of any surface (see [`World::nearest_point`]).
    /// Meshes are used in double precision.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn nearest_point<'a>(
        &self,
        points: impl Into<Points<'a, Double>>,
        nearest: &mut [DNearestPoint],
    ) {
        let points = points.into();
        points.check(nearest.len());
        let mut stack = Vec::new();
        for (i, answer) in nearest.iter_mut().enumerate() {
            *answer =
                self.space().nearest(points.points[i], points.limit(i), points.mask, &mut stack);
        }
    }

    /// The nearest point of any surface to one point.
    pub fn nearest_point_one(&self, point: DVec3) -> DNearestPoint {
        self.space().nearest(point, f64::INFINITY, u64::MAX, &mut Vec::new())
    }

    pub(super) fn space(&self) -> Space<'_> {
        Space { world: &self.world, double: Some(self) }
    }
}

/// A world of either precision, for point queries.
#[derive(Clone, Copy)]
pub(super) struct Space<'a> {
    pub world: &'a World,
    /// The meshes in double precision, if the world has any.
    pub double: Option<&'a DWorld>,
}

impl Space<'_> {
    /// The nearest point within the limit.
    pub fn nearest(
        &self,
        point: DVec3,
        limit: f64,
        mask: u64,
        stack: &mut Vec<Entry>,
    ) -> DNearestPoint {
        if !is_answered(point, limit) {
            return DNearestPoint::NONE;
        }
        let mut scale = 1.0;
        let mut best = self.search(point, limit, mask, scale, stack);
        // Where squares (and products of four lengths) leave the range of `f64`, the search is
        // repeated with all lengths scaled.
        for _ in 0..3 {
            let distance = best.squared.sqrt() / scale;
            let is_ordinary = (1e-140..1e140).contains(&best.squared) || best.squared == 0.0;
            if is_ordinary || !best.is_found() {
                break;
            }
            let wanted = if best.squared < 1.0 { 1e-40 } else { 1.0 };
            let next = wanted / distance.min(1e200);
            if next == scale {
                break;
            }
            scale = next;
            best = self.search(point, limit, mask, scale, stack);
        }
        best.result(&self.world.options, scale)
    }

    /// Searches with lengths multiplied by `scale`.
    fn search(
        &self,
        point: DVec3,
        limit: f64,
        mask: u64,
        scale: f64,
        stack: &mut Vec<Entry>,
    ) -> Best {
        stack.clear();
        let (options, data) = (&*self.world.options, self.double.map(|world| &world.data));
        let loose = self.world.loose.get_or_init(|| Loose::of(self.world, self.double));
        let best = Best::within(limit * scale);
        let mut search = Search { point, mask, options, data, loose, scale, best, stack };
        let place = Place::world(point, scale);
        match &self.world.structure {
            Structure::None(lists) => search.list(&|group| &lists[group], 0, &place, 0),
            Structure::Walked(structures) => {
                search.list(&|group| structures.list(group), 0, &place, 0)
            }
            Structure::Bvh(forest) => search.tree(forest, 0, &place, 0),
        }
        search.best
    }
}

/// True if something in a box may be nearer than the best point so far.
fn is_near(search: &Search<'_>, place: &Place, weights: DVec3, bounds: &Bounds3d) -> bool {
    let offset = (bounds.min - place.point).max(place.point - bounds.max).max(DVec3::ZERO);
    // The bound is lowered by more than its rounding.
    (offset * offset * weights).element_sum() * (1.0 - 1e-9) <= search.best.squared
}

/// False for points that are not finite, and limits that are negative or NaN.
fn is_answered(point: DVec3, limit: f64) -> bool {
    point.is_finite() && limit >= 0.0
}

/// The nearest point found so far.
struct Best {
    squared: f64,
    /// `squared` rounded up.
    limit: f32,
    /// Instance, geometry and primitive (the number of the triangle for a quad).
    ids: [u32; 3],
    position: DVec3,
    uv: DVec2,
}

impl Best {
    /// A limit without a point.
    fn within(distance: f64) -> Self {
        let squared = distance * distance;
        // Every id is lower than [`Hit::NONE`], so a point exactly at the limit is accepted.
        Self {
            squared,
            limit: above(squared),
            ids: [Hit::NONE; 3],
            position: DVec3::ZERO,
            uv: DVec2::ZERO,
        }
    }

    fn is_improved_by(&self, squared: f64, ids: [u32; 3]) -> bool {
        squared < self.squared || (squared == self.squared && ids < self.ids)
    }

    fn is_found(&self) -> bool {
        self.ids[1] != Hit::NONE
    }

    /// The result of a search with lengths multiplied by `scale`.
    fn result(&self, options: &[GeometryOptions], scale: f64) -> DNearestPoint {
        let [instance, geometry, primitive] = self.ids;
        if !self.is_found() {
            return DNearestPoint::NONE;
        }
        let found = DHit { t: 0.0, uv: self.uv, instance, geometry, primitive };
        let DHit { uv, primitive, .. } =
            if options[geometry as usize].quads { Double::quad_hit(&found) } else { found };
        let distance = (self.squared.sqrt() / scale).min(f64::MAX);
        DNearestPoint { distance, position: self.position, uv, instance, geometry, primitive }
    }
}

impl From<DNearestPoint> for NearestPoint {
    /// Rounds to single precision; finite numbers stay finite.
    fn from(near: DNearestPoint) -> Self {
        if !near.is_found() {
            return Self::NONE;
        }
        let DNearestPoint { distance, position, uv, instance, geometry, primitive } = near;
        let largest = DVec3::splat(f32::MAX.into());
        Self {
            distance: (distance as f32).min(f32::MAX),
            position: position.clamp(-largest, largest).as_vec3(),
            uv: uv.as_vec2(),
            instance,
            geometry,
            primitive,
        }
    }
}

/// The smallest `f32` that is not less than `x`.
fn above(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) < x { rounded.next_up() } else { rounded }
}

/// A deferred child, and a lower bound on its squared distance from the point.
pub(super) type Entry = (f32, ChildRef);

/// The search for one point.
struct Search<'a> {
    /// The point in world space.
    point: DVec3,
    mask: u64,
    options: &'a [GeometryOptions],
    /// The meshes of a world in double precision; `None` for a world in single precision.
    data: Option<&'a DoubleData>,
    /// The triangles of each group that are not in its tree.
    loose: &'a [Loose],
    /// The factor by which the metric of the world lengthens.
    scale: f64,
    best: Best,
    stack: &'a mut Vec<Entry>,
}

impl Search<'_> {
    /// Searches the tree of a group for nearer points, nearest boxes first.
    fn tree(&mut self, forest: &Forest, group: usize, place: &Place, instance: u32) {
        let tree: &GroupTree = &forest.trees[group];
        self.loose(group, place, instance);
        for &object in &tree.unbounded {
            self.object(
                &tree.objects,
                object as usize,
                place,
                instance,
                |search, child, place, instance| {
                    search.tree(forest, child, place, instance);
                },
            );
        }
        if tree.root == ChildRef::NONE {
            return;
        }
        let framed = self.data.map(|data| place.in_frame(&data.frames[group]));
        let seen = framed.as_ref().unwrap_or(place);
        let base = self.stack.len();
        self.stack.push((0.0, tree.root));
        while self.stack.len() > base {
            let Some((bound, child)) = self.stack.pop() else { break };
            if bound > self.best.limit {
                continue;
            }
            if child.is_node() {
                let node = &tree.nodes[child.index()];
                let bounds = seen.node_bounds(node);
                let first = self.stack.len();
                let children = bounds.into_iter().zip(node.children);
                self.stack
                    .extend(children.filter(|c| c.1 != ChildRef::NONE && c.0 <= self.best.limit));
                self.stack[first..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
            } else if child.is_triangles() {
                let mut room = MaybeUninit::uninit();
                let block = tree.blocks.get(child.block(), &mut room);
                self.triangles(tree, block, child.count() as usize, [place, seen], instance);
            } else {
                self.object(
                    &tree.objects,
                    child.index(),
                    place,
                    instance,
                    |search, child, place, instance| {
                        search.tree(forest, child, place, instance);
                    },
                );
            }
        }
    }

    /// Tests the triangles of a group that are not in its tree.
    fn loose(&mut self, group: usize, place: &Place, instance: u32) {
        let Some(loose) = self.loose.get(group) else { return };
        let weights = place.metric.axis_weights();
        let wants = |search: &Self, bounds: &Bounds3d| is_near(search, place, weights, bounds);
        loose.visit(self, wants, |search, triangle| {
            let ids = [instance, triangle.geometry, triangle.number];
            search.triangle_at(&triangle.corners, place, ids);
        });
    }

    /// Tests everything in a group; `lists` has the contents of each group.
    fn list<'l>(
        &mut self,
        lists: &impl Fn(usize) -> &'l GroupList,
        group: usize,
        place: &Place,
        instance: u32,
    ) {
        let list = lists(group);
        self.loose(group, place, instance);
        for (geometry, mesh) in &list.meshes {
            for triangle in (0..mesh.indices.len()).filter(|&i| !mesh.is_degenerate(i)) {
                let ids = [instance, *geometry, triangle as u32];
                self.triangle(|| mesh.corners(triangle), place, ids);
            }
        }
        for object in 0..list.objects.len() {
            self.object(
                &list.objects,
                object,
                place,
                instance,
                |search, child, place, instance| {
                    search.list(lists, child, place, instance);
                },
            );
        }
    }

    /// Tests the triangles of a block. `seen`, the second place, is the query point in the
    /// coordinates of the tree.
    fn triangles(
        &mut self,
        tree: &GroupTree,
        block: &TriangleBlock,
        count: usize,
        [place, seen]: [&Place; 2],
        instance: u32,
    ) {
        let bounds = seen.triangle_bounds(block);
        for (lane, bound) in bounds.into_iter().enumerate().take(count) {
            if bound <= self.best.limit {
                let (geometry, primitive) = tree.triangle(block.ids[lane]);
                self.triangle(
                    || block.corners(lane).map(Vec3::from_array),
                    place,
                    [instance, geometry, primitive],
                );
            }
        }
    }

    /// Tests a triangle; `corners` gives the corners stored in the structure.
    fn triangle(&mut self, corners: impl FnOnce() -> [Vec3; 3], place: &Place, ids: [u32; 3]) {
        if self.admits(ids[1]) {
            let corners = match self.data {
                Some(data) => *data.corners(ids[1], ids[2]),
                None => corners().map(|p| p.as_dvec3()),
            };
            self.offer_triangle(&corners, place, ids);
        }
    }

    /// Tests a triangle with these corners.
    fn triangle_at(&mut self, corners: &[DVec3; 3], place: &Place, ids: [u32; 3]) {
        if self.admits(ids[1]) {
            self.offer_triangle(corners, place, ids);
        }
    }

    #[inline]
    fn offer_triangle(&mut self, corners: &[DVec3; 3], place: &Place, ids: [u32; 3]) {
        let (position, uv) = on_triangle(&place.metric, place.point, corners);
        // A point that is exactly on the triangle is at distance zero, without rounding.
        let is_on = is_on(corners, place.point);
        let offset = if is_on { DVec3::ZERO } else { position - place.point };
        self.offer(offset, uv, &place.metric, ids);
    }

    /// Tests a shape or a primitive of a set, or enters an instance.
    fn object(
        &mut self,
        objects: &Objects,
        number: usize,
        place: &Place,
        instance: u32,
        enter: impl FnOnce(&mut Self, usize, &Place, u32),
    ) {
        match objects.get(number) {
            ObjectRef::Primitive(bulk, primitive) => {
                self.primitive(bulk, primitive, place, instance)
            }
            ObjectRef::Placed(Object::Shape { shape, geometry, shape_from_group }) => {
                self.shape(shape.as_ref(), *geometry, shape_from_group, place, instance);
            }
            ObjectRef::Placed(Object::Instance { child, offset, child_from_group, mask }) => {
                let place = if mask & self.mask == 0 {
                    None
                } else {
                    place.in_child(child_from_group.at_first())
                };
                if let Some(place) = place {
                    enter(self, *child, &place, instance + offset);
                }
            }
        }
    }

    fn shape(
        &mut self,
        shape: &dyn Shape,
        geometry: u32,
        shape_from_group: &DAffine3,
        place: &Place,
        instance: u32,
    ) {
        if !self.admits(geometry) {
            return;
        }
        let point = shape_from_group.transform_point3(place.point);
        let metric = place.metric_in_child(shape_from_group);
        if let Some(found) = shape.nearest_point(point, &metric) {
            // The point is clamped to the box, because the shape is skipped if that box is too far
            // away.
            let bounds = shape.bounds();
            let position = found.position.max(bounds.min).min(bounds.max);
            self.offer(position - point, DVec2::ZERO, &metric, [instance, geometry, found.face]);
        }
    }

    fn primitive(&mut self, bulk: &Bulk, primitive: u32, place: &Place, instance: u32) {
        if !self.admits(bulk.geometry) {
            return;
        }
        let number = primitive as usize;
        if let BulkContents::Heightfield(field) = &bulk.contents {
            return self.block(field, number, place, [instance, bulk.geometry]);
        }
        let bounds = bulk.contents.bounds(number);
        let found = match &bulk.contents {
            BulkContents::Heightfield(_) => None,
            BulkContents::Set(set) => set.nearest_point(number, place.point, &place.metric),
            BulkContents::MovingMesh(mesh) => {
                let corners = mesh.first().corners(number);
                let exists = !are_degenerate(&corners);
                let nearest =
                    || on_triangle(&place.metric, place.point, &corners.map(|p| p.as_dvec3()));
                exists.then(nearest).map(|(position, uv)| (position, uv.as_vec2()))
            }
        };
        if let Some((position, uv)) =
            found.filter(|found| !bounds.is_empty() && found.0.is_finite())
        {
            let position = position.max(bounds.min).min(bounds.max);
            self.offer(
                position - place.point,
                uv.as_dvec2(),
                &place.metric,
                [instance, bulk.geometry, primitive],
            );
        }
    }

    /// Tests the triangles of a block of a heightfield.
    fn block(
        &mut self,
        field: &Heightfield,
        block: usize,
        place: &Place,
        [instance, geometry]: [u32; 2],
    ) {
        let weights = place.metric.axis_weights();
        let is_single = self.data.is_none();
        let wants = |search: &Self, bounds: &Bounds3d| is_near(search, place, weights, bounds);
        let rounded = |p: DVec3| if is_single { p.as_vec3().as_dvec3() } else { p };
        field.visit_block(block, self, rounded, wants, |search, number, corners| {
            search.offer_triangle(&corners, place, [instance, geometry, number]);
        });
    }

    fn admits(&self, geometry: u32) -> bool {
        self.options[geometry as usize].mask & self.mask != 0
    }

    /// Accepts a point if it is nearer than the best so far. `offset` is the vector to it from the
    /// query point, in coordinates measured by `metric`.
    fn offer(&mut self, offset: DVec3, uv: DVec2, metric: &crate::shape::Metric, ids: [u32; 3]) {
        let in_world = *metric.linear() * offset;
        let squared = in_world.length_squared();
        if self.best.is_improved_by(squared, ids) {
            let position = self.point + in_world / self.scale;
            self.best = Best { squared, limit: above(squared), ids, position, uv };
        }
    }
}
