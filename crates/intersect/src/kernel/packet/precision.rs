//! The parts of packet traversal that differ between single and double precision.

use super::certain::{CertainHits, Decided};
use super::exact::{Found, Pairs};
use super::exact_rays::LaneRays;
use super::frustum::{Packet, PerRay};
use super::{certain, doubles, exact, runs};
use crate::kernel::single::filter::BlockFilter;
use crate::precision::frame::Frame;
use crate::precision::{Double, DoubleData, Single};
use crate::tree::GroupTree;
use snell_math::simd::{Lanes16, WideLanes};
use snell_math::{DRay, Ray};

/// Makes packets from rays of a precision, and tests them exactly.
pub(crate) trait PacketTests: BlockFilter {
    /// Maps sixteen rays of a group to the coordinates of the group's structures; see
    /// [`Self::ray_in_structure`].
    fn rays_in_structure<W: Lanes16>(
        token: W::Token,
        data: &Self::Data,
        group: usize,
        rays: LaneRays<W>,
    ) -> LaneRays<W>;

    /// Makes a packet of a run of rays in the root group, described relative to the start or end of
    /// `anchor` if possible. Returns false if the rays do not make a packet. Lanes without a ray
    /// repeat the first ray, with a search that is over.
    fn set_up_packet<W: Lanes16>(
        token: W::Token,
        data: &Self::Data,
        packet: &mut Packet,
        rays: &[Self::Ray],
        anchor: &Self::Ray,
        backward: bool,
    ) -> bool;

    /// The exact test for up to eight pairs of a ray of the packet and a triangle of the tree
    /// ([`exact::exact_hits`]). The rows of the rays must have been written if [triangles are
    /// elsewhere](Self::TRIANGLES_ELSEWHERE).
    fn exact_hits<W: Lanes16>(
        token: W::Token,
        data: &Self::Data,
        tree: &GroupTree,
        packet: &Packet,
        pairs: &Pairs,
        found: &mut Found<Self::Real>,
    );

    /// The exact test for some rays of the packet, each with the triangle of the tree that it
    /// certainly hits, or whose projection it certainly hits ([`certain::test`]).
    fn certain_hits<W: Lanes16>(
        token: W::Token,
        tree: &GroupTree,
        packet: &Packet,
        rays: [u32; 2],
        places: &PerRay<u32>,
        certain: &mut CertainHits<Self::Real>,
    ) -> Decided;
}

impl PacketTests for Single {
    #[inline(always)]
    fn rays_in_structure<W: Lanes16>(
        _: W::Token,
        _: &(),
        _: usize,
        rays: LaneRays<W>,
    ) -> LaneRays<W> {
        rays
    }

    #[inline(always)]
    fn set_up_packet<W: Lanes16>(
        token: W::Token,
        _: &(),
        packet: &mut Packet,
        rays: &[Ray],
        anchor: &Ray,
        backward: bool,
    ) -> bool {
        runs::set_up::<W>(token, packet, rays, anchor, backward)
    }

    #[inline(always)]
    fn exact_hits<W: Lanes16>(
        token: W::Token,
        _: &(),
        tree: &GroupTree,
        packet: &Packet,
        pairs: &Pairs,
        found: &mut Found<f32>,
    ) {
        exact::exact_hits::<W>(token, &tree.blocks, packet, pairs, found)
    }

    #[inline(always)]
    fn certain_hits<W: Lanes16>(
        token: W::Token,
        tree: &GroupTree,
        packet: &Packet,
        rays: [u32; 2],
        places: &PerRay<u32>,
        certain: &mut CertainHits<f32>,
    ) -> Decided {
        certain::test::<W>(token, &tree.blocks, packet, rays, places, certain)
    }
}

impl PacketTests for Double {
    #[inline(always)]
    fn rays_in_structure<W: Lanes16>(
        token: W::Token,
        data: &DoubleData,
        group: usize,
        rays: LaneRays<W>,
    ) -> LaneRays<W> {
        let Frame { center, scale, .. } = &data.frames[group];
        rays.framed(token, center, *scale)
    }

    #[inline(always)]
    fn set_up_packet<W: Lanes16>(
        token: W::Token,
        data: &DoubleData,
        packet: &mut Packet,
        rays: &[DRay],
        _: &DRay,
        backward: bool,
    ) -> bool {
        runs::set_up_doubles::<W>(token, data, packet, rays, backward)
    }

    #[inline(always)]
    fn exact_hits<W: Lanes16>(
        token: W::Token,
        data: &DoubleData,
        tree: &GroupTree,
        packet: &Packet,
        pairs: &Pairs,
        found: &mut Found<f64>,
    ) {
        doubles::exact_hits::<<W::Half as WideLanes>::Doubles>(
            W::half_token(token),
            data,
            tree,
            packet,
            pairs,
            found,
        )
    }

    #[inline(always)]
    fn certain_hits<W: Lanes16>(
        _: W::Token,
        _: &GroupTree,
        _: &Packet,
        _: [u32; 2],
        _: &PerRay<u32>,
        _: &mut CertainHits<f64>,
    ) -> Decided {
        Decided { hits: 0, moved: 0 }
    }
}
