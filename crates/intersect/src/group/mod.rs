//! The contents of groups, prepared for intersection, and the tests of single primitives that all
//! structures share.

mod heightfield;

use crate::exact::TriangleTest;
use crate::exact::ray::LocalRay;
use crate::exact::triangle::exact_hit;
use crate::geometry::motion::transform_at;
use crate::geometry::{Heightfield, MovingMesh, PrimitiveSet, within_bounds};
use crate::mesh::{TriangleMesh, are_degenerate};
use crate::precision::{Facts, Real};
use crate::search::{Goal, HitOf, Search, Verdict};
use crate::shape::Shape;
use snell_math::{Bounds3d, DAffine3, DRay, Transform, Vec2};
use std::sync::Arc;

/// A shape or an instance in a group.
#[derive(Clone, Debug)]
pub(crate) enum Object {
    /// An analytic shape.
    Shape {
        /// The shape to test.
        shape: Arc<dyn Shape>,
        /// The number of its geometry.
        geometry: u32,
        /// The map from the group to the shape.
        shape_from_group: DAffine3,
    },
    /// An instance of another group.
    Instance {
        /// The number of that group.
        child: usize,
        /// The difference between the occurrence numbers of the child and of the group.
        offset: u32,
        /// The map from the group to the child.
        child_from_group: Placement,
        /// Only rays whose mask has a bit in common with this one enter the instance.
        mask: u64,
    },
}

/// The map from a group to an object placed in it.
#[derive(Clone, Debug)]
pub(crate) enum Placement {
    /// A map that is the same at all times.
    Still(DAffine3),
    /// A moving map, given by keys of its inverse, from the child to the group, and their times;
    /// see [`transform_at`].
    Moving(Arc<[Transform]>, Arc<[f32]>),
}

impl Placement {
    /// The map at time 0.
    pub fn at_first(&self) -> &DAffine3 {
        match self {
            Self::Still(map) => map,
            Self::Moving(keys, _) => keys[0].inverse_matrix(),
        }
    }

    /// Reports to a recording goal that the search enters the child.
    #[inline(always)]
    fn report_entry<G: Goal>(&self, search: &mut Search<'_, G>) {
        if !G::RECORDS {
            return;
        }
        match self {
            Self::Still(map) => search.goal.enter(map),
            Self::Moving(keys, times) => {
                let map = transform_at(&keys[0], &keys[1..], times, search.time)
                    .map_or(DAffine3::IDENTITY, |t| *t.inverse_matrix());
                search.goal.enter(&map);
            }
        }
    }

    /// The ray in the coordinates of the child; `None` if it overflows or the map is singular, so
    /// that nothing there can be hit.
    #[inline(always)]
    pub fn ray_in_child(&self, ray: &DRay, time: f32) -> Option<DRay> {
        self.mapped(ray, time).filter(is_finite)
    }

    /// The ray in the coordinates of the child, which may have overflowed; `None` if the map is
    /// singular.
    #[inline(always)]
    pub fn mapped(&self, ray: &DRay, time: f32) -> Option<DRay> {
        match self {
            Self::Still(map) => Some(mapped(map, ray)),
            Self::Moving(keys, times) => {
                let map = transform_at(&keys[0], &keys[1..], times, time)?;
                Some(mapped(map.inverse_matrix(), ray))
            }
        }
    }
}

/// Many primitives of one geometry.
#[derive(Clone, Debug)]
pub(crate) enum BulkContents {
    /// A set: spheres, curves, or user-defined.
    Set(Arc<dyn PrimitiveSet>),
    /// Triangles of a mesh whose vertices move.
    MovingMesh(Arc<MovingMesh>),
    /// Blocks of cells of a heightfield.
    Heightfield(Arc<Heightfield>),
}

impl BulkContents {
    /// The number of primitives; of a heightfield, the number of blocks.
    pub fn len(&self) -> usize {
        match self {
            Self::Set(set) => set.len(),
            Self::MovingMesh(mesh) => mesh.len(),
            Self::Heightfield(field) => field.block_count(),
        }
    }

    /// The box of a primitive at all times; empty if the primitive is never hit.
    pub fn bounds(&self, primitive: usize) -> Bounds3d {
        let b = match self {
            Self::Set(set) => set.bounds(primitive),
            Self::MovingMesh(mesh) => mesh.bounds(primitive).unwrap_or(Bounds3d::EMPTY),
            Self::Heightfield(field) => field.block_bounds(primitive),
        };
        if b.is_empty() { Bounds3d::EMPTY } else { b }
    }
}

/// A set of primitives in a group.
#[derive(Clone, Debug)]
pub(crate) struct Bulk {
    /// Number of the set's first primitive among the objects of the group.
    pub first: u32,
    /// The number of the geometry.
    pub geometry: u32,
    /// The primitives to test.
    pub contents: BulkContents,
}

