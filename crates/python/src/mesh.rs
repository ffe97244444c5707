//! Meshes of a scene in the precision in which they were given, with their attributes for
//! rendering.

use snell_intersect::{DTriangleMesh, PairError, PairMesh, TriangleMesh, UV_SETS, first_uv_set};
use snell_math::{DVec3, Transform, Vec2, Vec3};
use std::sync::{Arc, OnceLock};

/// Vertices in the precision in which they were given.
#[derive(Clone, Debug)]
pub enum Positions {
    /// Given as `float32`.
    Single(Vec<Vec3>),
    /// Given as `float64`.
    Double(Vec<DVec3>),
}

impl Positions {
    /// Number of vertices.
    pub fn len(&self) -> usize {
        match self {
            Self::Single(p) => p.len(),
            Self::Double(p) => p.len(),
        }
    }
}

/// Attributes of vertices and triangles. Each list is complete or empty.
#[derive(Clone, Debug, Default)]
pub struct Attributes {
    /// Normals per vertex.
    pub normals: Vec<Vec3>,
    /// Texture coordinates per vertex.
    pub uvs: Vec<Vec2>,
    /// The further sets of texture coordinates.
    pub more_uvs: [Vec<Vec2>; UV_SETS - 1],
    /// Linear RGB and alpha per vertex.
    pub colors: Vec<[f32; 4]>,
    /// Material slot per triangle.
    pub material_slots: Vec<u16>,
}

/// A mesh as it is rendered, and the transform to the coordinates of the original mesh.
#[derive(Clone, Debug)]
struct Rendered {
    mesh: Arc<TriangleMesh>,
    placed: Transform,
}

/// A mesh. It is stored in the precision in which it was given; the other precision is computed
/// when needed.
#[derive(Debug)]
pub struct Mesh {
    is_double: bool,
    single: OnceLock<Arc<TriangleMesh>>,
    double: OnceLock<Arc<DTriangleMesh>>,
    /// The centre of the mesh's box, if it was given in double precision; else the origin.
    center: DVec3,
    centered: OnceLock<Arc<TriangleMesh>>,
    attributes: Attributes,
    rendered: OnceLock<Rendered>,
    written: OnceLock<Arc<TriangleMesh>>,
    paired: OnceLock<Arc<PairMesh>>,
}

impl Mesh {
    /// A mesh whose indices are in range and whose attributes are complete or empty.
    pub fn new(positions: Positions, indices: Vec<[u32; 3]>, attributes: Attributes) -> Self {
        let mesh = |is_double| Self {
            is_double,
            single: OnceLock::new(),
            double: OnceLock::new(),
            center: DVec3::ZERO,
            centered: OnceLock::new(),
            attributes,
            rendered: OnceLock::new(),
            written: OnceLock::new(),
            paired: OnceLock::new(),
        };
        match positions {
            Positions::Single(positions) => {
                let mesh = mesh(false);
                let made = mesh.single.set(Arc::new(TriangleMesh {
                    positions,
                    indices,
                    ..TriangleMesh::default()
                }));
                debug_assert!(made.is_ok());
                mesh
            }
            Positions::Double(positions) => {
                let mut mesh = mesh(true);
                let double = DTriangleMesh { positions, indices };
                let bounds = double.bounds();
                // The centre is rounded, so that subtracting it from nearby vertices is exact.
                mesh.center = if bounds.is_empty() {
                    DVec3::ZERO
                } else {
                    bounds.center().as_vec3().as_dvec3()
                };
                let made = mesh.double.set(Arc::new(double));
                debug_assert!(made.is_ok());
                mesh
            }
        }
    }

    /// The mesh of a file with its transform applied in double precision, so that no precision is
    /// lost.
    pub fn read(source: &Arc<TriangleMesh>, placed: &Transform) -> Self {
        let mut attributes = Attributes {
            normals: source.normals.clone(),
            uvs: source.uvs[0].clone(),
            more_uvs: std::array::from_fn(|i| source.uvs[i + 1].clone()),
            colors: source.colors.clone(),
            material_slots: source.material_slots.clone(),
        };
        let mesh = if placed.is_identity() {
            let mut mesh = Self::new(Positions::Single(Vec::new()), Vec::new(), attributes);
            mesh.single = OnceLock::from(source.clone());
            if !source.exact.is_empty() {
                mesh.is_double = true;
                mesh.double = OnceLock::from(Arc::new(DTriangleMesh::from(&**source)));
            }
            mesh
        } else {
            let exact = source.exact_positions();
            let positions = exact.iter().map(|p| placed.point(*p)).collect();
            for n in &mut attributes.normals {
                *n = placed.normal(n.as_dvec3()).normalize_or_zero().as_vec3();
            }
            let mut indices = source.indices.clone();
            if placed.is_mirrored() {
                indices.iter_mut().for_each(|[_, b, c]| std::mem::swap(b, c));
            }
            Self::new(Positions::Double(positions), indices, attributes)
        };
        // The mesh is rendered as it was read.
        let _ = mesh.rendered.set(Rendered { mesh: source.clone(), placed: *placed });
        mesh
    }

