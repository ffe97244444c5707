//! Here is my ray, what does it hit? Shapes, acceleration structures and ray queries: a ray library
//! on its own.
//!
//! A [`World`] holds triangle meshes, analytic shapes and sets of primitives in groups; a group may
//! be instanced in others at any depth. Queries take *batches* of rays ([`World::closest`],
//! [`World::occluded`], [`World::count`], [`World::all`]) or points ([`World::nearest_point`],
//! [`World::signed_distance`], [`World::winding_number`]), by one thread or by all
//! ([`World::parallel`]), and answer with plain records; [`World::interaction`] turns a [`Hit`]
//! into everything local about the surface. A [`DynamicWorld`] changes between batches, and a
//! [`DWorld`] has coordinates in double precision. Nothing here knows of colours, materials or
//! files.
//!
//! ```
//! use snell_intersect::{AcceptAll, BuildOptions, TriangleMesh, WorldBuilder};
//! use snell_math::{Ray, Vec3};
//! use std::sync::Arc;
//!
//! let triangle = TriangleMesh {
//!     positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
//!     indices: vec![[0, 1, 2]],
//!     ..TriangleMesh::default()
//! };
//! let mut builder = WorldBuilder::default();
//! builder.add_mesh(WorldBuilder::ROOT, Arc::new(triangle));
//! let world = builder.build(&BuildOptions::default())?;
//! let hit = world.closest_one(&Ray::new(Vec3::new(0.25, 0.5, -2.0), Vec3::Z), &AcceptAll);
//! assert_eq!((hit.t, hit.uv.x, hit.uv.y), (2.0, 0.25, 0.5));
//! # Ok::<(), snell_intersect::WorldError>(())
//! ```

pub mod accel;
pub mod geometry;
pub mod hit;
mod kernel;
pub mod mesh;
mod morton;
pub mod precision;
pub mod query;
pub mod shape;
pub mod world;

pub use accel::Quality;
pub use geometry::{
    CubicCurves, CurveBasis, Curves, LinearCurves, MeshKey, MovingMesh, PrimitiveHit, PrimitiveSet,
    QuadMesh, Spheres, StrandBasis, StrandError,
};
pub use hit::{DHit, Hit, SurfaceInteraction, SurfacePoint};
pub use mesh::{DTriangleMesh, TriangleMesh};
pub use precision::{Double, Precision, Single};
pub use query::crossings::AllHits;
pub use query::journey::{Journey, Place, PlaceKind, Stop};
pub use query::nearest::{DNearestPoint, NearestPoint, Points};
pub use query::parallel::{Cancelled, Parallel};
pub use query::queries::Queries;
pub use query::rays::{InvalidRays, RayQuery, Rays};
pub use query::{AcceptAll, Grouping, HitFilter};
pub use shape::{AnyShape, Metric, Shape, ShapeHit, ShapePoint, ShapeSample, ShapeSurface, Sphere};
pub use world::double::{DWorld, DWorldBuilder};
pub use world::smooth;
pub use world::spheres::SphereHits;
pub use world::triangles::{self, TriangleHits, TrianglePoints};
pub use world::{
    BuildOptions, DynamicWorld, EditError, Geometry, GeometryId, GeometryOptions, GroupId,
    Instance, InstanceId, Reuse, Snapshots, World, WorldBuilder, WorldError,
};

/// The examples of the README are tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
