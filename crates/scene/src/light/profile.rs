//! The light `profile`, with a measured intensity by direction: IES files and goniometric images.

use super::{Emitter, Incident, LightBounds, aimed, luminance, turned_frame};
use crate::image::Image;
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::{Kind, Value, Visitor};
use snell_math::{DAffine3, DMat3, DVec3, Rgb, Vec2, real};
use std::f64::consts::{PI, TAU};
use std::fmt;

snell_math::declare! {
    /// Light from a point with an intensity from a table, and with the inverse square law.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Profile {
        /// Position of the light.
        #[unit("scene units")]
        pub position: DVec3,
        /// Rotation of the table's coordinates into the world.
        pub world_from_light: DMat3,
        /// Factor on the intensities of the table.
        #[range(LIGHT)]
        pub scale: Rgb,
        /// Radiant intensity by direction, W / sr.
        pub table: IntensityTable,
    }
}

impl Profile {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let values = [3.0, 5.0, 1.0, 0.0].map(Rgb::splat).to_vec();
        let table = IntensityTable::new(vec![0.0, 0.4, 0.9, 1.2], vec![0.0], values);
        let position = DVec3::new(0.5, 3.0, 1.0);
        // The light shines downwards.
        let world_from_light = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y);
        let scale = Rgb::new(2.0, 1.5, 1.0);
        table.map(|table| Self { position, world_from_light, scale, table }).into_iter().collect()
    }
}

impl Emitter for Profile {
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
        let intensity = |direction| self.scale * self.table.at(direction);
        aimed::arriving(p, self.position, &self.world_from_light, intensity)
    }

    fn power(&self, _scene_radius: f64) -> f64 {
        luminance(self.scale) * self.table.power()
    }

    fn bounds(&self) -> Option<LightBounds> {
        let widest = self.table.widest();
        aimed::bounds(self.position, &self.world_from_light, widest, self.power(1.0))
    }
}

/// Radiant intensity on a grid of directions, interpolated between them in both angles.
///
/// In the light's own coordinates the polar angle is measured from `+z`, the azimuth from `+x`
/// towards `+y`.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "WrittenTable")]
pub struct IntensityTable {
    polar: Vec<f64>,
    azimuth: Vec<f64>,
    /// The intensities of all polar angles for each azimuth.
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

    fn try_from(
        WrittenTable { polar, azimuth, values }: WrittenTable,
    ) -> Result<Self, Self::Error> {
        Self::new(polar, azimuth, values).ok_or(
            "a table of intensities has ascending polar angles from 0 to pi, one azimuth or \
                ascending ones from 0 to a full turn, \
             and a value for each pair",
        )
    }
}

/// Writes the size only, since there are many values.
impl fmt::Debug for IntensityTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "IntensityTable({} x {})", self.polar.len(), self.azimuth.len())
    }
}

impl Value for IntensityTable {
    const KIND: Kind = Kind::Table;

    /// The values were checked when the table was created.
    fn visit(&self, _: &mut Visitor<'_>) {}
}

impl IntensityTable {
    /// A table over polar angles and azimuths, in radians. The polar angles ascend within
    /// `[0, pi]`. The azimuths are either a single one, for a light that is the same all around, or
    /// ascend from 0 to a full turn. `values` holds the intensities of all polar angles for the
    /// first azimuth, then for the next; outside of the polar angles there is no light. Negative or
    /// undefined values count as 0. `None` if the angles or counts do not meet these conditions.
    pub fn new(polar: Vec<f64>, azimuth: Vec<f64>, values: Vec<Rgb>) -> Option<Self> {
        let ascending = |angles: &[f64]| {
            angles.windows(2).all(|w| w[0] < w[1]) && angles.iter().all(|a| a.is_finite())
        };
        let closed =
            |a: &[f64]| a.len() == 1 || (a[0].abs() < 1e-6 && (a[a.len() - 1] - TAU).abs() < 1e-4);
        let usable = !polar.is_empty()
            && !azimuth.is_empty()
            && ascending(&polar)
            && ascending(&azimuth)
            && polar[0] >= 0.0
            && polar[polar.len() - 1] <= PI + 1e-6
            && closed(&azimuth)
            && values.len() == polar.len() * azimuth.len();
        let sane = |x: f32| if x > 0.0 && x.is_finite() { x } else { 0.0 };
        usable.then(|| Self {
            polar,
            azimuth,
            values: values.into_iter().map(|v| v.map(sane)).collect(),
        })
    }

