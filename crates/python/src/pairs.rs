//! Pairs of scenes: their distance, whether they collide, and when they will.

use crate::arrays::{array, contiguous, from_vec, is_double, numpy, shown, slice};
use crate::contents::{Contents, Kind};
use crate::memory::admit_all;
use crate::scene::Scene;
use crate::work::{Cancel, Stopped, Threads, run};
use numpy::PyUntypedArrayMethods;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;
use snell_intersect::{
    AnyShape, Cancelled, ClosestPair, Hit, Motion, PairMesh, PairQuery, PairScene, Pose,
    closest_pair, collides, time_of_impact,
};
use snell_math::{DAffine3, DMat4, DVec3, Transform};
use std::collections::HashMap;
use std::sync::Arc;

/// Objects that a scene may have in all, instances counted as often as they occur; each takes about
/// 400 bytes.
const MOST_OBJECTS: usize = 2_000_000;

/// Pairs of boxes that a single question looks at before it is given to threads that Ctrl-C can
/// stop: some milliseconds.
const QUICK_STEPS: u64 = 100_000;

/// The distance that counts as contact, as a share of the size of what moves.
const TOLERANCE: f64 = 1e-6;

/// The triangles of a scene for questions about pairs.
#[derive(Debug)]
pub struct Pairs {
    scene: PairScene,
    /// What each part is.
    names: Vec<PartName>,
    /// The number of instances within each other.
    depth: usize,
}

/// The object that a part is.
#[derive(Clone, Debug)]
struct PartName {
    /// The number of the object in the scene that holds it.
    object: u32,
    name: Option<Arc<str>>,
    /// The instances around it, the innermost first.
    around: Option<Arc<Around>>,
}

/// An instance, and those around it.
#[derive(Debug)]
struct Around {
    id: u32,
    name: Option<Arc<str>>,
    outer: Option<Arc<Self>>,
}

impl PartName {
    /// The instances around the object, the outermost first.
    fn instances(&self) -> Vec<&Around> {
        let mut all: Vec<_> =
            std::iter::successors(self.around.as_deref(), |step| step.outer.as_deref()).collect();
        all.reverse();
        all
    }

    /// The name as [`crate::assemble::Names::label`] gives it to hits.
    fn label(&self) -> String {
        let called = |name: &Option<Arc<str>>, id: u32| {
            name.as_deref().map_or_else(|| id.to_string(), str::to_string)
        };
        let around = self.instances();
        if around.is_empty() {
            return self.name.as_deref().unwrap_or_default().to_string();
        }
        let around = around.into_iter().map(|step| called(&step.name, step.id));
        around.chain([called(&self.name, self.object)]).collect::<Vec<_>>().join("/")
    }
}

/// What is collected of a scene.
#[derive(Default)]
struct Collector {
    parts: Vec<(Arc<PairMesh>, DAffine3)>,
    names: Vec<PartName>,
    shapes: HashMap<*const AnyShape, Arc<PairMesh>>,
    /// The number of objects so far.
    count: usize,
}

impl Pairs {
    /// Prepares a scene. Fails with what is wrong and what to do.
    pub fn new(contents: &Contents) -> Result<Self, String> {
        let mut collector = Collector::default();
        collector.collect(contents, &Transform::IDENTITY, &None)?;
        let Collector { parts, names, .. } = collector;
        let scene = PairScene::new(parts).map_err(|e| e.to_string())?;
        let depth = names.iter().map(|name| name.instances().len()).max().unwrap_or(0);
        Ok(Self { scene, names, depth })
    }
}

