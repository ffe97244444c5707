//! Triangles of leaves in packet traversal: some are certainly missed, some are certainly hit, and
//! the others are tested exactly.

use super::certain::Decided;
use super::edges::EdgeTests;
use super::exact::{PAIRS, Pairs};
use super::frustum::{Packet, PerRay, RAYS};
use super::leaf::{Leaf, SeenBlock, TriangleHits, Wanted};
use super::projection;
use super::walk::{Group, Scratch, Walker};
use crate::exact::TriangleTest;
use crate::exact::ray::LocalRay;
use crate::group::test_triangle;
use crate::kernel::Goal;
use crate::kernel::packet::PacketTests;
use crate::precision::Facts;
use crate::precision::Real;
use crate::search::padded;
use crate::search::{RealOf, Verdict};
use snell_math::simd::Lanes16;
use std::mem::MaybeUninit;

/// Up to this number of rays, the triangles of a block that rays may hit are found by testing the
/// rays one or two at a time against all triangles; with more rays, all rays are tested together.
/// The second limit is for occlusion queries, per register that a vector of sixteen takes.
const FEW_RAYS: u32 = 6;
const FEW_RAYS_OF_ANY: u32 = 4;

/// The number of untested pairs beyond which they are tested, for nearest-hit queries.
const DEFERRED_PAIRS: usize = 6;

impl<G: Goal> Walker<'_, '_, G> {
    /// True if only the nearest hit counts: where it is certain which triangle that is, exact tests
    /// of other triangles are saved.
    const DEFERS: bool = G::NARROWS && G::WANTS_ONE;

    /// Tests the triangles of a block for some of the rays. Exact tests of pairs may be postponed,
    /// because most of them become unnecessary.
    #[inline(always)]
    pub(super) fn test_triangles<W: Lanes16>(
        &mut self,
        token: W::Token,
        group: Group,
        leaf: &mut Leaf<W>,
        packet: &mut Packet,
        rays: u32,
        scratch: &mut Scratch,
    ) {
        let few = self.few_rays::<W>();
        let by_ray = !packet.packet_rays.separate && (!Self::DEFERS || rays.count_ones() <= few);
        let mut found = if G::ANY {
            self.find_any::<W>(token, group, leaf, packet, rays, scratch)
        } else if by_ray {
            self.find_pairs_of_origin::<W>(token, group, leaf, packet, rays, scratch)
        } else {
            self.find_pairs::<W>(token, group, leaf, packet, rays, scratch)
        };
        if scratch.pairs.count != 0 && self.is_urgent::<W>(token, packet, &scratch.pairs) {
            found |= self.test_pairs::<W>(
                token,
                group,
                packet,
                &mut scratch.pairs,
                &mut scratch.locals,
                false,
            );
        }
        if found {
            packet.update_limits::<W>(token);
        }
    }

    /// The limit [`FEW_RAYS`], or all rays where [triangles are small](super::trial::Detail).
    #[inline(always)]
    fn few_rays<W: Lanes16>(&self) -> u32 {
        if G::ANY {
            FEW_RAYS_OF_ANY * W::REGISTERS
        } else if self.is_small {
            RAYS as u32
        } else {
            FEW_RAYS
        }
    }

    /// True if the exact tests of pairs must not be postponed further.
    #[inline(always)]
    fn is_urgent<W: Lanes16>(&self, token: W::Token, packet: &Packet, pairs: &Pairs) -> bool {
        if G::ANY {
            // When most rays have finished, the packet is no longer efficient for the others.
            return 2 * pairs.count >= self.alive.count_ones() as usize;
        }
        // As long as any other ray has no hit, the packet must continue anyway.
        !Self::DEFERS
            || pairs.count > DEFERRED_PAIRS
            || packet.endless::<W>(token) & !pairs.mask == 0
    }

