//! Binary space partition: space is divided by the planes of polygons, polygons are cut where a
//! plane crosses them, and each node keeps the polygons on its plane (Fuchs, Kedem and Naylor, On
//! visible surface generation by a priori tree structures, 1980).
//!
//! Auto-partitions, by the planes of polygons alone, can be bad: the tree of a convex mesh becomes
//! a list. So the sides of the polygons' boxes are also used as planes where they divide better
//! (Ize, Wald and Parker, Ray tracing with the BSP tree, 2008), and a set that no plane divides
//! well stays together in a leaf. A hit is always on the whole triangle, by the exact test; the
//! clipped polygons only decide which leaves hold the triangle.

mod build;
mod polygon;

use super::box_ray::BoxRay;
use super::primitives::Primitives;
use super::{Accelerator, AcceleratorOptions, Later, Size, Visitor, Work, walk_with_stack};
use crate::search::region::Region;
use snell_math::plane::Plane;
use snell_math::{Bounds3, DVec3};

/// A reference to a child: an inner node, or with the bit [`Self::LEAF`] a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ChildRef(u32);

impl ChildRef {
    const LEAF: u32 = 1 << 31;

    #[inline(always)]
    fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 & !Self::LEAF) as usize
    }
}

/// A plane, the polygons on it, and the subtrees behind and in front of it.
#[derive(Clone, Copy, Debug)]
struct Node {
    plane: Plane,
    /// The range of the polygons on the plane in [`BspTree::references`], as first and end.
    on: [u32; 2],
    /// The children behind and in front of the plane.
    children: [ChildRef; 2],
}

#[derive(Debug)]
struct BspTree {
    nodes: Vec<Node>,
    /// For each leaf its range in `references`, as first and end.
    leaves: Vec<[u32; 2]>,
    references: Vec<u32>,
    root: ChildRef,
    depth: u32,
    /// The origin of the planes.
    center: DVec3,
    bounds: Bounds3,
    front_to_back: bool,
}

/// Builds the BSP tree of a group.
pub(crate) fn build(primitives: &Primitives, options: &AcceleratorOptions) -> Box<dyn Accelerator> {
    let (part, root, center) = build::tree(primitives);
    Box::new(BspTree {
        nodes: part.nodes,
        leaves: part.leaves,
        references: part.references,
        root,
        depth: part.depth,
        center,
        bounds: primitives.bounds,
        front_to_back: options.front_to_back,
    })
}

impl BspTree {
    fn references(&self, [first, end]: [u32; 2]) -> &[u32] {
        &self.references[first as usize..end as usize]
    }

    /// The lecture's `ComputeBSPIntersection`, with a stack and with a corrected test of `t`: the
    /// near side is always visited up to the plane (if the ray does not reach the plane, only the
    /// near side is visited). The polygons on the plane, and the far side, are visited if the ray
    /// crosses the plane within the interval.
    fn search(
        &self,
        ray: &BoxRay,
        visitor: &mut dyn Visitor,
        stack: &mut Vec<Later>,
        work: &mut Work,
    ) -> bool {
        let (start, end) = ray.span_of(&self.bounds);
        if start <= end {
            stack.push(Later::node(self.root.0, start, end));
        }
        let ray_here = ray.relative_to(self.center);
        while let Some(Later { node, start, end, level, .. }) = stack.pop() {
            if start > ray.cull(visitor) {
                continue;
            }
            let at = ChildRef(node);
            if level == ON_PLANE {
                work.look(visitor, true, || Region::stretch(ray.at(start), ray.at(end)));
                if visitor.test(self.references(self.nodes[at.index()].on)) {
                    return true;
                }
                continue;
            }
            if at.is_leaf() {
                work.cell(visitor, || Region::stretch(ray.at(start), ray.at(end)));
                if visitor.test(self.references(self.leaves[at.index()])) {
                    return true;
                }
                continue;
            }
            let node = &self.nodes[at.index()];
            let (low, high, goes_to_front) =
                ray_here.plane_crossing(&node.plane.normal, node.plane.offset);
            work.node(visitor, || {
                // The recorded piece of the plane is as large as the piece of the ray that it
                // divides, and is centred where the ray crosses the plane, or at the nearest point
                // of the piece.
                let middle = low * 0.5 + high * 0.5;
                let at = if middle.is_finite() { middle.clamp(start, end) } else { start };
                Region::plane(
                    ray.at(at),
                    node.plane.normal,
                    ray.at(end).distance(ray.at(start)) * 0.5,
                )
            });
            let side = usize::from(goes_to_front);
            let (ends_near, starts_far) = (end.min(high), start.max(low));
            let near = (start <= ends_near)
                .then(|| Later::node(node.children[1 - side].0, start, ends_near));
            let far =
                (starts_far <= end).then(|| Later::node(node.children[side].0, starts_far, end));
            let has_polygons = node.on[0] < node.on[1] && starts_far <= ends_near;
            let on = has_polygons
                .then_some(Later { level: ON_PLANE, ..Later::node(at.0, starts_far, ends_near) });
            // The last entry is visited first.
            let ordered =
                if self.front_to_back || goes_to_front { [far, on, near] } else { [near, on, far] };
            stack.extend(ordered.into_iter().flatten());
        }
        false
    }
}

