//! Finds the surface at a pixel.

use crate::describe::corners;
use crate::face::face;
use crate::protocol::PickedHit;
use crate::session::Snapshot;
use snell_intersect::{SurfaceInteraction, SurfacePoint};
use snell_math::{Bounds3d, DVec2, Ray, Transform, Vec2, real};
use snell_render::CompiledScene;
use snell_scene::{CameraSample, NodeId, Scene};

/// Directions in which a near surface is looked for, and steps in each.
const AROUND: u32 = 16;
const STEPS: u32 = 4;
/// A surface is looked for at most so far away, in pixels.
const FARTHEST: f64 = 64.0;

/// The surface at a position of the picture; if there is none, the nearest within `reach` pixels.
pub fn near(
    snapshot: &Snapshot,
    compiled: &CompiledScene,
    [x, y]: [f64; 2],
    reach: f64,
) -> Option<PickedHit> {
    let reach = if reach > 0.0 { reach.min(FARTHEST) } else { 0.0 };
    let ring = |step: u32| {
        let radius = reach * f64::from(step) / f64::from(STEPS);
        let turn = |i: u32| f64::from(i) / f64::from(AROUND) * std::f64::consts::TAU;
        (0..AROUND).map(turn).map(move |a| [x + radius * real::cos(a), y + radius * real::sin(a)])
    };
    let steps = if reach > 0.0 { STEPS } else { 0 };
    std::iter::once([x, y])
        .chain((1..=steps).flat_map(ring))
        .find_map(|pixel| pick(snapshot, compiled, pixel))
}

/// The surface that the camera sees at a position of the picture, in pixels from its upper left
/// corner.
pub fn pick(snapshot: &Snapshot, compiled: &CompiledScene, pixel: [f64; 2]) -> Option<PickedHit> {
    let film = DVec2::from(pixel);
    let [width, height] = snapshot.settings.size.map(f64::from);
    if !(0.0..=width).contains(&film.x) || !(0.0..=height).contains(&film.y) {
        return None;
    }
    let sample = CameraSample { film, lens: Vec2::splat(0.5) };
    let ray = snapshot.camera.ray(&sample, snapshot.settings.size).ray;
    let filter = snell_render::job::camera_filter(compiled);
    let hit = compiled.world.closest_one(&ray, filter.at(0));
    if !hit.is_hit() {
        return None;
    }
    let surface = compiled.world.interaction(&ray, &hit);
    let material = compiled.material_id(&hit);
    let path = compiled.node_path(&hit);
    let nodes = &snapshot.scene.nodes;
    let name =
        |id: &snell_scene::NodeId| nodes.get(id.index()).map_or(String::new(), |n| n.name.clone());
    let face = face(&compiled.world, &hit);
    let side = if surface.is_front_facing(ray.direction) { 1.0 } else { -1.0 };
    Some(PickedHit {
        position: surface.position.as_dvec3().to_array(),
        normal: surface.shading_normal.as_dvec3().to_array(),
        distance: f64::from(hit.t),
        node: path.last().map(|n| n.0),
        path: path.iter().map(name).collect(),
        nodes: path.iter().map(|id| id.0).collect(),
        material: (material.index() < snapshot.scene.materials.len()).then_some(material.0),
        material_name: compiled.material(material).name.clone(),
        surface: compiled.surface_number(&hit),
        primitive: hit.primitive,
        bounds: bounds_of(&snapshot.scene, &path).as_ref().map(corners),
        facing: (surface.geometric_normal * side).as_dvec3().to_array(),
        thickness: thickness(compiled, &surface, &ray),
        corners: face.iter().flat_map(|f| &f.corners).map(|corner| corner.to_array()).collect(),
        sharp: face.map(|f| f.sharp).unwrap_or_default(),
    })
}

/// The box around the last of these nodes, each the child of the one before, from the root.
fn bounds_of(scene: &Scene, path: &[NodeId]) -> Option<Bounds3d> {
    let place = |id: &NodeId| Some(scene.nodes.get(id.index())?.transform);
    let world_from_node = path.iter().map(place).reduce(|a, b| Some(a? * b?))??;
    let bounds = scene.node_bounds().ok()?.remove(path.last()?)?;
    let bounds = Transform::new(world_from_node)?.bounds(&bounds);
    (bounds.is_finite() && !bounds.is_empty()).then_some(bounds)
}

