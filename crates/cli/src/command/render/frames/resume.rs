//! A file beside unfinished frames that records their state.
//!
//! The first line is the fingerprint of how the frames are made. Each further line is the number of
//! a frame whose file belongs to Snell: alone for a frame still to be made, or followed by the
//! SHA-256 of the written file.

use super::Place;
use crate::command::render::options::Options;
use crate::command::render::output::hex;
use crate::failure::Failure;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Number of hexadecimal digits of a SHA-256.
const HASH_LETTERS: usize = 64;

/// How frames come about.
#[derive(Clone, Copy)]
pub enum Making<'a> {
    /// They are rendered.
    Rendering,
    /// They are merged from results. The function gives the hash of a frame's file if that is the
    /// whole frame already.
    Merging(&'a dyn Fn(i64) -> Option<String>),
}

/// The record of the finished frames.
pub struct Memory {
    path: PathBuf,
    content: Content,
}

/// The content of the record's file.
struct Content {
    fingerprint: String,
    /// The frames whose files belong to Snell, with the hash of each file that was written.
    frames: BTreeMap<i64, Option<String>>,
}

impl Content {
    /// Parses the file; `None` unless Snell has written it.
    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let fingerprint = lines.next().filter(|line| is_hash(line))?.to_string();
        let frame = |line: &str| match line.split_once(' ') {
            None => Some((line.parse().ok()?, None)),
            Some((number, hash)) => {
                Some((number.parse().ok()?, Some(hash.to_string()).filter(|hash| is_hash(hash))))
            }
        };
        Some(Self { fingerprint, frames: lines.filter_map(frame).collect() })
    }

    fn text(&self) -> String {
        let line = |(number, hash): (&i64, &Option<String>)| match hash {
            None => format!("{number}\n"),
            Some(hash) => format!("{number} {hash}\n"),
        };
        format!("{}\n{}", self.fingerprint, self.frames.iter().map(line).collect::<String>())
    }
}

fn is_hash(text: &str) -> bool {
    text.len() == HASH_LETTERS && text.bytes().all(|b| b.is_ascii_hexdigit())
}

/// True if the content of a file has this hash.
fn holds(file: &Path, hash: &str) -> bool {
    file.is_file() && std::fs::read(file).is_ok_and(|content| hex(&content) == hash)
}

impl Memory {
    /// Opens the record for frames with this fingerprint and these files. Files of the user in the
    /// place of unassembled frames are an error.
    pub fn open(
        place: &Place,
        fingerprint: String,
        files: &BTreeMap<i64, PathBuf>,
        options: &Options,
        making: Making,
    ) -> Result<Self, Failure> {
        let path = place.memory();
        let known = read(&path)?;
        let is_ours =
            |number: &i64| known.as_ref().is_some_and(|known| known.frames.contains_key(number));
        let waiting = place.animated.is_some();
        let foreign = files
            .iter()
            .find(|(number, file)| waiting && !is_ours(number) && file.symlink_metadata().is_ok());
        if let Some((_, file)) = foreign {
            let problem =
                "this file is not Snell's, and a frame is to be stored here; move it away";
            return Err(Failure::Other(format!("{}: {problem}", file.display())));
        }
        let warn = |problem: String| match options.quiet {
            true => {}
            false => eprintln!("warning: {problem}"),
        };
        let goes_on =
            options.resume && known.as_ref().is_some_and(|known| known.fingerprint == fingerprint);
        let is_render = matches!(making, Making::Rendering);
        if options.resume && !goes_on && is_render {
            let why = if known.is_some() {
                "the existing ones were made from other files or options"
            } else {
                "nothing was interrupted"
            };
            warn(format!("all frames are rendered, because {why}"));
        }
        let mut frames: BTreeMap<i64, Option<String>> =
            files.keys().map(|&number| (number, None)).collect();
        for (number, hash) in known.map(|known| known.frames).unwrap_or_default() {
            let file = place.file(number);
            let is_there = hash.as_ref().is_some_and(|hash| holds(&file, hash));
            if goes_on {
                if hash.is_some() && !is_there && files.contains_key(&number) && file.exists() {
                    let again = if is_render { "rendered" } else { "merged" };
                    warn(format!(
                        "{}: the file has changed since it was written; the frame is {again} again",
                        file.display()
                    ));
                }
                frames.insert(number, hash.filter(|_| is_there));
            } else if waiting && is_there && !files.contains_key(&number) {
                // Removes the file, which no other command needs.
                let _ = std::fs::remove_file(file);
            }
        }
        if let (Making::Merging(hash), true) = (making, options.resume && !goes_on) {
            frames.extend(files.keys().map(|&number| (number, hash(number))));
            let is_unknown = |number: &i64| frames[number].is_none() && files[number].exists();
            let unknown: Vec<i64> = files.keys().copied().filter(is_unknown).collect();
            if let Some(first) = unknown.first() {
                warn(format!(
                    "pictures whose receipts do not show that they are complete and of this \
                     plan are merged again: {}, the first is {}",
                    unknown.len(),
                    files[first].display()
                ));
            }
        }
        let memory = Self { path, content: Content { fingerprint, frames } };
        memory.write()?;
        Ok(memory)
    }

    /// True if a frame is finished.
    pub fn has(&self, number: i64) -> bool {
        self.content.frames.get(&number).is_some_and(Option::is_some)
    }

    /// Records a finished frame by the hash of its file.
    pub fn add(&mut self, number: i64, sha256: String) -> Result<(), Failure> {
        self.content.frames.insert(number, Some(sha256));
        self.write()
    }

    fn write(&self) -> Result<(), Failure> {
        Ok(snell_formats::atomic::write(&self.path, self.content.text().as_bytes())?)
    }

    /// Deletes the record once all frames are done. Frames that were stored in a folder are
    /// removed, and the folder if nothing else is in it.
    pub fn forget(self, place: &Place) {
        let _ = std::fs::remove_file(self.path);
        if place.animated.is_none() {
            return;
        }
        for (number, hash) in self.content.frames {
            let file = place.file(number);
            if hash.is_some_and(|hash| holds(&file, &hash)) {
                let _ = std::fs::remove_file(file);
            }
        }
        // Fails if the folder has other contents.
        let _ = std::fs::remove_dir(&place.folder);
    }
}

/// The content of the file; `None` if there is none.
fn read(path: &Path) -> Result<Option<Content>, Failure> {
    if path.symlink_metadata().is_err() {
        return Ok(None);
    }
    let text = if path.is_file() { std::fs::read_to_string(path).ok() } else { None };
    let content = text.and_then(|text| Content::parse(&text));
    content.map(Some).ok_or_else(|| {
        let problem = "this file is not Snell's, and the record of unfinished frames is to be \
            here; move it away";
        Failure::Other(format!("{}: {problem}", path.display()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let hash = "0123456789abcdef".repeat(4);
        let text = format!("{hash}\n-1\n2 {hash}\n");
        let content = Content::parse(&text).expect("it is ours");
        assert_eq!((content.text(), content.frames.len()), (text, 2));
        // This is the format from before frames had hashes.
        let old = Content::parse(&format!("{hash}\n0\n1\n")).expect("it is ours");
        assert!(old.frames.len() == 2 && old.frames.values().all(Option::is_none));
        for foreign in ["", "a diary\n", "0123\n1\n"] {
            assert!(Content::parse(foreign).is_none(), "{foreign}");
        }
    }
}
