//! AOVs of the ids of the hit.

use super::colors;
use super::{AovKind, Declared, Needs};

/// The AOV of the instance.
pub const INSTANCE: Declared = Declared {
    name: "instance-id",
    channels: &["id"],
    kind: AovKind::First,
    needs: Needs::Hit,
    values: |_, first, _, values| values.push(first.hit.instance as f32),
    preview: colors::id,
};

/// The AOV of the geometry.
pub const GEOMETRY: Declared = Declared {
    name: "geometry-id",
    channels: &["id"],
    kind: AovKind::First,
    needs: Needs::Hit,
    values: |_, first, _, values| values.push(first.hit.geometry as f32),
    preview: colors::id,
};

/// The AOV of the triangle or face.
pub const PRIMITIVE: Declared = Declared {
    name: "primitive-id",
    channels: &["id"],
    kind: AovKind::First,
    needs: Needs::Hit,
    values: |_, first, _, values| values.push(first.hit.primitive as f32),
    preview: colors::id,
};

/// The AOV of the material.
pub const MATERIAL: Declared = Declared {
    name: "material-id",
    channels: &["id"],
    kind: AovKind::First,
    needs: Needs::Hit,
    values: |context, first, _, values| values.push(context.scene.material_id(first.hit).0 as f32),
    preview: colors::id,
};
