//! Media by name: absorption and scattering of everyday materials.

use snell_math::Rgb;

/// Coefficients per millimetre: absorption, and reduced (isotropic) scattering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients {
    pub sigma_a: Rgb,
    pub sigma_s: Rgb,
}

/// Measured by H. W. Jensen, S. Marschner, M. Levoy and P. Hanrahan (A Practical Model for
/// Subsurface Light Transport, 2001, figure 5): name, scattering, absorption.
const MEASURED: [(&str, [f32; 3], [f32; 3]); 12] = [
    ("apple", [2.29, 2.39, 1.97], [0.0030, 0.0034, 0.046]),
    ("chicken1", [0.15, 0.21, 0.38], [0.015, 0.077, 0.19]),
    ("chicken2", [0.19, 0.25, 0.32], [0.018, 0.088, 0.20]),
    ("cream", [7.38, 5.47, 3.15], [0.0002, 0.0028, 0.0163]),
    ("ketchup", [0.18, 0.07, 0.03], [0.061, 0.97, 1.45]),
    ("marble", [2.19, 2.62, 3.00], [0.0021, 0.0041, 0.0071]),
    ("potato", [0.68, 0.70, 0.55], [0.0024, 0.0090, 0.12]),
    ("skimmilk", [0.70, 1.22, 1.90], [0.0014, 0.0025, 0.0142]),
    ("skin1", [0.74, 0.88, 1.01], [0.032, 0.17, 0.48]),
    ("skin2", [1.09, 1.59, 1.79], [0.013, 0.070, 0.145]),
    ("spectralon", [11.6, 20.4, 14.9], [0.0, 0.0, 0.0]),
    ("wholemilk", [2.55, 3.21, 3.77], [0.0011, 0.0024, 0.014]),
];

/// The medium of this name, in any case.
pub fn named(name: &str) -> Option<Coefficients> {
    let plain: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
    let found = MEASURED.iter().find(|(known, ..)| known.eq_ignore_ascii_case(&plain));
    found.map(|(_, s, a)| Coefficients { sigma_a: Rgb::from(*a), sigma_s: Rgb::from(*s) })
}

/// The diffuse reflectance of a semi-infinite medium from its single-scattering albedo and mean
/// cosine (van de Hulst's approximation).
pub fn color_of_albedo(albedo: f32, g: f32) -> f32 {
    let albedo = albedo.clamp(0.0, 1.0);
    let s = ((1.0 - albedo) / (1.0 - albedo * g).max(1e-6)).max(0.0).sqrt();
    ((1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_as_people_write_them() {
        assert_eq!(named("Skim milk").or(named("Skimmilk")), named("skimmilk"));
        assert!(named("skin1").is_some() && named("Coke").is_none());
    }

    #[test]
    fn what_absorbs_nothing_is_white() {
        assert_eq!(color_of_albedo(1.0, 0.5), 1.0);
        assert!(color_of_albedo(0.5, 0.0) < 0.2);
    }
}
