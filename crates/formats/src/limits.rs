//! Caps for hostile files. Reached caps are errors that say so.

/// Caps on sizes, counts and depths.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Bytes of one file.
    pub file_bytes: u64,
    /// Vertices, triangles or other elements of one kind in a scene.
    pub elements: usize,
    /// Pixels of one image.
    pub image_pixels: u64,
    /// Depth of nodes, groups and includes.
    pub depth: usize,
    /// Number of included or referenced files.
    pub files: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { file_bytes: 16 << 30, elements: 500_000_000, image_pixels: 1 << 28, depth: 512, files: 10_000 }
    }
}
