//! Instances, and the places of objects: where they are, and how they move.

use super::Scene;
use crate::animated::changes_surfaces;
use crate::arrays::{array, check_unsigned, contiguous, from_vec, shown, slice};
use crate::contents::{Kind, Object};
use crate::motion::still;
use crate::names::Name;
use crate::objects;
use crate::place::{place, places};
use crate::stage::add_materials;
use crate::state::Shared;
use numpy::PyUntypedArrayMethods;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;
use std::collections::HashMap;

/// Ids of objects, each once.
fn read_ids(ids: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
    let array = array(ids, "ids")?;
    let &[count] = array.shape() else {
        let found = shown(array.shape());
        return Err(PyValueError::new_err(format!("ids: shape is {found}, expected (n,)")));
    };
    if count == 0 {
        return Ok(Vec::new());
    }
    check_unsigned(&array, u32::MAX.into(), "ids")?;
    let ids = slice(&contiguous::<i64>(&array)?)?.to_vec();
    let mut known = HashMap::with_capacity(count);
    for (at, id) in ids.iter().enumerate() {
        if let Some(first) = known.insert(id, at) {
            let message = format!("ids[{first}] and ids[{at}] are both {id}, expected each once");
            return Err(PyValueError::new_err(message));
        }
    }
    Ok(ids)
}

/// Names of `count` objects.
fn read_names(names: Option<&Bound<'_, PyAny>>, count: usize) -> PyResult<Vec<Option<String>>> {
    let Some(names) = names else { return Ok(vec![None; count]) };
    let expected =
        || PyTypeError::new_err("names: expected a list of texts, one for each instance");
    if names.is_instance_of::<PyString>() {
        return Err(expected());
    }
    let names: Vec<Option<String>> = names.extract().map_err(|_| expected())?;
    match names.len() == count {
        true => Ok(names),
        false => Err(PyValueError::new_err(format!(
            "there are {} names and {count} transforms",
            names.len()
        ))),
    }
}

