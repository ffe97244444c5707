//! OpenEXR, through the crate `exr`.

mod attributes;
mod read;
mod write;

pub use read::{read_image, read_layers};
pub use write::encode;
