//! Many hits as a structure of arrays: each of their numbers has a column of its own.
//!
//! Columns are NumPy arrays from the beginning. Their memory is not cleared before it is written
//! (and comes in large pages if there is much of it), and the column of distances can be given to
//! the caller without a copy.

use crate::arrays::{empty, slice, slice_mut};
use crate::precision::{Found, Precision};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;
use rayon::prelude::*;

type Column<T> = Py<PyArray1<T>>;

/// Hits by column.
#[derive(Debug)]
pub struct Columns<P: Precision> {
    /// Distances; `None` after [`Self::take_t`].
    t: Option<Column<P>>,
    /// Barycentric coordinates, two for each hit.
    uv: Column<P>,
    /// Occurrences of the hits.
    occurrence: Column<u32>,
    /// Numbers of the hits' geometries in the world.
    geometry: Column<u32>,
    /// Numbers of the hits' primitives.
    primitive: Column<u32>,
}

impl<P: Precision> Columns<P> {
    /// Uninitialised columns of this length, and a guard to write them.
    pub fn new(py: Python<'_>, len: usize) -> PyResult<(Self, Writable<'_, P>)> {
        let (t, uv) = (empty(py, len)?, empty(py, 2 * len)?);
        let (occurrence, geometry, primitive) = (empty(py, len)?, empty(py, len)?, empty(py, len)?);
        let columns = Self {
            t: Some(t.clone().unbind()),
            uv: uv.clone().unbind(),
            occurrence: occurrence.clone().unbind(),
            geometry: geometry.clone().unbind(),
            primitive: primitive.clone().unbind(),
        };
        let writable = Writable {
            t: t.try_readwrite()?,
            uv: uv.try_readwrite()?,
            occurrence: occurrence.try_readwrite()?,
            geometry: geometry.try_readwrite()?,
            primitive: primitive.try_readwrite()?,
        };
        Ok((columns, writable))
    }

    /// The columns of the hits `found`.
    pub fn of(py: Python<'_>, found: &[Found<P>]) -> PyResult<Self> {
        let (columns, mut writable) = Self::new(py, found.len())?;
        let mut places = writable.places()?;
        found.iter().enumerate().for_each(|(i, found)| places.set(i, found));
        Ok(columns)
    }

    /// Gives the distances to the caller; later calls return `None`.
    pub fn take_t(&mut self) -> Option<Column<P>> {
        self.t.take()
    }

    /// A guard to read the columns.
    pub fn readable<'py>(&self, py: Python<'py>) -> PyResult<Readable<'py, P>> {
        Ok(Readable {
            t: self.t.as_ref().map(|t| t.bind(py).try_readonly()).transpose()?,
            uv: self.uv.bind(py).try_readonly()?,
            occurrence: self.occurrence.bind(py).try_readonly()?,
            geometry: self.geometry.bind(py).try_readonly()?,
            primitive: self.primitive.bind(py).try_readonly()?,
        })
    }
}

/// A guard through which [`Columns`] are written.
#[derive(Debug)]
pub struct Writable<'py, P: Precision> {
    t: PyReadwriteArray1<'py, P>,
    uv: PyReadwriteArray1<'py, P>,
    occurrence: PyReadwriteArray1<'py, u32>,
    geometry: PyReadwriteArray1<'py, u32>,
    primitive: PyReadwriteArray1<'py, u32>,
}

impl<P: Precision> Writable<'_, P> {
    /// The columns as slices, which other threads may write.
    pub fn places(&mut self) -> PyResult<Places<'_, P>> {
        Ok(Places {
            t: slice_mut(&mut self.t)?,
            uv: slice_mut(&mut self.uv)?,
            occurrence: slice_mut(&mut self.occurrence)?,
            geometry: slice_mut(&mut self.geometry)?,
            primitive: slice_mut(&mut self.primitive)?,
        })
    }
}

/// Slices of columns that are to be filled with hits.
#[derive(Debug)]
pub struct Places<'a, P> {
    t: &'a mut [P],
    uv: &'a mut [P],
    occurrence: &'a mut [u32],
    geometry: &'a mut [u32],
    primitive: &'a mut [u32],
}

