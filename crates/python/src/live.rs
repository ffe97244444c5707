//! Answers of queries whose arrays are computed from the world that was queried, each when it is
//! first accessed.

use crate::answers::Answers;
use crate::arrays::{filled, from_vec, numpy};
use crate::assemble::{Form, Snapshot};
use crate::choice::Choice;
use crate::columns::{Columns, View};
use crate::palette::Colors;
use crate::precision::Precision;
use crate::rays::KeptRays;
use crate::surface::{Local, Surfaces};
use crate::work::{Threads, run};
use numpy::Element;
use pyo3::prelude::*;
use rayon::prelude::*;
use snell_intersect::Hit;
use snell_math::{DRay, DVec3};
use std::collections::HashMap;
use std::sync::Arc;

/// Number of answers that a thread processes at a time.
const PIECE: usize = 16384;

/// The query's inputs, from which surfaces are computed.
#[derive(Debug)]
pub enum Asked<P> {
    /// Rays: an answer belongs to the ray with its own index or, if a list is given, to the ray
    /// listed at that index.
    Rays(KeptRays<P>, Option<Vec<u32>>),
    /// Points whose nearest points were searched.
    Positions(Vec<[P; 3]>),
}

/// Answers whose arrays are not computed yet, with the world that was queried.
#[derive(Debug)]
pub struct Live<P: Precision, F: Form> {
    /// The world that was queried.
    pub snapshot: Arc<Snapshot<F>>,
    /// The answers of the query.
    pub hits: Columns<P>,
    /// The rays or points that were asked about.
    pub asked: Asked<P>,
    /// What the query took into account.
    pub choice: Choice,
    /// Number of rays.
    pub rays: usize,
    /// Shape of the answers.
    pub shape: Vec<usize>,
    /// For each ray, the index of its first answer, and then the number of all answers; `None` for
    /// queries with one answer per ray.
    pub splits: Option<Vec<i64>>,
}

impl<P: Precision> Answers for Live<P, P> {
    fn array<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        let names = &self.snapshot.names;
        let hits = self.hits.readable(py)?;
        let hits = hits.view()?;
        let array = match name {
            "t_hit" | "distances" => self.copied(py, 1, hits.t),
            "primitive_ids" => self.copied(py, 1, hits.primitive),
            "geometry_ids" => self.mapped(py, hits.geometry, |id| names.object(id)),
            "instance_ids" => self.mapped(py, hits.occurrence, |id| names.instance(id)),
            "instance_paths" => {
                let depth = names.depth();
                self.rows(py, depth, |i, row| {
                    row.fill(Hit::NONE);
                    let path = names.path(hits.occurrence[i]);
                    row.iter_mut().zip(path).for_each(|(place, id)| *place = id);
                })
            }
            "names" => self.labels(py, &hits),
            "material_ids" => self.pieces(py, 1, |first, places| {
                for (i, place) in (first..).zip(places) {
                    *place =
                        names.material(hits.occurrence[i], hits.geometry[i], hits.primitive[i]);
                }
            }),
            "is_entering" if matches!(self.asked, Asked::Rays(..)) => {
                let normals = self.surfaces(py, &hits, 1, |local, ray| {
                    [local.geometric_normal.dot(ray.direction)]
                })?;
                normals.call_method1("__lt__", (0,))
            }
            "primitive_uvs" => self.copied(py, 2, hits.uv),
            "points" if let Asked::Positions(positions) = &self.asked => {
                let values = positions.as_flattened().to_vec();
                from_vec(py, values, &[&self.shape[..], &[3]].concat())
            }
            "points" => self.surfaces(py, &hits, 3, |local, _| local.position.to_array()),
            "primitive_normals" => {
                self.surfaces(py, &hits, 3, |local, _| local.geometric_normal.to_array())
            }
            "normals" => self.surfaces(py, &hits, 3, |local, _| local.normal.to_array()),
            "uvs" => self.surfaces(py, &hits, 2, |local, _| local.uv.to_array()),
            "albedo" => self.albedo(py, &hits),
            "ray_ids" => match &self.asked {
                Asked::Rays(_, Some(ids)) => {
                    from_vec(py, ids.iter().map(|&i| i64::from(i)).collect(), &self.shape)
                }
                _ => return Ok(None),
            },
            "ray_splits" => match &self.splits {
                Some(splits) => from_vec(py, splits.clone(), &[splits.len()]),
                None => return Ok(None),
            },
            _ => return Ok(None),
        };
        array.map(Some)
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }

    fn spawned<'py>(
        &self,
        directions: &Bound<'py, PyAny>,
        numbers: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        crate::spawn::rays(self, directions, numbers)
    }
}

