//! The matte surfaces of a scene with precomputed data, and vertices on them.

use crate::batch::Batch;
use crate::batch::lights::horizon;
use crate::batch::vertices::{OtherPoint, VertexLanes};
use crate::compile::CompiledScene;
use crate::integrator::Context;
use crate::integrator::estimators::{Arrival, may_be_lifted};
use crate::lanes::{BLACK, HitColors, LANES, at, color_at, put_color};
use crate::sampler::Sampler;
use snell_intersect::triangles::{HitVectors, PlainMesh};
use snell_intersect::{GeometryId, Hit};
use snell_math::simd::Wide;
use snell_math::spectrum::RgbSpectrum;
use snell_math::{ColorMode, ColorModel, Ray, SampledSpectrum, Vec3};
use snell_scene::Material;
use std::f32::consts::FRAC_1_PI;
use std::rc::Rc;

/// The matte surfaces of a scene.
#[derive(Debug)]
pub struct MatteSurfaces<'a> {
    /// By geometry: the mesh and its reflectance, if the mesh is static and the reflectance
    /// uniform.
    plain: Vec<Option<PlainSurface<'a>>>,
    /// The class of hits on each geometry outside of instances; the last entry is for misses.
    kinds: Vec<Kind>,
    /// By material: true if it is matte.
    materials: Vec<bool>,
}

/// The class of hits on a geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Matte,
    Other,
    /// The class of the hit depends on the primitive.
    Mixed,
}

/// A mesh with one matte material of uniform reflectance.
#[derive(Clone, Copy, Debug)]
pub struct PlainSurface<'a> {
    pub mesh: PlainMesh<'a>,
    /// The reflectance in RGB mode.
    reflectance: SampledSpectrum,
    /// The spectrum of the reflectance, in spectral mode.
    spectrum: Option<RgbSpectrum>,
}

impl PlainSurface<'_> {
    /// The lanes of the reflectance in this mode.
    #[inline(always)]
    pub fn reflectance_in(&self, mode: ColorMode) -> SampledSpectrum {
        match (mode, &self.spectrum) {
            (ColorMode::Spectral(wavelengths), Some(spectrum)) => spectrum.at(&wavelengths),
            _ => self.reflectance,
        }
    }
}

impl<'a> MatteSurfaces<'a> {
    /// Finds the surfaces; `None` if there are none, or with portable code, where the vertex
    /// function shades them.
    pub fn new(context: &Context<'a>) -> Option<Rc<Self>> {
        let scene = context.scene;
        scene.world.simd().wide()?;
        let materials: Vec<_> =
            scene.materials.iter().map(|material| is_matte(context, material)).collect();
        let plain = |geometry: u32| {
            let mesh = scene.world.plain_mesh(GeometryId(geometry))?;
            let id = scene.only_material(geometry).filter(|id| materials[id.index()])?;
            let material = scene.material(id);
            let is_plain = !material.is_bent() && material.interior.is_none();
            let reflectance = material.as_matte()?.uniform().filter(|_| is_plain)?;
            let is_spectral = context.settings.color == ColorModel::Spectral;
            let spectrum = is_spectral.then(|| RgbSpectrum::of_factor(reflectance));
            Some(PlainSurface {
                mesh,
                reflectance: ColorMode::Rgb.reflectance(reflectance),
                spectrum,
            })
        };
        let kind = |geometry: u32| match scene.only_material(geometry) {
            Some(id) if materials[id.index()] => Kind::Matte,
            Some(_) => Kind::Other,
            None => Kind::Mixed,
        };
        let geometries = 0..scene.world.geometry_count() as u32;
        let kinds = geometries.clone().map(kind).chain([Kind::Other]).collect();
        let plain = geometries.map(plain).collect();
        materials.contains(&true).then(|| Rc::new(Self { plain, kinds, materials }))
    }

    /// True if a path with this hit can be shaded as a vertex on a matte surface.
    #[inline(always)]
    pub fn has(&self, scene: &CompiledScene, hit: &Hit) -> bool {
        let kind = self.kinds[(hit.geometry as usize).min(self.kinds.len() - 1)];
        match (kind == Kind::Mixed) | (hit.instance != 0) & hit.is_hit() {
            false => kind == Kind::Matte,
            true => self.materials[scene.material_id(hit).index()],
        }
    }

    /// The plain surface that a path has hit, if it has hit one.
    #[inline(always)]
    pub fn plain(&self, hit: &Hit) -> Option<&PlainSurface<'a>> {
        self.plain.get(hit.geometry as usize).and_then(Option::as_ref).filter(|_| hit.instance == 0)
    }
}

/// True if vertices on this material can be shaded as matte ones.
fn is_matte(context: &Context, material: &Material) -> bool {
    let settings = context.settings;
    let knows_color = settings.color == ColorModel::Rgb || context.field.is_none();
    (settings.integrator.is_path() || settings.integrator.is_classic())
        && knows_color
        && material.as_matte().is_some()
}

