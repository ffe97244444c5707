//! The binary buffer, with its views and accessors.

use serde_json::{Value, json};
use snell_math::Vec3;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// A buffer with its views and accessors.
#[derive(Debug, Default)]
pub struct Buffer {
    pub bytes: Vec<u8>,
    pub views: Vec<Value>,
    pub accessors: Vec<Value>,
}

impl Buffer {
    /// Appends bytes, aligned to four; returns the index of their view.
    pub fn view(&mut self, bytes: impl IntoIterator<Item = u8>, target: Option<u32>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let mut view =
            json!({ "buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, value: Value) -> usize {
        self.accessors.push(value);
        self.accessors.len() - 1
    }

    /// Adds positions with their bounds, and returns the number of their accessor.
    pub fn positions(&mut self, positions: &[Vec3]) -> usize {
        let finite = || positions.iter().filter(|p| p.is_finite());
        let min = finite().fold(Vec3::INFINITY, |a, &b| a.min(b));
        let max = finite().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
        let numbers: Vec<f32> = positions.iter().flat_map(|p| p.to_array()).collect();
        let number = self.vectors(&numbers, "VEC3", 3);
        if min.is_finite() && max.is_finite() {
            self.accessors[number]["min"] = min.to_array().to_vec().into();
            self.accessors[number]["max"] = max.to_array().to_vec().into();
        }
        number
    }

    /// Adds vectors with `width` components.
    pub fn vectors(&mut self, numbers: &[f32], kind: &str, width: usize) -> usize {
        let view = self.view(numbers.iter().flat_map(|x| x.to_le_bytes()), Some(VERTICES));
        let count = numbers.len() / width;
        self.accessor(
            json!({ "bufferView": view, "componentType": FLOAT, "count": count, "type": kind }),
        )
    }

    /// Adds vertex indices.
    pub fn indices(&mut self, indices: &[u32]) -> usize {
        let view = self.view(indices.iter().flat_map(|x| x.to_le_bytes()), Some(INDICES));
        self.accessor(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(),
            "type": "SCALAR",
        }))
    }
}
