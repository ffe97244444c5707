//! Sixteen rays as lines.

use super::List;
use super::contents::{EdgeLines, Row, row};
use crate::kernel::quick::drawing;
use crate::kernel::triangle::ExactRay;
use snell_math::simd::Lanes8;
use snell_math::{DVec3, Ray};

/// Rays that are tested together.
pub(super) const RAYS: usize = 16;

/// One number per ray.
pub(super) type PerRay<T> = [T; RAYS];

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
#[repr(C, align(64))]
pub(super) struct Lines {
    /// Direction, and the product of origin, as seen from the centre of the list, and direction.
    plucker: [PerRay<f32>; 6],
    /// How large a signed volume must be for its sign to be certain; minus infinity for lanes without an ordinary ray.
    error: PerRay<f32>,
    /// The largest component of the direction.
    pub size: PerRay<f32>,
    /// No vertex is farther, in units of the ray.
    pub reach: PerRay<f32>,
    pub t_min: PerRay<f32>,
    pub t_max: PerRay<f32>,
    pub origin: PerRay<Row>,
    pub direction: PerRay<Row>,
    /// The first axis that each ray draws on.
    pub axis: PerRay<u32>,
}

impl Lines {
    pub const NONE: Self = Self {
        plucker: [[0.0; RAYS]; 6],
        error: [f32::NEG_INFINITY; RAYS],
        size: [0.0; RAYS],
        reach: [0.0; RAYS],
        t_min: [0.0; RAYS],
        t_max: [0.0; RAYS],
        origin: [[0.0; 6]; RAYS],
        direction: [[0.0; 6]; RAYS],
        axis: [0; RAYS],
    };

    /// Takes in up to sixteen rays, and says which of them are ordinary.
    #[inline(always)]
    pub fn set_up(&mut self, list: &List, rays: &[Ray]) -> u32 {
        let mut columns = [[0.0; RAYS]; 8];
        for (i, ray) in rays.iter().enumerate().take(RAYS) {
            let (o, d) = (ray.origin, ray.direction);
            for (column, x) in columns.iter_mut().zip([o.x, o.y, o.z, ray.t_min, d.x, d.y, d.z, ray.t_max]) {
                column[i] = x;
            }
            (self.origin[i], self.direction[i]) = (row(o.as_dvec3()), row(d.as_dvec3()));
        }
        let [x, y, z, t_min, dx, dy, dz, t_max] = columns;
        let mut ordinary = 0;
        for i in 0..RAYS {
            let (x, y, z) = (x[i] - list.center.x, y[i] - list.center.y, z[i] - list.center.z);
            let (dx, dy, dz) = (dx[i], dy[i], dz[i]);
            let moment = [y * dz - z * dy, z * dx - x * dz, x * dy - y * dx];
            for (to, from) in self.plucker.iter_mut().zip([dx, dy, dz].into_iter().chain(moment)) {
                to[i] = from;
            }
            // As in `LocalRay`.
            let (ax, ay, az) = (dx.abs(), dy.abs(), dz.abs());
            let is_x = (ax >= ay) & (ax >= az);
            self.axis[i] = if is_x { 1 } else { 2 * u32::from(ay >= az) };
            let far = largest(largest(x.abs(), y.abs()), z.abs());
            let size = largest(largest(ax, ay), az);
            // Zero as long as all are numbers.
            let not_finite = (dx + dy + dz) * 0.0;
            // NaN is never within. Lanes without a ray have an empty interval.
            let is_ordinary = (t_min[i] < t_max[i])
                & (far <= list.reach * FARTHEST)
                & (SMALLEST..=LARGEST).contains(&size)
                & (not_finite == 0.0);
            let distance = list.reach + far;
            self.error[i] = if is_ordinary { distance * size * VOLUME_ERROR } else { f32::NEG_INFINITY };
            self.size[i] = size;
            self.reach[i] = distance / size;
            ordinary |= u32::from(is_ordinary) << i;
        }
        (self.t_min, self.t_max) = (t_min, t_max);
        ordinary
    }

    #[inline(always)]
    pub fn origin(&self, lane: usize) -> DVec3 {
        let [x, y, z, ..] = self.origin[lane % RAYS];
        DVec3::new(x, y, z)
    }

    #[inline(always)]
    pub fn direction(&self, lane: usize) -> DVec3 {
        let [x, y, z, ..] = self.direction[lane % RAYS];
        DVec3::new(x, y, z)
    }

    /// For each triangle which lines may pass through it, a bit per ray.
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    #[inline(always)]
    pub unsafe fn passing<L: Lanes8>(&self, triangles: &[EdgeLines], passing: &mut [u16]) {
        for (edges, passing) in triangles.iter().zip(passing) {
            // SAFETY: passed on to the caller.
            unsafe {
                // By half of the rays and edge: the signed volumes. What is loaded is used at once, so that all of them stay in registers.
                let mut volumes = [[L::splat(0.0); 3]; 2];
                for (of_edges, of_rays) in edges.iter().zip(&self.plucker) {
                    let (low, high) = (lanes::<L>(of_rays, 0), lanes::<L>(of_rays, 1));
                    for (i, &of_edge) in of_edges.iter().enumerate() {
                        let of_edge = L::splat(of_edge);
                        volumes[0][i] = of_edge.mul_add(low, volumes[0][i]);
                        volumes[1][i] = of_edge.mul_add(high, volumes[1][i]);
                    }
                }
                let low = may_pass(volumes[0], lanes(&self.error, 0));
                let high = may_pass(volumes[1], lanes(&self.error, 1));
                *passing = (low | high << 8) as u16;
            }
        }
    }

    /// What the exact test wants to know of a ray.
    #[inline(always)]
    pub fn exact(&self, lane: usize, ray: &Ray) -> ExactRay {
        ExactRay { origin: self.origin(lane), direction: self.direction(lane), drawing: drawing(ray) }
    }
}

/// The greater one; `b` if `a` is not a number.
#[inline(always)]
fn largest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Where the volumes of three edges are not surely on both sides of zero.
#[inline(always)]
fn may_pass<L: Lanes8>([u, v, w]: [L; 3], error: L) -> u32 {
    // How far all of them are on one side, on the better side.
    let inside = u.min(v).min(w).add(error).max(error.sub(u.max(v).max(w)));
    !inside.signs() & 0xff
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
