//! The body of a cache file: its parts one after the other, and their checksum.
//!
//! A part is divided into pieces, each with a CRC-32, which detects any damage confined to 32
//! consecutive bits; the checksum is a hash of the CRCs. All threads read pieces and check each
//! slice of a piece while it is in the cache.

use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::Result;

/// The number of bytes that one thread reads at a time: a huge page, so that no two threads fault
/// in the same page.
const PIECE: usize = 1 << 21;

/// The number of bytes that are read before they are checked.
const SLICE: usize = 1 << 17;

/// The memory of the three parts of a tree's file.
pub type Parts<'a> = [&'a mut [u8]; 3];

/// The checksum of parts in memory.
pub fn checksum(parts: [&[u8]; 3]) -> u64 {
    let pieces: Vec<&[u8]> = parts.into_iter().flat_map(|part| part.chunks(PIECE)).collect();
    combined(pieces.into_par_iter().map(crc32fast::hash).collect())
}

/// Fills the parts from a file, beginning at byte `start`. Returns their checksum.
pub fn read(file: &File, start: u64, parts: Parts) -> Result<u64> {
    let mut at = start;
    let pieces = parts.into_iter().flat_map(|part| part.chunks_mut(PIECE));
    let pieces: Vec<(u64, &mut [u8])> = pieces
        .map(|piece| {
            let start = at;
            at += piece.len() as u64;
            (start, piece)
        })
        .collect();
    let sums: Result<Vec<u32>> =
        pieces.into_par_iter().map(|(at, piece)| read_piece(file, at, piece)).collect();
    sums.map(combined)
}

fn read_piece(file: &File, mut at: u64, piece: &mut [u8]) -> Result<u32> {
    let mut sum = crc32fast::Hasher::new();
    for slice in piece.chunks_mut(SLICE) {
        read_exact_at(file, slice, at)?;
        sum.update(slice);
        at += slice.len() as u64;
    }
    Ok(sum.finalize())
}

fn combined(sums: Vec<u32>) -> u64 {
    let bytes: Vec<u8> = sums.into_iter().flat_map(u32::to_le_bytes).collect();
    let hash: [u8; 32] = Sha256::digest(bytes).into();
    u64::from_le_bytes(std::array::from_fn(|i| hash[i]))
}

#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], at: u64) -> Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, at)
}

/// Without a place to read from, several threads cannot read one file.
#[cfg(not(any(unix, windows)))]
fn read_exact_at(_: &File, _: &mut [u8], _: u64) -> Result<()> {
    Err(std::io::ErrorKind::Unsupported.into())
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut bytes: &mut [u8], mut at: u64) -> Result<()> {
    while !bytes.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, bytes, at)? {
            0 => return Err(std::io::ErrorKind::UnexpectedEof.into()),
            read => (bytes, at) = (&mut bytes[read..], at + read as u64),
        }
    }
    Ok(())
}
