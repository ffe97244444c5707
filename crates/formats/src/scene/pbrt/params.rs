//! Parameter lists: `"type name" [ values ]`, looked up by name and checked by type.

use super::lexer::{Lexer, Token, quoted, utf8};
use crate::scene::fault::{Fault, Spot};
use snell_math::{DVec3, Vec2, Vec3};
use std::cell::Cell;
use std::rc::Rc;

/// The types of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    Float,
    Integer,
    Bool,
    String,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    Rgb,
    /// A colour in CIE XYZ (pbrt-v3).
    Xyz,
    Blackbody,
    Spectrum,
    Texture,
}

impl Type {
    /// The type of this name, including those of pbrt-v3.
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "float" => Self::Float,
            "integer" => Self::Integer,
            "bool" => Self::Bool,
            "string" => Self::String,
            "point2" => Self::Point2,
            "vector2" => Self::Vector2,
            "point3" | "point" => Self::Point3,
            "vector3" | "vector" => Self::Vector3,
            "normal" | "normal3" => Self::Normal,
            "rgb" | "color" => Self::Rgb,
            "xyz" => Self::Xyz,
            "blackbody" => Self::Blackbody,
            "spectrum" => Self::Spectrum,
            "texture" => Self::Texture,
            _ => return None,
        })
    }

    /// The name for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Float => "float",
            Self::Integer => "integer",
            Self::Bool => "bool",
            Self::String => "string",
            Self::Point2 => "point2",
            Self::Vector2 => "vector2",
            Self::Point3 => "point3",
            Self::Vector3 => "vector3",
            Self::Normal => "normal",
            Self::Rgb => "rgb",
            Self::Xyz => "xyz",
            Self::Blackbody => "blackbody",
            Self::Spectrum => "spectrum",
            Self::Texture => "texture",
        }
    }

    /// The number of numbers in one value.
    fn width(self) -> usize {
        match self {
            Self::Point2 | Self::Vector2 => 2,
            Self::Point3 | Self::Vector3 | Self::Normal | Self::Rgb | Self::Xyz => 3,
            _ => 1,
        }
    }
}

/// The values of a parameter.
#[derive(Clone, Debug)]
pub enum Values {
    Numbers(Vec<f64>),
    Strings(Vec<String>),
    Bools(Vec<bool>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(v) => v.len(),
            Self::Strings(v) => v.len(),
            Self::Bools(v) => v.len(),
        }
    }
}

/// A parameter.
#[derive(Debug)]
pub struct Param {
    pub kind: Type,
    pub name: String,
    pub values: Values,
    pub at: Spot,
    used: Cell<bool>,
}

impl Param {
    /// The numbers; empty for strings and booleans.
    pub fn numbers(&self) -> &[f64] {
        if let Values::Numbers(numbers) = &self.values { numbers } else { &[] }
    }

    /// The strings; empty for all other types.
    pub fn strings(&self) -> &[String] {
        if let Values::Strings(strings) = &self.values { strings } else { &[] }
    }

    /// An error about this parameter.
    pub fn fault(&self, problem: impl std::fmt::Display, remedy: impl Into<String>) -> Fault {
        Fault::new(self.at, format!("\"{} {}\": {problem}", self.kind.name(), self.name), remedy)
    }
}

/// The parameters of a directive.
#[derive(Clone, Debug, Default)]
pub struct Params {
    /// The directive, such as `Shape "sphere"`: for messages.
    pub owner: String,
    /// The place of the directive.
    pub at: Spot,
    own: Vec<Rc<Param>>,
    /// Defaults set by `Attribute`, the latest first.
    defaults: Vec<Rc<Param>>,
}

