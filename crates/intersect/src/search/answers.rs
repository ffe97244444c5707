//! Destinations for the results of a batch.

use super::{Any, Closest, Goal};
use crate::precision::Facts;
use crate::prefetch::fetch;

/// Receives the result of each ray, by the number of the ray. Closures implement this trait.
pub(crate) trait Answers<G> {
    /// Receives the result of the ray with this number.
    fn put(&mut self, number: usize, goal: G);

    /// Called some time before a ray's result is written, if rays are not traced in order, to
    /// prefetch the memory of the result.
    #[inline(always)]
    fn fetch(&self, _number: usize) {}
}

impl<G, F: FnMut(usize, G)> Answers<G> for F {
    #[inline(always)]
    fn put(&mut self, number: usize, goal: G) {
        self(number, goal);
    }
}

/// A goal with one result per ray, written to a slice.
pub(crate) trait Answered: Goal {
    type Answer;
    fn answer(self) -> Self::Answer;
}

impl<P: Facts> Answered for Closest<P> {
    type Answer = P::Hit;

    #[inline(always)]
    fn answer(self) -> P::Hit {
        self.result()
    }
}

impl<P: Facts> Answered for Any<P> {
    type Answer = bool;

    #[inline(always)]
    fn answer(self) -> bool {
        self.found
    }
}

/// A slice of results, whose first element is the result of ray 0.
pub(crate) struct Slice<'a, T>(pub &'a mut [T]);

impl<G: Answered> Answers<G> for Slice<'_, G::Answer> {
    #[inline(always)]
    fn put(&mut self, number: usize, goal: G) {
        self.0[number] = goal.answer();
    }

    #[inline(always)]
    fn fetch(&self, number: usize) {
        fetch(self.0.as_ptr().wrapping_add(number));
    }
}

/// Results of a part of a batch, in which ray 0 is the ray `first` of the whole batch.
pub(crate) struct Part<'a, A> {
    pub answers: &'a mut A,
    pub first: usize,
}

impl<G, A: Answers<G>> Answers<G> for Part<'_, A> {
    #[inline(always)]
    fn put(&mut self, number: usize, goal: G) {
        self.answers.put(self.first + number, goal);
    }

    #[inline(always)]
    fn fetch(&self, number: usize) {
        self.answers.fetch(self.first + number);
    }
}
