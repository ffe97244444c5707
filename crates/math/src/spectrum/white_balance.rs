//! White balance: colours as a camera shows them that takes a given light for white.

use super::authored::planck;
use super::response::{RGB_FROM_XYZ, rgb_of_light};
use crate::{DMat3, DVec3};
use std::ops::RangeInclusive;

/// The temperatures in kelvin of lights that a camera can take for white.
pub const WHITE_TEMPERATURES: RangeInclusive<f64> = 1000.0..=25_000.0;

/// The rows of the matrix from CIE XYZ to the responses of cones in the Bradford method.
const CONES: [[f64; 3]; 3] =
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// The matrix in CIE XYZ that adapts colours from one white to another by the Bradford method
/// (Lindbloom, "Chromatic Adaptation").
pub fn adaptation(from: DVec3, to: DVec3) -> DMat3 {
    let cones_from_xyz = matrix(&CONES);
    let gain = (cones_from_xyz * to) / (cones_from_xyz * from);
    cones_from_xyz.inverse() * DMat3::from_diagonal(gain) * cones_from_xyz
}

/// The matrix in linear Rec. 709 that turns daylight of a temperature in kelvin into white of the
/// same luminance, as sensors of pbrt do. Temperatures outside of [`WHITE_TEMPERATURES`] count as
/// the nearest one inside.
pub fn white_balance(kelvin: f64) -> DMat3 {
    let rgb_from_xyz = matrix(&RGB_FROM_XYZ);
    let xyz_from_rgb = rgb_from_xyz.inverse();
    rgb_from_xyz
        * adaptation(daylight(kelvin, xyz_from_rgb), xyz_from_rgb * DVec3::ONE)
        * xyz_from_rgb
}

/// The CIE XYZ colour, with Y = 1, of daylight of a temperature (CIE 015:2018, section 4.1.2), and
/// below 4000 K, where daylight is not defined, of a black body.
fn daylight(kelvin: f64, xyz_from_rgb: DMat3) -> DVec3 {
    let (coldest, hottest) = WHITE_TEMPERATURES.into_inner();
    // Temperatures have been redefined since the CIE published the formula.
    let t = kelvin.clamp(coldest, hottest) * (1.4388 / 1.4380);
    if t < 4000.0 {
        let [r, g, b] = rgb_of_light(|lambda| planck(lambda.into(), t)).to_array();
        let xyz = xyz_from_rgb * DVec3::new(r.into(), g.into(), b.into());
        return xyz / xyz.y;
    }
    let [a, b, c, d] = match t <= 7000.0 {
        true => [-4.607e9, 2.9678e6, 0.09911e3, 0.244_063],
        false => [-2.0064e9, 1.9018e6, 0.24748e3, 0.237_04],
    };
    let x = ((a / t + b) / t + c) / t + d;
    let y = (-3.0 * x + 2.870) * x - 0.275;
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// The matrix with these rows.
fn matrix(rows: &[[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(rows).transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Spectrum;

    #[test]
    fn the_chosen_light_becomes_white_and_d65_stays() {
        for kelvin in [1500.0_f32, 2856.0, 3900.0] {
            let lamp = Spectrum::blackbody(kelvin).expect("a temperature").light_rgb().to_array();
            // The temperature of daylight is 1.0006 times that of a black body.
            let seen = white_balance(kelvin.into()) * DVec3::from(lamp.map(f64::from));
            assert!((seen - DVec3::ONE).abs().max_element() < 5e-3, "{kelvin} K: {seen}");
        }
        let d65 = white_balance(6500.0);
        assert!((d65 * DVec3::ONE - DVec3::ONE).abs().max_element() < 2e-3, "{d65}");
        let [r, _, b] = (white_balance(4000.0) * DVec3::ONE).to_array();
        assert!(r < 0.8 && b > 1.3, "white light is blue to a camera that expects {r} {b}");
        assert!(white_balance(f64::INFINITY).is_finite() && white_balance(-1.0).is_finite());
    }

    #[test]
    fn daylight_of_5000_kelvin_is_d50() {
        let d50 = daylight(5000.0, DMat3::IDENTITY);
        let [x, y] = [d50.x, d50.y].map(|v| v / (d50.x + d50.y + d50.z));
        assert!((x - 0.3457).abs() < 2e-4 && (y - 0.3585).abs() < 2e-4, "{x} {y}");
    }
}
