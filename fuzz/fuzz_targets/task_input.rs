//! Whatever the bytes are, reading them as the contents of a task for a worker ends in a task that
//! can be performed, in one that is refused, or in an error.

#![no_main]

use snell_fuzz::saved::{file, with_job};
use snell_render::{TaskInput, Underway};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = file(b"snellI01", bytes);
    let Ok(input) = TaskInput::load(&mut file.as_slice()) else { return };
    with_job(|job| {
        let mut underway = Underway::empty(job.settings());
        job.perform_input(&mut underway, input, 1, &|progress| progress.done < 256);
    });
});
