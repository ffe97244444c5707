//! BSDFs: their conversion, and several of them on one surface.

mod adapter;
mod constants;
pub(super) mod facets;
mod plastic;
mod principled;

use super::Builder;
use super::color::{self, index_named};
use super::object::Object;
use super::texture::{Attributes, Pattern, rgb_of};
use super::value::Value;
use crate::scene::fault::Fault;
use crate::scene::metal::{Roughness, metal};
use crate::scene::sheet::letting_through;
use snell_math::spectrum::Metal;
use snell_math::{ColorMode, Rgb};
use snell_scene::Material;
use snell_scene::bsdf::{MicrofacetShape, fresnel};
use snell_scene::material::{
    AlphaMode, CoatedConductor, CoatedDiffuse, ColorParam, ConductorSpectrum, Dielectric, Diffuse,
    Hair, MaterialKind, MetallicRoughness, Mirror, OpenPbr, Phong, ScalarParam,
};
use std::rc::Rc;

/// The materials of one surface, in layers: where one is absent by its opacity, the next one is
/// hit.
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// The layers, outermost first; empty for no surface at all. Only the last one is always
    /// opaque.
    pub layers: Vec<Material>,
    /// The layers of the back, seen on a surface that is turned over; empty if it looks like the
    /// front.
    pub back: Vec<Material>,
    /// True if the back is black.
    pub is_one_sided: bool,
    /// The attributes of the mesh that it shows.
    pub attributes: Attributes,
}

impl Look {
    fn of(material: Material) -> Self {
        Self { layers: vec![material], ..Self::default() }
    }

    /// The same with panes of glass as surfaces that are always there, which can be a part of a
    /// blend and can emit.
    pub fn with_solid_panes(mut self) -> Self {
        self.layers.iter_mut().chain(&mut self.back).for_each(solid_pane);
        self
    }
}

/// The reflectance of a metal at normal incidence.
fn straight_reflectance(spectrum: &ConductorSpectrum) -> f32 {
    let of = |eta: Rgb, k: Rgb| {
        let of_channel = |eta: f32, k: f32| fresnel::conductor(1.0, eta, k);
        Rgb::new(of_channel(eta.r, k.r), of_channel(eta.g, k.g), of_channel(eta.b, k.b)).luminance()
    };
    match spectrum {
        ConductorSpectrum::Metal(metal) => {
            let [eta, k] = metal.indices(ColorMode::Rgb);
            of(Rgb::new(eta[0], eta[1], eta[2]), Rgb::new(k[0], k[1], k[2]))
        }
        ConductorSpectrum::Measured { eta, k } => of(*eta, *k),
        ConductorSpectrum::Color(color) => color.factor.luminance(),
    }
}

/// True for bsdfs that reflect on the front only.
fn is_one_sided(object: &Object) -> bool {
    const KINDS: [&str; 7] = [
        "diffuse",
        "roughdiffuse",
        "conductor",
        "roughconductor",
        "plastic",
        "roughplastic",
        "phong",
    ];
    let kind = object.kind.as_str();
    KINDS.contains(&kind) || (kind == "principled" && !object.has("spec_trans"))
}

/// Makes a pane of glass a surface that is always there.
fn solid_pane(material: &mut Material) {
    if let AlphaMode::Sheet(ior) = material.alpha_mode {
        let pane =
            MetallicRoughness { ior, transmission: 1.0.into(), ..MetallicRoughness::default() };
        (material.kind, material.alpha_mode) = (pane.into(), AlphaMode::Opaque);
    }
}

/// Grey, as Mitsuba's diffuse surfaces are by default.
pub const GRAY: f32 = 0.5;
/// Index of refraction of `bk7`, inside Mitsuba's dielectrics by default.
const GLASS: f64 = 1.5046;
/// Index of refraction of `air`, outside all of Mitsuba's materials by default.
const AIR: f64 = 1.000_277;
/// Index of refraction of `polypropylene`, inside Mitsuba's plastics by default.
const POLYPROPYLENE: f64 = 1.49;
/// Index of refraction of `amber`, inside Mitsuba's hair by default.
const AMBER: f64 = 1.55;

