//! The distortion of real lenses: the models of OpenCV, forwards and backwards.
//!
//! Points are those of the plane at distance 1 in front of the eye, with x to the right and y
//! down, as in the documentation of OpenCV's module `calib3d`.

use snell_math::{DMat2, DVec2, DVec3, real};
use std::f64::consts::PI;

/// How often a step towards the undistorted point is taken at most.
const MOST_STEPS: usize = 60;

/// The distance at which an undistorted point counts as found, relative to its size.
const TOLERANCE: f64 = 1e-15;

/// In how many places of the way from the middle to a point its distortion is examined.
const PLACES: usize = 24;

/// A lens.
#[derive(Clone, Copy, Debug)]
pub(super) enum Distortion {
    /// Radial, tangential and thin-prism: `k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4`.
    Flat([f64; 12]),
    /// The fisheye of Kannala and Brandt (A Generic Camera Model and Calibration Method, 2006) with
    /// `k1` to `k4`: the distance from the middle is a polynomial of the angle.
    Fisheye([f64; 4]),
}

/// A direction that a point of the distorted plane stands for.
pub(super) struct Undistorted {
    /// The direction, of any length: x to the right, y down, z forward.
    pub direction: DVec3,
    /// The solid angle of a small patch around the point, per its area in the distorted plane.
    pub solid_angle: f64,
}

impl Distortion {
    /// The place in the distorted plane of a direction (x to the right, y down, z forward); `None`
    /// where the lens shows nothing: behind a flat picture, or beyond the rim where the polynomial
    /// turns back.
    pub fn place(&self, d: DVec3) -> Option<DVec2> {
        match self {
            Self::Flat(k) => {
                let p = d.truncate() / d.z;
                (d.z > 0.0 && is_monotonic(k, p)).then(|| flat(k, p))
            }
            Self::Fisheye(k) => {
                let side = d.truncate().length();
                let theta = real::atan2(side, d.z);
                let is_seen = d != DVec3::ZERO && (1..=PLACES).all(|i| slope(k, theta, i) > 0.0);
                let scale = if side > 0.0 { angular(k, theta) / side } else { 0.0 };
                is_seen.then(|| d.truncate() * scale)
            }
        }
    }

    /// The inverse of [`Self::place`].
    pub fn direction(&self, place: DVec2) -> Option<Undistorted> {
        match self {
            Self::Flat(k) => {
                let p = solve(k, place).filter(|&p| is_monotonic(k, p))?;
                let area = jacobian(k, p).determinant();
                let squared = p.length_squared() + 1.0;
                let solid_angle = 1.0 / (area * squared * squared.sqrt());
                (area > 0.0).then(|| Undistorted { direction: p.extend(1.0), solid_angle })
            }
            Self::Fisheye(k) => {
                let radius = place.length();
                let theta = solve_angle(k, radius)?;
                let growth = polynomial_slope(k, theta);
                let (sin, cos) = real::sin_cos(theta);
                let stretch = if radius > 0.0 { sin / radius } else { 1.0 };
                let direction = (place * stretch).extend(cos);
                Some(Undistorted { direction, solid_angle: stretch / growth })
            }
        }
    }
}

/// The factor of the radial part and its derivative by the squared radius.
fn radial(k: &[f64; 12], r2: f64) -> (f64, f64) {
    let [k1, k2, _, _, k3, k4, k5, k6, ..] = *k;
    let over = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let under = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
    let over_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
    let under_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
    (over / under, (over_slope * under - over * under_slope) / (under * under))
}

fn flat(k: &[f64; 12], p: DVec2) -> DVec2 {
    let [_, _, p1, p2, _, _, _, _, s1, s2, s3, s4] = *k;
    let (r2, xy) = (p.length_squared(), p.x * p.y);
    let (factor, _) = radial(k, r2);
    DVec2::new(
        p.x * factor + 2.0 * p1 * xy + p2 * (r2 + 2.0 * p.x * p.x) + r2 * (s1 + s2 * r2),
        p.y * factor + p1 * (r2 + 2.0 * p.y * p.y) + 2.0 * p2 * xy + r2 * (s3 + s4 * r2),
    )
}

