//! The macro that makes an enum from the list of its kinds.

/// Makes an enum from a list of kinds, where each kind is a type of its own with a name. It also
/// makes a macro that runs an expression on the kind that a value holds, or on each of the kinds.
///
/// The enum implements [`Clone`], [`Debug`], [`PartialEq`] and [`From`] for each kind, and has
/// `NAMES`, `name()` and `examples()`; for the last of these each kind needs an `examples()` too.
/// Serde reads and writes the enum with the names as variants, so the calling crate needs serde;
/// attributes of serde may stand before the enum.
///
/// ```
/// #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
/// pub struct Square {
///     side: f32,
/// }
///
/// impl Square {
///     const CORNERS: u32 = 4;
///
///     fn examples() -> Vec<Self> {
///         vec![Self { side: 2.0 }]
///     }
///
///     fn area(&self) -> f32 {
///         self.side * self.side
///     }
/// }
///
/// snell_math::kinds! {
///     /// Any figure.
///     #[serde(tag = "figure")]
///     pub enum Figure by match_figure! {
///         "square" => Square,
///     }
/// }
///
/// impl Figure {
///     fn area(&self) -> f32 {
///         match_figure!(self, figure => figure.area())
///     }
///
///     fn corners() -> [u32; Self::NAMES.len()] {
///         match_figure!(each Kind => Kind::CORNERS)
///     }
/// }
///
/// assert_eq!(Figure::NAMES, ["square"]);
/// assert_eq!(Figure::examples()[0].name(), "square");
/// assert_eq!(Figure::from(Square { side: 3.0 }).area(), 9.0);
/// assert_eq!(Figure::corners(), [4]);
/// ```
///
/// With `tagged "figure"` after the name, instead of an attribute of serde, every kind must be a
/// type with parameters ([`declare!`](crate::declare)). The enum then has parameters too, and its
/// `DECLARATIONS` are those of the kinds:
///
/// ```
/// snell_math::declare! {
///     /// A square.
///     #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
///     pub struct Square {
///         /// Length of a side.
///         pub side: f32,
///     }
/// }
///
/// impl Square {
///     fn examples() -> Vec<Self> {
///         vec![Self { side: 2.0 }]
///     }
/// }
///
/// snell_math::kinds! {
///     /// Any figure.
///     pub enum Figure tagged "figure" by match_figure! {
///         "square" => Square,
///     }
/// }
///
/// let figure = &Figure::examples()[0];
/// assert_eq!(figure.declaration().parameters[0].name, "side");
/// assert_eq!(Figure::TAG, "figure");
/// ```
#[macro_export]
macro_rules! kinds {
    (
        $(#[$attribute:meta])*
        pub enum $any:ident tagged $tag:literal by $matching:ident! {
            $($name:literal => $kind:ident,)*
        }
    ) => {
        $crate::kinds! {
            $(#[$attribute])*
            #[serde(tag = $tag)]
            pub enum $any by $matching! { $($name => $kind,)* }
        }

        impl $any {
            /// The field whose value is the name of the kind.
            pub const TAG: &'static str = $tag;

            /// The declarations of all kinds: names and parameters.
            pub const DECLARATIONS: &'static [$crate::parameters::Declaration] =
                &[$($crate::parameters::Declaration::of::<$kind>($name)),*];

            /// The declaration of the kind of this value.
            pub fn declaration(&self) -> $crate::parameters::Declaration {
                match self {
                    $(Self::$kind(_) => $crate::parameters::Declaration::of::<$kind>($name),)*
                }
            }
        }

        impl $crate::parameters::Value for $any {
            const KIND: $crate::parameters::Kind =
                $crate::parameters::Kind::OneOf($tag, Self::DECLARATIONS);

            fn visit(&self, visitor: &mut $crate::parameters::Visitor<'_>) {
                match self {
                    $(Self::$kind(thing) => {
                        $crate::parameters::Value::visit(thing, visitor);
                    })*
                }
            }
        }
    };
    ($(#[$attribute:meta])* pub enum $any:ident by $matching:ident! {
        $($name:literal => $kind:ident,)*
    }) => {
        #[derive(Clone, Debug, PartialEq, ::serde::Serialize, ::serde::Deserialize)]
        $(#[$attribute])*
        pub enum $any {
            $(
                #[doc = concat!("See [`", stringify!($kind), "`].")]
                #[serde(rename = $name)]
                $kind($kind),
            )*
        }

        impl $any {
            /// The names of all kinds.
            pub const NAMES: &[&str] = &[$($name),*];

            /// The name of this kind.
            pub fn name(&self) -> &'static str {
                match self { $(Self::$kind(_) => $name,)* }
            }

            /// A few values of each kind, extremes included, for tests and galleries.
            pub fn examples() -> Vec<Self> {
                let mut all = Vec::new();
                $(all.extend($kind::examples().into_iter().map(Self::$kind));)*
                all
            }
        }

        $(impl From<$kind> for $any {
            fn from(kind: $kind) -> Self { Self::$kind(kind) }
        })*

        $crate::kinds! { @matching ($) $any by $matching! { $($kind,)* } }
    };
    // A dollar sign that arrives as a token stays one in the generated macro.
    (@matching ($dollar:tt) $any:ident by $matching:ident! { $($kind:ident,)* }) => {
        macro_rules! $matching {
            (each $dollar kind:ident => $dollar answer:expr) => {
                [$({ type $dollar kind = $kind; $dollar answer }),*]
            };
            ($dollar value:expr, $dollar kind:ident => $dollar answer:expr) => {
                match $dollar value { $($any::$kind($dollar kind) => $dollar answer,)* }
            };
        }
    };
}
