//! Arrays of numbers in JSON: short ones are written as lists, others as base64 of their
//! little-endian bytes. Both forms are read at any length.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::marker::PhantomData;

/// Arrays up to this length are written as lists.
const FEW: usize = 64;

/// A number of fixed size.
pub trait Number: Copy + Serialize + for<'a> Deserialize<'a> {
    /// Size in bytes.
    const SIZE: usize;
    /// Appends the bytes.
    fn put(self, bytes: &mut Vec<u8>);
    /// Reads a number from its bytes.
    fn get(bytes: &[u8]) -> Self;
    /// False for values that JSON cannot express.
    fn is_sayable(self) -> bool;
}

macro_rules! number {
    ($($type:ty: $is_sayable:expr,)*) => {
        $(impl Number for $type {
            const SIZE: usize = size_of::<$type>();

            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }

            fn get(bytes: &[u8]) -> Self {
                let mut own = [0; size_of::<$type>()];
                own.copy_from_slice(bytes);
                Self::from_le_bytes(own)
            }

            fn is_sayable(self) -> bool {
                let is_sayable: fn($type) -> bool = $is_sayable;
                is_sayable(self)
            }
        })*
    };
}

number! {
    u8: |_| true,
    u16: |_| true,
    u32: |_| true,
    f32: f32::is_finite,
    f64: f64::is_finite,
}

/// An array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers<T>(pub Vec<T>);

impl<T> Default for Numbers<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Numbers<T> {
    /// True if there are no numbers.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<T: Number> Serialize for Numbers<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.len() <= FEW && self.0.iter().all(|x| x.is_sayable()) {
            return serializer.collect_seq(&self.0);
        }
        let mut bytes = Vec::with_capacity(self.0.len() * T::SIZE);
        self.0.iter().for_each(|x| x.put(&mut bytes));
        serializer.serialize_str(&STANDARD.encode(bytes))
    }
}

impl<'a, T: Number> Deserialize<'a> for Numbers<T> {
    fn deserialize<D: Deserializer<'a>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumbersVisitor(PhantomData))
    }
}

struct NumbersVisitor<T>(PhantomData<T>);

impl<'a, T: Number> Visitor<'a> for NumbersVisitor<T> {
    type Value = Numbers<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of numbers, or base64 of their little-endian bytes")
    }

    fn visit_seq<A: SeqAccess<'a>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut all = Vec::new();
        while let Some(x) = list.next_element()? {
            all.push(x);
        }
        Ok(Numbers(all))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        let bytes =
            STANDARD.decode(text).map_err(|error| E::custom(format!("broken base64: {error}")))?;
        if bytes.len() % T::SIZE != 0 {
            let (found, size) = (bytes.len(), T::SIZE);
            return Err(E::custom(format!(
                "base64 of {found} bytes, expected a multiple of {size}"
            )));
        }
        Ok(Numbers(bytes.chunks_exact(T::SIZE).map(T::get).collect()))
    }
}
