//! Maps regions of rays to regions of a plane.

use super::polygon::{Affine, ConvexPolygon};
use snell_math::{DAffine3, DVec2, DVec3, DVec4};

/// A projection in which rays are points: all rays from one point (*perspective*) or in one
/// direction (*parallel*).
///
/// A point in the world has a place `(x, y)` and a *nearness*, which on every plane is an affine
/// function of the place, as in a z-buffer: the reciprocal of the depth in a perspective
/// projection, and the negative depth in a parallel one.
#[derive(Clone, Copy, Debug)]
pub struct View {
    rows: Rows,
    /// The common origin of all rays; `None` in a parallel projection.
    apex: Option<DVec3>,
    /// The ray of the place (0, 0): its direction from the apex, or its origin in a parallel
    /// projection.
    corner: DVec3,
    /// The change of that vector with the x of the place.
    across: DVec3,
    /// The change of that vector with the y of the place.
    down: DVec3,
    /// The direction of parallel rays.
    direction: DVec3,
}

/// Affine functions of points, each given by its coefficients. The place is `x / depth` and `y /
/// depth`, and the nearness of a point is `nearness / depth`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    pub x: DVec4,
    pub y: DVec4,
    pub nearness: DVec4,
    pub depth: DVec4,
    pub is_parallel: bool,
}

impl View {
    /// Rays from `apex`: the ray of place `(x, y)` has the direction `corner + x across + y down`,
    /// and depth is in units of it. `None` if the three vectors are not independent.
    pub fn perspective(apex: DVec3, corner: DVec3, across: DVec3, down: DVec3) -> Option<Self> {
        let [x, y, depth] = inverse_rows(across, down, corner)?;
        let from = |row: DVec3| row.extend(-row.dot(apex));
        let rows = Rows {
            x: from(x),
            y: from(y),
            nearness: DVec4::W,
            depth: from(depth),
            is_parallel: false,
        };
        Some(Self { rows, apex: Some(apex), corner, across, down, direction: DVec3::ZERO })
    }

    /// Parallel rays: the ray of place `(x, y)` starts at `corner + x across + y down`, and depth
    /// is in units of `direction`.
    pub fn parallel(direction: DVec3, corner: DVec3, across: DVec3, down: DVec3) -> Option<Self> {
        let [x, y, depth] = inverse_rows(across, down, direction)?;
        let from = |row: DVec3| row.extend(-row.dot(corner));
        let rows = Rows {
            x: from(x),
            y: from(y),
            nearness: -from(depth),
            depth: DVec4::W,
            is_parallel: true,
        };
        Some(Self { rows, apex: None, corner, across, down, direction })
    }

    /// Rays from `apex` through a triangle, which appears as the triangle of (0, 0), (1, 0) and (0,
    /// 1), at depth 1.
    pub fn through_triangle(apex: DVec3, [a, b, c]: [DVec3; 3]) -> Option<Self> {
        Self::perspective(apex, a - apex, b - a, c - a)
    }

    /// One of six views that cover all directions from a point: along axis 0, 1 or 2, up or down.
    /// Each covers places from -1 to 1.
    pub fn cube_side(apex: DVec3, axis: usize, up: bool) -> Self {
        let axes = DVec3::AXES;
        let towards = if up { axes[axis] } else { -axes[axis] };
        let view = Self::perspective(apex, towards, axes[(axis + 1) % 3], axes[(axis + 2) % 3]);
        view.expect("axes are independent")
    }

    /// The common origin of the rays; `None` in a parallel projection.
    pub fn apex(&self) -> Option<DVec3> {
        self.apex
    }

    /// Place and nearness of a point; `None` at and behind the apex.
    pub fn project(&self, p: DVec3) -> Option<(DVec2, f64)> {
        let p = p.extend(1.0);
        let depth = self.rows.depth.dot(p);
        let place = DVec2::new(self.rows.x.dot(p), self.rows.y.dot(p)) / depth;
        (depth > 0.0 && place.is_finite()).then(|| (place, self.rows.nearness.dot(p) / depth))
    }

    /// The point in the world for a place and a nearness.
    pub fn point(&self, place: DVec2, nearness: f64) -> DVec3 {
        let at = self.corner + self.across * place.x + self.down * place.y;
        match self.apex {
            Some(apex) => apex + at / nearness,
            None => at - self.direction * nearness,
        }
    }

