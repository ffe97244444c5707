//! Returned memory, kept for the next request of the same size.
//!
//! Fresh pages come from the system filled with zeros. For a mesh of 69 thousand triangles this
//! takes a sixth of the time of a fast build. Worlds that are rebuilt again and again, because
//! something in them moves, need pieces of the same sizes every time.

use super::{huge_bytes, map_anonymous};
use memmap2::MmapMut;
use std::ptr::NonNull;
use std::sync::{Mutex, PoisonError};

/// A piece of anonymous memory, aligned to huge pages.
pub(super) struct Piece {
    pub start: NonNull<u8>,
    bytes: usize,
    /// The mapping, held only to be unmapped on drop.
    _map: MmapMut,
}

// SAFETY: a piece owns the memory to which `start` leads.
unsafe impl Send for Piece {}

impl Piece {
    /// A returned piece with its old contents if one is suitable, otherwise zeros from the system.
    /// The piece is at most an eighth larger than a new one would be.
    pub fn unset(bytes: usize) -> Option<Self> {
        SPARE.take(bytes).or_else(|| Self::new(bytes))
    }

    fn new(bytes: usize) -> Option<Self> {
        let (start, bytes, map) = map_anonymous(bytes)?;
        Some(Self { start, bytes, _map: map })
    }

    /// Keeps the piece for a later request.
    pub fn give_back(self) {
        SPARE.keep(self);
    }
}

/// The returned pieces, oldest first.
struct Spare(Mutex<Vec<Piece>>);

static SPARE: Spare = Spare(Mutex::new(Vec::new()));

/// The largest amount of memory kept, in bytes.
const MOST_BYTES: usize = 64 << 20;
/// The largest number of pieces kept. (A fast build uses four.)
const MOST_PIECES: usize = 8;

impl Spare {
    fn take(&self, bytes: usize) -> Option<Piece> {
        let mut pieces = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let least = bytes.max(huge_bytes(bytes));
        let fits = |piece: &Piece| (bytes..=least + least / 8).contains(&piece.bytes);
        let best = (0..pieces.len()).filter(|&i| fits(&pieces[i])).min_by_key(|&i| pieces[i].bytes);
        best.map(|i| pieces.remove(i))
    }

    /// Keeps a piece, and frees the oldest pieces beyond the limits.
    fn keep(&self, piece: Piece) {
        if piece.bytes > MOST_BYTES {
            return;
        }
        let mut pieces = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        pieces.push(piece);
        let mut bytes: usize = pieces.iter().map(|piece| piece.bytes).sum();
        let mut old = 0;
        while bytes > MOST_BYTES || pieces.len() - old > MOST_PIECES {
            bytes -= pieces[old].bytes;
            old += 1;
        }
        let dropped: Vec<Piece> = pieces.drain(..old).collect();
        drop(pieces);
        // The memory is freed without the lock: the system call is slow, and no other thread should
        // wait for it.
        drop(dropped);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_used_again_where_they_are_about_as_large() {
        let spare = Spare(Mutex::default());
        let piece = Piece::new(5_000_000).expect("memory");
        let place = piece.start;
        spare.keep(piece);
        assert!(spare.take(2_000_000).is_none() && spare.take(8_000_000).is_none());
        let again = spare.take(4_900_000).expect("it was given back");
        assert!(
            again.start == place && again.bytes >= 4_900_000 && spare.take(4_900_000).is_none()
        );
    }

    #[test]
    fn no_more_is_kept_than_allowed() {
        let spare = Spare(Mutex::default());
        for _ in 0..MOST_PIECES + 3 {
            spare.keep(Piece::new(1_000_000).expect("memory"));
        }
        assert_eq!((0..).take_while(|_| spare.take(1_000_000).is_some()).count(), MOST_PIECES);
        for bytes in [MOST_BYTES / 2, MOST_BYTES / 4, MOST_BYTES / 2] {
            spare.keep(Piece::new(bytes).expect("memory"));
        }
        // The oldest pieces were freed.
        let counts = [MOST_BYTES / 2, MOST_BYTES / 4]
            .map(|bytes| (0..).take_while(|_| spare.take(bytes).is_some()).count());
        assert_eq!(counts, [1, 1]);
        spare.keep(Piece::new(MOST_BYTES + 1).expect("memory"));
        assert!(spare.take(MOST_BYTES + 1).is_none());
    }
}
