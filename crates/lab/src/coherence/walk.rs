//! Traverses the tree with a window of rays: nearest boxes first, reporting all triangles in the
//! window.

use super::CoherenceError;
use super::fragments::{Fragment, Fragments, Source};
use super::polygon::ConvexPolygon;
use super::view::{Facet, Rows, View, Window};
use snell_intersect::world::tree_view::{TreeChild, TreeNode, TreeView};
use snell_intersect::{AcceptAll, Geometry, GeometryId, GroupId, Hit, World};
use snell_math::{Bounds3, DAffine3, DRay, DVec3, DVec4, Ray};
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

/// The cost of tracing regions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RegionWork {
    /// Number of regions, including those that had to be divided.
    pub regions: u64,
    /// Nodes of the tree whose eight boxes were tested.
    pub nodes: u64,
    /// Triangles projected.
    pub triangles: u64,
    /// Rays that were traced one by one instead.
    pub rays: u64,
    /// Rays that were tested only with the triangle that is known to be visible at their place.
    pub confirmed: u64,
}

/// An occurrence of a group in a walk.
#[derive(Clone, Debug)]
struct Frame {
    group: usize,
    instance: u32,
    /// The enclosing frame, and the transform from it; `None` for the root.
    outer: Option<(u32, DAffine3)>,
    world_from_group: DAffine3,
    is_root: bool,
    /// The largest absolute coordinates in the group.
    extent: DVec3,
}

/// A part of the tree that is still to be visited.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    bounds: Bounds3,
    child: TreeChild,
    frame: u32,
}

/// An entry in traversal order.
#[derive(Clone, Copy, Debug)]
struct Next {
    nearest: f32,
    entry: Entry,
}

impl PartialEq for Next {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Next {}

impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> Ordering {
        self.nearest.total_cmp(&other.nearest)
    }
}

/// The result for a region.
pub(super) enum Outcome {
    /// Everything visible in the region.
    Seen(Fragments),
    /// The region has more pieces than allowed. The entries are the starts of traversals of its
    /// parts.
    Crowded(Vec<Entry>),
}

/// Traverses a world of triangles. Each thread needs a separate instance.
#[derive(Debug)]
pub(super) struct Walk<'w> {
    pub world: &'w World,
    tree: TreeView<'w>,
    frames: Vec<Frame>,
    /// The frame of each visited occurrence.
    frame_of: HashMap<u32, u32>,
    pub work: RegionWork,
    heap: BinaryHeap<Next>,
    /// Unused lists, kept for reuse.
    spare: Vec<Vec<Fragment>>,
}

impl<'w> Walk<'w> {
    pub fn new(world: &'w World) -> Result<Self, CoherenceError> {
        let tree = TreeView::new(world).ok_or(CoherenceError::NotBvh)?;
        let is_instance = |group, object| tree.instance(group, object as u32).is_some();
        let only_triangles = (0..tree.group_count())
            .all(|group| (0..tree.object_count(group)).all(|object| is_instance(group, object)));
        if !only_triangles {
            return Err(CoherenceError::NotTriangles);
        }
        let root = Frame {
            group: 0,
            instance: 0,
            outer: None,
            world_from_group: DAffine3::IDENTITY,
            is_root: true,
            extent: extent(&tree, 0),
        };
        Ok(Self {
            world,
            tree,
            frames: vec![root],
            frame_of: HashMap::new(),
            work: RegionWork::default(),
            heap: BinaryHeap::new(),
            spare: Vec::new(),
        })
    }

    /// The entries where traversals start: the whole world.
    pub fn start(&self) -> Vec<Entry> {
        let entry = |child| Entry { bounds: Bounds3::INFINITE, child, frame: 0 };
        self.tree.root(0).map(entry).into_iter().collect()
    }

