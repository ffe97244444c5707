//! Heightfields of a scene: rasters of heights.

use super::Scene;
use crate::contents::Kind;
use crate::heightfield;
use crate::names::Name;
use crate::objects;
use pyo3::prelude::*;
use std::sync::Arc;

#[pymethods]
impl Scene {
    /// Adds a surface given by heights on a grid, such as a terrain raster, and returns its id.
    ///
    /// The heights are kept as they are, and rays find their way through them: that takes a
    /// fraction of the time and memory of the same triangles as a mesh, and gives the same hits.
    ///
    /// Parameters
    /// ----------
    /// z : array (rows, columns) of numbers
    ///     The heights, of which there are 2 rows and columns or more. NaN, and masked elements of
    ///     a masked array, are no data. Heights that float32 holds exactly take 4 bytes each,
    ///     others 8.
    /// transform : Affine, array (2, 3) or (3, 3), (3, 4) or (4, 4), optional
    ///     Map from columns, rows and heights to the coordinates of the scene. A height is at the
    ///     centre of its pixel, as in a raster of elevations: it belongs to the place
    ///     ``transform @ (column + 0.5, row + 0.5)``, with the `transform` of rasterio. A matrix
    ///     (4, 4), or its first three rows, maps ``(column + 0.5, row + 0.5, height)``.
    /// name, mask, material
    ///     As for :meth:`add_mesh`.
    /// smooth : bool
    ///     Whether normals for shading (:attr:`Hits.normals`, and pictures) are interpolated
    ///     between the slopes at the heights. The surface itself stays as it is.
    /// edges : "open" or "closed"
    ///     Whether rays that pass exactly through the border hit: through the outermost heights,
    ///     and those beside no data. An open border is that of a mesh, which is hit on some sides
    ///     only. (At a height on a closed border, counts and lists may have two triangles.)
    ///
    /// A *cell* is between four heights: cell ``row * (columns - 1) + column`` begins with the one
    /// in this row and column, and is cut into two triangles by the diagonal from there to the next
    /// row and column. `primitive_ids` are ``2 * cell`` on the side of the next row and
    /// ``2 * cell + 1`` on the side of the next column. A cell at a height without data is a hole.
    /// Normals point upwards, whatever the transform. `uvs` are those of an image of the same
    /// pixels: (0, 0) is the corner of its first pixel. The surface is a sheet: nothing is inside
    /// it. Pictures and files show its triangles.
    ///
    /// :meth:`update_transform` moves it from where `transform` has put it.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> scene = snell.Scene()
    /// >>> z = np.array([[1, 1, 1], [1, 5, 1], [1, 1, np.nan]])
    /// >>> terrain = scene.add_heightfield(z, [[10, 0, 448000], [0, -10, 5412000]])
    /// >>> hits = scene.cast_rays(([[448015, 5411985, 100], [448024, 5411976, 100]], [0, 0, -1]))
    /// >>> hits.t_hit.tolist()
    /// [95.0, inf]
    /// >>> bool(hits.normals[0, 2] > 0)
    /// True
    #[pyo3(signature = (
        z, transform=None, name=None, *, smooth=false, edges="open", mask=None, material=None,
    ))]
    fn add_heightfield(
        &self,
        z: &Bound<'_, PyAny>,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<Name>,
        smooth: bool,
        edges: &str,
        mask: Option<objects::Mask>,
        material: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let field = heightfield::field(z, transform, smooth, heightfield::is_closed(edges)?)?;
        self.add(z.py(), Kind::Heightfield(Arc::new(field)), (None, None), name, mask, material)
    }

    /// Replaces the heights of a heightfield.
    ///
    /// Parameters
    /// ----------
    /// id : int
    ///     The id of a heightfield.
    /// z : array (rows, columns) of numbers
    ///     As many heights as before.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> scene = snell.Scene()
    /// >>> pond = scene.add_heightfield(np.zeros((2, 2)))
    /// >>> scene.update_heights(pond, np.full((2, 2), 3.5))
    /// >>> scene.cast_rays([1, 1, 10, 0, 0, -1]).t_hit
    /// array(6.5)
    fn update_heights(&self, id: i64, z: &Bound<'_, PyAny>) -> PyResult<()> {
        let py = z.py();
        let old = self.0.contents(py).heightfield(id)?.clone();
        let field = Arc::new(heightfield::moved(&old, z)?);
        self.0.edit(py, |contents| contents.set_heightfield(id, field))
    }
}
