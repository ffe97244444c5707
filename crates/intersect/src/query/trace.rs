//! The trace of one ray through an acceleration structure, step by step, for visualisation. The
//! search is the ordinary one, with a goal that also records its steps.

use crate::hit::Hit;
use crate::precision::Single;
use crate::search::rays::RayQuery;
use crate::search::region::Region;
use crate::search::{Closest, Counted, Goal, HitFilter, HitOf, RealOf, TraversalCounters};
use crate::world::{Structure, World};
use snell_math::DAffine3;

/// The largest number of steps that are recorded. A good structure needs a few hundred per ray.
const MAX_STEPS: usize = 10_000;

/// The largest number of instances that are entered. Only rays through instances of instances that
/// overlap enter so many, and some of those would enter more than anyone can wait for.
const MAX_INSTANCES: u32 = 1 << 22;

/// One node or cell that a search visited.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceStep {
    /// The region of the node or cell, in world space.
    pub region: Region,
    /// True if the node or cell holds primitives rather than other nodes.
    pub is_leaf: bool,
    /// The number of instances entered on the way to this node or cell; 0 in the root group.
    pub level: u32,
    /// The number of primitives tested at this step.
    pub tested: u32,
    /// Ray parameter of the nearest hit found at this step; `None` unless it is nearer than all
    /// earlier hits.
    pub found: Option<f32>,
}

/// The traversal of an acceleration structure by one ray.
#[derive(Clone, Debug, PartialEq)]
pub struct TraversalTrace {
    /// The steps, in order.
    pub steps: Vec<TraceStep>,
    /// The number of further steps beyond the largest number that is recorded.
    pub left_out: u64,
    /// The nearest hit.
    pub hit: Hit,
    /// Counters of the traversal.
    pub counters: TraversalCounters,
}

impl World {
    /// Traces how the nearest hit of one ray is found. The hit equals the result of
    /// [`World::closest_one`], unless the ray enters more than four million instances: the search
    /// is then given up.
    pub fn trace<'a>(
        &self,
        ray: impl Into<RayQuery<'a>>,
        filter: &dyn HitFilter,
    ) -> TraversalTrace {
        self.trace_of(ray.into(), filter)
    }

    fn trace_of(&self, ray: RayQuery, filter: &dyn HitFilter) -> TraversalTrace {
        let whole = match &self.structure {
            // Without a structure there is no node: everything is tested in the world's bounds.
            Structure::None(_) => Some(self.bounds()),
            _ => None,
        };
        let start = |ray: &_| {
            let goal = Counted { most_instances: MAX_INSTANCES, ..Counted::new(Closest::new(ray)) };
            let mut recorded = Recorded { goal, steps: Vec::new(), left_out: 0, maps: Vec::new() };
            if let Some(bounds) = &whole {
                recorded.visit(true, || Region::of_box(bounds));
            }
            recorded
        };
        let Recorded { goal, steps, left_out, .. } = self.searcher(filter).search(ray, start);
        TraversalTrace { steps, left_out, hit: goal.goal.result(), counters: goal.counters }
    }
}

/// A goal that finds the nearest hit and records the steps of the search.
struct Recorded {
    goal: Counted<Closest<Single>>,
    steps: Vec<TraceStep>,
    left_out: u64,
    /// The maps to the world from the instances that the search is in, innermost last.
    maps: Vec<DAffine3>,
}

impl Goal for Recorded {
    type Precision = Single;
    const NARROWS: bool = true;
    const RECORDS: bool = true;

    fn limit(&self) -> RealOf<Self> {
        self.goal.limit()
    }

    fn wants(&self, hit: &HitOf<Self>) -> bool {
        self.goal.wants(hit)
    }

    fn take(&mut self, hit: HitOf<Self>) -> bool {
        if let Some(step) = self.steps.last_mut() {
            step.found = Some(hit.t);
        }
        self.goal.take(hit)
    }

    fn count_node(&mut self) {
        self.goal.count_node();
    }

    fn count_primitives(&mut self, count: u32) {
        if let Some(step) = self.steps.last_mut() {
            step.tested += count;
        }
        self.goal.count_primitives(count);
    }

    fn count_visits(&mut self, nodes: u32, cells: u32) {
        self.goal.count_visits(nodes, cells);
    }

    fn count_instance(&mut self) {
        self.goal.count_instance();
    }

    fn gives_up(&self) -> bool {
        self.goal.gives_up()
    }

