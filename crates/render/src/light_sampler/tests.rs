use super::*;
use snell_math::rng::{self, uniform2};
use snell_math::simd::Level;
use snell_math::statistics::{chi_squared_deviation, sidak_deviation};
use snell_math::{Bounds3d, DVec3, sampling};

fn unit(i: u32, k: u32) -> f32 {
    rng::to_unit(rng::hash_combine(i, k))
}

fn random_point(key: u32, size: f32) -> Vec3 {
    (Vec3::new(unit(key, 1), unit(key, 2), unit(key, 3)) * 2.0 - 1.0) * size
}

fn part(key: u32, size: f32) -> LightBounds {
    let center = random_point(key, size).as_dvec3();
    let reach = DVec3::splat(f64::from(unit(key, 4)) * 0.1 * f64::from(size));
    LightBounds {
        bounds: Bounds3d { min: center - reach, max: center + reach },
        axis: sampling::uniform_sphere(uniform2([key, 0, 0, 1])),
        cos_spread: if key.is_multiple_of(5) { -1.0 } else { 1.0 },
        cos_emission: if key.is_multiple_of(7) { 0.9 } else { 0.0 },
        is_two_sided: key.is_multiple_of(3),
        intensity: f64::from(unit(key, 5)).powi(4) + 1e-4,
    }
}

/// Lights with one part, with many parts, and beside the tree.
fn lights(count: u32, size: f32) -> Vec<LightSummary> {
    let light = |i: u32| {
        let parts = match i % 4 {
            0 => Vec::new(),
            1 => (0..20).map(|k| part(1000 + i * 100 + k, size)).collect(),
            _ => vec![part(i, size)],
        };
        LightSummary { power: f64::from(unit(i, 8)), parts, is_sampled: i != 4 }
    };
    (0..count).map(light).collect()
}

fn receiver(key: u32, size: f32) -> Receiver {
    let normal = if key.is_multiple_of(4) {
        Vec3::ZERO
    } else {
        sampling::uniform_sphere(uniform2([key, 7, 7, 7]))
    };
    Receiver {
        position: random_point(key ^ 0x5555, size),
        normal,
        transmits: key.is_multiple_of(3),
    }
}

fn table(kind: LightSamplerKind, powers: &[f64], left_out: Option<usize>) -> LightSampler {
    let light = |(i, &power): (usize, &f64)| LightSummary {
        power,
        parts: vec![],
        is_sampled: left_out != Some(i),
    };
    LightSampler::new(
        kind,
        &powers.iter().enumerate().map(light).collect::<Vec<_>>(),
        Level::best().wide(),
    )
}

fn probability(sampler: &LightSampler, light: usize) -> f32 {
    sampler.probability(&Receiver::default(), light, (0, 1.0))
}

#[test]
fn the_unit_of_power_does_not_matter() {
    for scale in [1e-60, 1.0, 1e60] {
        let sampler = table(LightSamplerKind::Power, &[scale, 3.0 * scale, 0.0], None);
        assert_eq!([0, 1, 2].map(|light| probability(&sampler, light)), [0.25, 0.75, 0.0]);
    }
}

#[test]
fn lights_without_power_are_chosen_among_themselves() {
    for kind in [LightSamplerKind::Power, LightSamplerKind::Bvh] {
        assert_eq!(probability(&table(kind, &[0.0, 0.0], None), 1), 0.5);
        assert!(table(kind, &[], None).sample(&Receiver::default(), || 0.5).is_none());
    }
}

#[test]
fn a_light_that_is_left_out_takes_no_samples_from_the_others() {
    for kind in LightSamplerKind::ALL {
        let sampler = table(kind, &[2.0, 2.0, 1000.0], Some(2));
        assert_eq!(
            [0, 1, 2].map(|light| probability(&sampler, light)),
            [0.5, 0.5, 0.0],
            "{kind:?}"
        );
    }
    for kind in LightSamplerKind::ALL {
        assert!(table(kind, &[2.0], Some(0)).sample(&Receiver::default(), || 0.5).is_none());
    }
}

#[test]
fn the_tree_gives_every_emitter_with_the_probability_it_says() {
    for (count, size) in [(1, 1.0), (2, 1.0), (3, 1e-4), (30, 1e5), (900, 1.0)] {
        let lights = lights(count, size);
        let sampler = LightSampler::new(LightSamplerKind::Bvh, &lights, Level::best().wide());
        for key in 0..12 {
            let receiver = receiver(key, size);
            let parts = |l: &LightSummary| l.parts.len().max(1) as u32;
            let of = |light: usize, part: u32| sampler.probability(&receiver, light, (part, 1.0));
            let all: f64 = (0..lights.len())
                .flat_map(|l| (0..parts(&lights[l])).map(move |p| f64::from(of(l, p))))
                .sum();
            let mut chosen_at_all = 0.0;
            for i in 0..2000 {
                let u = (i as f32 + 0.5) / 2000.0;
                let Some(chosen) = sampler.sample(&receiver, || u) else { continue };
                let again = of(chosen.light, chosen.part.unwrap_or(0));
                assert!((again / chosen.probability - 1.0).abs() < 1e-4, "{again} {chosen:?}");
                chosen_at_all += 1.0 / 2000.0;
            }
            // The other numbers end in branches whose bounds promise light, but none of whose
            // emitters can contribute.
            assert!(
                (all - chosen_at_all).abs() < 0.01 && all < 1.0001,
                "{count} {key}: {all} {chosen_at_all}"
            );
        }
    }
}

