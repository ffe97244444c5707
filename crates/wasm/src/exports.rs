//! The functions that the worker of the page calls. Texts and bytes are passed in the memory of the
//! module: the worker allocates with [`snell_allocate`], and what is passed to a function belongs
//! to it from then on. What a function returns is read at [`snell_out`], until the next call.

use crate::{Page, Said};
use std::cell::RefCell;

thread_local! {
    static STATE: RefCell<State> = const { RefCell::new(State { page: None, out: Vec::new() }) };
}

struct State {
    page: Option<Page>,
    /// What the last function returned.
    out: Vec<u8>,
}

/// Runs something with the state. The worker calls one function at a time.
fn with<T>(act: impl FnOnce(&mut State) -> T) -> T {
    STATE.with_borrow_mut(act)
}

/// Takes bytes that the worker has written.
///
/// # Safety
///
/// `start` and `length` must come from [`snell_allocate`], and must not have been passed before.
unsafe fn taken(start: *mut u8, length: usize) -> Vec<u8> {
    // SAFETY: the caller promises that this is a vector of `snell_allocate` of just this length and
    // capacity, whose bytes are all initialised, and that nobody else owns it.
    unsafe { Vec::from_raw_parts(start, length, length) }
}

/// Memory for so many bytes, all zero, until it is passed to another function.
#[unsafe(no_mangle)]
pub extern "C" fn snell_allocate(length: usize) -> *mut u8 {
    let bytes = vec![0; length].into_boxed_slice();
    Box::into_raw(bytes).cast()
}

/// Where the bytes are that the last function returned.
#[unsafe(no_mangle)]
pub extern "C" fn snell_out() -> *const u8 {
    with(|state| state.out.as_ptr())
}

/// How many bytes the last function returned.
#[unsafe(no_mangle)]
pub extern "C" fn snell_out_length() -> usize {
    with(|state| state.out.len())
}

/// Begins with an [`Opening`](crate::Opening) in JSON. Returns 1, or 0 and a message for the user.
///
/// # Safety
///
/// As for [`taken`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn snell_start(start: *mut u8, length: usize) -> u32 {
    // SAFETY: the caller promises it.
    let opening = unsafe { taken(start, length) };
    let page = Page::new(&String::from_utf8_lossy(&opening));
    with(|state| match page {
        Ok(page) => {
            state.page = Some(page);
            1
        }
        Err(message) => {
            state.out = message.into_bytes();
            0
        }
    })
}

/// Handles a message of the page.
///
/// # Safety
///
/// As for [`taken`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn snell_receive(start: *mut u8, length: usize) {
    // SAFETY: the caller promises it.
    let text = unsafe { taken(start, length) };
    with(|state| state.page.as_mut().map(|page| page.receive(&String::from_utf8_lossy(&text))));
}

/// Answers a request. The bytes are its name, a line break, its parameters as JSON in one line, a
/// line break, and its body. Returns the status; the answer is the length of a note in four bytes
/// (little endian), the note, and the bytes.
///
/// # Safety
///
/// As for [`taken`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn snell_ask(start: *mut u8, length: usize) -> u32 {
    // SAFETY: the caller promises it.
    let asked = unsafe { taken(start, length) };
    let mut parts = asked.splitn(3, |byte| *byte == b'\n');
    let mut part = || parts.next().unwrap_or_default();
    let (request, query, body) = (part(), part(), part());
    let [request, query] = [request, query].map(|text| String::from_utf8_lossy(text).into_owned());
    let body = body.to_vec();
    drop(asked);
    with(|state| {
        let Some(page) = &mut state.page else { return 0 };
        let answer = page.ask(&request, &query, body);
        let note = answer.note.as_bytes();
        state.out = [&(note.len() as u32).to_le_bytes(), note, &answer.bytes].concat();
        answer.status.into()
    })
}

/// Renders for about so many milliseconds. Returns for how many nothing is to be done; a negative
/// number if that is until the next message.
#[unsafe(no_mangle)]
pub extern "C" fn snell_step(milliseconds: f64) -> f64 {
    with(|state| state.page.as_mut().map_or(-1.0, |page| page.step(milliseconds)))
}

/// What is said next: 0 if it is nothing, 1 for a message in JSON, 2 for a frame.
#[unsafe(no_mangle)]
pub extern "C" fn snell_next() -> u32 {
    with(|state| {
        let (kind, bytes) = match state.page.as_mut().and_then(Page::take) {
            None => (0, Vec::new()),
            Some(Said::Text(bytes)) => (1, bytes),
            Some(Said::Frame(bytes)) => (2, bytes),
        };
        state.out = bytes;
        kind
    })
}
