//! Many pictures of one scene: the frames of an animation or of a turntable, as numbered files or
//! as one animated picture.
//!
//! Each frame appears as a whole or not at all. Until all are done, a file beside them records how
//! they are made, so that `--resume` renders only the missing ones.

mod resume;
mod values;

use super::options::Options;
use super::output::{self, Target, hex};
use super::stage::{Shot, Stage};
use super::{Fate, Outcome, Session, checkpoint, memory, rescue};
use crate::exit::ExitCode;
use crate::failure::Failure;
use crate::progress::duration;
use crate::{interrupt, spectrum_file};
use resume::{Making, Memory};
use serde_json::{Value, json};
use snell_formats::image::{AnimatedFormat, AnimatedWriter, read_layers};
use snell_formats::open::{self, NamedBy};
use snell_formats::{Input, ReadOptions, Sources};
use snell_intersect::BuildOptions;
use snell_persist::Receipt;
use snell_render::Settings;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;
pub use values::{FrameRange, Turntable, parse_frames, parse_shutter, parse_turntable};

/// Maximum number of frames of one command.
const MOST: f64 = 1e6;

/// A frame to be rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The number in file names: the time times the rate. So the numbers of separately rendered
    /// parts of an animation fit together.
    pub number: i64,
    time: f64,
    /// The turn of the scene so far, as a fraction of a full turn.
    turn: f64,
}

/// The frames that the options ask for, and the number of frames per second; `None` if they ask for
/// one picture.
fn frames(options: &Options, stage: &Stage) -> Result<Option<(Vec<Frame>, f64)>, Failure> {
    if let Some(Turntable { count, rate }) = options.turntable {
        let time = options.at.unwrap_or_else(|| stage.usual_time());
        let frame =
            |i: u32| Frame { number: i.into(), time, turn: f64::from(i) / f64::from(count) };
        return Ok(Some(((0..count).map(frame).collect(), rate)));
    }
    let Some(FrameRange { start, end, rate }) = options.frames else { return Ok(None) };
    let [first, last] = stage.span();
    let (start, end) = (start.unwrap_or(first), end.unwrap_or(last));
    // A frame is rendered if it begins before the end, up to rounding.
    let count = ((end - start) * rate - 1e-6).ceil().max(1.0);
    if count > MOST || !count.is_finite() {
        return Err(Failure::Usage(format!(
            "--frames asks for {count} frames; at most {MOST} are possible"
        )));
    }
    let from = (start * rate).round() as i64;
    let frame = |i: i64| Frame { number: from + i, time: start + i as f64 / rate, turn: 0.0 };
    Ok(Some(((0..count as i64).map(frame).collect(), rate)))
}

/// All pictures that the options ask for, which may be one.
pub fn all(options: &Options, stage: &Stage) -> Result<Vec<Frame>, Failure> {
    let one = || {
        let time = options.at.unwrap_or_else(|| stage.usual_time());
        vec![Frame { number: 0, time, turn: 0.0 }]
    };
    Ok(frames(options, stage)?.map_or_else(one, |(frames, _)| frames))
}

/// The compiled scene and camera of a frame.
pub fn shot(
    stage: &mut Stage,
    frame: &Frame,
    options: &Options,
    build: &BuildOptions,
) -> Result<Shot, Failure> {
    let mut shot = stage.shot(frame.time, options, build)?;
    if frame.turn > 0.0 {
        stage.turn(&mut shot, frame.turn);
    }
    Ok(shot)
}

/// The destination of frames.
struct Place {
    folder: PathBuf,
    /// The part of the name before the number.
    before: OsString,
    /// The part of the name after the number.
    after: OsString,
    /// The least number of digits of the number.
    digits: usize,
    /// The animated picture, if requested; its path is `None` for standard output.
    animated: Option<(AnimatedFormat, Option<PathBuf>)>,
}

