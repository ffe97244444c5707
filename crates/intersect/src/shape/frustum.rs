//! The truncated cone, of which cylinder and cone are special cases: one routine for all three.

use super::disk::{on_ring_at, polar, sample_ring};
use super::nearest::{around, on_ring, on_segment};
use super::span::{Span, crossings, roots, slab};
use super::winding;
use super::{
    Metric, Patch, Shape, ShapeError, ShapeHit, ShapePoint, ShapeSample, ShapeSurface, turn,
};
use serde::{Deserialize, Serialize};
use snell_math::parameters::Range;
use snell_math::{Bounds3d, DRay, DVec2, DVec3, real, robust, rotation};
use std::f64::consts::{PI, TAU};

snell_math::declare! {
    /// A truncated cone around the y axis, centred: from `-height / 2` to `+height / 2`. Faces: 0
    /// side, 1 bottom, 2 top.
    ///
    /// `uv` of the side is (longitude / 2 pi, 0 at the top and 1 at the bottom), longitude from +z
    /// towards +x as on the sphere; of the caps (longitude / 2 pi, 0 at the rim and 1 at the
    /// centre).
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Frustum {
        /// Radius at the bottom, at least 0.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        pub bottom_radius: f64,
        /// Radius at the top, at least 0; one of the two must be positive.
        #[range(Range::AMOUNT)]
        #[unit("scene units")]
        pub top_radius: f64,
        /// Height, positive.
        #[range(Range::Positive)]
        #[unit("scene units")]
        pub height: f64,
        /// Whether the ends are closed by disks.
        #[serde(default = "closed")]
        pub caps: bool,
    }
}

/// The default of `caps`: ends are closed.
pub(super) fn closed() -> bool {
    true
}

impl Frustum {
    /// The side.
    pub const SIDE: u32 = 0;
    /// The disk at the bottom.
    pub const BOTTOM: u32 = 1;
    /// The disk at the top.
    pub const TOP: u32 = 2;

    /// Frusta for tests and galleries: open and closed, narrow above and below, nearly flat, nearly
    /// a cylinder.
    pub fn examples() -> Vec<Self> {
        [
            (1.0, 0.5, 2.0, true),
            (0.5, 1.0, 2.0, false),
            (0.0, 1.0, 1.0, true),
            (1.0, 1.0, 2.0, false),
            (50.0, 1.0, 0.1, true),
            (1.0, 0.999_999, 30.0, true),
            (2e-3, 1e-3, 1e-3, false),
        ]
        .map(|(bottom_radius, top_radius, height, caps)| Self {
            bottom_radius,
            top_radius,
            height,
            caps,
        })
        .to_vec()
    }

    /// Growth of the radius per unit of y.
    fn slope(&self) -> f64 {
        (self.top_radius - self.bottom_radius) / self.height
    }

    /// The ends of the axis: y at the bottom and at the top.
    fn ends(&self) -> [f64; 2] {
        [-0.5 * self.height, 0.5 * self.height]
    }

    /// The face at each end of the axis. An end of radius 0 is the apex, which belongs to the side.
    fn end_faces(&self) -> [u32; 2] {
        let face = |radius, cap| if radius > 0.0 { cap } else { Self::SIDE };
        [face(self.bottom_radius, Self::BOTTOM), face(self.top_radius, Self::TOP)]
    }

    /// The part of a line inside the solid, whether or not its ends are closed by caps.
    fn span(&self, o: DVec3, d: DVec3) -> Option<Span> {
        let axial = slab(o.y, d.y, self.ends(), self.end_faces())?;
        self.span_of_infinite_cone(o, d)?.intersection(axial)
    }

