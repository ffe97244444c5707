//! A render on its way, as a file: what is needed to go on to the same bits.
//!
//! A file is a mark followed by [chunks](chunk). The first chunk is the [`Header`]; the others are
//! the rows of tiles from the top.
//!
//! A finished guiding field is the last chunk, so that it is not trained again.

mod chunk;
mod facts;
mod film;
mod header;
#[cfg(test)]
mod hostile;
mod input;
mod result;
#[cfg(test)]
mod tests;

pub use chunk::SavedError;
pub use facts::{FRAME, Fact, fact, facts};
pub use header::{Difference, Header, MARK_BYTES, may_be_checkpoint};
pub use input::TaskInput;
pub use result::Origin;

use super::{Job, Progress, Statistics, Underway};
use crate::film::filter::FilterSampler;
use crate::guiding::{Field, SavedField};
use crate::settings::Settings;
use chunk::{Mark, damaged};
use film::{read_film, rows, write_rows};
use std::io::{Read, Write};

/// The mark of a checkpoint.
const MARK: Mark = Mark { what: "checkpoint", bytes: *b"snellR04" };

/// The mark of a guiding field alone.
const FIELD_MARK: Mark = Mark { what: "guiding field", bytes: *b"snellF02" };

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
            rows: rows(&self.film).count() as u32,
            // Training that was interrupted before the first sample is done anew.
            has_field: self.field.is_some() && self.statistics.samples > 0,
            mean_weight: FilterSampler::of(settings.filter).mean_weight(),
            note: note.into(),
        };
        out.write_all(&MARK.bytes)?;
        chunk::write(&header, out)?;
        write_rows(&self.film, &self.active, out)?;
        match &self.field {
            Some(field) if header.has_field => chunk::write(&field.saved(), out),
            _ => Ok(()),
        }
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
