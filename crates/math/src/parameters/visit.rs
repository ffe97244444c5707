//! Going through the numbers of a value.

use super::range::shown;
use super::{Range, Value};

/// One step from a thing to a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// To the parameter of this name.
    Name(&'static str),
    /// To the item at this position of a list.
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

/// What stands at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leaf<'a> {
    /// A number.
    Number(f64),
    /// Several that belong together: a vector or colour. Some may be missing.
    Numbers(&'a [Option<f64>]),
    /// The position in a table of the scene, such as a `texture`.
    Reference(&'static str, u32),
}

/// Something that was found in a thing.
#[derive(Clone, Copy, Debug)]
pub struct Found<'a> {
    /// Where.
    pub place: &'a [Step],
    /// What its numbers may be.
    pub range: Range,
    /// What its numbers usually are.
    pub usual: Range,
    /// The texture that it is a factor on, by its position in the scene's table.
    pub texture: Option<u32>,
    /// True for the factor on a spectrum.
    pub is_spectral: bool,
    /// What stands there.
    pub leaf: Leaf<'a>,
}

/// Where a walk through a thing is, and what is done with what it finds.
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
    /// Looks at a parameter.
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

    /// Looks at a part, which has the range of the whole.
    pub fn inside(&mut self, step: Step, value: &impl Value) {
        self.within(step, |visitor| value.visit(visitor));
    }

    /// Looks at what is one step further on.
    pub fn within(&mut self, step: Step, look: impl FnOnce(&mut Self)) {
        self.place.push(step);
        look(self);
        self.place.pop();
    }

    /// Looks at the factor on a texture (by its position), on a spectrum, or on neither.
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

    /// Finds a number.
    pub fn number(&mut self, x: f64) {
        self.found(Leaf::Number(x));
    }

    /// Finds several numbers that belong together.
    pub fn numbers(&mut self, all: &[Option<f64>]) {
        self.found(Leaf::Numbers(all));
    }

    /// Finds the position in a table.
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

/// Goes through all numbers and references of a thing.
pub fn find(thing: &impl Value, visit: &mut dyn FnMut(&Found<'_>)) {
    let (range, usual) = (Range::Any, Range::Any);
    let place = Vec::new();
    let mut visitor = Visitor { place, range, usual, texture: None, is_spectral: false, visit };
    thing.visit(&mut visitor);
}

/// The positions in one of the scene's tables that a thing refers to, in the order of its
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
    /// Those that are there.
    pub fn numbers(&self) -> Vec<f64> {
        match self.leaf {
            Leaf::Number(x) => vec![x],
            Leaf::Numbers(all) => all.iter().flatten().copied().collect(),
            Leaf::Reference(..) => Vec::new(),
        }
    }

    /// The name of the innermost parameter, which for the `factor` of one is that of the whole.
    pub fn name(&self) -> &'static str {
        let name = |step: &Step| match step {
            Step::Name(name) if *name != "factor" => Some(*name),
            _ => None,
        };
        self.place.iter().rev().find_map(name).unwrap_or("")
    }
}

/// A place as keys say it: steps with points between. The field `kind`, in which the parameters of
/// a kind stand beside those of all kinds, may be left out, and is.
pub fn place_of(steps: &[Step]) -> String {
    let steps: Vec<String> = steps.iter().map(Step::to_string).filter(|s| s != "kind").collect();
    steps.join(".")
}

/// The first number at or below a place of a thing that is out of its range: what is wrong, in
/// words.
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