    /// Finds the triangles of a block that rays with a common origin may hit. Returns true if pairs
    /// were tested because their buffer was full, and some hits counted.
    #[inline(always)]
    fn find_pairs_of_origin<W: Lanes16>(
        &mut self,
        token: W::Token,
        group: Group,
        leaf: &mut Leaf<W>,
        packet: &mut Packet,
        mut rays: u32,
        scratch: &mut Scratch,
    ) -> bool {
        let mut found = false;
        let (place, used) = (leaf.place, leaf.used);
        let seen = leaf.of_origin::<G::Precision>(token, packet);
        while rays != 0 {
            let ray = rays.trailing_zeros();
            rays &= rays - 1;
            let mut triangles = seen.candidates(
                W::half_token(token),
                &packet.packet_rays,
                ray as usize & (RAYS - 1),
            ) & used;
            // Mostly there is exactly one triangle.
            loop {
                scratch.pairs.push_if(
                    ray,
                    place + (triangles.trailing_zeros() & 7),
                    triangles != 0,
                );
                if scratch.pairs.is_full() {
                    found |= self.test_pairs::<W>(
                        token,
                        group,
                        packet,
                        &mut scratch.pairs,
                        &mut scratch.locals,
                        false,
                    );
                }
                triangles &= triangles.wrapping_sub(1);
                if triangles == 0 {
                    break;
                }
            }
        }
        found
    }

    /// Finds the triangles of a block that rays may hit, and those that rays certainly hit. Returns
    /// true if any hit has already changed the packet.
    #[inline(always)]
    fn find_pairs<W: Lanes16>(
        &mut self,
        token: W::Token,
        group: Group,
        leaf: &mut Leaf<W>,
        packet: &mut Packet,
        mut rays: u32,
        scratch: &mut Scratch,
    ) -> bool {
        let mut found = false;
        let (block, place, mut triangles) = (leaf.block, leaf.place, leaf.used);
        let seen = leaf.seen::<G::Precision>(
            token,
            packet,
            Wanted { planes: packet.packet_rays.separate, depths: true },
        );
        if rays.count_ones() <= self.few_rays::<W>() {
            triangles &= near_few::<W>(token, seen, packet, rays);
        } else {
            triangles &= seen.near_packet::<W::Half>(W::half_token(token), packet);
            self.counted = [self.counted[0] + 1, self.counted[1] + triangles.count_ones()];
        }
        while triangles != 0 {
            let triangle = triangles.trailing_zeros();
            triangles &= triangles - 1;
            let TriangleHits { mut possible, certain, nearer, low, high } =
                seen.hits::<W>(token, &packet.packet_rays, triangle as usize, rays);
            if possible == 0 {
                continue;
            }
            let (id, mut projected) = (block.ids[triangle as usize & 7], 0);
            if Self::DEFERS && possible & !certain != 0 {
                possible &= !(self.deferred.rays & W::places_of(token, id, &self.deferred.ids));
                if !G::Precision::TRIANGLES_ELSEWHERE
                    && possible & !certain != 0
                    && packet.is_aligned
                {
                    let [inside, outside] =
                        projection::sides::<W>(token, block, triangle as usize, packet);
                    possible &= !outside;
                    projected = nearer & possible & inside & !certain;
                }
            }
            let hit = certain | projected;
            if hit != 0
                && Self::DEFERS
                && !packet.kind.reversed
                && self.is_plain(group.tree.triangle(id).0)
            {
                W::write_where(token, hit, place + triangle, &mut self.deferred.triangles);
                W::write_where(token, hit, id, &mut self.deferred.ids);
                self.deferred.rays |= hit;
                self.deferred.projected = self.deferred.projected & !hit | projected;
                packet.tighten_to(token, hit, low, high);
                possible &= !hit;
                found = true;
            }
            found |=
                self.push_pairs::<W>(token, group, packet, possible, place + triangle, scratch);
            rays &= self.alive;
        }
        found
    }

