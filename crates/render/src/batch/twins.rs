//! Helpers for tests of batch shading, which render pictures at every SIMD level.

use crate::compile::Moving;
use crate::{CompiledScene, Job, Settings};
use snell_intersect::{BuildOptions, TriangleMesh};
use snell_math::simd::Level;
use snell_math::{DAffine3, Vec3};
use snell_scene::{Geometry, NodeId, Pose, Scene};
use std::sync::Arc;

/// Fails unless the picture and all of its layers have the same bits at every SIMD level of this
/// machine. Portable code shades one vertex at a time, the other levels in batches. Returns the
/// picture.
pub fn assert_same_at_every_level(scene: &Scene, moving: &Moving, settings: &Settings) -> Vec<f32> {
    let picture = |simd: Level| {
        let options = BuildOptions { simd, ..BuildOptions::default() };
        let compiled = CompiledScene::moving(scene, moving, &options, None).expect("a valid scene");
        let image = Job::new(&compiled, &scene.cameras[0], settings).run(1, &|_| true).0.image();
        image.layers.into_iter().map(|layer| layer.values).collect::<Vec<_>>()
    };
    let one_by_one = picture(Level::Scalar);
    for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
        for (number, (found, expected)) in picture(level).iter().zip(&one_by_one).enumerate() {
            let is_alike =
                found.iter().map(|x| x.to_bits()).eq(expected.iter().map(|x| x.to_bits()));
            let moves = moving.nodes.len();
            assert!(
                is_alike,
                "{} at {level}, layer {number}, moving {moves}: {settings:?}",
                scene.name
            );
        }
    }
    one_by_one.into_iter().next().unwrap_or_default()
}

/// Lets things move while the shutter is open: every second node with surfaces turns, and the first
/// mesh of the others grows.
pub fn every_second_node(scene: &Scene) -> Moving {
    let mut later = Pose::default();
    let has_surfaces = |id: &NodeId| !scene.nodes[id.index()].surfaces.is_empty();
    for (i, id) in (0..scene.nodes.len() as u32).map(NodeId).filter(has_surfaces).enumerate() {
        let node = &scene.nodes[id.index()];
        if i % 2 == 0 {
            later.transforms.insert(id, node.transform * DAffine3::from_rotation_z(0.1));
        } else if let Geometry::Mesh(mesh) = &node.surfaces[0].geometry
            && later.meshes.is_empty()
        {
            let mut grown = TriangleMesh::clone(mesh);
            grown.positions.iter_mut().for_each(|p: &mut Vec3| *p *= 1.1);
            later.meshes.insert((id, 0), Arc::new(grown));
        }
    }
    let nodes =
        later.transforms.keys().copied().chain(later.meshes.keys().map(|(id, _)| *id)).collect();
    Moving { nodes, later: vec![later] }
}
