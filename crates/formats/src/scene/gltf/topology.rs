//! Converts the primitive modes of glTF to separate triangles.

use super::json::Json;
use crate::ReadError;

/// How the vertices of a primitive form triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topology {
    /// Each three vertices make a triangle.
    Triangles,
    /// Each vertex from the third makes a triangle with the two before it.
    Strip,
    /// Each vertex from the third makes a triangle with the one before it and the first.
    Fan,
}

impl Topology {
    /// The topology of a primitive; `None` for points and lines.
    pub fn of(primitive: &Json) -> Result<Option<Self>, ReadError> {
        let Some(mode) = primitive.get("mode")? else { return Ok(Some(Self::Triangles)) };
        match mode.size()? {
            0..=3 => Ok(None),
            4 => Ok(Some(Self::Triangles)),
            5 => Ok(Some(Self::Strip)),
            6 => Ok(Some(Self::Fan)),
            other => Err(mode.error(format!("{other} is not a primitive mode; expected 0 to 6"))),
        }
    }

    /// Separate triangles, with the winding of glTF 2.0 (section 3.7.2.1). Triangles that use a
    /// vertex twice, as strips do to jump, are left out; so are one or two surplus vertices at the
    /// end.
    pub fn triangles(self, indices: &[u32]) -> Vec<[u32; 3]> {
        let proper = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        match self {
            Self::Triangles => indices.as_chunks::<3>().0.to_vec(),
            Self::Strip => {
                let turned = |(i, w): (usize, &[u32])| {
                    if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] }
                };
                indices.windows(3).enumerate().map(turned).filter(proper).collect()
            }
            Self::Fan => {
                let rim = indices.get(1..).unwrap_or(&[]);
                rim.windows(2).map(|w| [w[0], w[1], indices[0]]).filter(proper).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_keep_the_side_of_every_triangle_and_skip_jumps() {
        assert_eq!(Topology::Strip.triangles(&[0, 1, 2, 3]), [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(Topology::Strip.triangles(&[0, 1, 2, 2, 3, 3, 4, 5]), [[0, 1, 2], [3, 5, 4]]);
    }

    #[test]
    fn fans_share_their_first_vertex() {
        assert_eq!(Topology::Fan.triangles(&[7, 1, 2, 3]), [[1, 2, 7], [2, 3, 7]]);
    }

    #[test]
    fn too_few_vertices_make_no_triangle() {
        for topology in [Topology::Triangles, Topology::Strip, Topology::Fan] {
            for count in 0..3 {
                assert!(topology.triangles(&[0, 1, 2][..count]).is_empty());
            }
        }
    }
}
