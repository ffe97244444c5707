//! Queries of a scene about rays.

use super::Scene;
use crate::animated::changes_surfaces;
use crate::answers::{Hits, Intersections, Named};
use crate::arrays::{filled, from_vec};
use crate::assemble::Snapshot;
use crate::choice::{Choice, Chosen, max_hits};
use crate::columns::Columns;
use crate::live::{Asked, Live};
use crate::memory::admit_all;
use crate::precision::Precision;
use crate::progress::Report;
use crate::query::{FEW, Question, coherent_angle, piece_size};
use crate::rays::{Limits, RayArgument, RayArrays};
use crate::state::Kept;
use crate::work::{Cancel, Count, Stopped, Threads, run_with};
use numpy::PyArrayMethods;
use pyo3::exceptions::{PyMemoryError, PyRuntimeWarning, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use snell_formats::memory::Available;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Bytes per hit while all hits of rays are listed: in the lists of threads, in the joined list,
/// and in columns.
const BYTES_OF_LISTED: u64 = 200;

/// Options of a query over rays.
#[derive(Debug)]
struct Options<'a> {
    threads: Threads,
    choice: Choice,
    /// Maximum number of hits of a ray.
    max_hits: Option<u32>,
    warn_invalid: bool,
    report: Option<&'a Report>,
}

impl Options<'_> {
    /// Runs a query, and reports its progress.
    fn run<T: Send>(
        &self,
        py: Python<'_>,
        is_small: bool,
        work: impl FnOnce(&Cancel) -> Result<T, Stopped> + Send,
    ) -> PyResult<T> {
        let look = |py: Python<'_>| self.report.map_or(Ok(()), |report| report.tell(py));
        let result = run_with(py, self.threads, is_small, look, work);
        let Some(report) = self.report else { return result };
        let ended = report.end(py, result.is_ok());
        result.and_then(|result| ended.map(|()| result))
    }
}

