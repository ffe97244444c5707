//! A thin film, about as thick as the wavelength of light: soap bubbles, oil on water, anodised
//! metal.
//!
//! The reflectance is Airy's sum over the reflections between the faces of the film (Belcour and
//! Barla, A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence,
//! SIGGRAPH 2017). In spectral mode it is evaluated at the wavelengths. In RGB mode the cosines of
//! the series are averaged over the sensitivity of the channels, by the Gaussians that the paper's
//! authors fitted. The base is described by its reflectance at normal incidence, as in
//! `KHR_materials_iridescence`.

use super::fresnel;
use snell_math::{ColorMode, Rgb, SampledSpectrum, real};
use std::f32::consts::PI;

/// A thin film on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinFilm {
    /// Fraction of the surface that the film covers, in `[0, 1]`.
    pub weight: f32,
    /// Thickness in nanometres.
    pub thickness: f32,
    /// Index of refraction of the film divided by that of the outside; positive.
    pub ior: f32,
    /// What the lanes of spectra stand for.
    pub mode: ColorMode,
}

/// No film, as is known when the program is compiled.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoFilm;

impl From<NoFilm> for Option<ThinFilm> {
    #[inline(always)]
    fn from(NoFilm: NoFilm) -> Self {
        None
    }
}

/// One polarisation at one angle.
#[derive(Clone, Copy)]
struct Series {
    constant: f32,
    amplitude: f32,
    /// Ratio of the amplitudes of successive passages of light through the film.
    ratio: f32,
    /// Phase shift of one passage by reflections, without the optical path.
    phase: f32,
}

impl ThinFilm {
    /// Reflectance of the film on a surface that reflects `without` at this angle and `f0` at
    /// normal incidence.
    pub(super) fn reflectance(
        &self,
        cos: f32,
        f0: SampledSpectrum,
        without: SampledSpectrum,
    ) -> SampledSpectrum {
        let covered = self.covered(cos.clamp(0.0, 1.0), f0);
        without.lerp(covered, self.weight)
    }

    fn covered(&self, cos: f32, f0: SampledSpectrum) -> SampledSpectrum {
        // The index fades to 1 with the thickness, so that a film of thickness 0 has no effect.
        let ior = 1.0 + (self.ior - 1.0) * smoothstep(self.thickness / 30.0);
        let sin2 = (1.0 - cos * cos) / (ior * ior);
        if sin2 >= 1.0 {
            return SampledSpectrum::ONE;
        }
        let cos_film = (1.0 - sin2).sqrt();
        let way = 2.0 * ior * self.thickness * cos_film;
        let series = |base_f0: f32| polarisations(cos, cos_film, ior, base_f0);
        let rgb_of = |series: [Series; 2]| {
            let mut sum = [series[0].constant + series[1].constant; 3].map(|c| 0.5 * c);
            for m in 1..=2 {
                let waves = ChannelWaves::new(m as f32 * way);
                for s in &series {
                    let amplitude = s.amplitude * real::powi(s.ratio, m);
                    let average = waves.cosines(m as f32 * s.phase);
                    sum.iter_mut().zip(average).for_each(|(sum, a)| *sum += amplitude * a);
                }
            }
            sum
        };
        let at = |nm: f32, base_f0: f32| -> f32 {
            let total: f32 = series(base_f0)
                .iter()
                .map(|s| s.constant + 2.0 * s.amplitude * s.sum(way, nm))
                .sum();
            0.5 * total
        };
        let over = |f0: f32| {
            let channels = match self.mode {
                ColorMode::Rgb => Rgb::from(rgb_of(series(f0))),
                ColorMode::Spectral(_) => Rgb::BLACK,
            };
            self.mode.lanes(channels, |nm| at(nm, f0))
        };
        // A metal may reflect differently in each lane; a dielectric does not.
        let first = over(f0[0]);
        let of_lane = |i: usize| if f0[i] == f0[0] { first[i] } else { over(f0[i])[i] };
        SampledSpectrum(std::array::from_fn(of_lane)).clamp(0.0, 1.0)
    }
}

