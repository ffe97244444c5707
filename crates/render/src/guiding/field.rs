//! The guiding field: a density of directions for each region of space and each of six orientations
//! of surfaces.
//!
//! Regions are the leaves of binary trees over space. There is one tree for each of six
//! orientations of a surface (by the largest component of its normal), so that light on one side of
//! a wall does not guide paths on the other side. A region with many records is halved.

mod saved;

pub use saved::SavedField;

use super::atlas::{Atlas, Brief};
use super::density::Density;
use super::directional::{Gatherer, Moment};
use super::parallax::{Parallax, from_anchor, to_place};
use super::record::Record;
use super::regions::{Halves, Place, place};
use crate::threads::on_threads;
use snell_math::simd::{max, min};
use snell_math::{Vec2, Vec3, real, rng};

/// The largest number of regions.
const MAX_CELLS: usize = 1 << 14;
/// The largest number of times that the scene's box is halved for a region.
const MAX_DEPTH: u32 = 48;
/// The weight of a region's previous state, as a number of new records of equal light.
const TRUST: f64 = 16.0;
/// With fewer effective records than this, a region stays untrained.
const MIN_RECORDS: f64 = 4.0;
/// The least and greatest fraction of BSDF samples, so that a badly trained field cannot cost much.
const BSDF_SHARE: [f32; 2] = [0.5, 0.95];

/// The state of one region.
#[derive(Clone, Debug)]
pub struct Cell {
    /// The density of incident light, as seen from the anchor of [`Self::parallax`]; `None` if the
    /// region is not trained.
    density: Option<Density>,
    /// The fraction of directions that are sampled from the BSDF instead of the density.
    pub bsdf_share: f32,
    /// About how much light a path of throughput 1 will find after it leaves a vertex in the
    /// region.
    pub expected: f32,
    /// How directions change within the region.
    parallax: Parallax,
    /// The number of halvings of the cube that led to the region.
    depth: u32,
    gatherer: Gatherer,
    records: u32,
    /// Sums over the light gathered by direction in this pass.
    gathered: Weights,
    /// Sums over the light found by all records of this pass.
    found: Weights,
    /// The part of the light in `found` that BSDF samples would have found.
    found_by_bsdf: f64,
}

/// A sum of weights, with the sum of their squares.
#[derive(Clone, Copy, Debug, Default)]
struct Weights {
    sum: f64,
    squares: f64,
}

impl Weights {
    fn add(&mut self, weight: f32) {
        self.sum += f64::from(weight);
        self.squares += f64::from(weight) * f64::from(weight);
    }

    /// Kish's effective sample size: the number of equal weights with the same relative variance.
    /// It is 1 if one weight dominates.
    fn count(&self) -> f64 {
        if self.squares > 0.0 && self.squares.is_finite() {
            self.sum * self.sum / self.squares
        } else {
            0.0
        }
    }

    /// The weight of the region's previous state when it is averaged with these records.
    fn trust(&self) -> f64 {
        TRUST / (TRUST + self.count())
    }
}

impl Cell {
    fn new() -> Self {
        Self {
            density: None,
            bsdf_share: 0.5,
            expected: 0.0,
            parallax: Parallax::default(),
            depth: 0,
            gatherer: Gatherer::default(),
            records: 0,
            gathered: Weights::default(),
            found: Weights::default(),
            found_by_bsdf: 0.0,
        }
    }

    fn add(&mut self, record: &Record, key: u32) {
        self.records += 1;
        if record.light > 0.0 {
            let jitter = rng::uniform2([key, self.records, 3, 1]);
            let (direction, _) =
                from_anchor(record.direction, self.parallax.shift(record.position));
            self.gatherer.add(direction, record.light, jitter);
            self.gathered.add(record.light.sqrt());
            self.found.add(record.found);
            self.found_by_bsdf += f64::from(record.found) * f64::from(record.bsdf_share);
        }
    }

