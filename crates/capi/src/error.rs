//! Error codes, and the message of the last error of a thread.

use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What a function reports.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SnellError {
    /// The function did what it was asked to do.
    None = 0,
    /// A pointer is null, a size does not fit, or an index points past the vertices.
    InvalidArgument = 1,
    /// The scene was never committed, or has changed since.
    NotCommitted = 2,
    /// A limit of the structure is exceeded, or there is not enough memory.
    Limit = 3,
    /// A fault in Snell itself. What went wrong was printed to standard error.
    Internal = 4,
}

/// An error and its message.
pub struct Failure(pub SnellError, pub String);

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs the body of an exported function; keeps the message if it fails.
pub fn report(body: impl FnOnce() -> Result<(), Failure>) -> SnellError {
    let outcome = catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|_| {
        Err(Failure(SnellError::Internal, "internal fault; please report it".into()))
    });
    let Failure(error, message) = outcome.err().unwrap_or(Failure(SnellError::None, String::new()));
    // A message with a zero byte inside would end there; there is none.
    LAST.with(|last| *last.borrow_mut() = CString::new(message).unwrap_or_default());
    error
}

/// The error for a pointer that is null.
pub fn null(name: &str) -> Failure {
    Failure(SnellError::InvalidArgument, format!("{name} is null"))
}

/// Returns what an error code means, in a few words. The text is never released.
#[unsafe(export_name = "snellGetErrorString")]
pub extern "C" fn error_string(error: u32) -> *const c_char {
    let text = match error {
        0 => c"no error",
        1 => c"invalid argument",
        2 => c"the scene is not committed",
        3 => c"a limit is exceeded",
        4 => c"internal fault",
        _ => c"unknown error",
    };
    text.as_ptr()
}

/// Returns the message of the calling thread's last call that returns an error code: what is wrong,
/// and where. It is empty if that call succeeded, and valid until the next such call.
#[unsafe(export_name = "snellGetLastErrorMessage")]
pub extern "C" fn last_error_message() -> *const c_char {
    LAST.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}
