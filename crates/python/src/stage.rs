//! The stage of a scene: its materials, lights, cameras and medium. Also saves scenes. What
//! surrounds it all is in [`crate::surroundings`].

use crate::camera::Camera;
use crate::contents::{Contents, Kind as Content, Object};
use crate::declared::Declared;
use crate::encoding::warn;
use crate::file::write_error;
use crate::graph::{Purpose, graph};
use crate::light::Light;
use crate::material::Material;
use crate::medium::Medium as PyMedium;
use crate::names::{Name, suggestion};
use crate::scene::Scene;
use crate::schema::References;
use crate::texture::{AnyTexture, Pattern, Texture};
use crate::value::with_ids;
use crate::work::{Threads, run_to_end_on};
use pyo3::exceptions::{PyAttributeError, PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyList;
use snell_formats::WriteError;
use snell_scene::graph::{ImageId, MediumId};
use snell_scene::medium::Medium;
use snell_scene::{MaterialId, Scene as Graph, TextureId};
use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::Arc;

/// The id of a texture on a stage. A new texture is added after the textures that it refers to.
fn add_texture(stage: &mut Graph, texture: &AnyTexture) -> PyResult<TextureId> {
    let wanted: snell_scene::Texture = match texture {
        AnyTexture::Image(texture) => {
            let texture = texture.get();
            let known = stage.images.iter().position(|known| Arc::ptr_eq(known, &texture.image));
            let image = known
                .map_or_else(|| stage.add_image(texture.image.clone()), |at| ImageId(at as u32));
            snell_scene::ImageTexture { image, ..texture.declared.clone() }.into()
        }
        AnyTexture::Pattern(pattern) => on_stage(stage, &pattern.get().0)?.into(),
    };
    let known = stage.textures.iter().position(|known| *known == wanted);
    Ok(known.map_or_else(|| stage.add_texture(wanted), |at| TextureId(at as u32)))
}

/// The id of a medium on a stage; a new medium is added.
fn add_medium(stage: &mut Graph, medium: &Medium) -> MediumId {
    let known = stage.media.iter().position(|known| known == medium);
    known.map_or_else(|| stage.add_medium(medium.clone()), |at| MediumId(at as u32))
}

/// A material, light or pattern with its ids replaced by those of its textures and media on a
/// stage.
fn on_stage<T: serde::Serialize + serde::de::DeserializeOwned>(
    stage: &mut Graph,
    declared: &Declared<T>,
) -> PyResult<T> {
    let textures = declared.references.textures.iter().map(|texture| add_texture(stage, texture));
    let textures = textures.collect::<PyResult<Vec<_>>>()?;
    let media: Vec<_> =
        declared.references.media.iter().map(|medium| add_medium(stage, medium)).collect();
    let id = |kind: &str, id: u32| match kind {
        "TextureId" => textures.get(id as usize).map_or(id, |texture| texture.0),
        "MediumId" => media.get(id as usize).map_or(id, |medium| medium.0),
        _ => id,
    };
    with_ids(&declared.value, id).map_err(PyValueError::new_err)
}

/// The id of a material on a stage; a new material is added.
pub fn add_material(contents: &mut Contents, material: &Material) -> PyResult<MaterialId> {
    let stage = contents.stage_mut();
    let wanted = on_stage(stage, &material.0)?;
    let known = stage.materials.iter().position(|known| *known == wanted);
    Ok(known.map_or_else(|| stage.add_material(wanted), |at| MaterialId(at as u32)))
}

/// The id of a white matte material on a stage, with which colours of vertices are shown as they
/// are.
pub fn add_white(contents: &mut Contents) -> MaterialId {
    let stage = contents.stage_mut();
    let wanted = snell_scene::Material::white();
    let known = stage.materials.iter().position(|known| *known == wanted);
    known.map_or_else(|| stage.add_material(wanted), |at| MaterialId(at as u32))
}

/// Material ids by slot, from one material or a list of them.
pub fn add_materials(
    contents: &mut Contents,
    value: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Option<MaterialId>>> {
    let Some(value) = value else { return Ok(Vec::new()) };
    let one = |contents: &mut Contents, value: &Bound<'_, PyAny>, name: &str| {
        let error = || {
            PyTypeError::new_err(format!(
                "{name} is {}, expected a Material",
                crate::settings::shown(value)
            ))
        };
        add_material(contents, value.cast::<Material>().map_err(|_| error())?.get()).map(Some)
    };
    match value.cast::<PyList>() {
        Ok(list) => list
            .iter()
            .enumerate()
            .map(|(i, item)| one(contents, &item, &format!("material[{i}]")))
            .collect(),
        Err(_) => Ok(vec![one(contents, value, "material")?]),
    }
}

/// The opposite of [`on_stage`]: a value of a stage, with its own list of textures and media.
fn taken<T: serde::Serialize + serde::de::DeserializeOwned>(
    py: Python<'_>,
    stage: &Graph,
    value: &T,
) -> PyResult<Declared<T>> {
    let (mut used, mut textures, mut media) = (Vec::new(), Vec::new(), Vec::new());
    let value = with_ids(value, |kind, id| match kind {
        "MediumId" => {
            media.extend(stage.media.get(id as usize).cloned());
            (media.len() as u32).saturating_sub(1)
        }
        "TextureId" => used.iter().position(|&known| known == id).unwrap_or_else(|| {
            used.push(id);
            used.len() - 1
        }) as u32,
        _ => id,
    });
    for id in used {
        let Some(declared) = stage.textures.get(id as usize) else {
            return Err(PyIndexError::new_err(format!("texture {id} is not in the scene")));
        };
        textures.push(match declared {
            snell_scene::Texture::Image(declared) => {
                let missing = || Arc::new(snell_scene::texture::missing_texture_image());
                let image =
                    stage.images.get(declared.image.index()).cloned().unwrap_or_else(missing);
                let declared = snell_scene::ImageTexture { image: ImageId(0), ..declared.clone() };
                AnyTexture::Image(Py::new(py, Texture { image, declared })?)
            }
            // Textures refer only to preceding ones, so the recursion ends.
            snell_scene::Texture::Pattern(pattern)
                if pattern.textures().iter().all(|part| part.0 < id) =>
            {
                AnyTexture::Pattern(Py::new(py, Pattern(taken(py, stage, pattern)?))?)
            }
            snell_scene::Texture::Pattern(_) => {
                return Err(PyIndexError::new_err(format!(
                    "texture {id} refers to one that does not precede it"
                )));
            }
        });
    }
    Ok(Declared {
        value: value.map_err(PyValueError::new_err)?,
        references: References { textures, media },
    })
}

/// The materials of an object by slot; None for the default.
pub fn materials_of(
    py: Python<'_>,
    contents: &Contents,
    object: &Object,
) -> PyResult<Vec<Option<Material>>> {
    let stage = &contents.stage;
    let material = |id: &Option<MaterialId>| {
        let material = id.and_then(|id| stage.materials.get(id.index()));
        material.map(|material| taken(py, stage, material).map(Material)).transpose()
    };
    object.materials.iter().map(material).collect()
}

/// All elements of a list, which must be of one class.
fn each<'py, T: pyo3::PyClass>(
    list: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<Vec<Bound<'py, T>>> {
    let items =
        list.try_iter().map_err(|_| PyTypeError::new_err(format!("{name}: expected a list")))?;
    let item = |(i, item): (usize, PyResult<Bound<'py, PyAny>>)| {
        let item = item?;
        let found = crate::settings::shown(&item);
        item.cast_into::<T>().map_err(|_| {
            PyTypeError::new_err(format!("{name}[{i}] is {found}, which does not belong there"))
        })
    };
    items.enumerate().map(item).collect()
}

