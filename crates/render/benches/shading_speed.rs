//! Samples per second of built-in scenes on one thread, and how the time is shared between tracing
//! and everything else.
//!
//! `cargo bench -p snell-render --bench shading_speed -- [SCENE...]`

#![expect(clippy::disallowed_methods, reason = "times need no certain bits")]

use snell_intersect::BuildOptions;
use snell_render::{CompiledScene, Job, Settings};
use snell_scene::builtin::builtin;
use std::time::Instant;

const REPEATS: usize = 5;

fn main() {
    let chosen: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let scenes = if chosen.is_empty() {
        ["cornell-box", "spheres", "teapot", "night-town"].map(String::from).to_vec()
    } else {
        chosen
    };
    println!(
        "{:12} {:>10} {:>12} {:>12} {:>10} {:>10} {:>10}",
        "scene", "Msamples/s", "ns/sample", "ns tracing", "Mrays", "variance", "mean"
    );
    for name in scenes {
        let scene = builtin(&name).expect("the name of a built-in scene");
        let compiled = CompiledScene::new(&scene, &BuildOptions::default())
            .expect("built-in scenes are valid");
        let settings = Settings { size: [128, 128], spp: 16, max_depth: 8, ..Settings::default() };
        let job = Job::new(&compiled, &scene.cameras[0], &settings);
        let samples = f64::from(settings.size[0] * settings.size[1] * settings.spp);
        let image = |seed| {
            Job::new(&compiled, &scene.cameras[0], &Settings { seed, ..settings.clone() })
                .run(1, &|_| true)
                .0
                .image()
        };
        let (a, b) = (image(1), image(2));
        let pairs = || {
            a.layers[0]
                .values
                .iter()
                .zip(&b.layers[0].values)
                .map(|(&a, &b)| (f64::from(a), f64::from(b)))
        };
        let (count, sum) = (pairs().count() as f64, pairs().map(|(a, b)| a + b).sum::<f64>());
        let mean = sum / (2.0 * count);
        let variance =
            0.5 * pairs().map(|(a, b)| (a - b).powi(2)).sum::<f64>() / count / (mean * mean)
                * f64::from(settings.spp);
        let mut best: Option<(f64, f64, f64)> = None;
        for _ in 0..REPEATS {
            let start = Instant::now();
            let (_, statistics) = job.run(1, &|_| true);
            let seconds = start.elapsed().as_secs_f64();
            let rays = statistics.rays.total() as f64;
            if best.is_none_or(|b| seconds < b.0) {
                best = Some((seconds, statistics.tracing.as_secs_f64(), rays));
            }
        }
        let (seconds, tracing, rays) = best.expect("at least one repeat");
        let each = 1e9 / samples;
        println!(
            "{name:12} {:>10.3} {:>12.0} {:>12.0} {:>10.2} {variance:>10.4} {mean:>10.5}",
            samples / seconds * 1e-6,
            seconds * each,
            tracing * each,
            rays * 1e-6
        );
    }
}
