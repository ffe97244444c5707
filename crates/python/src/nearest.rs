//! Nearest points, insideness and winding numbers: each precision uses the same world as its rays.

use crate::precision::Found;
use numpy::Element;
use snell_intersect::{DNearestPoint, DWorld, NearestPoint, Points, World};
use snell_math::{DVec3, Vec3};

/// A nearest point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nearest<P> {
    /// Distance, parameters and ids, as for a hit.
    pub found: Found<P>,
    /// The point in world coordinates.
    pub position: [P; 3],
}

/// The precision of points: `f32` or `f64`.
pub trait PointPrecision: crate::precision::Precision + Element {
    /// The nearest point of a surface within the distance `limit`.
    fn nearest(world: &Self::World, point: [Self; 3], limit: Self, mask: u32) -> Nearest<Self>;

    /// True if a point is inside: its winding number exceeds 0.5.
    fn is_inside(world: &Self::World, point: [Self; 3]) -> bool;

    /// The winding number around a point.
    fn winding_number(world: &Self::World, point: [Self; 3]) -> f64;

    /// Prepares the world for winding numbers.
    fn prepare(world: &Self::World);
}

impl PointPrecision for f32 {
    fn nearest(world: &World, point: [f32; 3], limit: f32, mask: u32) -> Nearest<f32> {
        let (point, mut nearest) = ([Vec3::from_array(point)], [NearestPoint::NONE]);
        world.nearest_point(
            Points { max_distance: limit, mask, ..Points::new(&point) },
            &mut nearest,
        );
        let NearestPoint { distance, position, uv, instance, geometry, primitive } = nearest[0];
        let found =
            Found { t: distance, uv: uv.to_array(), occurrence: instance, geometry, primitive };
        let position = if nearest[0].is_found() { position } else { Vec3::NAN };
        Nearest { found, position: position.to_array() }
    }

    fn is_inside(world: &World, point: [f32; 3]) -> bool {
        let mut inside = [false];
        world.occupancy(&[Vec3::from_array(point)], &mut inside);
        inside[0]
    }

    fn winding_number(world: &World, point: [f32; 3]) -> f64 {
        let mut number = [0.0];
        world.winding_number(&[Vec3::from_array(point)], &mut number);
        number[0]
    }

    fn prepare(world: &World) {
        world.winding_number(&[], &mut []);
    }
}

impl PointPrecision for f64 {
    fn nearest(world: &DWorld, point: [f64; 3], limit: f64, mask: u32) -> Nearest<f64> {
        let (point, mut nearest) = ([DVec3::from_array(point)], [DNearestPoint::NONE]);
        world.nearest_point(
            Points { max_distance: limit, mask, ..Points::of_doubles(&point) },
            &mut nearest,
        );
        let DNearestPoint { distance, position, uv, instance, geometry, primitive } = nearest[0];
        let found =
            Found { t: distance, uv: uv.to_array(), occurrence: instance, geometry, primitive };
        let position = if nearest[0].is_found() { position } else { DVec3::NAN };
        Nearest { found, position: position.to_array() }
    }

    fn is_inside(world: &DWorld, point: [f64; 3]) -> bool {
        let mut inside = [false];
        world.occupancy(&[DVec3::from_array(point)], &mut inside);
        inside[0]
    }

    fn winding_number(world: &DWorld, point: [f64; 3]) -> f64 {
        let mut number = [0.0];
        world.winding_number(&[DVec3::from_array(point)], &mut number);
        number[0]
    }

    fn prepare(world: &DWorld) {
        world.winding_number(&[], &mut []);
    }
}
