//! The first moment at which a scene that moves meets another.
//!
//! Each pair of boxes, and then of triangles, is advanced by itself as far as it certainly stays
//! apart: by its distance along a direction, over the largest speed of its points along that
//! direction (conservative advancement; Tang, Kim and Manocha, C²A: Controlled Conservative
//! Advancement for Continuous Collision Detection of Polygonal Models, 2009). Pairs that do not
//! meet before the best moment so far are left out.

use super::boxes::{Below, OrientedBox};
use super::scene::{PairScene, Scale};
use super::search::{Patience, Side, Spot, Step, reference, rounding, whereabouts};
use super::{PairError, PairQuery, Pose, triangles};
use crate::query::parallel::Cancelled;
use snell_math::glam::DQuat;
use snell_math::{DAffine3, DMat3, DVec3, rotation};

/// Times that a pair of boxes is advanced before it is opened.
const ADVANCES: usize = 3;

/// A motion from one pose to another in a time of 1: the origin of the coordinates moves on a
/// straight line, and everything turns round it at a constant rate by the shortest way (slerp).
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// The first pose, without its translation.
    start: Pose,
    from: DVec3,
    velocity: DVec3,
    axis: DVec3,
    angle: f64,
}

impl Motion {
    /// The motion between two poses.
    ///
    /// # Errors
    /// If a pose is not a rotation, a mirroring and a uniform scale, or the two differ in scale or
    /// handedness.
    pub fn new(from: &DAffine3, to: &DAffine3) -> Result<Self, PairError> {
        let (first, last) = (Scale::of_pose(from)?, Scale::of_pose(to)?);
        let turn = to.matrix3 * from.matrix3.inverse();
        if (first.factor / last.factor - 1.0).abs() > 1e-6 || turn.determinant() < 0.0 {
            return Err(PairError::NotAMotion);
        }
        let turn = DQuat::from_mat3(&(turn * (first.factor / last.factor))).normalize();
        let (axis, angle) = rotation::axis_and_angle(if turn.w < 0.0 { -turn } else { turn });
        let map = DAffine3 { matrix3: from.matrix3, translation: DVec3::ZERO };
        let scale = Scale { error: first.error.max(last.error), ..first };
        let velocity = to.translation - from.translation;
        Ok(Self { start: Pose { map, scale }, from: from.translation, velocity, axis, angle })
    }

    /// The pose at a moment from 0 to 1.
    pub fn at(&self, t: f64) -> DAffine3 {
        let matrix3 = self.rotation(t) * self.start.map.matrix3;
        DAffine3 { matrix3, translation: self.from + self.velocity * t }
    }

    fn rotation(&self, t: f64) -> DMat3 {
        if self.angle == 0.0 {
            return DMat3::IDENTITY;
        }
        rotation::about(self.axis, self.angle * t)
    }

    /// A bound of the speed along a direction of length 1, of points that are no farther from the
    /// axis than `radius`.
    fn speed(&self, along: DVec3, radius: f64) -> f64 {
        let turned = self.angle * radius * self.axis.cross(along).length();
        self.velocity.dot(along) + turned
    }
}

/// The first moment, from 0 to 1, at which a scene that moves is no farther than `tolerance` from
/// the surface of another; infinite if there is none. The surfaces do not meet before. (A tolerance
/// below the rounding of coordinates, `1e-13` of the size of everything, is raised to it.)
///
/// # Errors
/// If the query is stopped. Its largest distance does not matter.
pub fn time_of_impact(
    a: &PairScene,
    motion: &Motion,
    b: (&PairScene, &Pose),
    tolerance: f64,
    query: &PairQuery,
) -> Result<f64, Cancelled> {
    let end = Pose { map: motion.at(1.0), scale: motion.start.scale };
    let begin = Pose { map: motion.at(0.0), ..end };
    let near = [whereabouts(a, &begin), whereabouts(b.0, b.1), whereabouts(a, &end)];
    let [Some(first), Some(other), Some(last)] = near else { return Ok(f64::INFINITY) };
    let (reference, extent) = reference(&[first, other, last], 1);
    let sides = [Side::new(a, &motion.start, DVec3::ZERO), Side::new(b.0, b.1, reference)];
    let rounding = rounding(extent);
    let mut search = Impact {
        motion,
        patience: Patience::new(query),
        shift: motion.from - reference,
        rounding,
        tolerance: tolerance.max(10.0 * rounding),
        best: f64::INFINITY,
        known: (0.0, DMat3::IDENTITY),
    };
    if let (Some(root_a), Some(root_b)) = (sides[0].root(), sides[1].root())
        && let Some(start) = search.advanced(&root_a.bounds, &root_b.bounds, 0.0)
    {
        search.descend(&sides, [&root_a, &root_b], start)?;
    }
    Ok(search.best)
}

/// A search for the first moment. Boxes of the scene that moves are turned as at the start, and
/// relative to the point that moves on a straight line.
struct Impact<'a> {
    motion: &'a Motion,
    patience: Patience<'a>,
    /// That point at the start, relative to the reference point.
    shift: DVec3,
    rounding: f64,
    tolerance: f64,
    best: f64,
    /// The moment that was looked at last, and the rotation then.
    known: (f64, DMat3),
}

