//! Scenes that are opened with the settings of a request, without a command line.

use crate::{CameraForSize, Opened, PlainWriter, Source, Which, read_dropped};
use snell_formats::ReadOptions;
use snell_formats::image::{Display, Tonemap};
use snell_render::Request;
use snell_scene::framing::{FramingOptions, prepare};
use snell_scene::{Camera, Scene};
use std::sync::Arc;

/// A scene that is shown as `snell render` shows it with this request. `camera` is seen first if it
/// is one of the scene's. The error is a message for the user.
pub fn opened(
    name: &str,
    mut scene: Scene,
    request: &Request,
    camera: Option<&Camera>,
) -> Result<Opened, String> {
    let camera_for_size = scene.cameras.is_empty().then(|| camera_maker(&scene));
    let size = request.size.unwrap_or(Request::DEFAULT_SIZE);
    let framing = FramingOptions { size, ..FramingOptions::default() };
    prepare(&mut scene, &framing).map_err(|e| e.to_string())?;
    let known = camera.filter(|camera| scene.cameras.contains(camera));
    let camera = known.or(scene.cameras.first()).cloned().ok_or("the scene has no camera")?;
    let wanted = scene.settings.tonemap.as_deref().unwrap_or("none");
    let display = Display {
        exposure: scene.settings.exposure.unwrap_or(0.0),
        tonemap: Tonemap::ALL.into_iter().find(|t| t.name() == wanted).unwrap_or_default(),
        srgb: !scene.settings.raw_display,
    };
    let settings = request.resolve(&scene, &camera).map_err(|e| e.to_string())?;
    Ok(Opened {
        animate: None,
        camera_number: scene.cameras.iter().position(|c| *c == camera).unwrap_or(0),
        camera,
        camera_for_size,
        request: request.clone(),
        settings,
        display,
        is_encoding_given: false,
        writer: Arc::new(PlainWriter),
        command: ["snell", "render", name].map(String::from).to_vec(),
        scene,
    })
}

/// Makes the camera that a scene without one gets for a picture of another size.
fn camera_maker(scene: &Scene) -> CameraForSize {
    let scene = scene.clone();
    Arc::new(move |size| {
        let mut scene = scene.clone();
        prepare(&mut scene, &FramingOptions { size, ..FramingOptions::default() }).ok()?;
        scene.cameras.into_iter().next()
    })
}

/// The built-in scenes and what is dropped on the page, with the usual settings.
pub struct Builtins {
    /// The name of the scene that is shown first.
    pub first: &'static str,
}

impl Source for Builtins {
    fn open(&self, which: Which) -> Result<Opened, String> {
        let builtin = |name: &str| {
            let scene = snell_scene::builtin::builtin(name);
            scene.ok_or_else(|| format!("{name}: there is no such built-in scene"))
        };
        let (name, scene) = match which {
            Which::Given => (self.first.into(), builtin(self.first)?),
            Which::Builtin(name) => (name.clone(), builtin(&name)?),
            Which::Dropped(files) => read_dropped(files, &ReadOptions::default())?,
        };
        opened(&name, scene, &Request::default(), None)
    }
}
