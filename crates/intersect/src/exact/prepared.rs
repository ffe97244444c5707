//! A ray of ordinary size, prepared for the fast kernels.
//!
//! Nearly all rays are ordinary, as [`PreparedRay`] defines. For them nothing overflows or cancels,
//! so boxes can be tested by one fused multiplication and addition per plane, and rays given in
//! `f32` can be prepared in `f32`. All other rays, and all rays in trees of extraordinary size, are
//! traced with the general [`super::ray::LocalRay`]. Both give the same hits: origin, axes and
//! shear have the same bits, and boxes and filters are conservative.

use super::ray::Axes;
use super::triangle::{ExactRay, Projection};
use snell_math::glam::Vec4Swizzles;
use snell_math::simd::Lanes8;
use snell_math::{DVec3, Ray, Vec3, Vec4};

/// Relative padding of box distances. Ize (Robust BVH Ray Traversal, JCGT 2013) needs `2 gamma(3)`,
/// about `4e-7`, for the slabs alone; the projection of triangles may have as large an error again.
pub(crate) const BOX_PADDING: f32 = 1.0e-6;

/// The largest magnitude of the coordinates of ordinary boxes and origins.
pub(crate) const MAX_COORDINATE: f32 = 1e12;

/// The smallest magnitude of a component of an ordinary direction that is not zero.
const MIN_SLOPE: f32 = 1e-24;
/// The largest magnitude of a component of an ordinary direction. The largest component must have a
/// magnitude of at least `1 / MAX_SLOPE`.
const MAX_SLOPE: f32 = 1e12;

/// More than the ray parameter of any point on an ordinary ray inside a box, which is at most
/// `2 MAX_COORDINATE MAX_SLOPE`.
const BEYOND: f32 = 4e24;

/// Replaces the inverse of a direction component of 0, after division by the magnitude of the
/// origin's coordinate where that is above 1. So planes parallel to the ray are at a distance of
/// about [`BEYOND`] or more, unless they are as close to the origin as `4e-13` (or its rounding
/// error).
const PARALLEL: f32 = 1e37;

/// An ordinary ray prepared for the kernels, in the coordinates of a group. (The data of the box
/// test come first and without gaps, because with dozens of rays in flight each cache line counts.)
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct PreparedRay {
    /// Inverse direction, `x y z`; a large number on axes along which the ray does not move.
    pub inverse: [f32; 3],
    /// For each axis, a term for the distances to near planes. With fused operations it is added to
    /// the product of the plane and `inverse`; otherwise it is subtracted from the plane. Rounded
    /// so that planes come nearer.
    pub near: [f32; 3],
    /// For each axis, the corresponding term for far planes, rounded so that planes move away.
    pub far: [f32; 3],
    /// The octant of the direction, with the numbering of [`crate::tree::node::WideNode::order`].
    octant: u32,
    /// The origin rounded to nearest; vertices are projected relative to it.
    pub origin: [f32; 3],
    /// The shear of the projection, see [`super::ray::LocalRay::shear`].
    pub shear: [f32; 2],
    /// The axes of the projection.
    pub axes: Axes,
    /// Bound on the error of a vertex relative to the origin; 0 in single precision.
    pub slack: f32,
}

/// The eight planes of a node on one side of an axis, one plane per box. The value is the index of
/// the first plane within [`crate::tree::node::WideNode::bounds`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planes(u8);

impl Planes {
    /// The index of the first plane: 0, 8, and so on to 40.
    #[inline(always)]
    pub fn first(self) -> usize {
        usize::from(self.0)
    }
}

/// For each octant the near planes `x y z`, the far planes `x y z`, and two unused entries.
static PLANES: [[Planes; 8]; 8] = {
    let mut table = [[Planes(0); 8]; 8];
    let mut octant = 0;
    while octant < 8 {
        let mut axis = 0;
        while axis < 3 {
            let near = if octant >> axis & 1 == 1 { 24 } else { 0 };
            table[octant][axis] = Planes(near + 8 * axis as u8);
            table[octant][axis + 3] = Planes(24 - near + 8 * axis as u8);
            axis += 1;
        }
        octant += 1;
    }
    table
};

/// True if a tree whose largest coordinate is `extent` is of ordinary size.
pub(crate) fn is_ordinary(extent: f32) -> bool {
    extent <= MAX_COORDINATE
}

impl PreparedRay {
    /// A placeholder for a ray that is not prepared yet.
    pub const UNSET: Self = Self {
        inverse: [0.0; 3],
        near: [0.0; 3],
        far: [0.0; 3],
        octant: 0,
        origin: [0.0; 3],
        shear: [0.0; 2],
        axes: Axes::BY_Z[0],
        slack: 0.0,
    };