    /// The part of a line inside the cone extended without end: inside where
    /// `f(t) = |P|^2 - R^2 <= 0`, with `P` the point of the line projected along the axis and `R`
    /// the (signed) radius at its height, both linear in `t`. The part may lie in the nappe beyond
    /// the apex; the slab between the ends cuts that off.
    ///
    /// `f` is a quadratic `a t^2 + 2 b t + c`. Its discriminant is written
    /// `|R d - e P|^2 - (P x d)^2` (with `e` the derivative of `R` by `t`; Lagrange's identity),
    /// which stays accurate for rays from far away and near the apex.
    fn span_of_infinite_cone(&self, o: DVec3, d: DVec3) -> Option<Span> {
        let minor = robust::difference_of_products;
        let (p, d_across) = (DVec2::new(o.z, o.x), DVec2::new(d.z, d.x));
        // The radius is measured from the nearer end, so that a point on a rim gets exactly the
        // radius of the rim.
        let r = if o.y < 0.0 {
            self.bottom_radius + self.slope() * (o.y + 0.5 * self.height)
        } else {
            self.top_radius + self.slope() * (o.y - 0.5 * self.height)
        };
        let e = self.slope() * d.y;
        let speed = d_across.length();
        let a = (speed - e) * (speed + e);
        let b = p.dot(d_across) - r * e;
        let distance = p.length();
        let c = (distance - r) * (distance + r);
        let reach = DVec2::new(minor(r, d_across.x, e, p.x), minor(r, d_across.y, e, p.y)).length();
        let cross = minor(p.x, d_across.y, p.y, d_across.x).abs();
        let discriminant = (reach - cross) * (reach + cross);
        let (start, end) = if a > 0.0 {
            if discriminant.is_nan() || discriminant < 0.0 {
                return None;
            }
            roots(a, b, c, discriminant)
        } else if a < 0.0 {
            // The line is steeper than the cone: it is inside from the last crossing on if the cone
            // widens along it, otherwise up to the first crossing.
            let (t0, t1) = roots(a, b, c, discriminant.max(0.0));
            if e > 0.0 { (t1, f64::INFINITY) } else { (f64::NEG_INFINITY, t0) }
        } else if b == 0.0 {
            // A line along the axis of a cylinder, or along the side.
            return if c <= 0.0 {
                Span::new(f64::NEG_INFINITY, f64::INFINITY, [0, 0])
            } else {
                None
            };
        } else {
            let t = -c / (2.0 * b);
            if b > 0.0 { (f64::NEG_INFINITY, t) } else { (t, f64::INFINITY) }
        };
        Span::new(start, end, [Self::SIDE, Self::SIDE])
    }

    /// Length of the side from rim to rim.
    fn slant(&self) -> f64 {
        real::hypot(self.height, self.top_radius - self.bottom_radius)
    }

    /// Area of side, bottom and top.
    fn areas(&self) -> [f64; 3] {
        let cap = |r: f64| if self.caps { PI * r * r } else { 0.0 };
        let side = PI * (self.bottom_radius + self.top_radius) * self.slant();
        [side, cap(self.bottom_radius), cap(self.top_radius)]
    }

    /// The point of the side nearest to `position`, in the half plane through the axis and
    /// `position`: the unit direction of that half plane as (z, x), the height as a fraction from 0
    /// (bottom) to 1 (top), and the radius at that height.
    fn on_side(&self, position: DVec3) -> (DVec2, f64, f64) {
        let across = DVec2::new(position.z, position.x);
        let along = across.try_normalize().unwrap_or(DVec2::X);
        let (rise, widening) = (self.height, self.top_radius - self.bottom_radius);
        let from_bottom =
            (across.length() - self.bottom_radius) * widening + (position.y + 0.5 * rise) * rise;
        let s = (from_bottom / (rise * rise + widening * widening)).clamp(0.0, 1.0);
        (along, s, self.bottom_radius * (1.0 - s) + self.top_radius * s)
    }

    /// Position and unit normal of a point of the side, given as returned by [`Self::on_side`].
    fn side_normal(&self, (along, s, rho): (DVec2, f64, f64)) -> (DVec3, DVec3) {
        let (rise, widening) = (self.height, self.top_radius - self.bottom_radius);
        let position = DVec3::new(along.y * rho, (s - 0.5) * rise, along.x * rho);
        (position, DVec3::new(along.y * rise, -widening, along.x * rise) / self.slant())
    }

    fn side_surface(&self, position: DVec3) -> ShapeSurface {
        let place @ (along, s, rho) = self.on_side(position);
        let (rise, widening) = (self.height, self.top_radius - self.bottom_radius);
        let around = DVec3::new(along.x, 0.0, -along.y);
        let slant = self.slant();
        let (position, normal) = self.side_normal(place);
        ShapeSurface {
            position,
            normal,
            uv: DVec2::new(turn(along), 1.0 - s),
            // At an apex, where the derivative vanishes, an arbitrary tangent is used.
            dpdu: around * if rho > 0.0 { TAU * rho } else { slant },
            dpdv: -DVec3::new(along.y * widening, rise, along.x * widening),
        }
    }

    /// The point of the side nearest to `point`, found as the nearest of one segment per angle.
    fn nearest_on_side(&self, point: DVec3, metric: &Metric) -> DVec3 {
        if metric.is_similarity() {
            return self.side_surface(point).position;
        }
        let [bottom, top] = self.ends();
        around(metric, point, |angle| {
            let (sin, cos) = real::sin_cos(angle);
            let at = |y: f64, radius: f64| DVec3::new(sin * radius, y, cos * radius);
            on_segment(metric, point, at(bottom, self.bottom_radius), at(top, self.top_radius)).0
        })
    }

