//! Files that were dropped on the page, and the scene among them.

use crate::words::for_page;
use snell_formats::input::CONFINED;
use snell_formats::{ReadOptions, SCENE_READERS, read_scene};
use snell_scene::{Scene, WarningKind};
use std::path::{Component, Path};

/// A file that was dropped on the page.
#[derive(Clone, Debug)]
pub struct Dropped {
    /// The name of the file, with the folders that were dropped: `model/textures/wood.png`.
    pub name: String,
    /// The contents of the file.
    pub bytes: Vec<u8>,
}

/// Maximum size of all files of a drop in bytes. Larger ones are opened by name and read in place.
pub const MAX_BYTES: usize = 256 << 20;
/// Maximum number of files in a drop.
const MAX_FILES: usize = 10_000;
/// Maximum size of the list of files at the beginning of a drop.
const MAX_LIST: usize = 4 << 20;

/// A file in the list at the beginning of a drop.
#[derive(serde::Deserialize)]
struct Listed {
    name: String,
    bytes: usize,
}

/// The files that a page sends: one line of JSON with their names and sizes,
/// `[{"name":…,"bytes":…},…]`, and then their contents, one after the other.
pub fn files(body: &[u8]) -> Result<Vec<Dropped>, String> {
    let end = body.iter().take(MAX_LIST).position(|byte| *byte == b'\n');
    let (list, mut rest) = end.map(|end| body.split_at(end + 1)).ok_or("no list")?;
    let list: Vec<Listed> =
        serde_json::from_slice(list).map_err(|_| "this is not a list of files")?;
    if list.len() > MAX_FILES {
        return Err(format!("more than {MAX_FILES} files; drop only those of one scene"));
    }
    let mut files = Vec::with_capacity(list.len());
    for Listed { name, bytes } in list {
        let (own, others) = rest.split_at_checked(bytes).ok_or("the upload was cut off")?;
        files.push(Dropped { name, bytes: own.to_vec() });
        rest = others;
    }
    Ok(files)
}

/// The middle of the warning about further scenes in a drop.
pub const OTHERS: &str = " was opened; drop one of these alone to see it: ";

/// Maximum number of folders above a file.
const MAX_DEPTH: usize = 32;

/// Checks that a name leads to a file below a folder, on any system.
pub fn check_name(name: &str) -> Result<(), String> {
    let is_plain = |step: &str| {
        !step.is_empty()
            && step.len() <= 255
            && !step.ends_with(['.', ' '])
            && !step.contains(['\\', ':', '\0', '*', '?', '"', '<', '>', '|'])
            && !step.chars().any(char::is_control)
    };
    let steps: Vec<&str> = name.split('/').collect();
    let only_names = Path::new(name).components().all(|c| matches!(c, Component::Normal(_)));
    if only_names && steps.len() <= MAX_DEPTH && steps.iter().all(|step| is_plain(step)) {
        return Ok(());
    }
    let shown: String = name.chars().take(80).collect();
    Err(format!("{shown:?} cannot be the name of a file on every system; rename it"))
}

/// The file to open: of those that may be scenes the one in the uppermost folder, scenes before
/// meshes, as readers come; then by name. The second list has the other scenes.
fn scene_of(files: &[Dropped]) -> (Option<&Dropped>, Vec<&str>) {
    let rank = |file: &Dropped| {
        let path = Path::new(file.name.strip_suffix(".gz").unwrap_or(&file.name));
        let extension = path.extension()?.to_string_lossy().to_lowercase();
        let reader = SCENE_READERS.iter().position(|r| r.extensions.contains(&&*extension))?;
        Some((file.name.matches('/').count(), reader))
    };
    let mut scenes: Vec<_> =
        files.iter().filter_map(|file| Some((rank(file)?, &file.name, file))).collect();
    scenes.sort_by_key(|(rank, name, _)| (*rank, *name));
    let top = scenes.first().map(|(rank, ..)| *rank);
    let others = scenes.iter().skip(1).filter(|(rank, ..)| Some(*rank) == top);
    let others = others.map(|(_, name, _)| name.as_str()).collect();
    (scenes.first().map(|(.., file)| *file), others)
}

