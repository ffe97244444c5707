//! Which triangles of a block a ray may hit, in either precision.

use crate::exact::quick::QuickRay;
use crate::exact::ray::LocalRay;
use crate::exact::triangle::TriangleBlock;
use crate::exact::{TriangleTest, double};
use crate::precision::{Double, Single};
use snell_math::simd::Lanes8;

/// How a precision filters the triangles of blocks: conservatively, in `f32`.
pub(crate) trait BlockFilter: TriangleTest {
    /// Which triangles of the block the ray may hit ([`crate::exact::triangle::candidates`]).
    ///
    /// # Safety
    /// The machine must have the instructions of `L`.
    unsafe fn candidates<L: Lanes8>(
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32;

    /// Which triangles of the block the line of an ordinary ray may pass through
    /// ([`crate::exact::triangle::lines_through`]).
    ///
    /// # Safety
    /// The machine must have the instructions of `L`; the ray must be prepared.
    unsafe fn lines_through<L: Lanes8>(block: &TriangleBlock, ray: &QuickRay) -> u32;
}

impl BlockFilter for Single {
    #[inline(always)]
    unsafe fn candidates<L: Lanes8>(
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32 {
        // SAFETY: passed on to the caller.
        unsafe { crate::exact::triangle::candidates::<L>(block, ray, t_min, cull) }
    }

    #[inline(always)]
    unsafe fn lines_through<L: Lanes8>(block: &TriangleBlock, ray: &QuickRay) -> u32 {
        // SAFETY: passed on to the caller.
        unsafe { crate::exact::triangle::lines_through::<L>(block, ray) }
    }
}

impl BlockFilter for Double {
    #[inline(always)]
    unsafe fn candidates<L: Lanes8>(
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32 {
        // SAFETY: passed on to the caller.
        unsafe { double::triangle::candidates::<L>(block, ray, t_min, cull) }
    }

    #[inline(always)]
    unsafe fn lines_through<L: Lanes8>(block: &TriangleBlock, ray: &QuickRay) -> u32 {
        // SAFETY: passed on to the caller.
        unsafe { double::triangle::lines_through::<L>(block, ray) }
    }
}
