//! The light `projector`, which projects an image.

use super::{Emitter, Incident, LightBounds, aimed, luminance, turned_frame};
use crate::image::Image;
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::{Kind, Value, Visitor};
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb, Vec2, real};
use std::fmt;

snell_math::declare! {
    /// Light from a point that projects an image, with the inverse square law.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Projector {
        /// Position of the light.
        #[unit("scene units")]
        pub position: DVec3,
        /// Rotation of the slide's coordinates into the world; the light projects along their `+z`.
        pub world_from_light: DMat3,
        /// Factor on the intensities of the slide.
        #[range(LIGHT)]
        pub scale: Rgb,
        /// True if the slide lights a plane across its axis as evenly as it is itself: its values
        /// are then the intensity along the axis, over the cube of the cosine in other directions.
        #[serde(default)]
        pub even: bool,
        /// Radiant intensity by direction, W / sr.
        pub slide: Slide,
    }
}

impl Projector {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let picture = Image::from_f32(2, 2, 3, (0..12).map(|i| (i % 5) as f32).collect());
        let slide = Slide::new(&picture, DVec2::new(0.8, 0.5));
        let position = DVec3::new(0.5, 3.0, 1.0);
        // The light shines downwards.
        let world_from_light = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y);
        let scale = Rgb::new(2.0, 1.5, 1.0);
        let with = |slide, even| Self { position, world_from_light, scale, even, slide };
        slide
            .into_iter()
            .flat_map(|slide| [with(slide.clone(), false), with(slide, true)])
            .collect()
    }
}

impl Emitter for Projector {
    fn color(&self) -> Rgb {
        self.scale
    }

    fn color_mut(&mut self) -> &mut Rgb {
        &mut self.scale
    }

    fn position(&self) -> Option<DVec3> {
        Some(self.position)
    }

    fn transform(&mut self, by: &DAffine3) {
        self.position = by.transform_point3(self.position);
        self.world_from_light = turned_frame(by, self.world_from_light);
    }

    fn sample_li(&self, p: DVec3, _u: Vec2) -> Option<Incident> {
        let intensity = |direction: DVec3| {
            let spread = if self.even { real::powi(direction.z, 3).recip() as f32 } else { 1.0 };
            self.scale * self.slide.at(direction) * spread
        };
        aimed::arriving(p, self.position, &self.world_from_light, intensity)
    }

    fn power(&self, _scene_radius: f64) -> f64 {
        luminance(self.scale) * if self.even { self.slide.flux() } else { self.slide.power() }
    }

    fn bounds(&self) -> Option<LightBounds> {
        let widest = self.slide.widest();
        aimed::bounds(self.position, &self.world_from_light, widest, self.power(1.0))
    }
}

/// A projected image. The radiant intensity in a direction is the value at the direction's position
/// in the image, interpolated linearly between texels, and 0 outside of the image.
///
/// In the light's own coordinates the image is seen along `+z` from the light, with `+x` to the
/// right and `+y` up.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenSlide")]
pub struct Slide {
    width: u32,
    height: u32,
    values: Vec<Rgb>,
    /// Half of the image's width and height at distance 1 from the light.
    half_size: DVec2,
}

#[derive(Deserialize)]
struct WrittenSlide {
    width: u32,
    height: u32,
    values: Vec<Rgb>,
    half_size: DVec2,
}

impl TryFrom<WrittenSlide> for Slide {
    type Error = &'static str;

    fn try_from(
        WrittenSlide { width, height, values, half_size }: WrittenSlide,
    ) -> Result<Self, Self::Error> {
        Self::of_values(width, height, values, half_size)
            .ok_or("a slide has width times height values, at least one, and a positive half_size")
    }
}

/// Writes the size only, since there are many values.
impl fmt::Debug for Slide {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Slide({} x {})", self.width, self.height)
    }
}

impl Value for Slide {
    const KIND: Kind = Kind::Table;

    /// The values were checked when the slide was created.
    fn visit(&self, _: &mut Visitor<'_>) {}
}

impl Slide {
    /// An image with this half width and half height at distance 1. `None` if the image is empty or
    /// a size is not positive.
    pub fn new(image: &Image, half_size: DVec2) -> Option<Self> {
        let texel = |x, y| {
            let [r, g, b, _] = image.rgba(x, y);
            Rgb::new(r, g, b)
        };
        let (width, height) = (image.width, image.height);
        let values = (0..height).flat_map(|y| (0..width).map(move |x| texel(x, y))).collect();
        Self::of_values(width, height, values, half_size)
    }

