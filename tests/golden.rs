//! Golden pictures: each scene in `tests/golden/INTEGRATOR/` looks like the OpenEXR file beside it
//! that has its name.
//!
//! The test finds the scenes by itself. To add one, put a scene into the folder, run `cargo xtask
//! golden`, look at the new picture, and commit both. Other files that a scene names go into the
//! file itself or into a subfolder. (Material files may stay beside it, because their extension
//! differs.)
//!
//! Noise does not count, so another seed passes, but other light, geometry or textures fail. After
//! a failure, `target/golden/INTEGRATOR/` has the new picture and the differences; `cargo xtask
//! golden` makes the new pictures the references.

use snell_formats::image::compare::{
    CompareError, CompareOptions, Compared, LinearImage, compare, difference_picture,
};
use snell_formats::image::{WriteOptions, read_layers, write_image};
use snell_formats::{Input, ReadOptions, SCENE_READERS, read_scene};
use snell_render::{Aov, IntegratorKind, Settings};
use snell_scene::framing::{FramingOptions, prepare};
use snell_scene::{Layer, LayeredImage, WarningKind};
use snell_tests::render;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const SIZE: [u32; 2] = [80, 60];

/// Samples per pixel.
const SPP: u32 = 128;

/// Differences below this many standard errors count as noise.
const NOISE: f32 = 4.0;

/// Maximum mean FLIP error of pixels that passes.
const MAX_FLIP: f64 = 0.005;

/// Sides in pixels of squares whose means are compared, too: these have less noise than pixels.
const SQUARES: [u32; 2] = [5, 20];

/// Maximum relative mean squared error of the means of squares that passes.
const MAX_REL_MSE: f64 = 3e-6;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("golden")
}

/// The folder for pictures of failures.
fn results() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("../golden")
}

fn extension(path: &Path) -> &str {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default()
}

/// The files of a folder, sorted.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<_> = entries.map(|e| e.expect("an entry").path()).collect();
    files.sort();
    files
}

/// The scenes of an integrator.
fn scenes(integrator: IntegratorKind) -> Vec<PathBuf> {
    let folder = folder().join(integrator.name());
    if !folder.exists() {
        return Vec::new();
    }
    let is_scene = |p: &PathBuf| SCENE_READERS.iter().any(|r| r.extensions.contains(&extension(p)));
    files(&folder).into_iter().filter(is_scene).collect()
}

/// A rendered picture with known noise.
struct Picture {
    image: LayeredImage,
    /// Standard error of each value.
    errors: Vec<[f32; 3]>,
}

