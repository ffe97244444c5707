//! Parameters of shapes, materials and other things. They are declared once, beside the type
//! ([`declare!`](crate::declare)), and all code that checks, lists, edits or describes parameters
//! reads the declaration.
//!
//! A declaration has two sides. [`Declared::PARAMETERS`] needs no value: names, kinds, ranges,
//! units and documentation. [`Value::visit`] goes through the numbers of a value, each with its
//! place and range, so that code can look at them without knowing the fields of the type.

mod declare;
mod kind;
mod range;
mod value;
mod visit;

pub use kind::{Declaration, Kind, Parameter, plain};
pub use range::Range;
pub use value::{Declared, Value};
pub use visit::{Found, Leaf, Step, Visitor, find, place_of, problem_at, references};