/// All contents of a group besides the triangles of meshes, under a single numbering: first the
/// shapes and instances, then the primitives of each set.
#[derive(Clone, Debug, Default)]
pub(crate) struct Objects {
    placed: Vec<Object>,
    sets: Vec<Bulk>,
    count: usize,
}

/// A reference to the object with a given number.
pub(crate) enum ObjectRef<'a> {
    /// A shape or an instance.
    Placed(&'a Object),
    /// A primitive of a set, with its index in the set.
    Primitive(&'a Bulk, u32),
}

impl Objects {
    /// Adds a shape or an instance. All of these must be added before any set.
    pub fn push(&mut self, object: Object) {
        debug_assert!(self.sets.is_empty(), "shapes and instances come first");
        self.placed.push(object);
        self.count += 1;
    }

    /// Adds a set. Returns false if the number of objects would not fit 32 bits.
    pub fn push_set(&mut self, geometry: u32, contents: BulkContents) -> bool {
        let count = self.count.saturating_add(contents.len());
        if count > u32::MAX as usize {
            return false;
        }
        self.sets.push(Bulk { first: self.count as u32, geometry, contents });
        self.count = count;
        true
    }

    /// The number of objects, including primitives of sets.
    pub fn len(&self) -> usize {
        self.count
    }

    /// The ranges of object numbers that belong to one geometry or instance, as first and end.
    pub fn geometries(&self) -> impl Iterator<Item = (u32, u32)> {
        let single = (0..self.placed.len() as u32).map(|i| (i, i + 1));
        single.chain(
            self.sets.iter().map(|bulk| (bulk.first, bulk.first + bulk.contents.len() as u32)),
        )
    }

    /// The shapes and instances.
    pub fn placed(&self) -> &[Object] {
        &self.placed
    }

    /// The object with a number.
    #[inline(always)]
    pub fn get(&self, number: usize) -> ObjectRef<'_> {
        if let Some(object) = self.placed.get(number) {
            return ObjectRef::Placed(object);
        }
        let after = self.sets.partition_point(|bulk| bulk.first as usize <= number);
        let bulk = &self.sets[after - 1];
        ObjectRef::Primitive(bulk, number as u32 - bulk.first)
    }

    /// Prefetches an object that will be tested soon.
    #[inline(always)]
    pub fn fetch(&self, number: usize) {
        if let ObjectRef::Primitive(Bulk { contents: BulkContents::Set(set), .. }, primitive) =
            self.get(number)
        {
            set.fetch(primitive as usize);
        }
    }

    /// Memory of the list in bytes, without the geometries.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.placed.as_slice()) + size_of_val(self.sets.as_slice())
    }
}

/// The contents of a group.
#[derive(Clone, Debug, Default)]
pub(crate) struct GroupList {
    /// Meshes with their geometry numbers.
    pub meshes: Vec<(u32, Arc<TriangleMesh>)>,
    /// Shapes, instances and primitives of sets.
    pub objects: Objects,
}

