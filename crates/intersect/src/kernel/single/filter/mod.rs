//! The filter that selects the triangles of a block that a ray may hit, in either precision.

pub(crate) mod double;
pub(crate) mod single;

use crate::exact::TriangleTest;
use crate::exact::prepared::PreparedRay;
use crate::exact::ray::LocalRay;
use crate::precision::{Double, Single};
use crate::tree::block::TriangleBlock;
use snell_math::simd::Lanes8;

/// The conservative filter of the triangles of blocks in a precision, computed in `f32`.
pub(crate) trait BlockFilter: TriangleTest {
    /// The triangles of the block that the ray may hit, a bit for each ([`single::candidates`]).
    fn candidates<L: Lanes8>(
        token: L::Token,
        block: &TriangleBlock,
        ray: &LocalRay,
        t_min: f32,
        cull: f32,
    ) -> u32;

    /// The triangles of the block that the line of an ordinary ray may pass through, a bit for each
    /// ([`single::lines_through`]).
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &PreparedRay) -> u32;
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
        single::candidates::<L>(token, block, ray, t_min, cull)
    }

    #[inline(always)]
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &PreparedRay) -> u32 {
        single::lines_through::<L>(token, block, ray)
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
        double::candidates::<L>(token, block, ray, t_min, cull)
    }

    #[inline(always)]
    fn lines_through<L: Lanes8>(token: L::Token, block: &TriangleBlock, ray: &PreparedRay) -> u32 {
        double::lines_through::<L>(token, block, ray)
    }
}