/// How thick the body is below a point: the length of the ray from there against the normal to the
/// opposite side. `None` where the next surface is no opposite side, as below a sheet: a body is
/// left through a surface of the other side.
fn thickness(compiled: &CompiledScene, surface: &SurfaceInteraction, seen_by: &Ray) -> Option<f64> {
    let is_front = surface.is_front_facing(seen_by.direction);
    let inwards = surface.geometric_normal * if is_front { -1.0 } else { 1.0 };
    let ray = Ray::new(SurfacePoint::from(surface).ray_origin(inwards), inwards);
    let filter = snell_render::job::camera_filter(compiled);
    let hit = compiled.world.closest_one(&ray, filter.at(0));
    if !hit.is_hit() || compiled.world.is_entering(&ray, &hit) == is_front {
        return None;
    }
    let opposite = compiled.world.interaction(&ray, &hit).position;
    Some((opposite.as_dvec3() - surface.position.as_dvec3()).length())
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_formats::image::Display;
    use snell_intersect::BuildOptions;
    use snell_math::DVec3;
    use snell_render::Settings;
    use std::sync::Arc;
    use std::time::Instant;

    /// What is picked in the middle of a picture of this scene.
    fn middle(scene: &Scene) -> Option<PickedHit> {
        at(scene, [4.0, 3.0], 0.0)
    }

    /// What is picked near a position in a picture of 8 x 6 pixels.
    fn at(scene: &Scene, pixel: [f64; 2], reach: f64) -> Option<PickedHit> {
        let compiled = CompiledScene::new(scene, &BuildOptions::default()).expect("valid");
        let snapshot = Snapshot {
            version: 0,
            generation: 0,
            geometry: 0,
            placement: 0,
            light: 0,
            moving: Arc::default(),
            scene: Arc::new(scene.clone()),
            camera: scene.cameras[0].clone(),
            seq: 0,
            settings: Settings { size: [8, 6], ..Settings::default() },
            display: Display::default(),
            moved: Instant::now(),
        };
        near(&snapshot, &compiled, pixel, reach)
    }

    #[test]
    fn beside_a_body_the_nearest_surface_is_picked_within_reach() {
        let mut scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        // So far away that the box is a small part of the picture.
        let camera = &mut scene.cameras[0];
        camera.eye += camera.towards * -1500.0;
        assert!(middle(&scene).is_some() && at(&scene, [0.5, 3.0], 0.0).is_none());
        let found = at(&scene, [0.5, 3.0], 4.0).expect("it is within reach");
        assert!(found.position[0].abs() < 600.0);
        assert!(at(&scene, [0.5, 3.0], f64::NAN).is_none());
    }

    #[test]
    fn a_hit_has_the_corners_of_its_face_and_the_thickness_of_its_body() {
        let mut scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        let camera = &mut scene.cameras[0];
        // Straight down onto the middle of the short block, which is 165 high.
        (camera.eye, camera.towards) = (DVec3::new(185.0, 500.0, 169.0), DVec3::NEG_Y);
        camera.up = DVec3::NEG_Z;
        let hit = middle(&scene).expect("the block");
        assert!((hit.position[1] - 165.0).abs() < 1e-3, "{:?}", hit.position);
        assert_eq!(hit.facing.map(f64::round), [0.0, 1.0, 0.0]);
        assert!(hit.corners.len() >= 3 && hit.sharp.len() == hit.corners.len());
        assert!(hit.corners.iter().all(|corner| (corner[1] - 165.0).abs() < 1e-3));
        assert!(hit.sharp.iter().filter(|&&is_sharp| is_sharp).count() >= 2, "{:?}", hit.sharp);
        // The block has no underside, and the floor below it is none.
        assert_eq!(hit.thickness, None);

        // A ball of radius 1 in the middle, seen from the front.
        let mut scene = snell_scene::builtin::builtin("spheres").expect("it is built in");
        let camera = &mut scene.cameras[0];
        (camera.eye, camera.towards, camera.up) =
            (DVec3::new(0.0, 1.0, 6.0), DVec3::NEG_Z, DVec3::Y);
        let hit = middle(&scene).expect("the ball");
        assert!(hit.corners.is_empty() && (hit.distance - 5.0).abs() < 1e-4);
        assert!((hit.thickness.expect("a ball is closed") - 2.0).abs() < 1e-4);
    }

    #[test]
    fn what_is_hidden_from_the_camera_is_not_picked() {
        let mut scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        let first = middle(&scene).expect("a surface");
        let material = first.material.expect("it has a material");
        scene.materials[material as usize].visible_to_camera = false;
        let next = middle(&scene);
        assert!(next.is_none_or(|next| next.material != Some(material)));
    }
}
