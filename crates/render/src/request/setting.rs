//! Settings of a render as users write them. Each is declared once, as a field of
//! [`Request`](super::Request); the command line, Python, the viewer and the reference page all
//! read the declarations.

use super::{Request, wish::Wish};
use snell_math::parameters::{Range, plain};

/// The heading under which help lists a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heading {
    /// Settings of the part of the scene that is seen.
    Subject,
    /// Settings of what is written.
    Picture,
    /// Settings of how light is simulated, and those that change only noise, time and memory.
    Light,
}

impl Heading {
    /// All headings.
    pub const ALL: [Self; 3] = [Self::Subject, Self::Picture, Self::Light];

    /// The text of the heading.
    pub fn text(self) -> &'static str {
        match self {
            Self::Subject => "What is rendered",
            Self::Picture => "The picture",
            Self::Light => "How light is computed",
        }
    }
}

/// How a setting is written on a command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A flag, or in Python `True` or `False`.
    Flag,
    /// A flag that may have a value.
    OptionalValue,
    /// A value.
    Value,
    /// A file or folder.
    Path,
    /// Several values, separated by commas.
    List,
    /// Several values, each `NAME=LIST`; in Python a dictionary.
    Lists,
}

/// A setting: a field of [`Request`].
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// The name of the field and of Python's keyword.
    pub name: &'static str,
    /// The heading under which help lists the setting.
    pub heading: Heading,
    /// The name of the value in help, such as `N`.
    pub value_name: &'static str,
    /// The type of the value in Python, in the form of an annotation.
    pub python: &'static str,
    /// The letter of the short option, if there is one.
    pub short: Option<char>,
    /// Another name of the option, if there is one.
    pub alias: Option<&'static str>,
    /// How the setting is written on a command line.
    pub form: Form,
    /// True if the setting may change while a picture is shown: the page of the viewer has a
    /// control for it.
    pub is_live: bool,
    /// The names to choose from; empty if the setting is not a choice.
    pub choices: fn() -> Vec<&'static str>,
    /// The default, as a name or in words; empty if there is none.
    pub default: fn() -> &'static str,
    /// The documentation as it stands in the source.
    pub doc: &'static str,
    /// Sets the field. A problem leaves the field as it was.
    pub(super) set: fn(&mut Request, &Wish) -> Result<(), Problem>,
    /// What is wrong with the field's value, if anything: the number, and what is expected instead.
    pub(super) check: fn(&Request) -> Option<[String; 2]>,
    /// The value of the field as text, or `None` if it is not set.
    pub(super) get: fn(&Request) -> Option<String>,
    /// The values of the option on a command line that sets the field; none if it is not set.
    pub(super) texts: fn(&Request) -> Vec<String>,
    /// Unsets the field.
    pub(super) clear: fn(&mut Request),
}

/// Why a setting cannot have a value. The text says what is expected instead, worded to follow the
/// name and the value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Problem {
    /// The value has the wrong type.
    Kind(String),
    /// The value has the right type, but is not possible.
    Value(String),
}

impl Problem {
    /// The text that says what is expected instead.
    pub fn text(&self) -> &str {
        match self {
            Self::Kind(text) | Self::Value(text) => text,
        }
    }
}

impl Setting {
    /// Sets the field in a request. A problem leaves the request as it was.
    pub fn set(&self, request: &mut Request, wish: &Wish) -> Result<(), Problem> {
        let mut next = request.clone();
        (self.set)(&mut next, wish)?;
        if let Some([_, expected]) = (self.check)(&next) {
            return Err(Problem::Value(format!("expected {expected}")));
        }
        *request = next;
        Ok(())
    }

    /// The value in a request, as it is written on a command line; `None` if it is not set.
    pub fn get(&self, request: &Request) -> Option<String> {
        (self.get)(request)
    }

    /// Unsets the field in a request, which leaves the choice to the scene or the default.
    pub fn clear(&self, request: &mut Request) {
        (self.clear)(request);
    }

    /// The name of the option on the command line, without dashes. The option of a list has the
    /// name of one item.
    pub fn option(&self) -> String {
        let name = self.name.replace('_', "-");
        match self.form {
            Form::List | Form::Lists => name.trim_end_matches('s').to_string(),
            _ => name,
        }
    }

