//! Answers of queries in Python: named arrays, each of which is created when it is first accessed.

use crate::arrays::{filled, from_vec, numpy};
use crate::assemble::{Form, Snapshot};
use crate::columns::{Columns, View};
use crate::precision::Precision;
use crate::rays::KeptRays;
use crate::surface::{Local, Surfaces};
use crate::work::{Threads, run};
use numpy::Element;
use pyo3::exceptions::{PyAttributeError, PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyList, PyTuple};
use rayon::prelude::*;
use snell_intersect::Hit;
use snell_math::{DRay, DVec3};
use std::collections::HashMap;
use std::sync::Arc;

/// Number of answers that a thread processes at a time.
const PIECE: usize = 16384;

/// Creates arrays from answers.
pub trait Answers: Send + Sync {
    /// The array of this name; `None` if answers of this kind have no such array.
    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>>;

    /// The leading shape of the arrays.
    fn shape(&self) -> &[usize];
}

/// The query's inputs, from which surfaces are computed.
#[derive(Debug)]
pub enum Asked<P> {
    /// Rays: an answer belongs to the ray with its own index or, if a list is given, to the ray
    /// listed at that index.
    Rays(KeptRays, Option<Vec<u32>>),
    /// Points whose nearest points were searched.
    Positions(Vec<[P; 3]>),
}

/// Answers whose arrays are not computed yet, with the world that was queried.
#[derive(Debug)]
pub struct Live<P: Precision, F: Form> {
    /// The world that was queried.
    pub snapshot: Arc<Snapshot<F>>,
    /// The answers of the query.
    pub hits: Columns<P>,
    /// The rays or points that were asked about.
    pub asked: Asked<P>,
    /// Number of rays.
    pub rays: usize,
    /// Shape of the answers.
    pub shape: Vec<usize>,
    /// For each ray, the index of its first answer, and then the number of all answers; `None` for
    /// queries with one answer per ray.
    pub splits: Option<Vec<i64>>,
}

impl<P: Precision, F: Form> Answers for Live<P, F> {
    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let names = &self.snapshot.names;
        let hits = self.hits.readable(py)?;
        let hits = hits.view()?;
        let array = match name {
            "t_hit" | "distances" => self.copied(py, 1, hits.t),
            "primitive_ids" => self.copied(py, 1, hits.primitive),
            "geometry_ids" => self.mapped(py, hits.geometry, |id| names.object(id)),
            "instance_ids" => self.mapped(py, hits.occurrence, |id| names.instance(id)),
            "instance_paths" => {
                let depth = names.depth();
                self.rows(py, depth, |i, row| {
                    row.fill(Hit::NONE);
                    let path = names.path(hits.occurrence[i]);
                    row.iter_mut().zip(path).for_each(|(place, id)| *place = id);
                })
            }
            "names" => self.labels(py, &hits),
            "material_ids" => self.pieces(py, 1, |first, places| {
                for (i, place) in (first..).zip(places) {
                    *place =
                        names.material(hits.occurrence[i], hits.geometry[i], hits.primitive[i]);
                }
            }),
            "is_entering" if matches!(self.asked, Asked::Rays(..)) => {
                let normals = self.surfaces(py, &hits, 1, |local, ray| {
                    [local.geometric_normal.dot(ray.direction)]
                })?;
                normals.call_method1("__lt__", (0,))
            }
            "primitive_uvs" => self.copied(py, 2, hits.uv),
            "points" if let Asked::Positions(positions) = &self.asked => {
                let values = positions.as_flattened().to_vec();
                from_vec(py, values, &[&self.shape[..], &[3]].concat())
            }
            "points" => self.surfaces(py, &hits, 3, |local, _| local.position.to_array()),
            "primitive_normals" => {
                self.surfaces(py, &hits, 3, |local, _| local.geometric_normal.to_array())
            }
            "normals" => self.surfaces(py, &hits, 3, |local, _| local.normal.to_array()),
            "uvs" => self.surfaces(py, &hits, 2, |local, _| local.uv.to_array()),
            "ray_ids" => match &self.asked {
                Asked::Rays(_, Some(ids)) => {
                    from_vec(py, ids.iter().map(|&i| i64::from(i)).collect(), &self.shape)
                }
                _ => return Ok(None),
            },
            "ray_splits" => match &self.splits {
                Some(splits) => from_vec(py, splits.clone(), &[splits.len()]),
                None => return Ok(None),
            },
            _ => return Ok(None),
        };
        array.map(Some)
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }
}

