//! Prefetching of memory. A prefetch has no side effects, so any address is valid, and results do
//! not depend on it.

/// Bytes of a cache line.
const LINE: usize = 64;

/// Prefetches an item of at most two cache lines.
#[inline(always)]
pub(crate) fn fetch<T>(item: *const T) {
    let (first, end) = (item.cast::<u8>(), item.wrapping_add(1).cast::<u8>());
    // The item may straddle two lines.
    fetch_line(first);
    fetch_line(end.wrapping_sub(1));
}

/// Prefetches `lines` cache lines from the address `start` on.
#[inline(always)]
pub(crate) fn fetch_lines<T>(start: *const T, lines: usize) {
    for line in 0..lines {
        fetch_line(start.cast::<u8>().wrapping_add(LINE * line));
    }
}

#[inline(always)]
fn fetch_line(at: *const u8) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: prefetching reads nothing, so any address is valid.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = at;
}
