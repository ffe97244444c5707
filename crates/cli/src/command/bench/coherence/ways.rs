//! The methods of tracing the rays of a picture.

use super::super::clock::MIN_PIECE;
use super::super::contest::Answer;
use super::Case;
use snell_intersect::TraversalWork;
use snell_intersect::{AcceptAll, Grouping, Hit};
use snell_lab::coherence::{
    BeamTracer, CoherenceError, Cone, ConeTracer, PencilTracer, RegionWork,
};
use snell_math::{Ray, Vec2};

/// A method of tracing rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Rays one by one, each in a call of its own.
    One,
    /// Batches of unrelated rays, several of which are in flight at a time.
    Batches,
    /// Packets of 16 rays that share the tests of boxes.
    Bundles,
    /// Beams: for each region of the picture, the pieces of triangles that are visible in it.
    Beams,
    /// Pencils: an axial ray and a matrix, where both are proven to be accurate enough; the other
    /// rays are traced one by one.
    Pencils,
    /// A cone for each ray.
    Cones,
}

impl Way {
    /// All methods; the others are compared with the first.
    pub const ALL: [Self; 6] =
        [Self::One, Self::Batches, Self::Bundles, Self::Beams, Self::Pencils, Self::Cones];

    /// The name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "one",
            Self::Batches => "batches",
            Self::Bundles => "bundles",
            Self::Beams => "beams",
            Self::Pencils => "pencils",
            Self::Cones => "cones",
        }
    }
}

/// Numbers of tested node boxes and of tested triangles.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    pub nodes: u64,
    pub tests: u64,
}

impl Work {
    fn of(regions: RegionWork) -> Self {
        Self { nodes: regions.nodes, tests: regions.triangles + regions.confirmed }
    }

    fn add(&mut self, rays: TraversalWork) {
        self.nodes += rays.nodes_visited;
        self.tests += rays.primitives_tested;
    }
}

/// Results of a method besides the hits.
#[derive(Default)]
pub struct Extra {
    /// The cost, if the method counts it while tracing.
    pub work: Option<Work>,
    /// The number of rays that fell back to tracing one by one.
    pub traced: Option<u64>,
}

/// Results that all methods can produce.
pub trait Answers: Answer + PartialEq {
    /// Traces the rays by a method.
    fn trace(
        way: Way,
        case: &Case,
        rays: &[Ray],
        answers: &mut [Self],
    ) -> Result<Extra, CoherenceError>;

    /// The cost of a method that can only count in a second run.
    fn work(way: Way, case: &Case, rays: &[Ray]) -> Option<Work>;
}

/// The number of rays per call when counting; `None` if the method cannot be counted.
fn counted_piece(way: Way) -> Option<usize> {
    match way {
        Way::One => Some(1),
        Way::Batches => Some(MIN_PIECE),
        _ => None,
    }
}

impl Answers for Hit {
    fn trace(
        way: Way,
        case: &Case,
        rays: &[Ray],
        answers: &mut [Self],
    ) -> Result<Extra, CoherenceError> {
        let pieces = rays.chunks(MIN_PIECE).zip(answers.chunks_mut(MIN_PIECE));
        let mut extra = Extra::default();
        match way {
            Way::One => rays
                .iter()
                .zip(answers)
                .for_each(|(ray, a)| *a = case.world.closest_one(ray, &AcceptAll)),
            Way::Batches => {
                pieces.for_each(|(rays, a)| case.world.closest(rays, Grouping::None, &AcceptAll, a))
            }
            Way::Bundles => pieces
                .for_each(|(rays, a)| case.world.closest(rays, Grouping::Coherent, &AcceptAll, a)),
            Way::Beams => {
                let mut tracer = BeamTracer::new(case.world)?;
                pieces.for_each(|(rays, answers)| tracer.closest(&case.view, rays, answers));
                extra = of_regions(tracer.work());
            }
            Way::Pencils => {
                let mut tracer = PencilTracer::new(case.world, case.tolerance)?;
                pieces.for_each(|(rays, answers)| tracer.closest(&case.view, rays, answers));
                extra = of_regions(tracer.work());
            }
            Way::Cones => {
                let mut tracer = ConeTracer::new(case.world)?;
                for ((ray, answer), spread) in rays.iter().zip(answers).zip(&case.spreads) {
                    let hits = tracer
                        .trace(&Cone::around(ray, 0.0, (*spread).into()), [0.0, f64::INFINITY]);
                    let largest = hits.largest().filter(|_| hits.opacity() > 0.5);
                    *answer = largest.map_or(Hit::MISS, |hit| Hit {
                        t: hit.distance as f32,
                        uv: Vec2::splat(1.0 / 3.0),
                        instance: hit.primitive.instance,
                        geometry: hit.primitive.geometry,
                        primitive: hit.primitive.primitive,
                    });
                }
                extra = of_regions(tracer.work());
                extra.traced = None;
            }
        }
        Ok(extra)
    }

