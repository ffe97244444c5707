//! Indexed triangle meshes.

use rayon::prelude::*;
use snell_math::{Bounds3, Bounds3d, DVec3, Transform, Vec2, Vec3, Vec4};
use std::borrow::Cow;

/// Number of sets of texture coordinates that a mesh may have.
pub const UV_SETS: usize = 4;

/// A set of texture coordinates as the first one of a mesh, which has no others.
pub fn first_uv_set(uvs: Vec<Vec2>) -> [Vec<Vec2>; UV_SETS] {
    let mut sets: [Vec<Vec2>; UV_SETS] = Default::default();
    sets[0] = uvs;
    sets
}

/// A triangle mesh. Attributes are per vertex; absent ones are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions. Triangles with a non-finite vertex are never hit.
    pub positions: Vec<Vec3>,
    /// Three vertex numbers per triangle; the right-hand rule gives the outer side.
    pub indices: Vec<[u32; 3]>,
    /// Vertex normals of any length but zero. Empty for a mesh that is shaded flat.
    pub normals: Vec<Vec3>,
    /// Unit tangents with the sign of the bitangent in `w` (as in glTF), or empty.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets, each empty or one entry per vertex. Whether `v` grows upwards
    /// depends on the texture.
    pub uvs: [Vec<Vec2>; UV_SETS],
    /// Linear RGB and alpha per vertex, or empty.
    pub colors: Vec<[f32; 4]>,
    /// Material slot per triangle, or empty: then every triangle has slot 0.
    pub material_slots: Vec<u16>,
    /// The vertex positions in double precision, of which `positions` are rounded copies. Empty if
    /// those are all that is known.
    pub exact: Vec<DVec3>,
}

/// Errors of an invalid mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// An index points past the vertices.
    #[error("triangle {triangle} refers to vertex {index}, but there are only {vertices} vertices")]
    IndexOutOfRange {
        /// The first triangle with an invalid index.
        triangle: usize,
        /// The invalid index.
        index: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// An attribute array has the wrong length.
    #[error("attribute {attribute} has {found} entries, expected {expected} (one per {per})")]
    AttributeLength {
        /// Name of the attribute.
        attribute: &'static str,
        /// Entries found.
        found: usize,
        /// Entries expected.
        expected: usize,
        /// "vertex", "triangle" or "quad".
        per: &'static str,
    },
}

/// A triangle mesh in double precision, without attributes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DTriangleMesh {
    /// Vertex positions. Triangles with a non-finite vertex are never hit.
    pub positions: Vec<DVec3>,
    /// Three vertex numbers per triangle; the right-hand rule gives the outer side.
    pub indices: Vec<[u32; 3]>,
}

impl DTriangleMesh {
    /// Checks that all indices are in range.
    pub fn validate(&self) -> Result<(), MeshError> {
        check_indices(&self.indices, self.positions.len())
    }

    /// The smallest box around all finite vertices that triangles use.
    pub fn bounds(&self) -> Bounds3d {
        Bounds3d::of(
            self.indices
                .iter()
                .flatten()
                .map(|&i| self.positions[i as usize])
                .filter(|p| p.is_finite()),
        )
    }

    /// Positions of the three corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.indices[triangle].map(|i| self.positions[i as usize])
    }

    /// True for a triangle that can never be hit, because a vertex is not finite or two vertices
    /// coincide.
    pub fn is_degenerate(&self, triangle: usize) -> bool {
        let [a, b, c] = self.corners(triangle);
        !(a.is_finite() && b.is_finite() && c.is_finite()) || a == b || b == c || c == a
    }
}

impl From<&TriangleMesh> for DTriangleMesh {
    fn from(mesh: &TriangleMesh) -> Self {
        Self { positions: mesh.exact_positions().into_owned(), indices: mesh.indices.clone() }
    }
}

/// Returns an error for indices that point past the vertices.
fn check_indices(indices: &[[u32; 3]], vertices: usize) -> Result<(), MeshError> {
    for (triangle, indices) in indices.iter().enumerate() {
        if let Some(&index) = indices.iter().find(|&&i| i as usize >= vertices) {
            return Err(MeshError::IndexOutOfRange { triangle, index, vertices });
        }
    }
    Ok(())
}

/// True for the corners of a triangle that can never be hit; see [`TriangleMesh::is_degenerate`].
#[inline(always)]
pub(crate) fn are_degenerate(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|v| v.extend(0.0));
    // Differences of finite numbers may overflow, so finiteness is tested by multiplying by 0: the
    // products are 0 if all numbers are finite, and otherwise NaN.
    let finite = (a * 0.0 + b * 0.0 + c * 0.0) == Vec4::ZERO;
    !finite || a == b || b == c || c == a
}

/// The bounding box of a triangle that acceleration structures use: padded by `1e-6` of its largest
/// extent and a unit in the last place. The hit test projects the triangle along the ray, and
/// rounding in that projection may move it out of the exact box by less than this padding.
#[inline(always)]
pub(crate) fn padded_bounds([a, b, c]: &[Vec3; 3]) -> Bounds3 {
    let (low, high) = (a.min(*b).min(*c), a.max(*b).max(*c));
    let size = high - low;
    let padding = size.x.max(size.y).max(size.z) * 1e-6 + f32::MIN_POSITIVE;
    let (down, up) = (low.abs() * f32::EPSILON + padding, high.abs() * f32::EPSILON + padding);
    Bounds3 { min: (low - down).max(Vec3::MIN), max: (high + up).min(Vec3::MAX) }
}