    /// Height and radius of the cap with this face number. `None` for the side and for a cap of
    /// radius 0.
    fn cap(&self, face: u32) -> Option<(f64, f64)> {
        let [bottom, top] = self.ends();
        match face {
            Self::BOTTOM if self.bottom_radius > 0.0 => Some((bottom, self.bottom_radius)),
            Self::TOP if self.top_radius > 0.0 => Some((top, self.top_radius)),
            _ => None,
        }
    }

    fn cap_surface(&self, position: DVec3, (y, radius): (f64, f64)) -> ShapeSurface {
        let place = |p: DVec2| DVec3::new(p.y, 0.0, p.x);
        let (p, uv, dpdu, dpdv) = polar(DVec2::new(position.z, position.x), radius, 0.0);
        ShapeSurface {
            position: place(p).with_y(y),
            normal: DVec3::Y.with_y(1.0_f64.copysign(y)),
            uv,
            dpdu: place(dpdu),
            dpdv: place(dpdv),
        }
    }
}

impl Shape for Frustum {
    fn validate(&self) -> Result<(), ShapeError> {
        let expected = "at least 0, and positive at one end";
        let (larger, smaller) =
            (self.bottom_radius.max(self.top_radius), self.bottom_radius.min(self.top_radius));
        ShapeError::unless("frustum", "bottom_radius", self.bottom_radius, expected, |r| {
            r >= 0.0 && larger > 0.0
        })?;
        ShapeError::unless("frustum", "top_radius", self.top_radius, expected, |_| smaller >= 0.0)?;
        ShapeError::unless_positive("frustum", "height", self.height)
    }

    fn bounds(&self) -> Bounds3d {
        let r = self.bottom_radius.max(self.top_radius);
        let corner = DVec3::new(r, 0.5 * self.height, r);
        Bounds3d { min: -corner, max: corner }
    }

    fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
        self.nearest_two(ray)[0]
    }

    fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
        crossings(ray, |o, d| self.span(o, d), |face| self.caps || face == Self::SIDE)
    }

    fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
        hits.extend(self.nearest_two(ray).into_iter().flatten());
    }

    fn surface(&self, position: DVec3, face: u32) -> ShapeSurface {
        match self.cap(face) {
            Some(cap) => self.cap_surface(position, cap),
            None => self.side_surface(position),
        }
    }

    fn normal(&self, position: DVec3, face: u32) -> (DVec3, DVec3) {
        let Some((y, radius)) = self.cap(face) else {
            return self.side_normal(self.on_side(position));
        };
        let (along, rho) = on_ring_at(DVec2::new(position.z, position.x), radius, 0.0);
        let p = along * rho;
        (DVec3::new(p.y, y, p.x), DVec3::Y.with_y(1.0_f64.copysign(y)))
    }

    fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
        let [bottom, top] = self.ends();
        let cap = |face, y, radius: f64| {
            let exists = self.caps && radius > 0.0;
            exists.then(|| ShapePoint { position: on_ring(metric, point, 1, y, radius, 0.0), face })
        };
        let side = ShapePoint { position: self.nearest_on_side(point, metric), face: Self::SIDE };
        let caps =
            [cap(Self::BOTTOM, bottom, self.bottom_radius), cap(Self::TOP, top, self.top_radius)];
        metric.nearest(point, [Some(side)].into_iter().chain(caps).flatten())
    }

    fn winding_number(&self, point: DVec3, metric: &Metric) -> f64 {
        let [bottom, top] = self.ends();
        let s = (point.y - bottom) / self.height;
        let radius = self.bottom_radius * (1.0 - s) + self.top_radius * s;
        let inside = 0.0 < s && s < 1.0 && DVec2::new(point.x, point.z).length() < radius;
        let solid = f64::from(inside);
        if self.caps {
            return solid;
        }
        // The side is the closed solid without its caps, whose bottom normal points down.
        solid + winding::of_disk(metric, point, 1, bottom, self.bottom_radius)
            - winding::of_disk(metric, point, 1, top, self.top_radius)
    }

    fn contains(&self, point: DVec3) -> bool {
        let [bottom, top] = self.ends();
        // Exactly the radius of a cylinder, and zero at the tip of a cone.
        let s = (point.y - bottom) / self.height;
        let radius = self.bottom_radius + (self.top_radius - self.bottom_radius) * s;
        let is_between = bottom <= point.y && point.y <= top;
        self.caps && is_between && DVec2::new(point.x, point.z).length() <= radius
    }

    fn area(&self) -> f64 {
        self.areas().iter().sum()
    }

    fn sample(&self, u: DVec2) -> Option<ShapeSample> {
        let (face, x) = choose(&self.areas(), u.x);
        let [bottom, top] = self.ends();
        let on_cap = |y, radius| {
            let p = sample_ring(DVec2::new(x, u.y), radius, 0.0);
            DVec3::new(p.y, y, p.x)
        };
        let position = match face as u32 {
            Self::BOTTOM => on_cap(bottom, self.bottom_radius),
            Self::TOP => on_cap(top, self.top_radius),
            _ => {
                // The area of the side up to a height grows with the square of the radius there.
                let (r0, r1) = (self.bottom_radius, self.top_radius);
                let rho = (r0 * r0 * (1.0 - x) + r1 * r1 * x).sqrt();
                let s = if rho > 0.0 { x * (r0 + r1) / (r0 + rho) } else { 0.0 };
                let p = rotation::unit_vector(TAU * u.y) * rho;
                DVec3::new(p.y, (s - 0.5) * self.height, p.x)
            }
        };
        Some(ShapeSample::at(self, position, face as u32))
    }

    fn is_closed(&self) -> bool {
        self.caps
    }

    fn patches(&self) -> Vec<Patch> {
        let Self { bottom_radius, top_radius, height, caps } = *self;
        let ring = |u: f64, radius: f64, y: f64| {
            let (sin, cos) = real::sin_cos(u * TAU);
            DVec3::new(radius * sin, y, radius * cos)
        };
        let side = move |u: f64, v: f64| {
            ring(u, top_radius + (bottom_radius - top_radius) * v, height * (0.5 - v))
        };
        let cap = |face: u32, radius: f64, y: f64| {
            let disk = move |u: f64, v: f64| ring(u, radius * (1.0 - v), y);
            (caps && radius > 0.0).then(|| Patch::round(face, 0.0, disk))
        };
        let [bottom, top] = self.ends();
        let caps = [cap(Self::BOTTOM, bottom_radius, bottom), cap(Self::TOP, top_radius, top)];
        [Some(Patch::round(Self::SIDE, 0.0, side))].into_iter().chain(caps).flatten().collect()
    }
}

