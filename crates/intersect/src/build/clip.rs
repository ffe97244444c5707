//! Division of a triangle by a plane, for spatial splits.

use super::binning::Primitive;
use crate::exact::triangle::PLACE_TOLERANCE;
use snell_math::{DVec3, Vec3};

/// The boxes of both parts of a piece of a triangle, divided at `plane` on an axis; `None` for a
/// side on which nothing of the triangle lies.
///
/// Each box holds the part of the triangle on that side, is padded by more than the error of a hit
/// along the triangle, and is clipped to the box of the piece. So a ray that hits the triangle also
/// hits the box of the piece in which the hit lies.
pub(super) fn divided(
    piece: &Primitive,
    corners: &[Vec3; 3],
    axis: usize,
    plane: f32,
) -> [Option<Primitive>; 2] {
    let plane = f64::from(plane);
    let corners = corners.map(|p| p.as_dvec3());
    let mut low = [DVec3::INFINITY; 2];
    let mut high = [DVec3::NEG_INFINITY; 2];
    let mut add = |side: usize, p: DVec3| {
        low[side] = low[side].min(p);
        high[side] = high[side].max(p);
    };
    for i in 0..3 {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        let (x, y) = (a[axis], b[axis]);
        if x <= plane {
            add(0, a);
        }
        if x >= plane {
            add(1, a);
        }
        if (x < plane && y > plane) || (x > plane && y < plane) {
            let mut p = a + (b - a) * ((plane - x) / (y - x));
            p[axis] = plane;
            add(0, p);
            add(1, p);
        }
    }
    let all =
        corners[0].max(corners[1]).max(corners[2]) - corners[0].min(corners[1]).min(corners[2]);
    let margin = DVec3::splat(all.max_element() * (2.0 * PLACE_TOLERANCE));
    let bounds = piece.bounds().bounds();
    let of = |side: usize| {
        let (mut low, mut high) = (
            (low[side] - margin).as_vec3().max(bounds.min),
            (high[side] + margin).as_vec3().min(bounds.max),
        );
        if side == 0 {
            high[axis] = high[axis].min((plane + margin.x) as f32);
        } else {
            low[axis] = low[axis].max((plane - margin.x) as f32);
        }
        low.cmple(high).all().then(|| Primitive::new(low, high, piece.number()))
    };
    [of(0), of(1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_of_a_diagonal_triangle_are_small() {
        let corners = [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.01)];
        let whole = Primitive::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.01), 7);
        let [a, b] = divided(&whole, &corners, 0, 0.5);
        let (a, b) = (a.expect("a piece"), b.expect("a piece"));
        let near = |p: Vec3, x: f32, y: f32| (p.x - x).abs() < 1e-3 && (p.y - y).abs() < 1e-3;
        assert!(near(a.bounds().bounds().max, 0.5, 0.5) && near(b.bounds().bounds().min, 0.5, 0.5));
        assert!(a.bounds().bounds().max.x > 0.5 && a.number() == 7);
        assert!(divided(&whole, &corners, 0, 2.0)[1].is_none());
    }
}
