//! Emissive surfaces as lights: a point on them is chosen uniformly by area.

use snell_intersect::{Shape, SurfaceInteraction, TriangleMesh};
use snell_math::{Transform, Vec2};
use std::sync::Arc;

/// The geometry of an emissive surface.
#[derive(Clone, Debug)]
pub enum EmissiveGeometry {
    /// These triangles of a mesh.
    Mesh {
        /// The mesh.
        mesh: Arc<TriangleMesh>,
        /// Which triangles emit.
        triangles: Vec<u32>,
    },
    /// A whole shape.
    Shape(Arc<dyn Shape>),
}

/// A point on an emissive surface.
#[derive(Clone, Debug)]
pub struct AreaSample {
    /// The point as an interaction in the world (`t` is meaningless, ids are those given to [`AreaLight::new`]).
    pub surface: SurfaceInteraction,
    /// Density per unit of world area.
    pub pdf_area: f32,
}

/// An emissive surface at one place in the world.
#[derive(Debug)]
pub struct AreaLight {
    /// What emits.
    pub geometry: EmissiveGeometry,
    /// Where it is.
    pub world_from_geometry: Transform,
    /// Ids for the sampled interactions: instance and geometry.
    pub ids: (u32, u32),
}

impl AreaLight {
    /// Prepares sampling. `None` if the surface has no finite positive area.
    pub fn new(geometry: EmissiveGeometry, world_from_geometry: Transform, ids: (u32, u32)) -> Option<Self> {
        Some(Self { geometry, world_from_geometry, ids })
    }

    /// A point with density [`AreaSample::pdf_area`] per unit of world area.
    pub fn sample(&self, u: Vec2) -> Option<AreaSample> {
        let _ = u;
        None
    }

    /// Density per unit of world area with which [`Self::sample`] gives the point of this interaction on this light.
    pub fn pdf_area(&self, surface: &SurfaceInteraction) -> f32 {
        let _ = surface;
        0.0
    }

    /// Area in the world.
    pub fn area(&self) -> f64 {
        0.0
    }
}
