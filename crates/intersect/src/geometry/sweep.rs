//! The intersection of a ray with the space swept by a ball along a cubic curve.
//!
//! This solid is a union of balls, so along a ray it is a union of intervals, one for each
//! connected set of balls that the ray passes through; entries and exits alternate. The search
//! divides the curve in halves and drops parts whose bounds the ray misses (as in Nakamaru and
//! Ohno, Ray tracing for curves primitive, WSCG 2002). The last pieces are approximated by the hull
//! of the balls at their ends, which gives intervals of the ray ([`UnitRay::hull_span`]), and
//! overlapping intervals are merged. The ends of the remaining intervals are then refined to the
//! true surface by Newton's method.

use super::rounded_cone::{Ball, UnitRay};
use crate::shape::ShapeSurface;
use snell_math::{DMat3, DRay, DVec2, DVec3, DVec4, real};
use std::f64::consts::TAU;

/// The largest distance between a piece of the curve and its chord, relative to the largest radius.
const FLATNESS: f64 = 1e-3;

/// The largest number of successive halvings.
const MAX_DEPTH: u32 = 12;

/// The largest number of intervals, far more than a cubic has; any further ones are merged.
const MAX_STRETCHES: usize = 16;

/// Value, first and second derivative of a Bézier curve at `u`.
pub(super) fn derivatives(c: &[DVec4; 4], u: f64) -> [DVec4; 3] {
    let l1 = [c[0].lerp(c[1], u), c[1].lerp(c[2], u), c[2].lerp(c[3], u)];
    let l2 = [l1[0].lerp(l1[1], u), l1[1].lerp(l1[2], u)];
    let second = (l1[2] - l1[1] * 2.0 + l1[0]) * 6.0;
    [l2[0].lerp(l2[1], u), (l2[1] - l2[0]) * 3.0, second]
}

/// Both halves of a Bézier curve. Their common point has the same bits in both.
#[inline]
pub(super) fn halves(&[a, b, c, d]: &[DVec4; 4]) -> [[DVec4; 4]; 2] {
    let middle = |p: DVec4, q: DVec4| (p + q) * 0.5;
    let (ab, bc, cd) = (middle(a, b), middle(b, c), middle(c, d));
    let (abc, bcd) = (middle(ab, bc), middle(bc, cd));
    let abcd = middle(abc, bcd);
    [[a, ab, abc, abcd], [abcd, bcd, cd, d]]
}

/// The curve parameter, near `u`, of the ball whose surface holds `position`.
pub(super) fn foot(controls: &[DVec4; 4], position: DVec3, mut u: f64) -> f64 {
    for _ in 0..6 {
        let [g, slope] = envelope(&derivatives(controls, u), position);
        // The distance has no minimum here: keep the ball that was hit.
        if slope.is_nan() || slope <= 0.0 {
            break;
        }
        u = (u - g / slope).clamp(0.0, 1.0);
    }
    if u.is_nan() { 0.5 } else { u }
}

/// Half the derivative by `u` of `|p - c|^2 - r^2`, which is 0 on the envelope of the balls, and
/// the derivative by `u` of that half.
fn envelope([c, d, dd]: &[DVec4; 3], p: DVec3) -> [f64; 2] {
    let e = p - c.truncate();
    let (d3, dd3) = (d.truncate(), dd.truncate());
    [-e.dot(d3) - c.w * d.w, d3.length_squared() - e.dot(dd3) - d.w * d.w - c.w * dd.w]
}

/// The surface of a tube at `position` on the ball of parameter `u`, where centre and radius change
/// by `growth` per unit of `u`. `chord` is a direction common to the whole curve, from which the
/// angle of the texture coordinates is measured.
pub(super) fn tube_surface(
    ball: &Ball,
    u: f64,
    growth: (DVec3, f64),
    chord: DVec3,
    position: DVec3,
) -> ShapeSurface {
    let normal = (position - ball.center).try_normalize().unwrap_or(DVec3::Y);
    let axis = growth.0.try_normalize().or(chord.try_normalize()).unwrap_or(DVec3::Y);
    let around = axis.cross(normal);
    // The angle is zero perpendicular to the curve, towards the coordinate axis that is least along
    // it.
    let reference =
        DVec3::AXES.into_iter().min_by(|a, b| a.dot(chord).abs().total_cmp(&b.dot(chord).abs()));
    let zero =
        reference.unwrap_or(DVec3::X).reject_from(axis).normalize_or(axis.any_orthonormal_vector());
    let angle = real::atan2(normal.dot(axis.cross(zero)), normal.dot(zero)) / TAU;
    let along = growth.0 + normal * growth.1;
    let along = (along - normal * along.dot(normal)).try_normalize();
    // At the poles of the round ends the tangent is arbitrary.
    let dpdu =
        along.unwrap_or(normal.any_orthonormal_vector()) * growth.0.length().max(ball.radius);
    let dpdv = around.try_normalize().unwrap_or(normal.cross(dpdu).normalize_or(DVec3::X))
        * (TAU * ball.radius);
    let v = if angle < 0.0 { (angle + 1.0).min(1.0_f64.next_down()) } else { angle };
    let position = ball.center + normal * ball.radius;
    ShapeSurface { position, normal, uv: DVec2::new(u, v), dpdu, dpdv }
}

