//! The light that hot gas emits.

use snell_math::spectrum::response::{luminance_of_light, rgb_of_light};
use snell_math::{ColorMode, Rgb, SampledSpectrum, real};
use std::sync::LazyLock;

/// Temperature in kelvin below which the emission is invisible.
const COLDEST: f32 = 500.0;
/// Temperature in kelvin above which the colour hardly changes.
const HOTTEST: f32 = 20_000.0;
/// Kelvin between the entries of the tables.
const STEP: f32 = 50.0;

/// Spectral radiance of a black body (Planck), in arbitrary units, at a wavelength in nm.
fn planck(lambda: f32, kelvin: f32) -> f64 {
    // The second radiation constant in nm K.
    const C2: f64 = 1.438_776_877e7;
    let lambda = f64::from(lambda);
    1e15 / (real::powi(lambda, 5) * real::exp_m1(C2 / (lambda * f64::from(kelvin))))
}

/// For each temperature, the colour with luminance 1, and the luminance of [`planck`].
static COLORS: LazyLock<Vec<(Rgb, f64)>> = LazyLock::new(|| {
    let count = ((HOTTEST - COLDEST) / STEP) as usize + 1;
    let entry = |i: usize| {
        let kelvin = COLDEST + STEP * i as f32;
        // Values are relative to the middle of the visible range, so that single precision can
        // represent the colours.
        let unit = planck(600.0, kelvin);
        let color = rgb_of_light(|lambda| planck(lambda, kelvin) / unit);
        let luminance = color.luminance();
        (color * (1.0 / luminance), f64::from(luminance) * unit)
    };
    (0..count).map(entry).collect()
});

/// The light of a black body, scaled to luminance 1; black below 500 K.
pub fn blackbody(kelvin: f32, mode: ColorMode) -> SampledSpectrum {
    if kelvin.is_nan() || kelvin < COLDEST {
        return SampledSpectrum::ZERO;
    }
    let kelvin = kelvin.min(HOTTEST);
    let at = (kelvin - COLDEST) / STEP;
    let low = (at as usize).min(COLORS.len() - 2);
    let t = at - low as f32;
    let (a, b) = (COLORS[low], COLORS[low + 1]);
    // Luminances grow nearly exponentially, so their logarithms are interpolated.
    let luminance = || real::exp(real::ln(a.1) + f64::from(t) * real::ln(b.1 / a.1));
    // Colours outside of the gamut, such as those of embers, have a negative lane.
    let color = (a.0 * (1.0 - t) + b.0 * t).map(|x| x.max(0.0));
    mode.lanes(color, |lambda| (planck(lambda, kelvin) / luminance()) as f32)
}

/// The luminance of a black body divided by its maximum spectral radiance, in units in which light
/// of radiance 1 at all wavelengths has luminance 1; 0 below 500 K. (Some renderers scale black
/// bodies to a maximum of 1.)
pub fn blackbody_luminance(kelvin: f32) -> f32 {
    if kelvin.is_nan() || kelvin < COLDEST {
        return 0.0;
    }
    let kelvin = kelvin.min(HOTTEST);
    // Wien's displacement constant in nm K.
    let largest = planck(2_897_772.0 / kelvin, kelvin);
    luminance_of_light(|lambda| planck(lambda, kelvin) / largest) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn embers_are_red_flames_yellow_and_stars_blue() {
        let at = |kelvin| blackbody(kelvin, ColorMode::Rgb);
        let [embers, flame, star] = [900.0, 1900.0, 12_000.0].map(at);
        assert!(embers[0] > 3.0 * embers[1] && embers[2] == 0.0, "{embers:?}");
        assert!(flame[0] > flame[1] && flame[1] > 2.0 * flame[2], "{flame:?}");
        assert!(star[2] > star[1] && star[1] > star[0], "{star:?}");
        // The white of Rec. 709 is near 6500 K.
        let white = at(6500.0);
        assert!(
            (white[0] / white[2] - 1.0).abs() < 0.1 && (white[1] / white[2] - 1.0).abs() < 0.1,
            "{white:?}"
        );
    }

    #[test]
    fn cool_gas_shines_mostly_beyond_the_visible() {
        let [ember, flame, sun] = [1000.0, 2000.0, 5800.0].map(blackbody_luminance);
        assert!(
            ember < 1e-3 && (0.01..0.1).contains(&flame) && (0.9..1.0).contains(&sun),
            "{ember} {flame} {sun}"
        );
        assert_eq!([f32::NAN, 0.0, -5.0, 499.0].map(blackbody_luminance), [0.0; 4]);
    }

    #[test]
    fn light_has_luminance_one_and_nonsense_has_none() {
        for kelvin in [1500.0, 1975.0, 3000.0, 1e9, f32::INFINITY] {
            let c = blackbody(kelvin, ColorMode::Rgb);
            assert!((Rgb::new(c[0], c[1], c[2]).luminance() - 1.0).abs() < 0.03, "{kelvin}: {c:?}");
        }
        for kelvin in [f32::NAN, -1.0, 0.0, 300.0, f32::NEG_INFINITY] {
            assert!(blackbody(kelvin, ColorMode::Rgb).is_black(), "{kelvin}");
        }
    }
}