impl Place {
    /// Places frames beside the output: `walk.png` becomes `walk.0000.png`; if the name has `#`
    /// characters, these become the digits. Frames of an animated picture are kept in a folder
    /// beside the picture until it is written.
    fn of(output: Option<&Path>, stem: &OsStr) -> Result<Self, Failure> {
        let path =
            output.map_or_else(|| joined([stem, OsStr::new(".png")]).into(), Path::to_path_buf);
        let waiting = |folder: OsString, format, target| Self {
            folder: folder.into(),
            before: OsString::new(),
            after: ".png".into(),
            digits: 4,
            animated: Some((format, target)),
        };
        let frames = OsStr::new(".frames");
        if path == Path::new("-") {
            return Ok(waiting(joined([stem, frames]), AnimatedFormat::Y4m, None));
        }
        if let Some(format) = animated_format(&path) {
            return Ok(waiting(joined([path.as_os_str(), frames]), format, Some(path)));
        }
        let name = path.file_name().unwrap_or_default();
        let folder = path
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."))
            .to_path_buf();
        let marks: Vec<usize> = (0..)
            .zip(name.as_encoded_bytes())
            .filter(|(_, b)| **b == b'#')
            .map(|(i, _)| i)
            .collect();
        let dot = OsStr::new(".");
        let (before, after, digits) = match (marks.first(), marks.last()) {
            (Some(&first), Some(&last)) if last - first + 1 == marks.len() => {
                (part(name, 0..first), part(name, last + 1..name.len()), marks.len())
            }
            (Some(_), Some(_)) => {
                let problem = "the # that stand for the number must be next to each other";
                return Err(Failure::Usage(format!("{}: {problem}", path.display())));
            }
            _ => {
                let after =
                    path.extension().map(|extension| joined([dot, extension])).unwrap_or_default();
                (joined([path.file_stem().unwrap_or_default(), dot]), after, 4)
            }
        };
        Ok(Self { folder, before, after, digits, animated: None })
    }

    /// The file of a frame.
    fn file(&self, number: i64) -> PathBuf {
        let number = digits(number, self.digits);
        self.folder.join(joined([&self.before, OsStr::new(&number), &self.after]))
    }

    /// The file that records the finished frames.
    fn memory(&self) -> PathBuf {
        let before = if self.before.is_empty() { OsStr::new("frames.") } else { &self.before };
        self.folder.join(joined([before, OsStr::new("resume")]))
    }
}

/// The number of a frame with at least so many digits.
pub fn digits(number: i64, digits: usize) -> String {
    let sign = if number < 0 { "-" } else { "" };
    format!("{sign}{:0digits$}", number.unsigned_abs())
}

fn joined<const N: usize>(parts: [&OsStr; N]) -> OsString {
    parts.into_iter().collect()
}

/// A part of a name. The range must begin and end at ASCII bytes.
#[cfg(unix)]
fn part(name: &OsStr, bytes: Range<usize>) -> OsString {
    use std::os::unix::ffi::OsStrExt;
    OsStr::from_bytes(&name.as_bytes()[bytes]).into()
}

#[cfg(not(unix))]
fn part(name: &OsStr, bytes: Range<usize>) -> OsString {
    String::from_utf8_lossy(&name.as_encoded_bytes()[bytes]).into_owned().into()
}

/// The format for animated pictures with a file's extension.
pub fn animated_format(path: &Path) -> Option<AnimatedFormat> {
    AnimatedFormat::of_extension(&path.extension()?.to_string_lossy())
}

/// True if frames become one animated picture, a file or a stream.
pub fn is_animated(options: &Options) -> bool {
    options
        .output
        .as_deref()
        .is_some_and(|path| path == Path::new("-") || animated_format(path).is_some())
}

