//! Curves: keyframed values over time.

use snell_math::glam::DQuat;
use snell_math::rotation;

/// How values are interpolated between keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of a key is kept until the next key.
    Step,
    /// Linear, or spherical linear for rotations.
    Linear,
    /// Hermite splines, for which each key has an in-tangent, a value and an out-tangent (glTF 2.0,
    /// appendix C.5).
    Cubic,
}

/// The reason why the keys of a curve are invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CurveError {
    /// There are no keys.
    #[error("there are no keys")]
    Empty,
    /// The time of the key with this number is not finite, or not later than the one before.
    #[error("the time of key {0} is not finite, or not after the one before")]
    Times(usize),
    /// The number of values is wrong.
    #[error("there are {found} numbers, expected {expected}")]
    Values {
        /// The number of values that were given.
        found: usize,
        /// The number of values that the keys need.
        expected: usize,
    },
    /// A value is not finite.
    #[error("a value is not finite")]
    NotFinite,
}

/// Several numbers over time. The value is constant before the first key and after the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    times: Vec<f64>,
    values: Vec<f32>,
    width: usize,
    interpolation: Interpolation,
}

impl Curve {
    /// A curve of `width` numbers. `values` has the numbers key by key; for
    /// [`Interpolation::Cubic`] it has three times as many, as described there.
    pub fn new(
        times: Vec<f64>,
        values: Vec<f32>,
        width: usize,
        interpolation: Interpolation,
    ) -> Result<Self, CurveError> {
        if times.is_empty() || width == 0 {
            return Err(CurveError::Empty);
        }
        let grows = |i: usize| times[i].is_finite() && (i == 0 || times[i] > times[i - 1]);
        if let Some(i) = (0..times.len()).find(|&i| !grows(i)) {
            return Err(CurveError::Times(i));
        }
        let expected =
            times.len() * width * if interpolation == Interpolation::Cubic { 3 } else { 1 };
        if values.len() != expected {
            return Err(CurveError::Values { found: values.len(), expected });
        }
        if values.iter().any(|v| !v.is_finite()) {
            return Err(CurveError::NotFinite);
        }
        Ok(Self { times, values, width, interpolation })
    }

    /// How many numbers a value of the curve has.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The times of the keys, in seconds.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The numbers, in the order of [`Self::new`].
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// How values are interpolated between keys.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// The times of the first and the last key, in seconds.
    pub fn span(&self) -> [f64; 2] {
        [self.times[0], self.times[self.times.len() - 1]]
    }

    /// The numbers at a time in seconds.
    pub fn at(&self, time: f64) -> Vec<f64> {
        let (key, s) = self.segment(time);
        let value = |key: usize, part: usize, i: usize| {
            let key = if self.interpolation == Interpolation::Cubic { 3 * key + part } else { key };
            f64::from(self.values[key * self.width + i])
        };
        (0..self.width)
            .map(|i| match self.interpolation {
                _ if s == 0.0 => value(key, 1, i),
                Interpolation::Step => value(key, 1, i),
                Interpolation::Linear => value(key, 1, i) * (1.0 - s) + value(key + 1, 1, i) * s,
                Interpolation::Cubic => {
                    let length = self.times[key + 1] - self.times[key];
                    let (s2, s3) = (s * s, s * s * s);
                    (2.0 * s3 - 3.0 * s2 + 1.0) * value(key, 1, i)
                        + (s3 - 2.0 * s2 + s) * length * value(key, 2, i)
                        + (3.0 * s2 - 2.0 * s3) * value(key + 1, 1, i)
                        + (s3 - s2) * length * value(key + 1, 0, i)
                }
            })
            .collect()
    }

    /// The first three numbers at a time in seconds; missing ones are 0.
    pub fn vector_at(&self, time: f64) -> [f64; 3] {
        let value = self.at(time);
        std::array::from_fn(|i| value.get(i).copied().unwrap_or(0.0))
    }

