//! The class `Scene` and its objects. Instances and the places of objects are in [`placing`], what
//! it tells of objects in [`reading`]; queries are in [`rays`] and [`points`], materials, lights
//! and cameras in [`crate::stage`].

mod heightfields;
mod placing;
mod points;
mod rays;
mod reading;

use crate::arrays::from_vec;
use crate::contents::{Contents, Kind, Object};
use crate::names::Name;
use crate::objects;
use crate::place::{Place, place};
use crate::stage::{add_materials, add_white, warn_without_uvs};
use crate::state::Shared;
use crate::work::run_to_end;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::sync::Arc;

/// Things to cast rays at: meshes, shapes and instances of other scenes.
///
/// Objects can be added and changed at any time, also while other threads query the scene; a query
/// sees the scene as it was when it started. Changes are built when the next query needs them.
/// `add_` methods return ids, which count from 0 and are never reused.
///
/// The dtype of a query's input decides its precision. `float32` rays and points are answered in
/// single precision. `float64` ones (and integers and plain Python numbers) are answered in double
/// precision, from vertices as they were given: nothing is rounded to `float32`.
///
/// Lengths are in the units of the scene, whatever they are; `t` is in units of the direction's
/// length.
///
/// Examples
/// --------
/// >>> import numpy as np, snell
/// >>> scene = snell.Scene()
/// >>> triangle = scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
/// >>> hits = scene.cast_rays(np.array([[0.25, 0.5, -2, 0, 0, 1]], dtype=np.float32))
/// >>> hits.t_hit, hits.primitive_uvs
/// (array([2.], dtype=float32), array([[0.25, 0.5 ]], dtype=float32))
#[pyclass(frozen, mapping, module = "snell")]
#[derive(Debug, Default)]
pub struct Scene(pub Shared);

impl Scene {
    fn add(
        &self,
        py: Python<'_>,
        kind: Kind,
        (transform, times): (Option<&Bound<'_, PyAny>>, Option<&Bound<'_, PyAny>>),
        name: Option<Name>,
        mask: Option<impl Into<i128>>,
        material: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let (place, mask) = (place(transform, times)?, objects::mask(mask)?);
        self.add_placed(py, kind, place, name, mask, material)
    }

    fn add_placed(
        &self,
        py: Python<'_>,
        kind: Kind,
        Place { transform, motion }: Place,
        name: Option<Name>,
        mask: u64,
        material: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        self.0.edit(py, |contents| {
            let mut materials = add_materials(contents, material)?;
            if materials.is_empty() && has_colors(&kind) {
                materials.push(Some(add_white(contents)));
            }
            let object = Object {
                motion,
                mask,
                materials,
                ..Object::new(kind, transform, name.map(|name| name.0))
            };
            warn_without_uvs(py, contents, &object)?;
            contents.add(object)
        })
    }
}

/// True for a mesh whose vertices have colours.
fn has_colors(kind: &Kind) -> bool {
    match kind {
        Kind::Mesh(mesh) => !mesh.attributes().colors.is_empty(),
        Kind::Spheres(spheres) => !spheres.colors.is_empty(),
        Kind::Curves(curves) => !curves.colors().is_empty(),
        _ => false,
    }
}

