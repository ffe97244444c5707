//! Scenes far from zero: maps, buildings and scans in national or world-wide coordinates.
//!
//! Single precision has 24 bits. Of coordinates of some millions of metres those below half a metre
//! are lost, and with them the shape of anything small. Such scenes are shown moved near zero.

use crate::graph::{Background, Scene, SceneError};
use crate::texture::Texture;
use snell_math::{Bounds3d, DAffine3, DVec3, real};

/// Over this many times its size away from zero, something has fewer than 131,072 steps of single
/// precision across.
const FAR: f64 = 64.0;

/// A round point in something with these bounds, if it is far from zero for its size.
pub fn far_origin(bounds: &Bounds3d) -> Option<DVec3> {
    if bounds.is_empty() || !bounds.is_finite() {
        return None;
    }
    let size = (bounds.max - bounds.min).max_element();
    let center = (bounds.min + bounds.max) / 2.0;
    let away = center.abs().max_element();
    if away <= size * FAR || away < f64::from(f32::MIN_POSITIVE) {
        return None;
    }
    // In single precision the size of something small may be anything below a step.
    let step = real::powf(10f64, real::log10(size.max(away * f64::from(f32::EPSILON))).ceil());
    let origin = (center / step).round() * step;
    origin.is_finite().then_some(origin)
}

/// Moves a scene near zero if it is far away, with its cameras, lights, media, portals and
/// patterns, and answers by how much. A scene with motion stays.
pub fn bring_near(scene: &mut Scene) -> Result<Option<DVec3>, SceneError> {
    let is_still = scene.motion.is_none();
    let Some(origin) = far_origin(&scene.bounds()?).filter(|_| is_still) else { return Ok(None) };
    let by = DAffine3::from_translation(-origin);
    let root = &mut scene.nodes[scene.root.index()];
    root.transform = by * root.transform;
    for camera in &mut scene.cameras {
        camera.eye -= origin;
    }
    for light in &mut scene.lights {
        *light = light.moved(&by);
    }
    for medium in &mut scene.media {
        medium.translate(-origin);
    }
    for portal in &mut scene.portals {
        portal.corner -= origin;
    }
    for texture in &mut scene.textures {
        if let Texture::Pattern(pattern) = texture {
            pattern.translate(-origin);
        }
    }
    if let Background::ShadowCatcher(floor) = &mut scene.background {
        floor.height -= floor.up.try_normalize().map_or(0.0, |up| up.dot(origin));
    }
    Ok(Some(-origin))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::{Geometry, Node, Surface};
    use snell_intersect::shape::Sphere;
    use std::sync::Arc;

    fn ball(center: DVec3, radius: f64) -> Scene {
        let mut scene = Scene::new("ball");
        let sphere = Geometry::Shape(Arc::new(Sphere { radius }.into()));
        let transform = DAffine3::from_translation(center);
        scene.add_child(
            scene.root,
            Node { transform, surfaces: vec![Surface::new(sphere)], ..Node::default() },
        );
        scene
    }

    #[test]
    fn what_is_far_for_its_size_is_shown_near_zero() {
        let center = DVec3::new(500_000.25, 4_649_776.5, 100.0);
        let mut far = ball(center, 0.5);
        let camera = crate::Camera::from_target(
            center + DVec3::Z,
            center,
            DVec3::Y,
            crate::camera::Projection::Panoramic,
        );
        far.cameras.push(camera);
        let by = bring_near(&mut far).expect("no cycle").expect("it is far");
        let bounds = far.bounds().expect("no cycle");
        assert!(bounds.min.abs().max_element() < 2.0, "{bounds:?}");
        assert_eq!(far.cameras[0].eye, center + DVec3::Z + by);
        assert_eq!(bring_near(&mut far).expect("no cycle"), None);
        for mut near in [ball(DVec3::ZERO, 1.0), ball(center, 1e5), ball(DVec3::splat(99.0), 1.0)] {
            assert_eq!(bring_near(&mut near).expect("no cycle"), None);
        }
    }
}
