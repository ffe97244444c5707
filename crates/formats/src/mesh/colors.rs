//! Colours of vertices and faces as mesh files write them.

use rayon::prelude::*;
use snell_intersect::TriangleMesh;
use snell_math::spectrum::srgb_to_linear;
use std::collections::HashMap;

/// Stands for a colour that the file does not give, which is white.
pub const MISSING: [f32; 4] = [f32::NAN; 4];

/// True if colours are bytes, whatever their type: all are whole numbers, and some are above 1.
pub fn are_bytes(colors: &[[f32; 4]]) -> bool {
    let rgb = || colors.iter().flat_map(|c| &c[..3]).filter(|c| !c.is_nan());
    rgb().all(|c| c.fract() == 0.0) && rgb().any(|c| *c > 1.0)
}

/// Makes linear colours of sRGB values from 0 to 1, or from 0 to 255 if they are bytes.
pub fn to_linear(colors: &mut [[f32; 4]]) {
    let scale = if are_bytes(colors) { 1.0 / 255.0 } else { 1.0 };
    scaled_to_linear(colors, scale);
}

/// Makes linear colours of sRGB values from 0 to 255.
pub fn bytes_to_linear(colors: &mut [[f32; 4]]) {
    scaled_to_linear(colors, 1.0 / 255.0);
}

fn scaled_to_linear(colors: &mut [[f32; 4]], scale: f32) {
    colors.par_iter_mut().with_min_len(1 << 12).for_each(|color| {
        if color.iter().any(|c| c.is_nan()) {
            *color = [1.0; 4];
            return;
        }
        // Without its own value alpha is 1, and so are those of bytes that stop at 1.
        let alpha = if color[3] > 1.0 { color[3] * scale } else { color[3] };
        let [r, g, b, _] = color.map(|c| srgb_to_linear((c * scale).clamp(0.0, 1.0)));
        *color = [r, g, b, alpha.clamp(0.0, 1.0)];
    });
}

/// Gives each triangle its colour, linear with alpha. Triangles of different colours get vertices
/// of their own; all other attributes stay.
pub fn paint(mesh: &mut TriangleMesh, colors: &[[f32; 4]]) {
    let mut vertex_colors: Vec<Option<[f32; 4]>> = vec![None; mesh.positions.len()];
    // Never iterated, so order does not matter.
    let mut copies: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    let mut copied: Vec<u32> = Vec::new();
    let first_copy = mesh.positions.len();
    for (triangle, &color) in mesh.indices.iter_mut().zip(colors) {
        for index in triangle {
            let own = &mut vertex_colors[*index as usize];
            if *own.get_or_insert(color) == color {
                continue;
            }
            let key = (*index, color.map(f32::to_bits));
            *index = *copies.entry(key).or_insert_with(|| {
                copied.push(*index);
                vertex_colors.push(Some(color));
                (first_copy + copied.len() - 1) as u32
            });
        }
    }
    fn extend<T: Copy>(values: &mut Vec<T>, copied: &[u32]) {
        if !values.is_empty() {
            let more: Vec<T> = copied.iter().map(|&i| values[i as usize]).collect();
            values.extend(more);
        }
    }
    extend(&mut mesh.positions, &copied);
    extend(&mut mesh.exact, &copied);
    extend(&mut mesh.normals, &copied);
    extend(&mut mesh.tangents, &copied);
    mesh.uvs.iter_mut().for_each(|uvs| extend(uvs, &copied));
    mesh.colors = vertex_colors.into_iter().map(|c| c.unwrap_or([1.0; 4])).collect();
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec3;

    #[test]
    fn triangles_share_vertices_of_their_colour_only() {
        let mut mesh = TriangleMesh {
            positions: (0..4).map(|i| Vec3::splat(i as f32)).collect(),
            normals: vec![Vec3::Z; 4],
            indices: vec![[0, 1, 2], [0, 2, 3], [1, 2, 3]],
            ..TriangleMesh::default()
        };
        let before: Vec<_> = (0..3).map(|t| mesh.corners(t)).collect();
        let (red, blue) = ([1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]);
        let colors = [red, blue, red];
        paint(&mut mesh, &colors);
        assert_eq!(mesh.validate(), Ok(()));
        assert_eq!(mesh.positions.len(), 7, "0, 2 and 3 have two colours");
        for (t, (corners, color)) in before.into_iter().zip(colors).enumerate() {
            assert_eq!(mesh.corners(t), corners);
            assert!(mesh.indices[t].iter().all(|&i| mesh.colors[i as usize] == color));
        }
    }

    #[test]
    fn whole_numbers_above_one_are_bytes() {
        let mut bytes = [[255.0, 0.0, 128.0, 255.0], [0.0, 0.0, 0.0, 1.0], MISSING];
        to_linear(&mut bytes);
        assert_eq!(bytes[2], [1.0; 4]);
        assert_eq!(bytes[0], [1.0, 0.0, srgb_to_linear(128.0 / 255.0), 1.0]);
        assert_eq!(bytes[1], [0.0, 0.0, 0.0, 1.0]);
        let mut fractions = [[1.0, 0.5, 0.0, 0.25], [2.0, 0.0, 0.0, 1.0]];
        to_linear(&mut fractions);
        assert_eq!(fractions[0], [1.0, srgb_to_linear(0.5), 0.0, 0.25]);
        assert_eq!(fractions[1], [1.0, 0.0, 0.0, 1.0]);
    }
}
