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
    /// Files that a scene may open, each counted as often as it is named.
    pub files: usize,
    /// Bytes of memory that all files of a scene may stand for, whatever their size.
    pub memory_bytes: u64,
    /// Bytes of memory that they may stand for beyond that, for each byte of theirs. A file that is
    /// named several times counts once.
    pub expansion: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 16 << 30,
            elements: 500_000_000,
            image_pixels: 1 << 28,
            depth: 512,
            files: 10_000,
            memory_bytes: 1 << 30,
            expansion: 256,
        }
    }
}
