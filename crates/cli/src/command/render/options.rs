//! Options of `snell render`, and the settings that follow from them, the scene and the defaults,
//! in this order.

use super::frames::{self, FrameRange, Turntable};
use super::request::RequestOptions;
use crate::failure::{Failure, choice};
use crate::progress::ProgressStyleOption;
use crate::{scene_source, threads};
use snell_formats::image::Tonemap;
use snell_formats::{Limits, ReadOptions, Sources};
use snell_math::simd::Level;
use snell_math::{DVec3, Rgb};
use snell_render::{Request, RequestError, Settings};
use snell_scene::framing::{turned, upright};
use snell_scene::surroundings::{self, BACKGROUNDS, ENVIRONMENTS, Named};
use snell_scene::{Background, Camera, Environment, Scene};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// The value of `--display`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DisplayOption {
    /// An encoding of display values.
    Encoding(DisplayEncoding),
    /// Address of a tev viewer.
    Tev(String),
}

/// Reads a duration in seconds, or with a unit.
pub fn parse_duration(text: &str) -> Result<Duration, String> {
    let seconds = snell_render::seconds_of(text);
    if seconds.is_some_and(|seconds| seconds <= 0.0) {
        return Err("expected a time above 0, such as 30s".into());
    }
    let duration = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    duration
        .filter(|duration| !duration.is_zero())
        .ok_or_else(|| "expected seconds, or a duration such as 30s, 5m or 1h".into())
}

fn parse_display(text: &str) -> Result<DisplayOption, String> {
    match text {
        "srgb" => Ok(DisplayOption::Encoding(DisplayEncoding::Srgb)),
        "linear" => Ok(DisplayOption::Encoding(DisplayEncoding::Linear)),
        _ if text.starts_with("tev://") => Ok(DisplayOption::Tev(text.into())),
        _ => Err("expected srgb, linear, or tev://HOST:PORT".into()),
    }
}

/// How values are stored in display formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisplayEncoding {
    /// Display values with the sRGB curve.
    Srgb,
    /// Linear values, clamped.
    Linear,
}

/// Examples below the help.
const EXAMPLES: &str = "Examples:
  snell render                                    the Cornell box, as cornell-box.png
  snell render model.glb -o model.png             a camera and a sky are made if the file has none
  snell render scene.gltf --time 1m -o a.exr      as good as it gets in a minute, in linear light
  snell render mesh.ply -i ao --size 800x600      ambient occlusion
  snell render a.obj --environment studio.hdr     light from all around
  snell render walk.glb --frames 0..2s@24         an animation, as walk.0000.png and so on
  snell render model.glb --turntable 48 -o a.gif  the model from all sides
Ctrl-C ends a render early and saves what is there; so do SIGTERM and SIGHUP.";

