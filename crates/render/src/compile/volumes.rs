//! The media of a scene, and the materials that bound them.

use super::CompileError;
use crate::light_sampler::{LightSummary, LightTable};
use snell_scene::material::Interior;
use snell_scene::medium::{
    Cloud, EquiangularLight, Glow, Grid, HeightFog, Homogeneous, Medium, PreparedMedium,
};
use snell_scene::{Material, MaterialId, MediumId, Scene, SceneError};

/// The media of a scene and the surfaces that bound them. Scenes without media have no table, so
/// they pay nothing.
#[derive(Debug)]
pub struct VolumeTable {
    media: Vec<PreparedMedium>,
    /// By medium: whether it scatters light.
    scatters: Vec<bool>,
    /// The medium outside of all interiors.
    pub everywhere: Option<MediumId>,
    boundaries: Vec<Option<Boundary>>,
    /// True if rays may pass some surfaces without being scattered.
    pub has_passable: bool,
    /// True if rays through media hit every surface: none is cut out, blended or single-sided.
    pub sees_all: bool,
    /// True if priorities may hide surfaces inside of other interiors.
    pub has_priorities: bool,
    /// The lights for equiangular sampling; `None` if all lights are at infinity.
    pub equiangular_lights: Option<EquiangularLights>,
}

/// The lights of a scene for equiangular sampling. One is chosen in proportion to power.
#[derive(Debug)]
pub struct EquiangularLights {
    table: LightTable,
    /// The place of each light, as equiangular sampling needs it; `None` for lights at infinity.
    equiangular_lights: Vec<Option<EquiangularLight>>,
}

impl EquiangularLights {
    /// Collects the places of the lights; `None` if all are at infinity.
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

    /// Chooses a light; `None` if it is at infinity. `u` returns a uniform number and is called
    /// only if there is a choice.
    pub fn sample(&self, u: impl FnOnce() -> f32) -> Option<EquiangularLight> {
        self.equiangular_lights[self.table.sample(u)?.light]
    }
}

/// A surface that bounds an interior.
#[derive(Clone, Copy, Debug)]
pub struct Boundary {
    /// What is inside.
    pub interior: Interior,
    /// True if light passes the surface without being scattered.
    pub is_interface: bool,
    /// Index of refraction of the interior.
    pub ior: f32,
}

impl VolumeTable {
    /// Makes the table; `None` if the scene has no media or interfaces, so that light travels
    /// through vacuum.
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
            scatters: scene.media.iter().map(scatters).collect(),
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

    /// True if a medium of the scene scatters light.
    pub fn scatters(&self, id: MediumId) -> bool {
        self.scatters[id.index()]
    }

    /// The media that occur in the scene and whose emission can be sampled.
    pub fn glows(&self) -> impl Iterator<Item = (MediumId, Glow)> {
        let is_used = |id: MediumId| {
            self.everywhere == Some(id)
                || self.boundaries.iter().flatten().any(|b| b.interior.medium == Some(id))
        };
        let ids = (0..self.media.len() as u32).map(MediumId).filter(move |&id| is_used(id));
        ids.filter_map(|id| Some((id, self.medium(id).glow()?)))
    }

    /// True if the transmittance of all media has a closed form.
    pub fn is_in_closed_form(&self) -> bool {
        self.media.iter().all(PreparedMedium::is_in_closed_form)
    }

    /// The interior that surfaces of a material bound, if they bound one.
    pub fn boundary(&self, material: MaterialId) -> Option<&Boundary> {
        self.boundaries[material.index()].as_ref()
    }
}

/// True if a medium scatters light.
fn scatters(medium: &Medium) -> bool {
    let (Medium::Homogeneous(Homogeneous { sigma_s, .. })
    | Medium::HeightFog(HeightFog { sigma_s, .. })
    | Medium::Grid(Grid { sigma_s, .. })
    | Medium::Cloud(Cloud { sigma_s, .. })) = medium;
    sigma_s.r > 0.0 || sigma_s.g > 0.0 || sigma_s.b > 0.0
}
