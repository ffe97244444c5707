//! Worlds that change: edits are collected, a commit makes them visible, and readers keep what they
//! have.

#[cfg(test)]
mod tests;

use super::{BuildOptions, World, WorldBuilder, WorldError};
use std::sync::{Arc, PoisonError, RwLock};

/// A world that changes between batches.
///
/// Edits go to a [`WorldBuilder`] and show when they are committed. Each commit makes a new
/// immutable [`World`] that shares all it can with the one before: groups whose contents are the
/// same keep their structures, groups in which things only moved are refitted, and only others (and
/// those that refitting has made slow) are built. Readers in other threads keep tracing the
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

/// Where readers find the newest committed world. Cheap to copy into other threads.
#[derive(Clone, Debug)]
pub struct Snapshots(Arc<RwLock<Arc<World>>>);

impl Snapshots {
    /// The newest committed world. It never changes; ask again for a newer one.
    pub fn current(&self) -> Arc<World> {
        self.0.read().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl DynamicWorld {
    /// An empty world.
    pub fn new(options: BuildOptions) -> Self {
        Self::from_builder(WorldBuilder::default(), options)
    }

    /// A world of what a builder holds. Nothing is visible before the first commit.
    pub fn from_builder(builder: WorldBuilder, options: BuildOptions) -> Self {
        let current = Snapshots(Arc::new(RwLock::new(Arc::new(World::empty(&options)))));
        Self { builder, options, current }
    }

    /// What the next commit will hold.
    pub fn edit(&mut self) -> &mut WorldBuilder {
        &mut self.builder
    }

    /// Builds what has changed since the last commit, on the threads of the current rayon pool, and
    /// makes it the current snapshot.
    ///
    /// # Errors
    /// As [`WorldBuilder::build`]. The current snapshot stays then, and so do the edits.
    pub fn commit(&mut self) -> Result<Arc<World>, WorldError> {
        let world = Arc::new(self.builder.rebuild(&self.options, &self.current.current())?);
        *self.current.0.write().unwrap_or_else(PoisonError::into_inner) = world.clone();
        Ok(world)
    }

    /// The last committed world.
    pub fn snapshot(&self) -> Arc<World> {
        self.current.current()
    }

    /// A handle for other threads, which sees all later commits.
    pub fn snapshots(&self) -> Snapshots {
        self.current.clone()
    }
}
