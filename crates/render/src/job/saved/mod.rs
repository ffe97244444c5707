//! A render on its way, as a file: what is needed to go on to the same bits.
//!
//! A file is a mark followed by [chunks](chunk). The first chunk is the [`Header`]; the others are
//! the rows of tiles from the top.
//!
//! A finished guiding field is the last chunk, so that it is not trained again.

mod chunk;
#[cfg(test)]
mod hostile;
mod input;
mod result;

pub use chunk::SavedError;
pub use input::TaskInput;
pub use result::Origin;

use super::{Job, Progress, Statistics, Underway, empty_film};
use crate::film::filter::FilterSampler;
use crate::film::tile::TileState;
use crate::film::{Film, FilmTile, noise};
use crate::guiding::{Field, SavedField};
use crate::integrator::aov::Aov;
use crate::sampler::SamplerKind;
use crate::settings::{Crop, Settings};
use chunk::{Mark, damaged};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// The mark of a checkpoint.
const MARK: Mark = Mark { what: "checkpoint", bytes: *b"snellR02" };

/// The mark of a guiding field alone.
const FIELD_MARK: Mark = Mark { what: "guiding field", bytes: *b"snellF01" };

/// The number of first bytes that are the same for all versions of the format.
pub const MARK_BYTES: usize = 6;

/// No pixel is checked more often before its samples are too many to be counted.
const MOST_LOOKS: usize = 200;

/// The largest number of values of a film that is read without its scene.
const MOST_VALUES: u64 = 1 << 28;

/// The number of rows of tiles that are compressed at a time.
const ROWS_AT_ONCE: usize = 16;

/// One thing on which the picture depends: what it is, such as `--seed`, and its value.
pub type Fact = (String, String);

/// A fact with the value that a type shows; `None` if the value is absent or an empty list.
pub fn fact(name: &str, value: &dyn std::fmt::Debug) -> Option<Fact> {
    let text = format!("{value:?}");
    let text = text.strip_prefix("Some(").and_then(|rest| rest.strip_suffix(')')).unwrap_or(&text);
    (!["None", "[]"].contains(&text)).then(|| (name.into(), text.into()))
}

/// What a file of a render on its way tells of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Header {
    /// The version of Snell that wrote the file.
    pub program: String,
    /// All on which the picture depends. Files with the same facts belong to the same picture.
    pub facts: Vec<Fact>,
    /// Width and height of the whole picture in pixels.
    pub size: [u32; 2],
    /// The part of the picture that is rendered.
    pub crop: Crop,
    /// The names of the layers.
    pub layers: Vec<String>,
    /// Samples that each pixel gets; the upper limit if pixels stop by their error.
    pub spp: u32,
    /// The number of samples that the active pixels have.
    pub samples: u32,
    /// The number of samples at which the active pixels are checked next.
    look: u32,
    /// Statistics of the samples so far.
    pub statistics: Statistics,
    rows: u32,
    /// True if the guiding field follows the rows.
    has_field: bool,
    /// The mean weight of the filter's samples.
    mean_weight: f64,
    /// A text of the program that saves.
    pub note: String,
}

/// Everything in the settings on which the bits of the picture depend, with the names of the
/// command's options.
pub fn facts(settings: &Settings) -> Vec<Fact> {
    // Every field is named here, so that a new one is not forgotten.
    let Settings {
        size,
        crop,
        spp,
        noise,
        noise_floor,
        progressive: _,
        seed,
        sampler,
        later_cameras,
        filter,
        pixel_position,
        sensor,
        integrator,
        color,
        max_depth,
        roulette_depth,
        shadows,
        terminator,
        light_strategy,
        light_sampler,
        guiding,
        fill,
        ao_distance,
        clamp,
        light_groups,
        aovs,
        tile_order: _,
        build: _,
    } = settings;
    let mut facts = Vec::new();
    let mut add = |name: &str, value: &dyn std::fmt::Debug| facts.extend(fact(name, value));
    add("--size", size);
    add("--crop", crop);
    // Points of a set depend on the size of the set, and pixels are judged by their error at the
    // last sample too.
    match (noise, sampler) {
        (Some(_), _) | (None, SamplerKind::Stratified) => add("--spp", spp),
        (None, SamplerKind::Sobol | SamplerKind::ZSobol) => {
            add("--spp (as the next power of two)", &spp.next_power_of_two());
        }
        (None, SamplerKind::Independent) => {}
    }
    if noise.is_some() {
        add("--noise", noise);
        add("the floor of --noise by --exposure", noise_floor);
    }
    add("--seed", seed);
    add("--sampler", sampler);
    add("the motion of the camera", later_cameras);
    add("--filter", filter);
    add("the position in the pixel", pixel_position);
    add("the sensor", sensor);
    add("--integrator", integrator);
    add("--color", color);
    add("--max-depth", max_depth);
    add("--roulette-depth", roulette_depth);
    add("--shadows", shadows);
    add("--terminator", terminator);
    add("--light-samples", light_strategy);
    add("--light-sampler", light_sampler);
    add("--guiding", guiding);
    add("the light from everywhere", fill);
    add("--ao-distance", ao_distance);
    add("--clamp", clamp);
    add("--light-group", light_groups);
    add("--aovs", aovs);
    facts
}

