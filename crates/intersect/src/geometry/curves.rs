//! Strands: round curves of one or more segments each, hit from outside only, for hair and fur.

use super::cubic::Tube;
use super::sweep::{derivatives, halves};
use super::{CubicCurves, CurveBasis, LinearCurves, PrimitiveHit, PrimitiveSet};
use crate::prefetch::fetch;
use crate::shape::{Metric, ShapeSurface};
use serde::{Deserialize, Serialize};
use snell_math::{Bounds3d, DRay, DVec3, DVec4, Vec2, Vec3, Vec4};

/// How the points of a strand define it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StrandBasis {
    /// Straight segments from point to point.
    Linear,
    /// Bézier segments of four points, the last of which is the first of the next: `3 n + 1` points
    /// for `n` segments.
    #[default]
    Bezier,
    /// Uniform B-spline: `n + 3` points for `n` segments, which approximate the points.
    BSpline,
    /// Catmull-Rom: `n + 3` points for `n` segments, through all points but the first and the last.
    CatmullRom,
}

impl StrandBasis {
    /// The number of points of a segment, and by how many points the next segment starts later.
    fn points_and_step(self) -> (usize, usize) {
        match self {
            Self::Linear => (2, 1),
            Self::Bezier => (4, 3),
            Self::BSpline | Self::CatmullRom => (4, 1),
        }
    }

    /// The number of segments of a strand with this number of points; `None` if the number is not
    /// valid for the basis.
    pub fn segments(self, points: usize) -> Option<usize> {
        let (whole, step) = self.points_and_step();
        let rest = points.checked_sub(whole)?;
        (rest % step == 0).then_some(rest / step + 1)
    }
}

/// Errors of points that do not define strands.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StrandError {
    /// A strand has too few points, or a number of points that does not make whole segments.
    #[error("strand {strand} has {points} points, expected {}", expected(*basis))]
    Points {
        /// The index of the strand.
        strand: usize,
        /// The number of points of the strand.
        points: u32,
        /// The basis of the strand.
        basis: StrandBasis,
    },
    /// There are colours, but not one for each point.
    #[error("there are {colors} colours, but {points} points: give one for each point, or none")]
    Colors {
        /// The number of colours given.
        colors: usize,
        /// The number of points.
        points: usize,
    },
    /// The strands together do not have as many points as were given.
    #[error("the strands have {strands} points together, but there are {points}")]
    Total {
        /// The number of points that the strands have together.
        strands: u64,
        /// The number of points given.
        points: usize,
    },
    /// There are more points or segments than 32-bit indices can address.
    #[error("more points than 32-bit numbers can count: spread them over several sets")]
    TooMany,
}

/// A description of the number of points that a strand of this basis needs.
fn expected(basis: StrandBasis) -> &'static str {
    match basis {
        StrandBasis::Linear => "2 or more",
        StrandBasis::Bezier => "4, 7, 10 or the like: 3 for each segment and 1 more",
        StrandBasis::BSpline | StrandBasis::CatmullRom => "4 or more",
    }
}

/// Curves of round cross-section in strands: the space that a ball sweeps along each strand.
/// [`LinearCurves`] and [`CubicCurves`] define the segments. Long and thin cubic segments are
/// divided into two, four or eight pieces, because the boxes of pieces are much smaller.
/// [`crate::Hit::primitive`] numbers the pieces over all strands, and [`crate::Hit::uv`] is along a
/// piece.
///
/// Unlike separate segments, a strand is hit only from outside: where a ray enters it, never where
/// the ray leaves, and never inside where segments meet. So a ray that starts on a strand passes
/// through it, as fibre scattering requires (the material models the light inside the fibre);
/// Embree culls the back faces of curves likewise.
///
/// The texture coordinate `u` goes from 0 at the root of a strand to 1 at its tip, evenly over its
/// segments; `v` goes from 0 to 1 around the strand.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves {
    basis: StrandBasis,
    segments: Segments,
    /// The number of points of each strand.
    strands: Vec<u32>,
    /// The first segment of each strand, followed by the number of all segments.
    first_segments: Vec<u32>,
    /// How often each segment is halved to give its pieces.
    halvings: u32,
    /// A bounding capsule of each piece of cubic segments.
    capsules: Vec<Capsule>,
    /// Linear RGB and alpha of each point; empty if all are white.
    colors: Vec<[f32; 4]>,
}

