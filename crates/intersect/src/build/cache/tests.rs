//! Tests of damaged cache files.

use super::*;
use crate::build::Quality;
use crate::build::tests::soup;
use crate::tree::GroupTree;
use snell_math::rng;
use snell_math::simd::Level;
use std::sync::Arc;

fn options(compact: bool) -> BvhOptions {
    BvhOptions { quality: Quality::Medium, compact, wide: Level::best().wide(), cache: None }
}

fn list(n: u32, seed: u32) -> GroupList {
    let mut mesh = soup(n, seed);
    // A degenerate triangle, which can never be hit.
    mesh.indices.push([0, 0, 1]);
    GroupList { meshes: vec![(0, Arc::new(mesh))], ..GroupList::default() }
}

/// A small tree in a file, and its contents.
struct Kept {
    folder: tempfile::TempDir,
    entry: Entry,
    wide: Wide,
    skipped: Vec<u32>,
    triangles: usize,
    file: Vec<u8>,
}

impl Kept {
    fn new(compact: bool) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let (list, options) = (list(if cfg!(miri) { 30 } else { 900 }, 3), options(compact));
        let tree = GroupTree::build(&list, &[], &options).expect("a tree");
        let GroupTree { nodes, blocks, root, rest, depth, skipped, .. } = tree;
        let wide = Wide { nodes, blocks, root, rest, depth };
        assert!(!skipped.is_empty());
        let entry = Entry::new(folder.path(), &list, &[], &options);
        entry.write(&wide, &skipped).expect("written");
        let file = std::fs::read(&entry.path).expect("a file");
        Self { folder, entry, wide, skipped, triangles: list.meshes[0].1.indices.len(), file }
    }

    fn read(&self) -> Result<Option<Cached>> {
        self.entry.read(self.triangles, 0)
    }

    fn is_same(&self, read: &Cached) -> bool {
        let [a, b] = [&self.wide, &read.wide];
        let numbers = |wide: &Wide| (wide.root, wide.rest, wide.depth, wide.blocks.count());
        a.nodes.bytes() == b.nodes.bytes()
            && a.blocks.bytes() == b.blocks.bytes()
            && numbers(a) == numbers(b)
            && self.skipped == read.skipped
    }

    fn names(&self) -> Vec<PathBuf> {
        std::fs::read_dir(self.folder.path())
            .expect("a folder")
            .flatten()
            .map(|found| found.path())
            .collect()
    }
}

fn random(below: usize, i: u32) -> usize {
    rng::hash32(i) as usize % below
}

#[test]
fn every_flipped_bit_is_found() {
    for compact in [false, true] {
        let kept = Kept::new(compact);
        assert!(kept.is_same(&kept.read().expect("whole").expect("a file")));
        let anywhere = (0..400).map(|i| random(kept.file.len(), i));
        for (i, place) in
            (0..).zip((0..176).chain(kept.file.len() - 40..kept.file.len()).chain(anywhere))
        {
            let mut bytes = kept.file.clone();
            bytes[place] ^= 1 << random(8, i);
            std::fs::write(&kept.entry.path, bytes).expect("written");
            assert!(kept.read().is_err(), "byte {place}, compact: {compact}");
        }
    }
}

#[test]
fn pieces_that_changed_places_or_became_zeros_are_found() {
    let kept = Kept::new(false);
    for i in 0..100 {
        let mut bytes = kept.file.clone();
        let [a, b] = [0, 1].map(|k| PAGE + random((bytes.len() - PAGE) / 512 - 1, 2 * i + k) * 512);
        if i % 2 == 0 {
            bytes[a..a + 512].fill(0);
        } else {
            bytes.copy_within(a..a + 512, b);
        }
        std::fs::write(&kept.entry.path, &bytes).expect("written");
        assert_eq!(kept.read().is_err(), bytes != kept.file, "{a} {b}");
    }
}

#[test]
fn a_file_of_another_length_is_found() {
    for compact in [false, true] {
        let kept = Kept::new(compact);
        let whole = kept.file.len();
        let lengths =
            (0..200).map(|i| random(whole, i)).chain([0, 1, PAGE - 1, PAGE, PAGE + 1, whole - 1]);
        for length in lengths.chain([whole + 1, whole + 4, 2 * whole]) {
            let mut bytes = kept.file.clone();
            bytes.resize(length, 0);
            std::fs::write(&kept.entry.path, bytes).expect("written");
            assert!(kept.read().is_err(), "{length} bytes, compact: {compact}");
        }
    }
}

