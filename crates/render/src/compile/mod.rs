//! Compiles a scene graph to instances over geometries and flat tables of lights, materials and
//! textures, all referred to by ids.
//!
//! A node with one parent is folded into the group of its parent: its transforms are composed in
//! double precision and applied to the vertices. A node with several parents becomes a group of its
//! own, which is stored once at any depth. So does a mesh that several surfaces share. A node that
//! moves becomes a group too, so that the frames of an animation share most structures.

mod camera_filter;
pub(crate) mod casters;
mod crowds;
pub(crate) mod floor;
mod lights;
mod surfaces;
mod volumes;

pub use camera_filter::CameraFilter;
pub use lights::{BareLight, CompiledLight, LightSpectrum, PlainEmission};
use volumes::EquiangularLights;
pub(crate) use volumes::{Boundary, VolumeTable};

use crate::light_sampler::{LightSampler, LightSamplerKind};
use crate::settings::LightStrategy;
use casters::Casters;
use floor::Floor;
use lights::LightTable;
use snell_intersect::{
    BuildOptions, GeometryId, Hit, HitFilter, RayQuery, SurfaceInteraction, World, WorldError,
};
use snell_math::{Bounds3d, ColorMode, Ray, Rgb, Vec3, rng};
use snell_scene::light::environment::EnvironmentLight;
use snell_scene::material::{AlphaMode, Prepared, ShadingPoint};
use snell_scene::{
    Background, Environment, Material, MaterialId, MediumId, NodeId, Pose, Scene, SceneError,
    ShadowCatcher, TextureSet, Warning,
};
use std::any::Any;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use surfaces::SurfaceTable;

/// The reason why a scene could not be compiled.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CompileError {
    /// The scene graph is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The world could not be built.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A mesh is inconsistent.
    #[error("mesh in node \"{node}\": {source}")]
    Mesh {
        /// The node's name.
        node: String,
        /// What is wrong.
        source: snell_intersect::mesh::MeshError,
    },
}

/// The parts of a scene that move.
#[derive(Clone, Debug, Default)]
pub struct Moving {
    /// Nodes that move from one compilation to the next, or while the shutter is open
    /// ([`snell_scene::Player::moving_nodes`]). Each becomes an instance of a group of its own, so
    /// that the rest of the world need not change.
    pub nodes: BTreeSet<NodeId>,
    /// The poses while the shutter is open, at equal times from the one after opening, which is the
    /// scene's own pose, to closing. Between poses everything moves on straight lines.
    pub later: Vec<Pose>,
}

/// A scene prepared for rendering. It is immutable and shared by all threads.
#[derive(Debug)]
pub struct CompiledScene {
    /// The geometry.
    pub world: Arc<World>,
    /// Materials by id. The last one is the default, for surfaces without a material.
    pub materials: Vec<Material>,
    /// Precomputed data of the BSDF of each material.
    prepared: Vec<Prepared>,
    /// Textures by id.
    pub textures: Arc<TextureSet>,
    /// Light from all directions at infinity.
    pub environment: Option<Arc<EnvironmentLight>>,
    /// The background for camera rays that leave the scene.
    pub background: Background,
    /// The floor of a background that catches shadows, if there is light to cast them.
    pub(crate) floor: Option<Floor>,
    /// Ambient light, for the integrators of local illumination only.
    pub ambient: Rgb,
    /// Centre of the scene's finite part.
    pub center: Vec3,
    /// Radius of the scene's finite part; 1 if it is empty.
    pub radius: f32,
    /// Warnings of the compilation.
    pub warnings: Vec<Warning>,
    /// The media, if the scene has any.
    pub(crate) volumes: Option<VolumeTable>,
    /// True if rays need times, because something moves while the shutter is open.
    pub moves: bool,
    /// True if camera rays pass through some surfaces that other rays hit.
    pub hides_from_camera: bool,
    surfaces: Arc<SurfaceTable>,
    lights: LightTable,
    /// The light samplers that were built so far.
    light_samplers: Mutex<Vec<(LightSamplerKind, LightStrategy, Arc<LightSampler>)>>,
    /// The surfaces that cast caustics, found at first use.
    casters: OnceLock<Casters>,
    /// What the last render has kept for the next one of the same scene.
    pub(crate) kept: Mutex<Option<Kept>>,
}

