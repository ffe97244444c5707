//! Memory use of the process, and checks that enough is available.

use crate::failure::Failure;
use snell_formats::memory::Available;
use snell_render::memory::of_scene;
use snell_scene::Scene;

/// Fails with a message if less than `bytes` of memory is available for `what`, which runs on all
/// threads.
pub fn admit(what: &str, bytes: u64) -> Result<(), String> {
    let available = Available::now().for_threads(rayon::current_num_threads());
    let admitted = available.admit(what, bytes);
    admitted.map_err(|problem| format!("{problem}; give it more memory, or make the scene simpler"))
}

/// Refuses a scene if there is too little memory to compile it.
pub fn admit_scene(name: &str, scene: &Scene) -> Result<(), Failure> {
    let admitted = admit("the scene ready for rays", of_scene(scene));
    admitted.map_err(|problem| Failure::Scene(format!("{name}: {problem}")))
}

/// Resident memory of this process now, in bytes; `None` where the system does not report it.
pub fn memory_bytes() -> Option<u64> {
    kilobytes("VmRSS:")
}

/// A number of `/proc/self/status`, in bytes.
fn kilobytes(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? * 1024)
}

/// Largest resident memory of this process so far, in bytes; `None` where the system does not
/// report it.
pub fn peak_memory_bytes() -> Option<u64> {
    // On Linux, `getrusage` also counts the memory that the parent had when it started this
    // process.
    if let Some(peak) = kilobytes("VmHWM:") {
        return Some(peak);
    }
    #[cfg(unix)]
    {
        let usage =
            nix::sys::resource::getrusage(nix::sys::resource::UsageWho::RUSAGE_SELF).ok()?;
        let unit = if cfg!(any(target_os = "macos", target_os = "ios")) { 1 } else { 1024 };
        Some(usage.max_rss() as u64 * unit)
    }
    #[cfg(not(unix))]
    None
}
