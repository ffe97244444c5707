//! Single and double precision: what worlds of `f32` coordinates and worlds of `f64` coordinates do
//! differently.
//!
//! Trees, boxes and kernels are the same for both, in `f32`: boxes and filters only skip. What
//! decides is different: how a ray is brought into the coordinates of a tree, and the exact test of
//! a triangle.

use crate::accel::bvh::{Forest, GroupTree};
use crate::hit::{DHit, Hit};
use crate::kernel::double::frame::Frame;
use crate::kernel::double::{self, DoubleData};
use crate::kernel::interleave::Batch;
use crate::kernel::list::Begun;
use crate::kernel::packet::bundle::{Bundle, PerRay};
use crate::kernel::packet::exact::{Found, Pairs};
use crate::kernel::packet::exact_rays::LaneRays;
use crate::kernel::packet::sure::{Decided, Sure};
use crate::kernel::quick::QuickRay;
use crate::kernel::ray::LocalRay;
use crate::kernel::triangle::{
    TriangleBlock, exact_hit, height_and_speed, hit_in_plane, is_behind,
};
use crate::kernel::{list, packet};
use crate::query::nearest::{DNearestPoint, NearestPoint};
use crate::query::search::{Goal, Search};
use snell_math::simd::{Lanes8, Lanes16, Wide, WideLanes};
use snell_math::{DRay, DVec2, DVec3, Ray, Vec2, Vec3};
use std::cmp::Ordering;
use std::fmt::Debug;

/// The precision of a world's coordinates and rays: [`Single`] or [`Double`].
pub trait Precision:
    sealed::Sealed + Copy + Debug + Default + PartialEq + Send + Sync + 'static
{
    /// Rays of the world.
    type Ray: Copy + Debug + Sync;
    /// What queries answer with.
    type Hit: Copy + Debug + Default + PartialEq + Send + Sync;
    /// Points, where queries are about those.
    type Point: Copy + Debug + PartialEq + Into<DVec3> + Send + Sync;
    /// Distances from them.
    type Distance: Copy + Debug + PartialEq + Into<f64> + Send + Sync;
    /// What queries for the nearest point answer with.
    type Nearest: Copy + Debug + Default + PartialEq + Send + Sync;
}

/// `f32`: [`Ray`] and [`Hit`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Single;

/// `f64`: [`DRay`] and [`DHit`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Double;

impl Precision for Single {
    type Ray = Ray;
    type Hit = Hit;
    type Point = Vec3;
    type Distance = f32;
    type Nearest = NearestPoint;
}

impl Precision for Double {
    type Ray = DRay;
    type Hit = DHit;
    type Point = DVec3;
    type Distance = f64;
    type Nearest = DNearestPoint;
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for super::Single {}
    impl Sealed for super::Double {}
}

/// A distance: `f32` or `f64`.
pub(crate) trait Real: Copy + Debug + PartialOrd + Into<f64> {
    /// Nothing.
    const ZERO: Self;

    /// The next greater number.
    fn next_up(self) -> Self;

    /// The order of all numbers, NaN included.
    fn compare(self, other: Self) -> Ordering;

    /// The greatest `f32` that is not above.
    fn below(self) -> f32;

    /// The least `f32` that is not below.
    fn above(self) -> f32;
}

impl Real for f32 {
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn next_up(self) -> Self {
        self.next_up()
    }

    #[inline(always)]
    fn compare(self, other: Self) -> Ordering {
        self.total_cmp(&other)
    }

    #[inline(always)]
    fn below(self) -> f32 {
        self
    }

    #[inline(always)]
    fn above(self) -> f32 {
        self
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn next_up(self) -> Self {
        self.next_up()
    }

    #[inline(always)]
    fn compare(self, other: Self) -> Ordering {
        self.total_cmp(&other)
    }

    #[inline(always)]
    fn below(self) -> f32 {
        let near = self as f32;
        if f64::from(near) > self { near.next_down() } else { near }
    }

    #[inline(always)]
    fn above(self) -> f32 {
        let near = self as f32;
        if f64::from(near) < self { near.next_up() } else { near }
    }
}

/// The rules of a precision, as searches use them.
pub(crate) trait Rules: Precision {
    /// Distances.
    type Real: Real;

