//! The common interface of worlds in either precision, so that one test serves both.

use snell_intersect::shape::AnyShape;
use snell_intersect::{
    AcceptAll, BuildOptions, DHit, DTriangleMesh, DWorld, DWorldBuilder, Double, EditError,
    Geometry, GeometryId, GroupId, Grouping, Hit, Instance, InstanceId, MovingMesh, Precision,
    PrimitiveSet, QuadMesh, RayQuery, Rays, Single, TriangleMesh, World, WorldBuilder, WorldError,
};
use snell_math::{DRay, DVec3, Ray, Transform, Vec3};
use std::sync::Arc;

/// How worlds of a precision are built and queried.
pub trait Tested: Precision {
    /// The builder of worlds in this precision.
    type Builder: Clone + Default;
    /// Worlds in this precision.
    type World;
    /// Meshes in this precision.
    type Mesh;
    /// The answer for a ray that misses.
    const MISS: Self::Hit;
    /// Positions to which the objects of the root group are moved.
    const PLACES: &'static [DVec3];

    /// The mesh in this precision, moved.
    fn mesh(mesh: &TriangleMesh, place: DVec3) -> Arc<Self::Mesh>;

    /// The ray in this precision, moved.
    fn ray(ray: &Ray, place: DVec3) -> Self::Ray;

    /// A ray from an origin to the point of a triangle with these barycentric coordinates, in a
    /// mesh of the root group.
    fn ray_to(
        mesh: &TriangleMesh,
        triangle: [u32; 3],
        barycentrics: [f64; 3],
        from: Vec3,
        place: DVec3,
    ) -> Self::Ray;

    /// [`WorldBuilder::add_group`].
    fn add_group(builder: &mut Self::Builder) -> GroupId;

    /// [`WorldBuilder::add_mesh`].
    fn add_mesh(builder: &mut Self::Builder, group: GroupId, mesh: Arc<Self::Mesh>) -> GeometryId;

    /// Replaces a mesh.
    fn set_mesh(
        builder: &mut Self::Builder,
        id: GeometryId,
        mesh: Arc<Self::Mesh>,
    ) -> Result<(), EditError>;

    /// [`WorldBuilder::add_quads`]; does nothing in a precision without quads.
    fn add_quads(_builder: &mut Self::Builder, _group: GroupId, _quads: QuadMesh) {}

    /// [`WorldBuilder::add_moving_mesh`]; does nothing in a precision without moving meshes.
    fn add_moving_mesh(_builder: &mut Self::Builder, _group: GroupId, _mesh: MovingMesh) {}

    /// [`WorldBuilder::add_shape`].
    fn add_shape(
        builder: &mut Self::Builder,
        group: GroupId,
        shape: AnyShape,
        placed: Transform,
    ) -> GeometryId;

    /// [`WorldBuilder::add_set`].
    fn add_set(
        builder: &mut Self::Builder,
        group: GroupId,
        set: Arc<dyn PrimitiveSet>,
    ) -> GeometryId;

    /// [`WorldBuilder::add`].
    fn add(builder: &mut Self::Builder, group: GroupId, instance: Instance) -> InstanceId;

    /// [`WorldBuilder::set_mask`].
    fn set_mask(builder: &mut Self::Builder, id: GeometryId, mask: u64);

    /// [`WorldBuilder::remove`].
    fn remove(builder: &mut Self::Builder, id: GeometryId) -> bool;

    /// [`WorldBuilder::move_instance`].
    fn move_instance(builder: &mut Self::Builder, id: InstanceId, placed: Transform) -> bool;

    /// [`WorldBuilder::remove_instance`].
    fn remove_instance(builder: &mut Self::Builder, id: InstanceId) -> bool;

    /// [`WorldBuilder::build`].
    fn build(builder: &Self::Builder, options: &BuildOptions) -> Result<Self::World, WorldError>;

