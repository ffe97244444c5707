//! Counters of the work of searches.

/// Counters of the work for one ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounters {
    /// Nodes of acceleration structures whose boxes were tested.
    pub nodes_visited: u32,
    /// Triangles and shapes tested.
    pub primitives_tested: u32,
    /// Cells of grids, and leaves of trees that divide space, that the ray passed through.
    pub cells_stepped: u32,
    /// Instances that the ray entered, each counted as often as it was entered.
    pub instances_entered: u32,
}

/// Counters of the work for a batch of rays: sums of [`TraversalCounters`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalWork {
    /// The sum of [`TraversalCounters::nodes_visited`].
    pub nodes_visited: u64,
    /// The sum of [`TraversalCounters::primitives_tested`].
    pub primitives_tested: u64,
    /// The sum of [`TraversalCounters::cells_stepped`].
    pub cells_stepped: u64,
    /// The sum of [`TraversalCounters::instances_entered`].
    pub instances_entered: u64,
}

impl TraversalWork {
    /// Adds the counters of one ray.
    pub(crate) fn add(&mut self, ray: &TraversalCounters) {
        self.nodes_visited += u64::from(ray.nodes_visited);
        self.primitives_tested += u64::from(ray.primitives_tested);
        self.cells_stepped += u64::from(ray.cells_stepped);
        self.instances_entered += u64::from(ray.instances_entered);
    }
}
