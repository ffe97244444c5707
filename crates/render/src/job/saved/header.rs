//! The start of a checkpoint, which tells what it is of.

use super::facts::{FRAME, OF_FRAME};
use super::film::read_rows;
use super::{Fact, MARK, chunk};
use crate::film::Film;
use crate::integrator::aov::Aov;
use crate::job::Statistics;
use crate::settings::Crop;
use chunk::{SavedError, damaged};
use serde::{Deserialize, Serialize};
use std::io::Read;

/// The number of first bytes that are the same for all versions of the format.
pub const MARK_BYTES: usize = 6;

/// The largest number of values of a film that is read without its scene.
const MOST_VALUES: u64 = 1 << 28;

/// Values with more bytes than this are not shown.
const MOST_SHOWN: usize = 100;

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
    pub(super) look: u32,
    /// Statistics of the samples so far.
    pub statistics: Statistics,
    pub(super) rows: u32,
    /// True if the guiding field follows the rows.
    pub(super) has_field: bool,
    /// The mean weight of the filter's samples.
    pub(super) mean_weight: f64,
    /// A text of the program that saves.
    pub note: String,
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
            return Err(SavedError::Other("it has layers that only its scene describes".into()));
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

    /// The first thing in which a picture with other facts differs from this one.
    pub fn difference(&self, facts: &[Fact]) -> Option<Difference> {
        self.differences(facts).next()
    }

    /// The first thing in which a picture with other facts differs from all pictures of the
    /// animation of which this is one.
    pub fn difference_from_animation(&self, facts: &[Fact]) -> Option<Difference> {
        let is_of_all = |d: &Difference| !OF_FRAME.contains(&d.name.as_str());
        // A picture that is none of an animation has no frame.
        let is_alone = |d: &Difference| d.name == FRAME && (d.then.is_none() || d.now.is_none());
        let find = |is_meant: &dyn Fn(&Difference) -> bool| self.differences(facts).find(is_meant);
        find(&is_of_all).or_else(|| find(&is_alone))
    }

    fn differences<'a>(&'a self, facts: &'a [Fact]) -> impl Iterator<Item = Difference> + 'a {
        let find = |facts: &[Fact], name: &str| {
            facts.iter().find(|fact| fact.0 == name).map(|fact| fact.1.clone())
        };
        let names = self.facts.iter().chain(facts).map(|fact| &fact.0);
        names.filter_map(move |name| {
            let [then, now] = [find(&self.facts, name), find(facts, name)];
            (then != now).then(|| Difference { name: name.clone(), then, now })
        })
    }
}

/// A thing in which two pictures differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// What it is, such as `--seed`.
    pub name: String,
    /// Its value in the file, if it has one.
    pub then: Option<String>,
    /// Its value now, if it has one.
    pub now: Option<String>,
}

impl Difference {
    /// True if both values are short enough to be shown.
    pub fn is_short(&self) -> bool {
        let length = |value: &Option<String>| value.as_ref().map_or(0, String::len);
        length(&self.then) + length(&self.now) < MOST_SHOWN
    }
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self { name, then, now } = self;
        match (then, now) {
            _ if !self.is_short() => write!(f, "{name} has changed"),
            (Some(then), Some(now)) => write!(f, "{name} was {then} and is {now} now"),
            (Some(then), None) => write!(f, "{name} was {then} and is not given now"),
            (None, now) => {
                write!(f, "{name} was not given and is {} now", now.as_deref().unwrap_or_default())
            }
        }
    }
}
