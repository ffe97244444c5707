//! Metals by name, with measured complex indices of refraction.
//!
//! The tables are those of refractiveindex.info (M. N. Polyanskiy, Sci. Data 11, 94, 2024; CC0),
//! from the papers named at each table. They run from the last entry below 360 nm to the first
//! above 830 nm. The tables of platinum and tungsten are `Rakic-LD`, a fit to optical measurements,
//! sampled at fewer wavelengths here (the tables of Werner et al. come from electrons, not from
//! light).

use super::response::rgb_of_reflectance;
use super::{ColorMode, Rgb, SampledSpectrum, table};
use crate::real;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// A metal with a measured index of refraction `n + i k`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Metal(usize);

/// The data of a metal.
struct Entry {
    symbol: &'static str,
    name: &'static str,
    /// Rows of wavelength in nm, n and k, by ascending wavelength.
    rows: &'static [[f32; 3]],
}

/// Values of n and of k for red, green and blue, for each metal.
static RGB: LazyLock<Vec<[Rgb; 2]>> =
    LazyLock::new(|| Metal::all().map(Metal::rgb_indices).collect());

impl Metal {
    /// All metals.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..METALS.len()).map(Self)
    }

    /// The metal of this chemical symbol or English name, in any case; `None` if it is unknown.
    pub fn named(name: &str) -> Option<Self> {
        let is = |other: &str| other.eq_ignore_ascii_case(name);
        METALS.iter().position(|m| is(m.symbol) || is(m.name)).map(Self)
    }

    /// Chemical symbol, such as `Au`.
    pub fn symbol(self) -> &'static str {
        METALS[self.0].symbol
    }

    /// English name, such as `gold`.
    pub fn name(self) -> &'static str {
        METALS[self.0].name
    }

    /// Real and imaginary part of the index of refraction at a wavelength in nm.
    pub fn index(self, lambda: f32) -> [f32; 2] {
        table::lookup(METALS[self.0].rows, lambda)
    }

    /// Real and imaginary part of the index of refraction for a colour mode.
    pub fn indices(self, mode: ColorMode) -> [SampledSpectrum; 2] {
        match mode {
            ColorMode::Rgb => RGB[self.0].map(|rgb| mode.lanes(rgb, |_| 0.0)),
            ColorMode::Spectral(_) => {
                let lanes = |part: usize| mode.lanes(Rgb::BLACK, |lambda| self.index(lambda)[part]);
                [lanes(0), lanes(1)]
            }
        }
    }

    /// Reflectance at normal incidence at a wavelength in nm.
    pub fn reflectance(self, lambda: f32) -> f32 {
        let [n, k] = self.index(lambda);
        ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k)
    }

    /// Indices n and k for red, green and blue. Each n is the mean over its channel, and each k is
    /// chosen so that the colour of the measured reflectance at normal incidence is reproduced.
    fn rgb_indices(self) -> [Rgb; 2] {
        let smallest = METALS[self.0].rows.iter().map(|row| row[1]).fold(f32::INFINITY, f32::min);
        let n = rgb_of_reflectance(|lambda| self.index(lambda)[0].into()).map(|n| n.max(smallest));
        let r = rgb_of_reflectance(|lambda| self.reflectance(lambda).into())
            .map(|r| r.clamp(0.0, 0.999));
        let k = |n: f32, r: f32| {
            ((r * real::powi(n + 1.0, 2) - real::powi(n - 1.0, 2)) / (1.0 - r)).max(0.0).sqrt()
        };
        [n, Rgb::new(k(n.r, r.r), k(n.g, r.g), k(n.b, r.b))]
    }
}

impl From<Metal> for String {
    fn from(metal: Metal) -> Self {
        metal.symbol().into()
    }
}

impl TryFrom<String> for Metal {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::named(&name).ok_or_else(|| {
            let known: Vec<_> = Self::all().map(Self::symbol).collect();
            format!("there is no metal \"{name}\" (known: {})", known.join(", "))
        })
    }
}

/// All metals, ordered by symbol.
const METALS: &[Entry] = &[
    Entry { symbol: "Ag", name: "silver", rows: SILVER },
    Entry { symbol: "Al", name: "aluminium", rows: ALUMINIUM },
    Entry { symbol: "Au", name: "gold", rows: GOLD },
    Entry { symbol: "Cr", name: "chromium", rows: CHROMIUM },
    Entry { symbol: "Cu", name: "copper", rows: COPPER },
    Entry { symbol: "Fe", name: "iron", rows: IRON },
    Entry { symbol: "Ni", name: "nickel", rows: NICKEL },
    Entry { symbol: "Pt", name: "platinum", rows: PLATINUM },
    Entry { symbol: "Ti", name: "titanium", rows: TITANIUM },
    Entry { symbol: "W", name: "tungsten", rows: TUNGSTEN },
];