#[derive(Serialize, Deserialize)]
struct SavedTile {
    state: TileState,
    /// The active pixels of the tile; `None` if all are active.
    active: Option<Vec<u32>>,
}

impl Underway {
    /// Writes the state of the render. `facts` are all on which its picture depends; `note` is kept
    /// for the reader.
    ///
    /// # Errors
    /// If `out` fails, or if one row of tiles takes more than a gigabyte.
    pub fn save(
        &self,
        settings: &Settings,
        facts: &[Fact],
        note: &str,
        out: &mut dyn Write,
    ) -> std::io::Result<()> {
        let rows: Vec<&[FilmTile]> = rows(&self.film).collect();
        let header = Header {
            program: env!("CARGO_PKG_VERSION").into(),
            facts: facts.to_vec(),
            size: settings.size,
            crop: self.film.crop,
            layers: self.film.aovs().iter().map(|aov| aov.name().into()).collect(),
            spp: settings.spp,
            samples: self.samples,
            look: self.look,
            statistics: self.statistics,
            rows: rows.len() as u32,
            // Training that was interrupted before the first sample is done anew.
            has_field: self.field.is_some() && self.statistics.samples > 0,
            mean_weight: FilterSampler::new(settings.filter).mean_weight(),
            note: note.into(),
        };
        out.write_all(&MARK.bytes)?;
        chunk::write(&header, out)?;
        let mut active = self.active.as_slice();
        for rows in rows.chunks(ROWS_AT_ONCE) {
            let mut together = Vec::with_capacity(rows.len());
            for row in rows {
                let (of_row, rest) = active.split_at(row.len());
                together.push((*row, of_row));
                active = rest;
            }
            let packed = |&(row, active): &(&[FilmTile], &[Option<Vec<u32>>])| {
                let tile = |(tile, active): (&FilmTile, &Option<Vec<u32>>)| SavedTile {
                    state: tile.state(),
                    active: active.clone(),
                };
                chunk::pack(&row.iter().zip(active).map(tile).collect::<Vec<_>>())
            };
            let chunks: Vec<_> = together.par_iter().map(packed).collect();
            for chunk in chunks {
                out.write_all(&chunk?)?;
            }
        }
        match &self.field {
            Some(field) if header.has_field => chunk::write(&field.saved(), out),
            _ => Ok(()),
        }
    }
}

/// The tiles of a film, row by row.
fn rows(film: &Film) -> impl Iterator<Item = &[FilmTile]> {
    film.tiles.chunk_by(|a, b| a.area.min[1] == b.area.min[1])
}

/// True if these first bytes of a file may be those of a checkpoint, of any version of the format;
/// [`MARK_BYTES`] of them decide.
pub fn may_be_checkpoint(start: &[u8]) -> bool {
    start.starts_with(MARK.name()) || MARK.name().starts_with(start)
}

impl Header {
    /// Reads the start of a file, up to the first row of tiles.
    pub fn read(input: &mut dyn Read) -> Result<Self, SavedError> {
        MARK.read(input)?;
        chunk::read(input)
    }

    /// Reads the rest of a file after its start, to find out whether it is whole.
    pub fn check_rest(&self, input: &mut dyn Read) -> Result<(), SavedError> {
        (0..self.rows + u32::from(self.has_field))
            .try_for_each(|_| chunk::read_content(input).map(drop))
    }

