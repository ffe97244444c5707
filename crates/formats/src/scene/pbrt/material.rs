//! Materials.

use super::Builder;
use crate::scene::fault::{Fault, Spot};
use super::lexer::{Lexer, quoted};
use super::params::{Params, Type};
use super::spectrum::{COPPER, Role};
use super::texture::Pattern;
use super::{legacy, options::is_kind};
use snell_math::Rgb;
use snell_math::spectrum::{Metal, Spectrum};
use snell_scene::material::{
    AlphaMode, ColorParam, Conductor, ConductorSpectrum, Dielectric, Diffuse, Interface, Interior, MetallicRoughness,
    NormalMap, Plastic, ScalarParam,
};
use snell_scene::{Encoding, Material, MaterialId, Texture};
use std::collections::HashMap;
use std::rc::Rc;

/// A material, not yet in the scene.
#[derive(Clone, Debug)]
pub struct Known {
    /// What it is; its emission and opacity come from shapes. `None` is no surface at all.
    pub material: Option<Material>,
    /// What the surface absorbs or lets through as a whole, from the material itself (pbrt-v3).
    pub opacity: Option<Rc<Pattern>>,
}

/// The materials of a scene.
#[derive(Debug, Default)]
pub struct Materials {
    /// In the order of definition.
    known: Vec<Known>,
    named: HashMap<String, usize>,
    default: Option<usize>,
    /// Ids in the scene by material and by what shapes add to it.
    ids: HashMap<(usize, String), MaterialId>,
}

/// What a shape adds to its material.
#[derive(Clone, Debug, Default)]
pub struct Finish {
    /// Radiance, and whether both sides emit.
    pub emission: Option<(ColorParam, bool)>,
    /// Opacity.
    pub alpha: Option<ScalarParam>,
    /// What is inside.
    pub interior: Option<Interior>,
}