/// A fingerprint of how all frames are made: only frames with the same fingerprint belong together.
/// It covers the files read and every option that changes pictures.
fn fingerprint(
    options: &Options,
    stage: &Stage,
    frames: &[Frame],
    rate: f64,
) -> Result<String, Failure> {
    let files = options.sources.as_ref().map(Sources::list);
    let neutral = Options {
        output: None,
        threads: None,
        quiet: false,
        verbose: false,
        stats: None,
        resume: false,
        frames: None,
        progress: Default::default(),
        sources: None,
        define: options
            .define
            .iter()
            .map(|d| spectrum_file::resolve(d))
            .collect::<Result<_, _>>()?,
        ..options.clone()
    };
    // If the first time is not a whole number of frames from 0, up to rounding, the numbers of
    // frames stand for other times.
    let offset = frames.first().map_or(0.0, |f| f.time - f.number as f64 / rate);
    let offset = (offset * 1e9).round();
    let version = env!("CARGO_PKG_VERSION");
    Ok(
        hex(format!("{version} {rate} {offset} {:?} {files:?} {neutral:?}", stage.span())
            .as_bytes()),
    )
}

/// Renders all frames that the options ask for; `None` if they ask for one picture.
pub(super) fn render(
    session: &mut Session,
    stage: &mut Stage,
) -> Result<Option<ExitCode>, Failure> {
    let options = session.options;
    let Some((frames, rate)) = frames(options, stage)? else { return Ok(None) };
    let place = Place::of(options.output.as_deref(), &session.stem)?;
    if place.animated.is_some() {
        std::fs::create_dir_all(&place.folder).map_err(|e| io(&place.folder, e))?;
    }
    let files: BTreeMap<i64, PathBuf> =
        frames.iter().map(|f| (f.number, place.file(f.number))).collect();
    if let Some(first) = files.values().next() {
        // Names of frames are longer than the name of the output, so the first is checked too.
        output::check_place(first)?;
    }
    let settings = options.settings(&stage.scene, &stage.camera(options)?, session.simd)?;
    let first = files.values().next().map_or(Path::new(""), PathBuf::as_path);
    checkpoint::check_animation(options, &settings, first, &session.receipt)?;
    let receipt = session.receipt.clone();
    let receipts: BTreeMap<i64, Receipt> = (0..)
        .zip(&frames)
        .map(|(picture, frame)| match options.turntable {
            Some(_) => (frame.number, Receipt { picture, ..receipt.clone() }),
            None => (frame.number, receipt.of_frame(frame.time)),
        })
        .collect();
    let fingerprint = fingerprint(options, stage, &frames, rate)?;
    let hash = |number: i64| hash_of_whole(&files[&number], &receipts[&number], &settings);
    let making = match session.merged {
        Some(_) => Making::Merging(&hash),
        None => Making::Rendering,
    };
    let mut memory = Memory::open(&place, fingerprint, &files, options, making)?;
    let start = Instant::now();
    let mut statistics = Vec::new();
    for (i, frame) in frames.iter().enumerate() {
        session.number = i as u32;
        session.receipt = receipts[&frame.number].clone();
        if memory.has(frame.number) {
            continue;
        }
        let there = format!(
            "interrupted: {} of {} frames are there; the same command with --resume makes the rest",
            files.keys().filter(|&&number| memory.has(number)).count(),
            frames.len()
        );
        interrupt::end_at_once(there.clone());
        let file = &files[&frame.number];
        let taken =
            if interrupt::is_requested() { None } else { render_one(session, stage, frame, file)? };
        let Some(taken) = taken else {
            eprintln!("{there}");
            return Ok(Some(ExitCode::from(interrupt::EXIT_CODE)));
        };
        let Some(sha256) = taken.sha256 else {
            eprintln!(
                "the frames before it are written; the same command with --resume makes the rest"
            );
            return Ok(Some(ExitCode::from(1)));
        };
        memory.add(frame.number, sha256)?;
        if !options.quiet {
            eprintln!("frame {} of {}: {}, {}", i + 1, frames.len(), file.display(), taken.line);
        }
        statistics.push(taken.statistics);
    }
    let farewell = "interrupted: all frames are there; the same command with --resume makes the \
        picture of them";
    interrupt::end_at_once(farewell);
    if interrupt::is_requested() && place.animated.is_some() {
        eprintln!("{farewell}");
        return Ok(Some(ExitCode::from(interrupt::EXIT_CODE)));
    }
    let assembled = assemble(&place, &files, rate)?;
    let mut is_in_place = assembled.is_in_place;
    if is_in_place {
        memory.forget(&place);
    }
    let all = Totals::of(&statistics, start.elapsed().as_secs_f64());
    if let Some(path) = &options.stats {
        let text = serde_json::to_string_pretty(&all.json(&statistics, rate))
            .map_err(|e| Failure::Other(e.to_string()))?;
        is_in_place &= output::write_text(path, "the JSON", &(text + "\n"))?;
    }
    if !options.quiet && assembled.is_in_place {
        let line = all.line(statistics.len(), session.merged.is_some());
        eprintln!("{}: {} frames, {line}", assembled.shown, frames.len());
    }
    Ok(Some(if is_in_place { ExitCode::SUCCESS } else { ExitCode::from(1) }))
}

