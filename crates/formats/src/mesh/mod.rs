//! Mesh files: each becomes a scene with one node.