/// Samples an index in proportion to the weights. The second result is `u` rescaled to a new
/// uniform number in `[0, 1)`.
pub(super) fn choose(weights: &[f64], u: f64) -> (usize, f64) {
    let mut rest = u * weights.iter().sum::<f64>();
    let last = weights.iter().rposition(|&w| w > 0.0).unwrap_or(0);
    for (i, &weight) in weights.iter().enumerate().take(last) {
        if rest < weight {
            return (i, rest / weight);
        }
        rest -= weight;
    }
    let fresh = rest / weights.get(last).copied().unwrap_or(1.0);
    (last, if fresh < 1.0 { fresh.max(0.0) } else { 1.0_f64.next_down() })
}

/// Implements [`Shape`] for a special case of the frustum by its method `as_frustum`.
macro_rules! shape_as_frustum {
    ($kind:ty, $validate:expr) => {
        impl Shape for $kind {
            fn validate(&self) -> Result<(), ShapeError> {
                let check: fn(&Self) -> Result<(), ShapeError> = $validate;
                check(self)
            }
            fn bounds(&self) -> Bounds3d {
                self.as_frustum().bounds()
            }
            fn closest(&self, ray: &DRay) -> Option<ShapeHit> {
                self.as_frustum().closest(ray)
            }
            fn nearest_two(&self, ray: &DRay) -> [Option<ShapeHit>; 2] {
                self.as_frustum().nearest_two(ray)
            }
            fn all(&self, ray: &DRay, hits: &mut Vec<ShapeHit>) {
                self.as_frustum().all(ray, hits);
            }
            fn surface(&self, position: DVec3, face: u32) -> ShapeSurface {
                self.as_frustum().surface(position, face)
            }
            fn normal(&self, position: DVec3, face: u32) -> (DVec3, DVec3) {
                self.as_frustum().normal(position, face)
            }
            fn nearest_point(&self, point: DVec3, metric: &Metric) -> Option<ShapePoint> {
                self.as_frustum().nearest_point(point, metric)
            }
            fn winding_number(&self, point: DVec3, metric: &Metric) -> f64 {
                self.as_frustum().winding_number(point, metric)
            }
            fn contains(&self, point: DVec3) -> bool {
                self.as_frustum().contains(point)
            }
            fn area(&self) -> f64 {
                self.as_frustum().area()
            }
            fn sample(&self, u: DVec2) -> Option<ShapeSample> {
                self.as_frustum().sample(u)
            }
            fn is_closed(&self) -> bool {
                self.as_frustum().is_closed()
            }
            fn patches(&self) -> Vec<Patch> {
                self.as_frustum().patches()
            }
        }
    };
}
pub(super) use shape_as_frustum;
