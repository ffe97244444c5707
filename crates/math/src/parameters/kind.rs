//! What parameters look like, without a value.

use super::{Declared, Range};

/// One parameter of a thing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, as scenes write it. Empty for the only value of a variant that names none.
    pub name: &'static str,
    /// What it looks like.
    pub kind: Kind,
    /// What its numbers may be, where what stands inside of it does not say more.
    pub range: Range,
    /// What its numbers usually are: outside of it they are possible, and most likely a mistake.
    pub usual: Range,
    /// What its numbers are measured in; empty for plain numbers.
    pub unit: &'static str,
    /// Its documentation, as it stands in the source.
    pub doc: &'static str,
}

/// What a parameter looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// True or false.
    Flag,
    /// A whole number.
    Whole,
    /// A number.
    Number,
    /// A number, times one channel of a texture if there is one.
    TexturedNumber,
    /// Linear red, green and blue.
    Color,
    /// A colour, times a texture and a spectrum if there are any.
    TexturedColor,
    /// A number, or the name of a glass.
    RefractiveIndex,
    /// A point, a direction, or another vector of this many coordinates.
    Vector(usize),
    /// This many numbers, of which some may be missing.
    Numbers(usize),
    /// A list of any length.
    List(&'static Kind),
    /// An affine map: rows or columns of numbers.
    Matrix,
    /// A text; of what, in words.
    Text(&'static str),
    /// The position in a table of the scene, such as a `texture`.
    Reference(&'static str),
    /// Measured or drawn data, which are no parameters to be changed one by one.
    Table,
    /// Cells of a grid, which stand beside the declaration.
    Cells,
    /// There may be none.
    Optional(&'static Kind),
    /// Parameters by name.
    Group(&'static [Parameter]),
    /// One of several: which one says a field of this name, beside the parameters; or, if it is
    /// empty, a name, around them.
    OneOf(&'static str, &'static [Declaration]),
}

/// A kind of thing with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Declaration {
    /// Its name, as scenes write it.
    pub name: &'static str,
    /// Its documentation, as it stands in the source.
    pub about: &'static str,
    /// Its parameters.
    pub parameters: &'static [Parameter],
}

impl Declaration {
    /// That of a type.
    pub const fn of<T: Declared>(name: &'static str) -> Self {
        Self { name, about: T::ABOUT, parameters: T::PARAMETERS }
    }

    /// The parameters by name: for a variant that holds a thing, those of the thing.
    pub fn fields(&self) -> &'static [Parameter] {
        match self.parameters {
            [Parameter { name: "", kind: Kind::Group(fields), .. }] => fields,
            parameters => parameters,
        }
    }

    /// The parameter of this name.
    pub fn get(&self, name: &str) -> Option<&'static Parameter> {
        self.fields().iter().find(|parameter| parameter.name == name)
    }

    /// Its documentation for people who do not read the source.
    pub fn text(&self) -> String {
        plain(self.about)
    }
}

impl Parameter {
    /// Its documentation for people who do not read the source.
    pub fn text(&self) -> String {
        plain(self.doc)
    }
}

impl Kind {
    /// What stands under a name, or at a position, inside of it. The field `kind`, in which the
    /// parameters of a kind stand beside those of all kinds, may be left out.
    pub fn inside(self, step: &str) -> Option<Self> {
        let named = |parameters: &'static [Parameter]| {
            parameters.iter().find(|parameter| parameter.name == step).map(|p| p.kind)
        };
        match self.required() {
            Self::Group(parameters) => named(parameters).or_else(|| {
                let kind = parameters.iter().find(|parameter| parameter.name == "kind")?;
                kind.kind.inside(step)
            }),
            Self::OneOf("", variants) => {
                let variant = variants.iter().find(|variant| variant.name == step)?;
                Some(match variant.parameters {
                    [Parameter { name: "", kind, .. }] => *kind,
                    parameters => Self::Group(parameters),
                })
            }
            Self::OneOf(_, variants) => variants.iter().find_map(|variant| named(variant.fields())),
            Self::TexturedNumber if step == "factor" => Some(Self::Number),
            Self::TexturedColor if step == "factor" => Some(Self::Color),
            Self::TexturedColor if step == "texture" => Some(Self::Reference("texture")),
            Self::Color | Self::Vector(_) | Self::Numbers(_) => Some(Self::Number),
            Self::List(kind) => Some(*kind),
            _ => None,
        }
    }

    /// The same if it is there.
    pub fn required(self) -> Self {
        match self {
            Self::Optional(kind) => *kind,
            kind => kind,
        }
    }
}

