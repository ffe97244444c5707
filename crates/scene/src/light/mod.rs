//! Lights: sources that are not part of a surface ([`Light`]), emissive surfaces ([`area::AreaLight`]) and light from all
//! directions ([`environment::EnvironmentLight`]).

pub mod area;
mod bounds;
pub mod environment;
mod panel;
mod profile;
pub mod punctual;
pub mod sky;
mod spot;
#[cfg(test)]
mod tests;

pub use bounds::LightBounds;
pub use profile::{IntensityTable, Slide};
pub use spot::SpotFalloff;

use punctual::{PunctualLight, PunctualSample};
use serde::{Deserialize, Serialize};
use snell_math::{ColorMode, DMat3, DVec3, Rgb, SampledSpectrum, Vec2, Vec3};

/// Light arriving at a point from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub direction: Vec3,
    /// How far a shadow ray has to see: the distance to the light, infinite for directional lights.
    pub distance: f32,
    /// For a delta light: irradiance on a surface that faces it. Otherwise incident radiance.
    pub radiance: SampledSpectrum,
    /// Density per steradian with which the direction was chosen; 1 for delta lights.
    pub pdf: f32,
    /// True if no other technique can find this direction (point and directional lights, and lights without a visible body).
    pub is_delta: bool,
}

/// Factor on a light's intensity by distance `d`: `1 / (c0 + c1 d + c2 d^2)`. Physical light has `[0, 0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attenuation(pub [f32; 3]);

impl Default for Attenuation {
    fn default() -> Self {
        Self::INVERSE_SQUARE
    }
}

impl Attenuation {
    /// The inverse square law.
    pub const INVERSE_SQUARE: Self = Self([0.0, 0.0, 1.0]);
    /// No change by distance.
    pub const NONE: Self = Self([1.0, 0.0, 0.0]);

    /// The factor at distance `d > 0`. A denominator that is not positive counts as 1.
    #[inline(always)]
    pub fn at(&self, d: f32) -> f32 {
        let [c0, c1, c2] = self.0.map(f64::from);
        let d = f64::from(d);
        let denominator = c0 + c1 * d + c2 * d * d;
        // Single precision would overflow at a distance of 1e-20 already.
        if denominator > 0.0 { (1.0 / denominator).min(f64::from(f32::MAX)) as f32 } else { 1.0 }
    }
}

/// A light that is not a surface, in world coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "light", rename_all = "kebab-case")]
pub enum Light {
    /// Parallel light from infinitely far.
    Directional {
        /// Unit direction in which the light travels.
        direction: DVec3,
        /// Irradiance on a surface that faces the light, W / m^2.
        irradiance: Rgb,
    },
    /// Light from a point, equal in all directions.
    Point {
        /// Where.
        position: DVec3,
        /// Radiant intensity, W / sr (with the inverse square law).
        intensity: Rgb,
        /// By distance.
        #[serde(default)]
        attenuation: Attenuation,
        /// Radius of a surrounding sphere in the scene that is the lamp's body: shadow rays end where they first meet it. 0 for
        /// none.
        #[serde(default)]
        body_radius: f64,
    },
    /// Light from a point into a cone.
    Spot {
        /// Where.
        position: DVec3,
        /// Unit direction of the axis, in which the light travels.
        direction: DVec3,
        /// Radiant intensity on the axis, W / sr (with the inverse square law).
        intensity: Rgb,
        /// By distance.
        #[serde(default)]
        attenuation: Attenuation,
        /// By angle.
        falloff: SpotFalloff,
    },
    /// Light from a point with a measured intensity by direction (IES files, goniometric pictures); with the inverse square law.
    Profile {
        /// Where.
        position: DVec3,
        /// Rotation of the table's coordinates into the world.
        world_from_light: DMat3,
        /// Factor on the table.
        scale: Rgb,
        /// Radiant intensity by direction, W / sr.
        table: IntensityTable,
    },
    /// Light from a point that throws a picture; with the inverse square law.
    Projector {
        /// Where.
        position: DVec3,
        /// Rotation of the slide's coordinates into the world: it shines along their `+z`.
        world_from_light: DMat3,
        /// Factor on the slide.
        scale: Rgb,
        /// Radiant intensity by direction, W / sr.
        slide: Slide,
    },
    /// An invisible disk that emits to one side. A facing surface receives the average over the disk of
    /// `emission * attenuation(d) * 2 cos(angle at the light)`.
    Disk {
        /// Centre.
        position: DVec3,
        /// Unit normal of the side that emits.
        direction: DVec3,
        /// Radius, at least 0.
        radius: f64,
        /// Half of the radiant intensity of the whole disk along its normal, W / sr (with the inverse square law).
        emission: Rgb,
        /// By distance.
        #[serde(default)]
        attenuation: Attenuation,
    },
    /// An invisible rectangle that emits to one side, in the same way as the disk.
    Rectangle {
        /// Centre.
        center: DVec3,
        /// Unit vectors along the sides; the side that emits is that of `axes[0] x axes[1]`.
        axes: [DVec3; 2],
        /// Full lengths of the sides, at least 0.
        lengths: [f64; 2],
        /// Half of the radiant intensity of the whole rectangle along its normal, W / sr (with the inverse square law).
        emission: Rgb,
        /// By distance.
        #[serde(default)]
        attenuation: Attenuation,
    },
}

