//! Surfaces that have only delta lobes and are the same everywhere, for vertices in batches.

use super::prepared::anywhere;
use super::{Dielectric, Material, MaterialKind, ShadingPoint, relative_ior};
use crate::bsdf::{Bsdf, Interface, Lobes};
use crate::texture::TextureSet;
use snell_intersect::SurfaceInteraction;
use snell_math::{ColorMode, SampledSpectrum, Vec3};

/// Reflection and refraction of a smooth surface. Surfaces that only reflect are used in
/// [`ColorMode::Rgb`] only.
#[derive(Clone, Debug)]
pub enum Specular {
    /// A surface that reflects or refracts.
    Interface {
        /// Index of refraction inside divided by that of air.
        ior: f32,
        /// Factor on light that crosses the surface, in [`ColorMode::Rgb`].
        tint: SampledSpectrum,
        /// The material of the surface.
        glass: Dielectric,
    },
    /// A surface that only reflects. Its BSDF has one lobe, that of a mirror.
    Reflector(Box<Bsdf>),
}

impl Specular {
    /// The lobes of a material; `None` for materials that scatter light in other ways, that emit,
    /// or that depend on more of a point than its normal.
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

    /// Index of refraction inside divided by `outside_ior`; 1 for surfaces that only reflect.
    #[inline]
    pub fn ior(&self, outside_ior: f32) -> f32 {
        match self {
            Self::Interface { ior, .. } => relative_ior(*ior, outside_ior),
            Self::Reflector(_) => 1.0,
        }
    }

    /// Factor on light that crosses the surface.
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

    /// Transmittance of the interior over a distance in scene units.
    #[inline]
    pub fn transmittance(&self, distance: f32, mode: ColorMode) -> SampledSpectrum {
        match self {
            Self::Interface { glass, .. } => glass.transmittance(distance, mode),
            Self::Reflector(_) => SampledSpectrum::ONE,
        }
    }

    /// Factor on light that is reflected at an angle with this cosine; `None` for surfaces that
    /// also refract.
    #[inline]
    pub fn reflectance(&self, cos: f32) -> Option<SampledSpectrum> {
        match self {
            Self::Interface { .. } => None,
            Self::Reflector(bsdf) => Some(bsdf.specular_branches(Vec3::Z * cos)[0]?.weight),
        }
    }

    /// True if the surface transmits no light ([`Lobes::is_opaque`]).
    pub fn is_opaque(&self) -> bool {
        match self {
            Self::Interface { .. } => false,
            Self::Reflector(bsdf) => bsdf.is_opaque(),
        }
    }
}
