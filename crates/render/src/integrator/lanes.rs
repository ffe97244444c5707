//! Vertices side by side, for what works on many at once: where paths have come to surfaces, and what they carry.

use super::carried::{Carried, Rest};
use super::path::{MAX_SURVIVAL, ROULETTE_DEPTH};
use super::{Context, dimension};
use crate::sampler::{ManyRandoms, Random, Sampler};
use snell_intersect::triangles::{HitLanes, HitVectors, TRIANGLE_HITS};
use snell_intersect::{Hit, SphereHits, SurfaceInteraction, TriangleHits, TrianglePoints};
use snell_math::simd::{Wide, least};
use snell_math::{Ray, SampledSpectrum, Vec3};

/// Most vertices at once.
pub const LANES: usize = TRIANGLE_HITS;

/// A vector of zero in every lane.
pub const ZERO: HitVectors = [[0.0; LANES]; 3];

/// A path that has come to a surface.
#[derive(Clone, Copy, Debug)]
pub struct Arriving<'a> {
    /// Its last ray.
    pub ray: &'a Ray,
    /// What that has hit.
    pub hit: &'a Hit,
    /// The path so far.
    pub carried: &'a Carried,
    pub rest: &'a Rest,
    /// Its numbers.
    pub random: &'a Random,
}

/// Vertices on surfaces. Arrays are by lane; those of lanes that are not in use hold anything.
#[derive(Debug)]
pub struct VertexLanes {
    triangles: TriangleHits,
    spheres: SphereHits,
    /// Of all vertices, once they are [placed](Self::place).
    pub points: TrianglePoints,
    /// What is known already of lanes that are not on plain triangles or spheres.
    others: Vec<(usize, OtherPoint)>,
    /// Direction to where the path comes from.
    pub wo: HitVectors,
    pub carried: CarriedLanes,
    pub randoms: ManyRandoms<LANES>,
    pub wide: Option<Wide>,
}

/// Of [`Carried`], what is needed.
#[derive(Debug)]
pub struct CarriedLanes {
    /// By channel.
    pub throughput: HitVectors,
    pub eta_scale: HitLanes,
    /// At the vertex.
    pub cone_width: HitLanes,
    pub cone_spread: HitLanes,
}

/// What [`SurfaceInteraction`] says of a point, as far as it matters here.
#[derive(Clone, Copy, Debug)]
pub struct OtherPoint {
    position: Vec3,
    position_error: Vec3,
    geometric_normal: Vec3,
    shading_normal: Vec3,
}

impl OtherPoint {
    /// Of a surface with this shading normal.
    pub fn of(surface: &SurfaceInteraction, shading_normal: Vec3) -> Self {
        let SurfaceInteraction { position, position_error, geometric_normal, .. } = *surface;
        Self { position, position_error, geometric_normal, shading_normal }
    }
}

/// Russian roulette of many vertices: their numbers, if it plays at their depth.
#[derive(Debug)]
pub struct Roulette {
    plays: bool,
    numbers: HitLanes,
}

impl Roulette {
    /// What a lane's throughput is multiplied with, and whether its path goes on; `weight` is what [`super::path::survival`] asks for.
    #[inline(always)]
    pub fn survival(&self, lane: usize, weight: f32) -> (f32, bool) {
        let survival = if self.plays { least(weight, MAX_SURVIVAL) } else { 1.0 };
        (1.0 / survival, self.numbers[lane] < survival)
    }
}

impl VertexLanes {
    /// For vertices of one depth.
    pub fn new(sampler: &Sampler, wide: Option<Wide>) -> Self {
        let zero = [0.0; LANES];
        let carried = CarriedLanes { throughput: ZERO, eta_scale: zero, cone_width: zero, cone_spread: zero };
        Self {
            triangles: TriangleHits::default(),
            spheres: SphereHits::default(),
            points: TrianglePoints::default(),
            others: Vec::new(),
            wo: ZERO,
            carried,
            randoms: ManyRandoms::new(sampler, 0),
            wide,
        }
    }

    /// The following vertices are of this depth.
    pub fn start(&mut self, sampler: &Sampler, depth: u32) {
        self.randoms = ManyRandoms::new(sampler, depth);
        self.spheres.clear();
        self.others.clear();
    }

