//! The medium `cloud`, made of noise.

use super::{Grid, MediumProperties, ScalarGrid};
use crate::noise::fractal_noise;
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{ColorMode, DAffine3, DVec3, Rgb, Vec3, real};

/// Maximum number of cells along each axis, at which the grid takes 64 MiB.
const MOST_CELLS: u32 = 256;

snell_math::declare! {
    /// A cloud: an ellipsoid whose surface is eroded by fractal noise. It is stored as a `grid` of
    /// its density, which is between 0 and 1.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(default)]
    pub struct Cloud {
        /// Absorption coefficient per scene unit of length where the cloud is densest.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        pub sigma_a: Rgb,
        /// Scattering coefficient per scene unit of length where the cloud is densest.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        pub sigma_s: Rgb,
        /// Mean cosine of the angle by which light is deflected, in `(-1, 1)`; about 0.85 for water
        /// drops.
        #[range(Range::Between(-1.0, 1.0))]
        pub g: f32,
        /// Size of the largest lumps as a fraction of the cloud's size; positive.
        #[range(Range::Positive)]
        pub lumps: f32,
        /// Erosion of the ellipsoid by noise: 0 leaves it unchanged, 1 leaves shreds.
        #[range(Range::AMOUNT)]
        pub raggedness: f32,
        /// Seed of the noise, which chooses one of many clouds.
        pub seed: u32,
        /// Number of cells along each axis, 1 to 256.
        #[range(Range::Positive)]
        #[unit("cells")]
        pub resolution: u32,
        /// Map from the cloud's coordinates, where the cloud fills the unit cube, to the world.
        pub world_from_cloud: DAffine3,
    }
}

/// The default cloud, which fills the unit cube and has no coefficients.
impl Default for Cloud {
    fn default() -> Self {
        Self::new(DVec3::ZERO, DVec3::ONE, Rgb::BLACK, 0)
    }
}

impl Cloud {
    /// A white cloud in the box between two corners.
    pub fn new(min: DVec3, max: DVec3, sigma_s: Rgb, seed: u32) -> Self {
        Self {
            sigma_a: Rgb::BLACK,
            sigma_s,
            g: 0.7,
            lumps: 0.3,
            raggedness: 0.6,
            seed,
            resolution: 96,
            world_from_cloud: DAffine3::from_translation(min) * DAffine3::from_scale(max - min),
        }
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let cloud =
            Self { resolution: 16, ..Self::new(DVec3::ZERO, DVec3::ONE, Rgb::splat(20.0), 1) };
        vec![Self { raggedness: 0.0, g: -0.3, ..cloud.clone() }, cloud]
    }

    /// The density at a point of the unit cube, between 0 and 1.
    fn density(&self, p: Vec3) -> f32 {
        let lumps = if self.lumps > 1e-3 { self.lumps } else { 1.0 };
        let octaves = 1 + real::log2((lumps * self.resolution as f32).max(1.0)) as u32;
        let from_center = 2.0 * p - 1.0;
        let inside = 1.0 - from_center.length();
        // The cloud is flatter below, like real clouds.
        let base = (p.y * 6.0).clamp(0.0, 1.0);
        let noise = fractal_noise(p / lumps, octaves.min(8), self.seed);
        // The slope is steep, so that the edge is visible.
        (4.0 * (inside * base + self.raggedness * (noise - 0.35))).clamp(0.0, 1.0)
    }

    /// The density of the cloud as a grid.
    pub fn grid(&self) -> Grid {
        let n = self.resolution.clamp(1, MOST_CELLS);
        let middle = |i: u32| (i as f32 + 0.5) / n as f32;
        let cells = (0..n).flat_map(|z| (0..n).flat_map(move |y| (0..n).map(move |x| [x, y, z])));
        let values = cells.map(|cell| self.density(Vec3::from_array(cell.map(middle)))).collect();
        let density = ScalarGrid::new([n as usize; 3], values).unwrap_or_default();
        Grid::new(self.sigma_a, self.sigma_s, self.g, density, self.world_from_cloud)
    }

    /// The properties of the cloud at a point of the world, without the grid's interpolation.
    pub fn properties(&self, p: Vec3, mode: ColorMode) -> MediumProperties {
        let p = self.world_from_cloud.inverse().transform_point3(p.as_dvec3()).as_vec3();
        let is_inside = p.cmpge(Vec3::ZERO).all() && p.cmple(Vec3::ONE).all();
        let density = if is_inside { self.density(p) } else { 0.0 };
        MediumProperties::from_colors(
            self.sigma_a * density,
            self.sigma_s * density,
            Rgb::BLACK,
            self.g,
            mode,
        )
    }
}
