//! Memory that was given back, kept for who next asks for as much.
//!
//! Fresh pages come from the system filled with zeros: for a mesh of 69 thousand triangles that is a sixth of a fast build. Worlds that are built
//! again and again, since something in them moves, need the same pieces every time.

use super::{huge_bytes, map_anonymous};
use memmap2::MmapMut;
use std::ptr::NonNull;
use std::sync::{Mutex, PoisonError};

/// A piece of anonymous memory, aligned to huge pages.
pub(super) struct Piece {
    pub start: NonNull<u8>,
    bytes: usize,
    /// Held only to be dropped.
    _map: MmapMut,
}

// SAFETY: it owns the memory that `start` leads to.
unsafe impl Send for Piece {}

/// What was given back, the oldest first.
static SPARE: Mutex<Vec<Piece>> = Mutex::new(Vec::new());

/// Most that is kept, in bytes and in pieces (a fast build takes four).
const MOST_BYTES: usize = 64 << 20;
const MOST_PIECES: usize = 8;

impl Piece {
    /// Zeros from the system.
    pub fn zeroed(bytes: usize) -> Option<Self> {
        let (start, bytes, map) = map_anonymous(bytes)?;
        Some(Self { start, bytes, _map: map })
    }

    /// What was given back, with whatever is in it, or else zeros: at most an eighth more than a new piece would have.
    pub fn unset(bytes: usize) -> Option<Self> {
        let mut spare = SPARE.lock().unwrap_or_else(PoisonError::into_inner);
        let least = bytes.max(huge_bytes(bytes));
        let fits = |piece: &Piece| (bytes..=least + least / 8).contains(&piece.bytes);
        let best = (0..spare.len()).filter(|&i| fits(&spare[i])).min_by_key(|&i| spare[i].bytes);
        if let Some(i) = best {
            return Some(spare.remove(i));
        }
        drop(spare);
        Self::zeroed(bytes)
    }

    /// Keeps the piece if there is room, where the oldest has to go for it.
    pub fn give_back(self) {
        if self.bytes > MOST_BYTES {
            return;
        }
        let mut spare = SPARE.lock().unwrap_or_else(PoisonError::into_inner);
        spare.push(self);
        let mut kept: usize = spare.iter().map(|piece| piece.bytes).sum();
        let mut old = 0;
        while kept > MOST_BYTES || spare.len() - old > MOST_PIECES {
            kept -= spare[old].bytes;
            old += 1;
        }
        let dropped: Vec<Self> = spare.drain(..old).collect();
        drop(spare);
        // (The system takes its time.)
        drop(dropped);
    }
}
