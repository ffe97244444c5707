//! The kinds of parameters: what a parameter is, without a value.

use super::{Declared, Range};

/// One parameter of a declared type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// The parameter's name in scenes. Empty for the unnamed value of a variant.
    pub name: &'static str,
    /// What sort of value the parameter takes.
    pub kind: Kind,
    /// The range of the parameter's numbers, unless a nested parameter has its own.
    pub range: Range,
    /// The range of plausible numbers. Numbers outside of it are allowed, but most likely a
    /// mistake.
    pub usual: Range,
    /// The unit of the parameter's numbers; empty for plain numbers.
    pub unit: &'static str,
    /// The parameter's doc comment as it stands in the source.
    pub doc: &'static str,
}

/// The sort of value that a parameter takes.
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
    /// A list of this many numbers, some of which may be missing.
    Numbers(usize),
    /// A list of any length.
    List(&'static Kind),
    /// An affine map: rows or columns of numbers.
    Matrix,
    /// A text. The string describes what the text means.
    Text(&'static str),
    /// A position in the table of the scene that the string names, such as `texture`.
    Reference(&'static str),
    /// Measured or painted data, whose numbers are not parameters in their own right.
    Table,
    /// Cells of a grid, whose numbers are not part of the declaration.
    Cells,
    /// An optional value.
    Optional(&'static Kind),
    /// Parameters by name.
    Group(&'static [Parameter]),
    /// One of several variants. The text is the name of the field beside the parameters that
    /// selects the variant; if it is empty, the variant's name encloses them.
    OneOf(&'static str, &'static [Declaration]),
}

/// A declared type, or a variant of one, with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Declaration {
    /// The name in scenes.
    pub name: &'static str,
    /// The doc comment as it stands in the source.
    pub about: &'static str,
    /// The parameters, in the order of the source.
    pub parameters: &'static [Parameter],
}

impl Declaration {
    /// The declaration of a type under a name.
    pub const fn of<T: Declared>(name: &'static str) -> Self {
        Self { name, about: T::ABOUT, parameters: T::PARAMETERS }
    }

    /// The named parameters. For a variant that holds another declared type, these are that type's
    /// parameters.
    pub fn fields(&self) -> &'static [Parameter] {
        match self.parameters {
            [Parameter { name: "", kind: Kind::Group(fields), .. }] => fields,
            parameters => parameters,
        }
    }

    /// The parameter of this name; `None` if there is none.
    pub fn get(&self, name: &str) -> Option<&'static Parameter> {
        self.fields().iter().find(|parameter| parameter.name == name)
    }

    /// The documentation as plain text.
    pub fn text(&self) -> String {
        plain(self.about)
    }
}

impl Parameter {
    /// The documentation as plain text.
    pub fn text(&self) -> String {
        plain(self.doc)
    }
}

impl Kind {
    /// The kind of the value at one step inside a value of this kind: a parameter's name or a
    /// position in a list. The field `kind`, which holds the parameters of one kind beside those
    /// that all kinds share, may be left out of a path.
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

    /// The kind inside [`Self::Optional`], or this kind if it is not optional.
    pub fn required(self) -> Self {
        match self {
            Self::Optional(kind) => *kind,
            kind => kind,
        }
    }
}

/// Writes the kind in words that fit any parameter of this kind.
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

/// Turns a doc comment into plain text: lines are joined, and links lose their brackets and
/// targets.
pub fn plain(doc: &str) -> String {
    let words: Vec<&str> = doc.split_whitespace().collect();
    let mut text = String::new();
    let mut rest = words.join(" ");
    while let Some((before, link)) = rest.split_once("[`") {
        let Some((name, after)) = link.split_once("`]") else { break };
        let name = name.rsplit("::").next().unwrap_or(name);
        text += &format!("{before}`{name}`");
        // The target of a link, which stands in parentheses, is skipped.
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
