//! The response of a sensor to a spectrum: CIE 1931 tristimulus values, and linear Rec. 709 with a
//! white that is exactly (1, 1, 1).
//!
//! The white is illuminant D65 as it stands in our own tables, so that rounding does not tint the
//! colour of the illuminant.

use super::cie::{D65, LAMBDA_COUNT, LAMBDA_MAX, LAMBDA_MIN, OBSERVER_1931};
use super::{LANES, Rgb, SampledSpectrum, SampledWavelengths};

/// Chromaticities of red, green and blue (ITU-R BT.709).
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];

/// D65 at the wavelengths of the observer, scaled to the luminance of light of radiance 1 at all
/// wavelengths.
static WHITE: [f32; LAMBDA_COUNT] = white();

/// The contribution of 1 nm of radiance to red, green and blue, in units in which light of radiance
/// 1 at all wavelengths has luminance 1.
static RESPONSE: [[f32; 3]; LAMBDA_COUNT] = response();

/// D65 at wavelength `i` of the observer, interpolated linearly.
const fn d65(i: usize) -> f64 {
    let (node, t) = (i / 5, (i % 5) as f64 / 5.0);
    let next = if node + 1 < D65.len() { node + 1 } else { node };
    D65[node] * (1.0 - t) + D65[next] * t
}

/// Y of light of radiance 1 at all wavelengths, in units of the observer's table.
const OBSERVED: f64 = observed();

const fn observed() -> f64 {
    let (mut sum, mut i) = (0.0, 0);
    while i < LAMBDA_COUNT {
        sum += OBSERVER_1931[i][1] * if i == 0 || i == LAMBDA_COUNT - 1 { 0.5 } else { 1.0 };
        i += 1;
    }
    sum
}

/// X, Y, Z of D65.
const fn white_xyz() -> [f64; 3] {
    let mut sum = [0.0; 3];
    let mut i = 0;
    while i < LAMBDA_COUNT {
        let weight = d65(i) * if i == 0 || i == LAMBDA_COUNT - 1 { 0.5 } else { 1.0 };
        sum[0] += weight * OBSERVER_1931[i][0];
        sum[1] += weight * OBSERVER_1931[i][1];
        sum[2] += weight * OBSERVER_1931[i][2];
        i += 1;
    }
    sum
}

const fn white() -> [f32; LAMBDA_COUNT] {
    let luminance = white_xyz()[1] / OBSERVED;
    let mut table = [0.0; LAMBDA_COUNT];
    let mut i = 0;
    while i < LAMBDA_COUNT {
        table[i] = (d65(i) / luminance) as f32;
        i += 1;
    }
    table
}

const fn response() -> [[f32; 3]; LAMBDA_COUNT] {
    let m = RGB_FROM_XYZ;
    let mut table = [[0.0; 3]; LAMBDA_COUNT];
    let mut i = 0;
    while i < LAMBDA_COUNT {
        let mut c = 0;
        while c < 3 {
            let [x, y, z] = OBSERVER_1931[i];
            table[i][c] = ((m[c][0] * x + m[c][1] * y + m[c][2] * z) / OBSERVED) as f32;
            c += 1;
        }
        i += 1;
    }
    table
}

/// Rows of the matrix from X, Y, Z (Y = 1 for white) to linear red, green and blue.
pub const RGB_FROM_XYZ: [[f64; 3]; 3] = rgb_from_xyz();

const fn rgb_from_xyz() -> [[f64; 3]; 3] {
    // The columns are X, Y, Z of each primary with Y = 1. The inverse of this matrix is scaled row
    // by row so that white becomes (1, 1, 1).
    let mut m = [[0.0; 3]; 3];
    let mut c = 0;
    while c < 3 {
        let [x, y] = PRIMARIES[c];
        m[0][c] = x / y;
        m[1][c] = 1.0;
        m[2][c] = (1.0 - x - y) / y;
        c += 1;
    }
    let mut inverse = inverse(m);
    let [x, y, z] = white_xyz();
    let mut r = 0;
    while r < 3 {
        let white = (inverse[r][0] * x + inverse[r][1] * y + inverse[r][2] * z) / y;
        inverse[r] = [inverse[r][0] / white, inverse[r][1] / white, inverse[r][2] / white];
        r += 1;
    }
    inverse
}

