//! Reads the values of the elements.

use super::header::{Element, Header, Property, Type, is_index_list};
use super::uniform;
use crate::mesh::colors;
use crate::mesh::notes::Notes;
use crate::mesh::polygon::Triangulator;
use crate::mesh::text::{Reader, Text, place_of};
use crate::mesh::too_many;
use crate::{Input, Place, ReadError};
use snell_intersect::TriangleMesh;
use snell_math::spectrum::srgb_to_linear;
use snell_math::{DVec3, Vec2, Vec3};
use snell_scene::WarningKind;
use std::collections::HashMap;

/// A source of values: text, or binary of either byte order. Every value fits `f64` exactly.
pub trait Source {
    /// The next value.
    fn value(&mut self, kind: Type) -> Result<f64, ReadError>;
    /// Skips values.
    fn skip(&mut self, kind: Type, count: u64) -> Result<(), ReadError>;
    /// The number of bytes of the file that are not read yet.
    fn bytes_left(&self) -> u64;
    /// Ends an element.
    fn end_element(&mut self);
    /// Adds the source's warnings at the end.
    fn finish(&self, notes: &mut Notes);
    /// An error about the value read last.
    fn error(&self, problem: String, remedy: &str) -> ReadError;
    /// Reads all vertices at once, if possible, and returns true; otherwise reads nothing.
    fn all_vertices(&mut self, _: &Element, _: &[Role], _: &mut TriangleMesh) -> bool {
        false
    }
    /// Reads all faces at once, if possible and if all are triangles of existing vertices, and
    /// returns true; otherwise reads nothing. `list` is the index of the property with the corners.
    fn all_triangles(
        &mut self,
        _element: &Element,
        _list: usize,
        _vertices: u64,
    ) -> Option<Vec<[u32; 3]>> {
        None
    }
}

/// Values as text. An element may span lines, but the next one begins on a new line.
pub struct AsciiSource<'a> {
    reader: Reader<'a>,
    last: usize,
    /// The number of lines with surplus values, and where the first surplus value is.
    surplus: Option<(u64, usize)>,
}

impl<'a> AsciiSource<'a> {
    /// A source of the values that follow the header.
    pub fn new(input: &'a Input, header: &Header) -> Self {
        let text = Text::new(&input.bytes, header.end);
        Self { reader: Reader::new(input, &input.bytes, text), last: header.end, surplus: None }
    }
}

impl Source for AsciiSource<'_> {
    fn value(&mut self, kind: Type) -> Result<f64, ReadError> {
        let Some(word) = self.reader.text.word_on_any_line() else {
            return Err(self.reader.missing("another value"));
        };
        self.last = word.start;
        let text = std::str::from_utf8(word.bytes).unwrap_or("");
        let value = if kind.is_integer() {
            text.parse::<i64>().map(|i| i as f64).ok()
        } else {
            text.parse::<f64>().ok()
        };
        // Some programs write whole numbers with a decimal point, and old libraries have their own
        // NaN.
        value
            .or_else(|| text.parse::<f64>().ok())
            .map_or_else(|| self.reader.number_in(word, "a number").map(f64::from), Ok)
    }

    fn skip(&mut self, _: Type, count: u64) -> Result<(), ReadError> {
        for _ in 0..count {
            if self.reader.text.word_on_any_line().is_none() {
                return Err(self.reader.missing("another value"));
            }
        }
        Ok(())
    }

    fn bytes_left(&self) -> u64 {
        self.reader.text.remaining() as u64
    }

    fn end_element(&mut self) {
        if let Some(word) = self.reader.text.word() {
            self.surplus.get_or_insert((0, word.start)).0 += 1;
        }
        self.reader.text.next_line();
    }

    fn finish(&self, notes: &mut Notes) {
        self.reader.note_commas(notes);
        let Some((lines, first)) = self.surplus else { return };
        let place = self.reader.location(first);
        notes.add("surplus", || {
            format!(
                "{place}: {lines} lines have more values than the header says; the rest of \
                those lines was ignored"
            )
        });
    }

    fn error(&self, problem: String, remedy: &str) -> ReadError {
        self.reader.error(self.last, problem, remedy)
    }
}

