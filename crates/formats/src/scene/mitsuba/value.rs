//! Property values as written: numbers, lists, colours, transforms.

use snell_math::spectrum::Spectrum;
use snell_math::{DAffine3, DMat3, DMat4, DVec3, Rgb, Transform};

/// The value of a property.
#[derive(Clone, Debug)]
pub enum Value {
    Float(f64),
    Integer(i64),
    Bool(bool),
    String(String),
    Vector(DVec3),
    Color(Hue),
    Transform(DAffine3),
}

impl Value {
    /// The kind of value, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Float(_) => "float",
            Self::Integer(_) => "integer",
            Self::Bool(_) => "boolean",
            Self::String(_) => "string",
            Self::Vector(_) => "vector",
            Self::Color(_) => "colour",
            Self::Transform(_) => "transform",
        }
    }
}

/// A colour.
#[derive(Clone, Copy, Debug)]
pub enum Hue {
    /// Linear Rec. 709.
    Rgb(Rgb),
    /// A value that is the same at all wavelengths.
    Uniform(f64),
    /// A factor on a spectrum.
    Spectrum(Spectrum, f64),
}

/// The numbers of a list, separated by commas or spaces; an error quotes the word that is not a
/// number.
pub fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    words.map(number).collect()
}

/// Parses one finite number.
pub fn number(word: &str) -> Result<f64, String> {
    match word.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("\"{}\" is not a number", shortened(word.trim()))),
    }
}

/// The beginning of a text, for messages.
pub fn shortened(text: &str) -> String {
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    }
}

/// Parses three numbers, or one that stands for all three.
pub fn triple(text: &str) -> Result<DVec3, String> {
    match *numbers(text)? {
        [x] => Ok(DVec3::splat(x)),
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        ref found => Err(format!("{} numbers where three were expected", found.len())),
    }
}

/// Parses an sRGB colour `#rrggbb`.
pub fn hex_color(text: &str) -> Option<Rgb> {
    let digits = text.trim().strip_prefix('#')?;
    if digits.len() != 6 || !digits.is_ascii() {
        return None;
    }
    let channel =
        |i: usize| u8::from_str_radix(&digits[i..i + 2], 16).ok().map(|c| f32::from(c) / 255.0);
    Some(from_srgb(Rgb::new(channel(0)?, channel(2)?, channel(4)?)))
}

/// Decodes sRGB values to linear ones.
pub fn from_srgb(color: Rgb) -> Rgb {
    color.map(snell_math::spectrum::srgb_to_linear)
}

/// Parses wavelengths and values, such as `400:0.1, 500:0.2`.
pub fn samples(text: &str) -> Result<Vec<[f32; 2]>, String> {
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    let pairs = words.map(|word| {
        let (lambda, value) = word
            .split_once(':')
            .ok_or_else(|| format!("\"{}\" is not a wavelength and a value", shortened(word)))?;
        Ok([number(lambda)? as f32, number(value)? as f32])
    });
    pairs.collect()
}

/// A spectrum that is 0 outside of its samples.
pub fn table(mut pairs: Vec<[f32; 2]>) -> Result<Hue, String> {
    let edge = |lambda: f32, step: f32| [lambda + step, 0.0];
    if let (Some(first), Some(last)) = (pairs.first().copied(), pairs.last().copied()) {
        if first[0] > 360.0 {
            pairs.insert(0, edge(first[0], -0.01));
        }
        if last[0] < 830.0 {
            pairs.push(edge(last[0], 0.01));
        }
    }
    Spectrum::table(&pairs).map(|spectrum| Hue::Spectrum(spectrum, 1.0))
}

/// A matrix of 16 numbers, or 9 for one without translation, row by row.
pub fn matrix(text: &str) -> Result<DAffine3, String> {
    let found = numbers(text)?;
    let map = match *found {
        [a, b, c, d, e, f, g, h, i] => {
            DAffine3::from_mat3(DMat3::from_cols_array(&[a, d, g, b, e, h, c, f, i]))
        }
        _ => {
            let rows: [f64; 16] = found
                .as_slice()
                .try_into()
                .map_err(|_| format!("{} numbers where 16 were expected", found.len()))?;
            let map = Transform::from_matrix(DMat4::from_cols_array(&rows).transpose());
            return map
                .map(|m| *m.matrix())
                .ok_or_else(|| "the matrix is singular or projective".into());
        }
    };
    Ok(map)
}

/// The transform from a camera to the world. The camera is at `origin` and looks at `target` along
/// its `+z`.
pub fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> Option<DAffine3> {
    let towards = (target - origin).try_normalize()?;
    let left = up.try_normalize()?.cross(towards).try_normalize()?;
    Some(DAffine3::from_mat3_translation(
        DMat3::from_cols(left, towards.cross(left), towards),
        origin,
    ))
}

/// A name in the spelling of versions 2 and 3: `toWorld` is `to_world`, `intIOR` is `int_ior`.
pub fn snake_case(name: &str) -> String {
    let mut snake = String::with_capacity(name.len() + 2);
    let mut after_lower = false;
    for c in name.chars() {
        if c.is_ascii_uppercase() && after_lower {
            snake.push('_');
        }
        after_lower = c.is_ascii_lowercase() || c.is_ascii_digit();
        snake.push(c.to_ascii_lowercase());
    }
    snake
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_names_become_new_ones() {
        for (old, new) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("alphaU", "alpha_u"),
            ("sigmaT", "sigma_t"),
            ("g", "g"),
        ] {
            assert_eq!(snake_case(old), new);
        }
    }

    #[test]
    fn a_camera_looks_along_its_z_with_x_to_the_left() {
        let map = look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y).expect("a view");
        assert_eq!(map.transform_vector3(DVec3::X), DVec3::NEG_X);
        assert_eq!(map.transform_vector3(DVec3::Z), DVec3::NEG_Z);
    }

    #[test]
    fn matrices_are_written_by_rows() {
        let map = matrix("1 0 0 5  0 1 0 6  0 0 1 7  0 0 0 1").expect("a matrix");
        assert_eq!(map.translation, DVec3::new(5.0, 6.0, 7.0));
        assert_eq!(
            matrix("0 1 0 0 0 1 1 0 0").expect("a matrix").transform_vector3(DVec3::Y),
            DVec3::X
        );
    }
}