impl<P: Precision> Places<'_, P> {
    /// Number of hits.
    pub fn len(&self) -> usize {
        self.geometry.len()
    }

    /// Fills the slices piece by piece. `fill` gets a thread's scratch space, the index of the
    /// first hit of a piece, and the piece to write.
    pub fn fill<S, E: Send>(
        self,
        piece: usize,
        start: impl Fn() -> S + Sync + Send,
        write: impl Fn(&mut S, usize, Places<'_, P>) -> Result<(), E> + Sync + Send,
    ) -> Result<(), E> {
        if self.len() <= piece {
            return write(&mut start(), 0, self);
        }
        let ids = self.occurrence.par_chunks_mut(piece).zip(self.geometry.par_chunks_mut(piece));
        let ids = ids.zip(self.primitive.par_chunks_mut(piece));
        let numbers = self.t.par_chunks_mut(piece).zip(self.uv.par_chunks_mut(2 * piece));
        let all = numbers.zip(ids).enumerate();
        all.try_for_each_init(
            start,
            |state, (i, ((t, uv), ((occurrence, geometry), primitive)))| {
                write(state, i * piece, Places { t, uv, occurrence, geometry, primitive })
            },
        )
    }

    /// Writes the hit with index `i`.
    #[inline(always)]
    fn set(&mut self, i: usize, found: &Found<P>) {
        self.t[i] = found.t;
        self.uv[2 * i..2 * i + 2].copy_from_slice(&found.uv);
        self.occurrence[i] = found.occurrence;
        self.geometry[i] = found.geometry;
        self.primitive[i] = found.primitive;
    }

    /// Writes all hits.
    pub fn write(&mut self, hits: &[P::Hit]) {
        let Self { t, uv, occurrence, geometry, primitive } = self;
        let numbers = t.iter_mut().zip(uv.as_chunks_mut::<2>().0);
        let ids = occurrence.iter_mut().zip(geometry.iter_mut()).zip(primitive.iter_mut());
        for ((hit, (t, uv)), ((occurrence, geometry), primitive)) in
            hits.iter().zip(numbers).zip(ids)
        {
            let found = P::found(hit);
            (*t, *uv, *occurrence, *geometry, *primitive) =
                (found.t, found.uv, found.occurrence, found.geometry, found.primitive);
        }
    }
}

/// A guard through which [`Columns`] are read.
#[derive(Debug)]
pub struct Readable<'py, P: Precision> {
    t: Option<PyReadonlyArray1<'py, P>>,
    uv: PyReadonlyArray1<'py, P>,
    occurrence: PyReadonlyArray1<'py, u32>,
    geometry: PyReadonlyArray1<'py, u32>,
    primitive: PyReadonlyArray1<'py, u32>,
}

impl<P: Precision> Readable<'_, P> {
    /// The columns as slices, which other threads may read.
    pub fn view(&self) -> PyResult<View<'_, P>> {
        Ok(View {
            t: self.t.as_ref().map_or(Ok::<&[P], PyErr>(&[]), slice)?,
            uv: slice(&self.uv)?,
            occurrence: slice(&self.occurrence)?,
            geometry: slice(&self.geometry)?,
            primitive: slice(&self.primitive)?,
        })
    }
}

/// Columns as slices that are only read.
#[derive(Clone, Copy, Debug)]
pub struct View<'a, P> {
    /// Distances; empty after [`Columns::take_t`].
    pub t: &'a [P],
    /// Barycentric coordinates, two for each hit.
    pub uv: &'a [P],
    /// Occurrences of the hits.
    pub occurrence: &'a [u32],
    /// Numbers of the hits' geometries in the world.
    pub geometry: &'a [u32],
    /// Numbers of the hits' primitives.
    pub primitive: &'a [u32],
}

impl<P: Precision> View<'_, P> {
    /// The hit with index `i`. Its distance is 0 if the distances were taken.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Found<P> {
        Found {
            t: self.t.get(i).copied().unwrap_or_default(),
            uv: [self.uv[2 * i], self.uv[2 * i + 1]],
            occurrence: self.occurrence[i],
            geometry: self.geometry[i],
            primitive: self.primitive[i],
        }
    }
}