impl LightSample {
    /// From a light of this colour.
    pub fn of_punctual(sample: PunctualSample, color: SampledSpectrum) -> Option<Self> {
        let PunctualSample { direction, distance, factor, arrives } = sample;
        arrives.then(|| Self { direction, distance, radiance: color * factor, pdf: 1.0, is_delta: true })
    }
}

impl Light {
    /// The names of all lights.
    pub const NAMES: &[&str] = &["directional", "point", "spot", "profile", "projector", "disk", "rectangle"];

    /// The name of this kind, one of [`Self::NAMES`].
    pub fn name(&self) -> &'static str {
        match self {
            Self::Directional { .. } => "directional",
            Self::Point { .. } => "point",
            Self::Spot { .. } => "spot",
            Self::Profile { .. } => "profile",
            Self::Projector { .. } => "projector",
            Self::Disk { .. } => "disk",
            Self::Rectangle { .. } => "rectangle",
        }
    }

    /// A few of each kind, extremes included: what tests and galleries run over.
    pub fn examples() -> Vec<Self> {
        let (position, attenuation) = (DVec3::new(0.5, 3.0, 1.0), Attenuation::INVERSE_SQUARE);
        let (intensity, emission) = (Rgb::splat(10.0), Rgb::new(8.0, 7.0, 6.0));
        let spot = |falloff| Self::Spot { position, direction: DVec3::NEG_Y, intensity, attenuation, falloff };
        let axes = [DVec3::Z, DVec3::X];
        // Both shine downwards.
        let world_from_light = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y);
        let values = [3.0, 5.0, 1.0, 0.0].map(Rgb::splat).to_vec();
        let table = IntensityTable::new(vec![0.0, 0.4, 0.9, 1.2], vec![0.0], values);
        let picture = crate::Image::from_f32(2, 2, 3, (0..12).map(|i| (i % 5) as f32).collect());
        let slide = Slide::new(&picture, snell_math::DVec2::new(0.8, 0.5));
        let scale = Rgb::new(2.0, 1.5, 1.0);
        let measured = table.map(|table| Self::Profile { position, world_from_light, scale, table });
        let projected = slide.map(|slide| Self::Projector { position, world_from_light, scale, slide });
        let plain = vec![
            Self::Directional { direction: DVec3::new(-0.6, -0.8, 0.0), irradiance: Rgb::splat(3.0) },
            Self::Point { position, intensity, attenuation, body_radius: 0.0 },
            Self::Point { position, intensity: Rgb::WHITE, attenuation: Attenuation::NONE, body_radius: 0.25 },
            spot(SpotFalloff::Power { cutoff: 0.6, exponent: 4.0 }),
            spot(SpotFalloff::Smooth { inner: 0.3, outer: 0.5 }),
            Self::Disk { position, direction: DVec3::NEG_Y, radius: 0.7, emission, attenuation },
            Self::Disk { position, direction: DVec3::NEG_Y, radius: 0.0, emission, attenuation },
            Self::Rectangle { center: position, axes, lengths: [2.0, 0.5], emission, attenuation },
        ];
        plain.into_iter().chain(measured).chain(projected).collect()
    }

    /// Light arriving at `p`. `u` in `[0, 1)^2` chooses a point of an extended light. `None` if nothing arrives.
    pub fn sample(&self, p: Vec3, u: Vec2, mode: ColorMode) -> Option<LightSample> {
        if let Some(light) = PunctualLight::of(self) {
            return LightSample::of_punctual(light.sample(p), mode.illuminant(light.color));
        }
        let p = p.as_dvec3();
        let (direction, distance, irradiance) = match self {
            Self::Directional { .. } | Self::Point { .. } => return None,
            Self::Spot { position, direction: axis, intensity, attenuation, falloff } => {
                let (direction, distance) = towards(p, *position)?;
                let factor = falloff.at(-direction.dot(*axis)) as f32;
                (direction, distance, *intensity * (attenuation.at(distance as f32) * factor))
            }
            Self::Profile { position, world_from_light, scale, table } => {
                let (direction, distance) = towards(p, *position)?;
                let intensity = table.at(world_from_light.transpose() * -direction);
                (direction, distance, *scale * intensity * Attenuation::INVERSE_SQUARE.at(distance as f32))
            }
            Self::Projector { position, world_from_light, scale, slide } => {
                let (direction, distance) = towards(p, *position)?;
                let intensity = slide.at(world_from_light.transpose() * -direction);
                (direction, distance, *scale * intensity * Attenuation::INVERSE_SQUARE.at(distance as f32))
            }
            Self::Disk { position, direction, radius, emission, attenuation } => {
                let point = panel::disk_point(*position, *direction, *radius, u);
                panel::arriving(p, point, *direction, *emission, attenuation)?
            }
            Self::Rectangle { center, axes, lengths, emission, attenuation } => {
                let point = panel::rectangle_point(*center, *axes, *lengths, u);
                panel::arriving(p, point, axes[0].cross(axes[1]), *emission, attenuation)?
            }
        };
        let arrives = !irradiance.is_black() && irradiance.is_finite() && direction.is_finite() && !distance.is_nan();
        arrives.then(|| LightSample {
            direction: direction.as_vec3(),
            distance: distance as f32,
            radiance: mode.illuminant(irradiance),
            pdf: 1.0,
            is_delta: true,
        })
    }

    /// Approximate emitted power in W over a scene of this radius: what the choice among lights goes by. Finite and not negative.
    /// Lights that do not follow the inverse square law count with what crosses a sphere of the scene's radius.
    pub fn power(&self, scene_radius: f64) -> f64 {
        use std::f64::consts::{PI, TAU};
        let radius = if scene_radius > 0.0 && scene_radius.is_finite() { scene_radius.min(1e9) } else { 1.0 };
        let luminance = |color: &Rgb| f64::from(color.map(f32::abs).luminance());
        let by_distance = |attenuation: &Attenuation| radius * radius * f64::from(attenuation.at(radius as f32));
        let power = match self {
            Self::Directional { irradiance, .. } => luminance(irradiance) * PI * radius * radius,
            Self::Point { intensity, attenuation, .. } => 2.0 * TAU * luminance(intensity) * by_distance(attenuation),
            Self::Spot { intensity, attenuation, falloff, .. } => {
                falloff.solid_angle() * luminance(intensity) * by_distance(attenuation)
            }
            Self::Profile { scale, table, .. } => luminance(scale) * table.power(),
            Self::Projector { scale, slide, .. } => luminance(scale) * slide.power(),
            // The integral of 2 cos over the hemisphere.
            Self::Disk { emission, attenuation, .. } | Self::Rectangle { emission, attenuation, .. } => {
                TAU * luminance(emission) * by_distance(attenuation)
            }
        };
        if power.is_nan() { 0.0 } else { power.clamp(0.0, f64::MAX) }
    }
}

/// Unit direction and distance; `None` if the points coincide.
fn towards(p: DVec3, position: DVec3) -> Option<(DVec3, f64)> {
    let to_light = position - p;
    let distance = to_light.length();
    (distance > 0.0).then(|| (to_light / distance, distance))
}