impl TriangleMesh {
    /// Checks that all indices are in range and all attributes are empty or complete.
    pub fn validate(&self) -> Result<(), MeshError> {
        let vertices = self.positions.len();
        check_indices(&self.indices, vertices)?;
        let check = |attribute, found: usize, expected: usize, per| {
            if found == 0 || found == expected {
                Ok(())
            } else {
                Err(MeshError::AttributeLength { attribute, found, expected, per })
            }
        };
        check("normals", self.normals.len(), vertices, "vertex")?;
        check("tangents", self.tangents.len(), vertices, "vertex")?;
        for (uvs, name) in self.uvs.iter().zip(["uvs[0]", "uvs[1]", "uvs[2]", "uvs[3]"]) {
            check(name, uvs.len(), vertices, "vertex")?;
        }
        check("colors", self.colors.len(), vertices, "vertex")?;
        check("exact", self.exact.len(), vertices, "vertex")?;
        check("material_slots", self.material_slots.len(), self.indices.len(), "triangle")
    }

    /// The smallest box around all finite vertices that triangles use.
    pub fn bounds(&self) -> Bounds3 {
        self.survey().0
    }

    /// Returns [`Self::bounds`] and [`Self::degenerate_triangles`] from one pass over all
    /// triangles.
    pub(crate) fn survey(&self) -> (Bounds3, usize) {
        let of = |indices: &[[u32; 3]]| {
            let (mut low, mut high, mut degenerate) = (Vec4::INFINITY, Vec4::NEG_INFINITY, 0);
            for triangle in indices {
                let corners = triangle.map(|i| self.positions[i as usize]);
                if are_degenerate(&corners) {
                    degenerate += 1;
                    for v in corners.into_iter().filter(|v| v.is_finite()) {
                        (low, high) = (low.min(v.extend(0.0)), high.max(v.extend(0.0)));
                    }
                } else {
                    let [a, b, c] = corners.map(|v| v.extend(0.0));
                    (low, high) = (low.min(a.min(b).min(c)), high.max(a.max(b).max(c)));
                }
            }
            (Bounds3 { min: low.truncate(), max: high.truncate() }, degenerate)
        };
        let nothing = || (Bounds3::EMPTY, 0);
        self.indices
            .par_chunks(1 << 12)
            .map(of)
            .reduce(nothing, |a, b| (a.0.union(&b.0), a.1 + b.1))
    }

    /// Positions of the three corners of a triangle.
    #[inline(always)]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        let [a, b, c] = self.indices[triangle];
        [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]
    }

    /// The bounding box of a triangle that acceleration structures use, padded by about `1e-6` of
    /// its largest extent.
    pub fn padded_bounds(&self, triangle: usize) -> Bounds3 {
        padded_bounds(&self.corners(triangle))
    }

    /// Number of triangles that can never be hit ([`Self::is_degenerate`]).
    pub fn degenerate_triangles(&self) -> usize {
        self.survey().1
    }

    /// True for a triangle that can never be hit, because a vertex is not finite or two vertices
    /// coincide.
    ///
    /// A triangle whose three different vertices lie on a line is not degenerate in this sense.
    /// Projected along a ray it may still cover a small area, which no other triangle of a closed
    /// mesh covers (rounding the coordinates of far-away meshes makes such triangles).
    pub fn is_degenerate(&self, triangle: usize) -> bool {
        are_degenerate(&self.corners(triangle))
    }

    /// The vertex positions in the best precision that is known.
    pub fn exact_positions(&self) -> Cow<'_, [DVec3]> {
        match self.exact.is_empty() {
            true => self.positions.iter().map(|p| p.as_dvec3()).collect::<Vec<_>>().into(),
            false => Cow::Borrowed(&self.exact),
        }
    }

    /// Drops the positions in double precision if they are those in single precision.
    pub fn drop_needless_exact(&mut self) {
        // Numbers that are not finite have no digits to lose.
        let same = |(p, exact): (&Vec3, &DVec3)| p.as_dvec3() == *exact || !exact.is_finite();
        if self.positions.iter().zip(&self.exact).all(same) {
            self.exact = Vec::new();
        }
    }

    /// The mesh transformed by `transform`. Positions are computed in double precision and rounded
    /// once, normals by the inverse transpose, and tangents as vectors. A mirroring transform also
    /// reverses the vertex order of the triangles, so that their outer side stays outside.
    pub fn transformed(&self, transform: &Transform) -> Self {
        let mut mesh = self.clone();
        for p in &mut mesh.positions {
            *p = transform.point(p.as_dvec3()).as_vec3();
        }
        for (exact, p) in mesh.exact.iter_mut().zip(&mut mesh.positions) {
            *exact = transform.point(*exact);
            *p = exact.as_vec3();
        }
        for n in &mut mesh.normals {
            *n = transform.normal(n.as_dvec3()).normalize_or_zero().as_vec3();
        }
        for t in &mut mesh.tangents {
            *t =
                transform.vector(t.truncate().as_dvec3()).normalize_or_zero().as_vec3().extend(t.w);
        }
        if transform.is_mirrored() {
            for [_, b, c] in &mut mesh.indices {
                std::mem::swap(b, c);
            }
            for t in &mut mesh.tangents {
                t.w = -t.w;
            }
        }
        mesh
    }

    /// Unit vertex normals: the angle-weighted mean of the adjacent triangles (Thürmer and
    /// Wüthrich, 1998). Vertices without a proper triangle get `+z`.
    pub fn computed_normals(&self) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for triangle in &self.indices {
            let p = triangle.map(|i| self.positions[i as usize]);
            let Some(normal) = (p[1] - p[0]).cross(p[2] - p[0]).try_normalize() else { continue };
            for k in 0..3 {
                let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                sums[triangle[k] as usize] += normal * a.angle_between(b);
            }
        }
        sums.into_iter().map(|n| n.try_normalize().unwrap_or(Vec3::Z)).collect()
    }
}
