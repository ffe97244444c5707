//! Reads and renders files in this process as the command does, from bytes to pixels.

use snell_formats::{Input, ReadError, ReadOptions, image};
use snell_math::{DAffine3, Rgb};
use snell_render::{Aov, CompiledScene, IntegratorKind, Job, Settings};
use snell_scene::{Environment, Scene, builtin::builtin};
use std::path::Path;
use std::sync::Arc;

const SIZE: [u32; 2] = [8, 8];

/// The result for a file.
pub enum End {
    /// A picture was rendered; the number of samples that were not finite.
    Picture { invalid_samples: u64 },
    /// The file was refused with this message.
    Refused(String),
}

/// Reads and renders a scene file.
pub fn scene(name: &str, bytes: Vec<u8>, folder: &Path) -> End {
    match snell_formats::read_scene_bytes(name, bytes, folder, &ReadOptions::default()) {
        Ok(scene) => render(scene),
        Err(error) => refused(&error),
    }
}

/// Reads an image and renders a scene with it as environment.
pub fn environment(name: &str, bytes: Vec<u8>, folder: &Path) -> End {
    let input = Input::from_bytes(name, bytes, folder, &ReadOptions::default());
    if let Ok(picture) = image::read_layers(&input) {
        assert_eq!(
            picture.layers[0].values.len()
                % (picture.width as usize * picture.height as usize).max(1),
            0
        );
    }
    match image::read_image(&input) {
        Ok(image) => {
            let mut scene = builtin("minray").expect("the scene is built in");
            let world_from_environment = DAffine3::IDENTITY;
            let image = Arc::new(image);
            scene.environment =
                Some(Environment::Image { image, scale: Rgb::WHITE, world_from_environment });
            render(scene)
        }
        Err(error) => refused(&error),
    }
}

fn refused(error: &ReadError) -> End {
    assert!(!error.file.is_empty() && !error.problem.is_empty(), "{error:?}");
    assert!(!error.to_string().contains('\n'), "one message, one line: {error}");
    End::Refused(error.to_string())
}

/// Renders a scene.
pub fn render(mut scene: Scene) -> End {
    let framing = snell_scene::framing::FramingOptions { size: SIZE, ..Default::default() };
    if let Err(error) = snell_scene::framing::prepare(&mut scene, &framing) {
        return End::Refused(error.to_string());
    }
    let settings = Settings {
        size: SIZE,
        spp: 1,
        max_depth: 4,
        aovs: Aov::ALL.to_vec(),
        ..Settings::default()
    };
    let compiled = match CompiledScene::new(&scene, &settings.build) {
        Ok(compiled) => compiled,
        Err(error) => return End::Refused(error.to_string()),
    };
    let mut invalid_samples = 0;
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let settings = Settings { integrator, ..settings.clone() };
        let (film, statistics) =
            Job::new(&compiled, &scene.cameras[0], &settings).run(1, &|_| true);
        let picture = film.image();
        let mut values = picture.layers.iter().flat_map(|l| &l.values);
        assert!(values.all(|v| v.is_finite()), "a pixel that is not finite");
        invalid_samples += statistics.invalid_samples;
    }
    End::Picture { invalid_samples }
}
