//! Lights from single points and parallel light, in a form in which many points can be computed at
//! once.

use super::Attenuation;
use snell_math::{DVec3, Rgb, Vec3};

/// A light whose intensity follows from its distance and, through cosines alone, from the angle.
/// These are the lights of the glTF extension `KHR_lights_punctual` and similar ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PunctualLight {
    /// Position of the light; unused for parallel light.
    pub position: DVec3,
    /// Unit direction in which parallel light travels, or of the axis of a spot light.
    pub direction: DVec3,
    /// For parallel light, the irradiance on a surface that faces it, W / m^2; for others, the
    /// radiant intensity in the middle of the cone, W / sr.
    pub color: Rgb,
    /// Attenuation by distance; unused for parallel light.
    pub attenuation: Attenuation,
    /// Radius of the lamp's body; see [`Point`](super::Point).
    pub body_radius: f64,
    /// Falloff by angle.
    pub cone: Cone,
    /// True for parallel light.
    pub is_parallel: bool,
}

/// A factor that depends on the cosine of the angle to an axis: 1 from the inner cosine on, 0 up to
/// the outer cosine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Cosine of the outer half-angle.
    pub outer: f64,
    /// Cosine of the inner half-angle.
    pub inner: f64,
    /// The factor between the two cosines, as a polynomial of a linear ramp `x` from 0 to 1: the
    /// coefficients `a`, `b` and `c` of `x² (a + b x + c x²)`.
    pub edge: [f64; 3],
}

/// The light that arrives at a point from a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PunctualSample {
    /// Unit direction to the light.
    pub direction: Vec3,
    /// Length of the shadow ray, infinite for parallel light.
    pub distance: f32,
    /// The irradiance on a surface that faces the light is this factor times the light's colour.
    pub factor: f32,
    /// False if nothing arrives; the other fields are then arbitrary.
    pub arrives: bool,
}

impl Cone {
    /// The cone of all directions.
    pub const ALL: Self = Self { outer: -2.0, inner: -2.0, edge: Self::SQUARE };

    /// The edge that is the square of the ramp.
    pub const SQUARE: [f64; 3] = [1.0, 0.0, 0.0];

    /// The edge that is a cubic step, `3 x² - 2 x³`.
    pub const STEP: [f64; 3] = [3.0, -2.0, 0.0];

    /// The edge that is the fourth power of the ramp.
    pub const FOURTH: [f64; 3] = [0.0, 0.0, 1.0];

    /// The factor at this cosine; 0 for NaN.
    #[inline(always)]
    pub fn at(&self, cos_angle: f64) -> f64 {
        let Self { outer, inner, edge: [a, b, c] } = *self;
        let ramp = (cos_angle - outer) / (inner - outer);
        let between = ramp * ramp * (a + ramp * (b + c * ramp));
        // NaN is in no cone.
        let factor = if cos_angle >= inner { 1.0 } else { between };
        if cos_angle > outer { factor } else { 0.0 }
    }
}

impl PunctualLight {
    /// A point light that emits in all directions.
    pub(super) fn at(position: DVec3, color: Rgb, attenuation: Attenuation) -> Self {
        Self {
            position,
            direction: DVec3::Z,
            color,
            attenuation,
            body_radius: 0.0,
            cone: Cone::ALL,
            is_parallel: false,
        }
    }

    /// Parallel light that travels in this direction.
    pub(super) fn parallel(direction: DVec3, color: Rgb) -> Self {
        Self { direction, is_parallel: true, ..Self::at(DVec3::ZERO, color, Attenuation::NONE) }
    }

    /// The light that arrives at `p`.
    #[inline(always)]
    pub fn sample(&self, p: Vec3) -> PunctualSample {
        let &Self {
            position,
            direction: axis,
            color,
            ref attenuation,
            body_radius,
            ref cone,
            is_parallel,
        } = self;
        let p = p.as_dvec3();
        let to_light = position - p;
        let length = to_light.length();
        let towards = to_light / length;
        let by_angle = cone.at(-towards.dot(axis)) as f32;
        let factor = if is_parallel { 1.0 } else { attenuation.at(length as f32) * by_angle };
        let direction = pick(is_parallel, -axis, towards);
        let distance = if is_parallel {
            f64::INFINITY
        } else {
            distance_to_body(p, position, length, body_radius)
        };
        let irradiance = color * factor;
        let is_black = (irradiance.r == 0.0) & (irradiance.g == 0.0) & (irradiance.b == 0.0);
        let is_finite =
            irradiance.r.is_finite() & irradiance.g.is_finite() & irradiance.b.is_finite();
        let has_direction =
            direction.x.is_finite() & direction.y.is_finite() & direction.z.is_finite();
        let is_apart = is_parallel | (length > 0.0);
        PunctualSample {
            direction: direction.as_vec3(),
            distance: distance as f32,
            factor,
            arrives: !is_black & is_finite & has_direction & is_apart & !distance.is_nan(),
        }
    }
}

#[inline(always)]
fn pick(first: bool, a: DVec3, b: DVec3) -> DVec3 {
    let pick = |a: f64, b: f64| if first { a } else { b };
    DVec3::new(pick(a.x, b.x), pick(a.y, b.y), pick(a.z, b.z))
}

/// The distance at which a ray from `p` towards the centre of a lamp first hits the lamp's body.
/// From outside this is the near side; from inside, and within rounding of the surface, it is the
/// far side, through the centre. The distance has no margin for rounding, so the caller must end
/// the shadow ray slightly before.
#[inline(always)]
pub(super) fn distance_to_body(p: DVec3, center: DVec3, distance: f64, radius: f64) -> f64 {
    // Points are in single precision, and a point on the body must not block its own shadow ray.
    let (p, c) = (p.abs(), center.abs());
    let size = p.x.max(p.y).max(p.z) + c.x.max(c.y).max(c.z) + radius;
    let rounding = 8.0 * f64::from(f32::EPSILON) * size;
    let to_body = if distance > radius + rounding { distance - radius } else { distance + radius };
    if radius > 0.0 { to_body } else { distance }
}
