//! The 8-wide node.

use snell_math::{Bounds3, Vec3};

/// A child reference in 32 bits: an inner node, up to eight triangles, or an object (shape or
/// instance).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct ChildRef(pub u32);

impl ChildRef {
    const TRIANGLES: u32 = 1 << 30;
    const OBJECT: u32 = 2 << 30;
    const BLOCK_BITS: u32 = 27;
    /// The largest number of blocks of triangles in a group.
    pub const MAX_BLOCKS: usize = 1 << Self::BLOCK_BITS;
    /// The largest number of inner nodes, and of objects, in a group.
    pub const MAX_NODES: usize = 1 << 30;
    /// Fills unused slots; their boxes are empty.
    pub const NONE: Self = Self(u32::MAX);
    /// A marker on the stack of a traversal, where it returns from an instance. Never stored in
    /// trees.
    pub const RETURN: Self = Self(u32::MAX - 1);

    pub fn node(index: usize) -> Self {
        Self(index as u32)
    }

    /// A reference to the first `count` triangles, from 1 to 8, of a block.
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

    /// The number of the node, for a reference that is known to be a node.
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

    /// The number of triangles in the block.
    #[inline(always)]
    pub fn count(self) -> u32 {
        ((self.0 >> Self::BLOCK_BITS) & 7) + 1
    }
}

/// Eight boxes, and a reference to the child in each.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    /// Bounds by side (minimum, maximum), axis and slot.
    pub bounds: [[[f32; 8]; 3]; 2],
    pub children: [ChildRef; 8],
    /// For each octant of directions (bit i is set for directions that are negative along axis i),
    /// the slots from far to near as eight numbers of 3 bits.
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

    /// The box of a slot; empty if the slot is not used.
    pub fn slot_bounds(&self, slot: usize) -> Bounds3 {
        let side = |side: usize| Vec3::from_array(self.bounds[side].map(|axis| axis[slot & 7]));
        Bounds3 { min: side(0), max: side(1) }
    }

    /// The box around all slots.
    pub fn bounds(&self) -> Bounds3 {
        (0..8).map(|slot| self.slot_bounds(slot)).fold(Bounds3::EMPTY, |all, own| all.union(&own))
    }

    /// The sum over all slots of half the surface area of the box.
    pub fn half_areas(&self) -> f64 {
        let [low, high] = &self.bounds;
        // Unused slots have an infinitely negative size, which counts as 0.
        let size = |axis: usize| {
            std::array::from_fn::<f32, 8, _>(|slot| (high[axis][slot] - low[axis][slot]).max(0.0))
        };
        let [x, y, z] = [size(0), size(1), size(2)];
        (0..8)
            .map(|slot| f64::from(x[slot] * y[slot] + y[slot] * z[slot] + z[slot] * x[slot]))
            .sum()
    }

    /// Computes the order of the children for each octant, by the position of their centres along
    /// the octant's diagonal. All slots must be set before.
    pub fn sort_octants(&mut self) {
        let center = |axis: usize| {
            let (low, high) = (&self.bounds[0][axis], &self.bounds[1][axis]);
            std::array::from_fn::<f32, 8, _>(|slot| low[slot] * 0.5 + high[slot] * 0.5)
        };
        let [x, y, z] = [center(0), center(1), center(2)];
        // Sort keys by slot, for the octants 0 to 3.
        let mut keys = [[0i32; 4]; 8];
        for (slot, keys) in keys.iter_mut().enumerate() {
            for (octant, key) in keys.iter_mut().enumerate() {
                let side = |axis: usize| if octant >> axis & 1 == 1 { -1.0 } else { 1.0 };
                // Unused slots give NaN and end up anywhere; they are never hit.
                let bits = (x[slot] * side(0) + y[slot] * side(1) + z[slot]).to_bits() as i32;
                // These integers have the order of the numbers, with the slot in the low bits.
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
            // The opposite octant has the reverse order.
            (self.order[octant], self.order[octant ^ 7]) = (up[octant], down[octant]);
        }
    }
}

/// Sorts eight rows, each column independently, without branches, by a network of 19 exchanges
/// (Batcher's odd-even merge sort).
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
