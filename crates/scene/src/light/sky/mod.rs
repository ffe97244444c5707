//! The sky of a clear day with its sun, as an environment. The sky is the measured and simulated
//! model of Hosek and Wilkie (An Analytic Model for Full Spectral Sky-Dome Radiance, 2012, in its
//! RGB form), with the sun seen through the atmosphere ([`sun`]) and uniform ground below.

mod hosek_wilkie;
mod sun;

use crate::graph::Environment;
use crate::image::Image;
use hosek_wilkie::HosekWilkie;
use snell_math::{DAffine3, DVec3, Rgb, real};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// The sky of a clear day.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Height of the sun above the horizon, degrees, `[0, 90]`.
    pub elevation: f64,
    /// Azimuth of the sun, degrees: 0 is `-z` (the middle of the environment's image), 90 is `+x`.
    pub azimuth: f64,
    /// Haze of the air, `[1, 10]`: 2 is very clear, 3 a clear day, 6 and more hazy.
    pub turbidity: f64,
    /// Reflectance of the ground, `[0, 1]`. It brightens the sky slightly, and the ground is
    /// visible below the horizon.
    pub ground: f64,
    /// Angular diameter of the sun, degrees, `[0, 20]`: 0.53 in nature, more for softer shadows of
    /// the same brightness, 0 for no sun.
    pub sun: f64,
    /// Factor on all radiance. With 1, the unit is `10^5 / pi` cd / m^2, which is the luminance of
    /// a white surface that receives 100,000 lx, full daylight.
    pub scale: f64,
}

impl Default for Sky {
    fn default() -> Self {
        Self { elevation: 35.0, azimuth: 135.0, turbidity: 3.0, ground: 0.2, sun: 0.53, scale: 1.0 }
    }
}

/// A parameter is out of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{parameter} is {found}, expected {least} to {most}")]
pub struct SkyError {
    /// The name of the parameter.
    pub parameter: &'static str,
    /// The value that was given.
    pub found: f64,
    /// The lower end of the range; both ends are included.
    pub least: f64,
    /// The upper end of the range.
    pub most: f64,
}

const SIZE: [u32; 2] = [2048, 1024];
/// The model's unit of luminance, in cd / m^2.
const MODEL_UNIT: f64 = 683.0;
/// The environment's unit of luminance, in cd / m^2.
const UNIT: f64 = 1e5 / PI;

impl Sky {
    /// The parameters by name, with their ranges.
    pub const PARAMETERS: [(&str, f64, f64); 6] = [
        ("elevation", 0.0, 90.0),
        ("azimuth", -360.0, 360.0),
        ("turbidity", 1.0, 10.0),
        ("ground", 0.0, 1.0),
        ("sun", 0.0, 20.0),
        ("scale", 0.0, 1e6),
    ];

    /// Mutable access to the parameter of this name; `None` if there is none.
    pub fn parameter(&mut self, name: &str) -> Option<&mut f64> {
        Some(match name {
            "elevation" => &mut self.elevation,
            "azimuth" => &mut self.azimuth,
            "turbidity" => &mut self.turbidity,
            "ground" => &mut self.ground,
            "sun" => &mut self.sun,
            "scale" => &mut self.scale,
            _ => return None,
        })
    }

    /// The environment as an image with the zenith at `+y`; an error if a parameter is out of its
    /// range. Texels are 0.18 degrees wide, and so is the soft edge of the sun.
    pub fn environment(&self) -> Result<Environment, SkyError> {
        let mut copy = *self;
        for (parameter, least, most) in Self::PARAMETERS {
            let found = copy.parameter(parameter).map_or(0.0, |p| *p);
            if !(least..=most).contains(&found) {
                return Err(SkyError { parameter, found, least, most });
            }
        }
        Ok(Environment::Image {
            image: Arc::new(self.picture()),
            scale: Rgb::WHITE,
            world_from_environment: DAffine3::IDENTITY,
        })
    }