/// Vertices on matte surfaces. Arrays are by lane; unused lanes hold arbitrary values.
#[derive(Debug)]
pub struct MatteVertices<'a> {
    pub lanes: VertexLanes,
    /// By channel, the reflectance at the vertices.
    pub reflectance: HitColors,
    surfaces: Rc<MatteSurfaces<'a>>,
}

impl<'a> MatteVertices<'a> {
    /// Makes empty lanes for vertices on these surfaces.
    pub fn new(surfaces: &Rc<MatteSurfaces<'a>>, sampler: &Sampler, wide: Wide) -> Self {
        let (lanes, surfaces) = (VertexLanes::new(sampler, Some(wide)), Rc::clone(surfaces));
        Self { lanes, reflectance: BLACK, surfaces }
    }

    /// The number of paths at the front of `paths` that are on matte surfaces, at most [`LANES`].
    pub fn accepts(&self, batch: &Batch, paths: &[u32]) -> usize {
        if batch.matte_next > 0 {
            return batch.matte_next.min(LANES);
        }
        let (scene, hits) = (batch.context.scene, &batch.paths.hits);
        let is_matte = |path: &&u32| self.surfaces.has(scene, &hits[**path as usize]);
        paths.iter().take(LANES).take_while(is_matte).count()
    }

    /// Puts the vertices of the paths with these numbers into the lanes: at most [`LANES`] paths.
    /// Paths that have ended are left out.
    pub fn gather(&mut self, batch: &Batch, paths: &[u32]) {
        let from = batch.paths;
        self.lanes.start(batch, paths);
        for lane in 0..self.lanes.paths().len() {
            let path = self.lanes.paths()[lane] as usize;
            let (ray, hit) = (&from.rays[path], &from.hits[path]);
            match self.surfaces.plain(hit) {
                Some(surface) => {
                    put_color(
                        &mut self.reflectance,
                        lane,
                        surface.reflectance_in(self.lanes.modes[lane]),
                    );
                    self.lanes.put_triangle(lane);
                }
                None => self.gather_other(batch.context, lane, ray, hit),
            }
        }
        let surfaces = &self.surfaces;
        self.lanes.gather_triangles(from, |hit| surfaces.plain(hit).map(|surface| &surface.mesh));
    }

    /// Puts a vertex that is on none of the plain surfaces into its lane.
    #[inline(never)]
    fn gather_other(&mut self, context: &Context, lane: usize, ray: &Ray, hit: &Hit) {
        let scene = context.scene;
        let material = scene.material(scene.material_id(hit));
        if let Some(rgb) = material.as_matte().and_then(|matte| matte.uniform())
            && !material.is_bent()
            && self.lanes.gather_shape(context, lane, ray, hit)
        {
            put_color(&mut self.reflectance, lane, self.lanes.modes[lane].reflectance(rgb));
            return;
        }
        let time = self.lanes.times[lane];
        let surface = scene.interaction(ray, time, hit);
        let point = scene.shading_point(
            &surface,
            self.lanes.carried.cone_width[lane],
            self.lanes.modes[lane],
        );
        let Some((reflectance, shading_normal)) = material.matte_at(&point) else { return };
        put_color(&mut self.reflectance, lane, reflectance);
        let lift = match may_be_lifted(context, material) {
            true => scene.lift(ray, time, &surface),
            false => Vec3::ZERO,
        };
        self.lanes.put_point(lane, OtherPoint::of(&surface, shading_normal, lift));
    }

    /// Computes the points of all lanes.
    pub fn place(&mut self, context: &Context) {
        self.lanes.place();
        self.lanes.place_lifts(context);
    }

    /// The surface of a lane with this shading normal.
    pub fn seen(&self, normal: &HitVectors, lane: usize) -> Seen {
        let lanes = &self.lanes;
        let (wo, normal) = (at(&lanes.wo, lane), at(normal, lane));
        let (geometric_normal, lift) =
            (at(&lanes.points.geometric_normal, lane), at(&lanes.lift, lane));
        let horizon = horizon(geometric_normal, normal, lift);
        Seen {
            arrival: lanes.arrival(lane),
            normal,
            horizon,
            cos_o: normal.dot(wo),
            side: horizon.dot(wo),
            reflectance: color_at(&self.reflectance, lane),
        }
    }
}

/// A matte surface at one vertex, as a receiver of light.
pub struct Seen {
    pub arrival: Arrival,
    normal: Vec3,
    horizon: Vec3,
    /// Cosines between the outgoing direction and the shading normal, and between it and `horizon`.
    cos_o: f32,
    side: f32,
    pub reflectance: SampledSpectrum,
}

impl Seen {
    /// The BSDF times the cosine for direction `wi`, and the density per steradian of sampling it.
    pub fn reflected(&self, wi: Vec3) -> (SampledSpectrum, f32) {
        let cos_i = self.normal.dot(wi);
        let is_seen = self.cos_o * cos_i > 0.0 && self.side * self.horizon.dot(wi) > 0.0;
        let pdf = if is_seen { cos_i.abs() * FRAC_1_PI } else { 0.0 };
        (self.reflectance * pdf, pdf)
    }
}
