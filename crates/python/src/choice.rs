//! What a query about rays takes into account: the side of surfaces, and objects by id and name.

use crate::arrays::{named, whole};
use crate::assemble::{Names, Snapshot};
use crate::contents::{Contents, Kind};
use crate::names::{choice, suggestion};
use crate::precision::Precision;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyByteArray, PyBytes, PyInt, PyString};
use snell_intersect::{AcceptAll, Both, DHit, Double, Hit, HitFilter, Side, Single};
use snell_math::{DRay, Ray};
use std::collections::HashSet;

/// The arguments `cull`, `only` and `exclude` of a query.
#[derive(Clone, Debug, Default)]
pub struct Choice {
    /// The side on which surfaces are not hit.
    cull: Option<Side>,
    /// The only objects that are hit.
    only: Option<Selection>,
    /// Objects that are not hit.
    exclude: Option<Selection>,
}

/// The arguments as they were given.
#[derive(Clone, Copy, Debug)]
pub struct Chosen<'a, 'py> {
    /// The side on which surfaces are not hit.
    pub cull: Option<&'a Bound<'py, PyAny>>,
    /// The only objects that are hit.
    pub only: Option<&'a Bound<'py, PyAny>>,
    /// Objects that are not hit.
    pub exclude: Option<&'a Bound<'py, PyAny>>,
}

/// The sides by their names.
const SIDES: [(&str, Side); 2] = [("back", Side::Back), ("front", Side::Front)];

impl Choice {
    /// Reads the arguments of a query of a scene with these contents.
    pub fn new(
        chosen: Chosen<'_, '_>,
        contents: impl FnOnce() -> std::sync::Arc<Contents>,
    ) -> PyResult<Self> {
        let Chosen { cull, only, exclude } = chosen;
        let cull = cull.map(side).transpose()?;
        if only.is_none() && exclude.is_none() {
            return Ok(Self { cull, ..Self::default() });
        }
        let contents = contents();
        let select = |value: Option<&Bound<'_, PyAny>>, name| {
            value.map(|value| Selection::new(value, name, &contents)).transpose()
        };
        Ok(Self { cull, only: select(only, "only")?, exclude: select(exclude, "exclude")? })
    }

    /// The choice for rays that go the opposite way.
    pub fn reversed(&self) -> Self {
        let cull = self.cull.map(|side| match side {
            Side::Front => Side::Back,
            Side::Back => Side::Front,
        });
        Self { cull, ..self.clone() }
    }

    /// Asks with the filter of this choice.
    pub fn with_filter<P: Precision, T>(
        &self,
        snapshot: &Snapshot<P>,
        ask: impl FnOnce(&dyn HitFilter<P::Tag>) -> T,
    ) -> T {
        let culled = self.cull.map(|side| P::culled(&snapshot.world, side));
        let is_selective = self.only.is_some() || self.exclude.is_some();
        let selected =
            is_selective.then(|| P::selected(Selected { names: &snapshot.names, choice: self }));
        match (culled, selected) {
            (None, None) => ask(&AcceptAll),
            (Some(culled), None) => ask(&*culled),
            (None, Some(selected)) => ask(&*selected),
            (Some(culled), Some(selected)) => ask(&Both(&*selected, &*culled)),
        }
    }
}

fn side(value: &Bound<'_, PyAny>) -> PyResult<Side> {
    let Ok(name) = value.cast::<PyString>() else {
        return Err(PyTypeError::new_err(format!(
            "cull is {}, expected \"back\", \"front\" or None",
            value.repr()?
        )));
    };
    choice("cull", &name.to_string_lossy(), &SIDES, |(name, _)| name).map(|(_, side)| side)
}

/// Some objects of a scene, with all that is in those that are instances.
#[derive(Clone, Debug, Default)]
struct Selection {
    /// The objects of the scene itself.
    own: HashSet<u32>,
    /// Objects within instances: the ids of the instances, the outermost first, and their own.
    within: Vec<Vec<u32>>,
}

impl Selection {
    /// Reads an argument: an id or a name, or a sequence of these.
    fn new(value: &Bound<'_, PyAny>, argument: &str, contents: &Contents) -> PyResult<Self> {
        let mut selection = Self::default();
        if value.is_instance_of::<PyString>() || value.is_instance_of::<PyInt>() {
            selection.add(value, argument, contents)?;
            return Ok(selection);
        }
        let wrong = || {
            // The items of bytes are numbers, which would be taken as ids.
            if value.is_instance_of::<PyBytes>() || value.is_instance_of::<PyByteArray>() {
                let found = crate::settings::shown(value);
                return PyTypeError::new_err(format!(
                    "{argument} is {found}, expected a text as a name; .decode() makes one of bytes"
                ));
            }
            let kind = value.get_type();
            PyTypeError::new_err(format!(
                "{argument} is of type {kind}, expected an id, a name, or a list of these"
            ))
        };
        if value.is_instance_of::<PyBytes>() || value.is_instance_of::<PyByteArray>() {
            return Err(wrong());
        }
        let items = value.try_iter().map_err(|_| wrong())?;
        for (i, item) in items.enumerate() {
            selection.add(&item?, &format!("{argument}[{i}]"), contents)?;
        }
        Ok(selection)
    }

