//! Vertices as a structure of arrays, for batch shaders: points on surfaces, and the states of
//! paths.

use super::Batch;
use super::paths::Paths;
use crate::integrator::carried::{Carried, Marks, Rest};
use crate::integrator::estimators::{Arrival, Skin};
use crate::integrator::{Context, dimension};
use crate::lanes::{BLACK, HitColors, LANES, ZERO, at, color_at, put, put_color};
use crate::sampler::{BatchRandoms, Sampler};
use crate::settings::Terminator;
use snell_intersect::triangles::{HitLanes, HitVectors, PlainMesh};
use snell_intersect::{Hit, SphereHits, SurfaceInteraction, TriangleHits, TrianglePoints};
use snell_math::simd::{Wide, min};
use snell_math::{ColorMode, Ray, Vec3};

/// Flags of each lane.
pub type MarkLanes = [Marks; LANES];

/// No flags in every lane.
pub const UNMARKED: MarkLanes = [Marks::NONE; LANES];

/// Vertices on surfaces. Arrays are by lane; unused lanes hold arbitrary values.
#[derive(Debug)]
pub struct VertexLanes {
    /// Numbers of the paths of the lanes, and how many lanes are in use.
    paths: [u32; LANES],
    count: usize,
    triangles: TriangleHits,
    spheres: SphereHits,
    /// Of all vertices, once they are [placed](Self::place).
    pub points: TrianglePoints,
    /// Lanes on plain triangles.
    plain: Vec<usize>,
    /// The points of lanes that are not on plain triangles or spheres.
    others: Vec<(usize, OtherPoint)>,
    /// Direction towards the ray's origin.
    pub wo: HitVectors,
    /// As [`crate::integrator::estimators::Skin::lift`], once they are placed; all zero while
    /// `has_lifts` is false.
    pub lift: HitVectors,
    has_lifts: bool,
    pub carried: CarriedLanes,
    /// The meaning of the channels of the paths, and the times of their rays.
    pub modes: [ColorMode; LANES],
    pub times: HitLanes,
    pub randoms: BatchRandoms<LANES>,
    pub wide: Option<Wide>,
}

/// The fields of [`Carried`] that are needed.
#[derive(Debug)]
pub struct CarriedLanes {
    /// By channel.
    pub throughput: HitColors,
    pub eta_scale: HitLanes,
    /// At the vertex.
    pub cone_width: HitLanes,
    pub cone_spread: HitLanes,
    pub marks: MarkLanes,
}

/// The fields of [`SurfaceInteraction`] that are needed here.
#[derive(Clone, Copy, Debug)]
pub struct OtherPoint {
    position: Vec3,
    position_error: Vec3,
    geometric_normal: Vec3,
    shading_normal: Vec3,
    lift: Vec3,
}

impl OtherPoint {
    /// Of a surface with this shading normal and [lift](crate::integrator::estimators::Skin::lift).
    pub fn of(surface: &SurfaceInteraction, shading_normal: Vec3, lift: Vec3) -> Self {
        let SurfaceInteraction { position, position_error, geometric_normal, .. } = *surface;
        Self { position, position_error, geometric_normal, shading_normal, lift }
    }
}

/// Russian roulette of a batch of vertices: their random numbers, if there is roulette at their
/// depth.
#[derive(Debug)]
pub struct Roulette {
    /// The largest survival probability.
    most: Option<f32>,
    numbers: HitLanes,
}

impl Roulette {
    /// The factor on a lane's throughput, and whether its path survives; `weight` is that of
    /// [`crate::integrator::path::survival`].
    #[inline(always)]
    pub fn survival(&self, lane: usize, weight: f32) -> (f32, bool) {
        let survival = match self.most {
            Some(most) => min(weight, most),
            None => 1.0,
        };
        (1.0 / survival, self.numbers[lane] < survival)
    }
}

