//! Reuse of the previous world in a build: everything whose contents did not change is shared.

use super::cover::Cover;
use super::occurrence::Occurrences;
use super::{
    AcceleratorKind, BuildOptions, Geometry, GroupBounds, Parts, Structure, World, WorldBuilder,
    WorldError, cover,
};
use crate::build::BvhOptions;
use crate::group::GroupList;
use crate::lecture::walk::Structures;
use crate::mesh::TriangleMesh;
use crate::tree::{Forest, GroupTree};
use rayon::prelude::*;
use snell_math::Bounds3d;
use std::sync::Arc;

/// Groups with fewer triangles are always rebuilt, because that is as fast as refitting.
const WORTH_REFITTING: u64 = 1024;

/// A tree is rebuilt when refitting has increased its traversal cost by this factor since the last
/// build.
const WORN: f32 = 1.3;

/// Facts about a world's contents that builds need and queries do not.
#[derive(Debug)]
pub(super) struct Inventory {
    accelerator: AcceleratorKind,
    quality: crate::build::Quality,
    compact: bool,
    /// A summary of each geometry.
    pub summaries: Vec<Summary>,
    /// The exact bounds of each group; see [`GroupBounds`].
    pub exact: Vec<Bounds3d>,
    grown: Vec<Bounds3d>,
    covers: Vec<Cover>,
    /// The cost of each group's tree when the tree was last built.
    costs: Vec<f32>,
    /// Statistics of reuse for this world.
    pub reuse: Reuse,
}

/// The number of groups whose structures were shared, refitted or built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reuse {
    /// Structures shared with the previous world.
    pub kept: usize,
    /// Structures of the previous world, refitted.
    pub refitted: usize,
    /// Structures built from scratch.
    pub built: usize,
}

/// Facts about a geometry that take time to compute.
#[derive(Clone, Debug)]
pub(super) struct Summary {
    /// Bounds in the geometry's own coordinates; empty for a set and for a mesh that moves.
    pub bounds: Bounds3d,
    /// The number of triangles or primitives.
    pub count: u64,
    /// The number of degenerate triangles or primitives among `count`.
    pub skipped: u64,
    /// The cover of a mesh that is instanced; `None` if it was not requested.
    pub cover: Option<Cover>,
}

impl Summary {
    pub fn of(geometry: &Geometry) -> Self {
        match geometry {
            Geometry::Mesh(mesh) => Self::of_mesh(mesh),
            Geometry::Quads(quads) => Self::of_mesh(quads.triangles()),
            Geometry::MovingMesh(mesh) => Self {
                bounds: Bounds3d::EMPTY,
                count: mesh.len() as u64,
                skipped: (0..mesh.len())
                    .into_par_iter()
                    .filter(|&i| mesh.bounds(i).is_none())
                    .count() as u64,
                cover: None,
            },
            Geometry::Heightfield(field) => Self {
                bounds: Bounds3d::EMPTY,
                count: field.triangle_count() as u64,
                skipped: 0,
                cover: None,
            },
            Geometry::Shape(shape, _) => {
                Self { bounds: shape.bounds(), count: 1, skipped: 0, cover: None }
            }
            Geometry::Set(set) => Self {
                bounds: Bounds3d::EMPTY,
                count: set.len() as u64,
                skipped: (0..set.len())
                    .into_par_iter()
                    .filter(|&i| set.bounds(i).is_empty())
                    .count() as u64,
                cover: None,
            },
        }
    }

    fn of_mesh(mesh: &TriangleMesh) -> Self {
        let (bounds, degenerate) = mesh.survey();
        Self {
            bounds: bounds.into(),
            count: mesh.indices.len() as u64,
            skipped: degenerate as u64,
            cover: None,
        }
    }

    /// Adds the cover of the geometry, if it is a mesh.
    fn with_cover(mut self, geometry: &Geometry) -> Self {
        let mesh = match geometry {
            Geometry::Mesh(mesh) => mesh,
            Geometry::Quads(quads) => quads.triangles(),
            Geometry::Shape(..)
            | Geometry::Set(_)
            | Geometry::MovingMesh(_)
            | Geometry::Heightfield(_) => return self,
        };
        self.cover.get_or_insert_with(|| cover::of_mesh(mesh));
        self
    }
}

