//! The kernel for lists of few primitives: sixteen rays at a time against each face in turn,
//! without a tree.
//!
//! A face is a triangle, or two triangles that make a flat quadrilateral ([`faces`]). The
//! intersection of a ray with the plane of a face, and on which side of the edges it lies, are
//! computed in `f32` with an error bound ([`packet`]). For nearly all rays it is then certain which
//! face is the nearest. Distance and barycentrics on that face are computed with the operations of
//! the exact test ([`exact`]), also for sixteen rays at a time. The other rays, which come near an
//! edge, start in a plane or run along a plane, and rays of extraordinary size, are traced through
//! the tree, with the same results. Spheres and flat shapes are tested sixteen rays at a time
//! ([`shapes`]), other shapes ray by ray. All except flat shapes have their boxes tested first.

mod exact;
mod outliers;
mod packet;
mod precision;
mod shapes;
#[cfg(test)]
pub(crate) mod tests;

pub(crate) use outliers::Unresolved;
pub(crate) use precision::ListSearch;

use super::single::traverse::{Entry, Stack, search_forest, test_object};
use super::stream::interleave::Batch;
use crate::hit::Hit;
use crate::kernel::Goal;
use crate::precision::Facts;
use crate::precision::Single;
use crate::search::{Search, Verdict};
use crate::tree::Forest;
use crate::tree::list::{FIRST_OBJECT, List, ListShape, MAX_OBJECTS, Outliers};
use exact::Found;
use packet::{Blocked, ListPacket, Nearest, PerRay, RAYS};
#[cfg(target_arch = "x86_64")]
use snell_math::simd::Avx16Doubles;
use snell_math::simd::{Doubles16, Lanes8, Lanes16, PairDoubles, Token, Wide, Wide8, WideToken};
use snell_math::{Ray, Vec2, Vec3};
use std::mem::MaybeUninit;

/// The smallest batch for which a list is worthwhile.
const MIN_RAYS: usize = 4;

/// The smallest batch for which a list of outliers is worthwhile, where most rays also need the
/// tree.
const MIN_RAYS_APART: usize = 16;

/// The number of rays after which it is decided whether the list is worthwhile for a batch.
const TRIAL: usize = 128;

/// Cost model: tracing a ray through a tree costs as much as testing this number of faces of a list
/// if the ray misses.
const FACES_PER_RAY: usize = 24;
/// Cost model: tracing a ray through a tree costs as much as testing this number of further faces
/// if the ray hits.
const FACES_PER_HIT: usize = 80;

/// True if a list can handle a batch of this size, or some of its rays, for queries that need one
/// hit per ray.
pub(crate) fn is_suitable(forest: &Forest, rays: usize) -> bool {
    rays >= MIN_RAYS && forest.list.is_some() || rays >= MIN_RAYS_APART && forest.outliers.is_some()
}

/// Searches for the rays of a batch; `finish` is called with the number of each ray and its goal.
/// [`is_suitable`] must hold. If the list has only outliers, rays that must still be traced through
/// the tree of the rest are added to `unresolved`. Returns the number of rays processed, which is
/// less than all if most rays miss everything, because a tree is faster for these.
pub(crate) fn search_list<G: Goal<Precision = Single>>(
    forest: &Forest,
    wide: Option<Wide>,
    batch: &Batch<Single>,
    unresolved: &mut Vec<Unresolved<Hit>>,
    start: impl Fn(&Ray) -> G,
    finish: impl FnMut(usize, G),
) -> usize {
    let (list, outliers) = match (&forest.list, &forest.outliers) {
        (Some(list), _) => (list, None),
        (None, Some(outliers)) => (&outliers.list, Some(outliers)),
        (None, None) => return 0,
    };
    let mut small = [const { MaybeUninit::<Entry>::uninit() }; crate::tree::SMALL_STACK];
    let mut large = Vec::new();
    let stack: &mut Stack = if forest.stack_size() <= small.len() {
        &mut small
    } else {
        large.resize_with(forest.stack_size(), MaybeUninit::uninit);
        &mut large
    };
    let scene = Scene { forest, list, outliers, wide, batch, is_plain: is_plain(list, batch) };
    if outliers.is_some() && !scene.is_plain {
        return 0;
    }
    match wide {
        #[cfg(target_arch = "x86_64")]
        Some(Wide::Avx512(token)) => token.run(
            #[inline(always)]
            move || run::<Avx16Doubles, G>(token, &scene, stack, unresolved, start, finish),
        ),
        Some(wide) => {
            let token = WideToken::from(wide);
            token.run(
                #[inline(always)]
                move || {
                    run::<PairDoubles<Wide8>, G>(token, &scene, stack, unresolved, start, finish)
                },
            )
        }
        // Without wide registers, a tree is as fast.
        None => 0,
    }
}

