//! Elements of a fixed size in binary files, read on all cores.
//!
//! Vertices without lists, and faces that all have as many corners as the first, take the same
//! number of bytes each, so any of them can be located without reading those before. If a file
//! turns out to be different or invalid, the reader of [`super::body`] takes over and reports
//! errors.

use super::header::{Element, Property, Type};
use rayon::prelude::*;

/// Elements that one thread reads at a time.
const PIECE: usize = 1 << 14;

/// The offset and type of a property in each element.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    offset: usize,
    kind: Type,
}

impl Field {
    /// The value in the bytes of an element.
    #[inline]
    pub fn value<const BIG: bool>(self, element: &[u8]) -> f64 {
        macro_rules! decode {
            ($number:ty) => {{
                let mut bytes = [0; size_of::<$number>()];
                bytes.copy_from_slice(&element[self.offset..self.offset + size_of::<$number>()]);
                f64::from(if BIG {
                    <$number>::from_be_bytes(bytes)
                } else {
                    <$number>::from_le_bytes(bytes)
                })
            }};
        }
        match self.kind {
            Type::I8 => decode!(i8),
            Type::U8 => decode!(u8),
            Type::I16 => decode!(i16),
            Type::U16 => decode!(u16),
            Type::I32 => decode!(i32),
            Type::U32 => decode!(u32),
            Type::F32 => decode!(f32),
            Type::F64 => decode!(f64),
        }
    }
}

/// The fields of an element without lists, and its size; `None` if it has lists or no properties.
pub fn fields(element: &Element) -> Option<(Vec<Field>, usize)> {
    let mut size = 0;
    let mut fields = Vec::with_capacity(element.properties.len());
    for Property { value, length, .. } in &element.properties {
        if length.is_some() {
            return None;
        }
        fields.push(Field { offset: size, kind: *value });
        size += value.size();
    }
    (size > 0).then_some((fields, size))
}

/// Makes one value of each element, in order.
pub fn each<T: Send>(bytes: &[u8], size: usize, make: impl Fn(&[u8]) -> T + Send + Sync) -> Vec<T> {
    bytes.par_chunks_exact(size).with_min_len(PIECE).map(make).collect()
}

/// Returns the triangles, and the number of bytes that they take, if all of the `count` elements at
/// the start of `bytes` are faces of three corners with valid vertex indices. `list` is the index
/// of the list of corners among the properties.
pub fn triangles<const BIG: bool>(
    bytes: &[u8],
    element: &Element,
    list: usize,
    vertices: u64,
) -> Option<(Vec<[u32; 3]>, usize)> {
    let mut size = 0;
    let (mut length, mut corners) = (None, None);
    for (i, property) in element.properties.iter().enumerate() {
        match property.length {
            Some(kind) if i == list => {
                length = Some(Field { offset: size, kind });
                corners = Some((size + kind.size(), property.value));
                size += kind.size() + 3 * property.value.size();
            }
            Some(_) => return None,
            None => size += property.value.size(),
        }
    }
    let (length, (first, kind)) = (length?, corners?);
    if !kind.is_integer() {
        return None;
    }
    let total = usize::try_from(element.count).ok()?.checked_mul(size)?;
    let faces = bytes.get(..total)?;
    let corner = |k: usize| Field { offset: first + k * kind.size(), kind };
    let corners = [corner(0), corner(1), corner(2)];
    let face = |face: &[u8]| {
        let found = corners.map(|corner| corner.value::<BIG>(face));
        let good = length.value::<BIG>(face) == 3.0
            && found.iter().all(|&i| i >= 0.0 && i < vertices as f64);
        good.then(|| found.map(|i| i as u32))
    };
    // The pieces are short, so that a face of another kind ends the work early and nothing is
    // copied twice.
    let mut all = vec![[0; 3]; element.count as usize];
    let pieces = all.par_chunks_mut(PIECE).zip(faces.par_chunks(PIECE * size));
    pieces
        .try_for_each(|(triangles, faces)| {
            triangles.iter_mut().zip(faces.chunks_exact(size)).try_for_each(|(triangle, bytes)| {
                *triangle = face(bytes)?;
                Some(())
            })
        })
        .map(|()| (all, total))
}
