//! The summary of a render: on the terminal, in the picture's metadata, and as JSON.

use super::options::Options;
use super::output::Target;
use crate::messages;
use crate::progress::duration;
use crate::resources::peak_memory_bytes;
use serde_json::{Value, json};
use snell_persist::Receipt;
use snell_render::{CompiledScene, Film, PhotonCounts, Settings, Statistics};
use snell_scene::{Scene, Warning};
use std::path::Path;

/// The share of paths that may be cut short without a warning.
const CUT_SHARE: f64 = 1e-3;

/// What a picture's file says of it.
pub struct Facts<'a> {
    pub scene: &'a Scene,
    pub settings: &'a Settings,
    pub statistics: Statistics,
    /// Figures of the photons, if caustics were found by photons.
    pub photons: Option<PhotonCounts>,
    pub film: &'a Film,
    pub image_sha256: String,
    pub receipt: Receipt,
}

impl Facts<'_> {
    /// Metadata of the picture.
    pub fn metadata(&self) -> Vec<(String, String)> {
        let s = self.settings;
        [
            ("Software", format!("Snell {}", env!("CARGO_PKG_VERSION"))),
            ("Scene", self.scene.name.clone()),
            ("Integrator", s.integrator.name().to_string()),
            ("Samples", self.film.least_samples().to_string()),
            ("MaxDepth", s.max_depth.to_string()),
            ("Seed", s.seed.to_string()),
            ("Sampler", s.sampler.name().to_string()),
            ("Filter", s.filter.name().to_string()),
            ("ImageSHA256", self.image_sha256.clone()),
        ]
        .map(|(k, v)| (k.to_string(), v))
        .into_iter()
        .chain(
            s.guiding.map(|_| {
                ("GuidingPasses".to_string(), self.statistics.training_passes.to_string())
            }),
        )
        .chain([(Receipt::KEY.to_string(), self.receipt.text())])
        .collect()
    }
}

/// A finished render.
pub struct Summary<'a> {
    pub facts: Facts<'a>,
    pub compiled: &'a CompiledScene,
    /// Warnings from before the render.
    pub warnings: Vec<Warning>,
    pub load_seconds: f64,
    pub build_seconds: f64,
    pub render_seconds: f64,
    pub threads: usize,
    /// The memory estimate from before the render.
    pub estimated_memory_bytes: u64,
}

