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
    fn candidates<L: Lanes8>(
        token: L::Token,
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32;

    /// Which triangles of the block the line of an ordinary ray may pass through
    /// ([`crate::exact::triangle::lines_through`]).
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &QuickRay) -> u32;
}

impl BlockFilter for Single {
    #[inline(always)]
    fn candidates<L: Lanes8>(
        token: L::Token,
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32 {
        crate::exact::triangle::candidates::<L>(token, block, ray, t_min, cull)
    }

    #[inline(always)]
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &QuickRay) -> u32 {
        crate::exact::triangle::lines_through::<L>(token, block, ray)
    }
}

impl BlockFilter for Double {
    #[inline(always)]
    fn candidates<L: Lanes8>(
        token: L::Token,
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32 {
        double::triangle::candidates::<L>(token, block, ray, t_min, cull)
    }

    #[inline(always)]
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &QuickRay) -> u32 {
        double::triangle::lines_through::<L>(token, block, ray)
    }
}
