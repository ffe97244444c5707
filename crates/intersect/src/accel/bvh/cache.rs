//! Trees in files: a tree that was built once is mapped into memory the next time, and a scene of a hundred million triangles starts
//! at once.
//!
//! A file is named by a hash of all that the tree follows from, so there is nothing to keep up to date; delete files to be rid of them. It
//! holds a page of header (with a hash of itself), the nodes, the blocks, and the triangles left out, each from a new page on, as they are in memory.
//! It is written under another name and renamed when it is complete. What is read is checked: the header, the sizes, and that every
//! reference leads to something, so that a damaged file can give wrong hits at worst.

use super::BvhOptions;
use super::blocks::Blocks;
use super::primitive::MAX_TRIANGLES;
use super::storage::Storage;
use super::wide::Wide;
use crate::accel::brute_force::GroupList;
use crate::kernel::compact::Line;
use crate::kernel::node::{ChildRef, WideNode};
use crate::kernel::triangle::TriangleBlock;
use crate::mesh::TriangleMesh;
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use snell_math::Bounds3;
use std::fs::File;
use std::io::{Error, ErrorKind, Read, Result, Write};
use std::path::{Path, PathBuf};

/// Goes up whenever a builder or the layout of nodes and blocks changes.
const VERSION: u64 = 3;

const MAGIC: u64 = u64::from_le_bytes(*b"SnellBVH");
const PAGE: usize = 4096;

/// Of a block, and of a line of compact ones.
const BLOCK_BYTES: [u64; 2] = [size_of::<TriangleBlock>() as u64, size_of::<Line>() as u64];

/// Groups with fewer triangles are built faster than they are found.
pub(super) const LEAST_TRIANGLES: usize = 1 << 16;

/// A tree, and the triangles that are not in it.
pub(super) struct Cached {
    pub wide: Wide,
    pub skipped: Vec<u32>,
}

/// The file of a group's tree.
pub(super) fn path(folder: &Path, list: &GroupList, boxes: &[Bounds3], options: &BvhOptions) -> PathBuf {
    let mut hash = Sha256::new();
    hash.update(VERSION.to_le_bytes());
    hash.update(options.quality.name());
    hash.update([u8::from(options.compact)]);
    for (_, mesh) in &list.meshes {
        hash.update(mesh_hash(mesh));
    }
    for b in boxes {
        for x in b.min.to_array().into_iter().chain(b.max.to_array()) {
            hash.update(x.to_bits().to_le_bytes());
        }
    }
    let name: String = hash.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect();
    folder.join(format!("{name}.bvh"))
}

/// A hash of the triangles of a mesh, on all threads.
fn mesh_hash(mesh: &TriangleMesh) -> [u8; 32] {
    const CHUNK: usize = 1 << 14;
    fn numbers<T: Sync>(items: &[T], bits: impl Fn(&T) -> [u32; 3] + Sync) -> Vec<[u8; 32]> {
        let hash = |items: &[T]| {
            let bytes: Vec<u8> = items.iter().flat_map(&bits).flat_map(u32::to_le_bytes).collect();
            Sha256::digest(bytes).into()
        };
        items.par_chunks(CHUNK).map(hash).collect()
    }
    let mut hash = Sha256::new();
    hash.update((mesh.positions.len() as u64).to_le_bytes());
    hash.update((mesh.indices.len() as u64).to_le_bytes());
    let positions = numbers(&mesh.positions, |p| p.to_array().map(f32::to_bits));
    let indices = numbers(&mesh.indices, |t| *t);
    positions.iter().chain(&indices).for_each(|h| hash.update(h));
    hash.finalize().into()
}

/// The numbers at the start of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Header {
    nodes: u64,
    blocks: u64,
    /// Bytes of each: of a block, or of a line of compact ones.
    block_bytes: u64,
    skipped: u64,
    root: u64,
    rest: u64,
    depth: u64,
}

impl Header {
    /// A page. `u64` in the order of the machine: a file from another one does not pass.
    fn to_page(self) -> Vec<u8> {
        let Self { nodes, blocks, block_bytes, skipped, root, rest, depth } = self;
        let numbers = [MAGIC, VERSION, nodes, blocks, block_bytes, skipped, root, rest, depth];
        let mut page: Vec<u8> = numbers.into_iter().flat_map(u64::to_ne_bytes).collect();
        page.extend(Sha256::digest(&page));
        page.resize(PAGE, 0);
        page
    }

    fn from_page(page: &[u8]) -> Option<Self> {
        let number = |i: usize| Some(u64::from_ne_bytes(page.get(8 * i..8 * i + 8)?.try_into().ok()?));
        let header = Self {
            nodes: number(2)?,
            blocks: number(3)?,
            block_bytes: number(4)?,
            skipped: number(5)?,
            root: number(6)?,
            rest: number(7)?,
            depth: number(8)?,
        };
        (header.to_page() == page).then_some(header)
    }

    /// Where nodes, blocks and skipped triangles start, and where the file ends; `None` for absurd sizes.
    fn places(&self) -> Option<[u64; 4]> {
        let most = MAX_TRIANGLES as u64;
        if self.nodes > most || self.blocks > most || self.skipped > most || !BLOCK_BYTES.contains(&self.block_bytes) {
            return None;
        }
        let page = PAGE as u64;
        let nodes = page;
        let blocks = nodes + (self.nodes * size_of::<WideNode>() as u64).next_multiple_of(page);
        let skipped = blocks + (self.blocks * self.block_bytes).next_multiple_of(page);
        Some([nodes, blocks, skipped, skipped + self.skipped * 4])
    }
}

