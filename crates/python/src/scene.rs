//! The class `Scene`: what it holds, and what it is asked.

use crate::answers::{Asked, ClosestPoints, Hits, Intersections, Live, Named};
use crate::arrays::{Column, PointArray, array, from_vec, is_double, leading, slice};
use crate::assemble::Snapshot;
use crate::contents::{Contents, Kind, Object};
use crate::nearest::PointPrecision;
use crate::objects;
use crate::precision::Precision;
use crate::query::{FEW, Pieces, Question};
use crate::rays::{Limits, RayArgument, RayArrays};
use crate::stage::add_materials;
use crate::state::{Kept, Shared};
use crate::work::{Stopped, Threads, run, run_to_end};
use numpy::PyUntypedArray;
use pyo3::exceptions::{PyRuntimeWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rayon::prelude::*;
use snell_intersect::World;
use snell_math::{DVec3, Transform};
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

/// Points of a piece.
const POINTS: usize = 64;

/// Things to cast rays at: meshes, shapes and instances of other scenes.
///
/// Objects are added and changed at any time, also while other threads ask; a query sees the scene as it was when it began. What has
/// changed is built when the next query needs it. `add_` methods give ids, which count from 0 and are never used again.
///
/// The dtype of a question decides its precision. `float32` rays and points are answered in single precision. `float64` ones (and integers
/// and plain Python numbers) are answered in double precision, from vertices as they were given: nothing is rounded to `float32`.
///
/// Lengths are in the units of the scene, whatever they are; `t` is in units of the direction's length.
///
/// Examples
/// --------
/// >>> import numpy as np, snell
/// >>> scene = snell.Scene()
/// >>> triangle = scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
/// >>> hits = scene.cast_rays(np.array([[0.25, 0.5, -2, 0, 0, 1]], dtype=np.float32))
/// >>> hits.t_hit, hits.primitive_uvs
/// (array([2.], dtype=float32), array([[0.25, 0.5 ]], dtype=float32))
#[pyclass(frozen, module = "snell")]
#[derive(Debug, Default)]
pub struct Scene(pub Shared);

impl Scene {
    fn add(
        &self,
        py: Python<'_>,
        kind: Kind,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<String>,
        mask: Option<i64>,
        material: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let (transform, mask) = (objects::transform(transform)?, objects::mask(mask)?);
        self.0.edit(py, |contents| {
            let materials = add_materials(contents, material)?;
            contents.add(Object { mask, materials, ..Object::new(kind, transform, name) })
        })
    }

    /// Asks about rays.
    fn ask<'py, P: Precision + Kept, T>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: Options,
        answer: impl FnOnce(&Arc<Snapshot<P>>, &RayArrays<'py, P>, &Question<'_, P>) -> PyResult<T>,
    ) -> PyResult<T> {
        let py = limits.t_min.py();
        let snapshot = self.0.snapshot::<P>(py)?;
        let arrays = RayArrays::<P>::new(rays, limits)?;
        let invalid = AtomicUsize::new(0);
        let invalid_wanted = options.warn_invalid.then_some(&invalid);
        let question = Question { rays: arrays.view()?, grouping: rays.grouping(), invalid: invalid_wanted };
        let result = answer(&snapshot, &arrays, &question)?;
        match invalid.into_inner() {
            0 => {}
            n => {
                let message = format!(
                    "{n} of {} rays can hit nothing: not finite, without direction, or with t_min >= t_max",
                    rays.len()
                );
                let message = std::ffi::CString::new(message).unwrap_or_default();
                PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &message, 1)?;
            }
        }
        Ok(result)
    }

    fn cast<'py, P: Precision + Kept>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: Options,
    ) -> PyResult<Hits> {
        let (py, count) = (limits.t_min.py(), rays.len());
        self.ask::<P, _>(rays, limits, options, |snapshot, arrays, question| {
            let world = &*snapshot.world;
            let hits = run(py, options.threads, count <= FEW, |cancel| {
                question.pieces(cancel, |rays, hits| P::closest(world, rays, question.grouping, hits))
            })?;
            // Where the ray met a shape decides its surface.
            let kept = arrays.keep(!snapshot.names.are_all_meshes())?;
            Ok(Hits(Named::new(Live::<P, P> {
                snapshot: snapshot.clone(),
                hits,
                asked: Asked::Rays(kept, None),
                rays: count,
                shape: rays.shape.clone(),
                splits: None,
            })))
        })
    }

    fn occlusions<'py, P: Precision + Kept>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: Options,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, count) = (limits.t_min.py(), rays.len());
        self.ask::<P, _>(rays, limits, options, |snapshot, _, question| {
            let world = &*snapshot.world;
            let blocked = run(py, options.threads, count <= FEW, |cancel| {
                let mut blocked = vec![false; count];
                let query = |rays: snell_intersect::Rays<'_, P::Tag>, blocked: &mut [bool]| {
                    P::occluded(world, rays, question.grouping, blocked);
                };
                question.answer(cancel, &mut blocked, query)?;
                Ok(blocked)
            })?;
            from_vec(py, blocked, &rays.shape)
        })
    }

    fn count<'py, P: Precision + Kept>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: Options,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, count) = (limits.t_min.py(), rays.len());
        self.ask::<P, _>(rays, limits, options, |snapshot, _, question| {
            let world = &*snapshot.world;
            let counts = run(py, options.threads, count <= FEW, |cancel| {
                let mut counts = vec![0u32; count];
                let query = |rays: snell_intersect::Rays<'_, P::Tag>, counts: &mut [u32]| P::count(world, rays, counts);
                question.answer(cancel, &mut counts, query)?;
                Ok(counts)
            })?;
            from_vec(py, counts, &rays.shape)
        })
    }

    fn list<'py, P: Precision + Kept>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: Options,
    ) -> PyResult<Intersections> {
        let (py, count) = (limits.t_min.py(), rays.len());
        if u32::try_from(rays.len()).is_err() {
            return Err(PyValueError::new_err(format!(
                "rays: there are {}, expected at most {}",
                rays.len(),
                u32::MAX
            )));
        }
        self.ask::<P, _>(rays, limits, options, |snapshot, arrays, question| {
            let world = &*snapshot.world;
            let (hits, splits, ids) = run(py, options.threads, count <= FEW, |cancel| {
                let pieces = question.all(cancel, |rays| P::all(world, rays))?;
                let total = pieces.iter().map(|piece| piece.hits.len()).sum();
                let (mut hits, mut ids) = (Vec::with_capacity(total), Vec::with_capacity(total));
                let mut splits = Vec::with_capacity(count + 1);
                splits.push(0);
                for piece in pieces {
                    cancel.check()?;
                    for ends in piece.ray_splits.windows(2) {
                        let ray = (splits.len() - 1) as u32;
                        hits.extend_from_slice(&piece.hits[ends[0]..ends[1]]);
                        ids.resize(hits.len(), ray);
                        splits.push(hits.len() as i64);
                    }
                }
                Ok((Pieces::from(hits), splits, ids))
            })?;
            let kept = arrays.keep(!snapshot.names.are_all_meshes())?;
            Ok(Intersections(Named::new(Live::<P, P> {
                snapshot: snapshot.clone(),
                shape: vec![hits.len()],
                hits,
                asked: Asked::Rays(kept, Some(ids)),
                rays: count,
                splits: Some(splits),
            })))
        })
    }

    fn closest<'py, P: PointPrecision>(
        &self,
        points: &Bound<'py, PyUntypedArray>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: u32,
        threads: Threads,
        snapshot: Arc<Snapshot<P::Form>>,
    ) -> PyResult<ClosestPoints> {
        let (py, points) = (points.py(), PointArray::<P>::new(points, "points")?);
        let limit = limit(max_distance, &points.shape)?;
        let limit = limit.values()?;
        let values = slice(&points.values)?.as_chunks::<3>().0;
        let (world, names) = (&*snapshot.world, &snapshot.names);
        let (hits, positions) = run(py, threads, values.len() <= POINTS, |cancel| {
            let mut hits = vec![P::Hit::default(); values.len()];
            let mut positions = vec![[P::default(); 3]; values.len()];
            let each = |(i, (hits, positions)): (usize, (&mut [P::Hit], &mut [[P; 3]]))| {
                cancel.check()?;
                for (k, (hit, position)) in hits.iter_mut().zip(positions).enumerate() {
                    let number = i * POINTS + k;
                    let near = P::nearest(world, names, values[number], limit.get(number), mask);
                    (*hit, *position) = (P::hit(&near.found), near.position);
                }
                Ok(())
            };
            if values.len() <= POINTS {
                hits.chunks_mut(POINTS).zip(positions.chunks_mut(POINTS)).enumerate().try_for_each(each)?;
            } else {
                let pieces = hits.par_chunks_mut(POINTS).zip(positions.par_chunks_mut(POINTS));
                pieces.enumerate().try_for_each(each)?;
            }
            Ok((Pieces::from(hits), positions))
        })?;
        Ok(ClosestPoints(Named::new(Live::<P, P::Form> {
            snapshot,
            hits,
            asked: Asked::Positions(positions),
            rays: 0,
            shape: points.shape,
            splits: None,
        })))
    }

    /// One answer per point.
    fn of_points<'py, P: PointPrecision, T: numpy::Element + Default + Copy + Send>(
        &self,
        points: &Bound<'py, PyUntypedArray>,
        threads: Threads,
        answer: impl Fn(usize, [P; 3]) -> T + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, points) = (points.py(), PointArray::<P>::new(points, "points")?);
        let values = slice(&points.values)?.as_chunks::<3>().0;
        let answers = run(py, threads, values.len() <= POINTS, |cancel| {
            let mut answers = vec![T::default(); values.len()];
            let each = |(i, places): (usize, &mut [T])| -> Result<(), Stopped> {
                cancel.check()?;
                for (k, place) in places.iter_mut().enumerate() {
                    *place = answer(i * POINTS + k, values[i * POINTS + k]);
                }
                Ok(())
            };
            if values.len() <= POINTS {
                answers.chunks_mut(POINTS).enumerate().try_for_each(each)?;
            } else {
                answers.par_chunks_mut(POINTS).enumerate().try_for_each(each)?;
            }
            Ok(answers)
        })?;
        from_vec(py, answers, &points.shape)
    }

    fn distances<'py, P: PointPrecision>(
        &self,
        points: &Bound<'py, PyUntypedArray>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: u32,
        threads: Threads,
        snapshot: &Snapshot<P::Form>,
        signed: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let limit = limit::<P>(max_distance, &leading(points, 3, "points")?)?;
        let limit = limit.values()?;
        let (world, names) = (&*snapshot.world, &snapshot.names);
        self.of_points::<P, P>(points, threads, |i, point| {
            let (limit, zero) = (limit.get(i), P::round(0.0));
            let found = P::nearest(world, names, point, limit, mask).found;
            if !signed {
                return found.t;
            }
            let is_limit = limit.into() >= 0.0 && point.iter().all(|&x| x.into().is_finite());
            let distance = if found.t.into().is_infinite() && is_limit { limit } else { found.t };
            if distance != zero && P::is_inside(world, point) { P::round(-distance.into()) } else { distance }
        })
    }
}