impl Scene {
    /// Answers a query about rays.
    fn ask<'py, P: Precision + Kept, T>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: &Options<'_>,
        answer: impl FnOnce(&Arc<Snapshot<P>>, &RayArrays<'py, P>, &Question<'_, P>) -> PyResult<T>,
    ) -> PyResult<T> {
        let py = limits.t_min.py();
        let snapshot = self.0.snapshot::<P>(py)?;
        let is_partial = || {
            let contents = self.0.contents(py);
            contents.stage.motion.as_ref().is_some_and(|motion| changes_surfaces(motion))
        };
        if limits.times.is_some() && is_partial() {
            let message = "times: queries do not see the animation of the file, but only what \
                update_transform(id, transforms, times) moves";
            crate::encoding::warn(py, message.into())?;
        }
        let coarse = snapshot.axis.filter(|_| limits.times.is_some()).and_then(|a| a.problem());
        if let Some(problem) = coarse {
            crate::encoding::warn(py, problem)?;
        }
        let arrays = RayArrays::<P>::new(rays, limits, snapshot.axis)?;
        let invalid = AtomicUsize::new(0);
        let invalid_wanted = options.warn_invalid.then_some(&invalid);
        let stats = P::stats(&snapshot.world);
        let piece = piece_size(rays.len(), options.threads.count(), stats);
        let question = Question {
            rays: arrays.view()?,
            piece,
            coherent_angle: coherent_angle(stats),
            invalid: invalid_wanted,
            done: options.report.map(|report| &report.done),
        };
        let result = answer(&snapshot, &arrays, &question)?;
        match invalid.into_inner() {
            0 => {}
            n => {
                let message = format!(
                    "{n} of {} rays can hit nothing: not finite, without direction, or with t_min \
                        >= t_max",
                    rays.len()
                );
                let message = std::ffi::CString::new(message).unwrap_or_default();
                PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &message, 1)?;
            }
        }
        Ok(result)
    }

    fn cast<'py, P: Precision + Kept>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: &Options<'_>,
    ) -> PyResult<Hits> {
        let (py, count) = (limits.t_min.py(), rays.len());
        self.ask::<P, _>(rays, limits, options, |snapshot, arrays, question| {
            let world = &*snapshot.world;
            let (mut hits, mut writable) = Columns::new(py, count)?;
            let places = writable.places()?;
            options.run(py, count <= FEW, |cancel| {
                options.choice.with_filter(snapshot, |filter| {
                    question.hits(cancel, places, |rays, grouping, hits| {
                        P::closest(world, rays, grouping, filter, hits)
                    })
                })
            })?;
            drop(writable);
            // The surface of a shape depends on the distance of the hit. For meshes it does not, so
            // the distances are given to Python without a copy.
            let is_distance_needed = !snapshot.names.are_all_meshes();
            let t = if is_distance_needed { None } else { hits.take_t() };
            let named = Named::new(Live::<P, P> {
                snapshot: snapshot.clone(),
                hits,
                asked: Asked::Rays(arrays.keep(is_distance_needed)?, None),
                choice: options.choice.clone(),
                rays: count,
                shape: rays.shape.clone(),
                splits: None,
            });
            if let Some(t) = t {
                named.set(py, "t_hit", t.bind(py).reshape(&rays.shape[..])?.into_any())?;
            }
            Ok(Hits(named))
        })
    }

    fn occlusions<'py, P: Precision + Kept>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: &Options<'_>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, count) = (limits.t_min.py(), rays.len());
        self.ask::<P, _>(rays, limits, options, |snapshot, _, question| {
            let world = &*snapshot.world;
            admit_all("the answers", count, size_of::<bool>())?;
            let blocked = options.run(py, count <= FEW, |cancel| {
                let mut blocked = vec![false; count];
                options.choice.with_filter(snapshot, |filter| {
                    question.answer(cancel, &mut blocked, |rays, grouping, blocked| {
                        P::occluded(world, rays, grouping, filter, blocked);
                    })
                })?;
                Ok(blocked)
            })?;
            from_vec(py, blocked, &rays.shape)
        })
    }

    fn count<'py, P: Precision + Kept>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: &Options<'_>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, count) = (limits.t_min.py(), rays.len());
        self.ask::<P, _>(rays, limits, options, |snapshot, _, question| {
            let world = &*snapshot.world;
            filled(py, &rays.shape, |counts: &mut [u32]| {
                options.run(py, count <= FEW, |cancel| {
                    options.choice.with_filter(snapshot, |filter| {
                        question.answer(cancel, counts, |rays, _, counts| {
                            P::count(world, rays, filter, options.max_hits, counts);
                        })
                    })
                })
            })
        })
    }

    fn list<'py, P: Precision + Kept>(
        &self,
        rays: &RayArgument<'py>,
        limits: &Limits<'_, 'py>,
        options: &Options<'_>,
    ) -> PyResult<Intersections> {
        let (py, count) = (limits.t_min.py(), rays.len());
        if u32::try_from(rays.len()).is_err() {
            return Err(PyValueError::new_err(format!(
                "rays: there are {}, expected at most {}",
                rays.len(),
                u32::MAX
            )));
        }
        self.ask::<P, _>(rays, limits, options, |snapshot, arrays, question| {
            let world = &*snapshot.world;
            let (most, found) = (Available::now().bytes / BYTES_OF_LISTED, AtomicU64::new(0));
            let listed = options.run(py, count <= FEW, |cancel| {
                let pieces = options.choice.with_filter(snapshot, |filter| {
                    question.all(cancel, |rays| {
                        let all = P::all(world, rays, filter, options.max_hits);
                        let count = all.hits.len() as u64;
                        if found.fetch_add(count, Ordering::Relaxed) + count > most {
                            cancel.stop();
                        }
                        all
                    })
                })?;
                cancel.check()?;
                let total = pieces.iter().map(|piece| piece.hits.len()).sum();
                let (mut hits, mut ids) = (Vec::with_capacity(total), Vec::with_capacity(total));
                let mut splits = Vec::with_capacity(count + 1);
                splits.push(0);
                for piece in pieces {
                    cancel.check()?;
                    for ends in piece.ray_splits.windows(2) {
                        let ray = (splits.len() - 1) as u32;
                        hits.extend(piece.hits[ends[0]..ends[1]].iter().map(P::found));
                        ids.resize(hits.len(), ray);
                        splits.push(hits.len() as i64);
                    }
                }
                Ok((hits, splits, ids))
            });
            let found = found.into_inner();
            if found > most {
                let message = format!(
                    "the list of more than {found} hits does not fit into memory; ask fewer rays"
                );
                return Err(PyMemoryError::new_err(message));
            }
            let (hits, splits, ids) = listed?;
            let kept = arrays.keep(!snapshot.names.are_all_meshes())?;
            Ok(Intersections(Named::new(Live::<P, P> {
                snapshot: snapshot.clone(),
                shape: vec![hits.len()],
                hits: Columns::of(py, &hits)?,
                asked: Asked::Rays(kept, Some(ids)),
                choice: options.choice.clone(),
                rays: count,
                splits: Some(splits),
            })))
        })
    }
}

