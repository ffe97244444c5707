//! Enums over all kinds of something, made from one list of the kinds.

/// Makes an enum from the list of its kinds, each a type of its own with a name, and a macro that
/// asks whichever kind a value is, or each of the kinds.
///
/// The enum is [`Clone`], [`Debug`] and [`PartialEq`], is made [`From`] each kind, and has `NAMES`,
/// `name()` and `examples()`, for which each kind has an `examples()` too. It is read and written
/// by serde (the crate that calls this needs it) with the names as variants; attributes of serde
/// may stand with it.
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
/// With `tagged "figure"` after the name, in place of an attribute of serde, the kinds are things
/// with parameters ([`declare!`](crate::declare)), and so is the enum, whose `DECLARATIONS` are
/// theirs:
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
            /// The field that says which kind a thing is.
            pub const TAG: &'static str = $tag;

            /// The kinds with their parameters.
            pub const DECLARATIONS: &'static [$crate::parameters::Declaration] =
                &[$($crate::parameters::Declaration::of::<$kind>($name)),*];

            /// The declaration of this kind.
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

            /// A few of each kind, extremes included, for tests and galleries.
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
    // A dollar passed as a token remains one in the generated macro.
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