impl Builder<'_> {
    /// `Material "diffuse" ...`
    pub(super) fn material(&mut self, params: Params) -> Result<(), Fault> {
        let known = self.build_material(&params)?;
        self.state.material = Some(self.keep(known));
        Ok(())
    }

    /// `MakeNamedMaterial "name" "string type" "diffuse" ...`
    pub(super) fn make_named_material(&mut self, params: Params) -> Result<(), Fault> {
        let name = params.owner.strip_prefix("MakeNamedMaterial \"").unwrap_or_default();
        let name = name.strip_suffix('"').unwrap_or(name).to_string();
        let Some(kind) = params.string("type")? else {
            return Err(params.fault("there is no type", "add \"string type\" [ \"diffuse\" ] or the like"));
        };
        let owner = format!("Material {}", quoted(kind.as_bytes()));
        let params = params.of(owner);
        let mut known = self.build_material(&params)?;
        if let Some(material) = &mut known.material {
            material.name = name.clone();
        }
        let position = self.keep(known);
        if self.materials.named.insert(name.clone(), position).is_some() {
            let name = quoted(name.as_bytes());
            self.note(format!("material {name}"), params.at, || {
                format!("the material {name} is defined again; what follows uses the new one")
            });
        }
        Ok(())
    }

    /// `NamedMaterial "name"`
    pub(super) fn named_material(&mut self, lexer: &mut Lexer) -> Result<(), Fault> {
        let (name, at) = lexer.expect_string("the name of a material")?;
        self.state.material = Some(self.find_material(name, at)?);
        Ok(())
    }

    fn find_material(&self, name: &str, at: Spot) -> Result<usize, Fault> {
        self.materials.named.get(name).copied().ok_or_else(|| {
            let problem = format!("there is no material {} so far", quoted(name.as_bytes()));
            Fault::new(at, problem, "define it above with MakeNamedMaterial")
        })
    }

    /// The material of a name.
    pub(super) fn known_material(&self, name: &str, at: Spot) -> Result<Known, Fault> {
        Ok(self.materials.known[self.find_material(name, at)?].clone())
    }

    fn keep(&mut self, known: Known) -> usize {
        self.materials.known.push(known);
        self.materials.known.len() - 1
    }

    /// The position of the current material.
    fn current_material(&mut self) -> usize {
        if let Some(position) = self.state.material {
            return position;
        }
        if let Some(position) = self.materials.default {
            return position;
        }
        let material = Some(Material::new("default", Diffuse::new(Rgb::splat(0.5))));
        let position = self.keep(Known { material, opacity: None });
        self.materials.default = Some(position);
        position
    }

    /// The current material with what a shape adds to it; `None` if there is no surface.
    pub(super) fn finished_material(&mut self, finish: &Finish) -> Option<MaterialId> {
        let position = self.current_material();
        let key = (position, format!("{finish:?}"));
        if let Some(id) = self.materials.ids.get(&key) {
            return Some(*id);
        }
        let Known { material, opacity } = self.materials.known[position].clone();
        let mut material = match (material, finish.interior) {
            (Some(material), _) => material,
            (None, Some(_)) => Material::new("interface", Interface {}),
            (None, None) => return None,
        };
        material.interior = finish.interior.or(material.interior);
        if let Some((emission, both)) = finish.emission {
            material.emission = emission;
            material.emits_on_both_sides = both;
        }
        let alpha = finish.alpha.or_else(|| opacity.map(|o| self.scalar_param(&o)));
        if let Some(alpha) = alpha {
            material.alpha_mode = AlphaMode::Blend;
            material.alpha = alpha;
        }
        let id = self.scene.add_material(material);
        self.materials.ids.insert(key, id);
        Some(id)
    }

    /// True if the current material is none: the boundary of a medium.
    pub(super) fn is_without_surface(&mut self) -> bool {
        let position = self.current_material();
        self.materials.known[position].material.is_none()
    }

    /// True if the current material has textures, so that texture coordinates matter.
    pub(super) fn is_textured(&mut self) -> bool {
        let position = self.current_material();
        // Ids of textures stand in the debug form only where there are some.
        let known = &self.materials.known[position];
        known.opacity.is_some() || format!("{:?}", known.material).contains("TextureId")
    }

    fn build_material(&mut self, params: &Params) -> Result<Known, Fault> {
        params.get("type");
        let mut known = self.material_of_kind(params)?;
        if let Some(material) = &mut known.material {
            material.normal_map = self.normal_map(params)?;
        }
        for name in ["displacement", "bumpmap"] {
            if let Some(param) = params.get(name) {
                let at = param.at;
                self.note(format!("material {name}"), at, || {
                    format!("\"{name}\": bump maps are not supported; the surface stays smooth")
                });
            }
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
            return Ok(Known { material: None, opacity: None });
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
        Ok(Known { material: Some(material), opacity: None })
    }

    /// A colour parameter of a material or its default.
    pub(super) fn material_color(&mut self, params: &Params, name: &str, default: f32) -> Result<ColorParam, Fault> {
        let pattern = self.pattern_param(params, name, true)?.unwrap_or_else(|| Pattern::constant(default));
        Ok(self.color_param(&pattern))
    }

    fn diffuse(&mut self, params: &Params) -> Result<Material, Fault> {
        let reflectance = self.material_color(params, "reflectance", 0.5)?;
        Ok(Material::new("", Diffuse { reflectance }))
    }

    fn coated_diffuse(&mut self, params: &Params) -> Result<Material, Fault> {
        let base = self.pattern_param(params, "reflectance", true)?.unwrap_or_else(|| Pattern::constant(0.5));
        let roughness = self.roughness(params, "", 0.0)?;
        let ior = self.index(params, "eta")?;
        self.coating_details(params)?;
        let diffuse = self.color_param(&base.mapped(seen_through_coat, ior));
        Ok(Material::new("", Plastic { diffuse, specular: Rgb::WHITE.into(), ior, roughness }))
    }

    /// Parameters of the layer between coat and base.
    fn coating_details(&mut self, params: &Params) -> Result<(), Fault> {
        // How pbrt computes the layers is its own affair.
        for name in ["maxdepth", "nsamples", "g"] {
            params.get(name);
        }
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
        let roughness = self.roughness(params, prefix, 0.0)?;
        let spectrum = self.metal(params, prefix)?;
        Ok(Material::new("", Conductor { spectrum, roughness }))
    }

    fn metal(&mut self, params: &Params, prefix: &str) -> Result<ConductorSpectrum, Fault> {
        if params.has("reflectance") {
            for name in ["eta", "k"] {
                if params.has(&format!("{prefix}{name}")) {
                    return Err(params.fault("both reflectance and eta or k are given", "take one of them out"));
                }
            }
            return Ok(ConductorSpectrum::Color(self.material_color(params, "reflectance", 0.5)?));
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
        let roughness = self.roughness(params, "conductor.", 0.0)?;
        let clearcoat_roughness = self.roughness(params, "interface.", 0.0)?;
        self.index(params, "interface.eta")?;
        self.coating_details(params)?;
        let base_color = match spectrum {
            ConductorSpectrum::Color(color) => color,
            ConductorSpectrum::Metal(metal) => {
                ColorParam { spectrum: Some(Spectrum::metal(metal)), ..Rgb::WHITE.into() }
            }
            ConductorSpectrum::Measured { eta, k } => ColorParam::constant(normal_reflectance(eta, k)),
        };
        let kind = MetallicRoughness {
            base_color,
            metallic: 1.0.into(),
            roughness,
            clearcoat: 1.0.into(),
            clearcoat_roughness,
            ..MetallicRoughness::default()
        };
        Ok(Material::new("", kind))
    }

    pub(super) fn dielectric(&mut self, params: &Params) -> Result<Material, Fault> {
        let ior = self.index(params, "eta")?;
        let roughness = self.roughness(params, "", 0.0)?;
        Ok(Material::new("", Dielectric { roughness, ..Dielectric::smooth(ior) }))
    }

    fn thin_dielectric(&mut self, params: &Params) -> Result<Material, Fault> {
        let ior = self.index(params, "eta")?;
        let kind = MetallicRoughness { ior, transmission: 1.0.into(), ..MetallicRoughness::default() };
        Ok(Material::new("", kind))
    }

    fn diffuse_transmission(&mut self, params: &Params) -> Result<Material, Fault> {
        let scale = params.float_or("scale", 1.0)? as f32;
        let mut reflectance = self.material_color(params, "reflectance", 0.25)?;
        self.material_color(params, "transmittance", 0.25)?;
        reflectance.factor = reflectance.factor * scale;
        let owner = params.owner.clone();
        self.note(owner.clone(), params.at, || {
            format!("{owner}: only what it reflects is shown, not what it lets through")
        });
        Ok(Material::new("", Diffuse { reflectance }))
    }

    fn subsurface(&mut self, params: &Params) -> Result<Material, Fault> {
        let diffuse = if params.has("reflectance") {
            self.material_color(params, "reflectance", 0.5)?
        } else {
            let (sigma_a, sigma_s) = (
                self.pattern_param(params, "sigma_a", true)?.and_then(|p| p.as_constant()),
                self.pattern_param(params, "sigma_s", true)?.and_then(|p| p.as_constant()),
            );
            // The coefficients of pbrt's default, in 1 / mm (Jensen et al., 2001).
            let a = sigma_a.unwrap_or(Rgb::new(0.0011, 0.0024, 0.014));
            let s = sigma_s.unwrap_or(Rgb::new(2.55, 3.21, 3.77));
            let channel = |a: f32, s: f32| diffuse_reflectance(a, s);
            ColorParam::constant(Rgb::new(channel(a.r, s.r), channel(a.g, s.g), channel(a.b, s.b)))
        };
        for name in ["mfp", "scale", "g", "name"] {
            params.get(name);
        }
        let roughness = self.roughness(params, "", 0.0)?;
        let ior = if params.has("eta") { self.index(params, "eta")? } else { 1.33 };
        let owner = params.owner.clone();
        self.note(owner.clone(), params.at, || {
            format!("{owner}: light does not travel below the surface; a coated diffuse surface was used instead")
        });
        Ok(Material::new("", Plastic { diffuse, specular: Rgb::WHITE.into(), ior, roughness }))
    }

    fn hair(&mut self, params: &Params) -> Result<Material, Fault> {
        for name in ["sigma_a", "eumelanin", "pheomelanin", "eta", "beta_m", "beta_n", "alpha"] {
            params.get(name);
        }
        let name = if params.has("color") { "color" } else { "reflectance" };
        let reflectance = if params.has(name) {
            self.material_color(params, name, 0.3)?
        } else {
            // The colour of brown hair.
            ColorParam::constant(Rgb::new(0.26, 0.15, 0.08))
        };
        let owner = params.owner.clone();
        self.note(owner.clone(), params.at, || format!("{owner}: a diffuse surface of its colour was used instead"));
        Ok(Material::new("", Diffuse { reflectance }))
    }

    fn mix(&mut self, params: &Params) -> Result<Known, Fault> {
        let Some(param) = params.typed("materials", &[Type::String])? else {
            return Err(params.fault("no materials", "name two"));
        };
        let [a, b] = param.strings() else {
            return Err(param.fault("not two names", "name two materials"));
        };
        let (a, b, at) = (self.find_material(a, param.at)?, self.find_material(b, param.at)?, param.at);
        let amount = self.pattern_param(params, "amount", false)?.unwrap_or_else(|| Pattern::constant(0.5));
        let share = amount.as_constant().map_or(0.5, |a| a.r);
        let (a, b) = (self.materials.known[a].clone(), self.materials.known[b].clone());
        if let (Some(one), Some(other)) = (&a.material, &b.material)
            && let Some(mixed) = mix_diffuse(one, other, share)
            && amount.as_constant().is_some()
        {
            return Ok(Known { material: Some(mixed), opacity: None });
        }
        let owner = params.owner.clone();
        self.note(owner.clone(), at, || format!("{owner}: the material with the larger share was used alone"));
        Ok(if share < 0.5 { a } else { b })
    }

    /// The index of refraction of a dielectric.
    pub(super) fn index(&mut self, params: &Params, name: &str) -> Result<f32, Fault> {
        let Some(param) = params.typed(name, &[Type::Float, Type::Spectrum, Type::Rgb, Type::Texture])? else {
            return Ok(1.5);
        };
        if param.kind == Type::Texture {
            self.note("textured index", param.at, || "a texture as index of refraction: 1.5 was used instead".into());
            return Ok(1.5);
        }
        let color = self.color(param, Role::Factor)?;
        Ok((color.r + color.g + color.b) / 3.0)
    }

    /// Roughness as Snell has it, whose square is the width of the distribution.
    pub(super) fn roughness(&mut self, params: &Params, prefix: &str, default: f32) -> Result<ScalarParam, Fault> {
        let mut get = |name: &str| self.pattern_param(params, &format!("{prefix}{name}"), false);
        let (both, u, v) = (get("roughness")?, get("uroughness")?, get("vroughness")?);
        let u = u.or_else(|| both.clone());
        let v = v.or(both).or_else(|| u.clone());
        let u = u.or_else(|| v.clone());
        let remap = params.bool_or("remaproughness", true)?;
        let from_alpha: fn(f32, f32) -> f32 = |alpha, _| alpha.max(0.0).sqrt();
        let function = match (remap, self.is_v3) {
            (false, _) => from_alpha,
            (true, false) => |roughness: f32, _| roughness.max(0.0).sqrt().sqrt(),
            (true, true) => |roughness: f32, _| legacy::alpha_of_roughness(roughness).sqrt(),
        };
        let pattern = match (u, v) {
            (Some(u), Some(v)) => match (u.as_constant(), v.as_constant()) {
                (Some(u), Some(v)) if u != v => {
                    let owner = params.owner.clone();
                    self.note("anisotropic", params.at, || {
                        format!("{owner}: roughness that differs by direction; the geometric mean was used")
                    });
                    Rc::new(Pattern::Constant(Rgb::splat((u.r * v.r).max(0.0).sqrt())))
                }
                _ => u,
            },
            _ => Pattern::constant(default),
        };
        let pattern = pattern.mapped(function, 0.0);
        Ok(self.scalar_param(&pattern))
    }

    fn normal_map(&mut self, params: &Params) -> Result<Option<NormalMap>, Fault> {
        let Some((name, at)) = self.file_name(params, "normalmap")? else { return Ok(None) };
        let image = self.image(name, at)?;
        let texture = self.scene.add_texture(Texture::new(image, Encoding::Linear));
        Ok(Some(NormalMap { texture, scale: 1.0 }))
    }
}

/// The metal whose tables `eta` and `k` name, if Snell has it too; copper if they say nothing.
fn named_metal(params: &Params, prefix: &str) -> Option<Metal> {
    let [eta, k] = ["eta", "k"].map(|part| {
        let name = format!("{prefix}{part}");
        if !params.has(&name) {
            return Some("Cu".to_string());
        }
        match params.get(&name)?.strings() {
            [table] => Some(table.strip_prefix("metal-")?.strip_suffix(part)?.strip_suffix('-')?.to_string()),
            _ => None,
        }
    });
    if eta == k { Metal::named(&eta?) } else { None }
}

/// Share of the diffuse light that enters a coat and leaves it again: the base reflects, and so does the coat's inner side, to and fro.
/// The diffuse reflectance of the inner side is the fit of Egan and Hilgeman, Optical Properties of Inhomogeneous Materials, 1979.
fn seen_through_coat(reflectance: f32, ior: f32) -> f32 {
    let inner = (-1.440 / (ior * ior) + 0.710 / ior + 0.668 + 0.0636 * ior).clamp(0.0, 0.99);
    let inner = if ior > 1.0 { inner } else { 0.0 };
    let base = reflectance.clamp(0.0, 1.0);
    base * (1.0 - inner) / (1.0 - base * inner)
}

/// What a metal reflects at normal incidence (Fresnel).
pub fn normal_reflectance(eta: Rgb, k: Rgb) -> Rgb {
    let channel = |n: f32, k: f32| ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k);
    Rgb::new(channel(eta.r, k.r), channel(eta.g, k.g), channel(eta.b, k.b))
}

/// Diffuse reflectance of a deep medium with an index of 1.33 (Jensen et al., A Practical Model for Subsurface Light Transport, 2001).
fn diffuse_reflectance(sigma_a: f32, sigma_s: f32) -> f32 {
    let albedo = sigma_s / (sigma_a + sigma_s).max(1e-12);
    let root = (3.0 * (1.0 - albedo)).max(0.0).sqrt();
    let a = 1.8;
    (0.5 * albedo * (1.0 + (-4.0 / 3.0 * a * root).exp()) * (-root).exp()).clamp(0.0, 1.0)
}

/// A mix of diffuse surfaces is diffuse.
fn mix_diffuse(a: &Material, b: &Material, share: f32) -> Option<Material> {
    use snell_scene::material::MaterialKind::Diffuse as Kind;
    let (Kind(one), Kind(other)) = (&a.kind, &b.kind) else { return None };
    if one.reflectance.texture.is_some() || other.reflectance.texture.is_some() {
        return None;
    }
    let mixed = one.reflectance.factor * (1.0 - share) + other.reflectance.factor * share;
    Some(Material::new("", Diffuse::new(mixed)))
}
