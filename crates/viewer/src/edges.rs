//! Feature edges of what a camera sees: outlines, creases and borders, as lines over the picture.
//!
//! A pixel is on a line if the surface beside it is another object, turns away, or lies in front or
//! behind (Saito and Takahashi, Comprehensible Rendering of 3-D Shapes, SIGGRAPH 1990).

use crate::session::{Session, lock};
use crate::state::valid_camera;
use rayon::prelude::*;
use snell_math::{DVec2, Vec2, Vec3};
use snell_render::CompiledScene;
use snell_scene::{Camera, CameraSample};

/// Maximum number of pixels of a map of edges.
const MAX_PIXELS: u64 = 1 << 23;
/// Surfaces that turn by more than this angle from one pixel to the next have a crease: its cosine,
/// of 30 degrees.
const CREASE: f32 = 0.866;
/// A surface is in front of another if it is off its tangent plane by more pixels than this.
const STEP: f32 = 4.0;

/// What a camera ray meets.
#[derive(Clone, Copy)]
struct Seen {
    /// The object: instance, geometry, material.
    object: [u32; 3],
    position: Vec3,
    normal: Vec3,
    /// Width of the pixel there.
    width: f32,
}

/// The edges that a camera, given as JSON, sees in a picture of this size: for each pixel 255 on a
/// line and 0 elsewhere. The error is a message for the user.
pub fn edges(session: &Session, camera: &str, size: [u32; 2]) -> Result<Option<Vec<u8>>, String> {
    let [width, height] = size;
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels > MAX_PIXELS {
        return Err(format!("edges of {width}x{height} pixels; ask for 1 to {MAX_PIXELS} pixels"));
    }
    let camera = serde_json::from_str(camera).map_err(|e| format!("camera: {e}"))?;
    let camera = valid_camera(camera)?;
    let compiled = lock(&session.compiled).clone();
    Ok(compiled.map(|(_, compiled)| lines(&camera, &compiled, size)))
}

fn lines(camera: &Camera, compiled: &CompiledScene, size: [u32; 2]) -> Vec<u8> {
    let width = size[0] as usize;
    let view = camera.view(size);
    let filter = snell_render::job::camera_filter(compiled);
    let look = |pixel: usize| {
        let film = DVec2::new((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
        let camera_ray = view.ray(&CameraSample { film, lens: Vec2::splat(0.5) });
        let ray = camera_ray.ray;
        let hit = compiled.world.closest_one(&ray, filter.at(0));
        if camera_ray.weight == 0.0 || !hit.is_hit() {
            return None;
        }
        let surface = compiled.world.interaction(&ray, &hit);
        let side = if surface.is_front_facing(ray.direction) { 1.0 } else { -1.0 };
        Some(Seen {
            object: [hit.instance, hit.geometry, compiled.material_id(&hit).0],
            position: surface.position,
            normal: surface.shading_normal * side,
            width: camera_ray.width + camera_ray.spread * hit.t,
        })
    };
    let seen: Vec<Option<Seen>> =
        (0..width * size[1] as usize).into_par_iter().with_min_len(256).map(look).collect();
    let is_line = |pixel: usize| {
        let right = (pixel % width + 1 < width).then(|| pixel + 1);
        let below = (pixel + width < seen.len()).then(|| pixel + width);
        // Lines are two pixels wide: on both sides of the edge.
        let left = (!pixel.is_multiple_of(width)).then(|| pixel - 1);
        let above = pixel.checked_sub(width);
        let beside = [right, below, left, above].into_iter().flatten();
        beside.into_iter().any(|other| is_edge(&seen[pixel], &seen[other]))
    };
    (0..seen.len()).into_par_iter().map(|pixel| if is_line(pixel) { 255 } else { 0 }).collect()
}

/// True if there is an edge between two neighbouring pixels.
fn is_edge(a: &Option<Seen>, b: &Option<Seen>) -> bool {
    let (Some(a), Some(b)) = (a, b) else { return a.is_some() != b.is_some() };
    if a.object != b.object || a.normal.dot(b.normal) < CREASE {
        return true;
    }
    // On one surface, however steep, the next point is in the tangent plane of one of the two.
    let between = b.position - a.position;
    let off = between.dot(a.normal).abs().min(between.dot(b.normal).abs());
    off > STEP * a.width.max(b.width)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::BuildOptions;

    #[test]
    fn a_floor_seen_at_a_flat_angle_has_no_edges_and_a_box_has() {
        let scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("valid");
        let size = [160, 160];
        let lines = lines(&scene.cameras[0], &compiled, size);
        let share = |from: [usize; 2], to: [usize; 2]| {
            let of_row = |y: usize| &lines[y * 160 + from[0]..y * 160 + to[0]];
            let on = (from[1]..to[1]).flat_map(of_row).filter(|&&line| line > 0).count();
            on as f32 / ((to[0] - from[0]) * (to[1] - from[1])) as f32
        };
        // The front of the floor, the middle of the back wall, and the short block.
        assert_eq!(share([45, 147], [70, 152]), 0.0);
        assert_eq!(share([90, 50], [110, 70]), 0.0);
        assert!(share([85, 90], [125, 150]) > 0.02);
        let all = share([0, 0], [160, 160]);
        assert!(all > 0.02 && all < 0.2, "{all}");
    }
}