/// An interval of the ray inside the solid: each end as length along the ray and curve parameter.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    enter: (f64, f64),
    exit: (f64, f64),
}

/// A curve in ray coordinates: the ray is the z axis, x and y are perpendicular to it.
pub(super) struct Sweep {
    controls: [DVec4; 4],
    /// The length along the ray at `z = 0`.
    start: f64,
    /// Ray parameter per unit of length.
    scale: f64,
}

/// A part of the curve: `width` of the curve parameter from `u` on, to be halved `depth` times.
#[derive(Clone, Copy)]
struct Part {
    controls: [DVec4; 4],
    u: f64,
    width: f64,
    depth: u32,
}

impl Part {
    fn is_missed(&self) -> bool {
        let misses = |axis: usize| {
            let low = self.controls.iter().all(|c| c[axis] + c.w < 0.0);
            low || self.controls.iter().all(|c| c[axis] - c.w > 0.0)
        };
        misses(0) || misses(1)
    }

    fn halves(&self) -> [Self; 2] {
        let (width, depth) = (self.width * 0.5, self.depth - 1);
        let [first, second] = halves(&self.controls);
        let half = |controls, u| Self { controls, u, width, depth };
        [half(first, self.u), half(second, self.u + width)]
    }
}

impl Sweep {
    /// The curve with these control points in the coordinates of the ray; `None` for some rays that
    /// miss it.
    pub fn new(controls: &[DVec4; 4], ray: &DRay) -> Option<Self> {
        let ray = UnitRay::new(ray)?;
        let middle = (controls[0] + controls[3]).truncate() * 0.5;
        let start = (middle - ray.origin).dot(ray.direction);
        let origin = ray.origin + ray.direction * start;
        // Most near misses pass beside the chord, so this is tested before anything is rotated.
        let whole_chord = (controls[3] - controls[0]).truncate();
        let across = ray.direction.cross(whole_chord);
        let unit = across.length();
        let (mut is_below, mut is_above) = (true, true);
        for c in controls {
            let (y, radius) = ((c.truncate() - origin).dot(across), c.w * unit);
            is_below &= y + radius < 0.0;
            is_above &= y - radius > 0.0;
        }
        if is_below | is_above {
            return None;
        }
        // x runs along the projected chord, so that y bounds the curve tightly.
        let chord = whole_chord.reject_from_normalized(ray.direction);
        let x = chord.try_normalize().unwrap_or(ray.direction.any_orthonormal_vector());
        let frame = DMat3::from_cols(x, ray.direction.cross(x), ray.direction).transpose();
        let controls = controls.map(|c| (frame * (c.truncate() - origin)).extend(c.w));
        Some(Self { controls, start, scale: ray.scale })
    }

    /// How often to halve the curve to make it flat ([`FLATNESS`]). After `n` equal divisions, the
    /// distance of a curve from its chords is at most `1 / (8 n^2)` of its second derivative.
    fn depth(&self) -> u32 {
        let [a, b, c, d] = self.controls;
        let bend =
            6.0 * (a - b * 2.0 + c).length_squared().max((b - c * 2.0 + d).length_squared()).sqrt();
        let radius = self.controls.iter().map(|c| c.w).fold(0.0, f64::max);
        let mut off = bend / 8.0;
        let mut depth = 0;
        while off > FLATNESS * radius && depth < MAX_DEPTH {
            off *= 0.25;
            depth += 1;
        }
        depth
    }

    /// The entries and exits of the ray in ascending order, each as ray parameter and curve
    /// parameter.
    pub fn crossings(self) -> impl Iterator<Item = (f64, f64)> {
        let depth = self.depth();
        let whole = Part { controls: self.controls, u: 0.0, width: 1.0, depth };
        let stretches =
            if whole.is_missed() { Stretches::default() } else { Self::stretches(whole) };
        let piece = 1.0 / f64::from(1 << depth);
        let (start, scale) = (self.start, self.scale);
        stretches
            .improved(move |end| self.improved(end, piece))
            .map(move |(z, u)| ((start + z) * scale, u))
    }

    fn stretches(whole: Part) -> Stretches {
        let mut found = Stretches::default();
        Self::add_stretches(&whole, &mut found);
        found
    }

    /// Adds the intervals of a part, its first half first.
    fn add_stretches(part: &Part, found: &mut Stretches) {
        if part.is_missed() {
            return;
        }
        if part.depth > 0 {
            part.halves().iter().for_each(|half| Self::add_stretches(half, found));
            return;
        }
        let axis = UnitRay { origin: DVec3::ZERO, direction: DVec3::Z, scale: 1.0 };
        let ball = |c: DVec4| Ball { center: c.truncate(), radius: c.w };
        if let Some(ends) = axis.hull_span(&[ball(part.controls[0]), ball(part.controls[3])]) {
            let [enter, exit] = ends.map(|(z, v)| (z, part.u + v * part.width));
            found.add(Stretch { enter, exit });
        }
    }

