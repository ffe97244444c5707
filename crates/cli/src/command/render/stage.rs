//! A scene that may move: its poses over time, compiled for rendering.

use super::options::Options;
use super::{choose_camera, prepare_for};
use crate::failure::Failure;
use snell_formats::error::one_line;
use snell_intersect::BuildOptions;
use snell_math::{DAffine3, DVec3, rotation};
use snell_render::{CompiledScene, Moving};
use snell_scene::light::environment::EnvironmentLight;
use snell_scene::{Camera, Environment, Light, Player, Pose, Scene};
use std::time::Instant;

/// Number of poses that a default camera for an animation must frame.
const PROBES: u32 = 9;

/// A scene that can be shown at any time.
pub struct Stage {
    /// The scene in the last pose.
    pub scene: Scene,
    /// Cameras, lights and environment before any pose.
    cameras: Vec<Camera>,
    lights: Vec<Light>,
    environment: Option<Environment>,
    player: Option<Player>,
    moving: Moving,
    shutter: [f64; 2],
    compiled: Option<CompiledScene>,
    /// True if the light was made for the camera; then it turns with the camera.
    light_follows: bool,
}

/// The compiled scene and camera at a time.
pub struct Shot {
    /// The camera when the shutter opens.
    pub camera: Camera,
    /// The cameras at later times while the shutter is open.
    pub later_cameras: Vec<Camera>,
    /// The compiled scene.
    pub compiled: CompiledScene,
    /// Seconds to compute the pose.
    pub pose_seconds: f64,
    /// Seconds to compile the scene.
    pub build_seconds: f64,
}

impl Stage {
    /// Prepares a scene. It is animated only if the options set a time, or if the file has a
    /// shutter.
    pub fn new(mut scene: Scene, options: &Options) -> Result<Self, Failure> {
        let shutter = options.shutter.or(scene.settings.shutter);
        let is_asked =
            options.at.is_some() || options.frames.is_some() || options.animation.is_some();
        let mut player = match (is_asked || shutter.is_some(), &scene.motion) {
            (true, Some(motion)) => {
                let clips = match &options.animation {
                    None => motion.usual_clips(),
                    Some(name) => {
                        motion.find_clips(name).ok_or_else(|| unknown_clip(name, &scene))?
                    }
                };
                Some(Player::new(motion.clone(), clips))
            }
            _ if is_asked => {
                let problem = "nothing in the scene moves, so there are no times to show it at";
                return Err(Failure::Usage(format!(
                    "{}: {problem} (--turntable N turns it)",
                    options.scene.display()
                )));
            }
            _ => None,
        };
        let poses: Vec<Pose> = player.iter_mut().flat_map(probes).collect();
        let had_light = scene.environment.is_some()
            || !scene.lights.is_empty()
            || options.environment.is_some();
        prepare_for(&mut scene, &poses, options)?;
        let light_follows = !had_light && scene.environment.is_some();
        let nodes = player.as_ref().map(Player::moving_nodes).unwrap_or_default();
        Ok(Self {
            cameras: scene.cameras.clone(),
            lights: scene.lights.clone(),
            environment: scene.environment.clone(),
            scene,
            player,
            moving: Moving { nodes, later: Vec::new() },
            shutter: shutter.unwrap_or([0.0; 2]),
            compiled: None,
            light_follows,
        })
    }

    /// First and last key of the animation, in seconds.
    pub fn span(&self) -> [f64; 2] {
        self.player.as_ref().map_or([0.0; 2], Player::span)
    }

    /// The default time: the start of the animation, or 0 for a file with a shutter.
    pub fn usual_time(&self) -> f64 {
        if self.scene.settings.shutter.is_some() { 0.0 } else { self.span()[0] }
    }

    /// Poses the scene at a time; returns the later poses while the shutter is open.
    fn pose(&mut self, time: f64) -> Vec<Pose> {
        let Some(player) = &mut self.player else { return Vec::new() };
        let [open, close] = self.shutter.map(|offset| time + offset);
        let mut poses = player.poses_between(open, close);
        let later = poses.split_off(1);
        self.scene.cameras.clone_from(&self.cameras);
        self.scene.lights.clone_from(&self.lights);
        poses.iter().for_each(|pose| self.scene.apply(pose));
        later
    }