/// How far to look.
fn limit<'py, P: Precision>(max_distance: Option<&Bound<'py, PyAny>>, shape: &[usize]) -> PyResult<Column<'py, P>> {
    match max_distance {
        None => Ok(Column::All(P::round(f64::INFINITY))),
        Some(limit) => Column::new(limit, shape, "max_distance"),
    }
}

/// What a query over rays may be told.
#[derive(Clone, Copy, Debug)]
struct Options {
    threads: Threads,
    warn_invalid: bool,
}

/// Asks in the precision of the rays.
macro_rules! by_rays {
    ($scene:ident . $method:ident ($py:ident, $rays:ident, $t_min:ident, $t_max:ident, $mask:ident, $threads:ident, $warn:ident)) => {{
        let rays = RayArgument::new($rays)?;
        let zero = 0.0f64.into_pyobject($py)?.into_any();
        let infinity = f64::INFINITY.into_pyobject($py)?.into_any();
        let limits = Limits { t_min: $t_min.unwrap_or(&zero), t_max: $t_max.unwrap_or(&infinity), mask: $mask };
        let options = Options { threads: Threads::new($threads)?, warn_invalid: $warn };
        if rays.is_double {
            $scene.$method::<f64>(&rays, &limits, options)
        } else {
            $scene.$method::<f32>(&rays, &limits, options)
        }
    }};
}

