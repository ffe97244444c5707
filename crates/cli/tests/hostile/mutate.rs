//! Damage: bytes changed, cut off, inserted, repeated. A function of a number.

use snell_math::rng::pcg4d;

/// What hostile files are made of.
const WORDS: [&[u8]; 20] = [
    b"-1",
    b"0",
    b"4294967295",
    b"999999999999999999",
    b"1e39",
    b"-1e300",
    b"1e-320",
    b"nan",
    b"inf",
    b"/",
    b"\n",
    b"\r",
    b"#",
    b"\"",
    b"[",
    b"{",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\xc0\x7f",
    b"\x00\x00\x80\x7f",
    b"\0",
];

/// The seed with the damage of this number: one to four changes.
pub fn mutate(seed: &[u8], number: u32) -> Vec<u8> {
    let mut counter = 0;
    let mut random = |n: usize| {
        counter += 1;
        pcg4d([number, counter, 0, 0])[0] as usize % n.max(1)
    };
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random(4) {
        if bytes.is_empty() {
            break;
        }
        let at = random(bytes.len());
        match random(16) {
            0..3 => bytes[at] ^= 1 << random(8),
            3 => bytes[at] = random(256) as u8,
            4 => bytes.truncate(at),
            5 => drop(bytes.splice(at..at, WORDS[random(WORDS.len())].iter().copied())),
            6 => drop(bytes.drain(at..(at + 1 + random(8)).min(bytes.len()))),
            7 => {
                let copy = bytes[at..(at + 1 + random(60)).min(bytes.len())].to_vec();
                drop(bytes.splice(at..at, copy));
            }
            8 => {
                let word = WORDS[random(WORDS.len())];
                let end = (at + word.len()).min(bytes.len());
                bytes[at..end].copy_from_slice(&word[..end - at]);
            }
            // Digits turned into other digits keep a text valid and reach deeper than random bytes.
            9..13 => replace_digit(&mut bytes, at, random(10) as u8),
            13 => replace_number(&mut bytes, at, WORDS[random(9)]),
            _ => bytes[at] = bytes[at].wrapping_add(1),
        }
    }
    bytes
}

fn next_digit(bytes: &[u8], at: usize) -> Option<usize> {
    (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit())
}

fn replace_digit(bytes: &mut [u8], at: usize, digit: u8) {
    if let Some(i) = next_digit(bytes, at) {
        bytes[i] = b'0' + digit;
    }
}

/// Replaces the rest of the next number by a word.
fn replace_number(bytes: &mut Vec<u8>, at: usize, word: &[u8]) {
    if let Some(start) = next_digit(bytes, at) {
        let length = bytes[start..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
        drop(bytes.splice(start..start + length, word.iter().copied()));
    }
}
