//! Photometric files of the Illuminating Engineering Society (IES LM-63, `.ies`): the luminous
//! intensity of a luminaire by angle.
//!
//! The reader supports photometry of type C (nearly all files), B (floodlights) and A (headlamps)
//! with any of their symmetries, in absolute candela, times the file's candela multiplier and
//! ballast factor. Keywords, lamp tilt and the size of the luminaire are ignored: it is a point.

use crate::error::{Place, ReadError};
use crate::input::Input;
use snell_math::Rgb;
use snell_math::real;
use snell_scene::light::IntensityTable;
use std::f64::consts::{PI, TAU};

const REMEDY: &str = "export the luminaire again as IES LM-63 with type C photometry";

/// Steps of the polar angle, and of the azimuth, in tables made of type A and B photometry.
const STEPS: [u32; 2] = [180, 180];

/// Reads a table of intensities in candela. Polar angle 0 is the axis of the luminaire (straight
/// down where it hangs); azimuths are its horizontal angles. Of types A and B, positive vertical
/// angles lean towards azimuth 0 and positive horizontal ones, which go clockwise, towards azimuth
/// -90 degrees, as `EXT_lights_ies` says.
pub fn read_ies(input: &Input) -> Result<IntensityTable, ReadError> {
    let text = String::from_utf8_lossy(&input.bytes);
    let mut numbers = Numbers::new(input, &text)?;
    let header = Header::read(&mut numbers)?;
    let vertical = numbers.take(header.vertical, "vertical angle")?;
    let horizontal = numbers.take(header.horizontal, "horizontal angle")?;
    let candela = numbers.take(header.vertical * header.horizontal, "intensity")?;
    let columns: Vec<&[f64]> = candela.chunks(header.vertical).collect();
    if header.photometry != Photometry::C {
        let flat = Flat::new(vertical, horizontal, candela).ok_or_else(|| {
            let problem = "its angles must ascend from 0 or -90 to at most 90 degrees";
            input.error(Place::Whole, problem, REMEDY)
        })?;
        return flat
            .table(header.photometry, header.factor)
            .ok_or_else(|| input.error(Place::Whole, "its intensities are not numbers", REMEDY));
    }
    let (azimuths, order) = around(&horizontal).ok_or_else(|| {
        let problem = "the horizontal angles must ascend from 0 to 0, 90, 180 or 360 degrees, or \
            from 90 to 270";
        input.error(Place::Whole, problem, REMEDY)
    })?;
    let grey = |cd: f64| Rgb::splat((cd * header.factor) as f32);
    let values = order.iter().flat_map(|&k| columns[k].iter().map(|&cd| grey(cd))).collect();
    let polar = vertical.iter().map(|a| a.to_radians()).collect();
    let azimuths = azimuths.iter().map(|a: &f64| a.to_radians()).collect();
    IntensityTable::new(polar, azimuths, values).ok_or_else(|| {
        input.error(
            Place::Whole,
            "the vertical angles must ascend within 0 and 180 degrees",
            REMEDY,
        )
    })
}

/// The azimuths of the full circle in degrees, each with the index of the given angle whose
/// intensities it repeats. `None` for angles that are not ascending or cover none of the standard's
/// ranges.
fn around(horizontal: &[f64]) -> Option<(Vec<f64>, Vec<usize>)> {
    let (first, last) = (*horizontal.first()?, *horizontal.last()?);
    if horizontal.len() == 1 {
        return Some((vec![0.0], vec![0]));
    }
    if horizontal.windows(2).any(|w| w[0] >= w[1]) {
        return None;
    }
    let near = |a: f64, b: f64| (a - b).abs() < 0.01;
    let given = horizontal.iter().copied().enumerate();
    // Each given angle is followed by its images in the planes of symmetry.
    let mut all: Vec<(f64, usize)> = match (first, last) {
        (f, l) if near(f, 0.0) && near(l, 90.0) => {
            given.flat_map(|(k, a)| [a, 180.0 - a, 180.0 + a, 360.0 - a].map(|a| (a, k))).collect()
        }
        (f, l) if near(f, 0.0) && near(l, 180.0) => {
            given.flat_map(|(k, a)| [a, 360.0 - a].map(|a| (a, k))).collect()
        }
        (f, l) if near(f, 90.0) && near(l, 270.0) => given
            .flat_map(|(k, a)| [a, (540.0 - a) % 360.0].map(|a| (a, k)))
            .chain([(360.0, opposite(horizontal))])
            .collect(),
        // The last plane may repeat the first or be omitted.
        (f, l) if near(f, 0.0) && l > 180.0 && l < 360.01 => {
            given.map(|(k, a)| (a, k)).chain([(360.0, 0)]).collect()
        }
        _ => return None,
    };
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.dedup_by(|a, b| near(a.0, b.0));
    let end = all.len() - 1;
    (all[0].0, all[end].0) = (0.0, 360.0);
    Some(all.into_iter().unzip())
}