impl<P: Precision, F: Form> Live<P, F> {
    /// An array of `values`, `width` of them per answer.
    fn copied<'py, T: Element + Copy + Send + Sync>(
        &self,
        py: Python<'py>,
        width: usize,
        values: &[T],
    ) -> PyResult<Bound<'py, PyAny>> {
        self.pieces(py, width, |first, places: &mut [T]| {
            places.copy_from_slice(&values[first * width..][..places.len()]);
        })
    }

    /// An array of objects' ids: `name` applied to each of the world's ids.
    fn mapped<'py>(
        &self,
        py: Python<'py>,
        ids: &[u32],
        name: impl Fn(u32) -> u32 + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.pieces(py, 1, |first, places| {
            places.iter_mut().zip(&ids[first..]).for_each(|(place, &id)| *place = name(id));
        })
    }

    /// An array of rows of `width` ids, which `write` fills by the index of the answer.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        width: usize,
        write: impl Fn(usize, &mut [u32]) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let shape = [&self.shape[..], &[width]].concat();
        if width == 0 {
            return from_vec(py, Vec::<u32>::new(), &shape);
        }
        let made = self.pieces(py, width, |first, places| {
            for (i, row) in places.chunks_exact_mut(width).enumerate() {
                write(first + i, row);
            }
        })?;
        made.call_method1("reshape", (shape,))
    }

    /// An array of the names of the objects, as text.
    fn labels<'py>(&self, py: Python<'py>, hits: &View<'_, P>) -> PyResult<Bound<'py, PyAny>> {
        let mut known: HashMap<(u32, u32), i64> = HashMap::new();
        let mut labels: Vec<String> = Vec::new();
        let pairs = hits.occurrence.iter().zip(hits.geometry);
        let numbers: Vec<i64> = pairs
            .map(|(&occurrence, &geometry)| {
                *known.entry((occurrence, geometry)).or_insert_with(|| {
                    labels.push(self.snapshot.names.label(occurrence, geometry));
                    labels.len() as i64 - 1
                })
            })
            .collect();
        if labels.is_empty() {
            labels.push(String::new());
        }
        let numbers = from_vec(py, numbers, &self.shape)?;
        numpy(py, "array")?.call1((labels,))?.get_item(numbers)
    }

    /// An array of a property of the surfaces.
    fn surfaces<'py, const N: usize>(
        &self,
        py: Python<'py>,
        hits: &View<'_, P>,
        width: usize,
        wanted: impl Fn(&Local, &DRay) -> [f64; N] + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        type Ray<'a> = &'a (dyn Fn(usize) -> (DRay, f32) + Sync);
        let write = |first: usize, places: &mut [P], ray: Ray<'_>| {
            let mut surfaces = Surfaces::new(&self.snapshot);
            for (i, place) in places.chunks_exact_mut(width).enumerate() {
                let found = hits.get(first + i);
                let is_hit = found.geometry != Hit::NONE;
                let (ray, time) = ray(first + i);
                let local = if is_hit { surfaces.at(&ray, time, &found) } else { Local::NONE };
                let values = wanted(&local, &ray);
                place.iter_mut().zip(values).for_each(|(place, x)| *place = P::round(x));
            }
        };
        match &self.asked {
            Asked::Positions(positions) => {
                let ray = |i: usize| {
                    let point = DVec3::from_array(positions[i].map(Into::into));
                    (DRay::new(point, DVec3::ZERO), 0.0)
                };
                self.pieces(py, width, |first, places| write(first, places, &ray))
            }
            Asked::Rays(kept, ids) => {
                let arrays = kept.rays::<P>(py, self.rays)?;
                let view = arrays.view()?;
                let number = |i: usize| ids.as_ref().map_or(i, |ids| ids[i] as usize);
                let ray = |i: usize| (P::exact(&view.get(number(i))), view.time(number(i)));
                self.pieces(py, width, |first, places| write(first, places, &ray))
            }
        }
    }

    fn pieces<'py, T: Element + Copy + Send>(
        &self,
        py: Python<'py>,
        width: usize,
        write: impl Fn(usize, &mut [T]) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut shape = self.shape.clone();
        if width > 1 {
            shape.push(width);
        }
        let threads = Threads::new(None)?;
        filled(py, &shape, |values| {
            let is_small = values.len() <= PIECE * width;
            run(py, threads, is_small, |cancel| {
                let piece = |(i, places): (usize, &mut [T])| {
                    cancel.check()?;
                    write(i * PIECE, places);
                    Ok(())
                };
                if is_small {
                    return values.chunks_mut(PIECE * width).enumerate().try_for_each(piece);
                }
                values.par_chunks_mut(PIECE * width).enumerate().try_for_each(piece)
            })
        })
    }
}