/// Values as bytes, big endian if `BIG`.
pub struct BinarySource<'a, const BIG: bool> {
    input: &'a Input,
    position: usize,
    last: usize,
}

impl<'a, const BIG: bool> BinarySource<'a, BIG> {
    /// A source of the values that follow the header.
    pub fn new(input: &'a Input, header: &Header) -> Self {
        Self { input, position: header.end, last: header.end }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], ReadError> {
        let Some(&bytes) = self.input.bytes[self.position..].first_chunk::<N>() else {
            return Err(self.cut_off());
        };
        self.last = self.position;
        self.position += N;
        Ok(bytes)
    }

    fn cut_off(&self) -> ReadError {
        self.input.error(
            Place::Byte(self.input.bytes.len() as u64),
            "the file ends before all values that its header declares",
            "the file seems cut off; export or copy it again",
        )
    }
}

macro_rules! decode {
    ($self:ident, $kind:ty) => {{
        let bytes = $self.take()?;
        if BIG { <$kind>::from_be_bytes(bytes) } else { <$kind>::from_le_bytes(bytes) }.into()
    }};
}

impl<const BIG: bool> Source for BinarySource<'_, BIG> {
    #[inline]
    fn value(&mut self, kind: Type) -> Result<f64, ReadError> {
        Ok(match kind {
            Type::I8 => decode!(self, i8),
            Type::U8 => decode!(self, u8),
            Type::I16 => decode!(self, i16),
            Type::U16 => decode!(self, u16),
            Type::I32 => decode!(self, i32),
            Type::U32 => decode!(self, u32),
            Type::F32 => decode!(self, f32),
            Type::F64 => decode!(self, f64),
        })
    }

    fn skip(&mut self, kind: Type, count: u64) -> Result<(), ReadError> {
        if count > self.bytes_left() / kind.size() as u64 {
            return Err(self.cut_off());
        }
        self.position += count as usize * kind.size();
        Ok(())
    }

    fn bytes_left(&self) -> u64 {
        (self.input.bytes.len() - self.position) as u64
    }

    fn end_element(&mut self) {}

    fn finish(&self, _: &mut Notes) {}

    fn error(&self, problem: String, remedy: &str) -> ReadError {
        self.input.error(Place::Byte(self.last as u64), problem, remedy)
    }

    fn all_vertices(&mut self, element: &Element, roles: &[Role], mesh: &mut TriangleMesh) -> bool {
        let Some((fields, size)) = uniform::fields(element) else { return false };
        let total = usize::try_from(element.count).ok().and_then(|count| count.checked_mul(size));
        let Some(bytes) = total.and_then(|total| self.input.bytes[self.position..].get(..total))
        else {
            return false;
        };
        // If a property occurs twice, the last one counts.
        let field = |role| {
            roles.iter().rposition(|r| *r == role).map(|i| (fields[i], element.properties[i].value))
        };
        let value = |field: Option<(uniform::Field, Type)>, vertex: &[u8]| {
            field.map_or(0.0, |(field, _)| field.value::<BIG>(vertex) as f32)
        };
        let exact = |role: fn(usize) -> Role, origin: DVec3| {
            let fields: [_; 3] = std::array::from_fn(|k| field(role(k)));
            move |vertex: &[u8]| {
                let exact = |k: usize| {
                    fields[k].map_or(0.0, |(field, _)| field.value::<BIG>(vertex)) - origin[k]
                };
                DVec3::new(exact(0), exact(1), exact(2))
            }
        };
        let vector = |role: fn(usize) -> Role, origin: DVec3| {
            let exact = exact(role, origin);
            uniform::each(bytes, size, move |vertex| exact(vertex).as_vec3())
        };
        mesh.positions = vector(Role::Position, self.input.origin);
        if self.input.options.exact {
            mesh.exact = uniform::each(bytes, size, exact(Role::Position, self.input.origin));
        }
        if has_all(roles, Role::Normal, 3) {
            mesh.normals = vector(Role::Normal, DVec3::ZERO);
        }
        if has_all(roles, Role::Uv, 2) {
            let fields: [_; 2] = std::array::from_fn(|k| field(Role::Uv(k)));
            mesh.uvs[0] = uniform::each(bytes, size, |vertex| {
                Vec2::from_array(fields.map(|f| value(f, vertex)))
            });
        }
        if has_all(roles, Role::Color, 3) {
            let fields: [_; 4] = std::array::from_fn(|k| field(Role::Color(k)));
            let channel = |vertex: &[u8], k: usize| {
                fields[k]
                    .map_or(1.0, |(f, kind)| linear_color(f.value::<BIG>(vertex) as f32, kind, k))
            };
            mesh.colors =
                uniform::each(bytes, size, |vertex| std::array::from_fn(|k| channel(vertex, k)));
        }
        self.position += bytes.len();
        true
    }

    fn all_triangles(
        &mut self,
        element: &Element,
        list: usize,
        vertices: u64,
    ) -> Option<Vec<[u32; 3]>> {
        if element.count > self.input.options.limits.elements as u64 {
            return None;
        }
        let bytes = &self.input.bytes[self.position..];
        let (triangles, size) = uniform::triangles::<BIG>(bytes, element, list, vertices)?;
        self.position += size;
        Some(triangles)
    }
}