    /// The table of a latitude-longitude image: row 0 is around `+z`, and columns go around from
    /// `+x` towards `+y`. `None` if the image is empty.
    pub fn from_picture(image: &Image) -> Option<Self> {
        let (w, h) = (image.width, image.height);
        let polar = (0..h).map(|y| (f64::from(y) + 0.5) / f64::from(h) * PI);
        // The table is extended to the poles, and closed all around.
        let polar: Vec<f64> = std::iter::once(0.0).chain(polar).chain([PI]).collect();
        let azimuth: Vec<f64> = (0..=w).map(|x| f64::from(x) / f64::from(w) * TAU).collect();
        let texel = |x: u32, y: u32| {
            let [r, g, b, _] = image.rgba(x % w, y);
            Rgb::new(r, g, b)
        };
        // Column centres are half a column away from the edges, so the value at an edge is the mean
        // of the two columns beside it.
        let edge = |x: u32, y: u32| (texel(x % w, y) + texel((x + w - 1) % w, y)) * 0.5;
        let rows = |x: u32| (0..h + 2).map(move |y| edge(x, y.saturating_sub(1).min(h - 1)));
        if w == 0 || h == 0 {
            return None;
        }
        Self::new(polar, azimuth, (0..=w).flat_map(rows).collect())
    }

    /// The intensity in a unit direction of the light's coordinates.
    pub fn at(&self, direction: DVec3) -> Rgb {
        let polar = real::acos(direction.z.clamp(-1.0, 1.0));
        let azimuth = real::atan2(direction.y, direction.x);
        let Some((row, t)) = interval(&self.polar, polar) else { return Rgb::BLACK };
        let (column, s) =
            interval(&self.azimuth, if azimuth < 0.0 { azimuth + TAU } else { azimuth })
                .unwrap_or((0, 0.0));
        let value = |column: usize| {
            let start = column.min(self.azimuth.len() - 1) * self.polar.len();
            let next = (row + 1).min(self.polar.len() - 1);
            self.values[start + row] * (1.0 - t) + self.values[start + next] * t
        };
        value(column) * (1.0 - s) + value(column + 1) * s
    }

    /// The greatest polar angle at which there is light, in radians.
    pub fn widest(&self) -> f64 {
        let rows = self.polar.len();
        let lit = (0..rows)
            .rev()
            .find(|&row| self.values.iter().skip(row).step_by(rows).any(|v| !v.is_black()));
        lit.map_or(0.0, |row| self.polar[(row + 1).min(rows - 1)])
    }

    /// Power in W: the integral of the luminance of the intensity over all directions.
    pub fn power(&self) -> f64 {
        let (rows, columns) = (256, 128);
        let mut sum = 0.0;
        for i in 0..rows {
            let cos = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(rows);
            let sin = (1.0 - cos * cos).sqrt();
            for k in 0..columns {
                let (s, c) = real::sin_cos((f64::from(k) + 0.5) / f64::from(columns) * TAU);
                sum += f64::from(self.at(DVec3::new(sin * c, sin * s, cos)).luminance());
            }
        }
        sum * 2.0 * TAU / f64::from(rows * columns)
    }
}

/// The interval that contains an angle, and the position in the interval, in `[0, 1]`; `None`
/// outside of all intervals.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(x: f32) -> Rgb {
        Rgb::splat(x)
    }

    #[test]
    fn a_table_is_linear_between_its_angles_and_dark_outside() {
        let polar = [0.0, 0.5, 1.0].to_vec();
        let table = IntensityTable::new(polar, vec![0.0], vec![grey(4.0), grey(2.0), grey(0.0)])
            .expect("a table");
        let at = |angle: f64| table.at(DVec3::new(0.0, angle.sin(), angle.cos())).r;
        assert!(
            (at(0.25) - 3.0).abs() < 1e-6
                && (at(0.75) - 1.0).abs() < 1e-6
                && at(1.2) == 0.0
                && at(PI) == 0.0
        );
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
}
