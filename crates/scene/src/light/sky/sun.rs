//! The sun seen through the atmosphere: its extraterrestrial light, multiplied by the transmittance
//! of molecules, haze and ozone.

use snell_math::real;

/// Illuminance of the sun outside of the atmosphere on a surface that faces it, lx.
const SOLAR_CONSTANT: f64 = 133_100.0;
/// The colour of the sun outside of the atmosphere, with luminance 1, in linear Rec. 709. The
/// chromaticity (0.323, 0.333) is that of the extraterrestrial spectrum (ASTM E-490).
const COLOR: [f64; 3] = [1.091, 0.979, 0.942];
/// Representative wavelengths of the channels, in micrometres.
const WAVELENGTHS: [f64; 3] = [0.612, 0.549, 0.465];
/// Absorption coefficient of ozone at these wavelengths, per cm.
const OZONE: [f64; 3] = [0.118, 0.084, 0.0075];
/// Thickness of the ozone layer, cm at normal pressure.
const OZONE_LAYER: f64 = 0.35;

/// Illuminance on a surface that faces the sun, per channel; its luminance is in lx. The elevation
/// is in degrees. The transmittances are those of Preetham, Shirley and Smits, A Practical Analytic
/// Model for Daylight, 1999, appendix A; the air mass is that of Kasten and Young, 1989.
pub(super) fn illuminance(elevation: f64, turbidity: f64) -> [f64; 3] {
    let elevation = elevation.clamp(0.0, 90.0);
    let mass = 1.0
        / (real::sin(elevation.to_radians())
            + 0.505_72 * real::powf(elevation + 6.079_95, -1.6364));
    // Angstrom's turbidity coefficient.
    let haze = (0.046_08 * turbidity - 0.045_86).max(0.0);
    std::array::from_fn(|c| {
        let wavelength: f64 = WAVELENGTHS[c];
        let molecules = 0.008_735 * real::powf(wavelength, -4.08);
        let depth = molecules + haze * real::powf(wavelength, -1.3) + OZONE[c] * OZONE_LAYER;
        SOLAR_CONSTANT * COLOR[c] * real::exp(-mass * depth)
    })
}
