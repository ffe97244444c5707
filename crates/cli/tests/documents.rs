//! The documents are correct: every command in them runs, every option and name is in them, every
//! file they name exists.
//!
//! Commands are the lines of blocks marked `sh`, and the lines after `$ ` in blocks marked
//! `console` (the lines that follow are the expected standard output, compared line by line). Each
//! document gets a fresh folder with a copy of `scenes/`; its commands run there in order, so later
//! ones may use the files of earlier ones.
//!
//! To be fast, `snell render` is made small: its size becomes 16x12 (unless it has `--crop`), its
//! samples per pixel 1, its time limit 1s, its threads 1; `snell bench` measures once, with the
//! rays of a small picture. Nothing else is changed. `cargo run --release -- ARGUMENTS` runs the
//! same program; of `cargo xtask WORD` only the word is checked (this test is part of `cargo xtask
//! test`); the other commands allowed are in [`NOT_RUN`].

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Beginnings of commands that a document may show but that are not run here: they would build the
/// program during its own test, need the network, or never end.
const NOT_RUN: &[&str] = &[
    "cd ",
    "git clone ",
    "cargo build",
    "cargo test",
    "cargo install --path crates/cli",
    "cargo doc",
    "pip install ",
    "python3 -m http.server",
];

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All documents: Markdown in the top folder and below `docs`.
fn documents() -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![repository().join("docs")];
    let top = std::fs::read_dir(repository()).expect("the repository is readable");
    found.extend(
        top.map(|e| e.expect("an entry").path())
            .filter(|p| p.extension().is_some_and(|e| e == "md")),
    );
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("docs is readable") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                found.push(path);
            }
        }
    }
    found.sort();
    assert!(found.len() >= 9, "documents are missing: {found:?}");
    found
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A command of a document.
#[derive(Debug)]
struct Step {
    line: usize,
    command: String,
    /// Expected standard output; empty if the document does not show any.
    output: String,
}

/// The commands of a document, in order.
fn steps(text: &str) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    let mut block: Option<String> = None;
    let mut continued = false;
    for (number, line) in text.lines().enumerate() {
        if let Some(fence) = line.trim_start().strip_prefix("```") {
            block = if block.is_some() { None } else { Some(fence.trim().to_string()) };
            continued = false;
            continue;
        }
        let console = block.as_deref() == Some("console");
        if !console && block.as_deref() != Some("sh") {
            continue;
        }
        let (text, is_command) = match line.strip_prefix("$ ") {
            Some(rest) if console => (rest, true),
            _ => (line, !console),
        };
        if continued || is_command {
            let part = text.split(" # ").next().unwrap_or(text).trim();
            let (part, more) =
                part.strip_suffix('\\').map_or((part, false), |p| (p.trim_end(), true));
            if part.is_empty() || part.starts_with('#') {
                continue;
            }
            match steps.last_mut() {
                Some(last) if continued => last.command += &format!(" {part}"),
                _ => steps.push(Step {
                    line: number + 1,
                    command: part.into(),
                    output: String::new(),
                }),
            }
            continued = more;
        } else if let Some(last) = steps.last_mut() {
            last.output += &format!("{}\n", line.trim_end());
        }
    }
    steps
}

/// Words of a command line; single and double quotes group words.
fn words(command: &str) -> Vec<String> {
    let (mut words, mut word, mut quote, mut any) = (Vec::new(), String::new(), None, false);
    for c in command.chars() {
        match (quote, c) {
            (Some(q), _) if c == q => quote = None,
            (None, '\'' | '"') => (quote, any) = (Some(c), true),
            (None, ' ') => {
                if any || !word.is_empty() {
                    words.push(std::mem::take(&mut word));
                }
                any = false;
            }
            _ => word.push(c),
        }
    }
    assert!(quote.is_none(), "a quote is open: {command}");
    if any || !word.is_empty() {
        words.push(word);
    }
    words
}

