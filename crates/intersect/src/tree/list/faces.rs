//! Faces: flat convex outlines of one triangle, or of two triangles that form a quadrilateral.

use super::{Corners, normal};
use crate::exact::ray::wide;
use snell_math::DVec3;
use snell_math::real;

/// The least nonzero magnitude of the coordinate of a plane perpendicular to an axis. The sign of
/// the height above such a plane is always certain, but for smaller coordinates the difference may
/// underflow in the division.
pub(crate) const LEAST_COORDINATE: f32 = 1e-22;

/// A face prepared for tests against many rays. The face is projected along one of the axes, and
/// distances from its edges are measured in the projection.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Face {
    /// The height of the plane above a point is `offset` plus the dot product of the point with
    /// `down`, the negated unit normal.
    pub offset: f64,
    pub down: [f64; 3],
    /// The unit normal.
    pub normal: [f32; 3],
    /// The coordinate of the plane on the axis, if the plane is perpendicular to the axis.
    pub level: f32,
    pub outline: Outline,
    /// A line that is positive on the side of the first triangle.
    pub diagonal: Line,
    /// Coefficients of the magnitudes of a point's coordinates, and a constant. The sign of a
    /// height is certain if its magnitude exceeds this linear function.
    pub near: [f32; 4],
}

/// Coefficients of the two projected coordinates relative to the centre of the list, and a
/// constant: the signed distance from a line.
pub(crate) type Line = [f32; 3];

/// The outline of a face in the projection.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Outline {
    /// A parallelogram: the lines midway between opposite edges, and the distances from them to the
    /// edges.
    Strips([Line; 2], [f32; 2]),
    /// Any other outline: the lines of the edges, positive inside.
    Edges([Line; 4]),
}

/// The faces that are projected along one axis: those perpendicular to the axis, and the others.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faces {
    pub across: Vec<Face>,
    pub tilted: Vec<Face>,
}

/// A face while the list is built.
pub(crate) struct Shape {
    /// The axis of the largest component of the normal, along which the face is projected.
    pub axis: usize,
    /// The unit normal.
    normal: DVec3,
    /// Coefficients for [`Face::near`].
    near: [f64; 4],
    /// True if the plane is not perpendicular to the axis, or is too near to the origin to be
    /// treated so.
    pub is_tilted: bool,
    /// The three or four corners in order around the face.
    outline: Vec<DVec3>,
    /// The triangles on both sides of the diagonal from the first to the third corner of the
    /// outline. Both are the same if the outline has three corners.
    pub triangles: [usize; 2],
}

/// The least area of a triangle relative to the square of its longest side. The normals of thinner
/// triangles are inaccurate.
const LEAST_AREA: f64 = 1.0 / (1 << 20) as f64;

/// The largest distance between two planes, relative to the size of the coordinates, that are
/// treated as one.
const SAME_PLANE: f64 = 1.0 / (1u64 << 44) as f64;

/// Bound on the error of a height above a tilted plane, here and in the exact test together,
/// relative to the products that make up the height. The error is about twenty roundings of `f64`,
/// less than `2^-48` of the products.
const HEIGHT_ERROR: f64 = 1.0 / (1u64 << 44) as f64;

/// The least absolute bound on the error of a height, so that the bound never underflows.
const LEAST_HEIGHT: f64 = 1e-30;

/// Edges count as parallel if the sum of the differences between the coefficients of their lines is
/// at most this. Half of it, relative to the size of the list, is the error of the distance from an
/// edge.
const PARALLEL: f64 = 1.0 / (1u64 << 20) as f64;

/// The faces of some triangles; `None` if one of the triangles is a sliver.
pub(crate) fn shapes(triangles: &[Corners]) -> Option<Vec<Shape>> {
    let mut shapes: Vec<Shape> = Vec::new();
    for (number, corners) in triangles.iter().enumerate() {
        let shape = Shape::of_triangle(corners, number)?;
        let other =
            shapes.iter_mut().find_map(|other| other.with(&shape).map(|joined| (other, joined)));
        match other {
            Some((other, joined)) => *other = joined,
            None => shapes.push(shape),
        }
    }
    Some(shapes)
}

impl Shape {
    fn of_triangle(corners: &Corners, number: usize) -> Option<Self> {
        let outline = corners.map(wide);
        let [a, b, c] = outline;
        let longest = (b - a).abs().max((c - b).abs()).max((a - c).abs()).max_element();
        let area = normal(corners);
        let axis =
            (0..3).fold(0, |best, i| if area[i].abs() > area[best].abs() { i } else { best });
        if area[axis].abs() <= longest * longest * LEAST_AREA {
            return None;
        }
        let level = corners[0][axis].abs();
        let is_tilted = (0..3).any(|i| i != axis && area[i] != 0.0)
            || (level > 0.0 && level < LEAST_COORDINATE);
        let mut normal = area.normalize();
        if !is_tilted {
            normal[axis] = area[axis].signum();
        }
        // Each component of the normal is a difference of two products, and its error comes from
        // rounding these.
        let (u, v) = ((b - a).abs(), (c - a).abs());
        let products =
            DVec3::new(u.y * v.z + u.z * v.y, u.z * v.x + u.x * v.z, u.x * v.y + u.y * v.x);
        let weights = products / area.length() * HEIGHT_ERROR;
        let constant = weights.dot(a.abs().max(b.abs()).max(c.abs())) + LEAST_HEIGHT;
        let near = [weights.x, weights.y, weights.z, constant];
        Some(Self {
            axis,
            normal,
            near,
            is_tilted,
            outline: outline.to_vec(),
            triangles: [number; 2],
        })
    }