/// Reads the scene among files that were dropped on the page, and returns it with its name. It can
/// name only the files that were dropped with it, whatever the options allow, because their sender
/// may not be the user who set them. The error is a message for the page.
pub fn read_dropped(files: Vec<Dropped>, options: &ReadOptions) -> Result<(String, Scene), String> {
    let confined = ReadOptions { confine: true, ..options.clone() };
    let is_alone = files.len() == 1;
    for file in &files {
        check_name(&file.name)?;
    }
    let (scene, others) = scene_of(&files);
    let others: Vec<String> = others.into_iter().map(String::from).collect();
    let Some(name) = scene.or_else(|| files.first().filter(|_| is_alone)).map(|f| f.name.clone())
    else {
        let names: Vec<&str> = files.iter().map(|f| f.name.as_str()).take(5).collect();
        let what = names.join(", ");
        return Err(format!("none of these files is a scene or a mesh: {what}"));
    };
    let folder = folder_of(files)?;
    let read = read_scene(&folder.path().join(&name), &confined);
    let inside = format!("{}{}", folder.path().display(), std::path::MAIN_SEPARATOR);
    let told = |message: &str| {
        for_page(&without_system(&message.replace(CONFINED, REMEDY)).replace(&inside, ""))
    };
    let mut scene = read.map_err(|error| told(&error.to_string()))?;
    for warning in &mut scene.warnings {
        warning.message = told(&warning.message);
    }
    if shows_nothing(&scene) {
        let reasons = scene.warnings.iter().map(|warning| warning.message.as_str()).take(3);
        let reasons: String = reasons.map(|reason| format!("; {reason}")).collect();
        return Err(format!(
            "{name}: there is nothing to see in it, no surface, medium or environment; the scene \
                that was shown stays{reasons}"
        ));
    }
    if !others.is_empty() {
        let message = format!("{name}{OTHERS}{}", others[..others.len().min(5)].join(", "));
        scene.warn_of(WarningKind::Choice, message);
    }
    Ok((name, scene))
}

/// True for a scene in which nothing can be seen, whatever lights it, as in an empty file.
fn shows_nothing(scene: &Scene) -> bool {
    scene.nodes.iter().all(|node| node.surfaces.is_empty())
        && scene.media.is_empty()
        && scene.environment.is_none()
}

/// A folder of this user alone with the files in it. It is removed when the value is dropped.
fn folder_of(files: Vec<Dropped>) -> Result<tempfile::TempDir, String> {
    let failed =
        |error: std::io::Error| format!("the files cannot be stored to read them: {error}");
    let folder = tempfile::Builder::new().prefix("snell-dropped-").tempdir().map_err(failed)?;
    for file in files {
        let path = folder.path().join(&file.name);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(failed)?;
        }
        std::fs::write(path, file.bytes).map_err(failed)?;
    }
    Ok(folder)
}

/// A message without what the system says of files that were not dropped: they are not there.
fn without_system(message: &str) -> String {
    const START: &str = "cannot open: ";
    const END: &str = "; check the name and that you may read it";
    let mut told = message.to_string();
    while let Some(start) = told.find(START)
        && let Some(length) = told[start..].find(END)
    {
        let missing = format!("it was not dropped; {REMEDY}");
        told.replace_range(start..start + length + END.len(), &missing);
    }
    told
}