/// Some of the answers of a query, selected by an index.
struct Part {
    whole: Py<PyAny>,
    /// The numbers of the selected answers.
    numbers: Py<PyAny>,
    shape: Vec<usize>,
}

impl Answers for Part {
    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let part = py.import("snell._answers")?.getattr("part_of")?;
        part.call1((&self.whole, name, &self.numbers)).map(Some)
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }
}

/// The arrays of a query by name. An array is computed from the answers when it is first accessed.
pub struct Named {
    live: Option<Box<dyn Answers>>,
    made: PyOnceLock<Py<PyDict>>,
}

impl Named {
    /// The arrays of a query's answers, none of them computed yet.
    pub fn new(live: impl Answers + 'static) -> Self {
        Self { live: Some(Box::new(live)), made: PyOnceLock::new() }
    }

    /// The part of some answers that an index selects.
    pub fn part(whole: &Bound<'_, PyAny>, key: &Bound<'_, PyAny>) -> PyResult<Self> {
        let select = whole.py().import("snell._answers")?.getattr("numbers_of")?;
        let numbers = select.call1((whole, key))?;
        let shape = numbers.getattr("shape")?.extract()?;
        Ok(Self::new(Part { whole: whole.clone().unbind(), numbers: numbers.unbind(), shape }))
    }

    /// Arrays that were stored by pickling. Fails if one of `names` is missing.
    pub fn stored(arrays: &Bound<'_, PyDict>, names: &[&str]) -> PyResult<Self> {
        for name in names {
            if !arrays.contains(name)? {
                return Err(PyTypeError::new_err(format!("arrays: there is no {name}")));
            }
        }
        let made = PyOnceLock::new();
        let _ = made.set(arrays.py(), arrays.copy()?.unbind());
        Ok(Self { live: None, made })
    }

    /// Stores an array under a name.
    pub fn set(&self, py: Python<'_>, name: &str, array: Bound<'_, PyAny>) -> PyResult<()> {
        self.made.get_or_init(py, || PyDict::new(py).unbind()).bind(py).set_item(name, array)
    }

