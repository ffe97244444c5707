//! Many pictures of one scene: the frames of an animation or of a turntable, as numbered files or as one animated picture.
//!
//! Each frame appears whole or not at all. While not all are there, a file beside them remembers how they are made, so that `--resume`
//! renders only those that are missing.

use super::options::Options;
use super::stage::Stage;
use super::{Outcome, Session, memory};
use crate::failure::Failure;
use crate::progress::duration;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use snell_formats::image::{AnimatedFormat, AnimatedWriter};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Most frames of one command.
const MOST: f64 = 1e6;

/// Frames a second of a turntable, unless it says.
const TURNTABLE_RATE: f64 = 24.0;
/// Most frames of a turn.
const MOST_OF_TURN: f64 = 100_000.0;

/// What `--frames` says: from a time until just before another, so many in a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRange {
    /// Seconds; the start of the animation if it is not said.
    pub start: Option<f64>,
    /// Seconds; the end of the animation if it is not said.
    pub end: Option<f64>,
    /// Frames a second.
    pub rate: f64,
}

/// What `--turntable` says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turntable {
    /// Frames of a whole turn.
    pub count: u32,
    /// Frames a second of an animated picture.
    pub rate: f64,
}

/// One frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Frame {
    /// In names: the time in frames, so that parts of an animation that are rendered apart fit together.
    number: i64,
    time: f64,
    /// Share of a whole turn.
    turn: f64,
}

/// Reads `0..2s@24`, `0.5..@30`, `@24`.
pub fn parse_frames(text: &str) -> Result<FrameRange, String> {
    let error = || format!("\"{text}\" is not a range of frames; write START..END@RATE in seconds, such as 0..2s@24");
    let (range, rate) = text.split_once('@').ok_or_else(error)?;
    let rate = possible_rate(rate.trim().parse().map_err(|_| error())?)?;
    let seconds = |text: &str| match text.trim().trim_end_matches('s') {
        "" => Ok(None),
        number => match number.parse::<f64>().map_err(|_| error())? {
            time if time.abs() <= 1e6 => Ok(Some(time)),
            _ => Err(format!("{number} seconds are too many: times are from -1e6 to 1e6")),
        },
    };
    let (start, end) = if range.trim().is_empty() { ("", "") } else { range.split_once("..").ok_or_else(error)? };
    let (start, end) = (seconds(start)?, seconds(end)?);
    let is_empty = matches!((start, end), (Some(a), Some(b)) if a >= b);
    if is_empty { Err(error()) } else { Ok(FrameRange { start, end, rate }) }
}

/// Reads `48` or `48@24`.
pub fn parse_turntable(text: &str) -> Result<Turntable, String> {
    let error = || format!("\"{text}\" is not a number of frames; write N or N@RATE, such as 48@24");
    let (count, rate) = text.split_once('@').map_or((text, None), |(count, rate)| (count, Some(rate)));
    let count: f64 = count.trim().parse().map_err(|_| error())?;
    if count.fract() != 0.0 || !(1.0..=MOST_OF_TURN).contains(&count) {
        return Err(format!("{count} frames: a turn has 1 to {MOST_OF_TURN}"));
    }
    let rate = possible_rate(rate.map_or(Ok(TURNTABLE_RATE), |r| r.trim().parse()).map_err(|_| error())?)?;
    Ok(Turntable { count: count as u32, rate })
}

fn possible_rate(rate: f64) -> Result<f64, String> {
    if (0.001..=1000.0).contains(&rate) {
        return Ok(rate);
    }
    Err(format!("{rate} frames a second are not possible: rates are from 0.001 to 1000"))
}

/// Reads `0..0.02`.
pub fn parse_shutter(text: &str) -> Result<[f64; 2], String> {
    let error = || format!("\"{text}\" is not when a shutter opens and closes; write seconds as 0..0.02");
    let (open, close) = text.split_once("..").ok_or_else(error)?;
    let seconds = |text: &str| text.trim().trim_end_matches('s').parse().ok().filter(|t: &f64| t.abs() <= 1e6);
    let (open, close) = (seconds(open).ok_or_else(error)?, seconds(close).ok_or_else(error)?);
    if open <= close { Ok([open, close]) } else { Err(error()) }
}

