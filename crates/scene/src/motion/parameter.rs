//! Animated parameters, such as colours, strengths and angles of view.

use super::Curve;
use crate::texture::Texture;
use crate::{Scene, overrides};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a parameter belongs to, by position in the scene's table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Owner {
    /// A material.
    Material(usize),
    /// A texture.
    Texture(usize),
    /// A light.
    Light(usize),
    /// A camera.
    Camera(usize),
}

/// A parameter of the scene with its values over time.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterTrack {
    /// What the parameter belongs to.
    pub owner: Owner,
    /// The path of the parameter in the syntax of [`overrides`]: `base_color.factor`,
    /// `projection.tan_half_fov.1`.
    pub path: String,
    /// The parameter's numbers: one, three for a colour, six for the transform of texture
    /// coordinates.
    pub curve: Curve,
}

impl ParameterTrack {
    /// Sets the parameter of the scene to these numbers. Invalid ones are ignored, because a file
    /// may contain anything.
    pub(super) fn set(&self, scene: &mut Scene, numbers: &[f64]) {
        let number = |x: f64| serde_json::Number::from_f64(x).map_or(Value::Null, Value::Number);
        let value = match numbers {
            [one] => number(*one),
            many => Value::Array(many.iter().map(|x| number(*x)).collect()),
        };
        let _ = match self.owner {
            Owner::Texture(i) => {
                if let (Some(texture), "uv_transform", &[a, b, c, d, e, f]) = (
                    scene.textures.get_mut(i).and_then(Texture::as_image_mut),
                    self.path.as_str(),
                    numbers,
                ) {
                    texture.uv_transform = [[a, b, c], [d, e, f]].map(|row| row.map(|x| x as f32));
                }
                Ok(())
            }
            Owner::Material(i) => overrides::set_material(scene, i, &self.path, value),
            Owner::Light(i) => overrides::set_light(scene, i, &self.path, value),
            Owner::Camera(i) => overrides::set_camera(scene, i, &self.path, value),
        };
    }
}