    fn visit(&mut self, is_leaf: bool, region: impl FnOnce() -> Region) {
        if self.steps.len() >= MAX_STEPS {
            self.left_out += 1;
            return;
        }
        let region = region();
        let region = self.maps.last().map_or(region, |map| region.mapped(map));
        let level = self.maps.len() as u32;
        self.steps.push(TraceStep { region, is_leaf, level, tested: 0, found: None });
    }

    fn enter(&mut self, child_from_group: &DAffine3) {
        let outer = self.maps.last().copied().unwrap_or(DAffine3::IDENTITY);
        self.maps.push(outer * child_from_group.inverse());
    }

    fn leave(&mut self) {
        self.maps.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::AcceptAll;
    use crate::search::region::RegionKind;
    use crate::shape::Sphere;
    use crate::world::AcceleratorKind;
    use crate::world::{BuildOptions, WorldBuilder};
    use snell_math::{DVec3, Ray, Transform, Vec3, rng};
    use std::sync::Arc;

    /// Balls in a group that is instanced with a translation, and a few more in the root.
    fn world(accelerator: AcceleratorKind) -> World {
        let mut builder = WorldBuilder::default();
        let placed =
            |map: DAffine3| Transform::from_matrix(map.into()).expect("it can be inverted");
        let group = builder.add_group();
        let number =
            |i: u32, axis: u32| f64::from(rng::to_unit(rng::hash_combine(i, axis))) * 4.0 - 2.0;
        let mut ball = |group, i: u32, radius: f64| {
            let center = DVec3::new(number(i, 0), number(i, 1), number(i, 2));
            builder.add_shape(group, Arc::new(Sphere { radius }), Transform::translation(center));
        };
        (0..60).for_each(|i| ball(group, i, 0.2));
        (100..104).for_each(|i| ball(WorldBuilder::ROOT, i, 0.1));
        let map = DAffine3::from_translation(DVec3::new(7.0, 0.0, 0.0))
            * DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5));
        builder.add_instance(WorldBuilder::ROOT, group, placed(map));
        builder.build(&BuildOptions { accelerator, ..BuildOptions::default() }).expect("a world")
    }

    /// True if a ray passes through a region of a kind that has an inside, to within a small
    /// tolerance.
    fn passes(region: &Region, ray: &Ray) -> bool {
        let inverse =
            snell_math::DMat3::from_cols(region.axes[0], region.axes[1], region.axes[2]).inverse();
        let origin = inverse * (ray.origin.as_dvec3() - region.center);
        let direction = inverse * ray.direction.as_dvec3();
        match region.kind {
            RegionKind::Box => {
                let [a, b] = [-1.001, 1.001].map(|side| (DVec3::splat(side) - origin) / direction);
                a.min(b).max_element() <= a.max(b).min_element()
            }
            RegionKind::Ball => {
                (origin - direction * (origin.dot(direction) / direction.length_squared())).length()
                    < 1.001
            }
            RegionKind::Plane | RegionKind::Stretch => true,
        }
    }

    #[test]
    fn the_way_leads_to_the_hit_in_every_structure() {
        for kind in AcceleratorKind::ALL {
            let world = world(kind);
            let mut found = 0;
            for i in 0..200 {
                let number =
                    |axis: u32| rng::to_unit(rng::hash_combine(i + 1000, axis)) * 4.0 - 2.0;
                let origin = Vec3::new(-5.0, number(0), number(1));
                let target = Vec3::new(7.0 + number(2), number(3), number(4) * 0.5);
                let ray = Ray::new(origin, (target - origin).normalize());
                let trace = world.trace(&ray, &AcceptAll);
                assert_eq!(trace.hit, world.closest_one(&ray, &AcceptAll), "{kind:?} {i}");
                let tested: u32 = trace.steps.iter().map(|s| s.tested).sum();
                assert_eq!(tested, trace.counters.primitives_tested, "{kind:?} {i}");
                if !trace.hit.is_hit() {
                    assert!(trace.steps.iter().all(|s| s.found.is_none()));
                    continue;
                }
                found += 1;
                let last = trace
                    .steps
                    .iter()
                    .rev()
                    .find(|s| s.found.is_some())
                    .expect("it was found somewhere");
                assert_eq!(last.found, Some(trace.hit.t), "{kind:?} {i}");
                // In the `bvh`, shapes belong to the node whose child they are.
                assert!(last.is_leaf || kind == AcceleratorKind::Bvh, "{kind:?} {i}: {last:?}");
                assert!(passes(&last.region, &ray), "{kind:?} {i}: {last:?}");
            }
            assert!(found > 20, "{kind:?}: {found}");
        }
    }
}