#[pymethods]
impl Scene {
    /// A name for users; for a file, the stem of its name.
    #[getter]
    fn name(&self, py: Python<'_>) -> String {
        self.0.contents(py).stage.name.clone()
    }

    #[setter]
    fn set_name(&self, py: Python<'_>, name: Name) -> PyResult<()> {
        self.0.edit(py, |contents| {
            contents.stage_mut().name = name.0;
            Ok(())
        })
    }

    /// The warnings of the file's reader, and the parts of the file that could not be kept.
    #[getter]
    fn warnings<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let stage = slf.get().0.contents(slf.py()).stage.clone();
        let all: Vec<_> = stage.warnings.iter().map(|warning| warning.message.clone()).collect();
        listed(slf, "warnings", all)
    }

    /// The materials, as a list of :class:`Material`: those of the file, and those that objects
    /// were given. An assignment to an element is :meth:`replace_material`.
    #[getter]
    fn materials<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, stage) = (slf.py(), slf.get().0.contents(slf.py()).stage.clone());
        let all = stage.materials.iter().map(|material| taken(py, &stage, material).map(Material));
        listed(slf, "materials", all.collect::<PyResult<Vec<_>>>()?)
    }

    #[setter(materials)]
    fn refuse_materials(&self, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        Err(PyAttributeError::new_err(
            "materials: objects bring them: add_mesh(…, material=…), update_material(id, …); \
                replace_material(number, …) changes one everywhere",
        ))
    }

    /// Puts another material in the place of one, on every surface that has it.
    ///
    /// Parameters
    /// ----------
    /// material : int or str
    ///     Number in :attr:`materials`, or name.
    /// new : Material
    ///     The new material.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.load("cornell-box")
    /// >>> red = next(i for i, material in enumerate(scene.materials) if material.name == "red")
    /// >>> scene.replace_material(red, scene.materials[red].replace(reflectance="#3050ff"))
    fn replace_material(
        &self,
        material: &Bound<'_, PyAny>,
        new: &Bound<'_, Material>,
    ) -> PyResult<()> {
        let py = material.py();
        self.0.edit(py, |contents| {
            let names: Vec<&str> =
                contents.stage.materials.iter().map(|m| m.name.as_str()).collect();
            let at = match material.extract::<String>() {
                Ok(name) => names.iter().position(|known| *known == name).ok_or_else(|| {
                    PyValueError::new_err(format!(
                        "there is no material {name:?}{}",
                        suggestion(&name, &names)
                    ))
                })?,
                Err(_) => {
                    material.extract::<usize>().ok().filter(|&at| at < names.len()).ok_or_else(
                        || {
                            PyIndexError::new_err(format!(
                                "material: expected a name or a number from 0 to {}",
                                names.len()
                            ))
                        },
                    )?
                }
            };
            let stage = contents.stage_mut();
            stage.materials[at] = on_stage(stage, &new.get().0)?;
            Ok(())
        })
    }

    /// Gives an object another material.
    ///
    /// Parameters
    /// ----------
    /// id : int
    ///     The id of the object.
    /// material : Material or list of Material
    ///     One material, or one per material slot of a mesh. The material of an instance is for the
    ///     objects in it that have none.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.update_material(ball, snell.Material("mirror", reflectance=0.9))
    fn update_material(
        &self,
        py: Python<'_>,
        id: i64,
        material: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        self.0.edit(py, |contents| {
            contents.get(id)?;
            let materials = add_materials(contents, Some(material))?;
            contents.get_mut(id)?.materials = materials;
            warn_without_uvs(py, contents, contents.get(id)?)
        })
    }

    /// The lights that are not surfaces, as a list of :class:`Light`. Can be assigned and changed.
    #[getter]
    fn lights<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, stage) = (slf.py(), slf.get().0.contents(slf.py()).stage.clone());
        let all = stage.lights.iter().map(|light| taken(py, &stage, light).map(Light));
        listed(slf, "lights", all.collect::<PyResult<Vec<_>>>()?)
    }

    #[setter]
    fn set_lights(&self, lights: &Bound<'_, PyAny>) -> PyResult<()> {
        let all = each::<Light>(lights, "lights")?;
        self.0.edit(lights.py(), |contents| {
            let stage = contents.stage_mut();
            let all =
                all.iter().map(|light| on_stage(stage, &light.get().0)).collect::<PyResult<_>>()?;
            stage.lights = all;
            Ok(())
        })
    }

    /// Adds a light and gives its number in :attr:`lights`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.add_light(snell.Light("directional", direction=(0, -1, -1), irradiance=3))
    /// 0
    fn add_light(&self, light: &Bound<'_, Light>) -> PyResult<usize> {
        self.0.edit(light.py(), |contents| {
            let stage = contents.stage_mut();
            let light = on_stage(stage, &light.get().0)?;
            stage.lights.push(light);
            Ok(stage.lights.len() - 1)
        })
    }

    /// The cameras, as a list of :class:`Camera`; the first is used unless another is asked for.
    /// Can be assigned and changed.
    #[getter]
    fn cameras<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let stage = slf.get().0.contents(slf.py()).stage.clone();
        listed(slf, "cameras", stage.cameras.iter().cloned().map(Camera).collect::<Vec<_>>())
    }

    #[setter]
    fn set_cameras(&self, cameras: &Bound<'_, PyAny>) -> PyResult<()> {
        let all = each::<Camera>(cameras, "cameras")?
            .iter()
            .map(|camera| camera.get().0.clone())
            .collect();
        self.0.edit(cameras.py(), |contents| {
            contents.stage_mut().cameras = all;
            Ok(())
        })
    }

    /// Adds a camera and gives its number in :attr:`cameras`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> scene.add_camera(snell.Camera(eye=(0, 0, 5)))
    /// 0
    fn add_camera(&self, camera: &Bound<'_, Camera>) -> PyResult<usize> {
        self.0.edit(camera.py(), |contents| {
            let cameras = &mut contents.stage_mut().cameras;
            cameras.push(camera.get().0.clone());
            Ok(cameras.len() - 1)
        })
    }

    /// The medium outside of all interiors of surfaces, such as fog: a :class:`Medium` or None. Can
    /// be assigned.
    #[getter]
    fn medium(&self, py: Python<'_>) -> Option<PyMedium> {
        let stage = self.0.contents(py).stage.clone();
        let value = stage.medium.and_then(|id| stage.media.get(id.index())).cloned()?;
        Some(PyMedium(Declared { value, references: References::default() }))
    }

    #[setter]
    fn set_medium(&self, py: Python<'_>, medium: Option<&Bound<'_, PyMedium>>) -> PyResult<()> {
        self.0.edit(py, |contents| {
            let stage = contents.stage_mut();
            stage.medium = medium.map(|medium| add_medium(stage, &medium.get().0.value));
            Ok(())
        })
    }

    /// Writes the scene as a `.snell` file, which :func:`load` and `snell render` read: the same
    /// picture to the bit. Or as glTF, pbrt, OBJ, PLY, STL or OFF, by the extension.
    ///
    /// A :class:`SceneWarning` names each thing that the format cannot hold, such as lights in OBJ,
    /// and masks in any. Vertices given as float64 are written so, beside the float32 ones around
    /// the centre of their mesh that pictures use. To keep all of it, pickle the scene.
    ///
    /// Parameters
    /// ----------
    /// path : str or os.PathLike
    ///     The path of the file. It is written completely or not at all.
    /// threads : int, optional
    ///     Number of threads for the writing. Default: one per core.
    ///
    /// Examples
    /// --------
    /// >>> import pathlib, tempfile, snell
    /// >>> scene = snell.Scene()
    /// >>> grey = snell.Material("diffuse", reflectance=0.5)
    /// >>> ball = scene.add_shape("sphere", radius=1, material=grey)
    /// >>> with tempfile.TemporaryDirectory() as folder:
    /// ...     path = pathlib.Path(folder, "ball.snell")
    /// ...     scene.save(path)
    /// ...     snell.load(path).materials
    /// [Material("diffuse", reflectance=(0.5, 0.5, 0.5))]
    #[pyo3(signature = (path, *, threads=None))]
    fn save(&self, py: Python<'_>, path: PathBuf, threads: Option<i64>) -> PyResult<()> {
        let contents = self.0.contents(py);
        let is_masked = has_masks(&contents);
        let written = run_to_end_on(py, Threads::new(threads)?, move || {
            let scene = graph(&contents, Purpose::File).map_err(Err)?;
            snell_formats::write_scene_as(&path, &scene, true).map_err(Ok)
        })?;
        let written = written.map_err(|error: Result<WriteError, String>| match error {
            Ok(error) => write_error(&error),
            Err(message) => PyValueError::new_err(message),
        })?;
        let losses = written.losses.iter().map(snell_scene::Warning::to_string);
        let masks = is_masked.then(|| "masks are left out".to_string());
        let warn = py.import("warnings")?.getattr("warn")?;
        let category = py.import("snell._render")?.getattr("SceneWarning")?;
        for message in losses.chain(masks) {
            warn.call1((message, &category))?;
        }
        Ok(())
    }
}

