//! The set of primitives that a traversal has already tested (mailboxing: Amanatides and Woo 1987;
//! Arnaldi, Priol and Bouatouch 1987).

/// An exact set of pairs of traversal and primitive, which is emptied in constant time. Traversals
/// may be nested.
#[derive(Debug)]
pub(crate) struct Mailbox {
    /// A hash table with open addressing, whose size is a power of two. Entries of traversals
    /// before `first` are free.
    slots: Vec<Letter>,
    /// The number of the first traversal of the query.
    first: u32,
    /// The last number given to a traversal.
    last: u32,
    /// The number of entries of this query.
    filled: usize,
}

#[derive(Clone, Copy, Debug, Default)]
struct Letter {
    walk: u32,
    primitive: u32,
}

const SMALLEST: usize = 256;

impl Default for Mailbox {
    fn default() -> Self {
        Self { slots: vec![Letter::default(); SMALLEST], first: 1, last: 0, filled: 0 }
    }
}

impl Mailbox {
    /// Empties the set for a new query.
    pub fn clear(&mut self) {
        // The numbers start again from 0 long before they are used up.
        if self.last > u32::MAX / 2 {
            *self = Self::default();
        }
        self.first = self.last + 1;
        self.filled = 0;
    }

    /// Returns a number for a new traversal.
    pub fn begin(&mut self) -> u32 {
        // A single query cannot use up the numbers in any practical time.
        self.last = self.last.wrapping_add(1);
        self.last
    }

    /// Inserts a primitive; false if the traversal has tested it before.
    #[inline(always)]
    pub fn insert(&mut self, walk: u32, primitive: u32) -> bool {
        let mask = self.slots.len() - 1;
        let mut at = hash(walk, primitive) as usize & mask;
        loop {
            let letter = &mut self.slots[at];
            if letter.walk < self.first {
                *letter = Letter { walk, primitive };
                self.filled += 1;
                if self.filled * 2 > mask {
                    self.grow();
                }
                return true;
            }
            if letter.walk == walk && letter.primitive == primitive {
                return false;
            }
            at = (at + 1) & mask;
        }
    }

    #[cold]
    fn grow(&mut self) {
        let old = std::mem::take(&mut self.slots);
        self.slots = vec![Letter::default(); old.len() * 2];
        self.filled = 0;
        let first = self.first;
        for letter in old.into_iter().filter(|l| l.walk >= first) {
            self.insert(letter.walk, letter.primitive);
        }
    }
}

/// Fibonacci hashing (Knuth, volume 3, 6.4).
#[inline(always)]
fn hash(walk: u32, primitive: u32) -> u32 {
    primitive.wrapping_add(walk.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0x9e37_79b9) >> 8
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn it_agrees_with_a_set() {
        let mut mailbox = Mailbox::default();
        for query in 0..20u32 {
            mailbox.clear();
            let mut set = BTreeSet::new();
            let walks = [mailbox.begin(), mailbox.begin()];
            for i in 0..500 * (query % 4) {
                let (walk, primitive) = (walks[(i % 2) as usize], i.wrapping_mul(7919) % 400);
                assert_eq!(mailbox.insert(walk, primitive), set.insert((walk, primitive)));
            }
        }
    }
}
