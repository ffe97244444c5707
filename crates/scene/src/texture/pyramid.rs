//! Mip maps: an image at its own resolution and at successively coarser ones, filtered in linear
//! light.

use super::Wrap;
use super::wrap::floor;
use crate::image::{Encoding, Image, Pixels};
use snell_math::{Vec2, Vec4};
use std::sync::Arc;

/// The linear values of the 256 codes of an 8-bit channel.
type Decode = [f32; 256];

/// How the texels of a level are stored.
#[derive(Debug)]
enum Texels {
    /// The image itself, as it was loaded; for level 0.
    Stored(Arc<Image>),
    /// Linear values as 0 to 65535, for images whose values lie in `[0, 1]`.
    Linear16(Vec<u16>),
    /// Linear values as they are.
    Linear32(Vec<f32>),
}

/// One level of the mip map.
#[derive(Debug)]
struct Level {
    width: u32,
    height: u32,
    texels: Texels,
}

/// An image in one encoding, prepared for look-ups. Level 0 is the image; each further level has
/// half the size (rounded down, at least 1).
#[derive(Debug)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
    channels: usize,
    encoding: Encoding,
    decode: Box<Decode>,
}

impl Pyramid {
    /// Builds the levels; only level 0 unless `with_levels` is true. `None` if the number of values
    /// is 0 or does not match the size of the image.
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
        let full = Level {
            width: image.width,
            height: image.height,
            texels: Texels::Stored(image.clone()),
        };
        let mut pyramid =
            Self { levels: vec![full], channels: image.channels as usize, encoding, decode };
        if with_levels {
            pyramid.build_levels(image);
        }
        Some(pyramid)
    }

    fn build_levels(&mut self, image: &Image) {
        let is_float = matches!(image.pixels, Pixels::F32(_));
        let mut finer: Vec<f32> = Vec::new();
        let (mut width, mut height) = self.size();
        while width.max(height) > 1 {
            let to = ((width / 2).max(1), (height / 2).max(1));
            let row_length = width as usize * self.channels;
            let coarser = if self.levels.len() == 1 {
                self.halve((width, height), to, |y, row| self.decode_row(image, y, row))
            } else {
                self.halve((width, height), to, |y, row| {
                    row.copy_from_slice(&finer[y as usize * row_length..][..row_length])
                })
            };
            (width, height) = to;
            let texels = if is_float {
                Texels::Linear32(coarser.clone())
            } else {
                Texels::Linear16(coarser.iter().map(|x| (x * 65535.0 + 0.5) as u16).collect())
            };
            self.levels.push(Level { width, height, texels });
            finer = coarser;
        }
    }

    /// Halves the resolution by an exact box filter. Where the size is odd, texels are weighted by
    /// the fraction that is covered. `read` fills a row with linear values.
    fn halve(&self, from: (u32, u32), to: (u32, u32), read: impl Fn(u32, &mut [f32])) -> Vec<f32> {
        let channels = self.channels;
        let columns: Vec<_> = (0..to.0).map(|x| Coverage::new(x, from.0, to.0)).collect();
        let mut out = vec![0.0; to.0 as usize * to.1 as usize * channels];
        let (mut row, mut sum) =
            (vec![0.0; from.0 as usize * channels], vec![0.0; from.0 as usize * channels]);
        for (y, out) in out.chunks_exact_mut(to.0 as usize * channels).enumerate() {
            sum.fill(0.0);
            for (source, weight) in Coverage::new(y as u32, from.1, to.1).texels() {
                read(source, &mut row);
                sum.iter_mut().zip(&row).for_each(|(sum, x)| *sum += weight * x);
            }
            for (out, column) in out.chunks_exact_mut(channels).zip(&columns) {
                for (source, weight) in column.texels() {
                    let texel = &sum[source as usize * channels..][..channels];
                    out.iter_mut().zip(texel).for_each(|(out, x)| *out += weight * x);
                }
            }
        }
        out
    }

    /// Fills `row` with the linear values of row `y` of the full image.
    fn decode_row(&self, image: &Image, y: u32, row: &mut [f32]) {
        let start = y as usize * row.len();
        for (i, texel) in row.chunks_exact_mut(self.channels).enumerate() {
            for (c, x) in texel.iter_mut().enumerate() {
                let index = start + i * self.channels + c;
                *x = Self::stored(
                    image,
                    &self.decode,
                    self.encoding,
                    index,
                    is_color(c, self.channels),
                );
            }
        }
    }

    pub(super) fn level_count(&self) -> usize {
        self.levels.len()
    }

    /// Width and height of level 0.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.levels[0].width, self.levels[0].height)
    }

    /// Memory use of the coarser levels in bytes. The image itself belongs to the scene.
    pub(super) fn bytes(&self) -> usize {
        let of = |level: &Level| match &level.texels {
            Texels::Stored(_) => 0,
            Texels::Linear16(v) => v.len() * 2,
            Texels::Linear32(v) => v.len() * 4,
        };
        self.levels.iter().map(of).sum()
    }

    /// One value of the full image in linear form, always finite.
    fn stored(image: &Image, decode: &Decode, encoding: Encoding, i: usize, is_color: bool) -> f32 {
        match &image.pixels {
            Pixels::U8(v) if is_color => decode[usize::from(v[i])],
            Pixels::U8(v) => f32::from(v[i]) * (1.0 / 255.0),
            Pixels::U16(v) if is_color => decoded(f32::from(v[i]) * (1.0 / 65535.0), encoding),
            Pixels::U16(v) => f32::from(v[i]) * (1.0 / 65535.0),
            Pixels::F32(v) if is_color => finite(decoded(finite(v[i]), encoding)),
            Pixels::F32(v) => finite(v[i]),
        }
    }

    /// Linear RGB and alpha of a texel. Grey is copied to all three colour channels; alpha is 1 if
    /// absent.
    #[inline]
    pub(super) fn texel(&self, level: usize, x: u32, y: u32) -> [f32; 4] {
        let level = &self.levels[level];
        let start = (y as usize * level.width as usize + x as usize) * self.channels;
        match &level.texels {
            Texels::Stored(image) => spread(self.channels, |c| {
                Self::stored(
                    image,
                    &self.decode,
                    self.encoding,
                    start + c,
                    is_color(c, self.channels),
                )
            }),
            Texels::Linear16(v) => {
                let v = &v[start..start + self.channels];
                spread(v.len(), |c| f32::from(v[c]) * (1.0 / 65535.0))
            }
            Texels::Linear32(v) => {
                let v = &v[start..start + self.channels];
                spread(v.len(), |c| v[c])
            }
        }
    }

    /// The bilinear interpolation in one level. `uv` must be finite and [reduced](Wrap::reduce);
    /// texel centres lie at half-integers.
    pub(super) fn bilinear(&self, level: usize, uv: Vec2, wrap: [Wrap; 2]) -> [f32; 4] {
        let Level { width, height, ref texels } = self.levels[level];
        let (x0, fx) = split(uv.x * width as f32 - 0.5);
        let (y0, fy) = split(uv.y * height as f32 - 0.5);
        let columns = [wrap[0].index(x0, width), wrap[0].index(x0 + 1, width)];
        let rows = [wrap[1].index(y0, height), wrap[1].index(y0 + 1, height)];
        let ([Some(left), Some(right)], [Some(upper), Some(lower)]) = (columns, rows) else {
            let at = |i: usize, j: usize| match (columns[i], rows[j]) {
                (Some(x), Some(y)) => self.texel(level, x, y),
                _ => [0.0; 4],
            };
            return lerp(lerp(at(0, 0), at(1, 0), fx), lerp(at(0, 1), at(1, 1), fx), fy);
        };
        let start = |x: u32, y: u32| (y as usize * width as usize + x as usize) * self.channels;
        let corners = Corners {
            starts: [
                start(left, upper),
                start(right, upper),
                start(left, lower),
                start(right, lower),
            ],
            fx,
            fy,
        };
        // The kind of storage is matched once, not for each number.
        match texels {
            Texels::Stored(image) => match &image.pixels {
                Pixels::U8(v) => corners.mixed(self.channels, |i, is_color| match is_color {
                    true => self.decode[usize::from(v[i])],
                    false => f32::from(v[i]) * (1.0 / 255.0),
                }),
                _ => corners.mixed(self.channels, |i, is_color| {
                    Self::stored(image, &self.decode, self.encoding, i, is_color)
                }),
            },
            Texels::Linear16(v) => match corners.mixed_fours(self.channels, v) {
                Some(rgba) => rgba,
                None => corners.mixed(self.channels, |i, _| f32::from(v[i]) * (1.0 / 65535.0)),
            },
            Texels::Linear32(v) => corners.mixed(self.channels, |i, _| v[i]),
        }
    }

    /// The texel of the full image that contains `uv`, which must be finite.
    pub(super) fn nearest(&self, uv: Vec2, wrap: [Wrap; 2]) -> [f32; 4] {
        let (width, height) = self.size();
        let x = wrap[0].index(floor(wrap[0].reduce(uv.x) * width as f32) as i32, width);
        let y = wrap[1].index(floor(wrap[1].reduce(uv.y) * height as f32) as i32, height);
        match (x, y) {
            (Some(x), Some(y)) => self.texel(0, x, y),
            _ => [0.0; 4],
        }
    }
}

