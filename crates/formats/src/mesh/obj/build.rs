//! Builds indexed meshes from the lists of an OBJ file.

use super::file::{Corner, Faces, NONE, ObjFile, State};
use crate::mesh::normals::{self, CREASE_ANGLE, Smoothing};
use crate::mesh::notes::Notes;
use crate::mesh::polygon::Triangulator;
use crate::mesh::push_polygon;
use crate::{Input, ReadError};
use snell_intersect::TriangleMesh;
use snell_math::{Vec2, Vec3};
use std::collections::HashMap;
use std::ops::Range;

/// An object of the file.
pub struct Object {
    pub name: String,
    pub mesh: TriangleMesh,
    /// Numbers of material names by slot; [`NONE`] for no material.
    pub materials: Vec<u32>,
}

/// Makes a mesh of each object that has faces, and consumes the faces of the file.
pub fn objects(
    input: &Input,
    file: &mut ObjFile,
    notes: &mut Notes,
) -> Result<Vec<Object>, ReadError> {
    let mut builder = Builder::new(file);
    let mut objects = Vec::new();
    let mut finish =
        |builder: &mut Builder, object: Option<Object>, file: &ObjFile, notes: &mut Notes| {
            let Some(mut object) = object else { return };
            builder.finish(file, &mut object);
            finish_normals(
                input,
                &mut object.mesh,
                &builder.missing_normals,
                &builder.smoothing,
                notes,
            );
            objects.push(object);
        };
    let (mut object, mut number) = (None, None);
    for (faces, runs) in std::mem::take(&mut file.pieces) {
        let mut ranges = faces.ranges();
        for run in runs {
            // Faces of one object are contiguous. If a name occurs again later, that is another
            // object.
            if run.state.object != number {
                finish(&mut builder, object.take(), file, notes);
                number = run.state.object;
            }
            let object = object.get_or_insert_with(|| builder.start(file, run.state));
            let polygons = ranges.by_ref().take(run.faces);
            builder.add(input, file, (&faces, polygons), run.state, object, notes)?;
        }
    }
    finish(&mut builder, object, file, notes);
    Ok(objects)
}

/// Makes one object of all faces, and consumes them.
pub fn one_object(
    input: &Input,
    file: &mut ObjFile,
    notes: &mut Notes,
) -> Result<Object, ReadError> {
    let mut builder = Builder::new(file);
    let mut object = builder.start(file, State::default());
    for (faces, runs) in std::mem::take(&mut file.pieces) {
        let mut ranges = faces.ranges();
        for run in runs {
            let polygons = ranges.by_ref().take(run.faces);
            builder.add(input, file, (&faces, polygons), run.state, &mut object, notes)?;
        }
    }
    builder.finish(file, &mut object);
    if !object.mesh.normals.is_empty() {
        finish_normals(input, &mut object.mesh, &builder.missing_normals, &[], notes);
    }
    Ok(object)
}