/// The lanes for searches with single rays.
type HalfOf<D> = <<D as Doubles16>::Singles as Lanes16>::Half;

/// The list and the batch of rays.
struct Scene<'a> {
    forest: &'a Forest,
    list: &'a List,
    /// The outliers, if the list holds only these.
    outliers: Option<&'a Outliers>,
    wide: Option<Wide>,
    batch: &'a Batch<'a, Single>,
    /// True if the nearest primitive tested in lanes is always the result, because no hit on these
    /// can be rejected.
    is_plain: bool,
}

/// True if hits on primitives that are tested in lanes can be neither rejected nor changed.
fn is_plain(list: &List, batch: &Batch<Single>) -> bool {
    let accepts = |geometry: u32| {
        let options = batch.context.options[geometry as usize];
        options.mask == u64::MAX && !options.filtered && !options.quads
    };
    !batch.rays.has_masks() && list.geometries().all(accepts)
}

#[inline(always)]
fn run<D: Doubles16, G: Goal<Precision = Single>>(
    token: D::Token,
    scene: &Scene,
    stack: &mut Stack,
    unresolved: &mut Vec<Unresolved<Hit>>,
    start: impl Fn(&Ray) -> G,
    mut finish: impl FnMut(usize, G),
) -> usize {
    let half = D::Singles::half_token(token);
    let (list, all) = (scene.list, scene.batch.rays.rays());
    let more_faces = list.len().saturating_sub(FACES_PER_RAY);
    let mut last = [Ray::new(Vec3::ZERO, Vec3::Z); RAYS];
    let (mut first, mut met) = (0, 0);
    while first < all.len() {
        if scene.outliers.is_none() && first >= TRIAL && met * FACES_PER_HIT < first * more_faces {
            break;
        }
        let rays = &all[first..(first + RAYS).min(all.len())];
        let sixteen = match rays.first_chunk() {
            Some(sixteen) => sixteen,
            None => {
                last[..rays.len()].copy_from_slice(rays);
                &last
            }
        };
        let packet = ListPacket::<D>::new(token, list, sixteen, rays.len());
        let mut near = Near::new(token, scene, &packet);
        let mut uncertain = !packet.ordinary & ((2 << (rays.len() - 1)) - 1);
        let more = match scene.outliers {
            Some(outliers) => outliers.may_meet_rest(token, &packet),
            None => 0,
        };
        if G::ANY && scene.is_plain {
            let mut found = packet.blocked(token, list);
            near.block(token, list, &packet, &mut found);
            let others = near.any();
            uncertain |= found.doubtful & !found.blocked & packet.ordinary;
            met += (found.met | uncertain).count_ones() as usize;
            for (lane, ray) in rays.iter().enumerate() {
                if uncertain >> lane & 1 == 1 {
                    continue;
                }
                let is_blocked = found.blocked >> lane & 1 == 1;
                if scene.outliers.is_some() && !is_blocked && more >> lane & 1 == 1 {
                    unresolved.push(Unresolved { number: (first + lane) as u32, hit: None });
                } else if is_blocked || others >> lane & 1 == 0 {
                    let mut goal = start(ray);
                    if is_blocked {
                        goal.take(Hit::MISS);
                    }
                    finish(first + lane, goal);
                } else {
                    let query = scene.batch.rays.get(first + lane);
                    let mut search = Search::new(query, scene.batch.context, start(ray));
                    test_objects::<HalfOf<D>, G>(half, scene, near.of(lane), &mut search, stack);
                    finish(first + lane, search.goal);
                }
            }
        } else {
            let mut found = Hits::of(token, list, &packet);
            if scene.is_plain {
                found.take_shapes(token, list, &packet, &mut near);
            }
            let others = near.any();
            uncertain |= found.uncertain;
            met += found.met.count_ones() as usize;
            for (lane, ray) in rays.iter().enumerate() {
                if uncertain >> lane & 1 == 1 {
                    continue;
                }
                if scene.outliers.is_some() && more >> lane & 1 == 1 {
                    unresolved.push(Unresolved {
                        number: (first + lane) as u32,
                        hit: found.get(list, lane),
                    });
                } else if scene.is_plain && others >> lane & 1 == 0 {
                    let mut goal = start(ray);
                    if let Some(hit) = found.get(list, lane) {
                        goal.take(hit);
                    }
                    finish(first + lane, goal);
                } else {
                    let query = scene.batch.rays.get(first + lane);
                    let mut search = Search::new(query, scene.batch.context, start(ray));
                    offer::<HalfOf<D>, G>(
                        half,
                        scene,
                        found.get(list, lane),
                        near.of(lane),
                        &mut search,
                        stack,
                    );
                    finish(first + lane, search.goal);
                }
            }
        }
        search_tree(scene, first, uncertain, &start, &mut finish);
        first += rays.len();
    }
    first
}

