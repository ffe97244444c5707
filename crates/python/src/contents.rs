//! What a scene holds, as plain data: objects by number. Worlds are assembled from it ([`crate::assemble`]).

use pyo3::PyResult;
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use snell_intersect::{AnyShape, DTriangleMesh, PrimitiveSet, Shape, Spheres, TriangleMesh};
use snell_math::{Bounds3d, DVec3, Transform, Vec2, Vec3};
use snell_scene::Camera;
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

/// Scenes may be instanced in scenes this deep.
const MAX_NESTING: usize = 500;

/// Vertices as they were given.
#[derive(Clone, Debug)]
pub enum Positions {
    /// `float32`.
    Single(Vec<Vec3>),
    /// `float64`.
    Double(Vec<DVec3>),
}

impl Positions {
    /// How many.
    pub fn len(&self) -> usize {
        match self {
            Self::Single(p) => p.len(),
            Self::Double(p) => p.len(),
        }
    }
}

/// A mesh. It is kept in the precision it was given in; the other is made when it is asked for.
#[derive(Debug)]
pub struct Mesh {
    is_double: bool,
    single: OnceLock<Arc<TriangleMesh>>,
    double: OnceLock<Arc<DTriangleMesh>>,
    /// The middle of its box, if it was given in double precision; else the origin.
    center: DVec3,
    centered: OnceLock<Arc<TriangleMesh>>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
}

impl Mesh {
    /// A mesh whose indices are in range and whose attributes are complete or empty.
    pub fn new(positions: Positions, indices: Vec<[u32; 3]>, normals: Vec<Vec3>, uvs: Vec<Vec2>) -> Self {
        let mesh = |is_double| Self {
            is_double,
            single: OnceLock::new(),
            double: OnceLock::new(),
            center: DVec3::ZERO,
            centered: OnceLock::new(),
            normals,
            uvs,
        };
        match positions {
            Positions::Single(positions) => {
                let mesh = mesh(false);
                let made = mesh.single.set(Arc::new(TriangleMesh { positions, indices, ..TriangleMesh::default() }));
                debug_assert!(made.is_ok());
                mesh
            }
            Positions::Double(positions) => {
                let mut mesh = mesh(true);
                let double = DTriangleMesh { positions, indices };
                let bounds = double.bounds();
                // Rounded, so that subtracting it from nearby vertices is exact.
                mesh.center = if bounds.is_empty() { DVec3::ZERO } else { bounds.center().as_vec3().as_dvec3() };
                let made = mesh.double.set(Arc::new(double));
                debug_assert!(made.is_ok());
                mesh
            }
        }
    }

    /// The mesh of a file.
    pub fn read(mut mesh: TriangleMesh) -> Self {
        let normals = std::mem::take(&mut mesh.normals);
        let [uvs, _] = std::mem::take(&mut mesh.uvs);
        Self::new(Positions::Single(mesh.positions), mesh.indices, normals, uvs)
    }

    /// In single precision.
    pub fn single(&self) -> &Arc<TriangleMesh> {
        self.single.get_or_init(|| {
            let double = self.double.get().cloned().unwrap_or_default();
            let positions = double.positions.iter().map(|p| p.as_vec3()).collect();
            Arc::new(TriangleMesh { positions, indices: double.indices.clone(), ..TriangleMesh::default() })
        })
    }

    /// In single precision, with [`Self::center`] as the origin.
    pub fn centered(&self) -> &Arc<TriangleMesh> {
        if !self.is_double {
            return self.single();
        }
        self.centered.get_or_init(|| {
            let positions = self.double().positions.iter().map(|p| (p - self.center).as_vec3()).collect();
            Arc::new(TriangleMesh { positions, indices: self.indices().to_vec(), ..TriangleMesh::default() })
        })
    }

    /// The origin of [`Self::centered`].
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// In double precision.
    pub fn double(&self) -> &Arc<DTriangleMesh> {
        self.double.get_or_init(|| Arc::new(DTriangleMesh::from(&**self.single())))
    }

    /// True if its vertices were given in double precision.
    pub fn is_double(&self) -> bool {
        self.is_double
    }

    /// Three vertex numbers per triangle.
    pub fn indices(&self) -> &[[u32; 3]] {
        if self.is_double { &self.double().indices } else { &self.single().indices }
    }

    /// How many vertices it has.
    pub fn vertex_count(&self) -> usize {
        if self.is_double { self.double().positions.len() } else { self.single().positions.len() }
    }

    /// The corners of a triangle, as they were given.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        if self.is_double {
            self.double().corners(triangle)
        } else {
            self.single().corners(triangle).map(|p| p.as_dvec3())
        }
    }

    /// Normals per vertex, or empty.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// Texture coordinates per vertex, or empty.
    pub fn uvs(&self) -> &[Vec2] {
        &self.uvs
    }

    /// The same mesh with its vertices elsewhere.
    pub fn moved(&self, positions: Positions, normals: Option<Vec<Vec3>>) -> Self {
        let normals = normals.unwrap_or_else(|| self.normals.clone());
        Self::new(positions, self.indices().to_vec(), normals, self.uvs.clone())
    }
}

/// What an object is.
#[derive(Clone, Debug)]
pub enum Kind {
    /// Triangles.
    Mesh(Arc<Mesh>),
    /// An analytic shape.
    Shape(Arc<AnyShape>),
    /// Spheres in bulk.
    Spheres(Arc<Spheres>),
    /// All that another scene held when it was added.
    Instance(Arc<Contents>),
}

