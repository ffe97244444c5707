//! Features of pbrt-v3 that pbrt-v4 changed.

use super::Builder;
use super::material::{Known, lit_below};
use super::options::is_kind;
use super::params::Params;
use super::spectrum::COPPER;
use super::texture::Pattern;
use crate::scene::fault::Fault;
use snell_math::Rgb;
use snell_math::real;
use snell_scene::Material;
use snell_scene::material::{
    Conductor, ConductorSpectrum, Dielectric, Diffuse, MetallicRoughness, Mirror, OpenPbr, Plastic,
    ScalarParam,
};

/// Width of the microfacet distribution for a roughness of pbrt-v3.
pub fn alpha_of_roughness(roughness: f32) -> f32 {
    let x = real::ln(roughness.max(1e-3));
    1.62142 + x * (0.819955 + x * (0.1734 + x * (0.0171201 + x * 0.000640711)))
}

/// A material of pbrt-v3; `None` if pbrt-v3 has none of this name.
pub fn material(builder: &mut Builder, params: &Params) -> Result<Option<Known>, Fault> {
    let kind = |kind: &str| is_kind(params, kind);
    let was_v3 = std::mem::replace(&mut builder.is_v3, true);
    let mut opacity = None;
    let built = if kind("matte") {
        let reflectance = builder.material_color(params, "Kd", 0.5)?;
        // Oren and Nayar's standard deviation of the slopes, in degrees; 1 is OpenPBR's maximum
        // roughness.
        let sigma = builder
            .pattern_param(params, "sigma", false)?
            .and_then(|p| p.as_constant())
            .map_or(0.0, |c| c.r);
        match sigma.to_radians().clamp(0.0, 1.0) {
            0.0 => Material::new("", Diffuse { reflectance }),
            roughness => Material::new(
                "",
                OpenPbr {
                    base_color: reflectance,
                    base_diffuse_roughness: roughness.into(),
                    specular_weight: 0.0.into(),
                    ..OpenPbr::default()
                },
            ),
        }
    } else if kind("plastic") {
        plastic(builder, params, 0.25, 0.25, 0.1)?
    } else if kind("substrate") {
        plastic(builder, params, 0.5, 0.5, 0.1)?
    } else if kind("uber") {
        opacity = builder.pattern_param(params, "opacity", true)?;
        let named = if params.has("eta") { "eta" } else { "index" };
        let ior = builder.index(params, named)?;
        warn_of_parts(builder, params, &["Kr", "Kt"]);
        let base = plastic(builder, params, 0.25, 0.25, 0.1)?;
        with_ior(base, ior)
    } else if kind("mirror") {
        let Some(reflectance) = builder.pattern_param(params, "Kr", true)? else {
            let mirror = Material::new("", Mirror { reflectance: Rgb::splat(0.9).into() });
            return Ok(Some(Known { layers: vec![mirror], opacity: None }));
        };
        Material::new("", Mirror { reflectance: builder.color_param(&reflectance) })
    } else if kind("metal") {
        let roughness = builder.roughness(params, "", 0.01)?;
        let get = |builder: &mut Builder, name: &str, copper: Rgb| -> Result<Rgb, Fault> {
            let pattern = builder.pattern_param(params, name, true)?;
            let constant = pattern.as_ref().and_then(|p| p.as_constant());
            if pattern.is_some() && constant.is_none() {
                builder.note("textured metal", params.at, || {
                    "a texture as the index of a metal: copper was used instead".into()
                });
            }
            Ok(constant.unwrap_or(copper))
        };
        let eta = get(builder, "eta", COPPER[0])?;
        let k = get(builder, "k", COPPER[1])?;
        Material::new("", Conductor::new(ConductorSpectrum::Measured { eta, k }, roughness))
    } else if kind("glass") {
        let named = if params.has("eta") { "eta" } else { "index" };
        let ior = builder.index(params, named)?;
        let tint = builder.material_color(params, "Kt", 1.0)?;
        let reflected = builder.material_color(params, "Kr", 1.0)?;
        if reflected.factor != Rgb::WHITE || reflected.texture.is_some() {
            let owner = params.owner.clone();
            builder.note(format!("{owner} Kr"), params.at, || {
                format!("{owner}: \"Kr\" was ignored: it reflects by Fresnel's law alone")
            });
        }
        let roughness = builder.roughness(params, "", 0.0)?;
        Material::new("", Dielectric { roughness, tint, ..Dielectric::smooth(ior) })
    } else if kind("translucent") {
        warn_of_parts(builder, params, &["transmit"]);
        plastic(builder, params, 0.25, 0.25, 0.1)?
    } else if kind("disney") {
        disney(builder, params)?
    } else if kind("kdsubsurface") {
        let color = builder.material_color(params, "Kd", 0.5)?;
        let mfp = builder
            .pattern_param(params, "mfp", true)?
            .and_then(|p| p.as_constant())
            .unwrap_or(Rgb::WHITE);
        let scale = params.float_or("scale", 1.0)? as f32;
        let ior = if params.has("eta") { builder.index(params, "eta")? } else { 1.33 };
        let roughness = builder.roughness(params, "", 0.0)?;
        warn_of_parts(builder, params, &["Kr", "Kt"]);
        lit_below(
            color,
            mfp * scale,
            params.float_or("g", 0.0)?.clamp(-0.99, 0.99) as f32,
            ior,
            roughness,
        )
    } else if kind("mix") {
        return v3_mix(builder, params);
    } else {
        builder.is_v3 = was_v3;
        return Ok(None);
    };
    Ok(Some(Known { layers: vec![built], opacity }))
}