    /// Reads the film after the start of a file, without what else the render needs.
    ///
    /// # Errors
    /// If the file is damaged, or if it has layers of light groups, which need the scene.
    pub fn film(&self, input: &mut dyn Read) -> Result<Film, SavedError> {
        let aov = |name: &String| Aov::ALL.into_iter().find(|aov| aov.name() == name);
        let Some(aovs) = self.layers.iter().map(aov).collect::<Option<Vec<_>>>() else {
            return Err(SavedError::Other("it has layers that only its scene tells of".into()));
        };
        let Crop { min, max } = self.crop;
        let is_part = |axis: usize| min[axis] < max[axis] && max[axis] <= self.size[axis];
        if !(is_part(0) && is_part(1) && (0.0..=1.0).contains(&self.mean_weight)) {
            return damaged("its size is impossible");
        }
        let channels = 4 + aovs.iter().map(|aov| aov.sampled_channels() as u64).sum::<u64>();
        let pixels = self.crop.size().iter().map(|&side| u64::from(side)).product::<u64>();
        if pixels.saturating_mul(channels) > MOST_VALUES {
            return Err(SavedError::Other("it is too large to be shown without its scene".into()));
        }
        let mut film = Film::with_mean_weight(self.crop, &aovs, self.mean_weight);
        read_rows(&mut film, input)?;
        Ok(film)
    }

    /// Says in which way a picture with other facts differs from this one.
    fn difference(&self, facts: &[Fact]) -> Option<String> {
        let find = |facts: &[Fact], name: &str| {
            facts.iter().find(|fact| fact.0 == name).map(|fact| fact.1.clone())
        };
        let names = self.facts.iter().chain(facts).map(|fact| &fact.0);
        let mut different = names.filter_map(|name| {
            let [then, now] = [find(&self.facts, name), find(facts, name)];
            (then != now).then(|| match (then, now) {
                (Some(then), Some(now)) if then.len() + now.len() < 100 => {
                    format!("{name} was {then} and is {now} now")
                }
                (Some(_), Some(_)) => format!("{name} has changed"),
                (Some(then), None) => format!("{name} was {then} and is not given now"),
                (None, now) => {
                    format!("{name} was not given and is {} now", now.unwrap_or_default())
                }
            })
        });
        different.next()
    }
}

impl Job<'_> {
    /// Reads the state of a render that [`Underway::save`] has written, and goes on with it. If it
    /// was saved before its first sample, path guiding is trained anew.
    ///
    /// # Errors
    /// If the input is no such state, is damaged, or is of another picture: one with other `facts`,
    /// another size or other layers.
    pub fn restore(
        &self,
        input: &mut dyn Read,
        facts: &[Fact],
        threads: usize,
        keep_going: &(dyn Fn(&Progress) -> bool + Sync),
    ) -> Result<Underway, SavedError> {
        let (header, film, active) = read_film(self.settings, input, facts)?;
        let (field, statistics) = match header.has_field {
            true => (Some(read_field(input)?), header.statistics),
            false if header.statistics.samples > 0 => (None, header.statistics),
            false => self.trained(None, threads, keep_going),
        };
        let (samples, look) = (header.samples, header.look);
        Ok(Underway { film, statistics, field, active, samples, look })
    }
}

fn read_field(input: &mut dyn Read) -> Result<Field, SavedError> {
    let saved: SavedField = chunk::read(input)?;
    Field::of_saved(saved).map_or_else(|| damaged("it has no guiding field"), Ok)
}

impl Underway {
    /// Writes the trained guiding field, for other machines that render the same picture.
    ///
    /// # Errors
    /// If `out` fails, or if the field takes more than a gigabyte.
    pub fn save_field(&self, facts: &[Fact], out: &mut dyn Write) -> std::io::Result<()> {
        out.write_all(&FIELD_MARK.bytes)?;
        chunk::write(&(facts, self.statistics), out)?;
        chunk::write(&self.field.as_ref().map(Field::saved), out)
    }
}

impl Job<'_> {
    /// Begins a render with a guiding field that [`Underway::save_field`] has written.
    ///
    /// # Errors
    /// If the input is no such field, is damaged, or is of another picture.
    pub fn begin_trained(
        &self,
        input: &mut dyn Read,
        facts: &[Fact],
    ) -> Result<Underway, SavedError> {
        FIELD_MARK.read(input)?;
        let (known, statistics): (Vec<Fact>, Statistics) = chunk::read(input)?;
        if known != facts {
            return Err(SavedError::Other("this guiding field belongs to another plan".into()));
        }
        let saved: Option<SavedField> = chunk::read(input)?;
        let field = match saved {
            Some(saved) => {
                Some(Field::of_saved(saved).map_or_else(|| damaged("it is no field"), Ok)?)
            }
            None => None,
        };
        Ok(Underway { statistics, ..Underway::new(self.empty_film(), field, statistics) })
    }
}

impl Underway {
    /// Replaces the film by a state that [`Self::save`] has written. The guiding field stays.
    ///
    /// # Errors
    /// As those of [`Job::restore`].
    pub fn replace_film(
        &mut self,
        settings: &Settings,
        input: &mut dyn Read,
        facts: &[Fact],
    ) -> Result<(), SavedError> {
        let (header, film, active) = read_film(settings, input, facts)?;
        (self.film, self.active) = (film, active);
        (self.samples, self.look) = (header.samples, header.look);
        self.statistics = header.statistics;
        Ok(())
    }
}

