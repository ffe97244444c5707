//! Attributes of meshes, which become vertex colours or texture coordinates.

use crate::Input;
use crate::ReadError;
use crate::mesh::{Attribute, ply_attribute, vertices_at};
use snell_intersect::TriangleMesh;
use snell_math::{Rgb, Vec2};

/// What an attribute is shown as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// A colour: vertex colours.
    Color,
    /// A number: the first of the second texture coordinates.
    Number,
}

/// The values of an attribute for each triangle.
#[derive(Debug)]
pub struct OnTriangles {
    use_as: Use,
    values: Vec<Rgb>,
}

/// What became of an attribute that a surface shows.
pub enum Shown {
    /// It is on the vertices.
    OnVertices,
    /// It must be put on the triangles when the vertices are complete.
    OnTriangles(OnTriangles),
    /// The mesh has no such attribute.
    Missing,
    /// The mesh has this number of values of the attribute, and another number of vertices or
    /// triangles.
    Misfit(usize),
}

/// Puts the attribute of this name, such as `face_color`, on a mesh that was just read. `faces` is
/// the number of triangles that each face of the file became, if not 1.
pub fn show(
    input: &Input,
    mesh: &mut TriangleMesh,
    faces: Option<&[u32]>,
    name: &str,
    use_as: Use,
) -> Result<Shown, ReadError> {
    let (element, own_name) = name.split_once('_').unwrap_or(("", name));
    if let Some(attribute) = ply_attribute(input, element, own_name)? {
        let values = colors(&attribute);
        if element == "face" {
            let values = match faces {
                Some(counts) => repeated(&values, counts),
                None => values,
            };
            if values.len() != mesh.indices.len() {
                return Ok(Shown::Misfit(values.len()));
            }
            return Ok(Shown::OnTriangles(OnTriangles { use_as, values }));
        }
        let count = values.len();
        let fits = put(mesh, use_as, values);
        return Ok(if fits { Shown::OnVertices } else { Shown::Misfit(count) });
    }
    if name == "vertex_color" && !mesh.colors.is_empty() {
        if use_as == Use::Number {
            let values = mesh.colors.iter().map(|[r, g, b, _]| Rgb::new(*r, *g, *b)).collect();
            put(mesh, use_as, values);
        }
        return Ok(Shown::OnVertices);
    }
    Ok(Shown::Missing)
}

/// The values of an attribute as colours; those of one channel are grey.
fn colors(attribute: &Attribute) -> Vec<Rgb> {
    let color = |values: &[f32]| match values {
        [r, g, b, ..] => Rgb::new(*r, *g, *b),
        [x, ..] => Rgb::splat(*x),
        [] => Rgb::WHITE,
    };
    attribute.values.chunks_exact(attribute.channels).map(color).collect()
}

/// Each value as often as its count says.
fn repeated(values: &[Rgb], counts: &[u32]) -> Vec<Rgb> {
    let pairs = values.iter().zip(counts);
    pairs.flat_map(|(value, count)| std::iter::repeat_n(*value, *count as usize)).collect()
}

/// Puts values on the vertices and returns true, if there is one for each.
fn put(mesh: &mut TriangleMesh, use_as: Use, values: Vec<Rgb>) -> bool {
    if values.len() != mesh.positions.len() {
        return false;
    }
    match use_as {
        Use::Color => mesh.colors = values.iter().map(|c| [c.r, c.g, c.b, 1.0]).collect(),
        Use::Number => mesh.uvs[1] = values.iter().map(|c| Vec2::new(c.luminance(), 0.0)).collect(),
    }
    true
}

impl OnTriangles {
    /// Puts the values on the triangles of a mesh, which get vertices of their own.
    pub fn put(&self, mesh: &mut TriangleMesh) {
        if self.values.len() == mesh.indices.len() {
            part_triangles(mesh);
            put(mesh, self.use_as, self.values.iter().flat_map(|value| [*value; 3]).collect());
        }
    }
}

/// Gives each triangle vertices of its own.
fn part_triangles(mesh: &mut TriangleMesh) {
    let indices = (0..mesh.indices.len() as u32).map(|t| [0, 1, 2].map(|k| 3 * t + k)).collect();
    *mesh = TriangleMesh { indices, ..vertices_at(mesh, mesh.indices.as_flattened()) };
}