/// An object of a scene.
#[derive(Clone, Debug)]
pub struct Object {
    /// What it is.
    pub kind: Kind,
    /// From its coordinates to the scene's. `None`: they are the same, and it was never moved.
    pub transform: Option<Transform>,
    /// For people.
    pub name: Option<String>,
    /// Only rays that share a bit with it meet the object.
    pub mask: u32,
}

/// The place of an object, by its number.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "almost all are the large one")]
pub enum Slot {
    /// There.
    Here(Object),
    /// Removed; whether it had a transform.
    Gone(bool),
}

/// All objects of a scene. Numbers of removed ones stay unused.
#[derive(Clone, Debug, Default)]
pub struct Contents {
    /// By number.
    pub slots: Vec<Slot>,
    /// Cameras of the file the scene was read from.
    pub cameras: Vec<Camera>,
    nesting: usize,
    /// Some mesh has, or had, vertices in double precision.
    has_double: bool,
}

impl Contents {
    /// Adds an object and gives its number.
    pub fn add(&mut self, object: Object) -> PyResult<u32> {
        if let Kind::Instance(child) = &object.kind {
            if child.nesting >= MAX_NESTING {
                let message = format!("scene: instances are nested more than {MAX_NESTING} deep");
                return Err(PyValueError::new_err(message));
            }
            self.nesting = self.nesting.max(child.nesting + 1);
        }
        self.has_double |= match &object.kind {
            Kind::Mesh(mesh) => mesh.is_double(),
            Kind::Instance(child) => child.has_double,
            Kind::Shape(_) | Kind::Spheres(_) => false,
        };
        // The last number means "nothing".
        let number = u32::try_from(self.slots.len()).ok().filter(|&n| n != u32::MAX);
        let number = number.ok_or_else(|| PyValueError::new_err("a scene holds no more than 4294967295 objects"))?;
        self.slots.push(Slot::Here(object));
        Ok(number)
    }

    /// Puts an unused number.
    pub fn add_gap(&mut self) {
        self.slots.push(Slot::Gone(false));
    }

    /// Takes an object out.
    pub fn remove(&mut self, id: i64) -> PyResult<()> {
        let was_placed = self.get_mut(id)?.transform.is_some();
        self.slots[id as usize] = Slot::Gone(was_placed);
        Ok(())
    }

    /// The object with this number.
    pub fn get(&self, id: i64) -> PyResult<&Object> {
        match usize::try_from(id).ok().and_then(|i| self.slots.get(i)) {
            Some(Slot::Here(object)) => Ok(object),
            Some(Slot::Gone(_)) => Err(PyIndexError::new_err(format!("id {id} was removed from the scene"))),
            None => Err(PyIndexError::new_err(format!(
                "id {id} is not in the scene, which has given {} ids",
                self.slots.len()
            ))),
        }
    }

    /// The object with this number, to be changed.
    pub fn get_mut(&mut self, id: i64) -> PyResult<&mut Object> {
        self.get(id)?;
        match &mut self.slots[id as usize] {
            Slot::Here(object) => Ok(object),
            Slot::Gone(_) => unreachable!("it was found above"),
        }
    }

    /// Puts another mesh in the place of one.
    pub fn set_mesh(&mut self, id: i64, mesh: Arc<Mesh>) -> PyResult<()> {
        self.mesh(id)?;
        self.has_double |= mesh.is_double();
        self.get_mut(id)?.kind = Kind::Mesh(mesh);
        Ok(())
    }

    /// The mesh with this number.
    pub fn mesh(&self, id: i64) -> PyResult<&Arc<Mesh>> {
        match &self.get(id)?.kind {
            Kind::Mesh(mesh) => Ok(mesh),
            _ => Err(PyTypeError::new_err(format!("id {id} is not a mesh"))),
        }
    }

    /// The box around everything.
    pub fn bounds(&self) -> Bounds3d {
        self.bounds_with(&mut HashMap::new())
    }

    /// The same; knows the boxes of scenes that were instanced before.
    fn bounds_with(&self, known: &mut HashMap<*const Self, Bounds3d>) -> Bounds3d {
        let mut all = Bounds3d::EMPTY;
        for (_, object) in self.objects() {
            let own = match &object.kind {
                Kind::Mesh(mesh) if mesh.is_double() => mesh.double().bounds(),
                Kind::Mesh(mesh) => mesh.single().bounds().into(),
                Kind::Shape(shape) => shape.bounds(),
                Kind::Spheres(spheres) => {
                    (0..spheres.len()).fold(Bounds3d::EMPTY, |all, i| all.union(&spheres.bounds(i)))
                }
                Kind::Instance(child) => match known.get(&Arc::as_ptr(child)) {
                    Some(bounds) => *bounds,
                    None => {
                        let bounds = child.bounds_with(known);
                        known.insert(Arc::as_ptr(child), bounds);
                        bounds
                    }
                },
            };
            all = all.union(&object.transform.map_or(own, |map| map.bounds(&own)));
        }
        all
    }

    /// True if some mesh, here or in an instance, has vertices in double precision.
    pub fn has_double_meshes(&self) -> bool {
        self.has_double
    }

    /// The objects that are there, with their numbers.
    pub fn objects(&self) -> impl Iterator<Item = (u32, &Object)> {
        self.slots.iter().enumerate().filter_map(|(i, slot)| match slot {
            Slot::Here(object) => Some((i as u32, object)),
            Slot::Gone(_) => None,
        })
    }
}
