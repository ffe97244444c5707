//! Measures one structure on one scene: builds it, traces rays for a while, and counts.

use super::super::clock::timed;
use super::super::kinds::{self, Kind};
use super::super::scenes::Bench;
use super::super::variants;
use super::rebuilt;
use crate::failure::Failure;
use snell_intersect::{AcceptAll, BuildOptions, Hit, World};
use snell_math::Ray;
use std::time::Instant;

/// Settings of a measurement.
pub struct Measurer {
    /// Width and height of the picture whose rays are traced.
    pub side: u32,
    /// Processor time for each kind of ray.
    pub seconds: f64,
    /// Structures that take longer to build are left out.
    pub build_limit: f64,
}

/// A scene and its rays.
pub struct Case<'a> {
    bench: &'a Bench,
    /// Rays of each kind, in the order of [`Kind::ALL`].
    rays: Vec<Vec<Ray>>,
}

impl<'a> Case<'a> {
    pub fn new(bench: &'a Bench, measurer: &Measurer) -> Result<Self, Failure> {
        let world = rebuilt(bench, &BuildOptions::default())?;
        let first = kinds::first_hits(bench, &world, measurer.side);
        let rays = Kind::ALL.iter().map(|&kind| kinds::rays(kind, bench, &first)).collect();
        Ok(Self { bench, rays })
    }
}

/// The results of a measurement.
pub struct Measured {
    pub build_seconds: f64,
    pub memory_bytes: u64,
    pub references: u64,
    pub kinds: Vec<KindMeasured>,
}

/// The results for a kind of ray; counts are per ray.
pub struct KindMeasured {
    pub kind: Kind,
    /// Rays per second on one thread.
    pub rays_per_second: f64,
    pub nodes: f64,
    pub cells: f64,
    pub primitives: f64,
}

impl Measurer {
    /// Builds a structure on all cores and traces rays on one thread.
    pub fn measure(
        &self,
        case: &Case,
        options: &BuildOptions,
        kinds: &[Kind],
    ) -> Result<Measured, Failure> {
        let builder = variants::builder_of(&case.bench.world);
        let start = Instant::now();
        let world = builder
            .build(options)
            .map_err(|e| Failure::Scene(format!("{}: {e}", case.bench.name)))?;
        let build_seconds = start.elapsed().as_secs_f64();
        let of = |&kind: &Kind| {
            let index = Kind::ALL.iter().position(|&k| k == kind).unwrap_or(0);
            self.kind(&world, kind, &case.rays[index])
        };
        Ok(Measured {
            build_seconds,
            memory_bytes: world.memory_bytes(),
            references: world.stats().references,
            kinds: kinds.iter().map(of).collect(),
        })
    }

    fn kind(&self, world: &World, kind: Kind, rays: &[Ray]) -> KindMeasured {
        let pieces = Pieces::new(world, kind, rays, self.seconds);
        let (mut traced, mut time) = (0, 0.0);
        let mut hits = vec![Hit::MISS; pieces.size];
        let mut blocked = vec![false; pieces.size];
        // Counting needs fewer rays than timing.
        let mut work = snell_intersect::TraversalWork::default();
        let mut counted = 0;
        for (i, piece) in pieces.iter(rays).enumerate() {
            time += timed(|| trace(world, kind, piece, &mut hits, &mut blocked)).1;
            traced += piece.len();
            if i % 4 == 0 {
                let more = world.closest_work(piece, &AcceptAll, &mut hits[..piece.len()]);
                work.nodes_visited += more.nodes_visited;
                work.cells_stepped += more.cells_stepped;
                work.primitives_tested += more.primitives_tested;
                counted += piece.len();
            }
            if time > self.seconds {
                break;
            }
        }
        let per_ray = |n: u64| n as f64 / counted.max(1) as f64;
        KindMeasured {
            kind,
            rays_per_second: traced as f64 / time.max(1e-9),
            nodes: per_ray(work.nodes_visited),
            cells: per_ray(work.cells_stepped),
            primitives: per_ray(work.primitives_tested),
        }
    }
}

fn trace(world: &World, kind: Kind, rays: &[Ray], hits: &mut [Hit], blocked: &mut [bool]) {
    match kind {
        Kind::Shadow => world.occluded(
            rays,
            snell_intersect::Grouping::None,
            &AcceptAll,
            &mut blocked[..rays.len()],
        ),
        _ => world.closest(rays, kind.grouping(), &AcceptAll, &mut hits[..rays.len()]),
    }
}

/// Evenly spread pieces of a batch. They are short enough that slow structures finish several, and
/// long enough that fast ones trace long runs.
struct Pieces {
    size: usize,
    step: usize,
}

impl Pieces {
    fn new(world: &World, kind: Kind, rays: &[Ray], seconds: f64) -> Self {
        // The rays are taken from the whole batch: neighbouring rays may all miss the scene, which
        // is no measure of the cost in a structure that tests every triangle.
        let few: Vec<Ray> = rays.iter().step_by(rays.len().div_ceil(16).max(1)).copied().collect();
        let (_, seconds_of_few) =
            timed(|| trace(world, kind, &few, &mut [Hit::MISS; 16], &mut [false; 16]));
        let each = seconds_of_few / few.len().max(1) as f64;
        // Divides the time into about twenty pieces.
        let size = (seconds / 20.0 / each.max(1e-9)) as usize;
        let size = size.clamp(16, 8192) / 16 * 16;
        // Consecutive pieces are far apart in the batch, by a step near the golden section.
        let count = (rays.len() / size).max(1);
        let step = (1..count)
            .map(|i| (count * 618 / 1000 + i) % count)
            .find(|&s| gcd(s, count) == 1)
            .unwrap_or(1);
        Self { size: size.min(rays.len()).max(1), step }
    }

    fn iter<'a>(&self, rays: &'a [Ray]) -> impl Iterator<Item = &'a [Ray]> {
        let (size, step) = (self.size, self.step);
        let count = (rays.len() / size).max(1);
        // Several rounds, for structures that finish before the time is over.
        (0..count * 50).map(move |i| {
            let first = (i * step % count) * size;
            &rays[first..(first + size).min(rays.len())]
        })
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}
