//! Whatever the bytes are, reading them as the contents of a task's result ends in a result that
//! can be added to a film, in one that is refused, or in an error.

#![no_main]

use snell_fuzz::saved::{file, with_job};
use snell_render::{TaskResult, Underway};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = file(b"snellT02", bytes);
    let Ok((_, result)) = TaskResult::load(&mut file.as_slice()) else { return };
    with_job(|job| {
        let mut underway = Underway::empty(job.settings());
        if underway.add(result.clone()) && underway.add(result) {
            job.end_round(&mut underway);
            underway.film.image();
        }
    });
});
