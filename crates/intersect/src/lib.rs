//! Here is my ray, what does it hit? Shapes, acceleration structures and ray queries: a ray library on its own.
//!
//! A [`World`] holds triangle meshes and analytic shapes in groups; a group may be instanced in others at any depth. Queries take
//! *batches* of rays ([`World::closest`], [`World::occluded`]) and answer with plain [`Hit`] records; [`World::interaction`] turns
//! a hit into everything local about the surface. A [`DWorld`] is the same for coordinates in double precision. Nothing here knows of
//! colours, materials or files.

pub mod accel;
pub mod geometry;
pub mod hit;
mod kernel;
pub mod mesh;
pub mod precision;
pub mod query;
pub mod shape;
pub mod world;

pub use accel::Quality;
pub use geometry::{CubicCurves, CurveBasis, LinearCurves, PrimitiveHit, PrimitiveSet, Spheres};
pub use hit::{DHit, Hit, SurfaceInteraction};
pub use mesh::{DTriangleMesh, TriangleMesh};
pub use precision::{Double, Precision, Single};
pub use query::crossings::AllHits;
pub use query::nearest::{NearestPoint, Points};
pub use query::parallel::{Cancelled, Parallel};
pub use query::rays::{InvalidRays, RayQuery, Rays};
pub use query::{AcceptAll, Grouping, HitFilter};
pub use shape::{AnyShape, Metric, Shape, ShapeHit, ShapePoint, ShapeSample, ShapeSurface, Sphere};
pub use world::double::{DWorld, DWorldBuilder};
pub use world::{
    BuildOptions, DynamicWorld, EditError, Geometry, GeometryId, GeometryOptions, GroupId, Instance, InstanceId, Reuse,
    Snapshots, World, WorldBuilder, WorldError,
};
