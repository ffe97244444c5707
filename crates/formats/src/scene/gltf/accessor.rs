//! Accessors: typed arrays in buffers. All arithmetic is checked, and allocations are bounded by
//! the size of the file's data.

use super::container::{Buffers, View};
use super::json::Json;
use crate::ReadError;
use std::cell::Cell;

/// Maximum number of elements of an accessor that has no data of its own, so that all elements are
/// zero.
const MAX_ZEROS: usize = 1 << 22;

/// Maximum number of elements without data that are decoded for one file; an accessor counts each
/// time it is used.
const MAX_ZEROS_IN_ALL: usize = 1 << 25;

/// Type of one component.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn parse(json: &Json) -> Result<Self, ReadError> {
        Ok(match json.size()? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => {
                return Err(json.error(format!(
                    "{other} is not a component type; expected one of 5120, 5121, 5122, 5123, \
                        5125, 5126"
                )));
            }
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The value of `bytes`, which has [`Self::bytes`] elements.
    fn number(self, bytes: &[u8], normalized: bool) -> f32 {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| bytes.get(i).copied().unwrap_or(0));
        let value = match self {
            Self::I8 => f32::from(a as i8),
            Self::U8 => f32::from(a),
            Self::I16 => f32::from(i16::from_le_bytes([a, b])),
            Self::U16 => f32::from(u16::from_le_bytes([a, b])),
            Self::U32 => u32::from_le_bytes([a, b, c, d]) as f32,
            Self::F32 => f32::from_le_bytes([a, b, c, d]),
        };
        if normalized { self.fraction(value) } else { value }
    }

    /// The fraction that an integer represents. Floating-point values represent themselves.
    fn fraction(self, value: f32) -> f32 {
        let most = match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 => u32::MAX as f32,
            Self::F32 => return value,
        };
        (value / most).max(-1.0)
    }

    /// The value of `bytes` as an index; `None` for types other than unsigned integers.
    fn index(self, bytes: &[u8]) -> Option<u32> {
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| bytes.get(i).copied().unwrap_or(0));
        match self {
            Self::U8 => Some(u32::from(a)),
            Self::U16 => Some(u32::from(u16::from_le_bytes([a, b]))),
            Self::U32 => Some(u32::from_le_bytes([a, b, c, d])),
            Self::I8 | Self::I16 | Self::F32 => None,
        }
    }
}

/// All accessors of a document.
pub(super) struct Accessors<'a> {
    table: Vec<Json<'a>>,
    buffers: Buffers<'a>,
    /// Elements decoded so far: by all accessors, and by those without data. These are counted
    /// because a short file can use one accessor many times.
    decoded: Cell<[usize; 2]>,
    max_decoded: usize,
}

/// An accessor that has been checked against its buffer view.
pub(super) struct Accessor<'s, 'a> {
    json: &'s Json<'a>,
    all: &'s Accessors<'a>,
    /// Number of elements.
    pub count: usize,
    /// Type of the components.
    pub component: Component,
    /// True if integers represent `[0, 1]` or `[-1, 1]`.
    normalized: bool,
    /// Components per element.
    pub width: usize,
    /// Location of the elements; `None` if all are zero.
    part: Option<Part>,
    stride: usize,
    /// Components of all elements, if they are decoded already.
    unpacked: Option<Vec<f32>>,
}

impl<'a> Accessors<'a> {
    /// Lists the accessors of a document. All decoded elements together are limited to 4 times
    /// `limit`.
    pub fn new(root: &Json<'a>, buffers: Buffers<'a>, limit: usize) -> Result<Self, ReadError> {
        let table = root.items_of("accessors")?;
        Ok(Self {
            table,
            buffers,
            decoded: Cell::new([0; 2]),
            max_decoded: limit.saturating_mul(4),
        })
    }

