//! `snell verify`: renders parts of a picture again and compares bits.
//!
//! A picture carries its receipt: the settings, a hash of the scene, and a hash of each tile. Tiles
//! that are rendered again must have the hashes of the receipt, and the file must show them.

use super::plan::folder::Folder;
use super::render::{self, Merged};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::{standard_output, threads};
use serde_json::json;
use snell_formats::error::one_line;
use snell_formats::image::read_layers;
use snell_formats::{Input, ReadOptions};
use snell_math::rng;
use snell_persist::{Receipt, tile_hash};
use snell_render::{Film, Job, Progress, Split, Statistics, Task, Underway};
use snell_scene::{LayeredImage, Scene};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::hash::{BuildHasher, RandomState};
use std::path::{Path, PathBuf};

/// The share of wrong tiles for which the probability to find them is told.
const SHARE: f64 = 0.05;

/// The number of wrong tiles that are named.
const NAMED: usize = 10;

/// Options of `snell verify`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Picture that Snell has written, as OpenEXR or PNG
    picture: PathBuf,
    /// Tiles of 16x16 pixels to render again, at random: a number, or all
    #[arg(long, value_name = "N|all", default_value = "60", value_parser = parse_tiles)]
    tiles: Tiles,
    /// Scene of the picture, or the folder of its plan. Default: the file that the picture names,
    /// in its folder or the current one
    #[arg(long, value_name = "FILE|FOLDER")]
    scene: Option<PathBuf>,
    /// Threads. Default: one per core
    #[arg(short, long, value_name = "N", value_parser = threads::number())]
    threads: Option<u32>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug)]
enum Tiles {
    Some(usize),
    All,
}

fn parse_tiles(text: &str) -> Result<Tiles, String> {
    match text {
        "all" => Ok(Tiles::All),
        _ => text
            .parse()
            .ok()
            .filter(|&count| count > 0)
            .map(Tiles::Some)
            .ok_or_else(|| "expected a number of tiles from 1, or all".into()),
    }
}

impl Options {
    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.threads.map_or_else(threads::cores, |n| n as usize)
    }
}

/// A tile that is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Wrong {
    /// Its first pixel.
    corner: [u32; 2],
    /// True if the file shows something else than the receipt says, false if the receipt itself is
    /// not that of these settings.
    is_file: bool,
}

