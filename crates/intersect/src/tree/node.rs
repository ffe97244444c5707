//! The 8-wide node and its box test.

use crate::exact::quick::{BOX_PADDING, FAR_FACTOR, Planes, QuickRay};
use crate::exact::ray::LocalRay;
use snell_math::simd::Lanes8;
use snell_math::{Bounds3, Vec3, Vec4};

/// What a node's slot leads to, in 32 bits: an inner node, up to eight triangles, or an object
/// (shape or instance).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct ChildRef(pub u32);

impl ChildRef {
    const TRIANGLES: u32 = 1 << 30;
    const OBJECT: u32 = 2 << 30;
    const BLOCK_BITS: u32 = 27;
    /// How many blocks of triangles a group may have.
    pub const MAX_BLOCKS: usize = 1 << Self::BLOCK_BITS;
    /// How many inner nodes, and how many objects, a group may have.
    pub const MAX_NODES: usize = 1 << 30;
    /// Fills unused slots; their boxes are empty.
    pub const NONE: Self = Self(u32::MAX);
    /// On the stack of a walk: here it returns from an instance. Not in trees.
    pub const RETURN: Self = Self(u32::MAX - 1);

    pub fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// `count` from 1 to 8.
    pub fn triangles(block: usize, count: usize) -> Self {
        Self(Self::TRIANGLES | ((count as u32 - 1) << Self::BLOCK_BITS) | block as u32)
    }

    pub fn object(index: usize) -> Self {
        Self(Self::OBJECT | index as u32)
    }

    #[inline(always)]
    pub fn is_node(self) -> bool {
        self.0 < Self::TRIANGLES
    }

    #[inline(always)]
    pub fn is_triangles(self) -> bool {
        self.0 & (3 << 30) == Self::TRIANGLES
    }

    #[inline(always)]
    pub fn is_object(self) -> bool {
        self.0 & (3 << 30) == Self::OBJECT
    }

    /// Number of the node, of what is known to be one.
    #[inline(always)]
    pub fn node_index(self) -> usize {
        self.0 as usize
    }

    /// Number of the node or object.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & ((1 << 30) - 1)) as usize
    }

    /// Number of the block of triangles.
    #[inline(always)]
    pub fn block(self) -> usize {
        (self.0 & ((1 << Self::BLOCK_BITS) - 1)) as usize
    }

    /// How many triangles the block holds.
    #[inline(always)]
    pub fn count(self) -> u32 {
        ((self.0 >> Self::BLOCK_BITS) & 7) + 1
    }
}

/// Eight boxes and where they lead.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    /// By side (minimum, maximum), axis, slot.
    pub bounds: [[[f32; 8]; 3]; 2],
    pub children: [ChildRef; 8],
    /// For each octant of directions (bit i set: down along axis i) the slots from far to near:
    /// eight numbers of 3 bits.
    pub order: [u32; 8],
}

impl WideNode {
    pub const EMPTY: Self = Self {
        bounds: [[[f32::INFINITY; 8]; 3], [[f32::NEG_INFINITY; 8]; 3]],
        children: [ChildRef::NONE; 8],
        order: [0o76543210; 8],
    };

    pub fn set(&mut self, slot: usize, bounds: &Bounds3, child: ChildRef) {
        for axis in 0..3 {
            self.bounds[0][axis][slot] = bounds.min[axis];
            self.bounds[1][axis][slot] = bounds.max[axis];
        }
        self.children[slot] = child;
    }

    /// The box of a slot; empty if it is not used.
    pub fn slot_bounds(&self, slot: usize) -> Bounds3 {
        let side = |side: usize| Vec3::from_array(self.bounds[side].map(|axis| axis[slot & 7]));
        Bounds3 { min: side(0), max: side(1) }
    }

    /// The box of all slots.
    pub fn bounds(&self) -> Bounds3 {
        (0..8).map(|slot| self.slot_bounds(slot)).fold(Bounds3::EMPTY, |all, own| all.union(&own))
    }

    /// Half of the surface areas of all slots together.
    pub fn half_areas(&self) -> f64 {
        let [low, high] = &self.bounds;
        // (Those that are not used are infinitely far from having a size.)
        let size = |axis: usize| {
            std::array::from_fn::<f32, 8, _>(|slot| (high[axis][slot] - low[axis][slot]).max(0.0))
        };
        let [x, y, z] = [size(0), size(1), size(2)];
        (0..8)
            .map(|slot| f64::from(x[slot] * y[slot] + y[slot] * z[slot] + z[slot] * x[slot]))
            .sum()
    }

