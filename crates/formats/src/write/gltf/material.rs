//! Materials: converts OpenPBR parameters to glTF's, the inverse of the reader.

use super::Document;
use super::stage::color_and_strength;
use super::texture::{Channels, colors, single};
use crate::write::material::{open_pbr, shown_name, without_spectrum};
use serde_json::{Value, json};
use snell_math::Rgb;
use snell_scene::Material;
use snell_scene::material::{
    AlphaMode, Bitangent, ColorParam, FuzzModel, MaterialKind, NormalMap, OpenPbr, ScalarParam,
};

/// The JSON of a material.
pub fn value(document: &mut Document, index: usize, material: &Material) -> Value {
    let who = shown_name(index, material);
    let mut surface = open_pbr(material, &who, document.output);
    let mut writer = Writer { document, who: &who, extensions: json!({}) };
    let emission = without_spectrum(material.emission, true);
    let is_unlit = matches!(material.kind, MaterialKind::Black(_))
        && material.is_emissive()
        && !material.illuminates;
    if is_unlit {
        surface = OpenPbr { base_color: emission, ..OpenPbr::default() };
        writer.extension("KHR_materials_unlit", json!({}));
    }
    let mut value = json!({ "pbrMetallicRoughness": writer.core(material, &surface) });
    if !is_unlit {
        writer.layers(&surface);
        writer.emission(&mut value, emission);
        if let Some(map) = &material.normal_map {
            value["normalTexture"] = writer.normal_map(map);
        }
        if material.bump_map.is_some() {
            writer.lose("its bump map is left out: the format has normal maps only");
        }
    }
    match material.alpha_mode {
        AlphaMode::Opaque => {}
        // A sheet lets light through by transmission.
        AlphaMode::Sheet(_) => {}
        AlphaMode::Blend => value["alphaMode"] = "BLEND".into(),
        AlphaMode::Mask(cutoff) => {
            value["alphaMode"] = "MASK".into();
            value["alphaCutoff"] = cutoff.into();
        }
    }
    if material.double_sided {
        value["doubleSided"] = true.into();
    }
    if material.is_emissive() && material.emits_on_both_sides != material.double_sided {
        writer.lose("it emits on all visible sides");
    }
    if material.is_emissive() && !material.illuminates && !is_unlit {
        writer.lose("its emission lights other things too");
    }
    if !material.visible {
        writer.lose("it is visible");
    }
    if material.interior.is_some_and(|i| i.medium.is_some() || i.priority != 0) {
        writer.lose("the medium inside, and its priority, are left out");
    }
    if !material.name.is_empty() {
        value["name"] = material.name.clone().into();
    }
    if writer.extensions.as_object().is_some_and(|e| !e.is_empty()) {
        value["extensions"] = writer.extensions;
    }
    value
}

struct Writer<'d, 'a, 'o> {
    document: &'d mut Document<'a, 'o>,
    who: &'d str,
    extensions: Value,
}

fn is_white(color: &ColorParam) -> bool {
    *color == ColorParam::constant(Rgb::WHITE)
}

