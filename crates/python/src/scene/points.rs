//! Queries of a scene about points.

use super::Scene;
use crate::answers::{ClosestPoints, Named};
use crate::arrays::{Column, PointArray, array, from_vec, is_double, leading, slice};
use crate::assemble::Snapshot;
use crate::choice::Choice;
use crate::columns::Columns;
use crate::live::{Asked, Live};
use crate::memory::admit_all;
use crate::nearest::{Inside, Nearest, PointPrecision};
use crate::objects;
use crate::precision::Precision;
use crate::state::Kept;
use crate::work::{Count, Stopped, Threads, run};
use numpy::PyUntypedArray;
use pyo3::prelude::*;
use rayon::prelude::*;
use snell_intersect::{DWorld, World};
use std::sync::Arc;

/// Number of points that a thread processes at a time.
const POINTS: usize = 64;

impl Scene {
    fn closest<'py, P: Kept + PointPrecision>(
        &self,
        points: &Bound<'py, PyUntypedArray>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: u64,
        threads: Threads,
    ) -> PyResult<ClosestPoints> {
        let (py, snapshot) = (points.py(), self.0.snapshot::<P>(points.py())?);
        let points = PointArray::<P>::new(points, "points")?;
        let limit = limit(max_distance, &points.shape)?;
        let limit = limit.values()?;
        let values = slice(&points.values)?.as_chunks::<3>().0;
        let world = &*snapshot.world;
        // The memory is that of the answers, of their copy in columns, and of the points.
        admit_all("the answers", values.len(), 3 * size_of::<Nearest<P>>())?;
        let (found, positions) = run(py, threads, values.len() <= POINTS, |cancel| {
            let each = |(i, (near, values)): (usize, (&mut [Nearest<P>], &[[P; 3]]))| {
                cancel.check()?;
                for (k, (near, value)) in near.iter_mut().zip(values).enumerate() {
                    *near = P::nearest(world, *value, limit.get(i * POINTS + k), mask);
                }
                Ok(())
            };
            let mut near = vec![Nearest::default(); values.len()];
            if values.len() <= POINTS {
                near.chunks_mut(POINTS)
                    .zip(values.chunks(POINTS))
                    .enumerate()
                    .try_for_each(each)?;
            } else {
                near.par_chunks_mut(POINTS)
                    .zip(values.par_chunks(POINTS))
                    .enumerate()
                    .try_for_each(each)?;
            }
            let found = near.iter().map(|near| near.found).collect::<Vec<_>>();
            Ok((found, near.iter().map(|near| near.position).collect()))
        })?;
        Ok(ClosestPoints(Named::new(Live::<P, P> {
            snapshot,
            hits: Columns::of(py, &found)?,
            asked: Asked::Positions(positions),
            choice: Choice::default(),
            rays: 0,
            shape: points.shape,
            splits: None,
        })))
    }

    /// An array with one answer per point, computed by `answer` from some points and the index of
    /// the first.
    fn of_points<'py, P: PointPrecision, T: numpy::Element + Default + Copy + Send>(
        &self,
        points: &Bound<'py, PyUntypedArray>,
        threads: Threads,
        answer: impl Fn(usize, &[[P; 3]], &mut [T]) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, points) = (points.py(), PointArray::<P>::new(points, "points")?);
        let values = slice(&points.values)?.as_chunks::<3>().0;
        admit_all("the answers", values.len(), size_of::<T>())?;
        let answers = run(py, threads, values.len() <= POINTS, |cancel| {
            let mut answers = vec![T::default(); values.len()];
            let each = |(i, places): (usize, &mut [T])| -> Result<(), Stopped> {
                cancel.check()?;
                let first = i * POINTS;
                answer(first, &values[first..first + places.len()], places);
                Ok(())
            };
            if values.len() <= POINTS {
                answers.chunks_mut(POINTS).enumerate().try_for_each(each)?;
            } else {
                answers.par_chunks_mut(POINTS).enumerate().try_for_each(each)?;
            }
            Ok(answers)
        })?;
        from_vec(py, answers, &points.shape)
    }

    /// An array of the distances of points, in the points' precision; negative inside, as `inside`
    /// has it.
    fn distances<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: Option<objects::Mask>,
        threads: Option<Count>,
        method: Option<&str>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let array = array(points, "points")?;
        let (mask, threads) = (objects::mask(mask)?, Threads::given(threads)?);
        let inside = method.map(|method| Inside::new(method, mask)).transpose()?;
        if is_double(&array, "points")? {
            self.distances_in::<f64>(&array, max_distance, mask, threads, inside)
        } else {
            self.distances_in::<f32>(&array, max_distance, mask, threads, inside)
        }
    }

    fn distances_in<'py, P: Kept + PointPrecision>(
        &self,
        points: &Bound<'py, PyUntypedArray>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: u64,
        threads: Threads,
        inside: Option<Inside>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let snapshot = self.0.snapshot::<P>(points.py())?;
        if inside.is_some() {
            self.prepare(points.py(), &snapshot)?;
        }
        let limits = limit::<P>(max_distance, &leading(points, 3, "points")?)?;
        let limits = limits.values()?;
        let world = &*snapshot.world;
        self.of_points::<P, P>(points, threads, |first, points, distances| {
            let zero = P::round(0.0);
            for (k, (distance, point)) in distances.iter_mut().zip(points).enumerate() {
                *distance = P::nearest(world, *point, limits.get(first + k), mask).found.t;
            }
            let Some(about) = inside else { return };
            let mut is_inside = vec![false; points.len()];
            P::occupancy(world, points, about, &mut is_inside);
            for (k, (distance, point)) in distances.iter_mut().zip(points).enumerate() {
                let limit = limits.get(first + k);
                let is_limit = limit.into() >= 0.0 && point.iter().all(|&x| x.into().is_finite());
                if (*distance).into().is_infinite() && is_limit {
                    *distance = limit;
                }
                if is_inside[k] && *distance != zero {
                    *distance = P::round(-(*distance).into());
                }
            }
        })
    }

    fn prepare<P: Kept + PointPrecision>(
        &self,
        py: Python<'_>,
        snapshot: &Arc<Snapshot<P>>,
    ) -> PyResult<()> {
        self.0.prepare_winding(py, snapshot)
    }

    /// An array with one number per point, computed by `single` or `double` from the world and some
    /// points.
    fn around<'py, T: numpy::Element + Default + Copy + Send>(
        &self,
        points: &Bound<'py, PyAny>,
        threads: Option<Count>,
        single: impl Fn(&World, &[[f32; 3]], &mut [T]) + Sync,
        double: impl Fn(&DWorld, &[[f64; 3]], &mut [T]) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, array, threads) =
            (points.py(), array(points, "points")?, Threads::given(threads)?);
        let is_double = is_double(&array, "points")?;
        leading(&array, 3, "points")?;
        if is_double {
            let snapshot = self.0.snapshot::<f64>(py)?;
            self.prepare(py, &snapshot)?;
            self.of_points::<f64, T>(&array, threads, |_, p, out| double(&snapshot.world, p, out))
        } else {
            let snapshot = self.0.snapshot::<f32>(py)?;
            self.prepare(py, &snapshot)?;
            self.of_points::<f32, T>(&array, threads, |_, p, out| single(&snapshot.world, p, out))
        }
    }
}

