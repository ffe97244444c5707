//! Indices of refraction that depend on the wavelength, and glasses by name.

use serde::{Deserialize, Serialize};

/// The Fraunhofer line d in nm, at which a single index of refraction is measured.
pub const LINE_D: f32 = 587.561_8;
/// The Fraunhofer line F in nm. Dispersion is measured between F and C.
const LINE_F: f32 = 486.132_7;
/// The Fraunhofer line C in nm.
const LINE_C: f32 = 656.272_5;

/// An index of refraction.
///
/// Serialised as a number, or as text: the name of a glass (`"BK7"`), `"abbe:1.5,30"` for index 1.5
/// and Abbe number 30, or `"cauchy:1.5,0.004"` for `1.5 + 0.004 / lambda^2`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub enum RefractiveIndex {
    /// The same index at all wavelengths.
    Constant(f32),
    /// Cauchy's formula `a + b / lambda^2` with the wavelength in micrometres.
    Cauchy {
        /// The index in the limit of long wavelengths.
        a: f32,
        /// The dispersion in square micrometres.
        b: f32,
    },
    /// A glass or another clear substance by name.
    Glass(Glass),
}

impl RefractiveIndex {
    /// The index `n` at the d line with Abbe number `abbe = (n - 1) / (n_F - n_C)`, by Cauchy's
    /// formula. A smaller Abbe number means more dispersion; one that is not positive and finite
    /// gives no dispersion.
    pub fn from_abbe(n: f32, abbe: f32) -> Self {
        if abbe.is_nan() || abbe <= 0.0 || abbe.is_infinite() {
            return Self::Constant(n);
        }
        let inverse_square = |lambda: f32| 1e6 / (lambda * lambda);
        let b = (n - 1.0) / (abbe * (inverse_square(LINE_F) - inverse_square(LINE_C)));
        Self::Cauchy { a: n - b * inverse_square(LINE_D), b }
    }

    /// The index at a wavelength in nm.
    pub fn at(self, lambda: f32) -> f32 {
        match self {
            Self::Constant(n) => n,
            Self::Cauchy { a, b } => a + b * 1e6 / (lambda * lambda),
            Self::Glass(glass) => glass.index(lambda),
        }
    }

    /// The index at the d line, 587.6 nm.
    pub fn at_line_d(self) -> f32 {
        self.at(LINE_D)
    }

    /// True if the index depends on the wavelength.
    pub fn is_dispersive(self) -> bool {
        match self {
            Self::Constant(_) => false,
            Self::Cauchy { b, .. } => b != 0.0,
            Self::Glass(_) => true,
        }
    }

    /// The Abbe number `(n_d - 1) / (n_F - n_C)`; infinite without dispersion.
    pub fn abbe_number(self) -> f32 {
        (self.at(LINE_D) - 1.0) / (self.at(LINE_F) - self.at(LINE_C))
    }
}

impl From<Glass> for RefractiveIndex {
    fn from(glass: Glass) -> Self {
        Self::Glass(glass)
    }
}

impl From<f32> for RefractiveIndex {
    fn from(n: f32) -> Self {
        Self::Constant(n)
    }
}

/// The serialised form of an index of refraction.
#[derive(Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected an index of refraction: a number, or a text such as glass:NAME"
)]
enum Written {
    Number(f32),
    Text(String),
}

impl From<RefractiveIndex> for Written {
    fn from(index: RefractiveIndex) -> Self {
        match index {
            RefractiveIndex::Constant(n) => Self::Number(n),
            RefractiveIndex::Cauchy { a, b } => Self::Text(format!("cauchy:{a},{b}")),
            RefractiveIndex::Glass(glass) => Self::Text(glass.name().into()),
        }
    }
}

impl TryFrom<Written> for RefractiveIndex {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        let text = match written {
            Written::Number(n) => return Ok(Self::Constant(n)),
            Written::Text(text) => text,
        };
        let pair = |numbers: &str| {
            let (a, b) = numbers.split_once(',')?;
            Some((a.trim().parse().ok()?, b.trim().parse().ok()?))
        };
        let parsed = match text.split_once(':') {
            Some(("cauchy", numbers)) => pair(numbers).map(|(a, b)| Self::Cauchy { a, b }),
            Some(("abbe", numbers)) => pair(numbers).map(|(n, abbe)| Self::from_abbe(n, abbe)),
            Some(("glass", name)) => Glass::named(name).map(Self::Glass),
            _ => Glass::named(&text).map(Self::Glass),
        };
        parsed.ok_or_else(|| {
            let known: Vec<_> = Glass::all().map(Glass::name).collect();
            format!(
                "\"{text}\" is not an index of refraction; write a number, abbe:N,V, cauchy:A,B or \
                    one of {}",
                known.join(", ")
            )
        })
    }
}

/// A glass or another clear substance with measured dispersion, by Sellmeier's formula
/// `n^2 = 1 + sum of B lambda^2 / (lambda^2 - C)` with the wavelength in micrometres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Glass(usize);

struct Entry {
    name: &'static str,
    b: [f32; 4],
    c: [f32; 4],
}

impl Glass {
    /// Schott's borosilicate crown, the glass of most lenses.
    pub const BK7: Self = Self(0);
    /// A dense flint of Schott's: heavy, and more dispersive than most glasses.
    pub const SF11: Self = Self(1);

