//! SIMD levels, chosen at run time. All levels give the same results.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx2_doubles;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod avx512_doubles;
mod doubles;
#[cfg(any(not(target_arch = "x86_64"), test))]
mod fours;
mod lanes;
mod level;
#[cfg(target_arch = "x86_64")]
mod memory;
mod portable;
mod sixteen;
mod sixteen_doubles;
mod token;
mod wide;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx8;
#[cfg(target_arch = "x86_64")]
pub use avx2_doubles::Avx4;
#[cfg(target_arch = "x86_64")]
pub use avx512::Avx16;
#[cfg(target_arch = "x86_64")]
pub use avx512_doubles::{Avx8Doubles, Avx16Doubles};
pub use doubles::{DoubleLanes, DoublesOf, Lanes4, Portable4, WideLanes};
#[cfg(not(target_arch = "x86_64"))]
pub use fours::{Fours4, Fours8};
pub use lanes::Lanes8;
pub use level::Level;
pub use portable::Portable8;
pub use sixteen::{Lanes16, Pair};
pub use sixteen_doubles::{Doubles16, PairDoubles};
#[cfg(target_arch = "x86_64")]
pub use token::{Avx2, Avx512};
pub use token::{Portable, Token};
pub use wide::{Bits, Wide, Wide8, WideToken, mask_select, mask_select_vector, max, min, select};
