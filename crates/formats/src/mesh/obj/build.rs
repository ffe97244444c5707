//! From the lists of an OBJ file to indexed meshes.

use super::parse::{Corner, Face, NONE, ObjFile};
use crate::mesh::normals::{self, CREASE_ANGLE, Smoothing};
use crate::mesh::notes::Notes;
use crate::mesh::polygon::Triangulator;
use crate::mesh::push_polygon;
use crate::{Input, ReadError};
use snell_intersect::TriangleMesh;
use snell_math::{Vec2, Vec3};
use std::collections::HashMap;

/// An object of the file.
pub struct Object {
    pub name: String,
    pub mesh: TriangleMesh,
    /// Numbers of material names by slot; [`NONE`] for no material.
    pub materials: Vec<u32>,
}

/// Makes a mesh of each object that has faces.
pub fn objects(input: &Input, file: &mut ObjFile, notes: &mut Notes) -> Result<Vec<Object>, ReadError> {
    let mut builder = Builder::new(file);
    let mut objects = Vec::new();
    // Faces of one object stand together, unless a name comes back; then it is another object.
    for faces in file.faces.chunk_by(|a, b| a.object == b.object) {
        let mut object = builder.object(input, file, faces, notes)?;
        crate::mesh::note_non_finite(input, &object.mesh, notes);
        let smoothing = std::mem::take(&mut builder.smoothing);
        finish_normals(input, &mut object.mesh, &builder.missing_normals, &smoothing, notes);
        builder.smoothing = smoothing;
        objects.push(object);
    }
    Ok(objects)
}

/// Makes one mesh of everything.
pub fn one_mesh(input: &Input, file: &mut ObjFile, notes: &mut Notes) -> Result<TriangleMesh, ReadError> {
    file.faces.iter_mut().for_each(|f| f.object = 0);
    let mut builder = Builder::new(file);
    let mut mesh = builder.object(input, file, &file.faces, notes)?.mesh;
    if !mesh.normals.is_empty() {
        finish_normals(input, &mut mesh, &builder.missing_normals, &[], notes);
    }
    mesh.material_slots = Vec::new();
    Ok(mesh)
}

/// Computes normals where the file has none, and replaces those that are none.
fn finish_normals(input: &Input, mesh: &mut TriangleMesh, missing: &[u32], smoothing: &[Smoothing], notes: &mut Notes) {
    if mesh.normals.is_empty() {
        normals::smooth(mesh, CREASE_ANGLE, smoothing);
        return;
    }
    if !missing.is_empty() {
        let computed = mesh.computed_normals();
        for &i in missing {
            mesh.normals[i as usize] = computed[i as usize];
        }
    }
    crate::mesh::repair_normals(mesh, input, notes);
}

/// Vertices of one position that are compared one by one; a position with more is looked up in a table.
const LONGEST_CHAIN: u32 = 32;

/// Scratch memory that serves all objects.
struct Builder {
    /// For each position of the file, the latest vertex made from it, and in which object (from 1).
    heads: Vec<(u32, u32)>,
    /// For each material of the file (and one more for none), its slot and in which object.
    slots: Vec<(u32, u16)>,
    object: u32,
    /// For each vertex of the object, the one made before it from the same position, and its corner.
    vertices: Vec<(u32, Corner)>,
    /// Vertices beyond the longest chain, by object and corner. Looked up only.
    overflow: HashMap<(u32, Corner), u32>,
    /// Vertices without a normal in an object that has normals.
    missing_normals: Vec<u32>,
    /// Smoothing of each triangle of the object.
    smoothing: Vec<Smoothing>,
    face: Vec<u32>,
    triangulator: Triangulator,
}

impl Builder {
    fn new(file: &ObjFile) -> Self {
        Self {
            heads: vec![(0, NONE); file.positions.len()],
            slots: vec![(0, 0); file.materials.len() + 1],
            object: 0,
            vertices: Vec::new(),
            overflow: HashMap::new(),
            missing_normals: Vec::new(),
            smoothing: Vec::new(),
            face: Vec::new(),
            triangulator: Triangulator::default(),
        }
    }

