//! The search for the nearest triangles of two scenes: both trees are descended together, nearest
//! boxes first (Johnson and Cohen, A Framework for Efficient Minimum Distance Computations, 1998).

use super::boxes::{Below, OrientedBox, Tree};
use super::scene::{PairScene, Part, Place, offset};
use super::{ClosestPair, PairQuery, Pose, meeting, triangles};
use crate::query::parallel::Cancelled;
use snell_math::DVec3;
use std::sync::atomic::Ordering;

/// What is rounded of coordinates and boxes, as a share of the size of everything.
const ROUNDING: f64 = 1e-14;

/// A scene in the coordinates of a search: those of the world less a reference point, so that
/// scenes far from 0 keep their digits.
pub(super) struct Side<'a> {
    pub scene: &'a PairScene,
    pub pose: &'a Pose,
    pub reference: DVec3,
    /// The place of the tree of the parts.
    pub top: Place,
}

impl<'a> Side<'a> {
    pub fn new(scene: &'a PairScene, pose: &'a Pose, reference: DVec3) -> Self {
        let Pose { map, scale } = pose;
        let top = Place::new(map.matrix3, scale, offset(&[map], scene.origin, reference));
        Self { scene, pose, reference, top }
    }

    /// The place of a part.
    pub fn placed(&self, place: usize) -> Placed<'a> {
        let part = self.scene.part(place);
        Placed { part, place: part.place(&self.pose.map, &self.pose.scale, self.reference) }
    }

    /// The root of the tree of the parts; `None` if the scene has none.
    pub fn root(&self) -> Option<Spot<'static>> {
        let bounds = self.top.bounds(self.scene.bounds()?);
        Some(Spot { bounds, longest: bounds.half.max_element(), node: 0, part: None })
    }

    /// A node of the tree of a part, or of the tree of the parts.
    #[inline(always)]
    pub fn spot<'p>(&self, node: u32, part: Option<&'p Placed<'p>>) -> Spot<'p> {
        let (tree, place) = self.tree(part);
        let bounds = place.bounds(&tree.nodes[node as usize].bounds);
        Spot { bounds, longest: bounds.half.max_element(), node, part }
    }

    /// What is below a node.
    #[inline]
    pub fn below(&self, spot: &Spot) -> Below {
        self.tree(spot.part).0.below(spot.node)
    }

    #[inline]
    fn tree<'s>(&'s self, part: Option<&'s Placed>) -> (&'s Tree, &'s Place) {
        match part {
            Some(placed) => (&placed.part.mesh.tree, &placed.place),
            None => (&self.scene.tree, &self.top),
        }
    }
}

/// A part of a scene in the coordinates of a search.
pub(super) struct Placed<'a> {
    pub part: &'a Part,
    pub place: Place,
}

impl Placed<'_> {
    /// The triangle at a place of the tree.
    #[inline]
    pub fn corners(&self, place: usize) -> [DVec3; 3] {
        self.part.mesh.triangles[place].map(|p| self.place.point(p))
    }
}

/// A node in the coordinates of a search.
#[derive(Clone, Copy)]
pub(super) struct Spot<'a> {
    pub bounds: OrientedBox,
    pub longest: f64,
    pub node: u32,
    /// The part that has the node; `None` for a node of the tree of the parts.
    pub part: Option<&'a Placed<'a>>,
}

/// What to do with a pair of nodes.
pub(super) enum Step {
    /// Both are leaves of meshes.
    Leaves,
    /// Go on with what is below the first (0) or the second (1).
    Open(usize),
}

impl Step {
    /// The larger one is opened.
    #[inline]
    pub fn of(spots: [&Spot; 2], below: &[Below; 2]) -> Self {
        let is_leaf = |i: usize| spots[i].part.is_some() && matches!(below[i], Below::Items(..));
        match (is_leaf(0), is_leaf(1)) {
            (true, true) => Self::Leaves,
            (true, false) => Self::Open(1),
            (false, true) => Self::Open(0),
            (false, false) => Self::Open(usize::from(spots[1].longest > spots[0].longest)),
        }
    }
}

/// A reference point for two scenes near each other, and the size of everything relative to it.
pub(super) fn reference(near: &[(DVec3, f64)], of: usize) -> (DVec3, f64) {
    let size = near.iter().map(|(_, radius)| radius).sum::<f64>();
    let reference = DVec3::from_array(near[of].0.to_array().map(|x| {
        let short = f64::from(x as f32);
        if x.abs() > 8.0 * size && short.is_finite() { short } else { 0.0 }
    }));
    let extent = near.iter().map(|(center, radius)| (*center - reference).length() + radius);
    (reference, extent.fold(0.0, f64::max))
}