    /// The array of this name, which is computed on first access.
    pub fn get<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let made = self.made.get_or_init(py, || PyDict::new(py).unbind()).bind(py);
        if let Some(array) = made.get_item(name)? {
            return Ok(array);
        }
        let array = match &self.live {
            Some(live) => live.array(py, name)?,
            None => None,
        };
        let array = array.ok_or_else(|| PyAttributeError::new_err(name.to_string()))?;
        // Another thread may have created the array meanwhile; all threads get the same one.
        made.call_method1("setdefault", (name, array))
    }

    /// Like [`Self::get`], for `answers[name]`: an unknown name is a `KeyError`.
    pub fn item<'py>(
        &self,
        py: Python<'py>,
        names: &[&str],
        name: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        if names.contains(&name) {
            self.get(py, name)
        } else {
            Err(PyKeyError::new_err(name.to_string()))
        }
    }

    /// The arrays of these names, as a dictionary.
    pub fn all<'py>(&self, py: Python<'py>, names: &[&str]) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for name in names {
            all.set_item(name, self.get(py, name)?)?;
        }
        Ok(all)
    }

    /// The arrays that pickling stores: those of these names, and what else was computed.
    pub fn stored_form<'py>(
        &self,
        py: Python<'py>,
        names: &[&str],
    ) -> PyResult<Bound<'py, PyDict>> {
        self.all(py, names)?;
        self.made.get_or_init(py, || PyDict::new(py).unbind()).bind(py).copy()
    }

    /// The leading shape of the arrays: the shape of `scalar`, which has one number per answer.
    pub fn shape<'py>(&self, py: Python<'py>, scalar: &str) -> PyResult<Bound<'py, PyTuple>> {
        match &self.live {
            Some(live) => PyTuple::new(py, live.shape()),
            None => Ok(self.get(py, scalar)?.getattr("shape")?.cast_into::<PyTuple>()?),
        }
    }
}

/// Declares a kind of answers: a class with these arrays, as attributes and as a mapping.
macro_rules! answers {
    ($(#[doc = $doc:expr])* $class:ident by $scalar:ident {
        $($(#[doc = $about:expr])* $name:ident,)*
    }) => {
        $(#[doc = $doc])*
        #[pyclass(frozen, mapping, module = "snell")]
        pub struct $class(pub Named);

        impl $class {
            const NAMES: &[&str] = &[$(stringify!($name)),*];
        }

        #[pymethods]
        impl $class {
            #[new]
            fn new(arrays: &Bound<'_, PyDict>) -> PyResult<Self> {
                Named::stored(arrays, Self::NAMES).map(Self)
            }

            $($(#[doc = $about])*
            #[getter]
            fn $name<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
                self.0.get(py, stringify!($name))
            })*

            /// The shape of the arrays with one number per answer.
            #[getter]
            fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
                self.0.shape(py, stringify!($scalar))
            }

            fn __getitem__<'py>(
                slf: &Bound<'py, Self>,
                key: &Bound<'py, PyAny>,
            ) -> PyResult<Bound<'py, PyAny>> {
                if let Ok(name) = key.extract::<String>() {
                    return slf.get().0.item(slf.py(), Self::NAMES, &name);
                }
                let part = Named::part(slf.as_any(), key)?;
                Ok(Bound::new(slf.py(), Self(part))?.into_any())
            }

            fn __setattr__(&self, name: &str, _value: &Bound<'_, PyAny>) -> PyResult<()> {
                Err(PyAttributeError::new_err(format!(
                    "{name}: answers never change; change a copy of the array"
                )))
            }

            fn __len__(&self) -> usize {
                Self::NAMES.len()
            }

            fn __contains__(&self, name: &Bound<'_, PyAny>) -> bool {
                name.extract::<String>().is_ok_and(|name| Self::NAMES.contains(&name.as_str()))
            }

            fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
                PyList::new(py, Self::NAMES)?.call_method0("__iter__")
            }

            /// The names of the arrays.
            fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
                PyList::new(py, Self::NAMES)
            }

            /// The arrays, in the order of :meth:`keys`.
            fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
                Ok(self.0.all(py, Self::NAMES)?.values())
            }

            /// The names with the arrays, in the order of :meth:`keys`.
            fn items<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
                Ok(self.0.all(py, Self::NAMES)?.items())
            }

            fn __reduce__<'py>(
                slf: &Bound<'py, Self>,
            ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
                Ok((slf.get_type().into_any(), (slf.get().0.stored_form(slf.py(), Self::NAMES)?,)))
            }

            fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
                let shape = self.0.shape(py, stringify!($scalar))?;
                Ok(format!("{} of shape {shape}", stringify!($class)))
            }
        }
    };
}

