//! Queues of the rays in flight.

use super::interleave::SLOTS;
use std::mem::MaybeUninit;

/// The memory of a queue: [`SLOTS`] items, and room for one more that is written and not counted.
pub(super) type Items<T> = [MaybeUninit<T>; SLOTS + 1];

/// The memory of an empty queue.
pub(super) const fn items<T>() -> Items<T> {
    [const { MaybeUninit::uninit() }; SLOTS + 1]
}

/// Items in order of arrival. (The memory is elsewhere, so that the count stays in a register.)
/// Items that are still in a queue when it is dropped are forgotten.
pub(super) struct Queue<'q, T> {
    items: &'q mut Items<T>,
    /// The number of items, which are written: at most [`SLOTS`] and one more.
    count: usize,
}

impl<'q, T> Queue<'q, T> {
    #[inline(always)]
    pub fn new(items: &'q mut Items<T>) -> Self {
        Self { items, count: 0 }
    }

    #[inline(always)]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Appends an item.
    ///
    /// # Panics
    /// If the queue is full.
    #[inline(always)]
    pub fn push(&mut self, item: T) {
        self.items[self.count].write(item);
        self.count += 1;
    }

    /// Writes an item behind the others, and appends it if `counts`; otherwise it is forgotten. (No
    /// branch on data, which could not be predicted.)
    ///
    /// # Safety
    /// The queue must hold at most [`SLOTS`] items.
    #[inline(always)]
    pub unsafe fn put(&mut self, item: T, counts: bool) {
        debug_assert!(self.count <= SLOTS);
        // SAFETY: the number of items is at most `SLOTS` by the caller's promise, and the memory
        // has one place more.
        unsafe { self.items.get_unchecked_mut(self.count).write(item) };
        self.count += usize::from(counts);
    }

    /// Removes the item that was appended last.
    #[inline(always)]
    pub fn pop(&mut self) -> Option<T> {
        let last = self.count.checked_sub(1)?;
        self.count = last;
        // SAFETY: the item was counted, so it is written; from now on it is not.
        Some(unsafe { self.items.get_unchecked(last).assume_init_read() })
    }

    #[inline(always)]
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        // SAFETY: items that are counted are within the memory and written.
        unsafe { std::slice::from_raw_parts_mut(self.items.as_mut_ptr().cast(), self.count) }
    }

    /// Empties the queue.
    #[inline(always)]
    pub fn drain(&mut self) -> impl Iterator<Item = T> {
        let count = std::mem::take(&mut self.count);
        // SAFETY: the items were counted, so they are within the memory and written; from now on
        // they are not, so each is read once.
        unsafe { self.items.get_unchecked(..count).iter().map(|item| item.assume_init_read()) }
    }

    /// Empties the queue, and returns the number of its items, which [`Self::read`] returns.
    #[inline(always)]
    pub fn clear(&mut self) -> usize {
        std::mem::take(&mut self.count)
    }

    /// Item `i` of a queue that was [cleared](Self::clear), so that it can be filled again while it
    /// is read.
    ///
    /// # Safety
    /// `i` must be less than what [`Self::clear`] returned, [`Self::put`] and [`Self::push`] must
    /// have been called at most `i` times since, and the item must not have been read before.
    #[inline(always)]
    pub unsafe fn read(&mut self, i: usize) -> T {
        debug_assert!(self.count <= i);
        // SAFETY: the queue had this item. What was put since went to the places before it, since
        // the `n`-th call writes to place `n` at most, counted from 0.
        unsafe { self.items.get_unchecked(i).assume_init_read() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_that_do_not_count_are_written_over() {
        let mut items = items();
        let mut queue = Queue::new(&mut items);
        for i in 0..2 * SLOTS {
            // SAFETY: every other item counts, so there are never more than `SLOTS`.
            unsafe { queue.put(i, i % 2 == 1) };
        }
        assert_eq!(queue.len(), SLOTS);
        assert!(queue.as_mut_slice().iter().copied().eq((0..SLOTS).map(|i| 2 * i + 1)));
        assert_eq!(queue.pop(), Some(2 * SLOTS - 1));
        assert_eq!(queue.drain().last(), Some(2 * SLOTS - 3));
        assert_eq!((queue.len(), queue.pop()), (0, None));
    }

    #[test]
    fn a_queue_is_filled_again_while_it_is_read() {
        let mut items = items();
        let mut queue = Queue::new(&mut items);
        (0..SLOTS).for_each(|i| queue.push(i));
        for i in 0..queue.clear() {
            // SAFETY: there were `SLOTS` items, each is read once, and one is put for each.
            unsafe {
                let item = queue.read(i);
                assert_eq!(item, i);
                queue.put(10 * item, item.is_multiple_of(3));
            }
        }
        assert!(queue.drain().eq((0..SLOTS).step_by(3).map(|i| 10 * i)));
    }
}
