//! Functions over the unit cube whose integrals are known.

use snell_math::Vec2;
use snell_math::real;
use snell_render::sampler::Random;
use std::f64::consts::PI;

/// A function of the numbers of one sample.
pub struct Integrand {
    /// The name of the integrand.
    pub name: &'static str,
    /// The formula, for the plot.
    pub formula: &'static str,
    /// The exact value of the integral.
    pub integral: f64,
    /// The value of the integrand at the numbers of a sample.
    pub value: fn(&Random) -> f64,
}

/// All integrands: smooth ones and ones with edges, in two and in more dimensions (as paths have).
pub const INTEGRANDS: [Integrand; 7] = [
    Integrand { name: "smooth", formula: "x y", integral: 0.25, value: |r| product(r, 1, |x| x) },
    Integrand {
        name: "gaussian",
        formula: "exp(-x² - y²)",
        // (sqrt(pi) / 2 erf(1))^2
        integral: 0.557_746_285_351_033_5,
        value: |r| product(r, 1, |x| real::exp(-x * x)),
    },
    Integrand {
        name: "disk",
        formula: "x² + y² < 1",
        integral: PI / 4.0,
        value: |r| f64::from(r.pair(0).length_squared() < 1.0),
    },
    Integrand {
        name: "step",
        formula: "y < 0.3 + 0.4 x",
        integral: 0.5,
        value: |r| {
            let Vec2 { x, y } = r.pair(0);
            f64::from(y < 0.3 + 0.4 * x)
        },
    },
    Integrand {
        name: "product4",
        formula: "π²/4 sin(πx) … over 4 dimensions",
        integral: 1.0,
        value: |r| product(r, 2, |x| PI / 2.0 * real::sin(PI * x)),
    },
    Integrand {
        name: "ball4",
        formula: "x² + y² + z² + w² < 1",
        integral: PI * PI / 32.0,
        value: |r| f64::from((0..2).map(|d| r.pair(d).length_squared()).sum::<f32>() < 1.0),
    },
    Integrand {
        name: "product8",
        formula: "(x + 1/2) … over 8 dimensions",
        integral: 1.0,
        value: |r| product(r, 4, |x| x + 0.5),
    },
];

/// The product of `f` over all numbers of the first pairs.
fn product(random: &Random, pairs: u32, f: fn(f64) -> f64) -> f64 {
    (0..pairs).map(|d| random.pair(d)).map(|u| f(f64::from(u.x)) * f(f64::from(u.y))).product()
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_render::SamplerKind;
    use snell_render::sampler::Sampler;

    #[test]
    fn the_integrals_are_those_of_the_functions() {
        let sampler = Sampler::new(SamplerKind::Sobol, 1, 1 << 16);
        for integrand in &INTEGRANDS {
            let sum: f64 =
                (0..1 << 16).map(|s| (integrand.value)(&sampler.random([0, 0], s))).sum();
            let mean = sum / f64::from(1 << 16);
            // Dimensions beyond the second are paired at random: the tolerance is four standard
            // deviations.
            assert!((mean / integrand.integral - 1.0).abs() < 6e-3, "{}: {mean}", integrand.name);
        }
    }
}
