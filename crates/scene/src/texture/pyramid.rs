//! Mip maps: an image at its own resolution and at ever coarser ones, filtered in linear light.

use super::Wrap;
use crate::image::{Encoding, Image, Pixels};
use snell_math::Vec2;
use std::sync::Arc;

/// Linear values of the 256 codes of an 8-bit channel.
type Decode = [f32; 256];

/// How the texels of a level are stored.
#[derive(Debug)]
enum Texels {
    /// The image itself, as it came.
    Stored(Arc<Image>),
    /// Linear values as 0 to 65535, for images whose values lie in `[0, 1]`.
    Linear16(Vec<u16>),
    /// Linear values.
    Linear32(Vec<f32>),
}

/// One resolution.
#[derive(Debug)]
struct Level {
    width: u32,
    height: u32,
    texels: Texels,
}

/// An image in one encoding, ready for lookups. Level 0 is the image; each further level has half the size (rounded down, at least 1).
#[derive(Debug)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
    channels: usize,
    encoding: Encoding,
    decode: Box<Decode>,
}

impl Pyramid {
    /// Builds all levels. `None` if the image does not hold as many values as its size says, or none.
    pub(super) fn new(image: &Arc<Image>, encoding: Encoding, with_levels: bool) -> Option<Self> {
        let values = u64::from(image.width) * u64::from(image.height) * u64::from(image.channels);
        let stored = match &image.pixels {
            Pixels::U8(v) => v.len(),
            Pixels::U16(v) => v.len(),
            Pixels::F32(v) => v.len(),
        };
        if values == 0
            || values != stored as u64
            || image.channels > 4
            || image.width.max(image.height) > i32::MAX as u32
        {
            return None;
        }
        let decode = Box::new(std::array::from_fn(|i| decoded(i as f32 / 255.0, encoding)));
        let full = Level { width: image.width, height: image.height, texels: Texels::Stored(image.clone()) };
        let mut pyramid = Self { levels: vec![full], channels: image.channels as usize, encoding, decode };
        if with_levels {
            pyramid.build_levels(matches!(image.pixels, Pixels::F32(_)));
        }
        Some(pyramid)
    }

    fn build_levels(&mut self, is_float: bool) {
        let mut finer: Option<Vec<f32>> = None;
        let (mut width, mut height) = (self.levels[0].width, self.levels[0].height);
        while width.max(height) > 1 {
            let size = ((width / 2).max(1), (height / 2).max(1));
            let coarser = match &finer {
                None => self.halve((width, height), size, |x, y, c| self.stored(0, x, y, c)),
                Some(v) => self.halve((width, height), size, |x, y, c| {
                    v[(y as usize * width as usize + x as usize) * self.channels + c]
                }),
            };
            (width, height) = size;
            let texels = if is_float {
                Texels::Linear32(coarser.clone())
            } else {
                Texels::Linear16(coarser.iter().map(|x| (x * 65535.0 + 0.5) as u16).collect())
            };
            self.levels.push(Level { width, height, texels });
            finer = Some(coarser);
        }
    }

