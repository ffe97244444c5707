//! Participating media between surfaces: fog, smoke, clouds, milk, coloured glass, flames.
//!
//! A medium absorbs, scatters and emits, each with a coefficient per scene unit of length. It has
//! no shape of its own: it fills the inside of closed surfaces ([`crate::material::Interior`]) or
//! the whole scene ([`crate::Scene::medium`]).

mod analytic;
mod blackbody;
mod cloud;
mod equiangular;
mod glow;
mod grid;
mod height_fog;
mod homogeneous;
mod homogeneous_travel;
mod majorant;
mod phase;
mod prepared;
mod segment;
mod tracking;

pub use blackbody::{blackbody, blackbody_luminance};
pub use cloud::Cloud;
pub use equiangular::EquiangularLight;
pub use glow::Glow;
pub use grid::{CellGrid, CellValue, ColorGrid, Grid, ScalarGrid};
pub use height_fog::HeightFog;
pub use homogeneous::Homogeneous;
pub use homogeneous_travel::{HomogeneousTravel, attenuate_homogeneous, travel_homogeneous};
pub use phase::HenyeyGreenstein;
pub use prepared::PreparedMedium;
pub use segment::{Scattering, Segment, Travel};
pub use tracking::TrackedGrid;

use snell_math::{ColorMode, DVec3, Rgb, SampledSpectrum, Vec3};

/// Maximum coefficient per scene unit. Scenes may be as small as they like, so this is only what
/// keeps products of two coefficients finite.
const MAX_COEFFICIENT: f32 = 1e18;

/// The properties of a medium at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MediumProperties {
    /// Probability density of absorption per scene unit of length.
    pub sigma_a: SampledSpectrum,
    /// Probability density of scattering per scene unit of length.
    pub sigma_s: SampledSpectrum,
    /// Radiance emitted per scene unit of length, W / (m^2 sr).
    pub emission: SampledSpectrum,
    /// The directional distribution of scattered light.
    pub phase: HenyeyGreenstein,
}

impl MediumProperties {
    /// Extinction, the sum of absorption and scattering.
    pub fn sigma_t(&self) -> SampledSpectrum {
        self.sigma_a + self.sigma_s
    }

    /// The properties from authored colours. Negative and undefined coefficients count as 0.
    pub fn from_colors(sigma_a: Rgb, sigma_s: Rgb, emission: Rgb, g: f32, mode: ColorMode) -> Self {
        Self {
            sigma_a: coefficient(sigma_a, mode),
            sigma_s: coefficient(sigma_s, mode),
            emission: mode.illuminant(emission.map(sane)),
            phase: HenyeyGreenstein::new(g),
        }
    }
}

/// The lanes of a coefficient, which may exceed 1.
fn coefficient(color: Rgb, mode: ColorMode) -> SampledSpectrum {
    let color = color.map(sane);
    // Reflectances are at most 1. Twice the maximum leaves room for their spectra.
    let scale = 2.0 * color.r.max(color.g).max(color.b);
    if scale > 0.0 {
        mode.reflectance(color * (1.0 / scale)) * scale
    } else {
        SampledSpectrum::ZERO
    }
}

/// A valid coefficient: negative numbers and NaN become 0, and larger ones are clamped to
/// [`MAX_COEFFICIENT`].
fn sane(x: f32) -> f32 {
    if x > 0.0 { x.min(MAX_COEFFICIENT) } else { 0.0 }
}

impl Medium {
    /// Copies the grids of another medium, since a textual description has none.
    pub fn keep_grids_of(&mut self, other: &Self) {
        if let (Self::Grid(grid), Self::Grid(other)) = (self, other) {
            grid.density = other.density.clone();
            grid.emission_scale = other.emission_scale.clone();
            grid.temperature = other.temperature.clone();
            grid.sigma_a_tint = other.sigma_a_tint.clone();
            grid.sigma_s_tint = other.sigma_s_tint.clone();
            grid.emission_tint = other.emission_tint.clone();
        }
    }

    /// Moves the medium by a vector in the world.
    pub fn translate(&mut self, by: DVec3) {
        match self {
            Self::Homogeneous(_) => {}
            Self::HeightFog(fog) => fog.base += by,
            Self::Grid(grid) => grid.world_from_grid.translation += by,
            Self::Cloud(cloud) => cloud.world_from_cloud.translation += by,
        }
    }

    /// The same medium without its grids, as a textual description.
    pub fn without_grids(&self) -> Self {
        let mut bare = self.clone();
        bare.keep_grids_of(&Grid::default().into());
        bare
    }
}

snell_math::kinds! {
    /// Any of the media, placed in world coordinates.
    pub enum Medium tagged "medium" by match_medium! {
        "homogeneous" => Homogeneous,
        "height-fog" => HeightFog,
        "grid" => Grid,
        "cloud" => Cloud,
    }
}

impl Medium {
    /// The properties of the medium at a point of the world.
    pub fn properties(&self, p: Vec3, mode: ColorMode) -> MediumProperties {
        match_medium!(self, medium => medium.properties(p, mode))
    }

    /// True if the medium emits light.
    pub fn is_emissive(&self) -> bool {
        match self {
            Self::Homogeneous(Homogeneous { emission, .. }) => !emission.is_black(),
            Self::Grid(grid) => grid.temperature.is_some() || !grid.emission.is_black(),
            Self::HeightFog(_) | Self::Cloud(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_coefficients_count_as_nothing_and_huge_ones_stay_finite() {
        let wild = Rgb::new(f32::NAN, -3.0, f32::INFINITY);
        let medium = MediumProperties::from_colors(wild, wild, wild, f32::NAN, ColorMode::Rgb);
        for lanes in [medium.sigma_t(), medium.emission] {
            assert!(
                lanes.is_finite()
                    && lanes[0] == 0.0
                    && lanes[1] == 0.0
                    && lanes[2] >= MAX_COEFFICIENT,
                "{lanes:?}"
            );
        }
    }

    #[test]
    fn coefficients_above_one_are_kept() {
        let medium = MediumProperties::from_colors(
            Rgb::new(5.0, 0.25, 0.0),
            Rgb::WHITE,
            Rgb::BLACK,
            0.0,
            ColorMode::Rgb,
        );
        assert_eq!(medium.sigma_t(), SampledSpectrum([6.0, 1.25, 1.0, 0.0]));
    }

    #[test]
    fn every_medium_has_finite_properties_everywhere() {
        for medium in Medium::examples() {
            for p in [Vec3::ZERO, Vec3::splat(0.5), Vec3::splat(-1e30), Vec3::splat(f32::MAX)] {
                let m = medium.properties(p, ColorMode::Rgb);
                assert!(
                    m.sigma_t().is_finite() && m.emission.is_finite(),
                    "{} at {p}",
                    medium.name()
                );
            }
        }
    }
}
