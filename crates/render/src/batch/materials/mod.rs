//! Surfaces: one shader for each way in which many materials can be shaded together.

pub mod bsdf_batch;
pub mod classic_matte;
pub mod general;
pub mod guided;
pub mod matte;
pub mod matte_surfaces;
pub mod specular;