/// What a render keeps for the next one, with a text that says all on which it depends.
pub(crate) type Kept = (String, Arc<dyn Any + Send + Sync>);

/// The parts of a compiled scene that take long to build.
struct Built {
    world: Arc<World>,
    surfaces: Arc<SurfaceTable>,
    textures: Arc<TextureSet>,
    environment: Option<Arc<EnvironmentLight>>,
    moves: bool,
}

impl CompiledScene {
    /// Compiles a scene in which nothing moves.
    pub fn new(scene: &Scene, options: &BuildOptions) -> Result<Self, CompileError> {
        Self::moving(scene, &Moving::default(), options, None)
    }

    /// Compiles a scene in which some nodes move. Unchanged parts of `previous` are reused: it must
    /// be the same scene, compiled with the same moving nodes, in another pose. The result does not
    /// depend on `previous`.
    pub fn moving(
        scene: &Scene,
        moving: &Moving,
        options: &BuildOptions,
        previous: Option<Self>,
    ) -> Result<Self, CompileError> {
        let mut warnings = Vec::new();
        // Poses do not change the textures of materials, so the check of possibly many materials is
        // skipped.
        if previous.is_none() {
            scene.check_textures()?;
        }
        let materials = materials_of(scene);
        let default_material = MaterialId(scene.materials.len() as u32);
        let before = previous.as_ref().map(|p| &*p.surfaces);
        let (builder, surfaces) =
            surfaces::compile(scene, moving, &materials, default_material, before, &mut warnings)?;
        let world = Arc::new(match &previous {
            Some(previous) => builder.rebuild(options, &previous.world)?,
            None => builder.build(options)?,
        });
        world.warnings().into_iter().for_each(|message| Warning::note(&mut warnings, message, 1));
        crowds::check(scene, &world, &surfaces, &mut warnings)?;
        let (textures, environment) = match previous {
            Some(previous) => {
                (TextureSet::placed(previous.textures, &scene.textures), previous.environment)
            }
            None => (
                Arc::new(TextureSet::new(&scene.textures, &scene.images)),
                EnvironmentLight::of_scene(scene).map(Arc::new),
            ),
        };
        let moves = !moving.later.is_empty();
        let built = Built { world, surfaces: Arc::new(surfaces), textures, environment, moves };
        Self::over(scene, materials, warnings, built)
    }

    /// Compiles `scene`, which differs from `before`, the scene that `self` was compiled from, in
    /// materials, lights, media and surroundings only. Nodes, geometries, textures and images must
    /// be the same. Only what has changed is built. Returns `None` if the world has to be built
    /// anew, because the number of materials has changed, or whether rays ask one of them if they
    /// hit its surface (as cut-out, one-sided or invisible ones).
    pub fn changed(&self, before: &Scene, scene: &Scene) -> Result<Option<Self>, CompileError> {
        let materials = materials_of(scene);
        let is_alike = |(a, b): (&Material, &Material)| a.needs_filter() == b.needs_filter();
        if materials.len() != self.materials.len()
            || !self.materials.iter().zip(&materials).all(is_alike)
        {
            return Ok(None);
        }
        scene.topological_order()?;
        let environment = match (&before.environment, &scene.environment) {
            (Some(old), Some(new)) if is_same(old, new) && before.portals == scene.portals => {
                self.environment.clone()
            }
            _ => EnvironmentLight::of_scene(scene).map(Arc::new),
        };
        let (world, surfaces, textures) =
            (self.world.clone(), self.surfaces.clone(), self.textures.clone());
        let built = Built { world, surfaces, textures, environment, moves: self.moves };
        Self::over(scene, materials, self.warnings.clone(), built).map(Some)
    }

