//! Fuzz: fibres on a surface, as on velvet, or dust.
//!
//! [`FuzzModel::Flakes`] is a volume of fibre-like flakes, fitted by linearly transformed cosines
//! (Zeltner, Burley and Chiang, Practical Multiple-Scattering Sheen Using Linearly Transformed
//! Cosines, SIGGRAPH 2022 talks). `sheen.bin` is the table that its authors publish with the talk
//! (repository tizian/ltc-sheen, Apache 2.0): for 32 roughnesses and 32 cosines the coefficients
//! `a` and `b` of the inverse transform and the reflectance, as 32-bit numbers.
//!
//! [`FuzzModel::Charlie`] is in `charlie.rs`.

mod charlie;

use charlie::CharlieLobe;
use serde::{Deserialize, Serialize};
use snell_math::{Frame, SampledSpectrum, Vec2, Vec3, sampling};

snell_math::declare! {
    /// Law by which fuzz reflects light.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
    pub enum FuzzModel {
        /// Flakes that scatter light many times, as in OpenPBR Surface 1.1.
        "flakes" => #[default] Flakes,
        /// Cylindrical fibres that reflect light once, as in glTF's `KHR_materials_sheen`; a coat
        /// covers them.
        "charlie" => Charlie,
    }
}

/// Fibres on top.
#[derive(Clone, Copy, Debug)]
pub struct Fuzz {
    /// Share of the surface that it covers, `[0, 1]`.
    pub weight: f32,
    /// Tint of its reflection.
    pub color: SampledSpectrum,
    /// 0 for straight fibres, 1 for dust.
    pub roughness: f32,
    /// Law of its reflection.
    pub model: FuzzModel,
}

impl Fuzz {
    /// True if a clear coat lies above the fuzz: that of glTF is a part of the base that a clear
    /// coat covers (`KHR_materials_clearcoat`, section "Layering"), that of OpenPBR the top layer.
    pub(super) fn is_under_coat(&self) -> bool {
        self.model == FuzzModel::Charlie
    }

    /// Share of light that passes towards a direction of this cosine.
    pub(crate) fn passed(&self, cos: f32) -> f32 {
        let w = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        1.0 - self.weight * FuzzLobe::new(self, w).reflectance()
    }
}

/// White fuzz of one roughness, seen from one direction above.
#[derive(Clone, Copy, Debug)]
pub(super) enum FuzzLobe {
    Flakes(FlakesLobe),
    Charlie(CharlieLobe),
}

impl FuzzLobe {
    pub(super) fn new(fuzz: &Fuzz, wo: Vec3) -> Self {
        match fuzz.model {
            FuzzModel::Flakes => Self::Flakes(FlakesLobe::new(fuzz.roughness, wo)),
            FuzzModel::Charlie => Self::Charlie(CharlieLobe::new(fuzz.roughness, wo)),
        }
    }

    /// Share of light reflected; the rest reaches the layers below.
    pub(super) fn reflectance(&self) -> f32 {
        match self {
            Self::Flakes(lobe) => lobe.reflectance,
            Self::Charlie(lobe) => lobe.reflectance,
        }
    }

    /// `f |cos(wi)|` for a direction above, and the density with which [`Self::sample`] draws it.
    pub(super) fn value_and_pdf(&self, wi: Vec3) -> (f32, f32) {
        match self {
            Self::Flakes(lobe) => {
                let pdf = lobe.pdf(wi);
                (lobe.reflectance * pdf, pdf)
            }
            Self::Charlie(lobe) => (lobe.value(wi), CharlieLobe::PDF),
        }
    }

    pub(super) fn sample(&self, u: Vec2) -> Vec3 {
        match self {
            Self::Flakes(lobe) => lobe.sample(u),
            Self::Charlie(_) => CharlieLobe::sample(u),
        }
    }
}

const SIZE: usize = 32;
static TABLE: &[u8] = include_bytes!("sheen.bin");

fn entry(row: usize, column: usize) -> [f32; 3] {
    std::array::from_fn(|k| {
        let at = 4 * (3 * (row * SIZE + column) + k);
        f32::from_le_bytes([TABLE[at], TABLE[at + 1], TABLE[at + 2], TABLE[at + 3]])
    })
}

/// White flakes of one roughness, seen from one direction above.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlakesLobe {
    /// The azimuth of the viewer is `x`.
    frame: Frame,
    a: f32,
    b: f32,
    /// Share of light reflected; the rest reaches the layers below.
    reflectance: f32,
}

impl FlakesLobe {
    fn new(roughness: f32, wo: Vec3) -> Self {
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
    fn pdf(&self, wi: Vec3) -> f32 {
        let w = self.frame.to_local(wi);
        let original = Vec3::new(self.a * w.x + self.b * w.z, self.a * w.y, w.z);
        let length2 = original.length_squared();
        // Cosine over length, times determinant over the cube of the length.
        sampling::cosine_hemisphere_pdf(w.z) * self.a * self.a / (length2 * length2)
    }

    fn sample(&self, u: Vec2) -> Vec3 {
        let o = sampling::cosine_hemisphere(u);
        let w = Vec3::new((o.x - o.z * self.b) / self.a, o.y / self.a, o.z);
        self.frame.from_local(w.normalize_or(Vec3::Z))
    }
}