#[pymethods]
impl Scene {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Adds a triangle mesh and gives its id.
    ///
    /// Parameters
    /// ----------
    /// vertices : array (n, 3), or a mesh of trimesh, Open3D or meshio
    ///     Finite positions. `float32` is kept as it is; all else is kept in double precision.
    /// faces : array (m, 3) of integers
    ///     Vertex numbers; seen from the outer side they go around counterclockwise. Left out for a mesh of another library.
    /// transform : array (4, 4) or (3, 4), optional
    ///     Map from the coordinates of the mesh to the scene's; column vectors, so the translation is the last column.
    /// name : str, optional
    ///     For people; see :attr:`names`.
    /// mask : int, optional
    ///     32 bits: only rays whose mask shares a bit with it meet the mesh. All bits if left out.
    /// normals : array (n, 3), optional
    ///     Normals at the vertices, of any length, for :attr:`Hits.normals`.
    /// uvs : array (n, 2), optional
    ///     Texture coordinates at the vertices, for :attr:`Hits.uvs` and textures. (0, 0) is the upper left corner of an image.
    /// colors : array (n, 3) or (n, 4), optional
    ///     Linear colours at the vertices, which the material's colour is multiplied by.
    /// material : Material or list of Material, optional
    ///     For rendering; grey if left out. Of a list, each face takes the one that `material_ids` says.
    /// material_ids : array (m,) of integers, optional
    ///     Which material of the list each face has; the first if left out.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], name="triangle")
    /// 0
    #[pyo3(signature = (vertices, faces=None, transform=None, name=None, *, mask=None, normals=None, uvs=None, colors=None, material=None, material_ids=None))]
    fn add_mesh(
        &self,
        vertices: &Bound<'_, PyAny>,
        faces: Option<&Bound<'_, PyAny>>,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<String>,
        mask: Option<i64>,
        normals: Option<&Bound<'_, PyAny>>,
        uvs: Option<&Bound<'_, PyAny>>,
        colors: Option<&Bound<'_, PyAny>>,
        material: Option<&Bound<'_, PyAny>>,
        material_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let given = objects::Given { normals, uvs, colors, material_ids };
        let mesh = objects::mesh(vertices, faces, &given)?;
        self.add(vertices.py(), Kind::Mesh(Arc::new(mesh)), transform, name, mask, material)
    }