/// Reads all elements.
pub fn read(
    source: &mut impl Source,
    input: &Input,
    header: &Header,
    mesh: &mut TriangleMesh,
    notes: &mut Notes,
) -> Result<Triangulated, ReadError> {
    let vertices = header.elements.iter().find(|e| e.name == "vertex").map_or(0, |e| e.count);
    let mut faces = Faces { vertices, ..Faces::default() };
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" if mesh.positions.is_empty() => {
                read_vertices(source, input, header, element, mesh)?;
                mesh.drop_needless_exact();
            }
            "face" => {
                faces.declared = element.start;
                read_faces(source, input, header, element, &mut faces, notes)?;
            }
            "tristrips" => {
                faces.declared = element.start;
                read_strips(source, element, &mut faces)?;
            }
            _ => skip_element(source, element)?,
        }
    }
    source.finish(notes);
    let mut are_bytes = false;
    for (element, colors) in [("vertex", &mut mesh.colors), ("face", &mut faces.colors)] {
        if has_float_colors(header, element) && colors::are_bytes(colors) {
            colors::to_linear(colors);
            are_bytes = true;
        }
    }
    if are_bytes {
        notes.add("float bytes", || {
            format!(
                "{}: colours of a floating-point type go to 255; they were taken as sRGB bytes",
                input.name
            )
        });
    }
    if !faces.uvs.is_empty() {
        faces.uvs.resize(faces.corners.len(), Vec2::ZERO);
    }
    faces.triangulate(input, mesh)
}

impl Header {
    /// True if vertices have colours.
    fn has_vertex_colors(&self) -> bool {
        self.elements.iter().any(|e| {
            let roles: Vec<Role> = e.properties.iter().map(Role::of).collect();
            e.name == "vertex" && has_all(&roles, Role::Color, 3)
        })
    }
}

/// True if the colours of vertices have a floating-point type.
fn has_float_colors(header: &Header, element: &str) -> bool {
    header
        .elements
        .iter()
        .filter(|e| e.name == element)
        .flat_map(|e| &e.properties)
        .any(|p| matches!(Role::of(p), Role::Color(0..=2)) && !p.value.is_integer())
}

/// The role of a vertex property.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    Skip,
    Position(usize),
    Normal(usize),
    Uv(usize),
    Color(usize),
}