/// Traces those of sixteen rays that have a bit in `lanes` through the tree.
#[inline(always)]
fn search_tree<G: Goal<Precision = Single>>(
    scene: &Scene,
    first: usize,
    mut lanes: u32,
    start: &impl Fn(&Ray) -> G,
    finish: &mut impl FnMut(usize, G),
) {
    while lanes != 0 {
        let number = first + lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let query = scene.batch.rays.get(number);
        let mut search = Search::new(query, scene.batch.context, start(query.ray));
        if Single::is_valid(query.ray) {
            search_forest(scene.forest, scene.wide, &mut search);
        }
        finish(number, search.goal);
    }
}

/// For each shape that still has to be tested, a bit for each ray that may hit it.
struct Near {
    shapes: [u32; MAX_OBJECTS],
}

impl Near {
    #[inline(always)]
    fn new<D: Doubles16>(token: D::Token, scene: &Scene, packet: &ListPacket<D>) -> Self {
        let mut near = Self { shapes: [0; MAX_OBJECTS] };
        for (object, shape) in scene.list.objects.iter().zip(&mut near.shapes) {
            // Testing a flat shape takes no longer than testing its box.
            let is_prepared =
                scene.is_plain && object.shape.as_ref().is_some_and(ListShape::is_flat);
            *shape = match &object.bounds {
                Some(bounds) if !is_prepared => packet.may_meet(token, scene.list, bounds),
                _ => u32::MAX,
            };
        }
        near
    }

    /// The rays that may hit any of the shapes.
    #[inline(always)]
    fn any(&self) -> u32 {
        let mut any = 0;
        for shape in &self.shapes {
            any |= shape;
        }
        any
    }

    /// For occlusion queries, tests the shapes that are tested in lanes.
    #[inline(always)]
    fn block<D: Doubles16>(
        &mut self,
        token: D::Token,
        list: &List,
        packet: &ListPacket<D>,
        found: &mut Blocked,
    ) {
        for (object, near) in list.objects.iter().zip(&mut self.shapes) {
            let Some(shape) = &object.shape else { continue };
            let lanes = std::mem::take(near) & packet.ordinary & !found.blocked;
            if lanes != 0 {
                let blocked =
                    shape.meet(token, packet, lanes).lt(D::Singles::splat(token, f32::INFINITY));
                found.blocked |= blocked;
                found.met |= blocked;
            }
        }
    }

    /// A bit for each shape that a ray may hit.
    #[inline(always)]
    fn of(&self, lane: usize) -> u32 {
        let mut shapes = 0;
        for (number, shape) in self.shapes.iter().enumerate() {
            shapes |= (shape >> lane & 1) << number;
        }
        shapes
    }
}

/// Offers the nearest hit on a triangle, if there is one, and tests the shapes with a bit in
/// `shapes`.
#[inline(never)]
fn offer<L: Lanes8, G: Goal<Precision = Single>>(
    token: L::Token,
    scene: &Scene,
    hit: Option<Hit>,
    shapes: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) {
    match hit.map(|hit| search.offer(hit)) {
        Some(Verdict::Finished) => {}
        // Faces behind the rejected hit were not searched.
        Some(Verdict::Rejected) => search_forest(scene.forest, scene.wide, search),
        Some(Verdict::Taken | Verdict::Behind) | None => {
            test_objects::<L, G>(token, scene, shapes, search, stack)
        }
    }
}

