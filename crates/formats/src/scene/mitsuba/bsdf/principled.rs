//! The principled BSDF (Burley's of 2012 and 2015, as Mitsuba has it) as an OpenPBR surface.

use super::super::Builder;
use super::super::object::Object;
use super::super::texture::Pattern;
use super::Look;
use crate::scene::fault::Fault;
use crate::scene::layers;
use crate::scene::metal::Roughness;
use snell_math::Rgb;
use snell_scene::Material;
use snell_scene::bsdf::fresnel;
use snell_scene::material::{ColorParam, OpenPbr, ScalarParam};

/// Weight of OpenPBR's fuzz that reflects as much diffuse light as a sheen of 1, which is 1.2 %.
const SHEEN: f32 = 0.06;

/// A share of the surface that is too small to be seen.
const ALMOST_NOTHING: f32 = 1e-6;

/// The mean of a scalar parameter, roughly if it has a texture.
fn mean_of(parameter: ScalarParam) -> f32 {
    let texels = if parameter.texture.is_some() { 0.5 } else { 1.0 };
    (parameter.factor * texels).clamp(0.0, 1.0)
}

/// What the diffuse body of the principled model reflects over what OpenPBR's body does under a
/// gloss of this index: the mean of this ratio for diffuse light and for light along the normal.
/// Burley's body gets light that the gloss reflects, too, and gives some back towards the light,
/// the more so the rougher it is.
fn body_brightness(roughness: f32, ior: f32) -> f32 {
    let diffuse = (0.953 + 0.112 * roughness) / (1.0 - fresnel::dielectric_average(ior));
    let straight = (0.976 + 0.057 * roughness) / (1.0 - fresnel::f0_from_ior(ior));
    0.5 * (diffuse + straight)
}

/// The index of a sheet whose faces together reflect along the normal what one face of this index
/// does.
fn index_of_one_face(ior: f32) -> f32 {
    let f0 = fresnel::f0_from_ior(ior);
    let root = (f0 / (2.0 - f0)).sqrt();
    (1.0 + root) / (1.0 - root)
}

/// A surface that is clear in part. From inside, the principled model lets through only this part
/// of the light, and absorbs the rest; OpenPBR lets through all. So the clear part is a layer of
/// its own on one that is black from inside: it lets almost nothing in, but has an inside.
fn partly_clear(kind: OpenPbr) -> Look {
    let (clear, metal) = (kind.transmission_weight, kind.base_metalness);
    let is_part = clear.texture.is_some() || (clear.factor > 0.0 && clear.factor < 1.0);
    let metal_share = metal.factor.clamp(0.0, 1.0);
    if !is_part || (metal_share > 0.0 && (metal.texture.is_some() || clear.texture.is_some())) {
        return Look::of(Material::new("", kind));
    }
    let share = ScalarParam { factor: clear.factor * (1.0 - metal_share), ..clear };
    let metal_of_rest =
        if share.texture.is_some() { 0.0 } else { metal_share / (1.0 - share.factor) };
    let top =
        OpenPbr { base_metalness: 0.0.into(), transmission_weight: 1.0.into(), ..kind.clone() };
    let rest = OpenPbr {
        base_metalness: metal_of_rest.min(1.0).into(),
        transmission_weight: ALMOST_NOTHING.into(),
        transmission_color: Rgb::BLACK.into(),
        ..kind
    };
    let part = |kind: OpenPbr| vec![Material::new("", kind)];
    Look { layers: layers::blend(part(top), part(rest), share), ..Look::default() }
}

