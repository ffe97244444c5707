//! The search for a file whose name in a scene is not that of a file here.
//!
//! A scene often comes from another machine: its folders are missing, its file system did not tell
//! the case of letters apart, or its program wrote names in a way of its own. Each such name still
//! leads to one file.

use crate::fence::Fence;
use std::collections::{BTreeMap, HashMap};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use unicode_normalization::UnicodeNormalization;

/// Maximum number of entries of a folder that are looked at.
const MAX_ENTRIES: usize = 100_000;

/// Maximum number of names that are remembered, of all folders together. Beyond it the names of
/// other folders are forgotten, and read again where they are needed.
const MAX_NAMES: usize = 4 * MAX_ENTRIES;

/// Maximum number of files that are recorded: more notes than that are not shown.
const MAX_FOUND: usize = 2000;

/// What the search has seen and found. All files of a scene share it.
#[derive(Debug, Default)]
pub(crate) struct Search(Mutex<Seen>);

#[derive(Debug, Default)]
struct Seen {
    /// The names in each folder, by their [`folded`] form.
    folders: HashMap<PathBuf, HashMap<String, PathBuf>>,
    /// The names that are not those of files, with the files that were opened for them.
    found: BTreeMap<String, Found>,
}

/// A file that was opened for a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Found {
    pub path: PathBuf,
    /// True if the name leads out of the folder of a confined scene, where nothing is looked at.
    pub was_refused: bool,
}

/// What a name may lead to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sought {
    File,
    Folder,
}

impl Sought {
    /// True if there is one at this path.
    pub fn is_at(self, path: &Path) -> bool {
        match self {
            Self::File => path.is_file(),
            Self::Folder => path.is_dir(),
        }
    }
}

impl Search {
    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Finds what `name` means: first in the folders that it leads to, without regard to the case
    /// of letters and to how their accents are written; then, without the folders in the name, in
    /// each of `folders`. Nothing outside of `fence` is looked at.
    pub fn find(
        &self,
        folders: &[&Path],
        name: &str,
        sought: Sought,
        fence: Option<&Fence>,
    ) -> Option<PathBuf> {
        let first = folders.first()?;
        let mut spellings = spellings(name);
        let plain = spellings.len();
        for i in 0..plain {
            if let Some(decoded) = decoded(&spellings[i]) {
                spellings.push(decoded);
            }
        }
        let whole = spellings.iter().map(|spelling| (*first, spelling.as_str()));
        let last = |of: &str| of.rsplit('/').next().map(String::from);
        let mut bare: Vec<String> =
            [plain, spellings.len()].iter().filter_map(|&n| last(&spellings[n - 1])).collect();
        bare.dedup();
        let bare = folders.iter().flat_map(|&folder| bare.iter().map(move |b| (folder, &b[..])));
        whole.chain(bare).find_map(|(folder, name)| self.in_any_case(folder, name, sought, fence))
    }

    /// Records that a file was opened in place of `name`.
    pub fn record(&self, name: &str, found: Found) {
        let mut seen = self.seen();
        if seen.found.len() < MAX_FOUND {
            seen.found.insert(name.into(), found);
        }
    }

    /// Returns all names and files that were recorded, in alphabetical order, and forgets them.
    pub fn take_found(&self) -> BTreeMap<String, Found> {
        std::mem::take(&mut self.seen().found)
    }

    /// The file of a name relative to `folder`, whatever the case of the letters is.
    fn in_any_case(
        &self,
        folder: &Path,
        name: &str,
        sought: Sought,
        fence: Option<&Fence>,
    ) -> Option<PathBuf> {
        if name.is_empty() {
            return None;
        }
        let (mut path, rest) = match fence {
            Some(fence) => (fence.root().to_path_buf(), fence.rest(&folder.join(name))?),
            None => (folder.to_path_buf(), PathBuf::from(name)),
        };
        let may_look_at = |path: &Path| fence.is_none_or(|fence| fence.holds(path));
        for component in rest.components() {
            match component {
                Component::Normal(part) if !path.join(part).exists() => {
                    if !may_look_at(&path) {
                        return None;
                    }
                    let actual = self.entry(&path, &folded(part.to_str()?))?;
                    path.push(actual);
                }
                // An absolute name starts from the root.
                _ => path.push(component),
            }
        }
        (may_look_at(&path) && sought.is_at(&path)).then_some(path)
    }