    /// The buffers that accessors and images lie in.
    pub fn buffers(&self) -> &Buffers<'a> {
        &self.buffers
    }

    /// The accessor that `index` refers to, to be read.
    pub fn get(&self, index: &Json) -> Result<Accessor<'_, 'a>, ReadError> {
        let accessor = self.describe(index)?;
        let count = accessor.count;
        if accessor.part.is_none() && count > MAX_ZEROS {
            return Err(accessor.error(format!(
                "the accessor declares {count} elements without any data; at most {MAX_ZEROS} \
                    are possible so"
            )));
        }
        Ok(accessor)
    }

    /// The accessor that `index` refers to, with `values` as the components of its elements: they
    /// were decoded elsewhere, from numbers of the type `component`.
    pub fn unpacked(
        &self,
        index: &Json,
        values: Vec<f32>,
        component: Component,
    ) -> Result<Accessor<'_, 'a>, ReadError> {
        let accessor = self.describe(index)?;
        let count = values.len() / accessor.width;
        Ok(Accessor { count, component, unpacked: Some(values), ..accessor })
    }

    /// The accessor that `index` refers to, whose elements may be stored elsewhere.
    pub fn describe(&self, index: &Json) -> Result<Accessor<'_, 'a>, ReadError> {
        let i = index.size()?;
        let json = self.table.get(i).ok_or_else(|| {
            index.error(format!(
                "it refers to number {i} of \"accessors\", but there are {}",
                self.table.len()
            ))
        })?;
        self.of(json)
    }

    fn of<'s>(&'s self, json: &'s Json<'a>) -> Result<Accessor<'s, 'a>, ReadError> {
        let component = Component::parse(&json.require("componentType")?)?;
        let kind = json.require("type")?;
        let width = match kind.string()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            other => return Err(kind.error(format!("\"{other}\" is not an accessor type"))),
        };
        let count = json.require("count")?.size()?;
        let normalized = json.boolean_or("normalized", false)?;
        let size = width * component.bytes();
        let accessor = |part, stride| Accessor {
            json,
            all: self,
            count,
            component,
            normalized,
            width,
            part,
            stride,
            unpacked: None,
        };
        let Some(view) = json.get("bufferView")? else {
            return Ok(accessor(None, size));
        };
        let view = self.buffers.view(&view)?;
        // Some programs write 0 for elements without gaps, which the standard forbids.
        let stride = view.stride.filter(|stride| *stride != 0).unwrap_or(size);
        if stride < size {
            return Err(json.error(format!(
                "its buffer view has {stride} bytes between elements, but an element has {size} \
                    bytes"
            )));
        }
        let part = Part::new(json, view, count, stride, size)?;
        Ok(accessor(Some(part), stride))
    }

    /// Checks all accessors of the document against their buffer views, without reading any buffer.
    pub fn check(&self) -> Result<(), ReadError> {
        for json in &self.table {
            let accessor = self.of(json)?;
            if let Some(sparse) = json.get("sparse")? {
                accessor.replacement(&sparse)?;
            }
        }
        Ok(())
    }
}

/// The bytes of some elements, which lie within their buffer view.
struct Part {
    view: View,
    start: usize,
    end: usize,
}

impl Part {
    /// Locates `count` elements of `size` bytes, `stride` bytes apart, from the `byteOffset` of
    /// `json`.
    fn new(
        json: &Json,
        view: View,
        count: usize,
        stride: usize,
        size: usize,
    ) -> Result<Self, ReadError> {
        let start = json.size_or("byteOffset", 0)?;
        let length = if count == 0 {
            Some(0)
        } else {
            (count - 1).checked_mul(stride).and_then(|l| l.checked_add(size))
        };
        match length.and_then(|length| start.checked_add(length)) {
            Some(end) if end <= view.length => Ok(Self { view, start, end }),
            _ => Err(json.error(format!(
                "{count} elements of {size} bytes, {stride} bytes apart, from byte {start} do not \
                    fit into the {} bytes of the buffer view",
                view.length
            ))),
        }
    }

    fn bytes<'s>(&self, buffers: &'s Buffers) -> Result<&'s [u8], ReadError> {
        Ok(&buffers.bytes(&self.view)?[self.start..self.end])
    }
}

/// The indices and values of a sparse accessor.
struct Replacement {
    component: Component,
    places: Part,
    values: Part,
}

impl Accessor<'_, '_> {
    /// An error about this accessor.
    pub fn error(&self, problem: impl Into<String>) -> ReadError {
        self.json.error(problem)
    }

    /// Returns the accessor with integers read as normalized, even if the file does not mark it so
    /// (for attributes that must be, such as weights).
    pub fn into_fractions(mut self) -> Self {
        self.normalized = true;
        self
    }

