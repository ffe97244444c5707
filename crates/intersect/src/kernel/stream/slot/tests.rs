use super::*;
use crate::precision::Single;
use crate::search::AcceptAll;
use crate::search::{Any, Context};
use crate::tree::SMALL_STACK;
use crate::world::AcceleratorKind;
use crate::world::tests::{Random, build, dust};
use crate::world::{Structure, WorldBuilder};
use snell_math::simd::{Level, Portable, Portable8};
use snell_math::{DVec3, Ray, Transform};
use std::sync::Arc;

/// Dozens of slots are in use at once, and the first-level cache is small.
#[test]
#[cfg(target_pointer_width = "64")]
fn a_slot_of_rays_of_single_precision_has_four_lines() {
    assert_eq!(size_of::<Slot<crate::search::Closest<Single>>>(), 4 * size_of::<Line>());
}

/// A search that ends inside an instance does not return from it, so the next search must forget
/// the position.
#[test]
fn searches_that_end_in_instances_leave_nothing_behind() {
    let mut random = Random(3);
    let mut builder = WorldBuilder::default();
    let [outer, inner] = [builder.add_group(), builder.add_group()];
    builder.add_mesh(inner, Arc::new(dust(&mut random, 3000)));
    for (group, child) in [(outer, inner), (WorldBuilder::ROOT, outer)] {
        for x in [-0.1, 0.0, 0.2] {
            builder.add_instance(group, child, Transform::translation(DVec3::splat(x)));
        }
    }
    let world = build(builder, AcceleratorKind::Bvh, Level::Scalar);
    let Structure::Bvh(forest) = &world.structure else { panic!("the product's own structure") };
    let context = Context { filter: &AcceptAll, options: &world.options, data: &(), cancel: None };
    let rays: Vec<Ray> =
        (0..200).map(|_| Ray::new(random.point(0.5), random.direction())).collect();
    let mut below = [const { MaybeUninit::uninit() }; SMALL_STACK];
    let mut slots = Slots::<Any<Single>>::new(1, forest);
    let mut idle = slots.walks().next().expect("one slot");
    let mut found = 0;
    for (i, ray) in rays.iter().enumerate() {
        let search = || Search::new(ray.into(), &context, Any::new(ray));
        let Ok(mut walk) = idle.start::<Portable8>(false, i, &(), search, ray) else {
            panic!("an ordinary ray")
        };
        assert_eq!((walk.slot().outside.len(), walk.slot().place.group), (0, 0));
        while walk.current() != ChildRef::NONE {
            let current = walk.current();
            // SAFETY: each state is that of `current`.
            walk = unsafe {
                if current.is_node() {
                    let (mut node, mut enters) = (walk.into_state::<Node>(), Enters::UNSET);
                    let hit = node.test_boxes::<Portable8>(Portable, &mut enters);
                    node.push_boxes::<Portable8>(Portable, hit, &enters)
                } else if current.is_triangles() {
                    let mut leaf = walk.into_state::<Leaf>();
                    let hit = leaf.test_lines::<Portable8>(Portable);
                    let candidates = leaf.leave(hit);
                    if candidates.is_empty() { candidates.walk } else { candidates.test() }
                } else if current == ChildRef::RETURN {
                    walk.into_state::<Return>().leave_instance()
                } else {
                    walk.into_state::<Object>().visit::<Portable8>(Portable, &mut below)
                }
            };
        }
        let mut is_found = false;
        idle = walk.finish(|number, goal| {
            assert_eq!(number, i);
            is_found = goal.found;
        });
        let is_outside = idle.slot().outside.is_empty();
        assert_eq!(is_outside, !is_found, "what is found is two instances deep");
        found += usize::from(is_found);
    }
    assert!((20..180).contains(&found), "{found}");
}

impl<G: Goal> Walk<'_, '_, G> {
    /// The stack of references to visit, each with the distance of its box, and last the current
    /// one.
    pub fn entries(&self) -> Vec<(f32, ChildRef)> {
        let (current, top) = (self.slot().current, self.slot().top as usize);
        if current == ChildRef::NONE {
            return vec![];
        }
        let at = |i: usize| {
            // SAFETY: entries below `top` are written, and that at `top`, which was popped last,
            // is still there.
            let [child, distance] = unsafe { self.entry(i).cast::<[u32; 2]>().read() };
            (f32::from_bits(distance), ChildRef(child))
        };
        let mut entries: Vec<_> = (1..top).map(at).collect();
        // The current reference was popped last, or is the root.
        entries.push(if entries.is_empty() && current.is_node() {
            (self.slot().t_min, current)
        } else {
            at(top)
        });
        entries
    }

    /// The start of the search, and its padded limit.
    pub fn interval(&self) -> [f32; 2] {
        [self.slot().t_min, self.slot().cull]
    }

    /// The ray in the coordinates of its group.
    pub fn ray(&self) -> &PreparedRay {
        &self.slot().place.ray
    }
}
