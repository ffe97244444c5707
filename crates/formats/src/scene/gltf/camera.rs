//! Cameras, placed by their nodes.

use super::Reader;
use super::json::Json;
use crate::ReadError;
use snell_math::DAffine3;
use snell_math::real;
use snell_scene::{Camera, Projection};
use std::f64::consts::PI;

/// Adds the camera of a node, if it has one, and returns its index in the file. The camera looks
/// along the node's `-z`, with `+y` up.
pub(super) fn read(
    reader: &mut Reader,
    node: &Json,
    world_from_node: &DAffine3,
) -> Result<Option<usize>, ReadError> {
    let Some(index) = node.get("camera")? else { return Ok(None) };
    let camera = reader.root.entry("cameras", &index)?;
    let projection = projection(&camera)?;
    if let Some(perspective) = camera.get("perspective")?
        && let Some(angle) = perspective.get("yfov")?
        && is_in_degrees(angle.number()?)
    {
        reader.scene.warn(format!(
            "the angle of view at {} is {} radians, more than half a turn; it was taken as degrees",
            angle.path(),
            angle.number()?
        ));
    }
    // Cameras ignore scale (section 3.10.2): `from_direction` keeps only the directions.
    let axes = &world_from_node.matrix3;
    let name = [node.name(), camera.name()].into_iter().find(|n| !n.is_empty()).unwrap_or_default();
    let camera =
        Camera::from_direction(world_from_node.translation, -axes.z_axis, axes.y_axis, projection);
    reader.scene.cameras.push(Camera { name, ..camera });
    index.size().map(Some)
}

/// True for an angle of view that radians cannot be, and degrees can. Of 4 to 9 degrees, which few
/// cameras have, a mistake of another kind is as likely.
fn is_in_degrees(angle: f64) -> bool {
    (10.0..180.0).contains(&angle)
}

/// The projection of a camera. The vertical extent is kept; the horizontal one follows from the
/// picture, so that nothing is stretched if the picture's shape differs from the camera's aspect
/// ratio.
pub(super) fn projection(camera: &Json) -> Result<Projection, ReadError> {
    let kind = camera.require("type")?;
    match kind.string()? {
        "perspective" => {
            let angle = camera.require("perspective")?.require("yfov")?;
            let given = angle.number()?;
            let y = if is_in_degrees(given) { given.to_radians() } else { given };
            if !(y > 0.0 && y < PI) {
                return Err(angle.error(format!(
                    "the angle of view is {given} radians, expected more than 0 and less than pi"
                )));
            }
            Ok(Projection::Perspective { tan_half_fov: [None, Some(real::tan(y / 2.0))] })
        }
        "orthographic" => {
            let height = camera.require("orthographic")?.require("ymag")?;
            let y = height.number()?.abs();
            if y == 0.0 {
                return Err(height.error("half of the height of the view is 0"));
            }
            Ok(Projection::Orthographic { half_size: [None, Some(y)] })
        }
        other => Err(kind.error(format!(
            "\"{other}\" is not a type of camera; expected \"perspective\" or \"orthographic\""
        ))),
    }
}
