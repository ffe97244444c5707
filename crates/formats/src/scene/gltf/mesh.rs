//! Primitives: converts vertex attributes and indices to a triangle mesh.

use super::accessor::{Accessor, Component};
use super::draco::Unpacked;
use super::json::Json;
use super::material::{FIRST_UV_SETS, uv_sets, variant};
use super::topology::Topology;
use super::{Reader, morph, skin};
use crate::ReadError;
use crate::strokes::Strokes;
use snell_intersect::{TriangleMesh, UV_SETS};
use snell_math::{Vec2, Vec3, Vec4};
use snell_scene::Warning;
use snell_scene::motion::{InfluenceSet, MorphTarget, make_usable};

/// A primitive and everything needed to show it.
pub(super) struct Primitive {
    /// The undeformed triangles; final if there are no targets.
    pub mesh: TriangleMesh,
    /// Morph targets, in the order of the mesh's weights.
    pub targets: Vec<MorphTarget>,
    /// Joints that move the vertices; empty if the primitive cannot be skinned.
    pub influences: Vec<InfluenceSet>,
    /// The points and lines of the vertices, of a primitive without triangles.
    pub strokes: Option<Strokes>,
    /// Index in the table of materials.
    pub material: Option<usize>,
}

/// Reads the primitives of a mesh that can be shown. `weights` are the weights of the morph
/// targets; `all_targets` is true if these weights change, and then all targets are read.
pub(super) fn read_primitives(
    reader: &mut Reader,
    mesh: &Json,
    weights: &[f64],
    all_targets: bool,
) -> Result<Vec<Primitive>, ReadError> {
    let mut primitives = Vec::new();
    for json in mesh.require("primitives")?.items()? {
        let topology = Topology::of(&json)?;
        primitives.extend(read_primitive(reader, &json, topology, weights, all_targets)?);
    }
    Ok(primitives)
}

fn read_primitive(
    reader: &mut Reader,
    json: &Json,
    topology: Topology,
    weights: &[f64],
    all_targets: bool,
) -> Result<Option<Primitive>, ReadError> {
    let attributes = json.get("attributes")?;
    let positions = attributes.as_ref().map_or(Ok(None), |a| a.get("POSITION"))?;
    let (Some(attributes), Some(positions)) = (attributes, positions) else {
        let place = json.place();
        reader.scene.warn(format!("{place}: a primitive without positions is not shown"));
        return Ok(None);
    };
    let attributes =
        Attributes { unpacked: Unpacked::of(reader, json, &attributes)?, json: attributes };
    let vertices = match &attributes.unpacked {
        Some(unpacked) => unpacked.vertices(),
        None => reader.accessors.get(&positions)?.count,
    };
    reader.vertices += vertices;
    if reader.vertices > reader.input.options.limits.elements {
        let limit = reader.input.options.limits.elements;
        return Err(positions
            .error_with(format!("the scene has more than {limit} vertices"), "split the scene"));
    }
    let material = variant::material(reader, json)?;
    let uv_sets = match material {
        Some(index) => uv_sets(&reader.root.at(&format!("/materials/{index}"))?),
        None => FIRST_UV_SETS,
    };
    let mut mesh = TriangleMesh::default();
    if let Some(accessor) = attributes.get(reader, "POSITION", vertices)? {
        mesh.positions = vectors(&accessor, Vec3::from_array)?;
    }
    read_attributes(reader, &attributes, uv_sets, &mut mesh)?;
    let influences = skin::influences(reader, &attributes, vertices)?;
    let targets = morph::targets(reader, json, weights, all_targets, &mesh)?;
    let mut strokes = None;
    mesh.indices = match &attributes.unpacked {
        Some(unpacked) => unpacked.triangles(),
        None => {
            let indices = read_indices(reader, json, vertices)?;
            strokes = topology.strokes(&indices);
            topology.triangles(&indices)
        }
    };
    repair_tangents(reader, &mut mesh);
    if targets.is_empty() {
        make_usable(&mut mesh);
    }
    Ok(Some(Primitive { mesh, targets, influences, strokes, material }))
}

