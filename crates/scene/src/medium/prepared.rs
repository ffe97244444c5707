//! Media ready for travel: with their tables made.

use super::analytic::{self, Profile};
use super::tracking::TrackedGrid;
use super::{
    EquiangularLight, Glow, HeightFog, Homogeneous, Medium, MediumProperties, Segment, Travel,
};
use snell_math::{ColorMode, SampledSpectrum, Vec2};

/// A medium with what travel through it needs to know.
#[derive(Clone, Debug)]
pub enum PreparedMedium {
    /// In closed form, and as it is in [`ColorMode::Rgb`].
    Homogeneous(Homogeneous, MediumProperties),
    /// In closed form.
    HeightFog(HeightFog),
    /// By collisions with a grid.
    Tracked(Box<TrackedGrid>),
}

impl PreparedMedium {
    /// Makes the tables.
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

    /// True if what light rays lose is known without tracking.
    pub fn is_in_closed_form(&self) -> bool {
        !matches!(self, Self::Tracked(_))
    }

    /// What it does everywhere alike; `None` if that depends on where.
    pub fn everywhere(&self, mode: ColorMode) -> Option<MediumProperties> {
        match self {
            Self::Homogeneous(_, rgb) if mode == ColorMode::Rgb => Some(*rgb),
            Self::Homogeneous(medium, _) => Some(medium.at_all(mode)),
            Self::HeightFog(_) | Self::Tracked(_) => None,
        }
    }

    /// The same in [`ColorMode::Rgb`].
    pub fn everywhere_in_rgb(&self) -> Option<&MediumProperties> {
        match self {
            Self::Homogeneous(_, rgb) => Some(rgb),
            Self::HeightFog(_) | Self::Tracked(_) => None,
        }
    }

    /// Sends a path along a segment: it is scattered on the way, or comes to the end. `numbers`
    /// gives pairs of uniform numbers in `[0, 1)`, independent of each other.
    pub fn travel(
        &self,
        segment: &Segment,
        throughput: SampledSpectrum,
        mode: ColorMode,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> Travel {
        self.travel_weighted(segment, throughput, mode, |_| 1.0, numbers)
    }

    /// What glows of it, if that can be sampled as a light.
    pub fn glow(&self) -> Option<Glow> {
        match self {
            Self::Homogeneous(..) | Self::HeightFog(_) => None,
            Self::Tracked(grid) => Glow::new(grid),
        }
    }

    /// As [`Self::travel`], with a factor on the light that is emitted at a distance from the
    /// segment's origin, where there is [`Self::glow`].
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

    /// What is left at the end of a segment of the value of a light ray, on average over `numbers`.
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

/// As a homogeneous medium.
impl MediumProperties {
    /// As [`PreparedMedium::travel`], for `u` in `[0, 1)^2`.
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

    /// As [`PreparedMedium::attenuate`], for a segment of this length.
    pub fn attenuate(&self, length: f32, value: SampledSpectrum) -> SampledSpectrum {
        analytic::attenuate(self, Profile::CONSTANT, length, value)
    }
}