fn jacobian(k: &[f64; 12], p: DVec2) -> DMat2 {
    let [_, _, p1, p2, _, _, _, _, s1, s2, s3, s4] = *k;
    let DVec2 { x, y } = p;
    let r2 = p.length_squared();
    let (factor, slope) = radial(k, r2);
    let (prism_x, prism_y) = (s1 + 2.0 * s2 * r2, s3 + 2.0 * s4 * r2);
    let xx = factor + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x + 2.0 * x * prism_x;
    let xy = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
    let yy = factor + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x + 2.0 * y * prism_y;
    DMat2::from_cols(DVec2::new(xx, xy + 2.0 * x * prism_y), DVec2::new(xy + 2.0 * y * prism_x, yy))
}

/// True if the radial part grows all the way from the middle to a point. Beyond, a lens shows
/// nothing, although the polynomial has values.
fn is_monotonic(k: &[f64; 12], p: DVec2) -> bool {
    let r2 = p.length_squared();
    let grows = |i: usize| {
        let s = r2 * i as f64 / PLACES as f64;
        let (factor, slope) = radial(k, s);
        factor + 2.0 * s * slope > 0.0 && factor > 0.0
    };
    r2.is_finite() && (1..=PLACES).all(grows)
}

/// Newton's method with steps that are halved while they lead away.
fn solve(k: &[f64; 12], place: DVec2) -> Option<DVec2> {
    let mut p = place;
    // The polynomial may have turned back there already.
    while !is_monotonic(k, p) && p.length_squared() > 1e-12 {
        p *= 0.8;
    }
    let mut residual = flat(k, p) - place;
    for _ in 0..MOST_STEPS {
        let matrix = jacobian(k, p);
        if matrix.determinant() == 0.0 || !residual.is_finite() {
            return None;
        }
        let mut step = matrix.inverse() * residual;
        let mut found = None;
        for _ in 0..40 {
            let next = p - step;
            let left = flat(k, next) - place;
            if left.length_squared() <= residual.length_squared() {
                found = Some((next, left));
                break;
            }
            step *= 0.5;
        }
        // No step leads nearer: this is as near as rounding lets it come.
        let Some((next, left)) = found else { break };
        (p, residual) = (next, left);
        if step.length() <= TOLERANCE * p.length() {
            break;
        }
    }
    (residual.length() <= 1e-11 * (1.0 + place.length())).then_some(p)
}

/// The distance from the middle at an angle.
fn angular(k: &[f64; 4], theta: f64) -> f64 {
    let s = theta * theta;
    theta * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))))
}

/// The derivative of [`angular`].
fn polynomial_slope(k: &[f64; 4], theta: f64) -> f64 {
    let s = theta * theta;
    1.0 + s * (3.0 * k[0] + s * (5.0 * k[1] + s * (7.0 * k[2] + s * 9.0 * k[3])))
}

/// [`polynomial_slope`] in one of [`PLACES`] places from the middle to an angle.
fn slope(k: &[f64; 4], theta: f64, place: usize) -> f64 {
    polynomial_slope(k, theta * place as f64 / PLACES as f64)
}

/// The angle from 0 to pi at a distance from the middle, by Newton's method within an interval in
/// which the polynomial grows, that is halved where a step leads out of it.
fn solve_angle(k: &[f64; 4], radius: f64) -> Option<f64> {
    let (mut low, mut high) = (0.0, 0.0);
    while angular(k, high) < radius {
        (low, high) = (high, high + PI / 64.0);
        if polynomial_slope(k, high) <= 0.0 {
            high = rim(k, low, high);
            break;
        }
        if high > PI {
            return None;
        }
    }
    let mut theta = 0.5 * (low + high);
    for _ in 0..MOST_STEPS {
        let over = angular(k, theta) - radius;
        *(if over < 0.0 { &mut low } else { &mut high }) = theta;
        let next = theta - over / polynomial_slope(k, theta);
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        if (next - theta).abs() <= TOLERANCE * theta {
            break;
        }
        theta = next;
    }
    let is_found = (angular(k, theta) - radius).abs() <= 1e-11 * (1.0 + radius);
    is_found.then_some(theta)
}

