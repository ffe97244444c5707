//! `snell view`: shows a scene in the browser.

use super::render::{self, receipt, stage::Stage};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::resources::admit_scene;
use crate::{interrupt, threads, usd};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser};
use snell_formats::Sources;
use snell_formats::error::one_line;
use snell_formats::image::Display;
use snell_math::simd::Level;
use snell_persist::{Checkpoint, Lock, Receipt, Resume, Wording};
use snell_render::Settings;
use snell_scene::Scene;
use snell_viewer::{
    Animated, CameraForSize, Finished, Opened, Prepare, Server, ServerOptions, Source, Which,
    Writer, read_dropped,
};
use std::ffi::OsString;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

/// Interval at which the modification times of files are checked with `--watch`.
const WATCH_INTERVAL: Duration = Duration::from_millis(300);

/// The scene that is shown behind the chooser if the command names no scene.
const FIRST_SCENE: &str = "cornell-box";

/// The environment variable with the token, an alternative to `--token`.
const TOKEN_VARIABLE: &str = "SNELL_VIEW_TOKEN";

/// Options of `snell view`.
#[derive(Clone, Debug, clap::Args)]
#[command(args_override_self = true)]
pub struct Options {
    /// Scene or mesh file, or the name of a built-in scene. Without one, the page offers the
    /// built-in scenes
    scene: Option<PathBuf>,
    /// Port to listen on. Default: any free one
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Address to listen on. Other machines can see the scene only if you name one of this
    /// machine's addresses here, or 0.0.0.0
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    host: IpAddr,
    /// Open the page in the browser (the default where there is a display)
    #[arg(long, overrides_with = "no_open")]
    open: bool,
    /// Only print the address of the page
    #[arg(long)]
    no_open: bool,
    /// Token in the page's address, 16 to 64 letters and digits, so that the address stays the
    /// same. Other users of the machine can see it on the command line; set SNELL_VIEW_TOKEN
    /// instead to keep it private. Default: a random one
    #[arg(long, value_name = "TOKEN", value_parser = parse_token)]
    token: Option<String>,
    /// Frames per second while something moves
    #[arg(long, value_name = "N", default_value_t = 30.0)]
    fps: f64,
    /// Reload the scene when its file changes; the camera stays
    #[arg(long)]
    watch: bool,
    /// Threads. Default: one per core
    #[arg(short, long, value_name = "N", value_parser = threads::number())]
    threads: Option<u32>,
    /// Keep the picture at rest in this file, every 30 seconds and at the end. If the file is
    /// there, the view continues where it was: with its camera, its options and its samples. `snell
    /// render --checkpoint FILE --resume` can finish the picture
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// More options of `snell render`, after `--`: settings of the picture at rest, such as
    /// `-- --spp 256 --environment sky`
    #[arg(last = true, value_name = "RENDER OPTIONS")]
    render: Vec<OsString>,
}

/// The options of `snell render` as a command of their own, to be read from words.
#[derive(Debug, clap::Parser)]
#[command(name = "snell render", no_binary_name = true)]
struct RenderLine {
    #[command(flatten)]
    options: render::Options,
}

fn parse_token(text: &str) -> Result<String, String> {
    let is_safe =
        (16..=64).contains(&text.len()) && text.chars().all(|c| c.is_ascii_alphanumeric());
    if is_safe {
        Ok(text.to_string())
    } else {
        Err("a token has 16 to 64 letters and digits".into())
    }
}

impl Options {
    /// The requested number of threads, from `snell view` or from the options of `snell render`.
    pub fn threads(&self) -> usize {
        self.threads.map_or_else(|| threads_of(&self.render), |n| n as usize)
    }
}

/// The number of threads in options of `snell render`. Errors in them are reported later.
pub(super) fn threads_of(render: &[OsString]) -> usize {
    let words = std::iter::once("scene".as_ref()).chain(render.iter().map(OsString::as_os_str));
    RenderLine::try_parse_from(words)
        .map_or_else(|_| threads::cores(), |line| line.options.threads())
}

/// The token from the option, or else from the environment, which other users of the machine cannot
/// read.
fn chosen_token(options: &Options) -> Result<Option<String>, Failure> {
    let given = std::env::var_os(TOKEN_VARIABLE).filter(|_| options.token.is_none());
    let Some(given) = given.filter(|value| !value.is_empty()) else {
        return Ok(options.token.clone());
    };
    let token = parse_token(&given.to_string_lossy());
    token.map(Some).map_err(|problem| Failure::Usage(format!("{TOKEN_VARIABLE}: {problem}")))
}