    /// What searches need to know besides the trees.
    type Data: Sync;

    /// A hit that is none.
    const MISS: Self::Hit;

    /// Where the interval of a ray starts and ends.
    fn interval(ray: &Self::Ray) -> [Self::Real; 2];

    /// True if the ray can hit anything.
    fn is_valid(ray: &Self::Ray) -> bool;

    /// The ray in `f64`.
    fn exact(ray: &Self::Ray) -> DRay;

    /// About where the ray starts.
    fn origin(ray: &Self::Ray) -> Vec3;

    /// A hit: distance (rounded), parameters, and instance, geometry and primitive.
    fn hit(t: f64, uv: Vec2, ids: [u32; 3]) -> Self::Hit;

    /// The distance of a hit.
    fn t(hit: &Self::Hit) -> Self::Real;

    /// Instance, geometry and primitive of a hit.
    fn ids(hit: &Self::Hit) -> [u32; 3];

    /// What decides between equally far hits: the ids, then the bits of the parameters.
    fn rank(hit: &Self::Hit) -> [u64; 5];

    /// The hit on a quad that a hit on one of its triangles is ([`crate::geometry::quads`]).
    fn quad_hit(hit: &Self::Hit) -> Self::Hit;

    /// A ray of a group in the coordinates that the structures of the group are in.
    fn ray_in_structure(data: &Self::Data, group: usize, ray: &DRay) -> DRay;

    /// Sixteen rays of a group in the coordinates that the structures of the group are in: as
    /// [`Self::ray_in_structure`].
    fn rays_in_structure<W: Lanes16>(
        token: W::Token,
        data: &Self::Data,
        group: usize,
        rays: LaneRays<W>,
    ) -> LaneRays<W>;

    /// A ray in the coordinates of a group, as the kernels want it.
    fn local_ray(data: &Self::Data, group: usize, ray: &DRay) -> LocalRay;

    /// Prepares a ray of the world for the fast kernels, in the root group; false if it is not
    /// ordinary, or its interval is empty or begins below zero.
    fn prepare_root<L: Lanes8>(data: &Self::Data, quick: &mut QuickRay, ray: &Self::Ray) -> bool;

    /// Prepares a ray of a group for the fast kernels; false if it is not ordinary.
    fn prepare<L: Lanes8>(
        data: &Self::Data,
        group: usize,
        quick: &mut QuickRay,
        ray: &DRay,
    ) -> bool;

    /// Which triangles of the block the line of an ordinary ray may pass through
    /// ([`crate::kernel::triangle::lines_through`]).
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &QuickRay) -> u32;

    /// As [`Self::triangle_hit`] for an ordinary ray; `origin` and `direction` are in the
    /// coordinates of the group.
    fn hit_on_line<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &QuickRay,
        origin: &DVec3,
        direction: &DVec3,
        corners: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<Self::Hit>;

    /// As [`Self::hit`], of what [`Self::exact_hits`] has found.
    fn found(t: Self::Real, uv: [Self::Real; 2], ids: [u32; 3]) -> Self::Hit;

    /// A point of a group in the coordinates that the structures of the group are in.
    fn point_in_structure(data: &Self::Data, group: usize, point: DVec3) -> DVec3;

    /// About the way back.
    fn point_in_group(data: &Self::Data, group: usize, point: DVec3) -> DVec3;

    /// How far vertices in the structures of a group may be from where they should be.
    fn slack(data: &Self::Data, group: usize) -> f32;

    /// Makes a bundle of a run of rays in the root group, if possible described from where `anchor`
    /// starts or ends; false if it is none. Lanes without a ray repeat the first one and want
    /// nothing.
    fn set_up_bundle<W: Lanes16>(
        token: W::Token,
        data: &Self::Data,
        bundle: &mut Bundle,
        rays: &[Self::Ray],
        anchor: &Self::Ray,
        backward: bool,
    ) -> bool;