/// Declares queries, which share their arguments and run in the precision of the rays.
macro_rules! queries {
    ($(
        $(#[doc = $doc:expr])*
        $name:ident $(limited by $most:ident)? ($signature:tt) -> $answer:ty = $method:ident;
    )*) => {
        #[pymethods]
        impl Scene {
            $($(#[doc = $doc])*
            #[pyo3(
                signature = (
                    rays, *more, t_min=None, t_max=None, mask=None, times=None, cull=None,
                    only=None, exclude=None, $($most=None,)? threads=None, progress=None,
                    warn_invalid=false,
                ),
                text_signature = $signature
            )]
            fn $name<'py>(
                &self,
                py: Python<'py>,
                rays: &Bound<'py, PyAny>,
                more: &Bound<'py, PyTuple>,
                t_min: Option<&Bound<'py, PyAny>>,
                t_max: Option<&Bound<'py, PyAny>>,
                mask: Option<&Bound<'py, PyAny>>,
                times: Option<&Bound<'py, PyAny>>,
                cull: Option<&Bound<'py, PyAny>>,
                only: Option<&Bound<'py, PyAny>>,
                exclude: Option<&Bound<'py, PyAny>>,
                $($most: Option<&Bound<'py, PyAny>>,)?
                threads: Option<Count>,
                progress: Option<&Bound<'py, PyAny>>,
                warn_invalid: bool,
            ) -> PyResult<$answer> {
                if !more.is_empty() {
                    return Err(PyTypeError::new_err(concat!(
                        stringify!($name),
                        ": origins and directions are one tuple, ",
                        stringify!($name),
                        "((origins, directions)); what follows has its name: t_min=…"
                    )));
                }
                let rays = RayArgument::new(rays)?;
                let zero = 0.0f64.into_pyobject(py)?.into_any();
                let infinity = f64::INFINITY.into_pyobject(py)?.into_any();
                let (t_min, t_max) = (t_min.unwrap_or(&zero), t_max.unwrap_or(&infinity));
                let limits = Limits { t_min, t_max, mask, times };
                let chosen = Chosen { cull, only, exclude };
                let report = Report::new(progress, rays.len())?;
                let options = Options {
                    threads: Threads::given(threads)?,
                    choice: Choice::new(chosen, || self.0.contents(py))?,
                    max_hits: max_hits(None $(.or($most))?)?,
                    warn_invalid,
                    report: report.as_ref(),
                };
                if rays.is_double {
                    self.$method::<f64>(&rays, &limits, &options)
                } else {
                    self.$method::<f32>(&rays, &limits, &options)
                }
            })*
        }
    };
}