/// About where a scene is, and its radius.
pub(super) fn whereabouts(scene: &PairScene, pose: &Pose) -> Option<(DVec3, f64)> {
    let bounds = scene.bounds()?;
    let center = pose.map.transform_point3(bounds.center + scene.origin);
    Some((center, bounds.radius() * pose.scale.factor))
}

/// Steps that may be taken, and a flag that stops them.
pub(super) struct Patience<'a> {
    query: &'a PairQuery<'a>,
    steps: u64,
}

impl<'a> Patience<'a> {
    pub fn new(query: &'a PairQuery<'a>) -> Self {
        Self { query, steps: 0 }
    }

    /// Counts a step; fails if the query should stop.
    #[inline]
    pub fn step(&mut self) -> Result<(), Cancelled> {
        self.steps += 1;
        if self.steps & 0xff == 0 { self.look() } else { Ok(()) }
    }

    #[cold]
    fn look(&self) -> Result<(), Cancelled> {
        let is_stopped = self.query.cancel.is_some_and(|flag| flag.load(Ordering::Relaxed));
        if is_stopped || self.steps > self.query.max_steps { Err(Cancelled) } else { Ok(()) }
    }
}

/// The largest error of coordinates in a search of this extent.
pub(super) fn rounding(extent: f64) -> f64 {
    extent * ROUNDING
}

/// A search for the nearest triangles.
struct Search<'a> {
    sides: [Side<'a>; 2],
    patience: Patience<'a>,
    rounding: f64,
    /// The distance of the best pair, or the largest that counts.
    limit: f64,
    /// Boxes at this distance or farther are left out.
    cut: f64,
    /// True if only meeting triangles are wanted, and not where they meet.
    meeting_only: bool,
    best: Option<ClosestPair>,
    /// The direction from the best point of the first to that of the second, of length 1.
    along: DVec3,
}

/// The nearest triangles of two scenes with poses; with `meeting_only`, any two that meet, without
/// the point.
pub(super) fn search(
    [a, b]: [(&PairScene, &Pose); 2],
    query: &PairQuery,
    meeting_only: bool,
) -> Result<Option<ClosestPair>, Cancelled> {
    let (Some(near_a), Some(near_b)) = (whereabouts(a.0, a.1), whereabouts(b.0, b.1)) else {
        return Ok(None);
    };
    let (reference, extent) = reference(&[near_a, near_b], 1);
    let sides = [a, b].map(|(scene, pose)| Side::new(scene, pose, reference));
    let limit = if meeting_only { 0.0 } else { query.max_distance };
    if limit.is_nan() || limit < 0.0 {
        return Ok(None);
    }
    let rounding = rounding(extent);
    let cut = limit + rounding;
    let patience = Patience::new(query);
    let (best, along) = (None, DVec3::ZERO);
    let mut search = Search { sides, patience, rounding, limit, cut, meeting_only, best, along };
    let (Some(root_a), Some(root_b)) = (search.sides[0].root(), search.sides[1].root()) else {
        return Ok(None);
    };
    if search.bound([&root_a, &root_b]).is_some() {
        search.descend([&root_a, &root_b])?;
    }
    let absolute =
        |pair: ClosestPair| ClosestPair { points: pair.points.map(|p| p + reference), ..pair };
    Ok(search.best.map(absolute))
}

