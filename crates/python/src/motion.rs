//! The motion of objects: maps at times, in any unit of time, such as seconds.
//!
//! Between two keys translations are interpolated linearly, rotations spherically and the rest of
//! the maps linearly ([`AnimatedTransform`], as animations of files are). An object rests before
//! its first key and after its last. Worlds interpolate matrices entry by entry, so they get keys
//! in between where something turns.

use crate::contents::{Contents, Kind};
use pyo3::PyResult;
use pyo3::exceptions::PyValueError;
use snell_intersect::Instance;
use snell_math::{Bounds3d, DAffine3, Transform};
use snell_scene::motion::AnimatedTransform;
use std::collections::HashMap;
use std::sync::Arc;

/// The largest difference that linear interpolation may make to an entry of a matrix, relative to
/// the largest entry: rotations are taken in steps of half a degree.
const TOLERANCE: f64 = 1e-5;

/// The maps of an object at some times.
#[derive(Clone, Debug)]
pub struct Motion {
    times: Vec<f64>,
    maps: Vec<Transform>,
    smooth: AnimatedTransform,
    /// Times and maps between which linear interpolation is accurate; the keys are among them.
    fine: Vec<(f64, Transform)>,
}

impl Motion {
    /// The motion with these maps at these ascending times, as many as maps and at least one. Fails
    /// if there is no way from a map to the next along which the object keeps its extent.
    pub fn new(times: Vec<f64>, maps: Vec<Transform>) -> PyResult<Self> {
        let keys = || times.iter().copied().zip(maps.iter());
        let smooth = AnimatedTransform::new(keys().map(|(time, map)| (time, *map.matrix())));
        let mut fine: Vec<(f64, Transform)> = Vec::with_capacity(maps.len());
        for (key, (time, map)) in keys().enumerate() {
            if let Some(&(last, from)) = fine.last() {
                let pieces = pieces(&from, smooth.at((last + time) * 0.5), map);
                for piece in 1..pieces {
                    let time = last + (time - last) * f64::from(piece) / f64::from(pieces);
                    let map = Transform::new(smooth.at(time)).ok_or_else(|| singular(key))?;
                    fine.push((time, map));
                }
                // A mirrored map is reached through a flat one.
                if from.is_mirrored() != map.is_mirrored() {
                    return Err(singular(key));
                }
            }
            fine.push((time, *map));
        }
        Ok(Self { times, maps, smooth, fine })
    }

    /// The times of the keys.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The maps at the keys.
    pub fn maps(&self) -> &[Transform] {
        &self.maps
    }

    /// The motion for renderers and files.
    pub fn smooth(&self) -> &AnimatedTransform {
        &self.smooth
    }

    /// The motion below something that is `placed`; `None` if that changes angles, so that the
    /// motion between keys would be another.
    pub fn below(&self, placed: &Transform) -> Option<Self> {
        if placed.is_identity() {
            return Some(self.clone());
        }
        let axes = placed.matrix().matrix3;
        let products = (axes.transpose() * axes).to_cols_array_2d();
        let size = products[0][0];
        let keeps_angles = (0..9).all(|i| {
            let expected = if i % 4 == 0 { size } else { 0.0 };
            (products[i / 3][i % 3] - expected).abs() <= 1e-12 * size
        });
        if !keeps_angles {
            return None;
        }
        let maps = self.maps.iter().map(|map| placed.compose(map)).collect();
        Self::new(self.times.clone(), maps).ok()
    }

    /// The map at a time.
    pub fn at(&self, time: f64) -> Transform {
        // The maps between keys were checked at finer steps than those where they are flat.
        Transform::new(self.smooth.at(time)).unwrap_or(self.maps[0])
    }

    /// The box of something at all times.
    pub fn bounds(&self, own: &Bounds3d) -> Bounds3d {
        self.fine.iter().fold(Bounds3d::EMPTY, |all, (_, map)| all.union(&map.bounds(own)))
    }
}

/// Number of pieces of the way from a map to another in which linear interpolation is accurate, by
/// the map in the middle. The error falls with the square of their number.
fn pieces(from: &Transform, middle: DAffine3, to: &Transform) -> u32 {
    let entries = |map: &DAffine3| map.matrix3.to_cols_array();
    let (a, m, b) = (entries(from.matrix()), entries(&middle), entries(to.matrix()));
    let size = m.iter().fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
    let bend = a
        .iter()
        .zip(m)
        .zip(b)
        .fold(0.0f64, |most, ((a, m), b)| most.max((m - (a + b) * 0.5).abs()));
    // Only a rotation bends, and by no more than its diameter.
    (bend / size / TOLERANCE).min(2.0 / TOLERANCE).sqrt().ceil().max(1.0) as u32
}