impl Collector {
    /// Adds the objects of a scene with its place, which is in the instances `around`.
    fn collect(
        &mut self,
        contents: &Contents,
        placed: &Transform,
        around: &Option<Arc<Around>>,
    ) -> Result<(), String> {
        for (number, object) in contents.objects() {
            self.count += 1;
            if self.count > MOST_OBJECTS {
                return Err(format!(
                    "the scene has more than {MOST_OBJECTS} objects, those in instances counted; \
                     ask about parts of it"
                ));
            }
            let map = match &object.transform {
                Some(own) => placed.compose(own),
                None => *placed,
            };
            let mesh = match &object.kind {
                Kind::Mesh(mesh) => mesh.prepare_pairs().map_err(|e| e.to_string())?,
                Kind::Instance(child) => {
                    let (name, outer) = (object.name.clone(), around.clone());
                    let inner = Some(Arc::new(Around { id: number, name, outer }));
                    self.collect(child, &map, &inner)?;
                    continue;
                }
                Kind::Shape(shape) => match self.shapes.get(&Arc::as_ptr(shape)) {
                    Some(known) => known.clone(),
                    None => {
                        let made = PairMesh::of_shape(shape).map_err(|e| e.to_string())?;
                        let made = made.ok_or_else(|| refused(shape.name(), number))?;
                        let made = Arc::new(made);
                        self.shapes.insert(Arc::as_ptr(shape), made.clone());
                        made
                    }
                },
                Kind::Spheres(_) => return Err(refused("set of spheres", number)),
                Kind::Curves(_) => return Err(refused("set of curves", number)),
                Kind::Heightfield(field) => {
                    let triangles = field.triangles();
                    if triangles.numbers.is_some() {
                        return Err(refused("heightfield with holes", number));
                    }
                    triangles.mesh.prepare_pairs().map_err(|e| e.to_string())?
                }
            };
            self.parts.push((mesh, *map.matrix()));
            let (name, around) = (object.name.clone(), around.clone());
            self.names.push(PartName { object: number, name, around });
        }
        Ok(())
    }
}

/// The message for what has no exact triangles.
fn refused(kind: &str, number: u32) -> String {
    let instead = match kind {
        "plane" => "add a rectangle that is large enough",
        "polygon" | "heightfield with holes" => "add its triangles as a mesh",
        _ => "add a mesh of it, as fine as you need",
    };
    format!(
        "object {number} is a {kind}, but pairs are found of meshes, boxes, rectangles, \
         triangles and heightfields without holes only; {instead}"
    )
}

/// Poses: one for all, or one for each question.
struct Poses {
    poses: Vec<Pose>,
    is_many: bool,
}

impl Poses {
    fn new(value: Option<&Bound<'_, PyAny>>, name: &str) -> PyResult<Self> {
        let Some(value) = value else {
            return Ok(Self { poses: vec![Pose::IDENTITY], is_many: false });
        };
        let (maps, shape) = matrices(value, name)?;
        if shape.len() > 1 {
            return Err(expected(name, "(4, 4) or (n, 4, 4)", &shape));
        }
        let is_many = !shape.is_empty();
        let pose = |(i, map): (usize, DAffine3)| {
            let at = if is_many { format!("[{i}]") } else { String::new() };
            Pose::new(map).map_err(|e| PyValueError::new_err(format!("{name}{at}: {e}")))
        };
        let poses = maps.into_iter().enumerate().map(pose).collect::<PyResult<_>>()?;
        Ok(Self { poses, is_many })
    }

    fn get(&self, i: usize) -> &Pose {
        &self.poses[if self.is_many { i } else { 0 }]
    }
}

fn expected(name: &str, expected: &str, leading: &[usize]) -> PyErr {
    let shape = [leading, &[4, 4]].concat();
    PyValueError::new_err(format!("{name}: shape is {}, expected {expected}", shown(&shape)))
}

