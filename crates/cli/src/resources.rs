//! What the process used.

/// Largest resident memory of this process so far, in bytes; `None` where the system does not tell.
pub fn peak_memory_bytes() -> Option<u64> {
    // On Linux, what `getrusage` tells counts what the parent had when it started this process, too.
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        let kilobytes = status
            .lines()
            .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse::<u64>().ok());
        if let Some(kilobytes) = kilobytes {
            return Some(kilobytes * 1024);
        }
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
