//! How much memory this process may still take: the minimum of what the machine, its control groups
//! and its resource limits leave.
//!
//! The figures come from `/proc` and `/sys/fs/cgroup` on Linux. On other systems nothing is known,
//! and nothing is refused in advance. In WebAssembly, addresses of 32 bits are the limit.

#![cfg_attr(target_arch = "wasm32", allow(dead_code))]

use std::fmt;
use std::fs::read_to_string;
use std::path::{Path, PathBuf};

/// The available memory, and the limit that makes it so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Available {
    /// Bytes that can still be allocated; `u64::MAX` if unknown.
    pub bytes: u64,
    /// The tightest limit.
    pub limit: Limit,
}

/// The source of a memory limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Free memory of the machine, including swap space.
    Machine,
    /// A control group, such as that of a container or of a cluster job.
    ControlGroup,
    /// `ulimit -v`: all mapped memory counts.
    AddressSpace,
    /// `ulimit -d`: all writable memory counts.
    Data,
    /// No limit is known.
    None,
}

impl Available {
    /// The value if no limit is known.
    pub const UNKNOWN: Self = Self { bytes: u64::MAX, limit: Limit::None };

    /// The memory that this process may allocate now.
    pub fn now() -> Self {
        #[cfg(target_arch = "wasm32")]
        return Self { bytes: left_of_addresses(), limit: Limit::AddressSpace };
        #[cfg(not(target_arch = "wasm32"))]
        Self::under(Path::new("/"))
    }

    /// Like [`Self::now`], with the system's files below `root`.
    fn under(root: &Path) -> Self {
        let read = |name: &str| read_to_string(root.join(name)).unwrap_or_default();
        let (status, limits) = (read("proc/self/status"), read("proc/self/limits"));
        let left = |limit: &str, used: &str| {
            let used = kilobytes(&status, used)?;
            Some(soft_limit(&limits, limit)?.saturating_sub(used))
        };
        let found = [
            (machine(&read("proc/meminfo")), Limit::Machine),
            (control_groups(root, &read("proc/self/cgroup")), Limit::ControlGroup),
            (left("Max address space", "VmSize:"), Limit::AddressSpace),
            (left("Max data size", "VmData:"), Limit::Data),
        ];
        let known =
            found.into_iter().filter_map(|(bytes, limit)| Some(Self { bytes: bytes?, limit }));
        known.min_by_key(|available| available.bytes).unwrap_or(Self::UNKNOWN)
    }

    /// The memory that is left for work on `threads` threads in addition to the calling one. Each
    /// of them takes address space for its stack and its part of the heap.
    pub fn for_threads(self, threads: usize) -> Self {
        let each = match self.limit {
            Limit::AddressSpace => SPACE_OF_THREAD,
            _ => 0,
        };
        Self { bytes: self.bytes.saturating_sub(each * threads.min(MOST_HEAPS) as u64), ..self }
    }
}

impl Available {
    /// Fails if the stacks of `threads` threads exceed what limits of the process leave. Starting
    /// them would fail only when no memory is left for anything else. The message has no remedy.
    pub fn admit_stacks(&self, threads: usize) -> Result<(), String> {
        match self.limit {
            Limit::AddressSpace | Limit::Data => {
                self.admit("a stack for each", threads as u64 * STACK)
            }
            _ => Ok(()),
        }
    }
}

/// The size in bytes that the standard library gives the stack of a thread.
const STACK: u64 = 2 << 20;

/// Address space of a thread in bytes: its stack, and the heap that the C library maps for it.
const SPACE_OF_THREAD: u64 = 68 << 20;

/// The C library shares heaps among more threads than this, on most machines.
const MOST_HEAPS: usize = 64;

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Machine | Self::None => "memory of this machine",
            Self::ControlGroup => "limit of the control group (container or job)",
            Self::AddressSpace => "limit of the address space (ulimit -v)",
            Self::Data => "limit of the data (ulimit -d)",
        })
    }
}