/// Gives tangents along the texture coordinates to vertices whose own have no direction, which
/// exporters write where they found none.
fn repair_tangents(reader: &mut Reader, mesh: &mut TriangleMesh) {
    let is_bad = |t: &Vec4| !t.is_finite() || t.truncate().length_squared() < 1e-12;
    let bad = mesh.tangents.iter().filter(|t| is_bad(t)).count() as u64;
    if bad == 0 {
        return;
    }
    if mesh.uvs[0].is_empty() {
        mesh.tangents.clear();
        return;
    }
    let mut along = vec![Vec3::ZERO; mesh.positions.len()];
    let mut mirrored = vec![0.0f32; mesh.positions.len()];
    for triangle in &mesh.indices {
        let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
        let [s, t, u] = triangle.map(|i| mesh.uvs[0][i as usize]);
        let (ts, us) = (t - s, u - s);
        let area = ts.perp_dot(us);
        let tangent = ((b - a) * us.y - (c - a) * ts.y) * area.signum();
        if tangent.is_finite() && area != 0.0 {
            for &i in triangle {
                along[i as usize] += tangent;
                mirrored[i as usize] += area;
            }
        }
    }
    for (i, tangent) in mesh.tangents.iter_mut().enumerate().filter(|(_, t)| is_bad(t)) {
        let normal = mesh.normals[i].normalize_or_zero();
        let flat = along[i] - normal * normal.dot(along[i]);
        let direction = flat.try_normalize().unwrap_or_else(|| normal.any_orthogonal_vector());
        // `v` of glTF grows downwards, and the bitangent is along the rows of the picture upwards.
        let sign = if mirrored[i] > 0.0 { -1.0 } else { 1.0 };
        *tangent = direction.try_normalize().unwrap_or(Vec3::X).extend(sign);
    }
    let message = "tangents have no direction; those of the texture coordinates were taken";
    Warning::note(&mut reader.scene.warnings, message.into(), bad);
}

/// The attributes of a primitive.
pub(super) struct Attributes<'a> {
    /// Their accessors, by name.
    json: Json<'a>,
    /// Their values, if they are compressed.
    unpacked: Option<Unpacked>,
}

impl Attributes<'_> {
    /// The accessor of an attribute, with one element per vertex.
    pub fn get<'s, 'a>(
        &self,
        reader: &'s Reader<'a>,
        name: &str,
        vertices: usize,
    ) -> Result<Option<Accessor<'s, 'a>>, ReadError> {
        if let (Some(unpacked), Some(index)) = (&self.unpacked, self.json.get(name)?) {
            let width = reader.accessors.describe(&index)?.width;
            if let Some((values, component)) = unpacked.values(name, width) {
                return reader.accessors.unpacked(&index, values, component).map(Some);
            }
        }
        attribute(reader, &self.json, name, vertices)
    }
}

/// All attributes but positions. The mesh gets the texture coordinates of `uv_sets`.
fn read_attributes(
    reader: &Reader,
    attributes: &Attributes,
    uv_sets: [usize; UV_SETS],
    mesh: &mut TriangleMesh,
) -> Result<(), ReadError> {
    let vertices = mesh.positions.len();
    if let Some(accessor) = attributes.get(reader, "NORMAL", vertices)? {
        mesh.normals = vectors(&accessor, Vec3::from_array)?;
        // Without normals the standard requires flat shading, and tangents are ignored.
        if let Some(accessor) = attributes.get(reader, "TANGENT", vertices)? {
            mesh.tangents = vectors(&accessor, Vec4::from_array)?;
        }
    }
    for (place, set) in uv_sets.into_iter().enumerate() {
        if let Some(accessor) = attributes.get(reader, &format!("TEXCOORD_{set}"), vertices)? {
            mesh.uvs[place] = vectors(&accessor, Vec2::from_array)?;
        }
    }
    if let Some(accessor) = attributes.get(reader, "COLOR_0", vertices)? {
        let accessor = accessor.into_fractions();
        mesh.colors = match accessor.width {
            3 => vectors(&accessor, |[r, g, b]| [r, g, b, 1.0])?,
            _ => vectors(&accessor, |rgba: [f32; 4]| rgba)?,
        };
    }
    Ok(())
}

