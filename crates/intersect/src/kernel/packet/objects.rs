//! Shapes and instances in packet traversal: shapes are tested ray by ray; instances are traversed
//! with packets where possible.

use super::frustum::{Packet, PerRay, RAYS};
use super::walk::{
    Cursor, Group, MAX_PACKETS, Members, PacketGroup, PacketState, PacketStates, Stacks, Walker,
    enter, next,
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
        packet: &mut Packet,
        rays: u32,
        stack: &mut Stack,
    ) {
        let mut culls = [0.0; RAYS];
        let over = self.test_one_by_one::<W::Half>(
            W::half_token(token),
            group,
            object,
            packet,
            rays,
            &mut culls,
            stack,
        );
        self.alive &= !over;
        packet.narrow::<W>(token, rays, over, &culls);
        packet.update_limits::<W>(token);
    }

    /// Tests a shape or instance for some of the rays, one by one. Stores their new padded limits,
    /// and returns the rays whose searches are over.
    #[inline(never)]
    fn test_one_by_one<L: Lanes8>(
        &mut self,
        token: L::Token,
        group: Group,
        object: usize,
        packet: &mut Packet,
        mut rays: u32,
        culls: &mut PerRay<f32>,
        stack: &mut Stack,
    ) -> u32 {
        self.want_rays(packet);
        let mut over = 0;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize & (RAYS - 1);
            rays &= rays - 1;
            self.search(lane);
            let (Some(search), ray) = (&mut self.searches[lane], packet.rays.get(lane)) else {
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

    /// The rays of a subset that may hit an object with this mask.
    #[inline(always)]
    fn visible(&mut self, mut rays: u32, mask: u64) -> u32 {
        if self.masks & mask == 0 {
            for lane in 0..RAYS {
                if rays >> lane & 1 == 1 && self.search(lane).mask & mask == 0 {
                    rays &= !(1 << lane);
                }
            }
        }
        rays
    }

    /// Makes a packet of some of the rays in the coordinates of an instanced group. Returns false
    /// if they do not make a packet there.
    #[inline(always)]
    fn set_up_in_child<W: Lanes16>(
        &self,
        token: W::Token,
        below: &mut Packet,
        packet: &Packet,
        mask: u32,
        (group, child): (usize, usize),
        child_from_group: &DAffine3,
    ) -> bool {
        let rays = packet.lane_rays::<W>(token).mapped(token, child_from_group);
        let cull = W::splat(token, -1.0).replace(mask, W::load(token, &packet.cull));
        let mut points = [Vec3::from_array(packet.kind.apex).as_dvec3(), packet.point().as_dvec3()];
        for point in &mut points {
            *point = child_from_group
                .transform_point3(G::Precision::point_in_group(self.data, group, *point));
        }
        let limits = [W::load(token, &packet.t_min), cull];
        below.set_up_exactly::<W, G::Precision>(
            token,
            rays,
            limits,
            self.data,
            child,
            points,
            &packet.kind,
        )
    }
}

/// Tests a shape or instance for some of the rays of some of the packets. An instance is traversed
/// with packets where possible, together if the packets are coherent in its coordinates.
#[inline(always)]
pub(super) fn enter_object<W: Lanes16, G: Goal>(
    token: W::Token,
    group: Group,
    object: ChildRef,
    states: &mut PacketStates<'_, '_, '_, G>,
    mut members: Members,
    rays: &[u32; MAX_PACKETS],
    cursor: &Cursor,
    stacks: &mut Stacks,
) {
    if states[0].walker.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
        return;
    }
    if let ObjectRef::Placed(Object::Instance {
        child,
        offset,
        child_from_group: Placement::Still(child_from_group),
        mask: visible,
    }) = group.tree.objects.get(object.index())
        && fits::<W::Half>(W::half_token(token), &states[0].walker.forest.trees[*child])
    {
        let mut packet_group = stacks.spare.pop().unwrap_or_else(PacketGroup::new);
        let (mut rest, mut inside, mut wanted) = (members, 0, [0; MAX_PACKETS]);
        while let Some(number) = next(&mut rest) {
            let PacketState { walker, packet, .. } = &mut states[number];
            wanted[number] = walker.visible(rays[number], *visible);
            let (below, groups) = (&mut packet_group.packets[number], (cursor.group, *child));
            if wanted[number].count_ones() as usize >= MIN_RAYS
                && walker.set_up_in_child::<W>(
                    token,
                    below,
                    packet,
                    wanted[number],
                    groups,
                    child_from_group,
                )
            {
                inside |= 1 << (8 * number);
            }
        }
        members &= !inside;
        let cursor = Cursor { group: *child, instance: group.instance + offset, ..*cursor };
        while inside != 0 {
            let coherent = packet_group.coherent(inside);
            inside &= !coherent;
            walk_inside::<W, G>(
                token,
                states,
                coherent,
                &wanted,
                &mut packet_group,
                stacks,
                cursor,
            );
        }
        stacks.spare.push(packet_group);
    }
    while let Some(number) = next(&mut members) {
        let PacketState { walker, packet, .. } = &mut states[number];
        let (object, single) = (object.index(), &mut stacks.single);
        walker.test_objects::<W>(token, group, object, packet, rays[number], single);
    }
}

/// Traverses an instanced group with packets that are coherent in its coordinates.
#[inline(always)]
fn walk_inside<W: Lanes16, G: Goal>(
    token: W::Token,
    states: &mut PacketStates<'_, '_, '_, G>,
    members: Members,
    wanted: &[u32; MAX_PACKETS],
    packet_group: &mut PacketGroup,
    stacks: &mut Stacks,
    cursor: Cursor,
) {
    let mut outside = [0; MAX_PACKETS];
    let [a, b, c, d] = &mut *states;
    let mut below = packet_group.states([a.walker, b.walker, c.walker, d.walker]);
    let mut rest = members;
    while let Some(number) = next(&mut rest) {
        below[number].scratch.clear();
        outside[number] = std::mem::replace(&mut below[number].walker.alive, wanted[number]);
    }
    enter::<W, G>(token, &mut below, members, stacks, cursor);
    let mut rest = members;
    while let Some(number) = next(&mut rest) {
        let PacketState { walker, packet, .. } = &mut states[number];
        let over = wanted[number] & !walker.alive;
        walker.alive = outside[number] & !over;
        packet.narrow::<W>(token, wanted[number], over, &packet_group.packets[number].cull);
        packet.update_limits::<W>(token);
    }
}
