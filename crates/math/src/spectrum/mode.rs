//! Conversions between colours and spectra.

use super::response::{rgb_of_samples, white_light};
use super::uplift::RgbSpectrum;
use super::{Color, LANES, Rgb, SampledSpectrum, SampledWavelengths};

/// The colour model of a render.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorModel {
    /// Three values: linear Rec. 709.
    #[default]
    Rgb,
    /// Four wavelengths for each path, chosen anew for each sample.
    Spectral,
}

impl ColorModel {
    /// All models.
    pub const ALL: [Self; 2] = [Self::Rgb, Self::Spectral];

    /// The model's name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Spectral => "spectral",
        }
    }

    /// The mode of a new path. `u` returns a number in `[0, 1)` from which the wavelengths are
    /// sampled; it is called only in spectral mode.
    #[inline]
    pub fn mode(self, u: impl FnOnce() -> f32) -> ColorMode {
        match self {
            Self::Rgb => ColorMode::Rgb,
            Self::Spectral => ColorMode::Spectral(SampledWavelengths::sample(u())),
        }
    }
}

/// The meaning of a path's lanes. It travels with the path; there is no global mode.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ColorMode {
    /// Linear Rec. 709 red, green, blue; the fourth lane is 0.
    #[default]
    Rgb,
    /// One wavelength in each lane.
    Spectral(SampledWavelengths),
}

impl ColorMode {
    /// The lanes of a reflectance, albedo or other factor, or of a coefficient without an upper
    /// bound.
    #[inline]
    pub fn reflectance(self, color: impl Into<Color>) -> SampledSpectrum {
        let Color { rgb: color, spectrum } = color.into();
        if let Some(spectrum) = &spectrum {
            return self.spectral_reflectance(color, spectrum);
        }
        match self {
            Self::Rgb => SampledSpectrum([color.r, color.g, color.b, 0.0]),
            Self::Spectral(wavelengths) => RgbSpectrum::of_factor(color).at(&wavelengths),
        }
    }

    /// The lanes of an emitted or incident radiance. White stands for the light of illuminant D65.
    #[inline]
    pub fn illuminant(self, color: impl Into<Color>) -> SampledSpectrum {
        let Color { rgb: color, spectrum } = color.into();
        if let Some(spectrum) = &spectrum {
            return self.spectral_illuminant(color, spectrum);
        }
        self.rgb_illuminant(color)
    }

    /// [`Self::illuminant`] for a radiance without a spectrum of its own.
    #[inline(always)]
    pub fn rgb_illuminant(self, color: Rgb) -> SampledSpectrum {
        match self {
            Self::Rgb => SampledSpectrum([color.r, color.g, color.b, 0.0]),
            Self::Spectral(wavelengths) => {
                Self::light_at(&wavelengths, &RgbSpectrum::of_light(color))
            }
        }
    }

    /// [`Self::rgb_illuminant`] in spectral mode, from a precomputed [`RgbSpectrum::of_light`].
    /// Computing that spectrum is the expensive part, and many colours never change.
    #[inline(always)]
    pub fn light_at(wavelengths: &SampledWavelengths, spectrum: &RgbSpectrum) -> SampledSpectrum {
        spectrum.at(wavelengths) * SampledSpectrum(wavelengths.lambda().map(white_light))
    }

    /// The lanes of the radiance of a surface of this reflectance in white light of radiance 1.
    #[inline]
    pub fn in_white_light(self, reflectance: SampledSpectrum) -> SampledSpectrum {
        match self {
            Self::Rgb => reflectance,
            Self::Spectral(wavelengths) => {
                reflectance * SampledSpectrum(wavelengths.lambda().map(white_light))
            }
        }
    }

    /// The initial throughput of a path: 1 in every lane that is in use.
    #[inline]
    pub fn unit(self) -> SampledSpectrum {
        match self {
            Self::Rgb => SampledSpectrum([1.0, 1.0, 1.0, 0.0]),
            Self::Spectral(_) => SampledSpectrum::ONE,
        }
    }

    /// The colour that a sensor sees, in linear Rec. 709. In spectral mode it is an estimate from
    /// the path's wavelengths, which may be negative.
    #[inline]
    pub fn to_rgb(self, s: SampledSpectrum) -> Rgb {
        match self {
            Self::Rgb => Rgb::new(s[0], s[1], s[2]),
            Self::Spectral(wavelengths) => rgb_of_samples(s, &wavelengths),
        }
    }

    /// The lanes of a quantity that depends on the wavelength: `at` at each wavelength (nm in
    /// vacuum), or `rgb` in RGB mode.
    #[inline]
    pub fn lanes(self, rgb: Rgb, at: impl Fn(f32) -> f32) -> SampledSpectrum {
        match self {
            Self::Rgb => SampledSpectrum([rgb.r, rgb.g, rgb.b, 0.0]),
            Self::Spectral(wavelengths) => SampledSpectrum(wavelengths.lambda().map(at)),
        }
    }

    /// The wavelength in nm that a path follows where its wavelengths separate: the hero's, or
    /// `otherwise` in RGB mode.
    #[inline]
    pub fn hero(self, otherwise: f32) -> f32 {
        match self {
            Self::Rgb => otherwise,
            Self::Spectral(wavelengths) => wavelengths.lambda()[0],
        }
    }

    /// The factor on a path's throughput where its wavelengths separate and only the hero's is
    /// followed, which then represents all of them. The factor is 1 in RGB mode, where nothing
    /// separates, and in the hero's lane if the other wavelengths were dropped before.
    #[inline]
    pub fn hero_factor(self) -> SampledSpectrum {
        match self {
            Self::Rgb => self.unit(),
            Self::Spectral(wavelengths) => SampledSpectrum([
                if wavelengths.is_hero_only() { 1.0 } else { LANES as f32 },
                0.0,
                0.0,
                0.0,
            ]),
        }
    }

    /// The mode of a path whose throughput was multiplied by [`Self::hero_factor`].
    #[inline]
    pub fn hero_only(self) -> Self {
        match self {
            Self::Rgb => self,
            Self::Spectral(wavelengths) => Self::Spectral(wavelengths.hero_only()),
        }
    }
}
