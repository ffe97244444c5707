//! What bundles do with shapes and instances: one ray after the other, but in instances they go on as bundles if they can.

use super::super::node::ChildRef;
use super::super::traverse::{Stack, test_object};
use super::bundle::{Bundle, PerRay, RAYS};
use super::walk::{Memory, Position, Row, Stacks, Walker};
use super::{MIN_RAYS, fits};
use crate::accel::bvh::GroupTree;
use crate::accel::group::{Object, ObjectRef, Placement, mapped};
use crate::precision::Rules;
use crate::query::search::Goal;
use snell_math::simd::Lanes16;
use snell_math::{DAffine3, DVec3, Vec3};

impl<G: Goal> Walker<'_, '_, G> {
    /// Tests a shape or instance for some of the rays.
    ///
    /// # Safety
    /// As [`Self::walk`].
    #[inline(always)]
    pub(super) unsafe fn test_objects<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        object: usize,
        bundle: &mut Bundle,
        rays: u32,
        instance: u32,
        stack: &mut Stack,
    ) {
        let mut culls = [0.0; RAYS];
        // SAFETY: as promised by the caller.
        unsafe {
            let over = self.test_one_by_one(tree, object, bundle, rays, instance, &mut culls, stack);
            self.alive &= !over;
            bundle.narrow::<W>(rays, over, &culls);
            bundle.update_limits::<W>();
        }
    }

    /// Tests a shape or instance for some of the rays, one by one; notes their new padded limits, and returns whose searches are over.
    ///
    /// # Safety
    /// The machine must have the instructions of the entries; the stacks must have room for all below the group.
    #[inline(never)]
    unsafe fn test_one_by_one(
        &mut self,
        tree: &GroupTree,
        object: usize,
        bundle: &mut Bundle,
        mut rays: u32,
        instance: u32,
        culls: &mut PerRay<f32>,
        stack: &mut Stack,
    ) -> u32 {
        self.want_rays(bundle);
        let mut over = 0;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize & (RAYS - 1);
            rays &= rays - 1;
            self.search(lane);
            let (Some(search), ray) = (&mut self.searches[lane], bundle.rays.get(lane)) else { continue };
            // SAFETY: as promised by the caller.
            let is_over =
                unsafe { test_object(self.forest, tree, object, &ray, instance, search, stack, self.enter_single) };
            culls[lane] = search.cull();
            over |= u32::from(is_over) << lane;
        }
        over
    }

    /// Tests a shape or instance for some of the rays: in an instance they go on as a bundle if they can.
    ///
    /// # Safety
    /// As [`Self::walk`].
    #[inline(always)]
    pub(super) unsafe fn enter_object<W: Lanes16>(
        &mut self,
        tree: &GroupTree,
        object: ChildRef,
        bundle: &mut Bundle,
        mask: u32,
        position: &Position,
        stacks: &mut Stacks,
    ) {
        if let ObjectRef::Placed(Object::Instance {
            child,
            offset,
            child_from_group: Placement::Still(child_from_group),
            mask: visible,
        }) = tree.objects.get(object.index())
        {
            let mut wanted = 0;
            for lane in (0..RAYS).filter(|lane| mask >> lane & 1 == 1) {
                wanted |= u32::from(self.search(lane).mask & visible != 0) << lane;
            }
            if wanted.count_ones() as usize >= MIN_RAYS && fits(&self.forest.trees[*child]) {
                let mut below = self.spare.pop().unwrap_or_else(|| Box::new(Bundle::NONE));
                let groups = (position.group, *child);
                // SAFETY: as promised by the caller.
                if unsafe { self.set_up_in_child::<W>(&mut below, bundle, wanted, groups, child_from_group) } {
                    let alive = std::mem::replace(&mut self.alive, wanted);
                    let inside = Position { group: *child, instance: position.instance + offset, ..*position };
                    let mut memory = Memory::new();
                    // SAFETY: as promised by the caller.
                    unsafe { (self.enter)(&mut [Row::new(self, &mut below, &mut memory)], stacks, inside) };
                    self.spare.push(below);
                    let over = wanted & !self.alive;
                    self.alive = alive & !over;
                    let mut culls = [0.0; RAYS];
                    for lane in (0..RAYS).filter(|lane| wanted >> lane & 1 == 1) {
                        culls[lane] = self.search(lane).cull();
                    }
                    // SAFETY: as promised by the caller.
                    unsafe {
                        bundle.narrow::<W>(wanted, over, &culls);
                        bundle.update_limits::<W>();
                    }
                    return;
                }
                self.spare.push(below);
            }
        }
        // SAFETY: as promised by the caller.
        unsafe { self.test_objects::<W>(tree, object.index(), bundle, mask, position.instance, &mut stacks.single) };
    }

    /// Makes a bundle of some of the rays in the coordinates of an instanced group; false if it is none.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    unsafe fn set_up_in_child<W: Lanes16>(
        &mut self,
        below: &mut Bundle,
        bundle: &mut Bundle,
        mask: u32,
        (group, child): (usize, usize),
        child_from_group: &DAffine3,
    ) -> bool {
        self.want_rays(bundle);
        let [mut t_min, mut cull] = [[0.0; RAYS]; 2];
        for lane in 0..RAYS {
            let ray = mapped(child_from_group, &bundle.rays.get(lane));
            let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
            let search = self.search(lane);
            t_min[lane] = search.start;
            cull[lane] = if mask >> lane & 1 == 1 { search.cull() } else { -1.0 };
            below.rays.origin[lane] = [o[0], o[1], o[2], bundle.rays.origin[lane][3]];
            below.rays.direction[lane] = [d[0], d[1], d[2], 0.0];
        }
        let [x, y, z, _] = below.rays.origin[0];
        let apex = if bundle.kind.common {
            DVec3::new(x, y, z)
        } else {
            let apex = Vec3::from_array(bundle.kind.apex).as_dvec3();
            child_from_group.transform_point3(G::Precision::point_in_group(self.data, group, apex))
        };
        // SAFETY: as promised by the caller.
        unsafe { below.set_up_exactly::<W, G::Precision>(&[t_min, cull], self.data, child, apex, &bundle.kind) }
    }
}
