//! Meshes and scenes prepared for questions about pairs.

use super::boxes::{OrientedBox, Tree, relative};
use crate::shape::AnyShape;
use snell_math::exact::DoubleDouble;
use snell_math::{DAffine3, DMat3, DVec3, real};
use std::sync::Arc;

/// Triangles in a leaf. With one alone queries are no faster, and trees take twice the memory.
const LEAF: usize = 2;

/// The largest coordinate: products of three of them stay in range.
const LARGEST: f64 = 1e90;

/// True for coordinates that are not numbers, or too large.
fn is_out_of_range(x: &f64) -> bool {
    x.is_nan() || x.abs() > LARGEST
}

/// Linear maps differ from a rotation and a uniform scale by no more than this.
const RIGID: f64 = 1e-6;

/// The error of meshes and poses that no questions about pairs can be asked of.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PairError {
    /// A coordinate is not a number, or too large.
    #[error("a coordinate is {0:e}, expected numbers below 1e90")]
    OutOfRange(f64),
    /// A pose shears or scales along one axis more than along others.
    #[error(
        "the pose is not a rotation, a mirroring and a uniform scale: its lengths differ by \
         {0:.2e}, expected at most 1e-6; apply it to the vertices instead"
    )]
    NotRigid(f64),
    /// The poses at both ends of a motion differ in scale, or one of them mirrors.
    #[error("the two poses of a motion differ in scale or in handedness")]
    NotAMotion,
}

/// The triangles of a mesh in a tree of oriented boxes. It takes about 150 bytes per triangle.
#[derive(Clone, Debug)]
pub struct PairMesh {
    /// Coordinates are relative to this point.
    pub(super) origin: DVec3,
    pub(super) tree: Tree,
    /// Corners in the order of the tree. (That of a mesh far from zero loses no digit: the
    /// difference of two numbers that are no more than a factor of two apart is exact.)
    pub(super) triangles: Vec<[DVec3; 3]>,
    /// The numbers of the triangles.
    numbers: Vec<u32>,
}

impl PairMesh {
    /// Prepares triangles, in time `n log n`, on all threads of the current rayon pool.
    ///
    /// # Errors
    /// If a coordinate is not a number or not below `1e90`.
    pub fn new(triangles: &[[DVec3; 3]]) -> Result<Self, PairError> {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in triangles.iter().flatten() {
            if let Some(bad) = p.to_array().into_iter().find(is_out_of_range) {
                return Err(PairError::OutOfRange(bad));
            }
            (min, max) = (min.min(*p), max.max(*p));
        }
        let origin = if triangles.is_empty() { DVec3::ZERO } else { near_zero(min, max) };
        let moved = relative(triangles, origin);
        let (tree, numbers) = Tree::build(&moved, LEAF);
        let triangles = numbers.iter().map(|&i| moved[i as usize]).collect();
        Ok(Self { origin, tree, triangles, numbers })
    }

    /// The number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// True if the mesh has no triangles.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The bytes that the mesh takes.
    pub fn memory(&self) -> usize {
        self.tree.memory() + self.triangles.len() * (size_of::<[DVec3; 3]>() + 4)
    }

    /// The number, in the mesh, of the triangle at a place of the tree.
    pub(super) fn number(&self, place: usize) -> u32 {
        self.numbers[place]
    }

    /// The mesh with a linear map applied.
    fn mapped(&self, linear: &DMat3) -> Result<Self, PairError> {
        let map = |t: &[DVec3; 3]| t.map(|p| *linear * (p + self.origin));
        let triangles: Vec<[DVec3; 3]> = self.triangles.iter().map(map).collect();
        let mut mesh = Self::new(&triangles)?;
        for number in &mut mesh.numbers {
            *number = self.numbers[*number as usize];
        }
        Ok(mesh)
    }