    /// Decodes all elements as `N` numbers each.
    pub fn vectors<const N: usize>(&self) -> Result<Vec<[f32; N]>, ReadError> {
        if self.width != N {
            return Err(
                self.error(format!("its elements have {} components, expected {N}", self.width))
            );
        }
        if let Some(values) = &self.unpacked {
            let scaled = |x| if self.normalized { self.component.fraction(x) } else { x };
            return Ok(values.as_chunks::<N>().0.iter().map(|v| v.map(scaled)).collect());
        }
        let step = self.component.bytes();
        let decode = |element: &[u8]| {
            std::array::from_fn(|i| {
                self.component.number(element.get(i * step..).unwrap_or(&[]), self.normalized)
            })
        };
        self.elements(decode, [0.0; N])
    }

    /// Decodes all elements as indices.
    pub fn indices(&self) -> Result<Vec<u32>, ReadError> {
        if self.width != 1 || self.component.index(&[]).is_none() {
            return Err(self.error(
                "indices must be unsigned whole numbers (SCALAR of type 5121, 5123 or 5125)",
            ));
        }
        self.elements(|element| self.component.index(element).unwrap_or(0), 0)
    }

    fn elements<T: Copy>(&self, decode: impl Fn(&[u8]) -> T, zero: T) -> Result<Vec<T>, ReadError> {
        let size = self.width * self.component.bytes();
        self.count_decoded()?;
        let mut elements = match &self.part {
            // The last element may be shorter than the stride.
            Some(part) => {
                let bytes = part.bytes(&self.all.buffers)?;
                bytes.chunks(self.stride).take(self.count).map(&decode).collect()
            }
            None => vec![zero; self.count],
        };
        if let Some(sparse) = self.json.get("sparse")? {
            let Replacement { component, places, values } = self.replacement(&sparse)?;
            let (places, values) =
                (places.bytes(&self.all.buffers)?, values.bytes(&self.all.buffers)?);
            for (place, value) in places.chunks(component.bytes()).zip(values.chunks(size)) {
                let place = component.index(place).unwrap_or(0) as usize;
                let Some(element) = elements.get_mut(place) else {
                    let indices = sparse.require("indices")?;
                    return Err(indices.error(format!(
                        "it refers to element {place}, but the accessor has {}",
                        self.count
                    )));
                };
                *element = decode(value);
            }
        }
        Ok(elements)
    }

    /// Counts the elements as decoded. Fails at the limits on what a file may make the reader
    /// decode.
    fn count_decoded(&self) -> Result<(), ReadError> {
        let [mut decoded, mut zeros] = self.all.decoded.get();
        decoded = decoded.saturating_add(self.count);
        zeros += if self.part.is_none() { self.count } else { 0 };
        self.all.decoded.set([decoded, zeros]);
        if decoded > self.all.max_decoded || zeros > MAX_ZEROS_IN_ALL {
            return Err(self.json.error_with(
                "the file uses its accessors for too many vertices in all",
                "split the scene",
            ));
        }
        let bytes = self.count.saturating_mul(self.width * 4) as u64;
        let charged = self.all.buffers.input().charge(bytes, "its decoded content");
        charged.map_err(|e| self.json.error_with(e.problem, e.remedy))
    }

    /// The indices and values of a sparse accessor.
    fn replacement(&self, sparse: &Json) -> Result<Replacement, ReadError> {
        let count = sparse.require("count")?.size()?;
        if count > self.count {
            return Err(
                sparse.error(format!("it replaces {count} of only {} elements", self.count))
            );
        }
        let places = sparse.require("indices")?;
        let component = Component::parse(&places.require("componentType")?)?;
        if component.index(&[]).is_none() {
            return Err(places.error("the component type must be 5121, 5123 or 5125"));
        }
        let part = |json: &Json, size: usize| {
            let view = self.all.buffers.view(&json.require("bufferView")?)?;
            Part::new(json, view, count, size, size)
        };
        let size = self.width * self.component.bytes();
        let values = part(&sparse.require("values")?, size)?;
        Ok(Replacement { component, places: part(&places, component.bytes())?, values })
    }
}
