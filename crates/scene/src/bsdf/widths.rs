//! The roughness of microfacet surfaces, as all distributions use it.

use snell_math::Vec3;

/// Below this width, lobes are too narrow for single precision.
const MIN_ALPHA: f32 = 1e-3;

/// Roughness of a surface: the root mean square slope is about `x` along the tangent and `y` along
/// the bitangent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Widths {
    pub(super) x: f32,
    pub(super) y: f32,
}

impl Widths {
    /// The widths of a perceptual roughness in `[0, 1]`: `alpha = roughness^2`, as in glTF and
    /// OpenPBR. Clamps; NaN counts as 0.
    pub fn from_roughness(roughness: f32) -> Self {
        let roughness = super::bounded(roughness, 1.0);
        Self { x: roughness * roughness, y: roughness * roughness }
    }

    /// Isotropic widths with this [alpha](Self::alpha), in `[0, 1]`.
    #[inline(always)]
    pub(super) fn both(alpha: f32) -> Self {
        Self { x: alpha, y: alpha }
    }

    /// The widths of a perceptual roughness and an anisotropy along the tangent, both in `[0, 1]`.
    /// The mean square of the two widths is `roughness^4` for any anisotropy (OpenPBR Surface 1.1,
    /// section "Microfacet model").
    pub fn from_anisotropy(roughness: f32, anisotropy: f32) -> Self {
        let (r, rest) = (super::bounded(roughness, 1.0), 1.0 - super::bounded(anisotropy, 1.0));
        let x = r * r * (2.0 / (1.0 + rest * rest)).sqrt();
        Self::from_alphas(x, rest * x)
    }

    /// [`Self::from_anisotropy`] for an anisotropy in `[-1, 1]`; a negative one is along the
    /// bitangent.
    pub fn stretched(roughness: f32, anisotropy: f32) -> Self {
        let Self { x, y } = Self::from_anisotropy(roughness, anisotropy.abs());
        if anisotropy < 0.0 { Self { x: y, y: x } } else { Self { x, y } }
    }

    /// The distribution with these widths along tangent and bitangent. A surface that is smooth
    /// along one axis only gets the minimum width along that axis.
    pub fn from_alphas(x: f32, y: f32) -> Self {
        let [x, y] = [x, y].map(|alpha| super::bounded(alpha, 2.0));
        if x.max(y) < MIN_ALPHA {
            Self { x, y }
        } else {
            Self { x: x.max(MIN_ALPHA), y: y.max(MIN_ALPHA) }
        }
    }

    /// The width of the distribution; for an anisotropic one the geometric mean of both widths.
    pub fn alpha(self) -> f32 {
        if self.x == self.y { self.x } else { (self.x * self.y).sqrt() }
    }

    /// True if the distribution depends on tangents: the surface is rough and anisotropic.
    pub fn has_tangent(self) -> bool {
        self.x != self.y && !self.is_smooth()
    }

    /// True if the surface counts as perfectly smooth, with delta lobes. Below `alpha = 0.001`,
    /// lobes are too narrow for single precision.
    #[inline(always)]
    pub fn is_smooth(self) -> bool {
        self.x.max(self.y) < MIN_ALPHA
    }

    /// `z |tan| alpha`, with the width `alpha` along the direction and `z` and `tan` of the
    /// direction.
    pub(super) fn spread(self, w: Vec3) -> f32 {
        let (x, y) = (self.x * w.x, self.y * w.y);
        (x * x + y * y).sqrt()
    }

    /// `z sqrt(1 + (alpha tan)^2)`, with the width `alpha` along the direction and `z` and `tan` of
    /// the direction.
    #[inline(always)]
    pub(super) fn root(self, w: Vec3) -> f32 {
        let (x, y) = (self.x * w.x, self.y * w.y);
        (x * x + y * y + w.z * w.z).sqrt()
    }

    /// The cosine of a direction in units of the roughness: 0 where the direction grazes the
    /// surface, 1 along the normal. Masking depends on this number alone.
    #[inline(always)]
    pub(super) fn steepness(self, w: Vec3) -> f32 {
        let spread = self.spread(w);
        if w.z > 0.0 { w.z / (w.z + spread) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretched_widths_have_the_mean_square_of_the_roughness() {
        for (anisotropy, ratio) in
            [(0.0, 1.0), (0.6, 0.4), (-0.6, 2.5), (1.0, 0.0), (f32::NAN, 1.0)]
        {
            let Widths { x, y } = Widths::stretched(0.8, anisotropy);
            assert!((0.5 * (x * x + y * y) - 0.8f32.powi(4)).abs() < 1e-5, "{anisotropy}: {x} {y}");
            assert!((y / x - ratio).abs() < 2e-3, "{anisotropy}: {x} {y}");
        }
    }

    #[test]
    fn hostile_roughness_is_bounded() {
        for rough in [f32::NAN, -1.0, 0.0, 1e-9, 1.0, 2.0, f32::INFINITY] {
            let all = [
                Widths::from_roughness(rough),
                Widths::from_alphas(rough, 1.0 - rough),
                Widths::stretched(rough, rough),
            ];
            for Widths { x, y } in all {
                assert!((0.0..=2.0).contains(&x) && (0.0..=2.0).contains(&y), "{rough}: {x} {y}");
            }
        }
    }
}
