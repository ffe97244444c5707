//! Rays that leave the surfaces at hits.

use crate::arrays::{array, broadcast, common_shape, filled, leading, numpy, shown, slice};
use crate::live::{Asked, Live};
use crate::precision::Precision;
use crate::work::{Threads, run};
use numpy::{PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use rayon::prelude::*;
use snell_intersect::Rays;
use snell_math::DVec3;

/// Number of rays that a thread makes at a time.
const PIECE: usize = 4096;

/// Rays `(..., 6)` that leave the answers with these numbers in `directions`; all answers, if none
/// are given.
pub fn rays<'py, P: Precision>(
    live: &Live<P, P>,
    directions: &Bound<'py, PyAny>,
    numbers: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = directions.py();
    let Asked::Rays(kept, ids) = &live.asked else {
        return Err(PyTypeError::new_err("spawn_rays: only hits of rays have it"));
    };
    let (shape, numbers) = match numbers {
        Some(numbers) => {
            let shape: Vec<usize> = numbers.getattr("shape")?.extract()?;
            let flat = numpy(py, "asarray")?.call1((numbers, "int64"))?;
            let flat: PyReadonlyArrayDyn<'_, i64> =
                crate::arrays::contiguous(flat.cast::<PyUntypedArray>()?)?;
            (shape, Some(flat))
        }
        None => (live.shape.clone(), None),
    };
    let numbers = numbers.as_ref().map(slice).transpose()?;
    let number = |i: usize| numbers.map_or(i, |numbers| numbers[i] as usize);
    let given = array(directions, "directions")?;
    let lead = leading(&given, 3, "directions")?;
    crate::arrays::is_double(&given, "directions")?;
    if common_shape(&lead, &shape).as_deref() != Some(&shape[..]) {
        return Err(PyValueError::new_err(format!(
            "directions: shape is {}, expected {} or what broadcasts to it",
            shown(given.shape()),
            shown(&[&shape[..], &[3]].concat()),
        )));
    }
    let directions = broadcast::<f64>(&given, &[&shape[..], &[3]].concat())?;
    let directions = slice(&directions)?.as_chunks::<3>().0;

    let hits = live.hits.readable(py)?;
    let hits = hits.view()?;
    let arrays = kept.rays(py, live.rays)?;
    let asked = arrays.view()?;
    let choice = live.choice.reversed();
    let write = |first: usize, places: &mut [P]| {
        let rows = places.as_chunks_mut::<6>().0;
        let range = first..first + rows.len();
        let found: Vec<P::Hit> = range.clone().map(|i| P::hit(&hits.get(number(i)))).collect();
        let ray = |i: usize| ids.as_ref().map_or(number(i), |ids| ids[number(i)] as usize);
        let rays: Vec<P::Ray> = range.clone().map(|i| asked.get(ray(i))).collect();
        let masks = match asked.has_masks() {
            true => range.clone().map(|i| asked.mask(ray(i))).collect(),
            false => Vec::new(),
        };
        let times: Vec<f32> = range.clone().map(|i| asked.time(ray(i))).collect();
        let directions = &directions[range];
        // In the precision of the new rays, so that the side is that of the rounded direction.
        let rounded = |d: &[f64; 3]| DVec3::from_array(d.map(|x| P::round(x).into()));
        let directions: Vec<DVec3> = directions.iter().map(rounded).collect();
        let mut origins = vec![DVec3::NAN; rows.len()];
        choice.with_filter(&live.snapshot, |filter| {
            let batch = Rays::new(&rays).with_times(&times);
            let rays = if masks.is_empty() { batch } else { batch.with_masks(&masks) };
            P::spawn(&live.snapshot.world, rays, filter, &found, &directions, &mut origins);
        });
        for (row, (o, d)) in rows.iter_mut().zip(origins.iter().zip(&directions)) {
            *row = [o.x, o.y, o.z, d.x, d.y, d.z].map(P::round);
        }
    };
    let threads = Threads::new(None)?;
    filled(py, &[&shape[..], &[6]].concat(), |values: &mut [P]| {
        let is_small = values.len() <= 6 * PIECE;
        run(py, threads, is_small, |cancel| {
            let piece = |(i, places): (usize, &mut [P])| {
                cancel.check()?;
                write(i * PIECE, places);
                Ok(())
            };
            if is_small {
                return values.chunks_mut(6 * PIECE).enumerate().try_for_each(piece);
            }
            values.par_chunks_mut(6 * PIECE).enumerate().try_for_each(piece)
        })
    })
}
