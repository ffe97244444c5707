//! Tests every example of every shape against an independent oracle, and the shape's operations
//! against each other.
//!
//! `SNELL_ORACLE_RAYS` sets the number of rays per example.

mod against_oracle;
mod nearest;
mod oracle;
mod rays;
mod surface;
mod tessellation;