impl Role {
    fn of(property: &Property) -> Self {
        if property.length.is_some() {
            return Self::Skip;
        }
        match property.name.to_ascii_lowercase().as_str() {
            "x" => Self::Position(0),
            "y" => Self::Position(1),
            "z" => Self::Position(2),
            "nx" => Self::Normal(0),
            "ny" => Self::Normal(1),
            "nz" => Self::Normal(2),
            "u" | "s" | "texture_u" | "texture_s" => Self::Uv(0),
            "v" | "t" | "texture_v" | "texture_t" => Self::Uv(1),
            "red" | "r" | "diffuse_red" => Self::Color(0),
            "green" | "g" | "diffuse_green" => Self::Color(1),
            "blue" | "b" | "diffuse_blue" => Self::Color(2),
            "alpha" | "a" | "diffuse_alpha" => Self::Color(3),
            _ => Self::Skip,
        }
    }
}

/// The names of the vertex properties that are not read.
pub fn unread(header: &Header) -> Vec<&str> {
    let vertices = header.elements.iter().filter(|element| element.name == "vertex");
    let properties = vertices.flat_map(|element| &element.properties);
    properties.filter(|p| Role::of(p) == Role::Skip).map(|p| p.name.as_str()).collect()
}

/// True if all parts of an attribute are present.
fn has_all(roles: &[Role], role: fn(usize) -> Role, parts: usize) -> bool {
    (0..parts).all(|k| roles.contains(&role(k)))
}

fn read_vertices(
    source: &mut impl Source,
    input: &Input,
    header: &Header,
    element: &Element,
    mesh: &mut TriangleMesh,
) -> Result<(), ReadError> {
    let roles: Vec<Role> = element.properties.iter().map(Role::of).collect();
    if !has_all(&roles, Role::Position, 3) {
        let problem = "the element \"vertex\" lacks one of the properties x, y and z";
        let place = place_of(&input.bytes, element.start);
        let is_packed = element.properties.iter().any(|p| p.name == "packed_position");
        let remedy = match is_packed {
            true => "these are packed Gaussian splats, which are not supported; show a mesh",
            false => "export the file again with positions",
        };
        return Err(input.error(place, problem, remedy));
    }
    if element.count > input.options.limits.elements as u64 {
        return Err(too_many(input, place_of(&input.bytes, element.start), "vertices"));
    }
    if source.all_vertices(element, &roles, mesh) {
        return Ok(());
    }
    let count =
        element.count.min(source.bytes_left() / element.least_size(header.format) as u64 + 1)
            as usize;
    let has_normals = has_all(&roles, Role::Normal, 3);
    let has_uvs = has_all(&roles, Role::Uv, 2);
    let has_colors = has_all(&roles, Role::Color, 3);
    mesh.positions.reserve(count);
    mesh.normals.reserve(if has_normals { count } else { 0 });
    mesh.uvs[0].reserve(if has_uvs { count } else { 0 });
    mesh.colors.reserve(if has_colors { count } else { 0 });
    for _ in 0..element.count {
        let (mut position, mut normal, mut uv, mut color) =
            (DVec3::ZERO, Vec3::ZERO, Vec2::ZERO, [1.0; 4]);
        for (property, role) in element.properties.iter().zip(&roles) {
            if let Some(length) = property.length {
                skip_list(source, length, property.value)?;
                continue;
            }
            let exact = source.value(property.value)?;
            let value = exact as f32;
            match *role {
                Role::Skip => {}
                Role::Position(k) => position[k] = exact - input.origin[k],
                Role::Normal(k) => normal[k] = value,
                Role::Uv(k) => uv[k] = value,
                Role::Color(k) => color[k] = linear_color(value, property.value, k),
            }
        }
        source.end_element();
        mesh.positions.push(position.as_vec3());
        if input.options.exact {
            mesh.exact.push(position);
        }
        if has_normals {
            mesh.normals.push(normal);
        }
        if has_uvs {
            mesh.uvs[0].push(uv);
        }
        if has_colors {
            mesh.colors.push(color);
        }
    }
    Ok(())
}