/// Reads matrices `(..., 4, 4)` or `(..., 3, 4)`, and returns them with the leading shape.
fn matrices(value: &Bound<'_, PyAny>, name: &str) -> PyResult<(Vec<DAffine3>, Vec<usize>)> {
    let array = array(value, name)?;
    let (leading, rows) = match array.shape() {
        [leading @ .., rows @ (3 | 4), 4] => (leading.to_vec(), *rows),
        found => {
            let found = shown(found);
            return Err(PyValueError::new_err(format!(
                "{name}: shape is {found}, expected (..., 4, 4)"
            )));
        }
    };
    is_double(&array, name)?;
    let values = contiguous::<f64>(&array)?;
    let mut maps = Vec::with_capacity(leading.iter().product());
    for (i, given) in slice(&values)?.chunks_exact(4 * rows).enumerate() {
        let at = if leading.is_empty() { String::new() } else { format!("[{i}]") };
        let mut all = DMat4::IDENTITY.to_cols_array();
        all[..given.len()].copy_from_slice(given);
        if let Some(bad) = all.iter().find(|x| !x.is_finite()) {
            return Err(PyValueError::new_err(format!(
                "{name}{at} holds {bad}, expected finite numbers"
            )));
        }
        if all[12..] != [0.0, 0.0, 0.0, 1.0] {
            return Err(PyValueError::new_err(format!(
                "{name}{at}: the last row is {:?}, expected [0, 0, 0, 1]; matrices are for column \
                 vectors",
                &all[12..]
            )));
        }
        maps.push(DAffine3::from_mat4(DMat4::from_cols_array(&all).transpose()));
    }
    Ok((maps, leading))
}

/// Two scenes with their poses.
struct Asked {
    a: Arc<Pairs>,
    b: Arc<Pairs>,
    poses: [Poses; 2],
    count: usize,
    /// The shape of the answers: `()` or `(n,)`.
    shape: Vec<usize>,
    threads: Threads,
}

