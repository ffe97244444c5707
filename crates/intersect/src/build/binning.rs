//! The inner loops of the builder: sorting boxes into bins, and partitioning them at a plane
//! between bins.

use snell_math::simd::{Lanes8, Portable, Portable8, Token, Wide, Wide8, WideToken};
use snell_math::{Bounds3, Vec3, Vec4};

/// A box stored as its extents along -x, -y, -z, (nothing), x, y, z, (nothing), so that the union
/// of two boxes is a single maximum.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Box8(pub [f32; 8]);

impl Default for Box8 {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Box8 {
    /// The empty box.
    pub const EMPTY: Self = Self([f32::NEG_INFINITY; 8]);

    pub fn new(low: Vec3, high: Vec3) -> Self {
        Self([-low.x, -low.y, -low.z, 0.0, high.x, high.y, high.z, 0.0])
    }

    #[inline(always)]
    fn low_negated(&self) -> Vec4 {
        let [x, y, z, w, ..] = self.0;
        Vec4::new(x, y, z, w)
    }

    #[inline(always)]
    fn high(&self) -> Vec4 {
        let [.., x, y, z, w] = self.0;
        Vec4::new(x, y, z, w)
    }

    #[inline(always)]
    pub fn union(&self, other: &Self) -> Self {
        let low = self.low_negated().max(other.low_negated()).to_array();
        let high = self.high().max(other.high()).to_array();
        Self([low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]])
    }

    /// The intersection of both boxes; may be empty.
    pub fn intersection(&self, other: &Self) -> Self {
        let (a, b) = (self.bounds(), other.bounds());
        Self::new(a.min.max(b.min), a.max.min(b.max))
    }

    /// The box extended to contain `p`.
    #[inline(always)]
    pub fn with_point(&self, p: Vec4) -> Self {
        let (low, high) = (self.low_negated().max(-p).to_array(), self.high().max(p).to_array());
        Self([low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]])
    }

    /// Extent along each axis; negative if empty.
    #[inline(always)]
    pub fn size(&self) -> Vec4 {
        self.high() + self.low_negated()
    }

    /// Half of the surface area; 0 if empty.
    #[inline(always)]
    pub fn half_area(&self) -> f32 {
        let d = self.size().max(Vec4::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Twice the centre. Overflows for coordinates above half of the largest `f32`.
    #[inline(always)]
    pub fn center2(&self) -> Vec4 {
        self.high() - self.low_negated()
    }

    pub fn low(&self) -> Vec4 {
        -self.low_negated()
    }

    #[inline(always)]
    pub fn bounds(&self) -> Bounds3 {
        Bounds3 { min: -self.low_negated().truncate(), max: self.high().truncate() }
    }
}

/// A primitive, or a piece of a triangle: its box, with its number in lane 3.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Primitive(Box8);

/// Bits that are flipped in numbers, so that most of them are normal numbers when read as `f32`.
/// Processors are very slow with subnormal numbers, even where the result is not used.
const NORMAL: u32 = 0x3f80_0000;

impl Primitive {
    #[inline(always)]
    pub fn new(low: Vec3, high: Vec3, id: u32) -> Self {
        let mut lanes = Box8::new(low, high);
        lanes.0[3] = f32::from_bits(id ^ NORMAL);
        Self(lanes)
    }

    #[inline(always)]
    pub fn number(&self) -> u32 {
        self.0.0[3].to_bits() ^ NORMAL
    }

    #[inline(always)]
    pub fn bounds(&self) -> &Box8 {
        &self.0
    }

    /// Twice the centre; see [`Box8::center2`].
    #[inline(always)]
    pub fn center2(&self) -> Vec4 {
        self.0.center2()
    }
}

/// Bins per axis.
pub(crate) const BINS: usize = 16;

/// From `2^23` on, every `f32` is an integer.
const FIRST_INTEGER: f32 = 8388608.0;

/// Maps doubled centres to bins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Binning {
    low: Vec4,
    scale: Vec4,
}

impl Binning {
    /// The binning for doubled centres in the box `centers`.
    pub fn new(centers: &Box8) -> Self {
        let size = centers.size();
        let scale = Vec4::select(
            size.cmpgt(Vec4::ZERO),
            Vec4::splat(BINS as f32 * 0.9999) / size,
            Vec4::ZERO,
        );
        // Tiny extents and extents that overflow give no usable scale: everything goes to one bin.
        let usable = scale.is_finite_mask() & size.is_finite_mask();
        Self { low: centers.low(), scale: Vec4::select(usable, scale, Vec4::ZERO) }
    }

