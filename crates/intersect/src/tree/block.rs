//! Blocks of up to eight triangles.

use snell_math::{Bounds3, Mat4, Vec3, Vec4};

/// Up to eight triangles in lanes, so that they are tested at once.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct TriangleBlock {
    /// Coordinates by vertex, axis and lane.
    pub vertices: [[[f32; 8]; 3]; 3],
    /// Number of each triangle within its group.
    pub ids: [u32; 8],
}

impl TriangleBlock {
    pub const EMPTY: Self = Self { vertices: [[[0.0; 8]; 3]; 3], ids: [u32::MAX; 8] };

    /// The box around the first `count` triangles.
    pub fn bounds(&self, count: u32) -> Bounds3 {
        Bounds3::of((0..count as usize).flat_map(|lane| self.corners(lane)).map(Vec3::from_array))
    }

    /// The box around the first `count` triangles, each padded as by
    /// [`crate::mesh::padded_bounds`]. All vertices must be finite.
    #[inline]
    pub fn padded_bounds(&self, count: usize) -> Bounds3 {
        let (mut low, mut high) = ([Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]);
        for (half, lanes) in
            [Vec4::new(0.0, 1.0, 2.0, 3.0), Vec4::new(4.0, 5.0, 6.0, 7.0)].into_iter().enumerate()
        {
            let used = lanes.cmplt(Vec4::splat(count as f32));
            let row = |vertex: usize, axis: usize| {
                Vec4::from_slice(&self.vertices[vertex][axis][4 * half..])
            };
            let rows = |axis: usize| [row(0, axis), row(1, axis), row(2, axis)];
            let sides = [0, 1, 2].map(|axis| {
                let [a, b, c] = rows(axis);
                (a.min(b).min(c), a.max(b).max(c))
            });
            let [x, y, z] = sides.map(|(l, h)| h - l);
            let padding = x.max(y).max(z) * 1e-6 + f32::MIN_POSITIVE;
            for (axis, (l, h)) in sides.into_iter().enumerate() {
                let l = (l - (l.abs() * f32::EPSILON + padding)).max(Vec4::MIN);
                let h = (h + (h.abs() * f32::EPSILON + padding)).min(Vec4::MAX);
                low[axis] = low[axis].min(Vec4::select(used, l, Vec4::INFINITY));
                high[axis] = high[axis].max(Vec4::select(used, h, Vec4::NEG_INFINITY));
            }
        }
        let across = |x: [Vec4; 3]| Mat4::from_cols(x[0], x[1], x[2], x[2]).transpose();
        let (low, high) = (across(low), across(high));
        let least = low.x_axis.min(low.y_axis).min(low.z_axis.min(low.w_axis));
        let most = high.x_axis.max(high.y_axis).max(high.z_axis.max(high.w_axis));
        Bounds3 { min: least.truncate(), max: most.truncate() }
    }

    /// The corners of the triangle in a lane.
    #[inline(always)]
    pub fn corners(&self, lane: usize) -> [[f32; 3]; 3] {
        let (lane, v) = (lane & 7, &self.vertices);
        let corner = |i: usize| [v[i][0][lane], v[i][1][lane], v[i][2][lane]];
        [corner(0), corner(1), corner(2)]
    }

    /// Sets all lanes. `corners` are given by vertex and lane.
    #[inline]
    pub fn set_all(&mut self, corners: &[[Vec4; 8]; 3], ids: [u32; 8]) {
        for (vertex, [a, b, c, d, e, f, g, h]) in self.vertices.iter_mut().zip(*corners) {
            // The numbers are transposed in registers: if they were written one by one, reading
            // them as rows (in `padded_bounds`) would have to wait for the writes.
            let (low, high) =
                (Mat4::from_cols(a, b, c, d).transpose(), Mat4::from_cols(e, f, g, h).transpose());
            for (axis, row) in vertex.iter_mut().enumerate() {
                let (low, high) = (low.col(axis).to_array(), high.col(axis).to_array());
                *row = [low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]];
            }
        }
        self.ids = ids;
    }

    /// Sets the triangle of one lane.
    pub fn set(&mut self, lane: usize, corners: &[[f32; 3]; 3], id: u32) {
        for (vertex, corner) in self.vertices.iter_mut().zip(corners) {
            for (axis, &x) in vertex.iter_mut().zip(corner) {
                axis[lane] = x;
            }
        }
        self.ids[lane] = id;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn boxes_around_blocks_are_those_around_their_triangles(
            corners in prop::collection::vec(
                prop::array::uniform3(prop::array::uniform3(-1e3f32..1e3)), 1..=8
            ),
            exponent in -60..36,
        ) {
            let scale = 2f32.powi(3 * exponent);
            let (mut block, mut expected) = (TriangleBlock::EMPTY, Bounds3::EMPTY);
            for (lane, corners) in corners.iter().enumerate() {
                let corners = corners.map(|v| Vec3::from_array(v) * scale);
                block.set(lane, &corners.map(|v| v.to_array()), lane as u32);
                expected = expected.union(&crate::mesh::padded_bounds(&corners));
            }
            prop_assert_eq!(block.padded_bounds(corners.len()), expected);
        }
    }
}