    /// A shape that has flat faces: a box, a rectangle or a triangle; `None` for others. The
    /// numbers of triangles are those of the faces.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn of_shape(shape: &AnyShape) -> Result<Option<Self>, PairError> {
        let (triangles, per_face) = match shape {
            AnyShape::BoxShape(shape) => (shape.triangles().to_vec(), 2),
            AnyShape::Rectangle(shape) => (shape.triangles().to_vec(), 2),
            AnyShape::Triangle(shape) => (vec![shape.vertices], 1),
            _ => return Ok(None),
        };
        let mut mesh = Self::new(&triangles)?;
        mesh.numbers.iter_mut().for_each(|number| *number /= per_face);
        Ok(Some(mesh))
    }
}

/// A point near to a box, of which each coordinate is 0 unless the box is far from 0 for its size.
/// Its coordinates have few digits, so that differences from points of the box are exact.
fn near_zero(min: DVec3, max: DVec3) -> DVec3 {
    let (center, size) = ((min + max) * 0.5, (max - min).max_element());
    DVec3::from_array(center.to_array().map(|x| {
        let short = f64::from(x as f32);
        if x.abs() > 8.0 * size && short.is_finite() { short } else { 0.0 }
    }))
}

/// A mesh at a place in a scene.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub mesh: Arc<PairMesh>,
    pub map: DAffine3,
    scale: Scale,
    /// The number that the part has for those who ask.
    pub number: u32,
}

/// Meshes at places, which move as one. Immutable; it shares the meshes.
#[derive(Clone, Debug, Default)]
pub struct PairScene {
    pub(super) origin: DVec3,
    pub(super) parts: Vec<Part>,
    /// The tree of the parts, relative to `origin`, with one part in each leaf.
    pub(super) tree: Tree,
    /// The parts in the order of the tree.
    order: Vec<u32>,
}

impl PairScene {
    /// A scene of meshes, each with the map from its coordinates to those of the scene. Maps may be
    /// any affine ones; for a map that is not a rotation and a uniform scale, the mesh is mapped
    /// and its tree is built again.
    ///
    /// # Errors
    /// If a coordinate leaves the range (see [`PairMesh::new`]).
    pub fn new(parts: Vec<(Arc<PairMesh>, DAffine3)>) -> Result<Self, PairError> {
        let mut scene = Self::default();
        for (number, (mesh, map)) in parts.into_iter().enumerate() {
            if mesh.is_empty() {
                continue;
            }
            let scale = Scale::of(&map.matrix3);
            let (mesh, map, scale) = if scale.error <= RIGID {
                (mesh, map, scale)
            } else {
                let mesh = Arc::new(mesh.mapped(&map.matrix3)?);
                let map = DAffine3::from_translation(map.translation);
                (mesh, map, Scale { factor: 1.0, error: 0.0 })
            };
            scene.parts.push(Part { mesh, map, scale, number: number as u32 });
        }
        if scene.parts.is_empty() {
            return Ok(scene);
        }
        let identity = DAffine3::IDENTITY;
        let corners = |origin: DVec3| -> Vec<[DVec3; 8]> {
            let placed = |part: &Part| {
                let place = part.place(&identity, &Scale::ONE, origin);
                place.bounds(&part.mesh.tree.nodes[0].bounds).corners()
            };
            scene.parts.iter().map(placed).collect()
        };
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in corners(DVec3::ZERO).iter().flatten() {
            (min, max) = (min.min(*p), max.max(*p));
        }
        if let Some(bad) = min.to_array().into_iter().chain(max.to_array()).find(is_out_of_range) {
            return Err(PairError::OutOfRange(bad));
        }
        scene.origin = near_zero(min, max);
        (scene.tree, scene.order) = Tree::build(&corners(scene.origin), 1);
        Ok(scene)
    }

    /// True if there are no triangles.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The diagonal of a box around everything; 0 if there is nothing.
    pub fn size(&self) -> f64 {
        self.bounds().map_or(0.0, |bounds| 2.0 * bounds.radius())
    }

    /// The part at a place of the tree.
    pub(super) fn part(&self, place: usize) -> &Part {
        &self.parts[self.order[place] as usize]
    }

    /// The box around everything, relative to the origin; `None` if there is nothing.
    pub(super) fn bounds(&self) -> Option<&OrientedBox> {
        self.tree.nodes.first().map(|node| &node.bounds)
    }
}

