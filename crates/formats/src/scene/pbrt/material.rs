//! Materials.

use super::Builder;
use super::lexer::{Lexer, quoted};
use super::params::{Params, Type};
use super::spectrum::{COPPER, Role};
use super::texture::{Function, Pattern};
use super::{legacy, options::is_kind};
use crate::scene::fault::{Fault, Spot};
use crate::scene::layers::{self, Layers, MAX_LAYERS};
use crate::scene::metal::{Roughness, metal};
use crate::scene::scattering::{self, Coefficients, color_of_albedo};
use crate::scene::shapes::crossed;
use crate::scene::sheet::letting_through;
use snell_math::Rgb;
use snell_math::real;
use snell_math::spectrum::Metal;
use snell_scene::bsdf::MicrofacetShape;
use snell_scene::material::{
    BumpMap, CoatedConductor, CoatedDiffuse, ColorParam, Conductor, ConductorSpectrum, Dielectric,
    Diffuse, Hair, HeightUnit, Interface, Interior, MetallicRoughness, NormalMap, OpenPbr,
    ScalarParam,
};
use snell_scene::{Encoding, ImageTexture, Material, MaterialId};
use std::collections::HashMap;
use std::rc::Rc;

/// A material, not yet in the scene.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Layers from the outermost; emission and opacity come from shapes. Empty for no surface at
    /// all.
    pub layers: Layers,
    /// The opacity of the whole surface, set by the material itself (pbrt-v3).
    pub opacity: Option<Rc<Pattern>>,
}

/// The materials of a scene.
#[derive(Debug, Default)]
pub struct Materials {
    /// Materials in the order of definition.
    known: Vec<Known>,
    named: HashMap<String, usize>,
    default: Option<usize>,
    /// Ids in the scene by material and by finish.
    ids: HashMap<(usize, String), Vec<MaterialId>>,
}

/// Properties that a shape adds to its material.
#[derive(Clone, Debug, Default)]
pub struct Finish {
    /// Radiance, and whether both sides emit.
    pub emission: Option<(ColorParam, bool)>,
    /// Opacity of the surface.
    pub alpha: Option<ScalarParam>,
    /// True for a lamp that lights and is not seen.
    pub is_hidden: bool,
    /// The medium inside of the surface.
    pub interior: Option<Interior>,
}