impl Search<'_> {
    /// True if boxes with this gap may hold a nearer pair.
    #[inline]
    fn wants(&self, gap: f64) -> bool {
        gap < self.cut || gap <= self.rounding
    }

    /// A lower bound of the distance of two nodes of different sides; `None` if they hold no nearer
    /// pair.
    #[inline]
    fn bound(&self, spots: [&Spot; 2]) -> Option<f64> {
        let [a, b] = spots.map(|spot| &spot.bounds);
        if self.meeting_only {
            return (!a.is_apart(b, self.rounding)).then_some(0.0);
        }
        if self.is_beyond(spots) {
            return None;
        }
        let gap = a.gap(b);
        self.wants(gap).then_some(gap)
    }

    /// True if two nodes lie farther apart along the direction of the best pair than that pair.
    /// This is quick to find, and leaves out most nodes where scenes are far apart.
    #[inline]
    fn is_beyond(&self, spots: [&Spot; 2]) -> bool {
        let [a, b] = spots.map(|spot| &spot.bounds);
        let widths = a.width(self.along) + b.width(self.along);
        (b.center - a.center).dot(self.along) - widths > self.cut.max(self.rounding)
    }

    fn is_done(&self) -> bool {
        self.best.is_some_and(|best| best.distance == 0.0)
    }

    fn descend(&mut self, spots: [&Spot; 2]) -> Result<(), Cancelled> {
        self.patience.step()?;
        let below = [self.sides[0].below(spots[0]), self.sides[1].below(spots[1])];
        let Step::Open(side) = Step::of(spots, &below) else {
            self.leaves(spots, below);
            return Ok(());
        };
        let (opened, other) = (spots[side], spots[1 - side]);
        let pair = |spot| if side == 0 { [spot, other] } else { [other, spot] };
        match below[side] {
            Below::Nodes([first, second]) => {
                // Each is made in its place: copies of boxes would take a quarter of the time.
                let first = self.sides[side].spot(first, opened.part);
                let second = self.sides[side].spot(second, opened.part);
                let (to_first, to_second) = (self.bound(pair(&first)), self.bound(pair(&second)));
                if is_second_nearer([&first, &second], [to_first, to_second], other) {
                    self.descend_to(pair(&second), to_second)?;
                    self.descend_to(pair(&first), to_first)?;
                } else {
                    self.descend_to(pair(&first), to_first)?;
                    self.descend_to(pair(&second), to_second)?;
                }
            }
            Below::Items(first, _) => {
                let placed = self.sides[side].placed(first);
                let root = self.sides[side].spot(0, Some(&placed));
                if self.bound(pair(&root)).is_some() {
                    self.descend(pair(&root))?;
                }
            }
        }
        Ok(())
    }

    /// Goes on with two nodes, of which this is the bound, if they still may hold a nearer pair.
    #[inline]
    fn descend_to(&mut self, spots: [&Spot; 2], bound: Option<f64>) -> Result<(), Cancelled> {
        match bound {
            Some(gap) if self.wants(gap) && !self.is_done() && !self.is_beyond(spots) => {
                self.descend(spots)
            }
            _ => Ok(()),
        }
    }

    /// Tests all triangles of two leaves.
    fn leaves(&mut self, spots: [&Spot; 2], below: [Below; 2]) {
        let ([Below::Items(a, count_a), Below::Items(b, count_b)], Some(part_a), Some(part_b)) =
            (below, spots[0].part, spots[1].part)
        else {
            return;
        };
        for i in a..a + count_a {
            let p = part_a.corners(i);
            for j in b..b + count_b {
                let q = part_b.corners(j);
                let Some(triangles::Nearest { distance, points }) = self.test(&p, &q) else {
                    continue;
                };
                if distance < self.limit || (self.best.is_none() && distance <= self.limit) {
                    (self.limit, self.cut) = (distance, distance - self.rounding);
                    self.along = (points[1] - points[0]).normalize_or_zero();
                    let triangles = [part_a.part.mesh.number(i), part_b.part.mesh.number(j)];
                    let parts = [part_a.part.number, part_b.part.number];
                    self.best = Some(ClosestPair { distance, points, parts, triangles });
                }
                if self.is_done() {
                    return;
                }
            }
        }
    }

    #[inline]
    fn test(&self, p: &[DVec3; 3], q: &[DVec3; 3]) -> Option<triangles::Nearest> {
        if self.meeting_only {
            let point = meeting::common_point(p, q, DVec3::ZERO)?;
            Some(triangles::Nearest { distance: 0.0, points: [point; 2] })
        } else if triangles::gap_along(p, q, self.along) > self.cut.max(self.rounding) {
            None
        } else {
            // What is rounded leaves out no pair at the limit itself.
            triangles::nearest(p, q, self.limit + self.rounding, self.rounding)
        }
    }
}

/// True if the second of two boxes is nearer to the other; the centres decide if both touch it.
#[inline]
fn is_second_nearer(found: [&Spot; 2], gaps: [Option<f64>; 2], other: &Spot) -> bool {
    let [Some(first), Some(second)] = gaps else { return gaps[0].is_none() };
    let from = |i: usize| (found[i].bounds.center - other.bounds.center).length_squared();
    second < first || (second == first && from(1) < from(0))
}