impl Part {
    /// Where the part is, in a scene with a pose, relative to `reference`.
    pub fn place(&self, pose: &DAffine3, scale: &Scale, reference: DVec3) -> Place {
        let offset = offset(&[&self.map, pose], self.mesh.origin, reference);
        Place::new(pose.matrix3 * self.map.matrix3, &self.scale.times(scale), offset)
    }
}

/// How much a linear map lengthens.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub factor: f64,
    /// Directions differ in it by no more than this share.
    pub error: f64,
}

impl Scale {
    pub const ONE: Self = Self { factor: 1.0, error: 0.0 };

    /// The scale of a linear map, of which all lengths differ by no more than its error.
    pub fn of(linear: &DMat3) -> Self {
        let factor = real::cbrt(linear.determinant().abs());
        let gram = linear.transpose() * *linear;
        let wanted = factor * factor;
        let columns = gram.to_cols_array_2d();
        let error = (0..9).map(|i| {
            let expected = if i % 4 == 0 { wanted } else { 0.0 };
            (columns[i / 3][i % 3] - expected).abs()
        });
        // A map that is singular or not finite is far from a rotation.
        let error = error.fold(0.0, f64::max) / wanted;
        let error = if error.is_finite() { error } else { f64::INFINITY };
        // What differs by rounding only is exact.
        Self { factor, error: if error < 1e-14 { 0.0 } else { error } }
    }

    /// The scale of a pose.
    pub fn of_pose(pose: &DAffine3) -> Result<Self, PairError> {
        let far = pose.translation.to_array().into_iter().find(is_out_of_range);
        if let Some(far) = far {
            return Err(PairError::OutOfRange(far));
        }
        let scale = Self::of(&pose.matrix3);
        if scale.error <= RIGID { Ok(scale) } else { Err(PairError::NotRigid(scale.error)) }
    }

    fn times(&self, other: &Self) -> Self {
        Self { factor: self.factor * other.factor, error: self.error + other.error }
    }
}

/// The map from the coordinates of a tree to those of a search: a rotation, a uniform scale and an
/// offset.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    linear: DMat3,
    rotation: DMat3,
    /// By how much lengths grow, with what the map is not exact in added.
    growth: f64,
    /// False if axes stay as they are, as those of a scene at rest do.
    is_turned: bool,
    pub offset: DVec3,
}

impl Place {
    pub fn new(linear: DMat3, scale: &Scale, offset: DVec3) -> Self {
        let is_exact = scale.factor == 1.0;
        let rotation = if is_exact { linear } else { linear * (1.0 / scale.factor) };
        let (growth, is_turned) =
            (scale.factor * (1.0 + 4.0 * scale.error), rotation != DMat3::IDENTITY);
        Self { linear, rotation, growth, is_turned, offset }
    }

    #[inline(always)]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.linear * p + self.offset
    }

    #[inline(always)]
    pub fn bounds(&self, bounds: &OrientedBox) -> OrientedBox {
        OrientedBox {
            center: self.point(bounds.center),
            axes: if self.is_turned { self.rotation * bounds.axes } else { bounds.axes },
            half: bounds.half * self.growth,
        }
    }
}

/// `origin` mapped by one map after the other, less `reference`: to the last digit, though all of
/// these may be far from 0.
pub(super) fn offset(maps: &[&DAffine3], origin: DVec3, reference: DVec3) -> DVec3 {
    let number = |x: f64| DoubleDouble { high: x, low: 0.0 };
    let mut point = origin.to_array().map(number);
    for map in maps {
        let rows = map.matrix3.transpose().to_cols_array_2d();
        let translation = map.translation.to_array();
        point = std::array::from_fn(|i| {
            let part = |k: usize| point[k].times_plain(rows[i][k]);
            part(0).plus(part(1)).plus(part(2)).plus(number(translation[i]))
        });
    }
    let reference = reference.to_array();
    DVec3::from_array(std::array::from_fn(|i| point[i].minus(number(reference[i])).high))
}
