//! Lights: sources that are not part of a surface ([`Light`]), emissive surfaces
//! ([`area::AreaLight`]) and light from all directions ([`environment::EnvironmentLight`]).
//!
//! A kind of [`Light`] is one file: its parameters, their ranges, `examples()`, and its
//! implementation of [`Emitter`]. To add a kind, add a file here and its three lines below. All
//! other code uses the list.

mod aimed;
pub mod area;
mod bounds;
mod directional;
mod disk;
pub mod environment;
mod panel;
mod point;
mod profile;
mod projector;
pub mod punctual;
mod rectangle;
pub mod sky;
mod spot;
#[cfg(test)]
mod tests;

pub use bounds::LightBounds;
pub use directional::Directional;
pub use disk::Disk;
pub use point::Point;
pub use profile::{IntensityTable, Profile};
pub use projector::{Projector, Slide};
pub use rectangle::Rectangle;
pub use spot::{Spot, SpotFalloff};

use crate::ranges::FARTHEST;
use punctual::{PunctualLight, PunctualSample};
use serde::{Deserialize, Serialize};
use snell_math::parameters::{Kind, Range, Value, Visitor, problem_at};
use snell_math::{ColorMode, DAffine3, DMat3, DVec3, Rgb, SampledSpectrum, Vec2, Vec3};

/// Light that arrives at a point from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub direction: Vec3,
    /// Length of the shadow ray: the distance to the light, infinite for directional lights.
    pub distance: f32,
    /// For a delta light: irradiance on a surface that faces it. Otherwise incident radiance.
    pub radiance: SampledSpectrum,
    /// Density per steradian with which the direction was chosen; 1 for delta lights.
    pub pdf: f32,
    /// True if no other technique can find this direction: for point and directional lights, and
    /// for lights without a visible body.
    pub is_delta: bool,
}

/// Factor on a light's intensity at distance `d`: `1 / (c0 + c1 d + c2 d^2)`. Physical light has
/// `[0, 0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attenuation(pub [f32; 3]);

impl Value for Attenuation {
    const KIND: Kind = Kind::Numbers(3);

    fn visit(&self, visitor: &mut Visitor<'_>) {
        self.0.visit(visitor);
    }
}

impl Default for Attenuation {
    fn default() -> Self {
        Self::INVERSE_SQUARE
    }
}

impl Attenuation {
    /// The inverse square law.
    pub const INVERSE_SQUARE: Self = Self([0.0, 0.0, 1.0]);
    /// No attenuation: the factor is 1 at all distances.
    pub const NONE: Self = Self([1.0, 0.0, 0.0]);

    /// The factor at distance `d > 0`. A denominator that is not positive counts as 1.
    #[inline(always)]
    pub fn at(&self, d: f32) -> f32 {
        let [c0, c1, c2] = self.0.map(f64::from);
        let d = f64::from(d);
        let denominator = c0 + c1 * d + c2 * d * d;
        // Single precision would already overflow at a distance of 1e-20.
        if denominator > 0.0 { (1.0 / denominator).min(f64::from(f32::MAX)) as f32 } else { 1.0 }
    }

    /// The factor on the power through a sphere of this radius, which is 1 for the inverse square
    /// law.
    fn over_sphere(&self, radius: f64) -> f64 {
        radius * radius * f64::from(self.at(radius as f32))
    }
}

impl LightSample {
    /// The sample of a punctual light of this colour; `None` if nothing arrives.
    pub fn of_punctual(sample: PunctualSample, color: SampledSpectrum) -> Option<Self> {
        let PunctualSample { direction, distance, factor, arrives } = sample;
        arrives.then(|| Self {
            direction,
            distance,
            radiance: color * factor,
            pdf: 1.0,
            is_delta: true,
        })
    }
}

/// The light that arrives at a point from a sampled point of a light, in RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Incident {
    /// Unit direction to the light.
    direction: DVec3,
    /// Length of the shadow ray.
    distance: f64,
    /// Irradiance on a surface that faces the light.
    irradiance: Rgb,
}

/// The interface of the kinds of lights, in world coordinates.
///
/// Rays never hit such a light. It is found by its own samples only, so it needs no density. Each
/// kind implements one of two ways to give the arriving light: [`Self::punctual`] or
/// [`Self::sample_li`].
trait Emitter {
    /// The factor on the light's emission.
    fn color(&self) -> Rgb;

    /// Mutable access to the value of [`Self::color`].
    fn color_mut(&mut self) -> &mut Rgb;

    /// The centre of the light; `None` if it is infinitely far away.
    fn position(&self) -> Option<DVec3>;

    /// True if a surface around the light is the light's own body, whose inner side does not block
    /// the light.
    fn has_body(&self) -> bool {
        false
    }

    /// Unit axis and half-angle, in radians, of a cone from the light's [position](Self::position)
    /// that contains all of the light; `None` if no such cone is known.
    fn cone(&self) -> Option<(DVec3, f64)> {
        None
    }

    /// Moves the light by a map of the world. The light keeps its size and power.
    fn transform(&mut self, by: &DAffine3);

    /// The light as a punctual one, if it is one, so that many points can be computed at once.
    fn punctual(&self) -> Option<PunctualLight> {
        None
    }

    /// The light that arrives at `p`, unless the light is punctual. `u` in `[0, 1)^2` chooses a
    /// point of an extended light. `None` if nothing arrives.
    fn sample_li(&self, _p: DVec3, _u: Vec2) -> Option<Incident> {
        None
    }

