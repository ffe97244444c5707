//! The memory of trees: large pieces are mapped in huge pages where the system has them.
//!
//! Fresh pages are a large part of the cost of a build, and address translation is a large part of
//! the cost of traversing large trees, so large pieces are mapped separately with huge pages.
//! Memory is not initialised before several threads write their parts of it: it holds zeros, which
//! the system provides, or the old contents of a piece that was returned ([`spare`]).

use std::alloc::{Layout, alloc_zeroed, dealloc, handle_alloc_error};
use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};
use std::ptr::NonNull;

mod spare;

use spare::Piece;

/// Plain old data.
///
/// # Safety
/// Any bits must be a valid value, and there must be no padding.
pub(crate) unsafe trait Plain: Copy + Send + Sync + 'static {}

/// Pieces of at least this many bytes are mapped separately. (The limit is low for Miri, which is
/// slow.)
const MAPPED_BYTES: usize = if cfg!(miri) { 1 << 12 } else { 3 << 17 };

/// Bytes of a huge page. Mapped memory is aligned to this also where the system has no huge pages.
const HUGE_PAGE: usize = 1 << 21;

/// The number of bytes to put in huge pages, rounded up if the end fills at least half of a page.
/// So at most a megabyte is wasted or left to small pages, each of which takes a microsecond to
/// touch on virtual machines.
fn huge_bytes(bytes: usize) -> usize {
    (bytes.saturating_add(HUGE_PAGE / 2)) / HUGE_PAGE * HUGE_PAGE
}

/// Maps zeroed memory, aligned to huge pages. Also returns its size in bytes.
fn map_anonymous(bytes: usize) -> Option<(NonNull<u8>, usize, memmap2::MmapMut)> {
    let huge = huge_bytes(bytes);
    let bytes = bytes.max(huge);
    let mut map = memmap2::MmapMut::map_anon(bytes.checked_add(HUGE_PAGE)?).ok()?;
    let offset = map.as_ptr().align_offset(HUGE_PAGE);
    let start = map.get_mut(offset..offset + bytes)?.as_mut_ptr();
    #[cfg(all(target_os = "linux", not(miri)))]
    // The advice may fail: without huge pages the memory works all the same.
    let _ = map.advise_range(memmap2::Advice::HugePage, offset, huge);
    Some((NonNull::new(start)?, bytes, map))
}

/// A slice that owns its memory: on the heap or mapped.
pub(crate) struct Storage<T> {
    start: NonNull<T>,
    len: usize,
    owner: Owner,
    values: PhantomData<T>,
}

/// The owner of the memory, which determines how the memory is freed.
enum Owner {
    Heap(Layout),
    Mapped(Piece),
    /// Memory that was already returned.
    Nothing,
}

// SAFETY: `Storage` alone owns its memory, like a `Vec`, and `Plain` values are `Send`.
unsafe impl<T: Plain> Send for Storage<T> {}
// SAFETY: `&Storage` gives out `&[T]` only, and `Plain` values are `Sync`.
unsafe impl<T: Plain> Sync for Storage<T> {}

impl<T: Plain> Storage<T> {
    /// Memory for `len` values with arbitrary contents: zeros, or values from earlier use.
    pub fn unset(len: usize) -> Self {
        let layout = Layout::array::<T>(len).expect("no world is larger than the address space");
        if layout.size() >= MAPPED_BYTES
            && let Some(piece) = Piece::unset(layout.size())
        {
            return Self {
                start: piece.start.cast(),
                len,
                owner: Owner::Mapped(piece),
                values: PhantomData,
            };
        }
        let start = if layout.size() == 0 {
            NonNull::dangling()
        } else {
            // SAFETY: the layout is not empty.
            let memory = unsafe { alloc_zeroed(layout) };
            NonNull::new(memory.cast::<T>()).unwrap_or_else(|| handle_alloc_error(layout))
        };
        Self { start, len, owner: Owner::Heap(layout), values: PhantomData }
    }

    /// The values as they are in memory.
    pub fn bytes(&self) -> &[u8] {
        // SAFETY: `self` derefs to a slice of the same memory, of which each byte is initialised:
        // `Plain` values have no padding.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr().cast(), size_of_val(&**self)) }
    }

    /// The values as they are in memory, for writing.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        // SAFETY: `self` derefs to a slice of the same memory, without padding, to which `&mut
        // self` is the only reference. Any bits are a `Plain` value, so whatever is written is
        // valid.
        unsafe { std::slice::from_raw_parts_mut(self.start.as_ptr().cast(), size_of_val(&**self)) }
    }
}

impl<T> Drop for Storage<T> {
    fn drop(&mut self) {
        match std::mem::replace(&mut self.owner, Owner::Nothing) {
            // SAFETY: `unset`, the only constructor, has allocated the memory with this layout, for
            // `Plain` values, which need no drop.
            Owner::Heap(layout) if layout.size() > 0 => unsafe {
                dealloc(self.start.as_ptr().cast(), layout)
            },
            Owner::Mapped(piece) => piece.give_back(),
            Owner::Heap(_) | Owner::Nothing => {}
        }
    }
}

impl<T> Deref for Storage<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        // SAFETY: `unset` has made memory for `len` aligned values at `start`: zeros or earlier
        // contents, and any bits are a `Plain` value. Only `drop` frees it.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.len) }
    }
}

impl<T> DerefMut for Storage<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        // SAFETY: `deref` says why there are `len` values, and `&mut self` is the only reference to
        // them.
        unsafe { std::slice::from_raw_parts_mut(self.start.as_ptr(), self.len) }
    }
}

impl<T: Plain> Clone for Storage<T> {
    fn clone(&self) -> Self {
        let mut copy = Self::unset(self.len);
        copy.copy_from_slice(self);
        copy
    }
}

impl<T> fmt::Debug for Storage<T> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Storage of {} values", self.len)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // SAFETY: a `u32` has no padding and accepts any bits.
    unsafe impl Plain for u32 {}

    #[test]
    fn memory_of_any_size_holds_what_is_written() {
        for len in [0, 1, 1000, if cfg!(miri) { 1 << 11 } else { 1 << 20 }] {
            let mut memory = Storage::<u32>::unset(len);
            assert_eq!(memory.len(), len);
            memory.iter_mut().zip(0..).for_each(|(x, i)| *x = i);
            let copy = memory.clone();
            drop(memory);
            assert!(copy.iter().zip(0..).all(|(&x, i)| x == i));
        }
    }
}
