//! Finds where a line crosses a shape, slowly and without any of the shapes' formulas: for convex
//! solids by searching the line for the deepest point and bisecting on both sides of it, for flat
//! shapes by bisecting the distance from their plane.

use crate::shape::{AnyShape, Frustum, Shape};
use snell_math::{DRay, DVec3};

/// A crossing of the surface, at a length along the ray, and whether rounding may make it a miss.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    pub s: f64,
    pub doubtful: bool,
}

/// The oracle's answer for a ray.
#[derive(Debug)]
pub enum Verdict {
    /// The ray has these crossings.
    Crossings(Vec<Crossing>),
    /// The line touches the shape to within rounding, or runs within a flat one: any answer on the
    /// surface is correct.
    Touching,
    /// The oracle does not know this shape.
    Unknown,
}

/// True for the shapes that the oracle supports. The others are covered by all other tests: hits
/// lie on the surface, areas match those measured by random lines, and samples are distributed like
/// hits.
pub fn knows(shape: &AnyShape) -> bool {
    let known = [
        "sphere",
        "box",
        "cylinder",
        "cone",
        "frustum",
        "disk",
        "rectangle",
        "plane",
        "triangle",
        "polygon",
    ];
    known.contains(&shape.name())
}

/// Magnitude of the numbers that enter a ray's result; rounding errors are relative to it.
pub fn scale(shape: &AnyShape, ray: &DRay) -> f64 {
    let b = shape.bounds();
    let extent = if b.is_finite() { b.min.abs().max(b.max.abs()).length() } else { 1.0 };
    extent + ray.origin.length()
}

/// The largest distance attributed to rounding.
pub fn tolerance(shape: &AnyShape, ray: &DRay) -> f64 {
    1e-13 * scale(shape, ray)
}

fn frustum_of(shape: &AnyShape) -> Option<Frustum> {
    match *shape {
        AnyShape::Frustum(f) => Some(f),
        AnyShape::Cylinder(c) => Some(Frustum {
            bottom_radius: c.radius,
            top_radius: c.radius,
            height: c.height,
            caps: c.caps,
        }),
        AnyShape::Cone(c) => {
            Some(Frustum { bottom_radius: c.radius, top_radius: 0.0, height: c.height, caps: true })
        }
        _ => None,
    }
}

/// How far a point is outside the infinite cone and outside the end planes.
fn frustum_depths(f: &Frustum, p: DVec3) -> (f64, f64) {
    let widening = f.top_radius - f.bottom_radius;
    let radius = f.bottom_radius + widening * (p.y / f.height + 0.5);
    let slant = f.height.hypot(widening);
    ((p.x.hypot(p.z) - radius) * f.height / slant, p.y.abs() - 0.5 * f.height)
}

/// For shapes around a solid (open frusta included): a convex function that is negative inside and,
/// near the surface, the distance from it. `None` for flat shapes.
pub fn outside(shape: &AnyShape, p: DVec3) -> Option<f64> {
    match shape {
        AnyShape::Sphere(s) => Some(p.length() - s.radius),
        AnyShape::BoxShape(b) => Some((b.min - p).max(p - b.max).max_element()),
        _ => frustum_of(shape).map(|f| {
            let (side, ends) = frustum_depths(&f, p);
            side.max(ends)
        }),
    }
}

/// For flat shapes: a point of the plane, its unit normal, and a function of a point of the plane
/// that returns how far the point is inside the outline.
fn flat(shape: &AnyShape) -> (DVec3, DVec3, Box<dyn Fn(DVec3) -> f64 + '_>) {
    match shape {
        AnyShape::Disk(d) => {
            let inside = |p: DVec3| {
                let rho = p.x.hypot(p.y);
                if d.inner_radius > 0.0 {
                    (d.radius - rho).min(rho - d.inner_radius)
                } else {
                    d.radius - rho
                }
            };
            (DVec3::ZERO, DVec3::Z, Box::new(inside))
        }
        AnyShape::Rectangle(r) => {
            let inside = |p: DVec3| (r.half_size.x - p.x.abs()).min(r.half_size.y - p.y.abs());
            (DVec3::ZERO, DVec3::Z, Box::new(inside))
        }
        AnyShape::Triangle(t) => outline(t.vertices.to_vec()),
        AnyShape::Polygon(p) => outline(p.vertices().to_vec()),
        _ => (DVec3::ZERO, DVec3::Z, Box::new(|_| f64::INFINITY)),
    }
}