    /// The entry of a folder whose name has this [`folded`] form; the first in alphabetical order,
    /// if there are several.
    fn entry(&self, folder: &Path, folded: &str) -> Option<PathBuf> {
        let mut seen = self.seen();
        if !seen.folders.contains_key(folder) {
            let names = entries(folder);
            let known: usize = seen.folders.values().map(HashMap::len).sum();
            if known + names.len() + seen.folders.len() > MAX_NAMES {
                seen.folders.clear();
            }
            seen.folders.insert(folder.into(), names);
        }
        seen.folders.get(folder)?.get(folded).cloned()
    }
}

/// A name in lower case, with each accented letter as one character: file systems of macOS store
/// letter and accent one after the other, and archives made there keep them so.
fn folded(name: &str) -> String {
    name.nfc().collect::<String>().to_lowercase()
}

/// Text that is UTF-8, or else Windows-1252, in which older programs write names.
pub(crate) fn text_of(bytes: &[u8]) -> String {
    // The characters from 0x80 to 0x9f; all others are those of Unicode.
    const SPECIAL: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8d}Ž\u{8f}\u{90}‘’“”•–—˜™š›œ\u{9d}žŸ";
    match std::str::from_utf8(bytes) {
        Ok(text) => text.into(),
        Err(_) => bytes
            .iter()
            .map(|&b| match b {
                0x80..=0x9f => SPECIAL.chars().nth(usize::from(b) - 0x80).unwrap_or('?'),
                _ => char::from(b),
            })
            .collect(),
    }
}

/// The names in a folder, by their folded form.
fn entries(folder: &Path) -> HashMap<String, PathBuf> {
    let mut names = HashMap::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten().take(MAX_ENTRIES) {
        let name = PathBuf::from(entry.file_name());
        let folded = folded(&text_of(name.as_os_str().as_encoded_bytes()));
        let kept = names.entry(folded).or_insert_with(|| name.clone());
        if name < *kept {
            *kept = name;
        }
    }
    names
}

/// A name in which characters are written as in an address, `%20` for a blank; `None` if none is.
fn decoded(name: &str) -> Option<String> {
    let plain = percent_encoding::percent_decode_str(name).decode_utf8().ok()?;
    (plain != name && !plain.contains('\0')).then(|| plain.into_owned())
}