    /// The exact test for up to eight pairs of a ray of the bundle and a triangle of the tree
    /// ([`packet::exact::exact_hits`]); rows of rays must have been written if
    /// [triangles are elsewhere](Self::TRIANGLES_ELSEWHERE).
    fn exact_hits<W: Lanes16>(
        token: W::Token,
        data: &Self::Data,
        tree: &GroupTree,
        bundle: &Bundle,
        pairs: &Pairs,
        found: &mut Found<Self::Real>,
    );

    /// The exact test for the triangle of the tree that each of some rays of the bundle surely
    /// hits, or the drawing of which ([`packet::sure::test`]).
    fn sure_hits<W: Lanes16>(
        token: W::Token,
        tree: &GroupTree,
        bundle: &Bundle,
        rays: [u32; 2],
        places: &PerRay<u32>,
        sure: &mut Sure<Self::Real>,
    ) -> Decided;

    /// Searches for the first rays of a batch, or all, in the list of the forest
    /// ([`list::search_list`]); returns how many.
    fn search_list<G: Goal<Precision = Self>>(
        forest: &Forest,
        wide: Option<Wide>,
        batch: &Batch<Self>,
        begun: &mut Vec<Begun<Self::Hit>>,
        start: impl Fn(&Self::Ray) -> G,
        finish: impl FnMut(usize, G),
    ) -> usize;

    /// True if triangles are decided on what is not in the blocks: then their memory may be asked
    /// for ahead.
    const TRIANGLES_ELSEWHERE: bool;

    /// Asks for the memory of a triangle.
    fn fetch_triangle(data: &Self::Data, geometry: u32, triangle: u32);

    /// Which triangles of the block the ray may hit ([`crate::kernel::triangle::candidates`]).
    fn candidates<L: Lanes8>(
        token: L::Token,
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32;

    /// The hit on a triangle whose corners are these in the tree, after the start of the ray and
    /// not beyond what is wanted.
    fn triangle_hit<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &LocalRay,
        corners: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<Self::Hit>;

    /// True if a hit is to be reported rather than the other: nearer, or at equal distance the
    /// lower (instance, geometry, primitive).
    #[inline(always)]
    fn is_before(hit: &Self::Hit, other: &Self::Hit) -> bool {
        let (a, b) = (Self::t(hit), Self::t(other));
        a < b || (a == b && Self::rank(hit) < Self::rank(other))
    }
}

impl Rules for Single {
    type Real = f32;
    type Data = ();
    const MISS: Hit = Hit::MISS;

    #[inline(always)]
    fn interval(ray: &Ray) -> [f32; 2] {
        [ray.t_min, ray.t_max]
    }

    #[inline(always)]
    fn is_valid(ray: &Ray) -> bool {
        ray.is_valid()
    }

    #[inline(always)]
    fn exact(ray: &Ray) -> DRay {
        ray.into()
    }

    #[inline(always)]
    fn origin(ray: &Ray) -> Vec3 {
        ray.origin
    }

    #[inline(always)]
    fn hit(t: f64, uv: Vec2, [instance, geometry, primitive]: [u32; 3]) -> Hit {
        // Never minus zero.
        Hit { t: t as f32 + 0.0, uv, instance, geometry, primitive }
    }

    #[inline(always)]
    fn t(hit: &Hit) -> f32 {
        hit.t
    }

    #[inline(always)]
    fn ids(hit: &Hit) -> [u32; 3] {
        [hit.instance, hit.geometry, hit.primitive]
    }

    #[inline(always)]
    fn rank(hit: &Hit) -> [u64; 5] {
        hit.rank().map(u64::from)
    }

    #[inline(always)]
    fn quad_hit(hit: &Hit) -> Hit {
        crate::geometry::quads::quad_hit(hit)
    }