    fn object(
        &mut self,
        input: &Input,
        file: &ObjFile,
        faces: &[Face],
        notes: &mut Notes,
    ) -> Result<Object, ReadError> {
        self.object += 1;
        self.vertices.clear();
        self.smoothing.clear();
        let name = faces.first().map_or("", |f| &file.objects[f.object as usize]).to_owned();
        let mut object = Object { name, mesh: TriangleMesh::default(), materials: Vec::new() };
        let mesh = &mut object.mesh;
        mesh.indices.reserve(faces.len());
        let mut start = faces.first().map_or(0, |f| first_corner(file, f));
        for face in faces {
            self.face.clear();
            for &corner in &file.corners[start..face.end] {
                let vertex = self.vertex(corner);
                if vertex as usize == mesh.positions.len() {
                    mesh.positions.push(file.positions[corner.position as usize]);
                }
                self.face.push(vertex);
            }
            start = face.end;
            push_polygon(input, mesh, &self.face, &mut self.triangulator)?;
            let slot = self.slot(input, face.material, &mut object.materials, notes);
            mesh.material_slots.resize(mesh.indices.len(), slot);
            self.smoothing.resize(mesh.indices.len(), smoothing(face.smoothing));
        }
        if object.materials.len() <= 1 {
            mesh.material_slots = Vec::new();
        }
        self.attributes(file, mesh);
        Ok(object)
    }

    /// The vertex for a corner: one that exists, or the next new one.
    fn vertex(&mut self, corner: Corner) -> u32 {
        let head = &mut self.heads[corner.position as usize];
        if head.0 != self.object {
            *head = (self.object, NONE);
        }
        let mut at = head.1;
        let mut steps = 0;
        while at != NONE && steps < LONGEST_CHAIN {
            let (before, known) = self.vertices[at as usize];
            if known == corner {
                return at;
            }
            at = before;
            steps += 1;
        }
        let vertex = self.vertices.len() as u32;
        if steps == LONGEST_CHAIN {
            let known = *self.overflow.entry((self.object, corner)).or_insert(vertex);
            if known != vertex {
                return known;
            }
        }
        self.vertices.push((head.1, corner));
        head.1 = vertex;
        vertex
    }

    fn slot(&mut self, input: &Input, material: u32, materials: &mut Vec<u32>, notes: &mut Notes) -> u16 {
        let last = self.slots.len() - 1;
        let entry = &mut self.slots[(material as usize).min(last)];
        if entry.0 != self.object {
            let slot = u16::try_from(materials.len()).unwrap_or_else(|_| {
                notes.add("many materials", || {
                    format!("{}: more than 65536 materials in one object; the rest share the last", input.name)
                });
                u16::MAX
            });
            *entry = (self.object, slot);
            if materials.len() <= usize::from(slot) {
                materials.push(material);
            }
        }
        entry.1
    }

    /// Gathers the attributes of the vertices made.
    fn attributes(&mut self, file: &ObjFile, mesh: &mut TriangleMesh) {
        let corners = || self.vertices.iter().map(|(_, corner)| corner);
        if !file.colors.is_empty() {
            mesh.colors = corners().map(|c| file.colors[c.position as usize]).collect();
        }
        if corners().any(|c| c.uv != NONE) {
            mesh.uvs[0] = corners().map(|c| file.uvs.get(c.uv as usize).copied().unwrap_or(Vec2::ZERO)).collect();
        }
        self.missing_normals.clear();
        if corners().any(|c| c.normal != NONE) {
            mesh.normals =
                corners().map(|c| file.normals.get(c.normal as usize).copied().unwrap_or(Vec3::ZERO)).collect();
            let missing = self.vertices.iter().enumerate().filter(|(_, (_, c))| c.normal == NONE);
            self.missing_normals.extend(missing.map(|(i, _)| i as u32));
        }
    }
}

fn first_corner(file: &ObjFile, face: &Face) -> usize {
    match file.faces.partition_point(|f| f.end < face.end) {
        0 => 0,
        i => file.faces[i - 1].end,
    }
}

fn smoothing(group: u32) -> Smoothing {
    match group {
        NONE => Smoothing::Angle,
        0 => Smoothing::Flat,
        group => Smoothing::Group(group),
    }
}