    /// Works out the order of the children for each octant, when all are set: by their centres
    /// along the diagonal.
    pub fn sort_octants(&mut self) {
        let center = |axis: usize| {
            let (low, high) = (&self.bounds[0][axis], &self.bounds[1][axis]);
            std::array::from_fn::<f32, 8, _>(|slot| low[slot] * 0.5 + high[slot] * 0.5)
        };
        let [x, y, z] = [center(0), center(1), center(2)];
        // By slot, for the octants 0 to 3.
        let mut keys = [[0i32; 4]; 8];
        for (slot, keys) in keys.iter_mut().enumerate() {
            for (octant, key) in keys.iter_mut().enumerate() {
                let side = |axis: usize| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 };
                // Unused slots give NaN and go wherever; they are never met.
                let bits = (x[slot] * side(0) + y[slot] * side(1) + z[slot]).to_bits() as i32;
                // Integers in the order of the numbers, with the slot in the low bits.
                let ordered = bits ^ (bits >> 31 & i32::MAX);
                *key = ordered & !7 | slot as i32;
            }
        }
        sort8(&mut keys);
        let (mut down, mut up) = ([0; 4], [0; 4]);
        for keys in keys {
            for (octant, key) in keys.into_iter().enumerate() {
                let slot = key as u32 & 7;
                up[octant] = up[octant] << 3 | slot;
                down[octant] = down[octant] >> 3 | slot << 21;
            }
        }
        for octant in 0..4 {
            // The opposite octant meets them the other way round.
            (self.order[octant], self.order[octant ^ 7]) = (up[octant], down[octant]);
        }
    }
}

impl Planes {
    /// Those of a node.
    #[inline(always)]
    pub fn of(self, node: &WideNode) -> &[f32; 8] {
        let bounds = node.bounds.as_ptr().cast::<f32>();
        // SAFETY: the first is 0, 8, and so on to 40, of 48.
        unsafe { &*bounds.add(self.first()).cast() }
    }
}

/// Sorts eight rows, each column by itself, by a network of 19 exchanges (Batcher's odd-even merge
/// sort): no branches.
#[inline]
fn sort8(rows: &mut [[i32; 4]; 8]) {
    const NETWORK: [(usize, usize); 19] = [
        (0, 1),
        (2, 3),
        (4, 5),
        (6, 7),
        (0, 2),
        (1, 3),
        (4, 6),
        (5, 7),
        (1, 2),
        (5, 6),
        (0, 4),
        (1, 5),
        (2, 6),
        (3, 7),
        (2, 4),
        (3, 5),
        (1, 2),
        (3, 4),
        (5, 6),
    ];
    for (a, b) in NETWORK {
        let (x, y) = (rows[a], rows[b]);
        for (column, (x, y)) in x.into_iter().zip(y).enumerate() {
            (rows[a][column], rows[b][column]) = (x.min(y), x.max(y));
        }
    }
}

/// Where the ray enters each of the eight boxes, and the value that must not exceed for the box to
/// be met between `t_min` and `cull` (from [`padded`]).
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
    // A plane that a parallel ray lies in gives NaN (0 times infinity), and a NaN on the left
    // does not count.
    let enter = near[0].max(near[1].max(near[2].max(L::splat(token, t_min))));
    let leave = far[0].min(far[1].min(far[2].min(L::splat(token, f32::INFINITY))));
    // Away from zero if positive, towards it if negative: always farther along the ray.
    let leave = leave
        .mul(L::splat(token, 1.0 + BOX_PADDING))
        .max(leave.mul(L::splat(token, 1.0 - BOX_PADDING)));
    (enter, leave.min(L::splat(token, cull)))
}

/// Where the ray meets the near planes of an axis.
#[inline(always)]
fn near<L: Lanes8>(token: L::Token, node: &WideNode, ray: &LocalRay, axis: usize) -> L {
    let plane = L::load(token, &node.bounds[ray.negative[axis] & 1][axis]);
    plane.sub(L::splat(token, ray.near_origin[axis])).mul(L::splat(token, ray.inverse[axis]))
}