impl Available {
    /// Fails if less memory is available than `what` needs. The message has no remedy: the caller
    /// adds one.
    pub fn admit(&self, what: &str, needed: u64) -> Result<(), String> {
        if needed <= self.bytes {
            return Ok(());
        }
        Err(format!("{what} needs about {} of memory, and {self}", Bytes(needed)))
    }
}

impl fmt::Display for Available {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { bytes, limit } = self;
        write!(f, "{} is available ({limit})", Bytes(*bytes))
    }
}

/// A number of bytes, displayed in MB or GB.
#[derive(Clone, Copy, Debug)]
pub struct Bytes(pub u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let bytes = self.0 as f64;
        match self.0 {
            0..1_000_000_000 => write!(f, "{:.0} MB", (bytes * 1e-6).ceil()),
            _ => write!(f, "{:.1} GB", bytes * 1e-9),
        }
    }
}

/// Allocates a buffer of `count` zeros; fails if there is no room for it.
pub fn zeros<T: Clone + Default>(
    count: usize,
) -> Result<Vec<T>, std::collections::TryReserveError> {
    let mut values = Vec::new();
    values.try_reserve_exact(count)?;
    values.resize(count, T::default());
    Ok(values)
}

/// The addresses that a program of 32 bits has not taken yet.
#[cfg(target_arch = "wasm32")]
fn left_of_addresses() -> u64 {
    const PAGE: u64 = 1 << 16;
    (1 << 32) - core::arch::wasm32::memory_size::<0>() as u64 * PAGE
}

/// Memory that the machine has left.
fn machine(meminfo: &str) -> Option<u64> {
    let free = kilobytes(meminfo, "MemAvailable:")?;
    Some(free.saturating_add(kilobytes(meminfo, "SwapFree:").unwrap_or(0)))
}

