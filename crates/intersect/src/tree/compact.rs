//! The compact form of triangle blocks, which stores shared vertices once.
//!
//! A record of several [lines](Line) begins with the numbers of eight triangles (the highest bits
//! of the first number hold the count of different corners), then come eight 4-bit corner indices
//! for each of the three vertices, and then the coordinates of the corners by axis. Nothing is
//! rounded, so unpacked triangles have the same hits, bit for bit. In a mesh a record takes two or
//! three cache lines, where a [`TriangleBlock`] takes five.

use crate::tree::block::TriangleBlock;
use snell_math::Vec4;
use snell_math::simd::{Lanes8, Token};
use std::mem::MaybeUninit;

/// A cache line, the unit of records.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Line(pub [u32; 16]);

/// The limit, exclusive, of triangle numbers.
pub(crate) const MAX_ID: u32 = 1 << ID_BITS;
const ID_BITS: u32 = 28;

/// The number of lines that must follow the last record, because reading a record may touch them.
pub(crate) const SPARE_LINES: usize = 4;

/// The largest number of different corners that a record can index. With more corners, a record
/// holds the corners of every triangle instead.
const MOST_CORNERS: usize = 16;

/// The offset of the corner indices in a record, in 32-bit words.
const NAMES: usize = 8;
/// The offset of the corner coordinates in a record, in 32-bit words.
const TABLE: usize = 11;
/// The offset of the corners in a record that holds the corners of every triangle.
const ALL: usize = 8;

/// The number of lines of a record that holds the corners of every triangle.
const LINES_OF_ALL: usize = size_of::<TriangleBlock>() / size_of::<Line>();

/// The number of lines of a record with this many different corners.
fn lines_for(corners: usize) -> usize {
    if corners > MOST_CORNERS { LINES_OF_ALL } else { (TABLE + 3 * corners).div_ceil(16) }
}

/// The different corners of a block's triangles, and for each vertex of each triangle the index of
/// its corner.
struct Corners {
    table: [[u32; 3]; 24],
    count: usize,
    names: [[u32; 8]; 3],
}

impl Corners {
    fn of(block: &TriangleBlock) -> Self {
        let mut found = Self { table: [[0; 3]; 24], count: 0, names: [[0; 8]; 3] };
        for lane in (0..8).filter(|&lane| block.ids[lane] != u32::MAX) {
            for (vertex, corner) in block.corners(lane).iter().enumerate() {
                let corner = corner.map(f32::to_bits);
                let known = found.table[..found.count].iter().position(|other| *other == corner);
                found.names[vertex][lane] = known.unwrap_or(found.count) as u32;
                if known.is_none() {
                    found.table[found.count] = corner;
                    found.count += 1;
                }
            }
        }
        // At least two, because a count of one is stored as 0, which marks a record that holds all
        // corners.
        found.count = found.count.max(2);
        found
    }
}

/// The number of lines of the record for a block.
pub(crate) fn lines_of(block: &TriangleBlock) -> usize {
    lines_for(Corners::of(block).count)
}

/// Writes a block, whose first lane must be used, with triangle numbers below [`MAX_ID`]. Returns
/// false if the record needs a different number of lines from the given one.
pub(crate) fn pack(block: &TriangleBlock, to: &mut [Line]) -> bool {
    let corners = Corners::of(block);
    if to.len() != lines_for(corners.count) {
        return false;
    }
    to.fill(Line([0; 16]));
    let mut set = |i: usize, bits: u32| to[i / 16].0[i % 16] = bits;
    (0..8).for_each(|lane| set(lane, block.ids[lane]));
    if corners.count > MOST_CORNERS {
        let numbers = block.vertices.as_flattened().as_flattened();
        numbers.iter().enumerate().for_each(|(i, x)| set(ALL + i, x.to_bits()));
        return true;
    }
    set(0, block.ids[0] | (corners.count as u32 - 1) << ID_BITS);
    for (vertex, names) in corners.names.iter().enumerate() {
        set(NAMES + vertex, names.iter().rev().fold(0, |all, name| all << 4 | name));
    }
    for (i, corner) in corners.table[..corners.count].iter().enumerate() {
        (0..3).for_each(|axis| set(TABLE + axis * corners.count + i, corner[axis]));
    }
    true
}

/// The number of lines of the record that begins with this line.
pub(crate) fn lines_from(first: &Line) -> usize {
    match first.0[0] >> ID_BITS {
        0 => LINES_OF_ALL,
        corners => lines_for(corners as usize + 1),
    }
}

/// The numbers of the triangles of the record that begins with this line; `u32::MAX` in unused
/// lanes.
pub(crate) fn ids_from(first: &Line) -> [u32; 8] {
    std::array::from_fn(|lane| if lane == 0 { first.0[0] & (MAX_ID - 1) } else { first.0[lane] })
}

/// Bit `i` of the result is the highest bit of the `i`th group of four bits.
#[inline(always)]
fn highest_of_four(bits: u32) -> u32 {
    let bits = bits >> 3 & 0x1111_1111;
    let bits = (bits | bits >> 3) & 0x0303_0303;
    let bits = (bits | bits >> 6) & 0x000f_000f;
    (bits | bits >> 12) & 0xff
}

