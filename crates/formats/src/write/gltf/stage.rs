//! Cameras and lights, each with a node of its own.

use super::{Document, placed};
use serde_json::{Value, json};
use snell_math::{DAffine3, DMat3, DVec3, Rgb, real};
use snell_scene::light::{Attenuation, Directional, Point, Spot, SpotFalloff};
use snell_scene::{Camera, Light, Projection};

/// Adds the nodes of all cameras; returns the table of cameras.
pub fn cameras(document: &mut Document, top: &mut Vec<usize>) -> Vec<Value> {
    let scene = document.scene;
    let bounds = scene.bounds().ok().filter(|b| !b.is_empty() && b.is_finite());
    let mut table = Vec::new();
    for (i, camera) in scene.cameras.iter().enumerate() {
        let who = if camera.name.is_empty() {
            format!("camera {i}")
        } else {
            format!("camera \"{}\"", camera.name)
        };
        let size = camera.resolution.or(scene.settings.size).unwrap_or([4, 3]);
        let aspect = f64::from(size[0].max(1)) / f64::from(size[1].max(1));
        // Programs that draw triangles need depths that fit the scene; Snell ignores them.
        let depth = bounds.map(|b| b.center().distance(camera.eye) + b.radius());
        let depth = depth.filter(|depth| *depth > 0.0).unwrap_or(DEPTH);
        let Some(mut value) = projection(document, camera, [aspect, depth], &who) else {
            let kind = match camera.projection {
                Projection::Panoramic => "panoramic",
                Projection::EqualArea => "equal-area",
                _ => "fisheye",
            };
            document.output.lose(format!("{who}: a {kind} camera is left out"));
            continue;
        };
        if camera.aperture_radius > 0.0 {
            document.output.lose(format!("{who}: its lens became a pinhole"));
        }
        if camera.resolution.is_some() {
            document.output.lose(format!("{who}: the size of its picture is left out"));
        }
        if camera.clip.is_some() {
            document.output.lose(format!("{who}: the plane that clips it is left out"));
        }
        if !camera.name.is_empty() {
            value["name"] = camera.name.clone().into();
        }
        let axes = DMat3::from_cols(camera.right(), camera.up, -camera.towards);
        let mut node = placed(&DAffine3 { matrix3: axes, translation: camera.eye });
        node["camera"] = table.len().into();
        if !camera.name.is_empty() {
            node["name"] = camera.name.clone().into();
        }
        top.push(document.nodes.len());
        document.nodes.push(node);
        table.push(value);
    }
    table
}

/// The depth of scenes whose extent is unknown.
const DEPTH: f64 = 1e3;

/// The projection of a camera, for this aspect ratio of the picture and depth of the scene; `None`
/// if glTF has none like it.
fn projection(
    document: &mut Document,
    camera: &Camera,
    [aspect, depth]: [f64; 2],
    who: &str,
) -> Option<Value> {
    let near = 1e-5 * depth;
    match &camera.projection {
        Projection::Perspective { tan_half_fov } => {
            let y = match *tan_half_fov {
                [_, Some(y)] => y,
                [Some(x), None] => {
                    document.output.lose(format!("{who}: its angle of view now spans the height"));
                    x / aspect
                }
                [None, None] => 1.0,
            };
            let perspective =
                json!({ "yfov": 2.0 * real::atan(y), "aspectRatio": aspect, "znear": near });
            Some(json!({ "type": "perspective", "perspective": perspective }))
        }
        Projection::Intrinsics(k) => {
            document.output.lose(format!("{who}: a camera matrix became an angle of view"));
            if k.is_distorted() {
                document.output.lose(format!("{who}: the distortion of its lens is left out"));
            }
            let y = f64::from(k.size[1]) / (2.0 * k.focal_length[1].abs());
            let perspective = json!({ "yfov": 2.0 * real::atan(y), "znear": near });
            Some(json!({ "type": "perspective", "perspective": perspective }))
        }
        Projection::Orthographic { half_size } => {
            let (x, y) = match *half_size {
                [Some(x), Some(y)] => (x, y),
                [Some(x), None] => (x, x / aspect),
                [None, Some(y)] => (y * aspect, y),
                [None, None] => (aspect, 1.0),
            };
            let orthographic = json!({ "xmag": x, "ymag": y, "znear": 0.0, "zfar": 2.0 * depth });
            Some(json!({ "type": "orthographic", "orthographic": orthographic }))
        }
        Projection::Panoramic | Projection::EqualArea | Projection::Fisheye { .. } => None,
    }
}

