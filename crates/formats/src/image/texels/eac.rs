//! EAC: blocks of one channel of 11 bits (Khronos Data Format Specification, "EAC compressed single
//! channel").

/// The modifiers of each table, for the eight indices.
const MODIFIERS: [[i8; 8]; 16] = [
    [-3, -6, -9, -15, 2, 5, 8, 14],
    [-3, -7, -10, -13, 2, 6, 9, 12],
    [-2, -5, -8, -13, 1, 4, 7, 12],
    [-2, -4, -6, -13, 1, 3, 5, 12],
    [-3, -6, -8, -12, 2, 5, 7, 11],
    [-3, -7, -9, -11, 2, 6, 8, 10],
    [-4, -7, -8, -11, 3, 6, 7, 10],
    [-3, -5, -8, -11, 2, 4, 7, 10],
    [-2, -6, -8, -10, 1, 5, 7, 9],
    [-2, -5, -8, -10, 1, 4, 7, 9],
    [-2, -4, -8, -10, 1, 3, 7, 9],
    [-2, -5, -7, -10, 1, 4, 6, 9],
    [-3, -4, -7, -10, 2, 3, 6, 9],
    [-1, -2, -3, -10, 0, 1, 2, 9],
    [-4, -6, -8, -9, 3, 5, 7, 8],
    [-3, -5, -7, -9, 2, 4, 6, 8],
];

/// Decodes the eight bytes of a block into every `stride`th value: 0 to 1 as 0 to 65535, or -1 to 1
/// if it is signed.
pub fn decode(block: &[u8], signed: bool, values: &mut [u16], stride: usize) {
    let [base, second, ..] = *block else { return };
    let table = MODIFIERS[usize::from(second & 15)];
    // Without a multiplier the modifiers count in the lowest of the eleven bits.
    let multiplier = match i32::from(second >> 4) {
        0 => 1,
        multiplier => multiplier * 8,
    };
    let indices = block[2..8].iter().fold(0u64, |bits, byte| bits << 8 | u64::from(*byte));
    for pixel in 0..16 {
        // Columns come before rows, the first pixel in the highest bits.
        let index = (indices >> (45 - 3 * pixel) & 7) as usize;
        let change = i32::from(table[index]) * multiplier;
        let value = if signed {
            let base = i32::from(base.cast_signed()).max(-127) * 8;
            super::plain::unsigned((base + change).clamp(-1023, 1023) as f32 / 1023.0)
        } else {
            let value = (i32::from(base) * 8 + 4 + change).clamp(0, 2047) as u32;
            ((value * 65535 + 1023) / 2047) as u16
        };
        values[(pixel % 4 * 4 + pixel / 4) * stride] = value;
    }
}