/// The accessor of an attribute, with one element per vertex.
pub(super) fn attribute<'s, 'a>(
    reader: &'s Reader<'a>,
    attributes: &Json,
    name: &str,
    vertices: usize,
) -> Result<Option<Accessor<'s, 'a>>, ReadError> {
    let Some(index) = attributes.get(name)? else { return Ok(None) };
    let accessor = reader.accessors.get(&index)?;
    if accessor.count != vertices {
        return Err(index.error(format!(
            "its accessor has {} elements, but there are {vertices} positions; every attribute \
                needs one per vertex",
            accessor.count
        )));
    }
    if accessor.component == Component::U32 {
        return Err(index.error("32-bit integers are not possible for vertex attributes"));
    }
    Ok(Some(accessor))
}

fn vectors<const N: usize, T>(
    accessor: &Accessor,
    make: impl Fn([f32; N]) -> T,
) -> Result<Vec<T>, ReadError> {
    Ok(accessor.vectors()?.into_iter().map(make).collect())
}

/// The vertex numbers of a primitive, each in range; without indices, all vertices in turn.
fn read_indices(reader: &Reader, json: &Json, vertices: usize) -> Result<Vec<u32>, ReadError> {
    let Some(index) = json.get("indices")? else {
        let vertices = u32::try_from(vertices)
            .map_err(|_| json.error("more vertices than 32-bit numbers can count"))?;
        return Ok((0..vertices).collect());
    };
    let accessor = reader.accessors.get(&index)?;
    let indices = accessor.indices()?;
    match indices.iter().position(|&i| i as usize >= vertices) {
        None => Ok(indices),
        Some(at) => Err(index.error(format!(
            "index {at} is {}, but there are only {vertices} vertices (strips cannot be restarted \
                in glTF)",
            indices[at]
        ))),
    }
}

/// Removes vertices that no triangle uses, if they are more than half: exporters let many
/// primitives share one large array.
pub(super) fn drop_unused(primitive: &mut Primitive) {
    const UNUSED: u32 = u32::MAX;
    if primitive.strokes.is_some() {
        return;
    }
    let mesh = &mut primitive.mesh;
    let mut new_number = vec![UNUSED; mesh.positions.len()];
    for &i in mesh.indices.iter().flatten() {
        new_number[i as usize] = 0;
    }
    let used: Vec<usize> = (0..new_number.len()).filter(|&i| new_number[i] != UNUSED).collect();
    if used.len() > mesh.positions.len() / 2 {
        return;
    }
    for (number, &i) in (0..).zip(&used) {
        new_number[i] = number;
    }
    keep(&mut mesh.positions, &used);
    keep(&mut mesh.normals, &used);
    keep(&mut mesh.tangents, &used);
    mesh.uvs.iter_mut().for_each(|uvs| keep(uvs, &used));
    keep(&mut mesh.colors, &used);
    for i in mesh.indices.iter_mut().flatten() {
        *i = new_number[*i as usize];
    }
    for target in &mut primitive.targets {
        keep(&mut target.positions, &used);
        keep(&mut target.normals, &used);
        keep(&mut target.tangents, &used);
    }
    for set in &mut primitive.influences {
        keep(&mut set.joints, &used);
        keep(&mut set.weights, &used);
    }
}

/// Keeps the elements at these indices, if there are any.
fn keep<T: Copy>(values: &mut Vec<T>, places: &[usize]) {
    if !values.is_empty() {
        *values = places.iter().map(|&i| values[i]).collect();
    }
}
