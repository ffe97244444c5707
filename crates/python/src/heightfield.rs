//! Heightfields: rasters of heights as objects of a scene.

use crate::arrays::{contiguous, from_vec, shown, slice};
use crate::mesh::{Attributes, Mesh, Positions};
use crate::names::choice;
use crate::place::named_transform;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use snell_intersect::{Heightfield, HeightfieldError, HeightfieldMesh, Heights};
use snell_math::{DMat4, DVec2, DVec3, Transform};
use std::sync::{Arc, OnceLock};

/// A heightfield of a scene.
#[derive(Debug)]
pub struct Field {
    /// The surface.
    pub grid: Arc<Heightfield>,
    /// True if normals for shading are those of a smooth surface.
    pub is_smooth: bool,
    made: OnceLock<Triangles>,
}

/// The triangles of a heightfield as a mesh.
#[derive(Clone, Debug)]
pub struct Triangles {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// The number in the heightfield of each triangle of the mesh; `None` if these are the same.
    pub numbers: Option<Arc<[u32]>>,
}

impl Field {
    /// A heightfield.
    pub fn new(grid: Heightfield, is_smooth: bool) -> Self {
        Self { grid: Arc::new(grid), is_smooth, made: OnceLock::new() }
    }

    /// The triangles as they are rendered and written; kept, so that the next picture shares them.
    pub fn triangles(&self) -> &Triangles {
        self.made.get_or_init(|| self.to_triangles())
    }

    /// The triangles that are no holes, as a mesh of the nodes that they use.
    pub fn to_triangles(&self) -> Triangles {
        if let Some(made) = self.made.get() {
            return made.clone();
        }
        let grid = &*self.grid;
        let HeightfieldMesh { mesh, nodes, numbers } = grid.to_mesh();
        let normal = |&[row, column]: &[usize; 2]| grid.node_normal(row, column).as_vec3();
        let attributes = Attributes {
            normals: if self.is_smooth { nodes.iter().map(normal).collect() } else { Vec::new() },
            uvs: nodes.iter().map(|&[row, column]| grid.uv(row, column).as_vec2()).collect(),
            ..Attributes::default()
        };
        let are_all = numbers.len() == 2 * grid.cell_count();
        let positions = Positions::Double(mesh.positions);
        Triangles {
            mesh: Arc::new(Mesh::new(positions, mesh.indices, attributes)),
            numbers: (!are_all).then(|| numbers.into()),
        }
    }

    /// The texture coordinates, and the normal for shading if it is smooth, at a point of a
    /// triangle that is given by barycentrics.
    pub fn attributes(&self, triangle: usize, barycentrics: [f64; 3]) -> (DVec2, Option<DVec3>) {
        let nodes = self.grid.nodes(triangle);
        let weighted = || nodes.iter().zip(barycentrics);
        let uv = weighted().map(|(&[row, column], b)| self.grid.uv(row, column) * b).sum();
        let normal =
            |(&[row, column], b): (&[usize; 2], f64)| self.grid.node_normal(row, column) * b;
        (uv, self.is_smooth.then(|| weighted().map(normal).sum()))
    }

    /// The heights as an array `(rows, columns)`.
    pub fn heights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let shape = [self.grid.rows(), self.grid.columns()];
        match self.grid.heights() {
            Heights::Single(all) => from_vec(py, all.clone(), &shape),
            Heights::Double(all) => from_vec(py, all.clone(), &shape),
        }
    }

    /// The map from columns, rows and heights, as a matrix.
    pub fn placed(&self) -> Transform {
        let matrix = DMat4::from(*self.grid.group_from_grid());
        Transform::from_matrix(matrix).unwrap_or(Transform::IDENTITY)
    }
}

/// Reads heights: an array `(rows, columns)` of any real numbers, in which NaN and masked elements
/// are no data. Returns rows, columns and heights.
pub fn heights(z: &Bound<'_, PyAny>) -> PyResult<(usize, usize, Heights)> {
    let py = z.py();
    let array = py.import("snell._rasters")?.getattr("heights_of")?.call1((z,))?;
    let array = array.cast_into::<PyUntypedArray>()?;
    let &[rows, columns] = array.shape() else {
        let found = shown(array.shape());
        let remedy = match array.shape() {
            [1, _, _] => "; give z[0], the only band",
            [_, _, _] => "; give one band, such as z[0]",
            _ => "",
        };
        let message = format!("z: shape is {found}, expected (rows, columns){remedy}");
        return Err(PyValueError::new_err(message));
    };
    let heights = if array.dtype().getattr("itemsize")?.extract::<usize>()? == 4 {
        Heights::Single(slice(&contiguous::<f32>(&array)?)?.to_vec())
    } else {
        let values = contiguous::<f64>(&array)?;
        let values = slice(&values)?;
        py.detach(|| Heights::of_doubles(values.to_vec()))
    };
    Ok((rows, columns, heights))
}

/// Reads a heightfield.
pub fn field(
    z: &Bound<'_, PyAny>,
    transform: Option<&Bound<'_, PyAny>>,
    is_smooth: bool,
    is_closed: bool,
) -> PyResult<Field> {
    let py = z.py();
    let placed = match transform {
        None => Transform::IDENTITY,
        Some(given) => {
            let matrix = py.import("snell._rasters")?.getattr("matrix_of")?.call1((given,))?;
            named_transform(&matrix, "transform")?
        }
    };
    let (rows, columns, heights) = heights(z)?;
    let made = py.detach(|| Heightfield::new(rows, columns, heights, *placed.matrix()));
    let made = made.map_err(|error| problem(&error))?;
    Ok(Field::new(made.with_closed_border(is_closed), is_smooth))
}

/// Reads the argument `edges`: whether the border of the surface belongs to it.
pub fn is_closed(edges: &str) -> PyResult<bool> {
    choice("edges", edges, &[("open", false), ("closed", true)], |(name, _)| name)
        .map(|(_, is_closed)| is_closed)
}

/// A copy of a heightfield with other heights.
pub fn moved(field: &Field, z: &Bound<'_, PyAny>) -> PyResult<Field> {
    let (rows, columns, heights) = heights(z)?;
    let expected = (field.grid.rows(), field.grid.columns());
    if (rows, columns) != expected {
        let message = format!("z: shape is {:?}, expected {expected:?} as before", (rows, columns));
        return Err(PyValueError::new_err(message));
    }
    let made = z.py().detach(|| field.grid.with_heights(heights));
    Ok(Field::new(made.map_err(|error| problem(&error))?, field.is_smooth))
}

fn problem(error: &HeightfieldError) -> PyErr {
    PyValueError::new_err(match error {
        HeightfieldError::Infinite { row, column, value } => format!(
            "z[{row}, {column}] is {value}, expected a finite number, or NaN where there is no data"
        ),
        HeightfieldError::Singular => {
            "transform is singular or too large, expected one with an inverse".to_string()
        }
        other => format!("z: {other}"),
    })
}
