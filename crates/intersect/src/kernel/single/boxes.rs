//! The test of the eight boxes of a node.

use crate::exact::prepared::{BOX_PADDING, FAR_FACTOR, Planes, PreparedRay};
use crate::exact::ray::LocalRay;
use crate::tree::node::WideNode;
use snell_math::simd::Lanes8;
use snell_math::{Vec3, Vec4};

impl Planes {
    /// The planes in a node, one for each of its eight boxes.
    #[inline(always)]
    pub fn of(self, node: &WideNode) -> &[f32; 8] {
        let bounds = node.bounds.as_ptr().cast::<f32>();
        // SAFETY: the first index is 0, 8, and so on to 40, of 48 numbers.
        unsafe { &*bounds.add(self.first()).cast() }
    }
}

/// The entry distances of the eight boxes, and the values that they must not exceed for the box to
/// be hit between `t_min` and `cull` (from [`padded`]).
#[inline(always)]
pub(crate) fn box_distances<L: Lanes8>(
    token: L::Token,
    node: &WideNode,
    ray: &LocalRay,
    t_min: f32,
    cull: f32,
) -> (L, L) {
    let near = [
        near::<L>(token, node, ray, 0),
        near::<L>(token, node, ray, 1),
        near::<L>(token, node, ray, 2),
    ];
    let far = [
        far::<L>(token, node, ray, 0),
        far::<L>(token, node, ray, 1),
        far::<L>(token, node, ray, 2),
    ];
    // A plane in which a parallel ray lies gives NaN (0 times infinity), and a NaN as the left
    // operand is ignored.
    let enter = near[0].max(near[1].max(near[2].max(L::splat(token, t_min))));
    let leave = far[0].min(far[1].min(far[2].min(L::splat(token, f32::INFINITY))));
    // Away from zero if positive, towards zero if negative: always farther along the ray.
    let leave = leave
        .mul(L::splat(token, 1.0 + BOX_PADDING))
        .max(leave.mul(L::splat(token, 1.0 - BOX_PADDING)));
    (enter, leave.min(L::splat(token, cull)))
}

/// Distances of the near planes of an axis.
#[inline(always)]
fn near<L: Lanes8>(token: L::Token, node: &WideNode, ray: &LocalRay, axis: usize) -> L {
    let plane = L::load(token, &node.bounds[ray.negative[axis] & 1][axis]);
    plane.sub(L::splat(token, ray.near_origin[axis])).mul(L::splat(token, ray.inverse[axis]))
}

/// Distances of the far planes of an axis.
#[inline(always)]
fn far<L: Lanes8>(token: L::Token, node: &WideNode, ray: &LocalRay, axis: usize) -> L {
    let plane = L::load(token, &node.bounds[(ray.negative[axis] & 1) ^ 1][axis]);
    plane.sub(L::splat(token, ray.far_origin[axis])).mul(L::splat(token, ray.inverse[axis]))
}

/// Performs [`box_distances`] for an ordinary ray, whose far planes are padded by the factor
/// [`FAR_FACTOR`].
#[inline(always)]
pub(crate) fn prepared_distances<L: Lanes8>(
    token: L::Token,
    node: &WideNode,
    ray: &PreparedRay,
    t_min: f32,
    cull: f32,
) -> (L, L) {
    let near = [
        prepared::<L>(token, node, ray, &ray.near, 0, 0),
        prepared(token, node, ray, &ray.near, 1, 0),
        prepared(token, node, ray, &ray.near, 2, 0),
    ];
    let far = [
        prepared::<L>(token, node, ray, &ray.far, 0, 3),
        prepared(token, node, ray, &ray.far, 1, 3),
        prepared(token, node, ray, &ray.far, 2, 3),
    ];
    let enter = near[0].max(near[1]).max(near[2].max(L::splat(token, t_min)));
    let leave = far[0].min(far[1]).min(far[2]).mul(L::splat(token, FAR_FACTOR));
    (enter, leave.min(L::splat(token, cull)))
}

/// Distances of the near (`side` 0) or far (3) planes of an axis, for an ordinary ray.
#[inline(always)]
fn prepared<L: Lanes8>(
    token: L::Token,
    node: &WideNode,
    ray: &PreparedRay,
    offsets: &[f32; 3],
    axis: usize,
    side: usize,
) -> L {
    let (inverse, offset) = (L::splat(token, ray.inverse[axis]), L::splat(token, offsets[axis]));
    crossing(ray.planes()[axis + side].of(node), inverse, offset)
}

/// The data for [`prepared_distances`] of one ray in registers, for many nodes in turn.
pub(crate) struct PreparedBoxes<L> {
    inverse: [L; 3],
    near: [L; 3],
    far: [L; 3],
    planes: [Planes; 6],
}

/// Used instead of [`FAR_FACTOR`]: far planes are moved away by this, relative to the largest
/// distance at which the ray crosses any plane. It is a little larger, to cover the rounding of
/// that distance.
const FAR_PADDING: f32 = 1.1e-6;

/// The largest padding of far planes. (Without a limit it would be infinite on an axis along which
/// the ray does not move, and empty boxes would count as hit.)
const MAX_FAR_PADDING: f32 = 4e30;

impl<L: Lanes8> PreparedBoxes<L> {
    /// Prepares a ray; `extent` is the largest coordinate of the boxes.
    #[inline(always)]
    pub fn new(token: L::Token, ray: &PreparedRay, extent: f32) -> Self {
        let (inverse, far) =
            (Vec3::from_array(ray.inverse).extend(1.0), Vec3::from_array(ray.far).extend(1.0));
        let far = if L::FUSED {
            far + ((inverse.abs() * extent + far.abs()) * FAR_PADDING)
                .min(Vec4::splat(MAX_FAR_PADDING))
        } else {
            far - ((far.abs() + extent) * FAR_PADDING).copysign(inverse)
        };
        let ([x, y, z], near, far, planes) = (ray.inverse, &ray.near, far.to_array(), ray.planes());
        // No closures, because closures over lanes are not always inlined.
        Self {
            inverse: [L::splat(token, x), L::splat(token, y), L::splat(token, z)],
            near: [L::splat(token, near[0]), L::splat(token, near[1]), L::splat(token, near[2])],
            far: [L::splat(token, far[0]), L::splat(token, far[1]), L::splat(token, far[2])],
            planes: [planes[0], planes[1], planes[2], planes[3], planes[4], planes[5]],
        }
    }

    /// The result of [`prepared_distances`].
    #[inline(always)]
    pub fn distances(&self, node: &WideNode, t_min: L, cull: L) -> (L, L) {
        let near = [self.near(node, 0), self.near(node, 1), self.near(node, 2)];
        let far = [self.far(node, 0), self.far(node, 1), self.far(node, 2)];
        (near[0].max(near[1]).max(near[2].max(t_min)), far[0].min(far[1]).min(far[2].min(cull)))
    }

    #[inline(always)]
    fn near(&self, node: &WideNode, axis: usize) -> L {
        crossing(self.planes[axis].of(node), self.inverse[axis], self.near[axis])
    }

    #[inline(always)]
    fn far(&self, node: &WideNode, axis: usize) -> L {
        crossing(self.planes[axis + 3].of(node), self.inverse[axis], self.far[axis])
    }
}

/// Distances of planes along an ordinary ray.
#[inline(always)]
fn crossing<L: Lanes8>(planes: &[f32; 8], inverse: L, offset: L) -> L {
    let plane = L::load(inverse.token(), planes);
    if L::FUSED { plane.mul_add(inverse, offset) } else { plane.sub(offset).mul(inverse) }
}