/// Johnson and Christy, Optical constants of the noble metals, Phys. Rev. B 6 (1972).
#[rustfmt::skip]
const SILVER: &[[f32; 3]] = &[
    [354.2, 0.1, 1.419], [367.9, 0.07, 1.657], [381.5, 0.05, 1.864], [397.4, 0.05, 2.07],
    [413.3, 0.05, 2.275], [430.5, 0.04, 2.462], [450.9, 0.04, 2.657], [471.4, 0.05, 2.869],
    [495.9, 0.05, 3.093], [520.9, 0.05, 3.324], [548.6, 0.06, 3.586], [582.1, 0.05, 3.858],
    [616.8, 0.06, 4.152], [659.5, 0.05, 4.483], [704.5, 0.04, 4.838], [756.0, 0.03, 5.242],
    [821.1, 0.04, 5.727], [892.0, 0.04, 6.312],
];

/// Rakic, Algorithm for the determination of intrinsic optical constants of metal films, Appl. Opt.
/// 34 (1995).
#[rustfmt::skip]
const ALUMINIUM: &[[f32; 3]] = &[
    [326.28, 0.31474, 3.9165], [364.66, 0.39877, 4.3957], [413.28, 0.52135, 5.0008],
    [442.8, 0.6079, 5.3676], [476.87, 0.7278, 5.7781], [516.6, 0.8734, 6.2418],
    [563.57, 1.0728, 6.7839], [619.93, 1.366, 7.4052], [652.25, 1.5724, 7.7354],
    [688.81, 1.8301, 8.0601], [729.32, 2.1606, 8.3565], [774.91, 2.6154, 8.4914],
    [794.78, 2.7675, 8.3866], [815.69, 2.7668, 8.2573], [837.74, 2.6945, 8.1878],
];

/// Johnson and Christy, Optical constants of the noble metals, Phys. Rev. B 6 (1972).
#[rustfmt::skip]
const GOLD: &[[f32; 3]] = &[
    [354.2, 1.5, 1.866], [367.9, 1.48, 1.895], [381.5, 1.46, 1.933], [397.4, 1.47, 1.952],
    [413.3, 1.46, 1.958], [430.5, 1.45, 1.948], [450.9, 1.38, 1.914], [471.4, 1.31, 1.849],
    [495.9, 1.04, 1.833], [520.9, 0.62, 2.081], [548.6, 0.43, 2.455], [582.1, 0.29, 2.863],
    [616.8, 0.21, 3.272], [659.5, 0.14, 3.697], [704.5, 0.13, 4.103], [756.0, 0.14, 4.542],
    [821.1, 0.16, 5.083], [892.0, 0.17, 5.663],
];

/// Johnson and Christy, Optical constants of transition metals, Phys. Rev. B 9 (1974).
#[rustfmt::skip]
#[expect(clippy::approx_constant, reason = "measured")]
const CHROMIUM: &[[f32; 3]] = &[
    [354.0, 1.84, 2.64], [368.0, 1.87, 2.69], [381.0, 1.92, 2.74], [397.0, 2.0, 2.83],
    [413.0, 2.08, 2.93], [431.0, 2.19, 3.04], [451.0, 2.33, 3.14], [471.0, 2.51, 3.24],
    [496.0, 2.75, 3.3], [521.0, 2.94, 3.33], [549.0, 3.18, 3.33], [582.0, 3.22, 3.3],
    [617.0, 3.17, 3.3], [659.0, 3.09, 3.34], [704.0, 3.05, 3.39], [756.0, 3.08, 3.42],
    [821.0, 3.2, 3.48], [892.0, 3.3, 3.52],
];

/// Johnson and Christy, Optical constants of the noble metals, Phys. Rev. B 6 (1972).
#[rustfmt::skip]
const COPPER: &[[f32; 3]] = &[
    [354.2, 1.37, 1.916], [367.9, 1.36, 1.975], [381.5, 1.33, 2.045], [397.4, 1.32, 2.116],
    [413.3, 1.28, 2.207], [430.5, 1.25, 2.305], [450.9, 1.24, 2.397], [471.4, 1.25, 2.483],
    [495.9, 1.22, 2.564], [520.9, 1.18, 2.608], [548.6, 1.02, 2.577], [582.1, 0.7, 2.704],
    [616.8, 0.3, 3.205], [659.5, 0.22, 3.747], [704.5, 0.21, 4.205], [756.0, 0.24, 4.665],
    [821.1, 0.26, 5.18], [892.0, 0.3, 5.768],
];

