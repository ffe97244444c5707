//! The real command in fresh folders: options, files, messages, exit codes.

mod bench;
mod errors;
mod info;
mod interrupt;
mod motion;
mod options;
mod output;
mod statistics;
mod support;
#[cfg(unix)]
mod view;
