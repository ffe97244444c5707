//! Damaged files and odd options, given to the real program until the time is over: five seconds as
//! an ordinary test, longer with `cargo xtask fuzz-smoke`. A case is a function of the seed and its
//! number. Cases that break a promise are minimised and saved in `target/fuzz-smoke/`, with the
//! command that reproduces them.

use super::mutate::Random;
use super::promise::{Case, write_files};
use super::subjects::{Kind, Subject, subjects};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Renders; `FILE` is the damaged one.
const RENDER: &str = "render FILE --size 8x6 --spp 1 -q -o out.pfm";
const RENDER_IN_LIGHT: &str = "render minray --environment FILE --size 8x6 --spp 1 -q -o out.pfm";
/// Options; half of the renders get some of these.
const RENDER_OPTIONS: [&str; 31] = [
    "-i flat",
    "-i raycast",
    "-i whitted",
    "-i direct",
    "-i ao",
    "-i path",
    "--color spectral",
    "--accelerator none",
    "--accelerator graph",
    "--accelerator spheres",
    "--accelerator grid",
    "--accelerator octree",
    "--accelerator octree-hierarchical",
    "--accelerator bsp",
    "--accelerator kdtree",
    "--quality fast",
    "--quality high",
    "--bvh-compact",
    "--sampler stratified",
    "--sampler independent",
    "--filter mitchell",
    "--light-samples bsdf",
    "--light-sampler uniform",
    "--guiding=1",
    "--caustics on --photons 500",
    "--environment sky",
    "--shadows soft",
    "--terminator faceted",
    "--camera 1",
    "--aov all -o out.exr",
    "--noise 0.1 --variance -o out.exr",
];
/// Other commands for a scene.
const COMMANDS: [&str; 22] = [
    "info FILE",
    "info FILE --json",
    "info FILE --nodes 3",
    "doctor FILE",
    "doctor FILE --json",
    "explain FILE --pixel 4,3 -- --size 8x6 --spp 1",
    "explain FILE --pixel 4,3 --json -- --size 8x6 --spp 2",
    "explain FILE --pixel 0,5 --svg out.svg -- --size 8x6 --spp 1 -i whitted",
    "convert FILE out.snell",
    "convert FILE out.gltf",
    "convert FILE out.glb",
    "convert FILE out.pbrt",
    "convert FILE out.obj",
    "convert FILE out.ply",
    "convert FILE out.stl",
    "convert FILE out.off",
    "convert FILE out.snell --force --json",
    "convert FILE out.glb --force",
    "convert FILE out.pbrt --force",
    "convert FILE out.obj --force",
    "convert FILE out.ply --force --json",
    "convert FILE out.stl --force",
];
const PICTURE_COMMANDS: [&str; 3] =
    ["compare FILE FILE", "compare FILE FILE --json --max-flip 1", "compare FILE FILE -o out.png"];
/// Options with odd values, for a valid scene.
const VALUED: [&str; 25] = [
    "--exposure",
    "--bits",
    "--noise",
    "--max-depth",
    "--roulette-depth",
    "--seed",
    "--clamp",
    "--ao-distance",
    "--camera",
    "--size",
    "--crop",
    "--light-group",
    "--aov",
    "--integrator",
    "--sampler",
    "--filter",
    "--tonemap",
    "--display",
    "--guiding",
    "--variant",
    "--scene",
    "--environment",
    "-D",
    "--light-samples",
    "--frames",
];
const VALUES: [&str; 24] = [
    "0",
    "-1",
    "1e38",
    "1e999",
    "nan",
    "-inf",
    "4294967296",
    "18446744073709551616",
    "",
    ",",
    "=",
    "a=",
    "8x",
    "0x0",
    "1x1",
    "4,3,2,1",
    "0,0,99999,1",
    "../x",
    "sky",
    "all",
    "depth,depth",
    "camera.0.fov=nan",
    "material.*.reflectance=1e38",
    "\u{1b}[31m",
];

/// The commands that are tested.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Only {
    All,
    Render,
    Commands,
}

