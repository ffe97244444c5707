//! Patterns that combine other textures.

use super::rgb_at;
use crate::material::{ColorParam, ShadingPoint};
use crate::texture::mapping::Mapping;
use serde::{Deserialize, Serialize};
use snell_intersect::SurfaceInteraction;
use snell_math::{Rgb, Vec3, real};

snell_math::declare! {
    /// Product of two textures.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Scale {
        /// Texture that is scaled.
        pub texture: ColorParam,
        /// Factor on the texture.
        pub scale: ColorParam,
    }
}

impl Default for Scale {
    fn default() -> Self {
        Self { texture: Rgb::WHITE.into(), scale: Rgb::WHITE.into() }
    }
}

impl Scale {
    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        vec![Self { texture: Rgb::splat(0.25).into(), scale: Rgb::splat(2.0).into() }]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        true
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        rgb_at(&self.texture, point) * rgb_at(&self.scale, point)
    }
}

snell_math::declare! {
    /// Linear interpolation between two textures, separately in red, green and blue.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Mix {
        /// Texture where the amount is 0.
        pub first: ColorParam,
        /// Texture where the amount is 1.
        pub second: ColorParam,
        /// Fraction of the second texture; values outside `[0, 1]` extrapolate.
        pub amount: ColorParam,
    }
}

impl Default for Mix {
    fn default() -> Self {
        Self { first: Rgb::BLACK.into(), second: Rgb::WHITE.into(), amount: Rgb::splat(0.5).into() }
    }
}

impl Mix {
    /// Examples for tests and galleries: half and half, and a fraction that differs by channel.
    pub fn examples() -> Vec<Self> {
        vec![Self::default(), Self { amount: Rgb::new(0.1, 0.5, 1.0).into(), ..Self::default() }]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        true
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let amount = rgb_at(&self.amount, point);
        rgb_at(&self.first, point) * amount.map(|t| 1.0 - t) + rgb_at(&self.second, point) * amount
    }
}

snell_math::declare! {
    /// Blend of two textures by the direction of the shading normal: the first where the normal is
    /// along an axis or opposite to it, the second where it is perpendicular.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct DirectionMix {
        /// Texture where the shading normal is along the axis.
        pub first: ColorParam,
        /// Texture where the shading normal is perpendicular to the axis.
        pub second: ColorParam,
        /// Axis in the world, of any length but 0, which counts as the y axis.
        pub axis: Vec3,
    }
}

impl Default for DirectionMix {
    fn default() -> Self {
        Self { first: Rgb::BLACK.into(), second: Rgb::WHITE.into(), axis: Vec3::Y }
    }
}

impl DirectionMix {
    /// Examples for tests and galleries, with two axes.
    pub fn examples() -> Vec<Self> {
        vec![Self::default(), Self { axis: Vec3::new(2.0, 0.0, 1.0), ..Self::default() }]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        false
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let axis = self.axis.normalize_or(Vec3::Y);
        let amount = point.surface.shading_normal.dot(axis).abs().min(1.0);
        rgb_at(&self.first, point) * amount + rgb_at(&self.second, point) * (1.0 - amount)
    }
}

snell_math::declare! {
    /// A texture raised to a power, separately in red, green and blue; negative values count as 0.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Power {
        /// Texture that is raised to the power.
        pub base: ColorParam,
        /// Exponent, above 0; other values leave the base unchanged.
        pub exponent: f32,
    }
}

impl Default for Power {
    fn default() -> Self {
        Self { base: Rgb::WHITE.into(), exponent: 1.0 }
    }
}

impl Power {
    /// Examples for tests and galleries: a square root.
    pub fn examples() -> Vec<Self> {
        vec![Self { base: Rgb::splat(0.25).into(), exponent: 0.5 }]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        true
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let exponent =
            if self.exponent > 0.0 && self.exponent.is_finite() { self.exponent } else { 1.0 };
        rgb_at(&self.base, point).map(|x| real::powf(x.max(0.0), exponent))
    }
}

snell_math::declare! {
    /// Colour ramp: a table whose first entry is at 0 and whose last is at 1, interpolated
    /// linearly.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Ramp {
        /// Positions in the ramp, separately for red, green and blue; clamped to `[0, 1]`.
        pub amount: ColorParam,
        /// Colours of the table; an empty table is black.
        pub colors: Vec<Rgb>,
    }
}

impl Default for Ramp {
    fn default() -> Self {
        Self { amount: Rgb::BLACK.into(), colors: vec![Rgb::BLACK, Rgb::WHITE] }
    }
}

impl Ramp {
    /// Examples for tests and galleries: a ramp of three colours.
    pub fn examples() -> Vec<Self> {
        let colors = vec![Rgb::BLACK, Rgb::new(1.0, 0.0, 0.0), Rgb::WHITE];
        vec![Self { amount: Rgb::splat(0.75).into(), colors }]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        true
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let Some(last) = self.colors.len().checked_sub(1) else { return Rgb::BLACK };
        let Rgb { r, g, b } = rgb_at(&self.amount, point);
        let at = |x: f32, channel: fn(Rgb) -> f32| {
            let place = crate::bsdf::bounded(x, 1.0) * last as f32;
            let first = (place as usize).min(last);
            let [a, b] = [first, (first + 1).min(last)].map(|i| channel(self.colors[i]));
            a + (b - a) * (place - first as f32)
        };
        Rgb::new(at(r, |c| c.r), at(g, |c| c.g), at(b, |c| c.b))
    }
}

snell_math::declare! {
    /// Another texture with a mapping in place of the texture coordinates of the surface.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Projected {
        /// Texture that is looked up; its texture coordinates are `(s, 1 - t)`.
        pub texture: ColorParam,
        /// Mapping to `(s, t)`.
        pub mapping: Mapping,
    }
}

impl Default for Projected {
    fn default() -> Self {
        Self { texture: Rgb::WHITE.into(), mapping: Mapping::default() }
    }
}

impl Projected {
    /// Examples for tests and galleries, one for each mapping.
    pub fn examples() -> Vec<Self> {
        Mapping::examples().into_iter().map(|mapping| Self { mapping, ..Self::default() }).collect()
    }

    pub(super) fn is_on_surface(&self) -> bool {
        self.mapping.is_on_surface()
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let at = self.mapping.at(point);
        // Makes a surface on which the footprint has the given width in units of the coordinates.
        let long =
            |axis: Vec3, width: f32| axis * if width > 0.0 { point.footprint / width } else { 1.0 };
        let surface = SurfaceInteraction {
            uv: [at.st.with_y(1.0 - at.st.y); snell_intersect::UV_SETS],
            dpdu: long(Vec3::X, at.width.x),
            dpdv: long(Vec3::Y, at.width.y),
            ..*point.surface
        };
        rgb_at(&self.texture, &ShadingPoint { surface: &surface, ..*point })
    }
}