fn outline(v: Vec<DVec3>) -> (DVec3, DVec3, Box<dyn Fn(DVec3) -> f64>) {
    let n = v.len();
    let center = v.iter().sum::<DVec3>() / n as f64;
    // The corner with the widest angle to the first edge gives the most accurate normal.
    let normals = (2..n).map(|i| (v[1] - v[0]).cross(v[i] - v[0]));
    let normal = normals
        .max_by(|a, b| a.length().total_cmp(&b.length()))
        .expect("three vertices")
        .normalize();
    let inside = move |p: DVec3| {
        let distance = |i: usize| {
            let (a, b) = (v[i], v[(i + 1) % n]);
            let inward = normal.cross(b - a).normalize();
            (p - a).dot(inward * inward.dot(center - a).signum())
        };
        (0..n).map(distance).fold(f64::INFINITY, f64::min)
    };
    (center, normal, Box::new(inside))
}

/// The point between `a` and `b` where `f` changes its sign, by bisection to 2^-64 of their
/// distance.
fn bisect(mut a: f64, mut b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let negative = f(a) < 0.0;
    for _ in 0..64 {
        let m = 0.5 * (a + b);
        if (f(m) < 0.0) == negative { a = m } else { b = m }
    }
    0.5 * (a + b)
}

/// The argument at which a convex function is least, by golden-section search.
fn least(mut a: f64, mut b: f64, f: impl Fn(f64) -> f64) -> f64 {
    const SHRINK: f64 = 0.618_033_988_749_894_8;
    let (mut l, mut r) = (b - SHRINK * (b - a), a + SHRINK * (b - a));
    let (mut fl, mut fr) = (f(l), f(r));
    for _ in 0..75 {
        if fl < fr {
            (b, r, fr) = (r, l, fl);
            l = b - SHRINK * (b - a);
            fl = f(l);
        } else {
            (a, l, fl) = (l, r, fr);
            r = a + SHRINK * (b - a);
            fr = f(r);
        }
    }
    if fl < fr { l } else { r }
}

/// Where the ray crosses the shape.
pub fn crossings(shape: &AnyShape, ray: &DRay) -> Verdict {
    if !knows(shape) {
        return Verdict::Unknown;
    }
    let length = ray.direction.length();
    let unit = ray.direction / length;
    let at = |s: f64| ray.origin + unit * s;
    let tolerance = tolerance(shape, ray);
    let mut found = Vec::new();
    if outside(shape, ray.origin).is_some() {
        let f = |s: f64| outside(shape, at(s)).unwrap_or(0.0);
        let (center, reach) = (shape.bounds().center(), 2.0 * shape.bounds().radius());
        let middle = (center - ray.origin).dot(unit);
        let deepest = least(middle - reach, middle + reach, f);
        if f(deepest) > tolerance {
            return Verdict::Crossings(found);
        }
        if f(deepest) > -tolerance {
            return Verdict::Touching;
        }
        for end in [-reach, reach] {
            let s = bisect(deepest, middle + end, f);
            let mut doubtful = false;
            if let Some(frustum) = frustum_of(shape).filter(|f| !f.caps) {
                let (side, ends) = frustum_depths(&frustum, at(s));
                // At the rim, where the side may be grazed, rounding decides.
                if ends > side + 1000.0 * tolerance {
                    continue;
                }
                doubtful = ends > side - 1000.0 * tolerance;
            }
            found.push(Crossing { s, doubtful });
        }
    } else {
        let (point, normal, inside) = flat(shape);
        let cos = unit.dot(normal);
        if cos.abs() < 1e-7 {
            return Verdict::Touching;
        }
        let f = |s: f64| (at(s) - point).dot(normal);
        let reach = 4.0 * scale(shape, ray) / cos.abs();
        let s = bisect(-reach, reach, f);
        let margin = inside(at(s));
        if margin > -tolerance / cos.abs() {
            found.push(Crossing { s, doubtful: margin < tolerance / cos.abs() });
        }
    }
    // Crossings outside the interval do not count, and those at its ends are doubtful.
    let blur = |s: f64| match outside(shape, at(s)) {
        Some(_) => tolerance,
        None => tolerance / unit.dot(flat(shape).1).abs(),
    };
    let ends = [ray.t_min * length, ray.t_max * length];
    found.retain(|c| {
        c.s > ends[0] - 1e-6 * scale(shape, ray) && c.s < ends[1] + 1e-6 * scale(shape, ray)
    });
    found.retain_mut(|c| {
        let at_end = |end: f64| {
            let near = (c.s - end).abs() <= 10.0 * blur(c.s);
            let same_surface =
                || outside(shape, at(end)).is_some_and(|d| d.abs() <= 2.0 * tolerance);
            end.is_finite()
                && (near || (c.s - end).abs() < 1e-2 * scale(shape, ray) && same_surface())
        };
        c.doubtful |= ends.into_iter().any(at_end);
        c.doubtful || (c.s > ends[0] && c.s < ends[1])
    });
    Verdict::Crossings(found)
}
