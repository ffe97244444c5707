//! What bundles do with shapes and instances: one ray after the other, but in instances they go on
//! as bundles if they can.

use super::bundle::{Bundle, PerRay, RAYS};
use super::walk::{
    Group, Luggage, Members, Position, ROWS, Row, Rows, Stacks, Walker, enter, next,
};
use super::{MIN_RAYS, fits};
use crate::group::{Object, ObjectRef, Placement};
use crate::kernel::Goal;
use crate::kernel::single::traverse::{Stack, test_object};
use crate::precision::frame::Frames;
use crate::tree::node::ChildRef;
use snell_math::simd::{Lanes8, Lanes16};
use snell_math::{DAffine3, Vec3};
use std::sync::atomic::Ordering;

impl<G: Goal> Walker<'_, '_, G> {
    /// Tests a shape or instance for some of the rays.
    #[inline(always)]
    pub(super) fn test_objects<W: Lanes16>(
        &mut self,
        token: W::Token,
        group: Group,
        object: usize,
        bundle: &mut Bundle,
        rays: u32,
        stack: &mut Stack,
    ) {
        let mut culls = [0.0; RAYS];
        let over = self.test_one_by_one::<W::Half>(
            W::half_token(token),
            group,
            object,
            bundle,
            rays,
            &mut culls,
            stack,
        );
        self.alive &= !over;
        bundle.narrow::<W>(token, rays, over, &culls);
        bundle.update_limits::<W>(token);
    }

    /// Tests a shape or instance for some of the rays, one by one; notes their new padded limits,
    /// and returns whose searches are over.
    #[inline(never)]
    fn test_one_by_one<L: Lanes8>(
        &mut self,
        token: L::Token,
        group: Group,
        object: usize,
        bundle: &mut Bundle,
        mut rays: u32,
        culls: &mut PerRay<f32>,
        stack: &mut Stack,
    ) -> u32 {
        self.want_rays(bundle);
        let mut over = 0;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize & (RAYS - 1);
            rays &= rays - 1;
            self.search(lane);
            let (Some(search), ray) = (&mut self.searches[lane], bundle.rays.get(lane)) else {
                continue;
            };
            let (forest, tree, instance) = (self.forest, group.tree, group.instance);
            let is_over =
                test_object::<L, G>(token, forest, tree, object, &ray, instance, search, stack);
            culls[lane] = search.cull();
            over |= u32::from(is_over) << lane;
        }
        over
    }

    /// Those of some rays that may meet what has a mask.
    #[inline(always)]
    fn visible(&mut self, mut rays: u32, mask: u32) -> u32 {
        if self.masks & mask == 0 {
            for lane in 0..RAYS {
                if rays >> lane & 1 == 1 && self.search(lane).mask & mask == 0 {
                    rays &= !(1 << lane);
                }
            }
        }
        rays
    }

    /// Makes a bundle of some of the rays in the coordinates of an instanced group; false if it is
    /// none.
    #[inline(always)]
    fn set_up_in_child<W: Lanes16>(
        &self,
        token: W::Token,
        below: &mut Bundle,
        bundle: &Bundle,
        mask: u32,
        (group, child): (usize, usize),
        child_from_group: &DAffine3,
    ) -> bool {
        let rays = bundle.lane_rays::<W>(token).mapped(token, child_from_group);
        let cull = W::splat(token, -1.0).replace(mask, W::load(token, &bundle.cull));
        let mut points = [Vec3::from_array(bundle.kind.apex).as_dvec3(), bundle.point().as_dvec3()];
        for point in &mut points {
            *point = child_from_group
                .transform_point3(G::Precision::point_in_group(self.data, group, *point));
        }
        let limits = [W::load(token, &bundle.t_min), cull];
        below.set_up_exactly::<W, G::Precision>(
            token,
            rays,
            limits,
            self.data,
            child,
            points,
            &bundle.kind,
        )
    }
}

/// Tests a shape or instance for some of the rays of some of the bundles: in an instance they go on
/// as bundles if they can, together if they are alike there.
#[inline(always)]
pub(super) fn enter_object<W: Lanes16, G: Goal>(
    token: W::Token,
    group: Group,
    object: ChildRef,
    rows: &mut Rows<'_, '_, '_, G>,
    mut members: Members,
    rays: &[u32; ROWS],
    position: &Position,
    stacks: &mut Stacks,
) {
    if rows[0].walker.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
        return;
    }
    if let ObjectRef::Placed(Object::Instance {
        child,
        offset,
        child_from_group: Placement::Still(child_from_group),
        mask: visible,
    }) = group.tree.objects.get(object.index())
        && fits::<W::Half>(W::half_token(token), &rows[0].walker.forest.trees[*child])
    {
        let mut luggage = stacks.spare.pop().unwrap_or_else(Luggage::new);
        let (mut rest, mut inside, mut wanted) = (members, 0, [0; ROWS]);
        while let Some(number) = next(&mut rest) {
            let Row { walker, bundle, .. } = &mut rows[number];
            wanted[number] = walker.visible(rays[number], *visible);
            let (below, groups) = (&mut luggage.bundles[number], (position.group, *child));
            if wanted[number].count_ones() as usize >= MIN_RAYS
                && walker.set_up_in_child::<W>(
                    token,
                    below,
                    bundle,
                    wanted[number],
                    groups,
                    child_from_group,
                )
            {
                inside |= 1 << (8 * number);
            }
        }
        members &= !inside;
        let position = Position { group: *child, instance: group.instance + offset, ..*position };
        while inside != 0 {
            let alike = luggage.alike(inside);
            inside &= !alike;
            walk_inside::<W, G>(token, rows, alike, &wanted, &mut luggage, stacks, position);
        }
        stacks.spare.push(luggage);
    }
    while let Some(number) = next(&mut members) {
        let Row { walker, bundle, .. } = &mut rows[number];
        let (object, single) = (object.index(), &mut stacks.single);
        walker.test_objects::<W>(token, group, object, bundle, rays[number], single);
    }
}

/// Walks an instanced group with bundles that are alike there.
#[inline(always)]
fn walk_inside<W: Lanes16, G: Goal>(
    token: W::Token,
    rows: &mut Rows<'_, '_, '_, G>,
    members: Members,
    wanted: &[u32; ROWS],
    luggage: &mut Luggage,
    stacks: &mut Stacks,
    position: Position,
) {
    let mut outside = [0; ROWS];
    let [a, b, c, d] = &mut *rows;
    let mut below = luggage.rows([a.walker, b.walker, c.walker, d.walker]);
    let mut rest = members;
    while let Some(number) = next(&mut rest) {
        below[number].memory.clear();
        outside[number] = std::mem::replace(&mut below[number].walker.alive, wanted[number]);
    }
    enter::<W, G>(token, &mut below, members, stacks, position);
    let mut rest = members;
    while let Some(number) = next(&mut rest) {
        let Row { walker, bundle, .. } = &mut rows[number];
        let over = wanted[number] & !walker.alive;
        walker.alive = outside[number] & !over;
        bundle.narrow::<W>(token, wanted[number], over, &luggage.bundles[number].cull);
        bundle.update_limits::<W>(token);
    }
}