/// The address of the blocks of a tree, in plain or compact form.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlocksAt {
    start: *const u8,
    /// Bytes between consecutive block numbers.
    stride: u32,
}

impl BlocksAt {
    /// The blocks with the given [`Self::parts`].
    #[inline(always)]
    pub const fn new(start: *const u8, stride: u32) -> Self {
        Self { start, stride }
    }

    #[inline(always)]
    pub fn parts(self) -> (*const u8, u32) {
        (self.start, self.stride)
    }

    /// Plain blocks, numbered by index.
    #[inline(always)]
    pub fn blocks(blocks: &[TriangleBlock]) -> Self {
        Self::new(blocks.as_ptr().cast(), size_of::<TriangleBlock>() as u32)
    }

    /// Compact records, numbered by line. [`SPARE_LINES`] must follow the last record.
    #[inline(always)]
    pub fn lines(lines: &[Line]) -> Self {
        Self::new(lines.as_ptr().cast(), size_of::<Line>() as u32)
    }

    /// The address of a block, for prefetching. (Of other numbers it is any address.)
    #[inline(always)]
    pub fn address(self, number: usize) -> *const u8 {
        self.start.wrapping_add(number.wrapping_mul(self.stride as usize))
    }

    #[inline(always)]
    fn is_compact(self) -> bool {
        self.stride != size_of::<TriangleBlock>() as u32
    }

    /// The block with this number, unpacked into `room` if it is compact.
    ///
    /// # Safety
    /// There must be a block with this number for as long as the result is used.
    #[inline(always)]
    pub unsafe fn block<L: Lanes8>(
        self,
        token: L::Token,
        number: usize,
        room: &mut MaybeUninit<TriangleBlock>,
    ) -> &TriangleBlock {
        let at = self.address(number);
        // SAFETY: the caller promises a block with this number. The stride gives its kind, since
        // `lines` and `blocks` make these addresses: a record with `SPARE_LINES` behind it, or a
        // `TriangleBlock`.
        unsafe {
            if self.is_compact() { unpacked::<L>(token, at.cast(), room) } else { &*at.cast() }
        }
    }

    /// The corners of the triangle in a lane.
    ///
    /// # Safety
    /// There must be a block with this number.
    #[inline(always)]
    pub unsafe fn corners(self, number: usize, lane: usize) -> [[f32; 3]; 3] {
        // SAFETY: the caller promises a block with this number. The stride gives its kind, since
        // `lines` and `blocks` make these addresses: a record with `SPARE_LINES` behind it, or a
        // `TriangleBlock`.
        unsafe {
            if self.is_compact() {
                return corners_in(self.address(number).cast(), lane)
                    .map(|corner| corner.truncate().to_array());
            }
            (*self.address(number).cast::<TriangleBlock>()).corners(lane)
        }
    }

    /// The number within the group of the triangle in a lane.
    ///
    /// # Safety
    /// There must be a block with this number. (The id means nothing if the lane is not used.)
    #[inline(always)]
    pub unsafe fn id(self, number: usize, lane: usize) -> u32 {
        // SAFETY: the caller promises a block with this number, whose kind the stride gives. Either
        // kind begins with the numbers of eight triangles.
        unsafe {
            if self.is_compact() {
                return self.address(number).cast::<u32>().add(lane & 7).read() & (MAX_ID - 1);
            }
            (*self.address(number).cast::<TriangleBlock>()).ids[lane & 7]
        }
    }
}

/// The corners of a triangle of a record. (Returned as whole registers: if numbers were written one
/// by one, reading several at a time would have to wait for the writes.)
///
/// # Safety
/// `first` must be the first line of a record, and [`SPARE_LINES`] must follow the record.
#[cold]
#[inline(never)]
unsafe fn corners_in(first: *const Line, lane: usize) -> [Vec4; 3] {
    let (record, lane) = (first.cast::<u32>(), lane & 7);
    // SAFETY: the caller promises five lines, 80 numbers, from `first` on. `count` is at most 16
    // and indices are below 16, so the last number that is read is 11 + 15 + 2 * 16 = 58; of a
    // record that holds all corners, it is 8 + 48 + 7 + 16 = 79.
    unsafe {
        let corner = |x: usize, step: usize| {
            let float = |i: usize| f32::from_bits(record.add(i).read());
            Vec4::new(float(x), float(x + step), float(x + 2 * step), 0.0)
        };
        let count = (record.read() >> ID_BITS) as usize + 1;
        if count == 1 {
            return [0, 24, 48].map(|vertex| corner(ALL + vertex + lane, 8));
        }
        let name = |vertex: usize| (record.add(NAMES + vertex).read() >> (4 * lane) & 15) as usize;
        [0, 1, 2].map(|vertex| corner(TABLE + name(vertex), count))
    }
}

