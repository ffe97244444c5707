//! Whatever the bytes are, reading them as the contents of a checkpoint ends in a render that can
//! be gone on with or in an error.

#![no_main]

use snell_fuzz::saved::{file, with_job};
use snell_render::{Header, Split};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = file(b"snellR03", bytes);
    let mut input = file.as_slice();
    let Ok(header) = Header::read(&mut input) else { return };
    if let Ok(film) = header.film(&mut input) {
        film.image();
    }
    with_job(|job| {
        // Its facts are right whatever they are.
        let restored = job.restore(&mut file.as_slice(), &header.facts, 1, &|_| true);
        let Ok(mut restored) = restored else { return };
        let split = Split { tiles: 1, samples: None };
        if let Some(&task) = restored.tasks(job.settings(), split).first() {
            job.perform(&mut restored, task, 1, &|progress| progress.done < 256);
        }
        job.end_round(&mut restored);
        restored.film.image();
    });
});
