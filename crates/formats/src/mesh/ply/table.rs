//! Reads the vertices as a table, with every number that they have.

use super::body::{AsciiSource, BinarySource, Source, skip_element, skip_property};
use super::header::{Format, Header, Type};
use crate::mesh::notes::Notes;
use crate::points::{Column, PointTable, Values};
use crate::{Input, ReadError};

/// The vertices of a file. Properties that are lists are left out.
pub fn points(input: &Input) -> Result<PointTable, ReadError> {
    let header = Header::read(input, &mut Notes::default())?;
    match header.format {
        Format::Ascii => read(&mut AsciiSource::new(input, &header), &header),
        Format::LittleEndian => read(&mut BinarySource::<false>::new(input, &header), &header),
        Format::BigEndian => read(&mut BinarySource::<true>::new(input, &header), &header),
    }
}

fn read(source: &mut impl Source, header: &Header) -> Result<PointTable, ReadError> {
    for element in &header.elements {
        if element.name != "vertex" {
            skip_element(source, element)?;
            continue;
        }
        let (names, mut values): (Vec<_>, Vec<_>) = element
            .properties
            .iter()
            .filter(|p| p.length.is_none())
            .map(|p| (p.name.clone(), empty(p.value)))
            .unzip();
        let count = if element.properties.is_empty() { 0 } else { element.count };
        for _ in 0..count {
            let mut columns = values.iter_mut();
            for property in &element.properties {
                if property.length.is_some() {
                    skip_property(source, property)?;
                } else if let Some(column) = columns.next() {
                    column.push(source.value(property.value)?);
                }
            }
            source.end_element();
        }
        let column = |(name, values)| Column { name, channels: 1, values };
        let columns = names.into_iter().zip(values).map(column).collect();
        return Ok(PointTable { width: count as usize, height: 1, columns });
    }
    Ok(PointTable { height: 1, ..PointTable::default() })
}

fn empty(kind: Type) -> Values {
    match kind {
        Type::I8 => Values::I8(Vec::new()),
        Type::U8 => Values::U8(Vec::new()),
        Type::I16 => Values::I16(Vec::new()),
        Type::U16 => Values::U16(Vec::new()),
        Type::I32 => Values::I32(Vec::new()),
        Type::U32 => Values::U32(Vec::new()),
        Type::F32 => Values::F32(Vec::new()),
        Type::F64 => Values::F64(Vec::new()),
    }
}
