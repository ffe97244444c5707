//! The real command in fresh folders: options, files, messages, exit codes.

mod bench;
mod checkpoint;
mod errors;
mod info;
mod interrupt;
mod lost;
mod memory;
mod motion;
mod options;
mod output;
#[cfg(unix)]
mod pipes;
mod plan;
mod statistics;
mod support;
mod usd;
#[cfg(unix)]
mod view;
