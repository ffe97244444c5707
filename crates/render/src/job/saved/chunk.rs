//! The parts of a file that holds a render on its way: a mark, and chunks.
//!
//! A chunk is the length of its content, the length and the CRC-32 of what follows, and the content
//! in the form of [postcard](https://postcard.jamesmunns.com) compressed with LZ4. A file that ends
//! early or has changed is told from a whole one.

use serde::{Serialize, de::DeserializeOwned};
use std::io::{ErrorKind, Read, Write};

/// The largest length of a chunk, compressed or not.
const LONGEST: u32 = 1 << 30;

/// The most by which LZ4 makes anything shorter.
const MOST_EXPANSION: u32 = 255;

/// The number of last bytes of a mark that are the version of the format.
const VERSION_BYTES: usize = 2;

/// The first bytes of every file of a kind. The last two are the version of the format.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    /// What such a file is, for messages.
    pub what: &'static str,
    pub bytes: [u8; 8],
}

/// The reason why a file cannot be gone on with.
#[derive(Debug, thiserror::Error)]
pub enum SavedError {
    /// The file was not written by Snell as what is named.
    #[error("this is not a {0} of Snell")]
    Foreign(&'static str),
    /// The file is of another version of the format.
    #[error(
        "this {0} has the format of another version of Snell ({1}); continue with that version"
    )]
    Version(&'static str, String),
    /// The file ends early or was changed.
    #[error("this file is damaged: {0}")]
    Damaged(&'static str),
    /// The file belongs to another picture.
    #[error("this is of another picture: {0}")]
    Other(String),
    /// The file could not be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

impl Mark {
    /// The part of the mark that is the same for all versions of the format.
    pub fn name(&self) -> &[u8] {
        &self.bytes[..self.bytes.len() - VERSION_BYTES]
    }

    /// Reads the mark of a file.
    pub fn read(&self, input: &mut dyn Read) -> Result<(), SavedError> {
        let mut found = [0; 8];
        input.read_exact(&mut found).map_err(cut)?;
        let (name, version) = found.split_at(self.name().len());
        if name != self.name() {
            return Err(SavedError::Foreign(self.what));
        }
        if found != self.bytes {
            let version = String::from_utf8_lossy(version).into_owned();
            return Err(SavedError::Version(self.what, version));
        }
        Ok(())
    }
}

/// Writes a chunk.
pub(super) fn write(content: &impl Serialize, out: &mut dyn Write) -> std::io::Result<()> {
    out.write_all(&pack(content)?)
}

/// A chunk as bytes.
pub(super) fn pack(content: &impl Serialize) -> std::io::Result<Vec<u8>> {
    let plain = postcard::to_stdvec(content).map_err(std::io::Error::other)?;
    let packed = lz4_flex::block::compress(&plain);
    if plain.len().max(packed.len()) > LONGEST as usize {
        return Err(std::io::Error::other("a row of the picture takes more than a gigabyte"));
    }
    let head = [plain.len() as u32, packed.len() as u32, crc32fast::hash(&packed)];
    let mut bytes: Vec<u8> = head.into_iter().flat_map(u32::to_le_bytes).collect();
    bytes.extend(packed);
    Ok(bytes)
}

/// The error of a file that ends early or was changed.
pub(super) fn damaged<T>(problem: &'static str) -> Result<T, SavedError> {
    Err(SavedError::Damaged(problem))
}

/// Reads a chunk.
pub(super) fn read<T: DeserializeOwned>(input: &mut dyn Read) -> Result<T, SavedError> {
    postcard::from_bytes(&read_content(input)?).or(damaged("its content is not what it should be"))
}

/// Reads a chunk without its meaning.
pub(super) fn read_content(input: &mut dyn Read) -> Result<Vec<u8>, SavedError> {
    let mut head = [[0; 4]; 3];
    input.read_exact(head.as_flattened_mut()).map_err(cut)?;
    let [plain, packed, crc] = head.map(u32::from_le_bytes);
    if packed > LONGEST || plain > LONGEST || plain / MOST_EXPANSION > packed {
        return damaged("a length is impossible");
    }
    // The buffer grows with what is read, because the length may be wrong.
    let mut bytes = Vec::new();
    input.take(u64::from(packed)).read_to_end(&mut bytes)?;
    if bytes.len() < packed as usize {
        return damaged("it ends early");
    }
    if crc32fast::hash(&bytes) != crc {
        return damaged("its content does not fit its checksum");
    }
    let Ok(content) = lz4_flex::block::decompress(&bytes, plain as usize) else {
        return damaged("its content cannot be unpacked");
    };
    if content.len() != plain as usize {
        return damaged("a length is wrong");
    }
    Ok(content)
}

fn cut(error: std::io::Error) -> SavedError {
    match error.kind() {
        ErrorKind::UnexpectedEof => SavedError::Damaged("it ends early"),
        _ => error.into(),
    }
}
