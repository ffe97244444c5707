//! The threads of the process.

use crate::failure::Failure;
use clap::builder::RangedI64ValueParser;
use snell_formats::memory::Available;
use snell_render::threads::MAX;
pub use snell_render::threads::cores;
use std::fmt::Display;

/// A parser for the number of threads on the command line.
pub fn number() -> RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(1..=MAX as i64)
}

/// Starts the pool of threads that read and write files and build structures: `threads` of them for
/// the whole process, whatever the environment specifies.
pub fn start(threads: usize) -> Result<(), Failure> {
    let refused = |why: &dyn Display| {
        let remedy = "use fewer with -t, or raise that limit";
        Failure::Other(format!("cannot start {threads} threads: {why}; {remedy}"))
    };
    Available::now().admit_stacks(threads).map_err(|why| refused(&why))?;
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("snell-{i}"));
    pool.build_global().map_err(|error| {
        refused(&format_args!("{error} (limit of processes, ulimit -u, or of memory)"))
    })
}