    /// [`WorldBuilder::rebuild`].
    fn rebuild(
        builder: &Self::Builder,
        options: &BuildOptions,
        last: &Self::World,
    ) -> Result<Self::World, WorldError>;

    /// The number of trees that were refitted for the world.
    fn refitted(world: &Self::World) -> usize;

    /// [`World::all_one`].
    fn all_one(world: &Self::World, ray: RayQuery<Self>) -> Vec<Self::Hit>;

    /// [`World::closest_one`].
    fn closest_one(world: &Self::World, ray: RayQuery<Self>) -> Self::Hit;

    /// [`World::occluded_one`].
    fn occluded_one(world: &Self::World, ray: RayQuery<Self>) -> bool;

    /// [`World::closest`].
    fn closest(world: &Self::World, rays: Rays<Self>, grouping: Grouping, hits: &mut [Self::Hit]);

    /// [`World::occluded`].
    fn occluded(world: &Self::World, rays: Rays<Self>, grouping: Grouping, blocked: &mut [bool]);

    /// [`World::count`].
    fn count(world: &Self::World, rays: Rays<Self>, counts: &mut [u32]);

    /// All fields of a hit, for bitwise comparison.
    fn bits(hit: &Self::Hit) -> [u64; 6];
}

fn weighted(corners: [DVec3; 3], [a, b, c]: [f64; 3]) -> DVec3 {
    corners[0] * a + corners[1] * b + corners[2] * c
}

/// The methods that have the same form in both precisions.
macro_rules! worlds {
    ($builder:ty, $world:ty, $hit:ty, $mesh:ty) => {
        type Builder = $builder;
        type World = $world;
        type Mesh = $mesh;
        const MISS: $hit = <$hit>::MISS;

        fn add_group(builder: &mut $builder) -> GroupId {
            builder.add_group()
        }

        fn add_mesh(builder: &mut $builder, group: GroupId, mesh: Arc<$mesh>) -> GeometryId {
            builder.add_mesh(group, mesh)
        }

        fn add_shape(
            builder: &mut $builder,
            group: GroupId,
            shape: AnyShape,
            placed: Transform,
        ) -> GeometryId {
            builder.add_shape(group, Arc::new(shape), placed)
        }

        fn add_set(
            builder: &mut $builder,
            group: GroupId,
            set: Arc<dyn PrimitiveSet>,
        ) -> GeometryId {
            builder.add_set(group, set)
        }

        fn add(builder: &mut $builder, group: GroupId, instance: Instance) -> InstanceId {
            builder.add(group, instance)
        }

        fn set_mask(builder: &mut $builder, id: GeometryId, mask: u64) {
            builder.set_mask(id, mask);
        }

        fn remove(builder: &mut $builder, id: GeometryId) -> bool {
            builder.remove(id)
        }

        fn move_instance(builder: &mut $builder, id: InstanceId, placed: Transform) -> bool {
            builder.move_instance(id, placed)
        }

        fn remove_instance(builder: &mut $builder, id: InstanceId) -> bool {
            builder.remove_instance(id)
        }

        fn build(builder: &$builder, options: &BuildOptions) -> Result<$world, WorldError> {
            builder.clone().build(options)
        }

        fn rebuild(
            builder: &$builder,
            options: &BuildOptions,
            last: &$world,
        ) -> Result<$world, WorldError> {
            builder.rebuild(options, last)
        }

        fn refitted(world: &$world) -> usize {
            world.stats().reuse.refitted
        }

        fn all_one(world: &$world, ray: RayQuery<Self>) -> Vec<$hit> {
            world.all_one(ray, &AcceptAll)
        }

        fn closest_one(world: &$world, ray: RayQuery<Self>) -> $hit {
            world.closest_one(ray, &AcceptAll)
        }

        fn occluded_one(world: &$world, ray: RayQuery<Self>) -> bool {
            world.occluded_one(ray, &AcceptAll)
        }

        fn closest(world: &$world, rays: Rays<Self>, grouping: Grouping, hits: &mut [$hit]) {
            world.closest(rays, grouping, &AcceptAll, hits);
        }

        fn occluded(world: &$world, rays: Rays<Self>, grouping: Grouping, blocked: &mut [bool]) {
            world.occluded(rays, grouping, &AcceptAll, blocked);
        }

        fn count(world: &$world, rays: Rays<Self>, counts: &mut [u32]) {
            world.count(rays, &AcceptAll, counts);
        }
    };
}

