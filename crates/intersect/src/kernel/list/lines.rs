//! Sixteen rays as lines.

use super::List;
use super::contents::EdgeLine;
use crate::kernel::quick::drawing;
use crate::kernel::triangle::ExactRay;
use snell_math::simd::Lanes8;
use snell_math::{DVec3, Ray};

/// Rays that are tested together.
pub(super) const RAYS: usize = 16;

/// One number per ray.
type PerRay<T> = [T; RAYS];

/// Bound of the error of a signed volume, relative to the distance of the farthest vertex from the start of the ray, the size of the
/// triangle and the size of the direction. With `u = 2^-24`: 66 u for coordinates rounded once each, products and sums here; 108 u for
/// the drawing of the exact test, which is off by 6 u of that distance at each vertex of a triangle that it finds to be hit.
const VOLUME_ERROR: f32 = 256.0 / 16_777_216.0;

/// Rays that start farther away, relative to the reach of the list, are left to the tree.
const FARTHEST: f32 = 64.0;

/// Sizes of directions of ordinary rays.
const SMALLEST: f32 = 1e-12;
const LARGEST: f32 = 1e12;

/// Some rays.
pub(super) struct Lines {
    direction_lanes: [PerRay<f32>; 3],
    /// The product of origin, as seen from the centre of the list, and direction.
    moment: [PerRay<f32>; 3],
    /// How large a signed volume must be for its sign to be certain; minus infinity for lanes without an ordinary ray.
    error: PerRay<f32>,
    pub origin: PerRay<DVec3>,
    pub direction: PerRay<DVec3>,
    pub t_min: PerRay<f64>,
    /// The largest component of the direction.
    pub size: PerRay<f64>,
    /// No vertex is farther, in units of the ray.
    pub reach: PerRay<f64>,
}

impl Lines {
    pub const NONE: Self = Self {
        direction_lanes: [[0.0; RAYS]; 3],
        moment: [[0.0; RAYS]; 3],
        error: [f32::NEG_INFINITY; RAYS],
        origin: [DVec3::ZERO; RAYS],
        direction: [DVec3::ZERO; RAYS],
        t_min: [0.0; RAYS],
        size: [0.0; RAYS],
        reach: [0.0; RAYS],
    };

    /// Takes in up to sixteen rays, and says which of them are ordinary.
    #[inline(always)]
    pub fn set_up(&mut self, list: &List, rays: &[Ray]) -> u32 {
        let mut ordinary = 0;
        self.error = [f32::NEG_INFINITY; RAYS];
        for (i, ray) in rays.iter().enumerate().take(RAYS) {
            let (o, d) = (ray.origin - list.center, ray.direction);
            let (far, size) = (o.abs().max_element(), d.abs().max_element());
            let distance = list.reach + far;
            // NaN is never within.
            let is_ordinary = (ray.t_min < ray.t_max)
                & (far <= list.reach * FARTHEST)
                & (size >= SMALLEST)
                & (size <= LARGEST)
                & d.is_finite();
            ordinary |= u32::from(is_ordinary) << i;
            let m = o.cross(d);
            for axis in 0..3 {
                self.direction_lanes[axis][i] = d[axis];
                self.moment[axis][i] = m[axis];
            }
            self.error[i] = if is_ordinary { distance * size * VOLUME_ERROR } else { f32::NEG_INFINITY };
            self.origin[i] = ray.origin.as_dvec3();
            self.direction[i] = d.as_dvec3();
            self.t_min[i] = ray.t_min.into();
            self.size[i] = size.into();
            self.reach[i] = f64::from(distance) / f64::from(size);
        }
        ordinary
    }

    /// For each triangle which lines may pass through it, a bit per ray.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn passing<L: Lanes8>(&self, triangles: &[[EdgeLine; 3]], passing: &mut [u16]) {
        for (edges, passing) in triangles.iter().zip(passing) {
            // SAFETY: passed on to the caller.
            unsafe {
                let (low, high) = (self.half::<L>(edges, 0), self.half::<L>(edges, 1));
                *passing = (low | high << 8) as u16;
            }
        }
    }

    /// [`Self::passing`] for one triangle and half of the rays.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; `half` must be 0 or 1.
    #[inline(always)]
    unsafe fn half<L: Lanes8>(&self, edges: &[EdgeLine; 3], half: usize) -> u32 {
        // SAFETY: passed on to the caller.
        unsafe {
            let u = self.volume::<L>(&edges[0], half);
            let v = self.volume::<L>(&edges[1], half);
            let w = self.volume::<L>(&edges[2], half);
            // How far all of them are on one side, on the better side.
            let inside = u.min(v).min(w).max(L::splat(0.0).sub(u.max(v).max(w)));
            !inside.add(lanes(&self.error, half)).signs() & 0xff
        }
    }

    /// The signed volume of an edge and half of the rays.
    ///
    /// # Safety
    /// As [`Self::half`].
    #[inline(always)]
    unsafe fn volume<L: Lanes8>(&self, edge: &EdgeLine, half: usize) -> L {
        // SAFETY: passed on to the caller.
        unsafe {
            let (d, m) = (&self.direction_lanes, &self.moment);
            let volume = L::splat(edge.moment[0]).mul(lanes(&d[0], half));
            let volume = L::splat(edge.moment[1]).mul_add(lanes(&d[1], half), volume);
            let volume = L::splat(edge.moment[2]).mul_add(lanes(&d[2], half), volume);
            let volume = L::splat(edge.direction[0]).mul_add(lanes(&m[0], half), volume);
            let volume = L::splat(edge.direction[1]).mul_add(lanes(&m[1], half), volume);
            L::splat(edge.direction[2]).mul_add(lanes(&m[2], half), volume)
        }
    }

    /// What the exact test wants to know of a ray.
    #[inline(always)]
    pub fn exact(&self, lane: usize, ray: &Ray) -> ExactRay {
        let lane = lane % RAYS;
        ExactRay { origin: self.origin[lane], direction: self.direction[lane], drawing: drawing(ray) }
    }
}

/// One half of the rays.
///
/// # Safety
/// The machine must have the instructions of `L`; `half` must be 0 or 1.
#[inline(always)]
unsafe fn lanes<L: Lanes8>(values: &PerRay<f32>, half: usize) -> L {
    // SAFETY: passed on to the caller.
    unsafe { L::load(&*values.as_ptr().add(8 * half).cast::<[f32; 8]>()) }
}
