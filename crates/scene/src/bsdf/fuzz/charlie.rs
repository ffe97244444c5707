//! The sheen of glTF: cylindrical fibres along the normal (Estevez and Kulla, Production Friendly
//! Microfacet Sheen BRDF, SIGGRAPH 2017 course; `KHR_materials_sheen`).
//!
//! The formulas are those of the extension, with `alpha` the square of its roughness. The table of
//! what the fibres reflect was integrated by the test below.

use super::super::energy::nodes;
use snell_math::{Vec2, Vec3, real, sampling};
use std::f32::consts::{FRAC_1_PI, TAU};

/// Nodes of the table in the roughness and in the root of the cosine.
const SIZE: usize = 48;

/// The least roughness: below, the fibres reflect next to nothing but at grazing angles.
const LEAST: f32 = 0.07;

/// Shares of 16 bits, little-endian, over [`RANGE`].
static TABLE: &[u8; 2 * SIZE * SIZE] = include_bytes!("charlie.bin");

/// The table's largest number.
const RANGE: f32 = 4.0;

fn entry(row: usize, column: usize) -> f32 {
    let at = 2 * (row * SIZE + column);
    f32::from(u16::from_le_bytes([TABLE[at], TABLE[at + 1]])) * (RANGE / 65535.0)
}

/// The exponent of the masking function.
fn exponent(x: f32, alpha: f32) -> f32 {
    let t = (1.0 - alpha) * (1.0 - alpha);
    let mix = |a: f32, b: f32| a + (b - a) * t;
    let (a, b, c) = (mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801));
    let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
    a / (1.0 + b * real::powf(x, c)) + d * x + e
}

/// Smith's `Lambda` of the fibres at a cosine.
fn lambda(cos: f32, alpha: f32) -> f32 {
    if cos < 0.5 {
        real::exp(exponent(cos, alpha))
    } else {
        real::exp(2.0 * exponent(0.5, alpha) - exponent(1.0 - cos, alpha))
    }
}

/// White fibres of one roughness, seen from one direction above.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct CharlieLobe {
    wo: Vec3,
    alpha: f32,
    /// `1 + Lambda(wo)`.
    masked: f32,
    /// Factor that keeps the reflectance from exceeding 1.
    scale: f32,
    /// Share of light reflected.
    pub reflectance: f32,
}

impl CharlieLobe {
    /// The density per steradian of [`Self::sample`].
    pub const PDF: f32 = 1.0 / TAU;

    pub fn new(roughness: f32, wo: Vec3) -> Self {
        let lobe = Self::unscaled(roughness, wo);
        let position = (roughness.max(LEAST) - LEAST) / (1.0 - LEAST);
        let ((row, r), (column, c)) = (nodes(position, SIZE), nodes(wo.z.sqrt(), SIZE));
        let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let at = |row| lerp(entry(row, column), entry(row, column + 1), c);
        let reflected = lerp(at(row), at(row + 1), r);
        let scale = 1.0 / reflected.max(1.0);
        Self { scale, reflectance: reflected * scale, ..lobe }
    }

    fn unscaled(roughness: f32, wo: Vec3) -> Self {
        let alpha = roughness.max(LEAST) * roughness.max(LEAST);
        Self { wo, alpha, masked: 1.0 + lambda(wo.z, alpha), scale: 1.0, reflectance: 0.0 }
    }

    /// `f |cos(wi)|` for a direction above.
    pub fn value(&self, wi: Vec3) -> f32 {
        let half = self.wo + wi;
        let (length2, inverse) = (half.length_squared(), 1.0 / self.alpha);
        if length2 == 0.0 || self.wo.z <= 0.0 {
            return 0.0;
        }
        let sin2 = ((half.x * half.x + half.y * half.y) / length2).min(1.0);
        let density = (2.0 + inverse) * real::powf(sin2, 0.5 * inverse) * (0.5 * FRAC_1_PI);
        let masking = (self.masked + lambda(wi.z, self.alpha)) * 4.0 * self.wo.z;
        self.scale * density / masking
    }

    pub fn sample(u: Vec2) -> Vec3 {
        let w = sampling::uniform_sphere(u);
        Vec3::new(w.x, w.y, w.z.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the formulas reflect towards a direction of this cosine.
    fn integrated(roughness: f32, cos: f32) -> f64 {
        let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        let lobe = CharlieLobe::unscaled(roughness, wo);
        let (rings, sectors) = (400, 128);
        let mut sum = 0.0;
        for i in 0..rings {
            // Squares, since most is reflected at grazing angles.
            let t = (i as f32 + 0.5) / rings as f32;
            let z = t * t;
            for k in 0..sectors {
                let phi = (k as f32 + 0.5) / sectors as f32 * std::f32::consts::PI;
                let r = (1.0 - z * z).sqrt();
                let wi = Vec3::new(r * phi.cos(), r * phi.sin(), z);
                sum += f64::from(lobe.value(wi) * 2.0 * t);
            }
        }
        sum * f64::from(TAU) / f64::from(rings * sectors)
    }

    #[test]
    #[ignore = "writes the table"]
    fn write_table() {
        let mut bytes = Vec::new();
        for row in 0..SIZE {
            let roughness = LEAST + (1.0 - LEAST) * row as f32 / (SIZE - 1) as f32;
            for column in 0..SIZE {
                let cos = (column as f32 / (SIZE - 1) as f32).max(0.01).powi(2);
                let share = integrated(roughness, cos) as f32 / RANGE;
                bytes.extend(((share.clamp(0.0, 1.0) * 65535.0).round() as u16).to_le_bytes());
            }
        }
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/src/bsdf/fuzz/charlie.bin"), bytes)
            .expect("writes the table");
    }

    #[test]
    fn the_table_holds_what_the_formulas_reflect() {
        for roughness in [0.07, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0] {
            for cos in [0.02, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0] {
                let expected = integrated(roughness, cos).min(1.0);
                let wo = Vec3::new((1.0f32 - cos * cos).max(0.0).sqrt(), 0.0, cos);
                let found = f64::from(CharlieLobe::new(roughness, wo).reflectance);
                assert!(
                    (found - expected).abs() < 5e-3,
                    "{roughness} {cos}: {found:.4}, integral {expected:.4}"
                );
            }
        }
    }
}