/// Adds the nodes of all lights; returns the table of `KHR_lights_punctual`.
pub fn lights(document: &mut Document, top: &mut Vec<usize>) -> Vec<Value> {
    let mut table = Vec::new();
    for (i, light) in document.scene.lights.iter().enumerate() {
        let Some((value, position, towards)) = light_value(document, light, i) else {
            document.output.lose(format!("light {i}: a {} light is left out", light.name()));
            continue;
        };
        let z = -towards;
        let x = z.any_orthonormal_vector();
        let mut node = placed(&DAffine3 {
            matrix3: DMat3::from_cols(x, z.cross(x), z),
            translation: position,
        });
        node["extensions"] = json!({ "KHR_lights_punctual": { "light": table.len() } });
        document.extensions.insert("KHR_lights_punctual");
        top.push(document.nodes.len());
        document.nodes.push(node);
        table.push(value);
    }
    if document.scene.environment.is_some() {
        document.output.lose("light from all directions (the environment) is left out");
    }
    if document.scene.medium.is_some() {
        document.output.lose("the medium that fills the scene is left out");
    }
    table
}

/// A colour of at most 1 and a factor.
pub fn color_and_strength(color: Rgb) -> ([f32; 3], f32) {
    let strength = color.max_element();
    if strength <= 0.0 || !strength.is_finite() {
        return ([1.0; 3], 0.0);
    }
    let color = color * (1.0 / strength);
    ([color.r, color.g, color.b].map(|c| c.clamp(0.0, 1.0)), strength)
}

fn light_value(document: &mut Document, light: &Light, i: usize) -> Option<(Value, DVec3, DVec3)> {
    let mut fades = |attenuation: &Attenuation| {
        if *attenuation != Attenuation::INVERSE_SQUARE {
            document
                .output
                .lose(format!("light {i}: it now fades by the inverse square of the distance"));
        }
    };
    let value = |kind: &str, color: Rgb| {
        let (color, intensity) = color_and_strength(color);
        json!({ "type": kind, "color": color, "intensity": intensity })
    };
    match light {
        Light::Directional(Directional { direction, irradiance }) => {
            Some((value("directional", *irradiance), DVec3::ZERO, direction.try_normalize()?))
        }
        Light::Point(Point { position, intensity, attenuation, body_radius }) => {
            fades(attenuation);
            if *body_radius > 0.0 {
                document.output.lose(format!("light {i}: the surface around it now casts shadows"));
            }
            Some((value("point", *intensity), *position, DVec3::NEG_Z))
        }
        Light::Spot(Spot { position, direction, intensity, attenuation, falloff }) => {
            fades(attenuation);
            let (inner, outer) = match *falloff {
                SpotFalloff::Smooth { inner, outer } => (inner, outer),
                SpotFalloff::Step { inner, outer } | SpotFalloff::Fourth { inner, outer } => {
                    document.output.lose(format!("light {i}: its edge fades by another curve"));
                    (inner, outer)
                }
                SpotFalloff::Power { cutoff, .. } => {
                    document.output.lose(format!("light {i}: its edge fades by another curve"));
                    (0.0, cutoff)
                }
            };
            let outer = outer.clamp(0.0, std::f64::consts::FRAC_PI_2);
            let mut spot = value("spot", *intensity);
            spot["spot"] =
                json!({ "innerConeAngle": inner.clamp(0.0, outer), "outerConeAngle": outer });
            Some((spot, *position, direction.try_normalize()?))
        }
        // A format handles only the lights listed here, so a new kind of light is left out until it
        // is added.
        _ => None,
    }
}