/// Other ways to write a name, the closest first: with slashes for backslashes and without a drive;
/// without quotes and blanks around it, and the scheme `file:`; without the query or fragment of an
/// address.
fn spellings(name: &str) -> Vec<String> {
    let slashes = name.replace('\\', "/");
    let plain = slashes.trim_matches(|c: char| c.is_whitespace() || matches!(c, '"' | '\''));
    let plain = plain.strip_prefix("file://").unwrap_or(plain);
    let plain = match plain.as_bytes() {
        [letter, b':', ..] if letter.is_ascii_alphabetic() => &plain[2..],
        _ => plain,
    };
    let plain = plain.trim_end_matches('/');
    let mut all = vec![slashes.clone(), plain.into()];
    if let Some((path, _)) = plain.split_once(['?', '#']) {
        all.push(path.trim_end().into());
    }
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use crate::{Input, ReadOptions};

    /// Resolves a name in a scene `scene/a.obj` of a folder with these files.
    fn resolved(files: &[&str], name: &str, confine: bool) -> Option<String> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().expect("it is in a folder")).expect("writable");
            std::fs::write(path, "x").expect("it is writable");
        }
        let name = name.replace("HERE", &folder.path().display().to_string());
        let options = ReadOptions { confine, ..ReadOptions::default() };
        let input = Input::from_bytes("a.obj", Vec::new(), &folder.path().join("scene"), &options);
        let path = input.resolve(&name).ok()?.canonicalize().ok()?;
        let root = folder.path().canonicalize().expect("it exists");
        Some(path.strip_prefix(root).expect("it is one of the files").display().to_string())
    }

    #[test]
    fn a_name_leads_to_the_file_that_it_means() {
        for (name, file) in [
            ("a.png", "scene/a.png"),
            ("A.PNG", "scene/a.png"),
            ("maps/A.png", "scene/Maps/a.png"),
            ("maps\\b.png", "scene/Maps/b.png"),
            ("C:\\Users\\me\\maps\\c.png", "scene/c.png"),
            ("/home/me/c.png", "scene/c.png"),
            ("\"c.png\"", "scene/c.png"),
            ("c.png?v=3", "scene/c.png"),
            ("C.PNG#x", "scene/c.png"),
            ("c.png # of wood", "scene/c.png"),
            ("odd?v=3", "scene/odd?v=3"),
            ("https://example.org/c.png?size=2", "scene/c.png"),
            ("my%20tex.png", "scene/my tex.png"),
            ("C:\\maps\\My%20Tex.png?v=1", "scene/my tex.png"),
            ("odd%20name.png", "scene/odd%20name.png"),
            ("/home/me/odd%20name.png", "scene/odd%20name.png"),
            // A folder of that name is not meant.
            ("inner/wood", "scene/wood"),
            ("../wood.png", "wood.png"),
            ("../Wood.png", "wood.png"),
            ("HERE/other/far.png", "other/far.png"),
            ("file://HERE/other/far.png", "other/far.png"),
            ("b\u{e4}ume.png", "scene/ba\u{308}ume.png"),
            ("B\u{c4}UME.png", "scene/ba\u{308}ume.png"),
            ("o\u{308}l.png", "scene/\u{f6}l.png"),
        ] {
            let files =
                ["scene/a.png", "scene/Maps/a.png", "scene/Maps/b.png", "scene/c.png", "wood.png"];
            let accented = ["scene/ba\u{308}ume.png", "scene/\u{f6}l.png"];
            let encoded = ["scene/my tex.png", "scene/odd%20name.png"];
            let folders = ["scene/inner/wood/x.png", "scene/wood"];
            let files = [&files[..], &["scene/odd?v=3", "other/far.png"], &accented].concat();
            let files = [&files[..], &encoded, &folders].concat();
            assert_eq!(resolved(&files, name, false).as_deref(), Some(file), "{name}");
        }
    }

    #[test]
    fn names_that_are_not_utf_8_are_windows_1252() {
        assert_eq!(super::text_of("gr\u{fc}n".as_bytes()), "gr\u{fc}n");
        assert_eq!(super::text_of(b"gr\xfcn \x80 \x9f"), "gr\u{fc}n \u{20ac} \u{178}");
    }

    #[test]
    fn a_confined_scene_finds_nothing_outside_of_its_folder() {
        let files = ["scene/Maps/b.png", "scene/near.png", "wood.png", "near.png"];
        for (name, file) in [
            ("../wood.png", None),
            ("../WOOD.png", None),
            ("HERE/wood.png", None),
            ("file://HERE/wood.png", None),
            ("maps/B.png", Some("scene/Maps/b.png")),
            ("../near.png", Some("scene/near.png")),
            ("../scene/near.png", Some("scene/near.png")),
            ("\\\\host\\share\\near.png", Some("scene/near.png")),
            ("//host/share/NEAR.png", Some("scene/near.png")),
            ("//host/share/wood.png", None),
            ("HERE/scene/Near.png", Some("scene/near.png")),
        ] {
            assert_eq!(resolved(&files, name, true).as_deref(), file, "{name}");
        }
    }
}
