//! Damage: changed, truncated, inserted and repeated bytes, as a function of a number.

use snell_math::rng::pcg4d;
use std::ops::Range;

/// The words of hostile files.
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

/// Numbers at the ends of ranges, and invalid numbers.
const NUMBERS: [&str; 28] = [
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "0.5",
    "1e-7",
    "1e-38",
    "1e-45",
    "1e-320",
    "1e7",
    "1e12",
    "1e20",
    "1e38",
    "-1e38",
    "3.4028236e38",
    "1e39",
    "1e300",
    "1e999",
    "nan",
    "inf",
    "255",
    "256",
    "65536",
    "2147483648",
    "4294967296",
    "9223372036854775808",
    "18446744073709551616",
];

/// Random numbers: a function of a key and of the number of earlier calls.
pub struct Random {
    key: [u32; 2],
    counter: u32,
}

impl Random {
    pub fn new(key: [u32; 2]) -> Self {
        Self { key, counter: 0 }
    }

    /// A number below `n`, or 0.
    pub fn below(&mut self, n: usize) -> usize {
        self.counter += 1;
        pcg4d([self.key[0], self.counter, self.key[1], 0])[0] as usize % n.max(1)
    }

    pub fn choose<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }
}

/// The seed with the damage of this number: one to four changes of bytes.
pub fn mutate(seed: &[u8], number: u32) -> Vec<u8> {
    let mut random = Random::new([number, 0]);
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random.below(4) {
        change_bytes(&mut bytes, &mut random);
    }
    bytes
}

/// The seed with one to four changes, usually one, of bytes or of words, some of which come from
/// another file.
pub fn mutate_words(seed: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random.below(4) * random.below(2) {
        if random.below(3) == 0 {
            change_bytes(&mut bytes, random)
        } else {
            change_words(&mut bytes, other, random)
        }
    }
    bytes
}

fn change_bytes(bytes: &mut Vec<u8>, random: &mut Random) {
    if bytes.is_empty() {
        return;
    }
    let at = random.below(bytes.len());
    match random.below(16) {
        0..3 => bytes[at] ^= 1 << random.below(8),
        3 => bytes[at] = random.below(256) as u8,
        4 => bytes.truncate(at),
        5 => drop(bytes.splice(at..at, random.choose(&WORDS[..]).iter().copied())),
        6 => drop(bytes.drain(at..(at + 1 + random.below(8)).min(bytes.len()))),
        7 => {
            let copy = bytes[at..(at + 1 + random.below(60)).min(bytes.len())].to_vec();
            drop(bytes.splice(at..at, copy));
        }
        8 => {
            let word = *random.choose(&WORDS[..]);
            let end = (at + word.len()).min(bytes.len());
            bytes[at..end].copy_from_slice(&word[..end - at]);
        }
        // Changing digits keeps a text valid and reaches deeper than random bytes.
        9..13 => replace_digit(bytes, at, random.below(10) as u8),
        13 => replace_number(bytes, at, random.choose::<&[u8]>(&WORDS[..9])),
        _ => bytes[at] = bytes[at].wrapping_add(1),
    }
}

/// Changes a text so that it usually stays valid in its language. Binary files contain words, too.
fn change_words(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let words = words_of(bytes);
    let (Some(range), Some(from)) = (pick(&words, random), pick(&words, random)) else { return };
    let copy = bytes[from].to_vec();
    let (range, by) = match random.below(12) {
        0..4 => {
            let numbers: Vec<_> =
                words.into_iter().filter(|w| is_number(&bytes[w.clone()])).collect();
            (pick(&numbers, random).unwrap_or(range), random.choose(&NUMBERS).as_bytes().to_vec())
        }
        4..6 => (range, copy),
        6 => (range, Vec::new()),
        7 => (range.end..range.end, [b" ", &copy[..]].concat()),
        8 | 9 => {
            let theirs = pick(&words_of(other), random).unwrap_or(0..0);
            (range, other[theirs].to_vec())
        }
        10 => {
            let start = random.below(other.len());
            let end = (start + 1 + random.below(200)).min(other.len());
            (range.start..range.start, other[start..end].to_vec())
        }
        _ => {
            // A duplicated line.
            let lines: Vec<_> = bytes.split_inclusive(|b| *b == b'\n').collect();
            let line = random.choose(&lines).to_vec();
            let at = lines[..random.below(lines.len())].iter().map(|line| line.len()).sum();
            (at..at, line)
        }
    };
    drop(bytes.splice(range, by));
}

fn pick(of: &[Range<usize>], random: &mut Random) -> Option<Range<usize>> {
    of.get(random.below(of.len())).cloned()
}

fn is_number(word: &[u8]) -> bool {
    word.iter().any(u8::is_ascii_digit)
        && word.iter().all(|b| b.is_ascii_digit() || b"+-.eE".contains(b))
}

/// The ranges of the names and numbers of a text.
fn words_of(bytes: &[u8]) -> Vec<Range<usize>> {
    let is_part = |b: u8| b.is_ascii_alphanumeric() || b"_+-.".contains(&b);
    let mut words: Vec<Range<usize>> = Vec::new();
    for (at, _) in bytes.iter().enumerate().filter(|(_, b)| is_part(**b)) {
        match words.last_mut() {
            Some(last) if last.end == at => last.end += 1,
            _ => words.push(at..at + 1),
        }
    }
    words
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
        let length =
            bytes[start..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
        drop(bytes.splice(start..start + length, word.iter().copied()));
    }
}

/// Changes one chunk of a PNG: its length, its order, or its presence. Checksums and lengths stay
/// correct.
pub fn change_png_chunk(bytes: &mut Vec<u8>, random: &mut Random) {
    let (mut chunks, mut at) = (Vec::new(), 8);
    while let Some(length) =
        bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_be_bytes)
    {
        let end = (at + 12).saturating_add(length as usize);
        let Some(chunk) = bytes.get(at + 4..end - 4) else { return };
        chunks.push(chunk.to_vec());
        at = end;
    }
    if chunks.is_empty() {
        return;
    }
    let (i, j) = (random.below(chunks.len()), random.below(chunks.len()));
    match random.below(8) {
        0..4 => {
            let length = 4 + random.below(chunks[i].len());
            chunks[i].truncate(length);
        }
        4 => chunks[i].extend((0..1 + random.below(8)).map(|k| k as u8)),
        5 => chunks.swap(i, j),
        6 => drop(chunks.remove(i)),
        _ => chunks.insert(j, chunks[i].clone()),
    }
    bytes.truncate(8);
    for chunk in chunks {
        bytes.extend((chunk.len() as u32 - 4).to_be_bytes());
        bytes.extend(&chunk);
        bytes.extend(crc32(&chunk).to_be_bytes());
    }
}

/// Corrects the checksums of a damaged PNG, so that the damage passes them.
pub fn correct_png_checksums(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let end = (at + 8).saturating_add(length);
        let Some(content) = bytes.get(at + 4..end) else { return };
        let checksum = crc32(content).to_be_bytes();
        let Some(place) = bytes.get_mut(end..end + 4) else { return };
        place.copy_from_slice(&checksum);
        at = end + 4;
    }
}

/// The checksum of PNG chunks (ISO 3309).
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &b| {
        (0..8)
            .fold(crc ^ u32::from(b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}