/// Serves the scene until Ctrl-C or another termination signal.
pub fn run(options: &Options) -> Result<ExitCode, Failure> {
    if !(options.fps >= 1.0 && options.fps <= 240.0) {
        return Err(Failure::Usage(format!("--fps {}: from 1 to 240", options.fps)));
    }
    let scene = options.scene.as_deref().unwrap_or(Path::new(FIRST_SCENE));
    let (render, _lock) = match &options.checkpoint {
        Some(checkpoint) => kept_options(checkpoint, scene, &options.render)?,
        None => (options.render.clone(), None),
    };
    let files = Files { checkpoint: options.checkpoint.clone(), ..Files::new(scene, &render)? };
    if files.line(scene).is_ok_and(|line| line.request.crop.is_some()) {
        let problem =
            "--crop belongs to `snell render`: the viewer shows the whole picture; leave it out";
        return Err(Failure::Usage(problem.into()));
    }
    let server_options = ServerOptions {
        host: options.host,
        port: options.port,
        frames_per_second: options.fps,
        threads: options.threads(),
        is_gallery: options.scene.is_none(),
        may_be_framed: false,
        token: chosen_token(options)?,
    };
    let server = snell_viewer::serve(Box::new(files), &server_options).map_err(Failure::Other)?;
    interrupt::save_first();
    if !options.host.is_loopback() {
        eprintln!(
            "warning: others can reach this address; anyone who knows it sees the scene and can \
                change the view"
        );
    }
    println!("{}", server.url);
    eprintln!("Open this address in a browser; Ctrl-C ends the viewer.");
    if !options.no_open && (options.open || has_display()) {
        open_browser(&server);
    }
    let watched = options.scene.as_ref().filter(|_| options.watch).filter(|path| path.exists());
    let mut before = watched.and_then(|path| modified(path));
    while !interrupt::is_requested() {
        interrupt::wait(WATCH_INTERVAL, 0);
        let now = watched.and_then(|path| modified(path));
        if now.is_some() && now != before {
            before = now;
            server.reload();
        }
    }
    server.stop();
    Ok(ExitCode::SUCCESS)
}

/// The options of the picture in a checkpoint; if it is not there yet, those that were given. While
/// the lock exists, no render saves to the checkpoint.
fn kept_options(
    checkpoint: &Path,
    scene: &Path,
    given: &[OsString],
) -> Result<(Vec<OsString>, Option<Lock>), Failure> {
    let lock = Checkpoint::check(checkpoint, Resume::IfSame, Wording::COMMAND)?;
    let Some(header) = Checkpoint::header(checkpoint, Wording::COMMAND)? else {
        return Ok((given.to_vec(), lock));
    };
    let shown = one_line(&checkpoint.display().to_string()).into_owned();
    let receipt = Receipt::parse(&header.note)?;
    if scene.file_name().is_none_or(|name| name.to_string_lossy() != receipt.scene) {
        return Err(Failure::Usage(format!(
            "{shown}: this is a picture of {}; name that scene, or another --checkpoint",
            one_line(&receipt.scene)
        )));
    }
    // A file may be a stranger's.
    receipt::options_of(scene, &receipt.arguments)?;
    eprintln!("{shown}: the view continues where it was, with the options that it had");
    let is_named = |argument: &&String| argument.starts_with("--denoise=");
    let arguments = receipt.arguments.iter().filter(|argument| !is_named(argument));
    Ok((arguments.map(OsString::from).collect(), lock))
}

/// The latest modification time of a scene file and of up to 1000 files beside it, which it may
/// name.
fn modified(path: &Path) -> Option<SystemTime> {
    let own = path.metadata().ok()?.modified().ok()?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let beside = std::fs::read_dir(folder)
        .ok()?
        .flatten()
        .take(1000)
        .filter_map(|entry| entry.metadata().ok()?.modified().ok());
    Some(beside.fold(own, SystemTime::max))
}

fn has_display() -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
    cfg!(any(target_os = "macos", windows)) || is_set("DISPLAY") || is_set("WAYLAND_DISPLAY")
}

