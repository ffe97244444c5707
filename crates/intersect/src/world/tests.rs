//! Tests of whole worlds: all structures and SIMD levels agree, closed meshes have no holes, rays
//! leave surfaces.

mod closed;
mod instances;
mod rays;
mod structures;
mod surfaces;

use super::*;
use crate::hit::Hit;
use crate::mesh::DTriangleMesh;
use crate::search::rays::Rays;
use crate::search::{AcceptAll, Grouping, HitFilter};
use crate::shape::{AnyShape, Sphere};
use proptest::prelude::{Strategy, TestCaseError, prop_assert_eq};
use snell_math::rng::{hash32, pcg4d, to_unit};
use snell_math::sampling::uniform_sphere;
use snell_math::{DAffine3, DMat3, DRay, DVec3, Ray, Vec2, Vec3};

/// A sequence of pseudo-random numbers.
pub(crate) struct Random(pub u32);

impl Random {
    pub fn unit(&mut self) -> f32 {
        self.0 += 1;
        to_unit(pcg4d([self.0, 17, 3, 5])[0])
    }

    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    pub fn point(&mut self, extent: f32) -> Vec3 {
        Vec3::new(
            self.range(-extent, extent),
            self.range(-extent, extent),
            self.range(-extent, extent),
        )
    }

    pub fn direction(&mut self) -> Vec3 {
        let u = Vec2::new(self.unit(), self.unit());
        uniform_sphere(u)
    }

    /// A random transform: a rotation with a nonuniform scale, sometimes mirrored, and a
    /// translation.
    pub fn transform(&mut self, extent: f32) -> Transform {
        let turn =
            DMat3::from_axis_angle(self.direction().as_dvec3(), f64::from(self.range(0.0, 6.0)));
        let mut scale = DVec3::new(
            self.range(0.3, 1.5).into(),
            self.range(0.3, 1.5).into(),
            self.range(0.3, 1.5).into(),
        );
        if self.unit() < 0.5 {
            scale.x = -scale.x;
        }
        let linear = turn * DMat3::from_diagonal(scale);
        let map = DAffine3 { matrix3: linear, translation: self.point(extent).as_dvec3() };
        Transform::new(map).expect("an invertible map")
    }
}