    /// Approximate power in W. Light that does not follow the inverse square law counts with the
    /// power through a sphere of the scene's radius, which is positive and finite.
    fn power(&self, scene_radius: f64) -> f64;

    /// The light's bounds, if it has a position and follows the inverse square law. `None` is
    /// always valid; the light is then chosen by its power only.
    fn bounds(&self) -> Option<LightBounds> {
        None
    }
}

snell_math::kinds! {
    /// A light that is not a surface, in world coordinates.
    pub enum Light tagged "light" by match_light! {
        "directional" => Directional,
        "point" => Point,
        "spot" => Spot,
        "profile" => Profile,
        "projector" => Projector,
        "disk" => Disk,
        "rectangle" => Rectangle,
    }
}

impl Light {
    /// The factor on the light's emission: irradiance, intensity, emission, or a scale.
    pub fn color(&self) -> Rgb {
        match_light!(self, light => light.color())
    }

    /// Mutable access to the value of [`Self::color`].
    pub fn color_mut(&mut self) -> &mut Rgb {
        match_light!(self, light => light.color_mut())
    }

    /// The centre of the light; `None` if it is infinitely far away.
    pub fn position(&self) -> Option<DVec3> {
        match_light!(self, light => light.position())
    }

    /// True if a surface around the light is the light's own body, whose inner side does not block
    /// the light.
    pub fn has_body(&self) -> bool {
        match_light!(self, light => light.has_body())
    }

    /// Unit axis and half-angle, in radians, of a cone from the light's [position](Self::position)
    /// that contains all of the light; `None` if no such cone is known.
    pub fn cone(&self) -> Option<(DVec3, f64)> {
        match_light!(self, light => light.cone())
    }

    /// The light, moved by a map of the world, with unchanged size and power.
    pub fn moved(&self, by: &DAffine3) -> Self {
        let mut light = self.clone();
        match_light!(&mut light, light => light.transform(by));
        light
    }

    /// The light as a punctual one, if its intensity follows from distance and cosines only.
    pub fn punctual(&self) -> Option<PunctualLight> {
        match_light!(self, light => light.punctual())
    }

    /// Samples the light that arrives at `p`. `u` in `[0, 1)^2` chooses a point of an extended
    /// light. `None` if nothing arrives.
    pub fn sample(&self, p: Vec3, u: Vec2, mode: ColorMode) -> Option<LightSample> {
        if let Some(light) = self.punctual() {
            return LightSample::of_punctual(light.sample(p), mode.illuminant(light.color));
        }
        let Incident { direction, distance, irradiance } =
            match_light!(self, light => light.sample_li(p.as_dvec3(), u))?;
        let arrives = !irradiance.is_black()
            && irradiance.is_finite()
            && direction.is_finite()
            && !distance.is_nan();
        arrives.then(|| LightSample {
            direction: direction.as_vec3(),
            distance: distance as f32,
            radiance: mode.illuminant(irradiance),
            pdf: 1.0,
            is_delta: true,
        })
    }

    /// Approximate emitted power in W in a scene of this radius, for choosing among lights; finite
    /// and not negative. Lights that do not follow the inverse square law count with the power
    /// through a sphere of the scene's radius.
    pub fn power(&self, scene_radius: f64) -> f64 {
        let is_usable = scene_radius > 0.0 && scene_radius.is_finite();
        let radius = if is_usable { scene_radius.min(FARTHEST) } else { 1.0 };
        let power = match_light!(self, light => light.power(radius));
        if power.is_nan() { 0.0 } else { power.clamp(0.0, f64::MAX) }
    }

    /// The bounds of a light that has a position and follows the inverse square law. `None` for all
    /// others, whose light does not fall off as the choice by distance assumes.
    pub fn bounds(&self) -> Option<LightBounds> {
        match_light!(self, light => light.bounds())
    }

    /// The flaw of a direction that is zero, which points nowhere.
    pub fn lost_direction(&self) -> Option<String> {
        self.directions().find_map(|name| problem_at(self, &[name]))
    }

    /// The names of the parameters that are directions.
    pub fn directions(&self) -> impl Iterator<Item = &'static str> {
        let parameters = self.declaration().parameters.iter();
        parameters.filter(|p| p.range == Range::Direction).map(|p| p.name)
    }
}

/// Unit direction and distance from `p` to a position; `None` if the points coincide.
fn towards(p: DVec3, position: DVec3) -> Option<(DVec3, f64)> {
    let to_light = position - p;
    let distance = to_light.length();
    (distance > 0.0).then(|| (to_light / distance, distance))
}

/// A direction of a light at unit length; scenes may give it any length, which means nothing. NaN
/// if it is zero or not finite: then no light arrives.
fn unit(direction: DVec3) -> DVec3 {
    let is_unit = (direction.length_squared() - 1.0).abs() < 1e-9;
    if is_unit { direction } else { direction.try_normalize().unwrap_or(DVec3::NAN) }
}

/// A unit direction, transformed; unchanged if it would vanish.
fn turned(by: &DAffine3, direction: DVec3) -> DVec3 {
    by.transform_vector3(direction).try_normalize().unwrap_or(direction)
}

/// A rotation, transformed.
fn turned_frame(by: &DAffine3, frame: DMat3) -> DMat3 {
    DMat3::from_cols(turned(by, frame.x_axis), turned(by, frame.y_axis), turned(by, frame.z_axis))
}

/// Luminance of a colour whose components may be negative.
fn luminance(color: Rgb) -> f64 {
    f64::from(color.map(f32::abs).luminance())
}
