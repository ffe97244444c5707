//! Tests that need several crates, as one program: it is linked once, and its tests run in
//! parallel. `cargo test -p snell-tests golden::` runs the tests of one file.

#![expect(clippy::disallowed_methods, reason = "tests need no certain bits")]

mod agreement;
mod batches;
mod caustics;
mod chi_squared;
mod closed_form;
mod conversion;
mod degenerate;
mod determinism;
mod exactness;
mod file_meaning;
mod golden;
mod guiding;
mod layers;
mod lights;
mod minray;
mod mitsuba;
mod noise;
mod pbrt_references;
mod physics;
mod references;
mod scales;
mod shading_normals;
mod small_scenes;
mod spectral;
mod structures;