impl Params {
    /// Reads the parameters that follow. `limit` is the maximum number of numbers in one parameter.
    pub fn read(lexer: &mut Lexer, owner: String, at: Spot, limit: usize) -> Result<Self, Fault> {
        let mut params = Self { owner, at, own: Vec::new(), defaults: Vec::new() };
        while lexer.string_follows() {
            let param = read_param(lexer, limit)?;
            if let Some(first) = params.own.iter().find(|p| p.name == param.name) {
                let problem =
                    format!("{} has the parameter \"{}\" twice", params.owner, first.name);
                return Err(Fault::new(param.at, problem, "remove one of them"));
            }
            params.own.push(Rc::new(param));
        }
        Ok(params)
    }

    /// Returns the parameters with defaults for those that are absent.
    pub fn with_defaults(mut self, defaults: &[Rc<Param>]) -> Self {
        self.defaults.extend(defaults.iter().rev().cloned());
        self
    }

    /// Returns the parameters as those of the directive `owner`.
    pub fn of(self, owner: String) -> Self {
        Self { owner, ..self }
    }

    /// The parameters that the directive itself gives, without defaults.
    pub fn into_own(self) -> Vec<Rc<Param>> {
        self.own
    }

    /// The parameter of this name, whatever its type, which is marked as used.
    pub fn get(&self, name: &str) -> Option<&Param> {
        let param = self.own.iter().chain(&self.defaults).find(|p| p.name == name)?;
        param.used.set(true);
        Some(param)
    }

    /// True if there is a parameter of this name. This does not mark it as used.
    pub fn has(&self, name: &str) -> bool {
        self.own.iter().chain(&self.defaults).any(|p| p.name == name)
    }

    /// Unused parameters.
    pub fn unused(&self) -> impl Iterator<Item = &Param> {
        self.own.iter().map(|p| &**p).filter(|p| !p.used.get())
    }

    /// An error about the directive.
    pub fn fault(&self, problem: impl std::fmt::Display, remedy: impl Into<String>) -> Fault {
        Fault::new(self.at, format!("{}: {problem}", self.owner), remedy)
    }

    /// The parameter of this name, which must be of one of these types.
    pub fn typed(&self, name: &str, kinds: &[Type]) -> Result<Option<&Param>, Fault> {
        let Some(param) = self.get(name) else { return Ok(None) };
        if kinds.contains(&param.kind) {
            return Ok(Some(param));
        }
        let expected: Vec<_> = kinds.iter().map(|k| k.name()).collect();
        let problem =
            format!("this parameter of {} is of type {}", self.owner, expected.join(" or "));
        Err(param.fault(problem, format!("write \"{} {name}\"", expected[0])))
    }

    /// The number of a parameter with exactly one.
    fn one_number(&self, name: &str, kinds: &[Type]) -> Result<Option<f64>, Fault> {
        let Some(param) = self.typed(name, kinds)? else { return Ok(None) };
        match param.numbers() {
            [number] => Ok(Some(*number)),
            numbers => Err(one_value_expected(param, numbers.len())),
        }
    }

    /// The parameter `name` as a number; `None` if absent.
    pub fn float(&self, name: &str) -> Result<Option<f64>, Fault> {
        self.one_number(name, &[Type::Float])
    }

    /// The parameter `name` as a number, or its default.
    pub fn float_or(&self, name: &str, default: f64) -> Result<f64, Fault> {
        Ok(self.float(name)?.unwrap_or(default))
    }

    /// The parameter `name` as a whole number; `None` if absent.
    pub fn integer(&self, name: &str) -> Result<Option<i64>, Fault> {
        Ok(self.one_number(name, &[Type::Integer])?.map(|x| x as i64))
    }

    /// The parameter `name` as a boolean, or its default.
    pub fn bool_or(&self, name: &str, default: bool) -> Result<bool, Fault> {
        let Some(param) = self.typed(name, &[Type::Bool])? else { return Ok(default) };
        match &param.values {
            Values::Bools(values) if values.len() == 1 => Ok(values[0]),
            values => Err(one_value_expected(param, values.len())),
        }
    }

