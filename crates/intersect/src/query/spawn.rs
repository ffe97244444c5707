//! Rays that leave the surfaces that other rays have hit.
//!
//! The origin of such a ray is offset from the hit by a bound on the error of its position (Pharr,
//! Jakob and Humphreys, Physically Based Rendering, 4th edition, section 6.8.6). That puts it on
//! the right side of the surface that was hit, but a step of rounding beside an edge may still put
//! it on the wrong side of the next wall. So a reflected ray's origin is accepted only if nothing
//! is between it and the origin of the ray that found the hit; otherwise it moves back along that
//! ray, which came through free space, as far as its origin. Rays of a closed room therefore stay
//! in it.

#[cfg(test)]
mod tests;

use super::queries::Queries;
use crate::hit::{DHit, DSurfacePoint, Hit};
use crate::precision::{Facts, Precision};
use crate::search::rays::{RayQuery, Rays};
use crate::search::{Grouping, HitFilter};
use crate::world::World;
use crate::world::double::DWorld;
use snell_math::{DRay, DVec3, Ray};

/// The origins that are tried: the factor of the error by which each is moved back along the ray
/// that found the hit.
const BACKWARDS: [f64; 6] = [0.0, 1.0, 4.0, 32.0, 512.0, 32768.0];

/// The way back to the origin of the earlier ray is free if nothing is on this part of it. The rest
/// is left out, because the direction of the way is rounded.
const WAY_BACK: f64 = 1.0 - 1.0 / (1 << 18) as f64;

/// Hits at most so many times their error from the origin of their ray lie deep in a corner. If no
/// other origin is free, the new ray starts there too.
const DEEP: f64 = 256.0;

/// The largest distance of a hit from its ray, relative to its distance from the origin. Beyond it
/// the ray is not the one that found the hit.
const OFF_THE_RAY: f64 = 1e-3;

/// The operations that differ between the precisions.
trait Spawning: Queries<Precision: Facts> {
    /// The point of a hit.
    fn site(
        &self,
        ray: RayQuery<Self::Precision>,
        hit: &<Self::Precision as Precision>::Hit,
    ) -> DSurfacePoint;

    /// The next number of this precision beyond `x` in the direction of `towards`; `x` itself,
    /// rounded, if that is 0.
    fn beyond(x: f64, towards: f64) -> f64;

    /// The ray with this origin, direction and interval, rounded.
    fn ray(ray: &DRay) -> <Self::Precision as Precision>::Ray;
}

impl Spawning for World {
    fn site(&self, ray: RayQuery, hit: &Hit) -> DSurfacePoint {
        (&self.point(ray, hit)).into()
    }

    fn beyond(x: f64, towards: f64) -> f64 {
        let near = x as f32;
        match towards {
            up if up > 0.0 => near.next_up().into(),
            down if down < 0.0 => near.next_down().into(),
            _ => near.into(),
        }
    }

    fn ray(ray: &DRay) -> Ray {
        Ray {
            origin: ray.origin.as_vec3(),
            direction: ray.direction.as_vec3(),
            t_min: ray.t_min as f32,
            t_max: ray.t_max as f32,
        }
    }
}

impl Spawning for DWorld {
    fn site(&self, ray: RayQuery<crate::precision::Double>, hit: &DHit) -> DSurfacePoint {
        self.point(ray, hit)
    }

    fn beyond(x: f64, towards: f64) -> f64 {
        match towards {
            up if up > 0.0 => x.next_up(),
            down if down < 0.0 => x.next_down(),
            _ => x,
        }
    }

    fn ray(ray: &DRay) -> DRay {
        *ray
    }
}

macro_rules! spawn {
    ($world:ident, $precision:ty, $hit:ty) => {
        impl $world {
            /// The origins of new rays that leave the surfaces at `hits`, which `rays` found, in
            /// these directions (of any length). Each is beside its hit, on the side to which the
            /// direction points, as near as rounding allows; the new rays do not hit the flat
            /// surface that they start on, and reflected rays do not leave a closed room. NaN where
            /// there is no hit.
            ///
            /// Masks, times, intervals and the filter should be those with which the hits were
            /// found.
            ///
            /// # Panics
            /// If the slices differ in length, or if a hit does not belong to this world.
            pub fn spawn<'a>(
                &self,
                rays: impl Into<Rays<'a, $precision>>,
                filter: &dyn HitFilter<$precision>,
                hits: &[$hit],
                directions: &[DVec3],
                origins: &mut [DVec3],
            ) {
                spawn_all(self, rays.into(), filter, hits, directions, origins);
            }
        }
    };
}

spawn!(World, crate::precision::Single, Hit);
spawn!(DWorld, crate::precision::Double, DHit);

/// A hit whose new ray still has no origin.
struct Open {
    number: usize,
    site: DSurfacePoint,
    /// The normal on the side of the new ray.
    normal: DVec3,
    /// The unit direction back along the ray that found the hit.
    back: DVec3,
    /// The origin of that ray.
    from: DVec3,
}

impl Open {
    /// A bound on the error of the position, with a step of rounding, so that the next number is on
    /// the same side. It is not 0 at the origin either, where there are numbers of any size.
    fn error<W: Spawning>(&self) -> DVec3 {
        let step = |x: f64| (W::beyond(x.abs(), 1.0) - x.abs()).abs();
        let least = self.from.distance(self.site.position) * f64::EPSILON;
        self.site.position_error
            + DVec3::from_array(self.site.position.to_array().map(step))
            + least
    }