fn singular(key: usize) -> pyo3::PyErr {
    PyValueError::new_err(format!(
        "transform: between the keys {} and {key} the map is singular; one is mirrored and the \
            other is not",
        key - 1
    ))
}

/// The largest share of the time between two keys that may be lost to rounding.
const LEAST_STEP: f64 = 1e-3;

/// The time axis of a world: its times run from 0 at the first of all keys of a scene to 1 at the
/// last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    start: f64,
    length: f64,
    /// The shortest time between two keys of an object that follow each other.
    shortest: f64,
}

impl Axis {
    /// The axis of a scene, of everything in instances too; `None` if nothing moves.
    pub fn of(contents: &Contents) -> Option<Self> {
        let [start, end, shortest] = span(contents, &mut HashMap::new())?;
        // At a single time, everything rests before and after it.
        (end > start).then_some(Self { start, length: end - start, shortest })
    }

    /// A warning if the times of a world, which are in single precision, are too coarse for the
    /// keys of what moves fast.
    pub fn problem(&self) -> Option<String> {
        let step = self.length * f64::from(f32::EPSILON) / 2.0;
        (step > self.shortest * LEAST_STEP).then(|| {
            format!(
                "times: the keys of all that moves span {:.6}, so times within {step:.1e} are one, \
                 but some keys are only {:.6} apart; give all times from about the start of the \
                 motion",
                self.length, self.shortest
            )
        })
    }

    /// A time in the world.
    #[inline(always)]
    pub fn time(&self, time: f64) -> f32 {
        ((time - self.start) / self.length).clamp(0.0, 1.0) as f32
    }

    /// An instance that moves.
    pub fn moving(&self, instance: Instance, motion: &Motion) -> Instance {
        Instance {
            group_from_child: motion.fine[0].1,
            later: motion.fine[1..].iter().map(|key| key.1).collect(),
            times: motion.fine.iter().map(|key| self.time(key.0)).collect(),
            ..instance
        }
    }
}

/// The first and the last time of all keys, and the shortest time between two keys of an object;
/// `None` if nothing moves.
fn span(
    contents: &Contents,
    known: &mut HashMap<*const Contents, Option<[f64; 3]>>,
) -> Option<[f64; 3]> {
    let mut all: Option<[f64; 3]> = None;
    for (_, object) in contents.objects() {
        let own = object.motion.as_ref().map(|motion| {
            let steps = motion.times.windows(2).map(|pair| pair[1] - pair[0]);
            let shortest = steps.fold(f64::INFINITY, f64::min);
            [motion.times[0], *motion.times.last().unwrap_or(&0.0), shortest]
        });
        let inner = match &object.kind {
            Kind::Instance(child) => match known.get(&Arc::as_ptr(child)) {
                Some(span) => *span,
                None => {
                    let span = span(child, known);
                    known.insert(Arc::as_ptr(child), span);
                    span
                }
            },
            _ => None,
        };
        for [start, end, shortest] in own.into_iter().chain(inner) {
            let joined = |[a, b, c]: [f64; 3]| [a.min(start), b.max(end), c.min(shortest)];
            all = Some(all.map_or([start, end, shortest], joined));
        }
    }
    all
}

/// The contents of a scene at a time, in which nothing moves. Whatever rests is shared.
pub fn still(contents: &Arc<Contents>, time: f64) -> Arc<Contents> {
    still_with(contents, time, &mut HashMap::new())
}

fn still_with(
    contents: &Arc<Contents>,
    time: f64,
    known: &mut HashMap<*const Contents, Arc<Contents>>,
) -> Arc<Contents> {
    if let Some(known) = known.get(&Arc::as_ptr(contents)) {
        return known.clone();
    }
    let mut posed: Option<Contents> = None;
    for (id, object) in contents.objects() {
        let moved = object.motion.as_ref().map(|motion| motion.at(time));
        let inner = match &object.kind {
            Kind::Instance(child) => {
                let still = still_with(child, time, known);
                (!Arc::ptr_eq(&still, child)).then_some(still)
            }
            _ => None,
        };
        if moved.is_none() && inner.is_none() {
            continue;
        }
        let posed = posed.get_or_insert_with(|| Contents::clone(contents));
        if let Ok(object) = posed.get_mut(id.into()) {
            if moved.is_some() {
                (object.transform, object.motion) = (moved, None);
            }
            if let Some(inner) = inner {
                object.kind = Kind::Instance(inner);
            }
        }
    }
    let posed = posed.map_or_else(|| contents.clone(), Arc::new);
    known.insert(Arc::as_ptr(contents), posed.clone());
    posed
}
