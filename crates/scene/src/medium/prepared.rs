//! Media with precomputed tables for travel through them.

use super::analytic::{self, Profile};
use super::tracking::TrackedGrid;
use super::{
    EquiangularLight, Glow, HeightFog, Homogeneous, Medium, MediumProperties, Segment, Travel,
};
use snell_math::{ColorMode, SampledSpectrum, Vec2};

/// A medium with precomputed tables.
#[derive(Clone, Debug)]
pub enum PreparedMedium {
    /// A homogeneous medium, with closed forms; the properties are those in [`ColorMode::Rgb`].
    Homogeneous(Homogeneous, MediumProperties),
    /// Fog with closed forms.
    HeightFog(HeightFog),
    /// A grid medium, in which collisions are sampled.
    Tracked(Box<TrackedGrid>),
}

impl PreparedMedium {
    /// Computes the tables of a medium.
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

    /// True if the attenuation of light rays has a closed form.
    pub fn is_in_closed_form(&self) -> bool {
        !matches!(self, Self::Tracked(_))
    }

    /// The properties of the medium if they are the same everywhere; otherwise `None`.
    pub fn everywhere(&self, mode: ColorMode) -> Option<MediumProperties> {
        match self {
            Self::Homogeneous(_, rgb) if mode == ColorMode::Rgb => Some(*rgb),
            Self::Homogeneous(medium, _) => Some(medium.at_all(mode)),
            Self::HeightFog(_) | Self::Tracked(_) => None,
        }
    }

    /// [`Self::everywhere`] for [`ColorMode::Rgb`].
    pub fn everywhere_in_rgb(&self) -> Option<&MediumProperties> {
        match self {
            Self::Homogeneous(_, rgb) => Some(rgb),
            Self::HeightFog(_) | Self::Tracked(_) => None,
        }
    }

    /// Moves a path along a segment, on which it is scattered or reaches the end. `numbers` returns
    /// pairs of independent uniform numbers in `[0, 1)`.
    pub fn travel(
        &self,
        segment: &Segment,
        throughput: SampledSpectrum,
        mode: ColorMode,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> Travel {
        self.travel_weighted(segment, throughput, mode, |_| 1.0, numbers)
    }

    /// The emission of the medium, if it can be sampled as a light.
    pub fn glow(&self) -> Option<Glow> {
        match self {
            Self::Homogeneous(..) | Self::HeightFog(_) => None,
            Self::Tracked(grid) => Glow::new(grid),
        }
    }

    /// Does what [`Self::travel`] does. For media with a [`Self::glow`], emitted light is
    /// multiplied by `weight` at its distance from the segment's origin.
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

    /// The value of a light ray at the end of a segment, on average over `numbers`.
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

/// Travel through a homogeneous medium with these properties.
impl MediumProperties {
    /// [`PreparedMedium::travel`] for a random pair `u` in `[0, 1)^2`.
    pub fn travel(&self, segment: &Segment, throughput: SampledSpectrum, u: Vec2) -> Travel {
        analytic::travel(self, Profile::CONSTANT, segment, throughput, u)
    }

    /// Does what [`Self::travel`] does with more scattering near a light. It is meant for paths
    /// whose first scattering may receive light directly from there.
    pub fn travel_near(
        &self,
        equiangular_light: &EquiangularLight,
        segment: &Segment,
        throughput: SampledSpectrum,
        u: Vec2,
    ) -> Travel {
        analytic::travel_near(self, equiangular_light, segment, throughput, u)
    }

    /// [`PreparedMedium::attenuate`] for a segment of this length.
    pub fn attenuate(&self, length: f32, value: SampledSpectrum) -> SampledSpectrum {
        analytic::attenuate(self, Profile::CONSTANT, length, value)
    }
}