    fn of_values(width: u32, height: u32, values: Vec<Rgb>, half_size: DVec2) -> Option<Self> {
        let sane = |x: f32| if x > 0.0 && x.is_finite() { x } else { 0.0 };
        let counted = width as usize * height as usize == values.len() && !values.is_empty();
        let usable = counted && half_size.is_finite() && half_size.min_element() > 0.0;
        usable.then(|| Self {
            width,
            height,
            values: values.into_iter().map(|v| v.map(sane)).collect(),
            half_size,
        })
    }

    /// Width and height in texels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Half of the image's width and height at distance 1 from the light.
    pub fn half_size(&self) -> DVec2 {
        self.half_size
    }

    /// The intensity in a unit direction of the light's coordinates.
    pub fn at(&self, direction: DVec3) -> Rgb {
        let place = direction.truncate() / direction.z / self.half_size;
        if !(direction.z > 0.0 && place.abs().max_element() < 1.0) {
            return Rgb::BLACK;
        }
        let x = (place.x * 0.5 + 0.5) * f64::from(self.width) - 0.5;
        let y = (0.5 - place.y * 0.5) * f64::from(self.height) - 0.5;
        let texel = |x: f64, y: f64| {
            let clamp = |v: f64, n: u32| (v.max(0.0) as usize).min(n as usize - 1);
            self.values[clamp(y, self.height) * self.width as usize + clamp(x, self.width)]
        };
        let (s, t) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
        let row = |y: f64| texel(x.floor(), y) * (1.0 - s) + texel(x.floor() + 1.0, y) * s;
        row(y.floor()) * (1.0 - t) + row(y.floor() + 1.0) * t
    }

    /// Half-angle in radians of the cone around the image.
    pub fn widest(&self) -> f64 {
        real::atan(self.half_size.length())
    }

    /// Power in W: the integral of the luminance of the intensity over all directions.
    pub fn power(&self) -> f64 {
        // The solid angle of a patch of the plane at distance 1.
        self.integral(|distance| real::powi(distance, -3))
    }

    /// Integral of the luminance over the plane at distance 1: the power of a slide that lights it
    /// evenly.
    pub fn flux(&self) -> f64 {
        self.integral(|_| 1.0)
    }

    /// Integral of the luminance over the plane at distance 1, with a weight by the distance from
    /// the light.
    fn integral(&self, weight: impl Fn(f64) -> f64) -> f64 {
        let n = 128;
        let mut sum = 0.0;
        for i in 0..n * n {
            let u =
                (DVec2::new(f64::from(i % n), f64::from(i / n)) + 0.5) / f64::from(n) * 2.0 - 1.0;
            let p = (u * self.half_size).extend(1.0);
            sum += f64::from(self.at(p.normalize()).luminance()) * weight(p.length());
        }
        sum * 4.0 * self.half_size.x * self.half_size.y / f64::from(n * n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_slide_is_upright_and_ends_at_its_border() {
        let values = vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        let slide =
            Slide::new(&Image::from_f32(2, 2, 3, values), DVec2::new(1.0, 0.5)).expect("a slide");
        let at = |x: f64, y: f64| slide.at(DVec3::new(x, y, 1.0).normalize()).to_array();
        assert_eq!(at(-0.9, 0.45), [1.0, 0.0, 0.0]);
        assert_eq!(at(0.9, 0.45), [0.0, 1.0, 0.0]);
        assert_eq!(at(-0.9, -0.45), [0.0, 0.0, 1.0]);
        assert_eq!(at(1.01, 0.0), [0.0; 3]);
        assert_eq!(slide.at(DVec3::NEG_Z), Rgb::BLACK);
        let white =
            Slide::new(&Image::from_f32(1, 1, 3, vec![1.0; 3]), DVec2::ONE).expect("a slide");
        // The slide covers one side of a cube.
        assert!((white.power() / (2.0 * TAU / 6.0) - 1.0).abs() < 1e-3, "{}", white.power());
    }
}