    /// The mesh in single precision.
    pub fn single(&self) -> &Arc<TriangleMesh> {
        self.single.get_or_init(|| {
            let double = self.double.get().cloned().unwrap_or_default();
            let positions = double.positions.iter().map(|p| p.as_vec3()).collect();
            Arc::new(TriangleMesh {
                positions,
                indices: double.indices.clone(),
                ..TriangleMesh::default()
            })
        })
    }

    /// The mesh in single precision, with `center` as the origin.
    fn centered(&self) -> &Arc<TriangleMesh> {
        if !self.is_double {
            return self.single();
        }
        self.centered.get_or_init(|| {
            let positions =
                self.double().positions.iter().map(|p| (p - self.center).as_vec3()).collect();
            Arc::new(TriangleMesh {
                positions,
                indices: self.indices().to_vec(),
                ..TriangleMesh::default()
            })
        })
    }

    /// The mesh in double precision.
    pub fn double(&self) -> &Arc<DTriangleMesh> {
        self.double.get_or_init(|| Arc::new(DTriangleMesh::from(&**self.single())))
    }

    /// [`Self::rendered`], with the positions in double precision if this mesh has them.
    pub fn written(&self) -> (Arc<TriangleMesh>, Transform) {
        let (rendered, placed) = self.rendered();
        let is_exact = !self.is_double || !rendered.exact.is_empty();
        let written = self.written.get_or_init(|| match is_exact {
            true => rendered,
            false => {
                let exact = |p: &DVec3| placed.inverse().point(*p);
                let exact = self.double().positions.iter().map(exact).collect();
                Arc::new(TriangleMesh { exact, ..TriangleMesh::clone(&rendered) })
            }
        });
        (written.clone(), placed)
    }

    /// The mesh as it is rendered, with all attributes, and the map from its coordinates to those
    /// of this mesh.
    pub fn rendered(&self) -> (Arc<TriangleMesh>, Transform) {
        let Rendered { mesh, placed } = self.rendered.get_or_init(|| {
            let Attributes { normals, uvs, more_uvs, colors, material_slots } =
                self.attributes.clone();
            let bare = self.centered();
            let is_bare = normals.is_empty()
                && uvs.is_empty()
                && colors.is_empty()
                && material_slots.is_empty();
            let mesh = if is_bare {
                bare.clone()
            } else {
                Arc::new(TriangleMesh {
                    normals,
                    uvs: {
                        let mut sets = first_uv_set(uvs);
                        sets[1..].clone_from_slice(&more_uvs);
                        sets
                    },
                    colors,
                    material_slots,
                    ..TriangleMesh::clone(bare)
                })
            };
            Rendered { mesh, placed: Transform::translation(self.center) }
        });
        (mesh.clone(), *placed)
    }

    /// True if the vertices were given in double precision.
    pub fn is_double(&self) -> bool {
        self.is_double
    }

    /// Three vertex numbers per triangle.
    pub fn indices(&self) -> &[[u32; 3]] {
        if self.is_double { &self.double().indices } else { &self.single().indices }
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        if self.is_double { self.double().positions.len() } else { self.single().positions.len() }
    }

    /// The corners of a triangle in the precision in which they were given.
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        if self.is_double {
            self.double().corners(triangle)
        } else {
            self.single().corners(triangle).map(|p| p.as_dvec3())
        }
    }

    /// Prepares the mesh for questions about pairs. It is kept, wherever the mesh is moved to.
    pub fn prepare_pairs(&self) -> Result<Arc<PairMesh>, PairError> {
        if let Some(paired) = self.paired.get() {
            return Ok(paired.clone());
        }
        // The cell is not locked meanwhile: a thread that waits for parallel work might do other
        // work that waits for the cell.
        let triangles: Vec<_> = (0..self.indices().len()).map(|i| self.corners(i)).collect();
        let made = Arc::new(PairMesh::new(&triangles)?);
        Ok(self.paired.get_or_init(|| made).clone())
    }

    /// Attributes of vertices and triangles.
    pub fn attributes(&self) -> &Attributes {
        &self.attributes
    }

    /// A copy of the mesh with other vertices and, if given, other normals.
    pub fn moved(&self, positions: Positions, normals: Option<Vec<Vec3>>) -> Self {
        let mut attributes = self.attributes.clone();
        if let Some(normals) = normals {
            attributes.normals = normals;
        }
        Self::new(positions, self.indices().to_vec(), attributes)
    }
}