/// True if both are the same geometry, compared by address.
fn is_same(a: &Geometry, b: &Geometry) -> bool {
    match (a, b) {
        (Geometry::Mesh(a), Geometry::Mesh(b)) => Arc::ptr_eq(a, b),
        (Geometry::Shape(a, at), Geometry::Shape(b, bt)) => Arc::ptr_eq(a, b) && at == bt,
        (Geometry::Quads(a), Geometry::Quads(b)) => Arc::ptr_eq(a, b),
        (Geometry::MovingMesh(a), Geometry::MovingMesh(b)) => Arc::ptr_eq(a, b),
        (Geometry::Set(a), Geometry::Set(b)) => Arc::ptr_eq(a, b),
        (Geometry::Heightfield(a), Geometry::Heightfield(b)) => Arc::ptr_eq(a, b),
        _ => false,
    }
}

impl WorldBuilder {
    /// Returns a summary of each geometry.
    pub(super) fn summaries(&self, previous: Option<&World>) -> Vec<Summary> {
        let mut is_shown = vec![false; self.geometries.len()];
        for instance in self.groups.iter().flat_map(|group| &group.instances) {
            for id in &self.groups[instance.child.0 as usize].geometries {
                is_shown[id.0 as usize] = true;
            }
        }
        let summary = |(i, geometry): (usize, &Geometry)| {
            let known = previous
                .and_then(|p| p.geometries.get(i).filter(|old| is_same(old, geometry)).map(|_| p));
            let summary =
                known.map_or_else(|| Summary::of(geometry), |p| p.inventory.summaries[i].clone());
            if is_shown[i] { summary.with_cover(geometry) } else { summary }
        };
        self.geometries.par_iter().enumerate().with_min_len(16).map(summary).collect()
    }

    /// True if the contents of a group, their placement and their numbers are the same as in the
    /// previous world.
    fn is_unchanged(
        &self,
        group: usize,
        occurrences: &Occurrences,
        bounds: &GroupBounds,
        previous: &World,
    ) -> bool {
        let (new, Some(old)) = (&self.groups[group], previous.groups.get(group)) else {
            return false;
        };
        let same_boxes = |child: usize| {
            let inventory = &previous.inventory;
            bounds.exact[child] == inventory.exact[child]
                && bounds.grown[child] == inventory.grown[child]
                && bounds.covers[child] == inventory.covers[child]
        };
        new.geometries == old.geometries
            && new.geometries.iter().all(|g| {
                is_same(&self.geometries[g.0 as usize], &previous.geometries[g.0 as usize])
            })
            && new.instances.len() == old.instances.len()
            && occurrences.offsets[group] == previous.occurrences.offsets[group]
            && new.instances.iter().zip(&old.instances).all(|(a, b)| {
                a.child == b.child
                    && a.group_from_child == b.group_from_child
                    && a.mask == b.mask
                    && a.later == b.later
                    && a.times == b.times
                    && same_boxes(a.child.0 as usize)
            })
    }

