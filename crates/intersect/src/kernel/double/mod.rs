//! Triangles and rays in double precision: the exact decisions of worlds whose coordinates do not fit `f32`.

pub(crate) mod plane;
pub(crate) mod triangle;

#[cfg(test)]
mod tests;