    #[inline(always)]
    fn ray_in_structure(_: &(), _: usize, ray: &DRay) -> DRay {
        *ray
    }

    #[inline(always)]
    fn rays_in_structure<W: Lanes16>(
        _: W::Token,
        _: &(),
        _: usize,
        rays: LaneRays<W>,
    ) -> LaneRays<W> {
        rays
    }

    #[inline(always)]
    fn local_ray(_: &(), _: usize, ray: &DRay) -> LocalRay {
        LocalRay::new(ray)
    }

    #[inline(always)]
    fn candidates<L: Lanes8>(
        token: L::Token,
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32 {
        crate::kernel::triangle::candidates::<L>(token, block, ray, t_min, cull)
    }

    #[inline(always)]
    fn triangle_hit<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &LocalRay,
        corners: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<Hit> {
        single_hit(search, exact_hit(ray, corners, search.start.into()), ids)
    }

    #[inline(always)]
    fn prepare_root<L: Lanes8>(_: &(), quick: &mut QuickRay, ray: &Ray) -> bool {
        quick.set_from_ray::<L>(ray)
    }

    #[inline(always)]
    fn prepare<L: Lanes8>(_: &(), _: usize, quick: &mut QuickRay, ray: &DRay) -> bool {
        quick.set_from_exact::<L>(&ray.origin, &ray.direction)
    }

    #[inline(always)]
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &QuickRay) -> u32 {
        crate::kernel::triangle::lines_through::<L>(token, block, ray)
    }

    #[inline(always)]
    fn hit_on_line<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &QuickRay,
        origin: &DVec3,
        direction: &DVec3,
        corners: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<Hit> {
        let t_min = search.start.into();
        let [height, speed] = height_and_speed(origin, direction, corners);
        // What is behind the start is so at once, without waiting for a quotient. (Which is finite:
        // of an ordinary ray, these are between `1e-150` and `1e40`.)
        if height * speed < 0.0 {
            return None;
        }
        let plane = height / speed;
        if is_behind(plane, t_min) {
            return None;
        }
        single_hit(
            search,
            hit_in_plane(&ray.exact(*origin, *direction), corners, plane, t_min),
            ids,
        )
    }

    #[inline(always)]
    fn found(t: f32, [b1, b2]: [f32; 2], [instance, geometry, primitive]: [u32; 3]) -> Hit {
        Hit { t, uv: Vec2::new(b1, b2), instance, geometry, primitive }
    }

    #[inline(always)]
    fn point_in_structure(_: &(), _: usize, point: DVec3) -> DVec3 {
        point
    }

    #[inline(always)]
    fn point_in_group(_: &(), _: usize, point: DVec3) -> DVec3 {
        point
    }

    #[inline(always)]
    fn slack(_: &(), _: usize) -> f32 {
        0.0
    }

    #[inline(always)]
    fn set_up_bundle<W: Lanes16>(
        token: W::Token,
        _: &(),
        bundle: &mut Bundle,
        rays: &[Ray],
        anchor: &Ray,
        backward: bool,
    ) -> bool {
        packet::runs::set_up::<W>(token, bundle, rays, anchor, backward)
    }

    #[inline(always)]
    fn exact_hits<W: Lanes16>(
        token: W::Token,
        _: &(),
        tree: &GroupTree,
        bundle: &Bundle,
        pairs: &Pairs,
        found: &mut Found<f32>,
    ) {
        packet::exact::exact_hits::<W>(token, &tree.blocks, bundle, pairs, found)
    }

    #[inline(always)]
    fn sure_hits<W: Lanes16>(
        token: W::Token,
        tree: &GroupTree,
        bundle: &Bundle,
        rays: [u32; 2],
        places: &PerRay<u32>,
        sure: &mut Sure<f32>,
    ) -> Decided {
        packet::sure::test::<W>(token, &tree.blocks, bundle, rays, places, sure)
    }