const fn inverse(m: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut cofactors = [[0.0; 3]; 3];
    let mut r = 0;
    while r < 3 {
        let mut c = 0;
        while c < 3 {
            let ([r1, r2], [c1, c2]) = ([(r + 1) % 3, (r + 2) % 3], [(c + 1) % 3, (c + 2) % 3]);
            cofactors[c][r] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
            c += 1;
        }
        r += 1;
    }
    let determinant =
        m[0][0] * cofactors[0][0] + m[0][1] * cofactors[1][0] + m[0][2] * cofactors[2][0];
    let mut r = 0;
    while r < 3 {
        let mut c = 0;
        while c < 3 {
            cofactors[r][c] /= determinant;
            c += 1;
        }
        r += 1;
    }
    cofactors
}

/// The index of the table entry at or below a wavelength in nm, and the fraction of the way to the
/// next entry.
#[inline]
fn place(lambda: f32) -> (usize, f32) {
    let x = (lambda - LAMBDA_MIN).clamp(0.0, LAMBDA_MAX - LAMBDA_MIN);
    let i = (x as usize).min(LAMBDA_COUNT - 2);
    (i, x - i as f32)
}

/// Spectral radiance of white light (D65) at a wavelength in nm. The light has the colour (1, 1,
/// 1); the unit is the radiance of equal-energy light of luminance 1.
#[inline]
pub fn white_light(lambda: f32) -> f32 {
    let (i, t) = place(lambda);
    WHITE[i] * (1.0 - t) + WHITE[i + 1] * t
}

/// The contribution of 1 nm of radiance 1 at a wavelength in nm to linear red, green and blue.
/// Single wavelengths lie outside of the triangle of the primaries, so some entries are negative.
#[inline]
pub fn rgb_response(lambda: f32) -> [f32; 3] {
    let (i, t) = place(lambda);
    response_at(i, t)
}

/// [`rgb_response`] at the wavelength `i + t` nm above [`LAMBDA_MIN`], with `t` in `[0, 1)`.
#[inline(always)]
fn response_at(i: usize, t: f32) -> [f32; 3] {
    std::array::from_fn(|c| RESPONSE[i][c] * (1.0 - t) + RESPONSE[i + 1][c] * t)
}

/// The estimated colour of a spectrum from its values at sampled wavelengths.
pub fn rgb_of_samples(spectrum: SampledSpectrum, wavelengths: &SampledWavelengths) -> Rgb {
    let mut rgb = [0.0; 3];
    for (value, lambda) in spectrum.0.into_iter().zip(wavelengths.lambda()) {
        let (whole, rest) = place(lambda);
        let weight = value * (1.0 / LANES as f32) * SampledWavelengths::inverse_pdf(whole, rest);
        rgb.iter_mut()
            .zip(response_at(whole, rest))
            .for_each(|(sum, response)| *sum += weight * response);
    }
    rgb.into()
}

/// The colour of a light of this spectral radiance, by a sum over the visible range in steps of 1
/// nm.
pub fn rgb_of_light(radiance: impl Fn(f32) -> f64) -> Rgb {
    let mut sum = [0.0; 3];
    for (i, response) in RESPONSE.iter().enumerate() {
        let weight = if i == 0 || i == LAMBDA_COUNT - 1 { 0.5 } else { 1.0 };
        let value = radiance(LAMBDA_MIN + i as f32) * weight;
        sum.iter_mut().zip(response).for_each(|(sum, r)| *sum += value * f64::from(*r));
    }
    sum.map(|x| x as f32).into()
}

/// The luminance of a light of this spectral radiance; a radiance of 1 at all wavelengths has
/// luminance 1.
pub fn luminance_of_light(radiance: impl Fn(f32) -> f64) -> f64 {
    let value = |i: usize| {
        let weight = if i == 0 || i == LAMBDA_COUNT - 1 { 0.5 } else { 1.0 };
        radiance(LAMBDA_MIN + i as f32) * OBSERVER_1931[i][1] * weight
    };
    (0..LAMBDA_COUNT).map(value).sum::<f64>() / OBSERVED
}