/// A capsule: all points within a distance of a line segment. It bounds a piece, so that most rays
/// that miss the piece are rejected early.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Capsule {
    start: Vec3,
    along: Vec3,
    /// Negative if the piece is never hit.
    radius: f32,
}

impl Capsule {
    const NOTHING: Self = Self { start: Vec3::ZERO, along: Vec3::ZERO, radius: -1.0 };

    /// A capsule around a tube. It holds the balls at the control points, and therefore all balls
    /// of the tube, which are weighted means of these.
    fn around(tube: &Tube) -> Self {
        let [a, b, c, d] = tube.0;
        let (start, end) = (a.truncate().as_vec3(), d.truncate().as_vec3());
        let along = end - start;
        let (from, chord) = (start.as_dvec3(), along.as_dvec3());
        let reach = [a, b, c, d].map(|ball| {
            let seen = ball.truncate() - from;
            let at = (seen.dot(chord) / chord.length_squared()).clamp(0.0, 1.0);
            (seen - if at.is_nan() { DVec3::ZERO } else { chord * at }).length() + ball.w
        });
        let radius = reach.into_iter().fold(0.0, f64::max) as f32;
        Self { start, along, radius: radius.next_up() }
    }

    /// True if the line of a ray certainly misses the capsule. The test compares the capsule's
    /// radius with the distance between the line and the capsule's segment, which is exact to
    /// rounding.
    #[inline]
    fn is_missed(&self, ray: &DRay) -> bool {
        let (start, along, radius) =
            (self.start.as_dvec3(), self.along.as_dvec3(), f64::from(self.radius));
        let seen = start - ray.origin;
        let per_length2 = 1.0 / ray.direction.length_squared();
        let (from, to) =
            (seen.dot(ray.direction) * per_length2, along.dot(ray.direction) * per_length2);
        let (seen_across, across) = (seen - ray.direction * from, along - ray.direction * to);
        let at = (-seen_across.dot(across) / across.length_squared()).clamp(0.0, 1.0);
        let nearest = seen_across + across * if at.is_nan() { 0.0 } else { at };
        // False for NaN, and for directions whose squares overflow or vanish.
        self.radius < 0.0
            || nearest.length_squared() > radius * radius + ROUNDING * seen.length_squared()
    }
}

/// A generous bound on the error of squared distances between lines and points, relative to the
/// squared distance from the ray's origin.
const ROUNDING: f64 = 1e-12;

#[derive(Clone, Debug, PartialEq)]
enum Segments {
    Linear(LinearCurves),
    Cubic(CubicCurves),
}

/// The largest number of halvings of a segment.
const MOST_HALVINGS: u32 = 3;

/// Target ratio of a piece's length to its width, which [`MOST_HALVINGS`] may not suffice to reach.
const SLENDER: f64 = 8.0;

/// The sine of an angle. A hit on the round end of a segment is dropped only if it is inside the
/// next segment by more than this angle, seen from the joint: rays that hit both ends must not slip
/// through between them.
const JOINT: f64 = 0.01;

impl Curves {
    /// Makes strands from points, position (x, y, z) and radius (w), one strand after the other;
    /// `strands` has the number of points of each. A segment is never hit if a point is not finite,
    /// if a radius is negative, or if all radii are 0.
    pub fn new(
        basis: StrandBasis,
        points: Vec<Vec4>,
        strands: Vec<u32>,
    ) -> Result<Self, StrandError> {
        Self::made_of(basis, points, Vec::new(), strands)
    }

    /// Makes strands like [`Self::new`], of points in double precision.
    pub fn exact(
        basis: StrandBasis,
        points: Vec<DVec4>,
        strands: Vec<u32>,
    ) -> Result<Self, StrandError> {
        let rounded = points.iter().map(|p| p.as_vec4()).collect();
        Self::made_of(basis, rounded, points, strands)
    }

