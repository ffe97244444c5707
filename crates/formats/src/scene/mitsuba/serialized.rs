//! Mitsuba's own mesh files: several compressed meshes, and a table of their offsets at the end.

use crate::expansion::Compression;
use crate::{Input, Place, ReadError};
use snell_intersect::TriangleMesh;
use snell_math::{DVec3, Vec2, Vec3};
use std::io::Read;

const MAGIC: u16 = 0x041C;
const NORMALS: u32 = 0x1;
const UVS: u32 = 0x2;
const COLORS: u32 = 0x8;
const FACE_NORMALS: u32 = 0x10;
const SINGLE: u32 = 0x1000;
const DOUBLE: u32 = 0x2000;

/// A mesh of a file, and whether it is to be shaded flat.
pub struct Serialized {
    pub mesh: TriangleMesh,
    pub is_flat: bool,
}

/// Reads one of the meshes of a file, counted from 0.
pub fn read(input: &Input, index: usize) -> Result<Serialized, ReadError> {
    let bytes = &input.bytes;
    let version = header(bytes).ok_or_else(|| {
        input.error(
            Place::Byte(0),
            "this is not a serialized mesh of Mitsuba (version 3 or 4)",
            "export it again",
        )
    })?;
    let start = start_of(bytes, version, index).ok_or_else(|| {
        let problem = format!("it has no mesh number {index} (counted from 0)");
        input.error(
            Place::Byte(bytes.len() as u64),
            problem,
            "correct shape_index, or export the file again",
        )
    })?;
    let limit = input.options.limits.elements as u64;
    let content = bytes.get(start + 4..).unwrap_or_default();
    let damaged =
        |problem: String| input.error(Place::Byte(start as u64), problem, "export the file again");
    let content = input.unpack(content, Compression::Zlib, Place::Byte(start as u64))?;
    let mut body = Body { from: content.as_slice(), input };
    body.mesh(version, limit).map_err(damaged)
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

fn header(bytes: &[u8]) -> Option<u16> {
    let version = u16_at(bytes, 2)?;
    (u16_at(bytes, 0)? == MAGIC && (version == 3 || version == 4)).then_some(version)
}

/// The offset of a mesh, from the table at the end.
fn start_of(bytes: &[u8], version: u16, index: usize) -> Option<usize> {
    let end = bytes.len();
    let count = u32::from_le_bytes(bytes.get(end.checked_sub(4)?..)?.try_into().ok()?) as usize;
    if index >= count {
        return None;
    }
    let width: usize = if version == 4 { 8 } else { 4 };
    let at = end.checked_sub(4)?.checked_sub(width.checked_mul(count - index)?)?;
    let mut offset = [0; 8];
    offset[..width].copy_from_slice(bytes.get(at..at + width)?);
    let start = usize::try_from(u64::from_le_bytes(offset)).ok()?;
    (start.checked_add(4)? <= end).then_some(start)
}

struct Body<'a, R> {
    from: R,
    input: &'a Input,
}

impl<R: Read> Body<'_, R> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut bytes = [0; N];
        self.from
            .read_exact(&mut bytes)
            .map_err(|e| format!("the mesh is damaged or cut off: {e}"))?;
        Ok(bytes)
    }

    fn u64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(self.bytes()?))
    }

    fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.bytes()?))
    }

    fn number(&mut self, is_double: bool) -> Result<f64, String> {
        if is_double {
            Ok(f64::from_le_bytes(self.bytes()?))
        } else {
            Ok(f32::from_le_bytes(self.bytes()?).into())
        }
    }

    fn vector(&mut self, is_double: bool) -> Result<DVec3, String> {
        Ok(DVec3::new(self.number(is_double)?, self.number(is_double)?, self.number(is_double)?))
    }

    fn vectors(&mut self, count: u64, is_double: bool) -> Result<Vec<Vec3>, String> {
        (0..count).map(|_| Ok(self.vector(is_double)?.as_vec3())).collect()
    }

    /// Reads the positions, relative to the origin.
    fn positions(&mut self, count: u64, is_double: bool) -> Result<TriangleMesh, String> {
        let mut mesh = TriangleMesh::default();
        for _ in 0..count {
            let position = self.vector(is_double)? - self.input.origin;
            mesh.positions.push(position.as_vec3());
            if self.input.options.exact {
                mesh.exact.push(position);
            }
        }
        mesh.drop_needless_exact();
        Ok(mesh)
    }

    fn mesh(&mut self, version: u16, limit: u64) -> Result<Serialized, String> {
        let flags = self.u32()?;
        if flags & (SINGLE | DOUBLE) == 0 {
            return Err("the mesh does not say whether its numbers are single or double".into());
        }
        let is_double = flags & DOUBLE != 0;
        if version == 4 {
            // A name that ends with a zero byte is skipped.
            while self.bytes::<1>()? != [0] {}
        }
        let (vertices, triangles) = (self.u64()?, self.u64()?);
        if vertices > limit || triangles > limit {
            return Err(format!(
                "{vertices} vertices and {triangles} triangles: more than {limit}, the limit"
            ));
        }
        let mut mesh = self.positions(vertices, is_double)?;
        if flags & NORMALS != 0 {
            mesh.normals = self.vectors(vertices, is_double)?;
        }
        if flags & UVS != 0 {
            for _ in 0..vertices {
                let uv = [self.number(is_double)?, self.number(is_double)?];
                mesh.uvs[0].push(Vec2::from(uv.map(|x| x as f32)));
            }
        }
        if flags & COLORS != 0 {
            let colors = self.vectors(vertices, is_double)?;
            mesh.colors = colors.into_iter().map(|c| [c.x, c.y, c.z, 1.0]).collect();
        }
        let is_wide = vertices > u64::from(u32::MAX);
        for i in 0..triangles {
            let mut corner = || if is_wide { Ok(self.u64()?) } else { self.u32().map(u64::from) };
            let triangle: [u64; 3] = [corner()?, corner()?, corner()?];
            if let Some(far) = triangle.iter().find(|v| **v >= vertices) {
                return Err(format!(
                    "triangle {i} has the vertex {far}, but there are only {vertices}"
                ));
            }
            mesh.indices.push(triangle.map(|v| v as u32));
        }
        Ok(Serialized { mesh, is_flat: flags & FACE_NORMALS != 0 })
    }
}
