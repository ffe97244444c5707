//! Surfaces of delta lobes only that are the same everywhere, for vertices in batches.

use super::prepared::anywhere;
use super::{Dielectric, Material, MaterialKind, ShadingPoint, relative_ior};
use crate::bsdf::{Bsdf, Interface, Lobes};
use crate::texture::TextureSet;
use snell_intersect::SurfaceInteraction;
use snell_math::{ColorMode, SampledSpectrum, Vec3};

/// Reflection and refraction of a smooth surface. Surfaces that only reflect exist in
/// [`ColorMode::Rgb`] only.
#[derive(Clone, Debug)]
pub enum Specular {
    /// Reflects or refracts.
    Interface {
        /// Index of refraction of the inside over that of air.
        ior: f32,
        /// Factor on light that crosses, in [`ColorMode::Rgb`].
        tint: SampledSpectrum,
        /// The material.
        glass: Dielectric,
    },
    /// Only reflects: the BSDF has one lobe, that of a mirror.
    Reflector(Box<Bsdf>),
}

impl Specular {
    /// `None` for materials that do anything else, that emit, or that depend on more of the point
    /// than its normal.
    pub fn of(material: &Material) -> Option<Self> {
        let may_be = matches!(
            material.kind,
            MaterialKind::Dielectric(_) | MaterialKind::Conductor(_) | MaterialKind::Mirror(_)
        );
        if !may_be || material.is_emissive() {
            return None;
        }
        let (bsdf, looks_up) = anywhere(&material.kind);
        if looks_up {
            return None;
        }
        match (&bsdf, &material.kind) {
            (Bsdf::Dielectric(lobe), MaterialKind::Dielectric(glass))
                if lobe.interface().microfacets.is_smooth() =>
            {
                let &Interface { ior, tint, .. } = lobe.interface();
                Some(Self::Interface { ior, tint, glass: glass.clone() })
            }
            (Bsdf::Conductor(_) | Bsdf::Mirror(_), _) if bsdf.is_delta() => {
                Some(Self::Reflector(Box::new(bsdf)))
            }
            _ => None,
        }
    }

    /// Index of refraction of the inside over this one of the outside; 1 for surfaces that only
    /// reflect.
    #[inline]
    pub fn ior(&self, outside_ior: f32) -> f32 {
        match self {
            Self::Interface { ior, .. } => relative_ior(*ior, outside_ior),
            Self::Reflector(_) => 1.0,
        }
    }

    /// Factor on light that crosses.
    #[inline]
    pub fn tint(&self, mode: ColorMode) -> SampledSpectrum {
        match self {
            Self::Interface { tint, .. } if mode == ColorMode::Rgb => *tint,
            Self::Interface { glass, .. } => {
                let surface = SurfaceInteraction::plain(Vec3::ZERO, Vec3::Z);
                let textures = &TextureSet::default();
                glass.tint_at(&ShadingPoint {
                    surface: &surface,
                    footprint: 0.0,
                    textures,
                    mode,
                    outside_ior: 1.0,
                })
            }
            Self::Reflector(_) => SampledSpectrum::ZERO,
        }
    }

    /// Transmittance of the inside over a distance.
    #[inline]
    pub fn transmittance(&self, distance: f32, mode: ColorMode) -> SampledSpectrum {
        match self {
            Self::Interface { glass, .. } => glass.transmittance(distance, mode),
            Self::Reflector(_) => SampledSpectrum::ONE,
        }
    }

    /// Factor on reflected light at this cosine; `None` for surfaces that also refract.
    #[inline]
    pub fn reflectance(&self, cos: f32) -> Option<SampledSpectrum> {
        match self {
            Self::Interface { .. } => None,
            Self::Reflector(bsdf) => Some(bsdf.specular_branches(Vec3::Z * cos)[0]?.weight),
        }
    }

    /// True if the BSDF is opaque ([`Lobes::is_opaque`]).
    pub fn is_opaque(&self) -> bool {
        match self {
            Self::Interface { .. } => false,
            Self::Reflector(bsdf) => bsdf.is_opaque(),
        }
    }
}
