//! Rays from Python: `(..., 6)`, or a pair `(origins, directions)`.

use crate::arrays::{
    Column, Values, are_double, array, broadcast, common_shape, contiguous, index_in, leading,
    mask_column, numpy, shown, slice,
};
use crate::motion::Axis;
use crate::precision::Precision;
use numpy::{Element, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};
use std::ops::Range;
use std::sync::Arc;

/// The argument `rays`. Its shape is known, but its numbers are not read yet.
#[derive(Debug)]
pub struct RayArgument<'py> {
    arrays: Arrays<'py>,
    /// The leading shape.
    pub shape: Vec<usize>,
    /// True if the query is in double precision.
    pub is_double: bool,
}

#[derive(Debug)]
enum Arrays<'py> {
    Rows(Bound<'py, PyUntypedArray>),
    Pair([Bound<'py, PyUntypedArray>; 2]),
}

impl<'py> RayArgument<'py> {
    /// Reads an argument.
    pub fn new(rays: &Bound<'py, PyAny>) -> PyResult<Self> {
        let pair = rays.cast::<PyTuple>().ok().filter(|pair| pair.len() == 2);
        let Some(pair) = pair else {
            let is_list_of_two = rays.cast::<PyList>().is_ok_and(|list| list.len() == 2);
            let hint = |error: PyErr, is_pair: bool| match is_pair {
                true => PyTypeError::new_err(format!(
                    "{}; origins and directions are a tuple: (origins, directions)",
                    error.value(rays.py())
                )),
                false => error,
            };
            let rows = array(rays, "rays").map_err(|e| hint(e, is_list_of_two))?;
            let is_pair = matches!(rows.shape(), [2, .., 3]);
            let shape = leading(&rows, 6, "rays").map_err(|e| hint(e, is_pair))?;
            let is_double = are_double(&[(rays, &rows, "rays")])?;
            return Ok(Self { arrays: Arrays::Rows(rows), shape, is_double });
        };
        let (origins, directions) = (pair.get_item(0)?, pair.get_item(1)?);
        let (o, d) =
            (array(&origins, "rays[0] (origins)")?, array(&directions, "rays[1] (directions)")?);
        let shapes =
            [leading(&o, 3, "rays[0] (origins)")?, leading(&d, 3, "rays[1] (directions)")?];
        let shape = common_shape(&shapes[0], &shapes[1]).ok_or_else(|| {
            let (o, d) = (shown(o.shape()), shown(d.shape()));
            PyValueError::new_err(format!(
                "rays: origins of shape {o} and directions of shape {d} do not broadcast"
            ))
        })?;
        let is_double = are_double(&[
            (&origins, &o, "rays[0] (origins)"),
            (&directions, &d, "rays[1] (directions)"),
        ])?;
        Ok(Self { arrays: Arrays::Pair([o, d]), shape, is_double })
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }
}

/// Further options of a query about its rays.
#[derive(Debug)]
pub struct Limits<'a, 'py> {
    /// Hits at or before this ray parameter do not count.
    pub t_min: &'a Bound<'py, PyAny>,
    /// Hits at or after this ray parameter do not count.
    pub t_max: &'a Bound<'py, PyAny>,
    /// The mask: only objects that share a bit with it are hit.
    pub mask: Option<&'a Bound<'py, PyAny>>,
    /// The times of the rays; at the first of all keys if they are left out.
    pub times: Option<&'a Bound<'py, PyAny>>,
}

/// The times of rays in a world.
#[derive(Clone, Debug)]
enum Times {
    /// One time for all.
    All(f32),
    /// One time for each.
    Each(Arc<[f32]>),
}

impl Times {
    /// Reads the times of rays of a shape, which must be finite. Where nothing moves, they are all
    /// the same.
    fn new<'py>(
        value: Option<&Bound<'py, PyAny>>,
        shape: &[usize],
        axis: Option<Axis>,
    ) -> PyResult<Self> {
        let Some(value) = value else { return Ok(Self::All(0.0)) };
        let column: Column<'py, f64> = Column::new(value, shape, "times")?;
        let values = column.values()?;
        let bad = match values {
            Values::All(time) => (!time.is_finite()).then_some((String::new(), time)),
            Values::Each(all) => {
                let at = all.iter().position(|time| !time.is_finite());
                at.map(|at| (format!("[{}]", index_in(at, shape)), all[at]))
            }
        };
        if let Some((place, time)) = bad {
            let message = format!("times{place} is {time}, expected a finite number");
            return Err(PyValueError::new_err(message));
        }
        Ok(match (values, axis) {
            (_, None) => Self::All(0.0),
            (Values::All(time), Some(axis)) => Self::All(axis.time(time)),
            (Values::Each(all), Some(axis)) => {
                Self::Each(value.py().detach(|| all.iter().map(|&time| axis.time(time)).collect()))
            }
        })
    }
}

/// Vectors of three numbers, at regular places in an array.
#[derive(Debug)]
struct Vectors<'py, P: Precision> {
    array: PyReadonlyArrayDyn<'py, P>,
    /// Distance from one vector to the next, in numbers; 0 if all rays share one vector.
    stride: usize,
    offset: usize,
}