    /// The origin that is tried in a round.
    fn origin<W: Spawning>(&self, backwards: f64) -> DVec3 {
        let (position, error) = (self.site.position, self.error::<W>());
        let half_way = 0.5 * self.from.distance(position);
        // Half of it is left when the way back starts closer to the surface.
        let aside = self.normal * (2.0 * self.normal.abs().dot(error));
        let offset = aside + self.back * (self.back.abs().dot(error) * backwards).min(half_way);
        stepped::<W>(position + offset, offset)
    }

    /// True if the earlier ray started beside the hit.
    fn is_deep<W: Spawning>(&self) -> bool {
        (self.from - self.site.position).abs().cmple(self.error::<W>() * DEEP).all()
    }
}

/// The sign of each coordinate; 0 for 0.
fn signs(v: DVec3) -> DVec3 {
    DVec3::from_array(v.to_array().map(|x| if x == 0.0 { 0.0 } else { x.signum() }))
}

/// The point with each coordinate moved to the next number in the direction of `towards`.
fn stepped<W: Spawning>(point: DVec3, towards: DVec3) -> DVec3 {
    DVec3::new(
        W::beyond(point.x, towards.x),
        W::beyond(point.y, towards.y),
        W::beyond(point.z, towards.z),
    )
}

fn spawn_all<W: Spawning>(
    world: &W,
    rays: Rays<W::Precision>,
    filter: &dyn HitFilter<W::Precision>,
    hits: &[<W::Precision as Precision>::Hit],
    directions: &[DVec3],
    origins: &mut [DVec3],
) {
    assert!(
        [hits.len(), directions.len(), origins.len()] == [rays.len(); 3],
        "one hit, direction and origin per ray"
    );
    let mut open = Vec::new();
    for (i, hit) in hits.iter().enumerate() {
        if W::Precision::ids(hit)[1] == Hit::NONE {
            origins[i] = DVec3::NAN;
            continue;
        }
        let site = world.site(rays.get(i), hit);
        let ray = W::Precision::exact(rays.get(i).ray);
        let front = site.geometric_normal;
        let (arrives, leaves) = (ray.direction.dot(front), directions[i].dot(front));
        // Directions along the surface stay on the side from which the earlier ray came.
        let is_outside = if leaves == 0.0 { arrives <= 0.0 } else { leaves > 0.0 };
        let normal = if is_outside { front } else { -front };
        let is_reflected = is_outside == (arrives <= 0.0);
        let back = -ray.direction.normalize_or_zero();
        let next = Open { number: i, site, normal, back, from: ray.origin };
        origins[i] = next.origin::<W>(0.0);
        let way = ray.origin - site.position;
        let reach = OFF_THE_RAY * way.length() + 4.0 * next.error::<W>().length();
        if is_reflected && (way - back * way.dot(back)).length() <= reach {
            open.push(next);
        }
    }
    for backwards in BACKWARDS {
        if open.is_empty() {
            return;
        }
        let tried: Vec<DVec3> = open.iter().map(|hit| hit.origin::<W>(backwards)).collect();
        let blocked = ways_back(world, &rays, filter, &open, &tried);
        let mut blocked = blocked.iter().zip(tried);
        open.retain(|hit| {
            let (is_blocked, origin) = blocked.next().expect("one answer per hit");
            if !is_blocked {
                origins[hit.number] = origin;
            }
            *is_blocked
        });
    }
    // What is still open keeps its first origin: something that the earlier ray did not meet, such
    // as what lies before its `t_min`, is between.
    for hit in open.iter().filter(|hit| hit.is_deep::<W>()) {
        origins[hit.number] = hit.from;
    }
}

/// For each hit, whether something is between the origin tried and that of the earlier ray.
fn ways_back<W: Spawning>(
    world: &W,
    rays: &Rays<W::Precision>,
    filter: &dyn HitFilter<W::Precision>,
    open: &[Open],
    tried: &[DVec3],
) -> Vec<bool> {
    let ways: Vec<_> = open
        .iter()
        .zip(tried)
        .map(|(hit, origin)| {
            let ray = W::Precision::exact(rays.get(hit.number).ray);
            // The way starts a little farther, so that an origin on a surface is not taken.
            let away = *origin - ray.origin;
            let start = stepped::<W>(*origin + hit.error::<W>() * 0.5 * signs(away), away);
            let direction = ray.origin - start;
            // What lies before the start of the earlier ray's interval does not count.
            let skipped = ray.direction.length() * ray.t_min / direction.length();
            let t_max = (1.0 - skipped.max(0.0)).min(1.0) * WAY_BACK;
            W::ray(&DRay { origin: start, direction, t_min: 0.0, t_max })
        })
        .collect();
    let queries = || open.iter().map(|hit| rays.get(hit.number));
    let masks: Vec<_> = queries().map(|query| query.mask).collect();
    let times: Vec<_> = queries().map(|query| query.time).collect();
    let mut batch = Rays::new(&ways);
    if rays.has_masks() {
        batch = batch.with_masks(&masks);
    }
    if rays.has_times() {
        batch = batch.with_times(&times);
    }
    let mut blocked = vec![false; ways.len()];
    world.occluded(batch, Grouping::None, filter, &mut blocked);
    blocked
}
