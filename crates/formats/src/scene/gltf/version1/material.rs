//! Materials of glTF 1.0: the values of techniques, or of `KHR_materials_common`.

use super::{CONVERTED, Converter, Object};
use serde_json::{Value, json};
use snell_math::real;
use snell_math::spectrum::srgb_to_linear;
use std::collections::BTreeMap;

/// States of WebGL that a technique may enable.
const BLEND: u64 = 3042;
const CULL_FACE: u64 = 2884;

impl Converter<'_> {
    /// A material of glTF 2 with the values of one of glTF 1.
    pub fn material(&mut self, old: &Object) -> Object {
        let common = old.get("extensions").and_then(|e| e.get(CONVERTED[1]));
        let id = old.get("technique").and_then(Value::as_str).unwrap_or_default();
        let technique = self.old.get("techniques").and_then(|t| t.get(id));
        let parameters = technique.and_then(|t| t.get("parameters")).and_then(Value::as_object);
        let mut values = BTreeMap::new();
        for (name, parameter) in parameters.into_iter().flatten() {
            if let (Some(meaning), Some(value)) = (meaning(name), parameter.get("value")) {
                values.insert(meaning, value);
            }
        }
        let own = common.map_or_else(|| old.get("values"), |common| common.get("values"));
        let mut unknown = Vec::new();
        for (name, value) in own.and_then(Value::as_object).into_iter().flatten() {
            match meaning(name) {
                Some(meaning) => _ = values.insert(meaning, value),
                None => unknown.push(name.as_str()),
            }
        }
        let name = old.get("name").and_then(Value::as_str).unwrap_or_default();
        if technique.is_some() && !unknown.is_empty() {
            let unknown = unknown.join(", ");
            self.warn(format!(
                "material \"{name}\": its shaders are not run, and these values are not used: \
                    {unknown}"
            ));
        }
        let state = |number: u64| {
            let states = technique.and_then(|t| t.pointer("/states/enable"))?.as_array()?;
            Some(states.iter().any(|state| state.as_u64() == Some(number)))
        };
        let flag = |key: &str| {
            let value = common.and_then(|c| c.get(key).or_else(|| c.get("values")?.get(key)));
            value.and_then(Value::as_bool)
        };
        let double_sided = flag("doubleSided").or(state(CULL_FACE).map(|culls| !culls));
        let blends = flag("transparent").or(state(BLEND)).unwrap_or(false);
        let transparency =
            values.get("transparency").and_then(|v| single(v).as_f64()).unwrap_or(1.0);
        let is_constant = common.and_then(|c| c.get("technique")) == Some(&"CONSTANT".into());
        let order: &[&str] =
            if is_constant { &["emission", "ambient", "diffuse"] } else { &["diffuse"] };
        let base = order.iter().find_map(|key| values.get(*key));
        let (mut factor, texture) = self.color(base.copied());
        factor[3] *= transparency.clamp(0.0, 1.0);
        let (specular, specular_texture) = self.color(values.get("specular").copied());
        // The strength of a highlight, where glTF 2.0 has the reflectance at normal incidence. That
        // of plastics and paints is a twenty-fifth.
        let specular = specular.map(|c| 0.04 * c);
        let has_specular = values.contains_key("specular");
        let shininess = values.get("shininess").and_then(|v| single(v).as_f64()).unwrap_or(0.0);
        // The width of a lobe of microfacets that is as wide as Blinn's is the square of this.
        let roughness = real::powf(2.0 / (shininess.max(0.0) + 2.0), 0.25);
        let mut surface = json!({
            "diffuseFactor": factor,
            "specularFactor": if has_specular { &specular[..3] } else { &[0.0; 3] },
            "glossinessFactor": 1.0 - roughness,
        });
        let mut new = json!({
            "name": name,
            "doubleSided": double_sided.unwrap_or(true),
            "alphaMode": if blends || factor[3] < 1.0 { "BLEND" } else { "OPAQUE" },
        });
        if let Some(texture) = texture {
            surface["diffuseTexture"] = json!({ "index": texture });
        }
        if let Some(texture) = specular_texture {
            surface["specularGlossinessTexture"] = json!({ "index": texture });
        }
        new["extensions"] = json!({ "KHR_materials_pbrSpecularGlossiness": surface });
        if is_constant {
            new["extensions"]["KHR_materials_unlit"] = json!({});
        } else if let Some(&emission) = values.get("emission") {
            let (factor, texture) = self.color(Some(emission));
            new["emissiveFactor"] = json!(factor[..3]);
            if let Some(texture) = texture {
                new["emissiveTexture"] = json!({ "index": texture });
            }
        }
        new.as_object().cloned().unwrap_or_default()
    }

    /// The factor and the texture of a value: a colour as it is displayed, or the id of a texture.
    fn color(&self, value: Option<&Value>) -> ([f64; 4], Option<Value>) {
        let Some(value) = value else { return ([1.0; 4], None) };
        if single(value).is_string() {
            return ([1.0; 4], Some(self.number("textures", single(value))));
        }
        let linear = |c: f64| f64::from(srgb_to_linear(c.clamp(0.0, 1.0) as f32));
        let mut factor = [1.0; 4];
        let numbers = value.as_array().into_iter().flatten().filter_map(Value::as_f64);
        for (i, (to, number)) in factor.iter_mut().zip(numbers).enumerate() {
            *to = if i < 3 { linear(number) } else { number.clamp(0.0, 1.0) };
        }
        (factor, None)
    }
}

/// The only element of an array; any other value itself.
fn single(value: &Value) -> &Value {
    match value.as_array().map(Vec::as_slice) {
        Some([only]) => only,
        _ => value,
    }
}

/// What a parameter of a technique means, by its name.
fn meaning(name: &str) -> Option<&'static str> {
    let name = name.to_lowercase();
    let name = name.strip_prefix("u_").unwrap_or(&name);
    let ends = ["texture", "_tex", "tex", "color", "_mat", "_"];
    let name = ends.iter().fold(name, |name, end| name.strip_suffix(end).unwrap_or(name));
    Some(match name {
        "diffuse" | "base" | "" => "diffuse",
        "emission" | "emissive" => "emission",
        "ambient" => "ambient",
        "specular" => "specular",
        "shininess" => "shininess",
        "transparency" => "transparency",
        _ => return None,
    })
}
