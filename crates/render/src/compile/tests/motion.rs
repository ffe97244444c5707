//! Tests of scenes that move while the shutter is open, and from one compilation to the next.

use super::*;
use crate::integrator::aov::Aov;
use crate::{IntegratorKind, Job, Settings, reference};
use snell_math::DVec2;
use snell_scene::motion::{
    AnimatedTransform, Channel, Clip, Deformed, Joint, Morph, MorphTarget, Placement, Track,
};
use snell_scene::motion::{Curve, Interpolation};
use snell_scene::{Camera, Environment, Motion, Player};

/// Three squares of 2 x 32 x 32 triangles, one that does not move, one that moves to the right and
/// turns, and one that bends; and a camera that rises.
fn three() -> Scene {
    let mut scene = Scene::new("three");
    let red = scene.add_material(Material::new("red", Diffuse::new(Rgb::new(0.8, 0.1, 0.1))));
    let mesh = square(32);
    let mut add = |x: f64, name: &str| {
        let surfaces = vec![Surface::with_material(Geometry::Mesh(Arc::new((*mesh).clone())), red)];
        scene.add_child(scene.root, Node { surfaces, ..moved(x, name) })
    };
    let (_, going, bent) = (add(-3.0, "still"), add(0.0, "going"), add(3.0, "bent"));
    let target = mesh.positions.iter().map(|p| Vec3::new(0.0, 0.0, p.x.abs())).collect();
    let at = |x: f64, angle: f64| {
        DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)) * DAffine3::from_rotation_z(angle)
    };
    let rise = DAffine3::from_translation(DVec3::new(0.0, 0.5, 0.0));
    let tracks = [
        Track::Transform(AnimatedTransform::new([(0.0, at(0.0, 0.0)), (1.0, at(0.5, 1.0))])),
        Track::Weights(
            Curve::new(vec![0.0, 1.0], vec![0.0, 1.0], 1, Interpolation::Linear)
                .expect("a valid curve"),
        ),
        Track::Transform(AnimatedTransform::new([(0.0, DAffine3::IDENTITY), (1.0, rise)])),
    ];
    let joint =
        |node| Joint { node, rest: Placement::Matrix(DAffine3::IDENTITY), ..Joint::default() };
    scene.motion = Some(Arc::new(Motion {
        joints: vec![joint(Some(going)), joint(None), joint(None)],
        clips: vec![Clip {
            name: "all".into(),
            channels: (0..).zip(tracks).map(|(joint, track)| Channel { joint, track }).collect(),
            parameters: Vec::new(),
        }],
        deformed: vec![Deformed {
            node: bent,
            surface: 0,
            rest: mesh,
            morph: Some(Morph {
                targets: vec![MorphTarget { positions: target, ..MorphTarget::default() }],
                weights: vec![0.0],
                joint: 1,
            }),
            skin: None,
        }],
        cameras: vec![(0, 2)],
        lights: Vec::new(),
        switches: Vec::new(),
    }));
    scene.environment = Some(Environment::Constant(Rgb::new(0.4, 0.5, 0.6)));
    scene.cameras.push(Camera::look_at(Vec3::new(0.0, -1.0, 9.0), Vec3::ZERO, Vec3::Y, 0.5));
    scene
}

struct Playing {
    scene: Scene,
    player: Player,
}

impl Playing {
    fn new() -> Self {
        let scene = three();
        let player = Player::new(scene.motion.clone().expect("it moves"), vec![0]);
        Self { scene, player }
    }

    /// Compiles the scene for a shutter that opens and closes at these times. Returns it with the
    /// cameras at its poses.
    fn shot(
        &mut self,
        from: f64,
        to: f64,
        previous: Option<CompiledScene>,
    ) -> (CompiledScene, Vec<Camera>) {
        let mut poses = self.player.poses_between(from, to);
        let camera = |pose: &Pose| {
            pose.cameras
                .first()
                .map_or(self.scene.cameras[0].clone(), |c| self.scene.cameras[0].moved(&c.1))
        };
        let cameras = poses.iter().map(camera).collect();
        let later = poses.split_off(1);
        let mut scene = self.scene.clone();
        scene.apply(&poses[0]);
        let moving = Moving { nodes: self.player.moving_nodes(), later };
        let compiled = CompiledScene::moving(&scene, &moving, &BuildOptions::default(), previous);
        (compiled.expect("a valid scene"), cameras)
    }
}

fn settings(cameras: &[Camera], integrator: IntegratorKind) -> Settings {
    let later_cameras = cameras[1..].to_vec();
    Settings {
        size: [40, 20],
        spp: 16,
        integrator,
        max_depth: 2,
        later_cameras,
        ..Settings::default()
    }
}

fn picture(compiled: &CompiledScene, cameras: &[Camera], threads: usize) -> Vec<f32> {
    let settings = settings(cameras, IntegratorKind::Path);
    let (film, statistics) = Job::new(compiled, &cameras[0], &settings).run(threads, &|_| true);
    assert_eq!(statistics.invalid_samples, 0);
    film.image().layers[0].values.clone()
}

