//! What outlives a render: its [checkpoint](Checkpoint) on the way, and the [receipt](Receipt) that
//! its picture carries. The command, the viewer and the Python package share them.

#![forbid(unsafe_code)]

mod checkpoint;
mod definitions;
mod lock;
mod pace;
mod receipt;
mod saving;

pub use checkpoint::{Checkpoint, Found, Problem, Resume, Wording};
pub use definitions::camera_definitions;
pub use lock::Lock;
pub use pace::Pace;
pub use receipt::{Receipt, image_sha256, sha256, tile_hash};
pub use saving::{Saved, go_on};
