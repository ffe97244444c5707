//! Acceleration structures, by name.

use crate::lecture::{Build, bsp, graph, grid, kdtree, octree, spheres};

macro_rules! accelerators {
    ($($(#[$attribute:meta])+ $kind:ident = $name:literal => $build:expr,)+) => {
        /// The acceleration structure of a world. All give the same hits, bit for bit.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub enum AcceleratorKind {
            $($(#[$attribute])+ $kind,)+
        }

        impl AcceleratorKind {
            /// All kinds.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$kind),+];

            /// The name on the command line.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => $name,)+
                }
            }

            /// How the structure of a group is built; `None` for the two that are built for all
            /// groups at once.
            pub(crate) fn build(self) -> Option<Build> {
                match self {
                    $(Self::$kind => $build,)+
                }
            }
        }
    };
}

accelerators! {
    /// No structure: every primitive is tested. This is the reference of the tests.
    None = "none" => None,
    /// The scene graph's own boxes: one per mesh, shape and instance, in the order of the graph.
    Graph = "graph" => Some(graph::build),
    /// A binary hierarchy of bounding spheres.
    Spheres = "spheres" => Some(spheres::build),
    /// An 8-wide bounding volume hierarchy, by far the fastest structure.
    #[default]
    Bvh = "bvh" => None,
    /// A uniform grid, with finer grids in crowded cells.
    Grid = "grid" => Some(grid::build),
    /// An octree, traversed from each cell to its neighbour.
    Octree = "octree" => Some(octree::build_neighbours),
    /// An octree, traversed from the root down.
    OctreeHierarchical = "octree-hierarchical" => Some(octree::build_hierarchical),
    /// A binary space partition whose splitting planes are the planes of the polygons.
    Bsp = "bsp" => Some(bsp::build),
    /// A k-d tree built by the surface area heuristic.
    KdTree = "kdtree" => Some(kdtree::build),
}

impl AcceleratorKind {
    /// The kind with this name; `None` for an unknown name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|k| k.name() == name)
    }
}