impl Builder<'_> {
    pub(super) fn principled(&mut self, object: &Object) -> Result<Look, Fault> {
        let is_thin = object.kind == "principledthin";
        let base_color = self.color(object, "base_color", 0.5)?;
        let transmission_weight = self.scalar(object, "spec_trans", 0.0)?;
        let ior = if object.has("eta") {
            object.float_within("eta", 1.5, [1e-3, 1e3])? as f32
        } else {
            // The reflectance at normal incidence is this share of 8 %.
            let f0: f32 = 0.08 * object.float_within("specular", 0.5, [0.0, 1.0])? as f32;
            (1.0 + f0.sqrt()) / (1.0 - f0.sqrt())
        };
        // Light crosses two surfaces of a solid; each gets the square root of the colour.
        let mut transmission_color = base_color;
        if !is_thin && base_color.texture.is_none() {
            transmission_color.factor = base_color.factor.map(|c| c.max(0.0).sqrt());
        }
        // The clear coat of the principled model is a quarter as strong as glass, and its gloss
        // maps to a width from 0.1 to 0.001.
        let coat = self.scalar(object, "clearcoat", 0.0)?;
        let gloss = self.scalar(object, "clearcoat_gloss", 0.0)?.factor.clamp(0.0, 1.0);
        let [roughness, anisotropy] = self.principled_roughness(object)?;
        let metalness = self.scalar(object, "metallic", 0.0)?;
        let sheen = self.scalar(object, "sheen", 0.0)?;
        let body = body_brightness(mean_of(roughness), if is_thin { 1.0 } else { ior.max(1.0) });
        // The colour is also that of the metal, which needs no change.
        let metal =
            if metalness.texture.is_none() { metalness.factor.clamp(0.0, 1.0) } else { 0.0 };
        let body = 1.0 + (body - 1.0) * (1.0 - metal);
        let most = base_color.factor.max_element().max(1e-6);
        let base_color =
            ColorParam { factor: base_color.factor * body.min(1.0 / most).max(0.0), ..base_color };
        let kind = OpenPbr {
            base_color,
            base_metalness: metalness,
            specular_roughness: roughness,
            specular_roughness_anisotropy: anisotropy,
            specular_ior: ior.into(),
            transmission_weight,
            transmission_color,
            coat_weight: ScalarParam { factor: 0.25 * coat.factor, ..coat },
            coat_roughness: (0.1 + (0.001 - 0.1) * gloss).sqrt().into(),
            coat_ior: 1.5.into(),
            coat_darkening: 0.0.into(),
            fuzz_weight: ScalarParam { factor: (SHEEN * sheen.factor).min(1.0), ..sheen },
            geometry_thin_walled: is_thin,
            ..OpenPbr::default()
        };
        self.note_approximations(object)?;
        if !is_thin {
            return Ok(partly_clear(kind));
        }
        // The diffuse part of a thin surface has no gloss. The transmitted share of its light is
        // half of it for a value of 1.
        let through = self.scalar(object, "diff_trans", 0.0)?;
        let matte = OpenPbr {
            specular_weight: 0.0.into(),
            transmission_weight: 0.0.into(),
            subsurface_weight: ScalarParam { factor: 0.5 * through.factor, ..through },
            subsurface_color: base_color,
            subsurface_scatter_anisotropy: 1.0.into(),
            ..kind.clone()
        };
        let clear = OpenPbr {
            specular_ior: index_of_one_face(ior).into(),
            transmission_weight: 1.0.into(),
            fuzz_weight: 0.0.into(),
            ..kind.clone()
        };
        let part = |kind: OpenPbr| vec![Material::new("", kind)];
        let layers = layers::blend(part(clear), part(matte), kind.transmission_weight);
        Ok(Look { layers, ..Look::default() })
    }

    /// Roughness and anisotropy: the widths along and across are `r² / aspect` and `r² aspect`
    /// with `aspect = sqrt(1 - 0.9 anisotropic)`.
    fn principled_roughness(&mut self, object: &Object) -> Result<[ScalarParam; 2], Fault> {
        let roughness = self.number_pattern(object, "roughness")?;
        let anisotropic = self.number_pattern(object, "anisotropic")?;
        let constant = |x: f32| Pattern::Constant(Rgb::splat(x).into());
        let roughness = roughness.unwrap_or_else(|| constant(0.5));
        let of_widths = |r: f32, anisotropic: f32| {
            let aspect = (1.0 - 0.9 * anisotropic.clamp(0.0, 1.0)).sqrt();
            let widths = [r * r / aspect, r * r * aspect].map(|width| width.clamp(0.0, 1.0));
            match Roughness::of_widths(widths[0], widths[1]) {
                Roughness::Even(roughness) => [roughness.factor, 0.0],
                Roughness::Stretched { roughness, anisotropy } => {
                    [roughness.factor, anisotropy.factor]
                }
            }
        };
        let Some(anisotropic) = anisotropic else {
            return Ok([self.scalar(object, "roughness", 0.5)?, 0.0.into()]);
        };
        if let Some(both) =
            self.numbers_of_both(object, [&roughness, &anisotropic], "principled", of_widths)
        {
            return Ok(both);
        }
        Ok([
            self.scalar(object, "roughness", 0.5)?,
            self.mapped(object, "anisotropic", 0.0, Some(|anisotropic| 0.9 * anisotropic))?,
        ])
    }

    /// Notes parameters without a counterpart, and those that look slightly different.
    fn note_approximations(&mut self, object: &Object) -> Result<(), Fault> {
        let owner = object.owner();
        for name in ["spec_tint", "sheen_tint", "flatness"] {
            let value = self.scalar(object, name, 0.0)?;
            if value.factor != 0.0 {
                self.note(format!("{owner} {name}"), object.at, || {
                    format!("{owner}: \"{name}\" was ignored: OpenPBR has no such parameter")
                });
            }
        }
        for name in ["sheen", "clearcoat"] {
            if self.scalar(object, name, 0.0)?.factor != 0.0 {
                self.note(format!("{owner} {name}"), object.at, || {
                    format!(
                        "{owner}: \"{name}\" became that of OpenPBR, which looks slightly different"
                    )
                });
            }
        }
        for name in [
            "diffuse_reflectance_sampling_rate",
            "specular_sampling_rate",
            "clearcoat_sampling_rate",
        ] {
            object.get(name);
        }
        Ok(())
    }
}