#[test]
fn the_file_of_another_mesh_is_not_used() {
    let kept = Kept::new(false);
    let other = Entry::new(kept.folder.path(), &list(900, 4), &[], &options(false));
    assert!(other.path != kept.entry.path && matches!(other.read(kept.triangles, 0), Ok(None)));
    std::fs::copy(&kept.entry.path, &other.path).expect("copied");
    let error = other.read(kept.triangles, 0).err().expect("another mesh");
    assert!(error.to_string().contains("something else"), "{error}");
}

#[test]
fn a_tree_stays_as_it_was_read_whatever_becomes_of_its_file() {
    for compact in [false, true] {
        let kept = Kept::new(compact);
        let read = kept.read().expect("whole").expect("a file");
        let file = std::fs::OpenOptions::new().write(true).open(&kept.entry.path).expect("a file");
        file.set_len(PAGE as u64 + 10).expect("cut");
        assert!(kept.is_same(&read));
        std::fs::write(&kept.entry.path, vec![0x35; kept.file.len()]).expect("written");
        assert!(kept.is_same(&read));
    }
}

#[test]
fn whoever_writes_at_the_same_time_leaves_one_whole_file() {
    let kept = Kept::new(true);
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..20 {
                    kept.entry.write(&kept.wide, &kept.skipped).expect("written");
                    assert!(kept.is_same(&kept.read().expect("whole").expect("a file")));
                }
            });
        }
    });
    assert_eq!(kept.names(), std::slice::from_ref(&kept.entry.path));
    assert!(std::fs::read(&kept.entry.path).expect("a file") == kept.file);
}

#[cfg(unix)]
#[test]
fn what_is_not_a_file_is_neither_opened_nor_replaced() {
    let kept = Kept::new(false);
    let path = &kept.entry.path;
    let make_pipe = |path: &Path| {
        let made = std::process::Command::new("mkfifo").arg(path).status();
        assert!(made.expect("mkfifo").success());
    };
    let makers: [&dyn Fn(&Path); 3] =
        [&make_pipe, &|path| std::fs::create_dir(path).expect("a folder"), &|path| {
            std::os::unix::fs::symlink("/dev/zero", path).expect("a link")
        }];
    for make in makers {
        std::fs::remove_file(path).expect("it was a file");
        make(path);
        let before = std::fs::symlink_metadata(path).expect("something").file_type();
        assert!(kept.read().is_err());
        assert!(kept.entry.write(&kept.wide, &kept.skipped).is_err());
        assert_eq!(std::fs::symlink_metadata(path).expect("something").file_type(), before);
        assert_eq!(kept.names().len(), 1);
        if before.is_dir() {
            std::fs::remove_dir(path).expect("an empty folder");
            std::fs::write(path, "").expect("written");
        }
    }
}

#[cfg(unix)]
#[test]
fn a_link_is_read_through_and_replaced_without_its_target() {
    let kept = Kept::new(false);
    let target = kept.folder.path().join("elsewhere");
    std::fs::rename(&kept.entry.path, &target).expect("renamed");
    std::os::unix::fs::symlink(&target, &kept.entry.path).expect("a link");
    assert!(kept.is_same(&kept.read().expect("whole").expect("a file")));
    std::fs::write(&target, "of another user").expect("written");
    assert!(kept.read().is_err());
    kept.entry.write(&kept.wide, &kept.skipped).expect("written");
    assert!(kept.is_same(&kept.read().expect("whole").expect("a file")));
    assert_eq!(std::fs::read(&target).expect("a file"), b"of another user");
}

#[cfg(unix)]
#[test]
fn others_may_read_what_the_umask_allows() {
    use std::os::unix::fs::PermissionsExt;
    let kept = Kept::new(false);
    let regular = kept.folder.path().join("regular");
    File::create(&regular).expect("a file");
    let [a, b] = [&regular, &kept.entry.path]
        .map(|path| std::fs::metadata(path).expect("a file").permissions().mode());
    assert_eq!(a, b);
}
