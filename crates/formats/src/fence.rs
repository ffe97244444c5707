//! The folder that a confined scene may not leave.
//!
//! Where a name leads is judged by the name first, so that the system is asked about nothing
//! outside: on some systems the question alone goes to another machine. Links inside of the folder
//! are followed afterwards.

use std::path::{Component, Path, PathBuf, absolute};

/// The folder of a confined scene.
#[derive(Clone, Debug)]
pub(crate) struct Fence {
    root: PathBuf,
    /// The folder from the root of the file system on, without `.` and `..`.
    named: PathBuf,
    /// The same with its links followed; `None` if there is no such folder.
    real: Option<PathBuf>,
}

impl Fence {
    /// The limits of a scene in this folder.
    pub fn around(root: &Path) -> Self {
        Self { root: root.into(), named: plain(root), real: root.canonicalize().ok() }
    }

    /// The folder as it was given.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The part of a path after the folder; `None` if the path leads out of it. The system is not
    /// asked.
    pub fn rest(&self, path: &Path) -> Option<PathBuf> {
        let path = plain(path);
        let roots = std::iter::once(&self.named).chain(&self.real);
        roots.filter_map(|root| path.strip_prefix(root).ok()).map(Path::to_path_buf).next()
    }

    /// True if a path lies in the folder, with its links followed as far as there are any.
    pub fn holds(&self, path: &Path) -> bool {
        if self.rest(path).is_none() {
            return false;
        }
        match (&self.real, path.canonicalize()) {
            (Some(root), Ok(path)) => path.starts_with(root),
            // There is no such file.
            _ => true,
        }
    }
}

/// A path from the root of the file system on, without `.` and `..`. Links are not followed.
fn plain(path: &Path) -> PathBuf {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let mut plain = PathBuf::new();
    for component in absolute(path).unwrap_or_else(|_| path.into()).components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                plain.pop();
            }
            other => plain.push(other),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_judged_without_a_question_to_the_system() {
        for root in ["/no/such/folder", "no/such", "."] {
            let fence = Fence::around(Path::new(root));
            let rest = |name: &str| fence.rest(&Path::new(root).join(name));
            for (name, inside) in [
                ("a.png", Some("a.png")),
                ("./sub/../a.png", Some("a.png")),
                ("sub/a.png", Some("sub/a.png")),
                ("../a.png", None),
                ("sub/../../a.png", None),
                ("/etc/passwd", None),
                ("//host/share/a.png", None),
            ] {
                assert_eq!(rest(name), inside.map(PathBuf::from), "{root} {name}");
            }
            let whole = absolute(root).expect("a path").join("a.png");
            assert_eq!(fence.rest(&whole), Some("a.png".into()));
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_of_the_folder_are_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        for name in ["scene", "outside"] {
            std::fs::create_dir(path(name)).expect("it is writable");
        }
        std::fs::write(path("outside/a.png"), "x").expect("it is writable");
        for (name, target) in [("scene/out", "outside"), ("same", "scene")] {
            std::os::unix::fs::symlink(path(target), path(name)).expect("it is writable");
        }
        let fence = Fence::around(&path("same"));
        assert!(!fence.holds(&path("same/out/a.png")) && fence.holds(&path("same/none.png")));
        // The folder has two names.
        assert_eq!(fence.rest(&path("same/b.png")), Some("b.png".into()));
        let real = path("scene").canonicalize().expect("it exists");
        assert_eq!(fence.rest(&real.join("b.png")), Some("b.png".into()));
    }
}