/// Writes a tree, so that others see all of it or nothing.
pub(super) fn write(path: &Path, wide: &Wide, skipped: &[u32]) -> Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let temporary = path.with_extension(format!("{}.tmp", std::process::id()));
    let written = write_all(&temporary, wide, skipped).and_then(|()| std::fs::rename(&temporary, path));
    if written.is_err() {
        // It may not even exist.
        let _ = std::fs::remove_file(&temporary);
    }
    written
}

fn write_all(path: &Path, wide: &Wide, skipped: &[u32]) -> Result<()> {
    let mut file = File::create(path)?;
    let block_bytes = BLOCK_BYTES[usize::from(wide.blocks.is_compact())];
    let header = Header {
        nodes: wide.nodes.len() as u64,
        blocks: wide.blocks.memory_bytes() as u64 / block_bytes,
        block_bytes,
        skipped: skipped.len() as u64,
        root: wide.root.0.into(),
        rest: wide.rest.0.into(),
        depth: wide.depth as u64,
    };
    file.write_all(&header.to_page())?;
    for bytes in [wide.nodes.bytes(), wide.blocks.bytes()] {
        file.write_all(bytes)?;
        file.write_all(&vec![0; bytes.len().next_multiple_of(PAGE) - bytes.len()])?;
    }
    let skipped: Vec<u8> = skipped.iter().flat_map(|id| id.to_ne_bytes()).collect();
    file.write_all(&skipped)?;
    file.sync_data()
}

/// Maps a tree; `None` if there is no such file.
pub(super) fn read(path: &Path, triangles: usize, objects: usize) -> Result<Option<Cached>> {
    if std::fs::metadata(path).is_ok_and(|known| !known.is_file()) {
        return Err(Error::new(ErrorKind::InvalidData, "it is a pipe, a device or a folder, and not a file"));
    }
    let mut file = match File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(e),
    };
    let damaged = |what: &str| Error::new(ErrorKind::InvalidData, what.to_string());
    let mut page = vec![0; PAGE];
    file.read_exact(&mut page)?;
    let header = Header::from_page(&page).ok_or_else(|| damaged("its header is damaged"))?;
    let [nodes_at, blocks_at, skipped_at, end] = header.places().ok_or_else(|| damaged("its sizes are absurd"))?;
    if file.metadata()?.len() != end {
        return Err(damaged("it is not as long as it should be"));
    }
    let nodes = Storage::<WideNode>::mapped(&file, nodes_at, header.nodes as usize)?;
    let (count, is_compact) = (header.blocks as usize, header.block_bytes == BLOCK_BYTES[1]);
    let blocks = if is_compact {
        Blocks::checked(Storage::mapped(&file, blocks_at, count)?, triangles)
            .ok_or_else(|| damaged("a block is damaged"))?
    } else {
        Blocks::Plain(Storage::mapped(&file, blocks_at, count)?)
    };
    let mut skipped = Vec::new();
    std::io::Seek::seek(&mut file, std::io::SeekFrom::Start(skipped_at))?;
    file.read_to_end(&mut skipped)?;
    let skipped: Vec<u32> = skipped.chunks_exact(4).map(|b| u32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect();
    let (root, rest) = (ChildRef(header.root as u32), ChildRef(header.rest as u32));
    let wide = Wide { nodes, blocks, root, rest, depth: header.depth as usize };
    let is_sound = is_sound(&wide, triangles, objects) && skipped.iter().all(|&id| (id as usize) < triangles);
    if is_sound { Ok(Some(Cached { wide, skipped })) } else { Err(damaged("a reference leads nowhere")) }
}

/// True if a group of so many triangles has those of a block.
pub(super) fn ids_exist(ids: &[u32; 8], triangles: usize) -> bool {
    ids.iter().all(|&id| id == u32::MAX || (id as usize) < triangles)
}

/// True if every reference leads to something, children come after their parents, and no way down is longer than the depth says.
fn is_sound(wide: &Wide, triangles: usize, objects: usize) -> bool {
    let leads_on = |child: ChildRef, from: usize| {
        if child == ChildRef::NONE {
            true
        } else if child.is_node() {
            child.index() >= from && child.index() < wide.nodes.len()
        } else if child.is_triangles() {
            child.block() < wide.blocks.end()
                && wide.blocks.ids(child.block())[..child.count() as usize].iter().all(|&id| (id as usize) < triangles)
        } else {
            child.0 >> 30 == 2 && child.index() < objects
        }
    };
    let ids_exist = match &wide.blocks {
        Blocks::Plain(blocks) => blocks.par_iter().all(|block| ids_exist(&block.ids, triangles)),
        // They have been looked at.
        Blocks::Compact(..) => true,
    };
    let is_first = |node: &WideNode| node.children[0] == wide.rest;
    let rest_is_known =
        wide.rest == wide.root || wide.root == ChildRef::node(0) && wide.nodes.first().is_some_and(is_first);
    if !rest_is_known
        || !leads_on(wide.root, 0)
        || !wide.nodes.par_iter().enumerate().all(|(i, node)| node.children.iter().all(|&c| leads_on(c, i + 1)))
        || !ids_exist
    {
        return false;
    }
    let mut depths = vec![1usize; wide.nodes.len()];
    for (i, node) in wide.nodes.iter().enumerate() {
        if depths[i] > wide.depth {
            return false;
        }
        for child in node.children.iter().filter(|c| c.is_node()) {
            depths[child.index()] = depths[child.index()].max(depths[i] + 1);
        }
    }
    true
}
