//! `snell bench samplers`: error against number of samples.
//!
//! Every pixel of some pictures estimates the same integral of known value. The root mean square of
//! the errors measures a sampler's quality. The root mean square after a slight blur measures how
//! well the errors of neighbouring pixels cancel, which is what the eye sees.

mod blur;
mod integrands;
mod plot;

use crate::exit::ExitCode;
use crate::failure::{Failure, choice};
use crate::standard_output;
use integrands::{INTEGRANDS, Integrand};
use serde_json::json;
use snell_math::real;
use snell_render::SamplerKind;
use snell_render::sampler::Sampler;
use std::path::PathBuf;

/// Options of `snell bench samplers`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Samplers: independent, stratified, sobol, zsobol. Default: all
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    sampler: Vec<String>,
    /// Numbers of samples per pixel
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "1,2,4,8,16,32,64,128,256,512,1024",
        value_parser = clap::value_parser!(u32).range(1..=1 << 20),
    )]
    spp: Vec<u32>,
    /// Number of pictures, each with another seed, whose pixels are the estimates
    #[arg(
        long,
        value_name = "N",
        default_value_t = 8,
        value_parser = clap::value_parser!(u32).range(1..=10_000),
    )]
    pictures: u32,
    /// Width and height of a picture
    #[arg(
        long,
        value_name = "N",
        default_value_t = 32,
        value_parser = clap::value_parser!(u32).range(8..=1024),
    )]
    side: u32,
    /// Seed of the first picture
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Write a plot as SVG
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Print JSON, a line for each measurement
    #[arg(long)]
    json: bool,
}

/// Errors of one sampler on one integrand.
pub struct Series {
    integrand: &'static Integrand,
    sampler: SamplerKind,
    points: Vec<Point>,
}

/// Errors of the estimates with one number of samples, relative to the integral.
#[derive(Clone, Copy)]
pub struct Point {
    spp: u32,
    /// Root mean square of the errors.
    error: f64,
    /// Root mean square of the blurred errors, divided by the blur's effect on white noise: equal
    /// to `error` if neighbours are independent.
    blurred: f64,
}

impl Series {
    /// The exponent of the power law fitted to the errors; `None` for fewer than two points.
    fn exponent(&self) -> Option<f64> {
        let logs: Vec<[f64; 2]> =
            self.points.iter().map(|p| [real::ln(f64::from(p.spp)), real::ln(p.error)]).collect();
        let n = logs.len() as f64;
        let mean = |axis: usize| logs.iter().map(|p| p[axis]).sum::<f64>() / n;
        let (x, y) = (mean(0), mean(1));
        let square: f64 = logs.iter().map(|p| real::powi(p[0] - x, 2)).sum();
        let exponent = logs.iter().map(|p| (p[0] - x) * (p[1] - y)).sum::<f64>() / square;
        exponent.is_finite().then_some(exponent)
    }
}

/// Measures and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    if let Some(path) = &options.plot {
        snell_formats::atomic::check(path)?;
    }
    let named = |name: &String| choice("sampler", name, &SamplerKind::ALL, SamplerKind::name);
    let mut samplers = options.sampler.iter().map(named).collect::<Result<Vec<_>, _>>()?;
    if samplers.is_empty() {
        samplers.extend(SamplerKind::ALL);
    }
    let mut all = Vec::new();
    for integrand in &INTEGRANDS {
        let series: Vec<Series> =
            samplers.iter().map(|&sampler| measure(options, integrand, sampler)).collect();
        let text = if options.json { lines(&series) } else { table(integrand, &series) };
        standard_output::write(text.as_bytes())?;
        all.extend(series);
    }
    if let Some(path) = &options.plot {
        snell_formats::atomic::write(path, plot::svg(&all).as_bytes())?;
    }
    Ok(ExitCode::SUCCESS)
}

fn measure(options: &Options, integrand: &'static Integrand, sampler: SamplerKind) -> Series {
    let point = |&spp: &u32| {
        let mut squares = [0.0; 2];
        for picture in 0..options.pictures {
            let sampler = Sampler::new(sampler, options.seed.wrapping_add(picture), spp);
            let errors = errors(sampler, options.side, spp, integrand);
            let blurred = blur::blurred(&errors, options.side as usize);
            squares[0] += mean_square(&errors);
            squares[1] += mean_square(&blurred);
        }
        let [error, blurred] = squares.map(|s| (s / f64::from(options.pictures)).sqrt());
        Point { spp, error, blurred: blurred / blur::OF_WHITE_NOISE }
    };
    Series { integrand, sampler, points: options.spp.iter().map(point).collect() }
}

fn mean_square(errors: &[f64]) -> f64 {
    errors.iter().map(|x| x * x).sum::<f64>() / errors.len() as f64
}

/// The relative error of each pixel's estimate.
fn errors(sampler: Sampler, side: u32, spp: u32, integrand: &Integrand) -> Vec<f64> {
    let pixels = (0..side * side).map(|i| [i % side, i / side]);
    let estimate = |pixel| {
        (0..spp).map(|s| (integrand.value)(&sampler.random(pixel, s))).sum::<f64>() / f64::from(spp)
    };
    pixels.map(|pixel| estimate(pixel) / integrand.integral - 1.0).collect()
}

fn lines(series: &[Series]) -> String {
    let mut text = String::new();
    for s in series {
        let (integrand, sampler) = (s.integrand.name, s.sampler.name());
        for p in &s.points {
            let line = json!({
                "integrand": integrand, "sampler": sampler, "spp": p.spp, "error": p.error,
                "blurred_error": p.blurred,
            });
            text += &format!("{line}\n");
        }
        text += &format!(
            "{}\n",
            json!({ "integrand": integrand, "sampler": sampler, "exponent": s.exponent() })
        );
    }
    text
}

fn table(integrand: &Integrand, series: &[Series]) -> String {
    let mut text = format!(
        "{} ({}): error, and after a blur\n{:>8}",
        integrand.name, integrand.formula, "spp"
    );
    series.iter().for_each(|s| text += &format!("{:>22}", s.sampler.name()));
    for row in 0..series[0].points.len() {
        text += &format!("\n{:>8}", series[0].points[row].spp);
        series
            .iter()
            .map(|s| s.points[row])
            .for_each(|p| text += &format!("{:>11.6}{:>11.6}", p.error, p.blurred));
    }
    text += &format!("\n{:>8}", "power");
    for s in series {
        text += &format!("{:>11}{:11}", s.exponent().map_or("-".into(), |e| format!("{e:.2}")), "");
    }
    text.trim_end().to_owned() + "\n\n"
}
