//! The kinds of rays that are measured, generated deterministically for a scene.

use super::scenes::Bench;
use snell_intersect::{AcceptAll, Grouping, Hit, SurfaceInteraction, World};
use snell_lab::coherence::View;
use snell_math::{DVec2, DVec3, Frame, Ray, Vec2, rng, sampling};
use snell_scene::Camera;
use snell_scene::camera::{CameraSample, Projection};

/// A kind of ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Rays from the camera through the middle of each pixel, pixels in Morton order.
    Primary,
    /// Rays from the hit points of primary rays to a light, which test for occlusion.
    Shadow,
    /// Rays from the hit points of primary rays in cosine-distributed directions, in the order of
    /// the pixels.
    Diffuse,
    /// The diffuse rays in random order.
    Shuffled,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Shadow, Self::Diffuse, Self::Shuffled];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Diffuse => "diffuse",
            Self::Shuffled => "shuffled",
        }
    }

    /// The grouping for queries of this kind. Primary and shadow rays of 4x4 pixels have a common
    /// origin or target; the others are incoherent.
    pub fn grouping(self) -> Grouping {
        match self {
            Self::Primary | Self::Shadow => Grouping::Coherent,
            Self::Diffuse | Self::Shuffled => Grouping::None,
        }
    }
}

/// Reads the side of a picture.
pub fn parse_side(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(n) if n.is_power_of_two() && (4..=16384).contains(&n) => Ok(n),
        _ => Err(format!("\"{text}\" is not a side; write a power of two from 4 to 16384")),
    }
}

/// A primary ray and the surface that it hits, if any.
pub type First = (Ray, Option<SurfaceInteraction>);

/// The primary rays of a square picture whose side is a power of two, with the surfaces that they
/// hit.
pub fn first_hits(bench: &Bench, world: &World, side: u32) -> Vec<First> {
    let camera = &bench.camera;
    let ray = |i: u32| {
        let film = DVec2::new(f64::from(even_bits(i)) + 0.5, f64::from(even_bits(i >> 1)) + 0.5);
        camera.ray(&CameraSample { film, lens: Vec2::ZERO }, [side; 2]).ray
    };
    let rays: Vec<Ray> = (0..side * side).map(ray).collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    world.closest(&rays, Grouping::None, &AcceptAll, &mut hits);
    let surface =
        |(ray, hit): (Ray, Hit)| (ray, hit.is_hit().then(|| world.interaction(&ray, &hit)));
    rays.into_iter().zip(hits).map(surface).collect()
}

/// Rays that leave a surface begin this far from it, in radii of the scene: otherwise the peer's
/// fast modes would hit the same surface again. (Snell's own rays do not need it.)
const START: f64 = 1e-4;

/// The rays of a kind.
pub fn rays(kind: Kind, bench: &Bench, first: &[First]) -> Vec<Ray> {
    let start = (bench.world.bounds().radius() * START) as f32;
    let hits = first
        .iter()
        .enumerate()
        .filter_map(|(i, (ray, surface))| Some((i as u32, ray, surface.as_ref()?)));
    match kind {
        Kind::Primary => first.iter().map(|(ray, _)| *ray).collect(),
        Kind::Shadow => hits.map(|(_, _, surface)| shadow_ray(surface, bench, start)).collect(),
        Kind::Diffuse => hits.map(|(i, ray, surface)| bounce(i, ray, surface, start)).collect(),
        Kind::Shuffled => {
            let mut rays: Vec<Ray> =
                hits.map(|(i, ray, surface)| bounce(i, ray, surface, start)).collect();
            for i in (1..rays.len()).rev() {
                rays.swap(i, rng::hash32(i as u32) as usize % (i + 1));
            }
            rays
        }
    }
}

fn shadow_ray(surface: &SurfaceInteraction, bench: &Bench, start: f32) -> Ray {
    let to_light = bench.light - surface.position;
    let origin = surface.ray_origin(to_light);
    let direction = bench.light - origin;
    Ray { t_min: start / direction.length(), t_max: 1.0, ..Ray::new(origin, direction) }
}

/// A diffuse bounce of the ray with number `i`, on the side of the surface that it came from.
fn bounce(i: u32, ray: &Ray, surface: &SurfaceInteraction, start: f32) -> Ray {
    let normal = if surface.is_front_facing(ray.direction) {
        surface.geometric_normal
    } else {
        -surface.geometric_normal
    };
    let direction =
        Frame::from_z(normal).from_local(sampling::cosine_hemisphere(rng::uniform2([i, 1, 2, 3])));
    Ray { t_min: start, ..Ray::new(surface.ray_origin(direction), direction) }
}

/// The view of a camera in a square picture, with positions in pixels; `None` unless all rays leave
/// one point and the picture is flat.
pub fn view(camera: &Camera, side: u32) -> Option<View> {
    let is_flat =
        matches!(camera.projection, Projection::Perspective { .. } | Projection::Intrinsics(_));
    if !is_flat || !camera.has_common_origin() {
        return None;
    }
    // Directions scaled to the plane at distance 1, where they are affine functions of the
    // position.
    let reach = |x: f64, y: f64| {
        let sample = CameraSample { film: DVec2::new(x, y), lens: Vec2::ZERO };
        let direction = camera.ray(&sample, [side; 2]).ray.direction.as_dvec3();
        direction / direction.dot(camera.towards)
    };
    let (size, corner): (f64, DVec3) = (side.into(), reach(0.0, 0.0));
    let eye = camera.eye.as_vec3().as_dvec3();
    View::perspective(
        eye,
        corner,
        (reach(size, 0.0) - corner) / size,
        (reach(0.0, size) - corner) / size,
    )
}

/// Every second bit of a number, from the lowest, compacted.
pub fn even_bits(i: u32) -> u32 {
    (0..16).map(|bit| (i >> (2 * bit) & 1) << bit).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_order_visits_every_pixel_in_blocks() {
        let mut seen = [false; 64];
        for i in 0..64 {
            let (x, y) = (even_bits(i), even_bits(i >> 1));
            seen[(y * 8 + x) as usize] = true;
            let first = i / 16 * 16;
            assert_eq!((x / 4, y / 4), (even_bits(first) / 4, even_bits(first >> 1) / 4), "{i}");
        }
        assert!(seen.iter().all(|s| *s));
    }
}