    /// Ends a pass: updates the region's state with what was gathered.
    fn learn(&mut self, moment: Moment) {
        if self.found.count() > 0.0 {
            let (mean, trust) = (self.found.sum / f64::from(self.records), self.found.trust());
            let trust = if self.expected > 0.0 { trust } else { 0.0 };
            self.expected = (f64::from(self.expected) * trust + mean * (1.0 - trust)) as f32;
        }
        if self.density.is_some() && self.found.count() > 0.0 {
            // One step of expectation maximisation for the mixture of BSDF and density, from the
            // fraction that was used.
            let (share, trust) = (self.found_by_bsdf / self.found.sum, self.found.trust());
            let share = (f64::from(self.bsdf_share) * trust + share * (1.0 - trust)) as f32;
            self.bsdf_share = share.clamp(BSDF_SHARE[0], BSDF_SHARE[1]);
        }
        if (self.density.is_some() || self.gathered.count() >= MIN_RECORDS)
            && let Some(shares) = self.gatherer.shares(moment, self.gathered.trust() as f32)
        {
            self.gatherer = Gatherer::suited_to(&shares);
            self.density = Some(shares.density());
        }
        self.forget();
    }

    /// Determines the parallax, and discards the density.
    fn find_parallax<'a>(&mut self, records: impl Iterator<Item = &'a Record>) {
        let found: Vec<Record> = records.filter(|record| record.light > 0.0).copied().collect();
        (self.parallax, self.density, self.gatherer) =
            (Parallax::of(&found), None, Gatherer::default());
    }

    /// True if the region is trained.
    pub fn is_known(&self) -> bool {
        self.density.is_some()
    }

    /// The density of directions at a point of the region; `None` if the region is not trained.
    pub fn guide(&self, position: Vec3) -> Option<Guide<'_>> {
        Some(Guide { density: self.density.as_ref()?, shift: self.parallax.shift(position) })
    }

    /// Discards the sums of a pass.
    fn forget(&mut self) {
        (self.gathered, self.found, self.found_by_bsdf) =
            (Weights::default(), Weights::default(), 0.0);
    }
}

/// The density of incident light at a point.
#[derive(Clone, Copy, Debug)]
pub struct Guide<'a> {
    density: &'a Density,
    shift: Vec3,
}

impl Guide<'_> {
    /// Samples a unit direction. `choice` and `u` are three independent uniform numbers.
    pub fn sample(&self, choice: f32, u: Vec2) -> Vec3 {
        to_place(self.density.sample(choice, u), self.shift)
    }

    /// Density per steradian of a unit direction.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        let (seen, larger) = from_anchor(direction, self.shift);
        self.density.pdf(seen) * larger
    }
}

/// The number of a trained region.
#[derive(Clone, Copy, Debug)]
pub struct Known(pub(crate) u32);

/// A node of the trees over space: either two halves, or a region.
#[derive(Clone, Copy, Debug)]
enum Node {
    /// The axes along which nodes are halved take turns.
    Halves {
        first: u32,
    },
    Region(u32),
}

/// A node, together with the list that holds its children.
#[derive(Clone, Copy)]
struct NodeOf<'a> {
    nodes: &'a [Node],
    node: Node,
}

impl Halves for NodeOf<'_> {
    fn halves(self) -> Result<[Self; 2], u32> {
        match self.node {
            Node::Region(region) => Err(region),
            Node::Halves { first } => {
                Ok([0, 1].map(|half| NodeOf { node: self.nodes[first as usize + half], ..self }))
            }
        }
    }
}

/// The number of orientations of a surface.
const FACES: usize = 6;

/// The orientation of a surface, by the largest component of its normal: 0 to 2 for positive x, y,
/// z; 3 to 5 for negative x, y, z.
#[inline(always)]
fn face(normal: Vec3) -> usize {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    if normal[axis] < 0.0 { axis + 3 } else { axis }
}

/// The regions of a scene with their trees.
#[derive(Clone, Debug)]
pub struct Field {
    origin: Vec3,
    scale: f32,
    /// The nodes of all trees. The first [`FACES`] nodes are the roots.
    nodes: Vec<Node>,
    /// The regions and their densities, laid out for look-ups.
    atlas: Atlas,
    cells: Vec<Cell>,
    is_learning: bool,
}