    /// Both faces joined, if they are triangles in one plane and form a convex quadrilateral.
    fn with(&self, other: &Self) -> Option<Self> {
        if self.outline.len() != 3 || other.outline.len() != 3 || self.axis != other.axis {
            return None;
        }
        let size = self.outline.iter().fold(0.0, |size: f64, v| size.max(v.abs().max_element()));
        let allowed = if self.is_tilted && other.is_tilted { SAME_PLANE } else { 0.0 };
        let height = |v: &DVec3| (*v - self.outline[0]).dot(self.normal).abs();
        let highest = other.outline.iter().map(height).fold(0.0, f64::max);
        let turn = (self.normal - other.normal).abs();
        if turn.max_element() > allowed || highest > allowed * size {
            return None;
        }
        // A point that is certainly above one of the two planes must also be above the other.
        let farthest = self.outline.iter().fold(DVec3::ZERO, |far, v| far.max(v.abs()));
        let apart = [turn.x, turn.y, turn.z, highest + turn.dot(farthest)];
        let near = std::array::from_fn(|i| self.near[i].max(other.near[i]) + apart[i]);
        let side = |of: &[DVec3], i: usize| [of[i], of[(i + 1) % 3], of[(i + 2) % 3]];
        for i in 0..9 {
            let ([a, b, c], [d, e, f]) = (side(&self.outline, i % 3), side(&other.outline, i / 3));
            if a == e && b == d {
                // The first triangle has the corners a, b and c.
                let joined = Self {
                    outline: vec![b, c, a, f],
                    near,
                    triangles: [self.triangles[0], other.triangles[0]],
                    ..*self
                };
                return joined.is_convex().then_some(joined);
            }
        }
        None
    }

    fn is_convex(&self) -> bool {
        let corners = self.outline.iter();
        (0..4).all(|i| {
            let edge = self.line(self.outline[i], self.outline[(i + 1) % 4], DVec3::ZERO);
            let others = corners.clone().enumerate().filter(|(j, _)| *j != i && *j != (i + 1) % 4);
            others.into_iter().all(|(_, v)| {
                let [x, y] = self.seen(*v);
                edge[0] * x + edge[1] * y + edge[2] > 0.0
            })
        })
    }

    /// The coordinates of a point in the projection along the axis.
    fn seen(&self, v: DVec3) -> [f64; 2] {
        [v[(self.axis + 1) % 3], v[(self.axis + 2) % 3]]
    }

    /// The line through two corners, as coefficients of the signed distance from it with the origin
    /// at `center`.
    fn line(&self, from: DVec3, to: DVec3, center: DVec3) -> [f64; 3] {
        let ([x, y], [dx, dy]) = (self.seen(from - center), self.seen(to - from));
        let scale = self.normal[self.axis].signum() / real::hypot(dx, dy);
        let (a, b) = (-dy * scale, dx * scale);
        [a, b, -(a * x + b * y)]
    }

    /// Prepares the face for tests, in a list with this centre.
    pub fn face(&self, center: DVec3) -> Face {
        let n = self.outline.len();
        let line = |from: usize, to: usize| {
            self.line(self.outline[from % n], self.outline[to % n], center)
        };
        Face {
            offset: self.normal.dot(self.outline[0]),
            down: (-self.normal).to_array(),
            normal: self.normal.as_vec3().to_array(),
            level: self.outline[0][self.axis] as f32,
            outline: Outline::new(std::array::from_fn(|i| line(i, i + 1)), n == 4),
            near: self.near.map(|x| (x as f32).next_up()),
            diagonal: if n == 4 { line(2, 0).map(|x| x as f32) } else { [0.0, 0.0, 1.0] },
        }
    }
}

impl Outline {
    /// The outline with these edges. If there are only three, the last edge repeats the first.
    fn new(edges: [[f64; 3]; 4], are_four: bool) -> Self {
        let [a, b, c, d] = edges;
        let are_parallel =
            |a: [f64; 3], c: [f64; 3]| (a[0] + c[0]).abs() + (a[1] + c[1]).abs() <= PARALLEL;
        if !are_four || !are_parallel(a, c) || !are_parallel(b, d) {
            return Self::Edges(edges.map(|line| line.map(|x| x as f32)));
        }
        let midway =
            |a: [f64; 3], c: [f64; 3]| std::array::from_fn(|i| ((a[i] - c[i]) * 0.5) as f32);
        let half = |a: [f64; 3], c: [f64; 3]| ((a[2] + c[2]) * 0.5) as f32;
        Self::Strips([midway(a, c), midway(b, d)], [half(a, c), half(b, d)])
    }
}