    /// The parameter `name` as a string; `None` if absent.
    pub fn string(&self, name: &str) -> Result<Option<&str>, Fault> {
        let Some(param) = self.typed(name, &[Type::String])? else { return Ok(None) };
        match param.strings() {
            [string] => Ok(Some(string)),
            strings => Err(one_value_expected(param, strings.len())),
        }
    }

    /// The parameter `name` as a point; `None` if absent.
    pub fn point(&self, name: &str) -> Result<Option<DVec3>, Fault> {
        let Some(param) = self.typed(name, &[Type::Point3])? else { return Ok(None) };
        match *param.numbers() {
            [x, y, z] => Ok(Some(DVec3::new(x, y, z))),
            ref numbers => Err(one_value_expected(param, numbers.len() / 3)),
        }
    }

    /// The parameter `name` as a list of floats or integers; empty if absent.
    pub fn floats(&self, name: &str) -> Result<&[f64], Fault> {
        Ok(self.typed(name, &[Type::Float, Type::Integer])?.map_or(&[], Param::numbers))
    }

    /// The parameter `name` as points in single precision; empty if absent.
    pub fn points(&self, name: &str) -> Result<Vec<Vec3>, Fault> {
        Ok(self.typed(name, &[Type::Point3])?.map_or_else(Vec::new, |p| triples(p.numbers())))
    }

    /// The parameter `name` as vectors or normals in single precision; empty if absent.
    pub fn directions(&self, name: &str) -> Result<Vec<Vec3>, Fault> {
        Ok(self
            .typed(name, &[Type::Normal, Type::Vector3])?
            .map_or_else(Vec::new, |p| triples(p.numbers())))
    }

    /// The parameter `name` as pairs of numbers; empty if absent. pbrt-v3 writes pairs as floats.
    pub fn pairs(&self, name: &str) -> Result<Vec<Vec2>, Fault> {
        let Some(param) = self.typed(name, &[Type::Point2, Type::Vector2, Type::Float])? else {
            return Ok(Vec::new());
        };
        if param.numbers().len() % 2 != 0 {
            return Err(param.fault("an odd number of values for pairs", "complete the list"));
        }
        Ok(param.numbers().chunks_exact(2).map(|p| Vec2::new(p[0] as f32, p[1] as f32)).collect())
    }

    /// Vertex indices in groups of `N`, and their total number, which may not be a multiple of `N`.
    pub fn indices<const N: usize>(
        &self,
        name: &str,
        count: usize,
    ) -> Result<(Vec<[u32; N]>, usize), Fault> {
        let Some(param) = self.typed(name, &[Type::Integer])? else { return Ok((Vec::new(), 0)) };
        let numbers = param.numbers();
        if let Some(number) =
            numbers.iter().find(|number| !(**number >= 0.0 && **number < count as f64))
        {
            let problem =
                format!("vertex {number}, but there are {count} vertices (counted from 0)");
            return Err(param.fault(problem, "correct the list, or export the file again"));
        }
        Ok((
            numbers
                .as_chunks::<N>()
                .0
                .iter()
                .map(|face| face.map(|number| number as u32))
                .collect(),
            numbers.len(),
        ))
    }
}

fn triples(numbers: &[f64]) -> Vec<Vec3> {
    numbers.chunks_exact(3).map(|p| Vec3::new(p[0] as f32, p[1] as f32, p[2] as f32)).collect()
}

fn one_value_expected(param: &Param, found: usize) -> Fault {
    param.fault(format!("{found} values where one was expected"), "give one value")
}

/// The type and name of a parameter: `"float radius"`.
fn read_declaration<'a>(lexer: &mut Lexer<'a>) -> Result<(Type, &'a str, Spot), Fault> {
    let (declaration, at) = lexer.expect_string("a parameter")?;
    let mut words = declaration.split_ascii_whitespace();
    let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
        let problem = format!("{} is not a type and a name", quoted(declaration.as_bytes()));
        return Err(Fault::new(at, problem, "write parameters like \"float radius\" [ 1 ]"));
    };
    match Type::named(kind) {
        Some(kind) => Ok((kind, name, at)),
        None => {
            let problem = format!("{} is not a type of parameters", quoted(kind.as_bytes()));
            let remedy = "use float, integer, bool, string, point2, point3, vector3, normal, rgb, \
                spectrum or the like";
            Err(Fault::new(at, problem, remedy))
        }
    }
}

