//! Repairs mesh attributes.

use snell_intersect::TriangleMesh;
use snell_math::{Vec2, Vec3};

/// Replaces invalid attributes: NaNs, zero-length normals and tangents, colours out of range.
pub fn make_usable(mesh: &mut TriangleMesh) {
    let usable = |v: Vec3| v.is_finite() && v.length_squared() > 0.0;
    if mesh.normals.iter().any(|&n| !usable(n)) {
        let computed = mesh.computed_normals();
        for (normal, computed) in mesh.normals.iter_mut().zip(computed) {
            if !usable(*normal) {
                *normal = computed;
            }
        }
    }
    for (tangent, normal) in mesh.tangents.iter_mut().zip(&mesh.normals) {
        let direction = tangent.truncate();
        let direction =
            if usable(direction) { direction } else { normal.normalize().any_orthonormal_vector() };
        *tangent = direction.normalize().extend(if tangent.w < 0.0 { -1.0 } else { 1.0 });
    }
    for uv in mesh.uvs.iter_mut().flatten().filter(|uv| !uv.is_finite()) {
        *uv = Vec2::ZERO;
    }
    for channel in mesh.colors.iter_mut().flatten() {
        *channel = if channel.is_nan() { 1.0 } else { channel.clamp(0.0, 1.0) };
    }
}
