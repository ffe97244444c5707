//! Build quality: build time against tracing speed.

/// The build quality of a hierarchy. All qualities give the same hits, bit for bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Quality {
    /// Along a space-filling curve: built several times faster, traced at perhaps three quarters of
    /// the rate.
    Fast,
    /// By the surface area heuristic; large slanted triangles are split beforehand where that pays.
    #[default]
    Medium,
    /// With spatial splits everywhere: the slowest to build.
    High,
}

impl Quality {
    /// All qualities, from fast to slow to build.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Medium, Self::High];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }

    /// The quality of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.name() == name)
    }
}
