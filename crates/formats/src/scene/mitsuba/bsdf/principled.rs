//! The principled BSDF (Burley's of 2012 and 2015, as Mitsuba has it) as an OpenPBR surface.

use super::super::Builder;
use super::super::object::Object;
use crate::scene::fault::Fault;
use snell_scene::Material;
use snell_scene::material::{OpenPbr, ScalarParam};

impl Builder<'_> {
    pub(super) fn principled(&mut self, object: &Object) -> Result<Material, Fault> {
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
        let mut kind = OpenPbr {
            base_color,
            base_metalness: self.scalar(object, "metallic", 0.0)?,
            specular_roughness: self.scalar(object, "roughness", 0.5)?,
            specular_roughness_anisotropy: self.scalar(object, "anisotropic", 0.0)?,
            specular_ior: ior.into(),
            transmission_weight,
            transmission_color,
            coat_weight: ScalarParam { factor: 0.25 * coat.factor, ..coat },
            coat_roughness: (0.1 + (0.001 - 0.1) * gloss).sqrt().into(),
            coat_ior: 1.5.into(),
            coat_darkening: 0.0.into(),
            fuzz_weight: self.scalar(object, "sheen", 0.0)?,
            geometry_thin_walled: is_thin,
            ..OpenPbr::default()
        };
        if is_thin {
            // The transmitted share of diffuse light: half of it for a value of 1.
            let through = self.scalar(object, "diff_trans", 0.0)?;
            kind.subsurface_weight = (0.5 * through.factor).clamp(0.0, 1.0).into();
            kind.subsurface_color = base_color;
            kind.subsurface_scatter_anisotropy = 1.0.into();
        }
        self.note_approximations(object)?;
        Ok(Material::new("", kind))
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
