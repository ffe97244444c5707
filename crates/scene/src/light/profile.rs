//! Radiant intensity by direction: measured tables (IES files, goniometric pictures) and projected pictures.

use crate::image::Image;
use serde::{Deserialize, Serialize};
use snell_math::{DVec2, DVec3, Rgb};
use std::f64::consts::{PI, TAU};

/// Radiant intensity on a grid of directions, interpolated between them in both angles.
///
/// In the light's own coordinates the polar angle is measured from `+z`, the azimuth from `+x` towards `+y`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenTable")]
pub struct IntensityTable {
    polar: Vec<f64>,
    azimuth: Vec<f64>,
    /// For each azimuth all polar angles.
    values: Vec<Rgb>,
}

#[derive(Deserialize)]
struct WrittenTable {
    polar: Vec<f64>,
    azimuth: Vec<f64>,
    values: Vec<Rgb>,
}

impl TryFrom<WrittenTable> for IntensityTable {
    type Error = &'static str;

    fn try_from(WrittenTable { polar, azimuth, values }: WrittenTable) -> Result<Self, Self::Error> {
        Self::new(polar, azimuth, values).ok_or(
            "a table of intensities has ascending polar angles from 0 to pi, one azimuth or ascending ones from 0 to a full turn, \
             and a value for each pair",
        )
    }
}

impl IntensityTable {
    /// A table over ascending polar angles in `[0, pi]` and azimuths, in radians: either one (the same all around), or ascending from
    /// 0 to a full turn. `values` holds the intensities of all polar angles for the first azimuth, then for the next; outside of the
    /// polar angles there is no light. Negative or undefined values count as 0. `None` if the angles or the counts are not so.
    pub fn new(polar: Vec<f64>, azimuth: Vec<f64>, values: Vec<Rgb>) -> Option<Self> {
        let ascending = |angles: &[f64]| angles.windows(2).all(|w| w[0] < w[1]) && angles.iter().all(|a| a.is_finite());
        let closed = |a: &[f64]| a.len() == 1 || (a[0].abs() < 1e-6 && (a[a.len() - 1] - TAU).abs() < 1e-4);
        let usable = !polar.is_empty()
            && !azimuth.is_empty()
            && ascending(&polar)
            && ascending(&azimuth)
            && polar[0] >= 0.0
            && polar[polar.len() - 1] <= PI + 1e-6
            && closed(&azimuth)
            && values.len() == polar.len() * azimuth.len();
        let sane = |x: f32| if x > 0.0 && x.is_finite() { x } else { 0.0 };
        usable.then(|| Self { polar, azimuth, values: values.into_iter().map(|v| v.map(sane)).collect() })
    }

    /// A latitude-longitude picture: row 0 is around `+z`, columns go around from `+x` towards `+y`.
    pub fn from_picture(image: &Image) -> Option<Self> {
        let (w, h) = (image.width, image.height);
        let polar = (0..h).map(|y| (f64::from(y) + 0.5) / f64::from(h) * PI);
        // Closed at the poles and around.
        let polar: Vec<f64> = std::iter::once(0.0).chain(polar).chain([PI]).collect();
        let azimuth: Vec<f64> = (0..=w).map(|x| f64::from(x) / f64::from(w) * TAU).collect();
        let texel = |x: u32, y: u32| {
            let [r, g, b, _] = image.rgba(x % w, y);
            Rgb::new(r, g, b)
        };
        // The angles of a column's middle are half a column on: blend two columns for its edge.
        let edge = |x: u32, y: u32| (texel(x % w, y) + texel((x + w - 1) % w, y)) * 0.5;
        let rows = |x: u32| (0..h + 2).map(move |y| edge(x, y.saturating_sub(1).min(h - 1)));
        if w == 0 || h == 0 {
            return None;
        }
        Self::new(polar, azimuth, (0..=w).flat_map(rows).collect())
    }

