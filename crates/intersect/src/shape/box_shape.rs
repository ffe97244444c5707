//! A box with sides parallel to the axes, and two intersection tests.

use super::frustum::choose;
use super::nearest::on_triangle;
use super::plane::intersect_plane;
use super::span::{Span, crossings};
use super::{Metric, Patch, Shape, ShapeError, ShapeHit, ShapePoint, ShapeSample, ShapeSurface};
use serde::{Deserialize, Serialize};
use snell_math::{Bounds3d, DRay, DVec2, DVec3};

snell_math::declare! {
    /// A box with sides parallel to the axes. Faces: 0 to 5 = -x, +x, -y, +y, -z, +z.
    ///
    /// `uv` spans each face; seen from outside, a picture on the four upright faces is upright with
    /// y up and not mirrored, on +y it is upright seen from above with -z up, on -y seen from below
    /// with +z up.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct BoxShape {
        /// Least corner.
        #[unit("scene units")]
        pub min: DVec3,
        /// Greatest corner, not below `min` in any coordinate.
        #[unit("scene units")]
        pub max: DVec3,
    }
}

/// Directions in which `u` and `v` grow on each face.
const UV_AXES: [[DVec3; 2]; 6] = [
    [DVec3::Z, DVec3::NEG_Y],
    [DVec3::NEG_Z, DVec3::NEG_Y],
    [DVec3::X, DVec3::NEG_Z],
    [DVec3::X, DVec3::Z],
    [DVec3::NEG_X, DVec3::NEG_Y],
    [DVec3::X, DVec3::NEG_Y],
];

/// The nearest hit, face by face (lecture: "ray-box intersection": find the intersection with the
/// plane of each side, check that it is inside the rectangle, return the least `t`). All six sides
/// are tested, because testing only those that face the ray would lose every ray that starts
/// inside. By rounding, a ray exactly through an edge may slip between two faces;
/// [`intersect_slabs`] is watertight.
pub fn intersect_faces(shape: &BoxShape, ray: &DRay) -> Option<ShapeHit> {
    let hit_face = |face: usize| {
        let axis = face / 2;
        let corner = if face % 2 == 1 { shape.max } else { shape.min };
        let t = intersect_plane(ray, corner, DVec3::AXES[axis])?;
        let p = ray.at(t);
        let inside = (0..3).all(|i| i == axis || (shape.min[i] <= p[i] && p[i] <= shape.max[i]));
        inside.then_some(ShapeHit { t, face: face as u32 })
    };
    (0..6).filter_map(hit_face).min_by(|a, b| a.t.total_cmp(&b.t))
}

/// The nearest hit by slabs: the ray is inside the box where it is between all three pairs of
/// planes (Kay and Kajiya, Ray tracing complex scenes, 1986). For a ray that starts inside, the hit
/// is its exit.
pub fn intersect_slabs(shape: &BoxShape, ray: &DRay) -> Option<ShapeHit> {
    crossings(ray, |o, d| shape.span(o, d), |_| true)[0]
}

impl BoxShape {
    /// Boxes for tests and galleries: cube, off-centre, plank, tiny.
    pub fn examples() -> Vec<Self> {
        [
            (DVec3::NEG_ONE, DVec3::ONE),
            (DVec3::new(2.0, -1.0, 0.5), DVec3::new(3.0, 4.0, 0.75)),
            (DVec3::new(-100.0, -1e-3, -1.0), DVec3::new(100.0, 1e-3, 1.0)),
            (DVec3::splat(1e-4), DVec3::splat(3e-4)),
        ]
        .map(|(min, max)| Self { min, max })
        .to_vec()
    }

    /// The two triangles of each face, in the order of the faces; seen from outside they run
    /// anticlockwise.
    pub(crate) fn triangles(&self) -> [[DVec3; 3]; 12] {
        std::array::from_fn(|i| {
            let (axis, is_upper, is_second) = (i / 4, i / 2 % 2 == 1, i % 2 == 1);
            let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |in_y: bool, in_z: bool| {
                let mut p = if is_upper { self.max } else { self.min };
                p[y] = if in_y { self.max[y] } else { self.min[y] };
                p[z] = if in_z { self.max[z] } else { self.min[z] };
                p
            };
            let [a, b] = [corner(false, false), corner(true, true)];
            let c = corner(!is_second, is_second);
            if is_second == is_upper { [a, b, c] } else { [a, c, b] }
        })
    }

    /// The intersection of the three slabs along a line, for finite numbers.
    fn span(&self, o: DVec3, d: DVec3) -> Option<Span> {
        let (mut enter, mut exit, mut faces) = (f64::NEG_INFINITY, f64::INFINITY, [0, 1]);
        for i in 0..3 {
            let [low, high] = [self.min[i], self.max[i]];
            if d[i] == 0.0 {
                if o[i] < low || high < o[i] {
                    return None;
                }
                continue;
            }
            // These are divisions for the same reason as in [`slab`]: their signs and order are
            // exact.
            let (at_low, at_high, lower) =
                ((low - o[i]) / d[i], (high - o[i]) / d[i], 2 * i as u32);
            let is_forward = d[i] > 0.0;
            let (near, far) = if is_forward { (at_low, at_high) } else { (at_high, at_low) };
            if near > enter {
                (enter, faces[0]) = (near, lower + u32::from(!is_forward));
            }
            if far < exit {
                (exit, faces[1]) = (far, lower + u32::from(is_forward));
            }
        }
        Span::new(enter, exit, faces)
    }

