//! Inside and outside: occupancy, signed distances and winding numbers, also for open meshes and
//! triangle soups.
//!
//! What is inside follows from the bodies of the world, one by one ([`InsideMethod`]). The
//! generalised winding number around a point (Jacobson, Kavan and Sorkine-Hornung 2013) is a sum
//! instead: the signed solid angle of all surfaces seen from the point, over `4 pi`. It is 1 inside
//! a closed surface, 0 outside, 2 inside two of them, and -1 inside one that is inside out. Around
//! open surfaces it varies smoothly, and a half is the natural boundary. The outer side is that of
//! the normal (right-hand rule for triangles), also in mirrored instances.

#[cfg(test)]
mod tests;

use super::nearest::Space;
use crate::hit::{DNearestPoint, NearestPoint};
use crate::precision::{Double, Precision};
use crate::search::AcceptAll;
use crate::search::points::{InsideMethod, Points};
use crate::search::rays::Rays;
use crate::world::World;
use crate::world::double::DWorld;
use crate::world::winding::{ACCURACY, Side, Winding};
use snell_math::{DRay, DVec3, Ray, Vec3};

/// The direction of the rays whose hits are counted for [`InsideMethod::Parity`]: along none of the
/// directions in which things are built.
const DIRECTION: DVec3 = DVec3::new(0.237_116_4, 0.541_958_7, 0.806_252_3);

impl World {
    /// The generalised winding number of all surfaces around each point, among geometries and
    /// instances that share a bit with the mask of the points; 0 for points that are not finite.
    ///
    /// Closed meshes and solid shapes count exactly, whatever their placement, and so does each
    /// sphere and each curve segment of a set. Distant triangles of open meshes are approximated in
    /// clusters (Barill et al. 2018), with errors of up to a few hundredths next to large surfaces
    /// and much less elsewhere; [`Self::winding_number_exact`] sums all of these.
    ///
    /// The first call takes the meshes apart and builds trees that are kept with the world: about
    /// 40 bytes per triangle of a closed mesh and 100 of an open one.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn winding_number<'a>(&self, points: impl Into<Points<'a>>, numbers: &mut [f64]) {
        self.space().winding_numbers(points.into(), numbers);
    }

    /// Computes [`Self::winding_number`] around a point in double precision, which is not rounded.
    pub fn winding_number_at(&self, point: DVec3) -> f64 {
        self.space().winding().around(&self.options, point, u64::MAX, ACCURACY)
    }

    /// True if a point in double precision, which is not rounded, is inside; see
    /// [`Self::occupancy`].
    pub fn is_inside(&self, point: DVec3) -> bool {
        self.space().winding().side(&self.options, point, u64::MAX) != Side::Outside
    }

    /// The generalised winding number without approximation, exact up to rounding. It takes time
    /// proportional to the number of triangles of open meshes.
    pub fn winding_number_exact(&self, point: Vec3) -> f64 {
        let winding = self.space().winding();
        winding.around(&self.options, point.as_dvec3(), u64::MAX, f64::INFINITY)
    }

    /// For each point, whether it is inside, as [`Points::method`] has it, among geometries and
    /// instances that share a bit with the mask of the points. Points that are not finite are
    /// outside. Limits on the distance do not matter.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occupancy<'a>(&self, points: impl Into<Points<'a>>, inside: &mut [bool]) {
        let points = points.into();
        if points.method == InsideMethod::Parity {
            let direction = DIRECTION.as_vec3();
            let rays: Vec<Ray> = points.points.iter().map(|&p| Ray::new(p, direction)).collect();
            let (masks, mut counts) = (vec![points.mask; rays.len()], vec![0; rays.len()]);
            self.count(Rays::new(&rays).with_masks(&masks), &AcceptAll, &mut counts);
            self.space().by_parity(points, &counts, inside);
        } else {
            self.space().by_bodies(points, inside);
        }
    }

    /// The distance of each point to the nearest surface, in world units, negative inside (see
    /// [`Self::occupancy`]) and 0 on a surface. Where no surface is within `max_distance`, the
    /// result is `max_distance` with the sign of inside or outside. It is infinite in an empty
    /// world and for points that are not finite. The mask of the points selects the surfaces, also
    /// for the sign.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn signed_distance<'a>(&self, points: impl Into<Points<'a>>, distances: &mut [f32]) {
        let points = points.into();
        let mut nearest = vec![NearestPoint::NONE; points.len()];
        self.nearest_point(points, &mut nearest);
        let found = nearest.iter().map(|near| near.is_found().then(|| near.distance.into()));
        let mut inside = vec![false; points.len()];
        self.occupancy(points, &mut inside);
        signed(points, found, &inside, distances, |x| x as f32);
    }
}

