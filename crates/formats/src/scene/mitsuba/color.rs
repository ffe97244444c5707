//! Converts the colours of properties to reflectances, light and single numbers; indices of
//! refraction by name.

use super::value::Hue;
use snell_math::Rgb;
use snell_math::real;
use snell_math::spectrum::Spectrum;
use snell_math::spectrum::cie::{LAMBDA_MAX, LAMBDA_MIN, OBSERVER_1931};
use snell_scene::material::ColorParam;

/// The reflectance of a surface.
pub fn reflectance(hue: Hue) -> ColorParam {
    match hue {
        Hue::Rgb(rgb) => rgb.into(),
        Hue::Uniform(x) => Rgb::splat(x as f32).into(),
        Hue::Spectrum(spectrum, factor) => {
            ColorParam { spectrum: Some(spectrum), ..Rgb::splat(factor as f32).into() }
        }
    }
}

/// The colour of a factor in linear Rec. 709.
pub fn factor(hue: Hue) -> Rgb {
    match hue {
        Hue::Rgb(rgb) => rgb,
        Hue::Uniform(x) => Rgb::splat(x as f32),
        Hue::Spectrum(spectrum, factor) => spectrum.reflectance_rgb() * factor as f32,
    }
}

/// The colour of light in linear Rec. 709.
pub fn light(hue: Hue) -> Rgb {
    match emission(hue) {
        ColorParam { factor, spectrum: Some(spectrum), .. } => factor * spectrum.light_rgb(),
        ColorParam { factor, .. } => factor,
    }
}

/// The radiance of a surface. A number is a spectrum of equal energy at all wavelengths, which is
/// redder than white.
pub fn emission(hue: Hue) -> ColorParam {
    match hue {
        Hue::Uniform(x) => {
            let flat = Spectrum::table(&[[LAMBDA_MIN, 1.0], [LAMBDA_MAX, 1.0]]);
            let spectrum = Some(flat.expect("two ascending wavelengths"));
            ColorParam { spectrum, ..Rgb::splat(x as f32).into() }
        }
        other => reflectance(other),
    }
}

/// Mitsuba's luminance of a black body: its radiance in W/(m² sr nm), weighted by the standard
/// observer, relative to a spectrum of ones.
pub fn blackbody_luminance(kelvin: f64) -> f64 {
    // First and second radiation constants (CODATA 2018): 2 h c² in W m² / sr, and h c / k in m K.
    const C1: f64 = 1.191_042_972e-16;
    const C2: f64 = 1.438_776_877e-2;
    let (mut sum, mut ones) = (0.0, 0.0);
    for (i, cie) in OBSERVER_1931.iter().enumerate() {
        let meters = (f64::from(LAMBDA_MIN) + i as f64) * 1e-9;
        sum += cie[1] * C1 / (real::powi(meters, 5) * real::exp_m1(C2 / (meters * kelvin))) * 1e-9;
        ones += cie[1];
    }
    sum / ones
}

/// Indices of refraction by name, from Mitsuba's documentation.
const INDICES: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.3330),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.470),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.5750),
    ("diamond", 2.419),
];

/// The index of refraction of this name.
pub fn index_named(name: &str) -> Option<f64> {
    INDICES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|(_, index)| *index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_black_body_of_the_suns_heat_has_its_luminance() {
        // The luminance of the sun's disk is 1.6e9 cd/m² from the ground and about 2e9 cd/m²
        // outside the atmosphere. 106.857 nm is the integral of the observer's curve, 683 lm/W the
        // luminous efficacy.
        let luminance = blackbody_luminance(5778.0) * 106.857 * 683.0;
        assert!((1.7e9..2.1e9).contains(&luminance), "{luminance}");
    }
}
