//! Visitors of the numbers in a value with parameters.

use super::range::shown;
use super::{Range, Value};

/// One step from a value to a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A step to the parameter of this name.
    Name(&'static str),
    /// A step to the item at this position of a list.
    Index(usize),
}

impl std::fmt::Display for Step {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Name(name) => f.write_str(name),
            Self::Index(i) => write!(f, "{i}"),
        }
    }
}

/// The value at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leaf<'a> {
    /// A number.
    Number(f64),
    /// A vector or colour. Some components may be missing.
    Numbers(&'a [Option<f64>]),
    /// A position in the table of the scene that the string names, such as `texture`.
    Reference(&'static str, u32),
}

/// A number, vector or reference that was found in a value with parameters.
#[derive(Clone, Copy, Debug)]
pub struct Found<'a> {
    /// The steps from the visited value to this one.
    pub place: &'a [Step],
    /// The range of the numbers.
    pub range: Range,
    /// The range of plausible numbers.
    pub usual: Range,
    /// The texture that the number or colour multiplies, by its position in the scene's table.
    pub texture: Option<u32>,
    /// True if the value is a factor that multiplies a spectrum.
    pub is_spectral: bool,
    /// The number, vector or reference itself.
    pub leaf: Leaf<'a>,
}

/// The state of a visit, with the callback that gets what is found.
pub struct Visitor<'v> {
    place: Vec<Step>,
    range: Range,
    usual: Range,
    texture: Option<u32>,
    is_spectral: bool,
    visit: &'v mut dyn FnMut(&Found<'_>),
}

impl std::fmt::Debug for Visitor<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Visitor").field("place", &self.place).finish_non_exhaustive()
    }
}

impl Visitor<'_> {
    /// Visits a parameter.
    pub fn parameter(&mut self, parameter: &super::Parameter, value: &impl Value) {
        let before = (self.range, self.usual);
        (self.range, self.usual) = (parameter.range, parameter.usual);
        if parameter.name.is_empty() {
            value.visit(self);
        } else {
            self.inside(Step::Name(parameter.name), value);
        }
        (self.range, self.usual) = before;
    }

    /// Visits a part of the current value. The part has the range of the whole.
    pub fn inside(&mut self, step: Step, value: &impl Value) {
        self.within(step, |visitor| value.visit(visitor));
    }

    /// Calls `look` with the visitor one step further inside.
    pub fn within(&mut self, step: Step, look: impl FnOnce(&mut Self)) {
        self.place.push(step);
        look(self);
        self.place.pop();
    }

    /// Visits a factor. It multiplies a texture (given by its position), a spectrum, or neither.
    pub fn factor(&mut self, texture: Option<u32>, is_spectral: bool, value: &impl Value) {
        let range = self.range;
        if texture.is_some() {
            self.range = range.of_factor();
        }
        (self.texture, self.is_spectral) = (texture, is_spectral);
        self.inside(Step::Name("factor"), value);
        (self.texture, self.is_spectral) = (None, false);
        self.range = range;
    }

    /// Reports a number at the current place.
    pub fn number(&mut self, x: f64) {
        self.found(Leaf::Number(x));
    }

    /// Reports a vector or colour at the current place.
    pub fn numbers(&mut self, all: &[Option<f64>]) {
        self.found(Leaf::Numbers(all));
    }

    /// Reports a reference to a position in a table of the scene.
    pub fn reference(&mut self, table: &'static str, number: u32) {
        self.found(Leaf::Reference(table, number));
    }

    fn found(&mut self, leaf: Leaf<'_>) {
        (self.visit)(&Found {
            place: &self.place,
            range: self.range,
            usual: self.usual,
            texture: self.texture,
            is_spectral: self.is_spectral,
            leaf,
        });
    }
}

/// Visits all numbers and references of `thing`.
pub fn find(thing: &impl Value, visit: &mut dyn FnMut(&Found<'_>)) {
    let (range, usual) = (Range::Any, Range::Any);
    let place = Vec::new();
    let mut visitor = Visitor { place, range, usual, texture: None, is_spectral: false, visit };
    thing.visit(&mut visitor);
}

/// The positions in one of the scene's tables that `thing` refers to, in the order of its
/// parameters.
pub fn references(thing: &impl Value, table: &str) -> Vec<u32> {
    let mut all = Vec::new();
    find(thing, &mut |found| {
        if let Leaf::Reference(of, number) = found.leaf
            && of == table
        {
            all.push(number);
        }
    });
    all
}

impl Found<'_> {
    /// The components that are present, as numbers.
    pub fn numbers(&self) -> Vec<f64> {
        match self.leaf {
            Leaf::Number(x) => vec![x],
            Leaf::Numbers(all) => all.iter().flatten().copied().collect(),
            Leaf::Reference(..) => Vec::new(),
        }
    }

    /// The name of the innermost parameter; for a `factor`, the name of its parent.
    pub fn name(&self) -> &'static str {
        let name = |step: &Step| match step {
            Step::Name(name) if *name != "factor" => Some(*name),
            _ => None,
        };
        self.place.iter().rev().find_map(name).unwrap_or("")
    }
}

/// A place in the syntax of keys: the steps, joined by dots. The field `kind`, which holds the
/// parameters of one kind beside those that all kinds share, is left out.
pub fn place_of(steps: &[Step]) -> String {
    let steps: Vec<String> = steps.iter().map(Step::to_string).filter(|s| s != "kind").collect();
    steps.join(".")
}

/// Describes the first number at or below the place `path` in `thing` that is out of its range;
/// `None` if all are in range.
pub fn problem_at(thing: &impl Value, path: &[&str]) -> Option<String> {
    let mut problem = None;
    find(thing, &mut |found| {
        if problem.is_none() {
            problem = problem_of(found, path);
        }
    });
    problem
}

fn problem_of(found: &Found<'_>, path: &[&str]) -> Option<String> {
    let is_wanted = |last: Option<Step>| {
        let mut steps =
            found.place.iter().chain(&last).map(Step::to_string).filter(|step| step != "kind");
        path.iter()
            .filter(|step| **step != "kind")
            .all(|step| steps.next().as_deref() == Some(step))
    };
    let place =
        |last: Option<Step>| place_of(&found.place.iter().copied().chain(last).collect::<Vec<_>>());
    let at = |x: f64, last: Option<Step>| {
        let is_wrong = !found.range.contains(x) && is_wanted(last);
        let range = found.range;
        is_wrong.then(|| format!("{}: {} is not possible, expected {range}", place(last), shown(x)))
    };
    match found.leaf {
        Leaf::Number(x) => at(x, None),
        Leaf::Numbers(all) => {
            let is_zero = !all.is_empty() && all.iter().all(|x| *x == Some(0.0));
            if found.range == Range::Direction && is_zero && is_wanted(None) {
                return Some(format!("{}: expected {}", place(None), found.range));
            }
            if !all.is_empty() && all.iter().all(Option::is_none) && is_wanted(None) {
                return Some(format!("{}: expected at least one number", place(None)));
            }
            let numbers = all.iter().enumerate();
            numbers.filter_map(|(i, x)| at((*x)?, Some(Step::Index(i)))).next()
        }
        Leaf::Reference(..) => None,
    }
}
