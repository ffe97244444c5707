//! Whatever world and rays the bytes describe: every accelerator, level, batch size and grouping
//! gives the same answers, in either precision, also when the world changes.

#![no_main]

use libfuzzer_sys::fuzz_target;
use snell_tests::random_worlds::{Double, Single, assert_agreement, assert_edits_agree};

fuzz_target!(|bytes: &[u8]| {
    // One of these at a time: with each other they would take long.
    let is_crowded = bytes.len() % 16 >= 12;
    match bytes.len() % 4 {
        0 => {
            assert_agreement::<Double>(bytes, is_crowded, 18, &[1, 16, 17]);
        }
        1 => {
            assert_edits_agree::<Single>(bytes, is_crowded, 18, &[17]);
        }
        2 => {
            assert_edits_agree::<Double>(bytes, is_crowded, 18, &[17]);
        }
        _ => {
            assert_agreement::<Single>(bytes, is_crowded, 18, &[1, 16, 17]);
        }
    }
});
