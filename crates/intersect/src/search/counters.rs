//! What searches cost.

/// What one ray cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounters {
    /// Nodes of acceleration structures whose boxes were tested.
    pub nodes_visited: u32,
    /// Triangles and shapes tested.
    pub primitives_tested: u32,
    /// Cells of grids, and leaves of trees that divide space, that were gone through.
    pub cells_stepped: u32,
}

/// What a batch of rays cost: [`TraversalCounters`], summed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalWork {
    /// See [`TraversalCounters::nodes_visited`].
    pub nodes_visited: u64,
    /// See [`TraversalCounters::primitives_tested`].
    pub primitives_tested: u64,
    /// See [`TraversalCounters::cells_stepped`].
    pub cells_stepped: u64,
}

impl TraversalWork {
    /// Adds the work of a ray.
    pub(crate) fn add(&mut self, ray: &TraversalCounters) {
        self.nodes_visited += u64::from(ray.nodes_visited);
        self.primitives_tested += u64::from(ray.primitives_tested);
        self.cells_stepped += u64::from(ray.cells_stepped);
    }
}