/// The frames that the options ask for, and how many are shown in a second; `None` if they ask for one picture.
fn frames(options: &Options, stage: &Stage) -> Result<Option<(Vec<Frame>, f64)>, Failure> {
    if let Some(Turntable { count, rate }) = options.turntable {
        let time = options.at.unwrap_or_else(|| stage.usual_time());
        let frame = |i: u32| Frame { number: i.into(), time, turn: f64::from(i) / f64::from(count) };
        return Ok(Some(((0..count).map(frame).collect(), rate)));
    }
    let Some(FrameRange { start, end, rate }) = options.frames else { return Ok(None) };
    let [first, last] = stage.span();
    let (start, end) = (start.unwrap_or(first), end.unwrap_or(last));
    // A frame counts if it begins before the end, but for rounding.
    let count = ((end - start) * rate - 1e-6).ceil().max(1.0);
    if count > MOST || !count.is_finite() {
        return Err(Failure::Usage(format!("--frames asks for {count} frames; at most {MOST} are possible")));
    }
    let from = (start * rate).round() as i64;
    let frame = |i: i64| Frame { number: from + i, time: start + i as f64 / rate, turn: 0.0 };
    Ok(Some(((0..count as i64).map(frame).collect(), rate)))
}

/// Where frames go.
struct Place {
    folder: PathBuf,
    /// What comes before and after the number, and how many digits that has at least.
    before: String,
    after: String,
    digits: usize,
    /// The picture that they become, if they do: `None` is standard output.
    animated: Option<(AnimatedFormat, Option<PathBuf>)>,
}

impl Place {
    /// `walk.png` becomes `walk.0000.png`; `#` are digits where there are any. Frames of an animated picture wait in a folder beside it.
    fn of(output: Option<&Path>, stem: &str) -> Result<Self, Failure> {
        let path = output.map_or_else(|| PathBuf::from(format!("{stem}.png")), Path::to_path_buf);
        let waiting = |folder: PathBuf, format, target| Self {
            folder,
            before: String::new(),
            after: ".png".into(),
            digits: 4,
            animated: Some((format, target)),
        };
        if path == Path::new("-") {
            return Ok(waiting(PathBuf::from(format!("{stem}.frames")), AnimatedFormat::Y4m, None));
        }
        if let Some(format) = animated_format(&path) {
            let mut folder = path.clone().into_os_string();
            folder.push(".frames");
            return Ok(waiting(folder.into(), format, Some(path)));
        }
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_path_buf();
        let (before, after, digits) = match (name.find('#'), name.rfind('#')) {
            (Some(first), Some(last)) if name[first..=last].bytes().all(|b| b == b'#') => {
                (name[..first].to_string(), name[last + 1..].to_string(), last + 1 - first)
            }
            (Some(_), Some(_)) => {
                let problem = "the # that stand for the number must be next to each other";
                return Err(Failure::Usage(format!("{}: {problem}", path.display())));
            }
            _ => match name.rfind('.') {
                Some(dot) => (format!("{}.", &name[..dot]), name[dot..].to_string(), 4),
                None => (format!("{name}."), String::new(), 4),
            },
        };
        Ok(Self { folder, before, after, digits, animated: None })
    }

    /// The file of a frame.
    fn file(&self, number: i64) -> PathBuf {
        let (sign, digits) = (if number < 0 { "-" } else { "" }, self.digits);
        let name = format!("{}{sign}{:0digits$}{}", self.before, number.unsigned_abs(), self.after);
        self.folder.join(name)
    }

    /// The file that remembers which frames are there.
    fn memory(&self) -> PathBuf {
        self.folder.join(format!("{}resume", if self.before.is_empty() { "frames." } else { &self.before }))
    }
}

/// The format of animated pictures that a file's name asks for.
pub fn animated_format(path: &Path) -> Option<AnimatedFormat> {
    AnimatedFormat::of_extension(&path.extension()?.to_string_lossy())
}

/// True if frames become one animated picture, a file or a stream.
pub fn is_animated(options: &Options) -> bool {
    options.output.as_deref().is_some_and(|path| path == Path::new("-") || animated_format(path).is_some())
}

/// How all frames are made, in few letters: frames of one fingerprint belong together.
fn fingerprint(options: &Options, stage: &Stage, rate: f64) -> String {
    let scene = std::fs::metadata(&options.scene).ok();
    let changed = scene.as_ref().map(|m| (m.len(), m.modified().ok()));
    let neutral = Options {
        output: None,
        threads: None,
        quiet: false,
        verbose: false,
        stats: None,
        resume: false,
        frames: None,
        progress: Default::default(),
        ..options.clone()
    };
    let text = format!("{} {rate} {:?} {changed:?} {neutral:?}", env!("CARGO_PKG_VERSION"), stage.span());
    Sha256::digest(text).iter().map(|b| format!("{b:02x}")).collect()
}

/// What is known of frames while not all of them are there: a file whose first line says how they are made, and whose others are the
/// numbers of those that are there.
struct Memory {
    path: PathBuf,
    fingerprint: String,
    done: BTreeSet<i64>,
}