/// The SHA-256 of a file that is this picture already, whole: its receipt is that of the picture,
/// with all samples.
fn hash_of_whole(file: &Path, receipt: &Receipt, settings: &Settings) -> Option<String> {
    let picture = read_layers(&Input::open(file, &ReadOptions::default()).ok()?).ok()?;
    let (_, text) = picture.metadata.iter().find(|(key, _)| key == Receipt::KEY)?;
    let found = Receipt::parse(text).ok()?;
    // Pixels that stop by their error have fewer samples.
    let is_complete = settings.noise.is_some() || found.samples[0] >= settings.spp;
    (is_complete && found.is_of_same_picture(receipt))
        .then(|| output::sha256_of_file(file).ok())
        .flatten()
}

/// The result of a frame.
struct Taken {
    /// SHA-256 of the frame's file; `None` if the file is in a fallback place.
    sha256: Option<String>,
    line: String,
    statistics: Value,
}

/// Renders one frame; `None` if it was interrupted and not written.
fn render_one(
    session: &mut Session,
    stage: &mut Stage,
    frame: &Frame,
    file: &Path,
) -> Result<Option<Taken>, Failure> {
    let settings =
        session.options.settings(&stage.scene, &stage.camera(session.options)?, session.simd)?;
    if !session.has_begun {
        session.estimated_memory_bytes = memory::check(session.options, &settings, &stage.scene)?;
    }
    let shot = shot(stage, frame, session.options, &settings.build)?;
    let reuse = shot.compiled.world.stats().reuse;
    let (pose, build) = (shot.pose_seconds, shot.build_seconds);
    let outcome = session.take(&stage.scene, shot, Target::File(file))?;
    let Outcome { compiled, fate, mut statistics, render_seconds, .. } = outcome;
    stage.keep(compiled);
    let sha256 = match fate {
        Fate::Written(sha256) => Some(sha256),
        Fate::Elsewhere => None,
        Fate::Nothing | Fate::Partial | Fate::Noisy => return Ok(None),
    };
    if let Value::Object(map) = &mut statistics {
        map.insert("frame".into(), json!(frame.number));
        map.insert("time".into(), json!(frame.time));
        map.insert("pose_seconds".into(), json!(pose));
        map.insert(
            "structures".into(),
            json!({ "kept": reuse.kept, "refitted": reuse.refitted, "built": reuse.built }),
        );
    }
    let line = match session.merged {
        Some(_) => format!("merged {}", duration(render_seconds)),
        None => format!(
            "posed {}, built {}, rendered {}",
            duration(pose),
            duration(build),
            duration(render_seconds)
        ),
    };
    Ok(Some(Taken { sha256, line, statistics }))
}

/// Times, summed over all frames.
struct Totals {
    seconds: f64,
    pose: f64,
    build: f64,
    render: f64,
}

impl Totals {
    fn of(statistics: &[Value], seconds: f64) -> Self {
        let sum = |key: &str| statistics.iter().filter_map(|s| s[key].as_f64()).sum();
        Self {
            seconds,
            pose: sum("pose_seconds"),
            build: sum("build_seconds"),
            render: sum("render_seconds"),
        }
    }