/// The angle between two others at which the polynomial turns back.
fn rim(k: &[f64; 4], mut low: f64, mut high: f64) -> f64 {
    for _ in 0..MOST_STEPS {
        let middle = 0.5 * (low + high);
        *(if polynomial_slope(k, middle) > 0.0 { &mut low } else { &mut high }) = middle;
    }
    low
}

#[cfg(test)]
mod tests {
    use super::Distortion;
    use snell_math::{DVec2, DVec3};

    const LENSES: [Distortion; 4] = [
        Distortion::Flat([-0.28, 0.07, 1e-3, -5e-4, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        Distortion::Flat([0.2, 0.05, 0.0, 2e-3, 0.0, 0.1, 0.02, 0.003, 1e-3, 2e-4, -1e-3, 1e-4]),
        Distortion::Fisheye([0.02, -0.005, 0.001, -0.0002]),
        Distortion::Fisheye([0.0; 4]),
    ];

    /// Points on a grid over the plane.
    fn grid() -> impl Iterator<Item = DVec2> {
        (0..441).map(|i| DVec2::new(f64::from(i % 21) - 10.0, f64::from(i / 21) - 10.0) * 0.06)
    }

    #[test]
    fn directions_come_back_to_their_places() {
        for lens in LENSES {
            for place in grid() {
                let Some(found) = lens.direction(place) else { continue };
                let back = lens.place(found.direction * 3.0).expect("it is seen");
                assert!((back - place).length() < 1e-13, "{place} {back} {lens:?}");
            }
            assert!(lens.direction(DVec2::new(0.3, -0.2)).is_some(), "{lens:?}");
        }
    }

    #[test]
    fn solid_angles_are_those_between_neighbouring_directions() {
        let h = 1e-4;
        for lens in LENSES {
            for place in [DVec2::new(0.1, 0.2), DVec2::new(-0.4, 0.3)] {
                let at = |x: f64, y: f64| {
                    let found = lens.direction(place + DVec2::new(x, y)).expect("it is seen");
                    found.direction.normalize()
                };
                let across = (at(h, 0.0) - at(-h, 0.0)).cross(at(0.0, h) - at(0.0, -h)).length();
                let solid_angle = lens.direction(place).expect("it is seen").solid_angle;
                assert!((across / (4.0 * h * h) / solid_angle - 1.0).abs() < 1e-5, "{lens:?}");
            }
        }
    }

    #[test]
    fn beyond_the_rim_nothing_is_seen() {
        // With k1 alone the radius 1 / sqrt(-3 k1) is the largest that is seen.
        let mut k = [0.0; 12];
        k[0] = -0.3;
        let (lens, rim) = (Distortion::Flat(k), 1.0 / 0.9f64.sqrt());
        assert!(lens.place(DVec3::new(rim * 0.99, 0.0, 1.0)).is_some());
        assert!(lens.place(DVec3::new(rim * 1.01, 0.0, 1.0)).is_none());
        assert!(lens.direction(DVec2::new(rim * 2.0 / 3.0 * 1.001, 0.0)).is_none());
        assert!(lens.place(DVec3::new(0.1, 0.1, -1.0)).is_none());
        // theta - theta^3 / 3 grows to 2 / 3, at an angle of 1.
        let lens = Distortion::Fisheye([-1.0 / 3.0, 0.0, 0.0, 0.0]);
        assert!(lens.direction(DVec2::new(2.0 / 3.0 - 1e-6, 0.0)).is_some());
        assert!(lens.direction(DVec2::new(2.0 / 3.0 + 1e-6, 0.0)).is_none());
        assert!(Distortion::Fisheye([1e300; 4]).direction(DVec2::new(0.2, 0.1)).is_none());
        // A fisheye sees what is behind its plane.
        assert!(LENSES[3].place(DVec3::new(1.0, 0.0, -0.5)).is_some());
    }
}