impl Writer<'_, '_, '_> {
    fn lose(&mut self, what: &str) {
        let who = self.who;
        self.document.output.lose(format!("{who}: {what}"));
    }

    fn extension(&mut self, name: &'static str, value: Value) {
        self.document.extensions.insert(name);
        self.extensions[name] = value;
    }

    fn info(&mut self, channels: Channels, is_color: bool) -> Value {
        self.document.texture_info(channels, is_color, self.who)
    }

    /// Adds a factor and, if there is one, a texture with its value in `channel`.
    fn scalar(&mut self, value: &mut Value, key: &str, scalar: &ScalarParam, channel: usize) {
        value[format!("{key}Factor")] = scalar.factor.clamp(0.0, 1.0).into();
        if let Some(texture) = scalar.texture {
            value[format!("{key}Texture")] = self.info(single(texture, channel), false);
        }
    }

    fn color(&mut self, value: &mut Value, key: &str, color: &ColorParam) {
        let color = without_spectrum(*color, false);
        let Rgb { r, g, b } = color.factor;
        value[format!("{key}Factor")] = json!([r, g, b]);
        if let Some(id) = color.texture {
            value[format!("{key}Texture")] = self.info(colors(id), true);
        }
    }

    fn normal_map(&mut self, map: &NormalMap) -> Value {
        if map.bitangent != Bitangent::Upwards {
            self.lose(
                "the green of its normal map points up in the picture: where texture coordinates \
                    are mirrored, that is the other way",
            );
        }
        let mut info = self.info(colors(map.texture), false);
        info["scale"] = map.scale.into();
        info
    }

    /// The core of a material: base colour with opacity, metalness and roughness.
    fn core(&mut self, material: &Material, surface: &OpenPbr) -> Value {
        let mut base = without_spectrum(surface.base_color, false);
        if surface.base_weight.texture.is_some() {
            self.lose("the texture of base_weight is left out");
        }
        base.factor = base.factor * surface.base_weight.factor;
        // In glTF the base colour tints transmitted light.
        if surface.transmission_weight.factor > 0.0 {
            let mut tint = without_spectrum(surface.transmission_tint, false);
            if surface.transmission_depth.factor <= 0.0
                && surface.transmission_color.texture.is_none()
            {
                tint.factor = tint.factor * surface.transmission_color.factor;
            }
            if surface.transmission_weight.factor < 1.0 && tint != base {
                self.lose(
                    "reflected and transmitted light have one colour, that of the transmitted",
                );
            }
            base = tint;
        }
        let is_opaque = material.alpha_mode == AlphaMode::Opaque;
        let alpha = if is_opaque { ScalarParam::constant(1.0) } else { material.alpha };
        let Rgb { r, g, b } = base.factor.map(|c| c.clamp(0.0, 1.0));
        let mut value = json!({ "baseColorFactor": [r, g, b, alpha.factor.clamp(0.0, 1.0)] });
        let mut channels = base.texture.map_or([None; 4], colors);
        channels[3] = alpha.texture;
        if is_opaque && let Some(id) = base.texture {
            // Alpha does not count, so the picture may be stored unchanged.
            channels[3] = Some((id, 3));
        }
        if channels != [None; 4] {
            value["baseColorTexture"] = self.info(channels, true);
        }
        let anisotropy = surface.specular_roughness_anisotropy.factor.clamp(0.0, 0.999);
        let (roughness, strength) = stretched(surface.specular_roughness.factor, anisotropy);
        value["metallicFactor"] = surface.base_metalness.factor.clamp(0.0, 1.0).into();
        value["roughnessFactor"] = roughness.into();
        let maps = [None, surface.specular_roughness.texture, surface.base_metalness.texture, None];
        if maps != [None; 4] {
            value["metallicRoughnessTexture"] = self.info(maps, false);
        }
        if anisotropy > 0.0 {
            if surface.specular_roughness_anisotropy.texture.is_some() {
                self.lose("the texture of the anisotropy is left out");
            }
            let rotation = surface.geometry_tangent.map_or(0.0, |t| t.rotation);
            self.extension(
                "KHR_materials_anisotropy",
                json!({ "anisotropyStrength": strength, "anisotropyRotation": rotation }),
            );
        }
        value
    }

    fn emission(&mut self, value: &mut Value, emission: ColorParam) {
        if emission.factor.is_black() {
            return;
        }
        let (mut color, strength) = color_and_strength(emission.factor);
        if strength > 1.0 {
            self.extension(
                "KHR_materials_emissive_strength",
                json!({ "emissiveStrength": strength }),
            );
        } else {
            color = color.map(|c| c * strength);
        }
        value["emissiveFactor"] = color.to_vec().into();
        if let Some(id) = emission.texture {
            value["emissiveTexture"] = self.info(colors(id), true);
        }
    }

    /// Adds everything above the core, each in its extension.
    fn layers(&mut self, surface: &OpenPbr) {
        if surface.specular_ior.factor != 1.5 {
            self.extension("KHR_materials_ior", json!({ "ior": surface.specular_ior.factor }));
        }
        if surface.specular_weight != ScalarParam::constant(1.0)
            || !is_white(&surface.specular_color)
        {
            let mut specular = json!({});
            self.scalar(&mut specular, "specular", &surface.specular_weight, 3);
            self.color(&mut specular, "specularColor", &surface.specular_color);
            self.extension("KHR_materials_specular", specular);
            if surface.specular_weight.factor > 1.0 {
                self.lose("specular_weight is at most 1");
            }
            if surface.base_metalness.factor > 0.0 && !is_white(&surface.specular_color) {
                self.lose("the colour of a metal at its edge is left out");
            }
        }
        self.coat(surface);
        if surface.fuzz_weight.factor > 0.0 {
            let mut sheen = json!({});
            let color = ColorParam {
                factor: surface.fuzz_color.factor * surface.fuzz_weight.factor,
                ..surface.fuzz_color
            };
            self.color(&mut sheen, "sheenColor", &color);
            self.scalar(&mut sheen, "sheenRoughness", &surface.fuzz_roughness, 3);
            self.extension("KHR_materials_sheen", sheen);
            if surface.fuzz_model != FuzzModel::Charlie {
                self.lose("the fuzz reflects by another law in glTF");
            }
        }
        if surface.thin_film_weight.factor > 0.0 {
            let mut film = json!({ "iridescenceIor": surface.thin_film_ior.factor });
            self.scalar(&mut film, "iridescence", &surface.thin_film_weight, 0);
            // The thickness is converted from micrometres to nanometres; the texture's minimum is
            // 0.
            film["iridescenceThicknessMinimum"] = 0.0.into();
            film["iridescenceThicknessMaximum"] = (surface.thin_film_thickness.factor * 1e3).into();
            if let Some(texture) = surface.thin_film_thickness.texture {
                film["iridescenceThicknessTexture"] = self.info(single(texture, 1), false);
            }
            self.extension("KHR_materials_iridescence", film);
        }
        self.interior(surface);
        if surface.base_diffuse_roughness.factor != 0.0 {
            self.lose("the roughness of the diffuse base is left out");
        }
    }

    fn coat(&mut self, surface: &OpenPbr) {
        if surface.coat_weight.factor <= 0.0 {
            return;
        }
        let mut coat = json!({});
        self.scalar(&mut coat, "clearcoat", &surface.coat_weight, 0);
        self.scalar(&mut coat, "clearcoatRoughness", &surface.coat_roughness, 1);
        if let Some(map) = &surface.geometry_coat_normal {
            coat["clearcoatNormalTexture"] = self.normal_map(map);
        }
        self.extension("KHR_materials_clearcoat", coat);
        if surface.coat_ior.factor != 1.5
            || surface.coat_darkening.factor != 0.0
            || !is_white(&surface.coat_color)
        {
            self.lose("the coat is colourless, of index 1.5, and does not darken its base");
        }
    }

    /// Adds transmission and diffuse transmission.
    fn interior(&mut self, surface: &OpenPbr) {
        if surface.subsurface_weight.factor > 0.0 {
            if surface.geometry_thin_walled {
                let mut through = json!({});
                self.scalar(&mut through, "diffuseTransmission", &surface.subsurface_weight, 3);
                self.color(&mut through, "diffuseTransmissionColor", &surface.subsurface_color);
                self.extension("KHR_materials_diffuse_transmission", through);
            } else {
                self.lose("scattering under the surface is left out");
            }
        }
        if surface.transmission_weight.factor <= 0.0 {
            return;
        }
        let mut transmission = json!({});
        self.scalar(&mut transmission, "transmission", &surface.transmission_weight, 0);
        self.extension("KHR_materials_transmission", transmission);
        if !surface.geometry_thin_walled {
            // The thickness is only for rasterisers: a ray tracer computes the path length.
            let mut volume = json!({ "thicknessFactor": 1.0 });
            if surface.transmission_depth.factor > 0.0 {
                let Rgb { r, g, b } = surface.transmission_color.factor.map(|c| c.clamp(0.0, 1.0));
                volume["attenuationColor"] = json!([r, g, b]);
                volume["attenuationDistance"] = surface.transmission_depth.factor.into();
            }
            self.extension("KHR_materials_volume", volume);
            if !surface.transmission_scatter.factor.is_black() {
                self.lose("scattering in the clear part is left out");
            }
        }
        if surface.transmission_dispersion_scale.factor > 0.0 {
            let abbe = surface.transmission_dispersion_abbe_number.factor.max(1e-3);
            let dispersion = 20.0 / abbe * surface.transmission_dispersion_scale.factor;
            self.extension("KHR_materials_dispersion", json!({ "dispersion": dispersion }));
        }
    }
}

/// Converts roughness and anisotropy of OpenPBR, which keeps the mean square of the two widths, to
/// those of glTF, which stretches one of them.
fn stretched(roughness: f32, anisotropy: f32) -> (f32, f32) {
    if anisotropy <= 0.0 {
        return (roughness.clamp(0.0, 1.0), 0.0);
    }
    let narrow = 1.0 - anisotropy;
    let wide = (roughness * roughness * (2.0 / (narrow * narrow + 1.0)).sqrt()).min(1.0);
    let alpha = wide * narrow;
    let strength = ((wide - alpha) / (1.0 - alpha).max(1e-6)).max(0.0).sqrt().min(1.0);
    (alpha.sqrt(), strength)
}
