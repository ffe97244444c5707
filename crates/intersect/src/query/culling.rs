//! Queries in which surfaces are seen from one side only.

#[cfg(test)]
mod tests;

use crate::hit::{DHit, Hit};
use crate::precision::{Double, Precision, Single};
use crate::search::HitFilter;
use crate::search::rays::RayQuery;
use crate::world::World;
use crate::world::double::DWorld;
use snell_math::{DRay, Ray};

/// A side of a surface. The geometric normal points away from the front: for a triangle, its
/// vertices go round counterclockwise as seen from there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The outer side.
    Front,
    /// The inner side.
    Back,
}

/// A filter that lets rays pass through surfaces that they meet from one side, on all geometries
/// of a world. All other hits are as without it: a mesh stays as watertight as it is.
#[derive(Clone, Copy, Debug)]
pub struct Culled<'a, W> {
    world: &'a W,
    side: Side,
}

impl<'a, W> Culled<'a, W> {
    /// Ignores hits on this side of surfaces in queries of `world`.
    pub fn new(world: &'a W, side: Side) -> Self {
        Self { world, side }
    }
}

impl HitFilter<Single> for Culled<'_, World> {
    fn accept(&self, ray: &Ray, hit: &Hit) -> bool {
        self.accept_at(ray, 0.0, hit)
    }

    fn accept_at(&self, ray: &Ray, time: f32, hit: &Hit) -> bool {
        let is_front = self.world.is_entering(RayQuery { time, ..RayQuery::from(ray) }, hit);
        is_front == (self.side == Side::Back)
    }

    fn decides_everywhere(&self) -> bool {
        true
    }
}

impl HitFilter<Double> for Culled<'_, DWorld> {
    fn accept(&self, ray: &DRay, hit: &DHit) -> bool {
        self.accept_at(ray, 0.0, hit)
    }

    fn accept_at(&self, ray: &DRay, time: f32, hit: &DHit) -> bool {
        let is_front = self.world.is_entering(RayQuery { time, ..RayQuery::from(ray) }, hit);
        is_front == (self.side == Side::Back)
    }

    fn decides_everywhere(&self) -> bool {
        true
    }
}

/// Two filters, of which both must accept a hit.
pub struct Both<'a, P: Precision>(pub &'a dyn HitFilter<P>, pub &'a dyn HitFilter<P>);

impl<P: Precision> HitFilter<P> for Both<'_, P> {
    fn accept(&self, ray: &P::Ray, hit: &P::Hit) -> bool {
        self.0.accept(ray, hit) && self.1.accept(ray, hit)
    }

    fn accept_at(&self, ray: &P::Ray, time: f32, hit: &P::Hit) -> bool {
        self.0.accept_at(ray, time, hit) && self.1.accept_at(ray, time, hit)
    }

    fn decides_everywhere(&self) -> bool {
        self.0.decides_everywhere() || self.1.decides_everywhere()
    }
}
