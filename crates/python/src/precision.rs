//! Operations for both `float32` and `float64`: one trait, implemented by the two number types.

use crate::assemble::{Builder, Form};
use crate::mesh::Mesh;
use numpy::Element;
use snell_intersect::BuildStats;
use snell_intersect::{
    AcceptAll, AllHits, AnyShape, BuildOptions, Curves, DHit, DWorld, DWorldBuilder, Double,
    GeometryId, GroupId, Grouping, Hit, Instance, Rays, Single, Spheres, World, WorldBuilder,
    WorldError,
};
use snell_math::{DRay, DVec3, Ray, Transform, Vec3};
use std::sync::Arc;

/// The data of a hit: distance, parameters, and the world's ids of occurrence, geometry and
/// primitive.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found<P> {
    /// The ray parameter, in units of the direction's length; infinite for a miss.
    pub t: P,
    /// Barycentric coordinates in a triangle.
    pub uv: [P; 2],
    /// Number of the occurrence in the world.
    pub occurrence: u32,
    /// Number of the geometry in the world; [`Hit::NONE`] for a miss.
    pub geometry: u32,
    /// Number of the primitive in the geometry.
    pub primitive: u32,
}

/// The precision of a query: `f32` or `f64`.
pub trait Precision:
    Form + Element + Copy + Default + PartialEq + Into<f64> + Send + Sync + 'static
{
    /// The marker type of this precision in `snell_intersect`.
    type Tag: snell_intersect::Precision<Ray = Self::Ray, Hit = Self::Hit>;
    /// The type of rays in this precision.
    type Ray: Copy + Send + Sync;
    /// The type of hits in this precision.
    type Hit: Copy + Send + Sync + Default;

    /// Rounds to this precision.
    fn round(x: f64) -> Self;

    /// Makes a ray.
    fn ray(origin: [Self; 3], direction: [Self; 3], interval: [Self; 2]) -> Self::Ray;

    /// True if the ray can hit anything.
    fn is_valid(ray: &Self::Ray) -> bool;

    /// The ray in double precision.
    fn exact(ray: &Self::Ray) -> DRay;

    /// The data of a hit.
    fn found(hit: &Self::Hit) -> Found<Self>;

    /// Statistics of the acceleration structures.
    fn stats(world: &Self::World) -> &BuildStats;

    /// Finds the nearest hit of each ray.
    fn closest(
        world: &Self::World,
        rays: Rays<Self::Tag>,
        grouping: Grouping,
        hits: &mut [Self::Hit],
    );

    /// For each ray, true if it hits anything.
    fn occluded(
        world: &Self::World,
        rays: Rays<Self::Tag>,
        grouping: Grouping,
        blocked: &mut [bool],
    );

    /// Counts the hits of each ray.
    fn count(world: &Self::World, rays: Rays<Self::Tag>, counts: &mut [u32]);

    /// Finds all hits of each ray.
    fn all(world: &Self::World, rays: Rays<Self::Tag>) -> AllHits<Self::Tag>;
}

impl Form for f32 {
    type World = World;
    type Builder = WorldBuilder;

    fn build(
        builder: WorldBuilder,
        options: &BuildOptions,
        previous: Option<&World>,
    ) -> Result<World, WorldError> {
        match previous {
            Some(previous) => builder.rebuild(options, previous),
            None => builder.build(options),
        }
    }

    fn placed(world: &World, occurrence: u32, time: f32) -> Transform {
        world.world_from_instance_at(occurrence, time)
    }
}

impl Form for f64 {
    type World = DWorld;
    type Builder = DWorldBuilder;

    fn build(
        builder: DWorldBuilder,
        options: &BuildOptions,
        previous: Option<&DWorld>,
    ) -> Result<DWorld, WorldError> {
        match previous {
            Some(previous) => builder.rebuild(options, previous),
            None => builder.build(options),
        }
    }

    fn placed(world: &DWorld, occurrence: u32, time: f32) -> Transform {
        world.world_from_instance_at(occurrence, time)
    }
}

impl Precision for f32 {
    type Tag = Single;
    type Ray = Ray;
    type Hit = Hit;

    fn round(x: f64) -> Self {
        x as f32
    }

    #[inline(always)]
    fn ray(origin: [f32; 3], direction: [f32; 3], [t_min, t_max]: [f32; 2]) -> Ray {
        Ray {
            origin: Vec3::from_array(origin),
            direction: Vec3::from_array(direction),
            t_min,
            t_max,
        }
    }

    fn is_valid(ray: &Ray) -> bool {
        ray.is_valid()
    }

    fn exact(ray: &Ray) -> DRay {
        DRay::from(ray)
    }

    #[inline(always)]
    fn found(hit: &Hit) -> Found<f32> {
        let &Hit { t, uv, instance, geometry, primitive } = hit;
        Found { t, uv: uv.to_array(), occurrence: instance, geometry, primitive }
    }

