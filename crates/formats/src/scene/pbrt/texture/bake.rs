//! Patterns drawn into pictures.

use super::{Mapping, Pattern, Picture};
use snell_math::{Rgb, Vec2};
use snell_scene::Image;
use snell_scene::texture::{Filtering, Wrap};
use std::sync::Arc;

/// A drawn pattern.
pub struct Baked {
    /// The picture, row 0 at v = `period`.
    pub image: Image,
    /// It covers texture coordinates from 0 to this.
    pub period: f32,
    /// False if the pattern does not repeat there.
    pub repeats: bool,
    /// How to look it up.
    pub filtering: Filtering,
    /// What is outside.
    pub wrap: Wrap,
}

/// Longest period that is tried.
const MAX_PERIOD: u32 = 8;
/// Most pixels along a side.
const MAX_SIZE: f32 = 4096.0;
/// Pixels of a dot's cell.
const DOT_SIZE: f32 = 64.0;

/// Draws a pattern; for scalars the mean of the channels. The picture has at most `pixels` pixels.
pub fn bake(pattern: &Pattern, images: &[Arc<Image>], is_color: bool, pixels: usize) -> Baked {
    let mut facts = Facts::default();
    facts.gather(pattern, images);
    let period = (1..=MAX_PERIOD).find(|p| facts.frequencies.iter().all(|f| is_whole(f * *p as f32)));
    let repeats = period.is_some();
    let period = period.unwrap_or(MAX_PERIOD);
    let [width, height] = facts.resolution.map(|r| (r * period as f32).ceil().clamp(1.0, MAX_SIZE));
    let shrink = (pixels as f32 / (width * height)).sqrt().min(1.0);
    let [width, height] = [width, height].map(|side| ((side * shrink) as u32).max(1));
    let channels = if is_color { 3 } else { 1 };
    let mut values = Vec::with_capacity(width as usize * height as usize * channels as usize);
    for y in 0..height {
        for x in 0..width {
            let u = (x as f32 + 0.5) / width as f32;
            let v = 1.0 - (y as f32 + 0.5) / height as f32;
            let color = value(pattern, Vec2::new(u, v) * period as f32, images);
            let color = color.map(|c| if c.is_finite() { c } else { 0.0 });
            match is_color {
                true => values.extend(color.to_array()),
                false => values.push((color.r + color.g + color.b) / 3.0),
            }
        }
    }
    Baked {
        image: Image::from_f32(width, height, channels, values),
        period: period as f32,
        repeats,
        filtering: if facts.is_smooth { Filtering::Trilinear } else { Filtering::Nearest },
        wrap: if facts.is_bounded && !facts.repeats { Wrap::Clamp } else { Wrap::Repeat },
    }
}

fn is_whole(x: f32) -> bool {
    (x - x.round()).abs() < 1e-4
}

/// What decides about size and period of the picture.
#[derive(Default)]
struct Facts {
    /// How often patterns repeat in one unit of the coordinates.
    frequencies: Vec<f32>,
    /// Pixels for one unit of the coordinates.
    resolution: [f32; 2],
    /// True if there is anything but checks.
    is_smooth: bool,
    /// True if there is a pattern that does not repeat.
    is_bounded: bool,
    /// True if there is a pattern that repeats.
    repeats: bool,
}

impl Facts {
    fn gather(&mut self, pattern: &Pattern, images: &[Arc<Image>]) {
        match pattern {
            Pattern::Constant(_) => {}
            Pattern::Picture(p) => {
                let image = &images[p.image.index()];
                self.is_smooth |= p.filtering != Filtering::Nearest;
                match p.wrap {
                    Wrap::Repeat | Wrap::Mirror => self.repeat(&p.mapping, 1.0),
                    Wrap::Clamp | Wrap::Black => self.is_bounded = true,
                }
                self.resolve(&p.mapping, [image.width as f32, image.height as f32]);
            }
            Pattern::Product(a, b) => [a, b].into_iter().for_each(|p| self.gather(p, images)),
            Pattern::Mix(of) => of.iter().for_each(|p| self.gather(p, images)),
            Pattern::Checkerboard(of, mapping) => {
                self.repeat(mapping, 0.5);
                // Edges of checks fall on edges of pixels, unless they are shifted.
                let fine = if mapping.offset == Vec2::ZERO && of.iter().all(|p| p.as_constant().is_some()) {
                    1.0
                } else {
                    64.0
                };
                self.is_smooth |= fine > 1.0;
                self.resolve(mapping, [fine; 2]);
                of.iter().for_each(|p| self.gather(p, images));
            }
            Pattern::Bilinear(_, mapping) => {
                self.is_smooth = true;
                self.is_bounded = true;
                self.resolve(mapping, [64.0; 2]);
            }
            Pattern::Dots(of, mapping) => {
                self.is_smooth = true;
                // The dots are scattered by a hash that never repeats; a whole period of them is shown.
                self.repeat(mapping, 1.0);
                self.resolve(mapping, [DOT_SIZE; 2]);
                of.iter().for_each(|p| self.gather(p, images));
            }
            Pattern::Map(of, ..) => self.gather(of, images),
        }
    }