impl Picture {
    /// Renders the picture of a scene as `snell render` does with this integrator.
    fn render(path: &Path, integrator: IntegratorKind, seed: u32) -> Self {
        let mut scene = read_scene(path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        prepare(&mut scene, &FramingOptions { size: SIZE, ..FramingOptions::default() })
            .expect("no cycles");
        // A glTF file with lights of its own is said to have no others.
        let is_as_written = scene.warnings.iter().all(|w| w.kind == WarningKind::Choice);
        assert!(is_as_written, "{}: {:?}", path.display(), scene.warnings);
        let is_aov = integrator == IntegratorKind::Aov;
        let aovs = if is_aov { vec![Aov::Normal] } else { Vec::new() };
        let max_depth = integrator.default_max_depth();
        let settings = Settings {
            size: SIZE,
            spp: SPP,
            seed,
            integrator,
            max_depth,
            aovs,
            ..Settings::default()
        };
        let film = render(&scene, &scene.cameras[0], &settings);
        // Normals, from -1 to 1, become colours from 0 to 1.
        let (offset, scale) = if is_aov { (0.5, 0.5) } else { (0.0, 1.0) };
        let rgb = |layers: LayeredImage| -> Vec<[f32; 3]> {
            let layer = &layers.layers[usize::from(is_aov)];
            layer.values.chunks_exact(layer.channels.len()).map(|v| [v[0], v[1], v[2]]).collect()
        };
        let image =
            picture(SIZE, rgb(film.image()).iter().flatten().map(|v| offset + scale * v).collect());
        let errors = rgb(film.variance()).iter().map(|v| v.map(|v| scale * v.sqrt())).collect();
        Self { image, errors }
    }
}

/// An image with one layer of RGB.
fn picture([width, height]: [u32; 2], values: Vec<f32>) -> LayeredImage {
    let channels = ["R", "G", "B"].map(String::from).to_vec();
    LayeredImage {
        width,
        height,
        layers: vec![Layer { name: String::new(), channels, values }],
        metadata: Vec::new(),
    }
}

fn linear(image: &LayeredImage) -> LinearImage {
    LinearImage::from_layer(image, &image.layers[0])
}

/// The picture whose pixels are the means of squares of pixels. Incomplete squares at the right and
/// bottom are dropped.
fn squares(image: &LinearImage, side: u32, mean: impl Fn(&[[f32; 3]]) -> [f32; 3]) -> LinearImage {
    let (width, height) = (image.width / side, image.height / side);
    let square = |i: u32| {
        let corner = i / width * side * image.width + i % width * side;
        let pixels = (0..side * side)
            .map(|k| image.pixels[(corner + k / side * image.width + k % side) as usize]);
        mean(&pixels.collect::<Vec<_>>())
    };
    LinearImage { width, height, pixels: (0..width * height).map(square).collect() }
}

fn mean(values: &[[f32; 3]]) -> [f32; 3] {
    [0, 1, 2].map(|c| values.iter().map(|v| v[c]).sum::<f32>() / values.len() as f32)
}

/// Standard error of the mean of values with these standard errors.
fn error_of_mean(errors: &[[f32; 3]]) -> [f32; 3] {
    [0, 1, 2].map(|c| errors.iter().map(|e| e[c] * e[c]).sum::<f32>().sqrt() / errors.len() as f32)
}

/// Compares `test` with the reference after moving each value towards the reference by the noise of
/// both.
fn compare_but_for_noise(
    reference: &LinearImage,
    test: &LinearImage,
    errors: &LinearImage,
) -> Result<Compared, CompareError> {
    let value = |r: f32, t: f32, error: f32| {
        let noise = NOISE * error * std::f32::consts::SQRT_2;
        if (t - r).abs() <= noise { r } else { t - (t - r).signum() * noise }
    };
    let pixels = (reference.pixels.iter().zip(&test.pixels).zip(&errors.pixels))
        .map(|((r, t), e)| [0, 1, 2].map(|c| value(r[c], t[c], e[c])))
        .collect();
    compare(reference, &LinearImage { pixels, ..*test }, &CompareOptions::default())
}

/// The difference of a picture from its reference, without noise.
struct Judgement {
    pixels: Compared,
    /// Relative mean squared errors of [`SQUARES`].
    squares: [f64; SQUARES.len()],
}

impl Judgement {
    fn new(picture: &Picture, reference: &Path) -> Result<Self, String> {
        let remedy = "if the new picture is right, run `cargo xtask golden`";
        let reference = Input::open(reference, &ReadOptions::default())
            .and_then(|input| read_layers(&input))
            .map_err(|e| format!("{e}; {remedy}"))?;
        let (reference, test) = (linear(&reference), linear(&picture.image));
        let errors = LinearImage { pixels: picture.errors.clone(), ..test };
        let pixels = compare_but_for_noise(&reference, &test, &errors)
            .map_err(|e| format!("{e}; {remedy}"))?;
        let squares = SQUARES.map(|side| {
            let means = [&reference, &test].map(|image| squares(image, side, mean));
            let errors = squares(&errors, side, error_of_mean);
            compare_but_for_noise(&means[0], &means[1], &errors)
                .expect("equal sizes")
                .comparison
                .rel_mse
        });
        Ok(Self { pixels, squares })
    }

    /// Fails with a message if the picture differs too much from its reference.
    fn verdict(&self) -> Result<(), String> {
        let c = &self.pixels.comparison;
        let is_finite = c.not_finite_in_reference + c.not_finite_in_test == 0;
        if is_finite && c.flip < MAX_FLIP && self.squares.iter().all(|e| *e < MAX_REL_MSE) {
            return Ok(());
        }
        let [x, y] = c.max_at;
        Err(format!("{self}; largest difference {:.3} at column {x}, row {y}", c.max_abs))
    }
}

impl std::fmt::Display for Judgement {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "mean FLIP error {:.4} (under {MAX_FLIP} passes)", self.pixels.comparison.flip)?;
        for (side, error) in SQUARES.iter().zip(&self.squares) {
            write!(
                f,
                ", relative MSE of {side} x {side} pixels {error:.7} (under {MAX_REL_MSE} passes)"
            )?;
        }
        Ok(())
    }
}

