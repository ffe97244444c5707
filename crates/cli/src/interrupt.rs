//! Signals that ask the program to end: Ctrl-C, and those that schedulers, systems and closed
//! terminals send (SIGTERM, SIGHUP, and SIGXCPU when the allowed processor time is used up).
//!
//! Initially such a signal ends the program at once. A command whose work can be saved calls
//! [`save_first`]: then the first signal is a request to end, and only a later one ends the program
//! at once. No temporary file is left either way.

use crate::failure::Failure;
use std::borrow::Cow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Signals within this time count as one: `timeout` and terminals send theirs twice.
const SAME_WISH: Duration = Duration::from_secs(1);
/// Exit code of an interrupted command.
pub const EXIT_CODE: u8 = 130;

/// Number of requests to end so far.
static REQUESTS: AtomicUsize = AtomicUsize::new(0);
static STATE: Mutex<State> =
    Mutex::new(State { farewell: Some(Cow::Borrowed("interrupted")), last: None, warned: false });
static CHANGED: Condvar = Condvar::new();

struct State {
    /// The message when a signal ends the program at once; `None` if the next signal is a request.
    farewell: Option<Cow<'static, str>>,
    /// The time of the last distinct signal.
    last: Option<Instant>,
    /// True if a request was made since [`save_first`].
    warned: bool,
}

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on a signal ends the program at once with this message, even if an earlier signal was
/// treated as a request.
pub fn end_at_once(farewell: impl Into<Cow<'static, str>>) {
    state().farewell = Some(farewell.into());
}

/// From now on the next signal is a request, and the one after it ends the program at once.
pub fn save_first() {
    let mut state = state();
    (state.farewell, state.warned) = (None, false);
}

/// True once a request to end was made.
pub fn is_requested() -> bool {
    requests() > 0
}

/// Number of requests to end.
pub fn requests() -> usize {
    REQUESTS.load(Ordering::Relaxed)
}

/// Waits for at most `time`, or until there are more requests than `known`.
pub fn wait(time: Duration, known: usize) {
    let is_quiet = |_: &mut State| requests() <= known;
    drop(CHANGED.wait_timeout_while(state(), time, is_quiet));
}

/// Handles a signal. `insists` is true if a second signal of its kind may abort the saving.
fn receive(insists: bool) {
    let mut state = state();
    let repeats = state.last.is_some_and(|last| last.elapsed() < SAME_WISH);
    if !repeats {
        state.last = Some(Instant::now());
    }
    match (&state.farewell, state.warned) {
        (None, false) if !repeats => {
            state.warned = true;
            REQUESTS.fetch_add(1, Ordering::Relaxed);
            CHANGED.notify_all();
        }
        (None, _) if repeats || !insists => {}
        _ => end(state
            .farewell
            .as_deref()
            .unwrap_or("interrupted again: unwritten results are lost")),
    }
}

/// Ends the program without waiting for other threads.
fn end(farewell: &str) -> ! {
    snell_formats::atomic::abandon();
    eprintln!("{farewell}");
    #[cfg(unix)]
    signal_hook::low_level::exit(EXIT_CODE.into());
    #[cfg(not(unix))]
    std::process::exit(EXIT_CODE.into());
}

/// Begins to watch for signals.
#[cfg(unix)]
pub fn watch() -> Result<(), Failure> {
    use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGXFSZ};
    use signal_hook::iterator::Signals;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    let failed = |e: std::io::Error| Failure::Other(format!("cannot watch for signals: {e}"));
    // A file that grows beyond `ulimit -f` is an error of that file, not the end of the program.
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false))).map_err(failed)?;
    // If memory or stack runs out, the standard library prints a message and aborts. That is a
    // failure like others.
    signal_hook::flag::register_conditional_shutdown(SIGABRT, 1, Arc::new(AtomicBool::new(true)))
        .map_err(failed)?;
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGXCPU]).map_err(failed)?;
    if !is_hangup_ignored() {
        signals.add_signal(SIGHUP).map_err(failed)?;
    }
    let watch =
        move || signals.forever().for_each(|signal| receive(matches!(signal, SIGINT | SIGTERM)));
    std::thread::Builder::new().name("signals".into()).spawn(watch).map_err(failed)?;
    Ok(())
}

/// Begins to watch for Ctrl-C.
#[cfg(not(unix))]
pub fn watch() -> Result<(), Failure> {
    ctrlc::set_handler(|| receive(true))
        .map_err(|e| Failure::Other(format!("cannot watch for Ctrl-C: {e}")))
}

/// True if the program was started by `nohup`, so that it survives the end of the terminal.
#[cfg(unix)]
fn is_hangup_ignored() -> bool {
    use std::io::IsTerminal;
    let ignored = std::fs::read_to_string("/proc/self/status").ok().and_then(|status| {
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
        Some(
            u64::from_str_radix(mask.trim(), 16).ok()? & 1 << (signal_hook::consts::SIGHUP - 1)
                != 0,
        )
    });
    // The system does not report it. But `nohup` redirects messages away from the terminal.
    ignored.unwrap_or_else(|| !std::io::stderr().is_terminal())
}
