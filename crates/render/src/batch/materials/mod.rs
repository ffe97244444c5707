//! Shaders of surfaces, one for each way in which vertices on many materials can be shaded
//! together.

pub mod bsdf_batch;
pub mod classic_matte;
pub mod general;
pub mod guided;
pub mod matte;
pub mod matte_surfaces;
pub mod specular;
