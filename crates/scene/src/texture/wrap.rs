//! Wrap modes, for texture coordinates outside of `[0, 1]`.

use serde::{Deserialize, Serialize};

snell_math::declare! {
    /// What a texture shows outside of `[0, 1]`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Wrap {
        /// The image repeats.
        "repeat" => #[default] Repeat,
        /// The image repeats, and every other copy is mirrored.
        "mirror" => Mirror,
        /// The texels at the border continue.
        "clamp" => Clamp,
        /// Black and transparent.
        "black" => Black,
    }
}

impl Wrap {
    /// An equivalent coordinate near `[0, 1]`, so that huge coordinates keep their meaning and fit
    /// in an index. `u` must be finite.
    pub(super) fn reduce(self, u: f32) -> f32 {
        match self {
            Self::Repeat => u - floor(u),
            Self::Mirror => u - 2.0 * floor(u * 0.5),
            Self::Clamp | Self::Black => u.clamp(-1.0, 2.0),
        }
    }

    /// Index of the texel that is shown at position `i` of a row of `n` texels; `None` stands for
    /// black.
    #[inline]
    pub(crate) fn index(self, i: i32, n: u32) -> Option<u32> {
        // Most positions are inside, and divisions are slow.
        if (0..i64::from(n)).contains(&i64::from(i)) {
            Some(i as u32)
        } else {
            self.index_outside(i, n)
        }
    }

    fn index_outside(self, i: i32, n: u32) -> Option<u32> {
        let (i, n) = (i64::from(i), i64::from(n));
        let index = match self {
            Self::Repeat => i.rem_euclid(n),
            Self::Mirror => {
                let i = i.rem_euclid(2 * n);
                if i < n { i } else { 2 * n - 1 - i }
            }
            Self::Clamp => i.clamp(0, n - 1),
            Self::Black => return None,
        };
        Some(index as u32)
    }
}

/// The result of [`f32::floor`], which is a function call on targets without an instruction for it.
/// The sign of zero is unspecified.
#[inline]
pub(super) fn floor(x: f32) -> f32 {
    /// All numbers of at least this magnitude are whole.
    const LARGE: f32 = (1 << f32::MANTISSA_DIGITS) as f32;
    if x.abs() < LARGE {
        let whole = x as i32 as f32;
        if whole > x { whole - 1.0 } else { whole }
    } else {
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_outside_follow_the_mode() {
        let row = |wrap: Wrap| (-4..7).map(|i| wrap.index(i, 3)).collect::<Vec<_>>();
        let some = |v: [u32; 11]| v.map(Some).to_vec();
        assert_eq!(row(Wrap::Repeat), some([2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0]));
        assert_eq!(row(Wrap::Mirror), some([2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0]));
        assert_eq!(row(Wrap::Clamp), some([0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2]));
        let black = row(Wrap::Black);
        assert_eq!(black[4..7], [Some(0), Some(1), Some(2)]);
        assert!(black[..4].iter().chain(&black[7..]).all(Option::is_none));
    }

    #[test]
    fn rounding_down_is_that_of_the_library() {
        let ends = [
            0.0,
            0.5,
            1.0,
            8_388_607.5,
            16_777_215.0,
            16_777_216.0,
            1e30,
            f32::MIN_POSITIVE,
            f32::INFINITY,
        ];
        for i in 0..1000 {
            for x in [snell_math::rng::uniform2([i, 1, 2, 3]).x * 200.0].into_iter().chain(ends) {
                assert!(floor(x) == x.floor() && floor(-x) == (-x).floor(), "{x}");
            }
        }
        assert!(floor(f32::NAN).is_nan());
    }

    #[test]
    fn huge_coordinates_stay_in_range() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Black] {
            for u in [-1e30f32, -1e-30, 0.0, 1e9, f32::MAX] {
                assert!((-1.0..=2.0).contains(&wrap.reduce(u)), "{wrap:?} {u}");
            }
        }
    }
}
