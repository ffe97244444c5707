//! The exact rays of a packet: row by row, and in lanes of `f64`.

use super::frustum::{PerRay, RAYS};
use crate::exact::plane_hit::dot;
use crate::kernel::packet::PacketTests;
use snell_math::simd::{Doubles16, Lanes16};
use snell_math::{DAffine3, DRay, DVec3, Vec3};

/// Origins and directions of rays in `f64`, by axis.
pub(super) type ExactColumns = [[PerRay<f64>; 3]; 2];

/// The rays of a packet in the coordinates of a group, a row per ray.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct ExactRays {
    /// The origins, with `t_min` as the fourth component.
    pub origin: PerRay<[f64; 4]>,
    pub direction: PerRay<[f64; 4]>,
}

impl ExactRays {
    /// Copies the rays of a run; lanes without a ray repeat the first ray.
    #[inline(always)]
    pub fn write<P: PacketTests>(&mut self, rays: &[P::Ray]) {
        for lane in 0..RAYS {
            let ray = P::exact(rays.get(lane).unwrap_or(&rays[0]));
            let (o, d) = (ray.origin, ray.direction);
            self.origin[lane] = [o.x, o.y, o.z, ray.t_min];
            self.direction[lane] = [d.x, d.y, d.z, ray.t_max];
        }
    }

    /// Performs [`Self::write`] with other origins and directions, given by axis.
    #[inline(always)]
    pub fn write_columns<P: PacketTests>(
        &mut self,
        rays: &[P::Ray],
        [[ox, oy, oz], [dx, dy, dz]]: &ExactColumns,
    ) {
        for lane in 0..RAYS {
            let [t_min, t_max] = P::interval(rays.get(lane).unwrap_or(&rays[0]));
            self.origin[lane] = [ox[lane], oy[lane], oz[lane], t_min.into()];
            self.direction[lane] = [dx[lane], dy[lane], dz[lane], t_max.into()];
        }
    }

    /// The ray in this lane; its interval is not used.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> DRay {
        let (o, d) = (&self.origin[lane], &self.direction[lane]);
        DRay::new(DVec3::new(o[0], o[1], o[2]), DVec3::new(d[0], d[1], d[2]))
    }
}

/// Sixteen rays in `f64`, by axis.
#[derive(Clone, Copy)]
pub(crate) struct LaneRays<W: Lanes16> {
    pub origin: [W::Doubles; 3],
    pub direction: [W::Doubles; 3],
}

impl<W: Lanes16> LaneRays<W> {
    #[inline(always)]
    pub fn load(token: W::Token, [[ox, oy, oz], [dx, dy, dz]]: &ExactColumns) -> Self {
        Self {
            origin: [
                W::Doubles::load(token, ox),
                W::Doubles::load(token, oy),
                W::Doubles::load(token, oz),
            ],
            direction: [
                W::Doubles::load(token, dx),
                W::Doubles::load(token, dy),
                W::Doubles::load(token, dz),
            ],
        }
    }

    /// Stores origins and directions by axis.
    #[inline(always)]
    pub(super) fn store(&self, to: &mut ExactColumns) {
        for (from, to) in [self.origin, self.direction].iter().zip(to) {
            from[0].store(&mut to[0]);
            from[1].store(&mut to[1]);
            from[2].store(&mut to[2]);
        }
    }

    /// The origins relative to a point, rounded to nearest.
    #[inline(always)]
    pub(super) fn seen_from(&self, token: W::Token, point: Vec3) -> [W; 3] {
        let ([ox, oy, oz], point) = (self.origin, point.as_dvec3());
        rounded3([
            ox.sub(W::Doubles::splat(token, point.x)),
            oy.sub(W::Doubles::splat(token, point.y)),
            oz.sub(W::Doubles::splat(token, point.z)),
        ])
    }

    /// The rays mapped like [`crate::precision::frame::Frame::ray`], by the same operations and so
    /// with the same bits.
    #[inline(always)]
    pub fn framed(&self, token: W::Token, center: &DVec3, scale: f64) -> Self {
        let mut image = *self;
        let scale = W::Doubles::splat(token, scale);
        for axis in 0..3 {
            image.origin[axis] =
                self.origin[axis].sub(W::Doubles::splat(token, center[axis])).mul(scale);
            image.direction[axis] = self.direction[axis].mul(scale);
        }
        image
    }

    /// The rays mapped like [`crate::group::mapped`], by the same operations and so with the same
    /// bits.
    #[inline(always)]
    pub fn mapped(&self, token: W::Token, map: &DAffine3) -> Self {
        let DAffine3 { matrix3, translation } = map;
        let [x, y, z] =
            [matrix3.x_axis.to_array(), matrix3.y_axis.to_array(), matrix3.z_axis.to_array()];
        let (translation, mut image) = (translation.to_array(), *self);
        for axis in 0..3 {
            let [x, y, z] = [
                W::Doubles::splat(token, x[axis]),
                W::Doubles::splat(token, y[axis]),
                W::Doubles::splat(token, z[axis]),
            ];
            image.origin[axis] =
                dot([x, y, z], self.origin).add(W::Doubles::splat(token, translation[axis]));
            image.direction[axis] = dot([x, y, z], self.direction);
        }
        image
    }
}

/// The vectors rounded to nearest.
#[inline(always)]
pub(super) fn rounded3<W: Lanes16>([x, y, z]: [W::Doubles; 3]) -> [W; 3] {
    [x.rounded(), y.rounded(), z.rounded()]
}
