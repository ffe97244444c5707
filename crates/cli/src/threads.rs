//! The threads of the process.

use crate::failure::Failure;
use clap::builder::RangedI64ValueParser;
use snell_render::threads::MAX;
pub use snell_render::threads::cores;

/// A parser for the number of threads on the command line.
pub fn number() -> RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(1..=MAX as i64)
}

/// Starts the pool of threads that read and write files and build structures: `threads` of them for
/// the whole process, whatever the environment specifies.
pub fn start(threads: usize) -> Result<(), Failure> {
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("snell-{i}"));
    pool.build_global().map_err(|error| {
        let remedy = "use fewer with -t, or raise the limit of processes (ulimit -u)";
        Failure::Other(format!("cannot start {threads} threads: {error}; {remedy}"))
    })
}
