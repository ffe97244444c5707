//! Times Snell and a peer alternately on the same rays, so that other load on the machine affects
//! both equally.

use super::clock::{Clock, median, time_pieces};
use super::peer::Contender;
use rayon::ThreadPool;
use snell_intersect::{AcceptAll, Grouping, Hit, World};
use snell_math::Ray;

/// Contenders within this factor of the fastest one in the first run are measured further.
const CLOSE: f64 = 1.25;

/// Maximum number of contenders that are measured further.
const MAX_FINALISTS: usize = 3;

/// Allowed rounding of distances, in radii of the scene. It is needed for nearby hits, whose
/// distances differ by more than 0.01 % if a peer computes with rounded transforms.
const ROUNDING: f32 = 1e-6;

/// How Snell is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// A batch at a time.
    Batch,
    /// One ray per call.
    One,
}

impl Call {
    /// All ways of calling.
    pub const ALL: [Self; 2] = [Self::Batch, Self::One];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Batch => "batch",
            Self::One => "one",
        }
    }
}

/// What a query finds for one ray.
pub trait Answer: Copy + Default + Send + Sync {
    fn snell(world: &World, call: Call, grouping: Grouping, rays: &[Ray], answers: &mut [Self]);
    fn peer(peer: &Contender, rays: &[Ray], answers: &mut [Self]);
    fn is_hit(&self) -> bool;
    /// True if both hit or both miss, and the distances differ by at most 0.01 % or by at most
    /// `slack`.
    fn agrees(&self, other: &Self, slack: f32) -> bool;
}

impl Answer for Hit {
    fn snell(world: &World, call: Call, grouping: Grouping, rays: &[Ray], answers: &mut [Self]) {
        match call {
            Call::Batch => world.closest(rays, grouping, &AcceptAll, answers),
            Call::One => {
                for (ray, answer) in rays.iter().zip(answers) {
                    *answer = world.closest_one(ray, &AcceptAll);
                }
            }
        }
    }

    fn peer(peer: &Contender, rays: &[Ray], answers: &mut [Self]) {
        peer.scene.closest(peer.mode, rays, answers);
    }

    fn is_hit(&self) -> bool {
        self.is_hit()
    }

    fn agrees(&self, other: &Self, slack: f32) -> bool {
        self.is_hit() == other.is_hit()
            && (!self.is_hit()
                || (self.t - other.t).abs() <= slack.max(1e-4 * self.t.abs().max(other.t.abs())))
    }
}

impl Answer for bool {
    fn snell(world: &World, call: Call, grouping: Grouping, rays: &[Ray], answers: &mut [Self]) {
        match call {
            Call::Batch => world.occluded(rays, grouping, &AcceptAll, answers),
            Call::One => {
                for (ray, answer) in rays.iter().zip(answers) {
                    *answer = world.occluded_one(ray, &AcceptAll);
                }
            }
        }
    }

    fn peer(peer: &Contender, rays: &[Ray], answers: &mut [Self]) {
        peer.scene.occluded(peer.mode, rays, answers);
    }

    fn is_hit(&self) -> bool {
        *self
    }

    fn agrees(&self, other: &Self, _: f32) -> bool {
        self == other
    }
}

/// The queries, the contenders, and the number of runs.
pub struct Contest<'a> {
    pub pool: &'a ThreadPool,
    pub clock: Clock,
    pub repeat: usize,
    pub world: &'a World,
    pub call: Call,
    pub grouping: Grouping,
    pub rays: &'a [Ray],
    pub contenders: &'a [Contender<'a>],
}

/// What a contest finds.
pub struct Outcome {
    /// Rays that hit something.
    pub hits: usize,
    /// Median of Snell's times, in seconds.
    pub seconds: f64,
    /// The fastest contender that is not robust.
    pub opponent: Option<Opponent>,
    /// The fastest robust contender.
    pub robust: Option<Opponent>,
}

