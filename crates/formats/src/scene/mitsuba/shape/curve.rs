//! Curves in files: lines of a position and a radius, with strands separated by empty lines.

use super::super::Builder;
use super::super::object::Object;
use super::super::value::shortened;
use crate::mesh::text::{Reader, Text, decoded};
use crate::scene::fault::Fault;
use crate::{Input, ReadError};
use snell_intersect::{Curves, StrandBasis};
use snell_math::{DAffine3, Vec3, Vec4};
use std::sync::Arc;

impl Builder<'_> {
    /// The transformed strands of a file. Radii are those of the file, whatever the scale of the
    /// transform. `None` if there are none.
    pub(super) fn curves(
        &mut self,
        object: &Object,
        basis: StrandBasis,
        place: DAffine3,
    ) -> Result<Option<Arc<Curves>>, Fault> {
        let (name, at) = object.file_name()?;
        let input = self.open(name, at)?;
        let (mut points, strands) = read(&input, basis)?;
        self.count_triangles(at, points.len())?;
        for point in &mut points {
            let position = place.transform_point3(point.truncate().as_dvec3());
            *point = position.as_vec3().extend(point.w);
        }
        let curves = Curves::new(basis, points, strands);
        let curves =
            curves.map_err(|error| Fault::new(at, error.to_string(), "export the file again"))?;
        if curves.strands().is_empty() {
            self.note("empty curves", at, || {
                format!("\"{}\" has no curves; it was left out", shortened(name))
            });
            return Ok(None);
        }
        Ok(Some(Arc::new(curves)))
    }
}

/// The points of a file, and the number of points of each strand.
fn read(input: &Input, basis: StrandBasis) -> Result<(Vec<Vec4>, Vec<u32>), ReadError> {
    let bytes = decoded(&input.bytes);
    let mut reader = Reader::new(input, &bytes, Text::new(&bytes, 0));
    let (mut points, mut strands) = (Vec::new(), Vec::new());
    let mut start = 0;
    loop {
        let is_at_end = reader.text.is_at_end();
        let here = reader.text.position();
        let mut ahead = reader.text.clone();
        if ahead.word().is_some() {
            points.push(point(&mut reader)?);
            if points.len() > input.options.limits.elements {
                let problem = format!(
                    "more than {} points of curves, the limit",
                    input.options.limits.elements
                );
                return Err(reader.error(here, problem, "split the file"));
            }
        } else if points.len() > start {
            let count = points.len() - start;
            if basis.segments(count).is_none() {
                let least = if basis == StrandBasis::Linear { 2 } else { 4 };
                let problem =
                    format!("a curve of {count} points ends here, expected {least} or more");
                return Err(reader.error(here, problem, "give more points, or remove the curve"));
            }
            strands.push(count as u32);
            start = points.len();
        }
        if is_at_end {
            return Ok((points, strands));
        }
        reader.text.next_line();
    }
}

fn point(reader: &mut Reader) -> Result<Vec4, ReadError> {
    let mut position = Vec3::ZERO;
    for x in 0..3 {
        position[x] = reader.number("a coordinate of a point of a curve", false)?;
    }
    Ok(position.extend(reader.number("the radius of a point of a curve", false)?))
}
