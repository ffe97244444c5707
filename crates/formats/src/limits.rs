//! Limits against hostile files. Exceeding one is an error that names it.

/// Limits on sizes, counts and depths.
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
    /// Files that a scene may open; a file counts each time it is named.
    pub files: usize,
    /// Bytes of memory that the files of a scene may take together, whatever their size.
    pub memory_bytes: u64,
    /// Bytes of memory that the files of a scene may take in addition to `memory_bytes`, per byte
    /// on disk. A file that is named several times counts once.
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
