//! Worlds and rays out of bytes: random ones for tests, and whatever a fuzzer finds.

use snell_intersect::WorldBuilder;
use snell_intersect::accel::AcceleratorKind;
use snell_intersect::shape::AnyShape;
use snell_intersect::{
    AcceptAll, BuildOptions, CubicCurves, CurveBasis, GroupId, Grouping, Hit, Instance, LinearCurves, MeshKey,
    MovingMesh, QuadMesh, Rays, Spheres, TriangleMesh, World,
};
use snell_math::rng::{hash32, pcg4d};
use snell_math::simd::Level;
use snell_math::{DAffine3, DMat3, DVec3, Ray, Transform, Vec3, Vec4};
use std::sync::Arc;

/// Bytes that are read as numbers; zeros when they have run out.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    bytes: &'a [u8],
}

impl<'a> Source<'a> {
    /// A source that reads these bytes.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    /// True if nothing is left.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.bytes.split_first() else { return 0 };
        self.bytes = rest;
        first
    }

    fn word(&mut self) -> u16 {
        u16::from_le_bytes([self.byte(), self.byte()])
    }

    /// A number below `n`, which is at most 256.
    fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    /// A coordinate of the order of one: often from a coarse lattice, so that things touch and coincide.
    fn coordinate(&mut self) -> f32 {
        match self.below(4) {
            0 => self.below(9) as f32 * 0.5 - 2.0,
            1 => self.below(3) as f32 - 1.0,
            _ => f32::from(self.word()) / 16384.0 - 2.0,
        }
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.coordinate(), self.coordinate(), self.coordinate())
    }

    /// What no one expects: not a number, infinite, enormous, tiny, zero.
    fn strange(&mut self) -> f32 {
        let values = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -3e38, 1e-45, f32::MIN_POSITIVE, 0.0, -0.0];
        values[self.below(values.len())]
    }

    fn transform(&mut self) -> Transform {
        let position = self.point().as_dvec3();
        let linear = match self.below(4) {
            0 => DMat3::IDENTITY,
            1 => {
                let axis = self.point().as_dvec3().normalize_or(DVec3::Z);
                DMat3::from_axis_angle(axis, f64::from(self.coordinate()) * 2.0)
            }
            2 => DMat3::from_diagonal((self.point().as_dvec3() + 0.1).map(|x| if x == 0.0 { 1.0 } else { x })),
            _ => {
                let axis = self.point().as_dvec3().normalize_or(DVec3::X);
                let scale = DVec3::new(1.0, -0.5, 2.0) * 10f64.powi(self.below(7) as i32 - 3);
                DMat3::from_axis_angle(axis, 1.0) * DMat3::from_diagonal(scale)
            }
        };
        Transform::new(DAffine3 { matrix3: linear, translation: position }).unwrap_or(Transform::IDENTITY)
    }

    fn mesh(&mut self) -> TriangleMesh {
        let size = [1.0, 1.0, 1.0, 1e-3, 1e4, 1e15, 1e-20][self.below(7)];
        let mut mesh = TriangleMesh::default();
        let vertices = 3 + self.below(30);
        for _ in 0..vertices {
            let mut point = self.point() * size;
            if self.below(40) == 39 {
                point[self.below(3)] = self.strange();
            }
            mesh.positions.push(point);
        }
        // Few vertices and many triangles: shared edges, fans, and the same triangle twice.
        for _ in 0..1 + self.below(60) {
            mesh.indices.push(std::array::from_fn(|_| self.below(vertices) as u32));
        }
        mesh
    }

    /// Groups with meshes, shapes and instances of each other, with masks.
    pub fn builder(&mut self) -> WorldBuilder {
        let mut builder = WorldBuilder::default();
        let shapes = AnyShape::examples();
        let count = 1 + self.below(4);
        for index in 0..count {
            let group = if index == 0 { WorldBuilder::ROOT } else { builder.add_group() };
            for _ in 0..self.below(3) {
                let mesh = Arc::new(self.mesh());
                let id = builder.add_mesh(group, mesh.clone());
                if self.below(8) == 0 {
                    builder.set_mask(id, 1 << self.below(3));
                }
                if self.below(6) == 0 {
                    builder.add_mesh(group, mesh);
                }
            }
            for _ in 0..self.below(4) {
                let shape = shapes[self.below(shapes.len())].clone();
                let placed = self.transform();
                builder.add_shape(group, Arc::new(shape), placed);
            }
        }
        // Only later groups are instanced in earlier ones: no cycles.
        for child in 1..count {
            for _ in 0..1 + self.below(3) {
                let group = GroupId(self.below(child) as u32);
                let group_from_child = self.transform();
                let mask = if self.below(8) == 0 { 1 << self.below(3) } else { u32::MAX };
                builder.add(group, Instance { mask, ..Instance::new(GroupId(child as u32), group_from_child) });
            }
        }
        builder
    }

    /// Adds spheres, curves, quads, a mesh with moving vertices, and a moving instance of the same.
    pub fn add_sets(&mut self, builder: &mut WorldBuilder) {
        let child = builder.add_group();
        for group in [WorldBuilder::ROOT, child] {
            if self.below(3) > 0 {
                let count = 1 + 40 * self.below(2);
                let spheres = self.balls(count);
                builder.add_set(group, Arc::new(Spheres { spheres, colors: Vec::new() }));
            }
            if self.below(3) > 0 {
                let points = self.balls(12);
                builder.add_set(group, Arc::new(LinearCurves::chain(points)));
            }
            if self.below(3) > 0 {
                let bases = [CurveBasis::Bezier, CurveBasis::BSpline, CurveBasis::CatmullRom, CurveBasis::Hermite];
                let basis = bases[self.below(4)];
                let (points, tangents) = (self.balls(12), self.balls(12));
                let segments = (0..9).map(|_| self.below(12) as u32).collect();
                builder.add_set(group, Arc::new(CubicCurves { basis, points, tangents, segments }));
            }
            if self.below(3) > 0 {
                let mesh = self.mesh();
                let quads: Vec<[u32; 4]> =
                    mesh.indices.chunks_exact(2).map(|t| [t[0][0], t[0][1], t[1][0], t[0][2]]).collect();
                builder.add_quads(group, Arc::new(QuadMesh::new(mesh, &quads).expect("vertices that exist")));
            }
            if self.below(3) > 0 {
                let mesh = self.mesh();
                let moved = |key: f32| mesh.positions.iter().rev().map(|p| *p * key).collect();
                let later = [0.5, -1.0].map(|key| MeshKey { positions: moved(key), normals: Vec::new() });
                let moving = MovingMesh::new(mesh.clone(), later.to_vec()).expect("as many vertices");
                builder.add_moving_mesh(group, Arc::new(moving));
            }
        }
        let later = (0..self.below(3)).map(|_| self.transform()).collect();
        builder.add(WorldBuilder::ROOT, Instance { later, ..Instance::new(child, self.transform()) });
    }

    /// Points with radii.
    fn balls(&mut self, count: usize) -> Vec<Vec4> {
        let ball = |_| {
            let radius = self.coordinate().abs() * 0.3;
            let ball = self.point().extend(radius);
            if self.below(40) == 39 { ball.with_w(self.strange()) } else { ball }
        };
        (0..count).map(ball).collect()
    }

    /// A ray at something, along an axis, through lattice points, or a broken one.
    pub fn ray(&mut self) -> Ray {
        let origin = self.point() * if self.below(3) == 0 { 4.0 } else { 1.0 };
        let mut ray = Ray::new(origin, self.point() - origin);
        match self.below(8) {
            0 => ray.direction = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z][self.below(6)],
            1 => {
                ray.t_min = self.coordinate();
                ray.t_max = ray.t_min + self.coordinate().abs() * 2.0;
            }
            2 => ray.direction *= 10f32.powi(self.below(31) as i32 - 15),
            3 => ray.t_max = self.coordinate(),
            4 if self.below(8) == 0 => match self.below(4) {
                0 => ray.origin[self.below(3)] = self.strange(),
                1 => ray.direction[self.below(3)] = self.strange(),
                2 => ray.t_min = self.strange(),
                _ => ray.t_max = self.strange(),
            },
            _ => {}
        }
        ray
    }

    /// A mask: mostly all bits.
    pub fn mask(&mut self) -> u32 {
        if self.below(4) == 0 { self.byte().into() } else { u32::MAX }
    }
}

