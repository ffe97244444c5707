//! Nearest points, and which side of the surfaces points are on.
//!
//! Single precision asks the same world as rays do. In double precision, points are not rounded; meshes with `float64` vertices are
//! searched in single precision around their own centre ([`Local`]), and the point found is then computed from the vertices as they are. So it
//! lies on the surface to double precision, and is the nearest to within `2^-23` of the size of the mesh.

use crate::assemble::{Form, MeshForm, Names, Surface};
use crate::mesh::Mesh;
use crate::precision::Found;
use numpy::Element;
use snell_intersect::shape::nearest::on_triangle;
use snell_intersect::{BuildOptions, DNearestPoint, Metric, NearestPoint, Points, World, WorldBuilder, WorldError};
use snell_math::{DVec3, Transform, Vec3};

/// Worlds for points in double precision: meshes given so are a group of their own, with their centre at its origin.
#[derive(Debug)]
pub struct Local;

impl Form for Local {
    type World = World;
    type Builder = WorldBuilder;
    const MESHES: MeshForm = MeshForm::Centered;

    fn build(builder: WorldBuilder, options: &BuildOptions, previous: Option<&World>) -> Result<World, WorldError> {
        <f32 as Form>::build(builder, options, previous)
    }

    fn center(mesh: &Mesh) -> DVec3 {
        mesh.center()
    }

    fn placed(world: &World, occurrence: u32) -> Transform {
        world.world_from_instance(occurrence)
    }
}

/// A nearest point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nearest<P> {
    /// Distance, parameters and numbers, as of a hit.
    pub found: Found<P>,
    /// In world coordinates.
    pub position: [P; 3],
}

/// `f32` or `f64`, for points.
pub trait PointPrecision: crate::precision::Precision + Element {
    /// Which world is asked.
    type Form: Form<World = World>;

    /// The nearest point of a surface.
    fn nearest(world: &World, names: &Names, point: [Self; 3], limit: Self, mask: u32) -> Nearest<Self>;

    /// Whether a point is inside.
    fn is_inside(world: &World, point: [Self; 3]) -> bool {
        world.is_inside(DVec3::from_array(point.map(Into::into)))
    }
}

impl PointPrecision for f32 {
    type Form = f32;

    fn nearest(world: &World, _: &Names, point: [f32; 3], limit: f32, mask: u32) -> Nearest<f32> {
        let point = [Vec3::from_array(point)];
        let mut nearest = [NearestPoint::NONE];
        world.nearest_point(Points { max_distance: limit, mask, ..Points::new(&point) }, &mut nearest);
        let NearestPoint { distance, position, uv, instance, geometry, primitive } = nearest[0];
        let found = Found { t: distance, uv: uv.to_array(), occurrence: instance, geometry, primitive };
        let position = if nearest[0].is_found() { position } else { Vec3::NAN };
        Nearest { found, position: position.to_array() }
    }
}

impl PointPrecision for f64 {
    type Form = Local;

    fn nearest(world: &World, names: &Names, point: [f64; 3], limit: f64, mask: u32) -> Nearest<f64> {
        let point = DVec3::from_array(point);
        // What is exactly at the limit may be beyond it for a mesh that is rounded.
        let near = world.nearest_point_at(point, limit, mask);
        let (mut distance, mut position, mut uv) = (near.distance, near.position, near.uv.as_dvec2());
        if !near.is_found() {
            position = DVec3::NAN;
        } else if let Some(Surface::Mesh(mesh)) = names.surfaces.get(near.geometry as usize)
            && mesh.is_double()
        {
            let placed = world.world_from_instance(near.instance).compose(&Transform::translation(-mesh.center()));
            // In the coordinates of the world, from the point: what is near is exact.
            let corners = mesh.corners(near.primitive as usize).map(|p| placed.point(p) - point);
            let (offset, barycentrics) = on_triangle(&Metric::EUCLIDEAN, DVec3::ZERO, &corners);
            (distance, position, uv) = (offset.length(), point + offset, barycentrics);
        }
        let DNearestPoint { instance, geometry, primitive, .. } = near;
        let found = Found { t: distance, uv: uv.to_array(), occurrence: instance, geometry, primitive };
        Nearest { found, position: position.to_array() }
    }
}
