//! The triangles of a heightfield as a mesh.

use super::Heightfield;
use crate::mesh::DTriangleMesh;

/// The triangles of a heightfield as a mesh; see [`Heightfield::to_mesh`].
#[derive(Clone, Debug, Default)]
pub struct HeightfieldMesh {
    /// The mesh. Its vertices are the nodes that triangles use, row after row.
    pub mesh: DTriangleMesh,
    /// The row and column of each vertex.
    pub nodes: Vec<[usize; 2]>,
    /// The number in the heightfield of each triangle of the mesh, ascending.
    pub numbers: Vec<u32>,
}

impl Heightfield {
    /// The triangles that are not in holes, as a mesh. It takes many times the memory of the
    /// heightfield.
    pub fn to_mesh(&self) -> HeightfieldMesh {
        let all = 0..2 * self.cell_count() as u32;
        let exists = |&triangle: &u32| {
            let [row, column] = self.cell_of(triangle as usize);
            self.cell_heights(row, column).is_some()
        };
        let numbers: Vec<u32> = all.filter(exists).collect();
        let node = |[row, column]: [usize; 2]| row * self.columns + column;
        let mut vertices = vec![u32::MAX; self.rows * self.columns];
        for &triangle in &numbers {
            for place in self.nodes(triangle as usize) {
                vertices[node(place)] = 0;
            }
        }
        let mut nodes = Vec::new();
        for (at, vertex) in vertices.iter_mut().enumerate().filter(|(_, vertex)| **vertex == 0) {
            *vertex = nodes.len() as u32;
            nodes.push([at / self.columns, at % self.columns]);
        }
        let indices = numbers
            .iter()
            .map(|&triangle| self.nodes(triangle as usize).map(|place| vertices[node(place)]))
            .collect();
        let positions = nodes.iter().map(|&[row, column]| self.node(row, column)).collect();
        HeightfieldMesh { mesh: DTriangleMesh { positions, indices }, nodes, numbers }
    }
}