impl Impact<'_> {
    /// The rotation and the offset at a moment.
    #[inline]
    fn moved(&mut self, t: f64) -> (DMat3, DVec3) {
        if self.known.0 != t {
            self.known = (t, self.motion.rotation(t));
        }
        (self.known.1, self.shift + self.motion.velocity * t)
    }

    fn is_over(&self, t: f64) -> bool {
        t > 1.0 || t >= self.best
    }

    /// A moment until which two boxes certainly do not meet, from one on where this is so; `None`
    /// if they do not meet before the best moment.
    #[inline]
    fn advanced(&mut self, a: &OrientedBox, b: &OrientedBox, mut t: f64) -> Option<f64> {
        let radius = self.motion.axis.cross(a.center).length() + a.radius();
        for _ in 0..ADVANCES {
            if self.is_over(t) {
                return None;
            }
            let (rotation, offset) = self.moved(t);
            let moved = OrientedBox {
                center: rotation * a.center + offset,
                axes: rotation * a.axes,
                half: a.half,
            };
            let step = self.free(&moved, b, radius);
            if step <= 0.0 {
                break;
            }
            t += step;
        }
        (!self.is_over(t)).then_some(t)
    }

    /// For how long two boxes stay apart.
    fn free(&self, a: &OrientedBox, b: &OrientedBox, radius: f64) -> f64 {
        let d = b.center - a.center;
        let mut longest: f64 = 0.0;
        for (gaps, axes) in a.gaps(b).into_iter().zip([&a.axes, &b.axes]) {
            let axes = [axes.x_axis, axes.y_axis, axes.z_axis];
            for (gap, axis) in gaps.to_array().into_iter().zip(axes) {
                let gap = gap - self.rounding;
                if gap > 0.0 {
                    let along = if axis.dot(d) < 0.0 { -axis } else { axis };
                    longest = longest.max(time(gap, self.motion.speed(along, radius)));
                }
            }
            let gap = gaps.length() - self.rounding;
            if gap > 0.0 {
                let speed = self.motion.velocity.length() + self.motion.angle * radius;
                longest = longest.max(time(gap, speed));
            }
        }
        longest
    }

    fn descend(
        &mut self,
        sides: &[Side; 2],
        spots: [&Spot; 2],
        start: f64,
    ) -> Result<(), Cancelled> {
        self.patience.step()?;
        let below = [sides[0].below(spots[0]), sides[1].below(spots[1])];
        let Step::Open(side) = Step::of(spots, &below) else {
            return self.leaves(spots, below, start);
        };
        let (opened, other) = (spots[side], spots[1 - side]);
        let pair = |spot| if side == 0 { [spot, other] } else { [other, spot] };
        match below[side] {
            Below::Nodes(children) => {
                let found = children.map(|node| sides[side].spot(node, opened.part));
                let mut times = [0.0; 2];
                for (time, spot) in times.iter_mut().zip(&found) {
                    let [a, b] = pair(spot);
                    *time = self.advanced(&a.bounds, &b.bounds, start).unwrap_or(f64::INFINITY);
                }
                let second = usize::from(self.is_second_first(&found, times, other, side));
                for i in [second, 1 - second] {
                    if !self.is_over(times[i]) {
                        self.descend(sides, pair(&found[i]), times[i])?;
                    }
                }
            }
            Below::Items(first, _) => {
                let placed = sides[side].placed(first);
                let root = sides[side].spot(0, Some(&placed));
                let [a, b] = pair(&root);
                if let Some(start) = self.advanced(&a.bounds, &b.bounds, start) {
                    self.descend(sides, pair(&root), start)?;
                }
            }
        }
        Ok(())
    }

    /// True if the second of two boxes may meet the other earlier, or at the same time is nearer.
    fn is_second_first(
        &mut self,
        found: &[Spot; 2],
        times: [f64; 2],
        other: &Spot,
        side: usize,
    ) -> bool {
        if times[0] != times[1] || times[0] == f64::INFINITY {
            return times[1] < times[0];
        }
        let (rotation, offset) = self.moved(times[0]);
        let from = |i: usize| {
            let [a, b] = if side == 0 { [&found[i], other] } else { [other, &found[i]] };
            (rotation * a.bounds.center + offset - b.bounds.center).length_squared()
        };
        from(1) < from(0)
    }

    fn leaves(
        &mut self,
        spots: [&Spot; 2],
        below: [Below; 2],
        start: f64,
    ) -> Result<(), Cancelled> {
        let ([Below::Items(a, count_a), Below::Items(b, count_b)], Some(part_a), Some(part_b)) =
            (below, spots[0].part, spots[1].part)
        else {
            return Ok(());
        };
        for i in a..a + count_a {
            let p = part_a.corners(i);
            for j in b..b + count_b {
                self.triangles(&p, &part_b.corners(j), start)?;
            }
        }
        Ok(())
    }

    /// Advances two triangles until they are within the tolerance.
    fn triangles(&mut self, p: &[DVec3; 3], q: &[DVec3; 3], mut t: f64) -> Result<(), Cancelled> {
        let from_axis = p.map(|corner| self.motion.axis.cross(corner).length());
        let radius = from_axis.into_iter().fold(0.0, f64::max);
        while !self.is_over(t) {
            self.patience.step()?;
            let (rotation, offset) = self.moved(t);
            let moved = p.map(|corner| rotation * corner + offset);
            let near = triangles::nearest(&moved, q, f64::INFINITY, self.rounding);
            let Some(triangles::Nearest { distance, points }) = near else { break };
            if distance <= self.tolerance {
                self.best = t;
                break;
            }
            // Planes through the nearest points, normal to the line between them, are between the
            // triangles.
            let along = (points[1] - points[0]) / distance;
            t += time(distance - 0.5 * self.tolerance, self.motion.speed(along, radius));
        }
        Ok(())
    }
}

/// How long a way takes; infinitely long at no speed, or away.
fn time(way: f64, speed: f64) -> f64 {
    if speed > 0.0 { way / speed } else { f64::INFINITY }
}