/// Makes `snell render` and `snell bench` fast, as described at the top of this file.
fn make_small(arguments: &mut Vec<String>) {
    if let Some("bench") = arguments.first().map(String::as_str)
        && !arguments.iter().any(|w| w == "--help")
    {
        let value = |name: &str| if name == "--side" { "16" } else { "1" };
        for name in ["--side", "--repeat", "--spp"] {
            if let Some(at) = arguments.iter().position(|w| w == name) {
                arguments[at + 1] = value(name).to_string();
            }
        }
        return;
    }
    let is_render = arguments.first().is_some_and(|w| w == "render");
    if !is_render || arguments.iter().any(|w| w == "--help") {
        return;
    }
    let cropped = arguments.iter().any(|w| w.starts_with("--crop"));
    let small: &[(&[&str], &str, bool)] = &[
        (&["--size", "-s"], "16x12", !cropped),
        (&["--spp", "--samples"], "1", true),
        (&["--threads", "-t"], "1", true),
        (&["--time"], "1s", false),
    ];
    for (names, value, always) in small {
        if cropped && names.contains(&"--size") {
            continue;
        }
        match arguments.iter().position(|w| names.contains(&w.as_str())) {
            Some(at) => arguments[at + 1] = (*value).to_string(),
            None if *always => arguments.extend([names[0].to_string(), (*value).to_string()]),
            None => {}
        }
    }
}

/// Starts `snell view` and ends it when it has printed its address. It uses any free port, because
/// the document's may be in use.
fn view(folder: &Path, mut arguments: Vec<String>, place: &str) -> Vec<u8> {
    if let Some(at) = arguments.iter().position(|w| w == "--port") {
        arguments[at + 1] = "0".into();
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_snell"));
    command
        .arg("view")
        .arg("--no-open")
        .args(&arguments[1..])
        .current_dir(folder)
        .stdout(Stdio::piped());
    let mut child = command.spawn().unwrap_or_else(|e| panic!("{place}: {e}"));
    let mut line = String::new();
    let output = child.stdout.take().expect("standard output is piped");
    BufReader::new(output).read_line(&mut line).expect("text");
    child.kill().and_then(|()| child.wait()).expect("it can be ended");
    assert!(line.starts_with("http://127.0.0.1:"), "{place}: {arguments:?} printed {line:?}");
    line.into_bytes()
}

/// The name of the first of the numbered pictures.
fn first_frame(path: &Path) -> PathBuf {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    path.with_extension(format!("0000.{extension}"))
}

/// Runs `snell` in a folder; returns standard output.
fn snell(folder: &Path, mut arguments: Vec<String>, place: &str) -> Vec<u8> {
    if arguments.first().is_some_and(|w| w == "view") && !arguments.iter().any(|w| w == "--help") {
        return view(folder, arguments, place);
    }
    make_small(&mut arguments);
    let mut command = Command::new(env!("CARGO_BIN_EXE_snell"));
    let run = command.args(&arguments).current_dir(folder).env_remove("SNELL_SIMD").output();
    let run = run.unwrap_or_else(|e| panic!("{place}: {e}"));
    let complaint = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{place}: {arguments:?} ended with {}\n{complaint}", run.status);
    for (i, word) in arguments.iter().enumerate() {
        if ["-o", "--output", "--stats"].contains(&word.as_str()) && arguments[i + 1] != "-" {
            let path = folder.join(&arguments[i + 1]);
            let is_plan = arguments[0] == "plan" && path.is_dir();
            let is_written = is_plan || path.is_file() || first_frame(&path).is_file();
            assert!(is_written, "{place}: {} was not written", arguments[i + 1]);
        }
    }
    run.stdout
}

fn run(folder: &Path, step: &Step, place: &str) {
    if NOT_RUN.iter().any(|start| step.command.starts_with(start)) {
        return;
    }
    if let Some(word) = step.command.strip_prefix("cargo xtask ") {
        let source = read(&repository().join("xtask/src/main.rs"));
        let word = word.split_whitespace().next().unwrap_or_default();
        assert!(
            source.contains(&format!("\"{word}\" =>")),
            "{place}: xtask does not know \"{word}\""
        );
        return;
    }
    let (command, into) =
        step.command.split_once(" > ").map_or((&*step.command, None), |(c, f)| (c, Some(f)));
    let arguments =
        command.strip_prefix("snell ").or_else(|| command.strip_prefix("cargo run --release -- "));
    let arguments = arguments
        .unwrap_or_else(|| panic!("{place}: this command is not allowed: {}", step.command));
    let output = snell(folder, words(arguments), place);
    if let Some(file) = into {
        std::fs::write(folder.join(file.trim()), output).expect("the folder is writable");
    } else if !step.output.trim().is_empty() {
        let output = String::from_utf8(output).expect("text");
        let tidy = |t: &str| {
            t.lines().map(str::trim_end).collect::<Vec<_>>().join("\n").trim().to_string()
        };
        assert_eq!(
            tidy(&output),
            tidy(&step.output),
            "{place}: the output is not what the document shows"
        );
    }
}

/// A fresh folder with the scenes of the repository.
fn fresh_folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("documents").join(name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder).expect("the folder of the last run can go");
    }
    std::fs::create_dir_all(folder.join("scenes")).expect("the folder can be made");
    for entry in std::fs::read_dir(repository().join("scenes")).expect("scenes is readable") {
        let entry = entry.expect("an entry");
        std::fs::copy(entry.path(), folder.join("scenes").join(entry.file_name()))
            .expect("a scene can be copied");
    }
    folder
}