#[pymethods]
impl Scene {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Adds a triangle mesh and returns its id.
    ///
    /// Parameters
    /// ----------
    /// vertices : array (n, 3), or a mesh of trimesh, Open3D, meshio or PyVista
    ///     Finite positions. `float32` is kept as it is; all else is kept in double precision. A
    ///     mesh brings its colours, and one of trimesh its texture, unless others are given; a
    ///     `trimesh.Scene` or a list of meshes becomes one mesh.
    /// faces : array (m, 3) of integers
    ///     Vertex numbers; seen from the outer side they go around counterclockwise. Left out for a
    ///     mesh of another library.
    /// transform : array (4, 4) or (3, 4), optional
    ///     Map from the coordinates of the mesh to the scene's; column vectors, so the translation
    ///     is the last column. Or `(k, 4, 4)`, one for each of `times`, for a mesh that moves.
    /// name : str, optional
    ///     A name for users; see :attr:`names`.
    /// mask : int, optional
    ///     64 bits: only rays whose mask shares a bit with it hit the mesh. All bits if left out.
    /// normals : array (n, 3), optional
    ///     Normals at the vertices, of any length, for :attr:`Hits.normals`.
    /// uvs : array (n, 2), optional
    ///     Texture coordinates at the vertices, for :attr:`Hits.uvs` and textures. (0, 0) is the
    ///     upper left corner of an image.
    /// colors : array (n, 3) or (n, 4), optional
    ///     Colours at the vertices, which the material's colour is multiplied by: floats are
    ///     linear, from 0 to 1; uint8 and uint16 are sRGB.
    /// material : Material or list of Material, optional
    ///     For rendering; if left out, white for a mesh with colours, otherwise grey. For a list,
    ///     `material_ids` selects the material of each face.
    /// material_ids : array (m,) of integers, optional
    ///     Index in the list for each face; the first material if left out.
    /// times : array (k,), optional
    ///     The times of the transforms of a mesh that moves; see :meth:`update_transform`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], name="triangle")
    /// 0
    #[pyo3(signature = (
        vertices, faces=None, transform=None, name=None, *, mask=None, normals=None, uvs=None,
        colors=None, material=None, material_ids=None, times=None,
    ))]
    fn add_mesh<'py>(
        &self,
        vertices: &Bound<'py, PyAny>,
        faces: Option<&Bound<'py, PyAny>>,
        transform: Option<&Bound<'py, PyAny>>,
        name: Option<Name>,
        mask: Option<objects::Mask>,
        normals: Option<&Bound<'py, PyAny>>,
        uvs: Option<&Bound<'py, PyAny>>,
        colors: Option<&Bound<'py, PyAny>>,
        material: Option<&Bound<'py, PyAny>>,
        material_ids: Option<&Bound<'py, PyAny>>,
        times: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<u32> {
        if faces.is_some() && vertices.hasattr("vertices")? {
            return Err(PyTypeError::new_err(
                "add_mesh: a mesh has its own faces, so the second argument is not taken; give a \
                 transform as transform=",
            ));
        }
        let parts = faces.is_none().then(|| objects::parts(vertices)).transpose()?;
        let own = |given: Option<&Bound<'py, PyAny>>, name: &str| match (given, &parts) {
            (None, Some(parts)) => parts.get_item(name),
            (given, _) => Ok(given.cloned()),
        };
        let [vertices, faces] = [own(faces.and(Some(vertices)), "vertices")?, own(faces, "faces")?];
        let (uvs, colors) = (own(uvs, "uvs")?, own(colors, "colors")?);
        let material = own(material, "material")?;
        let given =
            objects::Given { normals, uvs: uvs.as_ref(), colors: colors.as_ref(), material_ids };
        let vertices = vertices.ok_or_else(|| PyTypeError::new_err("vertices are left out"))?;
        let mesh = objects::mesh(&vertices, faces.as_ref(), &given)?;
        let kind = Kind::Mesh(Arc::new(mesh));
        self.add(vertices.py(), kind, (transform, times), name, mask, material.as_ref())
    }

    /// Adds an analytic shape and returns its id. :data:`SHAPES` lists the shapes and their
    /// parameters.
    ///
    /// Parameters
    /// ----------
    /// shape : str
    ///     The name of the shape, such as `"sphere"`. Shapes are centred at the origin; see the
    ///     user's guide for each.
    /// transform : array (4, 4) or (3, 4), optional
    ///     Map from the coordinates of the shape to the scene's.
    /// name, mask, times
    ///     As for :meth:`add_mesh`.
    /// material : Material, optional
    ///     For rendering; grey if left out.
    /// **parameters
    ///     The parameters of the shape, in units of the scene.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.add_shape("cylinder", radius=0.5, height=2)
    /// 0
    #[pyo3(signature = (
        shape, transform=None, name=None, *, mask=None, material=None, times=None, **parameters
    ))]
    fn add_shape(
        &self,
        py: Python<'_>,
        shape: &str,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<Name>,
        mask: Option<objects::Mask>,
        material: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<u32> {
        let shape = objects::shape(shape, parameters)?;
        self.add(py, Kind::Shape(Arc::new(shape)), (transform, times), name, mask, material)
    }

    /// Adds many spheres as one object, such as a point cloud or particles, and returns its id.
    ///
    /// Parameters
    /// ----------
    /// centers : array (n, 3)
    ///     Finite positions. `float32` is kept as it is; all else is kept in double precision.
    /// radii : array (n,) or float
    ///     Positive radii.
    /// transform, name, mask, material, times
    ///     As for :meth:`add_mesh`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> cloud = scene.add_spheres([[0, 0, 0], [0, 0, 5]], 0.5)
    /// >>> scene.cast_rays([0, 0, 2, 0, 0, 1]).primitive_ids
    /// array(1, dtype=uint32)
    #[pyo3(signature = (
        centers, radii, transform=None, name=None, *, mask=None, material=None, times=None,
    ))]
    fn add_spheres(
        &self,
        centers: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<Name>,
        mask: Option<objects::Mask>,
        material: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let spheres = objects::spheres(centers, radii)?;
        self.add(
            centers.py(),
            Kind::Spheres(Arc::new(spheres)),
            (transform, times),
            name,
            mask,
            material,
        )
    }

    /// Adds strands of round curves as one object, such as hair, fur, grass or wires, and returns
    /// its id.
    ///
    /// Parameters
    /// ----------
    /// points : array (n, 3)
    ///     Finite positions of the points of all strands, one strand after the other. `float32` is
    ///     kept as it is; all else is kept in double precision.
    /// radii : array (n,) or float
    ///     Radius at each point, 0 or more.
    /// strands : sequence of int, optional
    ///     Number of points of each strand. One strand if left out.
    /// basis : str
    ///     ``"linear"`` (2 points or more for each strand), ``"bezier"`` (3 for each segment and 1
    ///     more), ``"b-spline"`` or ``"catmull-rom"`` (4 or more).
    /// transform, name, mask, material, times
    ///     As for :meth:`add_mesh`.
    ///
    /// Rays hit strands from outside only: where they enter, not where they exit.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> wire = scene.add_curves([[0, 0, 0], [0, 1, 0], [1, 1, 0]], 0.25, basis="linear")
    /// >>> float(scene.cast_rays([0, 0.5, 2, 0, 0, -1]).t_hit)
    /// 1.75
    #[pyo3(signature = (
        points, radii, strands=None, basis="bezier", transform=None, name=None, *, mask=None,
        material=None, times=None,
    ))]
    #[expect(clippy::too_many_arguments, reason = "these are the arguments of Python")]
    fn add_curves(
        &self,
        points: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        strands: Option<&Bound<'_, PyAny>>,
        basis: &str,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<Name>,
        mask: Option<objects::Mask>,
        material: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let curves = objects::curves(points, radii, strands, basis)?;
        self.add(
            points.py(),
            Kind::Curves(Arc::new(curves)),
            (transform, times),
            name,
            mask,
            material,
        )
    }

    /// Moves the vertices of a mesh. The faces stay, so the acceleration structure of a mesh in
    /// single precision is refitted, not rebuilt.
    ///
    /// Parameters
    /// ----------
    /// id : int
    ///     The id of a mesh.
    /// vertices : array (n, 3)
    ///     Positions, as many as before.
    /// normals : array (n, 3), optional
    ///     Normals at the vertices; the old normals stay if they are left out.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> mesh = scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    /// >>> scene.update_vertices(mesh, [[0, 0, 7], [1, 0, 7], [0, 1, 7]])
    /// >>> scene.cast_rays([0.2, 0.2, 0, 0, 0, 1]).t_hit
    /// array(7.)
    #[pyo3(signature = (id, vertices, normals=None))]
    fn update_vertices(
        &self,
        id: i64,
        vertices: &Bound<'_, PyAny>,
        normals: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let py = vertices.py();
        let old = self.0.contents(py).mesh(id)?.clone();
        let positions = objects::positions(vertices, "vertices")?;
        let (found, expected) = (positions.len(), old.vertex_count());
        if found != expected {
            return Err(PyValueError::new_err(format!(
                "vertices: there are {found}, expected {expected} as before"
            )));
        }
        let normals = objects::normals(normals, expected)?;
        let mesh = Arc::new(py.detach(|| old.moved(positions, normals)));
        self.0.edit(py, |contents| contents.set_mesh(id, mesh))
    }

    /// Sets the mask of an object: only rays whose mask shares a bit with it hit the object.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.update_mask(ball, 0b10)
    /// >>> scene.test_occlusions([0, 0, -5, 0, 0, 1], mask=0b01)
    /// array(False)
    fn update_mask(&self, py: Python<'_>, id: i64, mask: objects::Mask) -> PyResult<()> {
        let mask = objects::mask(Some(mask))?;
        self.0.edit(py, |contents| {
            contents.get_mut(id)?.mask = mask;
            Ok(())
        })
    }

    /// Removes an object. Its id is not reused.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.remove(ball)
    /// >>> len(scene)
    /// 0
    fn remove(&self, py: Python<'_>, id: i64) -> PyResult<()> {
        self.0.edit(py, |contents| contents.remove(id))
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.0.contents(py).objects().count()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let contents = self.0.contents(py);
        let count = |wanted: fn(&Kind) -> bool| {
            contents.objects().filter(|(_, object)| wanted(&object.kind)).count()
        };
        let meshes = count(|kind| matches!(kind, Kind::Mesh(_)));
        let instances = count(|kind| matches!(kind, Kind::Instance(_)));
        let fields = count(|kind| matches!(kind, Kind::Heightfield(_)));
        let others =
            count(|kind| matches!(kind, Kind::Shape(_) | Kind::Spheres(_) | Kind::Curves(_)));
        let fields = if fields > 0 { format!("{fields} heightfields, ") } else { String::new() };
        format!(
            "<snell.Scene: {meshes} meshes, {fields}{others} shapes and sets of spheres, \
                {instances} instances>"
        )
    }

    /// Opens the scene in the viewer; the same as :func:`view`, with its options. In a notebook
    /// the viewer is shown in the cell.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> with scene.show(open=False) as view:
    /// ...     view.url.startswith("http")
    /// True
    #[pyo3(signature = (**options))]
    fn show<'py>(
        slf: Bound<'py, Self>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("snell._view")?.getattr("view")?.call((slf,), options)
    }

    /// A small picture of the scene, which notebooks show; `None` for a scene that has none.
    fn _repr_png_<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("snell._view")?.getattr("preview")?.call1((slf,))
    }

    /// Builds the acceleration structures that the next query would build first.
    ///
    /// Parameters
    /// ----------
    /// dtype : numpy.float32 or numpy.float64
    ///     Precision of the queries. `float32` if left out.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.add_shape("sphere", radius=1)
    /// 0
    /// >>> scene.commit()
    #[pyo3(signature = (dtype=None))]
    fn commit(&self, py: Python<'_>, dtype: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        if precision(py, dtype)? {
            self.0.snapshot::<f64>(py).map(|_| ())
        } else {
            self.0.snapshot::<f32>(py).map(|_| ())
        }
    }

    /// The bounding box: minimum and maximum corner, an array `(2, 3)` of float64. Infinite if an
    /// object is; the minimum exceeds the maximum if the scene is empty.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.bounds.tolist()
    /// [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let contents = self.0.contents(py);
        let bounds = run_to_end(py, move || contents.bounds())?;
        from_vec(py, [bounds.min.to_array(), bounds.max.to_array()].concat(), &[2, 3])
    }

    /// Whether the acceleration structures of meshes take less memory, by storing shared vertices
    /// once. Hits are the same; queries of incoherent rays take up to a quarter longer. The setting
    /// also holds for instanced scenes.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.compact = True
    /// >>> id = scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    /// >>> scene.cast_rays([[0.2, 0.2, 1, 0, 0, -1]]).t_hit.tolist()
    /// [1.0]
    #[getter]
    fn compact(&self, py: Python<'_>) -> bool {
        self.0.contents(py).compact
    }

    #[setter]
    fn set_compact(&self, py: Python<'_>, compact: bool) -> PyResult<()> {
        self.0.edit(py, |contents| {
            contents.compact = compact;
            Ok(())
        })
    }

    /// Statistics of the acceleration structures: numbers of triangles and nodes, and bytes without
    /// the vertices.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> id = scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    /// >>> scene.statistics()["triangles"]
    /// 1
    #[pyo3(signature = (dtype=None))]
    fn statistics<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let stats = if precision(py, dtype)? {
            *self.0.snapshot::<f64>(py)?.world.stats()
        } else {
            *self.0.snapshot::<f32>(py)?.world.stats()
        };
        let all = PyDict::new(py);
        all.set_item("triangles", stats.triangles)?;
        all.set_item("skipped_triangles", stats.skipped_triangles)?;
        all.set_item("instanced_triangles", stats.instanced_triangles)?;
        all.set_item("spheres", stats.primitives)?;
        all.set_item("nodes", stats.nodes)?;
        all.set_item("memory_bytes", stats.memory_bytes)?;
        all.set_item("groups_kept", stats.reuse.kept)?;
        all.set_item("groups_refitted", stats.reuse.refitted)?;
        all.set_item("groups_built", stats.reuse.built)?;
        Ok(all)
    }

    /// Scenes share unchanged data, so copies are cheap.
    fn __copy__(&self, py: Python<'_>) -> Self {
        Self(Shared::new(self.0.contents(py)))
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> Self {
        self.__copy__(py)
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        crate::pickle::reduce(py, &self.0.contents(py))
    }
}

impl Scene {
    /// A scene of these contents.
    pub fn of(contents: Contents) -> Self {
        Self(Shared::new(Arc::new(contents)))
    }
}

/// True for the dtype `float64`, false for `float32` or no dtype.
pub fn precision(py: Python<'_>, dtype: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
    let Some(dtype) = dtype else { return Ok(false) };
    let dtype = crate::arrays::numpy(py, "dtype")?.call1((dtype,))?;
    let name: String = dtype.getattr("name")?.extract()?;
    match name.as_str() {
        "float32" => Ok(false),
        "float64" => Ok(true),
        other => {
            Err(PyValueError::new_err(format!("dtype is {other}, expected float32 or float64")))
        }
    }
}
