//! Worlds that change: edits are collected, and a commit makes them visible in a new snapshot.
//! Readers keep the snapshots they hold.

#[cfg(test)]
mod tests;

use super::{BuildOptions, World, WorldBuilder, WorldError};
use std::sync::{Arc, PoisonError, RwLock};

/// A world that changes between batches.
///
/// Edits go to a [`WorldBuilder`] and take effect when they are committed. Each commit makes a new
/// immutable [`World`] that shares all it can with the previous one: groups with unchanged contents
/// keep their structures, groups in which geometry only moved are refitted, and all others (and
/// those that refitting has made slow) are rebuilt. Readers in other threads keep tracing the
/// snapshot they hold.
///
/// ```
/// use snell_intersect::{AcceptAll, BuildOptions, DynamicWorld, Sphere, WorldBuilder};
/// use snell_math::{DVec3, Ray, Transform, Vec3};
/// use std::sync::Arc;
///
/// let mut world = DynamicWorld::new(BuildOptions::default());
/// let ball = world.edit().add_group();
/// world.edit().add_shape(ball, Arc::new(Sphere { radius: 1.0 }), Transform::IDENTITY);
/// let id = world.edit().add_instance(WorldBuilder::ROOT, ball, Transform::IDENTITY);
/// let before = world.commit()?;
///
/// world.edit().move_instance(id, Transform::translation(DVec3::new(0.0, 0.0, 10.0)));
/// let after = world.commit()?;
/// let ray = Ray::new(Vec3::new(0.0, 0.0, -5.0), Vec3::Z);
/// assert_eq!(before.closest_one(&ray, &AcceptAll).t, 4.0);
/// assert_eq!(after.closest_one(&ray, &AcceptAll).t, 14.0);
/// # Ok::<(), snell_intersect::WorldError>(())
/// ```
#[derive(Debug)]
pub struct DynamicWorld {
    builder: WorldBuilder,
    options: BuildOptions,
    current: Snapshots,
}

/// A handle to the newest committed world. Cheap to clone for other threads.
#[derive(Clone, Debug)]
pub struct Snapshots(Arc<RwLock<Arc<World>>>);

impl Snapshots {
    /// The newest committed world. A world never changes; call this again for a newer one.
    pub fn current(&self) -> Arc<World> {
        self.0.read().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl DynamicWorld {
    /// An empty world.
    pub fn new(options: BuildOptions) -> Self {
        Self::from_builder(WorldBuilder::default(), options)
    }

    /// A world with the contents of a builder. Nothing is visible before the first commit.
    pub fn from_builder(builder: WorldBuilder, options: BuildOptions) -> Self {
        let current = Snapshots(Arc::new(RwLock::new(Arc::new(World::empty(&options)))));
        Self { builder, options, current }
    }

    /// The builder that receives the edits of the next commit.
    pub fn edit(&mut self) -> &mut WorldBuilder {
        &mut self.builder
    }

    /// Builds what changed since the last commit, on the threads of the current rayon pool, and
    /// makes the result the current snapshot.
    ///
    /// # Errors
    /// The errors of [`WorldBuilder::build`]. On an error the current snapshot and the edits stay.
    pub fn commit(&mut self) -> Result<Arc<World>, WorldError> {
        let world = Arc::new(self.builder.rebuild(&self.options, &self.current.current())?);
        *self.current.0.write().unwrap_or_else(PoisonError::into_inner) = world.clone();
        Ok(world)
    }

    /// The last committed world.
    pub fn snapshot(&self) -> Arc<World> {
        self.current.current()
    }

    /// A handle for other threads, through which they get all later commits.
    pub fn snapshots(&self) -> Snapshots {
        self.current.clone()
    }
}
