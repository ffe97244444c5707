//! Converts colours of files with primaries other than Rec. 709.

use exr::math::Vec2;
use exr::meta::attribute::Chromaticities;
use snell_math::DVec3;
use snell_math::spectrum::adaptation;

type Matrix = [[f64; 3]; 3];

/// Chromaticities of red, green, blue and white in Rec. 709: the default if a file names none.
const REC709: [[f64; 2]; 4] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];

/// The matrix from RGB of the file to Rec. 709; `None` if no conversion is needed or the
/// chromaticities are invalid.
pub fn to_rec709(chromaticities: &Chromaticities) -> Option<[[f32; 3]; 3]> {
    let point = |v: Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
    let Chromaticities { red, green, blue, white } = *chromaticities;
    rec709_from([red, green, blue, white].map(point))
}

/// The weights of red, green and blue in the luminance of colours with these primaries; those of
/// Rec. 709 if there are none or they are invalid.
pub fn luminance_weights(chromaticities: Option<&Chromaticities>) -> [f32; 3] {
    let named = chromaticities.and_then(|c| {
        let point = |v: Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
        xyz_from_rgb(&[c.red, c.green, c.blue, c.white].map(point))
    });
    let weights = named.map(|matrix| matrix[1].map(|w| w as f32));
    weights.filter(|w| w[1] > 1e-3 && w.iter().all(|w| w.is_finite())).unwrap_or(REC709_WEIGHTS)
}

/// Weights of the luminance in Rec. 709.
const REC709_WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Like [`to_rec709`], for the chromaticities of red, green, blue and white.
pub fn rec709_from(file: [[f64; 2]; 4]) -> Option<[[f32; 3]; 3]> {
    let same =
        file.iter().flatten().zip(REC709.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-3);
    if same {
        return None;
    }
    let to_xyz = xyz_from_rgb(&file)?;
    let from_xyz = inverse(&xyz_from_rgb(&REC709)?)?;
    let [from, to] = [xyz_of(file[3])?, xyz_of(REC709[3])?].map(DVec3::from);
    let adapt = adaptation(from, to).transpose().to_cols_array_2d();
    let matrix = product(&product(&from_xyz, &adapt), &to_xyz).map(|row| row.map(|v| v as f32));
    matrix.iter().flatten().all(|v| v.is_finite() && v.abs() < 1e3).then_some(matrix)
}

/// The XYZ colour with Y = 1 of a chromaticity; `None` if y is not positive.
fn xyz_of([x, y]: [f64; 2]) -> Option<[f64; 3]> {
    (y > 1e-6).then(|| [x / y, 1.0, (1.0 - x - y) / y])
}

/// The matrix from RGB to XYZ. Its columns are the primaries, scaled so that (1, 1, 1) is white
/// (SMPTE RP 177).
fn xyz_from_rgb(points: &[[f64; 2]; 4]) -> Option<Matrix> {
    // A primary may lie on the line y = 0 or below (ACES AP0 blue does), so the columns are scaled
    // by x + y + z instead of Y.
    let columns: [[f64; 3]; 3] =
        std::array::from_fn(|i| [points[i][0], points[i][1], 1.0 - points[i][0] - points[i][1]]);
    let primaries: Matrix = std::array::from_fn(|row| std::array::from_fn(|c| columns[c][row]));
    let scale = multiply(&inverse(&primaries)?, xyz_of(points[3])?);
    Some(primaries.map(|row| std::array::from_fn(|c| row[c] * scale[c])))
}

fn multiply(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| std::array::from_fn(|c| row[0] * b[0][c] + row[1] * b[1][c] + row[2] * b[2][c]))
}

fn inverse(m: &Matrix) -> Option<Matrix> {
    let cofactor = |r: usize, c: usize| {
        let [r1, r2, c1, c2] = [(r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3];
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * cofactor(0, c)).sum();
    (determinant.abs() > 1e-9)
        .then(|| std::array::from_fn(|r| std::array::from_fn(|c| cofactor(c, r) / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(points: [[f32; 2]; 4]) -> Chromaticities {
        let [red, green, blue, white] = points.map(|[x, y]| Vec2(x, y));
        Chromaticities { red, green, blue, white }
    }

    #[test]
    fn rec709_needs_no_change() {
        assert_eq!(to_rec709(&named(REC709.map(|p| p.map(|v| v as f32)))), None);
    }

    #[test]
    fn aces_ap0_has_the_published_matrix_and_keeps_white() {
        let ap0 = named([[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], [0.32168, 0.33767]]);
        let matrix = to_rec709(&ap0).unwrap();
        // OpenColorIO's ACES configuration, ACES2065-1 to linear Rec. 709 (Bradford).
        let expected = [
            [2.52169, -1.13413, -0.38756],
            [-0.27648, 1.37272, -0.09624],
            [-0.01538, -0.15298, 1.16835],
        ];
        for (row, expected) in matrix.iter().zip(expected) {
            assert!((0..3).all(|i| (row[i] - expected[i]).abs() < 2e-3), "{row:?} {expected:?}");
            assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn nonsense_is_ignored() {
        for v in [0.0, 0.3, f32::NAN, f32::INFINITY, -1e30] {
            assert_eq!(to_rec709(&named([[v; 2]; 4])), None);
        }
    }
}
