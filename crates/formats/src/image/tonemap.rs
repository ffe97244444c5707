//! Converts scene-linear values to display values: exposure, tone map, sRGB curve.

use super::{Display, Tonemap};
use snell_math::real;
use snell_math::spectrum::linear_to_srgb;

/// Display values, each from 0 to 1, of a scene-linear Rec. 709 colour. NaN counts as 0.
pub fn display_value(rgb: [f32; 3], display: &Display) -> [f32; 3] {
    let exposure = real::exp2(display.exposure as f32);
    let exposed = rgb.map(|v| bounded(v * exposure, f32::MAX));
    let mapped = match display.tonemap {
        Tonemap::None => exposed,
        Tonemap::Aces => aces(exposed),
        Tonemap::Agx => agx(exposed),
    };
    let clamped = mapped.map(|v| bounded(v, 1.0));
    if display.srgb { clamped.map(|v| linear_to_srgb(v).clamp(0.0, 1.0)) } else { clamped }
}

/// Clamps to the range from 0 to `highest`; NaN becomes 0.
fn bounded(value: f32, highest: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, highest) }
}

fn multiply(matrix: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Inputs are limited to this value: tone maps are flat beyond it, and larger squares might
/// overflow.
const BRIGHTEST: f32 = 1e6;

/// The ACES reference rendering and sRGB output transforms as fitted by Stephen Hill (2016),
/// published with the sample program of Matt Pettineo and David Neubelt, "BakingLab".
fn aces(rgb: [f32; 3]) -> [f32; 3] {
    /// Linear sRGB to the working space of the fit (AP1 with the transform's desaturation).
    const INPUT: [[f32; 3]; 3] =
        [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
    /// From the working space of the fit back to linear sRGB.
    const OUTPUT: [[f32; 3]; 3] = [
        [1.60475, -0.53108, -0.07367],
        [-0.10208, 1.10813, -0.00605],
        [-0.00327, -0.07276, 1.07602],
    ];
    let fit =
        |v: f32| (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081);
    multiply(&OUTPUT, multiply(&INPUT, rgb.map(|v| v.min(BRIGHTEST))).map(fit))
}

/// AgX by Troy Sobotka (2022), with Benjamin Wrensch's polynomial for its default curve ("Minimal
/// AgX Implementation", 2023).
fn agx(rgb: [f32; 3]) -> [f32; 3] {
    const INSET: [[f32; 3]; 3] = [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ];
    const OUTSET: [[f32; 3]; 3] = [
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ];
    /// The range of the curve in stops around 1.
    const STOPS: [f32; 2] = [-12.47393, 4.026069];
    let curve = |v: f32| {
        let x = (real::log2(v.max(f32::MIN_POSITIVE)).clamp(STOPS[0], STOPS[1]) - STOPS[0])
            / (STOPS[1] - STOPS[0]);
        let terms = [-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5];
        terms.iter().rev().fold(0.0, |sum, c| sum * x + c)
    };
    let inset = multiply(&INSET, rgb.map(|v| v.min(BRIGHTEST)));
    // The curve gives values for a display of gamma 2.2.
    multiply(&OUTSET, inset.map(curve)).map(|v| real::powf(v.max(0.0), 2.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Tonemap; 3] = [Tonemap::None, Tonemap::Aces, Tonemap::Agx];

    #[test]
    fn display_values_lie_in_the_unit_interval_for_any_input() {
        let odd = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            -1.0,
            0.0,
            1e-40,
            0.18,
            1.0,
            70000.0,
        ];
        for tonemap in ALL {
            for exposure in [-200.0, 0.0, 200.0, f64::NAN] {
                for srgb in [false, true] {
                    for (r, g) in odd.iter().flat_map(|r| odd.map(|g| (*r, g))) {
                        let shown =
                            display_value([r, g, 0.5], &Display { exposure, tonemap, srgb });
                        assert!(
                            shown.iter().all(|v| (0.0..=1.0).contains(v)),
                            "{tonemap:?} {r} {g}: {shown:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn more_light_is_never_darker() {
        for tonemap in ALL {
            let display = Display { tonemap, ..Display::default() };
            let greys =
                (-100..100).map(|i| display_value([(i as f32 * 0.1).exp2(); 3], &display)[1]);
            let greys: Vec<f32> = greys.collect();
            // The polynomial of AgX dips by less than one level of 16 bits at the dark end.
            assert!(greys.windows(2).all(|w| w[1] >= w[0] - 1e-3), "{tonemap:?}");
        }
    }

    #[test]
    fn grey_stays_grey_within_one_level() {
        for tonemap in ALL {
            let [r, g, b] = display_value([0.18; 3], &Display { tonemap, ..Display::default() });
            assert!((r - g).abs() < 0.004 && (g - b).abs() < 0.004, "{tonemap:?}: {r} {g} {b}");
        }
    }

    #[test]
    fn an_exposure_of_one_stop_doubles() {
        let linear = Display { exposure: 1.0, tonemap: Tonemap::None, srgb: false };
        assert_eq!(display_value([0.1, 0.2, 0.9], &linear), [0.2, 0.4, 1.0]);
    }

    #[test]
    fn white_of_each_tone_map_is_where_its_authors_put_it() {
        let linear =
            |tonemap| display_value([1.0; 3], &Display { exposure: 0.0, tonemap, srgb: false })[1];
        // Hill's fit at 1: (1.0245786 - 0.000090537) / (0.983729 + 0.432951 + 0.238081) = 0.61912.
        assert!((linear(Tonemap::Aces) - 0.619).abs() < 0.002, "{}", linear(Tonemap::Aces));
        // The AgX curve is at 0.7833 (of gamma 2.2) for x = 12.47393 / 16.5 = 0.756.
        assert!(
            (linear(Tonemap::Agx).powf(1.0 / 2.2) - 0.7833).abs() < 0.01,
            "{}",
            linear(Tonemap::Agx)
        );
    }
}