    /// The scene in the pose at a time, for viewing only.
    pub fn into_scene(mut self, time: Option<f64>) -> Scene {
        let time = time.unwrap_or_else(|| self.usual_time());
        self.pose(time);
        self.scene
    }

    /// The scene before any pose, and the player of its motion, if it is animated.
    pub fn into_parts(self) -> (Scene, Option<Player>) {
        (self.scene, self.player)
    }

    /// The camera that the options choose.
    pub fn camera(&self, options: &Options) -> Result<Camera, Failure> {
        choose_camera(&self.scene, options)
    }

    /// Compiles the scene at a time. Unchanged parts of the previous shot are reused, if its scene
    /// was returned by [`Self::keep`].
    pub fn shot(
        &mut self,
        time: f64,
        options: &Options,
        build: &BuildOptions,
    ) -> Result<Shot, Failure> {
        let start = Instant::now();
        self.moving.later = self.pose(time);
        let camera = self.camera(options)?;
        let later_cameras = self.later_cameras(&camera);
        let pose_seconds = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let compiled =
            CompiledScene::moving(&self.scene, &self.moving, build, self.compiled.take())
                .map_err(|e| Failure::Scene(format!("{}: {e}", options.scene.display())))?;
        Ok(Shot {
            camera,
            later_cameras,
            compiled,
            pose_seconds,
            build_seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Takes back a compiled scene, for the next shot.
    pub fn keep(&mut self, compiled: CompiledScene) {
        self.compiled = Some(compiled);
    }

    /// The cameras at later times while the shutter is open.
    fn later_cameras(&self, camera: &Camera) -> Vec<Camera> {
        let Some(number) = self.scene.cameras.iter().position(|c| c == camera) else {
            return Vec::new();
        };
        let of_pose = |pose: &Pose| {
            let moved = pose.cameras.iter().find(|(i, _)| *i == number);
            let placed = moved
                .map_or(self.cameras[number].clone(), |(_, by)| self.cameras[number].moved(by));
            // Animated properties other than the placement keep their values at the shutter's
            // opening.
            Camera { eye: placed.eye, towards: placed.towards, up: placed.up, ..camera.clone() }
        };
        let cameras: Vec<Camera> = self.moving.later.iter().map(of_pose).collect();
        if cameras.iter().all(|later| later == camera) { Vec::new() } else { cameras }
    }

    /// Turns the camera about the middle of the scene by a fraction of a turn, so that the scene
    /// seems to turn the other way. Light that was made for the camera turns with it.
    pub fn turn(&mut self, shot: &mut Shot, share: f64) {
        let up = self.scene.settings.up.and_then(DVec3::try_normalize).unwrap_or(DVec3::Y);
        let turn = DAffine3::from_mat3(rotation::about(up, share * std::f64::consts::TAU));
        let middle = shot.compiled.center.as_dvec3();
        let about = DAffine3::from_translation(middle) * turn * DAffine3::from_translation(-middle);
        shot.camera = shot.camera.moved(&about);
        if !self.light_follows {
            return;
        }
        if let (Some(Environment::Image { world_from_environment: still, .. }), Some(environment)) =
            (&self.environment, &mut self.scene.environment)
        {
            let turned = turn * *still;
            if let Environment::Image { world_from_environment, .. } = environment {
                *world_from_environment = turned;
            }
            shot.compiled.environment =
                EnvironmentLight::of_scene(&self.scene).map(std::sync::Arc::new);
        }
    }
}

fn probes(player: &mut Player) -> Vec<Pose> {
    let [start, end] = player.span();
    (0..PROBES)
        .map(|i| player.pose(start + (end - start) * f64::from(i) / f64::from(PROBES - 1)))
        .collect()
}

fn unknown_clip(name: &str, scene: &Scene) -> Failure {
    let clips = scene.motion.iter().flat_map(|m| &m.clips).enumerate();
    let names: Vec<String> = clips.map(|(i, clip)| format!("{i} \"{}\"", clip.name)).collect();
    Failure::Usage(
        one_line(&format!(
            "there is no animation \"{name}\"; the scene has: {} (or all)",
            names.join(", ")
        ))
        .into_owned(),
    )
}