answers! {
    /// The nearest hit of each ray: the result of :meth:`Scene.cast_rays`. `...` is the leading
    /// shape of the rays.
    ///
    /// Arrays are attributes and, by name, items of a mapping. Each is computed on first access;
    /// real numbers have the dtype of the query. Any other index selects some of the answers:
    /// `hits[0]`, `hits[mask]`. A miss has `t_hit` infinite, all ids
    /// :data:`INVALID_ID`, `points` NaN, and all other numbers 0.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> hits = scene.cast_rays([[0, 0, -5, 0, 0, 1], [9, 0, -5, 0, 0, 1]])
    /// >>> hits.t_hit.tolist()
    /// [4.0, inf]
    /// >>> hits["geometry_ids"].tolist() == [ball, snell.INVALID_ID]
    /// True
    /// >>> hits.points[0].tolist()
    /// [0.0, 0.0, -1.0]
    /// >>> hits[hits.is_hit].t_hit.tolist()
    /// [4.0]
    Hits by t_hit {
        /// `(...)`: ray parameter, in units of the direction's length; infinite for a miss.
        t_hit,
        /// `(...)`, uint32: the id that the `add_` method gave, in the scene that holds the object;
        /// :data:`INVALID_ID` for a miss.
        geometry_ids,
        /// `(...)`, uint32: the id that :meth:`Scene.add_instance` gave; :data:`INVALID_ID` for
        /// objects in no instance.
        instance_ids,
        /// `(..., depth)`, uint32: the ids of all instances around the object, the outermost first,
        /// each in the scene that holds it; :data:`INVALID_ID` after the last. `depth` is the
        /// number of instances within each other in the scene.
        instance_paths,
        /// `(...)`, uint32: number of the triangle of a mesh, of the face of a shape, or of the
        /// sphere of a set; :data:`INVALID_ID` for a miss.
        primitive_ids,
        /// `(..., 2)`: barycentric coordinates of the second and third vertex of a triangle, 0 on
        /// all other primitives.
        primitive_uvs,
        /// `(..., 3)`: unit normals of the surface itself, on its outer side (right-hand rule for
        /// triangles); 0 for a miss.
        primitive_normals,
        /// `(..., 3)`: positions in the scene, from the barycentric coordinates of triangles; NaN
        /// for a miss.
        points,
        /// `(..., 3)`: unit shading normals, interpolated where a mesh has normals at its vertices;
        /// 0 for a miss.
        normals,
        /// `(..., 2)`: texture coordinates; 0 where there are none.
        uvs,
    }
}

answers! {
    /// Every hit of each ray, as compressed sparse rows: the result of
    /// :meth:`Scene.list_intersections`. `n` is the number of all hits.
    ///
    /// The hits of ray `i` (in the order of the raveled leading shape) are those from
    /// `ray_splits[i]` to `ray_splits[i + 1]`, ascending by `t_hit`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> found = scene.list_intersections([[9, 0, -5, 0, 0, 1], [0, 0, -5, 0, 0, 1]])
    /// >>> found.ray_splits.tolist(), found.ray_ids.tolist(), found.t_hit.tolist()
    /// ([0, 0, 2], [1, 1], [4.0, 6.0])
    Intersections by t_hit {
        /// `(rays + 1,)`, int64: the index of the first hit of each ray, and last the number of all
        /// hits.
        ray_splits,
        /// `(n,)`, int64: the number of each hit's ray.
        ray_ids,
        /// `(n,)`: ray parameter, in units of the direction's length.
        t_hit,
        /// `(n,)`, uint32: ids of the objects, as in :class:`Hits`.
        geometry_ids,
        /// `(n,)`, uint32: ids of the instances, as in :class:`Hits`.
        instance_ids,
        /// `(n, depth)`, uint32: ids of all instances, as in :class:`Hits`.
        instance_paths,
        /// `(n,)`, uint32: triangles, faces or spheres, as in :class:`Hits`.
        primitive_ids,
        /// `(n, 2)`: barycentric coordinates, as in :class:`Hits`.
        primitive_uvs,
        /// `(n, 3)`: unit normals of the surfaces themselves, as in :class:`Hits`.
        primitive_normals,
        /// `(n, 3)`: positions in the scene, as in :class:`Hits`.
        points,
        /// `(n, 3)`: unit shading normals, as in :class:`Hits`.
        normals,
        /// `(n, 2)`: texture coordinates, as in :class:`Hits`.
        uvs,
    }
}

