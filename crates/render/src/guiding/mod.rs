//! Path guiding: densities of incident light are learnt before the render, and `path` samples
//! directions from them.
//!
//! In training passes, each with twice as many paths as the last, every vertex records the light
//! that arrives from the path's direction. A [`Field`] turns these records into densities of
//! directions, region by region, and each pass samples directions from the densities of the
//! previous one. Then the field is frozen, and the picture is rendered with independent samples, so
//! it is unbiased whatever was learnt (Müller, Gross and Novák, Practical Path Guiding for
//! Efficient Light-Transport Simulation, 2017; Müller's notes in the SIGGRAPH course Path Guiding
//! in Production, 2019).
//!
//! Before the first pass, photons initialise the field; half of them are emitted in directions in
//! which earlier photons were focused. Directions are stored as seen from one point of each region,
//! and reprojected for all other points ([`parallax`]). Look-ups are made for many points at once
//! ([`atlas`]).
//!
//! No sum depends on the order of threads: records are kept until a batch of parts is done, and
//! each region reads its records in the order of the parts. The field is therefore a function of
//! scene, camera, size, seed and settings.

pub(crate) mod atlas;
pub(crate) mod density;
pub(crate) mod directional;
mod field;
pub(crate) mod parallax;
mod record;
mod regions;

pub use field::{Cell, Field, Guide, Known, SavedField};
pub use record::{Choice, Record, Recorder};
use snell_math::real;

/// Settings of path guiding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Guiding {
    /// The number of training passes. The first has about [`Self::FIRST_PASS`] paths, and each
    /// further one twice as many as the one before.
    pub passes: u32,
    /// The number of photons that initialise the field before the first pass.
    pub photons: u32,
}

impl Guiding {
    /// The approximate number of paths in the first pass.
    pub const FIRST_PASS: u64 = 1 << 14;
    /// The largest number of passes that is accepted, which is more than is practical.
    pub const MAX_PASSES: u32 = 20;
    /// The default number of photons. It does not depend on the number of passes, so that a render
    /// whose passes were limited by time can be repeated with the same number of passes.
    pub const PHOTONS: u32 = 1 << 19;
    /// The default fraction of all work that is spent on training.
    pub const SHARE: f64 = 0.25;

    /// Settings with this number of passes and [`Self::PHOTONS`] photons.
    pub fn with_passes(passes: u32) -> Self {
        Self { passes, photons: Self::PHOTONS }
    }

    /// Settings with as many passes as fit into the fraction [`Self::SHARE`] of the samples of a
    /// picture of this size, but at least one.
    pub fn for_picture(size: [u32; 2], spp: u32) -> Self {
        let paths =
            size.iter().map(|&x| f64::from(x)).product::<f64>() * f64::from(spp) * Self::SHARE;
        let passes = real::log2(paths / Self::FIRST_PASS as f64 + 1.0).floor();
        Self::with_passes((passes as u32).clamp(1, Self::MAX_PASSES))
    }

    /// The number of records in a pass above which a region is halved. It grows with the square
    /// root of the number of paths, and so do both the number of regions and the number of records
    /// in each.
    pub(crate) fn most_records(pass: u32) -> u32 {
        (RECORDS_OF_REGION * f64::from(1u32 << pass.min(31)).sqrt()) as u32
    }
}

/// The value of [`Guiding::most_records`] in pass 0.
const RECORDS_OF_REGION: f64 = 1000.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_take_their_share() {
        for (size, spp) in [([512, 512], 64), ([960, 720], 256), ([1920, 1080], 1000)] {
            let passes = Guiding::for_picture(size, spp).passes;
            let paths = Guiding::FIRST_PASS * ((1 << passes) - 1);
            let all = f64::from(size[0] * size[1]) * f64::from(spp);
            assert!((0.1..=0.25).contains(&(paths as f64 / all)), "{passes}");
        }
        assert_eq!(Guiding::for_picture([8, 8], 1).passes, 1);
        assert_eq!(Guiding::for_picture([u32::MAX; 2], u32::MAX).passes, Guiding::MAX_PASSES);
    }
}