    /// Adds an analytic shape and gives its id. :data:`SHAPES` lists the shapes and their parameters.
    ///
    /// Parameters
    /// ----------
    /// shape : str
    ///     Which, such as `"sphere"`. Shapes are centred at the origin; see the user's guide for each.
    /// transform : array (4, 4) or (3, 4), optional
    ///     Map from the coordinates of the shape to the scene's.
    /// name, mask
    ///     As for :meth:`add_mesh`.
    /// material : Material, optional
    ///     For rendering; grey if left out.
    /// **parameters
    ///     Those of the shape, in units of the scene.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.add_shape("cylinder", radius=0.5, height=2)
    /// 0
    #[pyo3(signature = (shape, transform=None, name=None, *, mask=None, material=None, **parameters))]
    fn add_shape(
        &self,
        py: Python<'_>,
        shape: &str,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<String>,
        mask: Option<i64>,
        material: Option<&Bound<'_, PyAny>>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<u32> {
        let shape = objects::shape(shape, parameters)?;
        self.add(py, Kind::Shape(Arc::new(shape)), transform, name, mask, material)
    }

    /// Adds many spheres as one object and gives its id: a point cloud, particles.
    ///
    /// Parameters
    /// ----------
    /// centers : array (n, 3)
    ///     Finite positions, kept in single precision.
    /// radii : array (n,) or float
    ///     Positive.
    /// transform, name, mask, material
    ///     As for :meth:`add_mesh`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> cloud = scene.add_spheres([[0, 0, 0], [0, 0, 5]], 0.5)
    /// >>> scene.cast_rays([0, 0, 2, 0, 0, 1]).primitive_ids
    /// array(1, dtype=uint32)
    #[pyo3(signature = (centers, radii, transform=None, name=None, *, mask=None, material=None))]
    fn add_spheres(
        &self,
        centers: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<String>,
        mask: Option<i64>,
        material: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let spheres = objects::spheres(centers, radii)?;
        self.add(centers.py(), Kind::Spheres(Arc::new(spheres)), transform, name, mask, material)
    }