/// Chi-squared test of the emitters that are chosen with random numbers, for every kind of light
/// sampler.
#[test]
fn emitters_are_chosen_as_often_as_stated() {
    let n = 20_000u32;
    let cases: Vec<(LightSamplerKind, u32, f32)> = LightSamplerKind::ALL
        .into_iter()
        .flat_map(|kind| [(2, 1.0), (30, 1e3), (300, 1.0)].map(|(count, size)| (kind, count, size)))
        .collect();
    let (receivers, mut worst) = (4, (f64::NEG_INFINITY, String::new()));
    for &(kind, count, size) in &cases {
        let lights = lights(count, size);
        let sampler = LightSampler::new(kind, &lights, Level::best().wide());
        for key in 0..receivers {
            let receiver = receiver(key, size);
            // The tree chooses parts. Tables choose lights, and the part is then chosen by the
            // light.
            let parts = |l: &LightSummary| {
                if kind == LightSamplerKind::Bvh { l.parts.len().max(1) } else { 1 }
            };
            let firsts: Vec<usize> = lights
                .iter()
                .scan(0, |sum, l| Some(std::mem::replace(sum, *sum + parts(l))))
                .collect();
            let mut expected: Vec<f64> = (0..lights.len())
                .flat_map(|l| (0..parts(&lights[l]) as u32).map(move |part| (l, part)))
                .map(|(l, part)| {
                    f64::from(sampler.probability(&receiver, l, (part, 1.0))) * f64::from(n)
                })
                .collect();
            expected.push((f64::from(n) - expected.iter().sum::<f64>()).max(0.0));
            let mut found = vec![0; expected.len()];
            for i in 0..n {
                let place = match sampler.sample(&receiver, || unit(i, 40 + key)) {
                    Some(chosen) => firsts[chosen.light] + chosen.part.unwrap_or(0) as usize,
                    None => found.len() - 1,
                };
                found[place] += 1;
            }
            let z = chi_squared_deviation(&found, &expected);
            if z > worst.0 {
                worst = (z, format!("{kind:?}, {count} lights, receiver {key}"));
            }
        }
    }
    let limit = sidak_deviation(0.01, receivers * cases.len() as u32);
    assert!(worst.0 < limit, "{worst:?} exceeds {limit}");
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let parts: Vec<LightBounds> = (0..20_000).map(|i| part(i, 1.0)).collect();
    let lights = [LightSummary { power: 1.0, parts, is_sampled: true }];
    let choices = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let sampler = pool
            .install(|| LightSampler::new(LightSamplerKind::Bvh, &lights, Level::best().wide()));
        (0..3000).map(|i| sampler.sample(&receiver(i, 1.0), || unit(i, 9))).collect::<Vec<_>>()
    };
    assert_eq!(choices(1), choices(3));
}

/// With equidistant numbers, each emitter is chosen as often as its probability says, up to one for
/// each boundary.
#[test]
fn stratified_numbers_stay_stratified_over_the_tree() {
    let lights = lights(60, 1.0);
    let sampler = LightSampler::new(LightSamplerKind::Bvh, &lights, Level::best().wide());
    let receiver = receiver(5, 1.0);
    let n = 100_000;
    let mut counts = std::collections::BTreeMap::new();
    for i in 0..n {
        let u = (i as f32 + 0.5) / n as f32;
        let Some(chosen) = sampler.sample(&receiver, || u) else { continue };
        counts.entry((chosen.light, chosen.part)).or_insert((0, chosen.probability)).0 += 1;
    }
    for (key, (count, probability)) in counts {
        let expected = probability * n as f32;
        assert!(
            (count as f32 - expected).abs() <= 2.0 + 1e-4 * expected,
            "{key:?}: {count} {expected}"
        );
    }
}

