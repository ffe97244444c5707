//! Changes of the environment and of the background.

use super::{OpenPicture, OverrideError, error, from_value, light};
use crate::framing::{turned, upright};
use crate::surroundings::{self, BACKGROUNDS, ENVIRONMENTS, Named};
use crate::{Background, Environment, Scene};
use serde_json::Value;
use snell_math::{DAffine3, DVec3, Rgb, real, rotation::about};

/// Replaces the environment, rotates it, or scales its radiance.
pub(super) fn edit_environment(
    scene: &mut Scene,
    key: &str,
    path: &str,
    value: Value,
    picture: OpenPicture<'_>,
) -> Result<(), OverrideError> {
    let up = scene.settings.up.unwrap_or(DVec3::Y);
    match (path, &mut scene.environment) {
        ("", _) => {
            let environment = match &value {
                Value::String(text) => named(key, text, picture)?,
                _ => Some(Environment::Constant(light(key, value)?)),
            };
            // Environments have their zenith at +y.
            let turn = upright(up);
            scene.environment = environment.map(|environment| turned(environment, &turn));
            Ok(())
        }
        (_, None) => Err(error(key, "the scene has no environment")),
        ("scale", Some(Environment::Image { scale, .. })) => {
            *scale = light(key, value)?;
            Ok(())
        }
        ("rotation", Some(Environment::Image { world_from_environment, .. })) => {
            let wanted: f64 = from_value(key, value)?;
            if !wanted.is_finite() {
                return Err(error(key, "a number of degrees"));
            }
            let turn = (wanted - rotation(world_from_environment, up)).to_radians();
            *world_from_environment = DAffine3::from_mat3(about(up.normalize_or(DVec3::Y), turn))
                * *world_from_environment;
            Ok(())
        }
        ("rotation", Some(Environment::Constant(_))) => Ok(()),
        ("scale", Some(Environment::Constant(_))) => {
            Err(error(key, "a constant environment is its radiance: it has no scale"))
        }
        _ => Err(error(key, format!("there is no parameter \"{path}\" (known: rotation, scale)"))),
    }
}

/// The environment of a name; a picture is opened.
fn named(
    key: &str,
    text: &str,
    picture: OpenPicture<'_>,
) -> Result<Option<Environment>, OverrideError> {
    match surroundings::environment(text).map_err(|problem| error(key, problem))? {
        Named::Environment(environment) => Ok(environment),
        Named::Picture => {
            let missing = |problem| error(key, format!("{problem}; expected {ENVIRONMENTS}"));
            Ok(Some(Environment::Image {
                image: picture(text).map_err(missing)?,
                scale: Rgb::WHITE,
                world_from_environment: DAffine3::IDENTITY,
            }))
        }
    }
}

/// Replaces the background, or its colour.
pub(super) fn edit_background(
    scene: &mut Scene,
    key: &str,
    path: &str,
    value: Value,
) -> Result<(), OverrideError> {
    match (path, &mut scene.background) {
        ("", _) => {
            let wanted = match &value {
                Value::String(text) => surroundings::background(text, scene),
                _ => Some(Background::Color(light(key, value)?)),
            };
            let expected = || error(key, format!("expected {BACKGROUNDS}"));
            scene.background = wanted.ok_or_else(expected)?;
            Ok(())
        }
        ("color", Background::Color(color)) => {
            *color = light(key, value)?;
            Ok(())
        }
        ("color", Background::ShadowCatcher(catcher)) => {
            catcher.color = light(key, value)?;
            Ok(())
        }
        ("color", _) => Err(error(key, "this background has no colour of its own")),
        _ => Err(error(key, format!("there is no parameter \"{path}\" (known: color)"))),
    }
}

/// The rotation of an environment about a direction, in degrees from -180 to 180. It is the angle
/// of the middle of the environment's image, measured from `-z` (from `+y` if up is along `z`).
pub fn rotation(world_from_environment: &DAffine3, up: DVec3) -> f64 {
    let up = up.normalize_or(DVec3::Y);
    let level = |v: DVec3| (v - up * v.dot(up)).normalize_or_zero();
    let zero = level(if up.z.abs() > 0.9 { DVec3::Y } else { DVec3::NEG_Z });
    let middle = level(world_from_environment.transform_vector3(DVec3::NEG_Z));
    real::atan2(zero.cross(middle).dot(up), zero.dot(middle)).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::super::{apply, apply_with};
    use super::*;
    use crate::Image;
    use std::sync::Arc;

    #[test]
    fn an_environment_is_a_picture_a_colour_a_sky_or_none() {
        let mut scene = crate::builtin::builtin("cornell-box").expect("the scene is built in");
        let picture = |name: &str| match name {
            "studio.hdr" => Ok(Arc::new(Image::from_f32(2, 1, 3, vec![1.0; 6]))),
            _ => Err(format!("{name}: there is no such file")),
        };
        apply_with(&mut scene, "environment=studio.hdr", &picture).expect("a picture");
        assert!(matches!(scene.environment, Some(Environment::Image { .. })));
        apply_with(&mut scene, "environment=[0.5,1,2]", &picture).expect("a colour");
        let blue = Environment::Constant(Rgb::new(0.5, 1.0, 2.0));
        assert_eq!(scene.environment, Some(blue.clone()));
        let missing = apply_with(&mut scene, "environment=nothing.hdr", &picture);
        let missing = missing.expect_err("no such picture").to_string();
        assert!(missing.contains("nothing.hdr") && missing.contains("sky"), "{missing}");
        assert_eq!(scene.environment, Some(blue));
        apply(&mut scene, "environment=none").expect("darkness");
        assert_eq!(scene.environment, None);
    }

    #[test]
    fn a_background_is_chosen_by_name_and_has_a_colour() {
        let mut scene = crate::builtin::builtin("spheres").expect("the scene is built in");
        apply(&mut scene, "background=studio").expect("a floor");
        apply(&mut scene, "background.color=[0.5,0.5,0.5]").expect("a colour");
        let Background::ShadowCatcher(floor) = scene.background else { panic!("a floor") };
        assert_eq!(floor.color, Rgb::splat(0.5));
        apply(&mut scene, "background=transparent").expect("none");
        assert_eq!(scene.background, Background::Transparent);
        assert!(apply(&mut scene, "background.color=[1,1,1]").is_err());
        apply(&mut scene, "background=[0.1,0.2,0.3]").expect("a colour");
        assert_eq!(scene.background, Background::Color(Rgb::new(0.1, 0.2, 0.3)));
        let wrong = apply(&mut scene, "background=plaid").expect_err("no such thing").to_string();
        assert!(wrong.contains("studio"), "{wrong}");
    }
}