    /// Builds the parts that are made anew at every change.
    fn over(
        scene: &Scene,
        materials: Vec<Material>,
        mut warnings: Vec<Warning>,
        built: Built,
    ) -> Result<Self, CompileError> {
        let Built { world, surfaces, textures, environment, moves } = built;
        let bounds = finite_part(&scene_bounds(&world));
        let (sky, radius) = (environment.as_deref(), bounds.radius());
        let mut volumes = VolumeTable::new(scene, &materials)?;
        let lights = LightTable::new(
            scene,
            &world,
            &surfaces,
            &materials,
            &textures,
            sky,
            volumes.as_ref(),
            radius,
        );
        if let Some(volumes) = &mut volumes {
            volumes.equiangular_lights = EquiangularLights::new(&lights.summaries(true, None));
        }
        let found = "curves that shine are not sampled; their light is found by chance only, with \
            more noise";
        if lights.has_glowing_curves() && !warnings.iter().any(|w| w.message == found) {
            Warning::note(&mut warnings, found.into(), 1);
        }
        let message = "there are too many emissive surfaces to list; light from the rest is found \
            by chance only, with more noise";
        if !lights.is_complete() && !warnings.iter().any(|w| w.message == message) {
            Warning::note(&mut warnings, message.into(), 1);
        }
        let radius = bounds.radius() as f32;
        let floor = Floor::of(scene, &bounds, &scene_bounds(&world));
        Ok(Self {
            prepared: materials.iter().map(Prepared::of).collect(),
            hides_from_camera: materials.iter().any(|material| !material.visible_to_camera),
            materials,
            textures,
            environment,
            background: match scene.background {
                Background::Color(color) => Background::Color(color.map(finite)),
                Background::ShadowCatcher(catcher) => Background::ShadowCatcher(ShadowCatcher {
                    color: catcher.color.map(finite),
                    ..catcher
                }),
                other => other,
            },
            floor,
            ambient: scene.ambient.map(finite),
            center: if bounds.is_empty() { Vec3::ZERO } else { bounds.center().as_vec3() },
            radius: if radius > 0.0 { radius } else { 1.0 },
            warnings,
            moves,
            world,
            volumes,
            surfaces,
            lights,
            light_samplers: Mutex::default(),
            casters: OnceLock::new(),
            kept: Mutex::default(),
        })
    }

    /// The material at a hit.
    pub fn material_id(&self, hit: &Hit) -> MaterialId {
        self.surfaces.material(&self.world, hit.instance, hit.geometry, hit.primitive)
    }

    /// The material of all primitives of a geometry in the root group; `None` if there may be
    /// several.
    pub fn only_material(&self, geometry: u32) -> Option<MaterialId> {
        self.surfaces.only_material(geometry)
    }

    /// The nodes from the root of the scene graph to the one that holds the surface of a hit.
    pub fn node_path(&self, hit: &Hit) -> Vec<NodeId> {
        self.surfaces.node_path(&self.world, hit.instance, hit.geometry)
    }

    /// The number of the surface of a hit among the surfaces of the node that holds it.
    pub fn surface_number(&self, hit: &Hit) -> u32 {
        self.surfaces.surface_number(&self.world, hit.instance, hit.geometry)
    }

    /// The point at a hit of a ray with a time from 0 to 1, and the surface's properties there.
    #[inline]
    pub fn interaction(&self, ray: &Ray, time: f32, hit: &Hit) -> SurfaceInteraction {
        self.world.interaction(RayQuery { time, ..RayQuery::from(ray) }, hit)
    }

    /// The offset from a point of the surface to the smooth surface that the vertex normals imply
    /// ([`snell_intersect::World::lift`]).
    pub fn lift(&self, ray: &Ray, time: f32, surface: &SurfaceInteraction) -> Vec3 {
        self.world.lift(RayQuery { time, ..RayQuery::from(ray) }, surface)
    }