    /// Half the resolution by an exact box filter: where the size is odd, texels count by the share that is covered.
    fn halve(&self, from: (u32, u32), to: (u32, u32), texel: impl Fn(u32, u32, usize) -> f32) -> Vec<f32> {
        let columns: Vec<_> = (0..to.0).map(|x| coverage(x, from.0, to.0)).collect();
        let mut out = Vec::with_capacity(to.0 as usize * to.1 as usize * self.channels);
        for y in 0..to.1 {
            let rows = coverage(y, from.1, to.1);
            for (x0, wx) in &columns {
                for c in 0..self.channels {
                    let mut sum = 0.0;
                    for (dy, wy) in rows.1.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                        for (dx, wx) in wx.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                            sum += wx * wy * texel(x0 + dx as u32, rows.0 + dy as u32, c);
                        }
                    }
                    out.push(sum);
                }
            }
        }
        out
    }

    pub(super) fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Width and height of level 0.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.levels[0].width, self.levels[0].height)
    }

    /// Bytes of the coarser levels; the image itself belongs to the scene.
    pub(super) fn bytes(&self) -> usize {
        let of = |level: &Level| match &level.texels {
            Texels::Stored(_) => 0,
            Texels::Linear16(v) => v.len() * 2,
            Texels::Linear32(v) => v.len() * 4,
        };
        self.levels.iter().map(of).sum()
    }

    /// One linear value, always finite.
    #[inline]
    fn stored(&self, level: usize, x: u32, y: u32, channel: usize) -> f32 {
        let level = &self.levels[level];
        let i = (y as usize * level.width as usize + x as usize) * self.channels + channel;
        let is_color = self.channels >= 3 && channel < 3 || channel == 0;
        match &level.texels {
            Texels::Linear16(v) => f32::from(v[i]) * (1.0 / 65535.0),
            Texels::Linear32(v) => v[i],
            Texels::Stored(image) => match &image.pixels {
                Pixels::U8(v) if is_color => self.decode[usize::from(v[i])],
                Pixels::U8(v) => f32::from(v[i]) / 255.0,
                Pixels::U16(v) if is_color => decoded(f32::from(v[i]) / 65535.0, self.encoding),
                Pixels::U16(v) => f32::from(v[i]) / 65535.0,
                Pixels::F32(v) if is_color => finite(decoded(finite(v[i]), self.encoding)),
                Pixels::F32(v) => finite(v[i]),
            },
        }
    }

    /// Linear RGB and alpha of a texel; grey spreads to all three, alpha is 1 if absent.
    #[inline]
    pub(super) fn texel(&self, level: usize, x: u32, y: u32) -> [f32; 4] {
        let c = |channel| self.stored(level, x, y, channel);
        match self.channels {
            1 => [c(0), c(0), c(0), 1.0],
            2 => [c(0), c(0), c(0), c(1)],
            3 => [c(0), c(1), c(2), 1.0],
            _ => [c(0), c(1), c(2), c(3)],
        }
    }

    /// Bilinear interpolation in one level. `uv` is finite; texel centres lie at half-integers.
    pub(super) fn bilinear(&self, level: usize, uv: Vec2, wrap: [Wrap; 2]) -> [f32; 4] {
        let Level { width, height, .. } = self.levels[level];
        let (x0, fx) = split(wrap[0].reduce(uv.x) * width as f32 - 0.5);
        let (y0, fy) = split(wrap[1].reduce(uv.y) * height as f32 - 0.5);
        let columns = [wrap[0].index(x0, width), wrap[0].index(x0 + 1, width)];
        let rows = [wrap[1].index(y0, height), wrap[1].index(y0 + 1, height)];
        let at = |i: usize, j: usize| match (columns[i], rows[j]) {
            (Some(x), Some(y)) => self.texel(level, x, y),
            _ => [0.0; 4],
        };
        lerp(lerp(at(0, 0), at(1, 0), fx), lerp(at(0, 1), at(1, 1), fx), fy)
    }

    /// The texel that holds `uv` (finite) in the full image.
    pub(super) fn nearest(&self, uv: Vec2, wrap: [Wrap; 2]) -> [f32; 4] {
        let (width, height) = self.size();
        let x = wrap[0].index((wrap[0].reduce(uv.x) * width as f32).floor() as i32, width);
        let y = wrap[1].index((wrap[1].reduce(uv.y) * height as f32).floor() as i32, height);
        match (x, y) {
            (Some(x), Some(y)) => self.texel(0, x, y),
            _ => [0.0; 4],
        }
    }
}

fn decoded(x: f32, encoding: Encoding) -> f32 {
    match encoding {
        Encoding::Linear => x,
        Encoding::Srgb => snell_math::spectrum::srgb_to_linear(x),
    }
}

/// Undefined pixels become black, infinitely bright ones as bright as half precision can say.
fn finite(x: f32) -> f32 {
    if x.is_finite() {
        x
    } else if x == f32::INFINITY {
        65504.0
    } else {
        0.0
    }
}

/// First source texel that target texel `i` covers, and the shares of it and the two after it; they add up to 1.
fn coverage(i: u32, from: u32, to: u32) -> (u32, [f32; 3]) {
    if from == to {
        return (i, [1.0, 0.0, 0.0]);
    }
    let (i, from_, to_) = (u64::from(i), u64::from(from), u64::from(to));
    // In units of 1 / to of a source texel, exactly.
    let (start, end) = (i * from_, (i + 1) * from_);
    let first = start / to_;
    let share = |k: u64| {
        let (lo, hi) = ((first + k) * to_, (first + k + 1) * to_);
        hi.min(end).saturating_sub(lo.max(start)) as f32 / from_ as f32
    };
    (first as u32, [share(0), share(1), share(2)])
}

/// Integer part, rounded down, and the rest.
fn split(x: f32) -> (i32, f32) {
    let floor = x.floor();
    (floor as i32, x - floor)
}

pub(super) fn lerp(a: [f32; 4], b: [f32; 4], t: f32) -> [f32; 4] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}