    /// The bin on each axis plus `2^23`, so that its integer is in the low bits.
    #[inline(always)]
    fn bins_as_floats(&self, center2: Vec4) -> Vec4 {
        // Half a bin less, because adding `2^23` rounds to the nearest integer.
        let x = (center2 - self.low) * self.scale - 0.5;
        x.max(Vec4::ZERO).min(Vec4::splat((BINS - 1) as f32)) + FIRST_INTEGER
    }

    /// The bin on each axis.
    #[inline(always)]
    fn bins_of(&self, center2: Vec4) -> [usize; 3] {
        let x = self.bins_as_floats(center2);
        let bin = |x: f32| (x.to_bits() & (BINS as u32 - 1)) as usize;
        [bin(x.x), bin(x.y), bin(x.z)]
    }
}

/// A plane between bins: bins with numbers below `bin` are before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinPlane {
    pub axis: usize,
    pub bin: usize,
}

impl BinPlane {
    /// True if a centre is before the plane.
    #[inline(always)]
    fn is_before(&self, binning: &Binning, center2: Vec4) -> bool {
        let limit = Vec4::splat(self.bin as f32 + FIRST_INTEGER);
        binning.bins_as_floats(center2).cmplt(limit).bitmask() >> self.axis & 1 == 1
    }
}

/// The contents of each bin, by axis and bin.
#[derive(Clone)]
pub(crate) struct Bins {
    pub boxes: [[Box8; BINS]; 3],
    pub counts: [[u32; BINS]; 3],
}

impl Bins {
    pub const EMPTY: Self = Self { boxes: [[Box8::EMPTY; BINS]; 3], counts: [[0; BINS]; 3] };
}

/// Adds primitives to bins.
pub(crate) fn fill(
    wide: Option<Wide>,
    binning: &Binning,
    primitives: &[Primitive],
    bins: &mut Bins,
) {
    match wide {
        Some(wide) => {
            let token = WideToken::from(wide);
            token.run(
                #[inline(always)]
                move || fill_with::<Wide8>(token, binning, primitives, bins),
            );
        }
        None => fill_with::<Portable8>(Portable, binning, primitives, bins),
    }
}

#[inline(always)]
fn fill_with<L: Lanes8>(
    token: L::Token,
    binning: &Binning,
    primitives: &[Primitive],
    bins: &mut Bins,
) {
    for p in primitives {
        let at = binning.bins_of(p.center2());
        for ((boxes, counts), at) in bins.boxes.iter_mut().zip(&mut bins.counts).zip(at) {
            let bin = &mut boxes[at].0;
            L::load(token, bin).max(L::load(token, &p.0.0)).store(bin);
            counts[at] += 1;
        }
    }
}

/// The size of the first part, and for each of the two parts the box around its doubled centres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parts {
    pub first: usize,
    pub centers: [Box8; 2],
}

/// Moves the primitives before the plane to the front. The partition is stable, and has no branch
/// on data, which would be unpredictable.
///
/// # Panics
/// If `scratch` is shorter than the primitives.
pub(crate) fn part(
    wide: Option<Wide>,
    binning: &Binning,
    plane: BinPlane,
    primitives: &mut [Primitive],
    scratch: &mut [Primitive],
) -> Parts {
    match wide {
        Some(wide) => {
            let token = WideToken::from(wide);
            token.run(
                #[inline(always)]
                move || part_with::<Wide8>(token, binning, plane, primitives, scratch),
            )
        }
        None => part_with::<Portable8>(Portable, binning, plane, primitives, scratch),
    }
}

#[inline(always)]
fn part_with<L: Lanes8>(
    token: L::Token,
    binning: &Binning,
    plane: BinPlane,
    primitives: &mut [Primitive],
    scratch: &mut [Primitive],
) -> Parts {
    assert!(scratch.len() >= primitives.len(), "room for all");
    let mut first = 0;
    for i in 0..primitives.len() {
        // Each primitive is written to the next place of both parts, and one of the two writes is
        // later overwritten; the second part goes to scratch memory first.
        let p = L::load(token, &primitives[i].0.0);
        let is_first = plane.is_before(binning, primitives[i].center2());
        // SAFETY: `first <= i`, and `i - first`, the number of primitives in the second part so
        // far, is below the length of `scratch`, which was checked.
        let (to, other) =
            unsafe { (primitives.get_unchecked_mut(first), scratch.get_unchecked_mut(i - first)) };
        p.store(&mut to.0.0);
        p.store(&mut other.0.0);
        first += usize::from(is_first);
    }
    let (a, b) = primitives.split_at_mut(first);
    b.copy_from_slice(&scratch[..b.len()]);
    Parts { first, centers: [centers(a), centers(b)] }
}

#[inline(always)]
fn centers(primitives: &[Primitive]) -> Box8 {
    let (mut low, mut high) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
    for p in primitives {
        let c = p.center2();
        (low, high) = (low.min(c), high.max(c));
    }
    Box8::new(low.truncate(), high.truncate())
}