    /// Direction of the ray of a place; its length is arbitrary.
    pub fn direction(&self, place: DVec2) -> DVec3 {
        match self.apex {
            Some(_) => self.corner + self.across * place.x + self.down * place.y,
            None => self.direction,
        }
    }

    /// The place of the rays from the apex in this direction; `None` if the view does not cover it.
    pub fn place_of_direction(&self, direction: DVec3) -> Option<DVec2> {
        self.project(self.apex? + direction).map(|(place, _)| place)
    }

    /// The nearness at infinity.
    pub(super) fn horizon(&self) -> f64 {
        if self.apex.is_some() { 0.0 } else { -1e300 }
    }

    /// The functions of [`Self::project`] for points in the coordinates of a group.
    pub(super) fn rows_in(&self, world_from_local: &DAffine3) -> Rows {
        let m = world_from_local;
        let row = |r: DVec4| {
            let n = r.truncate();
            (m.matrix3.transpose() * n).extend(n.dot(m.translation) + r.w)
        };
        let Rows { x, y, nearness, depth, is_parallel } = self.rows;
        Rows { x: row(x), y: row(y), nearness: row(nearness), depth: row(depth), is_parallel }
    }

    pub(crate) fn rows(&self) -> Rows {
        self.rows
    }
}

/// The rows of the inverse of the matrix with these columns.
fn inverse_rows(a: DVec3, b: DVec3, c: DVec3) -> Option<[DVec3; 3]> {
    let scale = 1.0 / a.dot(b.cross(c));
    let rows = [b.cross(c) * scale, c.cross(a) * scale, a.cross(b) * scale];
    rows.iter().all(|r| r.is_finite() && *r != DVec3::ZERO).then_some(rows)
}

/// A triangle, or a part of it, as a view sees it: a triangle in the plane, with its nearness.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    pub polygon: ConvexPolygon,
    pub nearness: Affine,
}

/// A rectangle of places, with a minimum depth and nearness.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    pub low: DVec2,
    pub high: DVec2,
    /// The minimum depth; 0 or more.
    pub near: f64,
    /// The minimum nearness.
    pub floor: f64,
}

impl Window {
    /// The functions of points for the six sides of the window; a point where any of them is
    /// negative is outside.
    pub fn sides(&self, rows: &Rows) -> [DVec4; 6] {
        [
            rows.x - rows.depth * self.low.x,
            rows.depth * self.high.x - rows.x,
            rows.y - rows.depth * self.low.y,
            rows.depth * self.high.y - rows.y,
            self.beyond(rows),
            rows.nearness - rows.depth * self.floor,
        ]
    }

    /// The distance beyond the near plane.
    fn beyond(&self, rows: &Rows) -> DVec4 {
        (if rows.is_parallel { -rows.nearness } else { rows.depth }) - DVec4::W * self.near
    }

    /// Reports the visible part of a triangle: one facet, or several if it crosses the near plane.
    pub fn facets(&self, rows: &Rows, corners: &[DVec3; 3], mut each: impl FnMut(Facet)) {
        let points = corners.map(|p| p.extend(1.0));
        // x, y, nearness (each times depth), depth.
        let h = points.map(|p| {
            DVec4::new(rows.x.dot(p), rows.y.dot(p), rows.nearness.dot(p), rows.depth.dot(p))
        });
        let beyond = |h: &DVec4| (if rows.is_parallel { -h.z } else { h.w }) - self.near;
        let outside = |side: &dyn Fn(&DVec4) -> f64| h.iter().all(|h| side(h) < 0.0);
        if outside(&|h| h.x - h.w * self.low.x)
            || outside(&|h| h.w * self.high.x - h.x)
            || outside(&|h| h.y - h.w * self.low.y)
            || outside(&|h| h.w * self.high.y - h.y)
            || outside(&beyond)
            || outside(&|h| h.z - h.w * self.floor)
        {
            return;
        }
        let Some(nearness) = plane(&h) else { return };
        let place = |h: &DVec4| DVec2::new(h.x, h.y) / h.w;
        let far_enough = |h: &DVec4| beyond(h) >= 0.0 && h.w > 1e-9 * (h.x.abs() + h.y.abs());
        let mut facet = |[a, b, c]: [DVec2; 3]| {
            let polygon = ConvexPolygon::triangle(a, b, c);
            if polygon.area() > 0.0 {
                each(Facet { polygon, nearness });
            }
        };
        if h.iter().all(far_enough) {
            return facet([place(&h[0]), place(&h[1]), place(&h[2])]);
        }
        let clipped = self.clipped(&h, &beyond);
        let places: Vec<DVec2> = clipped.iter().filter(|h| h.w > 0.0).map(place).collect();
        for i in 2..places.len() {
            facet([places[0], places[i - 1], places[i]]);
        }
    }

