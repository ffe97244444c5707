//! Whatever scene the bytes describe, as a scene of Snell: compiling and rendering it ends in
//! finite pixels or in an error.

#![no_main]

use snell_fuzz::{Places, read};
use snell_render::{Aov, CompiledScene, IntegratorKind, Job, Settings};
use snell_scene::framing::{FramingOptions, prepare};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some(mut scene) = read("fuzz.snell", bytes.to_vec(), Places::Mostly) else { return };
    let size = [8, 6];
    if prepare(&mut scene, &FramingOptions { size, ..Default::default() }).is_err() {
        return;
    }
    let settings =
        Settings { size, spp: 1, max_depth: 4, aovs: Aov::ALL.to_vec(), ..Settings::default() };
    let Ok(compiled) = CompiledScene::new(&scene, &settings.build) else { return };
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted] {
        let settings = Settings { integrator, ..settings.clone() };
        let (film, _) = Job::new(&compiled, &scene.cameras[0], &settings).run(1, &|_| true);
        let picture = film.image();
        let is_finite =
            picture.layers.iter().all(|layer| layer.values.iter().all(|v| v.is_finite()));
        assert!(is_finite, "a pixel that is not finite");
    }
});