/// What the contest finds for a contender.
pub struct Opponent {
    /// The name of the contender's query mode and build.
    pub mode: String,
    /// Median of the contender's times, in seconds.
    pub seconds: f64,
    /// Median, over the runs, of the contender's time divided by Snell's: above 1, Snell is faster.
    pub ratio: f64,
    /// Share of rays with equal answers.
    pub agree: f64,
}

/// A contender and the times of its runs, which correspond to those of Snell.
struct Runs<'a> {
    contender: &'a Contender<'a>,
    seconds: Vec<f64>,
}

impl Contest<'_> {
    /// Runs the contest.
    pub fn run<A: Answer>(&self) -> Outcome {
        let mut answers = vec![A::default(); self.rays.len()];
        let mut other = answers.clone();
        // Warms up, and keeps the answers.
        self.time_snell(&mut answers);
        let mut finalists = self.finalists(&mut other);
        let mut own = Vec::new();
        for round in 0..self.repeat {
            // Snell and the contender take turns in going first.
            if round % 2 == 0 {
                own.push(self.time_snell(&mut answers));
            }
            for runs in &mut finalists {
                runs.seconds.push(self.time_peer(runs.contender, &mut other));
            }
            if round % 2 == 1 {
                own.push(self.time_snell(&mut answers));
            }
        }
        let (robust, fast): (Vec<_>, Vec<_>) =
            finalists.iter().partition(|runs| runs.contender.is_robust());
        Outcome {
            hits: answers.iter().filter(|a| a.is_hit()).count(),
            seconds: median(&own),
            opponent: self.fastest(&fast, &own, &answers),
            robust: self.fastest(&robust, &own, &answers),
        }
    }

    fn time_snell<A: Answer>(&self, answers: &mut [A]) -> f64 {
        time_pieces(
            self.pool,
            self.clock,
            self.rays,
            answers,
            &|rays: &[Ray], answers: &mut [A]| {
                A::snell(self.world, self.call, self.grouping, rays, answers);
            },
        )
    }

    fn time_peer<A: Answer>(&self, peer: &Contender, answers: &mut [A]) -> f64 {
        time_pieces(
            self.pool,
            self.clock,
            self.rays,
            answers,
            &|rays: &[Ray], answers: &mut [A]| {
                A::peer(peer, rays, answers);
            },
        )
    }

    /// The contenders that may be the fastest: some robust ones, and some others.
    fn finalists<A: Answer>(&self, answers: &mut [A]) -> Vec<Runs<'_>> {
        let mut kept = Vec::new();
        for robust in [false, true] {
            let entered = self.contenders.iter().filter(|c| c.is_robust() == robust);
            let mut times: Vec<_> = entered
                .map(|c| (self.time_peer(c, answers).min(self.time_peer(c, answers)), c))
                .collect();
            times.sort_by(|a, b| a.0.total_cmp(&b.0));
            let limit = times.first().map_or(0.0, |t| t.0 * CLOSE);
            let close = times.into_iter().take_while(|t| t.0 <= limit).take(MAX_FINALISTS);
            kept.extend(close.map(|(_, contender)| Runs { contender, seconds: Vec::new() }));
        }
        kept
    }

    fn fastest<A: Answer>(&self, runs: &[&Runs], own: &[f64], answers: &[A]) -> Option<Opponent> {
        let best = runs.iter().min_by(|a, b| median(&a.seconds).total_cmp(&median(&b.seconds)))?;
        let mut theirs = vec![A::default(); self.rays.len()];
        self.time_peer(best.contender, &mut theirs);
        let slack = self.world.bounds().radius() as f32 * ROUNDING;
        let equal = theirs.iter().zip(answers).filter(|(a, b)| a.agrees(b, slack)).count();
        let ratios: Vec<f64> =
            best.seconds.iter().zip(own).map(|(theirs, own)| theirs / own).collect();
        Some(Opponent {
            mode: best.contender.name(),
            seconds: median(&best.seconds),
            ratio: median(&ratios),
            agree: equal as f64 / self.rays.len().max(1) as f64,
        })
    }
}
