//! Batches of vertices of `raycast` and `whitted` on Lambertian surfaces
//! ([`crate::integrator::classic`]).

use super::matte_surfaces::{MatteSurfaces, MatteVertices};
use crate::batch::{Batch, BatchShader, Shaded};
use crate::integrator::{Context, Outputs, classic};
use crate::lanes::{LANES, ZERO};
use crate::sampler::Sampler;
use snell_intersect::TrianglePoints;
use snell_intersect::triangles::HitVectors;
use snell_math::{Vec3, at_level};
use snell_scene::material::visible_normal;
use std::f32::consts::PI;
use std::rc::Rc;

/// Shades vertices on matte surfaces: ambient light, and a light ray for each light.
pub struct ClassicMatteShader<'a> {
    vertices: MatteVertices<'a>,
    /// Shading normals.
    normal: HitVectors,
}

impl<'a> ClassicMatteShader<'a> {
    /// Makes the shader for these surfaces; `None` if there are none, or unless the integrator is
    /// `raycast` or `whitted`.
    pub fn new(
        context: &Context,
        sampler: &Sampler,
        surfaces: Option<&Rc<MatteSurfaces<'a>>>,
    ) -> Option<Self> {
        let surfaces = surfaces.filter(|_| context.settings.integrator.is_classic())?;
        let wide = context.scene.world.simd().wide()?;
        Some(Self { vertices: MatteVertices::new(surfaces, sampler, wide), normal: ZERO })
    }
}

impl<'a> BatchShader<'a> for ClassicMatteShader<'a> {
    fn accepts(&self, batch: &Batch<'_, 'a>, paths: &[u32]) -> usize {
        self.vertices.accepts(batch, paths)
    }

    fn shade(&mut self, batch: &Batch<'_, 'a>, paths: &[u32]) {
        self.vertices.gather(batch, paths);
        self.vertices.place(batch.context);
        let lanes = &self.vertices.lanes;
        at_level!(
            lanes.wide,
            normals,
            (
                points: &TrianglePoints = &lanes.points,
                wo: &HitVectors = &lanes.wo,
                normal: &mut HitVectors = &mut self.normal,
            )
        );
    }

    fn shaded(&self) -> Shaded<'_> {
        let lanes = &self.vertices.lanes;
        Shaded { paths: lanes.paths(), is_sound: &lanes.points.is_sound, ..Shaded::NONE }
    }

    fn is_lane_by_lane(&self, _batch: &Batch<'_, 'a>) -> bool {
        true
    }

    fn outputs(&self, batch: &Batch<'_, 'a>, lane: usize, out: &mut Outputs) {
        let (context, path) = (batch.context, self.vertices.lanes.paths()[lane] as usize);
        let (state, random) = (batch.paths.state(path), batch.random(path));
        let seen = self.vertices.seen(&self.normal, lane);
        let ambient =
            seen.reflectance * state.mode.illuminant(context.scene.ambient + context.settings.fill);
        out.radiance = state.throughput * ambient;
        let local = |wi| seen.reflected(wi).0 * PI;
        classic::add_lights(context, state.throughput, &random, &seen.arrival, local, out);
    }
}

/// Shading normals on the side from which they are seen.
#[inline(always)]
fn normals(points: &TrianglePoints, wo: &HitVectors, normal: &mut HitVectors) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let n = visible_normal(
            vector(&points.shading_normal),
            vector(&points.geometric_normal),
            vector(wo),
        );
        (0..3).for_each(|axis| normal[axis][i] = n[axis]);
    }
}