    /// Adds all that another scene holds now, as one object, and gives its id.
    ///
    /// Its geometry is stored and accelerated once, however often it is instanced. Later changes of the other scene do not show here.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    ///     What is placed. May hold instances itself.
    /// transform : array (4, 4) or (3, 4), optional
    ///     Map from its coordinates to this scene's.
    /// name : str, optional
    ///     For people.
    /// mask : int, optional
    ///     Only rays whose mask shares a bit with it enter the instance.
    /// material : Material, optional
    ///     For what in it has none.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> ball, scene = snell.Scene(), snell.Scene()
    /// >>> ball.add_shape("sphere", radius=1)
    /// 0
    /// >>> for x in range(3):
    /// ...     place = np.eye(4)
    /// ...     place[0, 3] = 10 * x
    /// ...     id = scene.add_instance(ball, place)
    /// >>> scene.cast_rays([20, 0, -5, 0, 0, 1]).instance_ids
    /// array(2, dtype=uint32)
    #[pyo3(signature = (scene, transform=None, name=None, *, mask=None, material=None))]
    fn add_instance(
        &self,
        py: Python<'_>,
        scene: &Self,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<String>,
        mask: Option<i64>,
        material: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        self.add(py, Kind::Instance(scene.0.contents(py)), transform, name, mask, material)
    }

    /// Moves an object: `transform` takes the place of the one it had.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.update_transform(ball, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3]])
    /// >>> float(scene.distance([0, 0, 0]))
    /// 2.0
    fn update_transform(&self, id: i64, transform: &Bound<'_, PyAny>) -> PyResult<()> {
        let map = objects::transform(Some(transform))?.unwrap_or(Transform::IDENTITY);
        self.0.edit(transform.py(), |contents| {
            contents.get_mut(id)?.transform = Some(map);
            Ok(())
        })
    }

