//! Materials, with the emission, opacity and media that pbrt attaches to shapes instead, and media
//! themselves.

use super::{File, quoted, rgb};
use crate::write::material::{lose_shape, open_pbr, shown_name, without_spectrum};
use crate::write::picture::Baked;
use snell_math::spectrum::Metal;
use snell_math::{ColorMode, Rgb, real};
use snell_scene::bsdf::fresnel;
use snell_scene::material::{
    AlphaMode, ColorParam, Conductor, ConductorSpectrum, Hair, HeightUnit, MaterialKind,
    MetallicRoughness, OpenPbr, ScalarParam,
};
use snell_scene::{Encoding, Material, MaterialId};

/// The text that a shape of a material needs.
#[derive(Clone, Debug, Default)]
pub struct Made {
    /// Directives to be written before the shape.
    pub attributes: Vec<String>,
    /// The names of the media inside and outside, to be written before the shape; empty ones for
    /// none.
    pub interface: Option<[String; 2]>,
    /// Parameters to be written after those of the shape itself.
    pub shape_parameters: String,
}

/// Metals whose tables pbrt has.
const METALS: [&str; 4] = ["Ag", "Al", "Au", "Cu"];

/// A material's class and parameters.
struct Body {
    text: String,
    /// Absorption of a clear interior per unit of length.
    absorption: Rgb,
}

impl Body {
    fn new(text: String) -> Self {
        Self { text, absorption: Rgb::BLACK }
    }
}

impl Made {
    /// The directives before a shape, each in a line.
    pub fn directives(&self) -> String {
        let interface = self.interface.as_ref();
        let interface = interface.map(|[a, b]| format!("MediumInterface \"{a}\" \"{b}\""));
        self.attributes.iter().chain(&interface).map(|line| format!("  {line}\n")).collect()
    }
}

impl File<'_, '_> {
    /// The text for shapes of a material; the material is defined on first use.
    pub fn material(&mut self, id: Option<MaterialId>) -> Made {
        if let Some(made) = self.materials.get(&id) {
            return made.clone();
        }
        let default = snell_scene::framing::default_material();
        let scene = self.scene;
        let material = id.and_then(|id| scene.materials.get(id.index())).unwrap_or(&default);
        let number = id.map_or(scene.materials.len(), MaterialId::index);
        let made = self.make_material(number, material);
        self.materials.insert(id, made.clone());
        made
    }

    fn make_material(&mut self, number: usize, material: &Material) -> Made {
        let who = shown_name(number, material);
        let name = quoted(&format!(
            "{}{}{number}",
            material.name,
            if material.name.is_empty() { "" } else { " " }
        ));
        let mut made = Made::default();
        let body = match material.alpha_mode {
            AlphaMode::Sheet(ior) => {
                let kind = "\"string type\" [ \"thindielectric\" ]";
                Body::new(format!("{kind} \"float eta\" [ {ior} ]"))
            }
            _ => self.body(material, &who),
        };
        let normal_map = self.normal_map(material, &who);
        let bump_map = self.bump_map(material, &who);
        self.line(format!("MakeNamedMaterial {name} {}{normal_map}{bump_map}", body.text));
        made.attributes.push(format!("NamedMaterial {name}"));
        self.add_media(&mut made, number, material, &body, &who);
        self.add_emission(&mut made, material, &who);
        self.add_alpha(&mut made, material, &who);
        if !material.double_sided {
            self.output.lose(format!("{who}: it is visible from both sides"));
        }
        made
    }

    fn bump_map(&mut self, material: &Material, who: &str) -> String {
        let Some(map) = material.bump_map else { return String::new() };
        if map.unit != HeightUnit::Scene {
            self.output
                .lose(format!("{who}: heights relative to the picture of its bumps are left out"));
            return String::new();
        }
        // For colour pictures the middle channel is nearest to the luminance.
        let channel = map.channel.unwrap_or(1);
        // The height is not multiplied into the picture, which may have few levels.
        let heights =
            self.texture(map.texture, "float", Baked::Scaled { channel, factor: 1.0 }, who);
        let scale = format!(
            "\"float\" \"scale\" \"texture tex\" [ \"{heights}\" ] \"float scale\" [ {} ]",
            map.height
        );
        format!(" \"texture displacement\" [ \"{}\" ]", self.define(scale, None))
    }

