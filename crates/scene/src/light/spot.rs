//! The light `spot`, which emits from a point into a cone, and its falloff with the angle from the
//! axis.

use super::punctual::Cone;
use super::{
    Attenuation, Emitter, Incident, LightBounds, PunctualLight, luminance, towards, turned, unit,
};
use crate::ranges::LIGHT;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{DAffine3, DVec3, Rgb, Vec2, real};
use std::f64::consts::PI;

snell_math::declare! {
    /// Light from a point into a cone.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Spot {
        /// Position of the light.
        #[unit("scene units")]
        pub position: DVec3,
        /// Direction of the axis, in which the light travels; its length has no meaning.
        #[range(Range::Direction)]
        pub direction: DVec3,
        /// Radiant intensity on the axis, W / sr (with the inverse square law).
        #[range(LIGHT)]
        #[unit("W / sr")]
        pub intensity: Rgb,
        /// Attenuation by distance from the light.
        #[range(Range::AMOUNT)]
        #[serde(default)]
        pub attenuation: Attenuation,
        /// Falloff with the angle from the axis.
        pub falloff: SpotFalloff,
    }
}

impl Spot {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let spot = |falloff| Self {
            position: DVec3::new(0.5, 3.0, 1.0),
            direction: DVec3::NEG_Y,
            intensity: Rgb::splat(10.0),
            attenuation: Attenuation::default(),
            falloff,
        };
        vec![
            spot(SpotFalloff::Power { cutoff: 0.6, exponent: 4.0 }),
            spot(SpotFalloff::Smooth { inner: 0.3, outer: 0.5 }),
            spot(SpotFalloff::Fourth { inner: 0.1, outer: 0.6 }),
        ]
    }
}

impl Emitter for Spot {
    fn color(&self) -> Rgb {
        self.intensity
    }

    fn color_mut(&mut self) -> &mut Rgb {
        &mut self.intensity
    }

    fn position(&self) -> Option<DVec3> {
        Some(self.position)
    }

    fn cone(&self) -> Option<(DVec3, f64)> {
        Some((unit(self.direction), self.falloff.widest()))
    }

    fn transform(&mut self, by: &DAffine3) {
        self.position = by.transform_point3(self.position);
        self.direction = turned(by, self.direction);
    }

    fn punctual(&self) -> Option<PunctualLight> {
        let cone = self.falloff.cone()?;
        let light = PunctualLight::at(self.position, self.intensity, self.attenuation);
        Some(PunctualLight { direction: unit(self.direction), cone, ..light })
    }

    fn sample_li(&self, p: DVec3, _u: Vec2) -> Option<Incident> {
        let (direction, distance) = towards(p, self.position)?;
        let factor = self.falloff.at(-direction.dot(unit(self.direction))) as f32;
        let irradiance = self.intensity * (self.attenuation.at(distance as f32) * factor);
        Some(Incident { direction, distance, irradiance })
    }

    fn power(&self, scene_radius: f64) -> f64 {
        self.falloff.solid_angle()
            * luminance(self.intensity)
            * self.attenuation.over_sphere(scene_radius)
    }

    fn bounds(&self) -> Option<LightBounds> {
        let intensity = self.attenuation.strength(self.intensity)?;
        LightBounds::of_cone(self.position, unit(self.direction), self.falloff.widest(), intensity)
    }
}