    /// The intensity in a unit direction of the light's coordinates.
    pub fn at(&self, direction: DVec3) -> Rgb {
        let polar = direction.z.clamp(-1.0, 1.0).acos();
        let azimuth = direction.y.atan2(direction.x);
        let Some((row, t)) = interval(&self.polar, polar) else { return Rgb::BLACK };
        let (column, s) =
            interval(&self.azimuth, if azimuth < 0.0 { azimuth + TAU } else { azimuth }).unwrap_or((0, 0.0));
        let value = |column: usize| {
            let start = column.min(self.azimuth.len() - 1) * self.polar.len();
            let next = (row + 1).min(self.polar.len() - 1);
            self.values[start + row] * (1.0 - t) + self.values[start + next] * t
        };
        value(column) * (1.0 - s) + value(column + 1) * s
    }

    /// The greatest polar angle in which there is light, in radians.
    pub fn widest(&self) -> f64 {
        let rows = self.polar.len();
        let lit = (0..rows).rev().find(|&row| self.values.iter().skip(row).step_by(rows).any(|v| !v.is_black()));
        lit.map_or(0.0, |row| self.polar[(row + 1).min(rows - 1)])
    }

    /// Integral of the luminance of the intensity over all directions.
    pub fn power(&self) -> f64 {
        let (rows, columns) = (256, 128);
        let mut sum = 0.0;
        for i in 0..rows {
            let cos = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(rows);
            let sin = (1.0 - cos * cos).sqrt();
            for k in 0..columns {
                let (s, c) = ((f64::from(k) + 0.5) / f64::from(columns) * TAU).sin_cos();
                sum += f64::from(self.at(DVec3::new(sin * c, sin * s, cos)).luminance());
            }
        }
        sum * 2.0 * TAU / f64::from(rows * columns)
    }
}

/// The interval that holds an angle and the place in it, in `[0, 1]`; `None` outside.
fn interval(angles: &[f64], angle: f64) -> Option<(usize, f32)> {
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    if angles.len() == 1 {
        return Some((0, 0.0));
    }
    if !(angle >= first - 1e-9 && angle <= last + 1e-6) {
        return None;
    }
    let i = angles.partition_point(|&a| a <= angle).clamp(1, angles.len() - 1) - 1;
    Some((i, ((angle - angles[i]) / (angles[i + 1] - angles[i])).clamp(0.0, 1.0) as f32))
}

/// A picture thrown by a lamp: radiant intensity by the direction's place in the picture, linear between texels, 0 outside.
///
/// In the light's own coordinates the picture is seen along `+z` from the lamp, `+x` to its right and `+y` up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenSlide")]
pub struct Slide {
    width: u32,
    height: u32,
    values: Vec<Rgb>,
    /// Half of the picture's width and height at distance 1.
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

    fn try_from(WrittenSlide { width, height, values, half_size }: WrittenSlide) -> Result<Self, Self::Error> {
        Self::of_values(width, height, values, half_size)
            .ok_or("a slide has width times height values, at least one, and a positive half_size")
    }
}

impl Slide {
    /// A picture of this half width and height at distance 1. `None` if the picture is empty or a size not positive.
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
        usable.then(|| Self { width, height, values: values.into_iter().map(|v| v.map(sane)).collect(), half_size })
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

    /// Half-angle of the cone around the picture.
    pub fn widest(&self) -> f64 {
        self.half_size.length().atan()
    }

