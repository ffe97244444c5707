//! Scenes in which another direction than `+y` is up.

use crate::graph::{Background, Environment, Scene};
use snell_math::glam::DQuat;
use snell_math::{DAffine3, DVec3};

/// The rotation that turns `+y`, where environments have their zenith, to `up`; the shortest one.
/// With `+z` up, the middle of an environment's picture, `-z`, is turned to `+y`, and `+x` stays. A
/// direction that is zero or not finite counts as `+y`.
pub fn upright(up: DVec3) -> DAffine3 {
    let up = up.try_normalize().filter(|up| up.is_finite()).unwrap_or(DVec3::Y);
    if up == DVec3::Y {
        return DAffine3::IDENTITY;
    }
    // The rotations to axes have no rounding errors.
    let turn = DAffine3::from_quat(DQuat::from_rotation_arc(DVec3::Y, up));
    let exact = DAffine3::from_cols_array(&turn.to_cols_array().map(f64::round));
    if exact.abs_diff_eq(turn, 1e-12) { exact } else { turn }
}

/// An environment, mapped by `by` after all else.
pub fn turned(environment: Environment, by: &DAffine3) -> Environment {
    match environment {
        Environment::Image { image, scale, world_from_environment } => Environment::Image {
            image,
            scale,
            world_from_environment: *by * world_from_environment,
        },
        constant @ Environment::Constant(_) => constant,
    }
}

/// Turns a scene so that `+y` is up, with its cameras, lights, environment and floor, for formats
/// in which it is always so. Media, patterns and portals stay where they are.
pub fn stand_up(scene: &mut Scene) {
    let Some(up) = scene.settings.up.take() else { return };
    let by = upright(up).inverse();
    if by == DAffine3::IDENTITY {
        return;
    }
    let root = &mut scene.nodes[scene.root.index()];
    root.transform = by * root.transform;
    for camera in &mut scene.cameras {
        *camera = camera.moved(&by);
    }
    for light in &mut scene.lights {
        *light = light.moved(&by);
    }
    scene.environment = scene.environment.take().map(|environment| turned(environment, &by));
    if let Background::ShadowCatcher(floor) = &mut scene.background {
        floor.up = by.transform_vector3(floor.up);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::light::Directional;
    use snell_math::Rgb;

    #[test]
    fn with_z_up_the_middle_of_a_picture_is_at_y() {
        let turn = upright(DVec3::Z * 3.0);
        let at = |v: DVec3| turn.transform_vector3(v);
        assert_eq!([DVec3::Y, DVec3::NEG_Z, DVec3::X].map(at), [DVec3::Z, DVec3::Y, DVec3::X]);
        for up in [DVec3::Y, DVec3::ZERO, DVec3::NAN] {
            assert_eq!(upright(up), DAffine3::IDENTITY);
        }
        for up in [DVec3::NEG_Y, DVec3::X, DVec3::NEG_Z, DVec3::new(1.0, 2.0, -3.0)] {
            let turned = upright(up).transform_vector3(DVec3::Y);
            assert!((turned - up.normalize()).length() < 1e-12, "{up}");
            assert!((upright(up).matrix3.determinant() - 1.0).abs() < 1e-12, "{up}");
        }
    }

    #[test]
    fn a_scene_that_is_stood_up_looks_the_same_to_its_camera() {
        let mut scene = Scene::new("z");
        scene.settings.up = Some(DVec3::Z);
        let eye = DVec3::new(1.0, -5.0, 2.0);
        scene.cameras.push(Camera::from_target(eye, DVec3::ZERO, DVec3::Z, Projection::Panoramic));
        scene.add_light(Directional { direction: DVec3::NEG_Z, irradiance: Rgb::WHITE });
        let before = scene.clone();
        stand_up(&mut scene);
        let root = scene.nodes[scene.root.index()].transform;
        let (old, new) = (&before.cameras[0], &scene.cameras[0]);
        for point in [DVec3::ZERO, DVec3::new(0.3, 0.2, 1.0)] {
            let seen = new.project(root.transform_point3(point), [640, 480]).expect("in view");
            let expected = old.project(point, [640, 480]).expect("in view");
            assert!((seen - expected).length() < 1e-9);
        }
        assert_eq!(root.transform_vector3(DVec3::Z), DVec3::Y);
        assert_eq!(scene.settings.up, None);
        let crate::light::Light::Directional(light) = &scene.lights[0] else { panic!("a light") };
        assert!((light.direction - DVec3::NEG_Y).length() < 1e-12);
    }
}