pub(crate) fn soup(random: &mut Random, triangles: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..triangles as u32 {
        let center = random.point(2.0);
        // Every tenth triangle is a long sliver, and every seventh repeats its predecessor, which
        // makes ties.
        let size = if i % 10 == 0 { 3.0 } else { 0.3 };
        if i % 7 == 6 {
            mesh.indices.push([3 * i - 3, 3 * i - 2, 3 * i - 1]);
            mesh.positions.extend([center; 3]);
            continue;
        }
        mesh.positions.extend([center, center + random.point(size), center + random.point(0.3)]);
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

/// A mesh of small triangles at random positions.
pub(crate) fn dust(random: &mut Random, triangles: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..triangles {
        let corner = random.point(1.0);
        mesh.positions.extend([corner, corner + random.point(0.02), corner + random.point(0.02)]);
        mesh.indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    mesh
}

/// A scene of groups nested four deep, each with meshes, spheres and instances of the previous
/// group.
pub(crate) fn nested_scene(seed: u32) -> WorldBuilder {
    let mut random = Random(hash32(seed));
    let mut builder = WorldBuilder::default();
    let mut group = WorldBuilder::ROOT;
    for level in 0..4 {
        let mesh = Arc::new(soup(&mut random, 60));
        builder.add_mesh(group, mesh.clone());
        // The same mesh again: every hit is a tie between two geometries.
        builder.add_mesh(group, mesh);
        for _ in 0..3 {
            let shapes = AnyShape::examples();
            let shape = shapes[(random.unit() * shapes.len() as f32) as usize].clone();
            let size = shape.bounds().size().max_element();
            let size = if size.is_finite() { 0.7 / size } else { 1.0 };
            let placed = random.transform(2.0).compose(&scaling(size));
            builder.add_shape(group, Arc::new(shape), placed);
        }
        if level < 3 {
            let child = builder.add_group();
            for _ in 0..3 {
                let placed = random.transform(2.0);
                builder.add_instance(group, child, placed);
                if random.unit() < 0.4 {
                    builder.add_instance(group, child, placed);
                }
            }
            group = child;
        }
    }
    builder
}

pub(crate) fn scaling(factor: f64) -> Transform {
    Transform::new(DAffine3::from_scale(DVec3::splat(factor))).expect("invertible")
}

pub(crate) fn build(builder: WorldBuilder, accelerator: AcceleratorKind, simd: Level) -> World {
    builder.build(&BuildOptions { accelerator, simd, ..BuildOptions::default() }).expect("a world")
}

pub(crate) fn default_world(builder: WorldBuilder) -> World {
    builder.build(&BuildOptions::default()).expect("a world")
}

pub(crate) fn bits(hit: &Hit) -> [u32; 6] {
    [
        hit.t.to_bits(),
        hit.uv.x.to_bits(),
        hit.uv.y.to_bits(),
        hit.instance,
        hit.geometry,
        hit.primitive,
    ]
}

/// A point of a lattice, so that rays often hit edges, vertices and flat boxes.
pub(crate) fn lattice_point() -> impl Strategy<Value = Vec3> {
    [-3i8..=3, -3i8..=3, -3i8..=3].prop_map(|p| Vec3::from_array(p.map(f32::from)))
}

/// Compares the hits of all queries, with every grouping of rays, with those of the reference.
pub(crate) fn check(
    world: &World,
    oracle: &World,
    rays: Rays,
    filter: &dyn HitFilter,
) -> Result<(), TestCaseError> {
    let expected: Vec<Hit> =
        (0..rays.len()).map(|i| oracle.closest_one(rays.get(i), filter)).collect();
    for grouping in [Grouping::Coherent, Grouping::None] {
        let (mut hits, mut blocked) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        world.closest(rays, grouping, filter, &mut hits);
        world.occluded(rays, grouping, filter, &mut blocked);
        for i in 0..rays.len() {
            prop_assert_eq!(bits(&hits[i]), bits(&expected[i]), "{:?} {:?}", grouping, rays.get(i));
            prop_assert_eq!(blocked[i], expected[i].is_hit(), "{:?} {:?}", grouping, rays.get(i));
        }
    }
    Ok(())
}

pub(crate) fn levels() -> impl Iterator<Item = Level> {
    Level::ALL.into_iter().filter(|l| l.is_supported())
}

pub(crate) fn sphere_mesh(center: Vec3, radius: f32, rings: u32, segments: u32) -> TriangleMesh {
    let DTriangleMesh { positions, indices } =
        double_sphere(center.as_dvec3(), radius.into(), rings, segments);
    let positions = positions.iter().map(|p| p.as_vec3()).collect();
    TriangleMesh { positions, indices, ..TriangleMesh::default() }
}

/// A closed sphere of triangles between circles of latitude and longitude.
pub(crate) fn double_sphere(
    center: DVec3,
    radius: f64,
    rings: u32,
    segments: u32,
) -> DTriangleMesh {
    let mut mesh = DTriangleMesh::default();
    let mut add = |z: f64, r: f64, phi: f64| {
        mesh.positions.push(DVec3::new(r * phi.cos(), r * phi.sin(), z) * radius + center);
    };
    add(1.0, 0.0, 0.0);
    for ring in 1..rings {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        (0..segments).for_each(|s| {
            add(
                theta.cos(),
                theta.sin(),
                std::f64::consts::TAU * f64::from(s) / f64::from(segments),
            );
        });
    }
    add(-1.0, 0.0, 0.0);
    let last = 1 + (rings - 1) * segments;
    let at = |ring: u32, s: u32| match ring {
        0 => 0,
        r if r == rings => last,
        r => 1 + (r - 1) * segments + s % segments,
    };
    for ring in 0..rings {
        for s in 0..segments {
            let (a, b, c, d) = (at(ring, s), at(ring + 1, s), at(ring + 1, s + 1), at(ring, s + 1));
            if ring + 1 < rings {
                mesh.indices.push([a, b, c]);
            }
            if ring > 0 {
                mesh.indices.push([a, c, d]);
            }
        }
    }
    mesh
}

pub(crate) fn mesh_world(mesh: TriangleMesh) -> World {
    let mut builder = WorldBuilder::default();
    builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
    default_world(builder)
}
