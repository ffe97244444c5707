//! Embree 4, loaded at run time, as a peer for comparison: the same world and the same rays, in the
//! same process.
//!
//! Nothing of Embree is built, linked or shipped. [`Embree::load`] opens the shared library that
//! the user names; the layouts in [`abi`] are those of Embree's C interface (version 4, API
//! reference, "rtcRay", "rtcIntersect1"), written by hand.
//!
//! Like the ray kernels, this crate needs `unsafe`: for calls into a foreign library. Its public
//! interface is safe.

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
