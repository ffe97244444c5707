//! The colours of surfaces at hits: the materials and textures of the scenes that hold the objects.

use crate::assemble::{Form, Snapshot, Surface};
use crate::precision::{Found, Precision};
use snell_intersect::{Geometry, Hit, interaction_on};
use snell_math::{DRay, Rgb, Transform, Vec2};
use snell_render::Albedos;
use snell_scene::Scene;
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

/// The stages of a scene and of the scenes instanced in it.
#[derive(Debug, Default)]
pub struct Palette {
    stages: Vec<Arc<Scene>>,
    /// The materials of each stage, and of no stage; prepared when they are first needed.
    albedos: OnceLock<Vec<Arc<Albedos>>>,
}

/// Prepared materials by stage, so that a scene that moves keeps them from snapshot to snapshot.
static PREPARED: Mutex<Vec<(Weak<Scene>, Arc<Albedos>)>> = Mutex::new(Vec::new());

impl Palette {
    /// The number of a stage, which is added if it is new.
    pub fn add(&mut self, stage: &Arc<Scene>) -> u32 {
        let known = self.stages.iter().position(|known| Arc::ptr_eq(known, stage));
        let at = known.unwrap_or_else(|| {
            self.stages.push(stage.clone());
            self.stages.len() - 1
        });
        at as u32
    }

    /// The materials of each stage. The caller holds the interpreter's lock.
    pub fn albedos(&self) -> &[Arc<Albedos>] {
        self.albedos.get_or_init(|| {
            let mut prepared = PREPARED.lock().unwrap_or_else(PoisonError::into_inner);
            prepared.retain(|(stage, _)| stage.strong_count() > 0);
            let albedos = self.stages.iter().map(|stage| {
                let is_same = |(known, _): &&(Weak<Scene>, _)| known.as_ptr() == Arc::as_ptr(stage);
                if let Some((_, known)) = prepared.iter().find(is_same) {
                    return known.clone();
                }
                let made = Arc::new(Albedos::new(stage));
                prepared.push((Arc::downgrade(stage), made.clone()));
                made
            });
            albedos.collect()
        })
    }
}

/// Computes colours at hits. It remembers the last occurrence and geometry, because consecutive
/// hits are often on one object.
pub struct Colors<'a, F: Form> {
    snapshot: &'a Snapshot<F>,
    albedos: &'a [Arc<Albedos>],
    /// Occurrence, geometry and time, with the surface and its place.
    last: Option<((u32, u32, f32), Geometry, Transform)>,
}

impl<'a, F: Form> Colors<'a, F> {
    /// Starts with nothing remembered.
    pub fn new(snapshot: &'a Snapshot<F>, albedos: &'a [Arc<Albedos>]) -> Self {
        Self { snapshot, albedos, last: None }
    }

    /// The albedo at the hit `found` of `ray`, which has this time of the world; black for a miss.
    /// From a ray without direction the surface is seen along its normal.
    pub fn at<P: Precision>(&mut self, ray: &DRay, time: f32, found: &Found<P>) -> Rgb {
        let &Found { t, uv, occurrence, geometry, primitive } = found;
        if geometry == Hit::NONE {
            return Rgb::BLACK;
        }
        let key = (occurrence, geometry, time);
        if !matches!(self.last, Some((last, ..)) if last == key) {
            let placed = F::placed(&self.snapshot.world, occurrence, time);
            self.last =
                self.painted(geometry).map(|(surface, own)| (key, surface, placed.compose(&own)));
        }
        let Some((_, surface, placed)) = &self.last else { return Rgb::BLACK };
        let mut uv = Vec2::from(uv.map(|x| Into::<f64>::into(x) as f32));
        // Mirrored meshes are queried with their second and third corner exchanged.
        if matches!(surface, Geometry::Mesh(_)) && self.is_turned(geometry) {
            uv = Vec2::new(uv.y, uv.x);
        }
        let t = Into::<f64>::into(t) as f32;
        let hit = Hit { t, uv, instance: occurrence, geometry, primitive };
        let interaction = interaction_on(surface, placed, ray, &hit);
        let away = (-ray.direction).as_vec3().try_normalize();
        let names = &self.snapshot.names;
        let (material, stage) = match names.material_of(occurrence, geometry, primitive) {
            Some((id, stage)) => (Some(id), stage),
            None => (None, 0),
        };
        let Some(albedos) = self.albedos.get(stage as usize) else { return Rgb::BLACK };
        albedos.at(material, &interaction, away.unwrap_or(interaction.geometric_normal))
    }

    /// A geometry as it is rendered, with the map to the coordinates in which it is queried.
    fn painted(&self, geometry: u32) -> Option<(Geometry, Transform)> {
        let own = Transform::IDENTITY;
        Some(match self.snapshot.names.surfaces.get(geometry as usize)? {
            Surface::Mesh(mesh) => {
                let (mesh, own) = mesh.rendered();
                (Geometry::Mesh(mesh), own)
            }
            Surface::Shape(shape, placed) => (Geometry::Shape(shape.clone(), *placed), own),
            Surface::Spheres(spheres) => (Geometry::Set(spheres.clone()), own),
            Surface::Curves(curves) => (Geometry::Set(curves.clone()), own),
            Surface::Heightfield(field) => (Geometry::Heightfield(field.grid.clone()), own),
            Surface::Gone => return None,
        })
    }

    /// True if a mesh was read from a file with a mirroring transform.
    fn is_turned(&self, geometry: u32) -> bool {
        match self.snapshot.names.surfaces.get(geometry as usize) {
            Some(Surface::Mesh(mesh)) => mesh.rendered().1.is_mirrored(),
            _ => false,
        }
    }
}
