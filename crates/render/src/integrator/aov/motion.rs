//! How far what a pixel shows moves over the picture while the shutter is open.

use super::colors::value;
use super::{AovKind, Declared, FirstHit, Needs};
use crate::integrator::Context;
use crate::integrator::camera_path::camera_at;
use snell_intersect::{Geometry, GeometryId, Hit};
use snell_math::{DVec2, DVec3, Ray, Rgb};
use snell_scene::Camera;

/// The way over the picture.
pub const MOTION: Declared = Declared {
    name: "motion",
    channels: &["X", "Y"],
    kind: AovKind::Averaged,
    needs: Needs::Motion,
    values: |context, first, camera, values| {
        values.extend(on_the_picture(context, camera, first));
    },
    // As normal maps are seen: grey where nothing moves; 64 pixels are as much as is shown.
    preview: |values, _| {
        let f = |i| (value(values, i) / 128.0 + 0.5).clamp(0.0, 1.0);
        Rgb::new(f(0), f(1), 0.5)
    },
};

/// Distance of what is seen behind the scene, in radii of the scene.
const FAR: f64 = 1e5;

/// The way over the picture from where the shutter opens to where it closes, in pixels, to the
/// right and down. Zero where nothing moves or a part of the way is out of the camera's sight.
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

/// True if the camera moves or anything that it may see.
pub fn is_any(context: &Context) -> bool {
    context.scene.moves || !context.settings.later_cameras.is_empty()
}

/// Where a point of a surface that is at `point` at a time is when the shutter opens and when it
/// closes.
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

/// A point that is seen behind the scene.
fn behind(ray: &Ray, radius: f64) -> DVec3 {
    ray.origin.as_dvec3() + ray.direction.as_dvec3() * (radius * FAR)
}
