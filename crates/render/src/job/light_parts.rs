//! Layers that hold parts of the light: where their values are in a sample, and which light belongs
//! to them.

use crate::compile::CompiledScene;
use crate::film::sensor::Sensor;
use crate::integrator::aov::Aov;
use crate::integrator::light_part::{LightPart, LightSource, LightTag};
use crate::settings::{LightGroup, Settings};
use snell_math::{ColorMode, SampledSpectrum};
use snell_scene::MaterialId;

/// The requested parts of the light.
pub struct LightParts {
    /// The requested parts, each with the index of its first value in a sample.
    parts: Vec<(usize, LightPart)>,
    /// The number of values of all layers in a sample.
    channels: usize,
    /// The sensor of the camera, if it changes the light.
    sensor: Option<Sensor>,
    /// The light group of each light.
    of_light: Vec<u8>,
    /// The light group of each material.
    of_material: Vec<u8>,
    /// The light group of the environment.
    of_environment: u8,
    /// The light group of all media.
    of_media: u8,
}

impl LightParts {
    /// The parts that the settings of a render request.
    pub fn new(scene: &CompiledScene, settings: &Settings) -> Self {
        let (mut parts, mut channels) = (Vec::new(), 0);
        let is_known = settings.integrator.is_path();
        for aov in &settings.aovs {
            if let (Aov::Light(part), true) = (aov, is_known) {
                parts.push((channels, *part));
            }
            channels += aov.sampled_channels();
        }
        let groups = &settings.light_groups;
        let of_material: Vec<u8> = (0..scene.materials.len())
            .map(|i| group(groups, LightSource::Material(MaterialId(i as u32))))
            .collect();
        let of_environment = group(groups, LightSource::Environment);
        let of_light = (0..scene.lights().len() as u32)
            .map(|i| group(groups, LightSource::Light(i)))
            .collect();
        let of_media = group(groups, LightSource::Medium);
        let sensor = settings.sensor;
        Self { parts, channels, sensor, of_light, of_material, of_environment, of_media }
    }

    /// True if no parts are requested.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// True if some parts depend on the first scattering of a path.
    pub fn want_lobes(&self) -> bool {
        self.parts.iter().any(|(_, part)| part.lobe.is_some())
    }

    /// The number of the light group of a source.
    pub fn group(&self, source: LightSource) -> u8 {
        match source {
            LightSource::Light(light) => self.of_light[light as usize],
            LightSource::Material(material) => self.of_material[material.index()],
            LightSource::Environment => self.of_environment,
            LightSource::Medium => self.of_media,
        }
    }

    /// Adds light to the values of a sample, in each part that the light belongs to.
    pub fn add(
        &self,
        values: &mut [f32],
        sample: u32,
        light: SampledSpectrum,
        tag: &LightTag,
        mode: ColorMode,
    ) {
        if light.is_black() || !light.is_finite() {
            return;
        }
        let values = &mut values[sample as usize * self.channels..][..self.channels];
        for (offset, part) in &self.parts {
            let rgb = mode.to_rgb(light * part.share(tag));
            let rgb = self.sensor.map_or(rgb, |sensor| sensor.response(rgb)).to_array();
            values[*offset..][..3].iter_mut().zip(rgb).for_each(|(value, c)| *value += c);
        }
    }
}

/// The number of the first group that holds a source; the number after the last if none does.
fn group(groups: &[LightGroup], source: LightSource) -> u8 {
    let number = groups.iter().position(|g| g.sources.contains(&source)).unwrap_or(groups.len());
    number.min(usize::from(u8::MAX)) as u8
}