/// The importance of a branch must never be 0 where an emitter in it could light the receiver.
#[test]
fn no_emitter_that_may_bring_light_is_left_out() {
    let lights = lights(200, 1.0);
    let sampler = LightSampler::new(LightSamplerKind::Bvh, &lights, Level::best().wide());
    for key in 0..60 {
        let receiver = receiver(key, 1.5);
        for (number, light) in lights.iter().enumerate().filter(|(_, l)| l.is_sampled) {
            for (k, bounds) in (0..).zip(&light.parts) {
                let center = bounds.bounds.center().as_vec3();
                let to_receiver = (receiver.position - center).normalize();
                let cos = to_receiver.dot(bounds.axis);
                let cos = if bounds.is_two_sided { cos.abs() } else { cos };
                let shines = bounds.cos_spread < 0.0 || cos > bounds.cos_emission.max(0.0) + 1e-3;
                let incident = -to_receiver.dot(receiver.normal);
                let incident = if receiver.transmits { incident.abs() } else { incident };
                if shines && (receiver.normal == Vec3::ZERO || incident > 1e-3) {
                    assert!(
                        sampler.probability(&receiver, number, (k, 1.0)) > 0.0,
                        "{key} {number} {k}"
                    );
                }
            }
        }
    }
}

#[test]
fn near_and_facing_lights_are_preferred() {
    let at = |x: f64, axis: Vec3| LightSummary {
        power: 1.0,
        parts: vec![LightBounds {
            bounds: Bounds3d { min: DVec3::new(x, 1.0, 0.0), max: DVec3::new(x, 1.0, 0.0) },
            axis,
            cos_spread: 1.0,
            cos_emission: 0.0,
            is_two_sided: false,
            intensity: 1.0,
        }],
        is_sampled: true,
    };
    let lights = [at(0.0, Vec3::NEG_Y), at(10.0, Vec3::NEG_Y), at(0.5, Vec3::Y)];
    let sampler = LightSampler::new(LightSamplerKind::Bvh, &lights, Level::best().wide());
    let receiver = Receiver { position: Vec3::ZERO, normal: Vec3::Y, transmits: false };
    let p = [0, 1, 2].map(|light| sampler.probability(&receiver, light, (0, 1.0)));
    assert!(p[0] > 0.999 && p[1] > 0.0 && p[2] == 0.0, "{p:?}");
    let behind = Receiver { normal: Vec3::NEG_Y, ..receiver };
    assert!(sampler.sample(&behind, || 0.3).is_none());
}

#[test]
fn broken_emitters_and_receivers_give_no_nan() {
    let mut broken = lights(40, 1.0);
    let point = |x: f64| Bounds3d { min: DVec3::splat(x), max: DVec3::splat(x) };
    for (i, bounds) in [point(f64::NAN), point(f64::INFINITY), Bounds3d::EMPTY, point(1e300)]
        .into_iter()
        .enumerate()
    {
        let parts = vec![LightBounds { bounds, ..part(i as u32, 1.0) }];
        broken.push(LightSummary { power: 1.0, parts, is_sampled: true });
    }
    for intensity in [0.0, 1e300, 1e-300] {
        let parts = vec![LightBounds { intensity, ..part(3, 1.0) }];
        broken.push(LightSummary { power: f64::MAX, parts, is_sampled: true });
    }
    // A thousand emitters in the same place.
    broken.push(LightSummary { power: 1.0, parts: vec![part(9, 1.0); 1000], is_sampled: true });
    let sampler = LightSampler::new(LightSamplerKind::Bvh, &broken, Level::best().wide());
    let positions = [
        Vec3::ZERO,
        Vec3::NAN,
        Vec3::splat(f32::INFINITY),
        Vec3::splat(f32::MAX),
        Vec3::splat(1e-40),
    ];
    for position in positions {
        for normal in [Vec3::Z, Vec3::ZERO, Vec3::NAN] {
            let receiver = Receiver { position, normal, transmits: false };
            for i in 0..200 {
                if let Some(chosen) = sampler.sample(&receiver, || unit(i, 1)) {
                    assert!(chosen.probability > 0.0 && chosen.probability <= 1.0001, "{chosen:?}");
                    let again = sampler.probability(
                        &receiver,
                        chosen.light,
                        (chosen.part.unwrap_or(0), 1.0),
                    );
                    assert!((again / chosen.probability - 1.0).abs() < 1e-3);
                }
            }
        }
    }
}

/// Run it with `cargo test --release -p snell-render a_million -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn a_million_emitters() {
    let parts: Vec<LightBounds> =
        (0..1_000_000).map(|i| LightBounds { cos_spread: 1.0, ..part(i, 1.0) }).collect();
    let lights = [LightSummary { power: 1.0, parts, is_sampled: true }];
    let start = std::time::Instant::now();
    let LightSampler::Bvh(tree) =
        LightSampler::new(LightSamplerKind::Bvh, &lights, Level::best().wide())
    else {
        return;
    };
    let built = start.elapsed();
    let start = std::time::Instant::now();
    let mut sum = 0.0;
    let n = 1_000_000;
    for i in 0..n {
        let receiver = receiver(i & 1023, 1.0);
        sum += tree.sample(&receiver, || unit(i, 3)).map_or(0.0, |c| c.probability);
    }
    let nanoseconds = start.elapsed().as_nanos() / u128::from(n);
    println!(
        "built in {built:?}, {} MB, {nanoseconds} ns a choice ({sum})",
        tree.bytes() / 1_000_000
    );
}