/// The colour that a surface of this reflectance has in white light (D65).
pub fn rgb_of_reflectance(reflectance: impl Fn(f32) -> f64) -> Rgb {
    rgb_of_light(|lambda| reflectance(lambda) * f64::from(white_light(lambda)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_is_one_and_the_matrix_is_that_of_the_standard() {
        let [r, g, b] = rgb_of_reflectance(|_| 1.0).to_array();
        assert!([r, g, b].iter().all(|c| (c - 1.0).abs() < 1e-5), "{r} {g} {b}");
        // The expected matrix is that of IEC 61966-2-1, for the white point (0.3127, 0.3290).
        let standard =
            [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
        for (row, expected) in RGB_FROM_XYZ.iter().zip(standard) {
            assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3), "{row:?}");
        }
    }

    #[test]
    fn sampled_wavelengths_see_the_same_colour() {
        let reflectance = |lambda: f32| 0.5 + 0.4 * (lambda / 60.0).sin();
        let expected = rgb_of_reflectance(|lambda| f64::from(reflectance(lambda))).to_array();
        let n = 2048;
        let mut mean = [0.0; 3];
        for i in 0..n {
            let wavelengths = SampledWavelengths::sample((i as f32 + 0.5) / n as f32);
            let values =
                SampledSpectrum(wavelengths.lambda().map(|l| reflectance(l) * white_light(l)));
            let rgb = rgb_of_samples(values, &wavelengths).to_array();
            mean.iter_mut().zip(rgb).for_each(|(m, x)| *m += f64::from(x) / f64::from(n));
        }
        assert!(
            mean.iter().zip(expected).all(|(m, e)| (m - f64::from(e)).abs() < 1e-3),
            "{mean:?} {expected:?}"
        );
    }

    /// The rows of a CSV file of the shared data, without its header; `None` if the data are
    /// absent.
    fn csv(name: &str) -> Option<Vec<Vec<String>>> {
        let path =
            format!("{}/../../../shared/data/spectra/cie/{name}", env!("CARGO_MANIFEST_DIR"));
        let Ok(text) = std::fs::read_to_string(&path) else {
            eprintln!("skipped: there is no {path}");
            return None;
        };
        Some(
            text.lines()
                .skip(1)
                .map(|line| line.split(',').map(str::to_string).collect())
                .collect(),
        )
    }

    /// The spectra of the 24 patches of the ColorChecker must give the published colours, and the
    /// upsampled spectra of these colours must give the same colours again.
    #[test]
    fn a_colour_checker_has_its_colours_and_they_come_back() {
        let (Some(spectra), Some(colors)) = (
            csv("colorchecker_babelcolor_reflectance.csv"),
            csv("colorchecker_expected_XYZ_linear_sRGB_D65.csv"),
        ) else {
            return;
        };
        let number = |text: &String| text.parse::<f32>().expect("a number");
        for (patch, row) in colors.iter().enumerate() {
            let table: Vec<[f32; 2]> =
                spectra.iter().map(|r| [number(&r[0]), number(&r[patch + 1])]).collect();
            let seen = rgb_of_reflectance(|lambda| {
                let [value] = super::super::table::lookup(&table, lambda);
                f64::from(value)
            });
            let expected = Rgb::new(number(&row[4]), number(&row[5]), number(&row[6]));
            let uplifted = super::super::uplift::RgbSpectrum::of_factor(expected);
            let back = rgb_of_reflectance(|lambda| uplifted.at_wavelength(lambda).into());
            for c in 0..3 {
                let [seen, expected, back] = [seen, expected, back].map(|rgb| rgb.to_array()[c]);
                assert!((seen - expected).abs() < 2e-3, "{}: {seen} instead of {expected}", row[0]);
                // One patch, cyan, is outside of the display gamut.
                assert!(
                    (back - expected.max(0.0)).abs() < 2e-3,
                    "{}: {expected} comes back as {back}",
                    row[0]
                );
            }
        }
    }
}