    /// Puts a path into a lane.
    #[inline(always)]
    pub fn gather(&mut self, lane: usize, path: &Arriving) {
        let &Arriving { ray, hit, carried, random, .. } = path;
        put(&mut self.wo, lane, -ray.direction);
        self.randoms.set(lane, random);
        put_color(&mut self.carried.throughput, lane, carried.throughput);
        self.carried.eta_scale[lane] = carried.eta_scale;
        self.carried.cone_width[lane] = carried.cone_width + carried.cone_spread * hit.t;
        self.carried.cone_spread[lane] = carried.cone_spread;
    }

    /// Puts the point of a path into a lane, if it is on a surface that has no colours of its own: a triangle or a shape that is not
    /// instanced. False, and nothing is done, elsewhere.
    #[inline(always)]
    pub fn gather_point(&mut self, context: &Context, lane: usize, path: &Arriving) -> bool {
        let world = &context.scene.world;
        world.gather_triangle(path.hit, lane, &mut self.triangles)
            || world.gather_sphere(path.ray, path.hit, lane, &mut self.spheres)
            || self.gather_shape(context, lane, path)
    }

    #[inline(never)]
    fn gather_shape(&mut self, context: &Context, lane: usize, path: &Arriving) -> bool {
        let Some(point) = context.scene.world.shape_point(path.ray, path.hit) else { return false };
        self.put_point(
            lane,
            OtherPoint {
                position: point.position,
                position_error: point.position_error,
                geometric_normal: point.geometric_normal,
                shading_normal: point.geometric_normal,
            },
        );
        true
    }

    /// Puts a point that is known already into a lane.
    pub fn put_point(&mut self, lane: usize, point: OtherPoint) {
        self.others.push((lane, point));
    }

    /// Works out the points of all lanes.
    pub fn place(&mut self) {
        self.triangles.points(&mut self.points, self.wide);
        self.spheres.points(&mut self.points, self.wide);
        for &(lane, ref other) in &self.others {
            put(&mut self.points.position, lane, other.position);
            put(&mut self.points.position_error, lane, other.position_error);
            put(&mut self.points.geometric_normal, lane, other.geometric_normal);
            put(&mut self.points.shading_normal, lane, other.shading_normal);
            self.points.is_sound[lane] = 1;
        }
    }

    /// Russian roulette at this depth.
    pub fn roulette(&self, depth: u32) -> Roulette {
        let plays = depth >= ROULETTE_DEPTH;
        let numbers = match plays {
            true => self.randoms.numbers(dimension::ROULETTE, self.wide),
            false => [0.0; LANES],
        };
        Roulette { plays, numbers }
    }
}

/// The vector of a lane.
#[inline(always)]
pub fn at(v: &HitVectors, lane: usize) -> Vec3 {
    Vec3::new(v[0][lane], v[1][lane], v[2][lane])
}

/// Puts a vector into a lane.
#[inline(always)]
pub fn put(v: &mut HitVectors, lane: usize, to: Vec3) {
    (v[0][lane], v[1][lane], v[2][lane]) = (to.x, to.y, to.z);
}

/// The spectrum of a lane, of [`snell_math::ColorMode::Rgb`].
#[inline(always)]
pub fn color_at(v: &HitVectors, lane: usize) -> SampledSpectrum {
    SampledSpectrum([v[0][lane], v[1][lane], v[2][lane], 0.0])
}

/// Puts a spectrum of [`snell_math::ColorMode::Rgb`] into a lane.
#[inline(always)]
pub fn put_color(v: &mut HitVectors, lane: usize, to: SampledSpectrum) {
    (v[0][lane], v[1][lane], v[2][lane]) = (to.0[0], to.0[1], to.0[2]);
}

/// The lanes that are marked, of those given.
pub fn keep(lanes: &[u32], marks: &[u32; LANES], to: &mut Vec<u32>) {
    to.clear();
    to.resize(lanes.len(), 0);
    let mut count = 0;
    for &lane in lanes {
        to[count] = lane;
        count += usize::from(marks[lane as usize % LANES] != 0);
    }
    to.truncate(count);
}