/// Tests an object, given by its number. `ray` is in the group's coordinates. For an instance,
/// `enter` searches the instanced group: it gets the number of the group, the ray in its
/// coordinates and its occurrence number. Returns true if the search is over.
#[inline(always)]
pub(crate) fn test_object<G: Goal<Precision: TriangleTest>>(
    objects: &Objects,
    number: usize,
    ray: &DRay,
    instance: u32,
    search: &mut Search<'_, G>,
    enter: impl FnOnce(usize, &DRay, u32, &mut Search<'_, G>) -> bool,
) -> bool {
    match objects.get(number) {
        ObjectRef::Placed(Object::Shape { shape, geometry, shape_from_group }) => {
            test_shape(search, shape.as_ref(), *geometry, instance, &mapped(shape_from_group, ray))
        }
        ObjectRef::Placed(Object::Instance { .. }) if search.is_given_up() => true,
        ObjectRef::Placed(Object::Instance { child, offset, child_from_group, mask }) => {
            mask & search.mask != 0
                && child_from_group.ray_in_child(ray, search.time).is_some_and(|ray| {
                    search.goal.count_instance();
                    child_from_group.report_entry(search);
                    let is_over = enter(*child, &ray, instance + offset, search);
                    search.goal.leave();
                    is_over
                })
        }
        ObjectRef::Primitive(bulk, primitive) => {
            let ids = [instance, bulk.geometry, primitive];
            match &bulk.contents {
                BulkContents::Set(set) => test_primitive(search, set.as_ref(), ids, ray),
                BulkContents::MovingMesh(mesh) => test_moving_triangle(search, mesh, ids, ray),
                BulkContents::Heightfield(field) => {
                    heightfield::test_block(search, field, ids, ray)
                }
            }
        }
    }
}

/// Maps a ray by an affine map; its parameter `t` stays the same.
#[inline(always)]
pub(crate) fn mapped(map: &DAffine3, ray: &DRay) -> DRay {
    DRay {
        origin: map.transform_point3(ray.origin),
        direction: map.transform_vector3(ray.direction),
        ..*ray
    }
}

fn is_finite(ray: &DRay) -> bool {
    ray.origin.is_finite() && ray.direction.is_finite()
}

/// The largest number of times that one object is tested for one ray. It is tested again, from the
/// last hit on, as long as a later hit may count. No built-in shape has as many crossings.
const MAX_CROSSINGS: usize = 64;

/// Reports the hits on one shape, nearest first. `ray` is in the shape's coordinates. Returns true
/// if the search is over.
pub(crate) fn test_shape<G: Goal>(
    search: &mut Search<'_, G>,
    shape: &dyn Shape,
    geometry: u32,
    instance: u32,
    ray: &DRay,
) -> bool {
    search.goal.count_primitives(1);
    let mut ray = DRay { t_min: search.t_min().into(), ..*ray };
    for _ in 0..MAX_CROSSINGS {
        // One unit in the last place more, to include hits that are at equal distance after
        // rounding.
        ray.t_max = search.goal.limit().next_up().into();
        let found = shape.nearest_two(&ray);
        for (number, found) in found.into_iter().enumerate() {
            let Some(found) = found else { return false };
            if number > 0
                && !(found.t > ray.t_min && found.t < search.goal.limit().next_up().into())
            {
                return false;
            }
            match search.offer(G::Precision::hit(
                found.t,
                Vec2::ZERO,
                [instance, geometry, found.face],
            )) {
                Verdict::Finished => return true,
                Verdict::Behind => return false,
                Verdict::Taken | Verdict::Rejected => ray.t_min = found.t,
            }
        }
    }
    false
}

/// Reports the hits on one primitive of a set, nearest first; `ids` are instance, geometry and
/// primitive. Returns true if the search is over.
fn test_primitive<G: Goal>(
    search: &mut Search<'_, G>,
    set: &dyn PrimitiveSet,
    ids: [u32; 3],
    ray: &DRay,
) -> bool {
    search.goal.count_primitives(1);
    let (time, number) = (search.time, ids[2] as usize);
    // The whole interval rather than the current limit: a hit that is moved into the bounds must
    // not depend on the hits that were found before.
    let [t_min, t_max] = G::Precision::interval(search.ray).map(Into::into);
    let mut ray = DRay { t_min, t_max, ..*ray };
    for _ in 0..MAX_CROSSINGS {
        let Some((found, bounds)) = set.closest_within(number, &ray, time) else { return false };
        if found.t.is_nan() || found.t <= ray.t_min {
            return false;
        }
        if let Some(t) = within_bounds(&bounds, &ray, found.t) {
            let hit = G::Precision::hit(t, found.uv, ids);
            match search.offer(hit) {
                Verdict::Finished => return true,
                Verdict::Behind => return false,
                // Later hits are not nearer, also if they are moved into the bounds.
                Verdict::Taken if search.goal.limit() <= G::Precision::t(&hit) => return false,
                Verdict::Taken | Verdict::Rejected => {}
            }
        }
        ray.t_min = found.t;
    }
    false
}

/// Reports the hit on a triangle with its corners at the ray's time. Returns true if the search is
/// over.
fn test_moving_triangle<G: Goal>(
    search: &mut Search<'_, G>,
    mesh: &MovingMesh,
    ids: [u32; 3],
    ray: &DRay,
) -> bool {
    search.goal.count_primitives(1);
    let corners = mesh.corners(ids[2] as usize, search.time);
    if are_degenerate(&corners) {
        return false;
    }
    let found =
        exact_hit(&LocalRay::new(ray), &corners.map(|p| p.to_array()), search.t_min().into());
    // Adding 0 turns -0 into +0.
    let hit = found.map(|(t, uv)| G::Precision::hit(t + 0.0, uv, ids));
    let hit = hit.filter(|hit| G::Precision::t(hit) <= search.goal.limit());
    hit.is_some() && mesh.bounds(ids[2] as usize).is_some() && offer_triangle(search, hit)
}

/// Reports the hit on one triangle. Returns true if the search is over.
#[inline(always)]
pub(crate) fn test_triangle<G: Goal<Precision: TriangleTest>>(
    search: &mut Search<'_, G>,
    ray: &LocalRay,
    corners: &[[f32; 3]; 3],
    ids: impl FnOnce() -> [u32; 3],
) -> bool {
    let hit = G::Precision::triangle_hit(search, ray, corners, ids);
    offer_triangle(search, hit)
}

/// Reports the result of the exact test of a triangle. Returns true if the search is over.
#[inline(always)]
pub(crate) fn offer_triangle<G: Goal>(search: &mut Search<'_, G>, found: Option<HitOf<G>>) -> bool {
    let Some(hit) = found else { return false };
    search.offer(hit) == Verdict::Finished
}
