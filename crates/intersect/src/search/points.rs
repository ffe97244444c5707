//! The input of point queries.

use crate::precision::{Double, Precision, Single};
use snell_math::{DVec3, Vec3};

/// What decides whether a point is inside. With each method, a point exactly on the surface of what
/// bounds an inside is inside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum InsideMethod {
    /// Body by body; a point is inside if it is inside any body.
    ///
    /// The triangles of a mesh that are joined at edges, after corners at equal positions are taken
    /// for one, are a body.
    ///
    /// - A *closed* body is decided exactly, by the crossings of a ray with it: a point is inside
    ///   if they differ in number outwards and inwards, in whichever orientation the body is (and
    ///   by parity if its triangles are not oriented alike). A body inside another one of the same
    ///   mesh that is turned the other way is a cavity.
    /// - An *open* body (with a border) is decided by its winding number, within its box: a point
    ///   is inside if the number is more than a half, in either orientation. So are all open
    ///   surfaces of a mesh together, such as the faces of a solid that are not joined at edges.
    /// - Sheets such as terrains, floors and planes bound nothing. These are open surfaces whose
    ///   area vectors add up to more than 0.7 of their area.
    /// - Solid shapes, spheres and segments of curves are bodies.
    #[default]
    Auto,
    /// The parity of a ray's hits on everything, open or closed.
    Parity,
    /// The sum of the winding numbers of everything is more than a half. Where the sum is nearly a
    /// half, within about a thousandth, either answer is given.
    Winding,
}

/// A batch of points. A slice of points converts into a batch without a distance limit, with all
/// mask bits set and [`InsideMethod::Auto`].
#[derive(Clone, Copy, Debug)]
pub struct Points<'a, P: Precision = Single> {
    /// The points, in world space.
    pub points: &'a [P::Point],
    /// The largest distance at which surfaces are found, inclusive.
    pub max_distance: P::Distance,
    /// A largest distance for each point, or empty. The smaller one of this and `max_distance`
    /// applies.
    pub max_distances: &'a [P::Distance],
    /// Only geometries and instances whose mask has a bit in common with this one count.
    pub mask: u64,
    /// What decides whether a point is inside, for queries that ask for it.
    pub method: InsideMethod,
}

impl<'a> Points<'a> {
    /// Points without distance limits.
    pub fn new(points: &'a [Vec3]) -> Self {
        Self {
            points,
            max_distance: f32::INFINITY,
            max_distances: &[],
            mask: u64::MAX,
            method: InsideMethod::Auto,
        }
    }
}

impl<'a> Points<'a, Double> {
    /// Points without distance limits, in double precision.
    pub fn of_doubles(points: &'a [DVec3]) -> Self {
        Self {
            points,
            max_distance: f64::INFINITY,
            max_distances: &[],
            mask: u64::MAX,
            method: InsideMethod::Auto,
        }
    }
}

impl<P: Precision> Points<'_, P> {
    /// The number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// True if the batch has no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The points of a range of indices, with their limits.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Self {
        let max_distances = if self.max_distances.is_empty() {
            self.max_distances
        } else {
            &self.max_distances[range.clone()]
        };
        Self { points: &self.points[range], max_distances, ..*self }
    }

    /// The distance limit of a point; NaN (which finds nothing) if either limit is NaN.
    pub(crate) fn limit(&self, number: usize) -> f64 {
        let own = self.max_distances.get(number).map_or(f64::INFINITY, |&own| own.into());
        let all = self.max_distance.into();
        if own < all || own.is_nan() { own } else { all }
    }

    /// Panics unless there is one result per point, and either no limit or one per point.
    pub(crate) fn check(&self, answers: usize) {
        assert_eq!(self.len(), answers, "one answer per point");
        assert!(
            self.max_distances.is_empty() || self.max_distances.len() == self.len(),
            "one limit per point"
        );
    }
}

impl<'a> From<&'a [Vec3]> for Points<'a> {
    fn from(points: &'a [Vec3]) -> Self {
        Self::new(points)
    }
}

impl<'a> From<&'a Vec<Vec3>> for Points<'a> {
    fn from(points: &'a Vec<Vec3>) -> Self {
        Self::new(points)
    }
}

impl<'a, const N: usize> From<&'a [Vec3; N]> for Points<'a> {
    fn from(points: &'a [Vec3; N]) -> Self {
        Self::new(points)
    }
}

impl<'a> From<&'a [DVec3]> for Points<'a, Double> {
    fn from(points: &'a [DVec3]) -> Self {
        Self::of_doubles(points)
    }
}

impl<'a> From<&'a Vec<DVec3>> for Points<'a, Double> {
    fn from(points: &'a Vec<DVec3>) -> Self {
        Self::of_doubles(points)
    }
}

impl<'a, const N: usize> From<&'a [DVec3; N]> for Points<'a, Double> {
    fn from(points: &'a [DVec3; N]) -> Self {
        Self::of_doubles(points)
    }
}