/// Decodes one channel of a vertex colour; channel 3 is alpha. Values that are not finite, or
/// negative, count as 1.
fn linear_color(value: f32, kind: Type, channel: usize) -> f32 {
    let value = value / kind.color_scale();
    if !value.is_finite() || value < 0.0 {
        return 1.0;
    }
    if kind.is_integer() && channel < 3 { srgb_to_linear(value.min(1.0)) } else { value }
}

fn list_length(source: &mut impl Source, length: Type, item: Type) -> Result<u64, ReadError> {
    let count = source.value(length)?;
    if count < 0.0 {
        return Err(source
            .error(format!("a list of {count} items"), "the file is damaged; export it again"));
    }
    let count = count as u64;
    if count > source.bytes_left() / item.size().min(2) as u64 + 1 {
        let problem = format!("a list of {count} items, more than the rest of the file can hold");
        return Err(source.error(problem, "the file is damaged or cut off; export it again"));
    }
    Ok(count)
}

fn skip_list(source: &mut impl Source, length: Type, item: Type) -> Result<(), ReadError> {
    let count = list_length(source, length, item)?;
    source.skip(item, count)
}

pub fn skip_property(source: &mut impl Source, property: &Property) -> Result<(), ReadError> {
    match property.length {
        Some(length) => skip_list(source, length, property.value),
        None => source.skip(property.value, 1),
    }
}

pub fn skip_element(source: &mut impl Source, element: &Element) -> Result<(), ReadError> {
    // Elements without properties take no space and are not iterated, whatever their count.
    if !element.properties.is_empty() {
        for _ in 0..element.count {
            for property in &element.properties {
                skip_property(source, property)?;
            }
            source.end_element();
        }
    }
    Ok(())
}

/// The polygons read so far. They become triangles at the end, because faces may come before the
/// vertices in a file.
#[derive(Default)]
struct Faces {
    vertices: u64,
    /// Offset of the line of the header that declares them.
    declared: usize,
    /// Triangles that were read at once, before all others.
    triangles: Vec<[u32; 3]>,
    corners: Vec<u32>,
    /// For each polygon, the end of its corners.
    ends: Vec<usize>,
    /// Texture coordinates of each corner; empty if the file has none, else as long as `corners`.
    uvs: Vec<Vec2>,
    /// The number of the picture of each polygon; empty if the file has no such numbers.
    pictures: Vec<u16>,
    /// The linear colour of each polygon; empty if the file has none.
    colors: Vec<[f32; 4]>,
}

/// What the faces of a file became.
#[derive(Default)]
pub struct Triangulated {
    /// The number of triangles of each face, if any became more than one.
    pub counts: Option<Vec<u32>>,
    /// The linear colour of each triangle, if the faces have colours.
    pub colors: Vec<[f32; 4]>,
}

impl Faces {
    fn checked(&self, source: &impl Source, index: f64) -> Result<u32, ReadError> {
        if index >= 0.0 && index < self.vertices as f64 && index.fract() == 0.0 {
            return Ok(index as u32);
        }
        let problem = format!(
            "vertex number {index}, but there are {} vertices (counted from 0)",
            self.vertices
        );
        Err(source.error(problem, "the file is damaged; export it again"))
    }