/// In words, as far as that does not depend on the parameter.
impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Flag => f.write_str("true or false"),
            Self::Whole => f.write_str("whole number"),
            Self::Number => f.write_str("number"),
            Self::TexturedNumber => f.write_str("number or texture"),
            Self::Color => f.write_str("colour"),
            Self::TexturedColor => f.write_str("colour, spectrum or texture"),
            Self::RefractiveIndex => f.write_str("number or glass"),
            Self::Vector(_) => f.write_str("vector"),
            Self::Numbers(n) => write!(f, "{n} numbers"),
            Self::List(kind) => write!(f, "list of: {kind}"),
            Self::Matrix => f.write_str("matrix"),
            Self::Text(what) => f.write_str(what),
            Self::Reference(table) => f.write_str(table),
            Self::Table => f.write_str("table"),
            Self::Cells => f.write_str("grid"),
            Self::Optional(kind) => write!(f, "{kind}, or none"),
            Self::Group(parameters) => names(f, parameters.iter().map(|p| p.name)),
            Self::OneOf(_, kinds) => {
                f.write_str("one of ")?;
                names(f, kinds.iter().map(|kind| kind.name))
            }
        }
    }
}

fn names(
    f: &mut std::fmt::Formatter<'_>,
    names: impl Iterator<Item = &'static str>,
) -> std::fmt::Result {
    for (i, name) in names.enumerate() {
        write!(f, "{}`{name}`", if i == 0 { "" } else { ", " })?;
    }
    Ok(())
}

/// A doc comment as text: lines joined, links without their brackets and paths.
fn plain(doc: &str) -> String {
    let words: Vec<&str> = doc.split_whitespace().collect();
    let mut text = String::new();
    let mut rest = words.join(" ");
    while let Some((before, link)) = rest.split_once("[`") {
        let Some((name, after)) = link.split_once("`]") else { break };
        let name = name.rsplit("::").next().unwrap_or(name);
        text += &format!("{before}`{name}`");
        // The target of a link in parentheses.
        let target = after.strip_prefix('(').and_then(|target| target.split_once(')'));
        rest = target.map_or(after, |(_, after)| after).to_string();
    }
    text + &rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn documentation_is_lines_joined_without_links() {
        let doc = " The metal of\n [`super::OpenPbr`], as\n [`Metal`](crate::Metal) has it.\n";
        assert_eq!(plain(doc), "The metal of `OpenPbr`, as `Metal` has it.");
    }

    #[test]
    fn what_stands_inside_is_found_by_name_position_and_variant() {
        let number = Parameter {
            name: "edge",
            kind: Kind::Number,
            range: Range::Any,
            usual: Range::Any,
            unit: "",
            doc: "",
        };
        let variants: &'static [Declaration] = Box::leak(Box::new([Declaration {
            name: "hard",
            about: "",
            parameters: Box::leak(Box::new([number])),
        }]));
        assert_eq!(Kind::OneOf("fading", variants).inside("edge"), Some(Kind::Number));
        assert_eq!(Kind::OneOf("", variants).inside("edge"), None);
        let inner = Kind::OneOf("", variants).inside("hard").expect("it is a variant");
        assert_eq!(inner.inside("edge"), Some(Kind::Number));
        assert_eq!(Kind::TexturedColor.inside("factor"), Some(Kind::Color));
        assert_eq!(Kind::Color.inside("2"), Some(Kind::Number));
    }
}