/// The four texels around a point.
struct Corners {
    /// Index of the first value of each texel: left and right above, then left and right below.
    starts: [usize; 4],
    /// Position of the point between the texels, to the right and down, from 0 to 1.
    fx: f32,
    fy: f32,
}

impl Corners {
    /// RGBA at the point for this number of channels. `number` returns the value with an index,
    /// which belongs to a colour channel or to alpha.
    #[inline(always)]
    fn mixed(&self, channels: usize, number: impl Fn(usize, bool) -> f32) -> [f32; 4] {
        let mix = |channel: usize, is_color: bool| {
            let [a, b, c, d] = self.starts;
            let at = |start: usize| number(start + channel, is_color);
            let (upper, lower) = (mixed(at(a), at(b), self.fx), mixed(at(c), at(d), self.fx));
            mixed(upper, lower, self.fy)
        };
        match channels {
            1 => {
                let grey = mix(0, true);
                [grey, grey, grey, 1.0]
            }
            2 => {
                let grey = mix(0, true);
                [grey, grey, grey, mix(1, false)]
            }
            3 => [mix(0, true), mix(1, true), mix(2, true), 1.0],
            _ => [mix(0, true), mix(1, true), mix(2, true), mix(3, false)],
        }
    }

    /// Computes [`Self::mixed`] for all channels at once: three channels are read as four, with the
    /// number that follows. `None` if no number follows, or for fewer than three channels.
    #[inline(always)]
    fn mixed_fours(&self, channels: usize, numbers: &[u16]) -> Option<[f32; 4]> {
        let four = |start: usize| {
            let [r, g, b, a] = (*numbers.get(start..)?.first_chunk()?).map(f32::from);
            Some(Vec4::new(r, g, b, a) * (1.0 / 65535.0))
        };
        if channels < 3 {
            return None;
        }
        let mixed = |a: Vec4, b: Vec4, t: f32| a + (b - a) * t;
        let [a, b, c, d] = self.starts;
        let (upper, lower) =
            (mixed(four(a)?, four(b)?, self.fx), mixed(four(c)?, four(d)?, self.fx));
        let [r, g, b, a] = mixed(upper, lower, self.fy).to_array();
        Some([r, g, b, if channels == 3 { 1.0 } else { a }])
    }
}

