//! Small pictures of the built-in scenes, which are part of the binary.
//!
//! `cargo xtask gallery` makes them anew, in `gallery/`.

/// The pictures as JPEG, by the names of their scenes.
macro_rules! pictures {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../gallery/", $name, ".jpg")))),*]
    };
}

const PICTURES: &[(&str, &[u8])] = pictures![
    "caustic",
    "cornell-box",
    "door-ajar",
    "drink",
    "fog",
    "hair",
    "minray",
    "night-town",
    "pool",
    "prism",
    "smoke",
    "spheres",
    "teapot",
];

/// The picture of a built-in scene, as JPEG.
pub fn picture(name: &str) -> Option<&'static [u8]> {
    PICTURES.iter().find(|(known, _)| *known == name).map(|&(_, bytes)| bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::viewpoint::keeping_frame;
    use snell_formats::ReadOptions;
    use snell_formats::image::{Display, Tonemap, WriteOptions, encode_image_as, read_image};
    use snell_formats::input::Input;
    use snell_render::{CompiledScene, Guiding, IntegratorKind, Job, Request, Settings};
    use snell_scene::builtin::{BUILTINS, Builtin, builtin};
    use std::path::Path;

    /// Width and height in pixels.
    const SIZE: [u32; 2] = [288, 180];
    /// Samples per pixel.
    const SPP: u32 = 1024;
    /// Maximum size of all pictures together, in bytes.
    const MAX_BYTES: usize = 200_000;

    /// The picture of a scene as its camera sees it.
    fn made(known: &Builtin) -> Vec<u8> {
        let scene = builtin(known.name).expect("it is built in");
        let size = scene.settings.size.unwrap_or(Request::DEFAULT_SIZE);
        let frame = f64::from(size[0]) / f64::from(size[1]);
        let camera = keeping_frame(&scene.cameras[0], frame, SIZE);
        let request = Request { size: Some(SIZE), spp: Some(SPP), ..Request::default() };
        let settings = request.resolve(&scene, &camera).expect("the request is valid");
        let is_path = settings.integrator == IntegratorKind::Path;
        let guiding = is_path.then(|| Guiding::for_picture(SIZE, SPP));
        let settings = Settings { guiding, ..settings };
        let compiled = CompiledScene::new(&scene, &settings.build).expect("it is valid");
        let job = Job::new(&compiled, &camera, &settings);
        let (film, _) = job.run(rayon::current_num_threads(), &|_| true);
        let wanted = scene.settings.tonemap.as_deref().unwrap_or("none");
        let display = Display {
            exposure: scene.settings.exposure.unwrap_or(0.0),
            tonemap: Tonemap::ALL.into_iter().find(|t| t.name() == wanted).unwrap_or_default(),
            srgb: !scene.settings.raw_display,
        };
        let options = WriteOptions { display, jpeg_quality: 85, ..WriteOptions::default() };
        let picture = snell_render::picture(&film, &settings, &compiled);
        encode_image_as("jpg", &picture, &options).expect("it is small")
    }

    #[test]
    fn every_scene_of_the_gallery_has_its_picture() {
        if std::env::var_os("SNELL_GALLERY").is_some_and(|v| v == "write") {
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/gallery/");
            for known in BUILTINS {
                std::fs::write(format!("{folder}{}.jpg", known.name), made(known))
                    .expect("the file can be written");
            }
            return;
        }
        let names: Vec<_> = PICTURES.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, BUILTINS.iter().map(|known| known.name).collect::<Vec<_>>());
        for (name, bytes) in PICTURES {
            let input =
                Input::from_bytes(name, bytes.to_vec(), Path::new(""), &ReadOptions::default());
            let picture = read_image(&input).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!([picture.width, picture.height], SIZE, "{name}");
        }
        let bytes: usize = PICTURES.iter().map(|(_, bytes)| bytes.len()).sum();
        assert!(bytes <= MAX_BYTES, "{bytes} bytes");
    }
}
