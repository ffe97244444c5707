//! Media with precomputed tables for travel.

use super::analytic::{self, Profile};
use super::tracking::TrackedGrid;
use super::{
    EquiangularLight, Glow, HeightFog, Homogeneous, Medium, MediumProperties, Segment, Travel,
};
use snell_math::{ColorMode, SampledSpectrum, Vec2};

/// A medium with precomputed tables.
#[derive(Clone, Debug)]
pub enum PreparedMedium {
    /// Travel in closed form; the properties are those in [`ColorMode::Rgb`].
    Homogeneous(Homogeneous, MediumProperties),
    /// Travel in closed form.
    HeightFog(HeightFog),
    /// Travel by collisions with a grid.
    Tracked(Box<TrackedGrid>),
}

impl PreparedMedium {
    /// Computes the tables.
    pub fn new(medium: &Medium) -> Self {
        match medium {
            Medium::Homogeneous(medium) => {
                Self::Homogeneous(medium.clone(), medium.at_all(ColorMode::Rgb))
            }
            Medium::HeightFog(fog) => Self::HeightFog(fog.clone()),
            Medium::Cloud(cloud) => Self::Tracked(Box::new(TrackedGrid::new(&cloud.grid()))),
            Medium::Grid(grid) => Self::Tracked(Box::new(TrackedGrid::new(grid))),
        }
    }

    /// True if the attenuation of light rays is known in closed form.
    pub fn is_in_closed_form(&self) -> bool {
        !matches!(self, Self::Tracked(_))
    }

    /// The properties if they are the same everywhere; otherwise `None`.
    pub fn everywhere(&self, mode: ColorMode) -> Option<MediumProperties> {
        match self {
            Self::Homogeneous(_, rgb) if mode == ColorMode::Rgb => Some(*rgb),
            Self::Homogeneous(medium, _) => Some(medium.at_all(mode)),
            Self::HeightFog(_) | Self::Tracked(_) => None,
        }
    }

    /// Like [`Self::everywhere`] in [`ColorMode::Rgb`].
    pub fn everywhere_in_rgb(&self) -> Option<&MediumProperties> {
        match self {
            Self::Homogeneous(_, rgb) => Some(rgb),
            Self::HeightFog(_) | Self::Tracked(_) => None,
        }
    }

    /// Sends a path along a segment: it is scattered on the way, or reaches the end. `numbers`
    /// returns pairs of independent uniform numbers in `[0, 1)`.
    pub fn travel(
        &self,
        segment: &Segment,
        throughput: SampledSpectrum,
        mode: ColorMode,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> Travel {
        self.travel_weighted(segment, throughput, mode, |_| 1.0, numbers)
    }

    /// Its emission, if that can be sampled as a light.
    pub fn glow(&self) -> Option<Glow> {
        match self {
            Self::Homogeneous(..) | Self::HeightFog(_) => None,
            Self::Tracked(grid) => Glow::new(grid),
        }
    }

    /// Like [`Self::travel`], with a factor on the light emitted at a distance from the segment's
    /// origin, if there is a [`Self::glow`].
    pub fn travel_weighted(
        &self,
        segment: &Segment,
        throughput: SampledSpectrum,
        mode: ColorMode,
        weight: impl Fn(f32) -> f32,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> Travel {
        match self {
            Self::Homogeneous(m, _) => m.at_all(mode).travel(segment, throughput, numbers()),
            Self::HeightFog(fog) => analytic::travel(
                &fog.at_base(mode),
                fog.profile(segment),
                segment,
                throughput,
                numbers(),
            ),
            Self::Tracked(grid) => grid.travel(segment, throughput, mode, weight, numbers),
        }
    }

    /// The remaining value of a light ray at the end of a segment, on average over `numbers`.
    pub fn attenuate(
        &self,
        segment: &Segment,
        value: SampledSpectrum,
        mode: ColorMode,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> SampledSpectrum {
        match self {
            Self::Homogeneous(m, _) => m.at_all(mode).attenuate(segment.length, value),
            Self::HeightFog(fog) => {
                analytic::attenuate(&fog.at_base(mode), fog.profile(segment), segment.length, value)
            }
            Self::Tracked(grid) => grid.attenuate(segment, value, mode, numbers),
        }
    }
}

/// Travel through a homogeneous medium.
impl MediumProperties {
    /// Like [`PreparedMedium::travel`], for `u` in `[0, 1)^2`.
    pub fn travel(&self, segment: &Segment, throughput: SampledSpectrum, u: Vec2) -> Travel {
        analytic::travel(self, Profile::CONSTANT, segment, throughput, u)
    }

    /// The same with more scattering near a light: for light that comes from there and is scattered
    /// once.
    pub fn travel_near(
        &self,
        equiangular_light: &EquiangularLight,
        segment: &Segment,
        throughput: SampledSpectrum,
        u: Vec2,
    ) -> Travel {
        analytic::travel_near(self, equiangular_light, segment, throughput, u)
    }

    /// Like [`PreparedMedium::attenuate`], for a segment of this length.
    pub fn attenuate(&self, length: f32, value: SampledSpectrum) -> SampledSpectrum {
        analytic::attenuate(self, Profile::CONSTANT, length, value)
    }
}
