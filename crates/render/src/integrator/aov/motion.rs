//! The AOV of motion vectors: how far points move in the picture while the shutter is open.

use super::colors::value;
use super::{AovKind, Declared, FirstHit, Needs};
use crate::integrator::Context;
use crate::integrator::camera_path::camera_at;
use snell_intersect::{Geometry, GeometryId, Hit};
use snell_math::{DVec2, DVec3, Ray, Rgb};
use snell_scene::Camera;

/// The AOV of the motion vector.
pub const MOTION: Declared = Declared {
    name: "motion",
    channels: &["X", "Y"],
    kind: AovKind::Averaged,
    needs: Needs::Motion,
    values: |context, first, camera, values| {
        values.extend(on_the_picture(context, camera, first));
    },
    // The preview is encoded like a normal map: grey where nothing moves. Motions are clamped to 64
    // pixels.
    preview: |values, _| {
        let f = |i| (value(values, i) / 128.0 + 0.5).clamp(0.0, 1.0);
        Rgb::new(f(0), f(1), 0.5)
    },
};

/// Distance at which the background is placed, in radii of the scene.
const FAR: f64 = 1e5;

/// The motion vector from the opening to the closing of the shutter in pixels, to the right and
/// down. It is zero where nothing moves, and where the point is outside of the camera's view at
/// either time.
fn on_the_picture(context: &Context, camera: &Camera, first: &FirstHit) -> [f32; 2] {
    if !is_any(context) {
        return [0.0; 2];
    }
    let (scene, settings) = (context.scene, context.settings);
    let [first, last] = match &first.surface {
        Some(surface) => ends(context, first.hit, surface.position.as_dvec3(), first.time),
        None => [behind(first.ray, f64::from(scene.radius)); 2],
    };
    let seen = |point: DVec3, time: f32| -> Option<DVec2> {
        match &settings.later_cameras[..] {
            [] => camera.project(point, settings.size),
            later => camera_at(camera, later, time).project(point, settings.size),
        }
    };
    let way = || Some(seen(last, 1.0)? - seen(first, 0.0)?);
    way().filter(|w| w.is_finite()).map_or([0.0; 2], |w| w.as_vec2().to_array())
}

/// True if the camera or the scene may move while the shutter is open.
pub fn is_any(context: &Context) -> bool {
    context.scene.moves || !context.settings.later_cameras.is_empty()
}

/// The positions, at the opening and at the closing of the shutter, of the surface point that is at
/// `point` at the given time.
fn ends(context: &Context, hit: &Hit, point: DVec3, time: f32) -> [DVec3; 2] {
    let world = &context.scene.world;
    let place = |time| world.world_from_instance_at(hit.instance, time);
    let local = match world.geometry(GeometryId(hit.geometry)) {
        Geometry::MovingMesh(mesh) => {
            let (u, v) = (f64::from(hit.uv.x), f64::from(hit.uv.y));
            [0.0, 1.0].map(|time| {
                let [a, b, c] = mesh.corners(hit.primitive as usize, time).map(|p| p.as_dvec3());
                a + (b - a) * u + (c - a) * v
            })
        }
        _ => [place(time).inverse().point(point); 2],
    };
    [place(0.0).point(local[0]), place(1.0).point(local[1])]
}

/// The point of the background in the direction of a ray.
fn behind(ray: &Ray, radius: f64) -> DVec3 {
    ray.origin.as_dvec3() + ray.direction.as_dvec3() * (radius * FAR)
}
