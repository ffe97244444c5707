//! Pairs of scenes: the distance of their surfaces, whether these meet, and when they will.
//!
//! Scenes here are triangles only, in double precision. A [`PairMesh`] has its triangles in a tree
//! of oriented boxes, a [`PairScene`] places meshes, and a [`Pose`] moves a whole scene without
//! changing anything in it, so a robot may be tried in many poses.
//!
//! Whether two triangles meet is decided exactly, for their corners as rounded after the pose is
//! applied (they are not rounded if there is none). Distances are exact up to rounding, which is
//! below `1e-13` of the size of both scenes and the space between them. They do not depend on how
//! far from 0 everything is.
//!
//! ```
//! use snell_intersect::{PairMesh, PairQuery, PairScene, Pose, closest_pair};
//! use snell_math::{DAffine3, DVec3};
//! use std::sync::Arc;
//!
//! let triangle = Arc::new(PairMesh::new(&[[DVec3::ZERO, DVec3::X, DVec3::Y]])?);
//! let scene = PairScene::new(vec![(triangle, DAffine3::IDENTITY)])?;
//! let above = Pose::new(DAffine3::from_translation(DVec3::Z * 2.0))?;
//! let near = closest_pair((&scene, &above), (&scene, &Pose::IDENTITY), &PairQuery::default());
//! assert_eq!(near.ok().flatten().map(|pair| pair.distance), Some(2.0));
//! # Ok::<(), snell_intersect::PairError>(())
//! ```

mod bodies;
mod boxes;
mod meeting;
mod motion;
mod scene;
mod search;
#[cfg(test)]
mod tests;
mod triangles;

use super::parallel::Cancelled;
use scene::Scale;
use snell_math::{DAffine3, DVec3};
use std::sync::atomic::AtomicBool;

pub use motion::{Motion, time_of_impact};
pub use scene::{PairError, PairMesh, PairScene};

/// A map that a scene is moved by: a rotation, perhaps a mirroring, a uniform scale and a
/// translation.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    map: DAffine3,
    scale: Scale,
}

impl Pose {
    /// The pose that moves nothing.
    pub const IDENTITY: Self = Self { map: DAffine3::IDENTITY, scale: Scale::ONE };

    /// A pose from its map.
    ///
    /// # Errors
    /// If the map shears, or scales along one axis more than along another: by more than `1e-6`.
    pub fn new(map: DAffine3) -> Result<Self, PairError> {
        Ok(Self { map, scale: Scale::of_pose(&map)? })
    }
}

/// What is asked about a pair of scenes.
#[derive(Clone, Copy, Debug)]
pub struct PairQuery<'a> {
    /// The largest distance that counts, inclusive.
    pub max_distance: f64,
    /// Makes the query stop soon after it is set.
    pub cancel: Option<&'a AtomicBool>,
    /// The query stops after about so many pairs of boxes, of which each takes about 50
    /// nanoseconds.
    pub max_steps: u64,
}

impl Default for PairQuery<'_> {
    fn default() -> Self {
        Self { max_distance: f64::INFINITY, cancel: None, max_steps: u64::MAX }
    }
}

/// The nearest points of two scenes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPair {
    /// The distance; 0 if and only if the surfaces meet.
    pub distance: f64,
    /// A point of each surface, in world coordinates. Both are the same if the surfaces meet.
    pub points: [DVec3; 2],
    /// The number that each part has in its scene.
    pub parts: [u32; 2],
    /// The number that each triangle has in its mesh.
    pub triangles: [u32; 2],
}

/// The nearest points of the surfaces of two scenes, each with a pose; `None` if none are within
/// the largest distance, or a scene is empty. If surfaces meet at several places, or several pairs
/// are equally near, which one is found depends on the meshes alone.
///
/// # Errors
/// If the query is stopped.
pub fn closest_pair(
    a: (&PairScene, &Pose),
    b: (&PairScene, &Pose),
    query: &PairQuery,
) -> Result<Option<ClosestPair>, Cancelled> {
    search::search([a, b], query, false)
}

/// True if the surfaces of two scenes meet, each with a pose; touching is meeting. The largest
/// distance does not matter. A scene that is wholly inside another does not meet it; for that,
/// [`PairScene::body_points`] gives a point of each body.
///
/// # Errors
/// If the query is stopped.
pub fn collides(
    a: (&PairScene, &Pose),
    b: (&PairScene, &Pose),
    query: &PairQuery,
) -> Result<bool, Cancelled> {
    Ok(search::search([a, b], query, true)?.is_some())
}
