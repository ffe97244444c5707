//! The class `Medium`.

use crate::declare::Family;
use crate::said::{Declared, declared_class};
use crate::tree::Tree;
use pyo3::prelude::*;
use snell_scene::medium::Medium as Value;

declared_class! {
    /// What light meets between surfaces: fog, smoke, milk. It fills the inside of a closed surface, as the `interior` of its material, or all of the
    /// scene, as :attr:`Scene.medium`.
    ///
    /// Parameters
    /// ----------
    /// kind : str
    ///     One of :data:`MEDIA`, such as `"homogeneous"`.
    /// **parameters
    ///     Those of the kind. Coefficients are per unit of length of the scene.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> milk = snell.Medium("homogeneous", sigma_a=0.1, sigma_s=(5, 5, 4.8))
    /// >>> glass = snell.Material("dielectric", ior=1.5, interior=milk)
    Medium of Value, restored by _restore_medium;

    /// The same medium but for some parameters.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> fog = snell.Medium("homogeneous", sigma_s=0.1)
    /// >>> fog.replace(g=0.5).g
    /// 0.5
    replace
}

impl Declared for Value {
    fn family() -> Family {
        // Those that can be said wholly.
        let is_whole = |example: &Value| {
            let again = serde_json::to_string(example).and_then(|json| serde_json::from_str::<Value>(&json));
            again.is_ok_and(|again| again == *example)
        };
        let examples = Self::examples().into_iter().filter(is_whole);
        Family {
            name: "medium",
            tag: "medium",
            examples: examples.filter_map(|example| Tree::of(&example).ok()).collect(),
        }
    }
}
