//! A limit on how much the files of one scene may expand to in memory, all together.
//!
//! A small file can expand greatly: compressed data, pictures of one colour, counts without data,
//! one file that is named a thousand times. Every expansion is charged here *before* memory is
//! allocated. All inputs of a scene share one account, so that many small expansions are refused
//! just as one large one is.

use crate::error::{Place, ReadError};
use crate::input::Input;
use crate::limits::Limits;
use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The sizes of a scene's files, and the memory charged for them so far.
#[derive(Debug, Default)]
pub(crate) struct Expansion(Mutex<Account>);

#[derive(Debug, Default)]
struct Account {
    /// Number of times that files were opened.
    opened: usize,
    /// Bytes of each file on the disk: opening a file again does not raise the limit.
    files: HashMap<PathBuf, u64>,
    /// Bytes of all files, each counted once.
    given: u64,
    /// Bytes of memory charged.
    charged: u64,
}

impl Account {
    fn allowed(&self, limits: &Limits) -> u64 {
        self.given.saturating_mul(limits.expansion).saturating_add(limits.memory_bytes)
    }
}

impl Expansion {
    /// An account for bytes that are in memory already.
    pub fn of_bytes(bytes: u64) -> Self {
        Self(Mutex::new(Account { given: bytes, ..Account::default() }))
    }

    fn account(&self) -> MutexGuard<'_, Account> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts the opening of a file.
    pub fn open(&self, path: &Path) {
        let mut account = self.account();
        account.opened += 1;
        let path = path.canonicalize().unwrap_or_else(|_| path.into());
        let bytes = path.metadata().map_or(0, |m| m.len());
        if account.files.insert(path, bytes).is_none() {
            account.given = account.given.saturating_add(bytes);
        }
    }
}

/// A kind of compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compression {
    /// Gzip, with one or several members.
    Gzip,
    /// A zlib stream; what follows it is ignored.
    Zlib,
}

impl Input {
    /// Charges memory that is about to be allocated for `what`, which this file expands to.
    ///
    /// # Errors
    /// If the files of the scene would take more than [`Limits::memory_bytes`] and
    /// [`Limits::expansion`] allow. Then nothing is charged.
    pub(crate) fn charge(&self, bytes: u64, what: &str) -> Result<(), ReadError> {
        let mut account = self.expansion.account();
        let (allowed, given) = (account.allowed(&self.options.limits), account.given);
        let charged = account.charged.saturating_add(bytes);
        if charged > allowed {
            let problem = format!(
                "{what} would take {}, and the scene's files ({}) may expand to {} in all",
                in_words(bytes),
                in_words(given),
                in_words(allowed)
            );
            let remedy = "the file is damaged or made to fill the memory: export it again, or \
                split the scene";
            return Err(self.error(Place::Whole, problem, remedy));
        }
        account.charged = charged;
        Ok(())
    }

    /// Counts the opening of `path`. Fails if the scene has opened too many files.
    pub(crate) fn count_file(&self, path: &Path) -> Result<(), ReadError> {
        let limit = self.options.limits.files;
        if self.expansion.account().opened >= limit {
            let problem = format!("the scene names more than {limit} files, the limit");
            return Err(self.error(Place::Whole, problem, "split the scene"));
        }
        self.expansion.open(path);
        Ok(())
    }

    /// Unpacks `packed`, found at `place`, and charges the bytes that it unpacks to.
    ///
    /// # Errors
    /// If the data is damaged, or unpacks to more than real files do, or to more than the scene may
    /// take.
    pub(crate) fn unpack(
        &self,
        packed: &[u8],
        how: Compression,
        place: Place,
    ) -> Result<Vec<u8>, ReadError> {
        let content = unpack(packed, how, &self.options.limits)
            .map_err(|(problem, remedy)| self.error(place, problem, remedy))?;
        self.charge(content.len() as u64, "its unpacked content")?;
        Ok(content)
    }
}

/// Any input, however small, may unpack to this many bytes.
const ALWAYS_UNPACKED: u64 = 64 << 20;

/// Unpacks `packed`. An error consists of a problem and a remedy.
pub(crate) fn unpack(
    packed: &[u8],
    how: Compression,
    limits: &Limits,
) -> Result<Vec<u8>, (String, &'static str)> {
    let expanded = (packed.len() as u64).saturating_mul(limits.expansion);
    let limit = expanded.max(ALWAYS_UNPACKED).min(limits.file_bytes);
    let mut content = Vec::new();
    let read = match how {
        Compression::Gzip => {
            flate2::read::MultiGzDecoder::new(packed).take(limit + 1).read_to_end(&mut content)
        }
        Compression::Zlib => {
            flate2::read::ZlibDecoder::new(packed).take(limit + 1).read_to_end(&mut content)
        }
    };
    let kind = if how == Compression::Gzip { "gzip" } else { "zlib" };
    read.map_err(|e| {
        let problem = format!("its {kind} compression is damaged: {e}");
        (problem, "the file seems cut off; compress or copy it again")
    })?;
    if content.len() as u64 > limit {
        return Err((
            format!("unpacks to more than {limit} bytes, the limit"),
            "unpack it, or export it again",
        ));
    }
    Ok(content)
}

/// Formats a number of bytes for a message.
fn in_words(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{bytes} bytes"),
        1_000_000..1_000_000_000 => format!("{} MB", bytes / 1_000_000),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadOptions;

    fn input(bytes: usize, limits: Limits) -> Input {
        let options = ReadOptions { limits, ..ReadOptions::default() };
        Input::from_bytes("a.bin", vec![0; bytes], Path::new("."), &options)
    }

    #[test]
    fn many_small_things_are_refused_as_one_large_one() {
        let small = Limits { memory_bytes: 1000, expansion: 10, ..Limits::default() };
        let input = input(100, small);
        input.charge(1500, "a picture").expect("2000 are allowed");
        let other = input.part("b.bin", vec![0; 50]);
        let error = other.charge(501, "a picture").expect_err("it is the same scene").to_string();
        assert!(
            error.contains("a picture would take 501 bytes") && error.contains("2000 bytes"),
            "{error}"
        );
        other.charge(500, "a picture").expect("what was refused is not counted");
    }

    #[test]
    fn a_file_that_is_opened_twice_gives_once() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("a.bin"), [0; 100]).expect("it is writable");
        let limits = Limits { memory_bytes: 0, expansion: 2, files: 3, ..Limits::default() };
        let options = ReadOptions { limits, ..ReadOptions::default() };
        let input = Input::open(&folder.path().join("a.bin"), &options).expect("100 of 200");
        input.open_relative("./a.bin").expect("200 of 200");
        let error = input.open_relative("a.bin").expect_err("300 of 200").to_string();
        assert!(error.contains("may expand to 200 bytes"), "{error}");
        let error = input.open_relative("a.bin").expect_err("the fourth").to_string();
        assert!(error.contains("names more than 3 files"), "{error}");
    }

    #[test]
    fn what_unpacks_to_a_thousand_times_its_size_is_refused() {
        use std::io::Write;
        let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        packer.write_all(&vec![0; 70 << 20]).expect("memory");
        let packed = packer.finish().expect("memory");
        let problem = unpack(&packed, Compression::Zlib, &Limits::default()).expect_err("a bomb").0;
        assert!(problem.contains("the limit"), "{problem}");
    }
}
