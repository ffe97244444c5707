//! The real command in fresh folders: options, files, messages, exit codes.

mod bench;
mod errors;
mod info;
mod interrupt;
mod memory;
mod motion;
mod options;
mod output;
mod statistics;
mod support;
