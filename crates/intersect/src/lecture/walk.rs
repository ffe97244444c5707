//! The structures of all groups, and the search of one ray in them: the recursion over instances
//! that all [`Accelerator`]s share.

use super::box_ray::BoxRay;
use super::mailbox::Mailbox;
use super::primitives::Primitives;
use super::{Accelerator, AcceleratorOptions, Build, Later, Size, Visitor, Work};
use crate::exact::TriangleTest;
use crate::exact::ray::LocalRay;
use crate::group::{GroupList, test_object, test_triangle};
use crate::precision::Facts;
use crate::precision::frame::Frames;
use crate::search::region::Region;
use crate::search::{Goal, Search};
use rayon::prelude::*;
use snell_math::{Bounds3, Bounds3d, DRay};
use std::cell::Cell;

/// The structures of all groups; group 0 is the root.
#[derive(Debug)]
pub(crate) struct Structures {
    groups: Vec<Group>,
    has_cache: bool,
}

/// A group with its structure.
#[derive(Debug)]
struct Group {
    list: GroupList,
    /// For each mesh the number of its first triangle.
    first: Vec<u32>,
    /// The number of triangles; shapes and instances are numbered from here on.
    triangles: u32,
    /// The numbers of unbounded primitives, which are always tested.
    unbounded: Vec<u32>,
    /// The box around the contents of the structure.
    bounds: Bounds3,
    structure: Box<dyn Accelerator>,
}

impl Structures {
    /// Builds the structures. `bounds` are the boxes of the objects of each group in the
    /// coordinates of the group.
    pub fn build(
        lists: Vec<GroupList>,
        bounds: &[Vec<Bounds3d>],
        build: Build,
        options: &AcceleratorOptions,
    ) -> Result<Self, String> {
        let group = |(list, bounds): (GroupList, &Vec<Bounds3d>)| {
            let boxes: Vec<Bounds3> = bounds.iter().map(Bounds3d::outward_f32).collect();
            let primitives = Primitives::new(&list, &boxes)?;
            let structure = build(&primitives, options);
            let Primitives { triangles, unbounded, bounds, .. } = primitives;
            let first = list.meshes.iter().scan(0, |next, (_, mesh)| {
                let first = *next;
                *next += mesh.indices.len() as u32;
                Some(first)
            });
            Ok(Group { first: first.collect(), triangles, unbounded, bounds, structure, list })
        };
        let groups: Result<_, String> = lists.into_par_iter().zip(bounds).map(group).collect();
        Ok(Self { groups: groups?, has_cache: options.last_hit_cache })
    }

    /// The contents of a group.
    pub fn list(&self, group: usize) -> &GroupList {
        &self.groups[group].list
    }

    /// Statistics of the build, over all groups.
    pub fn size(&self) -> Size {
        let add = |a: Size, b: Size| Size {
            nodes: a.nodes + b.nodes,
            references: a.references + b.references,
            depth: a.depth.max(b.depth),
            bytes: a.bytes + b.bytes,
        };
        self.groups.iter().map(|g| g.structure.size()).fold(Size::default(), add)
    }

    /// Memory for searches, taken from the thread's store. The last hits of earlier batches are
    /// forgotten.
    pub fn scratch(&self) -> Scratch {
        let mut scratch = SCRATCH.take().unwrap_or_default();
        scratch.last_hit.clear();
        if self.has_cache {
            scratch.last_hit.resize(self.groups.len(), NOTHING);
        }
        scratch
    }

    /// Searches for one ray, from the root.
    pub fn search<G: Goal<Precision: TriangleTest>>(
        &self,
        search: &mut Search<'_, G>,
        scratch: &mut Scratch,
    ) {
        scratch.mailbox.clear();
        self.search_group(0, &G::Precision::exact(search.ray), 0, search, scratch);
    }

    /// Searches a group and all groups below it. Returns true if the search is over.
    fn search_group<G: Goal<Precision: TriangleTest>>(
        &self,
        index: usize,
        ray: &DRay,
        instance: u32,
        search: &mut Search<'_, G>,
        scratch: &mut Scratch,
    ) -> bool {
        let group = &self.groups[index];
        let cached = scratch.last_hit.get(index).copied().unwrap_or(NOTHING);
        let data = search.context.data;
        let thick = BoxRay::new(
            &G::Precision::ray_in_structure(data, index, ray),
            &group.bounds,
            search.start,
        );
        let walk = if group.structure.repeats() { scratch.mailbox.begin() } else { 0 };
        let local = G::Precision::local_ray(data, index, ray);
        let mut visitor = GroupVisitor {
            structures: self,
            index,
            group,
            local,
            instance,
            walk,
            cached,
            search,
            scratch,
        };
        (cached != NOTHING && visitor.test_one(cached))
            || visitor.test(&group.unbounded)
            || group.structure.walk(&thick, &mut visitor)
    }
}

