//! The header of a cache file, which fills its first page.

use crate::build::primitive::MAX_TRIANGLES;
use crate::tree::block::TriangleBlock;
use crate::tree::compact::Line;
use crate::tree::node::WideNode;
use sha2::{Digest, Sha256};

/// The version of the format. It increases whenever a builder, the layout of nodes and blocks, or
/// the layout of the file changes.
pub const VERSION: u64 = 4;

const MAGIC: u64 = u64::from_le_bytes(*b"SnellBVH");

/// Bytes of the header.
pub const PAGE: usize = 4096;

/// Bytes of a plain block, and of a line of compact blocks.
pub const BLOCK_BYTES: [u64; 2] = [size_of::<TriangleBlock>() as u64, size_of::<Line>() as u64];

/// The header of a cache file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// The hash of everything that determines the tree.
    pub key: [u8; 32],
    pub nodes: u64,
    pub blocks: u64,
    /// Bytes of a block, or of a line of compact blocks.
    pub block_bytes: u64,
    pub skipped: u64,
    pub root: u64,
    pub rest: u64,
    pub depth: u64,
    /// The checksum of everything after the header (`body`).
    pub checksum: u64,
}

impl Header {
    /// The header as bytes: numbers, key, a hash of both, and zeros. Numbers have the byte order of
    /// the machine, so a file from a machine with another byte order is rejected.
    pub fn to_page(self) -> Vec<u8> {
        let Self { key, nodes, blocks, block_bytes, skipped, root, rest, depth, checksum } = self;
        let numbers =
            [MAGIC, VERSION, nodes, blocks, block_bytes, skipped, root, rest, depth, checksum];
        let mut page: Vec<u8> = numbers.into_iter().flat_map(u64::to_ne_bytes).chain(key).collect();
        page.extend(Sha256::digest(&page));
        page.resize(PAGE, 0);
        page
    }

    /// Returns an error that describes what is wrong with the page.
    pub fn from_page(page: &[u8; PAGE]) -> Result<Self, &'static str> {
        let (words, _) = page.as_chunks::<8>();
        let number = |i: usize| u64::from_ne_bytes(words[i]);
        let mut key = [0; 32];
        key.copy_from_slice(words[10..14].as_flattened());
        let header = Self {
            key,
            nodes: number(2),
            blocks: number(3),
            block_bytes: number(4),
            skipped: number(5),
            root: number(6),
            rest: number(7),
            depth: number(8),
            checksum: number(9),
        };
        if header.to_page() != page {
            return Err("its header is damaged, or of another version");
        }
        let most = MAX_TRIANGLES as u64;
        let is_absurd = header.nodes > most || header.blocks > most || header.skipped > most;
        if is_absurd || !BLOCK_BYTES.contains(&header.block_bytes) {
            return Err("its sizes are absurd");
        }
        Ok(header)
    }

    pub fn is_compact(&self) -> bool {
        self.block_bytes == BLOCK_BYTES[1]
    }

    /// The length of the file in bytes.
    pub fn file_bytes(&self) -> u64 {
        PAGE as u64
            + self.nodes * size_of::<WideNode>() as u64
            + self.blocks * self.block_bytes
            + self.skipped * 4
    }
}
