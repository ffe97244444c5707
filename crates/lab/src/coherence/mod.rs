//! The coherence lab: beams, pencils and cones, three older methods that trace all rays of a region
//! at once.
//!
//! * A *beam* ([`BeamTracer`]) is a pyramid of rays that is cut into the visible pieces of
//!   surfaces: it yields exact areas, and from them every ray's hit (Heckbert and Hanrahan, Beam
//!   Tracing Polygonal Objects, SIGGRAPH 1984).
//! * A *pencil* ([`Pencil`], [`PencilTracer`]) is an axial ray with a matrix that describes
//!   neighbouring rays, as long as they certainly hit the same surface (Shinya, Takahashi and
//!   Naito, Principles and Applications of Pencil Tracing, SIGGRAPH 1987).
//! * A *cone* ([`Cone`], [`ConeTracer`]) is a ray with a width; each primitive in it covers a share
//!   of its cross-section (Amanatides, Ray Tracing with Cones, SIGGRAPH 1984).
//!
//! All three use a [`View`], in which rays are points and triangles are triangles. They traverse
//! the 8-wide tree with the four planes around a region of it, and support triangles only, with
//! every mask and without a filter. They exist for comparison with rays (`snell bench coherence`),
//! and for results that rays cannot give: exact coverage, and footprints. The renderer traces rays,
//! which are faster.
//!
//! Differences from the papers: beams here are cut by a quadtree of regions and a bounding volume
//! hierarchy instead of one sorted list of polygons, and triangles may intersect; pencils start
//! from triangles instead of smooth patches, so the tolerance concerns the planes of triangles;
//! cones do not estimate how the coverages of triangles combine but cut them exactly, like beams.

mod beam;
mod cone;
mod fragments;
mod pencil;
mod pencil_tracer;
mod polygon;
mod queries;
#[cfg(test)]
mod tests;
mod view;
mod walk;

pub use beam::{BeamTracer, VisiblePiece};
pub use cone::{Cone, ConeHit, ConeHits, ConeTracer, Footprint};
pub use pencil::{CurvedSurface, Pencil};
pub use pencil_tracer::PencilTracer;
pub use polygon::ConvexPolygon;
pub use view::View;
pub use walk::RegionWork;

/// A triangle of a world, identified as in [`snell_intersect::Hit`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PrimitiveId {
    /// Occurrence number of the group; see [`snell_intersect::Hit::instance`].
    pub instance: u32,
    /// The number of the geometry; see [`snell_intersect::Hit::geometry`].
    pub geometry: u32,
    /// The number of the triangle; see [`snell_intersect::Hit::primitive`].
    pub primitive: u32,
}

impl From<[u32; 3]> for PrimitiveId {
    fn from([instance, geometry, primitive]: [u32; 3]) -> Self {
        Self { instance, geometry, primitive }
    }
}

/// Errors of tracing regions of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CoherenceError {
    /// The world has another acceleration structure than the bounding volume hierarchy.
    #[error(
        "beams, pencils and cones walk the bounding volume hierarchy only; build the world with \
            the accelerator bvh"
    )]
    NotBvh,
    /// The world has geometry other than triangles, or moving geometry.
    #[error(
        "beams, pencils and cones see triangles that do not move, and nothing else; take a scene \
            of meshes"
    )]
    NotTriangles,
}
