//! Many hits, each of their numbers in a column of its own: what arrays are made of.
//!
//! Columns begin as zeros, which cost nothing until a thread writes there, and are written by many threads at once.

use crate::precision::{Found, Precision};
use rayon::prelude::*;

/// Hits by column.
#[derive(Debug)]
pub struct Columns<P> {
    /// Distances; empty if they were given away.
    pub t: Vec<P>,
    /// Barycentrics.
    pub uv: Vec<[P; 2]>,
    /// Occurrences.
    pub occurrence: Vec<u32>,
    /// Geometries of the world.
    pub geometry: Vec<u32>,
    /// Primitives.
    pub primitive: Vec<u32>,
}

/// A part of [`Columns`] to be written.
#[derive(Debug)]
pub struct Places<'a, P> {
    t: &'a mut [P],
    uv: &'a mut [[P; 2]],
    occurrence: &'a mut [u32],
    geometry: &'a mut [u32],
    primitive: &'a mut [u32],
}

impl<P: Precision> Columns<P> {
    /// So many, all zero.
    pub fn zeroed(len: usize) -> Self {
        Self {
            t: vec![P::default(); len],
            uv: vec![[P::default(); 2]; len],
            occurrence: vec![0; len],
            geometry: vec![0; len],
            primitive: vec![0; len],
        }
    }

    /// None yet, with room for so many.
    pub fn with_capacity(len: usize) -> Self {
        Self {
            t: Vec::with_capacity(len),
            uv: Vec::with_capacity(len),
            occurrence: Vec::with_capacity(len),
            geometry: Vec::with_capacity(len),
            primitive: Vec::with_capacity(len),
        }
    }

    /// Adds one.
    pub fn push(&mut self, found: &Found<P>) {
        self.t.push(found.t);
        self.uv.push(found.uv);
        self.occurrence.push(found.occurrence);
        self.geometry.push(found.geometry);
        self.primitive.push(found.primitive);
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.geometry.len()
    }

    /// One of them; its distance is 0 if the distances were given away.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Found<P> {
        Found {
            t: self.t.get(i).copied().unwrap_or_default(),
            uv: self.uv[i],
            occurrence: self.occurrence[i],
            geometry: self.geometry[i],
            primitive: self.primitive[i],
        }
    }

    /// Fills them piece by piece: given something of the thread's own, the first of a piece, and its places.
    pub fn fill<S, E: Send>(
        &mut self,
        piece: usize,
        start: impl Fn() -> S + Sync + Send,
        write: impl Fn(&mut S, usize, Places<'_, P>) -> Result<(), E> + Sync + Send,
    ) -> Result<(), E> {
        if self.len() <= piece {
            let Self { t, uv, occurrence, geometry, primitive } = self;
            return write(&mut start(), 0, Places { t, uv, occurrence, geometry, primitive });
        }
        let ids = self.occurrence.par_chunks_mut(piece).zip(self.geometry.par_chunks_mut(piece));
        let ids = ids.zip(self.primitive.par_chunks_mut(piece));
        let numbers = self.t.par_chunks_mut(piece).zip(self.uv.par_chunks_mut(piece));
        let all = numbers.zip(ids).enumerate();
        all.try_for_each_init(start, |state, (i, ((t, uv), ((occurrence, geometry), primitive)))| {
            write(state, i * piece, Places { t, uv, occurrence, geometry, primitive })
        })
    }
}

impl<P: Precision> Places<'_, P> {
    /// How many.
    pub fn len(&self) -> usize {
        self.geometry.len()
    }

    /// Writes all of them.
    pub fn write(&mut self, hits: &[P::Hit]) {
        let Self { t, uv, occurrence, geometry, primitive } = self;
        let places = t.iter_mut().zip(uv.iter_mut()).zip(occurrence.iter_mut()).zip(geometry.iter_mut());
        for ((((t, uv), occurrence), geometry), (primitive, hit)) in places.zip(primitive.iter_mut().zip(hits)) {
            let found = P::found(hit);
            (*t, *uv, *occurrence, *geometry, *primitive) =
                (found.t, found.uv, found.occurrence, found.geometry, found.primitive);
        }
    }
}

impl<P: Precision> FromIterator<Found<P>> for Columns<P> {
    fn from_iter<I: IntoIterator<Item = Found<P>>>(all: I) -> Self {
        let mut columns = Self::with_capacity(0);
        all.into_iter().for_each(|found| columns.push(&found));
        columns
    }
}
