//! The cost of each pixel in each acceleration structure: heat maps for comparison.

use crate::explain::Subject;
use rayon::prelude::*;
use snell_math::{DVec2, Vec2};
use snell_scene::CameraSample;

/// Maximum number of pixels of a map.
const MAX_PIXELS: u32 = 512 * 512;

/// Approximate limit on the number of nodes, cells and primitives of all rays of a map. The
/// resolution is reduced if each ray visits too many.
const MAX_WORK: f64 = 4e8;
/// Rays along each side of the picture that estimate the work per ray.
const PROBES: u32 = 4;

/// Width and height of a map of at most `most` pixels, with the aspect ratio of the picture.
fn size_of(subject: &Subject, width: u32, most: f64) -> [u32; 2] {
    let [w, h] = subject.settings.size.map(f64::from);
    let width = f64::from(width.clamp(16, 2048));
    let scale = (most / (width * width * h / w)).sqrt().min(1.0);
    [width * scale, width * scale * h / w].map(|side| (side.round() as u32).max(1))
}

/// For the camera ray through the centre of each pixel of a picture of this size, row by row: the
/// number of visited nodes and cells, and the number of tested primitives.
fn costs(subject: &Subject, size: [u32; 2]) -> Vec<[u32; 2]> {
    let Subject { compiled, camera, settings, .. } = subject;
    let filter = snell_render::job::camera_filter(compiled);
    let share = [0, 1].map(|axis| f64::from(settings.size[axis]) / f64::from(size[axis]));
    let cost = |i: u32| {
        let [x, y] = [i % size[0], i / size[0]].map(|p| f64::from(p) + 0.5);
        let film = DVec2::new(x * share[0], y * share[1]);
        let ray = camera.ray(&CameraSample { film, lens: Vec2::splat(0.5) }, settings.size).ray;
        let (_, counters) = compiled.world.closest_counted(&ray, filter.at(0));
        [counters.nodes_visited.saturating_add(counters.cells_stepped), counters.primitives_tested]
    };
    (0..size[0] * size[1]).into_par_iter().map(cost).collect()
}

/// The [`costs`] of a map of at most this width as bytes: width, height, and the counts, each
/// little-endian 32 bits.
pub fn map(subject: Subject, width: u32) -> Vec<u8> {
    let probes = costs(&subject, [PROBES; 2]);
    let work: f64 = probes.iter().map(|&[nodes, tests]| f64::from(nodes) + f64::from(tests)).sum();
    let most = MAX_WORK / (work / probes.len() as f64).max(1.0);
    let size = size_of(&subject, width, most.min(f64::from(MAX_PIXELS)));
    let costs = costs(&subject, size);
    size.into_iter().chain(costs.into_iter().flatten()).flat_map(u32::to_le_bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::AcceleratorKind;
    use snell_intersect::BuildOptions;
    use snell_render::{CompiledScene, Settings};

    #[test]
    fn without_a_structure_every_pixel_costs_the_same() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
        let settings = Settings { size: [80, 40], ..Settings::default() };
        let words = |accelerator| {
            let options = BuildOptions { accelerator, ..BuildOptions::default() };
            let compiled = CompiledScene::new(&scene, &options).expect("a valid scene");
            let camera = &scene.cameras[0];
            let bytes = map(
                Subject { scene: &scene, compiled: &compiled, camera, settings: &settings },
                40,
            );
            let word = |b: &[u8]| u32::from_le_bytes(b.try_into().expect("four bytes"));
            bytes.chunks_exact(4).map(word).collect::<Vec<u32>>()
        };
        let none = words(AcceleratorKind::None);
        assert_eq!(none[..2], [40, 20]);
        assert!(
            none.len() == 2 + 2 * 800 && none[2..].chunks(2).all(|c| c[0] == 0 && c[1] == none[3])
        );
        let tree = words(AcceleratorKind::KdTree);
        assert!(
            tree[2..].chunks(2).any(|c| c[0] > 0) && tree[2..].chunks(2).all(|c| c[1] <= none[3])
        );
    }
}
