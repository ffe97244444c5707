//! The viewer in the browser, and explanations of pixels.

use crate::prepare::Prepared;
use crate::render::Task;
use crate::scene::Scene;
use crate::settings::Keywords;
use crate::work::{Threads, begin_alone, bound_shared_pool};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use snell_formats::ReadOptions;
use snell_intersect::AcceleratorKind;
use snell_render::Request;
use snell_scene::Camera;
use snell_viewer::explain::{Question, Subject, report, structures};
use snell_viewer::{Opened, Server, ServerOptions, Source, Which, opened, read_dropped};
use std::sync::{Arc, Mutex, PoisonError};

/// The explanation of a pixel, as JSON. With `structures`, also the traversal of those acceleration
/// structures by the camera ray.
#[pyfunction]
pub fn _explain<'py>(
    py: Python<'py>,
    scene: &Bound<'py, Scene>,
    options: &Bound<'py, PyDict>,
    pixel: [u32; 2],
    sample: Option<u32>,
    followed: Vec<String>,
) -> PyResult<String> {
    let keywords = Keywords(options);
    let threads = Threads::new(keywords.get("threads", "a whole number")?)?;
    let Task { prepared, camera, settings, .. } = Task::new(py, scene, &keywords)?;
    let kinds = followed.iter().map(|name| {
        let names: Vec<_> = AcceleratorKind::ALL.iter().map(|k| k.name()).collect();
        let unknown = || {
            PyValueError::new_err(format!(
                "structures has {name:?}, expected of {}",
                names.join(", ")
            ))
        };
        AcceleratorKind::from_name(name).ok_or_else(unknown)
    });
    let kinds = kinds.collect::<PyResult<Vec<_>>>()?;
    let job = begin_alone(py, threads, move || {
        let Prepared { scene, compiled, .. } = &*prepared;
        let structures = structures(scene, &settings, &kinds)?;
        let subject = Subject { scene, compiled, camera: &camera, settings: &settings };
        let report = report(subject, &Question { pixel, sample }, &structures)?;
        serde_json::to_string(&report).map_err(|e| e.to_string())
    })?;
    py.detach(|| job.wait_with(|_| Ok(())))?;
    job.take()?.map_err(PyValueError::new_err)
}

/// A scene that is shown in the browser until it is closed or deleted.
#[pyclass(module = "snell", name = "View", frozen)]
pub struct View {
    server: Mutex<Option<Server>>,
    /// Address of the page, with the token that grants access.
    #[pyo3(get)]
    url: String,
}

#[pymethods]
impl View {
    /// Stops the server; the page shows that the connection is lost. Closing again does nothing.
    fn close(&self, py: Python<'_>) {
        let server = self.server.lock().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| server.map(Server::stop));
    }

    /// An address that leads to the page once, within a minute, for programs of the same user. A
    /// browser is started with this address and not with `url`, because other users of the machine
    /// can read the browser's command line.
    fn _url_for_browser(&self) -> PyResult<String> {
        let server = self.server.lock().unwrap_or_else(PoisonError::into_inner);
        let closed = || PyValueError::new_err("the view is closed");
        server.as_ref().ok_or_else(closed)?.url_for_browser().map_err(PyRuntimeError::new_err)
    }

    /// True until the view is closed.
    #[getter]
    fn is_open(&self) -> bool {
        self.server.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    fn __enter__(this: Bound<'_, Self>) -> Bound<'_, Self> {
        this
    }

    #[pyo3(signature = (*_raised))]
    fn __exit__(&self, py: Python<'_>, _raised: &Bound<'_, pyo3::types::PyTuple>) {
        self.close(py);
    }

    fn __repr__(&self) -> String {
        let state = if self.is_open() { "" } else { " (closed)" };
        format!("<snell.View at {}{state}>", self.url)
    }

    /// The page as an HTML frame, for a cell of a notebook.
    fn _repr_html_(&self) -> String {
        if !self.is_open() {
            return "<em>This view is closed.</em>".into();
        }
        format!(
            "<iframe src=\"{}\" style=\"width:100%;height:600px;border:1px solid \
                #8884;border-radius:6px\" title=\"Snell\"></iframe>",
            self.url
        )
    }
}

/// Starts to show a scene in the viewer.
#[pyfunction]
pub fn _view<'py>(
    py: Python<'py>,
    scene: &Bound<'py, Scene>,
    options: &Bound<'py, PyDict>,
    port: u16,
    frames_per_second: f64,
) -> PyResult<View> {
    if !(1.0..=240.0).contains(&frames_per_second) {
        return Err(PyValueError::new_err(format!(
            "fps is {frames_per_second}, expected 1 to 240"
        )));
    }
    let keywords = Keywords(options);
    let threads = Threads::new(keywords.get("threads", "a whole number")?)?;
    let Task { prepared, camera, request, .. } = Task::new(py, scene, &keywords)?;
    bound_shared_pool(threads);
    let threads = threads.count();
    let options = ServerOptions {
        host: [127, 0, 0, 1].into(),
        port,
        frames_per_second,
        threads,
        is_gallery: false,
        may_be_framed: true,
        token: None,
    };
    // The page shows the whole picture.
    let request = Request { crop: None, ..request };
    let source = Box::new(Shown { prepared, camera, request });
    let server =
        py.detach(|| snell_viewer::serve(source, &options)).map_err(PyRuntimeError::new_err)?;
    Ok(View { url: server.url.clone(), server: Mutex::new(Some(server)) })
}

/// The scenes of a viewer: that of Python, and scenes chosen on the page.
struct Shown {
    prepared: Arc<Prepared>,
    camera: Camera,
    request: Request,
}

impl Source for Shown {
    fn open(&self, which: Which) -> Result<Opened, String> {
        let (name, scene) = match which {
            Which::Given => (self.prepared.scene.name.clone(), self.prepared.scene.clone()),
            Which::Builtin(name) => {
                let scene = snell_scene::builtin::builtin(&name)
                    .ok_or("there is no such built-in scene")?;
                (name, scene)
            }
            Which::Dropped(files) => read_dropped(files, &ReadOptions::default())?,
        };
        opened(&name, scene, &self.request, Some(&self.camera))
    }
}
