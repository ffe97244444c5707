//! What the process uses.

/// Resident memory of this process now, in bytes; `None` where the system does not say.
pub fn memory_bytes() -> Option<u64> {
    kilobytes("VmRSS:")
}

/// A number of `/proc/self/status`, in bytes.
fn kilobytes(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? * 1024)
}

/// Largest resident memory of this process so far, in bytes; `None` where the system does not tell.
pub fn peak_memory_bytes() -> Option<u64> {
    // On Linux, what `getrusage` tells counts what the parent had when it started this process, too.
    if let Some(peak) = kilobytes("VmHWM:") {
        return Some(peak);
    }
    #[cfg(unix)]
    {
        let usage = nix::sys::resource::getrusage(nix::sys::resource::UsageWho::RUSAGE_SELF).ok()?;
        let unit = if cfg!(any(target_os = "macos", target_os = "ios")) { 1 } else { 1024 };
        Some(usage.max_rss() as u64 * unit)
    }
    #[cfg(not(unix))]
    None
}
