//! Converts the primitive modes of glTF to separate triangles.

use super::json::Json;
use crate::ReadError;
use crate::strokes::Strokes;

/// How the vertices of a primitive form points, lines or triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topology {
    /// Each vertex is a point.
    Points,
    /// Each two vertices make a line.
    Lines,
    /// One line through all vertices, and back to the first.
    LineLoop,
    /// One line through all vertices.
    LineStrip,
    /// Each three vertices make a triangle.
    Triangles,
    /// Each vertex from the third makes a triangle with the two before it.
    Strip,
    /// Each vertex from the third makes a triangle with the one before it and the first.
    Fan,
}

impl Topology {
    /// The topology of a primitive.
    pub fn of(primitive: &Json) -> Result<Self, ReadError> {
        let Some(mode) = primitive.get("mode")? else { return Ok(Self::Triangles) };
        match mode.size()? {
            0 => Ok(Self::Points),
            1 => Ok(Self::Lines),
            2 => Ok(Self::LineLoop),
            3 => Ok(Self::LineStrip),
            4 => Ok(Self::Triangles),
            5 => Ok(Self::Strip),
            6 => Ok(Self::Fan),
            other => Err(mode.error(format!("{other} is not a primitive mode; expected 0 to 6"))),
        }
    }

    /// The points and lines of a primitive; `None` for triangles.
    pub fn strokes(self, indices: &[u32]) -> Option<Strokes> {
        let mut strokes = Strokes::default();
        match self {
            Self::Points => return Some(Strokes::points(indices.to_vec())),
            Self::Lines => indices.as_chunks::<2>().0.iter().for_each(|line| strokes.push(*line)),
            Self::LineLoop | Self::LineStrip if indices.len() < 2 => {}
            Self::LineLoop => strokes.push(indices.iter().chain(&indices[..1]).copied()),
            Self::LineStrip => strokes.push(indices.iter().copied()),
            Self::Triangles | Self::Strip | Self::Fan => return None,
        }
        Some(strokes)
    }

    /// Separate triangles (none for points and lines), with the winding of glTF 2.0 (section
    /// 3.7.2.1). Triangles that use a vertex twice, as strips do to jump, are left out; so are one
    /// or two surplus vertices at the end.
    pub fn triangles(self, indices: &[u32]) -> Vec<[u32; 3]> {
        let proper = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
        match self {
            Self::Points | Self::Lines | Self::LineLoop | Self::LineStrip => Vec::new(),
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
    fn loops_close_and_a_surplus_vertex_makes_no_line() {
        let lines = |topology: Topology, indices: &[u32]| -> Vec<Vec<u32>> {
            let strokes = topology.strokes(indices).expect("no triangles");
            strokes.iter().map(<[u32]>::to_vec).collect()
        };
        assert_eq!(lines(Topology::Points, &[2, 0]), [[2], [0]]);
        assert_eq!(lines(Topology::Lines, &[0, 1, 2, 3, 4]), [[0, 1], [2, 3]]);
        assert_eq!(lines(Topology::LineLoop, &[0, 1, 2]), [[0, 1, 2, 0]]);
        assert_eq!(lines(Topology::LineStrip, &[0, 1, 2]), [[0, 1, 2]]);
        assert!(lines(Topology::LineStrip, &[0]).is_empty());
        assert_eq!(Topology::Fan.strokes(&[0, 1, 2]), None);
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