/// Tests the shapes of a list that have a bit in `shapes`.
fn test_objects<L: Lanes8, G: Goal<Precision = Single>>(
    token: L::Token,
    scene: &Scene,
    mut shapes: u32,
    search: &mut Search<'_, G>,
    stack: &mut Stack,
) {
    let (forest, list, ray) = (scene.forest, scene.list, Single::exact(search.ray));
    while shapes != 0 {
        let object = list.objects[shapes.trailing_zeros() as usize].number;
        shapes &= shapes - 1;
        if test_object::<L, G>(token, forest, &forest.trees[0], object, &ray, 0, search, stack) {
            return;
        }
    }
}

/// The hits of sixteen rays.
struct Hits {
    found: Found,
    /// The indices of the triangles or objects that were hit, as the bits of floats.
    numbers: PerRay<f32>,
    /// The rays for which the hits are not certain.
    uncertain: u32,
    /// The rays that hit, or may hit, anything ahead.
    met: u32,
}

impl Hits {
    #[inline(always)]
    fn of<D: Doubles16>(token: D::Token, list: &List, packet: &ListPacket<D>) -> Self {
        let Nearest { first, second, triangle, doubtful, .. } = packet.nearest(token, list);
        let mut numbers = [0.0; RAYS];
        triangle.store(&mut numbers);
        let mut chosen = [list.triangle(0.0); RAYS];
        for (to, &number) in chosen.iter_mut().zip(&numbers) {
            *to = list.triangle(number);
        }
        let ahead = first.lt(D::Singles::splat(token, f32::INFINITY)) & packet.ordinary;
        let mut found = exact::test(token, packet, &chosen, second);
        let uncertain = (doubtful & packet.ordinary) | (ahead & !found.hits & !found.beyond);
        found.hits &= ahead & !uncertain;
        Self { found, numbers, uncertain, met: ahead | uncertain }
    }

    /// Tests the shapes that are tested in lanes. A hit replaces the previous one if it is nearer,
    /// or as near on a geometry with a lower number.
    #[inline(always)]
    fn take_shapes<D: Doubles16>(
        &mut self,
        token: D::Token,
        list: &List,
        packet: &ListPacket<D>,
        near: &mut Near,
    ) {
        for (number, (object, near)) in list.objects.iter().zip(&mut near.shapes).enumerate() {
            let Some(shape) = &object.shape else { continue };
            let lanes = std::mem::take(near) & packet.ordinary;
            if lanes == 0 {
                continue;
            }
            let (zero, infinity) =
                (D::Singles::splat(token, 0.0), D::Singles::splat(token, f32::INFINITY));
            let t = shape.meet(token, packet, lanes);
            let best = infinity.replace(self.found.hits, D::Singles::load(token, &self.found.t));
            let hits = t.lt(infinity);
            let mut taken = t.lt(best);
            let mut ties = hits & t.le(best) & !taken;
            while ties != 0 {
                let lane = ties.trailing_zeros();
                ties &= ties - 1;
                let (geometry, _) = list.triangle(self.numbers[lane as usize]).ids();
                taken |= u32::from(shape.geometry < geometry) << lane;
            }
            if taken != 0 {
                let this = D::Singles::splat(token, f32::from_bits((FIRST_OBJECT + number) as u32));
                this.store_where(taken, &mut self.numbers);
                t.store_where(taken, &mut self.found.t);
                zero.store_where(taken, &mut self.found.b1);
                zero.store_where(taken, &mut self.found.b2);
            }
            self.found.hits |= hits;
            self.met |= hits;
        }
    }

    #[inline(always)]
    fn get(&self, list: &List, lane: usize) -> Option<Hit> {
        let (geometry, primitive) = list.triangle(self.numbers[lane]).ids();
        let (t, uv) = (self.found.t[lane], Vec2::new(self.found.b1[lane], self.found.b2[lane]));
        (self.found.hits >> lane & 1 == 1).then_some(Hit {
            t,
            uv,
            instance: 0,
            geometry,
            primitive,
        })
    }
}