/// Opens the page in the browser. The address does not contain the token, because other users of
/// the machine can read the browser's command line.
fn open_browser(server: &Server) {
    let opened = server
        .url_for_browser()
        .and_then(|url| open::that_detached(url).map_err(|e| e.to_string()));
    if let Err(error) = opened {
        eprintln!("warning: no browser could be opened ({error}); open the address yourself");
    }
}

/// The message about the options behind `--`. One that belongs before it is said to.
fn in_words(error: &clap::Error) -> String {
    let named = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(name)) if error.kind() == ErrorKind::UnknownArgument => {
            name.as_str()
        }
        _ => "",
    };
    let name = named.split('=').next().unwrap_or_default();
    let view = <Options as clap::Args>::augment_args(clap::Command::new("view"));
    let is_own = |arg: &clap::Arg| {
        let long = arg.get_long().map(|long| format!("--{long}"));
        let short = arg.get_short().map(|short| format!("-{short}"));
        [long, short].iter().flatten().any(|own| own == name)
    };
    if view.get_arguments().any(is_own) {
        return format!("{name} is an option of `snell view`: give it before the --");
    }
    error.to_string().trim().replace("error: ", "")
}

/// Scenes that are read as by `snell render`.
pub(super) struct Files {
    scene: PathBuf,
    render: Vec<OsString>,
    /// The file that keeps the picture at rest.
    checkpoint: Option<PathBuf>,
}

impl Files {
    /// The scene at `scene`, with options of `snell render`. Fails if an option makes no sense
    /// here.
    pub fn new(scene: &Path, render: &[OsString]) -> Result<Self, Failure> {
        let (scene, render) = (scene.to_path_buf(), render.to_vec());
        let files = Self { scene, render, checkpoint: None };
        let options = files.line(&files.scene).map_err(Failure::Usage)?;
        let unused = [
            ("--output", options.output.is_some()),
            ("--stats", options.stats.is_some()),
            ("--checkpoint after --", options.checkpoint.is_some()),
        ];
        if let Some((name, _)) = unused.iter().find(|(_, given)| *given) {
            let problem =
                format!("{name} belongs to `snell render`: nothing is written here; leave it out");
            return Err(Failure::Usage(problem));
        }
        Ok(files)
    }

    fn line(&self, scene: &Path) -> Result<render::Options, String> {
        let words = std::iter::once(scene.into()).chain(self.render.iter().cloned());
        let line = RenderLine::try_parse_from(words).map_err(|error| in_words(&error))?;
        Ok(line.options)
    }

    /// Prepares a scene for the viewer. `name` is for messages and for the command line that is
    /// shown: it may come from a page, and is never read as an option.
    fn opened(
        &self,
        name: &Path,
        scene: Scene,
        options: render::Options,
    ) -> Result<Opened, Failure> {
        let options = render::Options { scene: name.into(), ..options };
        let simd = Level::from_env().map_err(Failure::Usage)?;
        if options.has_frames() {
            let problem = "the viewer shows one moment: leave out --frames and --turntable, and \
                choose it with --at";
            return Err(Failure::Usage(problem.into()));
        }
        let camera_for_size = scene.cameras.is_empty().then(|| camera_maker(&scene, &options));
        let animate = scene.motion.is_some().then(|| animate(scene.clone(), options.clone()));
        let scene = render::prepare_scene(scene, &options)?;
        admit_scene(&name.display().to_string(), &scene)?;
        let camera = render::choose_camera(&scene, &options)?;
        let settings = options.settings(&scene, &camera, simd)?;
        let tonemap = options.tonemap(&scene)?;
        let display = render::display(&options, &scene, tonemap, None);
        let camera_number = scene.cameras.iter().position(|c| *c == camera).unwrap_or(0);
        let is_like_option = name.as_os_str().as_encoded_bytes().starts_with(b"-");
        let file = if is_like_option { Path::new(".").join(name) } else { name.to_path_buf() };
        let words = ["snell".as_ref(), "render".as_ref(), file.as_os_str()].into_iter();
        let words = words.chain(self.render.iter().map(OsString::as_os_str));
        Ok(Opened {
            scene,
            camera,
            camera_number,
            camera_for_size,
            request: (*options.request).clone(),
            settings,
            display,
            is_encoding_given: options.encoding().is_some(),
            writer: Arc::new(FileWriter {
                sources: options.sources.clone(),
                checkpoint: self.checkpoint.clone(),
            }),
            animate,
            command: words.map(|word| word.to_string_lossy().into_owned()).collect(),
        })
    }
}