    /// Gives a vertex to each pair of a vertex and texture coordinates that occurs at a corner.
    fn split(&mut self, mesh: &mut TriangleMesh) {
        if self.uvs.is_empty() {
            return;
        }
        mesh.uvs[0] = vec![Vec2::ZERO; mesh.positions.len()];
        let mut is_used = vec![false; mesh.positions.len()];
        let mut known: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
        for (corner, &uv) in self.corners.iter_mut().zip(&self.uvs) {
            let vertex = *corner;
            *corner =
                *known.entry((vertex, uv.to_array().map(f32::to_bits))).or_insert_with(|| {
                    let at = vertex as usize;
                    if !std::mem::replace(&mut is_used[at], true) {
                        mesh.uvs[0][at] = uv;
                        return vertex;
                    }
                    mesh.uvs[0].push(uv);
                    mesh.positions.push(mesh.positions[at]);
                    if !mesh.exact.is_empty() {
                        mesh.exact.push(mesh.exact[at]);
                    }
                    if !mesh.normals.is_empty() {
                        mesh.normals.push(mesh.normals[at]);
                    }
                    if !mesh.colors.is_empty() {
                        mesh.colors.push(mesh.colors[at]);
                    }
                    mesh.positions.len() as u32 - 1
                });
        }
    }

    /// Stores a face's texture coordinates, pairs of u and v, beside its corners.
    fn add_uvs(&mut self, values: &[f32], corners: usize) {
        if values.is_empty() && self.uvs.is_empty() {
            return;
        }
        self.uvs.resize(self.corners.len() - corners, Vec2::ZERO);
        let (pairs, _) = values.as_chunks::<2>();
        self.uvs.extend(pairs.iter().take(corners).map(|&uv| Vec2::from_array(uv)));
        self.uvs.resize(self.corners.len(), Vec2::ZERO);
    }

    /// Appends the triangles.
    fn triangulate(
        mut self,
        input: &Input,
        mesh: &mut TriangleMesh,
    ) -> Result<Triangulated, ReadError> {
        let mut triangulator = Triangulator::default();
        self.split(mesh);
        mesh.indices = self.triangles;
        mesh.indices.reserve(self.ends.len());
        let lone = mesh.indices.len();
        let mut counts = Vec::new();
        let mut start = 0;
        for end in self.ends {
            let place = || place_of(&input.bytes, self.declared);
            let before = mesh.indices.len();
            crate::mesh::push_polygon(
                input,
                place,
                mesh,
                &self.corners[start..end],
                &mut triangulator,
            )?;
            counts.push((mesh.indices.len() - before) as u32);
            start = end;
        }
        if !self.pictures.is_empty() {
            mesh.material_slots.resize(lone, 0);
            for (&count, &picture) in counts.iter().zip(&self.pictures) {
                mesh.material_slots.extend(std::iter::repeat_n(picture, count as usize));
            }
            mesh.material_slots.resize(mesh.indices.len(), 0);
        }
        let mut colors = Vec::new();
        if !self.colors.is_empty() {
            colors.resize(lone, [1.0; 4]);
            for (&count, &color) in counts.iter().zip(&self.colors) {
                colors.extend(std::iter::repeat_n(color, count as usize));
            }
            colors.resize(mesh.indices.len(), [1.0; 4]);
        }
        if counts.iter().all(|count| *count <= 1) {
            return Ok(Triangulated { counts: None, colors });
        }
        let mut faces = vec![1; lone];
        faces.append(&mut counts);
        Ok(Triangulated { counts: Some(faces), colors })
    }
}