/// The settings from the environment.
struct Plan {
    program: PathBuf,
    time: Duration,
    seed: u32,
    only: Only,
}

impl Plan {
    fn of_the_environment() -> Self {
        let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
        let number = |name: &str, otherwise: u32| {
            variable(name).map_or(otherwise, |n| {
                n.parse().unwrap_or_else(|_| panic!("{name} is a whole number"))
            })
        };
        let only = match variable("SNELL_FUZZ_ONLY").as_deref() {
            None => Only::All,
            Some("render") => Only::Render,
            Some("commands") => Only::Commands,
            Some(other) => panic!("--only is render or commands, not {other}"),
        };
        let program = variable("SNELL_FUZZ_PROGRAM")
            .map_or(env!("CARGO_BIN_EXE_snell").into(), PathBuf::from);
        let time = Duration::from_secs(number("SNELL_FUZZ_SECONDS", 5).into());
        Self { program, time, seed: number("SNELL_FUZZ_SEED", 0), only }
    }

    /// The case of this number.
    fn case(&self, subjects: &[Subject], number: u32) -> Case {
        let mut random = Random::new([number, self.seed]);
        // The other file is often of the same kind, in which its words have a meaning.
        let other = random.choose(subjects);
        let subject = random.choose(subjects);
        let same_kind: Vec<_> = subjects
            .iter()
            .filter(|s| extension(&s.damaged) == extension(&subject.damaged))
            .collect();
        let other = if random.below(3) > 0 { random.choose(&same_kind) } else { other };
        let is_render = match self.only {
            Only::All => random.below(2) == 0,
            only => only == Only::Render,
        };
        if self.only != Only::Render && random.below(25) == 0 {
            return odd_options(&mut random);
        }
        let mut line = match (subject.kind, is_render) {
            (Kind::Scene, true) => RENDER.to_string(),
            (Kind::Picture, true) => RENDER_IN_LIGHT.to_string(),
            (Kind::Scene, false) => random.choose(&COMMANDS).to_string(),
            (Kind::Picture, false) => random.choose(&PICTURE_COMMANDS).to_string(),
        };
        if is_render {
            line += if random.below(4) == 0 { " -t 2" } else { " -t 1" };
            if random.below(2) == 0 {
                let option = random.choose(&RENDER_OPTIONS);
                line = if option.contains(" -o ") { line.replace(" -o out.pfm", "") } else { line }
                    + " "
                    + option;
            }
        }
        subject.damaged_case(&line, other, &mut random)
    }
}

fn extension(name: &str) -> &str {
    name.rsplit('.').next().unwrap_or(name)
}

/// A valid scene with an odd value of one or two options.
fn odd_options(random: &mut Random) -> Case {
    let mut case =
        Case::new(BTreeMap::new(), "", "render minray --spp 1 -q -t 1 --size 8x6 -o out.pfm");
    for _ in 0..1 + random.below(2) {
        let option = random.choose(&VALUED);
        if *option == "--size" {
            case.words.retain(|w| w != "--size" && w != "8x6");
        }
        case.words.push(format!("{option}={}", random.choose(&VALUES)).replace("-D=", "-D"));
    }
    if case.words.iter().any(|w| w.starts_with("--frames")) {
        case.writes = None;
    }
    case
}

/// The results so far.
#[derive(Default)]
struct Tally {
    done: u32,
    refused: u32,
    /// The findings by kind of fault: their number, and the number and text of the first case.
    findings: BTreeMap<String, (u32, u32, String)>,
}

/// A fault without the parts that differ among cases.
fn kind_of(fault: &str) -> String {
    if let Some((_, place)) = fault.split_once("panicked at ") {
        return format!("panics at {place}");
    }
    let mut is_quoted = false;
    let kept = fault.chars().filter(|c| {
        is_quoted ^= *c == '"';
        !is_quoted && !c.is_ascii_digit()
    });
    kept.take(120).collect()
}