impl Builder<'_> {
    /// Reads `Material "diffuse" ...`.
    pub(super) fn material(&mut self, params: Params) -> Result<(), Fault> {
        let known = self.build_material(&params)?;
        self.state.material = Some(self.keep(known));
        Ok(())
    }

    /// Reads `MakeNamedMaterial "name" "string type" "diffuse" ...`.
    pub(super) fn make_named_material(&mut self, params: Params) -> Result<(), Fault> {
        let name = params.owner.strip_prefix("MakeNamedMaterial \"").unwrap_or_default();
        let name = name.strip_suffix('"').unwrap_or(name).to_string();
        let Some(kind) = params.string("type")? else {
            return Err(
                params.fault("there is no type", "add \"string type\" [ \"diffuse\" ] or the like")
            );
        };
        let owner = format!("Material {}", quoted(kind.as_bytes()));
        let params = params.of(owner);
        let mut known = self.build_material(&params)?;
        known.layers.iter_mut().for_each(|material| material.name.clone_from(&name));
        let position = self.keep(known);
        if self.materials.named.insert(name.clone(), position).is_some() {
            let name = quoted(name.as_bytes());
            self.note(format!("material {name}"), params.at, || {
                format!("the material {name} is defined again; what follows uses the new one")
            });
        }
        Ok(())
    }

    /// Reads `NamedMaterial "name"`.
    pub(super) fn named_material(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let (name, at) = lexer.expect_string("the name of a material")?;
        self.state.material = Some(self.find_material(name, at));
        Ok(())
    }

    /// The index of the material with this name. As in pbrt-v3, which some of whose own scenes rely
    /// on it, a name that is not defined is the default material.
    pub(super) fn find_material(&mut self, name: &str, at: Spot) -> usize {
        if let Some(position) = self.materials.named.get(name) {
            return *position;
        }
        let name = quoted(name.as_bytes());
        self.note(format!("no material {name}"), at, || {
            format!(
                "there is no material {name} so far; the default material was used: define it \
                above with MakeNamedMaterial"
            )
        });
        self.default_material()
    }

    fn keep(&mut self, known: Known) -> usize {
        self.materials.known.push(known);
        self.materials.known.len() - 1
    }

    /// The index of the current material.
    fn current_material(&mut self) -> usize {
        match self.state.material {
            Some(position) => position,
            None => self.default_material(),
        }
    }

    /// The index of the default material.
    fn default_material(&mut self) -> usize {
        if let Some(position) = self.materials.default {
            return position;
        }
        let layers = vec![Material::new("default", Diffuse::new(Rgb::splat(0.5)))];
        let position = self.keep(Known { layers, opacity: None });
        self.materials.default = Some(position);
        position
    }

    /// The layers of the current material with a shape's finish; empty if there is no surface.
    pub(super) fn finished_material(&mut self, finish: &Finish, at: Spot) -> Vec<MaterialId> {
        let position = self.current_material();
        let key = (position, format!("{finish:?}"));
        if let Some(ids) = self.materials.ids.get(&key) {
            return ids.clone();
        }
        let Known { mut layers, opacity } = self.materials.known[position].clone();
        if layers.is_empty() && finish.interior.is_some() {
            layers.push(Material::new("interface", Interface {}));
        }
        if finish.emission.is_some() && layers.len() > 1 {
            self.note("emitting mix", at, || {
                "an area light on a mix of materials: the last of them was used alone".into()
            });
            layers.drain(..layers.len() - 1);
        }
        if let Some(alpha) = finish.alpha.or_else(|| opacity.map(|o| self.scalar_param(&o))) {
            let (masked, is_exact) = layers::mask(layers, alpha);
            layers = masked;
            if !is_exact {
                self.note("alpha of mix", at, || {
                    "a texture as alpha of a mix of materials: it was put on the last of them only"
                        .into()
                });
            }
        }
        let mut ids = Vec::new();
        for mut material in layers {
            material.interior = finish.interior.or(material.interior);
            if let Some((emission, both)) = finish.emission {
                material.emission = emission;
                material.emits_on_both_sides = both;
                material.visible = !finish.is_hidden;
            }
            ids.push(self.scene.add_material(material));
        }
        self.materials.ids.insert(key, ids.clone());
        ids
    }

    /// True if there is no current material: the surface bounds a medium.
    pub(super) fn is_without_surface(&mut self) -> bool {
        let position = self.current_material();
        self.materials.known[position].layers.is_empty()
    }

    /// True if the current material has textures, so that texture coordinates matter.
    pub(super) fn is_textured(&mut self) -> bool {
        let position = self.current_material();
        let known = &self.materials.known[position];
        let shows_picture = |light: usize| self.shapes.area_lights[light].shows_picture();
        self.state.area_light.is_some_and(shows_picture)
            || known.opacity.is_some()
            || known.layers.iter().any(|material| !material.textures().is_empty())
    }

    fn build_material(&mut self, params: &Params) -> Result<Known, Fault> {
        params.get("type");
        let mut known = self.material_of_kind(params)?;
        if let Some(map) = self.normal_map(params)? {
            known.layers.iter_mut().for_each(|material| material.normal_map = Some(map));
        }
        if let Some(map) = self.bump_map(params)? {
            known.layers.iter_mut().for_each(|material| material.bump_map = Some(map));
        }
        self.note_unused(params);
        Ok(known)
    }

    fn material_of_kind(&mut self, params: &Params) -> Result<Known, Fault> {
        let kind = |kind: &str| is_kind(params, kind);
        let material = if kind("diffuse") {
            self.diffuse(params)?
        } else if kind("coateddiffuse") {
            self.coated_diffuse(params)?
        } else if kind("conductor") {
            self.conductor(params, "")?
        } else if kind("coatedconductor") {
            self.coated_conductor(params)?
        } else if kind("dielectric") {
            self.dielectric(params)?
        } else if kind("thindielectric") {
            self.thin_dielectric(params)?
        } else if kind("diffusetransmission") {
            self.diffuse_transmission(params)?
        } else if kind("subsurface") {
            self.subsurface(params)?
        } else if kind("hair") {
            self.hair(params)?
        } else if kind("mix") && params.has("materials") {
            return self.mix(params);
        } else if kind("interface") || kind("none") || kind("") {
            return Ok(Known::default());
        } else if let Some(known) = legacy::material(self, params)? {
            return Ok(known);
        } else {
            params.get("filename");
            let owner = params.owner.clone();
            self.note(owner.clone(), params.at, || {
                format!("{owner} is not supported; a grey diffuse surface was used instead")
            });
            Material::new("", Diffuse::new(Rgb::splat(0.5)))
        };
        Ok(Known { layers: vec![material], opacity: None })
    }

    /// A colour parameter of a material, or its default.
    pub(super) fn material_color(
        &mut self,
        params: &Params,
        name: &str,
        default: f32,
    ) -> Result<ColorParam, Fault> {
        let pattern =
            self.pattern_param(params, name, true)?.unwrap_or_else(|| Pattern::constant(default));
        Ok(self.color_param(&pattern))
    }

    fn diffuse(&mut self, params: &Params) -> Result<Material, Fault> {
        let reflectance = self.material_color(params, "reflectance", 0.5)?;
        Ok(Material::new("", Diffuse { reflectance }))
    }

    fn coated_diffuse(&mut self, params: &Params) -> Result<Material, Fault> {
        let reflectance = self.material_color(params, "reflectance", 0.5)?;
        let roughness = self.roughness(params, "", 0.0)?;
        let ior = self.index(params, "eta")?;
        self.coating_details(params)?;
        Ok(Material::new(
            "",
            CoatedDiffuse { ior, roughness, ..CoatedDiffuse::new(reflectance, 0.0) },
        ))
    }

    /// Reads the parameters of the layer between coat and base.
    fn coating_details(&mut self, params: &Params) -> Result<(), Fault> {
        // These parameters only control how pbrt computes the layers.
        for name in ["maxdepth", "nsamples", "g"] {
            params.get(name);
        }
        // A clear layer looks the same at any thickness.
        params.get("thickness");
        if let Some(pattern) = self.pattern_param(params, "albedo", true)?
            && pattern.as_constant() != Some(Rgb::BLACK)
        {
            let owner = params.owner.clone();
            self.note(format!("{owner} albedo"), params.at, || {
                format!("{owner}: a layer that scatters light became a clear one")
            });
        }
        Ok(())
    }

    fn conductor(&mut self, params: &Params, prefix: &str) -> Result<Material, Fault> {
        let roughness = self.widths(params, prefix, 0.0)?;
        let spectrum = self.metal(params, prefix)?;
        Ok(metal(spectrum, Rgb::WHITE.into(), roughness, MicrofacetShape::Ggx))
    }

    fn metal(&mut self, params: &Params, prefix: &str) -> Result<ConductorSpectrum, Fault> {
        if params.has("reflectance") {
            for name in ["eta", "k"] {
                if params.has(&format!("{prefix}{name}")) {
                    return Err(params
                        .fault("both reflectance and eta or k are given", "remove one of them"));
                }
            }
            return Ok(ConductorSpectrum::Color(self.material_color(
                params,
                "reflectance",
                0.5,
            )?));
        }
        if let Some(metal) = named_metal(params, prefix) {
            return Ok(ConductorSpectrum::Metal(metal));
        }
        let mut part = |name: &str, copper: Rgb| -> Result<Rgb, Fault> {
            let pattern = self.pattern_param(params, &format!("{prefix}{name}"), true)?;
            let Some(pattern) = pattern else { return Ok(copper) };
            Ok(pattern.as_constant().unwrap_or_else(|| {
                self.note("textured metal", params.at, || {
                    "a texture as the index of a metal: copper was used instead".into()
                });
                copper
            }))
        };
        let eta = part("eta", COPPER[0])?;
        let k = part("k", COPPER[1])?;
        Ok(ConductorSpectrum::Measured { eta, k })
    }

    fn coated_conductor(&mut self, params: &Params) -> Result<Material, Fault> {
        let spectrum = self.metal(params, "conductor.")?;
        let conductor = Conductor::new(spectrum, self.roughness(params, "conductor.", 0.0)?);
        let roughness = self.roughness(params, "interface.", 0.0)?;
        let ior = self.index(params, "interface.eta")?;
        self.coating_details(params)?;
        Ok(Material::new("", CoatedConductor { conductor, ior, roughness }))
    }

    pub(super) fn dielectric(&mut self, params: &Params) -> Result<Material, Fault> {
        let ior = self.index(params, "eta")?;
        let roughness = self.roughness(params, "", 0.0)?;
        Ok(Material::new("", Dielectric { roughness, ..Dielectric::smooth(ior) }))
    }

    fn thin_dielectric(&mut self, params: &Params) -> Result<Material, Fault> {
        let ior = self.index(params, "eta")?;
        let kind =
            MetallicRoughness { ior, transmission: 1.0.into(), ..MetallicRoughness::default() };
        Ok(Material::new("", kind))
    }

    fn diffuse_transmission(&mut self, params: &Params) -> Result<Material, Fault> {
        let scale = params.float_or("scale", 1.0)? as f32;
        let mut color = |name: &str| -> Result<ColorParam, Fault> {
            let color = self.material_color(params, name, 0.25)?;
            Ok(ColorParam { factor: color.factor * scale, ..color })
        };
        Ok(letting_through(color("reflectance")?, color("transmittance")?))
    }

    /// Makes a material with subsurface scattering: from the diffuse reflectance and the mean free
    /// path, or from coefficients per millimetre.
    fn subsurface(&mut self, params: &Params) -> Result<Material, Fault> {
        let scale = params.float_or("scale", 1.0)? as f32;
        let g = params.float_or("g", 0.0)?.clamp(-0.99, 0.99) as f32;
        let (color, radius) = if params.has("reflectance") {
            let constant = |p: Rc<Pattern>| p.as_constant();
            let mfp =
                self.pattern_param(params, "mfp", true)?.and_then(constant).unwrap_or(Rgb::WHITE);
            (self.material_color(params, "reflectance", 0.5)?, mfp * scale)
        } else {
            let Coefficients { sigma_a, sigma_s } = self.coefficients_below(params)?;
            let (sigma_a, sigma_s) = (sigma_a * scale, sigma_s * scale);
            let channel = |a: f32, s: f32| color_of_albedo(s / (a + s).max(f32::MIN_POSITIVE), g);
            let color = Rgb::new(
                channel(sigma_a.r, sigma_s.r),
                channel(sigma_a.g, sigma_s.g),
                channel(sigma_a.b, sigma_s.b),
            );
            (color.into(), mean_free_paths(sigma_a + sigma_s))
        };
        let ior = if params.has("eta") { self.index(params, "eta")? } else { 1.33 };
        let roughness = self.roughness(params, "", 0.0)?;
        Ok(lit_below(color, radius, g, ior, roughness))
    }

    fn coefficients_below(&mut self, params: &Params) -> Result<Coefficients, Fault> {
        // pbrt's default is whole milk.
        let milk = scattering::named("wholemilk")
            .unwrap_or(Coefficients { sigma_a: Rgb::BLACK, sigma_s: Rgb::WHITE });
        let mut preset = milk;
        if let Some(name) = params.string("name")? {
            match scattering::named(name) {
                Some(known) => preset = known,
                None => {
                    let name = quoted(name.as_bytes());
                    self.note(format!("subsurface {name}"), params.at, || {
                        format!("the medium {name} has no table here; milk was used instead")
                    });
                }
            }
        }
        let mut part = |name: &str, default: Rgb| -> Result<Rgb, Fault> {
            Ok(self
                .pattern_param(params, name, true)?
                .and_then(|p| p.as_constant())
                .unwrap_or(default))
        };
        Ok(Coefficients {
            sigma_a: part("sigma_a", preset.sigma_a)?,
            sigma_s: part("sigma_s", preset.sigma_s)?,
        })
    }

    /// Makes hair from its absorption, its colour, or its pigments: the first of these that the
    /// file gives.
    fn hair(&mut self, params: &Params) -> Result<Material, Fault> {
        let mut kind = Hair::default();
        let color = if params.has("reflectance") { "reflectance" } else { "color" };
        let has_pigments = params.has("eumelanin") || params.has("pheomelanin");
        if params.has("sigma_a") {
            kind.sigma_a = self.material_color(params, "sigma_a", 0.0)?;
        } else if params.has(color) {
            kind.color = self.material_color(params, color, 1.0)?;
        } else {
            let brown = if has_pigments { 0.0 } else { 1.3 };
            kind.eumelanin = self.material_scalar(params, "eumelanin", brown)?;
            kind.pheomelanin = self.material_scalar(params, "pheomelanin", 0.0)?;
        }
        let given = [params.has("sigma_a"), params.has(color), has_pigments];
        for name in ["reflectance", "color", "eumelanin", "pheomelanin"] {
            params.get(name);
        }
        if given.iter().filter(|&&is| is).count() > 1 {
            let owner = params.owner.clone();
            self.note(format!("{owner} twice"), params.at, || {
                format!("{owner}: of sigma_a, reflectance and pigments the first was used alone")
            });
        }
        kind.longitudinal_roughness = self.material_scalar(params, "beta_m", 0.3)?;
        kind.azimuthal_roughness = self.material_scalar(params, "beta_n", 0.3)?;
        kind.ior = if params.has("eta") { self.index(params, "eta")? } else { kind.ior };
        let tilt = self.pattern_param(params, "alpha", false)?;
        if let Some(tilt) = tilt {
            match tilt.as_constant() {
                Some(degrees) => kind.scale_tilt = degrees.r,
                None => self.note("textured scales", params.at, || {
                    "a texture as \"alpha\" of hair: scales of 2 degrees were used instead".into()
                }),
            }
        }
        Ok(Material::new("", kind))
    }

    /// A scalar parameter of a material, or its default.
    fn material_scalar(
        &mut self,
        params: &Params,
        name: &str,
        default: f32,
    ) -> Result<ScalarParam, Fault> {
        let pattern =
            self.pattern_param(params, name, false)?.unwrap_or_else(|| Pattern::constant(default));
        Ok(self.scalar_param(&pattern))
    }

    fn mix(&mut self, params: &Params) -> Result<Known, Fault> {
        let Some(param) = params.typed("materials", &[Type::String])? else {
            return Err(params.fault("no materials", "name two"));
        };
        let [a, b] = param.strings() else {
            return Err(param.fault("not two names", "name two materials"));
        };
        let (a, b, at) =
            (self.find_material(a, param.at), self.find_material(b, param.at), param.at);
        let amount =
            self.pattern_param(params, "amount", false)?.unwrap_or_else(|| Pattern::constant(0.5));
        Ok(self.mixed([a, b], &amount, params, at))
    }

    /// Mixes two materials; the second covers a share of the surface.
    pub(super) fn mixed(
        &mut self,
        [a, b]: [usize; 2],
        amount: &Rc<Pattern>,
        params: &Params,
        at: Spot,
    ) -> Known {
        let (a, b) = (self.materials.known[a].clone(), self.materials.known[b].clone());
        let owner = params.owner.clone();
        if a.layers.is_empty() || b.layers.is_empty() || a.opacity.is_some() || b.opacity.is_some()
        {
            self.note(owner.clone(), at, || {
                format!(
                    "{owner} of something transparent or of no surface: the first material was \
                    used alone"
                )
            });
            return a;
        }
        if a.layers.len() + b.layers.len() > MAX_LAYERS {
            self.note(format!("{owner} too deep"), at, || {
                format!(
                    "{owner} of mixes makes more than {MAX_LAYERS} materials of one: the first \
                    was used alone"
                )
            });
            return a;
        }
        let share = self.scalar_param(amount);
        if share.texture.is_some() && b.layers.len() > 1 {
            self.note(format!("{owner} of mixes"), at, || {
                format!(
                    "{owner} of mixes with a texture as amount: the texture counts for their \
                    last materials only"
                )
            });
        }
        Known { layers: layers::blend(b.layers, a.layers, share), opacity: None }
    }

    /// The index of refraction of a dielectric.
    pub(super) fn index(&mut self, params: &Params, name: &str) -> Result<f32, Fault> {
        let Some(param) =
            params.typed(name, &[Type::Float, Type::Spectrum, Type::Rgb, Type::Texture])?
        else {
            return Ok(1.5);
        };
        if param.kind == Type::Texture {
            self.note("textured index", param.at, || {
                "a texture as index of refraction: 1.5 was used instead".into()
            });
            return Ok(1.5);
        }
        let color = self.color(param, Role::Factor)?;
        Ok((color.r + color.g + color.b) / 3.0)
    }

    /// Reads an isotropic roughness, as Snell defines it: its square is the width of the microfacet
    /// distribution.
    pub(super) fn roughness(
        &mut self,
        params: &Params,
        prefix: &str,
        default: f32,
    ) -> Result<ScalarParam, Fault> {
        let widths = self.widths(params, prefix, default)?;
        if let Roughness::Stretched { .. } = widths {
            let owner = params.owner.clone();
            self.note("anisotropic", params.at, || {
                format!("{owner}: roughness that differs by direction; the geometric mean was used")
            });
        }
        Ok(widths.mean())
    }

    /// Roughness along the two directions of the surface.
    pub(super) fn widths(
        &mut self,
        params: &Params,
        prefix: &str,
        default: f32,
    ) -> Result<Roughness, Fault> {
        let mut get = |name: &str| self.pattern_param(params, &format!("{prefix}{name}"), false);
        let (both, u, v) = (get("roughness")?, get("uroughness")?, get("vroughness")?);
        let u = u.or_else(|| both.clone());
        let v = v.or(both).or_else(|| u.clone());
        let u = u.or_else(|| v.clone());
        let remap = params.bool_or("remaproughness", true)?;
        let function = match (remap, self.is_v3) {
            (false, _) => Function { apply: |alpha| alpha.max(0.0).sqrt(), exponent: Some(0.5) },
            (true, false) => Function {
                apply: |roughness| roughness.max(0.0).sqrt().sqrt(),
                exponent: Some(0.25),
            },
            (true, true) => Function {
                apply: |roughness| legacy::alpha_of_roughness(roughness).sqrt(),
                exponent: None,
            },
        };
        let pattern = match (u, v) {
            (Some(u), Some(v)) => match (u.as_constant(), v.as_constant()) {
                (Some(u), Some(v)) if u != v => {
                    let width = |roughness: Rgb| real::powi((function.apply)(roughness.r), 2);
                    return Ok(Roughness::of_widths(width(u), width(v)));
                }
                _ => u,
            },
            _ => Pattern::constant(default),
        };
        let pattern = pattern.mapped(function);
        Ok(Roughness::Even(self.scalar_param(&pattern)))
    }

    /// Heights in units of the scene: `displacement`, in pbrt-v3 `bumpmap`.
    fn bump_map(&mut self, params: &Params) -> Result<Option<BumpMap>, Fault> {
        let mut map = None;
        for name in ["displacement", "bumpmap"].into_iter().filter(|name| params.has(name)) {
            let heights = self.material_scalar(params, name, 0.0)?;
            // A constant height changes no normal.
            map = heights.texture.map(|(texture, channel)| BumpMap {
                texture,
                channel: Some(channel),
                height: heights.factor,
                unit: HeightUnit::Scene,
            });
        }
        Ok(map)
    }

    fn normal_map(&mut self, params: &Params) -> Result<Option<NormalMap>, Fault> {
        let Some((name, _)) = self.file_name(params, "normalmap")? else { return Ok(None) };
        let image = self.image(name);
        let texture = self.scene.add_texture(ImageTexture::new(image, Encoding::Linear));
        let bitangent = crossed(&self.world_from_file);
        Ok(Some(NormalMap { bitangent, ..NormalMap::new(texture, 1.0) }))
    }
}