/// Johnson and Christy, Optical constants of transition metals, Phys. Rev. B 9 (1974).
#[rustfmt::skip]
const IRON: &[[f32; 3]] = &[
    [354.0, 1.93, 2.35], [368.0, 2.02, 2.43], [381.0, 2.12, 2.5], [397.0, 2.24, 2.58],
    [413.0, 2.35, 2.65], [431.0, 2.48, 2.71], [451.0, 2.59, 2.77], [471.0, 2.67, 2.82],
    [496.0, 2.74, 2.88], [521.0, 2.86, 2.91], [549.0, 2.95, 2.93], [582.0, 2.94, 2.99],
    [617.0, 2.88, 3.05], [659.0, 2.92, 3.1], [704.0, 2.86, 3.19], [756.0, 2.87, 3.28],
    [821.0, 2.94, 3.39], [892.0, 2.96, 3.56],
];

/// Johnson and Christy, Optical constants of transition metals, Phys. Rev. B 9 (1974).
#[rustfmt::skip]
const NICKEL: &[[f32; 3]] = &[
    [354.0, 1.74, 2.32], [368.0, 1.7, 2.4], [381.0, 1.72, 2.48], [397.0, 1.72, 2.57],
    [413.0, 1.7, 2.69], [431.0, 1.71, 2.82], [451.0, 1.73, 2.95], [471.0, 1.78, 3.09],
    [496.0, 1.82, 3.25], [521.0, 1.85, 3.42], [549.0, 1.92, 3.61], [582.0, 1.96, 3.8],
    [617.0, 1.99, 4.02], [659.0, 1.99, 4.26], [704.0, 2.06, 4.5], [756.0, 2.13, 4.73],
    [821.0, 2.26, 4.97], [892.0, 2.4, 5.23],
];

/// The Lorentz-Drude fit of Rakic, Djurisic, Elazar and Majewski, Optical properties of metallic
/// films, Appl. Opt. 37 (1998).
#[rustfmt::skip]
const PLATINUM: &[[f32; 3]] = &[
    [360.0, 1.615, 2.603], [384.0, 1.681, 2.756], [408.0, 1.745, 2.900], [432.0, 1.807, 3.038],
    [456.0, 1.866, 3.174], [480.0, 1.922, 3.308], [504.0, 1.979, 3.444], [528.0, 2.036, 3.579],
    [552.0, 2.096, 3.715], [576.0, 2.158, 3.850], [600.0, 2.224, 3.984], [624.0, 2.292, 4.115],
    [648.0, 2.364, 4.243], [672.0, 2.438, 4.368], [696.0, 2.514, 4.489], [720.0, 2.591, 4.606],
    [744.0, 2.669, 4.718], [768.0, 2.747, 4.827], [792.0, 2.825, 4.932], [816.0, 2.902, 5.033],
    [840.0, 2.978, 5.131],
];

/// Johnson and Christy, Optical constants of transition metals, Phys. Rev. B 9 (1974).
#[rustfmt::skip]
const TITANIUM: &[[f32; 3]] = &[
    [354.0, 1.82, 2.87], [368.0, 1.9, 2.9], [381.0, 1.99, 2.93], [397.0, 2.08, 2.95],
    [413.0, 2.14, 2.98], [431.0, 2.21, 3.01], [451.0, 2.27, 3.04], [471.0, 2.32, 3.1],
    [496.0, 2.36, 3.19], [521.0, 2.44, 3.3], [549.0, 2.54, 3.43], [582.0, 2.6, 3.58],
    [617.0, 2.67, 3.72], [659.0, 2.76, 3.84], [704.0, 2.86, 3.96], [756.0, 3.0, 4.01],
    [821.0, 3.21, 4.01], [892.0, 3.29, 3.96],
];

