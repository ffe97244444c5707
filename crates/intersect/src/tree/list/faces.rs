//! Faces: flat convex outlines of one triangle, or of two that together are a quadrilateral.

use super::{Corners, normal};
use crate::exact::ray::wide;
use snell_math::DVec3;

/// For planes across an axis the sign is always certain. But what is left of the difference of two
/// coordinates may vanish by division if they are less than this.
pub(crate) const LEAST_COORDINATE: f32 = 1e-22;

/// A face, ready to be tested against many rays. It is seen along one of the axes, in units of
/// distance from its edges there.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Face {
    /// How far the plane is above a point: this plus the product of the point with `down`, the unit
    /// normal turned around.
    pub offset: f64,
    pub down: [f64; 3],
    /// The unit normal.
    pub normal: [f32; 3],
    /// Where the plane is on the axis, if it is across it.
    pub level: f32,
    pub outline: Outline,
    /// Positive on the side of the first triangle.
    pub diagonal: Line,
    /// The sign of a height is certain if it is more than these coefficients of the coordinates of
    /// the point, without their signs, and a constant.
    pub near: [f32; 4],
}

/// Coefficients of the two coordinates seen from the centre of the list, and a constant: the
/// distance from a line, which has a sign.
pub(crate) type Line = [f32; 3];

/// Where a face is, in the coordinates that are seen.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Outline {
    /// Of a parallelogram: the lines midway between opposite edges, and how far away these are.
    Strips([Line; 2], [f32; 2]),
    /// Of others: the edges, positive inside.
    Edges([Line; 4]),
}

/// The faces that are seen along one axis: those in planes across it, and the others.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faces {
    pub across: Vec<Face>,
    pub tilted: Vec<Face>,
}

/// A face as it is found.
pub(crate) struct Shape {
    /// The largest component of the normal: it is seen along that.
    pub axis: usize,
    /// The unit normal.
    normal: DVec3,
    /// As [`Face::near`].
    near: [f64; 4],
    /// The plane is not across the axis, or so near to the origin that it is not taken for that.
    pub is_tilted: bool,
    /// Three or four, around the face.
    outline: Vec<DVec3>,
    /// On both sides of the line between the first and the third corner of the outline, if it has
    /// four.
    pub triangles: [usize; 2],
}

/// The normals of slivers, of less than this area relative to the square of the longest side, are
/// not well known.
const LEAST_AREA: f64 = 1.0 / (1 << 20) as f64;

/// Planes may be as far apart, relative to the size of numbers, and count as one.
const SAME_PLANE: f64 = 1.0 / (1u64 << 44) as f64;

/// Heights above tilted planes are off by less than this, relative to the products that they are
/// made of, here and in the exact test together: some twenty roundings of `f64`, which is less than
/// `2^-48` of them.
const HEIGHT_ERROR: f64 = 1.0 / (1u64 << 44) as f64;

/// And no less than that, so that nothing vanishes.
const LEAST_HEIGHT: f64 = 1e-30;

/// Edges are parallel if the coefficients of their lines differ by no more than this together, so
/// that half of it, relative to the size of the list, is how far the distance from an edge is off.
const PARALLEL: f64 = 1.0 / (1u64 << 20) as f64;

/// The faces of some triangles; `None` if there are slivers.
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
        // Each component of the normal is a difference of two products, and off by the roundings of
        // these.
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

    /// Both as one, if they are triangles in one plane, and form a convex quadrilateral.
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
        // What is above one of the two planes must be above the other.
        let farthest = self.outline.iter().fold(DVec3::ZERO, |far, v| far.max(v.abs()));
        let apart = [turn.x, turn.y, turn.z, highest + turn.dot(farthest)];
        let near = std::array::from_fn(|i| self.near[i].max(other.near[i]) + apart[i]);
        let side = |of: &[DVec3], i: usize| [of[i], of[(i + 1) % 3], of[(i + 2) % 3]];
        for i in 0..9 {
            let ([a, b, c], [d, e, f]) = (side(&self.outline, i % 3), side(&other.outline, i / 3));
            if a == e && b == d {
                // The first triangle is a, b and c.
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

    /// The coordinates of a point when looked at along the axis.
    fn seen(&self, v: DVec3) -> [f64; 2] {
        [v[(self.axis + 1) % 3], v[(self.axis + 2) % 3]]
    }

    /// The line through two corners as coefficients of a distance from it; the origin is at
    /// `center`.
    fn line(&self, from: DVec3, to: DVec3, center: DVec3) -> [f64; 3] {
        let ([x, y], [dx, dy]) = (self.seen(from - center), self.seen(to - from));
        let scale = self.normal[self.axis].signum() / dx.hypot(dy);
        let (a, b) = (-dy * scale, dx * scale);
        [a, b, -(a * x + b * y)]
    }

    /// Ready to be tested, in a list with this centre.
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
    /// Of four edges, of which the last is the first again if there are only three.
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
