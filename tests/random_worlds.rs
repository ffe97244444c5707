//! Worlds and rays decoded from bytes: random ones for tests, and the inputs of a fuzzer.

mod agreement;
mod precision;

pub use agreement::{Edits, assert_agreement, assert_edits_agree, bits};
pub use precision::Tested;
pub use snell_intersect::{Double, Single};

use snell_intersect::shape::AnyShape;
use snell_intersect::{
    CubicCurves, CurveBasis, GeometryId, GroupId, Instance, InstanceId, LinearCurves, MeshKey,
    MovingMesh, PrimitiveSet, QuadMesh, Spheres, TriangleMesh, WorldBuilder,
};
use snell_math::rng::{hash32, pcg4d, to_unit};
use snell_math::{DAffine3, DMat3, DVec3, Ray, Transform, Vec3, Vec4};
use std::sync::Arc;

/// Bytes that are decoded as numbers; zeros once they are exhausted.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    bytes: &'a [u8],
}

impl<'a> Source<'a> {
    /// A source of these bytes.
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

    /// A coordinate of the order of one: often from a coarse lattice, so that objects touch and
    /// coincide.
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

    /// An extreme number: NaN, infinite, enormous, tiny or zero.
    fn strange(&mut self) -> f32 {
        let values = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            -3e38,
            1e-45,
            f32::MIN_POSITIVE,
            0.0,
            -0.0,
        ];
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
            2 => DMat3::from_diagonal(
                (self.point().as_dvec3() + 0.1).map(|x| if x == 0.0 { 1.0 } else { x }),
            ),
            _ => {
                let axis = self.point().as_dvec3().normalize_or(DVec3::X);
                let scale = DVec3::new(1.0, -0.5, 2.0) * 10f64.powi(self.below(7) as i32 - 3);
                DMat3::from_axis_angle(axis, 1.0) * DMat3::from_diagonal(scale)
            }
        };
        Transform::new(DAffine3 { matrix3: linear, translation: position })
            .unwrap_or(Transform::IDENTITY)
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
        // Few vertices with many triangles give shared edges, fans, and the same triangle twice.
        for _ in 0..1 + self.below(60) {
            mesh.indices.push(std::array::from_fn(|_| self.below(vertices) as u32));
        }
        mesh
    }

    /// A mesh with so many triangles that it is refitted when it moves: strips of three triangles,
    /// small compared to the distances between them.
    fn crowd(&mut self) -> TriangleMesh {
        const STRIPS: u32 = 400;
        let (seed, size) = (self.word(), [0.3, 1e-2, 1e-4, 1e-6][self.below(4)]);
        let mut mesh = TriangleMesh::default();
        for strip in 0..STRIPS {
            let point = |i: u32| {
                let [x, y, z, _] = pcg4d([seed.into(), strip, i, 71]).map(to_unit);
                Vec3::new(x, y, z) * 4.0 - 2.0
            };
            let first = mesh.positions.len() as u32;
            mesh.positions.extend((1..=5).map(|i| point(0) + point(i) * size));
            mesh.indices.extend((0..3).map(|i| [0, 1, 2].map(|k| first + i + k)));
        }
        for _ in 0..self.below(4) {
            let vertex = self.word() as usize % mesh.positions.len();
            mesh.positions[vertex][self.below(3)] = self.strange();
        }
        mesh
    }

    /// Adds a mesh of more than a thousand triangles to the root.
    pub fn add_crowd<P: Tested>(&mut self, all: &mut Collected<P>) {
        let crowd = self.crowd();
        all.add_mesh(WorldBuilder::ROOT, &crowd);
    }

    /// Groups with meshes, shapes and instances of each other, with masks.
    pub fn collected<P: Tested>(&mut self) -> Collected<P> {
        let place =
            if P::PLACES.len() > 1 { P::PLACES[self.below(P::PLACES.len())] } else { DVec3::ZERO };
        let mut all = Collected {
            builder: P::Builder::default(),
            place,
            geometries: Vec::new(),
            meshes: Vec::new(),
            instances: Vec::new(),
        };
        let shapes = AnyShape::examples();
        let count = 1 + self.below(4);
        for index in 0..count {
            let group =
                if index == 0 { WorldBuilder::ROOT } else { P::add_group(&mut all.builder) };
            for _ in 0..self.below(3) {
                let mesh = self.mesh();
                let id = all.add_mesh(group, &mesh);
                if self.below(8) == 0 {
                    P::set_mask(&mut all.builder, id, 1 << self.below(3));
                }
                if self.below(6) == 0 {
                    all.add_mesh(group, &mesh);
                }
            }
            for _ in 0..self.below(4) {
                let shape = shapes[self.below(shapes.len())].clone();
                let placed = all.placed(group, self.transform());
                all.geometries.push(P::add_shape(&mut all.builder, group, shape, placed));
            }
        }
        // Only later groups are instanced in earlier ones, so there are no cycles.
        for child in 1..count {
            for _ in 0..1 + self.below(3) {
                let group = GroupId(self.below(child) as u32);
                let group_from_child = self.transform();
                let mask = if self.below(8) == 0 { 1 << self.below(3) } else { u64::MAX };
                all.add(
                    group,
                    Instance { mask, ..Instance::new(GroupId(child as u32), group_from_child) },
                );
            }
        }
        all
    }

    /// Adds spheres, curves, quads and meshes with moving vertices, each with some probability, to
    /// the root group and to a new group, and a moving instance of the new group.
    pub fn add_sets<P: Tested>(&mut self, all: &mut Collected<P>) {
        let child = P::add_group(&mut all.builder);
        for group in [WorldBuilder::ROOT, child] {
            if self.below(3) > 0 {
                let count = 1 + 40 * self.below(2);
                let spheres = self.balls(count);
                all.add_set(group, Arc::new(Spheres { spheres, ..Spheres::default() }));
            }
            if self.below(3) > 0 {
                let points = self.balls(12);
                all.add_set(group, Arc::new(LinearCurves::chain(points)));
            }
            if self.below(3) > 0 {
                let bases = [
                    CurveBasis::Bezier,
                    CurveBasis::BSpline,
                    CurveBasis::CatmullRom,
                    CurveBasis::Hermite,
                ];
                let basis = bases[self.below(4)];
                let (points, tangents) = (self.balls(12), self.balls(12));
                let segments = (0..9).map(|_| self.below(12) as u32).collect();
                all.add_set(
                    group,
                    Arc::new(CubicCurves { basis, points, tangents, segments, exact: Vec::new() }),
                );
            }
            if self.below(3) > 0 {
                let mesh = self.mesh();
                let quads: Vec<[u32; 4]> = mesh
                    .indices
                    .chunks_exact(2)
                    .map(|t| [t[0][0], t[0][1], t[1][0], t[0][2]])
                    .collect();
                P::add_quads(
                    &mut all.builder,
                    group,
                    QuadMesh::new(mesh, &quads).expect("vertices that exist"),
                );
            }
            if self.below(3) > 0 {
                let mesh = self.mesh();
                let moved = |key: f32| mesh.positions.iter().rev().map(|p| *p * key).collect();
                let later =
                    [0.5, -1.0].map(|key| MeshKey { positions: moved(key), normals: Vec::new() });
                let moving =
                    MovingMesh::new(mesh.clone(), later.to_vec()).expect("as many vertices");
                P::add_moving_mesh(&mut all.builder, group, moving);
            }
        }
        let later = (0..self.below(3)).map(|_| self.transform()).collect();
        all.add(WorldBuilder::ROOT, Instance { later, ..Instance::new(child, self.transform()) });
    }

    /// Makes random edits: vertices move, instances move and vanish, geometries appear, vanish and
    /// are replaced.
    pub fn edit<P: Tested>(&mut self, all: &mut Collected<P>) {
        for _ in 0..1 + self.below(4) {
            match self.below(6) {
                0 | 1 if !all.meshes.is_empty() => {
                    // The last mesh, which may be large, is chosen more often.
                    let at = self.below(2 * all.meshes.len()).min(all.meshes.len() - 1);
                    let (id, group, mut mesh) = all.meshes[at].clone();
                    let (scale, offset) =
                        ([1.0, 1.0, 1.001, -3.0][self.below(4)], self.point() * 0.1);
                    for position in &mut mesh.positions {
                        // Non-finite vertices become finite.
                        *position = if position.is_finite() {
                            *position * scale + offset
                        } else {
                            self.point()
                        };
                    }
                    if self.below(8) == 0 {
                        let vertex = self.word() as usize % mesh.positions.len();
                        mesh.positions[vertex][self.below(3)] = self.strange();
                    }
                    all.set_mesh(id, group, mesh);
                }
                2 if !all.meshes.is_empty() => {
                    let at = self.below(all.meshes.len());
                    let (id, group, _) = all.meshes[at];
                    all.set_mesh(id, group, self.mesh());
                }
                3 if !all.instances.is_empty() => {
                    let (id, group) = all.instances[self.below(all.instances.len())];
                    if self.below(3) == 0 {
                        P::remove_instance(&mut all.builder, id);
                    } else {
                        let placed = all.placed(group, self.transform());
                        P::move_instance(&mut all.builder, id, placed);
                    }
                }
                4 if !all.geometries.is_empty() => {
                    let id = all.geometries[self.below(all.geometries.len())];
                    P::remove(&mut all.builder, id);
                }
                _ => {
                    all.add_mesh(WorldBuilder::ROOT, &self.mesh());
                }
            }
        }
    }

    /// Random points with radii.
    fn balls(&mut self, count: usize) -> Vec<Vec4> {
        let ball = |_| {
            let radius = self.coordinate().abs() * 0.3;
            let ball = self.point().extend(radius);
            if self.below(40) == 39 { ball.with_w(self.strange()) } else { ball }
        };
        (0..count).map(ball).collect()
    }

    /// A ray that is aimed at an object, runs along an axis or through lattice points, or is
    /// invalid.
    pub fn ray(&mut self) -> Ray {
        let origin = self.point() * if self.below(3) == 0 { 4.0 } else { 1.0 };
        let mut ray = Ray::new(origin, self.point() - origin);
        match self.below(8) {
            0 => {
                ray.direction =
                    [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z][self.below(6)]
            }
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

    /// A ray at a vertex, an edge or the middle of a triangle in the root group; [`Self::ray`] if
    /// there is none.
    pub fn aimed_ray<P: Tested>(&mut self, all: &Collected<P>) -> P::Ray {
        let meshes: Vec<_> =
            all.meshes.iter().filter(|(_, group, _)| *group == WorldBuilder::ROOT).collect();
        if meshes.is_empty() {
            return P::ray(&self.ray(), all.place);
        }
        let (_, _, mesh) = meshes[self.below(meshes.len())];
        let triangle = mesh.indices[self.word() as usize % mesh.indices.len()];
        let third = 1.0 / 3.0;
        let barycentrics =
            [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.0, 0.25, 0.75], [third, third, third]]
                [self.below(4)];
        P::ray_to(mesh, triangle, barycentrics, self.point(), all.place)
    }

    /// A random mask, mostly with all bits set.
    pub fn mask(&mut self) -> u64 {
        if self.below(4) == 0 { self.byte().into() } else { u64::MAX }
    }
}