    /// The material with this id.
    pub fn material(&self, id: MaterialId) -> &Material {
        &self.materials[id.index()]
    }

    /// Precomputed data of the BSDF of the material with this id.
    pub fn prepared(&self, id: MaterialId) -> &Prepared {
        &self.prepared[id.index()]
    }

    /// All lights, the environment last.
    pub fn lights(&self) -> &[CompiledLight] {
        &self.lights.lights
    }

    /// The emission of a light that is a surface with uniform emission; `None` for other lights.
    #[inline]
    pub(crate) fn plain_emission(&self, light: usize) -> Option<&PlainEmission> {
        self.lights.plain(light)
    }

    /// The light of the surface of a geometry; `None` if it does not emit or cannot be sampled.
    pub fn light_of(&self, instance: u32, geometry: u32) -> Option<usize> {
        self.lights.of_surface(instance, geometry)
    }

    /// The light of a medium; `None` if it does not emit or cannot be sampled.
    pub fn light_of_medium(&self, medium: MediumId) -> Option<usize> {
        self.lights.of_medium(medium)
    }

    /// The approximate power of a light in W.
    pub(crate) fn light_power(&self, light: usize) -> f64 {
        self.lights.powers[light]
    }

    /// The surfaces that cast caustics.
    pub(crate) fn casters(&self) -> &Casters {
        self.casters.get_or_init(|| Casters::new(self))
    }

    /// The position of the environment among the lights.
    pub fn environment_light(&self) -> Option<usize> {
        self.lights.environment
    }

    /// True if there are media, in which rays may scatter before they hit anything.
    pub fn has_media(&self) -> bool {
        self.volumes.is_some()
    }

    /// True if rays that leave the scene see black in every direction.
    pub fn is_dark_outside(&self) -> bool {
        let shown = match self.background {
            Background::Color(color) => color,
            Background::ShadowCatcher(catcher) => catcher.color,
            Background::Environment | Background::Transparent => Rgb::BLACK,
        };
        self.environment.is_none() && shown.is_black()
    }

    /// True if most light comes uniformly from all directions, so that paths that leave the scene
    /// find similar radiance.
    pub fn is_evenly_lit(&self) -> bool {
        self.lights.is_even()
    }

    /// The light sampler of this kind, built at first use.
    pub fn light_sampler(
        &self,
        kind: LightSamplerKind,
        strategy: LightStrategy,
    ) -> Arc<LightSampler> {
        let mut known = self.light_samplers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., sampler)) = known.iter().find(|(k, s, _)| (*k, *s) == (kind, strategy)) {
            return sampler.clone();
        }
        let sampler = Arc::new(self.new_light_sampler(kind, strategy));
        known.push((kind, strategy, sampler.clone()));
        sampler
    }

    fn new_light_sampler(&self, kind: LightSamplerKind, strategy: LightStrategy) -> LightSampler {
        let left_out = self.environment_light().filter(|_| !self.samples_environment(strategy));
        let mut lights = self.lights.summaries(kind == LightSamplerKind::Bvh, left_out);
        if let (Some(i), Some(sky), LightStrategy::Mis) =
            (self.environment_light(), &self.environment, strategy)
        {
            lights[i].power *= sky.excess();
        }
        LightSampler::new(kind, &lights, self.world.simd().wide())
    }

    /// True if light samples are taken from the environment. A constant environment may be left to
    /// BSDF samples, which halves the work and lowers the variance.
    pub fn samples_environment(&self, strategy: LightStrategy) -> bool {
        self.environment.as_ref().is_some_and(|sky| match strategy {
            LightStrategy::Mis => sky.excess() > 0.0,
            LightStrategy::Light => true,
            LightStrategy::Bsdf => false,
        })
    }

    /// The point at a hit as the input of materials, for a path of this colour mode.
    pub fn shading_point<'a>(
        &'a self,
        surface: &'a SurfaceInteraction,
        footprint: f32,
        mode: ColorMode,
    ) -> ShadingPoint<'a> {
        ShadingPoint { surface, footprint, textures: &self.textures, mode, outside_ior: 1.0 }
    }

    /// True if some hits must pass the hit filter.
    pub fn has_filter(&self) -> bool {
        self.surfaces.any_filtered
    }
}

