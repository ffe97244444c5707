//! Nearest points, insideness and winding numbers: each precision uses the same world as its rays.

use crate::precision::Found;
use numpy::Element;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use snell_intersect::{DNearestPoint, DWorld, InsideMethod, NearestPoint, Points, World};
use snell_math::{DVec3, Vec3};

/// A nearest point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nearest<P> {
    /// Distance, parameters and ids, as for a hit.
    pub found: Found<P>,
    /// The point in world coordinates.
    pub position: [P; 3],
}

/// What decides whether a point is inside.
#[derive(Clone, Copy, Debug)]
pub struct Inside {
    /// The rule.
    pub method: InsideMethod,
    /// Only objects whose mask shares a bit with it count.
    pub mask: u64,
}

impl Inside {
    /// Makes the rule from its name.
    pub fn new(method: &str, mask: u64) -> PyResult<Self> {
        let method = match method {
            "auto" => InsideMethod::Auto,
            "parity" => InsideMethod::Parity,
            "winding" => InsideMethod::Winding,
            other => {
                return Err(PyValueError::new_err(format!(
                    "method is {other:?}, expected \"auto\", \"parity\" or \"winding\""
                )));
            }
        };
        Ok(Self { method, mask })
    }
}

/// The precision of points: `f32` or `f64`.
pub trait PointPrecision: crate::precision::Precision + Element {
    /// The nearest point of a surface within the distance `limit`.
    fn nearest(world: &Self::World, point: [Self; 3], limit: Self, mask: u64) -> Nearest<Self>;

    /// For each point, whether it is inside.
    fn occupancy(world: &Self::World, points: &[[Self; 3]], about: Inside, inside: &mut [bool]);

    /// The winding number around each point.
    fn winding_number(world: &Self::World, points: &[[Self; 3]], mask: u64, numbers: &mut [f64]);

    /// Prepares the world for winding numbers.
    fn prepare(world: &Self::World);
}

impl PointPrecision for f32 {
    fn nearest(world: &World, point: [f32; 3], limit: f32, mask: u64) -> Nearest<f32> {
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

    fn occupancy(world: &World, points: &[[f32; 3]], about: Inside, inside: &mut [bool]) {
        let points: Vec<Vec3> = points.iter().map(|&p| Vec3::from_array(p)).collect();
        let Inside { method, mask } = about;
        world.occupancy(Points { method, mask, ..Points::new(&points) }, inside);
    }

    fn winding_number(world: &World, points: &[[f32; 3]], mask: u64, numbers: &mut [f64]) {
        let points: Vec<Vec3> = points.iter().map(|&p| Vec3::from_array(p)).collect();
        world.winding_number(Points { mask, ..Points::new(&points) }, numbers);
    }

    fn prepare(world: &World) {
        world.winding_number(Points::new(&[]), &mut []);
    }
}

impl PointPrecision for f64 {
    fn nearest(world: &DWorld, point: [f64; 3], limit: f64, mask: u64) -> Nearest<f64> {
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

    fn occupancy(world: &DWorld, points: &[[f64; 3]], about: Inside, inside: &mut [bool]) {
        let points: Vec<DVec3> = points.iter().map(|&p| DVec3::from_array(p)).collect();
        let Inside { method, mask } = about;
        world.occupancy(Points { method, mask, ..Points::of_doubles(&points) }, inside);
    }

    fn winding_number(world: &DWorld, points: &[[f64; 3]], mask: u64, numbers: &mut [f64]) {
        let points: Vec<DVec3> = points.iter().map(|&p| DVec3::from_array(p)).collect();
        world.winding_number(Points { mask, ..Points::of_doubles(&points) }, numbers);
    }

    fn prepare(world: &DWorld) {
        world.winding_number(Points::of_doubles(&[]), &mut []);
    }
}
