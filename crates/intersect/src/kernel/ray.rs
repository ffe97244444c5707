//! A ray in the coordinates of one group, with all that the box and triangle tests want to know about it.

use snell_math::{DRay, DVec3, Vec3};

/// A ray in the coordinates of a group. The `f64` ray decides distances; what follows from it in `f32` decides which triangles
/// cover it (`origin`, `shear`: the drawing) and which boxes can be skipped (`near_origin` and on: conservatively).
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalRay {
    /// The ray as it came through the inverse transforms. Its interval is not used.
    pub exact: DRay,
    /// The origin rounded to nearest: all vertices are drawn relative to it.
    pub origin: [f32; 3],
    /// Axes x, y, z of the drawing: z is where the direction is largest (Woop, Benthin and Wald 2013).
    pub axes: [usize; 3],
    /// Drawn x = x - shear[0] z, y = y - shear[1] z.
    pub shear: [f32; 2],
    /// Distance along the ray per unit of the z axis; 0 if it has no useful value in `f32`, then depths are not compared.
    pub depth_scale: f32,
    /// Origin per axis, rounded so that near planes come nearer.
    pub near_origin: [f32; 3],
    /// Origin per axis, rounded so that far planes go farther.
    pub far_origin: [f32; 3],
    /// Inverse direction; not zero, infinite where the ray does not move along the axis.
    pub inverse: [f32; 3],
    /// 1 for each axis on which the ray goes down: then the near plane of a box is its maximum.
    pub negative: [usize; 3],
}

impl LocalRay {
    #[inline(always)]
    pub fn new(exact: &DRay) -> Self {
        let (o, d) = (exact.origin.to_array(), exact.direction.to_array());
        let a = exact.direction.abs();
        let z = if a.x >= a.y && a.x >= a.z {
            0
        } else if a.y >= a.z {
            1
        } else {
            2
        };
        let axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][z];
        let per_z = 1.0 / d[z];
        let depth_scale = per_z as f32;
        let usable = depth_scale.abs() > 1e-18 && depth_scale.abs() < 1e18;
        let mut ray = Self {
            exact: *exact,
            origin: o.map(|x| x as f32),
            axes,
            shear: [(d[axes[0]] * per_z) as f32, (d[axes[1]] * per_z) as f32],
            depth_scale: if usable { depth_scale } else { 0.0 },
            near_origin: [0.0; 3],
            far_origin: [0.0; 3],
            inverse: [0.0; 3],
            negative: [0; 3],
        };
        for i in 0..3 {
            let x = ray.origin[i];
            let below = if f64::from(x) > o[i] { x.next_down() } else { x };
            let above = if f64::from(x) < o[i] { x.next_up() } else { x };
            let down = d[i] < 0.0;
            ray.negative[i] = usize::from(down);
            (ray.near_origin[i], ray.far_origin[i]) = if down { (below, above) } else { (above, below) };
            // Never zero, so that empty boxes stay infinitely far.
            let size = ((1.0 / d[i].abs()) as f32).max(f32::from_bits(1));
            ray.inverse[i] = if down { -size } else { size };
            if size == f32::INFINITY && d[i] != 0.0 {
                // So slow along this axis that `f32` cannot say when it crosses a plane: no plane counts.
                (ray.near_origin[i], ray.far_origin[i]) =
                    if down { (f32::MIN, f32::MAX) } else { (f32::MAX, f32::MIN) };
            }
        }
        ray
    }

    /// The vertex as drawn on the plane across the ray. A vertex has the same bits in every triangle and at every SIMD level:
    /// rounded subtraction, product, subtraction, never fused.
    #[inline(always)]
    pub fn draw(&self, v: &[f32; 3]) -> [f32; 2] {
        let [kx, ky, kz] = self.axes;
        let (x, y, z) = (v[kx] - self.origin[kx], v[ky] - self.origin[ky], v[kz] - self.origin[kz]);
        [x - self.shear[0] * z, y - self.shear[1] * z]
    }
}

/// A vertex in double precision.
#[inline(always)]
pub(crate) fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from_array(v).as_dvec3()
}
