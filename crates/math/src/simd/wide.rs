//! Plain loops for wide registers: the same source compiled with and without the instructions of a
//! level.
//!
//! The compiler vectorises a branch-free loop over arrays where the instructions are enabled.
//! Selections are written as `if a { x } else { y }`, where `x` and `y` are already computed.
//! Nothing is fused or reordered, so every level gives the same bits.

use super::Level;
#[cfg(target_arch = "x86_64")]
use super::{Avx2, Avx8, Avx512};
#[cfg(not(target_arch = "x86_64"))]
use super::{Fours8, Portable};
use glam::Vec3;

/// Proof that the machine has the instructions of a level with wide registers.
#[derive(Clone, Copy, Debug)]
pub enum Wide {
    /// The instructions of [`Level::Avx2`].
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// The instructions of [`Level::Avx512`].
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    /// The instructions of [`Level::Vector128`].
    #[cfg(not(target_arch = "x86_64"))]
    Vector128(Portable),
}

/// Eight lanes that every machine with wide registers has.
#[cfg(target_arch = "x86_64")]
pub type Wide8 = Avx8;
/// Eight lanes that every machine with wide registers has.
#[cfg(not(target_arch = "x86_64"))]
pub type Wide8 = Fours8;

/// The token of [`Wide8`].
pub type WideToken = <Wide8 as super::Lanes8>::Token;

#[cfg(not(target_arch = "x86_64"))]
impl From<Wide> for Portable {
    #[inline(always)]
    fn from(wide: Wide) -> Self {
        match wide {
            Wide::Vector128(token) => token,
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl From<Wide> for Avx2 {
    #[inline(always)]
    fn from(wide: Wide) -> Self {
        match wide {
            Wide::Avx2(token) => token,
            Wide::Avx512(token) => token.into(),
        }
    }
}

impl Level {
    /// The proof that the machine has the instructions of this level, or of the best lower level
    /// that the machine supports; `None` for portable code.
    pub fn wide(self) -> Option<Wide> {
        #[cfg(target_arch = "x86_64")]
        if self == Self::Avx512
            && let Some(token) = Avx512::new()
        {
            return Some(Wide::Avx512(token));
        }
        #[cfg(target_arch = "x86_64")]
        if self >= Self::Avx2 {
            return Avx2::new().map(Wide::Avx2);
        }
        #[cfg(not(target_arch = "x86_64"))]
        if self >= Self::Vector128 && Self::Vector128.is_supported() {
            return Some(Wide::Vector128(Portable));
        }
        None
    }

    /// The level that `wide` proves.
    pub fn of(wide: Option<Wide>) -> Self {
        match wide {
            #[cfg(target_arch = "x86_64")]
            Some(Wide::Avx512(_)) => Self::Avx512,
            #[cfg(target_arch = "x86_64")]
            Some(Wide::Avx2(_)) => Self::Avx2,
            #[cfg(not(target_arch = "x86_64"))]
            Some(Wide::Vector128(_)) => Self::Vector128,
            None => Self::Scalar,
        }
    }
}

/// Calls `function`, which must be `#[inline(always)]`. If the first argument is `Some(Wide)`, the
/// call is compiled for wide registers:
/// `at_level!(wide, function, (a: A = value, b: B = value) -> C)`. If the types depend on a type
/// parameter of the caller, that parameter is declared again:
/// `at_level!(wide, <A: Bound> function::<A>, (a: A = value))`.
#[macro_export]
macro_rules! at_level {
    ($wide:expr, $function:path, $($rest:tt)*) => {
        $crate::at_level!($wide, <> $function, $($rest)*)
    };
    (
        $wide:expr,
        <$($parameter:ident : $bound:path)?> $function:path,
        ($($argument:ident : $type:ty = $value:expr),* $(,)?) $(-> $result:ty)?
    ) => {{
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn in_wide_registers$(<$parameter: $bound>)?($($argument: $type),*) $(-> $result)? {
            $function($($argument),*)
        }
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq")]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn in_widest_registers$(<$parameter: $bound>)?($($argument: $type),*) $(-> $result)? {
            $function($($argument),*)
        }
        let wide: Option<$crate::simd::Wide> = $wide;
        match wide {
            // SAFETY: the value proves that the machine has these instructions.
            #[cfg(target_arch = "x86_64")]
            Some($crate::simd::Wide::Avx512(_)) => unsafe { in_widest_registers($($value),*) },
            // SAFETY: the value proves that the machine has these instructions.
            #[cfg(target_arch = "x86_64")]
            Some($crate::simd::Wide::Avx2(_)) => unsafe { in_wide_registers($($value),*) },
            _ => $function($($value),*),
        }
    }};
}

/// The maximum of two numbers; the second if one is NaN. Unlike `f32::max`, it is one instruction.
#[inline(always)]
pub fn max<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// The minimum of two numbers; the second if one is NaN. Unlike `f32::min`, it is one instruction.
#[inline(always)]
pub fn min<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// A number type of 32 bits.
pub trait Bits: Copy {
    /// The bits of the number.
    fn bits(self) -> u32;

    /// The number that has these bits.
    fn of_bits(bits: u32) -> Self;
}

impl Bits for u32 {
    #[inline(always)]
    fn bits(self) -> u32 {
        self
    }

    #[inline(always)]
    fn of_bits(bits: u32) -> Self {
        bits
    }
}

impl Bits for f32 {
    #[inline(always)]
    fn bits(self) -> u32 {
        self.to_bits()
    }

    #[inline(always)]
    fn of_bits(bits: u32) -> Self {
        Self::from_bits(bits)
    }
}

/// The first of two numbers if `mask` is 1, the second if it is 0. Use it where the result is
/// stored over the second number: an `if` would become a masked store, which takes twenty cycles on
/// some processors (Zen 2 to 4, with AVX2). The mask must come from memory; otherwise the compiler
/// recognises it as a condition.
#[inline(always)]
pub fn mask_select<T: Bits>(mask: u32, a: T, b: T) -> T {
    let mask = mask.wrapping_neg();
    T::of_bits(a.bits() & mask | b.bits() & !mask)
}

/// Applies [`mask_select`] to each coordinate of two vectors.
#[inline(always)]
pub fn mask_select_vector(mask: u32, a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(mask_select(mask, a.x, b.x), mask_select(mask, a.y, b.y), mask_select(mask, a.z, b.z))
}

/// The first of two vectors if the condition holds, otherwise the second. It has no branches.
#[inline(always)]
pub fn select(condition: bool, a: Vec3, b: Vec3) -> Vec3 {
    let select = |a: f32, b: f32| if condition { a } else { b };
    Vec3::new(select(a.x, b.x), select(a.y, b.y), select(a.z, b.z))
}
