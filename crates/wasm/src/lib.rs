//! The renderer in WebAssembly: what a page without a server calls.
//!
//! `cargo xtask page` builds it for `wasm32-wasip1`. A worker of the page (`web/src/alone/`) calls
//! the functions of [`exports`], and gives it files, a clock and random numbers as WASI. A browser
//! gives one thread, and all that is said goes through [`Page`], which is safe code and the same on
//! every system.

#[cfg(target_family = "wasm")]
pub mod exports;
mod page;

pub use page::{Opening, Page, Said};
