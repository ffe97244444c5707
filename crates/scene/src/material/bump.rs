//! Bump maps: a texture of heights that changes shading normals but does not move the surface.

use super::ShadingPoint;
use crate::graph::TextureId;
use serde::{Deserialize, Serialize};
use snell_intersect::SurfaceInteraction;
use snell_math::parameters::Range;
use snell_math::{Rgb, Vec3};

snell_math::declare! {
    /// Heights that perturb the shading normal as if the surface were displaced along its normal.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct BumpMap {
        /// Linear texture of heights: an image or a pattern.
        pub texture: TextureId,
        /// The channel that holds the height (0 red to 3 alpha); without it, the luminance.
        #[range(Range::Within(0.0, 3.0))]
        #[serde(default)]
        pub channel: Option<u8>,
        /// Height where the texture is 1. If it is negative, bright texels are deep.
        pub height: f32,
        /// The unit of heights.
        #[serde(default)]
        pub unit: HeightUnit,
    }
}

snell_math::declare! {
    /// Unit of the heights in a bump map.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    pub enum HeightUnit {
        /// Units of the scene.
        "scene" => #[default] Scene,
        /// Multiples of the width of the whole image on the surface, so that the look does not
        /// depend on the size of the object.
        "picture" => Picture,
    }
}

/// Minimum step over the surface, relative to the distance from the origin, so that positions still
/// differ after rounding.
const LEAST_STEP: f32 = 2e-4;

/// The default step, in texture coordinates.
const PLAIN_STEP: f32 = 5e-4;

impl BumpMap {
    /// The gradient of the height along the surface: a vector perpendicular to the shading normal
    /// that points uphill and whose length is the slope (Mikkelsen, Bump Mapping Unparametrized
    /// Surfaces on the GPU, 2010). It is computed by central differences over the footprint of a
    /// pixel, but over at least one texel of an image, so slopes are continuous although the
    /// texture is linear between texels.
    pub(super) fn gradient(&self, point: &ShadingPoint) -> Vec3 {
        let surface = point.surface;
        let (n, dpdu, dpdv) = (surface.shading_normal, surface.dpdu, surface.dpdv);
        let area = n.dot(dpdu.cross(dpdv));
        let texels = point.textures.texel_steps(self.texture);
        let far = surface.position.abs().max_element() * LEAST_STEP;
        let step = |derivative: Vec3, texel: Option<f32>| {
            let cone = (0.5 * point.footprint).max(if texel.is_none() { far } else { 0.0 })
                / derivative.length();
            let texel = texel.filter(|texel| texel.is_finite());
            let least =
                texel.map_or(if cone > 0.0 { 0.0 } else { PLAIN_STEP }, |texel| 0.5 * texel);
            cone.max(least)
        };
        let (du, dv) = (step(dpdu, texels.map(|t| t[0])), step(dpdv, texels.map(|t| t[1])));
        let rise = |u: f32, v: f32| self.moved(point, u, v) - self.moved(point, -u, -v);
        let (by_u, by_v) = (rise(du, 0.0) / (2.0 * du), rise(0.0, dv) / (2.0 * dv));
        let unit = match self.unit {
            HeightUnit::Scene => 1.0,
            HeightUnit::Picture => {
                let turns =
                    point.textures.image(self.texture).map_or(1.0, |image| image.area_scale());
                (area.abs() / turns).sqrt()
            }
        };
        let gradient = (dpdv.cross(n) * by_u + n.cross(dpdu) * by_v) * (self.height * unit / area);
        if gradient.is_finite() { gradient } else { Vec3::ZERO }
    }

    /// The height in the texture at a small offset from the point, given in texture coordinates.
    fn moved(&self, point: &ShadingPoint, u: f32, v: f32) -> f32 {
        let mut beside: SurfaceInteraction = *point.surface;
        beside.position += beside.dpdu * u + beside.dpdv * v;
        beside.uv = beside.uv.map(|uv| uv + snell_math::Vec2::new(u, v));
        let rgba = point.textures.lookup(self.texture, &beside, point.footprint);
        match self.channel {
            Some(channel) => rgba[usize::from(channel).min(3)],
            None => Rgb::new(rgba[0], rgba[1], rgba[2]).luminance(),
        }
    }
}
