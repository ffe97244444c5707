//! A macro for choices by name: each has its documentation and its name on the command line in one
//! declaration.

/// Declares an enum whose variants have names: `Variant = "name"`, and for the default
/// `Variant = "name" (default)`. It makes `ALL`, `name` and `text`.
macro_rules! named {
    (
        $(#[$meta:meta])*
        pub enum $Type:ident {
            $($(#[doc = $doc:literal])* $Kind:ident = $name:literal $(($default:ident))?,)*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub enum $Type {
            $($(#[doc = $doc])* $(#[$default])? $Kind,)*
        }

        impl $Type {
            /// All of them.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$Kind),*];

            /// The name on the command line.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$Kind => $name,)*
                }
            }

            /// The documentation, in one line.
            pub fn text(self) -> &'static str {
                match self {
                    $(Self::$Kind => concat!($($doc),*).trim(),)*
                }
            }
        }
    };
}

pub(crate) use named;