#[pymethods]
impl Scene {
    /// Adds the current contents of another scene as one object, and returns its id.
    ///
    /// The geometry of the other scene is stored and accelerated once, however often it is
    /// instanced. Later changes of the other scene have no effect here.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    ///     The scene to instance. It may contain instances.
    /// transform : array (4, 4) or (3, 4), optional
    ///     Map from the other scene's coordinates to this scene's; or `(k, 4, 4)`, one for each of
    ///     `times`, for an instance that moves.
    /// name : str, optional
    ///     A name for users.
    /// mask : int, optional
    ///     Only rays whose mask shares a bit with this mask enter the instance.
    /// material : Material, optional
    ///     The material of the instanced objects that have no material of their own.
    /// times : array (k,), optional
    ///     The times of the transforms; see :meth:`update_transform`.
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
    #[pyo3(signature = (
        scene, transform=None, name=None, *, mask=None, material=None, times=None,
    ))]
    fn add_instance(
        &self,
        py: Python<'_>,
        scene: &Self,
        transform: Option<&Bound<'_, PyAny>>,
        name: Option<Name>,
        mask: Option<objects::Mask>,
        material: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<u32> {
        let (place, mask) = (place(transform, times)?, objects::mask(mask)?);
        self.add_placed(py, Kind::Instance(scene.0.contents(py)), place, name, mask, material)
    }

    /// Adds the current contents of another scene many times, as :meth:`add_instance` does once for
    /// each transform. Either all instances are added or, after an error, none.
    ///
    /// Parameters
    /// ----------
    /// scene : Scene
    ///     The scene to instance.
    /// transforms : array (n, 4, 4) or (n, 3, 4)
    ///     Map from the other scene's coordinates to this scene's, for each instance; or
    ///     `(n, k, 4, 4)`, for instances that move, with a map for each of `times`.
    /// names : list of str or None, optional
    ///     A name for each instance.
    /// mask, material
    ///     As for :meth:`add_instance`, for all instances.
    /// times : array (k,), optional
    ///     The times of the transforms of instances that move; see :meth:`update_transform`.
    ///
    /// Returns
    /// -------
    /// array (n,) of uint32
    ///     The ids.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> tree, forest = snell.Scene(), snell.Scene()
    /// >>> tree.add_shape("cone", radius=1, height=3)
    /// 0
    /// >>> places = np.tile(np.eye(4), (1000, 1, 1))
    /// >>> places[:, 0, 3] = np.arange(1000) * 4
    /// >>> ids = forest.add_instances(tree, places)
    /// >>> forest.cast_rays([400.3, 9, 0.1, 0, -1, 0]).instance_ids == ids[100]
    /// np.True_
    #[pyo3(signature = (scene, transforms, names=None, *, mask=None, material=None, times=None))]
    fn add_instances<'py>(
        &self,
        py: Python<'py>,
        scene: &Self,
        transforms: &Bound<'py, PyAny>,
        names: Option<&Bound<'py, PyAny>>,
        mask: Option<objects::Mask>,
        material: Option<&Bound<'py, PyAny>>,
        times: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (places, mask) = (places(transforms, times)?, objects::mask(mask)?);
        let names = read_names(names, places.len())?;
        let kind = Kind::Instance(scene.0.contents(py));
        let ids = self.0.edit(py, |contents| {
            let materials = add_materials(contents, material)?;
            let object = Object { mask, materials, ..Object::new(kind, None, None) };
            contents.add_many(object, places, names)
        })?;
        let count = ids.len();
        from_vec(py, ids.collect(), &[count])
    }

    /// Moves an object: `transform` replaces its transform; or lets it move in time.
    ///
    /// Parameters
    /// ----------
    /// id : int
    ///     The id of the object.
    /// transform : array (4, 4) or (3, 4), or (k, 4, 4)
    ///     Where it is now; or where it is at each of `times`.
    /// times : array (k,), optional
    ///     The times of the transforms, ascending, in any unit, such as seconds. Queries keep times
    ///     to 6e-8 of the span of all keys of the scene.
    ///
    /// Queries find an object that moves where it is at the `times` of their rays. Between two
    /// transforms its translation is interpolated linearly, its rotation the short way around, and
    /// scale and shear linearly, as in animated files; rotations in steps of half a degree, which
    /// are off by up to 1e-5 of the distance from the axis. Before the first time and after the
    /// last it rests. Queries without times, queries of points and pictures show it as at its first
    /// transform; :meth:`at` shows it at any time.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.update_transform(ball, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3]])
    /// >>> float(scene.distance([0, 0, 0]))
    /// 2.0
    /// >>> import numpy as np
    /// >>> keys = np.tile(np.eye(4), (2, 1, 1))
    /// >>> keys[1, 2, 3] = 100
    /// >>> scene.update_transform(ball, keys, times=[0, 10])
    /// >>> scene.cast_rays(([[0, 0, -5]] * 3, [0, 0, 1]), times=[0, 2.5, 5]).t_hit.tolist()
    /// [4.0, 29.0, 54.0]
    #[pyo3(signature = (id, transform, times=None))]
    fn update_transform(
        &self,
        id: i64,
        transform: &Bound<'_, PyAny>,
        times: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let place = place(Some(transform), times)?;
        self.0.edit(transform.py(), |contents| {
            contents.get_mut(id)?.put(place);
            Ok(())
        })
    }

    /// Moves many objects, as :meth:`update_transform` does one: all of them or, after an error,
    /// none.
    ///
    /// Parameters
    /// ----------
    /// ids : array (n,) of integers
    ///     The ids of the objects, each once.
    /// transforms : array (n, 4, 4) or (n, 3, 4), or (n, k, 4, 4)
    ///     Where each is now; or where it is at each of `times`.
    /// times : array (k,), optional
    ///     The times of the transforms.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> ball, scene = snell.Scene(), snell.Scene()
    /// >>> ball.add_shape("sphere", radius=1)
    /// 0
    /// >>> places = np.tile(np.eye(4), (100, 1, 1))
    /// >>> ids = scene.add_instances(ball, places)
    /// >>> places[:, 0, 3] = 3 * np.arange(100)
    /// >>> scene.update_transforms(ids, places)
    /// >>> scene.bounds[1].tolist()
    /// [298.0, 1.0, 1.0]
    #[pyo3(signature = (ids, transforms, times=None))]
    fn update_transforms(
        &self,
        ids: &Bound<'_, PyAny>,
        transforms: &Bound<'_, PyAny>,
        times: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let places = places(transforms, times)?;
        let ids = read_ids(ids)?;
        if ids.len() != places.len() {
            return Err(PyValueError::new_err(format!(
                "there are {} ids and {} transforms",
                ids.len(),
                places.len()
            )));
        }
        self.0.edit(transforms.py(), |contents| {
            ids.iter().try_for_each(|&id| contents.get(id).map(drop))?;
            ids.into_iter().zip(places).try_for_each(|(id, place)| {
                contents.get_mut(id)?.put(place);
                Ok(())
            })
        })
    }

    /// The scene at a time: a copy in which nothing moves. What rests is shared with this scene.
    ///
    /// Parameters
    /// ----------
    /// time : float
    ///     A time, as in the `times` of :meth:`update_transform`.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np, snell
    /// >>> scene = snell.Scene()
    /// >>> keys = np.tile(np.eye(4), (2, 1, 1))
    /// >>> keys[1, 0, 3] = 10
    /// >>> ball = scene.add_shape("sphere", keys, times=[0, 1], radius=1)
    /// >>> scene.at(0.5).bounds.tolist()
    /// [[4.0, -1.0, -1.0], [6.0, 1.0, 1.0]]
    fn at(&self, py: Python<'_>, time: f64) -> PyResult<Self> {
        if !time.is_finite() {
            let message = format!("time is {time}, expected a finite number");
            return Err(PyValueError::new_err(message));
        }
        let contents = self.0.contents(py);
        if let Some(motion) = &contents.stage.motion {
            let what = match changes_surfaces(motion) {
                true => {
                    "the animation of the file stays as it is; only what \
                    update_transform(id, transforms, times) moves is posed"
                }
                false => {
                    "the cameras, lights and parameters that the file animates stay as they \
                    are; only objects are posed"
                }
            };
            crate::encoding::warn(py, format!("at: {what}"))?;
        }
        Ok(Self(Shared::new(still(&contents, time))))
    }
}