impl Memory {
    fn open(place: &Place, fingerprint: String, options: &Options) -> Result<Self, Failure> {
        let path = place.memory();
        let known = std::fs::read_to_string(&path).ok();
        let mut lines = known.as_deref().unwrap_or("").lines();
        let goes_on = options.resume && lines.next() == Some(&fingerprint);
        let done = if goes_on { lines.filter_map(|line| line.parse().ok()).collect() } else { BTreeSet::new() };
        if options.resume && !goes_on && !options.quiet {
            let why = if known.is_some() { "the others were made in another way" } else { "nothing was interrupted" };
            eprintln!("warning: all frames are rendered, because {why}");
        }
        let memory = Self { path, fingerprint, done };
        memory.write()?;
        Ok(memory)
    }

    fn add(&mut self, number: i64) -> Result<(), Failure> {
        self.done.insert(number);
        self.write()
    }

    fn write(&self) -> Result<(), Failure> {
        let numbers: String = self.done.iter().map(|number| format!("{number}\n")).collect();
        Ok(snell_formats::atomic::write(&self.path, format!("{}\n{numbers}", self.fingerprint).as_bytes())?)
    }

    fn forget(self) {
        let _ = std::fs::remove_file(self.path);
    }
}

/// Renders all frames that the options ask for; `None` if they ask for one picture.
pub fn render(session: &mut Session, stage: &mut Stage) -> Result<Option<ExitCode>, Failure> {
    let options = session.options;
    let Some((frames, rate)) = frames(options, stage)? else { return Ok(None) };
    let place = Place::of(options.output.as_deref(), &session.stem)?;
    if place.animated.is_some() {
        std::fs::create_dir_all(&place.folder).map_err(|e| io(&place.folder, e))?;
    }
    let mut memory = Memory::open(&place, fingerprint(options, stage, rate), options)?;
    let start = Instant::now();
    let mut statistics = Vec::new();
    for (i, frame) in frames.iter().enumerate() {
        let file = place.file(frame.number);
        if memory.done.contains(&frame.number) && file.exists() {
            continue;
        }
        let taken = render_one(session, stage, frame, &file)?;
        let Some(taken) = taken else {
            eprintln!(
                "interrupted: {} frames of {} are there; the same command with --resume renders the rest",
                memory.done.len(),
                frames.len()
            );
            return Ok(Some(ExitCode::from(130)));
        };
        memory.add(frame.number)?;
        if !options.quiet {
            eprintln!("frame {} of {}: {}, {}", i + 1, frames.len(), file.display(), taken.line);
        }
        statistics.push(taken.statistics);
    }
    let shown = assemble(&place, &frames, rate)?;
    memory.forget();
    let all = Totals::of(&statistics, start.elapsed().as_secs_f64());
    if let Some(path) = &options.stats {
        let text =
            serde_json::to_string_pretty(&all.json(&statistics, rate)).map_err(|e| Failure::Other(e.to_string()))?;
        snell_formats::atomic::write(path, (text + "\n").as_bytes())?;
    }
    if !options.quiet {
        eprintln!("{shown}: {} frames, {}", frames.len(), all.line(statistics.len()));
    }
    Ok(Some(ExitCode::SUCCESS))
}

/// What became of a frame.
struct Taken {
    line: String,
    statistics: Value,
}

/// Renders one frame; `None` if it was interrupted, and so is not there.
fn render_one(session: &mut Session, stage: &mut Stage, frame: &Frame, file: &Path) -> Result<Option<Taken>, Failure> {
    let settings = session.options.settings(&stage.scene, &stage.camera(session.options)?, session.simd)?;
    if !session.has_begun {
        session.estimated_memory_bytes = memory::check(session.options, &settings, &stage.scene)?;
    }
    let mut shot = stage.shot(frame.time, session.options, &settings.build)?;
    if frame.turn > 0.0 {
        stage.turn(&mut shot, frame.turn);
    }
    let reuse = shot.compiled.world.stats().reuse;
    let (pose, build) = (shot.pose_seconds, shot.build_seconds);
    let outcome = session.take(&stage.scene, shot, Some(file))?;
    let Outcome { compiled, is_complete, mut statistics, render_seconds, .. } = outcome;
    stage.keep(compiled);
    if !is_complete {
        return Ok(None);
    }
    if let Value::Object(map) = &mut statistics {
        map.insert("frame".into(), json!(frame.number));
        map.insert("time".into(), json!(frame.time));
        map.insert("pose_seconds".into(), json!(pose));
        map.insert(
            "structures".into(),
            json!({ "kept": reuse.kept, "refitted": reuse.refitted, "built": reuse.built }),
        );
    }
    let line = format!("posed {}, built {}, rendered {}", duration(pose), duration(build), duration(render_seconds));
    Ok(Some(Taken { line, statistics }))
}