/// Options of `snell render`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES, args_override_self = true)]
pub struct Options {
    /// Scene or mesh file, `-` for standard input, or the name of a built-in scene
    #[arg(default_value = "cornell-box")]
    pub scene: PathBuf,
    /// Picture to write; the extension decides the format, `-` is standard output (PNG). Default:
    /// the scene's name with .png
    #[arg(short, long, value_name = "FILE", help_heading = "The picture")]
    pub output: Option<PathBuf>,
    /// The settings of the render.
    #[command(flatten)]
    pub request: RequestOptions,
    /// Camera by name or number
    #[arg(long, value_name = "NAME|INDEX", help_heading = "What is rendered")]
    pub camera: Option<String>,
    /// The time to show, in seconds of the scene's animation
    #[arg(
        long,
        value_name = "SECONDS",
        allow_negative_numbers = true,
        value_parser = parse_seconds,
        help_heading = "Motion",
    )]
    pub at: Option<f64>,
    /// Play this animation of the file (`all` for all together). Default: the first, and each later
    /// one that moves only other things
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Motion")]
    pub animation: Option<String>,
    /// Render many pictures: from one time until just before another, at a rate per second, such as
    /// 0..2s@24 (@24 for all of the animation). Numbered files; one animated picture if the output
    /// is .apng, .gif or .y4m; a video stream (Y4M) if it is `-`
    #[arg(
        long,
        value_name = "START..END@RATE",
        allow_hyphen_values = true,
        value_parser = frames::parse_frames,
        conflicts_with_all = ["at", "turntable"],
        help_heading = "Motion",
    )]
    pub frames: Option<FrameRange>,
    /// Turn the scene once about its middle in this many pictures (N@RATE for an animated picture
    /// with another rate than 24 per second)
    #[arg(long, value_name = "N", value_parser = frames::parse_turntable, help_heading = "Motion")]
    pub turntable: Option<Turntable>,
    /// Blur motion between these times, in seconds from the time shown, such as 0..0.02. Default:
    /// the file's
    #[arg(
        long,
        value_name = "OPEN..CLOSE",
        allow_hyphen_values = true,
        value_parser = frames::parse_shutter,
        help_heading = "Motion",
    )]
    pub shutter: Option<[f64; 2]>,
    /// Save the unfinished render in this file, every 30 seconds and when it is interrupted, so
    /// that --resume can continue it
    #[arg(long, value_name = "FILE", help_heading = "The picture")]
    pub checkpoint: Option<PathBuf>,
    /// Time between two saves, such as 30s or 5m
    #[arg(
        long,
        value_name = "TIME",
        value_parser = parse_duration,
        help_heading = "The picture",
    )]
    pub checkpoint_interval: Option<Duration>,
    /// Write the picture so far to this file, every 10 seconds
    #[arg(long, value_name = "FILE", help_heading = "The picture")]
    pub preview: Option<PathBuf>,
    /// Continue what was interrupted: the render that --checkpoint has saved, or the missing
    /// frames of an animation
    #[arg(long, help_heading = "The picture")]
    pub resume: bool,
    /// Show this set of materials, in glTF files with several
    #[arg(long, value_name = "NAME|INDEX", help_heading = "What is rendered")]
    pub variant: Option<String>,
    /// Show this scene, in glTF files with several
    #[arg(long = "scene", value_name = "NAME|INDEX", help_heading = "What is rendered")]
    pub scene_of_file: Option<String>,
    /// Threads. Default: one per core
    #[arg(
        short,
        long,
        value_name = "N",
        value_parser = threads::number(),
        help_heading = "How light is computed",
    )]
    pub threads: Option<u32>,
    /// Also write the variance of the picture and the layers (OpenEXR)
    #[arg(long, help_heading = "The picture")]
    pub variance: bool,
    /// Tone map for display formats: none, aces or agx
    #[arg(long, value_name = "NAME", help_heading = "The picture")]
    pub tonemap: Option<String>,
    /// Encoding of display formats: srgb (the standard) or linear (clamped, without the sRGB curve,
    /// as old programs wrote them). Default: srgb, but linear for .scn and .nff. Or
    /// tev://HOST:PORT: shows tiles in a running tev viewer while they are rendered
    #[arg(long, value_name = "NAME", value_parser = parse_display, help_heading = "The picture")]
    pub display: Vec<DisplayOption>,
    /// Bits per channel of PNG: 8 or 16
    #[arg(long, value_name = "N", default_value_t = 8, help_heading = "The picture")]
    pub bits: u8,
    /// 16-bit instead of 32-bit channels in OpenEXR
    #[arg(long, help_heading = "The picture")]
    pub half: bool,
    /// Background seen by the camera: environment, studio (grey, with a shadow on a floor),
    /// transparent (or none), white, black, #rrggbb or r,g,b
    #[arg(long, value_name = "COLOR", help_heading = "What is rendered")]
    pub background: Option<String>,
    /// Light from all around: a latitude-longitude picture (.hdr, .exr), sky (a studio),
    /// sky:elevation=35,azimuth=135,… (a clear day), none, #rrggbb or r,g,b
    #[arg(long, value_name = "FILE", help_heading = "What is rendered")]
    pub environment: Option<OsString>,
    /// Fill the scene with fog that removes this share of light per scene unit, such as 0.001
    #[arg(
        long,
        value_name = "DENSITY",
        value_parser = parse_density,
        help_heading = "What is rendered",
    )]
    pub fog: Option<f32>,
    /// Change the scene: material.NAME.PARAMETER=VALUE, camera.…, light.NUMBER.…, medium.NUMBER.…,
    /// `ambient=[r,g,b]`; or NAME=VALUE, a parameter of a Mitsuba scene
    #[arg(
        short = 'D',
        long = "define",
        value_name = "key=value",
        help_heading = "What is rendered"
    )]
    pub define: Vec<String>,
    /// Write statistics as JSON
    #[arg(long, value_name = "FILE.json", help_heading = "Messages")]
    pub stats: Option<PathBuf>,
    /// Refuse to open files outside of the scene's folder
    #[arg(long, help_heading = "What is rendered")]
    pub confine: bool,
    /// Style of the progress display
    #[arg(long, value_name = "STYLE", default_value = "auto", help_heading = "Messages")]
    pub progress: ProgressStyleOption,
    /// Print nothing but errors
    #[arg(short, long, help_heading = "Messages")]
    pub quiet: bool,
    /// Print more details
    #[arg(short, long, help_heading = "Messages")]
    pub verbose: bool,
    /// The record of the files that are read; `None` if none is kept.
    #[arg(skip)]
    pub sources: Option<Sources>,
}

impl Options {
    /// The options for reading the scene file.
    pub fn read_options(&self) -> ReadOptions {
        ReadOptions {
            confine: self.confine,
            exact: false,
            limits: Limits::default(),
            parameters: scene_source::parameters(&self.define),
            variant: self.variant.clone(),
            scene: self.scene_of_file.clone(),
            sources: self.sources.clone(),
        }
    }

    /// Returns the options with a record of the files that are read: `--resume` compares it, and
    /// pictures carry its hash.
    pub fn recording_sources(mut self) -> Self {
        self.sources = Some(Sources::default());
        self
    }

    /// The options without the denoiser.
    pub fn without_denoiser(mut self) -> Self {
        self.request.forget_denoiser();
        self
    }