snell_math::declare! {
    /// Factor on a spot light's intensity that depends on the angle from its axis. Angles are in
    /// radians.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub enum SpotFalloff tagged "falloff" {
        /// `cos(angle)^exponent` up to the cut-off angle, inclusive, and 0 beyond, as in old OpenGL
        /// and `.scn`.
        "power" => Power {
            /// Half-angle of the cone, `[0, pi]`. Nothing is emitted backwards unless the exponent
            /// is 0.
            #[range(Range::Within(0.0, PI))]
            #[unit("radians")]
            cutoff: f64,
            /// Exponent of the cosine, at least 0.
            #[range(Range::AMOUNT)]
            exponent: f64,
        },
        /// 1 inside the inner cone, 0 outside the outer one, and between them the square of a
        /// linear ramp in the cosine: the angular attenuation of the glTF extension
        /// `KHR_lights_punctual`.
        "smooth" => Smooth {
            /// Half-angle up to which the intensity is full.
            #[range(Range::Within(0.0, PI))]
            #[unit("radians")]
            inner: f64,
            /// Half-angle from which the intensity is 0; at least `inner` (equal angles make a hard
            /// edge).
            #[range(Range::Within(0.0, PI))]
            #[unit("radians")]
            outer: f64,
        },
        /// 1 inside the inner cone, 0 outside the outer one, and between them a cubic step in the
        /// cosine: the spot light of pbrt-v4.
        "step" => Step {
            /// Half-angle up to which the intensity is full.
            #[range(Range::Within(0.0, PI))]
            #[unit("radians")]
            inner: f64,
            /// Half-angle from which the intensity is 0; at least `inner` (equal angles make a hard
            /// edge).
            #[range(Range::Within(0.0, PI))]
            #[unit("radians")]
            outer: f64,
        },
        /// 1 inside the inner cone, 0 outside the outer one, and between them the fourth power of a
        /// linear ramp in the cosine: the spot light of pbrt-v3 and pbrt-v2.
        "fourth" => Fourth {
            /// Half-angle up to which the intensity is full.
            #[range(Range::Within(0.0, PI))]
            #[unit("radians")]
            inner: f64,
            /// Half-angle from which the intensity is 0; at least `inner` (equal angles make a hard
            /// edge).
            #[range(Range::Within(0.0, PI))]
            #[unit("radians")]
            outer: f64,
        },
    }
}