impl Field {
    /// An untrained field over the ball with this centre and radius.
    pub fn new(center: Vec3, radius: f32) -> Self {
        let scale = 0.5 / radius;
        let mut field = Self {
            origin: center - radius,
            scale: if scale.is_finite() { scale } else { 0.0 },
            nodes: (0..FACES as u32).map(Node::Region).collect(),
            atlas: Atlas::default(),
            cells: vec![Cell::new(); FACES],
            is_learning: true,
        };
        field.lay_out();
        field
    }

    /// Rebuilds [`Self::atlas`] from the nodes and cells.
    fn lay_out(&mut self) {
        let nodes = &self.nodes;
        self.atlas = Atlas::of_trees(nodes[..FACES].iter().map(|&node| NodeOf { nodes, node }));
        for cell in &self.cells {
            self.atlas.add(cell.density.as_ref(), cell.bsdf_share, cell.expected, cell.parallax);
        }
    }

    /// The cell at a point of a surface with this `normal`. Points outside of the cube around the
    /// ball are clamped to it.
    pub fn cell(&self, position: Vec3, normal: Vec3) -> &Cell {
        let (place, face) = self.place(position, normal);
        self.cell_at(place, face)
    }

    /// The coordinates of a point and the orientation of its surface, for look-ups in the
    /// [atlas](Self::atlas).
    #[inline(always)]
    pub fn place(&self, position: Vec3, normal: Vec3) -> (Place, usize) {
        let Vec3 { x, y, z } = self.unit(position);
        ([place(x), place(y), place(z)], face(normal))
    }

    fn cell_at(&self, place: Place, face: usize) -> &Cell {
        &self.cells[self.atlas.region(face, place) as usize]
    }

    /// The atlas, for look-ups at many points.
    #[inline]
    pub fn atlas(&self) -> &Atlas {
        &self.atlas
    }

    /// The data of a trained region in short form.
    #[inline]
    pub fn brief(&self, Known(region): Known) -> &Brief {
        self.atlas.brief(region)
    }