    fn repeat(&mut self, mapping: &Mapping, times: f32) {
        self.repeats = true;
        self.frequencies.extend([mapping.scale.x.abs() * times, mapping.scale.y.abs() * times]);
    }

    fn resolve(&mut self, mapping: &Mapping, pixels: [f32; 2]) {
        let scale = mapping.scale.abs();
        self.resolution = [self.resolution[0].max(pixels[0] * scale.x), self.resolution[1].max(pixels[1] * scale.y)];
    }
}

impl Mapping {
    /// The pattern's own coordinates.
    fn apply(&self, uv: Vec2) -> Vec2 {
        let st = uv * self.scale + self.offset;
        if st.is_finite() { st } else { Vec2::ZERO }
    }
}

/// The value of a pattern at texture coordinates of pbrt.
fn value(pattern: &Pattern, uv: Vec2, images: &[Arc<Image>]) -> Rgb {
    let of = |pattern: &Pattern| value(pattern, uv, images);
    match pattern {
        Pattern::Constant(color) => *color,
        Pattern::Picture(picture) => picture.value(uv, &images[picture.image.index()]),
        Pattern::Product(a, b) => of(a) * of(b),
        Pattern::Mix([a, b, t]) => {
            let t = of(t);
            of(a) * t.map(|t| 1.0 - t) + of(b) * t
        }
        Pattern::Checkerboard([first, second], mapping) => {
            let cell = mapping.apply(uv).floor();
            if (cell.x + cell.y).rem_euclid(2.0) == 0.0 { of(first) } else { of(second) }
        }
        Pattern::Bilinear([v00, v01, v10, v11], mapping) => {
            let st = mapping.apply(uv);
            let left = *v00 * (1.0 - st.y) + *v01 * st.y;
            let right = *v10 * (1.0 - st.y) + *v11 * st.y;
            left * (1.0 - st.x) + right * st.x
        }
        Pattern::Dots([inside, outside], mapping) => {
            if is_in_dot(mapping.apply(uv)) {
                of(inside)
            } else {
                of(outside)
            }
        }
        Pattern::Map(pattern, function, constant) => of(pattern).map(|x| function(x, *constant)),
    }
}

/// True within a dot: one in about every other cell, of radius 0.35, at a random place.
fn is_in_dot(st: Vec2) -> bool {
    let cell = (st + 0.5).floor();
    let [has_dot, x, y, _] =
        snell_math::rng::pcg4d([cell.x as i32 as u32, cell.y as i32 as u32, 0, 0]).map(snell_math::rng::to_unit);
    let shift = 0.5 - 0.35;
    let center = cell + Vec2::new(2.0 * x - 1.0, 2.0 * y - 1.0) * shift;
    has_dot < 0.5 && (st - center).length_squared() < 0.35 * 0.35
}

impl Picture {
    /// Bilinear in the full picture.
    fn value(&self, uv: Vec2, image: &Image) -> Rgb {
        let st = self.mapping.apply(uv);
        let (w, h) = (image.width as f32, image.height as f32);
        let wrap = |x: f32| if self.wrap == Wrap::Repeat { x - x.floor() } else { x };
        let (x, y) = (wrap(st.x) * w - 0.5, (1.0 - wrap(st.y)) * h - 0.5);
        if self.filtering == Filtering::Nearest {
            return self.texel(x.round(), y.round(), image);
        }
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let row = |y: f32| self.texel(x.floor(), y, image) * (1.0 - fx) + self.texel(x.floor() + 1.0, y, image) * fx;
        row(y.floor()) * (1.0 - fy) + row(y.floor() + 1.0) * fy
    }

    fn texel(&self, x: f32, y: f32, image: &Image) -> Rgb {
        let index = |i: f32, n: u32| -> Option<u32> {
            let (i, n) = (i as i64, i64::from(n));
            let i = match self.wrap {
                Wrap::Repeat | Wrap::Mirror => i.rem_euclid(n),
                Wrap::Clamp => i.clamp(0, n - 1),
                Wrap::Black if (0..n).contains(&i) => i,
                Wrap::Black => return None,
            };
            Some(i as u32)
        };
        let (Some(x), Some(y)) = (index(x, image.width), index(y, image.height)) else { return Rgb::BLACK };
        let [r, g, b, _] = image.rgba_as(x, y, self.encoding);
        let power = |v: f32| self.gamma.map_or(v, |gamma| v.max(0.0).powf(gamma));
        let shown = |v: f32| if self.invert { 1.0 - power(v) } else { power(v) } * self.scale;
        Rgb::new(shown(r), shown(g), shown(b))
    }
}