    fn normal_map(&mut self, material: &Material, who: &str) -> String {
        let Some(map) = material.normal_map else { return String::new() };
        let texture = self.pictures.texture(map.texture);
        if map.scale != 1.0
            || texture.uv_transform != [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
            || texture.uv_set != 0
        {
            self.output
                .lose(format!("{who}: the scale and the placement of the normal map are left out"));
        }
        let file = self.pictures.color(self.output, map.texture, Encoding::Linear);
        format!(" \"string normalmap\" [ {} ]", quoted(&file))
    }

    fn add_media(
        &mut self,
        made: &mut Made,
        number: usize,
        material: &Material,
        body: &Body,
        who: &str,
    ) {
        let outside = self.scene.medium.map_or(String::new(), |id| format!("medium-{}", id.0));
        let inside = match material.interior {
            Some(interior) => {
                if interior.priority != 0 {
                    self.output.lose(format!("{who}: the priority of its inside is left out"));
                }
                interior.medium.map(|id| format!("medium-{}", id.0))
            }
            None => None,
        };
        let inside = match inside {
            None if !body.absorption.is_black() => {
                let name = format!("inside-{number}");
                self.line(format!(
                    "MakeNamedMedium \"{name}\" \"string type\" [ \"homogeneous\" ] \"rgb \
                        sigma_a\" {} \"rgb sigma_s\" [ 0 0 0 ]",
                    rgb(body.absorption)
                ));
                Some(name)
            }
            inside => inside,
        };
        if inside.is_some() || (!outside.is_empty() && material.bounded_interior().is_some()) {
            let inside = inside.unwrap_or_default();
            made.interface = Some([inside, outside]);
        }
    }

    fn add_emission(&mut self, made: &mut Made, material: &Material, who: &str) {
        if !material.is_emissive() {
            return;
        }
        let emission = without_spectrum(material.emission, true);
        let light = match emission.texture {
            None => format!("\"rgb L\" {}", rgb(emission.factor)),
            Some(id) => {
                let baked = Baked::Light(emission.factor);
                let file = self.pictures.baked(self.output, id, baked);
                format!("\"string filename\" [ {} ]", quoted(&file))
            }
        };
        let both = if material.emits_on_both_sides { " \"bool twosided\" [ true ]" } else { "" };
        made.attributes.push(format!("AreaLightSource \"diffuse\" {light}{both}"));
        if !material.illuminates || material.emission_takes_vertex_color {
            self.output
                .lose(format!("{who}: its emission lights other things, and has one colour"));
        }
    }

    fn add_alpha(&mut self, made: &mut Made, material: &Material, who: &str) {
        if !material.visible_to_camera {
            self.output.lose(format!("{who}: the camera sees it"));
        }
        if !material.visible {
            // Of a lamp with this alpha, pbrt keeps the light.
            made.shape_parameters += " \"float alpha\" [ 0 ]";
            return;
        }
        let cutoff = match material.alpha_mode {
            AlphaMode::Opaque | AlphaMode::Sheet(_) => return,
            AlphaMode::Blend => None,
            AlphaMode::Mask(cutoff) => Some(cutoff),
        };
        made.shape_parameters += &match material.alpha.texture {
            None => {
                let alpha = material.alpha.factor;
                format!(
                    " \"float alpha\" [ {} ]",
                    cutoff.map_or(alpha, |c| f32::from(u8::from(alpha >= c)))
                )
            }
            Some((id, channel)) => {
                let baked = match cutoff {
                    Some(cutoff) => Baked::Mask { channel, least: cutoff / material.alpha.factor },
                    None => Baked::Scaled { channel, factor: material.alpha.factor },
                };
                let name = self.texture(id, "float", baked, who);
                format!(" \"texture alpha\" [ \"{name}\" ]")
            }
        };
    }

    /// Notes features that pbrt's metals and layers lack.
    fn lose_details(&mut self, material: &Material, who: &str) {
        lose_shape(&material.kind, who, self.output);
        if let MaterialKind::Plastic(plastic) = &material.kind
            && plastic.specular != Rgb::WHITE.into()
        {
            self.output.lose(format!("{who}: the tint of the reflection is left out"));
        }
    }

    /// The metal and the roughness of a conductor, whose parameters begin with `prefix`. pbrt has
    /// no tint of the reflection: with one the metal has a colour instead of its table.
    fn conductor(&mut self, prefix: &str, conductor: &Conductor, who: &str) -> String {
        let tint = conductor.tint;
        let metal = if tint == Rgb::WHITE.into() {
            self.metal(prefix, &conductor.spectrum, who)
        } else {
            self.output.lose(format!(
                "{who}: the tint of the reflection became a part of the metal's colour"
            ));
            let own = straight_reflectance(&conductor.spectrum);
            // A second texture has no place.
            let (texture, is_lost) = match &conductor.spectrum {
                ConductorSpectrum::Color(ColorParam { texture: Some(own), .. }) => {
                    (Some(*own), tint.texture.is_some())
                }
                _ => (tint.texture, false),
            };
            if is_lost {
                self.output.lose(format!("{who}: the texture of the tint is left out"));
            }
            let color = ColorParam { factor: own * tint.factor, texture, ..tint };
            self.color("reflectance", color, who)
        };
        metal + &self.widths(prefix, conductor.roughness, conductor.anisotropy, who)
    }

    /// Roughness that may differ by direction, as the widths of the distribution.
    fn widths(
        &mut self,
        prefix: &str,
        roughness: ScalarParam,
        anisotropy: ScalarParam,
        who: &str,
    ) -> String {
        let is_even = anisotropy.factor == 0.0 && anisotropy.texture.is_none();
        if is_even || roughness.texture.is_some() || anisotropy.texture.is_some() {
            if !is_even {
                self.output.lose(format!(
                    "{who}: roughness that differs by direction, with a texture, became isotropic"
                ));
            }
            return self.roughness(prefix, roughness, who);
        }
        let ratio = 1.0 - anisotropy.factor.abs().min(1.0);
        let most = roughness.factor * roughness.factor * (2.0 / (1.0 + ratio * ratio)).sqrt();
        let [u, v] =
            if anisotropy.factor < 0.0 { [most * ratio, most] } else { [most, most * ratio] };
        format!(
            " \"float {prefix}uroughness\" [ {u} ] \"float {prefix}vroughness\" [ {v} ] \"bool \
                remaproughness\" [ false ]"
        )
    }

    fn body(&mut self, material: &Material, who: &str) -> Body {
        let kind = |name: &str| format!("\"string type\" [ \"{name}\" ]");
        self.lose_details(material, who);
        match &material.kind {
            MaterialKind::Black(_) => {
                Body::new(format!("{} \"rgb reflectance\" [ 0 0 0 ]", kind("diffuse")))
            }
            MaterialKind::Diffuse(diffuse) => {
                Body::new(kind("diffuse") + &self.color("reflectance", diffuse.reflectance, who))
            }
            MaterialKind::CoatedDiffuse(coated) => Body::new(
                kind("coateddiffuse")
                    + &self.color("reflectance", coated.reflectance, who)
                    + &self.roughness("", coated.roughness, who)
                    + &format!(" \"float eta\" [ {} ]", coated.ior),
            ),
            MaterialKind::Plastic(plastic) => {
                self.coated(plastic.diffuse, plastic.ior, plastic.roughness, who)
            }
            MaterialKind::Conductor(conductor) => {
                Body::new(kind("conductor") + &self.conductor("", conductor, who))
            }
            MaterialKind::CoatedConductor(coated) => Body::new(
                kind("coatedconductor")
                    + &self.conductor("conductor.", &coated.conductor, who)
                    + &self.roughness("interface.", coated.roughness, who)
                    + &format!(" \"float interface.eta\" [ {} ]", coated.ior),
            ),
            MaterialKind::Mirror(mirror) => {
                self.output.lose(format!("{who}: an ideal mirror became a smooth metal"));
                Body::new(
                    kind("conductor")
                        + &self.color("reflectance", mirror.reflectance, who)
                        + " \"float roughness\" [ 0 ]",
                )
            }
            MaterialKind::Dielectric(glass) => {
                if glass.tint != Rgb::WHITE.into() {
                    self.output.lose(format!("{who}: the tint of the glass is left out"));
                }
                if glass.ior.is_dispersive() {
                    self.output.lose(format!("{who}: dispersion is left out"));
                }
                let eta = format!(" \"float eta\" [ {} ]", glass.ior.at_line_d());
                let text = kind("dielectric") + &self.roughness("", glass.roughness, who) + &eta;
                Body { text, absorption: glass.absorption }
            }
            MaterialKind::Interface(_) => Body::new(kind("interface")),
            MaterialKind::Hair(hair) => Body::new(kind("hair") + &self.hair(hair, who)),
            MaterialKind::MetallicRoughness(kind_of) if is_thin_glass(kind_of) => {
                Body::new(format!("{} \"float eta\" [ {} ]", kind("thindielectric"), kind_of.ior))
            }
            _ => {
                let surface = open_pbr(material, who, self.output);
                self.nearest(&surface, who)
            }
        }
    }

    /// The parameters of hair. pbrt accepts pigments, a colour or an absorption, but only one of
    /// them.
    fn hair(&mut self, hair: &Hair, who: &str) -> String {
        let plain = Hair::default();
        let is_dyed = hair.color != plain.color;
        let is_pigmented =
            hair.eumelanin != plain.eumelanin || hair.pheomelanin != plain.pheomelanin;
        let mut text = match (is_dyed, is_pigmented, hair.sigma_a != plain.sigma_a) {
            (true, false, false) => self.color("reflectance", hair.color, who),
            (false, true, false) => {
                self.scalar("eumelanin", hair.eumelanin, who)
                    + &self.scalar("pheomelanin", hair.pheomelanin, who)
            }
            (false, false, _) => self.color("sigma_a", hair.sigma_a, who),
            _ => {
                self.output.lose(format!(
                    "{who}: pigments, dye and absorption became one absorption, without textures"
                ));
                format!(" \"rgb sigma_a\" {}", rgb(hair.plain_absorption()))
            }
        };
        text += &self.scalar("beta_m", hair.longitudinal_roughness, who);
        text += &self.scalar("beta_n", hair.azimuthal_roughness, who);
        text += &format!(" \"float eta\" [ {} ] \"float alpha\" [ {} ]", hair.ior, hair.scale_tilt);
        text
    }

    /// Writes a scalar parameter.
    fn scalar(&mut self, name: &str, scalar: ScalarParam, who: &str) -> String {
        match scalar.texture {
            None => format!(" \"float {name}\" [ {} ]", scalar.factor),
            Some((id, channel)) => {
                let texture = self.texture(
                    id,
                    "float",
                    Baked::Scaled { channel, factor: scalar.factor },
                    who,
                );
                format!(" \"texture {name}\" [ \"{texture}\" ]")
            }
        }
    }

    /// The pbrt material nearest to an OpenPBR surface.
    fn nearest(&mut self, surface: &OpenPbr, who: &str) -> Body {
        let kind = |name: &str| format!("\"string type\" [ \"{name}\" ]");
        let mut base = without_spectrum(surface.base_color, false);
        base.factor = base.factor * surface.base_weight.factor;
        let has_maps = surface.base_metalness.texture.is_some()
            || surface.transmission_weight.texture.is_some();
        let is_pure = |x: f32| x <= 0.0 || x >= 1.0;
        if has_maps
            || !is_pure(surface.base_metalness.factor)
            || !is_pure(surface.transmission_weight.factor)
        {
            self.output.lose(format!("{who}: a mixture became its largest component"));
        }
        if [&surface.fuzz_weight, &surface.thin_film_weight, &surface.specular_roughness_anisotropy]
            .iter()
            .any(|p| p.factor > 0.0)
        {
            self.output.lose(format!("{who}: fuzz, thin films and anisotropy are left out"));
        }
        let (metal, clear) =
            (surface.base_metalness.factor >= 0.5, surface.transmission_weight.factor >= 0.5);
        let has_coat = surface.coat_weight.factor >= 0.5;
        if has_coat && !metal {
            self.output.lose(format!("{who}: the coat is left out"));
        }
        if metal && has_coat {
            return Body::new(
                kind("coatedconductor")
                    + &self.color("reflectance", base, who)
                    + &self.roughness("conductor.", surface.specular_roughness, who)
                    + &self.roughness("interface.", surface.coat_roughness, who)
                    + &format!(" \"float interface.eta\" [ {} ]", surface.coat_ior.factor),
            );
        }
        if metal {
            let roughness = self.roughness("", surface.specular_roughness, who);
            return Body::new(
                kind("conductor") + &self.color("reflectance", base, who) + &roughness,
            );
        }
        if clear {
            return self.clear(surface, who);
        }
        if surface.specular_weight.factor <= 0.0 {
            return Body::new(kind("diffuse") + &self.color("reflectance", base, who));
        }
        if surface.subsurface_weight.factor > 0.0 {
            self.output.lose(format!("{who}: scattering under the surface is left out"));
        }
        self.coated(base, surface.specular_ior.factor, surface.specular_roughness, who)
    }

    fn clear(&mut self, surface: &OpenPbr, who: &str) -> Body {
        let eta = format!(" \"float eta\" [ {} ]", surface.specular_ior.factor);
        let depth = surface.transmission_depth.factor;
        let (color, tint) = (surface.transmission_color.factor, surface.transmission_tint.factor);
        if tint != Rgb::WHITE
            || (depth <= 0.0 && color != Rgb::WHITE)
            || surface.transmission_tint.texture.is_some()
        {
            self.output.lose(format!("{who}: the tint of transmitted light is left out"));
        }
        if surface.geometry_thin_walled {
            return Body::new(format!("\"string type\" [ \"thindielectric\" ]{eta}"));
        }
        let absorption = match depth > 0.0 {
            true => color.map(|c| -real::ln(c.clamp(1e-6, 1.0)) / depth),
            false => Rgb::BLACK,
        };
        if !surface.transmission_scatter.factor.is_black() {
            self.output.lose(format!("{who}: scattering inside is left out"));
        }
        let roughness = self.roughness("", surface.specular_roughness, who);
        Body { text: format!("\"string type\" [ \"dielectric\" ]{roughness}{eta}"), absorption }
    }

    /// The pbrt material `coateddiffuse`. `seen` is the colour seen through the clear layer; pbrt
    /// needs the reflectance of the diffuse base below it.
    fn coated(&mut self, seen: ColorParam, ior: f32, roughness: ScalarParam, who: &str) -> Body {
        let body = Baked::UnderCoat { factor: without_spectrum(seen, false).factor, ior };
        let color = match seen.texture {
            None => {
                let Rgb { r, g, b } = without_spectrum(seen, false).factor;
                format!(
                    " \"rgb reflectance\" {}",
                    rgb(Rgb::new(r, g, b).map(|c| Baked::under_coat(c, ior)))
                )
            }
            Some(id) => {
                let name = self.texture(id, "spectrum", body, who);
                format!(" \"texture reflectance\" [ \"{name}\" ]")
            }
        };
        let roughness = self.roughness("", roughness, who);
        Body::new(format!(
            "\"string type\" [ \"coateddiffuse\" ]{color}{roughness} \"float eta\" [ {ior} ]"
        ))
    }

    fn metal(&mut self, prefix: &str, spectrum: &ConductorSpectrum, who: &str) -> String {
        match spectrum {
            ConductorSpectrum::Color(color) => self.color("reflectance", *color, who),
            ConductorSpectrum::Measured { eta, k } => {
                format!(" \"rgb {prefix}eta\" {} \"rgb {prefix}k\" {}", rgb(*eta), rgb(*k))
            }
            ConductorSpectrum::Metal(metal) => self.named_metal(prefix, *metal, who),
        }
    }

    fn named_metal(&mut self, prefix: &str, metal: Metal, who: &str) -> String {
        let symbol = metal.symbol();
        if METALS.contains(&symbol) {
            let table =
                |part: &str| format!(" \"spectrum {prefix}{part}\" [ \"metal-{symbol}-{part}\" ]");
            return table("eta") + &table("k");
        }
        self.output.lose(format!("{who}: the table of the metal became three numbers"));
        let at = metal.indices(ColorMode::Rgb).map(|lanes| Rgb::new(lanes[0], lanes[1], lanes[2]));
        format!(" \"rgb {prefix}eta\" {} \"rgb {prefix}k\" {}", rgb(at[0]), rgb(at[1]))
    }

    /// Writes a colour parameter.
    fn color(&mut self, name: &str, color: ColorParam, who: &str) -> String {
        let color = without_spectrum(color, false);
        match color.texture {
            None => format!(" \"rgb {name}\" {}", rgb(color.factor)),
            Some(id) => {
                let texture = self.texture(id, "spectrum", Baked::Tinted(color.factor), who);
                format!(" \"texture {name}\" [ \"{texture}\" ]")
            }
        }
    }

    /// Roughness as the width of the distribution.
    fn roughness(&mut self, prefix: &str, roughness: ScalarParam, who: &str) -> String {
        let width = match roughness.texture {
            None => {
                format!("\"float {prefix}roughness\" [ {} ]", roughness.factor * roughness.factor)
            }
            Some((id, _))
                if let Some((name, is_remapped)) =
                    self.width(id, roughness.factor, prefix, who) =>
            {
                return format!(
                    " \"texture {prefix}roughness\" [ \"{name}\" ] \"bool remaproughness\" [ \
                        {is_remapped} ]"
                );
            }
            Some((id, channel)) => {
                let name = self.texture(
                    id,
                    "float",
                    Baked::Squared { channel, factor: roughness.factor },
                    who,
                );
                format!("\"texture {prefix}roughness\" [ \"{name}\" ]")
            }
        };
        let flag = if prefix == "interface." { "" } else { " \"bool remaproughness\" [ false ]" };
        format!(" {width}{flag}")
    }
}

/// The reflectance of a metal at normal incidence, without its texture.
fn straight_reflectance(spectrum: &ConductorSpectrum) -> Rgb {
    let of = |eta: Rgb, k: Rgb| {
        let of_channel = |eta: f32, k: f32| fresnel::conductor(1.0, eta, k);
        Rgb::new(of_channel(eta.r, k.r), of_channel(eta.g, k.g), of_channel(eta.b, k.b))
    };
    match spectrum {
        ConductorSpectrum::Metal(metal) => {
            let [eta, k] = metal.indices(ColorMode::Rgb);
            of(Rgb::new(eta[0], eta[1], eta[2]), Rgb::new(k[0], k[1], k[2]))
        }
        ConductorSpectrum::Measured { eta, k } => of(*eta, *k),
        ConductorSpectrum::Color(color) => without_spectrum(*color, false).factor,
    }
}

/// True for a thin sheet of pure clear glass.
fn is_thin_glass(kind: &MetallicRoughness) -> bool {
    let plain = MetallicRoughness {
        ior: kind.ior,
        transmission: 1.0.into(),
        ..MetallicRoughness::default()
    };
    *kind == plain && kind.ior > 0.0
}
