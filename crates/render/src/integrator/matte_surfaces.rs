//! Which surfaces [`super::matte`] works on, and what can be known of them before they are hit.

use super::matte::is_classic;
use super::{Context, IntegratorKind};
use crate::compile::CompiledScene;
use snell_intersect::triangles::PlainMesh;
use snell_intersect::{GeometryId, Hit};
use snell_math::spectrum::RgbSpectrum;
use snell_math::{ColorMode, ColorModel, SampledSpectrum};
use snell_scene::Material;

/// Which surfaces [`super::matte`] works on.
#[derive(Debug)]
pub struct MatteSurfaces<'a> {
    /// By geometry: the mesh and its reflectance, if that is the same everywhere and nothing moves
    /// it.
    plain: Vec<Option<PlainSurface<'a>>>,
    /// By geometry, and last for nothing: what is known of hits on it outside of instances.
    kinds: Vec<Kind>,
    /// By material.
    materials: Vec<bool>,
}

/// What hits on a geometry are.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Matte,
    Other,
    /// It depends on what exactly was hit.
    Mixed,
}

/// A mesh of one matte material.
#[derive(Clone, Copy, Debug)]
pub struct PlainSurface<'a> {
    pub mesh: PlainMesh<'a>,
    /// The same everywhere.
    reflectance: SampledSpectrum,
    /// The same for all wavelengths, if it is asked for.
    spectrum: Option<RgbSpectrum>,
}

impl PlainSurface<'_> {
    /// The reflectance in this mode.
    #[inline(always)]
    pub fn reflectance_in(&self, mode: ColorMode) -> SampledSpectrum {
        match (mode, &self.spectrum) {
            (ColorMode::Spectral(wavelengths), Some(spectrum)) => spectrum.at(&wavelengths),
            _ => self.reflectance,
        }
    }
}

impl<'a> MatteSurfaces<'a> {
    /// `None` if there are none.
    pub fn new(context: &Context<'a>) -> Option<Self> {
        let scene = context.scene;
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
        materials.contains(&true).then_some(Self { plain, kinds, materials })
    }

    /// True if a path that has hit this can be worked on here.
    #[inline(always)]
    pub fn has(&self, scene: &CompiledScene, hit: &Hit) -> bool {
        let kind = self.kinds[(hit.geometry as usize).min(self.kinds.len() - 1)];
        match (kind == Kind::Mixed) | (hit.instance != 0) & hit.is_hit() {
            false => kind == Kind::Matte,
            true => self.materials[scene.material_id(hit).index()],
        }
    }

    /// What a path has hit, if it is one of the plain surfaces.
    #[inline(always)]
    pub fn plain(&self, hit: &Hit) -> Option<&PlainSurface<'a>> {
        self.plain.get(hit.geometry as usize).and_then(Option::as_ref).filter(|_| hit.instance == 0)
    }
}

fn is_for(integrator: IntegratorKind) -> bool {
    is_classic(integrator) || matches!(integrator, IntegratorKind::Path | IntegratorKind::Direct)
}

/// True if vertices on this material can be worked on here.
fn is_matte(context: &Context, material: &Material) -> bool {
    let settings = context.settings;
    let knows_color = settings.color == ColorModel::Rgb || context.field.is_none();
    is_for(settings.integrator) && knows_color && material.as_matte().is_some()
}