/// The remedy for a dropped file that names others.
const REMEDY: &str = "drop it together with the files that it names, or drop their folder";

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, text: &str) -> Dropped {
        Dropped { name: name.into(), bytes: text.as_bytes().to_vec() }
    }

    #[test]
    fn several_files_come_in_one_request() {
        let body = b"[{\"name\":\"a/b.obj\",\"bytes\":3},{\"name\":\"c\",\"bytes\":0}]\nv 0";
        let found = files(body).expect("two files");
        assert_eq!((&*found[0].name, &*found[0].bytes), ("a/b.obj", &b"v 0"[..]));
        assert_eq!((&*found[1].name, found.len()), ("c", 2));
        for wrong in [&b""[..], b"\n", b"[]", b"[{\"name\":\"a\",\"bytes\":9}]\nv 0", b"{}\n"] {
            assert!(files(wrong).is_err());
        }
    }

    const MESH: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    /// What a scene says, or the message if it cannot be read.
    fn said(files: Vec<Dropped>) -> String {
        match read_dropped(files, &ReadOptions::default()) {
            Ok((_, scene)) => {
                scene.warnings.iter().map(|w| w.message.clone()).collect::<Vec<_>>().join("\n")
            }
            Err(message) => message,
        }
    }

    #[test]
    fn a_dropped_file_names_no_other_file_whatever_is_allowed() {
        for name in ["/etc/passwd", "../../../../../../etc/passwd", "passwd", "./a/../../passwd"] {
            for (scene, text) in [
                ("a.obj", format!("mtllib {name}\n{MESH}f 1 2 3\n")),
                (
                    "b.pbrt",
                    format!(
                        "WorldBegin\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \
                            \"{name}\"\nMaterial \"diffuse\" \"texture reflectance\" \"t\"\n"
                    ),
                ),
                ("a.pbrt", format!("WorldBegin\nInclude \"{name}\"\n")),
                (
                    "a.xml",
                    format!("<scene version=\"3.0.0\"><include filename=\"{name}\"/></scene>"),
                ),
            ] {
                let together = vec![file(scene, &text), file("other.txt", "")];
                for files in [vec![file(scene, &text)], together] {
                    let said = said(files);
                    // Such a file is not opened, and the error does not reveal whether it could be.
                    assert!(
                        said.contains("passwd") && !said.contains("root:"),
                        "{scene} {name}: {said}"
                    );
                    let commands = ["--", "`snell", "snell-dropped"];
                    assert!(commands.iter().all(|c| !said.contains(c)), "{scene} {name}: {said}");
                }
            }
        }
    }

    #[test]
    fn files_that_are_dropped_together_name_each_other() {
        let files = vec![
            file("model/parts/red.mtl", "newmtl red\nKd 0.75 0 0\n"),
            file("model/a.obj", &format!("mtllib parts/red.mtl\nusemtl red\n{MESH}f 1 2 3\n")),
        ];
        let (name, scene) = read_dropped(files, &ReadOptions::default()).expect("a scene");
        assert_eq!((&*name, &*scene.materials[0].name), ("model/a.obj", "red"));
        assert_eq!(scene.warnings, []);
    }

    #[test]
    fn of_several_scenes_the_uppermost_is_opened_and_the_others_are_named() {
        let mesh = format!("{MESH}f 1 2 3\n");
        let files = ["sub/a.obj", "c.obj", "b.obj"].map(|name| file(name, &mesh)).to_vec();
        let (name, scene) = read_dropped(files, &ReadOptions::default()).expect("a scene");
        assert_eq!(name, "b.obj");
        assert!(scene.warnings[0].message.contains("c.obj"), "{:?}", scene.warnings);
    }

    #[test]
    fn a_file_with_nothing_to_see_is_refused() {
        for (name, text) in [
            ("empty.obj", ""),
            ("points.obj", "v 0 0 0\nv 1 0 0\n"),
            ("empty.off", "OFF\n0 0 0\n"),
            ("empty.gltf", "{\"asset\":{\"version\":\"2.0\"}}"),
        ] {
            let said = read_dropped(vec![file(name, text)], &ReadOptions::default());
            assert!(said.is_err_and(|said| said.contains(name)), "{name}");
        }
        let empty = said(vec![file("empty.obj", "")]);
        assert!(empty.contains("nothing to see"), "{empty}");
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        for name in ["../a.obj", "/a.obj", "a/../../b.obj", "c:a.obj", "a\\b.obj", "", "a//b", "a."]
        {
            let files = vec![file(name, MESH), file("b.obj", MESH)];
            assert!(read_dropped(files, &ReadOptions::default()).is_err(), "{name}");
        }
        let nothing = said(vec![file("a.txt", ""), file("b.png", "")]);
        assert!(nothing.contains("none of these files is a scene"), "{nothing}");
    }

    #[test]
    fn what_cannot_be_read_is_said_without_words_of_the_command_line() {
        let extensions = SCENE_READERS.iter().flat_map(|reader| reader.extensions);
        for extension in extensions.chain(&["txt", "fbx", "zip", ""]) {
            for content in
                ["", "nonsense", "{\"asset\":{\"version\":\"2.0\"}}", "<scene/>", "\0\x01"]
            {
                let said = said(vec![file(&format!("broken.{extension}"), content)]);
                assert!(!said.contains("`snell"), "{extension}: {said}");
                assert!(!said.contains(" --"), "{extension}: {said}");
            }
        }
    }
}
