//! `snell compare`: how much two pictures differ.

use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::standard_output;
use snell_formats::error::one_line;
use snell_formats::image::compare::{
    BYTES_PER_PIXEL, CompareOptions, Comparison, LinearImage, compare, difference_picture,
};
use snell_formats::image::{WriteOptions, read_image, read_layers, write_image};
use snell_formats::memory::Available;
use snell_formats::{Input, ReadOptions};
use std::path::{Path, PathBuf};

/// Options of `snell compare`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The reference
    reference: PathBuf,
    /// The other picture
    test: PathBuf,
    /// Compare the layers (or parts) of this name in two OpenEXR files, instead of the pictures
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write a picture of the differences (FLIP error: black is equal)
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Exit with 1 if the relative mean squared error is over this
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_negative_numbers = true)]
    max_relmse: Option<f64>,
    /// Exit with 1 if the mean FLIP error is over this
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_negative_numbers = true)]
    max_flip: Option<f64>,
    /// Exit with 1 if more than this share of the pixels (0 to 1) differs by more than the
    /// threshold
    #[arg(long, value_name = "X", value_parser = parse_limit, allow_negative_numbers = true)]
    max_different: Option<f64>,
    /// A pixel counts as different if it differs by more than this many levels of 255
    #[arg(long, value_name = "LEVELS", default_value_t = 1)]
    threshold: u8,
}

fn parse_limit(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|limit| *limit >= 0.0)
        .ok_or_else(|| "expected a number of at least 0".into())
}

/// Compares and prints.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let layer = options.layer.as_deref();
    let (reference, test) = (read(&options.reference, layer)?, read(&options.test, layer)?);
    let needed = reference.pixels.len() as u64 * BYTES_PER_PIXEL as u64;
    let what = format!("comparing pictures of {}x{} pixels", reference.width, reference.height);
    let admitted = Available::now().admit(&what, needed);
    admitted
        .map_err(|problem| Failure::Other(format!("{problem}; compare smaller parts of them")))?;
    let settings = CompareOptions { threshold: options.threshold, ..CompareOptions::default() };
    let compared = compare(&reference, &test, &settings).map_err(|e| {
        Failure::Other(format!(
            "{} and {}: {e}",
            options.reference.display(),
            options.test.display()
        ))
    })?;
    if let Some(path) = &options.output {
        write_image(path, &difference_picture(&compared), &WriteOptions::default())?;
    }
    let numbers = &compared.comparison;
    let text = if options.json {
        serde_json::to_string_pretty(numbers).map_err(|e| Failure::Other(e.to_string()))? + "\n"
    } else {
        table(numbers)
    };
    standard_output::write(text.as_bytes())?;
    let limits = [
        ("relative MSE", numbers.rel_mse, options.max_relmse),
        ("FLIP", numbers.flip, options.max_flip),
        ("share of different pixels", numbers.different, options.max_different),
    ];
    let mut within = true;
    for (what, value, limit) in limits {
        // NaN is over the limit, too.
        if let Some(limit) = limit
            && !matches!(
                value.partial_cmp(&limit),
                Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)
            )
        {
            eprintln!("over the limit: {what} is {value:.6}, at most {limit} was allowed");
            within = false;
        }
    }
    Ok(if within { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn read(path: &Path, layer: Option<&str>) -> Result<LinearImage, Failure> {
    let input = Input::open(path, &ReadOptions::default())?;
    if let Some(name) = layer {
        return read_layer(&input, name);
    }
    let image = read_image(&input)?;
    for note in input.take_notes() {
        eprintln!("warning: {}", one_line(&note));
    }
    let needed = u64::from(image.width) * u64::from(image.height) * size_of::<[f32; 3]>() as u64;
    let admitted = Available::now().admit(&format!("{}: the picture", path.display()), needed);
    admitted.map_err(|problem| Failure::Other(format!("{problem}; scale it down")))?;
    Ok(LinearImage::from_image(&image))
}

/// The layer of a file that has this name.
fn read_layer(input: &Input, name: &str) -> Result<LinearImage, Failure> {
    let image = read_layers(input)?;
    if let Some(layer) = image.layers.iter().find(|layer| layer.name == name) {
        return Ok(LinearImage::from_layer(&image, layer));
    }
    let names =
        image.layers.iter().map(|layer| layer.name.as_str()).filter(|name| !name.is_empty());
    let names: Vec<_> = names.collect();
    let known = if names.is_empty() { "none".into() } else { names.join(", ") };
    Err(Failure::Other(format!(
        "{}: there is no layer \"{name}\" beside the picture; the others are: {known}",
        input.name
    )))
}

fn table(c: &Comparison) -> String {
    let psnr = c.psnr.map_or("equal".to_string(), |p| format!("{p:.2} dB"));
    let [x, y] = c.max_at;
    let rows = [
        ("size", format!("{} x {}", c.width, c.height)),
        ("MSE", format!("{:.6e}", c.mse)),
        ("relative MSE", format!("{:.6e}", c.rel_mse)),
        ("PSNR", psnr),
        ("FLIP", format!("{:.6}", c.flip)),
        ("largest", format!("{:.6} at {x},{y} ({} levels of 255)", c.max_abs, c.max_levels)),
        (
            "different",
            format!(
                "{:.3} % of the pixels by more than {} level{}",
                c.different * 100.0,
                c.threshold,
                if c.threshold == 1 { "" } else { "s" }
            ),
        ),
    ];
    rows.map(|(name, value)| format!("{name:16} {value}\n")).concat()
}
