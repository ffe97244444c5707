//! Open Image Denoise 2, loaded at run time if it is installed.
//!
//! Nothing of it is built, linked or shipped. [`Denoiser::load`] opens the shared library; the few
//! functions of its C interface that are needed (Open Image Denoise, API documentation) are
//! declared in `library.rs`, by hand. Calls into a foreign library need `unsafe`, which is confined
//! to that file; the public interface is safe.

#![cfg_attr(
    test,
    expect(clippy::disallowed_methods, reason = "tests compare with the standard library")
)]

mod find;
mod library;
mod picture;

pub use library::Denoiser;

use std::path::PathBuf;

/// The reason why a picture could not be denoised. Each message ends with a remedy.
#[derive(Debug, thiserror::Error)]
pub enum DenoiseError {
    /// The library was not found.
    #[error(
        "Open Image Denoise is not found{}; install it (`pip install pyoidn`, `conda install \
            openimagedenoise`, `brew install \
         open-image-denoise`, or the archive from www.openimagedenoise.org) and name its library \
         or folder: --denoise=PATH",
        .0.as_ref().map(|p| format!(" in {}", p.display())).unwrap_or_default()
    )]
    NotFound(Option<PathBuf>),
    /// The system's loader refused the library.
    #[error(
        "{path}: cannot be loaded: {source}; it must be Open Image Denoise 2 for this machine, \
            with the libraries that belong to it beside it"
    )]
    Load {
        /// The library that was loaded.
        path: PathBuf,
        /// The loader's error.
        source: libloading::Error,
    },
    /// The library is not Open Image Denoise 2.
    #[error("{path}: has no function {symbol}; it must be Open Image Denoise 2")]
    Symbol {
        /// The library that was loaded.
        path: PathBuf,
        /// The missing function.
        symbol: &'static str,
    },
    /// The library reported an error.
    #[error("Open Image Denoise failed: {0}; render without --denoise")]
    Failed(String),
}

/// A picture to denoise, and its auxiliary images: `3 * width * height` values each, interleaved
/// red, green and blue (or x, y and z), row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct Noisy<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Linear radiance, not negative.
    pub color: &'a [f32],
    /// Reflectance of the first surface, 0 to 1.
    pub albedo: &'a [f32],
    /// Normal of the first surface; zero for the background.
    pub normal: &'a [f32],
}