    fn made_of(
        basis: StrandBasis,
        points: Vec<Vec4>,
        exact: Vec<DVec4>,
        strands: Vec<u32>,
    ) -> Result<Self, StrandError> {
        let total = strands.iter().map(|&n| u64::from(n)).sum();
        if total != points.len() as u64 {
            return Err(StrandError::Total { strands: total, points: points.len() });
        }
        if u32::try_from(points.len()).is_err() {
            return Err(StrandError::TooMany);
        }
        let (_, step) = basis.points_and_step();
        let (mut first, mut starts, mut first_segments) =
            (0, Vec::new(), Vec::with_capacity(strands.len() + 1));
        for (strand, &points) in strands.iter().enumerate() {
            first_segments.push(starts.len() as u32);
            let Some(segments) = basis.segments(points as usize) else {
                return Err(StrandError::Points { strand, points, basis });
            };
            starts.extend((0..segments).map(|i| first + (i * step) as u32));
            first += points;
        }
        first_segments.push(starts.len() as u32);
        let cubic = |basis, points, segments| {
            let (tangents, exact) = (Vec::new(), exact.clone());
            Segments::Cubic(CubicCurves { basis, points, tangents, segments, exact })
        };
        let segments = match basis {
            StrandBasis::Linear => {
                Segments::Linear(LinearCurves { points, segments: starts, exact })
            }
            StrandBasis::Bezier => cubic(CurveBasis::Bezier, points, starts),
            StrandBasis::BSpline => cubic(CurveBasis::BSpline, points, starts),
            StrandBasis::CatmullRom => cubic(CurveBasis::CatmullRom, points, starts),
        };
        let mut curves = Self {
            basis,
            segments,
            strands,
            first_segments,
            halvings: 0,
            capsules: Vec::new(),
            colors: Vec::new(),
        };
        curves.halvings = curves.best_halvings();
        if curves.segment_count() << curves.halvings > u32::MAX as usize {
            curves.halvings = 0;
        }
        if let Segments::Cubic(_) = curves.segments {
            let capsule = |piece| {
                curves.tube(piece).map_or(Capsule::NOTHING, |(tube, _)| Capsule::around(&tube))
            };
            curves.capsules = (0..curves.len()).map(capsule).collect();
        }
        Ok(curves)
    }

    /// The same curves with a colour for each point, linear RGB and alpha. Between points, colours
    /// change evenly with the texture coordinate `u`. No colours are white.
    pub fn with_colors(self, colors: Vec<[f32; 4]>) -> Result<Self, StrandError> {
        let points = self.points().len();
        if !colors.is_empty() && colors.len() != points {
            return Err(StrandError::Colors { colors: colors.len(), points });
        }
        Ok(Self { colors, ..self })
    }

    /// Linear RGB and alpha of each point; empty if all are white.
    pub fn colors(&self) -> &[[f32; 4]] {
        &self.colors
    }

    /// The colour of a strand at the texture coordinate `u`, from 0 at its root to 1 at its tip.
    pub fn color_of_strand(&self, strand: usize, u: f32) -> [f32; 4] {
        if self.colors.is_empty() {
            return [1.0; 4];
        }
        let (count, segments) = (self.strands[strand] as usize, self.segments_of(strand));
        let Some(first) = self.first_point(segments.start) else { return [1.0; 4] };
        let at = u.clamp(0.0, 1.0) * (count - 1) as f32;
        let before = (at as usize).min(count.saturating_sub(2));
        let (a, b) =
            (self.colors[first + before], self.colors[first + (before + 1).min(count - 1)]);
        std::array::from_fn(|k| a[k] + (b[k] - a[k]) * (at - before as f32))
    }

    /// The index of the first point of a segment.
    fn first_point(&self, segment: usize) -> Option<usize> {
        let segments = match &self.segments {
            Segments::Linear(curves) => &curves.segments,
            Segments::Cubic(curves) => &curves.segments,
        };
        segments.get(segment).map(|&first| first as usize)
    }

    /// The number of strands that are balls: all their points are one.
    pub fn ball_count(&self) -> usize {
        self.strand_points().filter(|points| points.windows(2).all(|p| p[0] == p[1])).count()
    }

    /// How often to halve cubic segments so that pieces have at most [`SLENDER`] times their width
    /// as length, on average over all segments.
    fn best_halvings(&self) -> u32 {
        let Segments::Cubic(curves) = &self.segments else { return 0 };
        let (mut length, mut width) = (0.0, 0.0);
        for c in (0..curves.segments.len()).filter_map(|i| curves.bezier(i)) {
            length += c.windows(2).map(|p| p[0].truncate().distance(p[1].truncate())).sum::<f64>();
            width += c[0].w + c[3].w;
        }
        (0..MOST_HALVINGS)
            .find(|&n| length <= SLENDER * width * f64::from(1 << n))
            .unwrap_or(MOST_HALVINGS)
    }

    /// The number of segments of all strands together.
    pub fn segment_count(&self) -> usize {
        self.first_segments.last().map_or(0, |&count| count as usize)
    }