impl VertexLanes {
    /// For vertices of one depth.
    pub fn new(sampler: &Sampler, wide: Option<Wide>) -> Self {
        let zero = [0.0; LANES];
        let carried = CarriedLanes {
            throughput: BLACK,
            eta_scale: zero,
            cone_width: zero,
            cone_spread: zero,
            marks: UNMARKED,
        };
        Self {
            paths: [0; LANES],
            count: 0,
            triangles: TriangleHits::default(),
            spheres: SphereHits::default(),
            points: TrianglePoints::default(),
            plain: Vec::new(),
            others: Vec::new(),
            wo: ZERO,
            lift: ZERO,
            has_lifts: false,
            carried,
            modes: [ColorMode::Rgb; LANES],
            times: zero,
            randoms: BatchRandoms::new(sampler, 0),
            wide,
        }
    }

    /// Takes the paths with these numbers, at most [`LANES`], of which the dead are left out; their
    /// vertices are of this depth. The data of the surfaces must follow.
    pub fn start(&mut self, batch: &Batch, paths: &[u32]) {
        let Batch { sampler, depth, paths: from, keys, .. } = *batch;
        self.randoms.start(sampler, depth);
        self.spheres.clear();
        self.plain.clear();
        self.others.clear();
        self.count = 0;
        for &path in &paths[..paths.len().min(LANES)] {
            self.paths[self.count % LANES] = path;
            self.count += usize::from(!from.carried[path as usize].throughput.is_black());
        }
        for lane in 0..self.count.min(LANES) {
            let path = self.paths[lane] as usize;
            let (ray, hit, carried) = (&from.rays[path], &from.hits[path], &from.carried[path]);
            put(&mut self.wo, lane, -ray.direction);
            self.randoms.set(lane, keys[from.samples[path] as usize]);
            put_color(&mut self.carried.throughput, lane, carried.throughput);
            self.carried.eta_scale[lane] = carried.eta_scale;
            self.carried.marks[lane] = carried.marks;
            self.carried.cone_width[lane] = carried.cone_width + carried.cone_spread * hit.t;
            self.carried.cone_spread[lane] = carried.cone_spread;
        }
        if let Some(rest) = from.rests() {
            for lane in 0..self.count.min(LANES) {
                let Rest { mode, time, .. } = rest[self.paths[lane] as usize];
                (self.modes[lane], self.times[lane]) = (mode, time);
            }
        }
    }

    /// Takes all paths out of the lanes.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Numbers of the paths of the lanes in use.
    pub fn paths(&self) -> &[u32] {
        &self.paths[..self.count]
    }

    /// Marks a lane as on a triangle of a plain mesh; [`Self::gather_triangles`] must follow.
    #[inline(always)]
    pub fn put_triangle(&mut self, lane: usize) {
        self.plain.push(lane);
    }