impl<'py, P: Precision> Vectors<'py, P> {
    fn new(array: &Bound<'py, PyUntypedArray>, shape: &[usize]) -> PyResult<Self> {
        if array.len() == 3 {
            return Ok(Self { array: contiguous(array)?, stride: 0, offset: 0 });
        }
        if array.len() == 0 {
            return Ok(Self { array: contiguous(array)?, stride: 3, offset: 0 });
        }
        let full: Vec<usize> = shape.iter().copied().chain([3]).collect();
        Ok(Self { array: broadcast(array, &full)?, stride: 3, offset: 0 })
    }

    fn view(&self) -> PyResult<VectorView<'_, P>> {
        Ok(VectorView { values: slice(&self.array)?, stride: self.stride, offset: self.offset })
    }
}

#[derive(Clone, Copy, Debug)]
struct VectorView<'a, P> {
    values: &'a [P],
    stride: usize,
    offset: usize,
}

impl<P: Precision> VectorView<'_, P> {
    #[inline(always)]
    fn get(&self, i: usize) -> [P; 3] {
        let at = i * self.stride + self.offset;
        let v = &self.values[at..at + 3];
        [v[0], v[1], v[2]]
    }
}

/// Rays in the precision of the query.
#[derive(Debug)]
pub struct RayArrays<'py, P: Precision> {
    origins: Vectors<'py, P>,
    directions: Vectors<'py, P>,
    t_min: Column<'py, P>,
    t_max: Column<'py, P>,
    mask: Column<'py, u32>,
    times: Times,
    len: usize,
}

impl<'py, P: Precision> RayArrays<'py, P> {
    /// Reads the numbers of the rays and their limits. `axis` has the times of the world.
    pub fn new(
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        axis: Option<Axis>,
    ) -> PyResult<Self> {
        let shape = &rays.shape;
        let (origins, directions) = match &rays.arrays {
            Arrays::Rows(rows) => {
                let part = |offset| {
                    Ok::<_, PyErr>(Vectors { array: contiguous(rows)?, stride: 6, offset })
                };
                (part(0)?, part(3)?)
            }
            Arrays::Pair([o, d]) => (Vectors::new(o, shape)?, Vectors::new(d, shape)?),
        };
        Ok(Self {
            origins,
            directions,
            t_min: Column::new(limits.t_min, shape, "t_min")?,
            t_max: Column::new(limits.t_max, shape, "t_max")?,
            mask: mask_column(limits.mask, shape)?,
            times: Times::new(limits.times, shape, axis)?,
            len: rays.len(),
        })
    }

    /// The rays as slices, for other threads.
    pub fn view(&self) -> PyResult<RayView<'_, P>> {
        Ok(RayView {
            origins: self.origins.view()?,
            directions: self.directions.view()?,
            t_min: self.t_min.values()?,
            t_max: self.t_max.values()?,
            mask: self.mask.values()?,
            times: &self.times,
            len: self.len,
        })
    }

    /// The rays that are needed later to compute the surfaces at hits. With `copy`, they do not
    /// change when the caller's arrays do.
    pub fn keep(&self, copy: bool) -> PyResult<KeptRays> {
        fn kept<T: Element>(
            array: &PyReadonlyArrayDyn<'_, T>,
            copy: bool,
        ) -> PyResult<Py<PyUntypedArray>> {
            let array = array.as_untyped().clone();
            if !copy {
                return Ok(array.unbind());
            }
            let copied = numpy(array.py(), "array")?.call1((array,))?;
            Ok(copied.cast_into::<PyUntypedArray>()?.unbind())
        }
        let part = |v: &Vectors<'_, P>| Ok::<_, PyErr>((kept(&v.array, copy)?, v.stride, v.offset));
        let (origins, directions) = (part(&self.origins)?, part(&self.directions)?);
        Ok(KeptRays { origins, directions, times: self.times.clone() })
    }
}

