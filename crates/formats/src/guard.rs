//! The last line of defence around decoders of other crates: a panic becomes an error of the file,
//! and nothing is printed on standard error.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Number of active calls of [`guarded`] on this thread.
    static DEPTH: Cell<usize> = const { Cell::new(0) };
}

static QUIET: Once = Once::new();

/// Returns the result of `work`, or `None` if it panics. Nothing is printed about such a panic; the
/// panic hook of the process still handles the panics of all other code.
pub(crate) fn guarded<T>(work: impl FnOnce() -> T) -> Option<T> {
    QUIET.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| {
            if DEPTH.get() == 0 {
                usual(panic);
            }
        }));
    });
    DEPTH.set(DEPTH.get() + 1);
    let result = catch_unwind(AssertUnwindSafe(work));
    DEPTH.set(DEPTH.get() - 1);
    result.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_no_more_than_nothing() {
        assert_eq!(guarded(|| guarded(|| Vec::<u8>::new()[0])), Some(None));
        assert_eq!((guarded(|| 7), DEPTH.get()), (Some(7), 0));
    }
}
