//! Fuzz: fibres on a surface, as on velvet, or dust.
//!
//! A volume of fibre-like flakes, fitted by linearly transformed cosines (Zeltner, Burley and
//! Chiang, Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines, SIGGRAPH 2022
//! talks). `sheen.bin` is the table that its authors publish with the talk (repository
//! tizian/ltc-sheen, Apache 2.0): for 32 roughnesses and 32 cosines the coefficients `a` and `b` of
//! the inverse transform and the reflectance, as 32-bit numbers.

use snell_math::{Frame, Vec2, Vec3, sampling};

const SIZE: usize = 32;
static TABLE: &[u8] = include_bytes!("sheen.bin");

fn entry(row: usize, column: usize) -> [f32; 3] {
    std::array::from_fn(|k| {
        let at = 4 * (3 * (row * SIZE + column) + k);
        f32::from_le_bytes([TABLE[at], TABLE[at + 1], TABLE[at + 2], TABLE[at + 3]])
    })
}

/// White fuzz of one roughness, seen from one direction above.
#[derive(Clone, Copy, Debug)]
pub(super) struct FuzzLobe {
    /// The azimuth of the viewer is `x`.
    frame: Frame,
    a: f32,
    b: f32,
    /// Share of light reflected; the rest reaches the layers below.
    pub(super) reflectance: f32,
}

impl FuzzLobe {
    pub(super) fn new(roughness: f32, wo: Vec3) -> Self {
        // The rows of the lowest roughness are empty: such fibres are too straight to be visible.
        let (row, r) = super::energy::nodes(roughness.max(0.07), SIZE);
        let (column, c) = super::energy::nodes(wo.z, SIZE);
        let lerp = |a: [f32; 3], b: [f32; 3], t: f32| -> [f32; 3] {
            std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t)
        };
        let at = |row| lerp(entry(row, column), entry(row, column + 1), c);
        let [a, b, reflectance] = lerp(at(row), at(row + 1), r);
        Self {
            frame: Frame::from_z_and_x(Vec3::Z, Vec3::new(wo.x, wo.y, 0.0)),
            a: a.max(1e-3),
            b,
            reflectance,
        }
    }

    /// Density per steradian with which light comes from `wi`, above.
    pub(super) fn pdf(&self, wi: Vec3) -> f32 {
        let w = self.frame.to_local(wi);
        let original = Vec3::new(self.a * w.x + self.b * w.z, self.a * w.y, w.z);
        let length2 = original.length_squared();
        // Cosine over length, times determinant over the cube of the length.
        sampling::cosine_hemisphere_pdf(w.z) * self.a * self.a / (length2 * length2)
    }

    pub(super) fn sample(&self, u: Vec2) -> Vec3 {
        let o = sampling::cosine_hemisphere(u);
        let w = Vec3::new((o.x - o.z * self.b) / self.a, o.y / self.a, o.z);
        self.frame.from_local(w.normalize_or(Vec3::Z))
    }
}
