//! The range of values that a parameter may have.

/// The range of values that a number may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any number.
    Any,
    /// From a lower to an upper bound, both included.
    Within(f64, f64),
    /// Between two bounds, both excluded.
    Between(f64, f64),
    /// More than 0.
    Positive,
    /// Coordinates of a direction, which must not all be 0.
    Direction,
}

use Range::{Any, Between, Direction, Positive, Within};

impl Range {
    /// A fraction from 0 to 1, both included.
    pub const SHARE: Self = Within(0.0, 1.0);
    /// An amount: 0 or more.
    pub const AMOUNT: Self = Within(0.0, f64::INFINITY);

    /// The range of a factor that multiplies a texture: this range without its upper bound, since
    /// the factor may be large where the texture is dark.
    pub fn of_factor(self) -> Self {
        match self {
            Within(least, most) if most < 1e20 => Within(least, f64::INFINITY),
            other => other,
        }
    }

    /// True for numbers in the range. NaN is in [`Self::Any`] only.
    pub fn contains(self, x: f64) -> bool {
        match self {
            Any | Direction => true,
            Within(least, most) => least <= x && x <= most,
            Between(least, most) => least < x && x < most,
            Positive => x > 0.0,
        }
    }

    /// The lower and upper bound, if both are finite.
    pub fn ends(self) -> Option<[f64; 2]> {
        match self {
            Within(least, most) | Between(least, most) if most < 1e6 && least > -1e6 => {
                Some([least, most])
            }
            _ => None,
        }
    }
}

/// Writes the expected numbers in words.
impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Any => f.write_str("any number"),
            Within(0.0, f64::INFINITY) => f.write_str("0 or more"),
            Within(f64::MIN_POSITIVE, most) => write!(f, "more than 0, and at most {most:.4}"),
            Within(least, most) if most == std::f64::consts::PI => {
                write!(f, "{least} to {most:.4}, in radians")
            }
            Within(least, most) => write!(f, "{} to {}", shown(least), shown(most)),
            Between(least, most) => write!(f, "more than {least} and less than {most}"),
            Positive => f.write_str("more than 0"),
            Direction => f.write_str("a direction, not all zeros"),
        }
    }
}

/// A number in its shortest decimal form.
pub(super) fn shown(x: f64) -> String {
    // Most numbers were given in single precision, which has a shorter form.
    let short = x as f32;
    let is_plain = x == 0.0 || (1e-4..1e7).contains(&x.abs());
    if is_plain { format!("{short}") } else { format!("{short:e}") }
}