    /// Integral of the luminance of the intensity over all directions.
    pub fn power(&self) -> f64 {
        let n = 128;
        let mut sum = 0.0;
        for i in 0..n * n {
            let u = (DVec2::new(f64::from(i % n), f64::from(i / n)) + 0.5) / f64::from(n) * 2.0 - 1.0;
            let p = (u * self.half_size).extend(1.0);
            // The solid angle of a patch of the plane at distance 1.
            sum += f64::from(self.at(p.normalize()).luminance()) / p.length().powi(3);
        }
        sum * 4.0 * self.half_size.x * self.half_size.y / f64::from(n * n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(x: f32) -> Rgb {
        Rgb::splat(x)
    }

    #[test]
    fn a_table_is_linear_between_its_angles_and_dark_outside() {
        let polar = [0.0, 0.5, 1.0].to_vec();
        let table = IntensityTable::new(polar, vec![0.0], vec![grey(4.0), grey(2.0), grey(0.0)]).expect("a table");
        let at = |angle: f64| table.at(DVec3::new(0.0, angle.sin(), angle.cos())).r;
        assert!((at(0.25) - 3.0).abs() < 1e-6 && (at(0.75) - 1.0).abs() < 1e-6 && at(1.2) == 0.0 && at(PI) == 0.0);
        assert!((table.widest() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn azimuths_go_from_x_to_y() {
        let azimuth = vec![0.0, TAU / 4.0, TAU / 2.0, 0.75 * TAU, TAU];
        let values = [1.0, 2.0, 3.0, 4.0, 1.0].iter().flat_map(|&v| [grey(v); 2]).collect();
        let table = IntensityTable::new(vec![0.0, PI], azimuth, values).expect("a table");
        let found = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y].map(|d| table.at(d).r);
        assert_eq!(found, [1.0, 2.0, 3.0, 4.0]);
        assert!((table.at(DVec3::new(1.0, 1.0, 0.0).normalize()).r - 1.5).abs() < 1e-6);
        assert!((table.power() - 2.5 * 2.0 * TAU).abs() < 1e-3);
    }

    #[test]
    fn a_uniform_picture_shines_alike_everywhere() {
        let image = Image::from_f32(5, 3, 3, vec![2.0; 45]);
        let table = IntensityTable::from_picture(&image).expect("a table");
        for d in [DVec3::Z, DVec3::NEG_Z, DVec3::new(0.6, -0.48, 0.64)] {
            assert!((table.at(d).g - 2.0).abs() < 1e-6);
        }
        assert!((table.power() / (4.0 * TAU) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn tables_that_make_no_sense_are_refused() {
        let value = || vec![grey(1.0); 2];
        assert!(IntensityTable::new(vec![1.0, 0.0], vec![0.0], value()).is_none());
        assert!(IntensityTable::new(vec![0.0, 4.0], vec![0.0], value()).is_none());
        assert!(IntensityTable::new(vec![0.0, 1.0], vec![0.0, 1.0], vec![grey(1.0); 4]).is_none());
        assert!(IntensityTable::new(vec![0.0, 1.0], vec![0.0], vec![grey(1.0); 3]).is_none());
        assert!(IntensityTable::new(vec![], vec![0.0], vec![]).is_none());
    }

    #[test]
    fn a_slide_is_upright_and_ends_at_its_border() {
        let values = vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        let slide = Slide::new(&Image::from_f32(2, 2, 3, values), DVec2::new(1.0, 0.5)).expect("a slide");
        let at = |x: f64, y: f64| slide.at(DVec3::new(x, y, 1.0).normalize()).to_array();
        assert_eq!(at(-0.9, 0.45), [1.0, 0.0, 0.0]);
        assert_eq!(at(0.9, 0.45), [0.0, 1.0, 0.0]);
        assert_eq!(at(-0.9, -0.45), [0.0, 0.0, 1.0]);
        assert_eq!(at(1.01, 0.0), [0.0; 3]);
        assert_eq!(slide.at(DVec3::NEG_Z), Rgb::BLACK);
        let white = Slide::new(&Image::from_f32(1, 1, 3, vec![1.0; 3]), DVec2::ONE).expect("a slide");
        // One side of a cube.
        assert!((white.power() / (2.0 * TAU / 6.0) - 1.0).abs() < 1e-3, "{}", white.power());
    }
}
