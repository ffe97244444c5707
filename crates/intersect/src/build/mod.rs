//! Builds the tree of one group in the requested quality.
//!
//! A build makes a binary tree (`fast`, `medium` or `high`), which consists of parts, each built by
//! one thread, and of inner nodes above them. Then `wide` counts the 8-wide nodes and blocks that
//! the tree needs, and all threads write them in place. The tree depends neither on the number of
//! threads nor on the SIMD level.

mod binary;
mod binning;
mod bins;
mod cache;
mod clip;
mod fast;
mod high;
mod medium;
mod outliers;
mod partition;
mod primitive;
mod quality;
mod refit;
mod waste;
mod wide;

#[cfg(test)]
mod tests;

pub use quality::Quality;

use crate::group::GroupList;
use crate::tree::node::{ChildRef, WideNode};
use crate::tree::storage::Storage;
use crate::tree::{Blocks, CacheUse, GroupTree};
use binning::Primitive;
use cache::{Cached, Entry};
use high::High;
use medium::Medium;
use primitive::{MAX_TRIANGLES, OBJECT, Triangles, triangle_primitives};
use rayon::prelude::*;
use snell_math::simd;
use snell_math::{Bounds3, Bounds3d};
use std::path::PathBuf;
use wide::{Wide, write};

/// Options of building trees.
#[derive(Clone, Debug)]
pub(crate) struct BvhOptions {
    pub quality: Quality,
    /// Whether blocks are compact: they take less memory, and tests take more time.
    pub compact: bool,
    /// SIMD instructions that the builder may use; the tree is the same at every level.
    pub wide: Option<simd::Wide>,
    /// The folder of cached trees; `None` disables the cache.
    pub cache: Option<PathBuf>,
}

impl GroupTree {
    /// Builds the tree of a group; `bounds` are the boxes of its objects in the group's
    /// coordinates.
    pub fn build(
        list: &GroupList,
        bounds: &[Bounds3d],
        options: &BvhOptions,
    ) -> Result<Self, String> {
        let boxes: Vec<Bounds3> = bounds.iter().map(Bounds3d::outward_f32).collect();
        build_group(list, &boxes, options)
    }
}

/// Builds the tree of one group. `boxes` are the boxes of its objects, in order.
fn build_group(
    list: &GroupList,
    boxes: &[Bounds3],
    options: &BvhOptions,
) -> Result<GroupTree, String> {
    let count: usize = list.meshes.iter().map(|(_, mesh)| mesh.indices.len()).sum();
    if count > MAX_TRIANGLES || list.objects.len() > ChildRef::MAX_NODES {
        return Err(format!(
            "a group holds {count} triangles and {} shapes and instances; the limits are \
                {MAX_TRIANGLES} and {}: spread them over several groups",
            list.objects.len(),
            ChildRef::MAX_NODES
        ));
    }
    let mut meshes = Vec::with_capacity(list.meshes.len());
    let mut first = 0;
    for (geometry, mesh) in &list.meshes {
        meshes.push((first, *geometry));
        first += mesh.indices.len() as u32;
    }
    let mut objects = Vec::new();
    let (mut unbounded, mut empty) = (Vec::new(), Vec::new());
    for (id, b) in boxes.iter().enumerate() {
        if b.is_finite() {
            objects.push(Primitive::new(b.min, b.max, id as u32 | OBJECT));
        } else if b.is_empty() {
            empty.push(id as u32);
        } else {
            unbounded.push(id as u32);
        }
    }
    let triangles = Triangles::new(list, &meshes);
    let build = || {
        let (wide, placed) = build_wide(list, &triangles, &objects, options)?;
        let wide = if options.compact { wide.compact(count)? } else { wide };
        let skipped = if placed < count { triangles.degenerate() } else { Vec::new() };
        Ok(Cached { wide, skipped })
    };
    let folder = options.cache.as_deref().filter(|_| count >= cache::LEAST_TRIANGLES);
    let (Cached { wide, skipped }, cache) = match folder {
        None => (build()?, CacheUse::None),
        Some(folder) => through_cache(
            &Entry::new(folder, list, boxes, options),
            count,
            list.objects.len(),
            build,
        )?,
    };
    let Wide { nodes, blocks, root, rest, depth } = wide;
    let objects = list.objects.clone();
    let (triangles, sah_cost) = (count, crate::build::sah_cost(&nodes));
    Ok(GroupTree {
        nodes,
        blocks,
        root,
        rest,
        objects,
        unbounded,
        meshes,
        depth,
        triangles,
        skipped,
        empty,
        cache,
        sah_cost,
    })
}

