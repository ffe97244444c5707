//! Acceleration structures, by name.

pub(crate) mod brute_force;
pub(crate) mod bvh;
pub(crate) mod group;

pub use bvh::Quality;

/// Which acceleration structure a world is built with. All give the same hits, bit for bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AcceleratorKind {
    /// No structure: every primitive is tested. The oracle.
    None,
    /// An 8-wide bounding volume hierarchy.
    #[default]
    Bvh,
}

impl AcceleratorKind {
    /// All kinds.
    pub const ALL: [Self; 2] = [Self::None, Self::Bvh];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Bvh => "bvh",
        }
    }

    /// The kind of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|k| k.name() == name)
    }
}
