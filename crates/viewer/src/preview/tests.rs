use super::*;
use crate::rest::Resting;
use snell_scene::builtin::builtin;
use std::time::Instant;

const SIZE: [u32; 2] = [192, 108];

fn of<'a>(
    compiled: &'a CompiledScene,
    camera: &'a Camera,
    settings: &'a Settings,
    generation: [u32; 3],
) -> View<'a> {
    View { compiled, camera, settings, generation, threads: 2 }
}

fn level(v: f32) -> f32 {
    255.0 * v.clamp(0.0, 1.0).powf(1.0 / 2.2)
}

/// Mean difference of two pictures in levels of 255.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    let sum: f32 = a.iter().zip(b).map(|(a, b)| (level(*a) - level(*b)).abs()).sum();
    sum / a.len() as f32
}

/// A camera that has gone a few steps around what is in the middle of its picture.
fn turned(camera: &Camera, distance: f64, step: u32) -> Camera {
    let middle = camera.eye + camera.towards * distance;
    let angle = 0.01 * f64::from(step);
    let right = camera.right();
    let mut turned = camera.clone();
    turned.eye = middle + (right * angle.sin() - camera.towards * angle.cos()) * distance;
    turned.towards = (middle - turned.eye).normalize();
    turned.square_up();
    turned
}

/// Turns a scene after a short rest, and gives the difference of the last moving picture to
/// that at rest.
fn error_after_turning(name: &str) -> f32 {
    let scene = builtin(name).expect("the scene is built in");
    let compiled = CompiledScene::new(&scene, &Default::default()).expect("a valid scene");
    let start = &scene.cameras[0];
    let distance = f64::from((compiled.center - start.eye.as_vec3()).length());
    let settings = |spp| Settings { size: SIZE, spp, ..Settings::default() };
    let picture = |camera: &Camera, spp: u32| {
        rgb_of(&Job::new(&compiled, camera, &settings(spp)).run(2, &|_| true).0.image())
    };
    let (mut moving, quick) = (Moving::default(), settings(8));
    let half = SIZE.map(|side| side / 2);
    let view = |camera| of(&compiled, camera, &quick, [0; 3]);
    moving.next(&view(start), half);
    let resting = Resting::new(&view(start), &moving).denoised(&picture(start, 8), 8.0);
    moving.rest(&view(start), resting.lit);
    let cameras: Vec<Camera> = (1..20).map(|step| turned(start, distance, step)).collect();
    let begin = Instant::now();
    let shown = cameras.iter().map(|camera| moving.next(&view(camera), half).1).last();
    let error = difference(&shown.expect("pictures"), &picture(&cameras[18], 128));
    println!("{name}: {error} levels, {:?} a picture", begin.elapsed() / 19);
    error
}

#[test]
fn moving_pictures_have_the_light_of_those_at_rest() {
    for name in ["cornell-box", "teapot"] {
        let error = error_after_turning(name);
        assert!(error < 8.0, "{name}: {error} levels");
    }
}

#[test]
fn another_scene_is_not_lit_by_the_one_before() {
    let scene = builtin("cornell-box").expect("the scene is built in");
    let compiled = CompiledScene::new(&scene, &Default::default()).expect("a valid scene");
    let settings = Settings { size: [32, 24], ..Settings::default() };
    let view = |generation| of(&compiled, &scene.cameras[0], &settings, generation);
    let mut moving = Moving::default();
    moving.next(&view([0; 3]), [16, 12]);
    let trust = |moving: &Moving| {
        let last = moving.last.as_ref().expect("there is light");
        last.known.iter().map(|known| known.trust).fold(0.0, f32::max)
    };
    (0..3).for_each(|_| drop(moving.next(&view([0; 3]), [16, 12])));
    assert!(trust(&moving) > 2.0);
    // A change of materials leaves something, another geometry or another light nothing.
    moving.keep(&view([1, 0, 0]));
    assert_eq!(trust(&moving), CHANGED);
    for other in [[2, 1, 0], [3, 1, 1]] {
        moving.next(&view([other[0] - 1, other[1], other[2]]), [16, 12]);
        moving.next(&view(other), [16, 12]);
        moving.next(&view([other[0], 7, 7]), [16, 12]);
        moving.keep(&view(other));
        assert!(moving.last.is_none() && moving.history.is_none(), "{other:?}");
    }
}