    /// Moves the vertices of a mesh. The faces stay, and so the structure of a mesh in single precision is adapted, not built anew.
    ///
    /// Parameters
    /// ----------
    /// id : int
    ///     Of a mesh.
    /// vertices : array (n, 3)
    ///     As many as before.
    /// normals : array (n, 3), optional
    ///     The old ones stay if this is left out.
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
            return Err(PyValueError::new_err(format!("vertices: there are {found}, expected {expected} as before")));
        }
        let normals = objects::normals(normals, expected)?;
        let mesh = Arc::new(py.detach(|| old.moved(positions, normals)));
        self.0.edit(py, |contents| contents.set_mesh(id, mesh))
    }

    /// Sets the mask of an object: only rays that share a bit with it meet the object.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.update_mask(ball, 0b10)
    /// >>> scene.test_occlusions([0, 0, -5, 0, 0, 1], mask=0b01)
    /// array(False)
    fn update_mask(&self, py: Python<'_>, id: i64, mask: i64) -> PyResult<()> {
        let mask = objects::mask(Some(mask))?;
        self.0.edit(py, |contents| {
            contents.get_mut(id)?.mask = mask;
            Ok(())
        })
    }

    /// Takes an object out. Its id is not used again.
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

    /// The vertices `(n, 3)` and faces `(m, 3)` of a mesh, in its own coordinates, as new arrays.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> id = scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    /// >>> vertices, faces = scene.mesh(id)
    /// >>> vertices.shape, faces.tolist()
    /// ((3, 3), [[0, 1, 2]])
    fn mesh<'py>(&self, py: Python<'py>, id: i64) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let contents = self.0.contents(py);
        let mesh = contents.mesh(id)?;
        let faces = from_vec(py, mesh.indices().as_flattened().to_vec(), &[mesh.indices().len(), 3])?;
        let shape = [mesh.vertex_count(), 3];
        let vertices = if mesh.is_double() {
            let values = mesh.double().positions.iter().flat_map(|p| p.to_array()).collect::<Vec<f64>>();
            from_vec(py, values, &shape)?
        } else {
            let values = mesh.single().positions.iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>();
            from_vec(py, values, &shape)?
        };
        Ok((vertices, faces))
    }

    /// The map `(4, 4)` from an object's coordinates to the scene's, as a new array.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.transform(scene.add_shape("sphere", radius=1)).tolist()[0]
    /// [1.0, 0.0, 0.0, 0.0]
    fn transform<'py>(&self, py: Python<'py>, id: i64) -> PyResult<Bound<'py, PyAny>> {
        let contents = self.0.contents(py);
        objects::matrix(py, &contents.get(id)?.transform.unwrap_or(Transform::IDENTITY))
    }

    /// The ids of all objects, ascending.
    #[getter]
    fn ids(&self, py: Python<'_>) -> Vec<u32> {
        self.0.contents(py).objects().map(|(id, _)| id).collect()
    }

    /// The names of the objects that have one, by id.
    #[getter]
    fn names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let names = PyDict::new(py);
        for (id, object) in self.0.contents(py).objects() {
            if let Some(name) = &object.name {
                names.set_item(id, name)?;
            }
        }
        Ok(names)
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.0.contents(py).objects().count()
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let contents = self.0.contents(py);
        let count = |wanted: fn(&Kind) -> bool| contents.objects().filter(|(_, object)| wanted(&object.kind)).count();
        let meshes = count(|kind| matches!(kind, Kind::Mesh(_)));
        let instances = count(|kind| matches!(kind, Kind::Instance(_)));
        let others = count(|kind| matches!(kind, Kind::Shape(_) | Kind::Spheres(_)));
        format!("<snell.Scene: {meshes} meshes, {others} shapes and sets of spheres, {instances} instances>")
    }

    /// Builds now what the next query would build first.
    ///
    /// Parameters
    /// ----------
    /// dtype : numpy.float32 or numpy.float64
    ///     For queries of which precision. `float32` if left out.
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

    /// The box around everything: least and greatest corner, an array `(2, 3)` of float64. Infinite where an object is; the least is greater
    /// than the greatest if there is nothing.
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

    /// What was built: numbers of triangles and nodes, and bytes of the structures without the vertices.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> id = scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    /// >>> scene.statistics()["triangles"]
    /// 1
    #[pyo3(signature = (dtype=None))]
    fn statistics<'py>(&self, py: Python<'py>, dtype: Option<&Bound<'_, PyAny>>) -> PyResult<Bound<'py, PyDict>> {
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

    /// The nearest hit of each ray.
    ///
    /// Parameters
    /// ----------
    /// rays : array (..., 6), or a tuple of two arrays (..., 3)
    ///     Origin and direction of each ray; a tuple `(origins, directions)` is broadcast. Directions have any length but 0.
    /// t_min, t_max : float or array (...), optional
    ///     Only hits between them count, ends excluded. 0 and infinity if left out.
    /// mask : int or array (...) of integers, optional
    ///     Only objects whose mask shares a bit with it are met.
    /// threads : int, optional
    ///     How many work on it. All cores if left out. The answer does not depend on it.
    /// warn_invalid : bool
    ///     Warn (RuntimeWarning) about rays that can hit nothing: not finite, direction 0, or `t_min >= t_max`. They miss.
    ///
    /// Returns
    /// -------
    /// Hits
    ///     With the leading shape of the rays.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.cast_rays(([0, 0, -5], [[0, 0, 1], [0, 0, 2], [0, 1, 0]])).t_hit.tolist()
    /// [4.0, 2.0, inf]
    #[pyo3(signature = (rays, *, t_min=None, t_max=None, mask=None, threads=None, warn_invalid=false))]
    fn cast_rays<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        mask: Option<&Bound<'py, PyAny>>,
        threads: Option<usize>,
        warn_invalid: bool,
    ) -> PyResult<Hits> {
        by_rays!(self.cast(py, rays, t_min, t_max, mask, threads, warn_invalid))
    }

    /// Whether each ray hits anything: an array `(...)` of bool. Faster than the nearest hit. Parameters as of :meth:`cast_rays`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.test_occlusions(([0, 0, -5], [[0, 0, 1], [0, 1, 0]])).tolist()
    /// [True, False]
    #[pyo3(signature = (rays, *, t_min=None, t_max=None, mask=None, threads=None, warn_invalid=false))]
    fn test_occlusions<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        mask: Option<&Bound<'py, PyAny>>,
        threads: Option<usize>,
        warn_invalid: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        by_rays!(self.occlusions(py, rays, t_min, t_max, mask, threads, warn_invalid))
    }

    /// How many hits each ray has: an array `(...)` of uint32. Parameters as of :meth:`cast_rays`.
    ///
    /// Exact: a ray through an edge or vertex of a closed mesh crosses it as often as it should.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.count_intersections(([[0, 0, -5], [0, 0, 0]], [0, 0, 1])).tolist()
    /// [2, 1]
    #[pyo3(signature = (rays, *, t_min=None, t_max=None, mask=None, threads=None, warn_invalid=false))]
    fn count_intersections<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        mask: Option<&Bound<'py, PyAny>>,
        threads: Option<usize>,
        warn_invalid: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        by_rays!(self.count(py, rays, t_min, t_max, mask, threads, warn_invalid))
    }

    /// Every hit of each ray, sorted. Parameters as of :meth:`cast_rays`.
    ///
    /// Returns
    /// -------
    /// Intersections
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.list_intersections([0, 0, -5, 0, 0, 1]).t_hit.tolist()
    /// [4.0, 6.0]
    #[pyo3(signature = (rays, *, t_min=None, t_max=None, mask=None, threads=None, warn_invalid=false))]
    fn list_intersections<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        mask: Option<&Bound<'py, PyAny>>,
        threads: Option<usize>,
        warn_invalid: bool,
    ) -> PyResult<Intersections> {
        by_rays!(self.list(py, rays, t_min, t_max, mask, threads, warn_invalid))
    }

    /// The nearest point of any surface to each point.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     `float32` is answered in single precision, all else in double: then the point lies on the surface to double precision, and is the
    ///     nearest to within `2**-23` of the size of its mesh.
    /// max_distance : float or array (...), optional
    ///     What is farther is not looked for.
    /// mask : int, optional
    ///     Only objects that share a bit with it count.
    /// threads : int, optional
    ///     As of :meth:`cast_rays`.
    ///
    /// Returns
    /// -------
    /// ClosestPoints
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.closest_points([[0, 0, -5], [0, 3, 0]]).points.tolist()
    /// [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    #[pyo3(signature = (points, *, max_distance=None, mask=None, threads=None))]
    fn closest_points<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: Option<i64>,
        threads: Option<usize>,
    ) -> PyResult<ClosestPoints> {
        let (py, array) = (points.py(), array(points, "points")?);
        let (mask, threads) = (objects::mask(mask)?, Threads::new(threads)?);
        if is_double(&array, "points")? {
            self.closest::<f64>(&array, max_distance, mask, threads, self.0.local(py)?)
        } else {
            self.closest::<f32>(&array, max_distance, mask, threads, self.0.snapshot::<f32>(py)?)
        }
    }

    /// The distance of each point to the nearest surface, not negative: an array `(...)`. Infinite where nothing is near enough.
    /// Parameters as of :meth:`closest_points`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.distance([[0, 0, -5], [0, 0.25, 0]]).tolist()
    /// [4.0, 0.75]
    #[pyo3(signature = (points, *, max_distance=None, mask=None, threads=None))]
    fn distance<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: Option<i64>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, array) = (points.py(), array(points, "points")?);
        let (mask, threads) = (objects::mask(mask)?, Threads::new(threads)?);
        if is_double(&array, "points")? {
            self.distances::<f64>(&array, max_distance, mask, threads, &*self.0.local(py)?, false)
        } else {
            self.distances::<f32>(&array, max_distance, mask, threads, &*self.0.snapshot::<f32>(py)?, false)
        }
    }

    /// The distance of each point to the nearest surface, negative inside (see :meth:`occupancy`): an array `(...)`. Where nothing is near
    /// enough it is `max_distance`, with the sign. Parameters as of :meth:`closest_points`; the mask does not matter to the sign.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.signed_distance([[0, 0, -5], [0, 0.25, 0]]).tolist()
    /// [4.0, -0.75]
    #[pyo3(signature = (points, *, max_distance=None, mask=None, threads=None))]
    fn signed_distance<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: Option<i64>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, array) = (points.py(), array(points, "points")?);
        let (mask, threads) = (objects::mask(mask)?, Threads::new(threads)?);
        if is_double(&array, "points")? {
            let snapshot = self.0.local(py)?;
            self.prepare(py, &snapshot)?;
            self.distances::<f64>(&array, max_distance, mask, threads, &snapshot, true)
        } else {
            let snapshot = self.0.snapshot::<f32>(py)?;
            self.prepare(py, &snapshot)?;
            self.distances::<f32>(&array, max_distance, mask, threads, &snapshot, true)
        }
    }

    /// Whether each point is inside of what the scene holds: an array `(...)` of bool.
    ///
    /// Inside is where the generalised winding number of all surfaces is more than a half: right for closed meshes, and sensible for open
    /// ones, soups and overlaps. Masks do not matter. Points that are not finite are outside.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.occupancy([[0, 0, -5], [0, 0.25, 0]]).tolist()
    /// [False, True]
    #[pyo3(signature = (points, *, threads=None))]
    fn occupancy<'py>(&self, points: &Bound<'py, PyAny>, threads: Option<usize>) -> PyResult<Bound<'py, PyAny>> {
        self.around(points, threads, |world, point| world.is_inside(point))
    }

    /// The generalised winding number of all surfaces around each point: an array `(...)` of float64. 1 inside of a closed surface, 0 outside,
    /// something between around open ones (to some hundredths next to large open surfaces).
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.winding_number([[0, 0, -5], [0, 0.25, 0]]).tolist()
    /// [0.0, 1.0]
    #[pyo3(signature = (points, *, threads=None))]
    fn winding_number<'py>(&self, points: &Bound<'py, PyAny>, threads: Option<usize>) -> PyResult<Bound<'py, PyAny>> {
        self.around(points, threads, |world, point| world.winding_number_at(point))
    }

    /// Rays of one of :attr:`cameras`, one through the centre of each pixel: an array `(height_px, width_px, 6)` of float32.
    ///
    /// Directions have unit length, so `t_hit` is the distance; where a projection shows nothing (outside of a fisheye's circle) they are 0.
    ///
    /// Parameters
    /// ----------
    /// camera : int, str or Camera, optional
    ///     Number or name, or a camera. The first if left out.
    /// width_px, height_px : int, optional
    ///     Size of the picture; what the camera says if left out.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> snell.load("cornell-box").create_rays_camera(0, 4, 4).shape
    /// (4, 4, 6)
    #[pyo3(signature = (camera=None, width_px=None, height_px=None))]
    fn create_rays_camera<'py>(
        &self,
        py: Python<'py>,
        camera: Option<&Bound<'py, PyAny>>,
        width_px: Option<u32>,
        height_px: Option<u32>,
    ) -> PyResult<Bound<'py, PyAny>> {
        crate::cameras::rays(py, &self.0.contents(py), camera, [width_px, height_px])
    }

    /// Scenes share what does not change: copies cost little.
    fn __copy__(&self, py: Python<'_>) -> Self {
        Self(Shared::new(self.0.contents(py)))
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Bound<'_, PyAny>) -> Self {
        self.__copy__(py)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        crate::pickle::reduce(py, &self.0.contents(py))
    }
}

