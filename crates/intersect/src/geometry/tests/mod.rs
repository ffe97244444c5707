//! Tests of sets, quads and moving geometry, against oracles and in worlds, where all structures
//! must agree.

mod heightfields;
mod motion;
mod quads;
mod sets;

use crate::hit::Hit;
use crate::search::rays::Rays;
use crate::search::{AcceptAll, Grouping};
use crate::world::{AcceleratorKind, BuildOptions, World, WorldBuilder};
use snell_math::rng::{pcg4d, to_unit};
use snell_math::sampling::uniform_sphere;
use snell_math::simd::Level;
use snell_math::{Ray, Vec2, Vec3};

/// A sequence of pseudo-random numbers.
pub(super) struct Random(pub(super) u32);

impl Random {
    pub(super) fn unit(&mut self) -> f32 {
        self.0 += 1;
        to_unit(pcg4d([self.0, 11, 7, 2])[0])
    }

    pub(super) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    pub(super) fn point(&mut self, extent: f32) -> Vec3 {
        Vec3::new(
            self.range(-extent, extent),
            self.range(-extent, extent),
            self.range(-extent, extent),
        )
    }

    pub(super) fn direction(&mut self) -> Vec3 {
        uniform_sphere(Vec2::new(self.unit(), self.unit()))
    }
}

fn bits(hit: &Hit) -> [u32; 6] {
    [
        hit.t.to_bits(),
        hit.uv.x.to_bits(),
        hit.uv.y.to_bits(),
        hit.instance,
        hit.geometry,
        hit.primitive,
    ]
}

/// The same world with every structure and at every SIMD level; the reference without a structure
/// comes first.
fn worlds(fill: impl Fn(&mut WorldBuilder)) -> Vec<World> {
    let mut all = Vec::new();
    for accelerator in AcceleratorKind::ALL {
        for simd in Level::ALL.into_iter().filter(|l| l.is_supported()) {
            let mut builder = WorldBuilder::default();
            fill(&mut builder);
            let options = BuildOptions { accelerator, ..BuildOptions::default() };
            all.push(builder.build(&BuildOptions { simd, ..options }).expect("a world"));
            // The other structures do not depend on the SIMD level.
            if accelerator != AcceleratorKind::Bvh {
                break;
            }
        }
    }
    all
}

/// Checks that all worlds give the same results, ray by ray and in batches; returns the number of
/// rays that hit.
fn agree(worlds: &[World], rays: &[Ray], times: &[f32]) -> usize {
    let queries = Rays::new(rays).with_times(times);
    let expected: Vec<_> =
        (0..rays.len()).map(|i| worlds[0].closest_one(queries.get(i), &AcceptAll)).collect();
    let all: Vec<_> =
        (0..rays.len()).map(|i| worlds[0].all_one(queries.get(i), &AcceptAll)).collect();
    for world in worlds {
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        world.closest(queries, Grouping::None, &AcceptAll, &mut hits);
        world.occluded(queries, Grouping::None, &AcceptAll, &mut blocked);
        for i in 0..rays.len() {
            let (query, wanted) = (queries.get(i), bits(&expected[i]));
            assert_eq!(bits(&hits[i]), wanted, "{:?} {:?}\n{:?}", rays[i], hits[i], expected[i]);
            assert_eq!(bits(&world.closest_one(query, &AcceptAll)), wanted);
            assert_eq!(blocked[i], expected[i].is_hit());
            assert_eq!(world.all_one(query, &AcceptAll), all[i], "{:?}", rays[i]);
        }
    }
    expected.iter().filter(|h| h.is_hit()).count()
}
