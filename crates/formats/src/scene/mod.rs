//! Scene files.

pub mod gltf;
pub mod minray;
pub mod nff;
pub mod scn;
mod shapes;
#[cfg(test)]
mod testing;
mod tokens;