#[test]
fn every_command_in_the_documents_runs() {
    let mut count = 0;
    for document in documents() {
        let name = document.strip_prefix(repository()).unwrap_or(&document);
        let name = name.display().to_string();
        let folder = fresh_folder(&name);
        for step in steps(&read(&document)) {
            run(&folder, &step, &format!("{name}:{}", step.line));
            count += 1;
        }
    }
    assert!(count >= 40, "only {count} commands were found");
}

#[test]
fn the_readme_has_the_command_to_render_and_the_command_to_test() {
    let commands: Vec<_> =
        steps(&read(&repository().join("README.md"))).into_iter().map(|s| s.command).collect();
    for wanted in ["cargo run --release -- render", "cargo xtask test"] {
        assert!(commands.iter().any(|c| c == wanted), "{wanted} is not in {commands:?}");
    }
    let folder = fresh_folder("render-without-arguments");
    snell(&folder, vec!["render".into()], "README");
    assert!(folder.join("cornell-box.png").is_file());
}

/// Words that look like long options.
fn long_options(text: &str) -> BTreeSet<String> {
    let is_part = |c: char| c.is_ascii_lowercase() || c == '-';
    let mut found = BTreeSet::new();
    for (at, _) in text.match_indices("--") {
        let starts = !text[..at].ends_with(|c: char| c == '-' || c.is_alphanumeric());
        let name: String = text[at + 2..].chars().take_while(|&c| is_part(c)).collect();
        if starts && name.starts_with(|c: char| c.is_ascii_lowercase()) {
            found.insert(format!("--{}", name.trim_end_matches('-')));
        }
    }
    found
}

/// The page about the command line, followed by the page of settings that it refers to.
fn page_of_commands() -> String {
    let folder = repository().join("docs/user");
    ["command-line.md", "settings.md"].map(|name| read(&folder.join(name))).concat()
}

#[test]
fn the_command_line_page_has_every_sub_command_and_option_and_no_other() {
    let page = page_of_commands();
    let folder = fresh_folder("options");
    let help = |arguments: &[&str]| {
        let arguments = arguments.iter().map(|a| a.to_string()).collect();
        String::from_utf8(snell(&folder, arguments, "help")).expect("text")
    };
    let mut known = BTreeSet::from(["--version".to_string()]);
    let listed = |arguments: &[&str]| -> Vec<String> {
        let text = help(arguments);
        let lines =
            text.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
        // Continuation lines of descriptions are indented further.
        let names = lines.filter_map(|l| l.strip_prefix("  ")).filter(|l| !l.starts_with(' '));
        names
            .filter_map(|l| l.split_whitespace().next())
            .filter(|c| *c != "help")
            .map(str::to_string)
            .collect()
    };
    let commands = listed(&["--help"]);
    assert!(commands.len() >= 8, "{commands:?}");
    for name in &commands {
        assert!(page.contains(&format!("\n## `snell {name}`")), "`snell {name}` has no section");
        known.extend(long_options(&help(&[name, "--help"])));
        for sub in listed(&[name, "--help"]) {
            assert!(
                page.contains(&format!("`snell {name} {sub}")),
                "`snell {name} {sub}` is not on the page"
            );
            known.extend(long_options(&help(&[name, &sub, "--help"])));
        }
    }
    assert_eq!(long_options(&page), known, "options of the page (left) and of the program (right)");
}

