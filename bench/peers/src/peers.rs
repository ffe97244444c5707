//! The peers: the crates `obvhs` (two of its structures) and `bvh`.

use crate::{Query, Ray, Triangles};
use ::bvh::aabb::{Aabb, Bounded};
use ::bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use glam::Vec3A;
use nalgebra::{Point3, Vector3};
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use std::time::Duration;

/// Their names: crate, structure, and how carefully it is built.
pub const NAMES: [&str; 5] = [
    "obvhs cwbvh medium",
    "obvhs cwbvh very slow",
    "obvhs bvh2 medium",
    "obvhs bvh2 very slow",
    "bvh",
];

/// A structure that answers for a batch.
pub trait Peer: Sync {
    fn trace(&self, query: Query, rays: &[Ray], found: &mut [f32]);
}

/// Builds the structure of this name.
pub fn build(name: &str, triangles: &Triangles) -> Box<dyn Peer> {
    if name == "bvh" {
        return Box::new(BinaryTree::build(triangles));
    }
    let corners: Vec<Triangle> = triangles
        .iter()
        .map(|t| t.map(Vec3A::from_array))
        .map(|[v0, v1, v2]| Triangle { v0, v1, v2 })
        .collect();
    let quality = if name.ends_with("slow") {
        BvhBuildParams::very_slow_build()
    } else {
        BvhBuildParams::medium_build()
    };
    let mut time = Duration::default();
    // Triangles in the order of the leaves, as its examples have them.
    let ordered =
        |indices: &[u32]| indices.iter().map(|&i| RtTriangle::from(&corners[i as usize])).collect();
    if name.contains("cwbvh") {
        let tree = build_cwbvh_from_tris(&corners, quality, &mut time);
        Box::new(Obvhs { triangles: ordered(&tree.primitive_indices), tree })
    } else {
        let tree = build_bvh2_from_tris(&corners, quality, &mut time);
        Box::new(Obvhs { triangles: ordered(&tree.primitive_indices), tree })
    }
}

/// A tree of `obvhs` with its triangles.
struct Obvhs<T> {
    tree: T,
    triangles: Vec<RtTriangle>,
}

macro_rules! obvhs_peer {
    ($tree:ty) => {
        impl Peer for Obvhs<$tree> {
            fn trace(&self, query: Query, rays: &[Ray], found: &mut [f32]) {
                for (ray, found) in rays.iter().zip(found) {
                    let (origin, direction) =
                        (Vec3A::from_array(ray.origin), Vec3A::from_array(ray.direction));
                    let ray = obvhs::ray::Ray::new(origin, direction, ray.t_min, ray.t_max);
                    let test = |ray: &obvhs::ray::Ray, i: usize| self.triangles[i].intersect(ray);
                    *found = match query {
                        Query::Closest => {
                            let mut hit = RayHit::none();
                            self.tree.ray_traverse(ray, &mut hit, test);
                            hit.t
                        }
                        Query::Occluded if self.tree.ray_traverse_miss(ray, test) => f32::INFINITY,
                        Query::Occluded => 0.0,
                    };
                }
            }
        }
    };
}

obvhs_peer!(CwBvh);
obvhs_peer!(Bvh2);

/// The tree of the crate `bvh`. It finds boxes; triangles are ours to test (Möller and Trumbore,
/// 1997, both sides).
struct BinaryTree {
    tree: ::bvh::bvh::Bvh<f32, 3>,
    triangles: Vec<Corners>,
}

struct Corners {
    corners: [Point3<f32>; 3],
    node: usize,
}

impl Bounded<f32, 3> for Corners {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.corners.iter().fold(Aabb::empty(), |aabb, corner| aabb.grow(corner))
    }
}

impl BHShape<f32, 3> for Corners {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Corners {
    /// The distance along a ray, infinite if it is not hit within the interval.
    fn distance(
        &self,
        origin: &Point3<f32>,
        direction: &Vector3<f32>,
        [t_min, t_max]: [f32; 2],
    ) -> f32 {
        let [a, b, c] = &self.corners;
        let (ab, ac) = (b - a, c - a);
        let p = direction.cross(&ac);
        let inverse = 1.0 / ab.dot(&p);
        let s = origin - a;
        let u = s.dot(&p) * inverse;
        let q = s.cross(&ab);
        let v = direction.dot(&q) * inverse;
        let t = ac.dot(&q) * inverse;
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        if inside && t > t_min && t < t_max { t } else { f32::INFINITY }
    }
}

impl BinaryTree {
    fn build(triangles: &Triangles) -> Self {
        let mut triangles: Vec<Corners> =
            triangles.iter().map(|t| Corners { corners: t.map(Point3::from), node: 0 }).collect();
        Self { tree: ::bvh::bvh::Bvh::build_par(&mut triangles), triangles }
    }
}

impl Peer for BinaryTree {
    fn trace(&self, query: Query, rays: &[Ray], found: &mut [f32]) {
        for (ray, found) in rays.iter().zip(found) {
            // It makes directions unit vectors, so distances are in other units inside.
            let length = Vector3::from(ray.direction).norm();
            let inner =
                ::bvh::ray::Ray::new(Point3::from(ray.origin), Vector3::from(ray.direction));
            let interval = [ray.t_min * length, ray.t_max * length];
            let distance = |t: &Corners| t.distance(&inner.origin, &inner.direction, interval);
            *found = match query {
                Query::Closest => {
                    let mut nearest = f32::INFINITY;
                    for triangle in self.tree.nearest_traverse_iterator(&inner, &self.triangles) {
                        let entry = inner
                            .intersection_slice_for_aabb(&triangle.aabb())
                            .map_or(f32::INFINITY, |s| s.0);
                        if entry > nearest {
                            break;
                        }
                        nearest = nearest.min(distance(triangle));
                    }
                    nearest / length
                }
                Query::Occluded => {
                    let mut candidates = self.tree.traverse_iterator(&inner, &self.triangles);
                    if candidates.any(|triangle| distance(triangle).is_finite()) {
                        0.0
                    } else {
                        f32::INFINITY
                    }
                }
            };
        }
    }
}
