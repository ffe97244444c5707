//! Environments and backgrounds by name: `--environment`, `--background`, and the keys
//! `environment` and `background` of `-D`.

use crate::framing::{default_sky, studio_background};
use crate::light::sky::Sky;
use crate::{Background, Environment, Scene};
use snell_math::{DVec3, Rgb};

/// What a text says about light from all around.
#[derive(Clone, Debug, PartialEq)]
pub enum Named {
    /// This environment, which has its zenith at `+y`; `None` for darkness.
    Environment(Option<Environment>),
    /// The picture of this name.
    Picture,
}

/// The names of environments, for messages.
pub const ENVIRONMENTS: &str = "white, black, #rrggbb or r,g,b (finite and not negative), \
    none, sky, sky:…, or the name of a picture";

/// The names of backgrounds, for messages.
pub const BACKGROUNDS: &str =
    "environment, studio, transparent (or none), white, black, #rrggbb or r,g,b";

/// The environment that a text names: `none`, `sky` (a studio), `sky:elevation=35,…` (a clear day),
/// a colour, or a picture.
///
/// # Errors
/// If a parameter of the clear day is unknown or out of its range.
pub fn environment(text: &str) -> Result<Named, String> {
    Ok(Named::Environment(match text {
        "none" => None,
        "sky" => Some(default_sky()),
        _ => match (text.strip_prefix("sky:"), color(text)) {
            (Some(parameters), _) => Some(clear_day(parameters)?),
            (None, Some(color)) => Some(Environment::Constant(color)),
            (None, None) => return Ok(Named::Picture),
        },
    }))
}

/// The background that a text names for a scene; `None` if it names none.
pub fn background(text: &str, scene: &Scene) -> Option<Background> {
    Some(match text {
        "environment" => Background::Environment,
        "transparent" | "none" => Background::Transparent,
        "studio" => studio_background(scene, DVec3::Y),
        _ => Background::Color(color(text)?),
    })
}

/// A clear day from `parameter=value,…`.
fn clear_day(text: &str) -> Result<Environment, String> {
    let usage = |problem: String| {
        let ranges =
            Sky::PARAMETERS.map(|(name, least, most)| format!("{name} ({least} to {most})"));
        format!("{problem}; the parameters are {}", ranges.join(", "))
    };
    let mut sky = Sky::default();
    for part in text.split(',').filter(|part| !part.trim().is_empty()) {
        let (name, value) =
            part.split_once('=').ok_or_else(|| usage(format!("\"{part}\" has no \"=\"")))?;
        let slot = sky
            .parameter(name.trim())
            .ok_or_else(|| usage(format!("\"{name}\" is not a parameter")))?;
        *slot = value.trim().parse().map_err(|_| usage(format!("\"{value}\" is not a number")))?;
    }
    sky.environment().map_err(|error| usage(error.to_string()))
}

/// A colour: `white`, `black`, `#rrggbb` (sRGB) or `r,g,b` (linear).
pub fn color(text: &str) -> Option<Rgb> {
    match text {
        "white" => return Some(Rgb::WHITE),
        "black" => return Some(Rgb::BLACK),
        _ => {}
    }
    if let Some(hex) = text.strip_prefix('#') {
        let byte = |i: usize| {
            u8::from_str_radix(hex.get(i..i + 2)?, 16).ok().map(|b| f32::from(b) / 255.0)
        };
        return (hex.len() == 6).then(|| Some(Rgb::from_srgb(byte(0)?, byte(2)?, byte(4)?)))?;
    }
    let numbers: Vec<f32> =
        text.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>()?;
    let [r, g, b] = numbers[..] else { return None };
    let color = Rgb::new(r, g, b);
    (color.is_finite() && r >= 0.0 && g >= 0.0 && b >= 0.0).then_some(color)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_understood() {
        assert_eq!(color("#ff0000"), Some(Rgb::new(1.0, 0.0, 0.0)));
        assert_eq!(color("0.5,1,2"), Some(Rgb::new(0.5, 1.0, 2.0)));
        assert_eq!(color("nan,0,0"), None);
    }

    #[test]
    fn environments_have_names() {
        assert_eq!(environment("none"), Ok(Named::Environment(None)));
        assert_eq!(environment("studio.hdr"), Ok(Named::Picture));
        let Ok(Named::Environment(Some(Environment::Constant(grey)))) = environment("0.5,0.5,0.5")
        else {
            panic!("a colour")
        };
        assert_eq!(grey, Rgb::splat(0.5));
        let wrong = environment("sky:height=3").expect_err("no such parameter");
        assert!(wrong.contains("\"height\" is not a parameter") && wrong.contains("elevation"));
    }
}
