//! Finds what a ray hits: shapes, acceleration structures and ray queries, as a stand-alone ray
//! library.
//!
//! A [`World`] holds triangle meshes, analytic shapes and sets of primitives in groups; a group may
//! be instanced in others at any depth. Queries take *batches* of rays ([`World::closest`],
//! [`World::occluded`], [`World::count`], [`World::all`]) or points ([`World::nearest_point`],
//! [`World::signed_distance`], [`World::winding_number`]), by one thread or by all
//! ([`World::parallel`]), and return plain records; [`World::interaction`] turns a [`Hit`] into a
//! description of the surface at that point. A [`DynamicWorld`] changes between batches, and a
//! [`DWorld`] has coordinates in double precision. This crate knows no colours, materials or files.
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

#![cfg_attr(
    test,
    expect(clippy::disallowed_methods, reason = "tests compare with the standard library")
)]

mod build;
mod exact;
pub mod geometry;
mod group;
pub mod hit;
mod kernel;
mod lecture;
pub mod mesh;
mod morton;
mod precision;
mod prefetch;
pub mod query;
mod search;
pub mod shape;
mod tree;
pub mod world;

pub use build::Quality;
pub use geometry::{
    CubicCurves, CurveBasis, Curves, Heightfield, HeightfieldError, HeightfieldMesh, Heights,
    LinearCurves, MeshKey, MovingMesh, PrimitiveHit, PrimitiveSet, QuadMesh, Spheres, StrandBasis,
    StrandError,
};
pub use hit::{
    DHit, DNearestPoint, DSurfacePoint, Hit, NearestPoint, SurfaceInteraction, SurfacePoint,
};
pub use lecture::AcceleratorOptions;
pub use mesh::{DTriangleMesh, TriangleMesh, UV_SETS, first_uv_set};
pub use precision::{Double, Precision, Single};
pub use query::all::AllHits;
pub use query::culling::{Both, Culled, Side};
pub use query::pair::{
    ClosestPair, Motion, PairError, PairMesh, PairQuery, PairScene, Pose, closest_pair, collides,
    time_of_impact,
};
pub use query::parallel::{Cancelled, Parallel};
pub use query::queries::Queries;
pub use query::trace::{TraceStep, TraversalTrace};
pub use search::points::{InsideMethod, Points};
pub use search::rays::{InvalidRays, RayQuery, Rays};
pub use search::region::{Region, RegionKind};
pub use search::{
    AcceptAll, GeometryOptions, Grouping, HitFilter, TraversalCounters, TraversalWork,
};
pub use shape::{AnyShape, Metric, Shape, ShapeHit, ShapePoint, ShapeSample, ShapeSurface, Sphere};
pub use world::double::{DWorld, DWorldBuilder};
pub use world::smooth;
pub use world::spheres::SphereHits;
pub use world::triangles::{self, TriangleHits, TrianglePoints};
pub use world::{
    AcceleratorKind, BuildOptions, BuildStats, DynamicWorld, EditError, Geometry, GeometryId,
    GroupId, Instance, InstanceId, Reuse, Snapshots, World, WorldBuilder, WorldError,
    interaction_on,
};

/// Runs the examples of the README as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