/// Where the time of all frames went.
struct Totals {
    seconds: f64,
    pose: f64,
    build: f64,
    render: f64,
}

impl Totals {
    fn of(statistics: &[Value], seconds: f64) -> Self {
        let sum = |key: &str| statistics.iter().filter_map(|s| s[key].as_f64()).sum();
        Self { seconds, pose: sum("pose_seconds"), build: sum("build_seconds"), render: sum("render_seconds") }
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

    fn line(&self, rendered: usize) -> String {
        if rendered == 0 {
            return "all of which were there".into();
        }
        format!(
            "{} a frame ({:.1} % posing, {:.1} % building and refitting, {:.1} % rendering)",
            duration(self.seconds / rendered as f64),
            100.0 * self.share(self.pose),
            100.0 * self.share(self.build),
            100.0 * self.share(self.render),
        )
    }
}

/// Makes an animated picture of the frames, if that was asked for; gives what to call the result.
fn assemble(place: &Place, frames: &[Frame], rate: f64) -> Result<String, Failure> {
    let files: Vec<PathBuf> = frames.iter().map(|f| place.file(f.number)).collect();
    let (Some(first), Some(last)) = (files.first(), files.last()) else { return Ok(String::new()) };
    let Some((format, target)) = &place.animated else {
        return Ok(format!("{} to {}", first.display(), last.display()));
    };
    let shown = match target {
        Some(path) => {
            snell_formats::atomic::write_with(path, |out| {
                encode(*format, out, &files, rate).map_err(|e| std::io::Error::other(e.to_string()))
            })?;
            path.display().to_string()
        }
        None => {
            encode(*format, std::io::BufWriter::new(std::io::stdout().lock()), &files, rate)?;
            "standard output".into()
        }
    };
    let _ = std::fs::remove_dir_all(&place.folder);
    Ok(shown)
}

fn encode(format: AnimatedFormat, out: impl Write, files: &[PathBuf], rate: f64) -> Result<(), Failure> {
    let read = |file: &PathBuf| std::fs::read(file).map_err(|e| io(file, e));
    let failed = |problem: String| Failure::Other(format!("the animated picture cannot be written: {problem}"));
    let first = read(&files[0])?;
    let mut writer = AnimatedWriter::new(format, out, &first, rate, files.len() as u32).map_err(failed)?;
    for file in files {
        writer.add(&read(file)?).map_err(failed)?;
    }
    writer.finish().map_err(failed)
}

fn io(path: &Path, error: std::io::Error) -> Failure {
    Failure::Other(format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_turns_and_shutters_are_understood() {
        let range = |start, end, rate| Ok(FrameRange { start, end, rate });
        assert_eq!(parse_frames("0..2s@24"), range(Some(0.0), Some(2.0), 24.0));
        assert_eq!(parse_frames(" 0.5 .. @ 12.5"), range(Some(0.5), None, 12.5));
        assert_eq!(parse_frames("@30"), range(None, None, 30.0));
        for wrong in ["", "24", "2..1@24", "0..2@0", "0..x@24", "nan..1@24", "0..2@24fps"] {
            assert!(parse_frames(wrong).is_err(), "{wrong}");
        }
        assert_eq!(parse_turntable("48@25"), Ok(Turntable { count: 48, rate: 25.0 }));
        assert!(parse_turntable("0").is_err() && parse_turntable("8@no").is_err());
        assert_eq!(parse_shutter("-0.01..0.01s"), Ok([-0.01, 0.01]));
        assert!(parse_shutter("0.1").is_err() && parse_shutter("1..0").is_err());
    }

    #[test]
    fn frames_are_named_by_their_numbers() {
        let place = |name: &str| Place::of(Some(Path::new(name)), "scene").expect("a possible name");
        assert_eq!(place("a/walk.png").file(7), Path::new("a/walk.0007.png"));
        assert_eq!(place("walk_###.exr").file(7), Path::new("./walk_007.exr"));
        assert_eq!(place("walk.png").file(-12), Path::new("./walk.-0012.png"));
        assert_eq!(place("x/walk.GIF").file(1), Path::new("x/walk.GIF.frames/0001.png"));
        assert_eq!(place("walk.png").memory(), Path::new("./walk.resume"));
        assert!(Place::of(Some(Path::new("#a#.png")), "scene").is_err());
    }
}