/// True if some object, also in instances, has a mask.
fn has_masks(contents: &Contents) -> bool {
    let (mut known, mut stack) = (HashSet::new(), vec![contents]);
    while let Some(contents) = stack.pop() {
        for (_, object) in contents.objects() {
            if object.mask != u64::MAX {
                return true;
            }
            if let Content::Instance(child) = &object.kind
                && known.insert(Arc::as_ptr(child))
            {
                stack.push(child);
            }
        }
    }
    false
}

/// Warns if a mesh has no coordinates for the textures of its materials.
pub fn warn_without_uvs(py: Python<'_>, contents: &Contents, object: &Object) -> PyResult<()> {
    let Content::Mesh(mesh) = &object.kind else { return Ok(()) };
    let (stage, attributes) = (&contents.stage, mesh.attributes());
    let lacks = |id: TextureId| {
        let image = stage.textures.get(id.index()).and_then(snell_scene::Texture::as_image);
        image.is_some_and(|texture| match texture.uv_set {
            0 => attributes.uvs.is_empty(),
            set => attributes.more_uvs.get(set as usize - 1).is_none_or(Vec::is_empty),
        })
    };
    let materials = object.materials.iter().flatten();
    let mut materials = materials.filter_map(|id| stage.materials.get(id.index()));
    match materials.any(|material| material.textures().into_iter().any(lacks)) {
        true => warn(
            py,
            "uvs: the material has a texture, but the mesh has no texture coordinates: one texel \
                shows all over"
                .into(),
        ),
        false => Ok(()),
    }
}

/// A list of a scene, whose changes are changes of the scene.
pub fn listed<'py, T: for<'a> IntoPyObject<'a>>(
    scene: &Bound<'py, Scene>,
    name: &str,
    items: Vec<T>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = scene.py();
    let items = PyList::new(py, items)?;
    py.import("snell._views")?.getattr("Listed")?.call1((scene, name, items))
}
