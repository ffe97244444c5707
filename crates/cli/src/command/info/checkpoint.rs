//! What a checkpoint of `snell render` holds.

use crate::failure::Failure;
use crate::progress::duration;
use serde_json::json;
use snell_formats::error::one_line;
use snell_formats::image::{WriteOptions, write_image};
use snell_persist::{Checkpoint, Found};
use snell_render::{Header, MARK_BYTES, SavedError, may_be_checkpoint};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// The extension by which a file is taken for a checkpoint.
const EXTENSION: &str = "snellr";

/// The longest value that is shown.
const MOST_SHOWN: usize = 300;

/// The checkpoint at `path`, or the one before it if that is not whole; `None` if the file is none.
pub fn found(path: &Path) -> Result<Option<Found>, Failure> {
    // A pipe can be read only once.
    if path.exists() && !path.is_file() {
        return Ok(None);
    }
    let is_named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case(EXTENSION));
    let found = match Checkpoint::find(path) {
        Ok(found) => found,
        Err(error) if is_named || has_mark(path) => return Err(failed(path, &error)),
        // What cannot be opened is reported by the reader of scenes.
        Err(_) => return Ok(None),
    };
    if let Some(warning) = &found.warning {
        eprintln!("warning: {warning}");
    }
    Ok(Some(found))
}

fn failed(path: &Path, error: &SavedError) -> Failure {
    Failure::Other(format!("{}: {error}", one_line(&path.display().to_string())))
}

/// The description of a checkpoint.
pub fn described(header: &Header, as_json: bool) -> String {
    match as_json {
        true => format!("{:#}\n", as_value(header)),
        false => text(header),
    }
}

/// Writes the picture that a checkpoint holds so far, without exposure and tone map.
pub fn write_picture(path: &Path, picture: &Path) -> Result<(), Failure> {
    let failed = |error: SavedError| failed(path, &error);
    let mut input = BufReader::new(File::open(path).map_err(|error| failed(error.into()))?);
    let header = Header::read(&mut input).map_err(failed)?;
    let film = header.film(&mut input).map_err(failed)?;
    Ok(write_image(picture, &film.image(), &WriteOptions::default())?)
}

/// True if the file begins as a checkpoint does.
fn has_mark(path: &Path) -> bool {
    use std::io::Read;
    let mut start = Vec::new();
    let count = MARK_BYTES as u64;
    let read = File::open(path).and_then(|file| file.take(count).read_to_end(&mut start));
    read.is_ok() && start.len() == MARK_BYTES && may_be_checkpoint(&start)
}

fn as_value(header: &Header) -> serde_json::Value {
    let [width, height] = header.size;
    json!({
        "kind": "checkpoint",
        "version": header.program,
        "width": width,
        "height": height,
        "crop": [header.crop.min[0], header.crop.min[1], header.crop.max[0], header.crop.max[1]],
        "spp": header.spp,
        "samples_of_each_pixel": header.samples,
        "samples": header.statistics.samples,
        "rays": header.statistics.rays.total(),
        "layers": header.layers,
        "depends_on": header.facts.iter().cloned().collect::<std::collections::BTreeMap<_, _>>(),
    })
}

fn text(header: &Header) -> String {
    let [width, height] = header.size;
    let statistics = &header.statistics;
    let mut text = format!(
        "checkpoint of a render of {width}x{height} pixels, by Snell {}\n\
         {} of {} samples in each pixel, {} samples and {:.1} million rays in all, {} of ray \
         queries\n",
        header.program,
        header.samples,
        header.spp,
        statistics.samples,
        statistics.rays.total() as f64 * 1e-6,
        duration(statistics.tracing.as_secs_f64()),
    );
    if header.crop.size() != header.size {
        let [min, max] = [header.crop.min, header.crop.max];
        text += &format!("only the pixels {},{} to {},{}\n", min[0], min[1], max[0], max[1]);
    }
    if !header.layers.is_empty() {
        text += &format!("layers: {}\n", header.layers.join(", "));
    }
    text += "it depends on\n";
    for (name, value) in &header.facts {
        let value = one_line(value);
        let shown: String = value.chars().take(MOST_SHOWN).collect();
        let more = if shown.len() < value.len() { "…" } else { "" };
        text += &format!("  {}: {shown}{more}\n", one_line(name));
    }
    text
}
