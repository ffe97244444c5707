//! Reads attributes of any name, for scene formats that show them.

use super::body::{AsciiSource, BinarySource, Source, skip_element, skip_property};
use super::header::{Element, Format, Header, Property};
use crate::mesh::notes::Notes;
use crate::{Input, ReadError};

/// An attribute of the vertices or faces of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// The number of values of one vertex or face, at least 1.
    pub channels: usize,
    /// The values as they stand in the file, whatever their type.
    pub values: Vec<f32>,
}

/// Reads the attribute of an element, `vertex` or `face`, from a PLY file; `None` if it has none of
/// this name.
///
/// Properties with the same name before `_x`, `_y` …, `_r`, `_g` … or `_0`, `_1` … are one
/// attribute, and `r`, `g`, `b` or `red`, `green`, `blue` are the attribute `color`, as in Mitsuba.
pub fn attribute(input: &Input, element: &str, name: &str) -> Result<Option<Attribute>, ReadError> {
    let header = Header::read(input, &mut Notes::default())?;
    match header.format {
        Format::Ascii => find(&mut AsciiSource::new(input, &header), &header, element, name),
        Format::LittleEndian => {
            find(&mut BinarySource::<false>::new(input, &header), &header, element, name)
        }
        Format::BigEndian => {
            find(&mut BinarySource::<true>::new(input, &header), &header, element, name)
        }
    }
}

fn find(
    source: &mut impl Source,
    header: &Header,
    element: &str,
    name: &str,
) -> Result<Option<Attribute>, ReadError> {
    for found in &header.elements {
        let is_part = |p: &Property| p.length.is_none() && attribute_of(&p.name) == name;
        let channels = found.properties.iter().filter(|p| is_part(p)).count();
        if found.name == element && channels > 0 {
            let values = values(source, found, is_part)?;
            return Ok(Some(Attribute { channels, values }));
        }
        skip_element(source, found)?;
    }
    Ok(None)
}

fn values(
    source: &mut impl Source,
    element: &Element,
    is_part: impl Fn(&Property) -> bool,
) -> Result<Vec<f32>, ReadError> {
    let mut values = Vec::new();
    for _ in 0..element.count {
        for property in &element.properties {
            match is_part(property) {
                true => values.push(source.value(property.value)? as f32),
                false => skip_property(source, property)?,
            }
        }
        source.end_element();
    }
    Ok(values)
}

/// The name of the attribute that a property is a part of.
fn attribute_of(property: &str) -> &str {
    match property {
        "r" | "g" | "b" | "red" | "green" | "blue" => "color",
        _ => match property.rsplit_once('_') {
            Some((name, "x" | "y" | "z" | "w" | "r" | "g" | "b" | "a")) => name,
            Some((name, "0" | "1" | "2" | "3" | "4")) => name,
            _ => property,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReadOptions;

    #[test]
    fn attributes_have_the_values_of_the_file() {
        let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
            property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
            property float weight_0\nelement face 1\nproperty list uchar int vertex_indices\n\
            property float color_0\nproperty float color_1\nproperty float color_2\nend_header\n\
            0 0 0 255 0 51 0.5\n1 0 0 0 1 2 0.25\n0 1 0 3 4 5 2\n3 0 1 2 0.1 0.2 0.3\n";
        let input = Input::from_bytes(
            "a.ply",
            text.into(),
            std::path::Path::new("."),
            &ReadOptions::default(),
        );
        let read = |element, name| attribute(&input, element, name).expect("a PLY file");
        let of = |channels, values: &[f32]| Some(Attribute { channels, values: values.into() });
        assert_eq!(
            read("vertex", "color"),
            of(3, &[255.0, 0.0, 51.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
        );
        assert_eq!(read("vertex", "weight"), of(1, &[0.5, 0.25, 2.0]));
        assert_eq!(read("face", "color"), of(3, &[0.1, 0.2, 0.3]));
        assert_eq!(read("face", "weight"), None);
    }
}