    /// Finds everything visible in a region of a window, up to a maximum number of pieces. (Hidden
    /// pieces do not count, because dividing the region would not help.) Facets that do not matter
    /// are skipped.
    pub fn see(
        &mut self,
        view: &View,
        window: &Window,
        region: &ConvexPolygon,
        from: &[Entry],
        most: usize,
        matters: impl Fn(&Facet) -> bool,
    ) -> Outcome {
        let mut fragments = Fragments::new(region, window, self.spare.pop().unwrap_or_default());
        let (mut is_crowded, mut done) = (false, Vec::new());
        let left = self.visit(view, window, from, |entry, facets| {
            let mut touched = false;
            for (facet, source) in facets {
                touched |= matters(facet) && fragments.insert(facet, *source);
            }
            if touched {
                done.push(entry);
            }
            is_crowded = fragments.list.len() > most;
            if is_crowded { f64::INFINITY } else { fragments.farthest() }
        });
        if !is_crowded {
            return Outcome::Seen(fragments);
        }
        self.recycle(fragments);
        done.extend(left);
        Outcome::Crowded(done)
    }

    /// Reclaims the memory of fragments.
    pub fn recycle(&mut self, fragments: Fragments) {
        self.spare.push(fragments.list);
    }

    /// Visits the leaves that may be in the window, nearest first. `take` is called with each leaf
    /// that has facets in the window, and returns the minimum nearness of interest from then on
    /// (infinite to stop). Returns the entries that were not visited.
    pub fn visit(
        &mut self,
        view: &View,
        window: &Window,
        from: &[Entry],
        mut take: impl FnMut(Entry, &[(Facet, Source)]) -> f64,
    ) -> Vec<Entry> {
        self.work.regions += 1;
        let mut heap = std::mem::take(&mut self.heap);
        heap.clear();
        let mut sight = Sight::new(view, window, &self.frames[0]);
        let mut sight_of = 0;
        for entry in from {
            self.look(view, window, entry.frame, &mut sight, &mut sight_of);
            if let Some(nearest) = sight.nearest(&entry.bounds) {
                heap.push(Next { nearest, entry: *entry });
            }
        }
        let (mut floor, mut facets) = (f64::NEG_INFINITY, Vec::new());
        while let Some(Next { nearest, entry }) = heap.pop() {
            if f64::from(nearest) < floor {
                break;
            }
            if let TreeChild::Object(object) = entry.child {
                if let Some(inner) = self.enter(entry.frame, object) {
                    heap.push(Next { nearest, entry: inner });
                }
                continue;
            }
            self.look(view, window, entry.frame, &mut sight, &mut sight_of);
            let Frame { group, instance, .. } = self.frames[entry.frame as usize];
            if let TreeChild::Node(node) = entry.child {
                self.work.nodes += 1;
                let node = self.tree.node(group, node);
                let (mut met, nearest) = sight.boxes(&node);
                while met != 0 {
                    let slot = met.trailing_zeros() as usize;
                    met &= met - 1;
                    if let Some(child) = node.child(slot) {
                        let entry = Entry { bounds: node.bounds(slot), child, frame: entry.frame };
                        heap.push(Next { nearest: nearest[slot], entry });
                    }
                }
                continue;
            }
            facets.clear();
            if let TreeChild::Triangles { block, count } = entry.child {
                self.work.triangles += u64::from(count);
                self.tree.triangles(group, block, count, |triangle, corners| {
                    let source = Source { frame: entry.frame, triangle, instance };
                    let corners = corners.map(|p| p.as_dvec3());
                    window.facets(&sight.rows, &corners, |facet| facets.push((facet, source)));
                });
            }
            if !facets.is_empty() {
                floor = take(entry, &facets);
                if floor == f64::INFINITY {
                    break;
                }
            }
        }
        let left = if floor == f64::INFINITY {
            heap.drain().map(|next| next.entry).collect()
        } else {
            Vec::new()
        };
        self.heap = heap;
        left
    }

    /// Transforms the window to the coordinates of a frame.
    fn look(
        &self,
        view: &View,
        window: &Window,
        frame: u32,
        sight: &mut Sight,
        sight_of: &mut u32,
    ) {
        if frame != *sight_of {
            *sight = Sight::new(view, window, &self.frames[frame as usize]);
            *sight_of = frame;
        }
    }