/// The Lorentz-Drude fit of Rakic, Djurisic, Elazar and Majewski, Optical properties of metallic
/// films, Appl. Opt. 37 (1998).
#[rustfmt::skip]
const TUNGSTEN: &[[f32; 3]] = &[
    [360.0, 3.189, 2.538], [384.0, 3.276, 2.529], [408.0, 3.331, 2.517], [432.0, 3.360, 2.515],
    [456.0, 3.372, 2.532], [480.0, 3.379, 2.570], [504.0, 3.392, 2.627], [528.0, 3.418, 2.694],
    [552.0, 3.460, 2.762], [576.0, 3.518, 2.822], [600.0, 3.586, 2.864], [624.0, 3.653, 2.885],
    [648.0, 3.712, 2.885], [672.0, 3.754, 2.869], [696.0, 3.774, 2.842], [720.0, 3.771, 2.813],
    [744.0, 3.744, 2.787], [768.0, 3.698, 2.772], [792.0, 3.634, 2.770], [816.0, 3.558, 2.786],
    [840.0, 3.475, 2.820],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metals_are_found_by_symbol_and_name() {
        assert_eq!(Metal::named("au"), Metal::named("Gold"));
        assert_eq!(Metal::named("W").map(Metal::name), Some("tungsten"));
        assert!(
            Metal::try_from("unobtainium".to_string()).is_err_and(|e| e.contains("Ag, Al, Au"))
        );
        let json = serde_json::to_string(&Metal::named("Cu")).expect("serialises");
        assert_eq!(json, "\"Cu\"");
    }

    #[test]
    fn tables_ascend_and_cover_the_visible_range() {
        for metal in METALS {
            assert!(metal.rows.windows(2).all(|w| w[0][0] < w[1][0]), "{}", metal.name);
            assert!(
                metal.rows[0][0] <= 360.0 && metal.rows[metal.rows.len() - 1][0] >= 830.0,
                "{}",
                metal.name
            );
        }
    }

    #[test]
    fn tables_are_those_of_the_database() {
        let place = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../../shared/data/spectra/refractiveindex.info/main"
        );
        let mut compared = 0;
        for metal in METALS {
            let paper = match metal.symbol {
                "Al" => "Rakic",
                "Pt" | "W" => continue,
                _ => "Johnson",
            };
            let Ok(text) =
                std::fs::read_to_string(format!("{place}/{}/nk/{paper}.yml", metal.symbol))
            else {
                eprintln!("skipped: the table of {} is absent", metal.name);
                continue;
            };
            let row = |line: &str| {
                let numbers: Vec<f32> =
                    line.split_whitespace().map_while(|n| n.parse().ok()).collect();
                <[f32; 3]>::try_from(numbers).ok()
            };
            let rows: Vec<[f32; 3]> = text.lines().filter_map(row).collect();
            for &[lambda, n, k] in metal.rows {
                let close = |a: f32, b: f32| (a - b).abs() <= 1e-4 * b;
                let is_it = |r: &&[f32; 3]| {
                    close(r[0] * 1000.0, lambda) && close(r[1], n) && close(r[2], k)
                };
                assert!(rows.iter().find(is_it).is_some(), "{} at {lambda} nm", metal.name);
                compared += 1;
            }
        }
        assert!(compared == 0 || compared > 100, "{compared}");
    }

    #[test]
    fn rgb_and_spectral_metals_have_one_colour_at_normal_incidence() {
        for metal in Metal::all() {
            let spectral = rgb_of_reflectance(|lambda| metal.reflectance(lambda).into()).to_array();
            let [n, k] = metal.indices(ColorMode::Rgb);
            for c in 0..3 {
                let r = ((n[c] - 1.0).powi(2) + k[c] * k[c]) / ((n[c] + 1.0).powi(2) + k[c] * k[c]);
                assert!(
                    (r - spectral[c].min(0.999)).abs() < 2e-3,
                    "{}: {r} {spectral:?}",
                    metal.name()
                );
            }
        }
    }

    #[test]
    fn gold_is_yellow_copper_is_red_and_silver_is_bright() {
        let color = |name: &str| {
            let metal = Metal::named(name).expect("known");
            rgb_of_reflectance(|lambda| metal.reflectance(lambda).into())
        };
        let (gold, copper, silver) = (color("gold"), color("copper"), color("silver"));
        assert!(gold.r > 0.95 && gold.g > 0.7 && gold.b < 0.45, "{gold:?}");
        assert!(copper.r > 0.9 && copper.g < 0.7 && copper.b < 0.6, "{copper:?}");
        assert!(silver.to_array().iter().all(|&c| c > 0.9), "{silver:?}");
        // Tungsten reflects half of the light.
        assert!((0.45..0.55).contains(&color("tungsten").luminance()), "{:?}", color("tungsten"));
    }
}
