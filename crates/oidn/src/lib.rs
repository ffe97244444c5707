//! Open Image Denoise 2, loaded at run time if it is there.
//!
//! Nothing of it is built, linked or shipped. [`Denoiser::load`] opens the shared library; the few
//! functions needed of its C interface (Open Image Denoise, API documentation) are declared in
//! `library.rs`, by hand. Calls into a foreign library need `unsafe`; it is all there, and the
//! front is safe.

mod find;
mod library;
mod picture;

pub use library::Denoiser;

use std::path::PathBuf;

/// Why a picture could not be denoised. Each message ends with what to do.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// No library.
    #[error(
        "Open Image Denoise is not found{}; install it (`pip install pyoidn`, `conda install \
            openimagedenoise`, `brew install \
         open-image-denoise`, or the archive from www.openimagedenoise.org) and name its library \
         or folder: --denoise=PATH",
        .0.as_ref().map(|p| format!(" in {}", p.display())).unwrap_or_default()
    )]
    NotFound(Option<PathBuf>),
    /// The system's loader refused it.
    #[error(
        "{path}: cannot be loaded: {source}; it must be Open Image Denoise 2 for this machine, \
            with the libraries that belong to it beside it"
    )]
    Load {
        /// What was loaded.
        path: PathBuf,
        /// What the loader says.
        source: libloading::Error,
    },
    /// Some other library.
    #[error("{path}: has no function {symbol}; it must be Open Image Denoise 2")]
    Symbol {
        /// What was loaded.
        path: PathBuf,
        /// What is missing.
        symbol: &'static str,
    },
    /// The library refused to work.
    #[error("Open Image Denoise failed: {0}; render without --denoise")]
    Failed(String),
}

/// A picture to denoise, and what guides it: `3 * width * height` values each, red, green and blue
/// (or x, y and z) of a pixel together, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct Noisy<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Linear light, not negative.
    pub color: &'a [f32],
    /// Share of light that the first surface reflects, 0 to 1.
    pub albedo: &'a [f32],
    /// Normal of the first surface; zero where there is none.
    pub normal: &'a [f32],
}