    /// The root of an instance's tree; `None` if the object is not an instance that stands still,
    /// if its group has no tree, or if the map into it is not finite.
    fn enter(&mut self, frame: u32, object: u32) -> Option<Entry> {
        let outer = &self.frames[frame as usize];
        let placed = self.tree.instance(outer.group, object)?;
        let root = self.tree.root(placed.child).filter(|_| placed.child_from_group.is_finite())?;
        let instance = outer.instance + placed.offset;
        let frame = match self.frame_of.get(&instance) {
            Some(&frame) => frame,
            None => {
                let group = self.world.group(GroupId(outer.group as u32));
                let group_from_child = &group.instances[object as usize].group_from_child;
                let frame = Frame {
                    group: placed.child,
                    instance,
                    outer: Some((frame, placed.child_from_group)),
                    world_from_group: outer.world_from_group * *group_from_child.matrix(),
                    is_root: false,
                    extent: extent(&self.tree, placed.child),
                };
                self.frames.push(frame);
                let number = self.frames.len() as u32 - 1;
                self.frame_of.insert(instance, number);
                number
            }
        };
        Some(Entry { bounds: Bounds3::INFINITE, child: root, frame })
    }

    /// Instance, geometry and primitive of a triangle.
    pub fn ids(&self, source: &Source) -> [u32; 3] {
        let frame = &self.frames[source.frame as usize];
        let (geometry, primitive) = self.tree.triangle(frame.group, source.triangle);
        [frame.instance, geometry, primitive]
    }

    /// The corners of a triangle in world coordinates.
    pub fn corners(&self, source: &Source) -> [DVec3; 3] {
        let map = &self.frames[source.frame as usize].world_from_group;
        self.local_corners(source).map(|p| map.transform_point3(p.as_dvec3()))
    }

    fn local_corners(&self, source: &Source) -> [snell_math::Vec3; 3] {
        let [_, geometry, primitive] = self.ids(source);
        match self.world.geometry(GeometryId(geometry)) {
            Geometry::Mesh(mesh) => mesh.corners(primitive as usize),
            Geometry::Quads(quads) => quads.triangles().corners(primitive as usize),
            _ => [snell_math::Vec3::ZERO; 3],
        }
    }

    /// Tests a ray with one triangle, by the test that all structures share.
    pub fn confirm(&mut self, ray: &Ray, source: &Source) -> Option<Hit> {
        self.work.confirmed += 1;
        let local = self.ray_in(source.frame, ray)?;
        self.tree.test_triangle(ray, &local, &self.local_corners(source), self.ids(source))
    }

    /// A ray of the world transformed to a frame, through one instance after the other.
    fn ray_in(&self, frame: u32, ray: &Ray) -> Option<DRay> {
        match &self.frames[frame as usize].outer {
            None => Some(DRay::from(ray)),
            Some((outer, map)) => {
                let ray = self.ray_in(*outer, ray)?;
                let (origin, direction) =
                    (map.transform_point3(ray.origin), map.transform_vector3(ray.direction));
                // A ray that overflows on the way hits nothing.
                (origin.is_finite() && direction.is_finite()).then_some(DRay {
                    origin,
                    direction,
                    ..ray
                })
            }
        }
    }

    /// Traces one ray by the ordinary traversal.
    pub fn closest(&mut self, ray: &Ray) -> Hit {
        self.work.rays += 1;
        self.world.closest_one(ray, &AcceptAll)
    }

    /// Tests one ray for occlusion by the ordinary traversal.
    pub fn occluded(&mut self, ray: &Ray) -> bool {
        self.work.rays += 1;
        self.world.occluded_one(ray, &AcceptAll)
    }
}

/// The largest absolute coordinates in a group.
fn extent(tree: &TreeView, group: usize) -> DVec3 {
    let Some(TreeChild::Node(root)) = tree.root(group) else {
        // The tree is a single leaf, whose triangles are always tested.
        return DVec3::INFINITY;
    };
    let node = tree.node(group, root);
    let all = (0..8).fold(Bounds3::EMPTY, |b, slot| b.union(&node.bounds(slot)));
    all.min.abs().max(all.max.abs()).as_dvec3()
}