    /// The solid of a piece and the direction of its segment; `None` if the piece is never hit, or
    /// linear.
    fn tube(&self, piece: usize) -> Option<(Tube, DVec3)> {
        let Segments::Cubic(curves) = &self.segments else { return None };
        let mut controls = curves.bezier(piece >> self.halvings)?;
        let chord = (controls[3] - controls[0]).truncate();
        for level in (0..self.halvings).rev() {
            controls = halves(&controls)[piece >> level & 1];
        }
        Some((Tube(controls), chord))
    }

    /// The basis by which points define strands.
    pub fn basis(&self) -> StrandBasis {
        self.basis
    }

    /// All points: position (x, y, z) and radius (w).
    pub fn points(&self) -> &[Vec4] {
        match &self.segments {
            Segments::Linear(curves) => &curves.points,
            Segments::Cubic(curves) => &curves.points,
        }
    }

    /// All points in double precision, if they were given so; else none.
    pub fn exact_points(&self) -> &[DVec4] {
        match &self.segments {
            Segments::Linear(curves) => &curves.exact,
            Segments::Cubic(curves) => &curves.exact,
        }
    }

    /// The number of points of each strand.
    pub fn strands(&self) -> &[u32] {
        &self.strands
    }

    /// The points of one strand after the other.
    pub fn strand_points(&self) -> impl Iterator<Item = &[Vec4]> {
        let mut rest = self.points();
        self.strands.iter().map(move |&count| {
            let (points, after) = rest.split_at(count as usize);
            rest = after;
            points
        })
    }

    /// The range of the pieces of the strand that holds a piece, as first and end.
    fn strand_of(&self, piece: usize) -> [usize; 2] {
        let segment = piece >> self.halvings;
        let strand = self.first_segments.partition_point(|&first| first as usize <= segment) - 1;
        [strand, strand + 1].map(|i| (self.first_segments[i] as usize) << self.halvings)
    }

    /// The range of the segments of a strand.
    pub fn segments_of(&self, strand: usize) -> std::ops::Range<usize> {
        self.first_segments[strand] as usize..self.first_segments[strand + 1] as usize
    }

    /// The Bézier control points of a segment, with the radius in `w`; `None` if the segment is
    /// never hit.
    pub fn bezier(&self, segment: usize) -> Option<[DVec4; 4]> {
        match &self.segments {
            Segments::Cubic(curves) => curves.bezier(segment),
            Segments::Linear(curves) => {
                let [a, b] = curves.ends(segment)?;
                Some([a, a.lerp(b, 1.0 / 3.0), a.lerp(b, 2.0 / 3.0), b])
            }
        }
    }

    /// Bounds of all strands.
    pub fn bounds_of_all(&self) -> Bounds3d {
        (0..self.len())
            .map(|i| self.bounds(i))
            .filter(|b| !b.is_empty())
            .fold(Bounds3d::EMPTY, |all, b| all.union(&b))
    }

    /// True if a point on the round end of a piece, at `u` 0 or 1, lies inside the adjacent piece.
    fn is_within_next(&self, piece: usize, u: f32, position: DVec3) -> bool {
        let [first, after] = self.strand_of(piece);
        let (next, start, sign) = match u {
            0.0 if piece > first => (piece - 1, 1.0, -1.0),
            1.0 if piece + 1 < after => (piece + 1, 0.0, 1.0),
            _ => return false,
        };
        let controls =
            self.tube(next).map(|(tube, _)| tube.0).or_else(|| self.bezier(next >> self.halvings));
        let Some(controls) = controls else { return false };
        let [c, d, _] = derivatives(&controls, start);
        // Half the rate at which `|p - c|^2 - r^2` decreases per unit of `u`.
        let nearer = (position - c.truncate()).dot(d.truncate()) + c.w * d.w;
        nearer * sign > JOINT * c.w * d.truncate().length()
    }
}

impl PrimitiveSet for Curves {
    fn len(&self) -> usize {
        self.segment_count() << self.halvings
    }

    fn bounds(&self, piece: usize) -> Bounds3d {
        match &self.segments {
            Segments::Linear(curves) => curves.bounds(piece),
            Segments::Cubic(_) => {
                self.tube(piece).map_or(Bounds3d::EMPTY, |(tube, _)| tube.bounds())
            }
        }
    }