/// Reads the tiles of an empty film, and the active pixels of each.
fn read_rows(film: &mut Film, input: &mut dyn Read) -> Result<Vec<Option<Vec<u32>>>, SavedError> {
    let mut active = Vec::with_capacity(film.tiles.len());
    let mut tiles = Vec::with_capacity(film.tiles.len());
    for row in rows(film) {
        let saved: Vec<SavedTile> = chunk::read(input)?;
        if saved.len() != row.len() {
            return damaged("a row has another number of tiles");
        }
        for (tile, saved) in row.iter().zip(saved) {
            let count = tile.pixels() as u32;
            let is_valid = saved.active.as_ref().is_none_or(|pixels| {
                pixels.is_sorted_by(|a, b| a < b) && pixels.last().is_none_or(|&p| p < count)
            });
            match tile.with_state(saved.state).filter(|_| is_valid) {
                Some(tile) => tiles.push(tile),
                None => return damaged("a tile is not of this picture"),
            }
            active.push(saved.active);
        }
    }
    film.tiles = tiles;
    Ok(active)
}

/// Reads a film and the active pixels of its tiles.
fn read_film(
    settings: &Settings,
    input: &mut dyn Read,
    facts: &[Fact],
) -> Result<(Header, Film, Vec<Option<Vec<u32>>>), SavedError> {
    let header = Header::read(input)?;
    if let Some(difference) = header.difference(facts) {
        return Err(SavedError::Other(difference));
    }
    let mut film = empty_film(settings);
    let layers = film.aovs().iter().map(|aov| aov.name());
    if header.crop != film.crop
        || header.size != settings.size
        || !layers.eq(header.layers.iter().map(String::as_str))
    {
        return Err(SavedError::Other("its size or layers differ".into()));
    }
    let active = read_rows(&mut film, input)?;
    let most = film.most_samples();
    if most > settings.spp {
        let spp = settings.spp;
        return Err(SavedError::Other(format!(
            "it has {most} samples already, and --spp is {spp} now"
        )));
    }
    let (samples, look) = (header.samples, header.look);
    let mut looks =
        std::iter::successors(Some(noise::next_look(0)), |&n| Some(noise::next_look(n)));
    let is_filled = |(tile, active): (&FilmTile, &Option<Vec<u32>>)| {
        active.as_ref().is_some_and(Vec::is_empty) || tile.samples() >= samples
    };
    // Only pixels that stop by their error are checked.
    let is_checked = settings.noise.is_some();
    if is_checked && samples > look
        || looks.by_ref().take(MOST_LOOKS).find(|&known| known >= look) != Some(look)
        || !film.tiles.iter().zip(&active).all(is_filled)
    {
        return damaged("its numbers of samples do not fit");
    }
    Ok((header, film, active))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::CompiledScene;
    use crate::film::filter::Filter;
    use crate::guiding::Guiding;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn with_job<T>(settings: &Settings, test: impl FnOnce(&Job) -> T) -> T {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let compiled = CompiledScene::new(&scene, &snell_intersect::BuildOptions::default())
            .expect("a valid scene");
        test(&Job::new(&compiled, &scene.cameras[0], settings))
    }

    fn settings() -> Settings {
        Settings { size: [20, 36], spp: 40, max_depth: 3, ..Settings::default() }
    }

    fn saved(job: &Job, underway: &Underway, facts: &[Fact]) -> Vec<u8> {
        let mut bytes = Vec::new();
        underway
            .save(job.settings(), facts, "a note", &mut bytes)
            .expect("memory takes everything");
        bytes
    }

    /// Renders until `keep_going` was asked so many times.
    fn part_of(job: &Job, asks: usize) -> Underway {
        let mut underway = job.begin(2, &|_| true);
        let asked = AtomicUsize::new(0);
        let goes_on = |_: &Progress| asked.fetch_add(1, Ordering::Relaxed) < asks;
        job.go_on(&mut underway, u32::MAX, 2, &goes_on);
        underway
    }

    #[test]
    fn a_render_that_is_saved_anywhere_goes_on_to_the_same_bits() {
        let guiding = Some(Guiding::with_passes(2));
        let aovs = vec![Aov::Depth, Aov::CryptoObject, Aov::Samples];
        let filter = Filter::Mitchell;
        for settings in [
            settings(),
            Settings { aovs, filter, ..settings() },
            Settings { noise: Some(0.1), spp: 300, ..settings() },
            Settings { guiding, ..settings() },
        ] {
            with_job(&settings, |job| {
                let facts = facts(&settings);
                let (whole, statistics) = job.run(2, &|_| true);
                for asks in [0, 1, 7, 30] {
                    let bytes = saved(job, &part_of(job, asks), &facts);
                    let mut underway = job
                        .restore(&mut bytes.as_slice(), &facts, 1, &|_| true)
                        .unwrap_or_else(|e| panic!("{e}"));
                    assert!(!job.go_on(&mut underway, u32::MAX, 1, &|_| true));
                    assert_eq!(underway.film.image(), whole.image(), "{asks} {settings:?}");
                    assert_eq!(underway.film.variance(), whole.variance(), "{asks} {settings:?}");
                    assert_eq!(underway.statistics.samples, statistics.samples);
                    assert_eq!(underway.statistics.rays, statistics.rays);
                    let covered = |film: &Film| {
                        let lists = film.coverage(Aov::CryptoObject);
                        lists.iter().map(|(list, n)| (list.to_vec(), *n)).collect::<Vec<_>>()
                    };
                    assert_eq!(covered(&underway.film), covered(&whole));
                }
            });
        }
    }

    #[test]
    fn a_render_goes_on_with_more_samples_where_they_do_not_depend_on_their_number() {
        let more = Settings { spp: 64, ..settings() };
        let bytes = with_job(&settings(), |job| {
            saved(job, &part_of(job, usize::MAX), &facts(job.settings()))
        });
        with_job(&more, |job| {
            let mut underway = job
                .restore(&mut bytes.as_slice(), &facts(&more), 1, &|_| true)
                .expect("both numbers have points of sets of 64");
            job.go_on(&mut underway, u32::MAX, 1, &|_| true);
            assert_eq!(underway.film.image(), job.run(1, &|_| true).0.image());
        });
        let too_many = Settings { spp: 65, ..settings() };
        with_job(&too_many, |job| {
            let error = job.restore(&mut bytes.as_slice(), &facts(&too_many), 1, &|_| true);
            let error = error.err().expect("other points").to_string();
            assert!(error.contains("--spp") && error.contains("was 64 and is 128"), "{error}");
        });
        let too_few = Settings { spp: 33, ..settings() };
        with_job(&too_few, |job| {
            let error = job.restore(&mut bytes.as_slice(), &facts(&too_few), 1, &|_| true);
            let error = error.err().expect("too few").to_string();
            assert!(error.contains("40 samples already, and --spp is 33 now"), "{error}");
        });
    }

    #[test]
    fn what_is_cut_or_changed_is_told_from_what_is_whole() {
        let settings = Settings { size: [20, 20], spp: 20, noise: Some(0.1), ..settings() };
        with_job(&settings, |job| {
            let facts = facts(&settings);
            let bytes = saved(job, &part_of(job, usize::MAX), &facts);
            let read = |bytes: &[u8]| job.restore(&mut &*bytes, &facts, 1, &|_| true).map(drop);
            read(&bytes).expect("it is whole");
            for length in (0..bytes.len()).step_by(7) {
                let error = read(&bytes[..length]).expect_err("it is cut");
                assert!(matches!(error, SavedError::Damaged(_)), "{length}: {error}");
            }
            for place in (0..bytes.len()).step_by(5) {
                let mut bytes = bytes.clone();
                bytes[place] ^= 1 << (place % 8);
                read(&bytes).expect_err("a bit is wrong");
            }
            assert!(matches!(read(b"a picture or something else"), Err(SavedError::Foreign(_))));
            let older = [b"snellR00", &bytes[8..]].concat();
            assert!(matches!(read(&older), Err(SavedError::Version(..))));
        });
    }

    #[test]
    fn a_checkpoint_of_another_picture_is_refused_by_what_differs() {
        let bytes =
            with_job(&settings(), |job| saved(job, &part_of(job, 3), &facts(job.settings())));
        for (other, what) in [
            (Settings { seed: 5, ..settings() }, "--seed was 0 and is 5 now"),
            (Settings { max_depth: 4, ..settings() }, "--max-depth was 3 and is 4 now"),
            (Settings { size: [20, 37], ..settings() }, "--size was [20, 36] and is [20, 37] now"),
        ] {
            with_job(&other, |job| {
                let error = job.restore(&mut bytes.as_slice(), &facts(&other), 1, &|_| true);
                let error = error.err().expect("it differs").to_string();
                assert!(error.contains(what), "{error}");
            });
        }
    }
}
