//! Embree 4, loaded at run time, as somebody to compare with: the same world, the same rays, in the
//! same process.
//!
//! Nothing of Embree is built, linked or shipped. [`Embree::load`] opens the shared library that
//! the user names; the layouts in [`abi`] are those of Embree's C interface (version 4, API
//! reference, "rtcRay", "rtcIntersect1"), written by hand.
//!
//! This is the one place besides the ray kernels that needs `unsafe`: calls into a foreign library.
//! The front is safe.

mod abi;
mod device;
mod floats;
mod library;
mod scene;
mod trace;

pub use device::Device;
pub use library::{Embree, LoadError};
pub use scene::{BuildQuality, PeerError, PeerScene, SceneOptions};
pub use trace::{Mode, Width};