    /// Unit direction towards the sun.
    fn towards_sun(&self) -> DVec3 {
        let (sin, cos) = real::sin_cos(self.elevation.to_radians());
        let (s, c) = real::sin_cos(self.azimuth.to_radians());
        DVec3::new(cos * s, sin, -cos * c)
    }

    fn picture(&self) -> Image {
        let [w, h] = SIZE;
        let model = HosekWilkie::new(self.elevation.to_radians(), self.turbidity, self.ground);
        let sun = self.towards_sun();
        let mut values = vec![0.0f32; (w * h * 3) as usize];
        let mut irradiance = [0.0; 3];
        let factor = self.scale * MODEL_UNIT / UNIT;
        for y in 0..h / 2 {
            let texel_area = row_area(y);
            for x in 0..w {
                let d = direction(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let radiance = model.radiance(d.y, d.dot(sun).clamp(-1.0, 1.0)).map(|v| v * factor);
                for c in 0..3 {
                    values[((y * w + x) * 3) as usize + c] = radiance[c] as f32;
                    irradiance[c] += radiance[c] * d.y * texel_area;
                }
            }
        }
        if self.sun > 0.0 {
            let direct =
                sun::illuminance(self.elevation, self.turbidity).map(|e| e * self.scale / UNIT);
            self.add_sun(&mut values, sun, direct);
            (0..3).for_each(|c| irradiance[c] += direct[c] * sun.y);
        }
        let ground = irradiance.map(|e| (e * self.ground / PI) as f32);
        let below = (w * h / 2 * 3) as usize;
        values[below..].chunks_exact_mut(3).for_each(|texel| texel.copy_from_slice(&ground));
        Image::from_f32(w, h, 3, values)
    }

    /// Spreads the sun's light over the texels of the part of its disk that is above the horizon.
    /// Energy is conserved.
    fn add_sun(&self, values: &mut [f32], sun: DVec3, direct: [f64; 3]) {
        let [w, h] = SIZE;
        // The disk is at least as large as a texel.
        let radius = (self.sun * 0.5).to_radians().max(0.7 * PI / f64::from(h));
        let cos_radius = real::cos(radius);
        let rows = |angle: f64| (angle / PI * f64::from(h)).clamp(0.0, f64::from(h / 2)) as u32;
        let polar = real::acos(sun.y.clamp(-1.0, 1.0));
        let mut covered = Vec::new();
        let mut solid_angle = 0.0;
        for y in rows(polar - radius * 1.1)..(rows(polar + radius * 1.1) + 1).min(h / 2) {
            for x in 0..w {
                let share = coverage(f64::from(x), f64::from(y), sun, cos_radius);
                if share > 0.0 {
                    covered.push(((y * w + x) as usize, share));
                    solid_angle += share * row_area(y);
                }
            }
        }
        for (texel, share) in covered {
            (0..3).for_each(|c| values[texel * 3 + c] += (direct[c] * share / solid_angle) as f32);
        }
    }
}

/// The fraction of a texel that the disk around `sun` covers, estimated with 16 points.
fn coverage(x: f64, y: f64, sun: DVec3, cos_radius: f64) -> f64 {
    let middle = direction(x + 0.5, y + 0.5);
    // Texels far outside of the disk need no points.
    if middle.dot(sun) < cos_radius - 0.02 {
        return 0.0;
    }
    let inside = |k: &u32| {
        let (i, j) = (f64::from(k % 4), f64::from(k / 4));
        direction(x + (i + 0.5) / 4.0, y + (j + 0.5) / 4.0).dot(sun) >= cos_radius
    };
    (0..16).filter(inside).count() as f64 / 16.0
}

/// The direction of a position in the image, which is given in texels.
fn direction(x: f64, y: f64) -> DVec3 {
    let (sin, cos) = real::sin_cos(y / f64::from(SIZE[1]) * PI);
    let (s, c) = real::sin_cos(x / f64::from(SIZE[0]) * TAU - PI);
    DVec3::new(sin * s, cos, -sin * c)
}

/// Solid angle of a texel in a row, in steradians.
fn row_area(y: u32) -> f64 {
    let edge = |y: u32| real::cos(f64::from(y) / f64::from(SIZE[1]) * PI);
    (edge(y) - edge(y + 1)) * TAU / f64::from(SIZE[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::environment::EnvironmentLight;
    use snell_math::ColorMode;

    /// Illuminance in lx of level ground under this sky.
    fn illuminance(sky: Sky) -> f64 {
        let image = sky.picture();
        let [w, h] = SIZE;
        let mut sum = 0.0;
        for y in 0..h / 2 {
            for x in 0..w {
                let [r, g, b, _] = image.rgba(x, y);
                let up = direction(f64::from(x) + 0.5, f64::from(y) + 0.5).y;
                sum += f64::from(Rgb::new(r, g, b).luminance()) * up * row_area(y);
            }
        }
        sum * UNIT
    }

    #[test]
    fn daylight_is_as_bright_as_in_nature() {
        // Total and diffuse illuminance of clear days, in klx: the ranges that daylight tables give
        // (IES, CIE).
        for (elevation, total, diffuse) in [
            (60.0, 75.0..115.0, 8.0..25.0),
            (30.0, 35.0..60.0, 6.0..18.0),
            (5.0, 2.0..9.0, 1.5..7.0),
        ] {
            let sky = Sky { elevation, ..Sky::default() };
            let (all, without) =
                (illuminance(sky) / 1e3, illuminance(Sky { sun: 0.0, ..sky }) / 1e3);
            eprintln!("{elevation} degrees: {all:.1} klx, {without:.1} klx without the sun");
            assert!(
                total.contains(&all) && diffuse.contains(&without),
                "{elevation}: {all} {without}"
            );
        }
    }

    #[test]
    fn the_size_of_the_sun_does_not_change_its_light() {
        let [small, large] =
            [0.53, 5.0].map(|sun| illuminance(Sky { sun, elevation: 50.0, ..Sky::default() }));
        assert!((small / large - 1.0).abs() < 0.01, "{small} {large}");
    }

    #[test]
    fn the_sun_is_where_it_is_said_to_be_and_low_suns_are_red() {
        for (azimuth, direction) in
            [(0.0, DVec3::NEG_Z), (90.0, DVec3::X), (180.0, DVec3::Z), (-90.0, DVec3::NEG_X)]
        {
            let sky = Sky { azimuth, elevation: 40.0, ..Sky::default() };
            let light = EnvironmentLight::new(&sky.environment().expect("a sky"));
            let towards = (direction * 40f64.to_radians().cos()
                + DVec3::Y * 40f64.to_radians().sin())
            .as_vec3();
            let at = |d| ColorMode::Rgb.to_rgb(light.radiance(d, ColorMode::Rgb)).luminance();
            assert!(
                at(towards) > 1e3 * at(-towards) && at(towards) > 100.0 * at(snell_math::Vec3::Y),
                "{azimuth}"
            );
        }
        let [r, _, b] = sun::illuminance(3.0, 3.0);
        assert!(r > 3.0 * b);
        let [r, _, b] = sun::illuminance(80.0, 3.0);
        assert!(r < 1.6 * b);
    }

    #[test]
    fn every_sky_in_range_is_finite_and_others_are_refused() {
        for elevation in [0.0, 0.1, 45.0, 90.0] {
            for turbidity in [1.0, 1.5, 10.0] {
                let model = HosekWilkie::new(f64::to_radians(elevation), turbidity, 1.0);
                for cos in [0.0, 1e-9, 0.5, 1.0] {
                    for gamma in [-1.0, 0.0, 0.999_999, 1.0] {
                        assert!(
                            model.radiance(cos, gamma).iter().all(|v| v.is_finite() && *v >= 0.0)
                        );
                    }
                }
                assert!(
                    sun::illuminance(elevation, turbidity)
                        .iter()
                        .all(|v| v.is_finite() && *v >= 0.0)
                );
            }
        }
        for broken in [f64::NAN, -1.0, 91.0] {
            let error =
                Sky { elevation: broken, ..Sky::default() }.environment().expect_err("no such sun");
            assert_eq!(error.parameter, "elevation");
        }
    }
}
