//! The state of a path as it is stored between vertices.

use super::PathState;
use super::light_part::LobeShares;
use crate::light_sampler::Receiver;
use snell_math::{ColorMode, SampledSpectrum, Vec3};

/// The state of a path in one cache line: [`PathState`] without the [rest](Rest), which is the same
/// for all paths in most renders.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Carried {
    pub throughput: SampledSpectrum,
    pub eta_scale: f32,
    pub cone_width: f32,
    pub cone_spread: f32,
    pub marks: Marks,
    /// Position and normal of [`PathState::receiver`].
    pub position: Vec3,
    pub bsdf_pdf: f32,
    pub normal: Vec3,
    pub stream: u32,
}

/// [`PathState::expected`], [`Receiver::transmits`] and [`PathState::is_specular`], and the
/// [`Chain`], packed into 32 bits.
#[derive(Clone, Copy, Debug)]
pub struct Marks(u32);

const TRANSMITS: u32 = 1;
const IS_SPECULAR: u32 = 2;
const AFTER_RECEIVER: u32 = 4;
const AFTER_CASTER: u32 = 8;

/// What a path has met since the last surface or medium at which photons are gathered. It is
/// [`Chain::Free`] in renders without photons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Chain {
    /// No such place, or something else than casters of caustics since.
    #[default]
    Free,
    /// Nothing: the path comes from such a place.
    Receiver,
    /// Casters only, and at least one. Photons bring the light of lamps that the path meets now.
    Casters,
}

impl Marks {
    pub const NONE: Self = Self(0);

    #[inline(always)]
    pub fn new(expected: Expected, transmits: bool, is_specular: bool) -> Self {
        let marks =
            if transmits { TRANSMITS } else { 0 } | if is_specular { IS_SPECULAR } else { 0 };
        Self(u32::from(expected.0) << 16 | marks)
    }

    #[inline(always)]
    pub fn expected(self) -> Expected {
        Expected((self.0 >> 16) as u16)
    }

    #[inline(always)]
    pub fn transmits(self) -> bool {
        self.0 & TRANSMITS != 0
    }

    #[inline(always)]
    pub fn is_specular(self) -> bool {
        self.0 & IS_SPECULAR != 0
    }

    /// What the path has met since photons were gathered.
    #[inline]
    pub fn chain(self) -> Chain {
        match self.0 & (AFTER_RECEIVER | AFTER_CASTER) {
            0 => Chain::Free,
            AFTER_RECEIVER => Chain::Receiver,
            _ => Chain::Casters,
        }
    }

    /// The same marks with another [`Self::chain`].
    #[inline]
    pub fn with_chain(self, chain: Chain) -> Self {
        let others = self.0 & !(AFTER_RECEIVER | AFTER_CASTER);
        Self(match chain {
            Chain::Free => others,
            Chain::Receiver => others | AFTER_RECEIVER,
            Chain::Casters => others | AFTER_CASTER,
        })
    }
}

/// A non-negative number with about two significant decimal digits, in 16 bits: the upper half of
/// an `f32`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Expected(u16);

impl Expected {
    /// Stores a non-negative number, rounded down.
    #[inline(always)]
    pub fn of(x: f32) -> Self {
        Self((x.to_bits() >> 16) as u16)
    }

    /// The stored number.
    #[inline(always)]
    pub fn get(self) -> f32 {
        f32::from_bits(u32::from(self.0) << 16)
    }
}

const _: () = assert!(size_of::<Carried>() == 64);

/// The part of [`PathState`] that [`Carried`] does not hold.
#[derive(Clone, Copy, Debug)]
pub struct Rest {
    pub mode: ColorMode,
    pub lobe: LobeShares,
    pub time: f32,
}

impl Rest {
    /// The rest of all paths in [`ColorMode::Rgb`] when no lobes are recorded and nothing moves.
    pub const PLAIN: Self = Self { mode: ColorMode::Rgb, lobe: LobeShares::UNKNOWN, time: 0.0 };
}

impl Carried {
    /// Splits a state into its two parts.
    pub fn of(state: &PathState) -> (Self, Rest) {
        let PathState {
            throughput,
            bsdf_pdf,
            eta_scale,
            cone_width,
            cone_spread,
            stream,
            is_specular,
            expected,
            ..
        } = *state;
        let Receiver { position, normal, transmits } = state.receiver;
        let marks = Marks::new(expected, transmits, is_specular);
        let carried = Self {
            throughput,
            eta_scale,
            cone_width,
            cone_spread,
            marks,
            position,
            bsdf_pdf,
            normal,
            stream,
        };
        (carried, Rest { mode: state.mode, lobe: state.lobe, time: state.time })
    }

    /// The receiver of the state; see [`PathState::receiver`].
    pub fn receiver(&self) -> Receiver {
        Receiver { position: self.position, normal: self.normal, transmits: self.marks.transmits() }
    }

    /// Joins the two parts of a state.
    pub fn with(&self, rest: &Rest) -> PathState {
        let Self {
            throughput, bsdf_pdf, eta_scale, cone_width, cone_spread, stream, marks, ..
        } = *self;
        let (expected, is_specular) = (marks.expected(), marks.is_specular());
        let receiver = self.receiver();
        let Rest { mode, lobe, time } = *rest;
        PathState {
            throughput,
            mode,
            bsdf_pdf,
            receiver,
            eta_scale,
            is_specular,
            expected,
            cone_width,
            cone_spread,
            stream,
            lobe,
            time,
        }
    }
}