impl Series {
    /// The sum of `ratio^m cos(m phi)` over all numbers `m` of passages, from 1 on.
    fn sum(&self, way: f32, nm: f32) -> f32 {
        let (sin, cos) = real::sin_cos(2.0 * PI * way / nm + self.phase);
        let (re, im) = (1.0 - self.ratio * cos, -self.ratio * sin);
        // The real part of z / (1 - z), with z = ratio e^(i phi).
        (self.ratio * cos * re + self.ratio * sin * im) / (re * re + im * im).max(1e-9)
    }
}

fn smoothstep(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// The series of both polarisations for a film on a surface with this reflectance, towards the
/// outside, at normal incidence.
fn polarisations(cos: f32, cos_film: f32, ior: f32, base_f0: f32) -> [Series; 2] {
    let root = base_f0.clamp(0.0, 0.9999).sqrt();
    let base_ior = (1.0 + root) / (1.0 - root);
    let below = (base_ior - ior) / (base_ior + ior);
    let r23 = below * below;
    let r23 = r23 + (1.0 - r23) * fresnel::schlick_weight(cos_film);
    let parallel = (ior * cos - cos_film) / (ior * cos + cos_film);
    let perpendicular = (cos - ior * cos_film) / (cos + ior * cos_film);
    // The product of the inner reflections is positive for a film between rarer media and negative
    // on a denser medium. Beyond Brewster's angle, one polarisation changes sign once more.
    let turns = if (base_ior < ior) == (ior > 1.0) { 0.0 } else { PI };
    let brewster = if parallel * (ior - 1.0) < 0.0 { PI } else { 0.0 };
    [(parallel, turns + brewster), (perpendicular, turns)].map(|(r, phase)| {
        let r12 = (r * r).clamp(1e-5, 0.9999);
        let t12 = 1.0 - r12;
        let back = t12 * t12 * r23 / (1.0 - r12 * r23);
        Series { constant: r12 + back, amplitude: back - t12, ratio: (r12 * r23).sqrt(), phase }
    })
}

/// The mean of `cos(2 pi way / lambda + phase)` over the sensitivity of red, green and blue, for
/// one way. It is the Fourier transform of the colour-matching functions, fitted by Gaussians in
/// the wave number (Belcour and Barla, supplemental material), in linear Rec. 709 and scaled to the
/// same white in each channel.
struct ChannelWaves {
    /// Height and angle of the Gaussians, two of X, then those of Y and Z.
    gaussians: [(f32, f32); 4],
}

impl ChannelWaves {
    fn new(way: f32) -> Self {
        // Height, position and variance of the Gaussians, in metres.
        const GAUSSIANS: [(f32, f32, f32); 4] = [
            (5.4856e-13, 1.6810e6, 4.3278e9),
            (9.7470e-14, 2.2399e6, 4.5282e9),
            (4.4201e-13, 1.7953e6, 9.3046e9),
            (5.2481e-13, 2.2084e6, 6.6121e9),
        ];
        const SCALE: f32 = 1.0 / 1.0685e-7;
        let k = 2.0 * PI * way * 1e-9;
        let gaussians = GAUSSIANS.map(|(height, position, variance)| {
            let height =
                height * (2.0 * PI * variance).sqrt() * real::exp(-variance * k * k) * SCALE;
            (height, position * k)
        });
        Self { gaussians }
    }

    fn cosines(&self, phase: f32) -> [f32; 3] {
        let [x1, x2, y, z] =
            self.gaussians.map(|(height, angle)| height * real::cos(angle + phase));
        let x = x1 + x2;
        const RGB: [[f32; 3]; 3] = [
            [3.240_454, -1.537_138_5, -0.498_531_4],
            [-0.969_266, 1.876_010_8, 0.041_556],
            [0.055_643_4, -0.204_025_9, 1.057_225_2],
        ];
        RGB.map(|[a, b, c]| (a * x + b * y + c * z) / (a + b + c))
    }
}
