//! How much a GGX surface reflects in total: what is left for the layer below.
//!
//! With Schlick's Fresnel the share of light reflected from a direction is linear in `f0` and `f90` (Karis, Real Shading in Unreal
//! Engine 4, 2013), so two numbers for each cosine and roughness are enough. They are integrated once, on first use.

use super::{fresnel, ggx::Ggx};
use snell_math::{SampledSpectrum, Vec2, Vec3};
use std::sync::LazyLock;

/// Nodes in the square root of the cosine: albedo changes most at grazing angles.
const COSINES: usize = 48;
/// Nodes in roughness.
const ROUGHNESSES: usize = 28;
/// Directions per node.
const DIRECTIONS: u32 = 256;

/// Factors of `f0` and `f90`.
#[derive(Clone, Copy, Debug, Default)]
struct Split {
    f0: f32,
    f90: f32,
}

impl Split {
    fn lerp(self, other: Self, t: f32) -> Self {
        Self { f0: self.f0 + (other.f0 - self.f0) * t, f90: self.f90 + (other.f90 - self.f90) * t }
    }

    fn apply(self, f0: SampledSpectrum, f90: SampledSpectrum) -> SampledSpectrum {
        (f0 * self.f0 + f90 * self.f90).clamp(0.0, 1.0)
    }
}

struct Table {
    directional: [[Split; COSINES]; ROUGHNESSES],
    average: [Split; ROUGHNESSES],
}

static TABLE: LazyLock<Box<Table>> = LazyLock::new(|| {
    let mut table = Box::new(Table {
        directional: [[Split::default(); COSINES]; ROUGHNESSES],
        average: [Split::default(); ROUGHNESSES],
    });
    for row in 0..ROUGHNESSES {
        let ggx = Ggx::from_roughness(row as f32 / (ROUGHNESSES - 1) as f32);
        for i in 0..COSINES {
            table.directional[row][i] = integrate(ggx, (i as f32 / (COSINES - 1) as f32).powi(2));
        }
        table.average[row] = average(&table.directional[row]);
    }
    table
});

/// Albedo towards a direction of this cosine, by a fixed low-discrepancy set of facets (a Fibonacci lattice).
fn integrate(ggx: Ggx, cos: f32) -> Split {
    if ggx.is_smooth() {
        return smooth(cos);
    }
    let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = Split::default();
    for i in 0..DIRECTIONS {
        let i = f64::from(i) + 0.5;
        // Half the azimuths by symmetry, and more of the tilted facets, whose reflections are the ones that get lost.
        let rest = 1.0 - (i / f64::from(DIRECTIONS)) as f32;
        let u = Vec2::new(0.5 * (i * 0.618_033_988_749_894_9).fract() as f32, 1.0 - rest * rest);
        let m = ggx.sample_visible_normal(wo, u);
        let wi = fresnel::reflect(wo, m);
        if wi.z > 0.0 {
            let (weight, grazing) = (2.0 * rest * ggx.shadowing(wo, wi), fresnel::schlick_weight(wo.dot(m)));
            sum.f0 += weight * (1.0 - grazing);
            sum.f90 += weight * grazing;
        }
    }
    Split { f0: sum.f0 / DIRECTIONS as f32, f90: sum.f90 / DIRECTIONS as f32 }
}

fn smooth(cos: f32) -> Split {
    let grazing = fresnel::schlick_weight(cos);
    Split { f0: 1.0 - grazing, f90: grazing }
}

/// `2 int E(mu) mu dmu` of the interpolated row.
fn average(row: &[Split; COSINES]) -> Split {
    let steps = 512;
    let mut sum = Split::default();
    for i in 0..steps {
        let cos = (i as f32 + 0.5) / steps as f32;
        let e = interpolate(row, cos);
        sum.f0 += 2.0 * cos / steps as f32 * e.f0;
        sum.f90 += 2.0 * cos / steps as f32 * e.f90;
    }
    sum
}

/// The two nodes around a position in `[0, 1]` on a grid of `n`, and the weight of the second.
fn nodes(x: f32, n: usize) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (x as usize).min(n - 2);
    (i, x - i as f32)
}

fn interpolate(row: &[Split; COSINES], cos: f32) -> Split {
    let (i, t) = nodes(cos.max(0.0).sqrt(), COSINES);
    row[i].lerp(row[i + 1], t)
}

/// Albedo of one surface: a GGX layer with Schlick's reflectance.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayerAlbedo {
    is_smooth: bool,
    row: usize,
    weight: f32,
}

impl LayerAlbedo {
    pub(super) fn new(ggx: Ggx) -> Self {
        let (row, weight) = nodes(ggx.alpha().sqrt(), ROUGHNESSES);
        Self { is_smooth: ggx.is_smooth(), row, weight }
    }

    /// Share of light reflected towards (equally: from) a direction with this cosine.
    pub(super) fn directional(self, cos: f32, f0: SampledSpectrum, f90: SampledSpectrum) -> SampledSpectrum {
        if self.is_smooth {
            return smooth(cos).apply(f0, f90);
        }
        let rows = &TABLE.directional;
        let split = interpolate(&rows[self.row], cos).lerp(interpolate(&rows[self.row + 1], cos), self.weight);
        split.apply(f0, f90)
    }

    /// Share of diffuse light reflected: the mean of [`Self::directional`] weighted by the cosine.
    pub(super) fn average(self, f0: SampledSpectrum, f90: SampledSpectrum) -> SampledSpectrum {
        if self.is_smooth {
            // 2 int (1 - mu)^5 mu dmu = 1 / 21.
            return Split { f0: 20.0 / 21.0, f90: 1.0 / 21.0 }.apply(f0, f90);
        }
        TABLE.average[self.row].lerp(TABLE.average[self.row + 1], self.weight).apply(f0, f90)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_agrees_with_a_fine_integral_between_its_nodes() {
        for r in 1..30 {
            let ggx = Ggx::from_roughness(0.033 * r as f32 + 0.0161);
            if ggx.is_smooth() {
                continue;
            }
            for c in 0..30 {
                let cos = 0.034 * c as f32 + 0.004;
                let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let (n, mut sum) = (4096, [0.0f64; 2]);
                for i in 0..n {
                    let i = f64::from(i) + 0.5;
                    let u = Vec2::new((i * 0.618_033_988_749_894_9).fract() as f32, (i / f64::from(n)) as f32);
                    let m = ggx.sample_visible_normal(wo, u);
                    let wi = fresnel::reflect(wo, m);
                    if wi.z > 0.0 {
                        let s = fresnel::schlick_weight(wo.dot(m));
                        sum[0] += f64::from(ggx.shadowing(wo, wi) * (1.0 - s));
                        sum[1] += f64::from(ggx.shadowing(wo, wi) * s);
                    }
                }
                let layer = LayerAlbedo::new(ggx);
                for (f0, f90, expected) in [(1.0, 0.0, sum[0]), (0.0, 1.0, sum[1])] {
                    let e = layer.directional(cos, SampledSpectrum::splat(f0), SampledSpectrum::splat(f90))[0];
                    let error = (e - (expected / f64::from(n)) as f32).abs();
                    // Nearly smooth layers change within a fraction of a degree of grazing, finer than the table.
                    let tolerance = if ggx.alpha() < 0.03 { 0.025 } else { 3e-3 };
                    assert!(error < tolerance, "alpha {} cosine {cos}: off by {error}", ggx.alpha());
                }
            }
        }
    }
}