/// As many bytes as one wants, from a seed.
pub fn random_bytes(seed: u32, count: usize) -> Vec<u8> {
    let words = (0..count.div_ceil(16) as u32).flat_map(|i| pcg4d([hash32(seed), i, 23, 5]));
    words.flat_map(u32::to_le_bytes).take(count).collect()
}

/// Builds the world that the bytes describe with every accelerator (one of them also compact) at every level, and asserts that all answers to the rays that
/// follow are those of testing everything, bit for bit: closest, any and all, one ray at a time and in batches of `batch`, on one
/// thread and on several, and how many hits there are. Returns how many rays there were, and how many of them hit.
///
/// # Panics
/// If two answers differ.
pub fn assert_agreement(bytes: &[u8], rays: usize, batches: &[usize]) -> (usize, usize) {
    let mut source = Source::new(bytes);
    // Half of the worlds also have sets and motion, which are read from the end.
    let reversed: Vec<u8> = bytes.iter().rev().copied().collect();
    let build = |accelerator, compact, simd| {
        let options = BuildOptions { accelerator, compact, simd, ..BuildOptions::default() };
        let (mut builder, mut end) = (Source::new(bytes).builder(), Source::new(&reversed));
        if end.below(2) == 1 {
            end.add_sets(&mut builder);
        }
        builder.build(&options).ok()
    };
    source.builder();
    let Some(oracle) = build(AcceleratorKind::None, false, Level::Scalar) else { return (0, 0) };
    let (mut queries, mut masks, mut times) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..rays {
        queries.push(source.ray());
        masks.push(source.mask());
        times.push([0.0, 1.0, 0.3, f32::NAN, 0.5, -1.0, 0.77][i % 7]);
    }
    let queries = Rays::new(&queries).with_masks(&masks).with_times(&times);
    let all: Vec<Vec<Hit>> = (0..rays).map(|i| oracle.all_one(queries.get(i), &AcceptAll)).collect();
    for (i, hits) in all.iter().enumerate() {
        let closest = oracle.closest_one(queries.get(i), &AcceptAll);
        assert_eq!(
            bits(&closest),
            bits(hits.first().unwrap_or(&Hit::MISS)),
            "closest and all: {:?}",
            queries.rays()[i]
        );
    }
    let kinds = AcceleratorKind::ALL.map(|accelerator| (accelerator, false));
    for (accelerator, compact) in kinds.into_iter().chain([(AcceleratorKind::Bvh, true)]) {
        for simd in Level::ALL.into_iter().filter(|l| l.is_supported()) {
            let name = format!("{}{}, {simd}", accelerator.name(), if compact { " (compact)" } else { "" });
            let world = build(accelerator, compact, simd).unwrap_or_else(|| panic!("{name} builds what none builds"));
            for (i, expected) in all.iter().enumerate() {
                let query = queries.get(i);
                let found = world.all_one(query, &AcceptAll);
                let only = |a: &[Hit], b: &[Hit]| -> Vec<Hit> {
                    a.iter().filter(|x| b.iter().all(|y| bits(x) != bits(y))).copied().collect()
                };
                let (missed, wrong) = (only(expected, &found), only(&found, expected));
                let same = missed.is_empty() && wrong.is_empty() && found.len() == expected.len();
                assert!(same, "{name}, all: {:?} misses {missed:?} and wrongly finds {wrong:?}", queries.rays()[i]);
                let closest = world.closest_one(query, &AcceptAll);
                let first = expected.first().copied().unwrap_or(Hit::MISS);
                assert_eq!(bits(&closest), bits(&first), "{name}, closest: {:?}", queries.rays()[i]);
                assert_eq!(
                    world.occluded_one(query, &AcceptAll),
                    first.is_hit(),
                    "{name}, any: {:?}",
                    queries.rays()[i]
                );
            }
            for &batch in batches {
                assert_batches(&world, &name, queries, &all, batch);
            }
        }
    }
    (rays, all.iter().filter(|hits| !hits.is_empty()).count())
}