/// True for the channels that the encoding applies to, which are all but alpha.
fn is_color(channel: usize, channels: usize) -> bool {
    channel == 0 || (channels >= 3 && channel < 3)
}

/// RGBA of a texel with this number of channels.
#[inline]
fn spread(channels: usize, c: impl Fn(usize) -> f32) -> [f32; 4] {
    match channels {
        1 => [c(0), c(0), c(0), 1.0],
        2 => [c(0), c(0), c(0), c(1)],
        3 => [c(0), c(1), c(2), 1.0],
        _ => [c(0), c(1), c(2), c(3)],
    }
}

fn decoded(x: f32, encoding: Encoding) -> f32 {
    match encoding {
        Encoding::Linear => x,
        Encoding::Srgb => snell_math::spectrum::srgb_to_linear(x),
    }
}

/// `x`, with NaN replaced by 0 and infinite values by the maximum of half precision.
fn finite(x: f32) -> f32 {
    if x.is_finite() {
        x
    } else if x == f32::INFINITY {
        65504.0
    } else {
        0.0
    }
}

/// The source texels that one target texel covers: at most three, with fractions that add up to 1.
struct Coverage {
    first: u32,
    count: usize,
    shares: [f32; 3],
}

impl Coverage {
    fn new(i: u32, from: u32, to: u32) -> Self {
        let (i, from, to) = (u64::from(i), u64::from(from), u64::from(to));
        // The positions are in units of 1 / to of a source texel, so they are exact.
        let (start, end) = (i * from, (i + 1) * from);
        let first = start / to;
        let share = |k: u64| {
            let (lo, hi) = ((first + k) * to, (first + k + 1) * to);
            hi.min(end).saturating_sub(lo.max(start)) as f32 / from as f32
        };
        let shares = [share(0), share(1), share(2)];
        Self { first: first as u32, count: shares.iter().filter(|&&s| s > 0.0).count(), shares }
    }

    fn texels(&self) -> impl Iterator<Item = (u32, f32)> {
        (self.first..).zip(self.shares).take(self.count)
    }
}

/// The integer part, rounded down, and the fractional part.
fn split(x: f32) -> (i32, f32) {
    let whole = floor(x);
    (whole as i32, x - whole)
}

pub(super) fn lerp(a: [f32; 4], b: [f32; 4], t: f32) -> [f32; 4] {
    std::array::from_fn(|i| mixed(a[i], b[i], t))
}

#[inline(always)]
fn mixed(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}