/// `count` pseudo-random bytes from a seed.
pub fn random_bytes(seed: u32, count: usize) -> Vec<u8> {
    let words = (0..count.div_ceil(16) as u32).flat_map(|i| pcg4d([hash32(seed), i, 23, 5]));
    words.flat_map(u32::to_le_bytes).take(count).collect()
}

/// A builder, with lists of what was added to it.
#[derive(Clone, Debug)]
pub struct Collected<P: Tested> {
    /// The builder.
    pub builder: P::Builder,
    /// The position of the root group's objects.
    pub place: DVec3,
    geometries: Vec<GeometryId>,
    /// The meshes, with their groups, before they were moved to `place`.
    meshes: Vec<(GeometryId, GroupId, TriangleMesh)>,
    /// Instances and their groups.
    instances: Vec<(InstanceId, GroupId)>,
}

impl<P: Tested> Collected<P> {
    fn place_of(&self, group: GroupId) -> DVec3 {
        if group == WorldBuilder::ROOT { self.place } else { DVec3::ZERO }
    }

    fn placed(&self, group: GroupId, transform: Transform) -> Transform {
        let mut placed = *transform.matrix();
        placed.translation += self.place_of(group);
        Transform::new(placed).unwrap_or(transform)
    }

    fn add_mesh(&mut self, group: GroupId, mesh: &TriangleMesh) -> GeometryId {
        let moved = P::mesh(mesh, self.place_of(group));
        let id = P::add_mesh(&mut self.builder, group, moved);
        self.geometries.push(id);
        self.meshes.push((id, group, mesh.clone()));
        id
    }

    /// Replaces a mesh, unless it was removed.
    fn set_mesh(&mut self, id: GeometryId, group: GroupId, mesh: TriangleMesh) {
        let moved = P::mesh(&mesh, self.place_of(group));
        if P::set_mesh(&mut self.builder, id, moved).is_ok() {
            self.meshes.iter_mut().filter(|m| m.0 == id).for_each(|m| m.2 = mesh.clone());
        }
    }

    fn add_set(&mut self, group: GroupId, set: Arc<dyn PrimitiveSet>) {
        self.geometries.push(P::add_set(&mut self.builder, group, set));
    }

    fn add(&mut self, group: GroupId, mut instance: Instance) {
        instance.group_from_child = self.placed(group, instance.group_from_child);
        for later in &mut instance.later {
            *later = self.placed(group, *later);
        }
        self.instances.push((P::add(&mut self.builder, group, instance), group));
    }
}