/// Rejects hits on cut-out, blended and single-sided surfaces. The decision is a pure function of
/// ray and hit, so shadow rays and batches of any size agree.
impl HitFilter for CompiledScene {
    fn accept(&self, ray: &Ray, hit: &Hit) -> bool {
        self.accept_at(ray, 0.0, hit)
    }

    fn accept_at(&self, ray: &Ray, time: f32, hit: &Hit) -> bool {
        let material = self.material(self.material_id(hit));
        if material.is_interface() || !material.visible {
            return false;
        }
        if material.alpha_mode == AlphaMode::Opaque {
            // Only the side of the surface matters.
            let point = || self.world.point(RayQuery { time, ..RayQuery::from(ray) }, hit);
            return material.double_sided || point().is_front_facing(ray.direction);
        }
        let surface = self.interaction(ray, time, hit);
        let bits = |v: Vec3| {
            rng::pcg4d([
                v.x.to_bits(),
                v.y.to_bits(),
                v.z.to_bits(),
                hit.primitive ^ hit.geometry << 16,
            ])
        };
        let [a, b, ..] = bits(ray.direction);
        let u = rng::to_unit(rng::hash_combine(
            rng::hash_combine(a ^ b, bits(ray.origin)[0]),
            hit.t.to_bits(),
        ));
        // Presence does not depend on colours, so any mode will do.
        material.is_present(ray.direction, &self.shading_point(&surface, 0.0, ColorMode::Rgb), u)
    }
}

/// The materials of the scene, followed by the default material.
pub(crate) fn materials_of(scene: &Scene) -> Vec<Material> {
    let mut materials = scene.materials.clone();
    materials.push(snell_scene::framing::default_material());
    materials
}

/// True if two environments certainly give the same light. Images are compared by address.
fn is_same(a: &Environment, b: &Environment) -> bool {
    match (a, b) {
        (Environment::Constant(a), Environment::Constant(b)) => a == b,
        (
            Environment::Image { image: a, scale: a_scale, world_from_environment: a_map },
            Environment::Image { image: b, scale: b_scale, world_from_environment: b_map },
        ) => Arc::ptr_eq(a, b) && a_scale == b_scale && a_map == b_map,
        _ => false,
    }
}

/// `x`, or 0 if it is negative or not finite, since lights and environments count such values as no
/// light.
fn finite(x: f32) -> f32 {
    if x.is_finite() { x.max(0.0) } else { 0.0 }
}

fn scene_bounds(world: &World) -> Bounds3d {
    world.bounds()
}

/// The bounds with infinite sides cut to the finite ones, so that infinite planes do not make the
/// scene infinite.
fn finite_part(bounds: &Bounds3d) -> Bounds3d {
    if bounds.is_finite() || bounds.is_empty() {
        return *bounds;
    }
    let side = |x: f64, other: f64| {
        if x.is_finite() {
            x
        } else if other.is_finite() {
            other
        } else {
            0.0
        }
    };
    let mut b = *bounds;
    for axis in 0..3 {
        b.min[axis] = side(bounds.min[axis], bounds.max[axis]);
        b.max[axis] = side(bounds.max[axis], bounds.min[axis]);
    }
    if b.radius() > 0.0 { b } else { Bounds3d { min: b.min - 1.0, max: b.max + 1.0 } }
}

/// The number of a geometry as a table index.
fn index(id: GeometryId) -> usize {
    id.0 as usize
}

#[cfg(test)]
mod tests;