fn read_faces(
    source: &mut impl Source,
    input: &Input,
    header: &Header,
    element: &Element,
    faces: &mut Faces,
    notes: &mut Notes,
) -> Result<(), ReadError> {
    let Some(at) =
        element.properties.iter().position(|p| p.length.is_some() && is_index_list(&p.name))
    else {
        if element.count > 0 {
            notes.add("no indices", || {
                format!("{}: the faces have no list vertex_indices and were skipped", input.name)
            });
        }
        return skip_element(source, element);
    };
    let is = |property: &Property, name: &str, is_list: bool| {
        property.name.eq_ignore_ascii_case(name) && property.length.is_some() == is_list
    };
    let uvs_at = element.properties.iter().position(|p| is(p, "texcoord", true));
    if uvs_at.is_some() && !header.reads_corners && element.count > 0 {
        notes.add_of(WarningKind::Choice, "texcoord", || {
            format!(
                "{}: texture coordinates at the corners of faces (texcoord) are not read in meshes \
                    that scenes name; those of the vertices are",
                input.name
            )
        });
    }
    let uvs_at = uvs_at.filter(|_| header.reads_corners);
    let pictures = header.textures.len();
    let picture_at = element.properties.iter().position(|p| is(p, "texnumber", false));
    let picture_at = picture_at.filter(|_| header.reads_corners && pictures > 1);
    // Colours of vertices hold where there are both.
    let roles: Vec<Role> = element.properties.iter().map(Role::of).collect();
    let is_colored =
        header.reads_corners && has_all(&roles, Role::Color, 3) && !header.has_vertex_colors();
    if faces.triangles.is_empty()
        && faces.ends.is_empty()
        && picture_at.is_none()
        && !is_colored
        && let Some(triangles) = source.all_triangles(element, at, faces.vertices)
    {
        faces.triangles = triangles;
        return Ok(());
    }
    let mut uvs: Vec<f32> = Vec::new();
    for _ in 0..element.count {
        let start = faces.corners.len();
        let mut color = [1.0; 4];
        for (i, property) in element.properties.iter().enumerate() {
            if let (true, Role::Color(k)) = (is_colored, roles[i]) {
                let value = source.value(property.value)? as f32;
                color[k] = linear_color(value, property.value, k);
                continue;
            }
            if Some(i) == picture_at {
                let value = source.value(property.value)?;
                faces.pictures.resize(faces.ends.len(), 0);
                let picture = value.clamp(0.0, pictures as f64 - 1.0);
                if picture != value {
                    notes.add("texnumber", || {
                        format!(
                            "{}: the texnumber {value} of a face, but the pictures have the \
                            numbers 0 to {}; the nearest one is shown on such faces",
                            input.name,
                            pictures - 1
                        )
                    });
                }
                faces.pictures.push(picture as u16);
                continue;
            }
            let Some(length) = property.length.filter(|_| i == at || Some(i) == uvs_at) else {
                skip_property(source, property)?;
                continue;
            };
            let corners = list_length(source, length, property.value)?;
            if i != at {
                uvs.clear();
                for _ in 0..corners {
                    uvs.push(source.value(property.value)? as f32);
                }
                continue;
            }
            for _ in 0..corners {
                let value = source.value(property.value)?;
                let index = faces.checked(source, value)?;
                faces.corners.push(index);
            }
            if corners < 3 {
                notes.add("few corners", || {
                    format!("{}: a face has fewer than 3 corners and was skipped", input.name)
                });
            }
        }
        if is_colored {
            faces.colors.resize(faces.ends.len(), [1.0; 4]);
            faces.colors.push(color);
        }
        faces.ends.push(faces.corners.len());
        faces.add_uvs(&uvs, faces.corners.len() - start);
        uvs.clear();
        source.end_element();
    }
    Ok(())
}

/// Strips of triangles: each index after the first two makes one, the winding alternates, and -1
/// begins a new strip.
fn read_strips(
    source: &mut impl Source,
    element: &Element,
    faces: &mut Faces,
) -> Result<(), ReadError> {
    for _ in 0..element.count {
        for property in &element.properties {
            let Some(length) = property.length.filter(|_| is_index_list(&property.name)) else {
                skip_property(source, property)?;
                continue;
            };
            let mut strip: Vec<u32> = Vec::new();
            for _ in 0..list_length(source, length, property.value)? {
                let value = source.value(property.value)?;
                if value == -1.0 {
                    strip.clear();
                    continue;
                }
                strip.push(faces.checked(source, value)?);
                if let [.., a, b, c] = strip[..] {
                    let odd = strip.len().is_multiple_of(2);
                    if a != b && b != c && c != a {
                        faces.corners.extend(if odd { [b, a, c] } else { [a, b, c] });
                        faces.ends.push(faces.corners.len());
                    }
                }
            }
        }
        source.end_element();
    }
    Ok(())
}
