//! Whatever world and rays the bytes describe: every accelerator, level, batch size and grouping gives the same answers.

#![no_main]

use libfuzzer_sys::fuzz_target;
use snell_tests::random_worlds::assert_agreement;

fuzz_target!(|bytes: &[u8]| {
    assert_agreement(bytes, 18, &[1, 16, 17]);
});