    /// The crossing, nearest to `z`, of the ball at an end of the curve (`u` is 0 or 1); `None` if
    /// a neighbouring ball extends beyond that ball there.
    fn on_end(&self, (z, u): (f64, f64)) -> Option<(f64, f64)> {
        let at = derivatives(&self.controls, u);
        let c = at[0];
        let half = (c.w * c.w - c.x * c.x - c.y * c.y).sqrt();
        let z = if z < c.z { c.z - half } else { c.z + half };
        let [g, _] = envelope(&at, DVec3::Z * z);
        let is_outermost = if u <= 0.0 { g >= 0.0 } else { g <= 0.0 };
        is_outermost.then_some((z, u))
    }

    /// Refines a crossing of a piece to a crossing of the true surface, as length and curve
    /// parameter: a point whose distance from the curve has a minimum at that parameter, equal to
    /// the radius. `None` if the iteration finds none nearby. `piece` is the width of a piece in
    /// the curve parameter.
    fn improved(&self, (z, u): (f64, f64), piece: f64) -> Option<(f64, f64)> {
        if let Some(at_end) = (u <= 0.0 || u >= 1.0).then(|| self.on_end((z, u))).flatten() {
            return Some(at_end);
        }
        let (mut new_z, mut new_u) = (z, u);
        for _ in 0..8 {
            let at = derivatives(&self.controls, new_u);
            let p = DVec3::Z * new_z;
            let e = p - at[0].truncate();
            let f = e.length_squared() - at[0].w * at[0].w;
            let [g, g_u] = envelope(&at, p);
            // Derivatives of f by z and u, and of g by z.
            let (f_z, f_u, g_z) = (2.0 * e.z, 2.0 * g, -at[1].z);
            let determinant = f_z * g_u - f_u * g_z;
            let (dz, du) = ((g * f_u - f * g_u) / determinant, (f * g_z - g * f_z) / determinant);
            (new_z, new_u) = (new_z + dz, new_u + du);
            let is_near = (new_u - u).abs() <= 2.0 * piece;
            if !is_near || !new_z.is_finite() {
                return None;
            }
            if !(0.0..=1.0).contains(&new_u) {
                return self.on_end((z, new_u.clamp(0.0, 1.0)));
            }
            if dz.abs() <= 1e-13 * (new_z.abs() + at[0].w) {
                return (g_u > 0.0).then_some((new_z, new_u));
            }
        }
        None
    }
}

/// Disjoint intervals in ascending order.
#[derive(Clone, Copy)]
struct Stretches {
    list: [Stretch; MAX_STRETCHES],
    count: usize,
}

impl Default for Stretches {
    fn default() -> Self {
        Self { list: [Stretch { enter: (0.0, 0.0), exit: (0.0, 0.0) }; MAX_STRETCHES], count: 0 }
    }
}

impl Stretches {
    /// Adds an interval, merged with those it overlaps.
    fn add(&mut self, mut new: Stretch) {
        let old = &self.list[..self.count];
        let first = old.iter().take_while(|old| old.exit.0 < new.enter.0).count();
        let overlapped = old[first..].iter().take_while(|old| old.enter.0 <= new.exit.0).count();
        for old in &old[first..first + overlapped] {
            new.enter = if old.enter.0 < new.enter.0 { old.enter } else { new.enter };
            new.exit = if old.exit.0 > new.exit.0 { old.exit } else { new.exit };
        }
        if overlapped == 0 && self.count == MAX_STRETCHES {
            let last = &mut self.list[MAX_STRETCHES - 1];
            last.exit = if new.exit.0 > last.exit.0 { new.exit } else { last.exit };
            return;
        }
        // The intervals behind move up or down to follow the new one.
        self.list.copy_within(first + overlapped..self.count, first + 1);
        self.list[first] = new;
        self.count = self.count + 1 - overlapped;
    }

    /// The refined ends of the intervals. An end that refinement would move out of order keeps its
    /// old value. Each is refined only when the iterator reaches it.
    fn improved(
        self,
        moved: impl Fn((f64, f64)) -> Option<(f64, f64)>,
    ) -> impl Iterator<Item = (f64, f64)> {
        let mut last = f64::NEG_INFINITY;
        (0..2 * self.count).map(move |i| {
            let Stretch { enter, exit } = self.list[i / 2];
            let before = match self.list[..self.count].get(i / 2 + 1) {
                _ if i % 2 == 0 => exit.0,
                Some(next) => next.enter.0,
                None => f64::INFINITY,
            };
            let old = if i % 2 == 0 { enter } else { exit };
            let new = moved(old).filter(|new| new.0 > last && new.0 < before).unwrap_or(old);
            last = new.0;
            new
        })
    }
}
