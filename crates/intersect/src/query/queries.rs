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
        #[doc = $doc:literal]
        fn $name:ident(&self, $($argument:ident: $type:ty),+) $(-> $answer:ty)?;
    )+) => {
        /// The queries of a [`World`] or a [`DWorld`], by the names they have there.
        pub trait Queries: Sync {
            /// The precision of coordinates, rays and results.
            type Precision: Precision;

            /// As [`World::stats`].
            fn stats(&self) -> &BuildStats;

            $(#[doc = $doc]
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

/// Rays, hits, points and distances of a world.
type RaysOf<'a, W> = Rays<'a, <W as Queries>::Precision>;
type PointsOf<'a, W> = Points<'a, <W as Queries>::Precision>;
type FilterOf<'a, W> = &'a dyn HitFilter<<W as Queries>::Precision>;
type HitOf<W> = <<W as Queries>::Precision as Precision>::Hit;
type PointOf<W> = <<W as Queries>::Precision as Precision>::Point;
type NearestOf<W> = <<W as Queries>::Precision as Precision>::Nearest;
type DistanceOf<W> = <<W as Queries>::Precision as Precision>::Distance;

queries! {
    /// As [`World::closest`].
    fn closest(
        &self,
        rays: RaysOf<'_, Self>,
        grouping: Grouping,
        filter: FilterOf<'_, Self>,
        hits: &mut [HitOf<Self>]
    );
    /// As [`World::occluded`].
    fn occluded(
        &self,
        rays: RaysOf<'_, Self>,
        grouping: Grouping,
        filter: FilterOf<'_, Self>,
        blocked: &mut [bool]
    );
    /// As [`World::count`].
    fn count(&self, rays: RaysOf<'_, Self>, filter: FilterOf<'_, Self>, counts: &mut [u32]);
    /// As [`World::all`].
    fn all(&self, rays: RaysOf<'_, Self>, filter: FilterOf<'_, Self>) -> AllHits<Self::Precision>;
    /// As [`World::nearest_point`].
    fn nearest_point(&self, points: PointsOf<'_, Self>, nearest: &mut [NearestOf<Self>]);
    /// As [`World::signed_distance`].
    fn signed_distance(&self, points: PointsOf<'_, Self>, distances: &mut [DistanceOf<Self>]);
    /// As [`World::winding_number`].
    fn winding_number(&self, points: &[PointOf<Self>], numbers: &mut [f64]);
    /// As [`World::occupancy`].
    fn occupancy(&self, points: &[PointOf<Self>], inside: &mut [bool]);
}