fn read_param(lexer: &mut Lexer, limit: usize) -> Result<Param, Fault> {
    let (kind, name, at) = read_declaration(lexer)?;
    let bracketed = lexer.take_bracket(b'[');
    let values = match kind {
        Type::String | Type::Texture => Values::Strings(read_strings(lexer, bracketed)?),
        Type::Bool => Values::Bools(read_bools(lexer, bracketed)?),
        Type::Spectrum if lexer.string_follows() => {
            Values::Strings(read_strings(lexer, bracketed)?)
        }
        _ => Values::Numbers(read_numbers(lexer, bracketed, name, limit)?),
    };
    if bracketed && !lexer.take_bracket(b']') {
        let (token, spot) = lexer.expect("\"]\"")?;
        let problem =
            format!("found {} among the values of \"{} {name}\"", token.quoted(), kind.name());
        return Err(Fault::new(spot, problem, "close the list with ] after values of one kind"));
    }
    let param = Param { kind, name: name.to_string(), values, at, used: Cell::new(false) };
    check(&param)?;
    Ok(param)
}

fn check(param: &Param) -> Result<(), Fault> {
    let (found, width) = (param.values.len(), param.kind.width());
    if found == 0
        && !matches!(
            param.kind,
            Type::Float | Type::Integer | Type::Point2 | Type::Point3 | Type::Normal
        )
    {
        return Err(param.fault("there is no value", "give one"));
    }
    if found % width != 0 {
        return Err(
            param.fault(format!("{found} numbers, but one value has {width}"), "complete the list")
        );
    }
    if param.kind == Type::Integer
        && let Some(number) =
            param.numbers().iter().find(|x| x.fract() != 0.0 || x.abs() > f64::from(i32::MAX))
    {
        return Err(param
            .fault(format!("{number} is not a whole number of 32 bits"), "write whole numbers"));
    }
    Ok(())
}

fn read_numbers(
    lexer: &mut Lexer,
    bracketed: bool,
    name: &str,
    limit: usize,
) -> Result<Vec<f64>, Fault> {
    let mut numbers = Vec::new();
    if !bracketed {
        return Ok(vec![lexer.expect_number(name)?]);
    }
    while let Some(number) = lexer.take_number(name)? {
        if numbers.len() >= limit {
            let spot = lexer.spot();
            return Err(Fault::new(
                spot,
                format!("\"{name}\" has more than {limit} numbers, the limit"),
                "split it",
            ));
        }
        numbers.push(number);
    }
    Ok(numbers)
}

fn read_strings(lexer: &mut Lexer, bracketed: bool) -> Result<Vec<String>, Fault> {
    let mut strings = Vec::new();
    while strings.is_empty() || (bracketed && lexer.string_follows()) {
        strings.push(lexer.expect_string("a string")?.0.to_string());
    }
    Ok(strings)
}

fn read_bools(lexer: &mut Lexer, bracketed: bool) -> Result<Vec<bool>, Fault> {
    let mut bools = Vec::new();
    while bools.is_empty() || (bracketed && (lexer.word_follows() || lexer.string_follows())) {
        let (token, spot) = lexer.expect("true or false")?;
        // pbrt-v3 wrote booleans in quotes.
        let text = match token {
            Token::Word(bytes) | Token::String(bytes) => utf8(bytes, spot)?,
            Token::Open | Token::Close => "",
        };
        bools.push(match text {
            "true" => true,
            "false" => false,
            _ => {
                let problem = format!("found {}, expected true or false", token.quoted());
                return Err(Fault::new(spot, problem, "write true or false"));
            }
        });
    }
    Ok(bools)
}
