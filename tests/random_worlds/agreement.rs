//! Every query of the same world gives the same answers, bit for bit.

use super::{Collected, Source, Tested};
use snell_intersect::{AcceleratorKind, AcceleratorOptions};
use snell_intersect::{BuildOptions, Grouping, Hit, Quality, Rays};
use snell_math::simd::Level;

/// Builds the world encoded by the bytes with every accelerator, every switch, and every level, and
/// traces the rays encoded by the following bytes (`rays` random ones, and as many aimed at
/// triangles). All answers must equal those of brute force, bit for bit: closest, any and all, one
/// ray at a time and in batches of `batches`, on one thread and on several, and the number of hits.
/// A crowded world has an additional mesh of many triangles. Returns the number of rays, and the
/// number of those that hit.
///
/// # Panics
/// If two answers differ.
pub fn assert_agreement<P: Tested>(
    bytes: &[u8],
    is_crowded: bool,
    rays: usize,
    batches: &[usize],
) -> (usize, usize) {
    let mut source = Source::new(bytes);
    let world = described::<P>(&mut source, bytes, is_crowded);
    let Ok(oracle) = P::build(&world.builder, &oracle_options()) else { return (0, 0) };
    let asked = Asked::<P>::new(&mut source, &world, rays);
    let expected = asked.answers(&oracle);
    for simd in levels() {
        for (name, options) in ways(simd, is_crowded) {
            let name = format!("{name}, {simd}");
            let world =
                P::build(&world.builder, &options).unwrap_or_else(|e| panic!("{name}: {e}"));
            asked.assert_answers(&world, &name, &expected, batches);
        }
    }
    (expected.len(), expected.iter().filter(|hits| !hits.is_empty()).count())
}

/// Edits the world encoded by the bytes as the following bytes specify, and asserts that rebuilding
/// from the previous world gives the same answers as building from scratch. This is done
/// repeatedly, with every accelerator and every switch.
///
/// # Panics
/// If two answers differ.
pub fn assert_edits_agree<P: Tested>(
    bytes: &[u8],
    is_crowded: bool,
    rays: usize,
    batches: &[usize],
) -> Edits {
    let mut source = Source::new(bytes);
    let mut world = described::<P>(&mut source, bytes, is_crowded);
    let asked = Asked::<P>::new(&mut source, &world, rays);
    let ways = ways(Level::best(), is_crowded);
    let mut last: Vec<_> =
        ways.iter().map(|(_, options)| P::build(&world.builder, options).ok()).collect();
    let mut edits = Edits::default();
    for edit in 1..=3 {
        source.edit(&mut world);
        let Ok(oracle) = P::build(&world.builder, &oracle_options()) else { continue };
        let expected = asked.answers(&oracle);
        for ((name, options), last) in ways.iter().zip(&mut last) {
            let Some(before) = last else { continue };
            let name = format!("{name}, edit {edit}");
            let after = P::rebuild(&world.builder, options, before)
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            edits.refitted += P::refitted(&after);
            asked.assert_answers(&after, &name, &expected, batches);
            *last = Some(after);
        }
        edits.rays += expected.len();
        edits.hits += expected.iter().filter(|hits| !hits.is_empty()).count();
    }
    edits
}

/// Numbers counted while worlds were edited.
#[derive(Clone, Copy, Debug, Default)]
pub struct Edits {
    /// Number of rays, each of which is traced in every way.
    pub rays: usize,
    /// Number of rays that hit.
    pub hits: usize,
    /// Number of trees that were refitted.
    pub refitted: usize,
}

/// The world encoded by the bytes. Half of the worlds also have sets and motion, which are read
/// from the end of the bytes.
fn described<P: Tested>(source: &mut Source, bytes: &[u8], is_crowded: bool) -> Collected<P> {
    let mut world = source.collected();
    let reversed: Vec<u8> = bytes.iter().rev().copied().collect();
    let mut end = Source::new(&reversed);
    if end.below(2) == 1 {
        end.add_sets(&mut world);
    }
    if is_crowded {
        end.add_crowd(&mut world);
    }
    world
}

fn levels() -> impl Iterator<Item = Level> {
    Level::ALL.into_iter().filter(|level| level.is_supported())
}

fn oracle_options() -> BuildOptions {
    BuildOptions {
        accelerator: AcceleratorKind::None,
        simd: Level::Scalar,
        ..BuildOptions::default()
    }
}

/// All ways to build, each with its name; for crowded worlds, the slow ones are left out.
fn ways(simd: Level, is_crowded: bool) -> Vec<(String, BuildOptions)> {
    let plain = |accelerator| BuildOptions { accelerator, simd, ..BuildOptions::default() };
    let mut ways = Vec::new();
    let is_slow = |kind: &AcceleratorKind| {
        matches!(kind, AcceleratorKind::None | AcceleratorKind::Graph | AcceleratorKind::Bsp)
    };
    for accelerator in AcceleratorKind::ALL.into_iter().filter(|kind| !is_crowded || !is_slow(kind))
    {
        ways.push((accelerator.name().to_owned(), plain(accelerator)));
        if !matches!(accelerator, AcceleratorKind::None | AcceleratorKind::Bvh) {
            let accelerator_options = AcceleratorOptions {
                front_to_back: false,
                last_hit_cache: true,
                nested_grids: false,
                grid_resolution: None,
            };
            let name = format!("{}, switched", accelerator.name());
            ways.push((name, BuildOptions { accelerator_options, ..plain(accelerator) }));
        }
    }
    let bvh = plain(AcceleratorKind::Bvh);
    for quality in [Quality::Fast, Quality::High] {
        ways.push((format!("bvh, {quality:?}"), BuildOptions { quality, ..bvh.clone() }));
    }
    ways.push(("bvh, compact".to_owned(), BuildOptions { compact: true, ..bvh }));
    ways
}

