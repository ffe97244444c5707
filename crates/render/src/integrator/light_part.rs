//! Parts of the light, for layers that add up to the picture. A part is selected by the path of the
//! light to the camera.
//!
//! A path is classified by its *first* scattering as seen from the camera: the mirror image of a
//! wall is specular, whatever the wall is made of.

use snell_math::SampledSpectrum;
use snell_math::Vec3;
use snell_scene::MaterialId;
use snell_scene::material::ShadingBsdf;

/// The kind of the first scattering of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lobe {
    /// Reflection by diffuse lobes.
    Diffuse,
    /// All other reflection: by mirrors, glossy lobes and coats.
    Specular,
    /// Transmission through a surface.
    Transmission,
    /// Scattering in a medium.
    Volume,
}

impl Lobe {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Diffuse, Self::Specular, Self::Transmission, Self::Volume];
}

/// The number of scatterings between light and camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scatterings {
    /// None: the camera sees the light itself.
    None,
    /// One.
    One,
    /// More than one.
    Many,
}

impl Scatterings {
    /// The class of this number of scatterings.
    pub fn of(count: u32) -> Self {
        match count {
            0 => Self::None,
            1 => Self::One,
            _ => Self::Many,
        }
    }
}

/// A part of the picture: all light with these properties; `None` means any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightPart {
    /// The first scattering. Light that is not scattered has none.
    pub lobe: Option<Lobe>,
    /// How often the light is scattered.
    pub scatterings: Option<Scatterings>,
    /// Number of the light group, see [`crate::settings::LightGroup`]. The number after the last
    /// group stands for light of no group.
    pub group: Option<u8>,
}

impl LightPart {
    /// The fraction of light with this classification that belongs to the part, by lane.
    pub fn share(&self, light: &LightTag) -> SampledSpectrum {
        let fits = self.scatterings.is_none_or(|s| s == light.scatterings)
            && self.group.is_none_or(|g| g == light.group);
        match self.lobe {
            _ if !fits => SampledSpectrum::ZERO,
            None => SampledSpectrum::ONE,
            Some(_) if light.scatterings == Scatterings::None => SampledSpectrum::ZERO,
            Some(lobe) => light.lobe.share(lobe),
        }
    }
}

/// What a first scattering is made of: a fraction of diffuse reflection, and one other lobe for the
/// rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeShares {
    diffuse: SampledSpectrum,
    rest: Lobe,
}

impl LobeShares {
    /// The value before any scattering.
    pub const UNKNOWN: Self = Self { diffuse: SampledSpectrum::ZERO, rest: Lobe::Specular };
    /// Diffuse reflection of all wavelengths.
    pub const MATTE: Self = Self { diffuse: SampledSpectrum::ONE, rest: Lobe::Specular };
    /// Scattering in a medium.
    pub const VOLUME: Self = Self { diffuse: SampledSpectrum::ZERO, rest: Lobe::Volume };

    /// The lobes of scattering by a surface from `wi` to `wo`.
    pub fn of_surface(shading: &ShadingBsdf, wo: Vec3, wi: Vec3, is_delta: bool) -> Self {
        let normal = shading.geometric_normal;
        if normal.dot(wo) * normal.dot(wi) < 0.0 {
            return Self { diffuse: SampledSpectrum::ZERO, rest: Lobe::Transmission };
        }
        let mut diffuse = SampledSpectrum::ZERO;
        if !is_delta {
            let (part, all) = (shading.diffuse(wo, wi), shading.eval(wo, wi));
            for ((share, part), all) in diffuse.0.iter_mut().zip(part.0).zip(all.0) {
                *share = if all > 0.0 { (part / all).clamp(0.0, 1.0) } else { 0.0 };
            }
        }
        Self { diffuse, rest: Lobe::Specular }
    }

    /// Reflection by diffuse lobes alone.
    pub fn of_matte(reflectance: SampledSpectrum) -> Self {
        Self {
            diffuse: SampledSpectrum(reflectance.0.map(|r| f32::from(r > 0.0))),
            rest: Lobe::Specular,
        }
    }

    /// The fraction that belongs to a lobe, by lane.
    pub(crate) fn share(&self, lobe: Lobe) -> SampledSpectrum {
        match lobe {
            Lobe::Diffuse => self.diffuse,
            _ if lobe == self.rest => SampledSpectrum::ONE - self.diffuse,
            _ => SampledSpectrum::ZERO,
        }
    }
}

/// The classification of light that arrives at the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightTag {
    /// The first scattering of the light.
    pub lobe: LobeShares,
    /// How often the light was scattered.
    pub scatterings: Scatterings,
    /// The number of the light's group.
    pub group: u8,
}

/// A source of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightSource {
    /// A light of the scene graph, by its number.
    Light(u32),
    /// Surfaces of an emissive material.
    Material(MaterialId),
    /// The environment, or the background where the camera sees that.
    Environment,
    /// Emissive media.
    Medium,
}
