//! `KHR_draco_mesh_compression`: primitives whose attributes and triangles are one Draco stream.
//! The crate `draco-core`, a port of Draco to Rust, decodes the stream; the accessors of the
//! primitive declare what it may hold.

use super::Reader;
use super::accessor::Component;
use super::json::Json;
use crate::ReadError;
use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use std::collections::BTreeMap;

/// The name of the extension.
const NAME: &str = "KHR_draco_mesh_compression";

/// Bytes of a component of a decoded attribute.
const COMPONENT_BYTES: u64 = 4;

/// Points that a stream may have beyond those that its accessors declare.
const SLACK: u64 = 64;

/// A decoded primitive.
pub(super) struct Unpacked {
    mesh: Mesh,
    /// The numbers of the attributes in the stream, by their names in glTF.
    ids: BTreeMap<String, u32>,
}

impl Unpacked {
    /// Decodes a primitive with these attributes. `None` if it is not compressed, or if the file
    /// has its positions without compression too.
    pub fn of(
        reader: &Reader,
        primitive: &Json,
        attributes: &Json,
    ) -> Result<Option<Self>, ReadError> {
        let Some(extension) = primitive.extension(NAME)? else { return Ok(None) };
        let positions = attributes.require("POSITION")?;
        if reader.root.entry("accessors", &positions)?.get("bufferView")?.is_some() {
            return Ok(None);
        }
        let mut ids = BTreeMap::new();
        for (name, id) in extension.require("attributes")?.properties()? {
            let number = u32::try_from(id.size()?)
                .map_err(|_| id.error("the number of an attribute has 32 bits at most"))?;
            ids.insert(name.to_owned(), number);
        }
        let limits = limits(reader, primitive, attributes)?;
        let view = extension.require("bufferView")?;
        let bytes = reader.accessors.buffers().view_bytes(&view)?;
        let decoded = crate::guard::guarded(|| {
            let mut mesh = Mesh::new();
            let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
            MeshDecoder::new().decode(&mut buffer, &mut mesh).map(|()| mesh)
        });
        let damaged = |why: &str| {
            extension.error_with(
                format!("the Draco data is damaged: {why}"),
                "copy or export the file again, or without compression",
            )
        };
        let mesh = match decoded {
            Some(Ok(mesh)) => mesh,
            Some(Err(error)) => return Err(damaged(&error.to_string())),
            None => return Err(damaged("its decoder failed")),
        };
        let points = mesh.num_points();
        if mesh.faces().iter().flatten().any(|point| point.0 as usize >= points) {
            return Err(damaged("a triangle names a vertex that does not exist"));
        }
        Ok(Some(Self { mesh, ids }))
    }

    /// The number of vertices.
    pub fn vertices(&self) -> usize {
        self.mesh.num_points()
    }

    /// The triangles.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.mesh.faces().iter().map(|face| face.map(|point| point.0)).collect()
    }

    /// The values of an attribute, `width` numbers for each vertex, and their type in the stream.
    /// `None` if the stream does not have it.
    pub fn values(&self, name: &str, width: usize) -> Option<(Vec<f32>, Component)> {
        let attribute = self.mesh.attribute_by_unique_id(*self.ids.get(name)?)?;
        let component = match attribute.data_type() {
            DataType::Int8 => Component::I8,
            DataType::Uint8 => Component::U8,
            DataType::Int16 => Component::I16,
            DataType::Uint16 => Component::U16,
            _ => Component::F32,
        };
        Some((attribute.read_f32s(self.vertices(), width), component))
    }
}

/// Limits on what the stream of a primitive may hold: what its accessors declare. Their memory is
/// charged twice, because the decoder takes as much for itself.
fn limits(reader: &Reader, primitive: &Json, attributes: &Json) -> Result<DecodeLimits, ReadError> {
    let (mut points, mut components) = (0u64, 0u64);
    for (_, index) in attributes.properties()? {
        let accessor = reader.accessors.describe(&index)?;
        points = points.max(accessor.count as u64);
        components += accessor.width as u64;
    }
    let corners = match primitive.get("indices")? {
        Some(index) => reader.accessors.describe(&index)?.count as u64,
        None => points,
    };
    let points = points.saturating_add(SLACK);
    let bytes = points.saturating_mul(components).saturating_mul(COMPONENT_BYTES);
    let all = bytes.saturating_add(corners.saturating_mul(COMPONENT_BYTES));
    let charged = reader.input.charge(all.saturating_mul(2), "a Draco mesh");
    charged.map_err(|e| primitive.error_with(e.problem, e.remedy))?;
    Ok(DecodeLimits::default()
        .with_max_points(points)
        .with_max_faces(corners / 3 + SLACK)
        .with_max_decoded_bytes(bytes))
}