    fn add(
        &mut self,
        value: &Bound<'_, PyAny>,
        argument: &str,
        contents: &Contents,
    ) -> PyResult<()> {
        if let Ok(name) = value.cast::<PyString>() {
            let name = name.to_string_lossy();
            let mut found = Vec::new();
            paths(contents, &name, &mut Vec::new(), &mut found);
            if found.is_empty() || name.is_empty() {
                let names: Vec<_> =
                    contents.objects().filter_map(|(_, object)| object.name.as_deref()).collect();
                let end = suggestion(&name, &names);
                return Err(PyValueError::new_err(format!(
                    "{argument}: nothing has the name {name:?}{end}"
                )));
            }
            for path in found {
                match path[..] {
                    [id] => _ = self.own.insert(id),
                    _ => self.within.push(path),
                }
            }
            return Ok(());
        }
        let id = (!value.is_instance_of::<PyBool>()).then(|| value.extract::<i64>());
        let Some(Ok(id)) = id else {
            return Err(PyTypeError::new_err(format!(
                "{argument} is {}, expected an id or a name",
                value.repr()?
            )));
        };
        contents.get(id).map_err(|error| {
            PyValueError::new_err(format!("{argument}: {}", error.value(value.py())))
        })?;
        self.own.insert(id as u32);
        Ok(())
    }

    fn holds(&self, names: &Names, occurrence: u32, geometry: u32) -> bool {
        let own = || names.object(geometry);
        let top = names.path(occurrence).next().unwrap_or_else(own);
        self.own.contains(&top)
            || self.within.iter().any(|path| {
                let whole = names.path(occurrence).chain([own()]);
                // A path ends at the object itself or at an instance around it.
                path.iter().copied().eq(whole.take(path.len()))
            })
    }
}

/// The paths of all objects with a name, as [`Names::label`] gives it: of objects of the scene by
/// their own names, and within instances after the instances' names, with slashes between them.
fn paths(contents: &Contents, name: &str, around: &mut Vec<u32>, found: &mut Vec<Vec<u32>>) {
    for (id, object) in contents.objects() {
        let number = id.to_string();
        let is_top = around.is_empty();
        let label = match object.name.as_deref() {
            Some(label) => label,
            // Objects without a name are called by their numbers, but for those in no instance.
            None if is_top && !matches!(object.kind, Kind::Instance(_)) => continue,
            None => &number,
        };
        around.push(id);
        if label == name {
            found.push(around.clone());
        } else if let Kind::Instance(child) = &object.kind
            && let Some(rest) = name.strip_prefix(label).and_then(|rest| rest.strip_prefix('/'))
        {
            paths(child, rest, around, found);
        }
        around.pop();
    }
}

/// The filter of a choice by objects.
#[derive(Clone, Copy, Debug)]
pub struct Selected<'a> {
    names: &'a Names,
    choice: &'a Choice,
}

impl Selected<'_> {
    fn accepts(&self, occurrence: u32, geometry: u32) -> bool {
        let holds = |selection: &Selection| selection.holds(self.names, occurrence, geometry);
        self.choice.only.as_ref().is_none_or(holds)
            && !self.choice.exclude.as_ref().is_some_and(holds)
    }
}

impl HitFilter<Single> for Selected<'_> {
    fn accept(&self, _: &Ray, hit: &Hit) -> bool {
        self.accepts(hit.instance, hit.geometry)
    }

    fn decides_everywhere(&self) -> bool {
        true
    }
}

impl HitFilter<Double> for Selected<'_> {
    fn accept(&self, _: &DRay, hit: &DHit) -> bool {
        self.accepts(hit.instance, hit.geometry)
    }

    fn decides_everywhere(&self) -> bool {
        true
    }
}

/// Reads the argument `max_hits`: a positive number.
pub fn max_hits(value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<u32>> {
    let Some(value) = value else { return Ok(None) };
    match whole(value).filter(|_| !value.is_instance_of::<PyBool>()) {
        Some(n) if n >= 1 => Ok(Some(u32::try_from(n).unwrap_or(u32::MAX))),
        Some(n) => {
            Err(PyValueError::new_err(format!("max_hits is {n}, expected a whole number from 1")))
        }
        None => Err(named(value, "max_hits", "1 or more, or None for all")),
    }
}