    /// All glasses.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..GLASSES.len()).map(Self)
    }

    /// The glass of this name, in any case; `None` if it is unknown.
    pub fn named(name: &str) -> Option<Self> {
        GLASSES.iter().position(|g| g.name.eq_ignore_ascii_case(name)).map(Self)
    }

    /// The name of the glass, such as `BK7`.
    pub fn name(self) -> &'static str {
        GLASSES[self.0].name
    }

    /// The index of refraction at a wavelength in nm.
    pub fn index(self, lambda: f32) -> f32 {
        let Entry { b, c, .. } = &GLASSES[self.0];
        let square = lambda * lambda * 1e-6;
        let n2 = 1.0 + (0..4).map(|i| b[i] * square / (square - c[i])).sum::<f32>();
        n2.max(1.0).sqrt()
    }
}

/// The sources: Schott's catalogue of 2017 for BK7, SF11 and N-SF11; Malitson, J. Opt. Soc. Am. 55
/// (1965) for fused silica; Malitson, J. Opt. Soc. Am. 52 (1962) for sapphire (ordinary ray);
/// Peter, Z. Phys. 15 (1923) for diamond; Daimon and Masumura, Appl. Opt. 46 (2007) for water at 20
/// °C.
const GLASSES: &[Entry] = &[
    Entry {
        name: "BK7",
        b: [1.03961212, 0.231792344, 1.01046945, 0.0],
        c: [0.00600069867, 0.0200179144, 103.560653, 0.0],
    },
    Entry {
        name: "SF11",
        b: [1.73848403, 0.311168974, 1.17490871, 0.0],
        c: [0.0136068604, 0.0615960463, 121.922711, 0.0],
    },
    Entry {
        name: "N-SF11",
        b: [1.73759695, 0.313747346, 1.89878101, 0.0],
        c: [0.013188707, 0.0623068142, 155.23629, 0.0],
    },
    Entry {
        name: "fused-silica",
        b: [0.6961663, 0.4079426, 0.8974794, 0.0],
        c: [0.00467914826, 0.0135120631, 97.9340025, 0.0],
    },
    Entry {
        name: "sapphire",
        b: [1.023798, 1.058264, 5.280792, 0.0],
        c: [0.00377588251, 0.0122544236, 321.361553, 0.0],
    },
    Entry { name: "diamond", b: [0.3306, 4.3356, 0.0, 0.0], c: [0.030625, 0.011236, 0.0, 0.0] },
    Entry {
        name: "water",
        b: [0.568402757, 0.172617739, 0.0208618958, 0.113074869],
        c: [0.00510182971, 0.0182115394, 0.0262072229, 10.6979272],
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glasses_have_their_published_index_and_abbe_number() {
        // Expected n_d and V_d: the makers' data sheets, and the papers for diamond and sapphire.
        for (name, n, abbe) in [
            ("BK7", 1.5168, 64.17),
            ("SF11", 1.784_72, 25.76),
            ("N-SF11", 1.784_72, 25.68),
            ("fused-silica", 1.458_46, 67.82),
            ("sapphire", 1.768_2, 72.2),
            ("diamond", 2.4175, 55.3),
            ("water", 1.333_36, 55.74),
        ] {
            let index = RefractiveIndex::Glass(Glass::named(name).expect("known"));
            assert!((index.at_line_d() - n).abs() < 5e-4, "{name}: {}", index.at_line_d());
            assert!(
                (index.abbe_number() / abbe - 1.0).abs() < 5e-3,
                "{name}: {}",
                index.abbe_number()
            );
            assert!(index.at(360.0) > index.at(830.0) && index.is_dispersive());
        }
    }

    #[test]
    fn an_abbe_number_is_kept() {
        let index = RefractiveIndex::from_abbe(1.6, 30.0);
        assert!(
            (index.at_line_d() - 1.6).abs() < 1e-5 && (index.abbe_number() - 30.0).abs() < 0.01
        );
        assert_eq!(RefractiveIndex::from_abbe(1.6, f32::INFINITY), RefractiveIndex::Constant(1.6));
        assert_eq!(RefractiveIndex::from_abbe(1.6, 0.0), RefractiveIndex::Constant(1.6));
    }

    #[test]
    fn indices_are_written_as_numbers_or_text() {
        let read = |json: &str| serde_json::from_str::<RefractiveIndex>(json);
        assert_eq!(read("1.5").expect("a number"), RefractiveIndex::Constant(1.5));
        assert_eq!(
            read("\"cauchy:1.5,0.004\"").expect("text"),
            RefractiveIndex::Cauchy { a: 1.5, b: 0.004 }
        );
        assert_eq!(read("\"abbe:1.5,30\"").expect("text"), RefractiveIndex::from_abbe(1.5, 30.0));
        for index in
            [1.5.into(), RefractiveIndex::from_abbe(1.7, 40.0), read("\"sf11\"").expect("a glass")]
        {
            let json = serde_json::to_string(&index).expect("serialises");
            assert_eq!(read(&json).expect("reads back"), index, "{json}");
        }
        let error = read("\"jelly\"").expect_err("no glass").to_string();
        assert!(error.contains("BK7, SF11"), "{error}");
    }
}