/// The index of the angle nearest to 180 degrees. In luminaires that are symmetric about the plane
/// through 90 and 270 degrees, the intensities at 0 and 360 degrees are those at 180 degrees.
fn opposite(horizontal: &[f64]) -> usize {
    (0..horizontal.len())
        .min_by(|&a, &b| (horizontal[a] - 180.0).abs().total_cmp(&(horizontal[b] - 180.0).abs()))
        .unwrap_or(0)
}

/// The coordinates of a file's angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Photometry {
    /// Polar angles from the axis, and azimuths about it.
    C,
    /// Vertical angles about a horizontal axis, and horizontal ones towards it.
    B,
    /// Horizontal angles about a vertical axis, and vertical ones towards it.
    A,
}

/// Intensities by horizontal and vertical angles in degrees, both 0 along the axis.
struct Flat {
    vertical: Vec<f64>,
    horizontal: Vec<f64>,
    /// All vertical angles of the first horizontal one, then those of the next.
    candela: Vec<f64>,
}

impl Flat {
    /// `None` if the angles do not ascend within -90 and 90 degrees.
    fn new(vertical: Vec<f64>, horizontal: Vec<f64>, candela: Vec<f64>) -> Option<Self> {
        let is_fine = |angles: &[f64]| {
            angles.windows(2).all(|w| w[0] < w[1])
                && angles.iter().all(|a| (-90.01..=90.01).contains(a))
        };
        (is_fine(&vertical) && is_fine(&horizontal)).then_some(Self {
            vertical,
            horizontal,
            candela,
        })
    }

    /// The table over polar angles and azimuths.
    fn table(&self, photometry: Photometry, factor: f64) -> Option<IntensityTable> {
        let angles = |steps: u32, end: f64| -> Vec<f64> {
            (0..=steps).map(|i| f64::from(i) / f64::from(steps) * end).collect()
        };
        let (polar, azimuths) = (angles(STEPS[0], PI), angles(STEPS[1], TAU));
        let mut values = Vec::with_capacity(polar.len() * azimuths.len());
        for &azimuth in &azimuths {
            for &polar in &polar {
                let ((sin, z), (s, c)) = (real::sin_cos(polar), real::sin_cos(azimuth));
                // Up is azimuth 0, and right, as seen along the axis, azimuth -90 degrees.
                let (up, right) = (sin * c, -sin * s);
                let [vertical, horizontal] = match photometry {
                    Photometry::A => [real::asin(up.clamp(-1.0, 1.0)), real::atan2(right, z)],
                    _ => [real::atan2(up, z), real::asin(right.clamp(-1.0, 1.0))],
                };
                let candela = self.at(vertical.to_degrees(), horizontal.to_degrees());
                values.push(Rgb::splat((candela * factor) as f32));
            }
        }
        IntensityTable::new(polar, azimuths, values)
    }

    /// The intensity, linear between the angles; those that begin at 0 are mirrored.
    fn at(&self, vertical: f64, horizontal: f64) -> f64 {
        let place = |angles: &[f64], angle: f64| {
            let angle = if angles[0] >= 0.0 { angle.abs() } else { angle };
            let last = angles.len() - 1;
            let is_inside = (angles[0] - 1e-6..=angles[last] + 1e-6).contains(&angle);
            let next = angles.partition_point(|a| *a <= angle).clamp(usize::from(last > 0), last);
            let i = next.saturating_sub(1);
            let width = angles[next] - angles[i];
            let t = if width > 0.0 { ((angle - angles[i]) / width).clamp(0.0, 1.0) } else { 0.0 };
            (is_inside || last == 0).then_some((i, next, t))
        };
        let columns = place(&self.horizontal, horizontal);
        let (Some((v0, v1, t)), Some((h0, h1, s))) = (place(&self.vertical, vertical), columns)
        else {
            return 0.0;
        };
        let rows = self.vertical.len();
        let column =
            |h: usize| self.candela[h * rows + v0] * (1.0 - t) + self.candela[h * rows + v1] * t;
        column(h0) * (1.0 - s) + column(h1) * s
    }
}