/// Rays with masks and times.
struct Asked<P: Tested> {
    rays: Vec<P::Ray>,
    masks: Vec<u64>,
    times: Vec<f32>,
}

impl<P: Tested> Asked<P> {
    /// `count` random rays, and as many aimed at triangles.
    fn new(source: &mut Source, world: &Collected<P>, count: usize) -> Self {
        let mut asked = Self { rays: Vec::new(), masks: Vec::new(), times: Vec::new() };
        for i in 0..2 * count {
            let ray = if i < count {
                P::ray(&source.ray(), world.place)
            } else {
                source.aimed_ray(world)
            };
            asked.rays.push(ray);
            asked.masks.push(source.mask());
            asked.times.push([0.0, 1.0, 0.3, f32::NAN, 0.5, -1.0, 0.77][i % 7]);
        }
        asked
    }

    fn queries(&self) -> Rays<'_, P> {
        Rays::new(&self.rays).with_masks(&self.masks).with_times(&self.times)
    }

    /// All hits of each ray. Asserts that the first is the closest.
    fn answers(&self, oracle: &P::World) -> Vec<Vec<P::Hit>> {
        let answer = |i: usize| {
            let query = self.queries().get(i);
            let (all, closest) = (P::all_one(oracle, query), P::closest_one(oracle, query));
            assert_eq!(
                P::bits(&closest),
                P::bits(&first::<P>(&all)),
                "closest and all: {:?}",
                self.rays[i]
            );
            all
        };
        (0..self.rays.len()).map(answer).collect()
    }

    fn assert_answers(
        &self,
        world: &P::World,
        name: &str,
        expected: &[Vec<P::Hit>],
        batches: &[usize],
    ) {
        for (i, expected) in expected.iter().enumerate() {
            let (query, ray) = (self.queries().get(i), &self.rays[i]);
            let found = P::all_one(world, query);
            let only = |a: &[P::Hit], b: &[P::Hit]| -> Vec<P::Hit> {
                a.iter().filter(|x| b.iter().all(|y| P::bits(x) != P::bits(y))).copied().collect()
            };
            let (missed, wrong) = (only(expected, &found), only(&found, expected));
            let same = missed.is_empty() && wrong.is_empty() && found.len() == expected.len();
            assert!(same, "{name}, all: {ray:?} misses {missed:?} and wrongly finds {wrong:?}");
            let closest = P::closest_one(world, query);
            assert_eq!(
                P::bits(&closest),
                P::bits(&first::<P>(expected)),
                "{name}, closest: {ray:?}"
            );
            assert_eq!(P::occluded_one(world, query), !expected.is_empty(), "{name}, any: {ray:?}");
        }
        for &batch in batches {
            self.assert_batches(world, name, expected, batch);
        }
    }

    fn assert_batches(&self, world: &P::World, name: &str, all: &[Vec<P::Hit>], batch: usize) {
        let count = self.rays.len();
        for grouping in [Grouping::None, Grouping::Coherent] {
            let mut hits = vec![P::MISS; count];
            let mut blocked = vec![false; count];
            let mut counts = vec![u32::MAX; count];
            for start in (0..count).step_by(batch) {
                let range = start..(start + batch).min(count);
                let rays = self.queries().slice(range.clone());
                P::closest(world, rays, grouping, &mut hits[range.clone()]);
                P::occluded(world, rays, grouping, &mut blocked[range.clone()]);
                P::count(world, rays, &mut counts[range]);
            }
            for (i, expected) in all.iter().enumerate() {
                let what = format!("{name}, batches of {batch}, {grouping:?}: {:?}", self.rays[i]);
                assert_eq!(P::bits(&hits[i]), P::bits(&first::<P>(expected)), "{what}, closest");
                assert_eq!(blocked[i], !expected.is_empty(), "{what}, any");
                assert_eq!(counts[i] as usize, expected.len(), "{what}, count");
            }
        }
    }
}

/// The first of all hits; a miss if there are none.
fn first<P: Tested>(all: &[P::Hit]) -> P::Hit {
    all.first().copied().unwrap_or(P::MISS)
}

/// All fields of a hit, for bitwise comparison.
pub fn bits(hit: &Hit) -> [u32; 6] {
    [
        hit.t.to_bits(),
        hit.uv.x.to_bits(),
        hit.uv.y.to_bits(),
        hit.instance,
        hit.geometry,
        hit.primitive,
    ]
}