    /// The two triangles of a face.
    fn face_triangles(&self, face: u32) -> [[DVec3; 3]; 2] {
        let axis = face as usize / 2;
        let corner = |x: bool, y: bool| {
            let mut p = if face % 2 == 1 { self.max } else { self.min };
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            p[i] = if x { self.max[i] } else { self.min[i] };
            p[j] = if y { self.max[j] } else { self.min[j] };
            p
        };
        let (a, b, c, d) =
            (corner(false, false), corner(true, false), corner(true, true), corner(false, true));
        [[a, b, c], [a, c, d]]
    }

    fn face_areas(&self) -> [f64; 6] {
        let d = self.max - self.min;
        let pairs = [d.y * d.z, d.z * d.x, d.x * d.y];
        std::array::from_fn(|face| pairs[face / 2])
    }

    /// The corners of a face, counter-clockwise from outside.
    fn corners_of(&self, face: u32) -> [DVec3; 4] {
        let (axis, upper) = ((face / 2) as usize, face % 2 == 1);
        let (s, t) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |a: bool, b: bool| {
            let mut p = self.min;
            p[axis] = if upper { self.max[axis] } else { self.min[axis] };
            p[s] = if a { self.max[s] } else { self.min[s] };
            p[t] = if b { self.max[t] } else { self.min[t] };
            p
        };
        let corners =
            [corner(false, false), corner(true, false), corner(true, true), corner(false, true)];
        if upper { corners } else { [corners[0], corners[3], corners[2], corners[1]] }
    }
}

impl Shape for BoxShape {
    fn validate(&self) -> Result<(), ShapeError> {
        for (i, name) in ["max.x", "max.y", "max.z"].into_iter().enumerate() {
            let finite = self.min[i].is_finite();
            ShapeError::unless("box", name, self.max[i], "at least min", |x| {
                finite && x >= self.min[i]
            })?;
        }
        Ok(())
    }

    fn bounds(&self) -> Bounds3d {
        Bounds3d { min: self.min, max: self.max }
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        intersect_slabs(self, ray)
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        crossings(ray, |o, d| self.span(o, d), |_| true)
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.nearest_two(ray).into_iter().flatten());
    }

    fn surface(&self, position: DVec3, face: u32) -> ShapeSurface {
        let (p, normal) = self.normal(position, face);
        let size = self.max - self.min;
        // From 0 at the side where the axis starts to 1 at the side to which it points.
        let along = |axis: DVec3| {
            let from = if axis.element_sum() > 0.0 { p - self.min } else { self.max - p };
            let extent = axis.abs().dot(size);
            if extent > 0.0 { axis.abs().dot(from) / extent } else { 0.0 }
        };
        // The box may be flat, and then the axis itself is the tangent.
        let tangent =
            |axis: DVec3| if (axis * size).abs().max_element() > 0.0 { axis * size } else { axis };
        let [u, v] = UV_AXES[face.min(5) as usize];
        ShapeSurface {
            position: p,
            normal,
            uv: DVec2::new(along(u), along(v)),
            dpdu: tangent(u),
            dpdv: tangent(v),
        }
    }

    fn normal(&self, position: DVec3, face: u32) -> (DVec3, DVec3) {
        let face = face.min(5) as usize;
        let (axis, upper) = (face / 2, face % 2 == 1);
        let mut p = position.max(self.min).min(self.max);
        p[axis] = if upper { self.max[axis] } else { self.min[axis] };
        (p, if upper { DVec3::AXES[axis] } else { -DVec3::AXES[axis] })
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        if metric.is_similarity() {
            let on = |face| ShapePoint { position: self.surface(point, face).position, face };
            return metric.nearest(point, (0..6).map(on));
        }
        let halves =
            (0..6).flat_map(|face| self.face_triangles(face).map(|corners| (face, corners)));
        metric.nearest(
            point,
            halves.map(|(face, t)| ShapePoint { position: on_triangle(metric, point, &t).0, face }),
        )
    }

    fn winding_number(&self, point: DVec3, _metric: &Metric) -> f64 {
        f64::from(point.cmpgt(self.min).all() && point.cmplt(self.max).all())
    }

    fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    fn area(&self) -> f64 {
        self.face_areas().iter().sum()
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        let (face, x) = choose(&self.face_areas(), u.x);
        let axis = face / 2;
        let mut s = DVec3::ZERO;
        s[(axis + 1) % 3] = x;
        s[(axis + 2) % 3] = u.y;
        Some(ShapeSample::at(self, self.min + (self.max - self.min) * s, face as u32))
    }

    fn is_closed(&self) -> bool {
        true
    }

    fn patches(&self) -> Vec<Patch> {
        (0..6).map(|face| Patch::flat(face, self.corners_of(face))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: BoxShape = BoxShape { min: DVec3::NEG_ONE, max: DVec3::ONE };

    #[test]
    fn errata_e7_a_ray_from_inside_hits_the_far_side_by_both_methods() {
        let ray = DRay::new(DVec3::new(0.25, 0.0, 0.0), DVec3::new(0.5, 0.1, 0.0));
        let expected = Some(ShapeHit { t: 1.5, face: 1 });
        assert_eq!(intersect_slabs(&CUBE, &ray), expected);
        assert_eq!(intersect_faces(&CUBE, &ray), expected);
    }

    #[test]
    fn a_box_turned_inside_out_is_never_hit() {
        let wrong = BoxShape { min: DVec3::ONE, max: DVec3::NEG_ONE };
        assert!(wrong.validate().is_err() && wrong.bounds().is_empty());
        assert_eq!(wrong.closest(&DRay::new(DVec3::new(0.1, 0.2, -5.0), DVec3::Z)), None);
    }
}
