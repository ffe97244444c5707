//! The macro that declares things with parameters.

/// Declares a struct, or an enum of variants, with its parameters. The parameters are the fields,
/// each with its documentation and these attributes, in this order:
///
/// * `#[range(…)]`: the [`Range`](crate::parameters::Range) of the numbers in the field,
/// * `#[usual(…)]`: the range outside of which numbers are most likely a mistake,
/// * `#[unit("…")]`: the unit of the numbers,
/// * attributes of serde, which give the default.
///
/// ```
/// use snell_math::parameters::{Declared, Kind, Range, problem_at};
///
/// snell_math::declare! {
///     /// A disk.
///     #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
///     pub struct Disk {
///         /// Radius, at least 0.
///         #[range(Range::AMOUNT)]
///         #[unit("scene units")]
///         #[serde(default)]
///         pub radius: f64,
///     }
/// }
///
/// assert_eq!(Disk::PARAMETERS[0].name, "radius");
/// assert_eq!(Disk::PARAMETERS[0].kind, Kind::Number);
/// assert_eq!(Disk::PARAMETERS[0].text(), "Radius, at least 0.");
/// assert_eq!(problem_at(&Disk { radius: 1.0 }, &[]), None);
/// let problem = problem_at(&Disk { radius: -1.0 }, &[]).expect("no radius is below 0");
/// assert_eq!(problem, "radius: -1 is not possible, expected 0 or more");
///
/// snell_math::declare! {
///     /// How something fades.
///     #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
///     pub enum Fading tagged "fading" {
///         /// It never fades.
///         "never" => Never,
///         /// It fades at once.
///         "edge" => Edge {
///             /// The distance at which it fades.
///             #[range(Range::Positive)]
///             distance: f64,
///         },
///     }
/// }
///
/// let json = serde_json::to_value(Fading::Edge { distance: 2.0 }).expect("it is JSON");
/// assert_eq!(json, serde_json::json!({ "fading": "edge", "distance": 2.0 }));
/// assert!(problem_at(&Fading::Edge { distance: 0.0 }, &[]).is_some());
/// ```
#[macro_export]
macro_rules! declare {
    (
        $(#[doc = $about:literal])*
        $(#[derive $derive:tt])*
        $(#[serde $serde:tt])*
        pub struct $name:ident {$(
            $(#[doc = $doc:literal])*
            $(#[range($range:expr)])?
            $(#[usual($usual:expr)])?
            $(#[unit($unit:literal)])?
            $(#[serde $field_serde:tt])*
            pub $field:ident: $type:ty,
        )*}
    ) => {
        $(#[doc = $about])*
        $(#[derive $derive])*
        $(#[serde $serde])*
        pub struct $name {$(
            $(#[doc = $doc])*
            $(#[serde $field_serde])*
            pub $field: $type,
        )*}

        impl $crate::parameters::Declared for $name {
            const ABOUT: &'static str = concat!($($about, "\n"),*);
            const PARAMETERS: &'static [$crate::parameters::Parameter] = &[$(
                $crate::declare! { @parameter
                    stringify!($field), $type,
                    ($($doc)*) ($($range)?) ($($usual)?) ($($unit)?)
                },
            )*];
        }

        impl $crate::parameters::Value for $name {
            const KIND: $crate::parameters::Kind = $crate::parameters::Kind::Group(
                <Self as $crate::parameters::Declared>::PARAMETERS,
            );

            #[allow(unused_mut, unused_variables, reason = "some have no parameters")]
            fn visit(&self, visitor: &mut $crate::parameters::Visitor<'_>) {
                let mut parameters =
                    <Self as $crate::parameters::Declared>::PARAMETERS.iter();
                $(if let Some(parameter) = parameters.next() {
                    visitor.parameter(parameter, &self.$field);
                })*
            }
        }
    };
    (
        $(#[doc = $about:literal])*
        $(#[derive $derive:tt])*
        $(#[serde $serde:tt])*
        pub enum $name:ident $(tagged $tag:literal)? {$(
            $(#[doc = $doc:literal])*
            $text:literal => $(#[$default:ident])? $variant:ident $({$(
                $(#[doc = $field_doc:literal])*
                $(#[range($range:expr)])?
                $(#[usual($usual:expr)])?
                $(#[unit($unit:literal)])?
                $(#[serde $field_serde:tt])*
                $field:ident: $type:ty,
            )*})? $(($(#[range($inner_range:expr)])? $value:ident: $inner:ty))?,
        )*}
    ) => {
        $(#[doc = $about])*
        $(#[derive $derive])*
        $(#[serde $serde])*
        $(#[serde(tag = $tag)])?
        pub enum $name {$(
            $(#[doc = $doc])*
            $(#[$default])?
            #[serde(rename = $text)]
            $variant $({$(
                $(#[doc = $field_doc])*
                $(#[serde $field_serde])*
                $field: $type,
            )*})? $(($inner))?,
        )*}

        impl $name {
            /// The declarations of the variants, each with its name.
            pub const DECLARATIONS: &'static [$crate::parameters::Declaration] = &[$(
                $crate::parameters::Declaration {
                    name: $text,
                    about: concat!($($doc, "\n"),*),
                    parameters: &[
                        $($($crate::declare! { @parameter
                            stringify!($field), $type,
                            ($($field_doc)*) ($($range)?) ($($usual)?) ($($unit)?)
                        },)*)?
                        $($crate::declare! { @parameter
                            "", $inner, () ($($inner_range)?) () ()
                        },)?
                    ],
                },
            )*];
        }

        impl $crate::parameters::Value for $name {
            const KIND: $crate::parameters::Kind =
                $crate::parameters::Kind::OneOf(concat!("", $($tag)?), Self::DECLARATIONS);

            #[allow(unused_mut, unused_variables, reason = "some have no parameters")]
            fn visit(&self, visitor: &mut $crate::parameters::Visitor<'_>) {
                let mut variants = Self::DECLARATIONS.iter();
                $(if let Some(variant) = variants.next()
                    && let Self::$variant $({ $($field),* })? $(($value))? = self
                {
                    let mut look = |visitor: &mut $crate::parameters::Visitor<'_>| {
                        let mut parameters = variant.parameters.iter();
                        $($(if let Some(parameter) = parameters.next() {
                            visitor.parameter(parameter, $field);
                        })*)?
                        $(if let Some(parameter) = parameters.next() {
                            visitor.parameter(parameter, $value);
                        })?
                    };
                    // A variant's name either encloses the parameters or is a field beside them.
                    if matches!(Self::KIND, $crate::parameters::Kind::OneOf("", _)) {
                        visitor.within($crate::parameters::Step::Name(variant.name), look);
                    } else {
                        look(visitor);
                    }
                })*
            }
        }
    };
    (
        @parameter $name:expr, $type:ty,
        ($($doc:literal)*) ($($range:expr)?) ($($usual:expr)?) ($($unit:literal)?)
    ) => {
        $crate::parameters::Parameter {
            name: $name,
            kind: <$type as $crate::parameters::Value>::KIND,
            range: $crate::declare!(@first $($range,)? $crate::parameters::Range::Any),
            usual: $crate::declare!(
                @first $($usual,)? $($range,)? $crate::parameters::Range::Any
            ),
            unit: concat!("", $($unit)?),
            doc: concat!($($doc, "\n"),*),
        }
    };
    (@first $first:expr $(, $rest:expr)*) => { $first };
}