/// Removes parts of the damaged files as long as the case fails in the same way, within a time
/// limit.
fn minimised(mut case: Case, kind: &str, program: &Path, scratch: &Path) -> Case {
    let end = Instant::now() + Duration::from_secs(20);
    let fails =
        |case: &Case| case.try_in(program, scratch).is_err_and(|fault| kind_of(&fault) == kind);
    for name in case.files.keys().cloned().collect::<Vec<_>>() {
        let mut size = case.files[&name].len() / 2;
        while size > 0 {
            let mut at = 0;
            while at < case.files[&name].len() && Instant::now() < end {
                let mut smaller = case.clone();
                smaller.files.entry(name.clone()).and_modify(|bytes| {
                    bytes.drain(at..(at + size).min(bytes.len()));
                });
                if fails(&smaller) { case = smaller } else { at += size }
            }
            size /= 2;
        }
    }
    case
}

fn save(case: &Case, fault: &str, program: &Path, name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/fuzz-smoke").join(name);
    _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("target is writable");
    write_files(&folder, &case.files);
    let text = format!("# {fault}\n{}\n", case.command_line(program));
    std::fs::write(folder.join("repeat.sh"), text).expect("target is writable");
    folder.canonicalize().unwrap_or(folder)
}

#[test]
fn whatever_the_files_are_the_program_keeps_its_promises() {
    let plan = Plan::of_the_environment();
    let scratch = tempfile::TempDir::new().expect("temporary folders can be made");
    let mut subjects = subjects();
    let all = subjects.len();
    // Files that cannot be read undamaged are left out: only their first lines would be tested.
    // Some files of the collection need other files that are not beside them here.
    subjects.retain(|subject| {
        let line = if subject.kind == Kind::Scene { RENDER } else { RENDER_IN_LIGHT };
        let end = subject.case(line).try_in(&plan.program, scratch.path());
        let is_done = end
            .unwrap_or_else(|fault| panic!("{} (with {}): {fault}", subject.name, subject.damaged));
        if !is_done {
            eprintln!(
                "left out: {} (with {}), which is refused as it is",
                subject.name, subject.damaged
            );
        }
        is_done
    });
    assert!(subjects.len() * 10 > all * 9, "only {} of {all} subjects are good", subjects.len());

    let (next, tally, start) = (AtomicU32::new(0), Mutex::new(Tally::default()), Instant::now());
    let work = || {
        let scratch = tempfile::TempDir::new().expect("temporary folders can be made");
        while start.elapsed() < plan.time {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let case = plan.case(&subjects, number);
            let end = case.try_in(&plan.program, scratch.path());
            let mut known = tally.lock().expect("no worker panics");
            match end {
                Ok(true) => known.done += 1,
                Ok(false) => known.refused += 1,
                Err(fault) => {
                    let kind = kind_of(&fault);
                    let (count, _, _) = known
                        .findings
                        .entry(kind.clone())
                        .or_insert_with(|| (0, number, fault.clone()));
                    *count += 1;
                    let is_new = *count == 1;
                    drop(known);
                    if is_new {
                        let case = minimised(case, &kind, &plan.program, scratch.path());
                        let folder =
                            save(&case, &fault, &plan.program, &format!("{}-{number}", plan.seed));
                        eprintln!("finding: {fault}\n    {}", folder.display());
                    }
                }
            }
        }
    };
    std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get().min(8));
        (0..threads).for_each(|_| drop(scope.spawn(work)));
    });

    let tally = tally.into_inner().expect("no worker panics");
    let executions = tally.done + tally.refused + tally.findings.values().map(|f| f.0).sum::<u32>();
    println!(
        "fuzz-smoke: {executions} executions in {} s from seed {} ({} subjects): {} done, {} \
            refused, {} findings",
        start.elapsed().as_secs(),
        plan.seed,
        subjects.len(),
        tally.done,
        tally.refused,
        tally.findings.len()
    );
    let list: Vec<_> = tally
        .findings
        .values()
        .map(|(n, number, fault)| format!("{number}: {fault} ({n} times)"))
        .collect();
    assert!(list.is_empty(), "{list:#?}");
    assert!(
        tally.done * 20 > executions,
        "only {} of {executions} got past the first lines",
        tally.done
    );
}