impl Scene {
    /// A scene of these contents.
    pub fn of(contents: Contents) -> Self {
        Self(Shared::new(Arc::new(contents)))
    }

    fn prepare<F: Kept<World = World>>(&self, py: Python<'_>, snapshot: &Arc<Snapshot<F>>) -> PyResult<()> {
        self.0.prepare_winding(py, snapshot)
    }

    /// Something about the surfaces around points.
    fn around<'py, T: numpy::Element + Default + Copy + Send>(
        &self,
        points: &Bound<'py, PyAny>,
        threads: Option<usize>,
        answer: impl Fn(&World, DVec3) -> T + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, array, threads) = (points.py(), array(points, "points")?, Threads::new(threads)?);
        let is_double = is_double(&array, "points")?;
        leading(&array, 3, "points")?;
        if is_double {
            let snapshot = self.0.local(py)?;
            self.prepare(py, &snapshot)?;
            self.of_points::<f64, T>(&array, threads, |_, p| answer(&snapshot.world, DVec3::from_array(p)))
        } else {
            let snapshot = self.0.snapshot::<f32>(py)?;
            self.prepare(py, &snapshot)?;
            self.of_points::<f32, T>(&array, threads, |_, p| {
                answer(&snapshot.world, DVec3::from_array(p.map(f64::from)))
            })
        }
    }
}

/// Whether a dtype is the double one; it may be left out.
fn precision(py: Python<'_>, dtype: Option<&Bound<'_, PyAny>>) -> PyResult<bool> {
    let Some(dtype) = dtype else { return Ok(false) };
    let dtype = crate::arrays::numpy(py, "dtype")?.call1((dtype,))?;
    let name: String = dtype.getattr("name")?.extract()?;
    match name.as_str() {
        "float32" => Ok(false),
        "float64" => Ok(true),
        other => Err(PyValueError::new_err(format!("dtype is {other}, expected float32 or float64"))),
    }
}
