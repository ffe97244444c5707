//! Proofs that the machine has the instructions of a level.
//!
//! A token has no size. It is created once, where a level is chosen, and passed to all code that
//! creates [lanes](super::Lanes8). Lanes can therefore exist only on machines that have their
//! instructions, and all operations on them are safe.

use std::fmt::Debug;

/// A proof that the machine has the instructions of a level.
pub trait Token: Copy + Debug + Send + Sync + 'static {
    /// Calls `function`, compiled with the instructions of the level. `function` must be
    /// `#[inline(always)]`, and so must all functions with lanes that it calls: functions that are
    /// not inlined are compiled without the instructions and are much slower. The call to `run`
    /// itself is never inlined.
    fn run<R>(self, function: impl FnOnce() -> R) -> R;
}

/// The token of portable code, which runs everywhere.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

impl Token for Portable {
    #[inline(never)]
    fn run<R>(self, function: impl FnOnce() -> R) -> R {
        function()
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Token;

    /// The proof that the machine has AVX2, FMA, BMI1, BMI2, LZCNT and POPCNT.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2(());

    impl Avx2 {
        /// Creates the proof; `None` if the machine lacks any of these instructions.
        pub fn new() -> Option<Self> {
            let has = is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("lzcnt")
                && is_x86_feature_detected!("popcnt");
            has.then_some(Self(()))
        }

        /// Creates the proof without asking the machine again.
        ///
        /// # Safety
        /// [`Self::new`] must have given a proof before.
        #[inline(always)]
        pub(in super::super) unsafe fn assume() -> Self {
            Self(())
        }
    }

    impl Token for Avx2 {
        #[inline(always)]
        fn run<R>(self, function: impl FnOnce() -> R) -> R {
            #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
            #[inline(never)]
            fn with_avx2<R>(function: impl FnOnce() -> R) -> R {
                function()
            }
            // SAFETY: the token exists, so `new` has found these instructions.
            unsafe { with_avx2(function) }
        }
    }

    /// The proof that the machine has AVX-512 F, VL, BW and DQ, and all that [`Avx2`] proves.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx512(Avx2);

    impl Avx512 {
        /// Creates the proof; `None` if the machine lacks any of these instructions.
        pub fn new() -> Option<Self> {
            let has = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq");
            if has { Avx2::new().map(Self) } else { None }
        }

        /// Creates the proof without asking the machine again.
        ///
        /// # Safety
        /// [`Self::new`] must have given a proof before.
        #[inline(always)]
        pub(in super::super) unsafe fn assume() -> Self {
            Self(Avx2(()))
        }
    }

    impl Token for Avx512 {
        #[inline(always)]
        fn run<R>(self, function: impl FnOnce() -> R) -> R {
            #[target_feature(
                enable = "avx512f,avx512vl,avx512bw,avx512dq,avx2,fma,bmi1,bmi2,lzcnt,popcnt"
            )]
            #[inline(never)]
            fn with_avx512<R>(function: impl FnOnce() -> R) -> R {
                function()
            }
            // SAFETY: the token exists, so `new` has found these instructions.
            unsafe { with_avx512(function) }
        }
    }

    impl From<Avx512> for Avx2 {
        #[inline(always)]
        fn from(token: Avx512) -> Self {
            token.0
        }
    }
}