/// A number that no primitive has.
const NOTHING: u32 = u32::MAX;

thread_local! {
    /// The memory for searches of this thread; `None` during a search.
    static SCRATCH: Cell<Option<Scratch>> = const { Cell::new(None) };
}

/// The memory of a search, reused by the next search.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    mailbox: Mailbox,
    stacks: Vec<Vec<Later>>,
    /// For each group the primitive that was hit last; empty if the cache is off.
    last_hit: Vec<u32>,
}

impl Scratch {
    /// Returns the memory to the thread's store.
    pub fn keep(self) {
        SCRATCH.set(Some(self));
    }
}

/// Tests the primitives of one occurrence of a group.
struct GroupVisitor<'a, 's, G: Goal<Precision: TriangleTest>> {
    structures: &'a Structures,
    index: usize,
    group: &'a Group,
    local: LocalRay,
    instance: u32,
    /// The number of the traversal if primitives may be visited more than once, otherwise 0.
    walk: u32,
    /// The primitive that is tested before all others.
    cached: u32,
    search: &'a mut Search<'s, G>,
    scratch: &'a mut Scratch,
}

impl<G: Goal<Precision: TriangleTest>> GroupVisitor<'_, '_, G> {
    /// True if the traversal visits the primitive for the first time.
    #[inline(always)]
    fn is_new(&mut self, primitive: u32) -> bool {
        primitive != self.cached
            && (self.walk == 0 || self.scratch.mailbox.insert(self.walk, primitive))
    }

    /// Tests a primitive. Returns true if the search is over.
    #[inline(always)]
    fn test_one(&mut self, primitive: u32) -> bool {
        let before = self.search.goal.limit();
        let finished = if primitive < self.group.triangles {
            self.search.goal.count_primitives(1);
            let mesh = match self.group.first.as_slice() {
                [_] => 0,
                all => all.partition_point(|&first| first <= primitive) - 1,
            };
            let triangle = primitive - self.group.first[mesh];
            let (geometry, mesh) = &self.group.list.meshes[mesh];
            // A triangle that can never be hit is in no list, but may be in a range.
            let corners = mesh.corners(triangle as usize).map(|p| p.to_array());
            test_triangle(self.search, &self.local, &corners, || {
                [self.instance, *geometry, triangle]
            })
        } else {
            self.test_object((primitive - self.group.triangles) as usize)
        };
        if (finished || self.search.goal.limit() < before) && !self.scratch.last_hit.is_empty() {
            self.scratch.last_hit[self.index] = primitive;
        }
        finished
    }

    #[inline(never)]
    fn test_object(&mut self, object: usize) -> bool {
        let Self { structures, group, local, instance, scratch, search, .. } = self;
        test_object(
            &group.list.objects,
            object,
            &local.exact,
            *instance,
            search,
            |child, ray, instance, search| {
                structures.search_group(child, ray, instance, search, scratch)
            },
        )
    }
}

impl<G: Goal<Precision: TriangleTest>> Visitor for GroupVisitor<'_, '_, G> {
    #[inline]
    fn cull(&self) -> f64 {
        // The second term is for distances so small that rounding them to `f32` changes them by
        // more than the relative padding.
        f64::from(self.search.cull()) + 4.0 * f64::from(f32::from_bits(1))
    }

    fn test(&mut self, primitives: &[u32]) -> bool {
        primitives.iter().any(|&p| self.is_new(p) && self.test_one(p))
    }

    fn test_range(&mut self, first: u32, end: u32) -> bool {
        (first..end).any(|p| self.is_new(p) && self.test_one(p))
    }

    fn records(&self) -> bool {
        G::RECORDS
    }

    fn visit(&mut self, is_leaf: bool, region: Region) {
        self.search.goal.visit(is_leaf, || region);
    }

    fn count(&mut self, work: Work) {
        self.search.goal.count_visits(work.nodes, work.cells);
    }

    fn take_stack(&mut self) -> Vec<Later> {
        self.scratch.stacks.pop().unwrap_or_default()
    }

    fn give_stack(&mut self, mut stack: Vec<Later>) {
        stack.clear();
        self.scratch.stacks.push(stack);
    }
}