/// Origins and directions of the rays of a query.
#[derive(Debug)]
pub struct KeptRays {
    origins: (Py<PyUntypedArray>, usize, usize),
    directions: (Py<PyUntypedArray>, usize, usize),
    times: Times,
}

impl KeptRays {
    /// The rays that the arrays hold now.
    pub fn rays<'py, P: Precision>(
        &self,
        py: Python<'py>,
        len: usize,
    ) -> PyResult<RayArrays<'py, P>> {
        let part = |(array, stride, offset): &(Py<PyUntypedArray>, usize, usize)| {
            Ok::<_, PyErr>(Vectors {
                array: contiguous(array.bind(py))?,
                stride: *stride,
                offset: *offset,
            })
        };
        let (t_min, t_max) = (Column::All(P::round(0.0)), Column::All(P::round(f64::INFINITY)));
        let mask = Column::All(u32::MAX);
        Ok(RayArrays {
            origins: part(&self.origins)?,
            directions: part(&self.directions)?,
            t_min,
            t_max,
            mask,
            times: self.times.clone(),
            len,
        })
    }
}

/// Rays as slices.
#[derive(Clone, Copy, Debug)]
pub struct RayView<'a, P> {
    origins: VectorView<'a, P>,
    directions: VectorView<'a, P>,
    t_min: Values<'a, P>,
    t_max: Values<'a, P>,
    mask: Values<'a, u32>,
    times: &'a Times,
    len: usize,
}

impl<P: Precision> RayView<'_, P> {
    /// Number of rays.
    pub fn len(&self) -> usize {
        self.len
    }

    /// The ray with index `i`.
    #[inline(always)]
    pub fn get(&self, i: usize) -> P::Ray {
        P::ray(self.origins.get(i), self.directions.get(i), [self.t_min.get(i), self.t_max.get(i)])
    }

    /// The time in the world of the ray with index `i`.
    #[inline(always)]
    pub fn time(&self, i: usize) -> f32 {
        match self.times {
            Times::All(time) => *time,
            Times::Each(times) => times[i],
        }
    }

    /// Reads the times of a range; none if all are 0.
    pub fn read_times(&self, range: Range<usize>, times: &mut Vec<f32>) {
        times.clear();
        match self.times {
            Times::All(0.0) => {}
            Times::All(time) => times.resize(range.len(), *time),
            Times::Each(all) => times.extend_from_slice(&all[range]),
        }
    }

    /// The rays of a range as rows of six numbers, if that is their form.
    fn rows(&self, range: Range<usize>) -> Option<&[[P; 6]]> {
        let is_rows =
            self.origins.stride == 6 && self.directions.stride == 6 && self.origins.offset == 0;
        is_rows.then(|| &self.origins.values.as_chunks::<6>().0[range])
    }

    /// Reads the rays of a range, and their masks (none if all bits are set).
    pub fn read(&self, range: Range<usize>, rays: &mut Vec<P::Ray>, masks: &mut Vec<u32>) {
        rays.clear();
        match (self.rows(range.clone()), self.t_min, self.t_max) {
            (Some(rows), Values::All(t_min), Values::All(t_max)) => {
                let ray = |&[ox, oy, oz, dx, dy, dz]: &[P; 6]| {
                    P::ray([ox, oy, oz], [dx, dy, dz], [t_min, t_max])
                };
                rays.extend(rows.iter().map(ray));
            }
            _ => rays.extend(range.clone().map(|i| self.get(i))),
        }
        masks.clear();
        if !matches!(self.mask, Values::All(u32::MAX)) {
            masks.extend(range.map(|i| self.mask.get(i)));
        }
    }
}
