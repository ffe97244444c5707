//! Proofs that the machine has the instructions of a level.
//!
//! A token has no size. It is created once, where a level is chosen, and passed to all code that
//! creates [lanes](super::Lanes8): so lanes exist only where their instructions do, and all
//! operations on them are safe.

use std::fmt::Debug;

/// A proof that the machine has the instructions of a level.
pub trait Token: Copy + Debug + Send + Sync + 'static {
    /// Calls a function that is compiled with the instructions. It must be `#[inline(always)]`, and
    /// so must be all functions with lanes that it calls: functions that are not inlined are
    /// compiled without the instructions, and much slower. The call itself is never inlined.
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
        /// The proof; `None` if the machine lacks any of them.
        pub fn new() -> Option<Self> {
            let has = is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("fma")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("lzcnt")
                && is_x86_feature_detected!("popcnt");
            has.then_some(Self(()))
        }

        /// The proof, where one was created before.
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
        /// The proof; `None` if the machine lacks any of them.
        pub fn new() -> Option<Self> {
            let has = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq");
            if has { Avx2::new().map(Self) } else { None }
        }

        /// The proof, where one was created before.
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