    /// The previous world if it was built with the same options, so that its trees can be reused.
    pub(super) fn same_build<'a>(
        options: &BuildOptions,
        previous: Option<&'a World>,
    ) -> Option<&'a World> {
        previous.filter(|p| {
            let inventory = &p.inventory;
            options.accelerator == AcceleratorKind::Bvh
                && inventory.accelerator == options.accelerator
                && inventory.quality == options.quality
                && inventory.compact == options.compact
        })
    }

    /// The bounds of all groups, and for each group whether it is unchanged.
    pub(super) fn measure(
        &self,
        occurrences: &Occurrences,
        summaries: &[Summary],
        same_build: Option<&World>,
    ) -> (GroupBounds, Vec<bool>) {
        let n = self.groups.len();
        let mut bounds = GroupBounds::empty(n);
        let mut unchanged = vec![false; n];
        for &group in &occurrences.order {
            match same_build.filter(|p| self.is_unchanged(group, occurrences, &bounds, p)) {
                Some(p) => {
                    unchanged[group] = true;
                    bounds.exact[group] = p.inventory.exact[group];
                    bounds.grown[group] = p.inventory.grown[group];
                    bounds.covers[group] = p.inventory.covers[group].clone();
                }
                None => bounds.measure(self, summaries, group),
            }
        }
        (bounds, unchanged)
    }

    /// Builds or reuses the structures of all groups. The boxes of objects are in the coordinates
    /// of the structures.
    pub(super) fn structures(
        &self,
        options: &BuildOptions,
        occurrences: &Occurrences,
        summaries: Vec<Summary>,
        (bounds, unchanged): (GroupBounds, Vec<bool>),
        same_build: Option<&World>,
    ) -> Result<Parts, WorldError> {
        let lists = self.group_lists(occurrences)?;
        let n = self.groups.len();
        let wide = options.simd.wide();
        let bvh = BvhOptions {
            quality: options.quality,
            compact: options.compact,
            wide,
            cache: options.cache.clone(),
        };
        let mut inventory = Inventory {
            accelerator: options.accelerator,
            quality: options.quality,
            compact: options.compact,
            summaries,
            exact: bounds.exact,
            grown: bounds.grown,
            covers: bounds.covers,
            costs: Vec::new(),
            reuse: Reuse::default(),
        };
        let structure = match (options.accelerator.build(), options.accelerator) {
            (Some(build), _) => {
                inventory.reuse.built = n;
                let built =
                    Structures::build(lists, &bounds.objects, build, &options.accelerator_options);
                Structure::Walked(built.map_err(WorldError::Limit)?)
            }
            (None, AcceleratorKind::None) => {
                inventory.reuse.built = n;
                Structure::None(lists)
            }
            (None, _) => {
                let old = same_build.and_then(|p| match &p.structure {
                    Structure::Bvh(forest) => Some((forest, &p.inventory)),
                    Structure::None(_) | Structure::Walked(_) => None,
                });
                let grown = (0..n).into_par_iter().map(|group| {
                    let old = old.filter(|(forest, _)| group < forest.trees.len());
                    let old = old
                        .map(|(forest, inventory)| (&forest.trees[group], inventory.costs[group]));
                    tree(&lists[group], &bounds.objects[group], &bvh, old, unchanged[group])
                });
                let grown: Vec<Grown> =
                    grown.collect::<Result<_, _>>().map_err(WorldError::Limit)?;
                for grown in &grown {
                    let count = match grown.how {
                        How::Kept => &mut inventory.reuse.kept,
                        How::Refitted => &mut inventory.reuse.refitted,
                        How::Built => &mut inventory.reuse.built,
                    };
                    *count += 1;
                    inventory.costs.push(grown.cost);
                }
                Structure::Bvh(Forest::of(
                    grown.into_iter().map(|g| g.tree).collect(),
                    &occurrences.order,
                ))
            }
        };
        let stats = self.count_triangles(occurrences, &structure, &inventory);
        Ok(Parts { bounds: inventory.exact[0], structure, inventory, wide, stats })
    }
}

enum How {
    Kept,
    Refitted,
    Built,
}

struct Grown {
    tree: Arc<GroupTree>,
    /// The cost of the tree when it was last built.
    cost: f32,
    how: How,
}

/// The tree of a group: the old tree if the group is unchanged, otherwise a refitted one where that
/// is worthwhile, otherwise a new one.
fn tree(
    list: &GroupList,
    boxes: &[Bounds3d],
    options: &BvhOptions,
    old: Option<(&Arc<GroupTree>, f32)>,
    unchanged: bool,
) -> Result<Grown, String> {
    if let Some((tree, cost)) = old {
        if unchanged {
            return Ok(Grown { tree: tree.clone(), cost, how: How::Kept });
        }
        let triangles: u64 = list.meshes.iter().map(|(_, mesh)| mesh.indices.len() as u64).sum();
        let refitted = if triangles < WORTH_REFITTING { None } else { tree.refit(list, boxes) };
        if let Some(tree) = refitted.filter(|tree| tree.sah_cost <= WORN * cost) {
            return Ok(Grown { tree: Arc::new(tree), cost, how: How::Refitted });
        }
    }
    let tree = GroupTree::build(list, boxes, options)?;
    Ok(Grown { cost: tree.sah_cost, tree: Arc::new(tree), how: How::Built })
}
