//! AOVs of the cost of tracing the camera ray.

use super::colors;
use super::{AovKind, Declared, Needs};

/// The AOV of the number of nodes visited.
pub const NODES_VISITED: Declared = Declared {
    name: "nodes-visited",
    channels: &["V"],
    kind: AovKind::Averaged,
    needs: Needs::Counters,
    values: |_, first, _, values| values.push(first.counters[0] as f32),
    preview: |values, _| colors::count(values, 8.0),
};

/// The AOV of the number of triangles and shapes tested.
pub const PRIMITIVES_TESTED: Declared = Declared {
    name: "primitives-tested",
    channels: &["V"],
    kind: AovKind::Averaged,
    needs: Needs::Counters,
    values: |_, first, _, values| values.push(first.counters[1] as f32),
    preview: |values, _| colors::count(values, 8.0),
};