/// The mean error of the moving picture, in levels, and after a rest that of the next one, when the
/// lamp was so many times as bright for a while. `is_told` says that the light is another one.
fn errors_after_a_bright_lamp(factor: f32, is_told: bool) -> [f32; 2] {
    let plain = builtin("cornell-box").expect("the scene is built in");
    let mut bright = plain.clone();
    let lamp = bright.materials.iter_mut().find(|m| m.name == "lamp").expect("it has a lamp");
    lamp.emission.factor = lamp.emission.factor.map(|c| c * factor);
    let compile = |scene| CompiledScene::new(scene, &Default::default()).expect("a valid scene");
    let (plain_compiled, bright_compiled) = (compile(&plain), compile(&bright));
    let start = &plain.cameras[0];
    let distance = f64::from((plain_compiled.center - start.eye.as_vec3()).length());
    let settings = Settings { size: SIZE, spp: 4, ..Settings::default() };
    let half = SIZE.map(|side| side / 2);
    let picture = |compiled: &CompiledScene, camera: &Camera, spp: u32| {
        let settings = Settings { size: SIZE, spp, ..Settings::default() };
        rgb_of(&Job::new(compiled, camera, &settings).run(2, &|_| true).0.image())
    };
    let mut moving = Moving::default();
    // Shows a state of the scene for some pictures, and rests.
    let mut show = |compiled: &CompiledScene, number: u32, cameras: &[Camera]| {
        let generation = [number, 0, if is_told { number } else { 0 }];
        let view = |camera| of(compiled, camera, &settings, generation);
        let shown = cameras.iter().map(|camera| moving.next(&view(camera), half).1).last();
        let last = cameras.last().expect("there are some");
        let resting = Resting::new(&view(last), &moving);
        moving.rest(&view(last), resting.denoised(&picture(compiled, last, 4), 4.0).lit);
        shown.expect("there are some")
    };
    let still = vec![start.clone(); 6];
    let turning: Vec<Camera> = (1..8).map(|step| turned(start, distance, step)).collect();
    show(&plain_compiled, 0, &still);
    show(&bright_compiled, 1, &still);
    let soon = show(&plain_compiled, 2, &still);
    let later = show(&plain_compiled, 2, &turning);
    [
        difference(&soon, &picture(&plain_compiled, start, 128)),
        difference(&later, &picture(&plain_compiled, &turning[6], 128)),
    ]
}

#[test]
fn a_light_that_is_gone_leaves_nothing_behind() {
    let usual = errors_after_a_bright_lamp(1.0, true);
    let gone = errors_after_a_bright_lamp(1e6, true);
    println!("{usual:?} {gone:?}");
    assert!((0..2).all(|i| gone[i] < usual[i] + 1.0), "{gone:?}, and usually {usual:?}");
    // Even if nothing says that the light is another one, what is far too bright goes.
    let unsaid = errors_after_a_bright_lamp(1e6, false);
    assert!((0..2).all(|i| unsaid[i] < usual[i] + 12.0), "{unsaid:?}, and usually {usual:?}");
}

#[test]
fn integrators_without_light_are_shown_too() {
    let scene = builtin("cornell-box").expect("the scene is built in");
    let compiled = CompiledScene::new(&scene, &Default::default()).expect("a valid scene");
    for (integrator, aovs) in
        [(IntegratorKind::Flat, vec![]), (IntegratorKind::Aov, vec![Aov::Normal])]
    {
        let settings = Settings { size: [32, 24], integrator, aovs, ..Settings::default() };
        let view = of(&compiled, &scene.cameras[0], &settings, [0; 3]);
        let (size, rgb) = Moving::default().next(&view, [16, 12]);
        assert_eq!((size, rgb.len()), ([32, 24], 32 * 24 * 3));
        assert!(rgb.iter().any(|v| *v > 0.1) && rgb.iter().all(|v| v.is_finite()));
    }
}