    /// For occlusion queries, ends the searches of rays that certainly hit a triangle of a block,
    /// and finds the triangles that others may hit. Returns true if any hit has already changed the
    /// packet.
    #[inline(always)]
    fn find_any<W: Lanes16>(
        &mut self,
        token: W::Token,
        group: Group,
        leaf: &mut Leaf<W>,
        packet: &mut Packet,
        mut rays: u32,
        scratch: &mut Scratch,
    ) -> bool {
        let (block, place, mut triangles) = (leaf.block, leaf.place, leaf.used);
        let seen = leaf.seen::<G::Precision>(token, packet, Wanted { planes: true, depths: false });
        if rays.count_ones() <= self.few_rays::<W>() {
            triangles &= near_few::<W>(token, seen, packet, rays);
        } else {
            if !self.is_small || W::REGISTERS > 1 {
                triangles &= seen.near_packet::<W::Half>(W::half_token(token), packet);
                self.counted = [self.counted[0] + 1, self.counted[1] + triangles.count_ones()];
            }
            // Most rays come close only to the triangle on which they start, which is behind their
            // start.
            triangles = seen.near_any::<W>(token, &packet.packet_rays, rays, triangles);
        }
        if triangles == 0 {
            return false;
        }
        let EdgeTests { mut near, mut certain, rays: edge_tests } =
            seen.edge_tests::<W>(token, &packet.packet_rays, rays, triangles);
        let mut hit = 0;
        while certain != 0 {
            let triangle = certain.trailing_zeros() as usize & 7;
            certain &= certain - 1;
            if self.is_plain(group.tree.triangle(block.ids[triangle]).0) {
                hit |= edge_tests[triangle][1];
            }
        }
        let mut found = hit != 0;
        if found {
            self.take_any::<W>(token, hit, packet);
            rays &= !hit;
        }
        while near != 0 {
            let triangle = near.trailing_zeros();
            near &= near - 1;
            let possible = edge_tests[triangle as usize & 7][0] & rays;
            found |=
                self.push_pairs::<W>(token, group, packet, possible, place + triangle, scratch);
            rays &= self.alive;
        }
        found
    }

    /// Adds pairs of some rays and one triangle. Returns true if pairs were tested because their
    /// buffer was full, and some hits counted.
    #[inline(always)]
    fn push_pairs<W: Lanes16>(
        &mut self,
        token: W::Token,
        group: Group,
        packet: &mut Packet,
        mut rays: u32,
        triangle: u32,
        scratch: &mut Scratch,
    ) -> bool {
        let mut found = false;
        while rays != 0 {
            scratch.pairs.push(rays.trailing_zeros(), triangle);
            rays &= rays - 1;
            if scratch.pairs.is_full() {
                found |= self.test_pairs::<W>(
                    token,
                    group,
                    packet,
                    &mut scratch.pairs,
                    &mut scratch.locals,
                    false,
                );
                rays &= self.alive;
            }
        }
        found
    }

    /// True if hits on a geometry count for all rays of the run, because it is not filtered and
    /// every mask admits it.
    #[inline(always)]
    fn is_plain(&self, geometry: u32) -> bool {
        let options = &self.options[geometry as usize];
        options.mask & self.masks != 0 && !options.filtered
    }

    /// Ends the searches of rays that certainly hit a triangle that counts.
    #[inline(always)]
    fn take_any<W: Lanes16>(&mut self, token: W::Token, rays: u32, packet: &mut Packet) {
        self.alive &= !rays;
        self.hit |= rays;
        packet.finish::<W>(token, rays);
    }