fn assert_batches(world: &World, name: &str, queries: Rays, all: &[Vec<Hit>], batch: usize) {
    let rays = queries.rays();
    for grouping in [Grouping::None, Grouping::Coherent] {
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut blocked = vec![false; rays.len()];
        let mut counts = vec![u32::MAX; rays.len()];
        for start in (0..rays.len()).step_by(batch) {
            let range = start..(start + batch).min(rays.len());
            world.closest(queries.slice(range.clone()), grouping, &AcceptAll, &mut hits[range.clone()]);
            world.occluded(queries.slice(range.clone()), grouping, &AcceptAll, &mut blocked[range.clone()]);
            world.count(queries.slice(range.clone()), &AcceptAll, &mut counts[range]);
        }
        for (i, expected) in all.iter().enumerate() {
            let first = expected.first().copied().unwrap_or(Hit::MISS);
            let what = format!("{name}, batches of {batch}, {grouping:?}: {:?}", rays[i]);
            assert_eq!(bits(&hits[i]), bits(&first), "{what}, closest");
            assert_eq!(blocked[i], first.is_hit(), "{what}, any");
            assert_eq!(counts[i] as usize, expected.len(), "{what}, count");
        }
    }
}

/// All that a hit says, for comparisons bit by bit.
pub fn bits(hit: &Hit) -> [u32; 6] {
    [hit.t.to_bits(), hit.uv.x.to_bits(), hit.uv.y.to_bits(), hit.instance, hit.geometry, hit.primitive]
}