    fn stats(world: &World) -> &BuildStats {
        world.stats()
    }

    fn closest(world: &World, rays: Rays, grouping: Grouping, hits: &mut [Hit]) {
        world.closest(rays, grouping, &AcceptAll, hits);
    }

    fn occluded(world: &World, rays: Rays, grouping: Grouping, blocked: &mut [bool]) {
        world.occluded(rays, grouping, &AcceptAll, blocked);
    }

    fn count(world: &World, rays: Rays, counts: &mut [u32]) {
        world.count(rays, &AcceptAll, counts);
    }

    fn all(world: &World, rays: Rays) -> AllHits {
        world.all(rays, &AcceptAll)
    }
}

impl Precision for f64 {
    type Tag = Double;
    type Ray = DRay;
    type Hit = DHit;

    fn round(x: f64) -> Self {
        x
    }

    #[inline(always)]
    fn ray(origin: [f64; 3], direction: [f64; 3], [t_min, t_max]: [f64; 2]) -> DRay {
        DRay {
            origin: DVec3::from_array(origin),
            direction: DVec3::from_array(direction),
            t_min,
            t_max,
        }
    }

    fn is_valid(ray: &DRay) -> bool {
        ray.is_valid()
    }

    fn exact(ray: &DRay) -> DRay {
        *ray
    }

    #[inline(always)]
    fn found(hit: &DHit) -> Found<f64> {
        let &DHit { t, uv, instance, geometry, primitive } = hit;
        Found { t, uv: uv.to_array(), occurrence: instance, geometry, primitive }
    }

    fn stats(world: &DWorld) -> &BuildStats {
        world.stats()
    }

    fn closest(world: &DWorld, rays: Rays<Double>, grouping: Grouping, hits: &mut [DHit]) {
        world.closest(rays, grouping, &AcceptAll, hits);
    }

    fn occluded(world: &DWorld, rays: Rays<Double>, grouping: Grouping, blocked: &mut [bool]) {
        world.occluded(rays, grouping, &AcceptAll, blocked);
    }

    fn count(world: &DWorld, rays: Rays<Double>, counts: &mut [u32]) {
        world.count(rays, &AcceptAll, counts);
    }

    fn all(world: &DWorld, rays: Rays<Double>) -> AllHits<Double> {
        world.all(rays, &AcceptAll)
    }
}

impl Builder for WorldBuilder {
    fn add_group(&mut self) -> GroupId {
        self.add_group()
    }

    fn add_mesh(&mut self, group: GroupId, mesh: &Mesh) -> GeometryId {
        self.add_mesh(group, mesh.single().clone())
    }

    fn add_shape(
        &mut self,
        group: GroupId,
        shape: &Arc<AnyShape>,
        placed: Transform,
    ) -> GeometryId {
        self.add_shape(group, shape.clone(), placed)
    }

    fn add_spheres(&mut self, group: GroupId, spheres: &Arc<Spheres>) -> GeometryId {
        self.add_set(group, spheres.clone())
    }

    fn add_curves(&mut self, group: GroupId, curves: &Arc<Curves>) -> GeometryId {
        self.add_set(group, curves.clone())
    }

    fn add_gap(&mut self) {
        let gap = self.add_mesh(Self::ROOT, Arc::default());
        self.remove(gap);
    }

    fn add(&mut self, group: GroupId, instance: Instance) {
        self.add(group, instance);
    }

    fn set_mask(&mut self, geometry: GeometryId, mask: u32) {
        self.set_mask(geometry, mask);
    }
}

impl Builder for DWorldBuilder {
    fn add_group(&mut self) -> GroupId {
        self.add_group()
    }

    fn add_mesh(&mut self, group: GroupId, mesh: &Mesh) -> GeometryId {
        self.add_mesh(group, mesh.double().clone())
    }

    fn add_shape(
        &mut self,
        group: GroupId,
        shape: &Arc<AnyShape>,
        placed: Transform,
    ) -> GeometryId {
        self.add_shape(group, shape.clone(), placed)
    }

    fn add_spheres(&mut self, group: GroupId, spheres: &Arc<Spheres>) -> GeometryId {
        self.add_set(group, spheres.clone())
    }

    fn add_curves(&mut self, group: GroupId, curves: &Arc<Curves>) -> GeometryId {
        self.add_set(group, curves.clone())
    }

    fn add_gap(&mut self) {
        let gap = self.add_mesh(Self::ROOT, Arc::default());
        self.remove(gap);
    }

    fn add(&mut self, group: GroupId, instance: Instance) {
        self.add(group, instance);
    }

    fn set_mask(&mut self, geometry: GeometryId, mask: u32) {
        self.set_mask(geometry, mask);
    }
}
