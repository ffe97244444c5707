//! The threads of the process.

use crate::failure::Failure;

/// Most threads that are started where no number is given.
const MOST: usize = 1024;

/// One for each core that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, |n| n.get()).min(MOST)
}

/// Starts the threads on which files are read and written and structures are built: this many for
/// the whole process, whatever the environment says.
pub fn start(threads: usize) -> Result<(), Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|i| format!("snell-{i}"));
    pool.build_global().map_err(|error| {
        let remedy = "use fewer with -t, or raise the limit of processes (ulimit -u)";
        Failure::Other(format!("cannot start {threads} threads: {error}; {remedy}"))
    })
}