impl SpotFalloff {
    /// The factor at an angle from the axis, which is given by its cosine. It is in `[0, 1]`, and 0
    /// for NaN.
    pub fn at(&self, cos_angle: f64) -> f64 {
        let factor = match *self {
            // The angles are compared, so that a cut-off of exactly 90 degrees includes 90 degrees.
            Self::Power { cutoff, exponent }
                if real::acos(cos_angle.clamp(-1.0, 1.0)) <= cutoff =>
            {
                if exponent == 0.0 {
                    1.0
                } else {
                    real::powf(cos_angle.max(0.0), exponent)
                }
            }
            Self::Power { .. } => 0.0,
            Self::Smooth { .. } | Self::Step { .. } | Self::Fourth { .. } => {
                self.cone().map_or(0.0, |cone| cone.at(cos_angle))
            }
        };
        if factor.is_finite() { factor.clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The falloff as a function of cosines, if it has that form.
    fn cone(&self) -> Option<Cone> {
        let (inner, outer, edge) = match *self {
            Self::Power { .. } => return None,
            Self::Smooth { inner, outer } => (inner, outer, Cone::SQUARE),
            Self::Step { inner, outer } => (inner, outer, Cone::STEP),
            Self::Fourth { inner, outer } => (inner, outer, Cone::FOURTH),
        };
        Some(Cone { outer: real::cos(outer), inner: real::cos(inner), edge })
    }

    /// Half-angle of the cone that contains all of the light, in radians, in `[0, pi]`.
    pub fn widest(&self) -> f64 {
        let widest = match *self {
            Self::Power { cutoff, .. } => cutoff,
            Self::Smooth { outer, .. } | Self::Step { outer, .. } | Self::Fourth { outer, .. } => {
                outer
            }
        };
        if widest.is_nan() { 0.0 } else { widest.clamp(0.0, PI) }
    }

    /// The integral of the factor over all directions, in steradians: `[0, 4 pi]`.
    pub fn solid_angle(&self) -> f64 {
        // The midpoint rule in the cosine covers the cone only, so that narrow cones are resolved.
        let cos_widest = real::cos(self.widest());
        let (n, width) = (256, 1.0 - cos_widest);
        let sum: f64 = (0..n).map(|i| self.at(1.0 - width * (i as f64 + 0.5) / n as f64)).sum();
        std::f64::consts::TAU * width * sum / n as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    #[test]
    fn the_power_falloff_ends_at_the_cutoff() {
        let spot = SpotFalloff::Power { cutoff: 0.5, exponent: 3.0 };
        assert_eq!(spot.at(0.3f64.cos()), 0.3f64.cos().powf(3.0));
        assert_eq!(spot.at(0.5001f64.cos()), 0.0);
        assert_eq!(SpotFalloff::Power { cutoff: PI, exponent: 0.0 }.at(-1.0), 1.0);
        assert_eq!(SpotFalloff::Power { cutoff: PI, exponent: 2.0 }.at(-1.0), 0.0);
    }

    #[test]
    fn the_smooth_falloff_is_the_square_of_a_ramp_in_the_cosine() {
        let spot = SpotFalloff::Smooth { inner: 0.2, outer: 0.6 };
        assert_eq!((spot.at(1.0), spot.at(0.2f64.cos()), spot.at(0.6f64.cos())), (1.0, 1.0, 0.0));
        let middle = (0.2f64.cos() + 0.6f64.cos()) / 2.0;
        assert!((spot.at(middle) - 0.25).abs() < 1e-12);
        // The reference form in the specification, with a scale and an offset.
        let scale = 1.0 / (0.2f64.cos() - 0.6f64.cos());
        for angle in [0.25f64, 0.4, 0.55] {
            let linear = (angle.cos() * scale - 0.6f64.cos() * scale).clamp(0.0, 1.0);
            assert!((spot.at(angle.cos()) - linear * linear).abs() < 1e-12);
        }
    }

    #[test]
    fn the_cubic_step_has_the_integral_that_pbrt_says() {
        let (inner, outer) = (0.3f64, 0.5f64);
        let spot = SpotFalloff::Step { inner, outer };
        assert_eq!((spot.at(1.0), spot.at(0.3f64.cos()), spot.at(0.5f64.cos())), (1.0, 1.0, 0.0));
        let closed_form = TAU * ((1.0 - inner.cos()) + (inner.cos() - outer.cos()) / 2.0);
        assert!((spot.solid_angle() / closed_form - 1.0).abs() < 1e-4);
    }

    #[test]
    fn the_fourth_power_is_that_of_pbrt_3() {
        let (inner, outer) = (0.3f64, 0.5f64);
        let spot = SpotFalloff::Fourth { inner, outer };
        assert_eq!((spot.at(1.0), spot.at(0.3f64.cos()), spot.at(0.5f64.cos())), (1.0, 1.0, 0.0));
        for angle in [0.31f64, 0.4, 0.49] {
            let delta = (angle.cos() - outer.cos()) / (inner.cos() - outer.cos());
            assert!((spot.at(angle.cos()) - (delta * delta) * (delta * delta)).abs() < 1e-15);
        }
        // The integral of the fourth power of a ramp is a fifth of its width.
        let closed_form = TAU * ((1.0 - inner.cos()) + (inner.cos() - outer.cos()) / 5.0);
        assert!((spot.solid_angle() / closed_form - 1.0).abs() < 1e-4);
    }

    #[test]
    fn equal_cones_make_a_hard_edge_and_nan_is_dark() {
        let spot = SpotFalloff::Smooth { inner: 0.4, outer: 0.4 };
        assert_eq!(
            (spot.at(0.39f64.cos()), spot.at(0.41f64.cos()), spot.at(f64::NAN)),
            (1.0, 0.0, 0.0)
        );
        assert_eq!(SpotFalloff::Smooth { inner: f64::NAN, outer: f64::NAN }.at(0.9), 0.0);
    }

    #[test]
    fn solid_angles_match_closed_forms() {
        let cosine = SpotFalloff::Power { cutoff: FRAC_PI_2, exponent: 1.0 };
        assert!((cosine.solid_angle() - PI).abs() < 1e-4);
        let full = SpotFalloff::Power { cutoff: PI, exponent: 0.0 };
        assert!((full.solid_angle() - 2.0 * TAU).abs() < 1e-9);
        // The expected value is one third of the ramp's width in the cosine, plus the inner cone.
        let smooth = SpotFalloff::Smooth { inner: 0.01, outer: 0.02 };
        let expected = TAU * ((1.0 - 0.01f64.cos()) + (0.01f64.cos() - 0.02f64.cos()) / 3.0);
        assert!((smooth.solid_angle() / expected - 1.0).abs() < 1e-3);
    }
}
