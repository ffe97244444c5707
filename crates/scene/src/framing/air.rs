//! Adds fog to scenes that have none.

use crate::graph::{Node, Scene, SceneError, Surface};
use crate::material::Material;
use crate::medium::Homogeneous;
use snell_intersect::shape::Sphere;
use snell_math::{DAffine3, Rgb};

/// Albedo of the fog: the fraction of extinction that is scattering.
const ALBEDO: f32 = 0.95;
/// The radius of the ball of fog, divided by that of the scene.
const MARGIN: f64 = 1.01;

/// Fills a ball around the scene with fog of this extinction coefficient (per scene unit) and
/// isotropic scattering. For a scene without bounds the fog is infinite.
pub fn fill_with_fog(scene: &mut Scene, density: f32) -> Result<(), SceneError> {
    let bounds = scene.bounds()?;
    let fog =
        scene.add_medium(Homogeneous::scattering(Rgb::splat(density), Rgb::splat(ALBEDO), 0.0));
    if !bounds.is_finite() || bounds.is_empty() || bounds.radius() <= 0.0 {
        scene.medium = Some(fog);
        return Ok(());
    }
    let material = scene.add_material(Material::interface("fog", fog));
    let surfaces = vec![Surface::shape(Sphere { radius: bounds.radius() * MARGIN }, material)];
    let transform = DAffine3::from_translation(bounds.center());
    // The fog is added beside the old root, so that the transform of the old root does not affect
    // it.
    let root = scene.root;
    scene.root = scene.add_node(Node { children: vec![root], ..Node::named("scene in fog") });
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::named("fog") });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::builtin;

    #[test]
    fn fog_surrounds_the_scene_and_an_endless_scene_is_full_of_it() {
        let mut scene = builtin("cornell-box").expect("the scene is built in");
        let before = scene.bounds().expect("no cycles");
        fill_with_fog(&mut scene, 0.001).expect("no cycles");
        let after = scene.bounds().expect("no cycles");
        assert!(
            scene.medium.is_none()
                && after.min.cmplt(before.min).all()
                && after.max.cmpgt(before.max).all()
        );
        let mut empty = Scene::new("nothing");
        fill_with_fog(&mut empty, 0.001).expect("no cycles");
        assert!(empty.medium.is_some());
    }
}