/// Marks an entry of the stack as the polygons on a node's plane.
const ON_PLANE: u32 = 1;

impl Accelerator for BspTree {
    fn walk(&self, ray: &BoxRay, visitor: &mut dyn Visitor) -> bool {
        walk_with_stack(visitor, |visitor, stack, work| self.search(ray, visitor, stack, work))
    }

    fn repeats(&self) -> bool {
        true
    }

    fn size(&self) -> Size {
        let bytes = size_of_val(self.nodes.as_slice())
            + size_of_val(self.leaves.as_slice())
            + size_of_val(self.references.as_slice());
        Size {
            nodes: (self.nodes.len() + self.leaves.len()) as u64,
            references: self.references.len() as u64,
            depth: self.depth,
            bytes: bytes as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::search::AcceptAll;
    use crate::world::AcceleratorKind;
    use crate::world::{BuildOptions, WorldBuilder};
    use crate::{Hit, TriangleMesh, World};
    use snell_math::{Ray, Vec3};
    use std::sync::Arc;

    /// Walls of triangles, one across each of several planes `x = i`, enough for a tree of planes.
    fn walls() -> World {
        let mut mesh = TriangleMesh::default();
        for i in 0..16 {
            let first = mesh.positions.len() as u32;
            let x = i as f32;
            mesh.positions.extend([
                Vec3::new(x, -1.0, -1.0),
                Vec3::new(x, 3.0, -1.0),
                Vec3::new(x, -1.0, 3.0),
            ]);
            mesh.indices.push([first, first + 1, first + 2]);
        }
        let mut builder = WorldBuilder::default();
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
        let options = BuildOptions { accelerator: AcceleratorKind::Bsp, ..BuildOptions::default() };
        builder.build(&options).expect("a world")
    }

    #[test]
    fn errata_e6_the_near_side_is_visited_whether_or_not_the_ray_meets_the_plane() {
        let world = walls();
        assert!(world.stats().nodes >= 7, "{:?}", world.stats());
        let hit = |ray: Ray| world.closest_one(&ray, &AcceptAll);
        let up = |x: f32, t_min: f32, t_max: f32| {
            Ray { t_min, ..Ray::new(Vec3::new(x, 0.0, 0.0), Vec3::X) }.with_t_max(t_max)
        };
        // Planes before, in and beyond the interval, crossed from both sides.
        for i in 0..15 {
            let x = i as f32 + 0.5;
            assert_eq!((hit(up(x, 0.0, 100.0)).t, hit(up(x, 0.0, 100.0)).primitive), (0.5, i + 1));
            assert_eq!(
                hit(up(x, 0.0, 0.6)).primitive,
                i + 1,
                "most planes lie beyond the interval"
            );
            assert_eq!(hit(up(x, 0.0, 0.4)), Hit::MISS);
            let down = Ray::new(Vec3::new(x, 0.0, 0.0), -Vec3::X);
            assert_eq!((hit(down).t, hit(down).primitive), (0.5, i));
            assert_eq!(
                hit(up(-10.0, 10.0 + x - 0.1, 10.0 + x + 0.9)).primitive,
                i + 1,
                "most lie before or beyond"
            );
            // Rays parallel to all the planes, between them and in one of them.
            assert_eq!(hit(Ray::new(Vec3::new(x, 0.0, 0.0), Vec3::Y)), Hit::MISS);
            assert_eq!(hit(Ray::new(Vec3::new(x - 0.5, -5.0, 0.0), Vec3::Y)), Hit::MISS);
        }
        assert_eq!(hit(up(100.0, 0.0, 100.0)), Hit::MISS);
    }
}