    #[inline(always)]
    fn search_list<G: Goal<Precision = Self>>(
        forest: &Forest,
        wide: Option<Wide>,
        batch: &Batch<Self>,
        begun: &mut Vec<Begun<Hit>>,
        start: impl Fn(&Ray) -> G,
        finish: impl FnMut(usize, G),
    ) -> usize {
        if list::is_suitable(forest, batch.rays.len()) {
            list::search_list(forest, wide, batch, begun, start, finish)
        } else {
            0
        }
    }

    const TRIANGLES_ELSEWHERE: bool = false;

    #[inline(always)]
    fn fetch_triangle(_: &(), _: u32, _: u32) {}
}

/// What the exact test in single precision has found, as a hit; `None` if it is beyond what is
/// wanted.
#[inline(always)]
fn single_hit<G: Goal<Precision = Single>>(
    search: &Search<'_, G>,
    found: Option<(f64, Vec2)>,
    ids: impl FnOnce() -> [u32; 3],
) -> Option<Hit> {
    let (t, uv) = found?;
    // Never minus zero.
    let t = t as f32 + 0.0;
    if t > search.goal.limit() {
        return None;
    }
    let [instance, geometry, primitive] = ids();
    Some(Hit { t, uv, instance, geometry, primitive })
}

impl Rules for Double {
    type Real = f64;
    type Data = DoubleData;
    const MISS: DHit = DHit::MISS;

    #[inline(always)]
    fn interval(ray: &DRay) -> [f64; 2] {
        [ray.t_min, ray.t_max]
    }

    #[inline(always)]
    fn is_valid(ray: &DRay) -> bool {
        ray.is_valid()
    }

    #[inline(always)]
    fn exact(ray: &DRay) -> DRay {
        *ray
    }

    #[inline(always)]
    fn origin(ray: &DRay) -> Vec3 {
        ray.origin.as_vec3()
    }

    #[inline(always)]
    fn hit(t: f64, uv: Vec2, [instance, geometry, primitive]: [u32; 3]) -> DHit {
        DHit { t, uv: uv.as_dvec2(), instance, geometry, primitive }
    }

    #[inline(always)]
    fn t(hit: &DHit) -> f64 {
        hit.t
    }

    #[inline(always)]
    fn ids(hit: &DHit) -> [u32; 3] {
        [hit.instance, hit.geometry, hit.primitive]
    }

    #[inline(always)]
    fn rank(hit: &DHit) -> [u64; 5] {
        let [instance, geometry, primitive] = Self::ids(hit).map(u64::from);
        [instance, geometry, primitive, hit.uv.x.to_bits(), hit.uv.y.to_bits()]
    }

    #[inline(always)]
    fn quad_hit(hit: &DHit) -> DHit {
        crate::geometry::quads::quad_hit_double(hit)
    }

    #[inline(always)]
    fn ray_in_structure(data: &DoubleData, group: usize, ray: &DRay) -> DRay {
        data.frames[group].ray(ray)
    }

    #[inline(always)]
    fn rays_in_structure<W: Lanes16>(
        token: W::Token,
        data: &DoubleData,
        group: usize,
        rays: LaneRays<W>,
    ) -> LaneRays<W> {
        let Frame { center, scale, .. } = &data.frames[group];
        rays.framed(token, center, *scale)
    }

    #[inline(always)]
    fn local_ray(data: &DoubleData, group: usize, ray: &DRay) -> LocalRay {
        data.frames[group].local_ray(ray)
    }

    #[inline(always)]
    fn candidates<L: Lanes8>(
        token: L::Token,
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32 {
        double::triangle::candidates::<L>(token, block, ray, t_min, cull)
    }

    #[inline(always)]
    fn triangle_hit<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        ray: &LocalRay,
        _: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<DHit> {
        double_hit(search, &ray.exact, ids())
    }

    #[inline(always)]
    fn prepare_root<L: Lanes8>(data: &DoubleData, quick: &mut QuickRay, ray: &DRay) -> bool {
        (ray.t_min >= 0.0) & (ray.t_min < ray.t_max) && Self::prepare::<L>(data, 0, quick, ray)
    }

    #[inline(always)]
    fn prepare<L: Lanes8>(
        data: &DoubleData,
        group: usize,
        quick: &mut QuickRay,
        ray: &DRay,
    ) -> bool {
        data.frames[group].prepare::<L>(quick, ray)
    }

    #[inline(always)]
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &QuickRay) -> u32 {
        double::triangle::lines_through::<L>(token, block, ray)
    }