    /// The rotation at a time in seconds, for a curve of quaternions x y z w. A zero quaternion
    /// gives no rotation.
    pub fn rotation_at(&self, time: f64) -> DQuat {
        let unit = |v: Vec<f64>| {
            let q = DQuat::from_xyzw(
                v.first().copied().unwrap_or(0.0),
                v.get(1).copied().unwrap_or(0.0),
                v.get(2).copied().unwrap_or(0.0),
                v.get(3).copied().unwrap_or(1.0),
            );
            if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
        };
        let (key, s) = self.segment(time);
        if self.interpolation != Interpolation::Linear || s == 0.0 {
            return unit(self.at(time));
        }
        rotation::slerp(unit(self.at(self.times[key])), unit(self.at(self.times[key + 1])), s)
    }

    /// The number of the key before a time, and the fraction of the interval to the next key, from
    /// 0 to less than 1.
    fn segment(&self, time: f64) -> (usize, f64) {
        let after = self.times.partition_point(|&t| t <= time);
        let (Some(key), Some(next)) = (after.checked_sub(1), self.times.get(after)) else {
            return (after.saturating_sub(1), 0.0);
        };
        (key, (time - self.times[key]) / (next - self.times[key]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    fn curve(values: &[f32], width: usize, interpolation: Interpolation) -> Curve {
        Curve::new(vec![1.0, 3.0], values.to_vec(), width, interpolation).expect("a valid curve")
    }

    #[test]
    fn values_go_from_key_to_key_as_they_should() {
        let step = curve(&[5.0, 9.0], 1, Interpolation::Step);
        let linear = curve(&[5.0, 9.0], 1, Interpolation::Linear);
        for (time, stepped, lerped) in
            [(-1.0, 5.0, 5.0), (1.0, 5.0, 5.0), (1.5, 5.0, 6.0), (2.999, 5.0, 8.998)]
        {
            assert_eq!(step.at(time), [stepped]);
            assert!((linear.at(time)[0] - lerped).abs() < 1e-9);
        }
        assert_eq!(
            (step.at(3.0), linear.at(9.0), linear.at(f64::NAN)),
            (vec![9.0], vec![9.0], vec![5.0])
        );
    }

    #[test]
    fn a_spline_follows_the_cubic_that_its_tangents_come_from() {
        // The values are t^3 - t at 1 and 3, with the derivative 3 t^2 - 1.
        let f = |t: f64| t * t * t - t;
        let spline = curve(&[7.0, 0.0, 2.0, 26.0, 24.0, -5.0], 1, Interpolation::Cubic);
        for i in 0..=20 {
            let t = 1.0 + 0.1 * f64::from(i);
            assert!(
                (spline.at(t)[0] - f(t)).abs() < 1e-6,
                "at {t}: {} and not {}",
                spline.at(t)[0],
                f(t)
            );
        }
    }

    #[test]
    fn rotations_turn_evenly_the_short_way() {
        let quarter = DQuat::from_rotation_y(FRAC_PI_2);
        // The second key with the opposite sign is the same rotation.
        let values: Vec<f32> = [0.0, 0.0, 0.0, 1.0]
            .into_iter()
            .chain((-quarter).to_array().map(|x| x as f32))
            .collect();
        let half = curve(&values, 4, Interpolation::Linear).rotation_at(2.0);
        assert!(half.angle_between(DQuat::from_rotation_y(FRAC_PI_4)) < 1e-6);
        assert_eq!(curve(&[0.0; 8], 4, Interpolation::Step).rotation_at(2.0), DQuat::IDENTITY);
    }

    #[test]
    fn keys_that_make_no_sense_are_refused() {
        let new = |times: &[f64], count: usize| {
            Curve::new(times.to_vec(), vec![0.0; count], 1, Interpolation::Linear)
        };
        assert_eq!(new(&[], 0), Err(CurveError::Empty));
        assert_eq!(new(&[0.0, 0.0], 2), Err(CurveError::Times(1)));
        assert_eq!(new(&[f64::NAN], 1), Err(CurveError::Times(0)));
        assert_eq!(new(&[0.0, 1.0], 3), Err(CurveError::Values { found: 3, expected: 2 }));
        let infinite = Curve::new(vec![0.0], vec![f32::INFINITY], 1, Interpolation::Step);
        assert_eq!(infinite, Err(CurveError::NotFinite));
    }
}