#[test]
fn frames_take_over_what_stays_and_are_the_same_as_if_they_did_not() {
    let mut playing = Playing::new();
    let (mut last, _) = playing.shot(0.0, 0.0, None);
    for time in [0.3, 0.6] {
        let (next, cameras) = playing.shot(time, time, Some(last));
        let reuse = next.world.stats().reuse;
        // The static square is in the root group, which is rebuilt: the rest of that group is
        // small.
        assert!(reuse.kept >= 1 && reuse.refitted >= 1, "{reuse:?}");
        let (alone, _) = Playing::new().shot(time, time, None);
        assert!(!next.moves);
        assert_eq!(picture(&next, &cameras, 2), picture(&alone, &cameras, 1), "at {time}");
        last = next;
    }
}

#[test]
fn motion_blur_is_the_mean_of_the_moments_and_the_same_in_every_way() {
    let mut playing = Playing::new();
    let (open, cameras) = playing.shot(0.2, 0.9, None);
    assert!(open.moves && cameras.len() > 2);
    let blurred = picture(&open, &cameras, 3);
    assert_eq!(blurred, picture(&open, &cameras, 1));
    for integrator in [IntegratorKind::Path, IntegratorKind::Whitted, IntegratorKind::Ao] {
        let settings = settings(&cameras, integrator);
        let expected = reference::ray_cast(&open, &cameras[0], &settings);
        let (film, _) = Job::new(&open, &cameras[0], &settings).run(2, &|_| true);
        for (found, expected) in
            film.image().layers[0].values.as_chunks::<4>().0.iter().zip(&expected)
        {
            assert!(
                (found[1] - expected.g).abs() <= 1e-5 * expected.g.abs().max(1.0),
                "{integrator:?}"
            );
        }
    }
    let moments = 24;
    let mut mean = vec![0.0; blurred.len()];
    for i in 0..moments {
        let time = 0.2 + 0.7 * (f64::from(i) + 0.5) / f64::from(moments);
        let (still, cameras) = playing.shot(time, time, None);
        picture(&still, &cameras, 4)
            .iter()
            .zip(&mut mean)
            .for_each(|(v, m)| *m += v / moments as f32);
    }
    let differences = blurred.iter().zip(&mean).map(|(a, b)| f64::from(a - b).powi(2));
    let error = (differences.sum::<f64>() / blurred.len() as f64).sqrt();
    assert!(error < 0.03, "{error}");
    let (still, cameras) = playing.shot(0.2, 0.2, None);
    let sharp = picture(&still, &cameras, 4);
    let differences = sharp.iter().zip(&mean).map(|(a, b)| f64::from(a - b).powi(2));
    let unblurred = (differences.sum::<f64>() / sharp.len() as f64).sqrt();
    assert!(unblurred > 2.5 * error, "{unblurred} {error}: a moment is not the mean");
}

#[test]
fn motion_is_the_way_of_the_point_over_the_picture() {
    let (opens, closes) = (0.4, 0.41);
    let (open, cameras) = Playing::new().shot(opens, closes, None);
    let aovs = vec![Aov::Position, Aov::Motion, Aov::PrimitiveId];
    let settings = Settings { aovs, spp: 1, ..settings(&cameras, IntegratorKind::Aov) };
    let image = Job::new(&open, &cameras[0], &settings).run(2, &|_| true).0.image();
    let values = |layer: usize| &image.layers[layer].values;
    let mut seen = [0; 3];
    for pixel in (0..values(3).len()).filter(|&pixel| values(3)[pixel] >= 0.0) {
        let at = |axis: usize| f64::from(values(1)[3 * pixel + axis]);
        let point = DVec3::new(at(0), at(1), at(2));
        // The velocity of the point: the first square stands still, the third bends in proportion
        // to the distance from its middle, and the second moves and turns.
        let (square, speed) = match point.x {
            x if x < -1.5 => (0, DVec3::ZERO),
            x if x > 1.9 => (2, DVec3::new(0.0, 0.0, (x - 3.0).abs())),
            x => (1, DVec3::new(0.5 - point.y, x - 0.5 * opens, 0.0)),
        };
        seen[square] += 1;
        let last = cameras
            .last()
            .expect("there are some")
            .project(point + speed * (closes - opens), settings.size);
        let expected =
            last.expect("in sight") - cameras[0].project(point, settings.size).expect("in sight");
        let found =
            DVec2::new(f64::from(values(2)[2 * pixel]), f64::from(values(2)[2 * pixel + 1]));
        // The point belongs to some moment while the shutter is open, so the bound is loose.
        let bound = 0.02 * expected.length() + 1e-4;
        assert!((found - expected).length() < bound, "{point} of {square}: {found} {expected}");
    }
    assert!(seen.iter().all(|&count| count > 10), "{seen:?}");
}