/// Prepares a scene for one of its animations, as `--at` and `--animation` do.
fn animate(scene: Scene, options: render::Options) -> Arc<Prepare> {
    Arc::new(move |clip: Option<&str>| {
        let animation = clip.map(String::from).or_else(|| options.animation.clone());
        let options = render::Options { at: Some(0.0), animation, frames: None, ..options.clone() };
        let stage = Stage::new(scene.clone(), &options).map_err(|e| e.to_string())?;
        let (scene, player) = stage.into_parts();
        let player = player.ok_or("nothing in this scene moves")?;
        Ok(Animated::new(scene, player))
    })
}

impl Source for Files {
    fn open(&self, which: Which) -> Result<Opened, String> {
        let options = self.line(&self.scene)?.recording_sources();
        let reading = options.read_options();
        let (name, scene) = match which {
            Which::Given => (self.scene.clone(), crate::scene_source::load(&self.scene, &reading)),
            Which::Builtin(name) => {
                let scene = snell_scene::builtin::builtin(&name);
                let missing = || Failure::Scene(format!("{name}: there is no such built-in scene"));
                (name.clone().into(), scene.ok_or_else(missing))
            }
            Which::Dropped(files) if files.iter().any(|f| usd::is_usd(Path::new(&f.name))) => {
                return Err("USD stages are read where they are, with the files they name: start \
                    the viewer with the stage"
                    .into());
            }
            Which::Dropped(files) => match read_dropped(files, &reading) {
                Ok((name, scene)) => (name.into(), Ok(scene)),
                Err(message) => return Err(message),
            },
        };
        let scene = scene.map_err(|e| e.to_string())?;
        self.opened(&name, scene, options).map_err(|e| e.to_string())
    }
}

/// Makes the camera that `snell render` makes with `--size` for a scene without one.
fn camera_maker(scene: &Scene, options: &render::Options) -> CameraForSize {
    let (scene, options) = (scene.clone(), options.clone());
    Arc::new(move |size| {
        let mut options = options.clone();
        options.request.resize(size);
        let scene = render::prepare_scene(scene.clone(), &options).ok()?;
        render::choose_camera(&scene, &options).ok()
    })
}

/// Writes pictures as `snell render` does.
struct FileWriter {
    /// The files that the scene was read from.
    sources: Option<Sources>,
    /// The file that keeps the picture at rest.
    checkpoint: Option<PathBuf>,
}

impl FileWriter {
    /// The options that a command gives.
    fn options(&self, command: &[String]) -> Result<(render::Options, ArgMatches), clap::Error> {
        // The first two words are `snell render`.
        let words = command.get(2..).unwrap_or_default();
        let matches = RenderLine::command().try_get_matches_from(words)?;
        let line = RenderLine::from_arg_matches(&matches)?;
        Ok((render::Options { sources: self.sources.clone(), ..line.options }, matches))
    }

    /// The file that keeps the picture that a command renders.
    fn kept_at(
        &self,
        path: PathBuf,
        command: &[String],
        settings: &Settings,
    ) -> Result<Checkpoint, Failure> {
        let usage = |error: clap::Error| Failure::Usage(error.render().to_string());
        let (options, matches) = self.options(command).map_err(usage)?;
        let facts = render::checkpoint::all_facts(&options, settings, Path::new(""))?;
        let note = receipt::of_options(&options, &matches).text();
        Ok(Checkpoint::new(path, facts, note, Checkpoint::INTERVAL))
    }
}

impl Writer for FileWriter {
    fn write(
        &self,
        picture: &Finished,
        command: &[String],
        _: Display,
        format: &str,
    ) -> Result<Vec<u8>, String> {
        let (options, matches) = self.options(command).map_err(|e| e.to_string())?;
        render::encode(&options, &matches, picture, format).map_err(|e| e.to_string())
    }
    fn checkpoint(
        &self,
        command: &[String],
        settings: &Settings,
    ) -> Option<Result<Checkpoint, String>> {
        let path = self.checkpoint.clone()?;
        Some(self.kept_at(path, command, settings).map_err(|failure| failure.to_string()))
    }
}
