//! Processor time, which on a shared machine is a better measure than wall-clock time. Wall-clock
//! time is used where the system does not provide processor time.

#![allow(dead_code, reason = "every benchmark takes some of it")]

use std::time::Instant;

/// Processor time of this thread in seconds. (Values of `/proc` for a running thread may be some
/// milliseconds old.)
pub fn of_thread() -> f64 {
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    if let Some(time) = read(nix::time::ClockId::CLOCK_THREAD_CPUTIME_ID) {
        return time;
    }
    wall()
}

/// Processor time of all threads in seconds.
pub fn of_process() -> f64 {
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    if let Some(time) = read(nix::time::ClockId::CLOCK_PROCESS_CPUTIME_ID) {
        return time;
    }
    wall()
}

#[cfg(any(target_os = "linux", target_os = "macos"))]
fn read(clock: nix::time::ClockId) -> Option<f64> {
    nix::time::clock_gettime(clock).ok().map(|time| std::time::Duration::from(time).as_secs_f64())
}

fn wall() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}
