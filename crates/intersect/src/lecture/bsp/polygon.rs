//! Clipping of planes and boxes against each other.

use snell_math::plane::{Plane, Vertices};
use snell_math::{Bounds3d, DVec3};

/// The polygon in which a plane intersects a box; `point` must be a point of the plane in or near
/// the box.
pub(super) fn plane_in_box(plane: &Plane, point: DVec3, b: &Bounds3d, out: &mut Vertices) {
    let (x, y) = plane.normal.any_orthonormal_pair();
    let r = b.size().length() * 2.0;
    let mut polygon = vec![
        point - x * r - y * r,
        point + x * r - y * r,
        point + x * r + y * r,
        point - x * r + y * r,
    ];
    for axis in DVec3::AXES {
        for (side, sign) in [(b.min, 1.0), (b.max, -1.0)] {
            let mut part = Vec::with_capacity(8);
            Plane { normal: axis, offset: axis.dot(side) }.cut(&polygon, sign, &mut part);
            polygon = part;
        }
    }
    out.extend(polygon);
}

/// The part of a box on one side of a plane.
pub(super) struct BoxPart {
    /// Half of the surface area of the part, including the cut.
    pub half_area: f64,
    /// The box around the part.
    pub bounds: Bounds3d,
}

/// The two parts, back and front, into which a plane divides a box.
pub(super) fn parts_of_box(plane: &Plane, b: &Bounds3d) -> [BoxPart; 2] {
    if let Some(axis) = (0..3).find(|&a| plane.normal[a] == 1.0) {
        let mut bounds = [*b; 2];
        let at = plane.offset.clamp(b.min[axis], b.max[axis]);
        (bounds[0].max[axis], bounds[1].min[axis]) = (at, at);
        return bounds.map(|bounds| BoxPart { half_area: bounds.half_area(), bounds });
    }
    [-1.0, 1.0].map(|sign| part_of_box(plane, b, sign))
}

/// One part of a divided box, computed from the parts of the six faces. The area of the cut is the
/// length of the sum of the directed areas of all others.
fn part_of_box(plane: &Plane, b: &Bounds3d, sign: f64) -> BoxPart {
    let (mut area, mut directed, mut bounds) = (0.0, DVec3::ZERO, Bounds3d::EMPTY);
    let mut part = Vec::with_capacity(8);
    for axis in 0..3 {
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        for (side, outwards) in [(b.min, -1.0), (b.max, 1.0)] {
            let face =
                [(b.min, b.min), (b.max, b.min), (b.max, b.max), (b.min, b.max)].map(|(u, v)| {
                    let mut p = side;
                    (p[j], p[k]) = (u[j], v[k]);
                    p
                });
            part.clear();
            plane.cut(&face, sign, &mut part);
            let size = area_of(&part);
            area += size;
            directed[axis] += outwards * size;
            bounds = part.iter().fold(bounds, |b, &p| b.with_point(p));
        }
    }
    BoxPart {
        half_area: (area + directed.length()) * 0.5,
        bounds: if bounds.is_empty() { *b } else { bounds },
    }
}

/// The area of a convex polygon.
fn area_of(polygon: &[DVec3]) -> f64 {
    let Some(&a) = polygon.first() else { return 0.0 };
    polygon.windows(2).map(|w| (w[0] - a).cross(w[1] - a)).sum::<DVec3>().length() * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_a_box_share_the_cut() {
        let b = Bounds3d { min: DVec3::ZERO, max: DVec3::ONE };
        let plane = Plane { normal: DVec3::new(1.0, 1.0, 0.0).normalize(), offset: 0.5f64.sqrt() };
        let [back, front] = parts_of_box(&plane, &b);
        // The half surface area consists of half of the cube's and half of the diagonal cut.
        assert!(
            (back.half_area - (3.0 + 2f64.sqrt()) / 2.0).abs() < 1e-12
                && (front.half_area - back.half_area).abs() < 1e-12
        );
        let plane = Plane { normal: DVec3::ONE.normalize(), offset: 0.5 / 3f64.sqrt() };
        let [back, _] = parts_of_box(&plane, &b);
        assert!((back.bounds.max - 0.5).abs().max_element() < 1e-12, "{:?}", back.bounds);
    }

    #[test]
    fn the_parts_of_a_cut_polygon_make_up_the_whole() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        for i in 0..100 {
            let turn = f64::from(i);
            let plane =
                Plane { normal: DVec3::new(turn.cos(), turn.sin(), 0.1).normalize(), offset: 0.3 };
            let (mut front, mut back) = (Vec::new(), Vec::new());
            plane.cut(&square, 1.0, &mut front);
            plane.cut(&square, -1.0, &mut back);
            let sum: f64 = [&front, &back].iter().filter(|p| p.len() > 2).map(|p| area_of(p)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{i}: {sum}");
            assert!(front.iter().all(|p| plane.distance(p) > -1e-12));
            assert!(back.iter().all(|p| plane.distance(p) < 1e-12));
        }
    }

    #[test]
    fn a_plane_meets_a_cube_in_a_hexagon() {
        let normal = DVec3::ONE.normalize();
        let (center, mut polygon) = (DVec3::splat(0.5), Vec::new());
        let plane = Plane { normal, offset: normal.dot(center) };
        plane_in_box(&plane, center, &Bounds3d { min: DVec3::ZERO, max: DVec3::ONE }, &mut polygon);
        assert_eq!(polygon.len(), 6);
        assert!((area_of(&polygon) - 27f64.sqrt() / 4.0).abs() < 1e-12);
    }

    #[test]
    fn sides_of_boxes_are_those_of_their_corners() {
        let b = Bounds3d { min: DVec3::new(-1.0, 0.0, 2.0), max: DVec3::new(1.0, 3.0, 2.5) };
        let corners: Vec<DVec3> = (0..8)
            .map(|i| {
                DVec3::from_array(std::array::from_fn(|a| {
                    if i >> a & 1 == 1 { b.max[a] } else { b.min[a] }
                }))
            })
            .collect();
        for i in 0..200 {
            let turn = f64::from(i);
            let normal = DVec3::new(turn.cos(), turn.sin(), (turn * 0.7).sin()).normalize();
            let plane = Plane { normal, offset: turn * 0.02 - 1.0 };
            assert_eq!(plane.side_of_box(&b, 0.0), plane.side(&corners, 0.0), "{i}");
        }
    }
}