/// Words such as `snell render NAME` in running text are not complete commands; their sub-command
/// and options must exist.
#[test]
fn commands_in_running_text_exist() {
    let folder = fresh_folder("running-text");
    let mut count = 0;
    for document in documents() {
        let text = read(&document);
        // The prose is the text outside of blocks.
        let prose: String = text.split("```").step_by(2).collect();
        for span in prose.split('`').skip(1).step_by(2) {
            let place = format!("{}: `{span}`", document.display());
            if let Some(word) = span.strip_prefix("cargo xtask ") {
                for word in word.split('|') {
                    run(
                        &folder,
                        &Step {
                            line: 0,
                            command: format!("cargo xtask {word}"),
                            output: String::new(),
                        },
                        &place,
                    );
                }
            }
            let Some(arguments) = span.strip_prefix("snell ") else { continue };
            let is_word = |w: &&str| w.chars().all(|c| c.is_ascii_lowercase());
            let mut words: Vec<String> =
                arguments.split(' ').take(2).take_while(is_word).map(str::to_string).collect();
            if arguments.starts_with("COMMAND") {
                continue;
            }
            if words[0] != "bench" {
                words.truncate(1);
            }
            words.push("--help".into());
            let help = String::from_utf8(snell(&folder, words, &place)).expect("text");
            let unknown: Vec<_> =
                long_options(arguments).difference(&long_options(&help)).cloned().collect();
            assert!(unknown.is_empty(), "{place}: there are no {unknown:?}");
            count += 1;
        }
    }
    assert!(count >= 10, "only {count} commands were found");
}

#[test]
fn the_command_line_page_has_every_name() {
    use snell_intersect::AcceleratorKind;
    use snell_render::{
        Aov, Filter, IntegratorKind, LightSamplerKind, LightStrategy, SamplerKind, Shadows,
        Terminator,
    };
    let page = page_of_commands();
    // These names are in tables, which describe them.
    let tables = read(&repository().join("docs/user/command-line.md"));
    let described = IntegratorKind::ALL.map(IntegratorKind::name).into_iter();
    for name in described.chain(Aov::ALL.map(Aov::name)) {
        assert!(tables.contains(&format!("`{name}`")), "`{name}` is not in its table");
    }
    let mut names: Vec<&str> = Vec::new();
    names.extend(SamplerKind::ALL.map(SamplerKind::name));
    names.extend(Filter::ALL.iter().map(|f| f.name()));
    names.extend(LightSamplerKind::ALL.map(LightSamplerKind::name));
    names.extend(LightStrategy::ALL.map(LightStrategy::name));
    names.extend(Shadows::ALL.map(Shadows::name));
    names.extend(Terminator::ALL.map(Terminator::name));
    names.extend(AcceleratorKind::ALL.iter().map(|a| a.name()));
    names.extend(snell_formats::image::Tonemap::ALL.map(|t| t.name()));
    for name in names {
        assert!(page.contains(&format!("`{name}`")), "`{name}` is not on the page");
    }
}

#[test]
fn the_command_line_page_has_every_number_of_the_statistics() {
    let page = read(&repository().join("docs/user/command-line.md"));
    let folder = fresh_folder("statistics");
    let arguments = ["render", "--stats", "s.json", "-q"].map(String::from).to_vec();
    snell(&folder, arguments, "statistics");
    let statistics: serde_json::Value =
        serde_json::from_str(&read(&folder.join("s.json"))).expect("JSON");
    for key in statistics.as_object().expect("an object").keys() {
        assert!(page.contains(&format!("`{key}`")), "`{key}` is not on the page");
    }
}