/// Unpacks a record into a block. (Not inlined, because kernels for plain blocks are 2 to 4 %
/// slower with this code in their loops.)
///
/// # Safety
/// `first` must be the first line of a record, and [`SPARE_LINES`] must follow the record.
#[cold]
#[inline(never)]
unsafe fn unpacked<L: Lanes8>(
    token: L::Token,
    first: *const Line,
    room: &mut MaybeUninit<TriangleBlock>,
) -> &TriangleBlock {
    token.run(
        #[inline(always)]
        // SAFETY: the caller promises a record with `SPARE_LINES` behind it, which is what `unpack`
        // asks for.
        move || unsafe { unpack::<L>(token, first, room) },
    )
}

/// # Safety
/// `first` must be the first line of a record, and [`SPARE_LINES`] must follow the record.
#[inline(always)]
unsafe fn unpack<L: Lanes8>(
    token: L::Token,
    first: *const Line,
    room: &mut MaybeUninit<TriangleBlock>,
) -> &TriangleBlock {
    // SAFETY: the caller promises five lines, 80 numbers, from `first` on. `count` is at most 16,
    // so the last number that is read is 11 + 2 * 16 + 15 = 58; of a record that holds all corners,
    // it is 8 + 71 = 79. Both branches write all of the block.
    unsafe {
        let (record, block) = (first.cast::<u32>(), &mut *room.as_mut_ptr());
        block.ids = *record.cast();
        let count = (block.ids[0] >> ID_BITS) as usize + 1;
        block.ids[0] &= MAX_ID - 1;
        if count == 1 {
            let rows = &*record.add(ALL).cast::<[[[f32; 8]; 3]; 3]>();
            for (to, from) in block.vertices.as_flattened_mut().iter_mut().zip(rows.as_flattened())
            {
                L::load(token, from).store(to);
            }
            return block;
        }
        for (vertex, to) in block.vertices.iter_mut().enumerate() {
            let names = record.add(NAMES + vertex).read();
            let lanes: [u32; 8] = std::array::from_fn(|lane| names >> (4 * lane) & 7);
            let far = highest_of_four(names);
            for (axis, to) in to.iter_mut().enumerate() {
                let table = record.add(TABLE + axis * count).cast::<[f32; 8]>();
                let corners = L::load_permuted(token, &*table, &lanes);
                corners.replace(far, L::load_permuted(token, &*table.add(1), &lanes)).store(to);
            }
        }
        block
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::tests::Random;
    use snell_math::simd::{Level, Portable, Portable8, Wide8, WideToken};

    /// Random blocks of triangles whose corners are chosen from the given number of points.
    fn blocks(random: &mut Random, points: usize) -> Vec<TriangleBlock> {
        let table: Vec<[f32; 3]> = (0..points).map(|_| random.point(9.0).to_array()).collect();
        let mut block = |count: usize| {
            let mut block = TriangleBlock::EMPTY;
            for lane in 0..count {
                let corners = std::array::from_fn(|_| {
                    table[(random.unit() * points as f32) as usize % points]
                });
                block.set(lane, &corners, (random.unit() * MAX_ID as f32) as u32 % MAX_ID);
            }
            block
        };
        (1..=8).cycle().take(64).map(&mut block).collect()
    }

    fn is_same(a: &TriangleBlock, b: &TriangleBlock) -> bool {
        let lanes = || (0..8).filter(|&lane| a.ids[lane] != u32::MAX);
        let bits = |block: &TriangleBlock, lane| block.corners(lane).map(|c| c.map(f32::to_bits));
        a.ids == b.ids && lanes().all(|lane| bits(a, lane) == bits(b, lane))
    }

    #[test]
    fn what_is_packed_is_unpacked_bit_for_bit() {
        let mut random = Random(7);
        let mut seen = [0; 6];
        for points in [1, 2, 3, 6, 7, 8, 9, 12, 16, 40] {
            for block in blocks(&mut random, points) {
                let count = lines_of(&block);
                seen[count] += 1;
                let mut lines = vec![Line([u32::MAX; 16]); count + SPARE_LINES];
                assert!(!pack(&block, &mut lines[..count + 1]));
                assert!(pack(&block, &mut lines[..count]));
                assert_eq!((lines_from(&lines[0]), ids_from(&lines[0])), (count, block.ids));
                let (at, mut room) = (BlocksAt::lines(&lines), MaybeUninit::uninit());
                // SAFETY: there is one block.
                let (unpacked, corners) = unsafe {
                    (at.block::<Portable8>(Portable, 0, &mut room), |lane| {
                        (at.id(0, lane), at.corners(0, lane))
                    })
                };
                assert!(is_same(&block, unpacked), "{block:?}");
                for lane in (0..8).filter(|&lane| block.ids[lane] != u32::MAX) {
                    assert_eq!(corners(lane), (block.ids[lane], block.corners(lane)));
                }
                if let Some(wide) = Level::best().wide() {
                    let token = WideToken::from(wide);
                    // SAFETY: there is one block.
                    let again = unsafe { at.block::<Wide8>(token, 0, &mut room) };
                    assert!(is_same(&block, again), "{block:?}");
                }
            }
        }
        assert!(seen[2..].iter().all(|&n| n > 5), "{seen:?}");
    }
}