/// Maximum distances of the points; infinity by default.
fn limit<'py, P: Precision>(
    max_distance: Option<&Bound<'py, PyAny>>,
    shape: &[usize],
) -> PyResult<Column<'py, P>> {
    match max_distance {
        None => Ok(Column::All(P::round(f64::INFINITY))),
        Some(limit) => Column::new(limit, shape, "max_distance"),
    }
}

#[pymethods]
impl Scene {
    /// The nearest point of any surface to each point.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     `float32` is answered in single precision, everything else in double precision, with the
    ///     vertices as they are, not rounded.
    /// max_distance : float or array (...), optional
    ///     Farther surfaces are ignored.
    /// mask : int, optional
    ///     Only objects whose mask shares a bit with it count.
    /// threads : int, optional
    ///     As for :meth:`cast_rays`.
    ///
    /// Returns
    /// -------
    /// ClosestPoints
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.closest_points([[0, 0, -5], [0, 3, 0]]).points.tolist()
    /// [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    #[pyo3(signature = (points, *, max_distance=None, mask=None, threads=None))]
    fn closest_points<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: Option<objects::Mask>,
        threads: Option<Count>,
    ) -> PyResult<ClosestPoints> {
        let array = array(points, "points")?;
        let (mask, threads) = (objects::mask(mask)?, Threads::given(threads)?);
        if is_double(&array, "points")? {
            self.closest::<f64>(&array, max_distance, mask, threads)
        } else {
            self.closest::<f32>(&array, max_distance, mask, threads)
        }
    }

    /// The distance of each point to the nearest surface, not negative: an array `(...)`. Infinite
    /// where no surface is within `max_distance`. Parameters as for :meth:`closest_points`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.distance([[0, 0, -5], [0, 0.25, 0]]).tolist()
    /// [4.0, 0.75]
    #[pyo3(signature = (points, *, max_distance=None, mask=None, threads=None))]
    fn distance<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        mask: Option<objects::Mask>,
        threads: Option<Count>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.distances(points, max_distance, mask, threads, None)
    }

    /// The distance of each point to the nearest surface, negative inside (see :meth:`occupancy`)
    /// and 0 on a surface: an array `(...)`. Where no surface is within `max_distance`, it is
    /// `max_distance`, negative inside.
    ///
    /// Parameters
    /// ----------
    /// points, max_distance, threads
    ///     As for :meth:`closest_points`.
    /// method : {"auto", "parity", "winding"}
    ///     What decides about inside; see :meth:`occupancy`.
    /// mask : int, optional
    ///     Only objects whose mask shares a bit with it count, for the distance and for the sign.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.signed_distance([[0, 0, -5], [0, 0.25, 0]]).tolist()
    /// [4.0, -0.75]
    #[pyo3(signature = (points, *, max_distance=None, method="auto", mask=None, threads=None))]
    fn signed_distance<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        max_distance: Option<&Bound<'py, PyAny>>,
        method: &str,
        mask: Option<objects::Mask>,
        threads: Option<Count>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.distances(points, max_distance, mask, threads, Some(method))
    }

    /// Whether each point is inside of something: an array `(...)` of bool.
    ///
    /// By default, each body is asked by itself, and a point is inside if it is inside any of them.
    /// The triangles of a mesh that are joined at edges are a body (corners at equal positions are
    /// joined).
    ///
    /// - A closed body is decided exactly, by the crossings of a ray with it, in whichever
    ///   orientation it is. A body inside another one of the same mesh that is turned the other way
    ///   is a cavity.
    /// - An open body, such as a scan with holes, is decided by its winding number: inside is more
    ///   than a half, within the body's box. So are all open surfaces of a mesh together, such as
    ///   the faces of a solid that are not joined.
    /// - Sheets (terrains, floors, planes, discs) have no inside, and take none from others. They
    ///   are open surfaces whose area vectors add up to more than 0.7 of their area.
    /// - Solid shapes, spheres and curves are bodies.
    ///
    /// A point exactly on the surface of a body is inside. Points that are not finite are outside.
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     As for :meth:`closest_points`.
    /// method : {"auto", "parity", "winding"}
    ///     `"auto"` is the rule above. `"parity"` counts the hits of a ray from the point with
    ///     everything, as Open3D does: inside is an odd number. `"winding"` is a
    ///     :meth:`winding_number` of more than a half, the sum over everything.
    /// mask : int, optional
    ///     Only objects whose mask shares a bit with it count.
    /// threads : int, optional
    ///     As for :meth:`cast_rays`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> floor = scene.add_shape("plane")
    /// >>> scene.occupancy([[0, 0, -5], [0, 0.25, 0], [0, 1, 0]]).tolist()
    /// [False, True, True]
    #[pyo3(signature = (points, *, method="auto", mask=None, threads=None))]
    fn occupancy<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        method: &str,
        mask: Option<objects::Mask>,
        threads: Option<Count>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let about = Inside::new(method, objects::mask(mask)?)?;
        self.around(
            points,
            threads,
            |world, points, inside| f32::occupancy(world, points, about, inside),
            |world, points, inside| f64::occupancy(world, points, about, inside),
        )
    }

    /// The generalised winding number of all surfaces around each point: an array `(...)` of
    /// float64. It is the sum over everything: 1 inside a closed surface and 0 outside, 2 inside
    /// two, -1 inside one that is inside out; near open surfaces it has other values (accurate to
    /// some hundredths next to large ones).
    ///
    /// Parameters
    /// ----------
    /// points : array (..., 3)
    ///     As for :meth:`closest_points`.
    /// mask : int, optional
    ///     Only objects whose mask shares a bit with it count.
    /// threads : int, optional
    ///     As for :meth:`cast_rays`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.winding_number([[0, 0, -5], [0, 0.25, 0]]).tolist()
    /// [0.0, 1.0]
    #[pyo3(signature = (points, *, mask=None, threads=None))]
    fn winding_number<'py>(
        &self,
        points: &Bound<'py, PyAny>,
        mask: Option<objects::Mask>,
        threads: Option<Count>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mask = objects::mask(mask)?;
        self.around(
            points,
            threads,
            |world, points, numbers| f32::winding_number(world, points, mask, numbers),
            |world, points, numbers| f64::winding_number(world, points, mask, numbers),
        )
    }
}
