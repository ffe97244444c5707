//! Bundles from runs of rays as they come.

use super::super::node::padded;
use super::MIN_RAYS;
use super::bundle::{Bundle, Columns, Kind, PerRay, RAYS, store};
use crate::kernel::double::DoubleData;
use crate::precision::{Double, Real, Single};
use snell_math::simd::{Lanes16, WideLanes};
use snell_math::{DRay, Ray};

/// Makes a bundle of a run; false if it is none. Lanes without a ray repeat the first one and want nothing.
///
/// # Safety
/// The machine must have the instructions of `W`.
#[inline(always)]
pub(crate) unsafe fn set_up<W: Lanes16>(
    bundle: &mut Bundle,
    columns: &mut Columns,
    rays: &[Ray],
    backward: bool,
) -> bool {
    if rays.len() < MIN_RAYS {
        return false;
    }
    let first = &rays[0];
    let all: [&Ray; RAYS] = if let Some(all) = rays.first_chunk::<RAYS>() {
        all.each_ref()
    } else {
        std::array::from_fn(|i| rays.get(i).unwrap_or(first))
    };
    let mut t_max = [0.0; RAYS];
    // SAFETY: as promised by the caller; halves are 0 and 1.
    let (is_fine, ends) = unsafe { load_columns::<W::Half>(&all, columns, &mut bundle.drawn_origin, &mut t_max) };
    if !is_fine {
        return false;
    }
    let bits = |ray: &Ray| ray.origin.to_array().map(f32::to_bits);
    let common = all.iter().all(|ray| bits(ray) == bits(first));
    let reversed = !common && ends;
    // A little beyond the ends, so that all rays end before it.
    let end = first.origin + first.direction * (first.t_max * (1.0 + 1.0 / 1024.0));
    let apex = if reversed { end } else { first.origin }.to_array();
    bundle.kind = Kind { apex, reversed, common, backward: reversed && backward, rounded: false, slack: 0.0 };
    for (i, ray) in all.iter().enumerate() {
        let (o, d) = (ray.origin, ray.direction);
        bundle.rays.origin[i] = [o.x.into(), o.y.into(), o.z.into(), ray.t_min.into()];
        bundle.rays.direction[i] = [d.x.into(), d.y.into(), d.z.into(), ray.t_max.into()];
        columns.cull[i] = padded(t_max[i]);
    }
    columns.cull[rays.len()..].fill(-1.0);
    if !common {
        let first = first.origin.to_array();
        for axis in 0..3 {
            for (i, &origin) in bundle.drawn_origin[axis].iter().enumerate() {
                columns.from_apex[axis][i] = origin - apex[axis];
                columns.from_first[axis][i] = origin - first[axis];
            }
        }
    }
    // SAFETY: as promised by the caller.
    unsafe { bundle.set_up::<W, Single>(columns) }
}

/// [`set_up`] in double precision.
///
/// # Safety
/// The machine must have the instructions of `W`.
#[inline(always)]
pub(crate) unsafe fn set_up_doubles<W: Lanes16>(
    data: &DoubleData,
    bundle: &mut Bundle,
    columns: &mut Columns,
    rays: &[DRay],
    backward: bool,
) -> bool {
    if rays.len() < MIN_RAYS {
        return false;
    }
    let first = &rays[0];
    let (mut is_fine, mut ends, mut common) = (true, true, true);
    for i in 0..RAYS {
        let ray = rays.get(i).unwrap_or(first);
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        is_fine &= (ray.t_min >= 0.0) & (ray.t_min < ray.t_max);
        ends &= ray.t_max < f64::INFINITY;
        common &= ray.origin == first.origin;
        bundle.rays.origin[i] = [o[0], o[1], o[2], ray.t_min];
        bundle.rays.direction[i] = [d[0], d[1], d[2], ray.t_max];
        columns.t_min[i] = ray.t_min.below();
        columns.cull[i] = padded(ray.t_max.above());
    }
    columns.cull[rays.len()..].fill(-1.0);
    let reversed = !common && ends;
    // A little beyond the ends, so that all rays end before it.
    let end = first.origin + first.direction * (first.t_max * (1.0 + 1.0 / 1024.0));
    let apex = if reversed { end } else { first.origin };
    let kind = Kind { apex: [0.0; 3], reversed, common, backward: reversed && backward, rounded: true, slack: 0.0 };
    // SAFETY: as promised by the caller.
    is_fine && unsafe { bundle.set_up_exactly::<W, Double>(columns, data, 0, apex, &kind) }
}

/// Transposes rays. Whether all are finite, with intervals that begin at zero or later and are not empty; and whether all end.
///
/// # Safety
/// The machine must have the instructions of `L`.
#[inline(always)]
unsafe fn load_columns<L: WideLanes>(
    rays: &[&Ray; RAYS],
    columns: &mut Columns,
    origin: &mut [PerRay<f32>; 3],
    t_max: &mut PerRay<f32>,
) -> (bool, bool) {
    let (mut fine, mut ends) = (0xff, 0xff);
    for half in 0..2 {
        // SAFETY: as promised by the caller; a ray is eight numbers in this order: origin, t_min, direction, t_max.
        unsafe {
            // (Nothing here by `map` or `from_fn`: what is not compiled into this function has not its instructions.)
            let row = |i: usize| &*(&raw const *rays[8 * half + i]).cast::<[f32; 8]>();
            let rows = [row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7)];
            let [ox, oy, oz, from, dx, dy, dz, to] = L::load_columns(rows);
            let zero = L::splat(0.0);
            // Zero if everything is finite.
            let mut sum = from.mul(zero);
            for column in [ox, oy, oz, dx, dy, dz] {
                sum = sum.add(column.mul(zero));
            }
            fine &= sum.le(zero) & zero.le(from) & from.lt(to);
            ends &= to.lt(L::splat(f32::INFINITY));
            for (column, to) in [ox, oy, oz].into_iter().zip(origin.iter_mut()) {
                store(column, to, half);
            }
            for (column, to) in [dx, dy, dz].into_iter().zip(columns.direction.iter_mut()) {
                store(column, to, half);
            }
            store(from, &mut columns.t_min, half);
            store(to, t_max, half);
        }
    }
    (fine == 0xff, ends == 0xff)
}

const _: () = assert!(
    std::mem::offset_of!(Ray, t_min) == 12
        && std::mem::offset_of!(Ray, direction) == 16
        && std::mem::offset_of!(Ray, t_max) == 28
);