#[test]
fn the_formats_page_has_every_format() {
    let page = read(&repository().join("docs/user/formats.md"));
    let extensions = snell_formats::SCENE_READERS.iter().flat_map(|r| r.extensions);
    let pictures = snell_formats::image::IMAGE_FORMATS.iter().flat_map(|f| f.extensions);
    for extension in extensions.chain(pictures) {
        assert!(page.contains(&format!("`.{extension}`")), "`.{extension}` is not on the page");
    }
}

#[test]
fn links_and_file_names_in_the_documents_lead_somewhere() {
    let folders = ["crates/", "docs/", "scenes/", "xtask/", "tests/"];
    let mut count = 0;
    for document in documents() {
        // Lines of this kind are for the site, which has further pages.
        let is_in_file = |line: &&str| !line.starts_with("<!-- site: ");
        let text = read(&document).lines().filter(is_in_file).collect::<Vec<_>>().join("\n");
        let base = document.parent().expect("a folder").to_path_buf();
        let links = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next());
        let links = links.filter(|l| !l.is_empty() && !l.contains("://")).map(|l| base.join(l));
        let files = text
            .split('`')
            .skip(1)
            .step_by(2)
            .filter(|word| folders.iter().any(|f| word.starts_with(f)));
        let files = files
            .filter(|word| !word.contains([' ', '*', '<', '…']))
            .map(|word| repository().join(word));
        for path in links.chain(files) {
            assert!(path.exists(), "{}: there is no {}", document.display(), path.display());
            count += 1;
        }
    }
    assert!(count >= 60, "only {count} names were found");
}

#[test]
fn the_tests_that_the_documents_name_are_there() {
    let mut sources = String::new();
    let mut folders = vec![repository().join("crates"), repository().join("tests")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                sources += &read(&path);
            }
        }
    }
    let mut count = 0;
    for name in [
        "docs/lecture.md",
        "docs/how-it-is-tested.md",
        "SECURITY.md",
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
    ] {
        let text = read(&repository().join(name));
        // Names of tests have at least four words.
        let is_test = |w: &&str| {
            w.matches('_').count() >= 3
                && w.chars().all(|c| c == '_' || c.is_ascii_lowercase() || c.is_ascii_digit())
        };
        for test in text.split('`').skip(1).step_by(2).filter(is_test) {
            assert!(sources.contains(&format!("fn {test}(")), "{name}: there is no test {test}");
            count += 1;
        }
    }
    assert!(count >= 20, "only {count} names were found");
}

#[test]
fn the_table_of_crates_has_every_direct_dependency() {
    let page = read(&repository().join("THIRD_PARTY.md"));
    let rows: Vec<&str> = page.lines().filter(|l| l.starts_with("| ")).collect();
    let mut manifests =
        vec![repository().join("xtask/Cargo.toml"), repository().join("tests/Cargo.toml")];
    for entry in std::fs::read_dir(repository().join("crates")).expect("a folder") {
        manifests.push(entry.expect("an entry").path().join("Cargo.toml"));
    }
    let mut count = 0;
    for manifest in manifests {
        let mut in_dependencies = false;
        for line in read(&manifest).lines() {
            if line.starts_with('[') {
                in_dependencies = line.trim_end_matches(']').ends_with("dependencies");
                continue;
            }
            let name: String =
                line.chars().take_while(|c| c.is_alphanumeric() || "-_".contains(*c)).collect();
            if !in_dependencies || name.is_empty() || name.starts_with("snell-") {
                continue;
            }
            let words = |row: &&str| row.split(['|', ' ', ',']).any(|w| w == name);
            assert!(
                rows.iter().any(words),
                "{}: {name} has no row in THIRD_PARTY.md",
                manifest.display()
            );
            count += 1;
        }
    }
    assert!(count > 20, "only {count} dependencies were found");
}