/// A diffuse base of `Kd` under a layer that reflects `Ks`.
fn plastic(
    builder: &mut Builder,
    params: &Params,
    kd: f32,
    ks: f32,
    roughness: f32,
) -> Result<Material, Fault> {
    let diffuse = builder.material_color(params, "Kd", kd)?;
    let specular = builder.material_color(params, "Ks", ks)?;
    let alpha = alpha_of_roughness(roughness);
    let given = ["roughness", "uroughness", "vroughness"].into_iter().any(|name| params.has(name));
    let read = builder.roughness(params, "", roughness)?;
    let roughness = if given { read } else { ScalarParam::constant(alpha.sqrt()) };
    Ok(Material::new("", Plastic { specular, roughness, ..Plastic::new(diffuse, 0.0) }))
}

fn with_ior(mut material: Material, ior: f32) -> Material {
    if let snell_scene::material::MaterialKind::Plastic(plastic) = &mut material.kind {
        plastic.ior = ior;
    }
    material
}

fn warn_of_parts(builder: &mut Builder, params: &Params, names: &[&str]) {
    let given = names.iter().any(|name| params.get(name).is_some());
    if given {
        let owner = params.owner.clone();
        builder.note(owner.clone(), params.at, || {
            format!("{owner} of pbrt-v3: mirror reflection and transmission were left out")
        });
    }
}

fn disney(builder: &mut Builder, params: &Params) -> Result<Material, Fault> {
    let get = |builder: &mut Builder, name: &str, default: f32| -> Result<ScalarParam, Fault> {
        let pattern = builder
            .pattern_param(params, name, false)?
            .unwrap_or_else(|| Pattern::constant(default));
        Ok(builder.scalar_param(&pattern))
    };
    let kind = MetallicRoughness {
        base_color: builder.material_color(params, "color", 0.5)?,
        metallic: get(builder, "metallic", 0.0)?,
        roughness: get(builder, "roughness", 0.5)?,
        ior: builder.index(params, "eta")?,
        clearcoat: get(builder, "clearcoat", 0.0)?,
        transmission: get(builder, "spectrans", 0.0)?,
        ..MetallicRoughness::default()
    };
    let parts = [
        "anisotropic",
        "speculartint",
        "sheen",
        "sheentint",
        "clearcoatgloss",
        "scatterdistance",
        "thin",
        "difftrans",
        "flatness",
    ];
    builder.note_ignored(params, &parts, "the material became a metallic-roughness one");
    Ok(Material::new("", kind))
}

/// A mix of two named materials by `amount`, the share of the first.
fn v3_mix(builder: &mut Builder, params: &Params) -> Result<Option<Known>, Fault> {
    let (first, second) = (params.string("namedmaterial1")?, params.string("namedmaterial2")?);
    let (Some(first), Some(second)) = (first, second) else {
        return Err(
            params.fault("there are not two materials", "give namedmaterial1 and namedmaterial2")
        );
    };
    let amount =
        builder.pattern_param(params, "amount", true)?.unwrap_or_else(|| Pattern::constant(0.5));
    // In pbrt-v4's order, the amount is the share of the second material.
    let [first, second] =
        [builder.find_material(first, params.at), builder.find_material(second, params.at)];
    Ok(Some(builder.mixed([second, first], &amount, params, params.at)))
}
