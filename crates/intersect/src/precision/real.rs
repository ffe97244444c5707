//! Distances in single or double precision.

use std::cmp::Ordering;
use std::fmt::Debug;

/// A distance: `f32` or `f64`.
pub(crate) trait Real: Copy + Debug + PartialOrd + Into<f64> {
    /// The number 0.
    const ZERO: Self;

    /// The next greater number.
    fn next_up(self) -> Self;

    /// The total order of all numbers, NaN included.
    fn compare(self, other: Self) -> Ordering;

    /// The largest `f32` that is not greater than the number.
    fn below(self) -> f32;

    /// The smallest `f32` that is not less than the number.
    fn above(self) -> f32;
}

impl Real for f32 {
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn next_up(self) -> Self {
        self.next_up()
    }

    #[inline(always)]
    fn compare(self, other: Self) -> Ordering {
        self.total_cmp(&other)
    }

    #[inline(always)]
    fn below(self) -> f32 {
        self
    }

    #[inline(always)]
    fn above(self) -> f32 {
        self
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn next_up(self) -> Self {
        self.next_up()
    }

    #[inline(always)]
    fn compare(self, other: Self) -> Ordering {
        self.total_cmp(&other)
    }

    #[inline(always)]
    fn below(self) -> f32 {
        let near = self as f32;
        if f64::from(near) > self { near.next_down() } else { near }
    }

    #[inline(always)]
    fn above(self) -> f32 {
        let near = self as f32;
        if f64::from(near) < self { near.next_up() } else { near }
    }
}