impl Summary<'_> {
    fn mrays_per_second(&self) -> f64 {
        self.facts.statistics.rays.total() as f64 / self.render_seconds.max(1e-9) / 1e6
    }

    /// The share of pixels whose error is within the requested limit.
    fn converged(&self) -> Option<f64> {
        let pixels = self.facts.film.crop.size().iter().map(|&s| f64::from(s)).product::<f64>();
        self.facts
            .settings
            .noise
            .map(|_| self.facts.statistics.converged_pixels as f64 / pixels.max(1.0))
    }

    /// Samples per pixel, as text.
    fn samples(&self) -> String {
        let least = self.facts.film.least_samples();
        match (self.facts.settings.noise, self.converged()) {
            (Some(noise), Some(share)) => format!(
                "{:.0} samples per pixel ({least} to {}), {:.1} % of the pixels within {noise}",
                self.facts.film.mean_samples(),
                self.facts.film.most_samples(),
                (share * 1000.0).floor() / 10.0
            ),
            _ => format!("{least} samples per pixel"),
        }
    }

    /// The JSON of `--stats`.
    pub fn json(&self) -> Value {
        let rays = self.facts.statistics.rays;
        json!({
            "scene": self.facts.scene.name,
            "integrator": self.facts.settings.integrator.name(),
            "size": self.facts.settings.size,
            "triangles": self.compiled.world.triangle_count(),
            "instanced_triangles": self.compiled.world.instanced_triangle_count(),
            "shapes": self.compiled.world.shape_count(),
            "instances": self.compiled.world.instance_count(),
            "lights": self.compiled.lights().len(),
            "load_seconds": self.load_seconds,
            "build_seconds": self.build_seconds,
            "render_seconds": self.render_seconds,
            "rays": { "camera": rays.camera, "shadow": rays.shadow, "indirect": rays.indirect },
            "mrays_per_second": self.mrays_per_second(),
            "tracing_seconds": self.facts.statistics.tracing.as_secs_f64(),
            "guiding": self.facts.settings.guiding.map(|_| json!({
                "passes": self.facts.statistics.training_passes,
                "seconds": self.facts.statistics.training.as_secs_f64(),
                "regions": self.facts.statistics.guiding_regions,
                "memory_bytes": self.facts.statistics.guiding_bytes,
            })),
            "caustics": self.facts.photons.map(|photons| json!({
                "photons_of_pass": photons.of_pass,
                "passes": photons.passes,
                "landed": photons.landed,
                "in_media": photons.in_media,
                "seconds": photons.time.as_secs_f64(),
                "map_bytes": photons.map_bytes,
                "first_radius": photons.first_radius,
                "first_radius_in_media": photons.first_radius_in_media,
            })),
            "spp": self.facts.film.least_samples(),
            "spp_mean": self.facts.film.mean_samples(),
            "spp_most": self.facts.film.most_samples(),
            "noise": self.facts.settings.noise,
            "converged": self.converged(),
            "complete": self.facts.statistics.is_complete,
            "invalid_samples": self.facts.statistics.invalid_samples,
            "cut_paths": self.facts.statistics.cut_paths,
            "warnings": messages::as_json(&self.warnings),
            "peak_memory_bytes": peak_memory_bytes(),
            "estimated_memory_bytes": self.estimated_memory_bytes,
            "accelerator_memory_bytes": self.compiled.world.memory_bytes(),
            "threads": self.threads,
            "simd": self.facts.settings.build.simd.name(),
            "image_sha256": self.facts.image_sha256,
            "receipt": self.facts.receipt,
        })
    }

    /// The closing lines on the terminal.
    pub fn print(&self, options: &Options, target: Target) {
        let [w, h] = self.facts.film.crop.size();
        let place = match target {
            Target::File(path) => path.display().to_string(),
            Target::Output { .. } => "standard output".into(),
        };
        eprintln!(
            "{place}: {w}x{h}, {}, {} in {} ({:.1} Mrays/s, {} thread{})",
            self.samples(),
            self.facts.settings.integrator.name(),
            duration(self.render_seconds),
            self.mrays_per_second(),
            self.threads,
            if self.threads == 1 { "" } else { "s" },
        );
        if self.facts.settings.guiding.is_some() {
            let statistics = &self.facts.statistics;
            eprintln!(
                "guided by {} training pass{} in {} ({} regions, {:.1} MB)",
                statistics.training_passes,
                if statistics.training_passes == 1 { "" } else { "es" },
                duration(statistics.training.as_secs_f64()),
                statistics.guiding_regions,
                statistics.guiding_bytes as f64 * 1e-6,
            );
        }
        if let Some(photons) = self.facts.photons {
            let in_media = match photons.in_media {
                0 => String::new(),
                points => format!(
                    " and {points} points in media, there of first radius {:.3},",
                    photons.first_radius_in_media,
                ),
            };
            eprintln!(
                "caustics by {} photons{in_media} in {} pass{} of {} ({:.1} s of threads, maps of \
                 {:.1} MB, first radius {:.3})",
                photons.landed,
                photons.passes,
                if photons.passes == 1 { "" } else { "es" },
                photons.of_pass,
                photons.time.as_secs_f64(),
                photons.map_bytes as f64 * 1e-6,
                photons.first_radius,
            );
        }
        if options.verbose {
            let rays = self.facts.statistics.rays;
            eprintln!(
                "{} triangles, {} shapes, {} instances, {} lights; read {}, built {}; rays: {} \
                    camera, {} shadow, {} indirect; \
                 {}; sha256 {}",
                self.compiled.world.triangle_count(),
                self.compiled.world.shape_count(),
                self.compiled.world.instance_count(),
                self.compiled.lights().len(),
                duration(self.load_seconds),
                duration(self.build_seconds),
                rays.camera,
                rays.shadow,
                rays.indirect,
                self.facts.settings.build.simd,
                self.facts.image_sha256,
            );
        }
        if self.facts.statistics.invalid_samples > 0 {
            eprintln!(
                "warning: {}: {} samples were not finite and count as black; lights, colours or \
                    sizes of the scene may be too large",
                options.scene.display(),
                self.facts.statistics.invalid_samples
            );
        }
        let cut_share =
            self.facts.statistics.cut_paths as f64 / self.facts.statistics.samples.max(1) as f64;
        if self.facts.settings.max_depth >= Settings::MAX_DEPTH && cut_share > CUT_SHARE {
            eprintln!(
                "warning: {}: {:.1} % of the paths were cut short after {} bounces, so light may \
                    be missing; use a larger --max-depth",
                options.scene.display(),
                cut_share * 100.0,
                self.facts.settings.max_depth
            );
        }
        if options.scene == Path::new("cornell-box") && options.output.is_none() {
            eprintln!(
                "\nNext: `snell render FILE` for your own scene (glTF, OBJ, PLY, STL, pbrt, \
                    Mitsuba, USD, .scn and more),"
            );
            eprintln!(
                "      `snell render teapot`, `snell scenes` for more built-in ones, `snell render \
                    --help` for everything."
            );
        }
    }
}