    /// Prepares a ray that is given in `f32`. Returns false if the ray is not ordinary, or its
    /// interval is empty or begins below zero. (Writes in place, because copies of values just
    /// written would have to wait for them.)
    #[inline(always)]
    pub fn set_from_ray<L: Lanes8>(&mut self, ray: &Ray) -> bool {
        let [o, d] = halves(ray);
        let a = d.abs();
        if !((ray.t_min >= 0.0) & (ray.t_min < ray.t_max) & is_ordinary_line(o, a)) {
            return false;
        }
        (self.axes, self.shear) = axes_and_shear(&ray.direction, a);
        self.set_slabs::<L>(o, d)
    }

    /// The data of the ray for the exact test; `origin` and `direction` must be those that were
    /// prepared.
    #[inline(always)]
    pub fn exact(&self, origin: DVec3, direction: DVec3) -> ExactRay {
        let projection = Projection { origin: self.origin, axes: self.axes, shear: self.shear };
        ExactRay { origin, direction, projection }
    }

    /// Prepares a ray given in `f64`, as after the transforms of instances. Returns false if the
    /// ray is not ordinary.
    #[inline(always)]
    pub fn set_from_exact<L: Lanes8>(&mut self, origin: &DVec3, direction: &DVec3) -> bool {
        // The fourth components are 1, as in `halves`.
        let (o, d) = (origin.as_vec3().extend(1.0), direction.as_vec3().extend(1.0));
        if !is_ordinary_line(o, d.abs()) || (is_slow(d) && is_too_slow(direction)) {
            return false;
        }
        let a = direction.abs();
        let bit = |i: usize, at_least: bool| usize::from(at_least) << i;
        self.axes = AXES[bit(0, a.x >= a.y) | bit(1, a.x >= a.z) | bit(2, a.y >= a.z)];
        let [x, y, z] = self.axes.of(direction.as_ref());
        self.shear = [(x / z) as f32, (y / z) as f32];
        self.set_slabs::<L>(o, d)
    }

    #[inline(always)]
    fn set_slabs<L: Lanes8>(&mut self, o: Vec4, d: Vec4) -> bool {
        // At most three roundings: of the origin to `f32`, and of the product and the sum here.
        const ROUNDING: f32 = 6.0 * (f32::EPSILON / 2.0);
        let inverse = d.recip();
        let (near, far) = if L::FUSED {
            let middle = -(o * inverse);
            let side = middle.abs() * ROUNDING + f32::MIN_POSITIVE;
            (middle - side, middle + side)
        } else {
            let side = (o.abs() * ROUNDING + f32::MIN_POSITIVE).copysign(d);
            (o + side, o - side)
        };
        self.inverse = inverse.truncate().to_array();
        self.near = near.truncate().to_array();
        self.far = far.truncate().to_array();
        self.origin = o.truncate().to_array();
        self.octant = d.is_negative_bitmask() & 7;
        !is_slow(d) || self.set_slow::<L>(&d.to_array())
    }

    /// Sets the values of axes along which the ray does not move. Returns false if a component of
    /// the direction is too small without being 0, or if all are too small.
    #[cold]
    #[inline(never)]
    fn set_slow<L: Lanes8>(&mut self, d: &[f32; 4]) -> bool {
        if d[..3].iter().all(|slope| slope.abs() < 1.0 / MAX_SLOPE) {
            return false;
        }
        self.octant = 0;
        for (i, &slope) in d.iter().enumerate().take(3) {
            // Zero counts as positive, whatever its sign.
            self.octant |= u32::from(slope < 0.0) << i;
            if slope != 0.0 {
                if slope.abs() < MIN_SLOPE {
                    return false;
                }
                continue;
            }
            let o = self.origin[i];
            self.inverse[i] = PARALLEL / o.abs().max(1.0);
            let middle = if L::FUSED { -(o * self.inverse[i]) } else { o };
            let slack = middle.abs() * 4.0 * f32::EPSILON;
            if L::FUSED {
                (self.near[i], self.far[i]) = (middle - slack - BEYOND, middle + slack + BEYOND);
            } else {
                let slack = slack + BEYOND / PARALLEL;
                (self.near[i], self.far[i]) = (middle + slack, middle - slack);
            }
        }
        true
    }

    /// Widens the ray for boxes and origins that are off by up to `slack` along each axis.
    #[inline(always)]
    pub fn widen<L: Lanes8>(&mut self, slack: f32) {
        let largest = self.origin[0].abs().max(self.origin[1].abs()).max(self.origin[2].abs());
        self.slack = slack + largest * (f32::EPSILON * 0.5);
        for i in 0..3 {
            if L::FUSED {
                let side = slack * self.inverse[i].abs();
                (self.near[i], self.far[i]) = (self.near[i] - side, self.far[i] + side);
            } else {
                let side = slack.copysign(self.inverse[i]);
                (self.near[i], self.far[i]) = (self.near[i] + side, self.far[i] - side);
            }
        }
    }