impl Asked {
    fn new(
        py: Python<'_>,
        [a, b]: [&Bound<'_, PyAny>; 2],
        poses: [Poses; 2],
        threads: Option<i64>,
    ) -> PyResult<Self> {
        let many = || poses.iter().filter(|poses| poses.is_many).map(|poses| poses.poses.len());
        let count = many().next().unwrap_or(1);
        if many().any(|other| other != count) {
            return Err(PyValueError::new_err(format!(
                "there are {} poses in transform_a and {} in transform_b",
                poses[0].poses.len(),
                poses[1].poses.len()
            )));
        }
        let shape = if many().next().is_some() { vec![count] } else { Vec::new() };
        let threads = Threads::new(threads)?;
        let (a, b) = (pairs(py, a, "a")?, pairs(py, b, "b")?);
        Ok(Self { a, b, poses, count, shape, threads })
    }

    /// Answers all questions. A short one is answered by the calling thread at once.
    fn answers<T: Default + Clone + Send>(
        &self,
        py: Python<'_>,
        answer: impl Fn(usize, &PairQuery) -> Result<T, Cancelled> + Sync,
    ) -> PyResult<Vec<T>> {
        answers(py, self.count, self.threads, answer)
    }

    fn sides(&self, i: usize) -> [(&PairScene, &Pose); 2] {
        [(&self.a.scene, self.poses[0].get(i)), (&self.b.scene, self.poses[1].get(i))]
    }
}

fn answers<T: Default + Clone + Send>(
    py: Python<'_>,
    count: usize,
    threads: Threads,
    answer: impl Fn(usize, &PairQuery) -> Result<T, Cancelled> + Sync,
) -> PyResult<Vec<T>> {
    admit_all("the answers", count, 2 * size_of::<T>())?;
    if count == 1 {
        let quick = PairQuery { max_steps: QUICK_STEPS, ..PairQuery::default() };
        if let Ok(answer) = py.detach(|| answer(0, &quick)) {
            return Ok(vec![answer]);
        }
    }
    run(py, threads, false, |cancel: &Cancel| {
        let query = PairQuery { cancel: Some(cancel.flag()), ..PairQuery::default() };
        let mut all = vec![T::default(); count];
        let each = |(i, place): (usize, &mut T)| -> Result<(), Stopped> {
            cancel.check()?;
            *place = answer(i, &query).map_err(|Cancelled| Stopped)?;
            Ok(())
        };
        all.par_iter_mut().enumerate().try_for_each(each)?;
        Ok(all)
    })
}

/// The triangles of an argument that is a scene.
fn pairs(py: Python<'_>, scene: &Bound<'_, PyAny>, name: &str) -> PyResult<Arc<Pairs>> {
    let found = scene.cast::<Scene>().map_err(|_| {
        let kind = scene.get_type().name().map_or_else(|_| "?".into(), |kind| kind.to_string());
        PyTypeError::new_err(format!("{name} is a {kind}, expected a snell.Scene"))
    })?;
    let named = |e: PyErr| match e.is_instance_of::<PyValueError>(py) {
        true => PyValueError::new_err(format!("{name}: {}", e.value(py))),
        false => e,
    };
    found.get().0.pairs(py).map_err(named)
}

/// A number that is not negative and not NaN.
fn length(value: Option<f64>, default: f64, name: &str) -> PyResult<f64> {
    let value = value.unwrap_or(default);
    if value >= 0.0 {
        return Ok(value);
    }
    Err(PyValueError::new_err(format!("{name} is {value}, expected 0 or more")))
}

/// Distances, points `(..., 2, 3)`, the ids `(..., 2)` of geometries, primitives and instances, the
/// paths of instances `(..., 2, depth)`, and names `(..., 2)`.
#[pyfunction]
#[pyo3(signature = (a, b, transform_a, transform_b, max_distance, threads))]
pub fn _closest_pair<'py>(
    py: Python<'py>,
    a: &Bound<'py, PyAny>,
    b: &Bound<'py, PyAny>,
    transform_a: Option<&Bound<'py, PyAny>>,
    transform_b: Option<&Bound<'py, PyAny>>,
    max_distance: Option<f64>,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyTuple>> {
    let max_distance = length(max_distance, f64::INFINITY, "max_distance")?;
    let poses = [Poses::new(transform_a, "transform_a")?, Poses::new(transform_b, "transform_b")?];
    let asked = Asked::new(py, [a, b], poses, threads)?;
    let found = asked.answers(py, |i, query| {
        let [a, b] = asked.sides(i);
        closest_pair(a, b, &PairQuery { max_distance, ..*query })
    })?;
    let distances = found.iter().map(|pair| pair.map_or(f64::INFINITY, |pair| pair.distance));
    let points = |pair: &Option<ClosestPair>| pair.map_or([DVec3::NAN; 2], |pair| pair.points);
    let points = found.iter().flat_map(points).flat_map(|p| p.to_array());
    let ids = |id: &dyn Fn(&ClosestPair, usize) -> u32| -> Vec<u32> {
        let of = |pair: &Option<ClosestPair>| {
            [0, 1].map(|side| pair.as_ref().map_or(Hit::NONE, |pair| id(pair, side)))
        };
        found.iter().flat_map(of).collect()
    };
    let name = |pair: &ClosestPair, side: usize| {
        let names = if side == 0 { &asked.a.names } else { &asked.b.names };
        &names[pair.parts[side] as usize]
    };
    let sides = || found.iter().flat_map(|pair| [0, 1].map(|side| (pair.as_ref(), side)));
    let paths: Vec<Vec<u32>> = sides()
        .map(|(pair, side)| {
            let instances = pair.map_or(Vec::new(), |pair| name(pair, side).instances());
            instances.into_iter().map(|step| step.id).collect()
        })
        .collect();
    let depth = asked.a.depth.max(asked.b.depth);
    let padded = |path: &Vec<u32>| {
        let mut row = vec![Hit::NONE; depth];
        row[..path.len()].copy_from_slice(path);
        row
    };
    let outermost = paths.iter().map(|path| path.first().copied().unwrap_or(Hit::NONE));
    let labels = sides().map(|(pair, side)| pair.map(|pair| name(pair, side).label()));
    let two = [&asked.shape[..], &[2]].concat();
    let labels: Vec<String> = labels.map(Option::unwrap_or_default).collect();
    let labels =
        numpy(py, "array")?.call1((labels, "U"))?.call_method1("reshape", (two.clone(),))?;
    PyTuple::new(
        py,
        [
            from_vec(py, distances.collect(), &asked.shape)?,
            from_vec(py, points.collect(), &[&asked.shape[..], &[2, 3]].concat())?,
            from_vec(py, ids(&|pair, side| name(pair, side).object), &two)?,
            from_vec(py, ids(&|pair, side| pair.triangles[side]), &two)?,
            from_vec(py, outermost.collect(), &two)?,
            from_vec(py, paths.iter().flat_map(padded).collect(), &[&two[..], &[depth]].concat())?,
            labels,
        ],
    )
}

/// Whether surfaces meet: an array `()` or `(n,)`.
#[pyfunction]
#[pyo3(signature = (a, b, transform_a, transform_b, threads))]
pub fn _collides<'py>(
    py: Python<'py>,
    a: &Bound<'py, PyAny>,
    b: &Bound<'py, PyAny>,
    transform_a: Option<&Bound<'py, PyAny>>,
    transform_b: Option<&Bound<'py, PyAny>>,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyAny>> {
    let poses = [Poses::new(transform_a, "transform_a")?, Poses::new(transform_b, "transform_b")?];
    let asked = Asked::new(py, [a, b], poses, threads)?;
    let found = asked.answers(py, |i, query| {
        let [a, b] = asked.sides(i);
        collides(a, b, query)
    })?;
    from_vec(py, found, &asked.shape)
}