    fn closest(&self, piece: usize, ray: &DRay, time: f32) -> Option<PrimitiveHit> {
        self.closest_within(piece, ray, time).map(|(hit, _)| hit)
    }

    fn closest_within(
        &self,
        piece: usize,
        ray: &DRay,
        _time: f32,
    ) -> Option<(PrimitiveHit, Bounds3d)> {
        if self.capsules.get(piece).is_some_and(|capsule| capsule.is_missed(ray)) {
            return None;
        }
        let is_seen = |hit: &PrimitiveHit| {
            let at_end = hit.uv.x == 0.0 || hit.uv.x == 1.0;
            ray.contains(hit.t) && !(at_end && self.is_within_next(piece, hit.uv.x, ray.at(hit.t)))
        };
        match &self.segments {
            Segments::Linear(curves) => {
                let hit = curves.entry(piece, ray).filter(is_seen)?;
                Some((hit, curves.bounds(piece)))
            }
            Segments::Cubic(_) => {
                let (tube, _) = self.tube(piece)?;
                // The entries of the ray: every other crossing.
                let hit = tube.crossings(ray)?.step_by(2).find(is_seen)?;
                Some((hit, tube.bounds()))
            }
        }
    }

    fn fetch(&self, piece: usize) {
        if let Some(capsule) = self.capsules.get(piece) {
            fetch(capsule);
        }
    }

    fn surface(&self, piece: usize, position: DVec3, uv: Vec2, time: f32) -> ShapeSurface {
        let surface = match (&self.segments, self.tube(piece)) {
            (Segments::Linear(curves), _) => curves.surface(piece, position, uv, time),
            (Segments::Cubic(_), Some((tube, chord))) => tube.surface(position, uv.x, chord),
            (Segments::Cubic(curves), None) => {
                curves.surface(piece >> self.halvings, position, uv, time)
            }
        };
        let [first, after] = self.strand_of(piece);
        let count = (after - first) as f64;
        let mut along = surface.uv;
        along.x = ((piece - first) as f64 + along.x) / count;
        ShapeSurface { uv: along, dpdu: surface.dpdu * count, ..surface }
    }

    fn is_curve(&self) -> bool {
        true
    }

    fn color(&self, piece: usize, uv: Vec2) -> [f32; 4] {
        if self.colors.is_empty() {
            return [1.0; 4];
        }
        let segment = piece >> self.halvings;
        let strand = self.first_segments.partition_point(|&first| first as usize <= segment) - 1;
        let [first, after] = self.strand_of(piece);
        self.color_of_strand(strand, ((piece - first) as f32 + uv.x) / (after - first) as f32)
    }

    fn nearest_point(&self, piece: usize, point: DVec3, metric: &Metric) -> Option<(DVec3, Vec2)> {
        match &self.segments {
            Segments::Linear(curves) => curves.nearest_point(piece, point, metric),
            Segments::Cubic(_) => Some(self.tube(piece)?.0.nearest_point(point, metric)),
        }
    }

