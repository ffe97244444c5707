//! The class `Material`.

use crate::declared::{Schema, declared_class};
use crate::value::Value;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use serde_json::{Map, Value as Json};
use snell_scene::material::OpenPbr;

declared_class! {
    /// A material: how a surface reflects, transmits and emits light.
    ///
    /// A colour is a number (grey), three numbers (linear Rec. 709), `"#rrggbb"` (sRGB) or a
    /// :class:`Texture`; a number may be a channel of a texture. A dictionary gives both:
    /// `{"factor": 0.5, "texture": texture}`. :data:`MATERIALS` lists the kinds and their
    /// parameters.
    ///
    /// Parameters
    /// ----------
    /// kind : str
    ///     One of :data:`MATERIALS`, such as `"diffuse"` or `"metallic-roughness"`.
    /// **parameters
    ///     The parameters of the kind, and those of all kinds: `name`, `emission` (radiance, W /
    ///     (m^2 sr)), `alpha`, `alpha_mode` (`"opaque"`, `"blend"`, `{"mask": cutoff}` or
    ///     `{"sheet": ior}`), `double_sided`, `normal_map` (a texture) and others. Emission,
    ///     opacity and normals of an `"open-pbr"` take precedence over the common parameters.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> red = snell.Material("diffuse", reflectance=(0.8, 0.1, 0.1))
    /// >>> red
    /// Material("diffuse", reflectance=(0.8, 0.1, 0.1))
    /// >>> red.replace(emission=2).emission
    /// (2.0, 2.0, 2.0)
    /// >>> snell.Material("difuse")
    /// Traceback (most recent call last):
    /// ValueError: there is no material "difuse"; did you mean "diffuse"?
    Material of snell_scene::Material, restored by _restore_material;

    /// A copy of the material with some parameters changed.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> gold = snell.Material("metallic-roughness", base_color=(1, 0.77, 0.34), metallic=1)
    /// >>> gold.replace(roughness=0.5).roughness
    /// 0.5
    replace
}

impl Schema for snell_scene::Material {
    const FAMILY: &'static str = "material";

    fn common() -> PyResult<Vec<(String, Value)>> {
        let bare = Self::new("", snell_scene::material::Diffuse::new(snell_math::Rgb::WHITE));
        let (_, common) = Self::apart(Value::of(&bare).map_err(PyTypeError::new_err)?);
        Ok(common)
    }

    fn assemble(kind: Map<String, Json>, mut common: Map<String, Json>) -> Json {
        common.insert("kind".into(), Json::Object(kind));
        Json::Object(common)
    }

    fn apart(value: Value) -> (Vec<(String, Value)>, Vec<(String, Value)>) {
        let Value::Fields(mut common) = value else { return Default::default() };
        let place = common.iter().position(|(key, _)| key == "kind");
        match place.map(|at| common.remove(at)) {
            Some((_, Value::Fields(kind))) => (kind, common),
            _ => (Vec::new(), common),
        }
    }

    /// Replaces emission, opacity and normals by those of an OpenPBR surface, where the surface
    /// sets them.
    fn settle(mut self) -> PyResult<Self> {
        self.follow_kind(&OpenPbr::default().into());
        Ok(self)
    }
}