/// Moments of contact: an array `()` or `(n,)` for motions `(2, 4, 4)` or `(n, 2, 4, 4)`.
#[pyfunction]
#[pyo3(signature = (a, b, motion, transform_b, tolerance, threads))]
pub fn _time_of_impact<'py>(
    py: Python<'py>,
    a: &Bound<'py, PyAny>,
    b: &Bound<'py, PyAny>,
    motion: &Bound<'py, PyAny>,
    transform_b: Option<&Bound<'py, PyAny>>,
    tolerance: Option<f64>,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyAny>> {
    let tolerance = tolerance.map(|given| length(Some(given), 0.0, "tolerance")).transpose()?;
    let (maps, shape) = matrices(motion, "motion")?;
    let shape = match &*shape {
        [2] => Vec::new(),
        [n, 2] => vec![*n],
        other => return Err(expected("motion", "(2, 4, 4) or (n, 2, 4, 4)", other)),
    };
    let motions = maps.as_chunks::<2>().0.iter().enumerate().map(|(i, [from, to])| {
        let at = if shape.is_empty() { String::new() } else { format!("[{i}]") };
        Motion::new(from, to).map_err(|e| PyValueError::new_err(format!("motion{at}: {e}")))
    });
    let motions = motions.collect::<PyResult<Vec<_>>>()?;
    let pose = Poses::new(transform_b, "transform_b")?;
    if pose.is_many {
        return Err(PyValueError::new_err("transform_b: expected one pose, (4, 4)"));
    }
    let threads = Threads::new(threads)?;
    let (a, b) = (pairs(py, a, "a")?, pairs(py, b, "b")?);
    let tolerance = tolerance.unwrap_or(TOLERANCE * a.scene.size());
    let found = answers(py, motions.len(), threads, |i, query| {
        time_of_impact(&a.scene, &motions[i], (&b.scene, pose.get(0)), tolerance, query)
    })?;
    from_vec(py, found, &shape)
}

/// A point of each body of a scene: an array `(m, 3)`.
#[pyfunction]
pub fn _body_points<'py>(
    py: Python<'py>,
    scene: &Bound<'py, PyAny>,
    name: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let pairs = pairs(py, scene, name)?;
    let points = py.detach(|| pairs.scene.body_points());
    let shape = [points.len(), 3];
    from_vec(py, points.into_iter().flat_map(|p| p.to_array()).collect(), &shape)
}