    /// True if several pictures are rendered.
    pub fn has_frames(&self) -> bool {
        self.frames.is_some() || self.turntable.is_some()
    }

    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.threads.map_or_else(threads::cores, |n| n as usize)
    }

    /// The encoding of display values, if set.
    pub fn encoding(&self) -> Option<DisplayEncoding> {
        let encoding = |option: &DisplayOption| match option {
            DisplayOption::Encoding(encoding) => Some(*encoding),
            DisplayOption::Tev(_) => None,
        };
        self.display.iter().rev().find_map(encoding)
    }

    /// The address of tev, if set.
    pub fn tev(&self) -> Option<&str> {
        self.display.iter().rev().find_map(|option| match option {
            DisplayOption::Tev(url) => Some(url.as_str()),
            DisplayOption::Encoding(_) => None,
        })
    }

    /// Exposure in stops.
    pub fn exposure(&self, scene: &Scene) -> f64 {
        self.request.exposure.or(scene.settings.exposure).unwrap_or(0.0)
    }

    /// The requested tone map, else that of the scene's file, else none.
    pub fn tonemap(&self, scene: &Scene) -> Result<Tonemap, Failure> {
        let name = self.tonemap.as_deref().or(scene.settings.tonemap.as_deref()).unwrap_or("none");
        choice("tone map", name, &Tonemap::ALL, Tonemap::name)
    }

    /// The settings of the render.
    pub fn settings(
        &self,
        scene: &Scene,
        camera: &Camera,
        simd: Level,
    ) -> Result<Settings, Failure> {
        let request = Request { simd: Some(simd), ..(*self.request).clone() };
        request.resolve(scene, camera).map_err(|error| self.usage(&error))
    }

    /// The error message for invalid options, in command-line terms.
    fn usage(&self, error: &RequestError) -> Failure {
        Failure::Usage(match error {
            RequestError::Parameter { parameter, problem } => {
                format!("--{} {problem}", parameter.replace('_', "-"))
            }
            RequestError::LightGroup { group, problem } => {
                let is_meant = |(name, _): &&(String, Vec<String>)| name == group;
                let groups = self.request.light_groups.as_deref().unwrap_or_default();
                let lights = groups.iter().rev().find(is_meant).map(|(_, lights)| lights.join(","));
                format!("--light-group {group}={}: {problem}", lights.unwrap_or_default())
            }
            RequestError::TooManyPixels { .. } => {
                format!("{error}; make it smaller with --size, or render parts of it with --crop")
            }
            RequestError::SceneName { parameter, .. } => {
                format!("{error}; choose another with --{parameter}")
            }
        })
    }

    /// Applies `--environment`.
    pub fn apply_environment(&self, scene: &mut Scene) -> Result<(), Failure> {
        let Some(value) = &self.environment else { return Ok(()) };
        // A value that is not valid text can only be the name of a file.
        let name = value.to_str().unwrap_or_default();
        let usage = |problem| Failure::Usage(format!("--environment {name}: {problem}"));
        scene.environment = match surroundings::environment(name).map_err(usage)? {
            Named::Environment(environment) => environment,
            Named::Picture if is_meant_as_color(name) && !Path::new(value).exists() => {
                return Err(usage(format!("not a color; expected {ENVIRONMENTS}")));
            }
            Named::Picture => {
                let input = snell_formats::Input::open(Path::new(value), &self.read_options())?;
                let image = snell_formats::image::read_environment(&input)?;
                for note in input.take_notes() {
                    scene.warn(note);
                }
                Some(Environment::Image {
                    image: Arc::new(image),
                    scale: Rgb::WHITE,
                    world_from_environment: snell_math::DAffine3::IDENTITY,
                })
            }
        };
        // Environments have their zenith at +y.
        let turn = upright(scene.settings.up.unwrap_or(DVec3::Y));
        scene.environment = scene.environment.take().map(|environment| turned(environment, &turn));
        scene.background = Background::Environment;
        Ok(())
    }

    /// Applies `--background`.
    pub fn apply_background(&self, scene: &mut Scene) -> Result<(), Failure> {
        let Some(name) = &self.background else { return Ok(()) };
        scene.background = surroundings::background(name, scene).ok_or_else(|| {
            Failure::Usage(format!("--background {name}: expected {BACKGROUNDS}"))
        })?;
        Ok(())
    }
}

/// True for text that may be a misspelt colour.
fn is_meant_as_color(text: &str) -> bool {
    text.starts_with('#') || text.split(',').all(|n| n.trim().parse::<f32>().is_ok())
}

fn parse_density(text: &str) -> Result<f32, String> {
    let density = text.parse().ok().filter(|x: &f32| *x > 0.0);
    density.ok_or_else(|| {
        format!(
            "\"{text}\" is not a density; write a positive number: the share of light lost per \
            scene unit"
        )
    })
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.trim_end_matches('s').parse().ok().filter(|t: &f64| t.abs() <= 1e6);
    seconds.ok_or_else(|| format!("\"{text}\" is not a time; write seconds, such as 1.5"))
}
