//! Parameters of things: declared once, where the thing is ([`declare!`](crate::declare)), and read
//! by all who check, list, edit or describe them.
//!
//! A declaration has two sides. [`Declared::PARAMETERS`] is known without a value: names, kinds,
//! ranges, units and documentation. [`Value::visit`] goes through the numbers of a value, each with
//! its place and range, so that nobody has to know the fields of a type to look at them.

mod declare;
mod kind;
mod range;
mod value;
mod visit;

pub use kind::{Declaration, Kind, Parameter, plain};
pub use range::Range;
pub use value::{Declared, Value};
pub use visit::{Found, Leaf, Step, Visitor, find, place_of, problem_at, references};