queries! {
    /// The nearest hit of each ray.
    ///
    /// Parameters
    /// ----------
    /// rays : array (..., 6), or a tuple of two arrays (..., 3)
    ///     Origin and direction of each ray; a tuple `(origins, directions)` is broadcast.
    ///     Directions have any length but 0.
    /// t_min, t_max : float or array (...), optional
    ///     Only hits between them count, ends excluded. 0 and infinity if left out.
    /// mask : int or array (...) of integers, optional
    ///     64 bits: only objects whose mask shares a bit with it are hit.
    /// times : float or array (...), optional
    ///     The time of each ray, for things that move (:meth:`update_transform`): each ray sees
    ///     them where they are at its time. The time of the first of all keys if left out.
    /// cull : "back" or "front", optional
    ///     Rays pass through surfaces that they meet from this side: from behind, along
    ///     `primitive_normals`, or from the front, against them (for triangles, the side from which
    ///     their vertices go round counterclockwise). All other hits stay as they are.
    /// only, exclude : int, str, or a list of these, optional
    ///     Objects by id or name: the only ones that are hit, and ones that are not hit. All that
    ///     is in an instance goes with it; a name such as `"taxi/rear"`, as in :attr:`Hits.names`,
    ///     is an object within an instance. A name stands for all objects that have it.
    /// threads : int, optional
    ///     Number of threads. All cores if left out. The result does not depend on it.
    /// progress : bool or callable, optional
    ///     True shows a bar after a second, by tqdm or rich if the program has imported one of
    ///     them, else as a line of text on a terminal. A callable is given the number of rays that
    ///     are answered and that of all, ten times a second and at the end; its exceptions end the
    ///     query.
    /// warn_invalid : bool
    ///     Warn (RuntimeWarning) about rays that can hit nothing: not finite, direction 0, or
    ///     `t_min >= t_max`. They miss.
    ///
    /// Returns
    /// -------
    /// Hits
    ///     With the leading shape of the rays.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.cast_rays(([0, 0, -5], [[0, 0, 1], [0, 0, 2], [0, 1, 0]])).t_hit.tolist()
    /// [4.0, 2.0, inf]
    /// >>> scene.cast_rays([0, 0, -5, 0, 0, 1], cull="front").t_hit.tolist()
    /// 6.0
    /// >>> scene.cast_rays([0, 0, -5, 0, 0, 1], exclude=[ball]).t_hit.tolist()
    /// inf
    cast_rays (
        "($self, rays, *, t_min=None, t_max=None, mask=None, times=None, cull=None, only=None, \
        exclude=None, threads=None, progress=None, warn_invalid=False)"
    ) -> Hits = cast;

    /// Whether each ray hits anything: an array `(...)` of bool. Faster than :meth:`cast_rays`.
    /// Parameters as for :meth:`cast_rays`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.test_occlusions(([0, 0, -5], [[0, 0, 1], [0, 1, 0]])).tolist()
    /// [True, False]
    test_occlusions (
        "($self, rays, *, t_min=None, t_max=None, mask=None, times=None, cull=None, only=None, \
        exclude=None, threads=None, progress=None, warn_invalid=False)"
    ) -> Bound<'py, PyAny> = occlusions;

    /// The number of hits of each ray: an array `(...)` of uint32. Parameters as for
    /// :meth:`cast_rays`, and `max_hits`: counting stops at this number.
    ///
    /// The number is exact: a ray through an edge or vertex of a closed mesh counts each crossing
    /// once.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.count_intersections(([[0, 0, -5], [0, 0, 0]], [0, 0, 1])).tolist()
    /// [2, 1]
    count_intersections limited by max_hits (
        "($self, rays, *, t_min=None, t_max=None, mask=None, times=None, cull=None, only=None, \
        exclude=None, max_hits=None, threads=None, progress=None, warn_invalid=False)"
    ) -> Bound<'py, PyAny> = count;

    /// Every hit of each ray, sorted. Parameters as for :meth:`cast_rays`, and `max_hits`: only the
    /// first hits of each ray, so many at most; what lies behind them is not searched.
    ///
    /// Returns
    /// -------
    /// Intersections
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> scene = snell.Scene()
    /// >>> ball = scene.add_shape("sphere", radius=1)
    /// >>> scene.list_intersections([0, 0, -5, 0, 0, 1]).t_hit.tolist()
    /// [4.0, 6.0]
    /// >>> scene.list_intersections([0, 0, -5, 0, 0, 1], max_hits=1).t_hit.tolist()
    /// [4.0]
    list_intersections limited by max_hits (
        "($self, rays, *, t_min=None, t_max=None, mask=None, times=None, cull=None, only=None, \
        exclude=None, max_hits=None, threads=None, progress=None, warn_invalid=False)"
    ) -> Intersections = list;
}

#[pymethods]
impl Scene {
    /// Rays of one of :attr:`cameras`, one through the centre of each pixel: an array
    /// `(height_px, width_px, 6)`.
    ///
    /// Directions have unit length, so `t_hit` is the distance; where a projection shows nothing
    /// (outside of a fisheye's circle) they are 0.
    ///
    /// Parameters
    /// ----------
    /// camera : int, str or Camera, optional
    ///     Number or name, or a camera. The first if left out.
    /// width_px, height_px : int, optional
    ///     Size of the picture; the camera's if left out.
    /// dtype : float32 or float64
    ///     The precision of the rays, float32 if left out; see :meth:`Camera.rays`.
    ///
    /// Examples
    /// --------
    /// >>> import snell
    /// >>> snell.load("cornell-box").create_rays_camera(0, 4, 4).shape
    /// (4, 4, 6)
    #[pyo3(signature = (camera=None, width_px=None, height_px=None, dtype=None))]
    fn create_rays_camera<'py>(
        &self,
        py: Python<'py>,
        camera: Option<&Bound<'py, PyAny>>,
        width_px: Option<u32>,
        height_px: Option<u32>,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        crate::cameras::rays(py, &self.0.contents(py), camera, [width_px, height_px], dtype)
    }
}
