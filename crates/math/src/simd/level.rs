//! The instruction sets for which kernels are compiled.

#[cfg(target_arch = "x86_64")]
use super::{Avx2, Avx512};
use std::fmt;

/// An instruction-set level. Every level finds the same hits, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Portable code without special instructions. It is the reference in tests of the other
    /// levels.
    Scalar,
    /// Registers of four numbers that all machines with the processor have: NEON on AArch64,
    /// SIMD128 in WebAssembly if the program was compiled with it.
    Vector128,
    /// AVX2, FMA, BMI1, BMI2, LZCNT and POPCNT (x86-64).
    Avx2,
    /// AVX-512 F, VL, BW, DQ (x86-64).
    Avx512,
}

impl Level {
    /// All levels, from the lowest.
    pub const ALL: [Self; 4] = [Self::Scalar, Self::Vector128, Self::Avx2, Self::Avx512];

    /// The name used on the command line and in `SNELL_SIMD`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Vector128 => "vector128",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The level of this name; `None` if no level has it.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|l| l.name() == name)
    }

    /// True if this machine can run the level.
    pub fn is_supported(self) -> bool {
        match self {
            Self::Scalar => true,
            Self::Vector128 => cfg!(any(
                target_arch = "aarch64",
                all(target_arch = "wasm32", target_feature = "simd128")
            )),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => Avx2::new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => Avx512::new().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// The highest level that this machine can run.
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|l| l.is_supported()).unwrap_or(Self::Scalar)
    }

    /// The level named by the environment variable `SNELL_SIMD`, or the best one if it is unset or
    /// empty. The error lists the valid names.
    pub fn from_env() -> Result<Self, String> {
        match std::env::var("SNELL_SIMD") {
            Ok(name) if !name.is_empty() => match Self::from_name(&name) {
                Some(level) if level.is_supported() => Ok(level),
                Some(level) => Err(format!(
                    "SNELL_SIMD={level} needs instructions that this machine lacks; the best it \
                        has is {}",
                    Self::best()
                )),
                None => Err(format!(
                    "SNELL_SIMD={name} is not a level; use scalar, vector128, avx2 or avx512, or \
                        unset it"
                )),
            },
            _ => Ok(Self::best()),
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
