//! Build quality: build time against tracing speed.

/// The build quality of a hierarchy. All qualities give the same hits, bit for bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Quality {
    /// Built along a space-filling curve: the build is several times faster than the others, and
    /// rays are traced at about three quarters of the rate.
    Fast,
    /// Built by the surface area heuristic; large slanted triangles are split first where that is
    /// worthwhile.
    #[default]
    Medium,
    /// Built with spatial splits everywhere, which takes the longest.
    High,
}

impl Quality {
    /// All qualities, from the fastest to the slowest build.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Medium, Self::High];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }

    /// The quality with this name; `None` for an unknown name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|q| q.name() == name)
    }
}
