//! Winding numbers, occupancy and signed distances, also for open meshes and triangle soups.
//!
//! The generalised winding number around a point (Jacobson, Kavan and Sorkine-Hornung 2013) is the
//! signed solid angle of all surfaces seen from the point, over `4 pi`: 1 inside a closed surface,
//! 0 outside, 2 inside two of them. Around open surfaces it varies smoothly, and a half is the
//! natural boundary. The outer side is that of the normal (right-hand rule for triangles), also in
//! mirrored instances. A closed mesh turned inside out counts -1, so that one inside another is a
//! cavity.

#[cfg(test)]
mod tests;

use super::nearest::Space;
use crate::hit::{DNearestPoint, NearestPoint};
use crate::precision::{Double, Precision};
use crate::search::points::Points;
use crate::world::World;
use crate::world::double::DWorld;
use crate::world::winding::{ACCURACY, Winding};
use snell_math::{DVec3, Vec3};

impl World {
    /// The generalised winding number of all surfaces around each point; 0 for points that are not
    /// finite.
    ///
    /// Distant triangles are approximated in clusters (Barill et al. 2018), with errors of up to a
    /// few hundredths next to large open surfaces and much less elsewhere;
    /// [`Self::winding_number_exact`] sums all triangles. Closed analytic shapes count exactly 1
    /// inside and 0 outside, however they are placed, and so does each sphere and each curve
    /// segment of a set. Masks are ignored.
    ///
    /// The first call builds a tree that is kept with the world: about 40 bytes per triangle.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn winding_number(&self, points: &[Vec3], numbers: &mut [f64]) {
        assert_eq!(points.len(), numbers.len(), "one answer per point");
        let winding = self.winding();
        points
            .iter()
            .zip(numbers)
            .for_each(|(&point, number)| *number = winding.around(point.as_dvec3(), ACCURACY));
    }

    /// Computes [`Self::winding_number`] around a point in double precision, which is not rounded.
    pub fn winding_number_at(&self, point: DVec3) -> f64 {
        self.winding().around(point, ACCURACY)
    }

    /// True if a point in double precision, which is not rounded, is inside; see
    /// [`Self::occupancy`].
    pub fn is_inside(&self, point: DVec3) -> bool {
        self.winding().is_inside(point)
    }

    /// The generalised winding number without approximation, exact up to rounding. It takes time
    /// proportional to the number of triangles.
    pub fn winding_number_exact(&self, point: Vec3) -> f64 {
        self.winding().around(point.as_dvec3(), f64::INFINITY)
    }

    /// For each point, whether it is inside, that is, whether its winding number is more than a
    /// half. Where the approximation of [`Self::winding_number`] is near a half, the exact sum
    /// decides. Points that are not finite are outside.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occupancy(&self, points: &[Vec3], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer per point");
        let winding = self.winding();
        points
            .iter()
            .zip(inside)
            .for_each(|(&point, inside)| *inside = winding.is_inside(point.as_dvec3()));
    }

    /// The distance of each point to the nearest surface, in world units, negative inside (see
    /// [`Self::occupancy`]) and 0 on a surface. Where no surface is within `max_distance`, the
    /// result is `max_distance` with the sign of inside or outside. It is infinite in an empty
    /// world and for points that are not finite. The mask of the points selects the surfaces for
    /// distances; the sign comes from all surfaces.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn signed_distance<'a>(&self, points: impl Into<Points<'a>>, distances: &mut [f32]) {
        let points = points.into();
        let mut nearest = vec![NearestPoint::NONE; points.len()];
        self.nearest_point(points, &mut nearest);
        let found = nearest.iter().map(|near| near.is_found().then(|| near.distance.into()));
        self.space().signed(points, found, distances, |x| x as f32);
    }

    fn winding(&self) -> &Winding {
        self.space().winding()
    }
}

impl DWorld {
    /// The generalised winding number of all surfaces around each point (see
    /// [`World::winding_number`]). Meshes are used in double precision.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn winding_number(&self, points: &[DVec3], numbers: &mut [f64]) {
        assert_eq!(points.len(), numbers.len(), "one answer per point");
        let winding = self.space().winding();
        points
            .iter()
            .zip(numbers)
            .for_each(|(&point, number)| *number = winding.around(point, ACCURACY));
    }

    /// The generalised winding number without approximation; see [`World::winding_number_exact`].
    pub fn winding_number_exact(&self, point: DVec3) -> f64 {
        self.space().winding().around(point, f64::INFINITY)
    }

    /// For each point, whether it is inside; see [`World::occupancy`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occupancy(&self, points: &[DVec3], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer per point");
        let winding = self.space().winding();
        points.iter().zip(inside).for_each(|(&point, inside)| *inside = winding.is_inside(point));
    }

    /// The distance of each point to the nearest surface, negative inside; see
    /// [`World::signed_distance`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn signed_distance<'a>(
        &self,
        points: impl Into<Points<'a, Double>>,
        distances: &mut [f64],
    ) {
        let points = points.into();
        let mut nearest = vec![DNearestPoint::NONE; points.len()];
        self.nearest_point(points, &mut nearest);
        let found = nearest.iter().map(|near| near.is_found().then_some(near.distance));
        self.space().signed(points, found, distances, |x| x);
    }
}

impl<'a> Space<'a> {
    fn winding(&self) -> &'a Winding {
        // The tree is not built while the cell is locked: a thread that waits for parallel work may
        // start another query meanwhile, which would then deadlock.
        if self.world.winding.get().is_none() {
            // Another thread may have stored its result first.
            let _ = self.world.winding.set(Winding::of(self.world, self.double));
        }
        self.world.winding.get_or_init(|| Winding::of(self.world, self.double))
    }

    /// Gives distances their signs; `round` converts them to the precision of the results.
    fn signed<P: Precision>(
        &self,
        points: Points<P>,
        found: impl Iterator<Item = Option<f64>>,
        distances: &mut [P::Distance],
        round: impl Fn(f64) -> P::Distance,
    ) {
        assert_eq!(points.len(), distances.len(), "one answer per point");
        let winding = self.winding();
        for (i, (distance, found)) in distances.iter_mut().zip(found).enumerate() {
            let limit = points.limit(i);
            let far = if limit.is_nan() || limit < 0.0 { f64::INFINITY } else { limit };
            let size = found.unwrap_or(far);
            let is_inside = size > 0.0 && winding.is_inside(points.points[i].into());
            *distance = round(if is_inside { -size } else { size });
        }
    }
}
