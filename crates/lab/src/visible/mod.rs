//! The lab of hidden-surface algorithms: finds the visible triangle at each pixel by every
//! classical method.
//!
//! Sutherland, Sproull and Schumacker compared ten methods (A Characterization of Ten
//! Hidden-Surface Algorithms, ACM Computing Surveys 6(1), 1974) by what they sort, in which order,
//! and by the coherence they exploit. [`Method`] lists these kinds of methods as they are taught
//! today, each in a file that follows its paper, and [`Method::characterization`] gives the paper's
//! criteria for each. The methods exist for comparison (`snell bench hidden-surfaces`); the
//! renderer traces rays.
//!
//! All methods have the same input: [`Screen`] projects the triangles of a world as seen by a
//! pinhole camera, and `facet.rs` has the only tests of a pixel, so that all methods but the two
//! that trace rays give the same picture, bit for bit. (A painter's order may differ where two
//! triangles are equally near up to rounding.) Triangles are double-sided; at equal nearness the
//! lowest ids win.
//!
//! [`HiddenLines`] draws lines instead of surfaces, by the oldest of these algorithms: Appel's
//! quantitative invisibility.

mod areas;
mod bsp;
mod canvas;
mod depth_sort;
mod facet;
mod hidden_lines;
mod kinds;
mod pieces;
mod ray_casting;
mod rows;
mod scan_line;
mod scan_line_z;
mod screen;
#[cfg(test)]
mod tests;
mod warnock;
mod z_buffer;

pub use bsp::Tree;
pub use canvas::Seen;
pub use hidden_lines::{HiddenLines, LineKind, LineWork, Stretch};
pub use kinds::{Characterization, Method, Space};
pub use screen::Screen;

use snell_intersect::World;

/// The item of a background pixel.
pub const NOTHING: u32 = u32::MAX;

/// The item of a pixel where a ray hit a triangle that is seen edge-on and therefore has no number.
/// Only methods that trace rays produce it.
pub const EDGE_ON: u32 = u32::MAX - 1;

/// Errors of methods that do not support a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VisibleError {
    /// The rays do not start at one point, or the picture is not flat.
    #[error("hidden surfaces are found for a pinhole camera with a flat picture")]
    NotPinhole,
    /// The world has geometry other than triangles, or moving geometry.
    #[error(
        "hidden surfaces are found among triangles that do not move, and nothing else; take a \
            scene of meshes"
    )]
    NotTriangles,
    /// The world has another acceleration structure than the bounding volume hierarchy.
    #[error(
        "areas are found with the bounding volume hierarchy; build the world with the accelerator \
            bvh"
    )]
    NotBvh,
    /// There are too many triangles.
    #[error(
        "the scene has {count} triangles, and {most} is the most for hidden surfaces; take a \
            smaller one"
    )]
    TooManyTriangles {
        /// The number of triangles; each instance counts.
        count: u64,
        /// The largest number of triangles.
        most: u64,
    },
    /// A method would take far too much time or memory for this scene.
    #[error("more than {limit} {what}: too many for this method; take a smaller scene or picture")]
    TooMuchWork {
        /// The operation or data that exceeds the limit.
        what: &'static str,
        /// The limit.
        limit: u64,
    },
}

/// A method with its view-independent data for a scene.
#[derive(Debug)]
pub struct Prepared<'w> {
    method: Method,
    world: &'w World,
    /// The tree for methods that sort by planes; empty for other methods.
    tree: Tree,
}

impl<'w> Prepared<'w> {
    /// Prepares a method. `world` is the screen's world, built with the accelerator `bvh`.
    pub fn new(method: Method, screen: &Screen, world: &'w World) -> Result<Self, VisibleError> {
        let is_tree = matches!(method, Method::Bsp | Method::BspFrontToBack);
        let tree = if is_tree { Tree::build(screen)? } else { Tree::default() };
        Ok(Self { method, world, tree })
    }

    /// Finds the visible item at the centre of each pixel; `with_cost` also counts work per pixel,
    /// if that is defined.
    pub fn run(&self, screen: &Screen, with_cost: bool) -> Result<Seen, VisibleError> {
        Ok(match self.method {
            Method::RayCastingAll => ray_casting::run_all(screen)?,
            Method::RayCasting => ray_casting::run(screen, self.world),
            Method::ZBuffer => z_buffer::run(screen, with_cost),
            Method::ScanLineZ => scan_line_z::run(screen, with_cost),
            Method::ScanLine => scan_line::run(screen, with_cost),
            Method::DepthSort => depth_sort::run(screen, with_cost)?,
            Method::Bsp => bsp::run(screen, &self.tree, false, with_cost),
            Method::BspFrontToBack => bsp::run(screen, &self.tree, true, with_cost),
            Method::Warnock => warnock::run(screen, with_cost),
            Method::WeilerAtherton => areas::run(screen, self.world, with_cost)?,
        })
    }
}

/// The cost of rays through the hierarchy for this picture: nodes whose eight boxes were tested,
/// and triangles.
pub fn ray_work(screen: &Screen, world: &World) -> [u64; 2] {
    ray_casting::work(screen, world)
}