answers! {
    /// The nearest point of any surface to each point: the result of :meth:`Scene.closest_points`.
    /// `...` is the leading shape of the points.
    ///
    /// Where nothing is near enough, `distances` is infinite, all ids :data:`INVALID_ID`, `points`
    /// NaN, and all other numbers 0.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> near = scene.closest_points([3, 0, 0])
    /// >>> near.points.tolist(), float(near.distances)
    /// ([1.0, 0.0, 0.0], 2.0)
    ClosestPoints by distances {
        /// `(..., 3)`: the points of the surfaces, in the scene.
        points,
        /// `(...)`: distances of the points, in units of the scene; not negative.
        distances,
        /// `(...)`, uint32: ids of the objects, as in :class:`Hits`.
        geometry_ids,
        /// `(...)`, uint32: ids of the instances, as in :class:`Hits`.
        instance_ids,
        /// `(..., depth)`, uint32: ids of all instances, as in :class:`Hits`.
        instance_paths,
        /// `(...)`, uint32: triangles, faces or spheres, as in :class:`Hits`.
        primitive_ids,
        /// `(..., 2)`: barycentric coordinates, as in :class:`Hits`.
        primitive_uvs,
        /// `(..., 3)`: unit normals of the surfaces themselves, as in :class:`Hits`.
        primitive_normals,
        /// `(..., 3)`: unit shading normals, as in :class:`Hits`.
        normals,
        /// `(..., 2)`: texture coordinates, as in :class:`Hits`.
        uvs,
    }
}

/// Declares further arrays of answers. They are attributes, but no items, and pickled only if they
/// were computed before.
macro_rules! further {
    ($class:ident { $($(#[doc = $about:expr])* $name:ident,)* }) => {
        #[pymethods]
        impl $class {
            $($(#[doc = $about])*
            #[getter]
            fn $name<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
                self.0.get(py, stringify!($name))
            })*
        }
    };
}

further! {
    Hits {
        /// `(...)`, bool: whether the ray comes from the outer side of the surface, against
        /// `primitive_normals`; False for a miss.
        is_entering,
        /// `(...)`, uint32: number of the material in :attr:`Scene.materials`, of the scene that
        /// holds the object; if the object has none, of the scene that holds the innermost instance
        /// with a material; :data:`INVALID_ID` for the default material and for a miss.
        material_ids,
        /// `(...)`, text: the name of the object, empty without one and for a miss. In instances,
        /// the names of these come first, as in `"car/wheel/tyre"`; what has no name there is
        /// called by its id.
        names,
    }
}

further! {
    Intersections {
        /// `(n,)`, bool: whether the ray enters the surface, as in :class:`Hits`.
        is_entering,
        /// `(n,)`, uint32: numbers of the materials, as in :class:`Hits`.
        material_ids,
        /// `(n,)`, text: names of the objects, as in :class:`Hits`.
        names,
    }
}

further! {
    ClosestPoints {
        /// `(...)`, uint32: numbers of the materials, as in :class:`Hits`.
        material_ids,
        /// `(...)`, text: names of the objects, as in :class:`Hits`.
        names,
    }
}

#[pymethods]
impl Hits {
    /// `(...)`, bool: whether the ray hits anything.
    #[getter]
    fn is_hit<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        numpy(py, "isfinite")?.call1((self.0.get(py, "t_hit")?,))
    }
}