impl Tested for Single {
    worlds!(WorldBuilder, World, Hit, TriangleMesh);
    const PLACES: &'static [DVec3] = &[DVec3::ZERO];

    fn mesh(mesh: &TriangleMesh, _: DVec3) -> Arc<TriangleMesh> {
        Arc::new(mesh.clone())
    }

    fn ray(ray: &Ray, _: DVec3) -> Ray {
        *ray
    }

    fn ray_to(
        mesh: &TriangleMesh,
        triangle: [u32; 3],
        barycentrics: [f64; 3],
        from: Vec3,
        _: DVec3,
    ) -> Ray {
        let corners = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
        Ray::new(from, weighted(corners, barycentrics).as_vec3() - from)
    }

    fn set_mesh(
        builder: &mut WorldBuilder,
        id: GeometryId,
        mesh: Arc<TriangleMesh>,
    ) -> Result<(), EditError> {
        builder.replace(id, Geometry::Mesh(mesh))
    }

    fn add_quads(builder: &mut WorldBuilder, group: GroupId, quads: QuadMesh) {
        builder.add_quads(group, Arc::new(quads));
    }

    fn add_moving_mesh(builder: &mut WorldBuilder, group: GroupId, mesh: MovingMesh) {
        builder.add_moving_mesh(group, Arc::new(mesh));
    }

    fn bits(hit: &Hit) -> [u64; 6] {
        super::bits(hit).map(u64::from)
    }
}

/// A factor on coordinates whose result `f32` cannot represent.
const FINE: f64 = 1.0 + 1e-9;

impl Tested for Double {
    worlds!(DWorldBuilder, DWorld, DHit, DTriangleMesh);
    /// The second place is in a city, in metres of UTM.
    const PLACES: &'static [DVec3] = &[DVec3::ZERO, DVec3::new(500_000.123, 4_649_776.22, 300.0)];

    fn mesh(mesh: &TriangleMesh, place: DVec3) -> Arc<DTriangleMesh> {
        let mut mesh = DTriangleMesh::from(mesh);
        mesh.positions.iter_mut().for_each(|p| *p = *p * FINE + place);
        Arc::new(mesh)
    }

    fn ray(ray: &Ray, place: DVec3) -> DRay {
        let ray = DRay::from(ray);
        DRay { origin: ray.origin * FINE + place, ..ray }
    }

    fn ray_to(
        mesh: &TriangleMesh,
        triangle: [u32; 3],
        barycentrics: [f64; 3],
        from: Vec3,
        place: DVec3,
    ) -> DRay {
        let corners = triangle.map(|i| mesh.positions[i as usize].as_dvec3() * FINE + place);
        let from = from.as_dvec3() * FINE + place;
        DRay::new(from, weighted(corners, barycentrics) - from)
    }

    fn set_mesh(
        builder: &mut DWorldBuilder,
        id: GeometryId,
        mesh: Arc<DTriangleMesh>,
    ) -> Result<(), EditError> {
        builder.set_mesh(id, mesh)
    }

    fn bits(hit: &DHit) -> [u64; 6] {
        let ids = [hit.instance, hit.geometry, hit.primitive].map(u64::from);
        [hit.t.to_bits(), hit.uv.x.to_bits(), hit.uv.y.to_bits(), ids[0], ids[1], ids[2]]
    }
}