/// Returns the tree from the cache file, or builds a new one and writes it to the file.
fn through_cache(
    entry: &Entry,
    triangles: usize,
    objects: usize,
    build: impl FnOnce() -> Result<Cached, String>,
) -> Result<(Cached, CacheUse), String> {
    let damage = match entry.read(triangles, objects) {
        Ok(Some(cached)) => return Ok((cached, CacheUse::Read)),
        Ok(None) => None,
        Err(damage) => Some(damage),
    };
    let built = build()?;
    let path = entry.path.display();
    let usage = match (damage, entry.write(&built.wide, &built.skipped)) {
        (None, Ok(())) => CacheUse::Written,
        (None, Err(e)) => {
            CacheUse::Failed(format!("the structure could not be cached as {path}: {e}"))
        }
        (Some(damage), Ok(())) => CacheUse::Failed(format!(
            "the cached structure {path} was not used and is replaced: {damage}"
        )),
        (Some(damage), Err(e)) => CacheUse::Failed(format!(
            "the cached structure {path} was not used ({damage}) and could not be replaced: {e}"
        )),
    };
    Ok((built, usage))
}

/// Builds the 8-wide tree of a group. Also returns the number of triangles in it.
fn build_wide(
    list: &GroupList,
    triangles: &Triangles,
    objects: &[Primitive],
    options: &BvhOptions,
) -> Result<(Wide, usize), String> {
    let nothing = || {
        let none = ChildRef::NONE;
        Wide { nodes: Storage::unset(0), blocks: Blocks::none(), root: none, rest: none, depth: 0 }
    };
    if options.quality == Quality::Fast {
        let sorted = fast::sorted(triangles, objects);
        if sorted.count == 0 {
            return Ok((nothing(), 0));
        }
        let (tree, blocks) = fast::build(&sorted.keys[..sorted.count], triangles, objects);
        return Ok((write(&tree, triangles, Some(blocks))?, sorted.triangles));
    }
    let has_objects = !objects.is_empty();
    let most = triangles.count() + objects.len();
    let room = if options.quality == Quality::High { most / 3 + 64 } else { most / 4 + 64 };
    // Unused memory is never touched, and costs nothing.
    let (mut primitives, count) = triangle_primitives(triangles, objects.len() + room);
    let all = count + objects.len();
    primitives[count..all].copy_from_slice(objects);
    if all == 0 {
        return Ok((nothing(), 0));
    }
    let (rest, extent) = outliers::divide(&mut primitives[..all], list);
    let mut large = primitives[rest..all].to_vec();
    let splits =
        options.quality == Quality::High || waste::is_large(&primitives[..rest], triangles);
    let medium = Medium { wide: options.wide, has_objects };
    let tree = if splits {
        High::new(options.wide, has_objects, triangles).build(
            &mut primitives[..rest + room],
            rest,
            extent,
        )
    } else {
        medium.build_within(&mut primitives[..rest], &extent)
    };
    let tree = outliers::join(tree, &mut large, medium);
    Ok((write(&tree, triangles, None)?, count))
}

/// The expected number of nodes and blocks that a random line through the bounds of the first node,
/// which is the root, visits.
fn sah_cost(nodes: &[WideNode]) -> f32 {
    let Some(root) = nodes.first() else { return 0.0 };
    let whole = root.bounds().half_area();
    let area = |nodes: &[WideNode]| nodes.iter().map(WideNode::half_areas).sum::<f64>();
    let pieces: Vec<f64> = nodes.par_chunks(1 << 12).map(area).collect();
    (1.0 + pieces.iter().sum::<f64>() / f64::from(whole)) as f32
}
