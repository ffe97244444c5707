//! The first surface along a camera ray, with the values that AOVs show.

use super::{Context, SurfaceVertex, outgoing};
use snell_intersect::SurfaceInteraction;
use snell_math::{ColorMode, Ray, Rgb, SampledSpectrum, Vec2, Vec3};

/// The data of a surface that AOVs show. See [`SurfaceInteraction`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FirstSurface {
    /// Point in the world.
    pub position: Vec3,
    /// Geometric normal.
    pub geometric_normal: Vec3,
    /// Interpolated vertex normal; normal maps are not applied.
    pub shading_normal: Vec3,
    /// First texture coordinates.
    pub uv: Vec2,
    /// Fraction of light that the material reflects or transmits towards the ray's origin; black
    /// unless [`SurfaceNeeds::albedo`] is set.
    pub albedo: Rgb,
}

/// The data that are needed besides the position and the normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceNeeds {
    /// True if texture coordinates are needed.
    pub uv: bool,
    /// True if the albedo is needed.
    pub albedo: bool,
}

impl FirstSurface {
    /// The data of a surface that a ray has hit.
    pub fn of(context: &Context, ray: &Ray, surface: &SurfaceVertex, needs: SurfaceNeeds) -> Self {
        let SurfaceInteraction { position, geometric_normal, shading_normal, uv, .. } =
            *surface.interaction;
        let albedo = || {
            surface.material.albedo(surface.prepared, &surface.point(context.scene), outgoing(ray))
        };
        let albedo = if needs.albedo { in_white_light(surface.mode, albedo()) } else { Rgb::BLACK };
        Self { position, geometric_normal, shading_normal, uv: uv[0], albedo }
    }
}

/// The colour of an albedo under white light.
pub(crate) fn in_white_light(mode: ColorMode, albedo: SampledSpectrum) -> Rgb {
    mode.to_rgb(mode.in_white_light(albedo))
}