/// A window in the coordinates of a frame: conservative in `f32` for boxes, in `f64` for triangles.
struct Sight {
    rows: Rows,
    sides: [Side; 6],
    nearness: Side,
    depth: Side,
}

/// An affine function of points.
#[derive(Clone, Copy)]
struct Side {
    normal: [f32; 3],
    /// The offset, enlarged by a bound on rounding errors.
    offset: f32,
}

impl Side {
    fn new(row: DVec4, extent: DVec3) -> Self {
        let (normal, offset) = (row.truncate(), row.w);
        let size = normal.abs().dot(extent) + offset.abs();
        // Three products, three sums, and the rounding of the numbers themselves.
        let margin = size * 8.0 * f64::from(f32::EPSILON);
        Self { normal: normal.as_vec3().to_array(), offset: (offset + margin) as f32 }
    }

    /// The maximum in a box; NaN if unknown.
    fn greatest(&self, b: &Bounds3) -> f32 {
        let (low, high) = (b.min.to_array(), b.max.to_array());
        (0..3).fold(self.offset, |sum, axis| {
            let n = self.normal[axis];
            sum + n * if n >= 0.0 { high[axis] } else { low[axis] }
        })
    }

    /// The maximum in each box of a node.
    #[inline(always)]
    fn greatest_of(&self, node: &TreeNode) -> [f32; 8] {
        let mut sums = [self.offset; 8];
        for axis in 0..3 {
            let n = self.normal[axis];
            let planes = &node.planes()[usize::from(n >= 0.0)][axis];
            for (sum, plane) in sums.iter_mut().zip(planes) {
                *sum += n * plane;
            }
        }
        sums
    }
}

impl Sight {
    fn new(view: &View, window: &Window, frame: &Frame) -> Self {
        let rows = if frame.is_root { view.rows() } else { view.rows_in(&frame.world_from_group) };
        Self {
            rows,
            sides: window.sides(&rows).map(|row| Side::new(row, frame.extent)),
            nearness: Side::new(rows.nearness, frame.extent),
            // The minimum depth is the negated maximum of the negated depth.
            depth: Side::new(-rows.depth, frame.extent),
        }
    }

    /// A bound on the nearness of anything in the box; `None` if the box is outside of the window.
    fn nearest(&self, b: &Bounds3) -> Option<f32> {
        let outside = self.sides.iter().any(|side| side.greatest(b) < 0.0);
        (!outside).then(|| nearest(self.nearness.greatest(b), -self.depth.greatest(b)))
    }

    /// A bit for each box that may be in the window, and bounds on their nearness.
    fn boxes(&self, node: &TreeNode) -> (u32, [f32; 8]) {
        let mut inside = [true; 8];
        for side in &self.sides {
            let greatest = side.greatest_of(node);
            for (inside, value) in inside.iter_mut().zip(greatest) {
                // NaN does not count as outside.
                *inside &= value >= 0.0 || value.is_nan();
            }
        }
        let (high, low) = (self.nearness.greatest_of(node), self.depth.greatest_of(node));
        let met = inside
            .iter()
            .enumerate()
            .fold(0, |met, (slot, &inside)| met | u32::from(inside) << slot);
        (met, std::array::from_fn(|slot| nearest(high[slot], -low[slot])))
    }
}

/// The maximum quotient of a value of at most `nearness` and a depth of at least `depth`.
fn nearest(nearness: f32, depth: f32) -> f32 {
    let quotient = if nearness < 0.0 {
        // Parallel rays: the depth is 1.
        nearness
    } else if depth > 0.0 {
        nearness / depth
    } else {
        f32::INFINITY
    };
    // The division rounds too.
    let quotient = quotient + quotient.abs() * f32::EPSILON;
    if quotient.is_nan() { f32::INFINITY } else { quotient }
}