    /// The near planes `x y z` of the ray's octant, the far planes `x y z`, and two unused entries.
    #[inline(always)]
    pub fn planes(&self) -> &'static [Planes; 8] {
        &PLANES[self.octant()]
    }

    /// The octant of the direction.
    #[inline(always)]
    pub fn octant(&self) -> usize {
        self.octant as usize & 7
    }
}

/// Origin and direction, each with a fourth component of 1: the value is never used, but must be an
/// ordinary number, since others slow the processor down.
#[inline(always)]
fn halves(ray: &Ray) -> [Vec4; 2] {
    let start = (&raw const *ray).cast::<Vec4>();
    // SAFETY: a ray is eight numbers in this order (`repr(C)`): origin, start, direction, end.
    // (Loaded at once, which the compiler does not do on its own.)
    let [o, d] = unsafe { [start.read_unaligned(), start.add(1).read_unaligned()] };
    [o.with_w(1.0), d.with_w(1.0)]
}

/// The axes and the shear of the projection, from a direction and the magnitudes of its components.
#[inline(always)]
fn axes_and_shear(direction: &Vec3, sizes: Vec4) -> (Axes, [f32; 2]) {
    let axes = AXES[(sizes.xxyw().cmpge(sizes.yzzw()).bitmask() & 7) as usize];
    // By a table rather than conditions, because the order of magnitudes is unpredictable.
    let [x, y, z] = axes.of(direction.as_ref());
    (axes, [x / z, y / z])
}

/// True if no component is too large. (The fourth component is ignored.)
#[inline(always)]
fn is_ordinary_line(o: Vec4, d: Vec4) -> bool {
    let ordinary = o.abs().cmple(Vec4::splat(MAX_COORDINATE)) & d.cmple(Vec4::splat(MAX_SLOPE));
    ordinary.bitmask() & 7 == 7
}

/// True if some component of a direction is so small that the direction may not be ordinary.
#[inline(always)]
fn is_slow(d: Vec4) -> bool {
    d.abs().cmpge(Vec4::splat(1.0 / MAX_SLOPE)).bitmask() & 7 != 7
}

/// True if some component of a direction is too small without being 0. (Rounded to `f32` it may be
/// 0.)
#[cold]
fn is_too_slow(direction: &DVec3) -> bool {
    (direction.abs().cmplt(DVec3::splat(f64::from(MIN_SLOPE))) & direction.cmpne(DVec3::ZERO)).any()
}

/// The axes of the projection, indexed by three comparisons of magnitudes of the direction as bits:
/// x at least y, x at least z, y at least z.
static AXES: [Axes; 8] = {
    const FIRST: [Axes; 3] = Axes::BY_Z;
    [FIRST[2], FIRST[2], FIRST[2], FIRST[0], FIRST[1], FIRST[1], FIRST[1], FIRST[0]]
};