/// The metal whose tables `eta` and `k` name, if Snell has it; copper by default.
fn named_metal(params: &Params, prefix: &str) -> Option<Metal> {
    let [eta, k] = ["eta", "k"].map(|part| {
        let name = format!("{prefix}{part}");
        if !params.has(&name) {
            return Some("Cu".to_string());
        }
        match params.get(&name)?.strings() {
            [table] => Some(
                table.strip_prefix("metal-")?.strip_suffix(part)?.strip_suffix('-')?.to_string(),
            ),
            _ => None,
        }
    });
    if eta == k { Metal::named(&eta?) } else { None }
}

/// The mean free paths for these extinctions. Of a channel without extinction it is long beside the
/// others, which any finite number in scene units need not be.
fn mean_free_paths(sigma_t: Rgb) -> Rgb {
    let least = (sigma_t.max_element() * 1e-12).max(1e-18);
    sigma_t.map(|sigma| 1.0 / sigma.max(least))
}

/// A surface with subsurface scattering, from its diffuse reflectance `color`, the mean free path
/// `radius` of each channel and the mean cosine `g` of scattering.
pub(super) fn lit_below(
    color: ColorParam,
    radius: Rgb,
    g: f32,
    ior: f32,
    roughness: ScalarParam,
) -> Material {
    let longest = radius.max_element().max(f32::MIN_POSITIVE);
    let kind = OpenPbr {
        subsurface_weight: 1.0.into(),
        subsurface_color: color,
        subsurface_radius: longest.into(),
        subsurface_radius_scale: (radius * (1.0 / longest)).into(),
        subsurface_scatter_anisotropy: g.into(),
        specular_ior: ior.into(),
        specular_roughness: roughness,
        ..OpenPbr::default()
    };
    Material::new("", kind)
}
