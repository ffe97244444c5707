//! Eight `f32` lanes: the operations that kernels need, implemented for each instruction set.

use super::Token;

/// Eight lanes of `f32`. Every implementation gives the same bits, except for operations documented
/// otherwise: no other operation is fused, and `min` and `max` return the second operand if one is
/// NaN.
pub trait Lanes8: Copy {
    /// True if [`Self::mul_add`] and [`Self::mul_sub`] round once; false if they round the product
    /// and then the result.
    const FUSED: bool;

    /// The token of the instruction set, needed to create values.
    type Token: Token;

    /// The token that was used to create this value.
    fn token(self) -> Self::Token;

    /// The same number in all lanes.
    fn splat(token: Self::Token, value: f32) -> Self;

    /// Eight numbers from memory.
    fn load(token: Self::Token, values: &[f32; 8]) -> Self;

    /// Lane `i` of the result is lane `lanes[i]` (below 8) of `values`.
    fn load_permuted(token: Self::Token, values: &[f32; 8], lanes: &[u32; 8]) -> Self;

    /// Writes the eight numbers.
    fn store(self, to: &mut [f32; 8]);

    /// Writes the lanes whose bit is set in `mask`.
    fn store_where(self, mask: u32, to: &mut [f32; 8]);

    /// `self + other`.
    fn add(self, other: Self) -> Self;

    /// `self - other`.
    fn sub(self, other: Self) -> Self;

    /// `self * other`.
    fn mul(self, other: Self) -> Self;

    /// `self * factor + summand`, fused or not: see [`Self::FUSED`].
    fn mul_add(self, factor: Self, summand: Self) -> Self;

    /// `self * factor - subtrahend`, fused or not: see [`Self::FUSED`].
    fn mul_sub(self, factor: Self, subtrahend: Self) -> Self;

    /// The minimum of both; `other` if either is NaN.
    fn min(self, other: Self) -> Self;

    /// The maximum of both; `other` if either is NaN.
    fn max(self, other: Self) -> Self;

    /// Absolute value.
    fn abs(self) -> Self;

    /// Bit `i` is set if `self <= other` in lane `i` (not for NaN).
    fn le(self, other: Self) -> u32;

    /// Bit `i` is set if `self < other` in lane `i` (not for NaN).
    fn lt(self, other: Self) -> u32;

    /// Bit `i` is set if lane `i` has its sign bit set.
    fn signs(self) -> u32;

    /// `other` in the lanes whose bit is set in `mask`, `self` in the others.
    fn replace(self, mask: u32, other: Self) -> Self;

    /// `other` where `low < high` (not for NaN), `self` elsewhere. This is cheaper than
    /// [`Self::lt`] followed by [`Self::replace`], which convert the comparison to bits and back.
    fn where_less(self, low: Self, high: Self, other: Self) -> Self;

    /// Bit `i` is set if `self <= limit` in the lane that comes `i`-th in `order` (eight numbers of
    /// 3 bits, the first lowest).
    fn le_in_order(self, limit: Self, order: u32) -> u32;

    /// Takes the lanes in `order`, keeps those whose bit is set in `mask` (a result of
    /// [`Self::le_in_order`]), and writes them to the front of `to`: for each its `payload` and the
    /// bits of its number. The contents of `to` behind them are unspecified.
    fn compress(self, mask: u32, order: u32, payload: &[u32; 8], to: &mut [[u32; 2]; 8]);

    /// Does what [`Self::compress`] does with the payload alone.
    fn compress_payload(
        token: Self::Token,
        mask: u32,
        order: u32,
        payload: &[u32; 8],
        to: &mut [u32; 8],
    );

    /// Writes for each lane its payload, followed by the bits of its number.
    fn store_after(self, payload: &[u32; 8], to: &mut [[u32; 2]; 8]);

    /// Takes the lanes in `order` (eight numbers of 3 bits, the first lowest), keeps those with
    /// `self <= limit`, and writes their numbers and their `payload` to the front of the outputs.
    /// The contents behind them are unspecified. Returns how many lanes were kept.
    fn compress_le(
        self,
        limit: Self,
        order: u32,
        payload: &[u32; 8],
        values_out: &mut [f32; 8],
        payload_out: &mut [u32; 8],
    ) -> usize;
}