/// Where the ray meets the far planes of an axis.
#[inline(always)]
fn far<L: Lanes8>(token: L::Token, node: &WideNode, ray: &LocalRay, axis: usize) -> L {
    let plane = L::load(token, &node.bounds[(ray.negative[axis] & 1) ^ 1][axis]);
    plane.sub(L::splat(token, ray.far_origin[axis])).mul(L::splat(token, ray.inverse[axis]))
}

/// [`box_distances`] for an ordinary ray: a far plane less than [`FAR_FACTOR`] away is as good as
/// met.
#[inline(always)]
pub(crate) fn quick_distances<L: Lanes8>(
    token: L::Token,
    node: &WideNode,
    ray: &QuickRay,
    t_min: f32,
    cull: f32,
) -> (L, L) {
    let near = [
        quick::<L>(token, node, ray, &ray.near, 0, 0),
        quick(token, node, ray, &ray.near, 1, 0),
        quick(token, node, ray, &ray.near, 2, 0),
    ];
    let far = [
        quick::<L>(token, node, ray, &ray.far, 0, 3),
        quick(token, node, ray, &ray.far, 1, 3),
        quick(token, node, ray, &ray.far, 2, 3),
    ];
    let enter = near[0].max(near[1]).max(near[2].max(L::splat(token, t_min)));
    let leave = far[0].min(far[1]).min(far[2]).mul(L::splat(token, FAR_FACTOR));
    (enter, leave.min(L::splat(token, cull)))
}

/// Where an ordinary ray meets the near (`side` 0) or far (3) planes of an axis.
#[inline(always)]
fn quick<L: Lanes8>(
    token: L::Token,
    node: &WideNode,
    ray: &QuickRay,
    offsets: &[f32; 3],
    axis: usize,
    side: usize,
) -> L {
    let (inverse, offset) = (L::splat(token, ray.inverse[axis]), L::splat(token, offsets[axis]));
    crossing(ray.planes()[axis + side].of(node), inverse, offset)
}

/// [`quick_distances`] with all about the ray in registers, for many nodes in turn.
pub(crate) struct QuickBoxes<L> {
    inverse: [L; 3],
    near: [L; 3],
    far: [L; 3],
    planes: [Planes; 6],
}

/// Instead of [`FAR_FACTOR`]: far planes are this much farther, relative to the largest distance at
/// which the ray may meet any plane. A little more, for the roundings of that.
const FAR_PADDING: f32 = 1.1e-6;

/// No distance needs more. (Without a limit it would be infinite along an axis that the ray does
/// not move along, and empty boxes would count as met.)
const MAX_FAR_PADDING: f32 = 4e30;

impl<L: Lanes8> QuickBoxes<L> {
    /// `extent` is the largest coordinate of the boxes.
    #[inline(always)]
    pub fn new(token: L::Token, ray: &QuickRay, extent: f32) -> Self {
        let (inverse, far) =
            (Vec3::from_array(ray.inverse).extend(1.0), Vec3::from_array(ray.far).extend(1.0));
        let far = if L::FUSED {
            far + ((inverse.abs() * extent + far.abs()) * FAR_PADDING)
                .min(Vec4::splat(MAX_FAR_PADDING))
        } else {
            far - ((far.abs() + extent) * FAR_PADDING).copysign(inverse)
        };
        let ([x, y, z], near, far, planes) = (ray.inverse, &ray.near, far.to_array(), ray.planes());
        // (No closures for lanes: those are not always inlined.)
        Self {
            inverse: [L::splat(token, x), L::splat(token, y), L::splat(token, z)],
            near: [L::splat(token, near[0]), L::splat(token, near[1]), L::splat(token, near[2])],
            far: [L::splat(token, far[0]), L::splat(token, far[1]), L::splat(token, far[2])],
            planes: [planes[0], planes[1], planes[2], planes[3], planes[4], planes[5]],
        }
    }

    /// As [`quick_distances`].
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

/// Where an ordinary ray meets planes.
#[inline(always)]
fn crossing<L: Lanes8>(planes: &[f32; 8], inverse: L, offset: L) -> L {
    let plane = L::load(inverse.token(), planes);
    if L::FUSED { plane.mul_add(inverse, offset) } else { plane.sub(offset).mul(inverse) }
}