impl<P: Precision, F: Form> Live<P, F> {
    /// An array of `values`, `width` of them per answer.
    fn copied<'py, T: Element + Copy + Send + Sync>(
        &self,
        py: Python<'py>,
        width: usize,
        values: &[T],
    ) -> PyResult<Bound<'py, PyAny>> {
        self.pieces(py, width, |first, places: &mut [T]| {
            places.copy_from_slice(&values[first * width..][..places.len()]);
        })
    }

    /// An array of objects' ids: `name` applied to each of the world's ids.
    fn mapped<'py>(
        &self,
        py: Python<'py>,
        ids: &[u32],
        name: impl Fn(u32) -> u32 + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.pieces(py, 1, |first, places| {
            places.iter_mut().zip(&ids[first..]).for_each(|(place, &id)| *place = name(id));
        })
    }

    /// An array of rows of `width` ids, which `write` fills by the index of the answer.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        width: usize,
        write: impl Fn(usize, &mut [u32]) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let shape = [&self.shape[..], &[width]].concat();
        if width == 0 {
            return from_vec(py, Vec::<u32>::new(), &shape);
        }
        let made = self.pieces(py, width, |first, places| {
            for (i, row) in places.chunks_exact_mut(width).enumerate() {
                write(first + i, row);
            }
        })?;
        made.call_method1("reshape", (shape,))
    }

    /// An array of the names of the objects, as text.
    fn labels<'py>(&self, py: Python<'py>, hits: &View<'_, P>) -> PyResult<Bound<'py, PyAny>> {
        let mut known: HashMap<(u32, u32), i64> = HashMap::new();
        let mut labels: Vec<String> = Vec::new();
        let pairs = hits.occurrence.iter().zip(hits.geometry);
        let numbers: Vec<i64> = pairs
            .map(|(&occurrence, &geometry)| {
                *known.entry((occurrence, geometry)).or_insert_with(|| {
                    labels.push(self.snapshot.names.label(occurrence, geometry));
                    labels.len() as i64 - 1
                })
            })
            .collect();
        if labels.is_empty() {
            labels.push(String::new());
        }
        let numbers = from_vec(py, numbers, &self.shape)?;
        numpy(py, "array")?.call1((labels,))?.get_item(numbers)
    }

    /// An array of a property of the surfaces.
    fn surfaces<'py, const N: usize>(
        &self,
        py: Python<'py>,
        hits: &View<'_, P>,
        width: usize,
        wanted: impl Fn(&Local, &DRay) -> [f64; N] + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let write = |first: usize, places: &mut [P], ray: RayOf<'_>| {
            let mut surfaces = Surfaces::new(&self.snapshot);
            for (i, place) in places.chunks_exact_mut(width).enumerate() {
                let found = hits.get(first + i);
                let is_hit = found.geometry != Hit::NONE;
                let (ray, time) = ray(first + i);
                let local = if is_hit { surfaces.at(&ray, time, &found) } else { Local::NONE };
                let values = wanted(&local, &ray);
                place.iter_mut().zip(values).for_each(|(place, x)| *place = P::round(x));
            }
        };
        self.by_ray(py, width, write)
    }

    /// An array of the colours of the surfaces.
    fn albedo<'py>(&self, py: Python<'py>, hits: &View<'_, P>) -> PyResult<Bound<'py, PyAny>> {
        let albedos = self.snapshot.names.palette.albedos();
        let write = |first: usize, places: &mut [P], ray: RayOf<'_>| {
            let mut colors = Colors::new(&self.snapshot, albedos);
            for (i, place) in places.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let found = hits.get(first + i);
                let (ray, time) = ray(first + i);
                let color = colors.at(&ray, time, &found);
                *place = color.to_array().map(|x| P::round(x.into()));
            }
        };
        self.by_ray(py, 3, write)
    }

    /// An array with `width` numbers per answer, which `write` fills from the index of the first
    /// answer on, asking for the ray of each.
    fn by_ray<'py>(
        &self,
        py: Python<'py>,
        width: usize,
        write: impl Fn(usize, &mut [P], RayOf<'_>) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        match &self.asked {
            Asked::Positions(positions) => {
                let ray = |i: usize| {
                    let point = DVec3::from_array(positions[i].map(Into::into));
                    (DRay::new(point, DVec3::ZERO), 0.0)
                };
                self.pieces(py, width, |first, places| write(first, places, &ray))
            }
            Asked::Rays(kept, ids) => {
                let arrays = kept.rays(py, self.rays)?;
                let view = arrays.view()?;
                let number = |i: usize| ids.as_ref().map_or(i, |ids| ids[i] as usize);
                let ray = |i: usize| (P::exact(&view.get(number(i))), view.time(number(i)));
                self.pieces(py, width, |first, places| write(first, places, &ray))
            }
        }
    }

    fn pieces<'py, T: Element + Copy + Send>(
        &self,
        py: Python<'py>,
        width: usize,
        write: impl Fn(usize, &mut [T]) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut shape = self.shape.clone();
        if width > 1 {
            shape.push(width);
        }
        let threads = Threads::new(None)?;
        filled(py, &shape, |values| {
            let is_small = values.len() <= PIECE * width;
            run(py, threads, is_small, |cancel| {
                let piece = |(i, places): (usize, &mut [T])| {
                    cancel.check()?;
                    write(i * PIECE, places);
                    Ok(())
                };
                if is_small {
                    return values.chunks_mut(PIECE * width).enumerate().try_for_each(piece);
                }
                values.par_chunks_mut(PIECE * width).enumerate().try_for_each(piece)
            })
        })
    }
}

/// The ray of an answer, and its time in the world.
type RayOf<'a> = &'a (dyn Fn(usize) -> (DRay, f32) + Sync);