    /// Clips a triangle to the window, before the division by depth (Blinn and Newell, Clipping
    /// Using Homogeneous Coordinates, SIGGRAPH 1978).
    fn clipped(&self, h: &[DVec4; 3], beyond: &dyn Fn(&DVec4) -> f64) -> Vec<DVec4> {
        let sides: [&dyn Fn(&DVec4) -> f64; 5] = [
            beyond,
            &|h| h.x - h.w * self.low.x,
            &|h| h.w * self.high.x - h.x,
            &|h| h.y - h.w * self.low.y,
            &|h| h.w * self.high.y - h.y,
        ];
        let mut polygon = h.to_vec();
        for side in sides {
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for (i, a) in polygon.iter().enumerate() {
                let b = &polygon[(i + 1) % polygon.len()];
                let (da, db) = (side(a), side(b));
                if da >= 0.0 {
                    kept.push(*a);
                }
                if (da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0) {
                    kept.push(*a + (*b - *a) * (da / (da - db)));
                }
            }
            polygon = kept;
        }
        polygon
    }
}

/// Nearness on the plane through three projected points, as a function of the place; `None` if the
/// plane is seen edge-on.
fn plane(h: &[DVec4; 3]) -> Option<Affine> {
    let (u, v, w) = (h[0], h[1] - h[0], h[2] - h[0]);
    let minor = |pick: fn(DVec4) -> DVec3| pick(u).dot(pick(v).cross(pick(w)));
    let a = minor(|h| DVec3::new(h.y, h.z, h.w));
    let b = -minor(|h| DVec3::new(h.x, h.z, h.w));
    let c = minor(|h| DVec3::new(h.x, h.y, h.w));
    let d = -minor(|h| DVec3::new(h.x, h.y, h.z));
    let nearness = Affine { normal: DVec2::new(-a / c, -b / c), offset: -d / c };
    (nearness.normal.is_finite() && nearness.offset.is_finite()).then_some(nearness)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_places_are_inverse_and_planes_are_affine() {
        let corner = DVec3::new(-1.0, 0.5, 2.0);
        let (across, down) = (DVec3::new(0.1, 0.02, 0.0), DVec3::new(0.0, -0.1, 0.03));
        let origin = DVec3::new(3.0, 4.0, 5.0);
        for view in [
            View::perspective(origin, corner, across, down),
            View::parallel(corner, origin, across, down),
        ] {
            let view = view.expect("independent");
            let corners =
                [(1.0, 2.0, 3.0), (4.0, -1.0, 9.0), (7.0, 7.0, 5.0)].map(|(x, y, depth)| {
                    let nearness = if view.apex().is_some() { 1.0 / depth } else { -depth };
                    let p = view.point(DVec2::new(x, y), nearness);
                    let (place, n) = view.project(p).expect("in front");
                    assert!(
                        (place - DVec2::new(x, y)).length() < 1e-9 && (n - nearness).abs() < 1e-9
                    );
                    p
                });
            let window = Window {
                low: DVec2::splat(-100.0),
                high: DVec2::splat(100.0),
                near: 0.0,
                floor: view.horizon(),
            };
            let mut facets = Vec::new();
            window.facets(&view.rows(), &corners, |f| facets.push(f));
            assert_eq!(facets.len(), 1);
            let (place, nearness) =
                view.project((corners[0] + corners[1] * 2.0 + corners[2]) / 4.0).expect("in front");
            assert!((facets[0].nearness.at(place) - nearness).abs() < 1e-9);
            assert!(facets[0].polygon.contains(place, 0.0));
        }
    }

    #[test]
    fn a_triangle_behind_and_before_the_apex_is_clipped() {
        let view = View::cube_side(DVec3::ZERO, 2, true);
        let window = Window { low: DVec2::splat(-1.0), high: DVec2::ONE, near: 0.0, floor: 0.0 };
        // The plane y = -1/2 from far behind to far ahead is visible below the horizon.
        let corners =
            [DVec3::new(-1e4, -0.5, -1e4), DVec3::new(1e4, -0.5, -1e4), DVec3::new(0.0, -0.5, 1e6)];
        let mut area = 0.0;
        window.facets(&view.rows(), &corners, |f| area += f.polygon.area());
        assert!((area - 2.0).abs() < 1e-2, "{area}");
    }
}