/// The fixed numbers before the tables.
struct Header {
    vertical: usize,
    horizontal: usize,
    photometry: Photometry,
    /// A factor on all intensities.
    factor: f64,
}

impl Header {
    fn read(numbers: &mut Numbers) -> Result<Self, ReadError> {
        let fixed = numbers.take(13, "one of the 13 numbers after TILT")?;
        let count = |x: f64, what: &str| {
            let is_count = (1.0..=10_000.0).contains(&x) && x.fract() == 0.0;
            let problem = || format!("the number of {what} angles is {x}, expected 1 to 10000");
            if is_count {
                Ok(x as usize)
            } else {
                Err(numbers.input.error(Place::Whole, problem(), REMEDY))
            }
        };
        let (vertical, horizontal) = (count(fixed[3], "vertical")?, count(fixed[4], "horizontal")?);
        let photometry = match fixed[5] {
            1.0 => Photometry::C,
            2.0 => Photometry::B,
            3.0 => Photometry::A,
            other => {
                let problem =
                    format!("its photometry is of type {other}, expected 1 (C), 2 (B) or 3 (A)");
                return Err(numbers.input.error(Place::Whole, problem, REMEDY));
            }
        };
        Ok(Self { vertical, horizontal, photometry, factor: fixed[2] * fixed[10] })
    }
}

/// The numbers after the TILT line.
struct Numbers<'a> {
    input: &'a Input,
    words: Box<dyn Iterator<Item = (usize, &'a str)> + 'a>,
}

impl<'a> Numbers<'a> {
    fn new(input: &'a Input, text: &'a str) -> Result<Self, ReadError> {
        let tilt = |line: &str| line.trim_start().to_ascii_uppercase().starts_with("TILT");
        let Some(start) = text.lines().position(tilt) else {
            return Err(input.error(
                Place::Whole,
                "it has no line TILT=, so it is not an IES LM-63 file",
                REMEDY,
            ));
        };
        let words = text.lines().enumerate().skip(start + 1).flat_map(|(line, content)| {
            let words =
                content.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
            words.map(move |word| (line + 1, word))
        });
        let mut numbers = Self { input, words: Box::new(words) };
        let includes = text
            .lines()
            .nth(start)
            .is_some_and(|line| line.to_ascii_uppercase().contains("INCLUDE"));
        if includes {
            let pairs = numbers.take(2, "tilt of the lamp")?[1].clamp(0.0, 10_000.0) as usize;
            numbers.take(2 * pairs, "tilt of the lamp")?;
        }
        Ok(numbers)
    }