/// Computes normals where the file has none, and replaces invalid ones.
fn finish_normals(
    input: &Input,
    mesh: &mut TriangleMesh,
    missing: &[u32],
    smoothing: &[Smoothing],
    notes: &mut Notes,
) {
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

/// Up to this many vertices of one position are compared one by one; a position with more uses a
/// hash table.
const LONGEST_CHAIN: u32 = 32;

/// Scratch memory that serves all objects.
struct Builder {
    /// For each position of the file, the latest vertex made from it, and the number of that
    /// vertex's object (from 1).
    heads: Vec<(u32, u32)>,
    /// For each material of the file (and one more for none), its slot and the number of the object
    /// that has the slot.
    slots: Vec<(u32, u16)>,
    /// The number of the object that is being built, from 1.
    object: u32,
    /// For each vertex of the object, the previous vertex made from the same position, and the
    /// vertex's corner.
    vertices: Vec<(u32, Corner)>,
    /// Vertices beyond the longest chain, by object and corner. Never iterated, so order does not
    /// matter.
    overflow: HashMap<(u32, Corner), u32>,
    /// Vertices without a normal in an object that has normals.
    missing_normals: Vec<u32>,
    /// Smoothing of each triangle of the object; empty if the file has no `s` statement.
    smoothing: Vec<Smoothing>,
    /// Number of triangles of the object before the current faces.
    smoothed: usize,
    /// The vertices of the current polygon.
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
            smoothed: 0,
            face: Vec::new(),
            triangulator: Triangulator::default(),
        }
    }

    /// Begins an object.
    fn start(&mut self, file: &ObjFile, state: State) -> Object {
        self.object += 1;
        self.vertices.clear();
        self.smoothing.clear();
        self.smoothed = 0;
        let name = state.object.map_or("", |object| &file.objects[object as usize]).to_owned();
        Object { name, mesh: TriangleMesh::default(), materials: Vec::new() }
    }

    /// Adds faces that have the same state.
    fn add(
        &mut self,
        input: &Input,
        file: &ObjFile,
        (faces, polygons): (&Faces, impl Iterator<Item = Range<usize>>),
        state: State,
        object: &mut Object,
        notes: &mut Notes,
    ) -> Result<(), ReadError> {
        let mesh = &mut object.mesh;
        for polygon in polygons {
            self.face.clear();
            for corner in polygon.map(|at| faces.corner(at)) {
                let vertex = self.vertex(corner);
                if vertex as usize == mesh.positions.len() {
                    mesh.positions.push(file.positions[corner.position as usize]);
                    mesh.exact.extend(file.exact.get(corner.position as usize));
                }
                self.face.push(vertex);
            }
            let end = || crate::mesh::text::place_of(&input.bytes, input.bytes.len());
            push_polygon(input, end, mesh, &self.face, &mut self.triangulator)?;
        }
        let slot = self.slot(input, state.material.unwrap_or(NONE), &mut object.materials, notes);
        mesh.material_slots.resize(mesh.indices.len(), slot);
        // Without any `s` statement angles decide, so nothing is stored until there is one.
        if state.smoothing.is_some() || !self.smoothing.is_empty() {
            self.smoothing.resize(self.smoothed, Smoothing::Angle);
            self.smoothing.resize(mesh.indices.len(), smoothing(state.smoothing));
        }
        self.smoothed = mesh.indices.len();
        Ok(())
    }

    /// Ends an object.
    fn finish(&mut self, file: &ObjFile, object: &mut Object) {
        if object.materials.len() <= 1 {
            object.mesh.material_slots = Vec::new();
        }
        object.mesh.drop_needless_exact();
        self.attributes(file, &mut object.mesh);
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

    fn slot(
        &mut self,
        input: &Input,
        material: u32,
        materials: &mut Vec<u32>,
        notes: &mut Notes,
    ) -> u16 {
        let last = self.slots.len() - 1;
        let entry = &mut self.slots[(material as usize).min(last)];
        if entry.0 != self.object {
            let slot = u16::try_from(materials.len()).unwrap_or_else(|_| {
                notes.add("many materials", || {
                    format!(
                        "{}: more than 65536 materials in one object; the rest share the last",
                        input.name
                    )
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
            mesh.uvs[0] = corners()
                .map(|c| file.uvs.get(c.uv as usize).copied().unwrap_or(Vec2::ZERO))
                .collect();
        }
        self.missing_normals.clear();
        if corners().any(|c| c.normal != NONE) {
            mesh.normals = corners()
                .map(|c| file.normals.get(c.normal as usize).copied().unwrap_or(Vec3::ZERO))
                .collect();
            let missing = self.vertices.iter().enumerate().filter(|(_, (_, c))| c.normal == NONE);
            self.missing_normals.extend(missing.map(|(i, _)| i as u32));
        }
    }
}

fn smoothing(group: Option<u32>) -> Smoothing {
    match group {
        None => Smoothing::Angle,
        Some(0) => Smoothing::Flat,
        Some(group) => Smoothing::Group(group),
    }
}
