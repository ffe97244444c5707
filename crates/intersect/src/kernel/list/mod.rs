//! Lists of few primitives: sixteen rays at a time against each face in turn, without a tree.
//!
//! A face is a triangle, or two that make a flat quadrilateral ([`faces`]). Where a ray meets its
//! plane, and on which side of its edges that is, is worked out in `f32` with a bound of the error
//! ([`packet`]). For nearly all rays it is then certain which face is the nearest; the distance on
//! it and the coordinates follow from the numbers that the exact test would find ([`exact`]),
//! sixteen rays at a time too. The others, which come near an edge, start in a plane or run along
//! one, and rays of extraordinary size, go through the tree, which finds the same. Spheres and flat
//! shapes are tested sixteen rays at a time ([`shapes`]), others ray by ray; all but flat ones with
//! a look at their boxes before.

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
use snell_math::simd::{Avx8, Avx16Doubles, PairDoubles, Token};
use snell_math::simd::{Doubles16, Lanes8, Lanes16, Wide};
use snell_math::{Ray, Vec2, Vec3};
use std::mem::MaybeUninit;

/// Batches of fewer rays are not worth it.
const MIN_RAYS: usize = 4;

/// Nor are those of fewer rays where most are to be searched for in the tree besides.
const MIN_RAYS_APART: usize = 16;

/// The number of rays after which it is decided whether lists pay for a batch.
const TRIAL: usize = 128;

/// Cost model: in a tree, a ray that misses costs as much as this many faces of a list, and a ray
/// that hits as much as this many more.
const FACES_PER_RAY: usize = 24;
const FACES_PER_HIT: usize = 80;

/// True if a list handles queries for one hit of each ray of a batch of this size, or some of the
/// rays.
pub(crate) fn is_suitable(forest: &Forest, rays: usize) -> bool {
    rays >= MIN_RAYS && forest.list.is_some() || rays >= MIN_RAYS_APART && forest.outliers.is_some()
}

/// Searches for the rays of a batch; `finish` gets the number of a ray and what was found.
/// [`is_suitable`] must hold. Rays that have yet to be searched for among the rest, if the list is
/// only of outliers, are added to `unresolved`. Returns how many rays were dealt with: less
/// than all if most of them point past everything, for in a tree that costs little.
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
        #[cfg(target_arch = "x86_64")]
        Some(Wide::Avx2(token)) => token.run(
            #[inline(always)]
            move || run::<PairDoubles<Avx8>, G>(token, &scene, stack, unresolved, start, finish),
        ),
        // Without wide registers, the tree is as fast.
        _ => 0,
    }
}

/// The lanes that single rays are searched for with.
type HalfOf<D> = <<D as Doubles16>::Singles as Lanes16>::Half;

/// The list that is searched, and the rays.
struct Scene<'a> {
    forest: &'a Forest,
    list: &'a List,
    /// Where the rest is, if that is not all.
    outliers: Option<&'a Outliers>,
    wide: Option<Wide>,
    batch: &'a Batch<'a, Single>,
    /// The nearest hit within the interval of a ray is always what it hits, as far as things are
    /// tested in lanes.
    is_plain: bool,
}

/// True if nothing may reject a hit on what is tested in lanes, or change it.
fn is_plain(list: &List, batch: &Batch<Single>) -> bool {
    let accepts = |geometry: u32| {
        let options = batch.context.options[geometry as usize];
        options.mask == u32::MAX && !options.filtered && !options.quads
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

/// Searches through the tree for those of sixteen rays that have a bit.
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

/// The rays that may meet shapes that have yet to be tested: a bit for each ray, by shape.
struct Near {
    shapes: [u32; MAX_OBJECTS],
}

impl Near {
    #[inline(always)]
    fn new<D: Doubles16>(token: D::Token, scene: &Scene, packet: &ListPacket<D>) -> Self {
        let mut near = Self { shapes: [0; MAX_OBJECTS] };
        for (object, shape) in scene.list.objects.iter().zip(&mut near.shapes) {
            // Those that are flat are tested as quickly as their boxes.
            let is_prepared =
                scene.is_plain && object.shape.as_ref().is_some_and(ListShape::is_flat);
            *shape = match &object.bounds {
                Some(bounds) if !is_prepared => packet.may_meet(token, scene.list, bounds),
                _ => u32::MAX,
            };
        }
        near
    }

    /// The rays that may meet any.
    #[inline(always)]
    fn any(&self) -> u32 {
        let mut any = 0;
        for shape in &self.shapes {
            any |= shape;
        }
        any
    }

    /// Tests the shapes that are tested in lanes, where any will do.
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

    /// The shapes that a ray may meet, a bit for each.
    #[inline(always)]
    fn of(&self, lane: usize) -> u32 {
        let mut shapes = 0;
        for (number, shape) in self.shapes.iter().enumerate() {
            shapes |= (shape >> lane & 1) << number;
        }
        shapes
    }
}

/// Offers the nearest hit on a triangle, if there is one, and tests some of the shapes.
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
        // What is behind it has not been looked for.
        Some(Verdict::Rejected) => search_forest(scene.forest, scene.wide, search),
        Some(Verdict::Taken | Verdict::Behind) | None => {
            test_objects::<L, G>(token, scene, shapes, search, stack)
        }
    }
}

/// Tests some of the shapes of a list, a bit for each.
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
    /// The numbers of what they hit, as bits.
    numbers: PerRay<f32>,
    /// The rays for which that is not certain, and those that meet anything ahead, or may.
    uncertain: u32,
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

    /// Tests the shapes that are tested in lanes, and takes what is nearer, or as near with a lower
    /// number.
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
