//! AOVs of the surface that was hit.

use super::colors::{self, value};
use super::{AovKind, Declared, Needs};
use crate::integrator::outgoing;
use snell_math::Rgb;

/// The AOV of the point.
pub const POSITION: Declared = Declared {
    name: "position",
    channels: &["X", "Y", "Z"],
    kind: AovKind::Averaged,
    needs: Needs::Surface,
    values: |_, first, _, values| {
        values.extend(first.surface.iter().flat_map(|surface| surface.position.to_array()));
    },
    preview: |values, scene_radius| {
        let f = |i| (value(values, i) / scene_radius * 0.5 + 0.5).rem_euclid(1.0);
        Rgb::new(f(0), f(1), f(2))
    },
};

/// The AOV of the shading normal.
pub const NORMAL: Declared = Declared {
    name: "normal",
    channels: &["X", "Y", "Z"],
    kind: AovKind::Averaged,
    needs: Needs::Surface,
    values: |_, first, _, values| {
        values.extend(first.surface.iter().flat_map(|surface| surface.shading_normal.to_array()));
    },
    preview: colors::direction,
};

/// The AOV of the geometric normal.
pub const GEOMETRIC_NORMAL: Declared = Declared {
    name: "geometric-normal",
    channels: &["X", "Y", "Z"],
    kind: AovKind::Averaged,
    needs: Needs::Surface,
    values: |_, first, _, values| {
        values.extend(first.surface.iter().flat_map(|surface| surface.geometric_normal.to_array()));
    },
    preview: colors::direction,
};

/// The AOV of texture coordinates.
pub const UV: Declared = Declared {
    name: "uv",
    channels: &["U", "V"],
    kind: AovKind::Averaged,
    needs: Needs::Surface,
    values: |_, first, _, values| {
        values.extend(first.surface.iter().flat_map(|surface| surface.uv.to_array()));
    },
    preview: colors::coordinates,
};

/// The AOV of the albedo.
pub const ALBEDO: Declared = Declared {
    name: "albedo",
    channels: &["R", "G", "B"],
    kind: AovKind::Averaged,
    needs: Needs::Surface,
    values: |_, first, _, values| {
        values.extend(first.surface.iter().flat_map(|surface| surface.albedo.to_array()));
    },
    preview: colors::color,
};

/// The AOV of the side that is seen.
pub const FACING: Declared = Declared {
    name: "facing",
    channels: &["V"],
    kind: AovKind::Averaged,
    needs: Needs::Surface,
    values: |_, first, _, values| {
        let facing = |normal| outgoing(first.ray).dot(normal);
        values.extend(first.surface.iter().map(|surface| facing(surface.geometric_normal)));
    },
    preview: |values, _| match value(values, 0) {
        outside if outside >= 0.0 => Rgb::splat(outside),
        inside => Rgb::new(-inside, 0.0, 0.0),
    },
};

/// The AOV of barycentric coordinates.
pub const BARYCENTRICS: Declared = Declared {
    name: "barycentrics",
    channels: &["U", "V"],
    kind: AovKind::Averaged,
    needs: Needs::Hit,
    values: |_, first, _, values| values.extend(first.hit.uv.to_array()),
    preview: colors::coordinates,
};
