//! Moves batches of paths and light rays through homogeneous media without emission, with the same
//! bits as [`super::Walker`].

use super::Numbers;
use crate::integrator::dimension;
use crate::lanes::{LANES, ZERO, color_at, put_color};
use crate::sampler::{BatchRandoms, Random, Sampler};
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::Wide;
use snell_math::{SampledSpectrum, Vec2, at_level};
use snell_scene::medium::{
    HenyeyGreenstein, MediumProperties, Scattering, attenuate_homogeneous, travel_homogeneous,
};

/// The segments of a batch. Arrays are by lane; unused lanes hold arbitrary values.
#[derive(Debug)]
pub struct HomogeneousBatch {
    /// Index of the path or light ray of each lane.
    whose: Vec<u32>,
    phase: [HenyeyGreenstein; LANES],
    ways: Ways,
    /// The first random numbers on the way of each path to its next vertex.
    randoms: BatchRandoms<LANES>,
    /// The lanes whose paths have used those numbers already, with their further numbers.
    later: Vec<(usize, Numbers)>,
    wide: Wide,
}

#[derive(Debug)]
struct Ways {
    sigma_t: HitVectors,
    sigma_s: HitVectors,
    length: HitLanes,
    /// By channel, the throughput of each path or the value of each light ray: at the start of the
    /// segment before `travel` or `attenuate` is called, and at the end of the segment afterwards.
    color: HitVectors,
    /// The distance at which each path was scattered.
    distance: HitLanes,
    is_scattered: [u32; LANES],
}

impl HomogeneousBatch {
    /// An empty batch, with random numbers of this sampler.
    pub fn new(sampler: &Sampler, wide: Wide) -> Self {
        let (length, distance, is_scattered) = ([0.0; LANES], [0.0; LANES], [0; LANES]);
        Self {
            whose: Vec::new(),
            phase: [HenyeyGreenstein::new(0.0); LANES],
            ways: Ways {
                sigma_t: ZERO,
                sigma_s: ZERO,
                length,
                color: ZERO,
                distance,
                is_scattered,
            },
            randoms: BatchRandoms::new(sampler, 0),
            later: Vec::new(),
            wide,
        }
    }

    /// Sets the depth of the vertices to which the next segments lead.
    pub fn start(&mut self, sampler: &Sampler, depth: u32) {
        self.randoms.start(sampler, depth);
        self.clear();
    }

    /// Empties all lanes.
    pub fn clear(&mut self) {
        self.whose.clear();
        self.later.clear();
    }

    /// True if all lanes are in use.
    pub fn is_full(&self) -> bool {
        self.whose.len() == LANES
    }

    /// The index of the path or light ray in each lane in use.
    pub fn whose(&self) -> &[u32] {
        &self.whose
    }

    /// Puts a light ray into the next lane.
    #[inline(always)]
    pub fn push(
        &mut self,
        whose: u32,
        medium: &MediumProperties,
        length: f32,
        value: SampledSpectrum,
    ) {
        let lane = self.whose.len() % LANES;
        self.whose.push(whose);
        put_color(&mut self.ways.sigma_t, lane, medium.sigma_t());
        put_color(&mut self.ways.color, lane, value);
        self.ways.length[lane] = length;
    }

    /// Puts a path into the next lane. `step` random numbers of the way to its vertex have been
    /// used already.
    #[inline(always)]
    pub fn push_path(
        &mut self,
        whose: u32,
        medium: &MediumProperties,
        length: f32,
        throughput: SampledSpectrum,
        random: &Random,
        step: u32,
    ) {
        let lane = self.whose.len() % LANES;
        put_color(&mut self.ways.sigma_s, lane, medium.sigma_s);
        self.phase[lane] = medium.phase;
        self.randoms.set(lane, random.key());
        if step > 0 {
            self.later.push((lane, Numbers::of_path(*random, step)));
        }
        self.push(whose, medium, length, throughput);
    }

    /// Moves all paths along their segments.
    pub fn travel(&mut self) {
        let mut u = self.randoms.pairs(dimension::MEDIUM, Some(self.wide));
        for (lane, numbers) in &mut self.later {
            [u[0][*lane], u[1][*lane]] = numbers.next().to_array();
        }
        at_level!(
            Some(self.wide),
            travel,
            (u: &[HitLanes; 2] = &u, ways: &mut Ways = &mut self.ways)
        );
    }

    /// Moves all light rays along their segments.
    pub fn attenuate(&mut self) {
        at_level!(Some(self.wide), attenuate, (ways: &mut Ways = &mut self.ways));
    }

    /// The throughput or value of a lane at the end of its segment.
    #[inline(always)]
    pub fn color(&self, lane: usize) -> SampledSpectrum {
        color_at(&self.ways.color, lane % LANES)
    }

    /// Where the path of a lane was scattered; `None` if it was not.
    #[inline(always)]
    pub fn scattered(&self, lane: usize) -> Option<Scattering> {
        let lane = lane % LANES;
        let scattering = Scattering { distance: self.ways.distance[lane], phase: self.phase[lane] };
        (self.ways.is_scattered[lane] != 0).then_some(scattering)
    }
}

#[inline(always)]
fn travel(u: &[HitLanes; 2], ways: &mut Ways) {
    for i in 0..LANES {
        let color = |v: &HitVectors| [v[0][i], v[1][i], v[2][i]];
        let (sigma_t, sigma_s, throughput) =
            (color(&ways.sigma_t), color(&ways.sigma_s), color(&ways.color));
        let travel = travel_homogeneous(
            sigma_t,
            sigma_s,
            ways.length[i],
            throughput,
            Vec2::new(u[0][i], u[1][i]),
        );
        for channel in 0..3 {
            ways.color[channel][i] = travel.throughput[channel];
        }
        ways.distance[i] = travel.distance;
        ways.is_scattered[i] = u32::from(travel.is_scattered);
    }
}

#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
fn attenuate(ways: &mut Ways) {
    for i in 0..LANES {
        let color = |v: &HitVectors| [v[0][i], v[1][i], v[2][i]];
        let left = attenuate_homogeneous(color(&ways.sigma_t), ways.length[i], color(&ways.color));
        for channel in 0..3 {
            ways.color[channel][i] = left[channel];
        }
    }
}
