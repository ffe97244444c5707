//! AOVs that the film computes, and that have no values of samples.

use super::colors;
use super::{AovKind, Declared, Needs};

/// The AOV of the pixel's error.
pub const NOISE: Declared = Declared {
    name: "noise",
    channels: &["V"],
    kind: AovKind::OfFilm,
    needs: Needs::Nothing,
    values: |_, _, _, _| {},
    preview: |values, _| colors::heat((colors::value(values, 0) * 10.0).clamp(0.0, 1.0)),
};

/// The AOV of the pixel's number of samples.
pub const SAMPLES: Declared = Declared {
    name: "samples",
    channels: &["V"],
    kind: AovKind::OfFilm,
    needs: Needs::Nothing,
    values: |_, _, _, _| {},
    preview: |values, _| colors::count(values, 14.0),
};