    fn contains(&self, piece: usize, point: DVec3) -> bool {
        match &self.segments {
            Segments::Linear(curves) => curves.contains(piece, point),
            Segments::Cubic(_) => self.tube(piece).is_some_and(|(tube, _)| tube.contains(point)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::tests::Random;
    use crate::{AcceptAll, BuildOptions, WorldBuilder};
    use snell_math::{Ray, Vec3};
    use std::sync::Arc;

    const BASES: [StrandBasis; 4] =
        [StrandBasis::Linear, StrandBasis::Bezier, StrandBasis::BSpline, StrandBasis::CatmullRom];

    /// A strand of three segments or more that winds gently along x.
    fn winding(basis: StrandBasis) -> Curves {
        let point = |i: u32| {
            let x = i as f32 * 0.5;
            Vec4::new(
                x,
                (x * 0.9).sin() * 0.6,
                (x * 0.7).cos() * 0.5,
                0.05 + 0.02 * (x * 1.3).cos(),
            )
        };
        Curves::new(basis, (0..10).map(point).collect(), vec![10]).expect("whole segments")
    }

    #[test]
    fn points_must_make_whole_segments_and_be_used_up() {
        let points = |n| vec![Vec4::ONE; n];
        assert_eq!(StrandBasis::Bezier.segments(7), Some(2));
        assert_eq!(
            [0, 1, 2, 3].map(|n| StrandBasis::Linear.segments(n)),
            [None, None, Some(1), Some(2)]
        );
        let error = Curves::new(StrandBasis::Bezier, points(9), vec![4, 5])
            .expect_err("five make no segments");
        assert_eq!(
            error.to_string(),
            "strand 1 has 5 points, expected 4, 7, 10 or the like: 3 for each segment and 1 more"
        );
        assert!(matches!(
            Curves::new(StrandBasis::Linear, points(5), vec![2, 2]),
            Err(StrandError::Total { .. })
        ));
        let none =
            Curves::new(StrandBasis::BSpline, Vec::new(), Vec::new()).expect("nothing is fine");
        assert!(none.is_empty() && none.bounds_of_all().is_empty());
    }

    #[test]
    fn colours_of_points_change_along_a_strand_and_a_ball_has_one() {
        let points = [0.0, 1.0, 2.0, 9.0, 9.0].map(|x| Vec4::new(x, 0.0, 0.0, 0.25)).to_vec();
        let curves = Curves::new(StrandBasis::Linear, points, vec![3, 2]).expect("two strands");
        assert_eq!(curves.ball_count(), 1);
        let grey = |value: f32| [value, value, value, 1.0];
        let few = curves.clone().with_colors(vec![grey(0.0); 4]).expect_err("five points");
        assert!(few.to_string().contains("4 colours, but 5 points"), "{few}");
        let colors = [0.0, 1.0, 0.0, 0.5, 0.5].map(grey).to_vec();
        let curves = curves.with_colors(colors).expect("one for each");
        let seen = |x: f64| {
            let ray = DRay::new(DVec3::new(x, 0.0, 5.0), DVec3::NEG_Z);
            (0..curves.len())
                .find_map(|i| curves.closest(i, &ray, 0.0).map(|hit| curves.color(i, hit.uv)[0]))
                .expect("a hit")
        };
        for (x, expected) in [(0.25, 0.25), (0.75, 0.75), (1.75, 0.25), (9.1, 0.5)] {
            assert!((seen(x) - expected).abs() < 1e-6, "{x}: {}", seen(x));
        }
    }

    #[test]
    fn a_ray_meets_a_strand_where_its_segments_together_begin_and_never_from_within() {
        for basis in BASES {
            let curves = winding(basis);
            let mut random = Random(7);
            let (mut hits, mut inside) = (0, 0);
            for _ in 0..20_000 {
                let target = curves
                    .bezier((random.unit() * curves.segment_count() as f32) as usize)
                    .expect("a segment")[0];
                let from = random.direction().as_dvec3() * 9.0;
                let way = target.truncate() + random.point(0.05).as_dvec3() - from;
                let ray = DRay::new(from, way);
                let closest = |set: &dyn PrimitiveSet, ray: &DRay| {
                    let all = (0..set.len()).filter_map(|i| Some((set.closest(i, ray, 0.0)?.t, i)));
                    all.min_by(|a, b| a.0.total_cmp(&b.0))
                };
                let segments: &dyn PrimitiveSet = match &curves.segments {
                    Segments::Linear(curves) => curves,
                    Segments::Cubic(curves) => curves,
                };
                let (mine, solids) = (closest(&curves, &ray), closest(segments, &ray));
                assert_eq!(mine.is_some(), solids.is_some(), "{basis:?}: {ray:?}");
                let (Some(mine), Some(solids)) = (mine, solids) else { continue };
                assert!((mine.0 - solids.0).abs() < 1e-6, "{basis:?}: {ray:?}");
                hits += 1;
                // The ray continues into the strand: anything it hits must be entered from outside.
                let point = ray.at(mine.0);
                let on = DRay { t_min: 1e-9, ..DRay::new(point, way) };
                let Some((t, again)) = closest(&curves, &on) else { continue };
                let surface = curves.surface(again, on.at(t), Vec2::splat(0.5), 0.0);
                assert!(surface.normal.dot(way) < 0.0, "{basis:?}: {ray:?}");
                let before = on.at(t - 1e-6);
                inside += usize::from((0..curves.len()).any(|i| curves.contains(i, before)));
            }
            assert!(hits > 5_000, "{basis:?}: {hits}");
            // Rays are aimed at joints. Where straight segments meet at an angle, a small part of
            // one's side is inside the other.
            assert!(inside * 50 < hits, "{basis:?}: {inside} hits within the strand, of {hits}");
        }
    }

    #[test]
    fn strands_have_no_cracks_where_segments_meet() {
        for basis in BASES {
            let curves = winding(basis);
            let mut random = Random(9);
            for segment in 1..curves.segment_count() {
                let joint = curves.bezier(segment).expect("a segment")[0];
                for _ in 0..3_000 {
                    let from = joint.truncate() + random.direction().as_dvec3() * 5.0;
                    let target = joint.truncate() + random.point(0.3).as_dvec3() * joint.w;
                    let ray = DRay::new(from, target - from);
                    assert!(
                        (0..curves.len()).any(|i| curves.closest(i, &ray, 0.0).is_some()),
                        "{basis:?}: {ray:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn coordinates_run_from_root_to_tip_and_derivatives_follow_them() {
        for basis in BASES {
            let curves = winding(basis);
            let mut last = 0.0;
            for piece in 0..curves.len() {
                let linear = || curves.bezier(piece).expect("a segment");
                let controls = curves.tube(piece).map_or_else(linear, |(tube, _)| tube.0);
                for u in [0.1, 0.5, 0.9] {
                    let [c, d, _] = derivatives(&controls, u);
                    let across = d.truncate().any_orthogonal_vector().normalize();
                    let surface = curves.surface(
                        piece,
                        c.truncate() + across * c.w,
                        Vec2::new(u as f32, 0.0),
                        0.0,
                    );
                    assert!(
                        surface.uv.x > last
                            && surface.uv.x < 1.0
                            && (0.0..1.0).contains(&surface.uv.y)
                    );
                    last = surface.uv.x;
                    let along = d.truncate() * curves.len() as f64;
                    assert!(
                        (surface.dpdu - along).length() < 0.05 * along.length(),
                        "{basis:?}: {surface:?}"
                    );
                }
            }
            assert!(last > 0.9);
        }
    }

    #[test]
    fn only_rays_that_miss_are_told_at_once_to_pass_by() {
        let mut random = Random(77);
        let (mut rejected, mut met) = (0, 0);
        for scale in [1.0f32, 1e-5, 1e6] {
            for _ in 0..3000 {
                let points = (0..4)
                    .map(|_| random.point(scale).extend(0.1 * scale * random.unit()))
                    .collect();
                let curves =
                    Curves::new(StrandBasis::Bezier, points, vec![4]).expect("four points");
                let direction = random.direction().as_dvec3();
                let target = random.point(scale).as_dvec3();
                // Origins near and far: squared distances from far away have few accurate digits.
                let origin = target
                    - direction * f64::from(scale) * if random.unit() < 0.5 { 0.5 } else { 1e5 };
                let ray = DRay::new(origin, direction);
                for piece in 0..curves.len() {
                    let is_met = curves.tube(piece).is_some_and(|(tube, _)| {
                        tube.crossings(&ray).is_some_and(|mut crossings| crossings.next().is_some())
                    });
                    let is_rejected = curves.capsules[piece].is_missed(&ray);
                    assert!(!(is_met && is_rejected), "{ray:?} {:?}", curves.capsules[piece]);
                    rejected += u32::from(is_rejected);
                    met += u32::from(is_met);
                }
            }
        }
        assert!(met > 300 && rejected > 10 * met, "{met} {rejected}");
    }

    #[test]
    fn broken_points_are_never_hit_and_do_no_harm() {
        let mut points: Vec<Vec4> = (0..12).map(|i| Vec4::new(i as f32, 0.0, 0.0, 0.1)).collect();
        (points[1].x, points[4].w, points[7].y) = (f32::NAN, -1.0, f32::INFINITY);
        for basis in [StrandBasis::Linear, StrandBasis::BSpline, StrandBasis::CatmullRom] {
            let curves =
                Curves::new(basis, points.clone(), vec![12]).expect("points as many as needed");
            let mut builder = WorldBuilder::default();
            builder.add_set(WorldBuilder::ROOT, Arc::new(curves));
            let world = builder.build(&BuildOptions::default()).expect("builds");
            for i in 0..110 {
                let ray = Ray::new(Vec3::new(i as f32 * 0.1, 3.0, 0.02), Vec3::NEG_Y);
                let hit = world.closest_one(&ray, &AcceptAll);
                if hit.is_hit() {
                    let surface = world.interaction(&ray, &hit);
                    assert!(
                        surface.on_curve
                            && surface.position.is_finite()
                            && surface.dpdu.is_finite()
                    );
                }
            }
        }
    }
}
