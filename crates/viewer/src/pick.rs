//! Finds the surface at a pixel.

use crate::protocol::PickedHit;
use crate::session::Snapshot;
use snell_math::{DVec2, Vec2};
use snell_render::CompiledScene;
use snell_scene::CameraSample;

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
    Some(PickedHit {
        position: surface.position.as_dvec3().to_array(),
        normal: surface.shading_normal.as_dvec3().to_array(),
        distance: f64::from(hit.t),
        node: path.last().map(|n| n.0),
        path: path.iter().map(name).collect(),
        material: (material.index() < snapshot.scene.materials.len()).then_some(material.0),
        material_name: compiled.material(material).name.clone(),
        primitive: hit.primitive,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_formats::image::Display;
    use snell_intersect::BuildOptions;
    use snell_render::Settings;
    use snell_scene::Scene;
    use std::sync::Arc;
    use std::time::Instant;

    #[test]
    fn what_is_hidden_from_the_camera_is_not_picked() {
        let mut scene = snell_scene::builtin::builtin("cornell-box").expect("it is built in");
        let picked = |scene: &Scene| {
            let compiled = CompiledScene::new(scene, &BuildOptions::default()).expect("valid");
            let snapshot = Snapshot {
                version: 0,
                generation: 0,
                geometry: 0,
                scene: Arc::new(scene.clone()),
                camera: scene.cameras[0].clone(),
                seq: 0,
                settings: Settings { size: [8, 6], ..Settings::default() },
                display: Display::default(),
                moved: Instant::now(),
            };
            pick(&snapshot, &compiled, [4.0, 3.0])
        };
        let first = picked(&scene).expect("a surface");
        let material = first.material.expect("it has a material");
        scene.materials[material as usize].visible_to_camera = false;
        let next = picked(&scene);
        assert!(next.is_none_or(|next| next.material != Some(material)));
    }
}