/// Checks a picture against `reference`. If they differ, writes the new picture and the difference
/// into `results`, or makes the picture the reference if `accept` is set.
fn check(picture: &Picture, reference: &Path, results: &Path, accept: bool) -> Result<(), String> {
    let judgement = Judgement::new(picture, reference);
    let problem = match judgement.as_ref().map_err(Clone::clone).and_then(Judgement::verdict) {
        Ok(()) => return Ok(()),
        Err(problem) => problem,
    };
    let half = WriteOptions { exr_half: true, ..WriteOptions::default() };
    let write = |path: &Path, image: &LayeredImage| {
        write_image(path, image, &half).unwrap_or_else(|e| panic!("{e}"));
        eprintln!("wrote {}", path.display());
    };
    if accept {
        write(reference, &picture.image);
        return Ok(());
    }
    std::fs::create_dir_all(results).expect("the folder can be made");
    let name = reference.file_stem().expect("a name").to_string_lossy().into_owned();
    write(&results.join(format!("{name}.exr")), &picture.image);
    write(&results.join(format!("{name}.png")), &picture.image);
    if let Ok(judgement) = &judgement {
        write(
            &results.join(format!("{name}.difference.png")),
            &difference_picture(&judgement.pixels),
        );
    }
    Err(format!("{}: {problem}", reference.display()))
}

#[test]
fn every_golden_scene_looks_like_its_reference() {
    let accept = match std::env::var("SNELL_GOLDEN") {
        Ok(word) => {
            assert_eq!(word, "accept", "SNELL_GOLDEN");
            true
        }
        Err(_) => false,
    };
    let (mut count, mut failures) = (0, Vec::new());
    for integrator in IntegratorKind::ALL {
        for scene in scenes(integrator) {
            let picture = Picture::render(&scene, integrator, 0);
            let results = results().join(integrator.name());
            failures.extend(check(&picture, &scene.with_extension("exr"), &results, accept).err());
            count += 1;
        }
    }
    assert!(
        failures.is_empty(),
        "{} of {count} pictures are not as they were:\n{}",
        failures.len(),
        failures.join("\n")
    );
    assert!(count >= 9, "only {count} golden scenes were found");
}

#[test]
fn every_golden_reference_has_a_scene_and_is_small() {
    let known = IntegratorKind::ALL.map(IntegratorKind::name);
    for family in files(&folder()) {
        let name = family.file_name().expect("a name").to_string_lossy().into_owned();
        let integrator = IntegratorKind::ALL.into_iter().find(|i| i.name() == name);
        let integrator = integrator
            .unwrap_or_else(|| panic!("{name} is not an integrator; known are {known:?}"));
        let scenes = scenes(integrator);
        let stems: BTreeSet<_> = scenes.iter().map(|s| s.with_extension("")).collect();
        assert_eq!(stems.len(), scenes.len(), "two scenes of {name} have the same name");
        for file in files(&family).iter().filter(|f| extension(f) == "exr") {
            assert!(stems.contains(&file.with_extension("")), "{} has no scene", file.display());
            let size = file.metadata().expect("a file").len();
            assert!(size < 60_000, "{} has {size} bytes", file.display());
        }
    }
}

#[test]
fn another_seed_passes() {
    for integrator in IntegratorKind::ALL {
        for scene in scenes(integrator) {
            let picture = Picture::render(&scene, integrator, 1);
            let judgement = Judgement::new(&picture, &scene.with_extension("exr"))
                .expect("the reference is fine");
            eprintln!("{}: {judgement}", scene.display());
            judgement.verdict().unwrap_or_else(|e| panic!("{}: {e}", scene.display()));
        }
    }
}

#[test]
fn changed_missing_and_damaged_references_fail_and_can_be_accepted() {
    let folder = tempfile::tempdir().expect("a folder");
    let (reference, results) = (folder.path().join("ramp.exr"), folder.path().join("results"));
    let ramp = |gain: f32| {
        let value = |i: usize| (i / 20 + i % 20) as f32 / 40.0 * gain;
        let image = picture([20, 20], (0..400).flat_map(|i| [value(i), 0.5, 0.2]).collect());
        Picture { image, errors: vec![[1e-4; 3]; 400] }
    };
    let run = |gain, accept| check(&ramp(gain), &reference, &results, accept);

    let missing = run(1.0, false).expect_err("there is no reference");
    assert!(missing.contains("ramp.exr") && missing.contains("cargo xtask golden"), "{missing}");
    assert!(results.join("ramp.exr").is_file(), "the new picture is there to look at");
    run(1.0, true).expect("accepted");
    run(1.0, false).expect("equal");
    run(1.001, false).expect("rounding");
    let changed = run(1.08, false).expect_err("a channel is brighter by 8 %");
    assert!(changed.contains("FLIP"), "{changed}");
    assert!(results.join("ramp.png").is_file() && results.join("ramp.difference.png").is_file());
    run(1.08, true).expect("accepted");
    run(1.0, false).expect_err("now the old picture is the wrong one");
    std::fs::write(&reference, b"not a picture").expect("writable");
    run(1.08, false).expect_err("the reference is damaged");
}