    /// Tests the deferred hits. If `last` is true, nothing follows in the root group, and for rays
    /// without a search the hits are only recorded; otherwise [`Packet::update_limits`] must
    /// follow.
    #[inline(always)]
    pub(super) fn test_deferred<W: Lanes16>(
        &mut self,
        token: W::Token,
        group: Group,
        packet: &mut Packet,
        locals: &mut Locals,
        last: bool,
    ) {
        if !Self::DEFERS {
            return;
        }
        let mut rays = std::mem::take(&mut self.deferred.rays);
        if rays != 0 && packet.is_aligned {
            let mut outcome = Outcome::NONE;
            let Decided { mut hits, moved } = G::Precision::certain_hits::<W>(
                token,
                group.tree,
                packet,
                [rays, self.deferred.projected],
                &self.deferred.triangles,
                &mut self.certain_hits,
            );
            rays &= !hits & !moved;
            self.unresolved |= moved;
            outcome.over |= moved;
            if last {
                self.certain = hits & !self.searched & !self.hit;
                hits &= !self.certain;
            }
            while hits != 0 {
                let ray = hits.trailing_zeros() as usize & (RAYS - 1);
                hits &= hits - 1;
                let (t, b) = (
                    self.certain_hits.t[ray],
                    [self.certain_hits.b1[ray], self.certain_hits.b2[ray]],
                );
                self.offer(group, ray, self.deferred.triangles[ray], t, b, &mut outcome);
            }
            self.conclude::<W>(token, packet, &outcome, last);
        }
        while rays != 0 {
            let mut pairs = Pairs::NONE;
            while rays != 0 && !pairs.is_full() {
                let ray = rays.trailing_zeros();
                rays &= rays - 1;
                pairs.push(ray, self.deferred.triangles[ray as usize & (RAYS - 1)]);
            }
            self.test_pairs::<W>(token, group, packet, &mut pairs, locals, last);
        }
    }

    /// Offers the hits of pairs of rays and triangles, and clears the pairs. Returns true if any
    /// hit counts. If `last` is true, nothing follows, and the packet is not updated.
    #[inline(always)]
    pub(super) fn test_pairs<W: Lanes16>(
        &mut self,
        token: W::Token,
        group: Group,
        packet: &mut Packet,
        pairs: &mut Pairs,
        locals: &mut Locals,
        last: bool,
    ) -> bool {
        let all = u32::MAX >> (32 - pairs.count);
        let mut outcome = Outcome::NONE;
        (self.found.hits, self.found.uncertain) = (0, all);
        if packet.is_aligned {
            self.found.uncertain = 0;
            if G::Precision::TRIANGLES_ELSEWHERE {
                self.want_rays(packet);
            }
            G::Precision::exact_hits::<W>(
                token,
                self.data,
                group.tree,
                packet,
                pairs,
                &mut self.found,
            );
        }
        let (mut hits, mut uncertain) = (self.found.hits & all, self.found.uncertain & all);
        while hits != 0 {
            let pair = hits.trailing_zeros() as usize & (PAIRS - 1);
            hits &= hits - 1;
            let ray = pairs.rays[pair] as usize & (RAYS - 1);
            let (t, b) = (self.found.t[pair], [self.found.b1[pair], self.found.b2[pair]]);
            self.offer(group, ray, pairs.triangles[pair], t, b, &mut outcome);
        }
        if uncertain != 0 {
            self.want_rays(packet);
        }
        while uncertain != 0 {
            let pair = uncertain.trailing_zeros() as usize & (PAIRS - 1);
            uncertain &= uncertain - 1;
            let ray = pairs.rays[pair] as usize & (RAYS - 1);
            if (self.alive & !outcome.over) >> ray & 1 == 0 {
                continue;
            }
            let (block, triangle) = pairs.place(pair);
            let blocks = &group.tree.blocks;
            let ids = || {
                let (geometry, primitive) = group.tree.triangle(blocks.id(block, triangle));
                [group.instance, geometry, primitive]
            };
            let (local, search) = (locals.get(packet, ray), self.search(ray));
            let is_over = test_triangle(search, local, &blocks.corners(block, triangle), ids);
            outcome.note(ray, search.cull(), is_over);
        }
        pairs.clear();
        self.conclude::<W>(token, packet, &outcome, last)
    }