/// The factor that moves the far side of a box away; see [`BOX_PADDING`].
pub(crate) const FAR_FACTOR: f32 = 1.0 + BOX_PADDING;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exact::ray::LocalRay;
    use crate::kernel::single::boxes::{PreparedBoxes, prepared_distances};
    use crate::search::padded;
    use crate::tree::node::ChildRef;
    use crate::tree::node::WideNode;
    use proptest::prelude::*;
    use snell_math::simd::{Level, Portable, Portable8, Wide8, WideToken};
    use snell_math::{Bounds3, DRay, Vec3};

    /// Zeros of either sign, and small and large numbers.
    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            Just(0.0f32),
            Just(-0.0f32),
            -2.0f32..2.0,
            (-2.0f32..2.0, -12i32..12).prop_map(|(x, e)| x * 10.0f32.powi(e)),
            (-8i32..8).prop_map(|i| i as f32 * 0.25),
        ]
    }

    fn vector() -> impl Strategy<Value = Vec3> {
        [number(), number(), number()].prop_map(Vec3::from_array)
    }

    /// Whether a ray hits a box, by the arithmetic of a SIMD level; `None` if the ray is not
    /// ordinary.
    fn is_met<L: Lanes8>(token: L::Token, ray: &Ray, bounds: &Bounds3, cull: f32) -> Option<bool> {
        let mut prepared = PreparedRay::UNSET;
        if !prepared.set_from_ray::<L>(ray) {
            return None;
        }
        let mut node = WideNode::EMPTY;
        node.set(5, bounds, ChildRef::node(1));
        let (enter, limit) = prepared_distances::<L>(token, &node, &prepared, ray.t_min, cull);
        let met = enter.le(limit);
        let extent = bounds.min.abs().max(bounds.max.abs()).max_element();
        let boxes = PreparedBoxes::<L>::new(token, &prepared, extent);
        let [start, end] = [ray.t_min, cull].map(|t| L::splat(token, t));
        let (enter, limit) = boxes.distances(&node, start, end);
        let again = enter.le(limit);
        assert_eq!((met | again) & !(1 << 5), 0, "empty boxes are never met");
        assert!(met == 0 || again != 0, "with all in registers it is not met: {ray:?} {bounds:?}");
        Some(met != 0)
    }

    proptest! {
        #[test]
        fn boxes_around_points_on_the_ray_are_met(
            o in vector(), d in vector(),
            t in 0.0f64..1.0, e in -6i32..6,
            below in vector(), above in vector(),
        ) {
            let ray = Ray::new(o, if d == Vec3::ZERO { Vec3::Y } else { d });
            // A box around the exact point, as tight as possible.
            let t = t * 10f64.powi(e);
            let p = DRay::from(&ray).at(t);
            let exact = snell_math::Bounds3d { min: p, max: p }.outward_f32();
            let bounds = Bounds3 { min: exact.min - below.abs(), max: exact.max + above.abs() };
            for cull in [padded(t as f32), f32::INFINITY] {
                prop_assert_ne!(is_met::<Portable8>(Portable, &ray, &bounds, cull), Some(false));
                if let Some(wide) = Level::best().wide() {
                    let is_met = is_met::<Wide8>(WideToken::from(wide), &ray, &bounds, cull);
                    prop_assert_ne!(is_met, Some(false));
                }
            }
        }

        #[test]
        fn rays_prepared_in_f32_and_in_f64_are_projected_alike(o in vector(), d in vector()) {
            let ray = Ray::new(o, d);
            let (mut prepared, mut exact) = (PreparedRay::UNSET, PreparedRay::UNSET);
            let (o, d) = (o.as_dvec3(), d.as_dvec3());
            if prepared.set_from_ray::<Portable8>(&ray) {
                prop_assert!(exact.set_from_exact::<Portable8>(&o, &d));
                let general = LocalRay::new(&DRay::new(o, d));
                prop_assert_eq!([prepared.axes, exact.axes], [general.axes; 2]);
                prop_assert_eq!(prepared.shear.map(f32::to_bits), general.shear.map(f32::to_bits));
                prop_assert_eq!(exact.shear.map(f32::to_bits), general.shear.map(f32::to_bits));
                prop_assert_eq!(prepared.origin, general.origin);
            }
        }
    }

    #[test]
    fn a_box_beside_an_axis_parallel_ray_is_missed_and_one_around_it_met() {
        let ray = Ray::new(Vec3::new(0.5, 0.25, -3.0), Vec3::Z);
        let bounds =
            |x: f32| Bounds3 { min: Vec3::new(x, 0.0, 0.0), max: Vec3::new(x + 1.0, 1.0, 1.0) };
        assert_eq!(is_met::<Portable8>(Portable, &ray, &bounds(0.0), 1e20), Some(true));
        assert_eq!(is_met::<Portable8>(Portable, &ray, &bounds(0.51), 1e20), Some(false));
        assert_eq!(
            is_met::<Portable8>(Portable, &ray, &bounds(0.5), 1e20),
            Some(true),
            "the side belongs to the box"
        );
    }

    #[test]
    fn extraordinary_rays_are_refused() {
        let mut prepared = PreparedRay::UNSET;
        let mut accepts = |ray: Ray| prepared.set_from_ray::<Portable8>(&ray);
        assert!(accepts(Ray::new(Vec3::ZERO, Vec3::new(1.0, 0.0, -1e-20))));
        assert!(!accepts(Ray::new(Vec3::ZERO, Vec3::new(1.0, 0.0, 1e-30))));
        assert!(!accepts(Ray::new(Vec3::ZERO, Vec3::splat(1e-20))));
        assert!(!accepts(Ray::new(Vec3::splat(1e20), Vec3::X)));
        assert!(!accepts(Ray::new(Vec3::splat(f32::NAN), Vec3::X)));
        assert!(!accepts(Ray::new(Vec3::ZERO, Vec3::new(f32::NAN, 1.0, 0.0))));
        assert!(!accepts(Ray { t_min: -1.0, ..Ray::new(Vec3::ZERO, Vec3::X) }));
        assert!(!accepts(Ray { t_max: f32::NAN, ..Ray::new(Vec3::ZERO, Vec3::X) }));
    }
}