    /// See [`Cell::guide`].
    pub fn guide(&self, Known(region): Known, position: Vec3) -> Option<Guide<'_>> {
        self.cells[region as usize].guide(position)
    }

    /// The coordinates of a point in the unit cube.
    #[inline(always)]
    fn unit(&self, position: Vec3) -> Vec3 {
        let p = (position - self.origin) * self.scale;
        // NaN becomes 0, since `max` returns the second operand.
        let inside = |x: f32| min(max(x, 0.0), rng::ONE_MINUS_EPSILON);
        Vec3::new(inside(p.x), inside(p.y), inside(p.z))
    }

    /// The region to which a record is added: the region at a random point at most half of a
    /// region's size away, which smooths between neighbours.
    fn region_of(&self, record: &Record, key: u32) -> u32 {
        let (p, face) = (self.unit(record.position), face(record.normal));
        let region = |p: Vec3| self.atlas.region(face, p.to_array().map(place));
        let depth = self.cells[region(p) as usize].depth;
        let [x, y, z, _] = rng::pcg4d([key, depth, 17, 4]);
        let u = Vec3::new(rng::to_unit(x), rng::to_unit(y), rng::to_unit(z)) - 0.5;
        // The axes of halving take turns, x first.
        let size = Vec3::new(halved(depth.div_ceil(3)), halved((depth + 1) / 3), halved(depth / 3));
        let moved = (p + u * size).clamp(Vec3::ZERO, Vec3::splat(rng::ONE_MINUS_EPSILON));
        region(moved)
    }

    /// Adds records. Each region gets its records in the order given, whatever the number of
    /// threads.
    pub fn add(&mut self, records: &[Record], key: u32, threads: usize) {
        self.for_each_cell_with(records, key, threads, |cell, records| {
            for (record, key) in records {
                cell.add(record, key);
            }
        });
    }

    /// Determines the parallax of each region, and discards the densities.
    pub fn find_parallax(&mut self, records: &[Record], key: u32, threads: usize) {
        self.for_each_cell_with(records, key, threads, |cell, records| {
            cell.find_parallax(records.map(|(record, _)| record));
        });
    }

    /// Calls a function for each region with the region's records, in the order given, each with a
    /// random key.
    fn for_each_cell_with(
        &mut self,
        records: &[Record],
        key: u32,
        threads: usize,
        f: impl Fn(&mut Cell, &mut dyn Iterator<Item = (&Record, u32)>) + Sync,
    ) {
        let key = |i: usize| rng::hash_combine(key, i as u32);
        let mut regions = vec![0u32; records.len()];
        let piece = records.len().div_ceil(threads.max(1)).max(1);
        let (this, pieces) =
            (&*self, regions.chunks_mut(piece).zip(records.chunks(piece)).enumerate());
        let queue = std::sync::Mutex::new(pieces);
        let next = || queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
        on_threads(threads, || {
            while let Some((number, (regions, records))) = next() {
                for (i, (region, record)) in regions.iter_mut().zip(records).enumerate() {
                    *region = this.region_of(record, key(number * piece + i));
                }
            }
        });
        // Counting sort by region.
        let mut starts = vec![0u32; self.cells.len() + 1];
        regions.iter().for_each(|&region| starts[region as usize + 1] += 1);
        (0..self.cells.len()).for_each(|i| starts[i + 1] += starts[i]);
        let mut order = vec![0u32; records.len()];
        let mut ends = starts.clone();
        for (i, &region) in (0..).zip(&regions) {
            let at = &mut ends[region as usize];
            order[*at as usize] = i;
            *at += 1;
        }
        let of = |cell: usize| &order[starts[cell] as usize..starts[cell + 1] as usize];
        self.for_each_cell(threads, |i, cell| {
            f(
                cell,
                &mut of(i).iter().map(|&record| (&records[record as usize], key(record as usize))),
            );
        });
    }

    /// Calls a function for each region, on several threads.
    fn for_each_cell(&mut self, threads: usize, f: impl Fn(usize, &mut Cell) + Sync) {
        let queue = std::sync::Mutex::new(self.cells.iter_mut().enumerate());
        let next = || queue.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
        on_threads(threads, || {
            while let Some((i, cell)) = next() {
                f(i, cell);
            }
        });
    }

    /// Ends a pass: computes densities from this moment of the gathered records, and halves regions
    /// with more than `most` records.
    pub fn learn(&mut self, moment: Moment, most: u32, threads: usize) {
        self.for_each_cell(threads, |_, cell| cell.learn(moment));
        for root in 0..FACES {
            self.halve(root, 0, most);
        }
        for cell in &mut self.cells {
            cell.records = 0;
        }
        self.lay_out();
    }

    fn halve(&mut self, node: usize, depth: u32, most: u32) {
        match self.nodes[node] {
            Node::Halves { first } => {
                self.halve(first as usize, depth + 1, most);
                self.halve(first as usize + 1, depth + 1, most);
            }
            Node::Region(cell) => {
                let records = self.cells[cell as usize].records;
                if records <= most || depth >= MAX_DEPTH || self.cells.len() >= MAX_CELLS {
                    return;
                }
                let halved = &mut self.cells[cell as usize];
                (halved.records, halved.depth) = (records / 2, depth + 1);
                self.cells.push(self.cells[cell as usize].clone());
                let first = self.nodes.len() as u32;
                self.nodes.push(Node::Region(cell));
                self.nodes.push(Node::Region(self.cells.len() as u32 - 1));
                self.nodes[node] = Node::Halves { first };
                self.halve(first as usize, depth + 1, most);
                self.halve(first as usize + 1, depth + 1, most);
            }
        }
    }

    /// The number of trained regions.
    pub fn known_regions(&self) -> usize {
        self.cells.iter().filter(|c| c.density.is_some()).count()
    }

    /// Memory use of the data for sampling, in bytes.
    pub fn memory_bytes(&self) -> usize {
        let densities: usize =
            self.cells.iter().filter_map(|c| c.density.as_ref()).map(Density::memory_bytes).sum();
        densities + self.cells.len() * size_of::<Cell>() + self.atlas.memory_bytes()
    }

    /// Discards the records added since the last call of [`Self::learn`].
    pub fn forget_pass(&mut self) {
        for cell in &mut self.cells {
            cell.gatherer = Gatherer::default();
            cell.records = 0;
            cell.forget();
        }
    }

    /// True until [`Self::finish`] is called. While it is true the field accepts records.
    pub fn is_learning(&self) -> bool {
        self.is_learning
    }

    /// Ends training, and frees the data that only training needs.
    pub fn finish(&mut self) {
        self.is_learning = false;
        for cell in &mut self.cells {
            cell.gatherer = Gatherer::default();
        }
    }
}