    /// Offers a hit on the triangle at a place.
    #[inline(always)]
    fn offer(
        &mut self,
        group: Group,
        ray: usize,
        place: u32,
        t: RealOf<G>,
        b: [RealOf<G>; 2],
        outcome: &mut Outcome,
    ) {
        if (self.alive & !outcome.over) >> ray & 1 == 0 {
            return;
        }
        let (geometry, primitive) = group.tree.triangle_at(place);
        if !G::WANTS_ONE || self.searched >> ray & 1 == 1 || !self.is_plain(geometry) {
            let search = self.search(ray);
            if t <= search.goal.limit() {
                let verdict =
                    search.offer(G::Precision::found(t, b, [group.instance, geometry, primitive]));
                outcome.note(ray, search.cull(), verdict == Verdict::Finished);
            }
            return;
        }
        // For rays without a search, the same decisions as in [`crate::search::Search::offer`].
        let [start, end] = G::Precision::interval(&self.rays[ray]);
        let (nearest, is_met) = (&mut self.nearest[ray], self.hit >> ray & 1 == 1);
        let limit = if is_met { G::Precision::t(nearest) } else { end };
        if t > limit || t <= start {
            return;
        }
        let hit = G::Precision::found(t, b, [group.instance, geometry, primitive]);
        let hit =
            if self.options[geometry as usize].quads { G::Precision::quad_hit(&hit) } else { hit };
        if t < limit || (is_met && G::Precision::is_before(&hit, nearest)) {
            *nearest = hit;
            self.hit |= 1 << ray;
            outcome.note(ray, padded(t.above()), G::ANY);
        }
    }

    /// Updates the packet with the results of tests, and returns true if it changes. If `last` is
    /// true, nothing follows, and the packet is not updated.
    #[inline(always)]
    fn conclude<W: Lanes16>(
        &mut self,
        token: W::Token,
        packet: &mut Packet,
        outcome: &Outcome,
        last: bool,
    ) -> bool {
        let Outcome { nearer, over, culls } = outcome;
        self.alive &= !over;
        let is_narrowed = !last && (*over != 0 || (G::NARROWS && *nearer != 0));
        if is_narrowed {
            packet.narrow::<W>(token, *nearer, *over, culls);
        }
        is_narrowed
    }
}

/// The triangles of a block that any of a few rays may hit.
#[inline(always)]
fn near_few<W: Lanes16>(token: W::Token, seen: &SeenBlock, packet: &Packet, mut rays: u32) -> u32 {
    let mut near = 0;
    while rays != 0 {
        near |= seen.near_two::<W>(token, &packet.packet_rays, &mut rays);
    }
    near | near >> 8
}

/// The results of tests, by ray.
struct Outcome {
    /// The rays whose limits may have come nearer.
    nearer: u32,
    /// The rays whose searches are over.
    over: u32,
    /// The new padded limits of all rays in `nearer` and `over`.
    culls: PerRay<f32>,
}

impl Outcome {
    const NONE: Self = Self { nearer: 0, over: 0, culls: [0.0; RAYS] };

    #[inline(always)]
    fn note(&mut self, ray: usize, cull: f32, is_over: bool) {
        self.culls[ray] = cull;
        self.nearer |= 1 << ray;
        self.over |= u32::from(is_over) << ray;
    }
}

/// The data of the rays for the exact test, computed when needed.
pub(super) struct Locals {
    pub(super) built: u32,
    rays: [MaybeUninit<LocalRay>; RAYS],
}

impl Locals {
    /// No rays yet. (Not a constant, because copying one would clear all of it for each packet.)
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { built: 0, rays: [const { MaybeUninit::uninit() }; RAYS] }
    }

    /// Forgets the computed rays.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.built = 0;
    }

    #[inline(always)]
    pub(super) fn get(&mut self, packet: &Packet, lane: usize) -> &LocalRay {
        if self.built >> lane & 1 == 0 {
            self.built |= 1 << lane;
            self.rays[lane].write(LocalRay::new(&packet.rays.get(lane)));
        }
        // SAFETY: the bit of `lane` in `built` is set, which is done only here, beside the write.
        unsafe { self.rays[lane].assume_init_ref() }
    }
}
