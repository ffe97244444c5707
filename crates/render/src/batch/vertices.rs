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

/// The marks of the paths, by lane.
pub type MarkLanes = [Marks; LANES];

/// No marks in any lane.
pub const UNMARKED: MarkLanes = [Marks::NONE; LANES];

/// Vertices on surfaces, with the state of their paths. Arrays are by lane; unused lanes hold
/// arbitrary values.
#[derive(Debug)]
pub struct VertexLanes {
    /// The number of each lane's path.
    paths: [u32; LANES],
    /// The number of lanes in use.
    count: usize,
    triangles: TriangleHits,
    spheres: SphereHits,
    /// The points of all vertices, once [`Self::place`] has computed them.
    pub points: TrianglePoints,
    /// The lanes on plain triangles.
    plain: Vec<usize>,
    /// The points of lanes that are neither on plain triangles nor on plain spheres.
    others: Vec<(usize, OtherPoint)>,
    /// Unit directions towards the rays' origins.
    pub wo: HitVectors,
    /// The lift of each point ([`crate::integrator::estimators::Skin::lift`]), once
    /// [`Self::place_lifts`] has computed it.
    pub lift: HitVectors,
    /// False if all lifts are zero.
    has_lifts: bool,
    pub carried: CarriedLanes,
    /// What the channels of each path stand for.
    pub modes: [ColorMode; LANES],
    /// The time of each ray, from 0 to 1.
    pub times: HitLanes,
    pub randoms: BatchRandoms<LANES>,
    pub wide: Option<Wide>,
}

/// The columns of the fields of [`Carried`] that batches need.
#[derive(Debug)]
pub struct CarriedLanes {
    /// The throughput, by colour channel.
    pub throughput: HitColors,
    pub eta_scale: HitLanes,
    /// The width of the ray cone at the vertex.
    pub cone_width: HitLanes,
    pub cone_spread: HitLanes,
    pub marks: MarkLanes,
}

/// The fields of [`SurfaceInteraction`] that batches need.
#[derive(Clone, Copy, Debug)]
pub struct OtherPoint {
    position: Vec3,
    position_error: Vec3,
    geometric_normal: Vec3,
    shading_normal: Vec3,
    lift: Vec3,
}

impl OtherPoint {
    /// The point of a surface with this shading normal and
    /// [lift](crate::integrator::estimators::Skin::lift).
    pub fn of(surface: &SurfaceInteraction, shading_normal: Vec3, lift: Vec3) -> Self {
        let SurfaceInteraction { position, position_error, geometric_normal, .. } = *surface;
        Self { position, position_error, geometric_normal, shading_normal, lift }
    }
}

/// Russian roulette for a batch of vertices, with the random numbers of the lanes.
#[derive(Debug)]
pub struct Roulette {
    /// The largest survival probability; `None` if there is no roulette at this depth.
    most: Option<f32>,
    numbers: HitLanes,
}

impl Roulette {
    /// The factor on the throughput of a lane's path, and whether the path survives. `weight` is
    /// the value of [`crate::integrator::path::survival`].
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
    /// Makes empty lanes.
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

    /// Fills the lanes with the paths of these numbers, at most [`LANES`], except those that have
    /// ended. The points on surfaces must follow.
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

    /// Removes all paths from the lanes.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Numbers of the paths of the lanes in use.
    pub fn paths(&self) -> &[u32] {
        &self.paths[..self.count]
    }

    /// Records that the vertex of a lane is on a triangle of a plain mesh;
    /// [`Self::gather_triangles`] must follow.
    #[inline(always)]
    pub fn put_triangle(&mut self, lane: usize) {
        self.plain.push(lane);
    }

    /// Looks up the triangles of all lanes recorded by [`Self::put_triangle`], in the meshes that
    /// were hit.
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

    /// Looks up the texture coordinates of triangles that were looked up before, for
    /// [`Self::tangents`].
    #[inline(always)]
    pub fn gather_uvs<'w>(&mut self, meshes: impl Iterator<Item = (usize, &'w PlainMesh<'w>)>) {
        self.triangles.gather_uvs(meshes);
    }

    /// Writes the tangents of the triangles ([`SurfaceInteraction::dpdu`]), once the points are
    /// computed.
    pub fn tangents(&self, to: &mut HitVectors) {
        self.triangles.tangents(&self.points, to, self.wide);
    }

    /// The vertex of a lane as a receiver of light, once its point and lift are computed.
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

    /// Looks up the point of a lane if it is on a shape outside of instances. Otherwise returns
    /// false and does nothing.
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

    /// Stores a point that was computed elsewhere.
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

    /// Computes the lifts of all lanes from their points. Does nothing if no lane needs one.
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
        // Lanes that are neither on triangles nor in `others` have no lift.
        self.lift = ZERO;
        for &lane in &self.plain {
            put(&mut self.lift, lane, at(&found, lane));
        }
        for &(lane, ref other) in &self.others {
            put(&mut self.lift, lane, other.lift);
        }
    }

    /// The random numbers and the limit of Russian roulette at this depth.
    pub fn roulette(&self, context: &Context, depth: u32) -> Roulette {
        let most = context.roulette(depth);
        let numbers = match most {
            Some(_) => self.randoms.numbers(dimension::ROULETTE, self.wide),
            None => [0.0; LANES],
        };
        Roulette { most, numbers }
    }
}

/// Rays as columns. Lanes without a ray hold arbitrary values.
#[derive(Clone, Copy, Debug)]
pub struct RayColumns<'a> {
    pub origin: &'a HitVectors,
    pub direction: &'a HitVectors,
    /// [`Ray::t_max`] of each ray.
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

/// [`Carried`] as columns, for paths that are not branched. Lanes without a path hold arbitrary
/// values.
#[derive(Clone, Copy, Debug)]
pub struct CarriedColumns<'a> {
    /// The throughput, by colour channel.
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
    /// The entry of a lane.
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
