//! Traversal kernels: ray-boxes and ray-triangles at each SIMD level.
