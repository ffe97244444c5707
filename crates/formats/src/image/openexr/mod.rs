//! OpenEXR, through the crate `exr`.

mod attributes;
mod chromaticities;
mod deep;
mod read;
mod sampling;
mod write;

pub use chromaticities::rec709_from;
pub use read::{read_image, read_layers};
pub use write::encode;