/// The number in a line such as `VmSize:   1234 kB`, in bytes.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// The soft limit of a line of `/proc/self/limits`; `None` if there is none.
fn soft_limit(limits: &str, name: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

/// The memory that the control groups of this process leave: the minimum over its own group and all
/// enclosing ones.
fn control_groups(root: &Path, groups: &str) -> Option<u64> {
    let left = |(top, path, files): (&str, &str, &Files)| files.least(&root.join(top), path);
    groups.lines().flat_map(places_of_group).filter_map(left).min()
}

/// Places of the files for a line of `/proc/self/cgroup`: the folder, and the path below it.
/// Version 2 has no list of controllers, and may be mounted beside version 1.
fn places_of_group(line: &str) -> Vec<(&'static str, &str, &'static Files)> {
    let mut parts = line.splitn(3, ':').skip(1);
    match (parts.next(), parts.next()) {
        (Some(""), Some(path)) => {
            ["sys/fs/cgroup", "sys/fs/cgroup/unified"].map(|top| (top, path, &SECOND)).into()
        }
        (Some(controllers), Some(path)) if controllers.split(',').any(|c| c == "memory") => {
            vec![("sys/fs/cgroup/memory", path, &FIRST)]
        }
        _ => Vec::new(),
    }
}

/// The names of the files of a control group version.
struct Files {
    limit: &'static str,
    used: &'static str,
    /// Keys of `memory.stat`: page cache, which is freed when memory is short.
    cached: [&'static str; 2],
}

static FIRST: Files = Files {
    limit: "memory.limit_in_bytes",
    used: "memory.usage_in_bytes",
    cached: ["total_inactive_file", "total_active_file"],
};
static SECOND: Files =
    Files { limit: "memory.max", used: "memory.current", cached: ["inactive_file", "active_file"] };

impl Files {
    /// The minimum that a group and its enclosing groups leave.
    fn least(&self, top: &Path, path: &str) -> Option<u64> {
        let mut folder = top.join(path.trim_start_matches('/'));
        // In a container the group may be the root of the mount.
        let mut least: Option<u64> = None;
        loop {
            let left = self.left(&folder);
            least = least.into_iter().chain(left).min();
            if folder == top || !folder.pop() {
                return least;
            }
        }
    }

    /// The memory that one group leaves; `None` if it has no limit.
    fn left(&self, folder: &Path) -> Option<u64> {
        let number = |name: &str| {
            read_to_string::<PathBuf>(folder.join(name)).ok()?.trim().parse::<u64>().ok()
        };
        let limit = number(self.limit)?;
        let stat = read_to_string(folder.join("memory.stat")).unwrap_or_default();
        let cached = |name: &&str| {
            let line = stat.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
            line.and_then(|number| number.parse::<u64>().ok()).unwrap_or(0)
        };
        let cached: u64 = self.cached.iter().map(cached).sum();
        Some(limit.saturating_sub(number(self.used)?.saturating_sub(cached)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with files of a system.
    fn system(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("temporary folders can be made");
        for (name, text) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().expect("a name in a folder")).expect("a folder");
            std::fs::write(path, text).expect("the folder is writable");
        }
        folder
    }

    const MACHINE: (&str, &str) =
        ("proc/meminfo", "MemTotal: 9000000 kB\nMemAvailable:    8000000 kB\nSwapFree: 1000 kB\n");

    #[test]
    fn the_machine_counts_where_nothing_else_does() {
        let limits = "Limit   Soft Limit   Hard Limit   Units\nMax address space  unlimited   \
            unlimited   bytes\n";
        let system = system(&[
            MACHINE,
            ("proc/self/limits", limits),
            ("proc/self/status", "VmSize:\t 5000 kB\n"),
        ]);
        let expected = Available { bytes: 8_001_000 << 10, limit: Limit::Machine };
        assert_eq!(Available::under(system.path()), expected);
        assert_eq!(Available::under(Path::new("/nonexistent")), Available::UNKNOWN);
    }

    #[test]
    fn limits_of_the_process_count_less_what_it_has() {
        let limits = "Max data size   unlimited   unlimited   bytes\n\
                      Max address space         2000000000           unlimited            bytes\n";
        let status = "VmSize:\t  1000000 kB\nVmData:\t 500000 kB\n";
        let system = system(&[MACHINE, ("proc/self/limits", limits), ("proc/self/status", status)]);
        let available = Available::under(system.path());
        assert_eq!(
            available,
            Available { bytes: 2_000_000_000 - 1_024_000_000, limit: Limit::AddressSpace }
        );
        assert_eq!(available.for_threads(2).bytes, available.bytes - 2 * SPACE_OF_THREAD);
    }

    #[test]
    fn the_least_of_all_control_groups_around_counts_and_cached_files_do_not() {
        let stat = "anon 5\ninactive_file 300000000\nactive_file 100000000\n";
        let group = "sys/fs/cgroup/a/b";
        let second = [
            MACHINE,
            ("proc/self/cgroup", "0::/a/b\n"),
            ("sys/fs/cgroup/a/b/memory.max", "max\n"),
            ("sys/fs/cgroup/a/memory.max", "1000000000\n"),
            ("sys/fs/cgroup/a/memory.current", "700000000\n"),
            ("sys/fs/cgroup/a/memory.stat", stat),
        ];
        let available = Available::under(system(&second).path());
        assert_eq!(
            available,
            Available { bytes: 700_000_000, limit: Limit::ControlGroup },
            "{group}"
        );
        let first = [
            MACHINE,
            ("proc/self/cgroup", "9:cpu:/x\n4:memory:/job\n0::/\n"),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n"),
            ("sys/fs/cgroup/memory/memory.usage_in_bytes", "5\n"),
            ("sys/fs/cgroup/memory/job/memory.limit_in_bytes", "600000000\n"),
            ("sys/fs/cgroup/memory/job/memory.usage_in_bytes", "500000000\n"),
            (
                "sys/fs/cgroup/memory/job/memory.stat",
                "total_inactive_file 50000000\ninactive_file 7\n",
            ),
        ];
        let available = Available::under(system(&first).path());
        assert_eq!(available, Available { bytes: 150_000_000, limit: Limit::ControlGroup });
    }
}