    /// Looks up the triangles of all lanes that are on some, in the meshes that were hit.
    #[inline(always)]
    pub fn gather_triangles<'w>(
        &mut self,
        from: &Paths,
        mesh: impl Fn(&Hit) -> Option<&'w PlainMesh<'w>>,
    ) {
        let paths = &self.paths;
        let hits = self.plain.iter().filter_map(|&lane| {
            let hit = &from.hits[paths[lane] as usize];
            mesh(hit).map(|mesh| (lane, mesh, hit))
        });
        self.triangles.gather(hits);
    }

    /// Looks up the texture coordinates of meshes of lanes whose triangles are known, for
    /// [`Self::tangents`].
    #[inline(always)]
    pub fn gather_uvs<'w>(&mut self, meshes: impl Iterator<Item = (usize, &'w PlainMesh<'w>)>) {
        self.triangles.gather_uvs(meshes);
    }

    /// The tangents on the triangles ([`SurfaceInteraction::dpdu`]), once they are placed.
    pub fn tangents(&self, to: &mut HitVectors) {
        self.triangles.tangents(&self.points, to, self.wide);
    }

    /// The receiver at the vertex of a lane, once it is placed and lifted.
    pub fn arrival(&self, lane: usize) -> Arrival {
        let points = &self.points;
        let skin = Skin {
            position_error: at(&points.position_error, lane),
            geometric_normal: at(&points.geometric_normal, lane),
            lift: at(&self.lift, lane),
        };
        let (mode, time) = (self.modes[lane], self.times[lane]);
        Arrival { position: at(&points.position, lane), surface: Some(skin), mode, time }
    }

    /// Puts a point into a lane if it is on a shape that is not instanced; otherwise returns false
    /// and does nothing.
    pub fn gather_shape(&mut self, context: &Context, lane: usize, ray: &Ray, hit: &Hit) -> bool {
        let world = &context.scene.world;
        if world.gather_sphere(ray, hit, lane, &mut self.spheres) {
            return true;
        }
        let Some(point) = world.shape_point(ray, hit) else { return false };
        self.put_point(
            lane,
            OtherPoint {
                position: point.position,
                position_error: point.position_error,
                geometric_normal: point.geometric_normal,
                shading_normal: point.geometric_normal,
                lift: Vec3::ZERO,
            },
        );
        true
    }

    /// Puts a point that is known already into a lane.
    pub fn put_point(&mut self, lane: usize, point: OtherPoint) {
        self.others.push((lane, point));
    }

    /// Computes the points of all lanes.
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

    /// Computes the lifts of all lanes, once they are placed; does nothing if no mesh has vertex
    /// normals.
    pub fn place_lifts(&mut self, context: &Context) {
        let had_lifts = self.has_lifts;
        let is_smooth =
            self.triangles.has_normals() && context.settings.terminator == Terminator::Smooth;
        self.has_lifts = is_smooth || self.others.iter().any(|(_, other)| other.lift != Vec3::ZERO);
        if !self.has_lifts && !had_lifts {
            return;
        }
        let mut found = ZERO;
        if is_smooth {
            self.triangles.lifts(&self.points, &self.wo, &mut found, self.wide);
        }
        // (Lanes that are not on triangles have none.)
        self.lift = ZERO;
        for &lane in &self.plain {
            put(&mut self.lift, lane, at(&found, lane));
        }
        for &(lane, ref other) in &self.others {
            put(&mut self.lift, lane, other.lift);
        }
    }

    /// Russian roulette at this depth.
    pub fn roulette(&self, context: &Context, depth: u32) -> Roulette {
        let most = context.roulette(depth);
        let numbers = match most {
            Some(_) => self.randoms.numbers(dimension::ROULETTE, self.wide),
            None => [0.0; LANES],
        };
        Roulette { most, numbers }
    }
}

/// Rays by column; lanes without one hold arbitrary values.
#[derive(Clone, Copy, Debug)]
pub struct RayColumns<'a> {
    pub origin: &'a HitVectors,
    pub direction: &'a HitVectors,
    /// As [`Ray::t_max`].
    pub end: &'a HitLanes,
}

impl RayColumns<'_> {
    /// The ray of a lane.
    #[inline(always)]
    pub fn at(&self, lane: usize) -> Ray {
        let lane = lane % LANES;
        Ray::new(at(self.origin, lane), at(self.direction, lane)).with_t_max(self.end[lane])
    }
}

/// [`Carried`] column by column, of paths that are not branched; lanes without a path hold
/// arbitrary values.
#[derive(Clone, Copy, Debug)]
pub struct CarriedColumns<'a> {
    /// By channel.
    pub throughput: &'a HitColors,
    pub eta_scale: &'a HitLanes,
    pub cone_width: &'a HitLanes,
    pub cone_spread: &'a HitLanes,
    pub marks: &'a MarkLanes,
    pub position: &'a HitVectors,
    pub bsdf_pdf: &'a HitLanes,
    pub normal: &'a HitVectors,
}

impl CarriedColumns<'_> {
    /// The state of a lane.
    #[inline(always)]
    pub fn at(&self, lane: usize) -> Carried {
        let lane = lane % LANES;
        Carried {
            throughput: color_at(self.throughput, lane),
            eta_scale: self.eta_scale[lane],
            cone_width: self.cone_width[lane],
            cone_spread: self.cone_spread[lane],
            marks: self.marks[lane],
            position: at(self.position, lane),
            bsdf_pdf: self.bsdf_pdf[lane],
            normal: at(self.normal, lane),
            stream: 0,
        }
    }
}
