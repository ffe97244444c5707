//! The queries of worlds of either precision, for code that is generic over both.

use super::all::AllHits;
use crate::precision::{Double, Precision, Single};
use crate::search::points::Points;
use crate::search::rays::Rays;
use crate::search::{Grouping, HitFilter};
use crate::world::double::DWorld;
use crate::world::{BuildStats, World};

macro_rules! queries {
    ($(
        $(#[doc = $doc:literal])+
        fn $name:ident(&self, $($argument:ident: $type:ty),+) $(-> $answer:ty)?;
    )+) => {
        /// The queries of a [`World`] or a [`DWorld`], under the same names.
        pub trait Queries: Sync {
            /// The precision of coordinates, rays and results.
            type Precision: Precision;

            /// Statistics of the build; see [`World::stats`].
            fn stats(&self) -> &BuildStats;

            $($(#[doc = $doc])+
            fn $name(&self, $($argument: $type),+) $(-> $answer)?;)+
        }

        impl Queries for World {
            type Precision = Single;

            fn stats(&self) -> &BuildStats {
                self.stats()
            }

            $(fn $name(&self, $($argument: $type),+) $(-> $answer)? {
                self.$name($($argument),+)
            })+
        }

        impl Queries for DWorld {
            type Precision = Double;

            fn stats(&self) -> &BuildStats {
                self.stats()
            }

            $(fn $name(&self, $($argument: $type),+) $(-> $answer)? {
                self.$name($($argument),+)
            })+
        }
    };
}

/// The type of a batch of rays of a world; the types of hits, points and distances follow.
type RaysOf<'a, W> = Rays<'a, <W as Queries>::Precision>;
type PointsOf<'a, W> = Points<'a, <W as Queries>::Precision>;
type FilterOf<'a, W> = &'a dyn HitFilter<<W as Queries>::Precision>;
type HitOf<W> = <<W as Queries>::Precision as Precision>::Hit;
type NearestOf<W> = <<W as Queries>::Precision as Precision>::Nearest;
type DistanceOf<W> = <<W as Queries>::Precision as Precision>::Distance;

queries! {
    /// The nearest hit of each ray; see [`World::closest`].
    fn closest(
        &self,
        rays: RaysOf<'_, Self>,
        grouping: Grouping,
        filter: FilterOf<'_, Self>,
        hits: &mut [HitOf<Self>]
    );
    /// For each ray, whether anything lies in its interval; see [`World::occluded`].
    fn occluded(
        &self,
        rays: RaysOf<'_, Self>,
        grouping: Grouping,
        filter: FilterOf<'_, Self>,
        blocked: &mut [bool]
    );
    /// The number of hits of each ray; see [`World::count`].
    fn count(&self, rays: RaysOf<'_, Self>, filter: FilterOf<'_, Self>, counts: &mut [u32]);
    /// Every hit of each ray; see [`World::all`].
    fn all(&self, rays: RaysOf<'_, Self>, filter: FilterOf<'_, Self>) -> AllHits<Self::Precision>;
    /// The nearest surface point to each point; see [`World::nearest_point`].
    fn nearest_point(&self, points: PointsOf<'_, Self>, nearest: &mut [NearestOf<Self>]);
    /// The distance from each point to the nearest surface, negative inside; see
    /// [`World::signed_distance`].
    fn signed_distance(&self, points: PointsOf<'_, Self>, distances: &mut [DistanceOf<Self>]);
    /// The winding number around each point; see [`World::winding_number`].
    fn winding_number(&self, points: PointsOf<'_, Self>, numbers: &mut [f64]);
    /// For each point, whether it is inside; see [`World::occupancy`].
    fn occupancy(&self, points: PointsOf<'_, Self>, inside: &mut [bool]);
}
