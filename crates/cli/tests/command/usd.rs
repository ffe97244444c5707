//! USD in a hostile folder. These tests hold without Python, and with a Python that lacks
//! `usd-core`.

use super::support::Place;
use std::path::Path;

const STAGE: &str = "#usda 1.0\ndef Sphere \"s\"\n{\n    double radius = 1\n}\n";

/// A folder with a stage, and modules that leave a file behind if they are executed.
fn evil() -> Place {
    let place = Place::new();
    place.write("a.usda", STAGE);
    for name in [
        "pxr",
        "numpy",
        "sitecustomize",
        "usercustomize",
        "os",
        "json",
        "site",
        "signal",
        "snell_usd",
    ] {
        let marker = place.path("marker");
        place.write(&format!("{name}.py"), format!("open({marker:?}, 'w').write('{name}')\n"));
    }
    place
}

fn nothing_was_run(place: &Place, how: &str) {
    let marker = std::fs::read_to_string(place.path("marker"));
    assert!(
        marker.is_err(),
        "{how}: the module {} of the scene's folder was run",
        marker.unwrap_or_default()
    );
}

#[test]
fn python_modules_in_the_current_folder_are_not_run() {
    let place = evil();
    for words in ["info a.usda", "info ./a.usda"] {
        let run = place.run(words);
        nothing_was_run(&place, words);
        assert!(run.code == 0 || run.err.contains("reading USD needs"), "{}", run.err);
    }
}

#[test]
fn python_modules_that_variables_lead_to_are_not_run() {
    let place = evil();
    for (name, value) in [
        ("PYTHONPATH", "."),
        ("PYTHONSTARTUP", "pxr.py"),
        ("PYTHONUSERBASE", "."),
        ("PYTHONHOME", "."),
    ] {
        place.finish(place.command("info a.usda").env(name, value), b"");
        nothing_was_run(&place, name);
    }
}

#[cfg(unix)]
#[test]
fn a_python_in_the_current_folder_is_not_run() {
    use std::os::unix::fs::PermissionsExt;
    let place = evil();
    let marker = place.path("marker");
    for name in ["python3", "python"] {
        place.write(name, format!("#!/bin/sh\necho {name} > {}\n", marker.display()));
        std::fs::set_permissions(place.path(name), std::fs::Permissions::from_mode(0o755))
            .expect("it is ours");
    }
    let here = place.path("");
    for path in [Path::new("."), Path::new(""), &here] {
        let run = place.finish(place.command("info a.usda").env("PATH", path), b"");
        nothing_was_run(&place, "PATH");
        assert!(
            run.code == 1 && run.err.contains("a.usda: reading USD needs Python; install"),
            "{}",
            run.err
        );
    }
}

#[cfg(unix)]
#[test]
fn a_python_that_gives_messages_or_dies_ends_in_one_line() {
    use std::os::unix::fs::PermissionsExt;
    let (place, programs) = (Place::new(), Place::new());
    place.write("a.usda", STAGE);
    let run = |script: &str| {
        programs.write("python3", format!("#!/bin/sh\n{script}\n"));
        let mode = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(programs.path("python3"), mode).expect("it is ours");
        place.finish(place.command("info a.usda").env("PATH", programs.path("")), b"")
    };
    let refused = run("echo 'error: a.usda: at /s: odd; mend it' >&2; exit 1");
    assert_eq!((refused.code, refused.err.as_str()), (1, "error: a.usda: at /s: odd; mend it\n"));
    let killed = run("kill -9 $$");
    assert!(
        killed.err.starts_with("error: a.usda: its reader was killed (signal: 9"),
        "{}",
        killed.err
    );
    assert_eq!(killed.err.lines().count(), 1);
}
