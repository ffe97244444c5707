//! Random rays for a shape, many of them degenerate or nearly so.

use crate::shape::{AnyShape, Shape};
use snell_math::{DRay, DVec2, DVec3, rng};
use std::f64::consts::TAU;

/// A sequence of random numbers that is determined by two keys.
pub struct Numbers {
    key: [u32; 2],
    next: u32,
}

impl Numbers {
    pub fn new(stream: u32, index: u32) -> Self {
        Self { key: [stream, index], next: 0 }
    }

    /// Uniform in [0, 1), with 52 bits.
    pub fn uniform(&mut self) -> f64 {
        let [a, b, _, _] = rng::pcg4d([self.key[0], self.key[1], self.next, 77]);
        self.next += 1;
        (f64::from(a) + f64::from(b >> 12) / f64::from(1 << 20)) / 4_294_967_296.0
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    pub fn below(&mut self, n: usize) -> usize {
        ((self.uniform() * n as f64) as usize).min(n - 1)
    }

    pub fn square(&mut self) -> DVec2 {
        DVec2::new(self.uniform(), self.uniform())
    }

    pub fn direction(&mut self) -> DVec3 {
        let z = self.between(-1.0, 1.0);
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }

    fn pick(&mut self, points: &[DVec3]) -> DVec3 {
        points[self.below(points.len())]
    }
}

/// Corners, rim points, poles, apexes and edge midpoints of a shape: places where errors are
/// likely.
pub fn features(shape: &AnyShape) -> Vec<DVec3> {
    let mut points: Vec<DVec3> = match shape {
        AnyShape::Triangle(t) => t.vertices.to_vec(),
        AnyShape::Polygon(p) => p.vertices().to_vec(),
        _ => Vec::new(),
    };
    if points.is_empty() {
        let b = shape.bounds();
        let (center, half) = if b.is_finite() {
            (b.center(), b.size() * 0.5)
        } else {
            (DVec3::ZERO, DVec3::new(3.0, 3.0, 0.0))
        };
        for i in 0..27 {
            let offset = DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9)) - 1.0;
            for face in 0..6 {
                points.push(shape.surface(center + half * offset, face).position);
            }
        }
    } else {
        let n = points.len();
        points.extend((0..n).map(|i| (points[i] + points[(i + 1) % n]) * 0.5).collect::<Vec<_>>());
    }
    points
}

/// A random point of the surface and its normal.
pub fn surface_point(shape: &AnyShape, numbers: &mut Numbers) -> (DVec3, DVec3) {
    let u = numbers.square();
    match shape.sample(u) {
        Some(sample) => (sample.position, sample.normal),
        None => ((u * 8.0 - 4.0).extend(0.0), DVec3::Z),
    }
}

/// A random ray for the shape, of one of several kinds.
pub fn ray(shape: &AnyShape, features: &[DVec3], numbers: &mut Numbers) -> DRay {
    let b = shape.bounds();
    let (center, radius) =
        if b.is_finite() { (b.center(), b.radius()) } else { (DVec3::ZERO, 5.0) };
    let mut origin = match numbers.below(7) {
        0 => center + numbers.direction() * radius * numbers.between(1.0, 6.0),
        1 => center + numbers.direction() * radius * 10f64.powf(numbers.between(1.0, 4.0)),
        2 => center + numbers.direction() * radius * numbers.uniform(),
        3 => surface_point(shape, numbers).0,
        4 => {
            let (p, n) = surface_point(shape, numbers);
            p + n * (p.abs().max_element() * 1.2e-7 * numbers.between(-4.0, 4.0))
        }
        5 => {
            let (p, _) = surface_point(shape, numbers);
            let deep = numbers.uniform();
            center + (p - center) * deep
        }
        _ => {
            numbers.pick(features)
                + DVec3::AXES[numbers.below(3)] * radius * numbers.between(-3.0, 3.0)
        }
    };
    let axis = DVec3::AXES[numbers.below(3)] * if numbers.uniform() < 0.5 { -1.0 } else { 1.0 };
    let mut direction = match numbers.below(8) {
        0 => numbers.direction(),
        1 => surface_point(shape, numbers).0 - origin,
        2 => numbers.pick(features) - origin,
        3 => numbers.pick(features).lerp(numbers.pick(features), 0.5) - origin,
        4 => axis,
        5 => numbers.direction().with_x(0.0),
        6 => numbers.direction() * 1e-9 + axis,
        _ => {
            // Along the surface, or nearly.
            let (p, n) = surface_point(shape, numbers);
            let tangent = n.cross(numbers.direction());
            origin = p - tangent * radius * numbers.between(-2.0, 2.0);
            tangent + n * numbers.between(-1e-6, 1e-6) * f64::from(numbers.below(2) as u32)
        }
    };
    if numbers.below(3) == 0 {
        let zeroed = numbers.below(3);
        direction[zeroed] = 0.0;
    }
    direction *= 10f64.powi(numbers.below(9) as i32 * 4 - 16);
    if numbers.below(2) == 0 {
        (origin, direction) = (origin.as_vec3().as_dvec3(), direction.as_vec3().as_dvec3());
    }
    let mut ray = DRay::new(origin, direction);
    if numbers.below(6) == 0 {
        let unit = radius / direction.length().max(1e-300);
        ray.t_min = numbers.between(-3.0, 3.0) * unit;
        ray.t_max = ray.t_min + numbers.between(0.0, 6.0) * unit;
    }
    ray
}
