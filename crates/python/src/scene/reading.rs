//! What a scene tells of its objects: meshes, shapes, instances, ids and names.

use super::Scene;
use crate::arrays::from_vec;
use crate::contents::{Kind, Object};
use crate::material::Material;
use crate::names::{Name, suggestion};
use crate::place::{matrices, matrix};
use crate::stage::{listed, materials_of};
use crate::state::Shared;
use crate::value::Value;
use pyo3::exceptions::{PyAttributeError, PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use snell_math::Transform;

#[pymethods]
impl Scene {
    /// The vertices `(n, 3)` and faces `(m, 3)` of a mesh, in its own coordinates, as new arrays;
    /// of a heightfield, its triangles (those in holes are left out) and the nodes that they use. A
    /// pair, which has `normals`, `uvs`, `colors`, `material_ids` (None for what was not given) and
    /// `materials` as attributes.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> id = scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    /// >>> vertices, faces = scene.mesh(id)
    /// >>> vertices.shape, faces.tolist()
    /// ((3, 3), [[0, 1, 2]])
    /// >>> scene.mesh(id).uvs is None
    /// True
    fn mesh<'py>(&self, py: Python<'py>, id: i64) -> PyResult<Bound<'py, PyAny>> {
        let contents = self.0.contents(py);
        let triangles;
        let mesh = match &contents.get(id)?.kind {
            Kind::Heightfield(field) => {
                triangles = py.detach(|| field.to_triangles());
                &triangles.mesh
            }
            _ => contents.mesh(id)?,
        };
        let faces =
            from_vec(py, mesh.indices().as_flattened().to_vec(), &[mesh.indices().len(), 3])?;
        let shape = [mesh.vertex_count(), 3];
        let vertices = if mesh.is_double() {
            let values =
                mesh.double().positions.iter().flat_map(|p| p.to_array()).collect::<Vec<f64>>();
            from_vec(py, values, &shape)?
        } else {
            let values =
                mesh.single().positions.iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>();
            from_vec(py, values, &shape)?
        };
        let parts = PyDict::new(py);
        parts.set_item("vertices", vertices)?;
        parts.set_item("faces", faces)?;
        let attributes = mesh.attributes();
        let floats = |values: Vec<f32>, width: usize| {
            let rows = values.len() / width;
            (rows > 0).then(|| from_vec(py, values, &[rows, width])).transpose()
        };
        let normals = attributes.normals.iter().flat_map(|n| n.to_array()).collect();
        parts.set_item("normals", floats(normals, 3)?)?;
        let uvs = attributes.uvs.iter().flat_map(|uv| uv.to_array()).collect();
        parts.set_item("uvs", floats(uvs, 2)?)?;
        parts.set_item("colors", floats(attributes.colors.as_flattened().to_vec(), 4)?)?;
        let slots = &attributes.material_slots;
        let slots = (!slots.is_empty()).then(|| from_vec(py, slots.clone(), &[slots.len()]));
        parts.set_item("material_ids", slots.transpose()?)?;
        parts.set_item("materials", materials_of(py, &contents, contents.get(id)?)?)?;
        py.import("snell._views")?.getattr("Mesh")?.call((), Some(&parts))
    }

    /// The shape with this id as a dictionary: its name as `"shape"`, and its parameters. With it,
    /// `add_shape(**scene.shape(id))` adds another.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.shape(scene.add_shape("sphere", radius=2))
    /// {'shape': 'sphere', 'radius': 2.0}
    fn shape<'py>(&self, py: Python<'py>, id: i64) -> PyResult<Bound<'py, PyAny>> {
        match &self.0.contents(py).get(id)?.kind {
            Kind::Shape(shape) => Value::of(&**shape).map_err(PyTypeError::new_err)?.plain(py),
            _ => Err(PyTypeError::new_err(format!("id {id} is not a shape"))),
        }
    }

    /// The spheres with this id as a dictionary of `centers` and `radii`, as new arrays. With it,
    /// `add_spheres(**scene.spheres(id))` adds them again.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> cloud = scene.add_spheres([[0, 0, 0], [0, 0, 5]], 0.5)
    /// >>> scene.spheres(cloud)["radii"].tolist()
    /// [0.5, 0.5]
    fn spheres<'py>(&self, py: Python<'py>, id: i64) -> PyResult<Bound<'py, PyDict>> {
        match &self.0.contents(py).get(id)?.kind {
            Kind::Spheres(spheres) => {
                let all = PyDict::new(py);
                crate::pickle::store_spheres(&all, spheres)?;
                Ok(all)
            }
            _ => Err(PyTypeError::new_err(format!("id {id} is not a set of spheres"))),
        }
    }

    /// The curves with this id as a dictionary of `points`, `radii`, `strands` and `basis`, as
    /// :meth:`add_curves` takes them; those of a file may have `colors` too.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> wire = scene.add_curves([[0, 0, 0], [0, 1, 0], [1, 1, 0]], 0.25, basis="linear")
    /// >>> scene.curves(wire)["strands"].tolist()
    /// [3]
    fn curves<'py>(&self, py: Python<'py>, id: i64) -> PyResult<Bound<'py, PyDict>> {
        match &self.0.contents(py).get(id)?.kind {
            Kind::Curves(curves) => {
                let all = PyDict::new(py);
                crate::pickle::store_curves(&all, curves)?;
                Ok(all)
            }
            _ => Err(PyTypeError::new_err(format!("id {id} is not curves"))),
        }
    }

    /// The scene that the instance with this id shows, as a copy.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> ball, scene = snell.Scene(), snell.Scene()
    /// >>> id = ball.add_shape("sphere", radius=2)
    /// >>> scene.instance(scene.add_instance(ball)).shape(id)["radius"]
    /// 2.0
    fn instance(&self, py: Python<'_>, id: i64) -> PyResult<Self> {
        match &self.0.contents(py).get(id)?.kind {
            Kind::Instance(child) => Ok(Self(Shared::new(child.clone()))),
            _ => Err(PyTypeError::new_err(format!("id {id} is not an instance"))),
        }
    }

    /// The objects as they are now, in the order of their ids: a list of :class:`Node`, each with
    /// the `id`, `name`, `kind`, `mask`, `transform`, `motion`, `materials` and `content` of an
    /// object, and the `children` of an instance.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> wheel, car = snell.Scene(), snell.Scene()
    /// >>> tyre = wheel.add_shape("sphere", radius=0.3, name="tyre")
    /// >>> id = car.add_instance(wheel, name="front")
    /// >>> id = car.add_shape("box", min=[-2, 0, -1], max=[2, 1, 1])
    /// >>> [(node.kind, node.name) for node in car.children]
    /// [('instance', 'front'), ('shape', None)]
    /// >>> car.children[0].children[0].content
    /// {'shape': 'sphere', 'radius': 0.3}
    #[getter]
    fn children<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, contents) = (slf.py(), slf.get().0.contents(slf.py()));
        let node = py.import("snell._views")?.getattr("Node")?;
        // The nodes tell of the scene as it is now, whatever becomes of it.
        let copy = Bound::new(py, Self(Shared::new(contents.clone())))?;
        let nodes = contents
            .objects()
            .map(|(id, object)| {
                let name = object.name.as_deref();
                let node = node.call1((&copy, id, object.kind.name(), name, object.mask))?;
                Ok(node.unbind())
            })
            .collect::<PyResult<Vec<Py<PyAny>>>>()?;
        listed(slf, "children", nodes)
    }

    /// All objects, those in instances too, depth first: for each the ids of the instances that it
    /// is in, itself as a :class:`Node`, and the map `(4, 4)` from its coordinates to the scene's.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> wheel, car = snell.Scene(), snell.Scene()
    /// >>> tyre = wheel.add_shape("sphere", radius=0.3, name="tyre")
    /// >>> for x in (-1, 1):
    /// ...     id = car.add_instance(wheel, [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]])
    /// >>> for path, node, transform in car.walk():
    /// ...     if node.kind != "instance":
    /// ...         print(path, node.name, transform[0, 3])
    /// (0,) tyre -1.0
    /// (1,) tyre 1.0
    fn walk<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("snell._views")?.getattr("walk")?.call1((slf,))
    }

    /// The materials of an object by slot; None for the default.
    fn _materials(&self, py: Python<'_>, id: i64) -> PyResult<Vec<Option<Material>>> {
        let contents = self.0.contents(py);
        materials_of(py, &contents, contents.get(id)?)
    }

    /// The id of the object with a name.
    fn __getitem__(&self, py: Python<'_>, name: &Bound<'_, PyAny>) -> PyResult<u32> {
        let Ok(name) = name.extract::<String>() else {
            return Err(PyTypeError::new_err(
                "a scene is indexed by the names of its objects; of ids there are mesh(id), \
                    shape(id), instance(id) and transform(id)",
            ));
        };
        let contents = self.0.contents(py);
        let named = |object: &Object| object.name.as_deref() == Some(&*name);
        let found: Vec<u32> =
            contents.objects().filter(|(_, object)| named(object)).map(|(id, _)| id).collect();
        match found[..] {
            [id] => Ok(id),
            [] => {
                let names: Vec<&str> =
                    contents.objects().filter_map(|(_, object)| object.name.as_deref()).collect();
                let hint = suggestion(&name, &names);
                Err(PyKeyError::new_err(format!("there is no object {name:?}{hint}")))
            }
            _ => Err(PyKeyError::new_err(format!(
                "{} objects are called {name:?}: {found:?}",
                found.len()
            ))),
        }
    }

    /// Names an object, or takes its name away (None).
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.update_name(scene.add_shape("sphere", radius=1), "ball")
    /// >>> scene["ball"]
    /// 0
    fn update_name(&self, py: Python<'_>, id: i64, name: Option<Name>) -> PyResult<()> {
        self.0.edit(py, |contents| {
            contents.get_mut(id)?.name = name.map(|name| name.0.into());
            Ok(())
        })
    }

    /// The map `(4, 4)` from an object's coordinates to the scene's, as a new array; at the first
    /// time of an object that moves.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.transform(scene.add_shape("sphere", radius=1)).tolist()[0]
    /// [1.0, 0.0, 0.0, 0.0]
    fn transform<'py>(&self, py: Python<'py>, id: i64) -> PyResult<Bound<'py, PyAny>> {
        let contents = self.0.contents(py);
        matrix(py, &contents.get(id)?.transform.unwrap_or(Transform::IDENTITY))
    }

    /// The transforms `(k, 4, 4)` of an object that moves and their times `(k,)`, as they were
    /// given to :meth:`update_transform`; None for one that rests.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.motion(ball) is None
    /// True
    /// >>> scene.update_transform(ball, np.tile(np.eye(4), (3, 1, 1)), times=[0, 0.5, 2])
    /// >>> transforms, times = scene.motion(ball)
    /// >>> transforms.shape, times.tolist()
    /// ((3, 4, 4), [0.0, 0.5, 2.0])
    fn motion<'py>(
        &self,
        py: Python<'py>,
        id: i64,
    ) -> PyResult<Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>> {
        let contents = self.0.contents(py);
        let Some(motion) = &contents.get(id)?.motion else { return Ok(None) };
        let times = from_vec(py, motion.times().to_vec(), &[motion.times().len()])?;
        Ok(Some((matrices(py, motion.maps())?, times)))
    }

    /// The ids of all objects, ascending.
    #[getter]
    fn ids<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let contents = slf.get().0.contents(slf.py());
        listed(slf, "ids", contents.objects().map(|(id, _)| id).collect::<Vec<_>>())
    }

    /// The names of the objects that have one, by id. Changes of this dictionary name objects, as
    /// :meth:`update_name` does.
    #[getter]
    fn names<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, names) = (slf.py(), PyDict::new(slf.py()));
        for (id, object) in slf.get().0.contents(py).objects() {
            if let Some(name) = object.name.as_deref() {
                names.set_item(id, name)?;
            }
        }
        py.import("snell._views")?.getattr("Names")?.call1((slf, names))
    }

    #[setter(names)]
    fn set_names(&self, names: &Bound<'_, PyDict>) -> PyResult<()> {
        let given: Vec<(i64, String)> = names
            .iter()
            .map(|(id, name)| Ok((id.extract()?, name.extract()?)))
            .collect::<PyResult<_>>()?;
        self.0.edit(names.py(), |contents| {
            given.iter().try_for_each(|(id, _)| contents.get(*id).map(drop))?;
            let ids: Vec<u32> = contents.objects().map(|(id, _)| id).collect();
            for id in ids {
                contents.get_mut(id.into())?.name = None;
            }
            for (id, name) in given {
                contents.get_mut(id)?.name = Some(name.into());
            }
            Ok(())
        })
    }

    #[setter(ids)]
    fn refuse_ids(&self, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        Err(PyAttributeError::new_err(
            "ids: add_mesh(…) and its like add objects, remove(id) removes one",
        ))
    }

    #[setter(children)]
    fn refuse_children(&self, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        Err(PyAttributeError::new_err(
            "children: add_mesh(…) and its like add objects, remove(id) removes one",
        ))
    }

    #[setter(bounds)]
    fn refuse_bounds(&self, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        Err(PyAttributeError::new_err(
            "bounds: they follow from the objects; update_transform(id, …) moves one",
        ))
    }
}
