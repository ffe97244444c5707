//! A ray in the coordinates of one group, with all data that the general box and triangle tests
//! need.

use super::triangle::{ExactRay, Projection};
use snell_math::{DRay, DVec3, Vec3};

/// Axes x, y, z of a projection: z is the axis along which the direction of the ray is largest
/// (Woop, Benthin and Wald 2013).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Axes([u8; 4]);

impl Axes {
    /// The axes for each number of the z axis.
    pub const BY_Z: [Self; 3] = [Self([1, 2, 0, 0]), Self([2, 0, 1, 0]), Self([0, 1, 2, 0])];

    /// The number of the z axis.
    #[inline(always)]
    pub fn z(self) -> usize {
        usize::from(self.0[2])
    }

    /// The elements of `all` for the axes x, y and z.
    #[inline(always)]
    pub fn of<T>(self, all: &[T; 3]) -> [&T; 3] {
        let [x, y, z, _] = self.0.map(usize::from);
        // SAFETY: the axis numbers are those of `BY_Z`, below 3.
        unsafe { [all.get_unchecked(x), all.get_unchecked(y), all.get_unchecked(z)] }
    }

    /// The inverse of [`Self::of`].
    #[inline(always)]
    pub fn back<T: Copy>(self, projected: [T; 3]) -> [T; 3] {
        let (mut all, [x, y, z, _]) = (projected, self.0.map(usize::from));
        for (axis, value) in [x, y, z].into_iter().zip(projected) {
            // SAFETY: the axis numbers are those of `BY_Z`, below 3.
            unsafe { *all.get_unchecked_mut(axis) = value };
        }
        all
    }
}

/// A ray in the coordinates of a group. The `f64` ray decides distances. Values derived from it in
/// `f32` decide which triangles the ray passes through (`origin`, `axes` and `shear`, the
/// projection) and which boxes can be skipped (`near_origin` and the following fields,
/// conservatively).
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    /// The ray after the inverse transforms of the instances. Its interval is not used.
    pub exact: DRay,
    /// The origin rounded to nearest; vertices are projected relative to it.
    pub origin: [f32; 3],
    /// The axes of the projection.
    pub axes: Axes,
    /// The shear of the projection: projected x = x - shear[0] z, y = y - shear[1] z.
    pub shear: [f32; 2],
    /// Distance along the ray per unit of the z axis. 0 if it has no usable value in `f32`; then
    /// depths are not compared.
    pub depth_scale: f32,
    /// The origin on each axis, rounded so that near planes come nearer.
    pub near_origin: [f32; 3],
    /// The origin on each axis, rounded so that far planes move away.
    pub far_origin: [f32; 3],
    /// Inverse direction: never zero, and infinite on axes along which the ray does not move.
    pub inverse: [f32; 3],
    /// 1 for each axis along which the direction is negative, so that the near plane of a box is
    /// its maximum.
    pub negative: [usize; 3],
    /// Bound on the errors of the origin and of a vertex, for trees of rounded vertices
    /// ([`super::double`]); 0 in single precision.
    pub slack: f32,
}

impl LocalRay {
    /// Prepares a ray of a tree in single precision. The signs of directions are unpredictable, so
    /// nothing branches on them; and nothing is stored before all values are computed, so that the
    /// processor never waits for part of a vector that it has just stored.
    #[inline(always)]
    pub fn new(exact: &DRay) -> Self {
        Self::within(exact, exact.origin, exact.direction, 0.0)
    }

    /// Prepares a ray for a tree whose coordinates differ from those of its group. `o` and `d` are
    /// the origin and direction in the tree's coordinates, and vertices there are off by up to
    /// `slack`.
    #[inline(always)]
    pub fn within(exact: &DRay, o: DVec3, d: DVec3, slack: f32) -> Self {
        let a = d.abs();
        let (x_first, y_first) = (a.x >= a.y && a.x >= a.z, a.y >= a.z);
        let pick = |x: f64, y: f64, z: f64| {
            if x_first {
                x
            } else if y_first {
                y
            } else {
                z
            }
        };
        let z = pick(d.x, d.y, d.z);
        let depth_scale = (1.0 / z) as f32;
        let usable = depth_scale.abs() > 1e-18 && depth_scale.abs() < 1e18;
        let sides = [
            AxisRay::new(o.x, d.x, slack),
            AxisRay::new(o.y, d.y, slack),
            AxisRay::new(o.z, d.z, slack),
        ];
        Self {
            exact: *exact,
            origin: [sides[0].origin, sides[1].origin, sides[2].origin],
            axes: Axes::BY_Z[if x_first { 0 } else { 2 - usize::from(y_first) }],
            // The shears are quotients, so that `f32` operands give the bits of a division in
            // `f32`.
            shear: [(pick(d.y, d.z, d.x) / z) as f32, (pick(d.z, d.x, d.y) / z) as f32],
            depth_scale: if usable { depth_scale } else { 0.0 },
            near_origin: [sides[0].near, sides[1].near, sides[2].near],
            far_origin: [sides[0].far, sides[1].far, sides[2].far],
            inverse: [sides[0].inverse, sides[1].inverse, sides[2].inverse],
            negative: [sides[0].negative(), sides[1].negative(), sides[2].negative()],
            slack,
        }
    }

    /// The data of the ray for the exact test.
    #[inline(always)]
    pub fn exact_ray(&self) -> ExactRay {
        let projection = Projection { origin: self.origin, axes: self.axes, shear: self.shear };
        ExactRay { origin: self.exact.origin, direction: self.exact.direction, projection }
    }
}

/// The data of the box test for one axis; see [`LocalRay`] for the fields.
struct AxisRay {
    origin: f32,
    near: f32,
    far: f32,
    inverse: f32,
}

impl AxisRay {
    #[inline(always)]
    fn new(o: f64, d: f64, slack: f32) -> Self {
        let origin = (o as f32).clamp(f32::MIN, f32::MAX);
        let is_exact = slack == 0.0 && f64::from(origin) == o;
        let rounding =
            if is_exact { 0.0 } else { origin.abs() * f32::EPSILON + f32::MIN_POSITIVE + slack };
        // Zero counts as positive. The inverse is never zero, so that empty boxes stay infinitely
        // far.
        let slow = d as f32 + 0.0;
        let inverse = (1.0 / slow.abs()).max(f32::from_bits(1));
        let side = rounding.copysign(slow);
        // If the direction is so small or large that `f32` cannot represent where the ray crosses a
        // plane, no plane limits the ray on this axis.
        let unknown = (inverse == f32::INFINITY && d != 0.0) || inverse < 1e-30;
        let inverse = if unknown { f32::INFINITY } else { inverse };
        let (middle, side) = if unknown { (0.0, f32::MAX.copysign(slow)) } else { (origin, side) };
        // Kept finite, so that an empty box never gives NaN, which comparisons would ignore.
        let finite = |x: f32| x.clamp(f32::MIN, f32::MAX);
        Self {
            origin,
            near: finite(middle + side),
            far: finite(middle - side),
            inverse: inverse.copysign(slow),
        }
    }

    #[inline(always)]
    fn negative(&self) -> usize {
        (self.inverse.to_bits() >> 31) as usize
    }
}

/// The vertex converted to double precision.
#[inline(always)]
pub(crate) fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from_array(v).as_dvec3()
}