    fn share(&self, of: f64) -> f64 {
        of / self.seconds.max(1e-9)
    }

    fn json(&self, statistics: &[Value], rate: f64) -> Value {
        json!({
            "frames": statistics,
            "frames_per_second": rate,
            "seconds": self.seconds,
            "pose_share": self.share(self.pose),
            "build_share": self.share(self.build),
            "render_share": self.share(self.render),
        })
    }

    fn line(&self, made: usize, is_merge: bool) -> String {
        if made == 0 {
            return "all of which existed already".into();
        }
        let time = duration(self.seconds / made as f64);
        if is_merge {
            return format!("{made} merged, {time} each");
        }
        format!(
            "{time} a frame ({:.1} % posing, {:.1} % building and refitting, {:.1} % rendering)",
            100.0 * self.share(self.pose),
            100.0 * self.share(self.build),
            100.0 * self.share(self.render),
        )
    }
}

/// The result of assembling the frames.
struct Assembled {
    shown: String,
    is_in_place: bool,
}

/// Makes an animated picture of the frames, if requested.
fn assemble(
    place: &Place,
    files: &BTreeMap<i64, PathBuf>,
    rate: f64,
) -> Result<Assembled, Failure> {
    let files: Vec<&Path> = files.values().map(PathBuf::as_path).collect();
    let Some((format, target)) = &place.animated else {
        let ends = [files.first(), files.last()]
            .map(|file| file.map_or(String::new(), |f| f.display().to_string()));
        return Ok(Assembled { shown: ends.join(" to "), is_in_place: true });
    };
    let (shown, written) = match target {
        Some(path) => {
            let encode = |out: &mut dyn Write| {
                encode(*format, out, &files, rate).map_err(|e| std::io::Error::other(e.to_string()))
            };
            (path.display().to_string(), rescue::write(path, "the picture", &encode))
        }
        None => {
            let out = std::io::BufWriter::new(std::io::stdout().lock());
            ("standard output".into(), encode(*format, out, &files, rate).map(|()| true))
        }
    };
    if !matches!(written, Ok(true)) {
        let folder = place.folder.display();
        eprintln!(
            "the frames are in {folder}; the same command with --resume makes the animated picture"
        );
    }
    Ok(Assembled { shown, is_in_place: written? })
}

fn encode(
    format: AnimatedFormat,
    out: impl Write,
    files: &[&Path],
    rate: f64,
) -> Result<(), Failure> {
    let failed = |problem: String| {
        Failure::Other(format!("the animated picture cannot be written: {problem}"))
    };
    let first = read(files[0])?;
    let mut writer =
        AnimatedWriter::new(format, out, &first, rate, files.len() as u32).map_err(failed)?;
    for &file in files {
        writer.add(&read(file)?).map_err(failed)?;
    }
    writer.finish().map_err(failed)
}

/// Reads a file that Snell has written, which may have been replaced by a pipe.
fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    open::read(path, NamedBy::File, u64::MAX - 1)
        .map_err(|e| Failure::Other(format!("{}: {e}", path.display())))
}

fn io(path: &Path, error: std::io::Error) -> Failure {
    Failure::Other(format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_named_by_their_numbers() {
        let place = |name: &str| {
            Place::of(Some(Path::new(name)), "scene".as_ref()).expect("a possible name")
        };
        assert_eq!(place("a/walk.png").file(7), Path::new("a/walk.0007.png"));
        assert_eq!(place("walk_###.exr").file(7), Path::new("./walk_007.exr"));
        assert_eq!(place("walk.png").file(-12), Path::new("./walk.-0012.png"));
        assert_eq!(place("x/walk.GIF").file(1), Path::new("x/walk.GIF.frames/0001.png"));
        assert_eq!(place("walk.png").memory(), Path::new("./walk.resume"));
        assert!(Place::of(Some(Path::new("#a#.png")), "scene".as_ref()).is_err());
    }
}
