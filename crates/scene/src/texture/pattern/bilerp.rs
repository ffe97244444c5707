//! Bilinear interpolation between four corners.

use super::rgb_at;
use crate::material::{ColorParam, ShadingPoint};
use crate::texture::mapping::Mapping;
use serde::{Deserialize, Serialize};
use snell_math::Rgb;

snell_math::declare! {
    /// Bilinear interpolation between four colours, which extrapolates outside of their square.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct Bilerp {
        /// The texture at `(s, t) = (0, 0)`.
        pub v00: ColorParam,
        /// The texture at `(0, 1)`.
        pub v01: ColorParam,
        /// The texture at `(1, 0)`.
        pub v10: ColorParam,
        /// The texture at `(1, 1)`.
        pub v11: ColorParam,
        /// Mapping of the corners.
        pub mapping: Mapping,
    }
}

impl Default for Bilerp {
    fn default() -> Self {
        let [v0, v1]: [ColorParam; 2] = [Rgb::BLACK.into(), Rgb::WHITE.into()];
        Self { v00: v0, v01: v1, v10: v0, v11: v1, mapping: Mapping::default() }
    }
}

impl Bilerp {
    /// Examples for tests and galleries: from black below to white above, and between four colours.
    pub fn examples() -> Vec<Self> {
        let [v00, v01, v10] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|c| ColorParam::from(Rgb::from(c)));
        vec![Self::default(), Self { v00, v01, v10, ..Self::default() }]
    }

    pub(super) fn is_on_surface(&self) -> bool {
        self.mapping.is_on_surface()
    }

    pub(super) fn rgb(&self, point: &ShadingPoint) -> Rgb {
        let st = self.mapping.at(point).st;
        let left = rgb_at(&self.v00, point) * (1.0 - st.y) + rgb_at(&self.v01, point) * st.y;
        let right = rgb_at(&self.v10, point) * (1.0 - st.y) + rgb_at(&self.v11, point) * st.y;
        left * (1.0 - st.x) + right * st.x
    }
}
