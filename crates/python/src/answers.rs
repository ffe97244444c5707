//! Answers of queries in Python: named arrays, each of which is created when it is first accessed.

use crate::arrays::numpy;
use pyo3::exceptions::{PyAttributeError, PyKeyError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyList, PyTuple};

/// Creates arrays from answers.
pub trait Answers: Send + Sync {
    /// The array of this name; `None` if answers of this kind have no such array.
    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>>;

    /// The leading shape of the arrays.
    fn shape(&self) -> &[usize];

    /// The rays `(..., 6)` that leave the answers with these numbers (all if none are given) in
    /// `directions`; an error for answers that no rays found.
    fn spawned<'py>(
        &self,
        directions: &Bound<'py, PyAny>,
        numbers: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>>;
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

    fn spawned<'py>(
        &self,
        directions: &Bound<'py, PyAny>,
        numbers: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let own = self.numbers.bind(directions.py());
        let numbers = numbers.map_or_else(
            || Ok(own.clone()),
            |numbers| own.call_method0("ravel")?.get_item(numbers),
        )?;
        let whole = self.whole.bind(directions.py());
        match whole.cast::<Hits>() {
            Ok(hits) => hits.get().0.spawned(directions, Some(&numbers)),
            Err(_) => Err(no_rays()),
        }
    }
}

fn no_rays() -> PyErr {
    PyTypeError::new_err("spawn_rays: only hits of rays have it")
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

    /// The rays that leave answers; see [`Answers::spawned`].
    pub fn spawned<'py>(
        &self,
        directions: &Bound<'py, PyAny>,
        numbers: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        match &self.live {
            Some(live) => live.spawned(directions, numbers),
            None => Err(PyValueError::new_err(
                "spawn_rays: these hits were unpickled, and have no scene; cast the rays again",
            )),
        }
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
        /// `(..., 3)`: the colour of the surface, in linear RGB: the fraction of white light that
        /// it reflects or transmits towards the ray's origin, from its material with textures,
        /// patterns and vertex colours, as the layer `albedo` of a picture has it; 0 for a miss.
        albedo,
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
        /// `(n, 3)`: colours of the surfaces, as in :class:`Hits`.
        albedo,
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
        /// `(..., 3)`: colours of the surfaces, as in :class:`Hits`, seen along the normal.
        albedo,
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

    /// Rays that leave the surfaces at the hits: an array `(..., 6)` in the precision of the query.
    ///
    /// Their origins are beside `points`, on the side to which the directions point, by a few steps
    /// of rounding: as near as is certain. So they need no `t_min`: a ray does not hit the flat
    /// surface that it starts on, and reflected rays do not leave a closed room, through edges and
    /// corners neither. Where nothing was hit, the origin is NaN, and the ray hits nothing.
    ///
    /// In a scene of meshes alone the rays that were cast are not copied: leave their arrays as
    /// they are until then, or a reflected ray may leave the room through an edge.
    ///
    /// Parameters
    /// ----------
    /// directions : array (..., 3)
    ///     Directions of any length, one for each hit or one for all. They point away from the
    ///     surface for reflection, and through it for transmission.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> room = snell.Scene()
    /// >>> walls = room.add_shape("box", min=[0, 0, 0], max=[7, 5, 3])
    /// >>> hits = room.cast_rays([[2, 2, 1, 1, 0, 0]])
    /// >>> rays = hits.spawn_rays([[-1, 0, 0]])
    /// >>> bool(0 < 7 - rays[0, 0] < 1e-12)
    /// True
    /// >>> room.cast_rays(rays).points[0].tolist()
    /// [0.0, 2.0, 1.0]
    fn spawn_rays<'py>(&self, directions: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        self.0.spawned(directions, None)
    }
}