    fn take(&mut self, count: usize, what: &str) -> Result<Vec<f64>, ReadError> {
        let mut values = Vec::new();
        while values.len() < count {
            let Some((line, word)) = self.words.next() else {
                let problem =
                    format!("it ends where {what} {} of {count} should be", values.len() + 1);
                return Err(self.input.error(Place::Whole, problem, REMEDY));
            };
            match word.parse::<f64>() {
                Ok(x) if x.is_finite() => values.push(x),
                _ => {
                    let problem = format!(
                        "\"{word}\" is not a number, expected {what} {} of {count}",
                        values.len() + 1
                    );
                    return Err(self.input.error(Place::Line(line), problem, REMEDY));
                }
            }
        }
        Ok(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadOptions;
    use snell_math::DVec3;
    use std::path::Path;

    fn read(text: &str) -> Result<IntensityTable, ReadError> {
        read_ies(&Input::from_bytes(
            "lamp.ies",
            text.as_bytes().to_vec(),
            Path::new("."),
            &ReadOptions::default(),
        ))
    }

    fn file(horizontal: &str, candela: &str) -> String {
        let count = horizontal.split_whitespace().count();
        let header = format!(
            "IESNA:LM-63-2002\n[TEST] x\nTILT=NONE\n1 1000 2.0 3 {count} 1 2 0 0 0\n0.5 1.0 60\n"
        );
        format!("{header}0 45 90\n{horizontal}\n{candela}\n")
    }

    fn at(table: &IntensityTable, polar: f64, azimuth: f64) -> f32 {
        let (sin, cos) = polar.to_radians().sin_cos();
        let (s, c) = azimuth.to_radians().sin_cos();
        table.at(DVec3::new(sin * c, sin * s, cos)).r
    }

    #[test]
    fn candela_are_multiplied_by_the_factors_of_the_file() {
        let table = read(&file("0", "100 50,10")).expect("a lamp");
        assert_eq!(
            (at(&table, 0.0, 0.0), at(&table, 45.0, 77.0), at(&table, 100.0, 0.0)),
            (100.0, 50.0, 0.0)
        );
        assert!((at(&table, 67.5, 10.0) - 30.0).abs() < 1e-3);
    }

    #[test]
    fn every_symmetry_is_unfolded() {
        let quadrant = read(&file("0 90", "9 1 1  9 3 3")).expect("a lamp");
        let sides = [0.0, 90.0, 180.0, 270.0].map(|a| at(&quadrant, 45.0, a));
        assert_eq!(sides, [1.0, 3.0, 1.0, 3.0]);
        let half = read(&file("0 90 180", "9 1 1  9 3 3  9 5 5")).expect("a lamp");
        assert_eq!([0.0, 90.0, 180.0, 270.0].map(|a| at(&half, 45.0, a)), [1.0, 3.0, 5.0, 3.0]);
        let other = read(&file("90 180 270", "9 1 1  9 3 3  9 5 5")).expect("a lamp");
        assert_eq!([0.0, 90.0, 180.0, 270.0].map(|a| at(&other, 45.0, a)), [3.0, 1.0, 3.0, 5.0]);
        for last in ["0 90 180 270 360", "0 90 180 270"] {
            let full = read(&file(last, "9 1 1  9 2 2  9 3 3  9 4 4  9 1 1")).expect("a lamp");
            let sides = [0.0, 90.0, 180.0, 270.0, 315.0].map(|a| at(&full, 45.0, a).round());
            assert_eq!(sides[..4], [1.0, 2.0, 3.0, 4.0], "{last}");
            assert!((at(&full, 45.0, 315.0) - 2.5).abs() < 1e-3);
        }
    }

    #[test]
    fn types_a_and_b_have_angles_up_and_to_the_right() {
        // The beam of a lamp at 30 degrees up and 40 to the right, as each type means it.
        let lamp = |photometry: &str, horizontal: &str, candela: &str| {
            read(
                &file(horizontal, candela)
                    .replace(" 1 2 0 0 0", &format!(" {photometry} 2 0 0 0"))
                    .replace("0 45 90\n", "-90 30 90\n"),
            )
            .expect("a lamp")
        };
        let candela = "0 0 0  0 70 0  0 0 0";
        let (up, right, along) = (DVec3::X, DVec3::NEG_Y, DVec3::Z);
        let [(sv, cv), (sh, ch)] = [30f64, 40.0].map(|a| a.to_radians().sin_cos());
        let b = (along * cv + up * sv) * ch + right * sh;
        let a = (along * ch + right * sh) * cv + up * sv;
        for (photometry, beam, other) in [("2", b, a), ("3", a, b)] {
            let table = lamp(photometry, "-90 40 90", candela);
            assert!((table.at(beam).r - 70.0).abs() < 3.0, "{}", table.at(beam).r);
            assert!(table.at(other).r < 68.0 && table.at(-beam).r == 0.0);
            // Mirrored about the vertical plane.
            let half = lamp(photometry, "0 40 90", candela);
            for side in [1.0, -1.0] {
                let at = half.at(beam * DVec3::new(1.0, side, 1.0)).r;
                assert!((at - 70.0).abs() < 3.0, "{at}");
            }
        }
    }

    #[test]
    fn an_included_tilt_is_skipped() {
        let text = file("0", "100 50 10").replace("TILT=NONE", "TILT=INCLUDE\n1\n2\n0 90\n1.0 0.9");
        assert_eq!(at(&read(&text).expect("a lamp"), 0.0, 0.0), 100.0);
    }

    #[test]
    fn broken_files_are_clear_errors() {
        for (text, expected) in [
            ("".to_string(), "lamp.ies: it has no line TILT="),
            (file("0", "100 50"), "lamp.ies: it ends where intensity 3 of 3 should be"),
            (file("0", "100 x 5"), "lamp.ies:8: \"x\" is not a number, expected intensity 2 of 3"),
            (
                file("0", "1 2 3").replace("1 1 2 0", "1 4 2 0"),
                "lamp.ies: its photometry is of type 4",
            ),
            (
                file("0", "1 2 3").replace("2.0 3", "2.0 1e9"),
                "lamp.ies: the number of vertical angles is 1000000000",
            ),
            (file("0 77", "1 2 3 4 5 6"), "lamp.ies: the horizontal angles must ascend"),
            (
                file("0", "1 2 3").replace("0 45 90", "0 45 40"),
                "lamp.ies: the vertical angles must ascend",
            ),
        ] {
            let error = read(&text).expect_err("a broken file").to_string();
            assert!(error.starts_with(expected) && error.contains(REMEDY), "{error}");
        }
    }
}