/// Verifies a picture.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    let shown = one_line(&options.picture.display().to_string()).into_owned();
    let picture = read_picture(&options.picture)?;
    let text = picture.metadata.iter().find(|(key, _)| key == Receipt::KEY);
    let Some((_, text)) = text else {
        return Err(Failure::Usage(format!(
            "{shown}: this picture has no receipt; Snell writes one into OpenEXR and PNG"
        )));
    };
    let receipt = Receipt::parse(text)?;
    if receipt.version != env!("CARGO_PKG_VERSION") {
        return Err(Failure::Usage(format!(
            "{shown}: rendered by Snell {}, and this is {}, whose pictures may have other bits",
            receipt.version,
            env!("CARGO_PKG_VERSION")
        )));
    }
    let Some(hashes) = receipt.hashes().filter(|hashes| !hashes.is_empty()) else {
        return Err(Failure::Other(format!("{shown}: its receipt has no tiles")));
    };
    let (mut render_options, scene) = scene_of(options, &receipt)?;
    let is_denoised = render_options.request.denoise.is_some();
    let chosen = chosen(options.tiles, hashes.len());
    let folder = tempfile::tempdir().map_err(|error| Failure::Other(error.to_string()))?;
    let again = folder.path().join("again").with_extension(
        options.picture.extension().unwrap_or_default().to_string_lossy().to_lowercase(),
    );
    render_options.output = Some(again.clone());
    render_options.threads = options.threads;
    render_options.quiet = true;
    if is_denoised {
        render_options = render_options.without_denoiser();
    }
    let wrong = RefCell::new(BTreeSet::new());
    let areas = RefCell::new(Vec::new());
    let film = |job: &Job, _: u32| -> Result<(Film, Statistics), Failure> {
        let (film, statistics) = some_tiles(job, &chosen, &receipt, &hashes, options.threads())?;
        if film.tiles.len() != hashes.len() {
            return Err(Failure::Other(format!("{shown}: its receipt has other tiles")));
        }
        for &tile in &chosen {
            let area = film.tiles[tile].area;
            areas.borrow_mut().push(area);
            if tile_hash(&film.tiles[tile]) != hashes[tile] {
                wrong.borrow_mut().insert(Wrong { corner: area.min, is_file: false });
            }
        }
        Ok((film, statistics))
    };
    let merged = Merged { film: &film, receipt: receipt.clone() };
    render::again::one(&render_options, scene, &merged)?;
    if !is_denoised {
        let again = read_picture(&again)?;
        for area in areas.borrow().iter() {
            if !is_same(&picture, &again, area) {
                wrong.borrow_mut().insert(Wrong { corner: area.min, is_file: true });
            }
        }
    }
    let wrong = wrong.into_inner();
    report(options, &shown, &wrong, [chosen.len(), hashes.len()], is_denoised)?;
    Ok(if wrong.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn read_picture(path: &Path) -> Result<LayeredImage, Failure> {
    Ok(read_layers(&Input::open(path, &ReadOptions::default())?)?)
}

/// The options and the scene of a picture. The scene must be the one that was rendered.
fn scene_of(options: &Options, receipt: &Receipt) -> Result<(render::Options, Scene), Failure> {
    let path = match &options.scene {
        Some(path) => path.clone(),
        None => render::again::named_scene(receipt, &options.picture),
    };
    if path.is_dir() {
        let folder = Folder::open(&path)?;
        if folder.plan.receipt.scene_sha256 != receipt.scene_sha256 {
            return Err(Failure::Usage(format!(
                "{}: this is not the plan of the picture, but of another scene",
                path.display()
            )));
        }
        let mut of_plan = folder.render_options()?;
        if of_plan.frames.is_some() {
            (of_plan.frames, of_plan.at) = (None, receipt.time());
        }
        return Ok((of_plan, folder.scene()?));
    }
    render::again::scene_of(receipt, &path)
}

/// Numbers of tiles, at random.
fn chosen(tiles: Tiles, count: usize) -> Vec<usize> {
    let mut all: Vec<usize> = (0..count).collect();
    let Tiles::Some(some) = tiles else { return all };
    let key = RandomState::new().hash_one(count) as u32;
    all.sort_by_key(|&tile| rng::hash_combine(key, tile as u32));
    all.truncate(some);
    all.sort_unstable();
    all
}

/// The film with these tiles; all of it, if pixels stop by their error, because they look at pixels
/// around them.
fn some_tiles(
    job: &Job,
    chosen: &[usize],
    receipt: &Receipt,
    hashes: &[[u8; 8]],
    threads: usize,
) -> Result<(Film, Statistics), Failure> {
    let goes_on = |_: &Progress| true;
    if job.settings().noise.is_some() {
        return Ok(job.run(threads, &goes_on));
    }
    let mut underway = job.begin(threads, &goes_on);
    let other = || Failure::Other("the picture has other tiles than its receipt".into());
    for &tile in chosen {
        let (number, hash) = (tile as u32, hashes.get(tile).ok_or_else(other)?);
        let mut found = None;
        for samples in possible_samples(receipt.samples) {
            let task = Task { tiles: [number, number + 1], samples: [0, samples] };
            let result = job.perform(&mut underway, task, threads, &goes_on).ok_or_else(other)?;
            let mut alone = Underway::empty(job.settings());
            if !alone.add(result.clone()) {
                return Err(other());
            }
            let is_it = tile_hash(&alone.film.tiles[tile]) == *hash;
            found = Some(result);
            if is_it {
                break;
            }
        }
        if !found.is_some_and(|result| underway.add(result)) {
            return Err(other());
        }
    }
    Ok((underway.film, underway.statistics))
}

/// The numbers of samples that a tile may have. If a render ends early, some tiles have more than
/// others.
fn possible_samples([least, most]: [u32; 2]) -> Vec<u32> {
    let ends = [1, 4].into_iter().chain((Split::SAMPLES..most).step_by(Split::SAMPLES as usize));
    let between = ends.filter(|&end| least < end && end < most);
    let mut all: Vec<u32> = [least].into_iter().chain(between).chain([most]).collect();
    all.retain(|&samples| samples > 0);
    all.dedup();
    all
}

/// True if two pictures are the same in an area, in all layers.
fn is_same(a: &LayeredImage, b: &LayeredImage, area: &snell_render::Crop) -> bool {
    if [a.width, a.height] != [b.width, b.height] || a.layers.len() != b.layers.len() {
        return false;
    }
    // Pictures of a part of the whole begin at its corner.
    a.layers.iter().zip(&b.layers).all(|(a_layer, b_layer)| {
        let channels = a_layer.channels.len();
        a_layer.channels == b_layer.channels
            && (area.min[1]..area.max[1]).all(|y| {
                let row = |layer: &snell_scene::Layer| {
                    let start = (y as usize * a.width as usize + area.min[0] as usize) * channels;
                    let end = start + (area.max[0] - area.min[0]) as usize * channels;
                    let values = layer.values.get(start..end)?;
                    Some(values.iter().map(|value| value.to_bits()).collect::<Vec<_>>())
                };
                row(a_layer) == row(b_layer)
            })
    })
}

fn report(
    options: &Options,
    shown: &str,
    wrong: &BTreeSet<Wrong>,
    [checked, count]: [usize; 2],
    is_denoised: bool,
) -> Result<(), Failure> {
    let certainty = certainty(checked, count);
    if options.json {
        let tiles: Vec<_> = wrong
            .iter()
            .map(|wrong| {
                let what = if wrong.is_file { "file" } else { "receipt" };
                json!({ "x": wrong.corner[0], "y": wrong.corner[1], "differs": what })
            })
            .collect();
        let value = json!({
            "tiles": count,
            "checked": checked,
            "wrong": tiles,
            "certainty_of_5_percent": certainty,
            "file_was_compared": !is_denoised,
        });
        return standard_output::write(format!("{value:#}\n").as_bytes());
    }
    let mut text = String::new();
    for wrong in wrong.iter().take(NAMED) {
        let [x, y] = wrong.corner;
        text += &match wrong.is_file {
            true => format!("{shown}: the tile at {x},{y} is not what its settings give\n"),
            false => format!("{shown}: the receipt of the tile at {x},{y} is of other samples\n"),
        };
    }
    if wrong.len() > NAMED {
        text += &format!("and {} more\n", wrong.len() - NAMED);
    }
    if is_denoised {
        text += "the picture was denoised, so only its receipt is compared, not the file\n";
    }
    if wrong.is_empty() {
        text += &format!("{shown}: {checked} of {count} tiles rendered again: all the same bits");
        text += &match checked < count {
            true => format!(
                "; if 5 % of all were wrong, some would have been found with {:.1} % certainty\n",
                100.0 * certainty
            ),
            false => "\n".into(),
        };
    }
    standard_output::write(text.as_bytes())
}

/// The probability to find some of 5 % wrong tiles among those that are checked.
fn certainty(checked: usize, count: usize) -> f64 {
    let wrong = (SHARE * count as f64).ceil().max(1.0) as usize;
    let missed = (0..wrong).map(|i| {
        let right = count.saturating_sub(checked + i) as f64;
        right / (count - i).max(1) as f64
    });
    1.0 - missed.product::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixty_tiles_of_many_find_five_percent_with_ninety_five_percent() {
        assert!((certainty(60, 8000) - 0.954).abs() < 0.002);
        assert_eq!(certainty(100, 100), 1.0);
        assert_eq!(certainty(1, 1), 1.0);
        assert!((certainty(1, 2) - 0.5).abs() < 1e-12);
    }
}
