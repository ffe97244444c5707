//! Operations for both `float32` and `float64`: one trait, implemented by the two number types.

use crate::assemble::{Builder, Form};
use crate::choice::Selected;
use crate::mesh::Mesh;
use numpy::Element;
use snell_intersect::BuildStats;
use snell_intersect::{
    AllHits, AnyShape, BuildOptions, Culled, Curves, DHit, DWorld, DWorldBuilder, Double,
    GeometryId, GroupId, Grouping, Heightfield, Hit, HitFilter, Instance, Rays, Side, Single,
    Spheres, World, WorldBuilder, WorldError,
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

    /// The hit with these data.
    fn hit(found: &Found<Self>) -> Self::Hit;

    /// Finds the nearest hit of each ray.
    fn closest(
        world: &Self::World,
        rays: Rays<Self::Tag>,
        grouping: Grouping,
        filter: &dyn HitFilter<Self::Tag>,
        hits: &mut [Self::Hit],
    );

    /// For each ray, true if it hits anything.
    fn occluded(
        world: &Self::World,
        rays: Rays<Self::Tag>,
        grouping: Grouping,
        filter: &dyn HitFilter<Self::Tag>,
        blocked: &mut [bool],
    );

    /// Counts the hits of each ray, up to `most` if it is given.
    fn count(
        world: &Self::World,
        rays: Rays<Self::Tag>,
        filter: &dyn HitFilter<Self::Tag>,
        most: Option<u32>,
        counts: &mut [u32],
    );

    /// Finds all hits of each ray, or the first `most` of them.
    fn all(
        world: &Self::World,
        rays: Rays<Self::Tag>,
        filter: &dyn HitFilter<Self::Tag>,
        most: Option<u32>,
    ) -> AllHits<Self::Tag>;

    /// The origins of rays that leave the hits in these directions; see [`World::spawn`].
    fn spawn(
        world: &Self::World,
        rays: Rays<Self::Tag>,
        filter: &dyn HitFilter<Self::Tag>,
        hits: &[Self::Hit],
        directions: &[DVec3],
        origins: &mut [DVec3],
    );

    /// The filter that ignores hits on one side of surfaces.
    fn culled(world: &Self::World, side: Side) -> Box<dyn HitFilter<Self::Tag> + '_>;

    /// The filter of a choice of objects.
    fn selected(selected: Selected<'_>) -> Box<dyn HitFilter<Self::Tag> + '_>;
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

    fn hit(found: &Found<f32>) -> Hit {
        let &Found { t, uv, occurrence, geometry, primitive } = found;
        Hit { t, uv: uv.into(), instance: occurrence, geometry, primitive }
    }

    fn closest(
        world: &World,
        rays: Rays,
        grouping: Grouping,
        filter: &dyn HitFilter,
        hits: &mut [Hit],
    ) {
        world.closest(rays, grouping, filter, hits);
    }

    fn occluded(
        world: &World,
        rays: Rays,
        grouping: Grouping,
        filter: &dyn HitFilter,
        blocked: &mut [bool],
    ) {
        world.occluded(rays, grouping, filter, blocked);
    }

    fn count(
        world: &World,
        rays: Rays,
        filter: &dyn HitFilter,
        most: Option<u32>,
        counts: &mut [u32],
    ) {
        match most {
            Some(most) => world.count_to(rays, filter, most, counts),
            None => world.count(rays, filter, counts),
        }
    }

    fn all(world: &World, rays: Rays, filter: &dyn HitFilter, most: Option<u32>) -> AllHits {
        match most {
            Some(most) => world.first(rays, filter, most as usize),
            None => world.all(rays, filter),
        }
    }

    fn spawn(
        world: &World,
        rays: Rays,
        filter: &dyn HitFilter,
        hits: &[Hit],
        directions: &[DVec3],
        origins: &mut [DVec3],
    ) {
        world.spawn(rays, filter, hits, directions, origins);
    }

    fn culled(world: &World, side: Side) -> Box<dyn HitFilter + '_> {
        Box::new(Culled::new(world, side))
    }

    fn selected(selected: Selected<'_>) -> Box<dyn HitFilter + '_> {
        Box::new(selected)
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

    fn hit(found: &Found<f64>) -> DHit {
        let &Found { t, uv, occurrence, geometry, primitive } = found;
        DHit { t, uv: uv.into(), instance: occurrence, geometry, primitive }
    }

    fn closest(
        world: &DWorld,
        rays: Rays<Double>,
        grouping: Grouping,
        filter: &dyn HitFilter<Double>,
        hits: &mut [DHit],
    ) {
        world.closest(rays, grouping, filter, hits);
    }

    fn occluded(
        world: &DWorld,
        rays: Rays<Double>,
        grouping: Grouping,
        filter: &dyn HitFilter<Double>,
        blocked: &mut [bool],
    ) {
        world.occluded(rays, grouping, filter, blocked);
    }

    fn count(
        world: &DWorld,
        rays: Rays<Double>,
        filter: &dyn HitFilter<Double>,
        most: Option<u32>,
        counts: &mut [u32],
    ) {
        match most {
            Some(most) => world.count_to(rays, filter, most, counts),
            None => world.count(rays, filter, counts),
        }
    }

    fn all(
        world: &DWorld,
        rays: Rays<Double>,
        filter: &dyn HitFilter<Double>,
        most: Option<u32>,
    ) -> AllHits<Double> {
        match most {
            Some(most) => world.first(rays, filter, most as usize),
            None => world.all(rays, filter),
        }
    }

    fn spawn(
        world: &DWorld,
        rays: Rays<Double>,
        filter: &dyn HitFilter<Double>,
        hits: &[DHit],
        directions: &[DVec3],
        origins: &mut [DVec3],
    ) {
        world.spawn(rays, filter, hits, directions, origins);
    }

    fn culled(world: &DWorld, side: Side) -> Box<dyn HitFilter<Double> + '_> {
        Box::new(Culled::new(world, side))
    }

    fn selected(selected: Selected<'_>) -> Box<dyn HitFilter<Double> + '_> {
        Box::new(selected)
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

    fn add_heightfield(&mut self, group: GroupId, field: &Arc<Heightfield>) -> GeometryId {
        self.add_heightfield(group, field.clone())
    }

    fn add_gap(&mut self) {
        let gap = self.add_mesh(Self::ROOT, Arc::default());
        self.remove(gap);
    }

    fn add(&mut self, group: GroupId, instance: Instance) {
        self.add(group, instance);
    }

    fn set_mask(&mut self, geometry: GeometryId, mask: u64) {
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

    fn add_heightfield(&mut self, group: GroupId, field: &Arc<Heightfield>) -> GeometryId {
        self.add_heightfield(group, field.clone())
    }

    fn add_gap(&mut self) {
        let gap = self.add_mesh(Self::ROOT, Arc::default());
        self.remove(gap);
    }

    fn add(&mut self, group: GroupId, instance: Instance) {
        self.add(group, instance);
    }

    fn set_mask(&mut self, geometry: GeometryId, mask: u64) {
        self.set_mask(geometry, mask);
    }
}