    fn work(way: Way, case: &Case, rays: &[Ray]) -> Option<Work> {
        let size = counted_piece(way)?;
        let (mut work, mut answers) = (Work::default(), vec![Self::MISS; size]);
        for piece in rays.chunks(size) {
            work.add(case.world.closest_work(piece, &AcceptAll, &mut answers[..piece.len()]));
        }
        Some(work)
    }
}

impl Answers for bool {
    fn trace(
        way: Way,
        case: &Case,
        rays: &[Ray],
        answers: &mut [Self],
    ) -> Result<Extra, CoherenceError> {
        let pieces = rays.chunks(MIN_PIECE).zip(answers.chunks_mut(MIN_PIECE));
        let light = case.bench.light.as_dvec3();
        let mut extra = Extra::default();
        match way {
            Way::One => rays
                .iter()
                .zip(answers)
                .for_each(|(ray, a)| *a = case.world.occluded_one(ray, &AcceptAll)),
            Way::Batches => pieces
                .for_each(|(rays, a)| case.world.occluded(rays, Grouping::None, &AcceptAll, a)),
            Way::Bundles => pieces
                .for_each(|(rays, a)| case.world.occluded(rays, Grouping::Coherent, &AcceptAll, a)),
            Way::Beams => {
                let mut tracer = BeamTracer::new(case.world)?;
                pieces.for_each(|(rays, answers)| tracer.occluded(light, rays, answers));
                extra = of_regions(tracer.work());
            }
            Way::Pencils => {
                let mut tracer = PencilTracer::new(case.world, case.tolerance)?;
                pieces.for_each(|(rays, answers)| tracer.occluded(light, rays, answers));
                extra = of_regions(tracer.work());
            }
            Way::Cones => {
                let mut tracer = ConeTracer::new(case.world)?;
                for (ray, answer) in rays.iter().zip(answers) {
                    *answer = seen_share(&mut tracer, case, ray) <= 0.5;
                }
                extra = of_regions(tracer.work());
                extra.traced = None;
            }
        }
        Ok(extra)
    }

    fn work(way: Way, case: &Case, rays: &[Ray]) -> Option<Work> {
        let size = counted_piece(way)?;
        let (mut work, mut answers) = (Work::default(), vec![false; size]);
        for piece in rays.chunks(size) {
            work.add(case.world.occluded_work(piece, &AcceptAll, &mut answers[..piece.len()]));
        }
        Some(work)
    }
}

/// The share of the spherical light that is visible from the start of a shadow ray.
pub fn seen_share(tracer: &mut ConeTracer, case: &Case, ray: &Ray) -> f64 {
    let length = f64::from(ray.direction.length());
    let (origin, light) = (ray.origin.as_dvec3(), case.bench.light.as_dvec3());
    tracer.visibility_of_ball(origin, light, case.light_radius, f64::from(ray.t_min) * length)
}

fn of_regions(work: RegionWork) -> Extra {
    Extra { work: Some(Work::of(work)), traced: Some(work.rays) }
}
