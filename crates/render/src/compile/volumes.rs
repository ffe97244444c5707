//! Which media there are, and which materials bound them.

use super::CompileError;
use crate::light_sampler::{LightSummary, LightTable};
use snell_scene::material::Interior;
use snell_scene::medium::{EquiangularLight, Glow, PreparedMedium};
use snell_scene::{Material, MaterialId, MediumId, Scene, SceneError};

/// The media of a scene and the surfaces that bound them. A scene without has none of this, and
/// pays nothing for it.
#[derive(Debug)]
pub struct VolumeTable {
    media: Vec<PreparedMedium>,
    /// What is where no inside is.
    pub everywhere: Option<MediumId>,
    boundaries: Vec<Option<Boundary>>,
    /// True if rays may pass some surfaces as if they were not there.
    pub has_passable: bool,
    /// True if rays through media meet every surface: none is cut out, blended or single-sided.
    pub sees_all: bool,
    /// True if insides may hide surfaces of others.
    pub has_priorities: bool,
    /// Where light comes from, if it comes from anywhere near.
    pub equiangular_lights: Option<EquiangularLights>,
}

/// The lights of a scene as media see them from far: one is chosen in proportion to power.
#[derive(Debug)]
pub struct EquiangularLights {
    table: LightTable,
    /// `None` for light that comes from nowhere near.
    equiangular_lights: Vec<Option<EquiangularLight>>,
}

impl EquiangularLights {
    /// `None` if no light has a place.
    pub fn new(lights: &[LightSummary]) -> Option<Self> {
        let equiangular_light = |light: &LightSummary| {
            let bounds = light.parts.iter().map(|part| part.bounds).reduce(|a, b| a.union(&b))?;
            let equiangular_light = EquiangularLight {
                center: bounds.center().as_vec3(),
                radius: (0.5 * (bounds.max - bounds.min).max_element()) as f32,
            };
            (equiangular_light.center.is_finite() && equiangular_light.radius.is_finite())
                .then_some(equiangular_light)
        };
        let equiangular_lights: Vec<_> = lights.iter().map(equiangular_light).collect();
        let powers: Vec<f64> = lights.iter().map(|light| light.power).collect();
        equiangular_lights
            .iter()
            .any(Option::is_some)
            .then(|| Self { table: LightTable::new(&powers), equiangular_lights })
    }

    /// A equiangular_light, or none if light from far was chosen. `u` is asked for a uniform number
    /// if there is a choice.
    pub fn sample(&self, u: impl FnOnce() -> f32) -> Option<EquiangularLight> {
        self.equiangular_lights[self.table.sample(u)?.light]
    }
}

/// A surface that bounds an inside.
#[derive(Clone, Copy, Debug)]
pub struct Boundary {
    /// What is inside.
    pub interior: Interior,
    /// Light passes it as if it were not there.
    pub is_interface: bool,
    /// Index of refraction inside.
    pub ior: f32,
}

impl VolumeTable {
    /// `None` if the scene has no media or interfaces, so that light travels through vacuum.
    pub fn new(scene: &Scene, materials: &[Material]) -> Result<Option<Self>, CompileError> {
        let check = |id: Option<MediumId>, what: &str| match id {
            Some(id) if id.index() >= scene.media.len() => {
                let (what, count) = (what.to_string(), scene.media.len());
                Err(CompileError::Scene(SceneError::DanglingMedium { what, id: id.0, count }))
            }
            _ => Ok(()),
        };
        check(scene.medium, "the scene")?;
        for material in materials {
            check(
                material.interior.and_then(|i| i.medium),
                &format!("material \"{}\"", material.name),
            )?;
        }
        let says = |m: &Material| m.interior.is_some() || m.has_own_medium();
        if scene.medium.is_none() && !materials.iter().any(says) {
            return Ok(None);
        }
        let boundary = |m: &Material| {
            let interior = m.bounded_interior()?;
            Some(Boundary { interior, is_interface: m.is_interface(), ior: m.ior() })
        };
        let boundaries: Vec<_> = materials.iter().map(boundary).collect();
        let mut priorities = boundaries.iter().flatten().map(|b| b.interior.priority);
        let first = priorities.next();
        let has_priorities = priorities.any(|p| Some(p) != first);
        Ok(Some(Self {
            media: scene.media.iter().map(PreparedMedium::new).collect(),
            everywhere: scene.medium,
            has_passable: has_priorities || boundaries.iter().flatten().any(|b| b.is_interface),
            sees_all: materials.iter().all(|m| m.is_interface() || !m.needs_filter()),
            has_priorities,
            boundaries,
            equiangular_lights: None,
        }))
    }

    /// A medium of the scene.
    pub fn medium(&self, id: MediumId) -> &PreparedMedium {
        &self.media[id.index()]
    }

    /// The media that are anywhere and glow so that points of them can be sampled.
    pub fn glows(&self) -> impl Iterator<Item = (MediumId, Glow)> {
        let is_used = |id: MediumId| {
            self.everywhere == Some(id)
                || self.boundaries.iter().flatten().any(|b| b.interior.medium == Some(id))
        };
        let ids = (0..self.media.len() as u32).map(MediumId).filter(move |&id| is_used(id));
        ids.filter_map(|id| Some((id, self.medium(id).glow()?)))
    }

    /// True if no medium is expensive to pass.
    pub fn is_in_closed_form(&self) -> bool {
        self.media.iter().all(PreparedMedium::is_in_closed_form)
    }

    /// What a material bounds.
    pub fn boundary(&self, material: MaterialId) -> Option<&Boundary> {
        self.boundaries[material.index()].as_ref()
    }
}