impl Builder<'_> {
    /// The appearance of a BSDF.
    pub(super) fn bsdf(&mut self, object: &Rc<Object>) -> Result<Look, Fault> {
        let key = Rc::as_ptr(object);
        if let Some(known) = self.looks.get(&key) {
            return Ok(known.clone());
        }
        if object.class != "bsdf" {
            return Err(object.fault("a bsdf was expected here", "refer to a bsdf"));
        }
        self.enter(object)?;
        let outer = std::mem::take(&mut self.attributes);
        let mut look = self.new_look(object)?;
        look.is_one_sided |= is_one_sided(object);
        look.attributes.add(&self.attributes);
        self.attributes = outer;
        self.leave();
        self.note_unused(object);
        if let (Some(id), [only]) = (&object.id, &mut look.layers[..])
            && only.name.is_empty()
        {
            only.name.clone_from(id);
        }
        self.looks.insert(key, look.clone());
        Ok(look)
    }

    fn new_look(&mut self, object: &Rc<Object>) -> Result<Look, Fault> {
        Ok(Look::of(match object.kind.as_str() {
            "diffuse" | "roughdiffuse" => self.diffuse(object)?,
            "dielectric" | "roughdielectric" => self.dielectric(object)?,
            "thindielectric" => self.thin_dielectric(object)?,
            "conductor" | "roughconductor" => self.conductor(object)?,
            "plastic" | "roughplastic" => self.plastic(object)?,
            "principled" | "principledthin" => return self.principled(object),
            "phong" => self.phong(object)?,
            "difftrans" => self.difftrans(object)?,
            "hair" => self.hair(object)?,
            "coating" | "roughcoating" => return self.coating(object),
            "null" | "mask" | "twosided" | "blendbsdf" | "mixturebsdf" | "bumpmap" | "bump"
            | "normalmap" => {
                return self.adapter(object);
            }
            _ => {
                let owner = object.owner();
                self.ignore_all(object);
                self.note(owner.clone(), object.at, || {
                    format!("{owner} is not supported; a grey diffuse surface was used instead")
                });
                Material::new("", Diffuse::new(Rgb::splat(GRAY)))
            }
        }))
    }

    fn diffuse(&mut self, object: &Object) -> Result<Material, Fault> {
        let name =
            if object.has("diffuse_reflectance") { "diffuse_reflectance" } else { "reflectance" };
        let reflectance = self.color(object, name, GRAY)?;
        if object.kind != "roughdiffuse" {
            return Ok(Material::new("", Diffuse { reflectance }));
        }
        object.get("use_fast_approx");
        let kind = OpenPbr {
            base_color: reflectance,
            base_diffuse_roughness: self.scalar(object, "alpha", 0.2)?,
            specular_weight: 0.0.into(),
            ..OpenPbr::default()
        };
        Ok(Material::new("", kind))
    }

    /// The index of the inside over that of the outside.
    fn relative_index(&mut self, object: &Object, default: f64) -> Result<f32, Fault> {
        let index = |name: &str, default: f64| -> Result<f64, Fault> {
            let Some(property) = object.get(name) else { return Ok(default) };
            let found = match &property.value {
                Value::String(material) => index_named(material).ok_or_else(|| {
                    let material = super::value::shortened(material);
                    property.fault(
                        format!("\"{material}\" is not a material that Mitsuba knows"),
                        "give a number or bk7, water, …",
                    )
                })?,
                Value::Color(hue) => f64::from(color::factor(*hue).luminance()),
                _ => object.float_or(name, default)?,
            };
            if (1e-3..1e3).contains(&found) {
                return Ok(found);
            }
            Err(property.fault(
                format!("an index of refraction of {found}"),
                "give a number from 0.001 to 1000",
            ))
        };
        Ok((index("int_ior", default)? / index("ext_ior", AIR)?) as f32)
    }

    /// Shape of the microfacet distribution; Beckmann by default.
    fn microfacets(&mut self, object: &Object) -> Result<MicrofacetShape, Fault> {
        if !object.kind.starts_with("rough") {
            return Ok(MicrofacetShape::Ggx);
        }
        let Some((distribution, at)) = object.string("distribution")? else {
            return Ok(MicrofacetShape::Beckmann);
        };
        match distribution {
            "ggx" => return Ok(MicrofacetShape::Ggx),
            "beckmann" => {}
            // A Phong exponent is converted to the same width; the highlights look similar.
            "phong" | "as" => {
                let owner = object.owner();
                self.note("distribution", at, || {
                    format!(
                        "{owner}: microfacets by Phong; Beckmann's of the same width were used, \
                            which are similar"
                    )
                });
            }
            other => {
                let problem = format!(
                    "\"{}\" is not a distribution of microfacets",
                    super::value::shortened(other)
                );
                return Err(Fault::new(at, problem, "use ggx or beckmann"));
            }
        }
        Ok(MicrofacetShape::Beckmann)
    }

    /// Roughness from `alpha`, or from `alpha_u` and `alpha_v`.
    fn roughness(&mut self, object: &Object) -> Result<Roughness, Fault> {
        if !object.kind.starts_with("rough") {
            return Ok(Roughness::Even(0.0.into()));
        }
        for name in ["sample_visible", "nonlinear"] {
            object.get(name);
        }
        for name in ["alpha", "alpha_u", "alpha_v"] {
            self.note_limits_of_width(object, name);
        }
        if !object.has("alpha_u") && !object.has("alpha_v") {
            return Ok(Roughness::Even(self.mapped(object, "alpha", 0.1, Some(root))?));
        }
        let widths =
            [self.number_pattern(object, "alpha_u")?, self.number_pattern(object, "alpha_v")?];
        let [u, v] = widths.map(|width| width.unwrap_or(Pattern::Constant(Rgb::splat(0.1).into())));
        if let (Pattern::Constant(u), Pattern::Constant(v)) = (&u, &v) {
            let [u, v] = [u, v].map(|width| rgb_of(*width).luminance().clamp(0.0, 1.0));
            return Ok(Roughness::of_widths(u, v));
        }
        match self.numbers_of_both(object, [&u, &v], "widths", |u, v| {
            let widths = [u, v].map(|width| width.clamp(0.0, 1.0));
            match Roughness::of_widths(widths[0], widths[1]) {
                Roughness::Even(roughness) => [roughness.factor, 0.0],
                Roughness::Stretched { roughness, anisotropy } => {
                    [roughness.factor, anisotropy.factor]
                }
            }
        }) {
            Some([roughness, anisotropy]) => Ok(Roughness::Stretched { roughness, anisotropy }),
            None => {
                let owner = object.owner();
                self.note(format!("{owner} widths"), object.at, || {
                    format!(
                        "{owner}: textures as \"alpha_u\" and \"alpha_v\" that do not fit on each \
                            other; a width of 0.1 was used instead"
                    )
                });
                Ok(Roughness::of_widths(0.1, 0.1))
            }
        }
    }

    /// Warns if a width of the distribution is out of range.
    fn note_limits_of_width(&mut self, object: &Object, name: &str) {
        let Some(property) = object.get(name) else { return };
        let width = match property.value {
            Value::Float(width) => width,
            Value::Integer(width) => width as f64,
            _ => return,
        };
        if !(0.0..=1.0).contains(&width) {
            let (owner, used) = (object.owner(), if width > 1.0 { 1 } else { 0 });
            self.note(format!("{owner} {name}"), property.at, || {
                format!(
                    "{owner}: \"{name}\" of {width:?} is outside of 0 to 1; {used} was used instead"
                )
            });
        }
    }

    /// Reads one roughness, for isotropic models.
    fn even_roughness(&mut self, object: &Object) -> Result<ScalarParam, Fault> {
        let roughness = self.roughness(object)?;
        if let Roughness::Stretched { .. } = roughness {
            let owner = object.owner();
            self.note(format!("{owner} stretched"), object.at, || {
                format!("{owner}: roughness that differs by direction; the geometric mean was used")
            });
        }
        Ok(roughness.mean())
    }

    fn dielectric(&mut self, object: &Object) -> Result<Material, Fault> {
        let ior = self.relative_index(object, GLASS)?;
        let (roughness, microfacets) = (self.even_roughness(object)?, self.microfacets(object)?);
        let tint = self.color(object, "specular_transmittance", 1.0)?;
        self.expect_white(object, "specular_reflectance")?;
        Ok(Material::new(
            "",
            Dielectric { roughness, microfacets, tint, ..Dielectric::smooth(ior) },
        ))
    }

    fn thin_dielectric(&mut self, object: &Object) -> Result<Material, Fault> {
        let ior = self.relative_index(object, GLASS)?;
        let base_color = self.color(object, "specular_transmittance", 1.0)?;
        if base_color == Rgb::WHITE.into() {
            // A mirror that is there as often as a pane reflects: lights are sampled through it.
            let reflectance = self.color(object, "specular_reflectance", 1.0)?;
            let alpha_mode = AlphaMode::Sheet(ior);
            return Ok(Material { alpha_mode, ..Material::new("", Mirror { reflectance }) });
        }
        self.expect_white(object, "specular_reflectance")?;
        let kind = MetallicRoughness {
            ior,
            base_color,
            transmission: 1.0.into(),
            ..MetallicRoughness::default()
        };
        Ok(Material::new("", kind))
    }

    /// Warns if a factor on untinted reflection is not white.
    fn expect_white(&mut self, object: &Object, name: &str) -> Result<(), Fault> {
        let Some(pattern) = self.pattern(object, name)? else { return Ok(()) };
        if !matches!(pattern, Pattern::Constant(color) if rgb_of(color) == Rgb::WHITE) {
            let owner = object.owner();
            let at = object.get(name).map_or(object.at, |p| p.at);
            self.note(format!("{owner} {name}"), at, || {
                format!("{owner}: \"{name}\" was ignored: it reflects by Fresnel's law alone")
            });
        }
        Ok(())
    }

    fn conductor(&mut self, object: &Object) -> Result<Material, Fault> {
        let (roughness, microfacets) = (self.roughness(object)?, self.microfacets(object)?);
        let tint = self.color(object, "specular_reflectance", 1.0)?;
        let spectrum = self.metal(object)?;
        if spectrum.is_none() && roughness == Roughness::Even(0.0.into()) {
            return Ok(Material::new("", Mirror { reflectance: tint }));
        }
        let spectrum = spectrum.unwrap_or(ConductorSpectrum::Color(Rgb::WHITE.into()));
        let kept = facets::Layer::new(microfacets, roughness).map_or(1.0, |layer| {
            layer.kept_by_metal(straight_reflectance(&spectrum), &mut self.means)
        });
        let tint = ColorParam { factor: tint.factor * kept, ..tint };
        Ok(metal(spectrum, tint, roughness, microfacets))
    }

    /// The metal of an object; `None` for a perfect reflector.
    fn metal(&mut self, object: &Object) -> Result<Option<ConductorSpectrum>, Fault> {
        let over = 1.0 / self.outside_index(object)?;
        if object.has("eta") || object.has("k") {
            object.get("material");
            let mut part = |name: &str| -> Result<Rgb, Fault> {
                Ok(self.constant(object, name)?.unwrap_or(Rgb::BLACK) * over)
            };
            return Ok(Some(ConductorSpectrum::Measured { eta: part("eta")?, k: part("k")? }));
        }
        let default = if self.version.starts_with("0.") { "Cu" } else { "none" };
        let (name, at) = object.string("material")?.unwrap_or((default, object.at));
        if name.eq_ignore_ascii_case("none") {
            return Ok(None);
        }
        if let Some([eta, k]) = constants::constants(name) {
            return Ok(Some(ConductorSpectrum::Measured { eta: eta * over, k: k * over }));
        }
        let known = Metal::named(name.strip_suffix("_palik").unwrap_or(name));
        if known.is_none() {
            let name = super::value::shortened(name);
            self.note(format!("metal {name}"), at, || {
                format!("the metal \"{name}\" has no table here; aluminium was used instead")
            });
        }
        Ok(known.or_else(|| Metal::named("Al")).map(ConductorSpectrum::Metal))
    }

    fn outside_index(&mut self, object: &Object) -> Result<f32, Fault> {
        let Some(property) = object.get("ext_eta") else { return Ok(1.0) };
        Ok(match &property.value {
            Value::String(name) => index_named(name).unwrap_or(1.0) as f32,
            _ => object.float_within("ext_eta", 1.0, [1e-3, 1e3])? as f32,
        })
    }

    fn phong(&mut self, object: &Object) -> Result<Material, Fault> {
        let exponent = self.constant(object, "exponent")?.map_or(30.0, |c| c.luminance());
        let diffuse = self.color(object, "diffuse_reflectance", GRAY)?;
        let specular = self.color(object, "specular_reflectance", 0.2)?;
        // Mitsuba's lobe integrates to its reflectance only at normal incidence, as ours does.
        let kind = Phong { diffuse, specular, shininess: exponent, ..Phong::default() };
        Ok(Material::new("", kind))
    }

    fn difftrans(&mut self, object: &Object) -> Result<Material, Fault> {
        let color = self.color(object, "transmittance", GRAY)?;
        Ok(letting_through(Rgb::BLACK.into(), color))
    }

    /// Reads hair, from its pigments or its absorption.
    fn hair(&mut self, object: &Object) -> Result<Material, Fault> {
        let mut kind = Hair { ior: self.relative_index(object, AMBER)?, ..Hair::default() };
        if object.has("sigma_a") {
            let scale = self.constant(object, "scale")?.map_or(1.0, |c| c.luminance());
            let sigma_a = self.color(object, "sigma_a", 0.0)?;
            kind.sigma_a = ColorParam { factor: sigma_a.factor * scale, ..sigma_a };
            if object.has("eumelanin") || object.has("pheomelanin") {
                return Err(
                    object.fault("both sigma_a and pigments are given", "remove one of them")
                );
            }
        } else {
            object.get("scale");
            kind.eumelanin = self.scalar(object, "eumelanin", 1.3)?;
            kind.pheomelanin = self.scalar(object, "pheomelanin", 0.2)?;
        }
        kind.longitudinal_roughness = self.scalar(object, "longitudinal_roughness", 0.3)?;
        kind.azimuthal_roughness = self.scalar(object, "azimuthal_roughness", 0.3)?;
        kind.scale_tilt = object.float_or("scale_tilt", 2.0)? as f32;
        Ok(Material::new("", kind))
    }

    /// A clear coat on a metal or a diffuse surface.
    fn coating(&mut self, object: &Object) -> Result<Look, Fault> {
        let ior = self.relative_index(object, GLASS)?;
        let (roughness, microfacets) = (self.even_roughness(object)?, self.microfacets(object)?);
        self.expect_white(object, "specular_reflectance")?;
        for name in ["thickness", "sigma_a"] {
            if object.get(name).is_some() {
                let owner = object.owner();
                self.note(format!("{owner} {name}"), object.at, || {
                    format!("{owner}: \"{name}\" was ignored: the layer is clear")
                });
            }
        }
        let mut look = self.inner_bsdf(object)?;
        for layer in &mut look.layers {
            let kind: Option<MaterialKind> = match &layer.kind {
                MaterialKind::Diffuse(body) => Some(
                    CoatedDiffuse { reflectance: body.reflectance, ior, roughness, microfacets }
                        .into(),
                ),
                MaterialKind::Conductor(conductor) => {
                    if microfacets != MicrofacetShape::Ggx {
                        let owner = object.owner();
                        self.note("distribution of coats", object.at, || {
                            format!(
                                "{owner}: microfacets by Beckmann; GGX of the same width was \
                                used, whose highlights have wider tails"
                            )
                        });
                    }
                    Some(CoatedConductor { conductor: conductor.clone(), ior, roughness }.into())
                }
                _ => None,
            };
            match kind {
                Some(kind) => layer.kind = kind,
                None => {
                    let owner = object.owner();
                    self.note(owner.clone(), object.at, || {
                        format!(
                            "{owner}: only diffuse surfaces and metals can be coated; the coat \
                            was left off"
                        )
                    });
                }
            }
        }
        Ok(look)
    }
}

fn root(alpha: f32) -> f32 {
    alpha.max(0.0).sqrt()
}