    #[inline(always)]
    fn hit_on_line<G: Goal<Precision = Self>>(
        search: &Search<'_, G>,
        _: &QuickRay,
        origin: &DVec3,
        direction: &DVec3,
        _: &[[f32; 3]; 3],
        ids: impl FnOnce() -> [u32; 3],
    ) -> Option<DHit> {
        double_hit(search, &DRay::new(*origin, *direction), ids())
    }

    #[inline(always)]
    fn found(t: f64, [b1, b2]: [f64; 2], [instance, geometry, primitive]: [u32; 3]) -> DHit {
        DHit { t, uv: DVec2::new(b1, b2), instance, geometry, primitive }
    }

    #[inline(always)]
    fn point_in_structure(data: &DoubleData, group: usize, point: DVec3) -> DVec3 {
        data.frames[group].point(point)
    }

    #[inline(always)]
    fn point_in_group(data: &DoubleData, group: usize, point: DVec3) -> DVec3 {
        data.frames[group].point_in_group(point)
    }

    #[inline(always)]
    fn slack(data: &DoubleData, group: usize) -> f32 {
        data.frames[group].slack
    }

    #[inline(always)]
    fn set_up_bundle<W: Lanes16>(
        token: W::Token,
        data: &DoubleData,
        bundle: &mut Bundle,
        rays: &[DRay],
        _: &DRay,
        backward: bool,
    ) -> bool {
        packet::runs::set_up_doubles::<W>(token, data, bundle, rays, backward)
    }

    #[inline(always)]
    fn exact_hits<W: Lanes16>(
        token: W::Token,
        data: &DoubleData,
        tree: &GroupTree,
        bundle: &Bundle,
        pairs: &Pairs,
        found: &mut Found<f64>,
    ) {
        packet::doubles::exact_hits::<<W::Half as WideLanes>::Doubles>(
            W::half_token(token),
            data,
            tree,
            bundle,
            pairs,
            found,
        )
    }

    /// None: lists are in single precision.
    fn search_list<G: Goal<Precision = Self>>(
        _: &Forest,
        _: Option<Wide>,
        _: &Batch<Self>,
        _: &mut Vec<Begun<DHit>>,
        _: impl Fn(&DRay) -> G,
        _: impl FnMut(usize, G),
    ) -> usize {
        0
    }

    #[inline(always)]
    fn sure_hits<W: Lanes16>(
        _: W::Token,
        _: &GroupTree,
        _: &Bundle,
        _: [u32; 2],
        _: &PerRay<u32>,
        _: &mut Sure<f64>,
    ) -> Decided {
        Decided { hits: 0, moved: 0 }
    }

    const TRIANGLES_ELSEWHERE: bool = true;

    #[inline(always)]
    fn fetch_triangle(data: &DoubleData, geometry: u32, triangle: u32) {
        data.fetch(geometry, triangle);
    }
}

/// The hit on a triangle in double precision. `ray` is in the coordinates of the group; its
/// interval is not used.
#[inline(always)]
fn double_hit<G: Goal<Precision = Double>>(
    search: &Search<'_, G>,
    ray: &DRay,
    [instance, geometry, primitive]: [u32; 3],
) -> Option<DHit> {
    let corners = search.context.data.corners(geometry, primitive);
    let (t, uv) = double::triangle::exact_hit(ray, corners, search.ray.t_min)?;
    // Never minus zero.
    let t = t + 0.0;
    (t <= search.goal.limit()).then_some(DHit { t, uv, instance, geometry, primitive })
}