/// The name and the licence of every crate that is built here, with `OR` for the old `/`.
fn licences() -> Vec<(String, String)> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args([
        "tree",
        "--workspace",
        "--offline",
        "--locked",
        "--edges",
        "normal,build,dev",
        "--prefix",
        "none",
    ]);
    let output =
        cargo.args(["--format", "{p}|{l}"]).current_dir(repository()).output().expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let lines = text.lines().filter_map(|line| line.trim_end_matches(" (*)").split_once('|'));
    let lines = lines.map(|(package, licence)| {
        let name = package.split(' ').next().unwrap_or(package);
        (
            name.to_string(),
            licence.replace('/', " OR ").split_whitespace().collect::<Vec<_>>().join(" "),
        )
    });
    lines
        .collect::<BTreeSet<_>>()
        .into_iter()
        .filter(|(name, _)| !name.starts_with("snell"))
        .collect()
}

/// True if a list satisfies a licence expression: `OR` needs one side, `AND` both.
fn is_allowed(expression: &str, allowed: &dyn Fn(&str) -> bool) -> bool {
    let depths = expression.char_indices().scan(0, |depth, (i, c)| {
        *depth += i32::from(c == '(') - i32::from(c == ')');
        Some((i, *depth))
    });
    let top: Vec<_> = depths.filter(|(_, depth)| *depth == 0).map(|(i, _)| i).collect();
    for (operator, all) in [(" OR ", false), (" AND ", true)] {
        if let Some(&at) = top.iter().find(|&&i| expression[i..].starts_with(operator)) {
            let sides = [&expression[..at], &expression[at + operator.len()..]]
                .map(|s| is_allowed(s, allowed));
            return if all { sides == [true; 2] } else { sides != [false; 2] };
        }
    }
    match expression.strip_prefix('(').and_then(|e| e.strip_suffix(')')) {
        Some(inner) => is_allowed(inner, allowed),
        None => allowed(expression),
    }
}

/// The quoted words of a list of `deny.toml`.
fn denied_unless(list: &str) -> Vec<String> {
    let text = read(&repository().join("deny.toml"));
    let rest = text
        .split_once(&format!("\n{list} = ["))
        .unwrap_or_else(|| panic!("deny.toml has no {list}"))
        .1;
    let list = rest.split_once("]\n").expect("a list ends").0;
    list.split('"').skip(1).step_by(2).map(String::from).collect()
}

#[test]
fn every_licence_is_within_the_policy() {
    let allow = denied_unless("allow");
    let [exceptions, policy] =
        [denied_unless("exceptions").join(" "), read(&repository().join("THIRD_PARTY.md"))];
    for licence in &allow {
        let name = licence.split([' ', '-']).next().unwrap_or(licence);
        assert!(
            policy.contains(name),
            "THIRD_PARTY.md does not name {licence}, which deny.toml allows"
        );
    }
    let licences = licences();
    for (name, licence) in &licences {
        let allowed = |one: &str| {
            allow.iter().any(|a| a == one) || exceptions.contains(&format!("{name} {one}"))
        };
        assert!(
            is_allowed(licence, &allowed),
            "{name} is under {licence}: not within the policy of deny.toml"
        );
    }
    assert!(licences.len() > 150, "only {} crates were found", licences.len());
    assert!(!is_allowed("(MIT OR Apache-2.0) AND IJG", &|one| one == "MIT"));
}

#[test]
fn the_table_of_crates_has_the_licences() {
    let page = read(&repository().join("THIRD_PARTY.md"));
    let table = page.split_once("Direct dependencies:").expect("the table is there").1;
    let licences = licences();
    let mut count = 0;
    for row in table.lines().filter(|l| l.starts_with("| ")).skip(1) {
        let mut cells = row.trim_start_matches("| ").split(" | ");
        let [names, stated] = [cells.next().unwrap_or_default(), cells.next().unwrap_or_default()];
        let sorted =
            |text: &str| text.split_whitespace().map(String::from).collect::<BTreeSet<_>>();
        for name in names.split([',', ' ']).filter(|n| !n.is_empty() && !n.contains(['(', ')'])) {
            let stated = stated.split(';').next().unwrap_or(stated);
            for (_, licence) in licences.iter().filter(|(n, _)| n == name) {
                assert_eq!(
                    sorted(stated),
                    sorted(licence),
                    "{name}: THIRD_PARTY.md says {stated}, the crate {licence}"
                );
                count += 1;
            }
        }
    }
    assert!(count > 30, "only {count} crates of the table were found");
}
