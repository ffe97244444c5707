//! Clouds of points as tables: every number of each point, in the type of the file.

use crate::mesh::{pcd, ply};
use crate::{Input, Place, ReadError, ReadOptions};
use std::path::Path;

/// The numbers of all points of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointTable {
    /// Number of points in a row. Clouds without an order have a single row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// The columns, in the order of the file.
    pub columns: Vec<Column>,
}

/// One or more numbers of each point.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The name in the file.
    pub name: String,
    /// The numbers of a point, at least 1.
    pub channels: usize,
    /// The numbers, point after point.
    pub values: Values,
}

macro_rules! values {
    ($($name:ident($kind:ty)),*) => {
        /// Numbers of one type.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Values {
            $(#[doc = concat!("`", stringify!($kind), "`.")] $name(Vec<$kind>),)*
        }

        impl Values {
            /// Adds the number whose bytes, little endian, are these; bytes that are missing are 0.
            pub(crate) fn push_bytes(&mut self, bytes: &[u8]) {
                match self {
                    $(Self::$name(all) => {
                        let mut own = [0; size_of::<$kind>()];
                        own.iter_mut().zip(bytes).for_each(|(own, byte)| *own = *byte);
                        all.push(<$kind>::from_le_bytes(own));
                    })*
                }
            }

            /// Adds the number that is nearest to this one.
            pub(crate) fn push(&mut self, number: f64) {
                match self {
                    $(Self::$name(all) => all.push(number as $kind),)*
                }
            }

            /// Adds the number that a word of a text is; false if it is none.
            pub(crate) fn push_word(&mut self, word: &str) -> bool {
                match self {
                    $(Self::$name(all) => match word.parse::<$kind>() {
                        Ok(number) => all.push(number),
                        // Some programs write whole numbers with a decimal point.
                        Err(_) => match word.parse::<f64>() {
                            Ok(number) => all.push(number as $kind),
                            Err(_) => return false,
                        },
                    },)*
                }
                true
            }

            /// The number with this index.
            pub fn get(&self, index: usize) -> f64 {
                match self {
                    $(Self::$name(all) => all[index] as f64,)*
                }
            }

            /// Bytes of a number.
            pub fn size(&self) -> usize {
                match self {
                    $(Self::$name(_) => size_of::<$kind>(),)*
                }
            }
        }
    };
}

values!(
    I8(i8),
    U8(u8),
    I16(i16),
    U16(u16),
    I32(i32),
    U32(u32),
    I64(i64),
    U64(u64),
    F32(f32),
    F64(f64)
);

impl PointTable {
    /// The column of this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }
}

/// Reads the points of a PLY or PCD file, which is recognised by its content.
pub fn read_points(path: &Path, options: &ReadOptions) -> Result<PointTable, ReadError> {
    let input = Input::open(path, options)?;
    if (ply::READER.recognises)(&input.bytes) {
        return ply::points(&input).map_err(|error| input.located(error));
    }
    if (pcd::READER.recognises)(&input.bytes) || input.extension() == "pcd" {
        return pcd::points(&input).map_err(|error| input.located(error));
    }
    let remedy = "convert it, for example with CloudCompare";
    Err(input.error(Place::Whole, "this is neither a PLY nor a PCD file", remedy))
}