    /// What the setting is: the first paragraph of the documentation, in one line without a full
    /// stop.
    pub fn statement(&self) -> String {
        let first = self.doc.trim().split("\n\n").next().unwrap_or_default();
        plain(first).trim_end_matches('.').to_string()
    }

    /// The statement, followed by the choices and the default.
    pub fn summary(&self) -> String {
        let mut text = self.statement();
        let choices = (self.choices)();
        if let [others @ .., last] = &choices[..]
            && self.form != Form::List
        {
            text = format!("{text}: {} or {last}", others.join(", "));
        }
        let default = (self.default)();
        if !default.is_empty() {
            text = format!("{text}. Default: {default}");
        }
        text
    }

    /// The further paragraphs of the documentation; empty if there are none.
    pub fn details(&self) -> String {
        let (_, rest) = self.doc.trim().split_once("\n\n").unwrap_or_default();
        plain(rest)
    }
}

/// Describes the numbers of a range in words.
pub(super) fn in_words(range: Range, is_whole: bool) -> String {
    let number = if is_whole { "a whole number" } else { "a number" };
    match range {
        Range::Any if is_whole => format!("{number} from 0 to {}", u32::MAX),
        Range::Any | Range::Direction => number.into(),
        Range::Within(f64::MIN_POSITIVE, high) if high > 1e10 => "a positive number".into(),
        Range::Within(f64::MIN_POSITIVE, high) => format!("a positive number up to {high:e}"),
        Range::Within(low, high) if high.is_finite() => format!("{number} from {low} to {high}"),
        Range::Within(low, _) => format!("{number} of at least {low}"),
        Range::Between(low, high) => format!("{number} between {low} and {high}"),
        Range::Positive => "a positive number".into(),
    }
}

/// Declares the struct of wishes, `Request`, with a [`Setting`] for each field.
macro_rules! settings {
    (
        $(#[$attribute:meta])*
        pub struct $name:ident {$(
            $(#[doc = $doc:literal])*
            #[setting(
                $heading:ident, $value_name:literal, $python:literal
                $(, short $short:literal)? $(, alias $alias:literal)? $(, range $range:expr)?
                $(, default $default:expr)? $(; $live:ident)?
            )]
            pub $field:ident: $type:ty,
        )*}
        beside {$(
            $(#[doc = $beside_doc:literal])*
            pub $beside:ident: $beside_type:ty,
        )*}
    ) => {
        $(#[$attribute])*
        pub struct $name {
            $($(#[doc = $doc])* pub $field: Option<$type>,)*
            $($(#[doc = $beside_doc])* pub $beside: Option<$beside_type>,)*
        }

        impl $name {
            /// All settings that users write, in the order in which help shows them.
            pub const SETTINGS: &'static [$crate::request::Setting] = &[$({
                use $crate::request::{Heading, Setting, wish::Wished};
                const RANGE: Range = $crate::request::setting::settings!(
                    @first $($range,)? Range::Any
                );
                Setting {
                    name: stringify!($field),
                    heading: Heading::$heading,
                    value_name: $value_name,
                    python: $python,
                    short: $crate::request::setting::settings!(@option $($short)?),
                    alias: $crate::request::setting::settings!(@option $($alias)?),
                    form: <$type as Wished>::FORM,
                    is_live: $crate::request::setting::settings!(@live $($live)?),
                    choices: <$type as Wished>::choices,
                    default: || $crate::request::setting::settings!(
                        @first $($default,)? <$type as Wished>::default_name()
                    ),
                    doc: concat!($($doc, "\n"),*),
                    set: |request, wish| {
                        request.$field = <$type as Wished>::read(wish, RANGE)?;
                        Ok(())
                    },
                    check: |request| {
                        request.$field.as_ref().and_then(|value| value.problem(RANGE))
                    },
                    get: |request| request.$field.as_ref().map(Wished::text),
                    texts: |request| {
                        request.$field.as_ref().map(Wished::texts).unwrap_or_default()
                    },
                    clear: |request| request.$field = None,
                }
            }),*];
        }
    };
    (@first $first:expr $(, $rest:expr)*) => { $first };
    (@live) => { false };
    (@live live) => { true };
    (@option) => { None };
    (@option $value:literal) => { Some($value) };
}
pub(super) use settings;