/// `2^-times`.
fn halved(times: u32) -> f32 {
    real::powi(0.5f32, times as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng::uniform2;
    use snell_math::sampling::uniform_sphere;

    /// A field learnt on a floor under a small lamp, which each region sees in a different
    /// direction.
    pub(super) fn learnt() -> Field {
        let lamp = Vec3::new(0.1, 0.7, -0.2);
        let records: Vec<Record> = (0..40_000)
            .map(|i| {
                let [u, v] = [0, 1].map(|k| uniform2([i, k, 1, 2]));
                let position = Vec3::new(u.x * 2.0 - 1.0, 0.0, u.y * 2.0 - 1.0);
                let direction = match i % 2 {
                    0 => uniform_sphere(v),
                    _ => (lamp - position).normalize(),
                };
                Record {
                    position,
                    normal: Vec3::Y,
                    direction,
                    light: 1.0,
                    found: 0.0,
                    bsdf_share: 0.0,
                }
            })
            .collect();
        let mut field = Field::new(Vec3::ZERO, 1.5);
        for round in 0..8 {
            if round == 3 {
                field.find_parallax(&records, 9, 2);
            }
            field.add(&records, round, 2);
            field.learn(Moment::First, 2000, 2);
        }
        field.finish();
        field
    }

    /// The density at the corner of a region must point to the lamp as seen from that corner, not
    /// as seen from the region's middle.
    #[test]
    fn directions_turn_within_a_region() {
        let field = learnt();
        let lamp = Vec3::new(0.1, 0.7, -0.2);
        let mut sum = 0.0;
        for i in 0..1000 {
            let u = uniform2([i, 5, 6, 7]);
            let position = Vec3::new(u.x * 2.0 - 1.0, 0.0, u.y * 2.0 - 1.0);
            let guide =
                field.cell(position, Vec3::Y).guide(position).expect("all of the floor is known");
            sum += guide.pdf((lamp - position).normalize()) / 1000.0;
        }
        // The sum is about 330. Without parallax it would be 2 or 3, since regions are some 30
        // degrees wide as seen from the lamp.
        assert!(sum > 100.0, "{sum}");
    }

    /// Compares integrals over the sphere with estimates from sampled directions and their reported
    /// density.
    #[test]
    fn turned_directions_are_drawn_as_densely_as_is_stated() {
        let field = learnt();
        let n = 1_000_000;
        for (place, x, z) in [(0u32, -0.45, 0.3), (1, 0.2, 0.26), (2, 0.93, -0.88)] {
            let position = Vec3::new(x, 0.0, z);
            let guide =
                field.cell(position, Vec3::Y).guide(position).expect("all of the floor is known");
            assert_ne!(guide.shift, Vec3::ZERO);
            let mut integrals = [0.0f64; 7];
            for i in 0..n {
                let [u, v] = [1, 2].map(|k| uniform2([i, place, k, 6]));
                let d = guide.sample(u.x, v);
                // Because of rounding, a few samples fall where the density is 0.
                let pdf = f64::from(guide.pdf(d));
                let weight = if pdf > 0.0 { 1.0 / pdf / f64::from(n) } else { 0.0 };
                integrals[0] += weight;
                for axis in 0..3 {
                    integrals[1 + axis] += weight * f64::from(1.0 + d[axis]);
                    integrals[4 + axis] += weight * f64::from(1.0 - d[axis]);
                }
            }
            for integral in integrals {
                assert!(
                    (integral / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.02,
                    "{position}: {integrals:?}"
                );
            }
        }
    }
}