impl DWorld {
    /// The generalised winding number of all surfaces around each point (see
    /// [`World::winding_number`]). Meshes are used in double precision.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn winding_number<'a>(&self, points: impl Into<Points<'a, Double>>, numbers: &mut [f64]) {
        self.space().winding_numbers(points.into(), numbers);
    }

    /// The generalised winding number without approximation; see [`World::winding_number_exact`].
    pub fn winding_number_exact(&self, point: DVec3) -> f64 {
        let winding = self.space().winding();
        winding.around(&self.world.options, point, u64::MAX, f64::INFINITY)
    }

    /// For each point, whether it is inside; see [`World::occupancy`].
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occupancy<'a>(&self, points: impl Into<Points<'a, Double>>, inside: &mut [bool]) {
        let points = points.into();
        if points.method == InsideMethod::Parity {
            let rays: Vec<DRay> = points.points.iter().map(|&p| DRay::new(p, DIRECTION)).collect();
            let (masks, mut counts) = (vec![points.mask; rays.len()], vec![0; rays.len()]);
            self.count(Rays::new(&rays).with_masks(&masks), &AcceptAll, &mut counts);
            self.space().by_parity(points, &counts, inside);
        } else {
            self.space().by_bodies(points, inside);
        }
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
        let mut inside = vec![false; points.len()];
        self.occupancy(points, &mut inside);
        signed(points, found, &inside, distances, |x| x);
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

    fn winding_numbers<P: Precision>(&self, points: Points<P>, numbers: &mut [f64]) {
        assert_eq!(points.len(), numbers.len(), "one answer per point");
        let (winding, options) = (self.winding(), &self.world.options);
        for (&point, number) in points.points.iter().zip(numbers) {
            *number = winding.around(options, point.into(), points.mask, ACCURACY);
        }
    }

    /// Answers [`InsideMethod::Auto`] and [`InsideMethod::Winding`].
    fn by_bodies<P: Precision>(&self, points: Points<P>, inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer per point");
        let (winding, options) = (self.winding(), &self.world.options);
        for (&point, inside) in points.points.iter().zip(inside) {
            let point: DVec3 = point.into();
            *inside = if points.method == InsideMethod::Winding {
                winding.exceeds_half(options, point, points.mask)
                    || self.touches(point, points.mask)
            } else {
                winding.side(options, point, points.mask) != Side::Outside
            };
        }
    }

    /// Answers [`InsideMethod::Parity`], given the number of hits of the ray from each point.
    fn by_parity<P: Precision>(&self, points: Points<P>, counts: &[u32], inside: &mut [bool]) {
        assert_eq!(points.len(), inside.len(), "one answer per point");
        for ((&point, inside), count) in points.points.iter().zip(inside).zip(counts) {
            *inside = count % 2 == 1 || self.touches(point.into(), points.mask);
        }
    }

    /// True if a point is on a surface, at distance zero.
    fn touches(&self, point: DVec3, mask: u64) -> bool {
        self.nearest(point, 0.0, mask, &mut Vec::new()).is_found()
    }
}

/// Gives distances their signs; `round` converts them to the precision of the results.
fn signed<P: Precision>(
    points: Points<P>,
    found: impl Iterator<Item = Option<f64>>,
    inside: &[bool],
    distances: &mut [P::Distance],
    round: impl Fn(f64) -> P::Distance,
) {
    assert_eq!(points.len(), distances.len(), "one answer per point");
    for (i, (distance, found)) in distances.iter_mut().zip(found).enumerate() {
        let limit = points.limit(i);
        let far = if limit.is_nan() || limit < 0.0 { f64::INFINITY } else { limit };
        let size = found.unwrap_or(far);
        *distance = round(if inside[i] && size > 0.0 { -size } else { size });
    }
}
