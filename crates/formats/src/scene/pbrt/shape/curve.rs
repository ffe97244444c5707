//! Curves: round ones as strands, ribbons as triangles.

use super::super::Builder;
use super::super::lexer::quoted;
use super::super::params::Params;
use super::{Lamps, Made};
use crate::scene::fault::Fault;
use crate::strip::{Strip, pieces};
use snell_intersect::TriangleMesh;
use snell_math::{Vec3, Vec4};

/// The basis of the control points.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Basis {
    Bezier,
    BSpline,
}

impl Builder<'_> {
    pub(super) fn curve(&mut self, params: &Params) -> Result<Made, Fault> {
        let points = self.points(params)?;
        let width = params.float_or("width", 1.0)?;
        let widths =
            [params.float_or("width0", width)? as f32, params.float_or("width1", width)? as f32];
        let degree = self.count_param(params, "degree", 3, [2, 3])?;
        let basis = match params.string("basis")?.unwrap_or("bezier") {
            "bezier" => Basis::Bezier,
            "bspline" => Basis::BSpline,
            other => {
                let problem = format!("{} is not a basis", quoted(other.as_bytes()));
                return Err(params.fault(problem, "use bezier or bspline"));
            }
        };
        let segments = match basis {
            Basis::Bezier if points.len() > degree && (points.len() - 1) % degree == 0 => {
                (points.len() - 1) / degree
            }
            Basis::BSpline if points.len() > degree => points.len() - degree,
            _ => {
                let problem =
                    format!("{} points do not make curves of degree {degree}", points.len());
                return Err(params.fault(
                    problem,
                    "give 1 more than a multiple of the degree (bspline: more than the degree)",
                ));
            }
        };
        let normals = params.directions("N")?;
        let kind = params.string("type")?.unwrap_or("flat");
        let is_ribbon = match kind {
            "ribbon" => true,
            "flat" | "cylinder" => false,
            other => {
                let problem = format!("{} is not a type of curves", quoted(other.as_bytes()));
                return Err(params.fault(problem, "use flat, cylinder or ribbon"));
            }
        };
        if is_ribbon && normals.len() != segments + 1 {
            let problem = format!("{} normals for {segments} segments of a ribbon", normals.len());
            return Err(params.fault(problem, format!("give {} in \"normal N\"", segments + 1)));
        }
        self.note_common(params);
        if let (false, Some(param)) = (is_ribbon, params.get("N")) {
            let at = param.at;
            self.note("normals of curves", at, || {
                "\"N\": only ribbons have normals; the curve is round".into()
            });
        }
        let stride = if basis == Basis::Bezier { degree } else { 1 };
        let controls = |segment: usize| &points[segment * stride..=segment * stride + degree];
        let radius = |position: f32| {
            0.5 * (widths[0] + (widths[1] - widths[0]) * position / segments as f32)
        };
        if !is_ribbon {
            if kind == "flat" {
                self.mention("flat curves", params.at, || {
                    "flat curves, which face each ray in pbrt, are round here: their outline is \
                        the same"
                        .into()
                });
            }
            return Ok(Made::Strand(strand(basis, segments, controls, radius)));
        }
        self.note("ribbons", params.at, || "ribbons are made of triangles".into());
        let at = |segment: usize, t: f32| evaluate(basis, controls(segment), t);
        let pieces = pieces(segments, |segment, t| at(segment, t).1);
        let rings = segments * pieces;
        if !self.may_make(params, 2 * rings) {
            return Ok(Made::Nothing);
        }
        let mut mesh = TriangleMesh::default();
        let mut strip = Strip::new(&mut mesh, 1);
        for ring in 0..=rings {
            let position = ring as f32 / pieces as f32;
            let segment = (position as usize).min(segments - 1);
            let t = position - segment as f32;
            let (center, tangent) = at(segment, t);
            let normal = normals[segment] * (1.0 - t) + normals[segment + 1] * t;
            strip.add_ring(
                center,
                tangent,
                radius(position),
                position / segments as f32,
                Some(normal),
            );
        }
        Ok(self.finish_mesh(mesh, Lamps::Triangles))
    }
}

/// Converts a curve to a strand of cubic Bézier segments. `radius` takes a position from 0 to the
/// number of segments.
fn strand<'p>(
    basis: Basis,
    segments: usize,
    controls: impl Fn(usize) -> &'p [Vec3],
    radius: impl Fn(f32) -> f32,
) -> Vec<Vec4> {
    let mut strand = Vec::with_capacity(3 * segments + 1);
    for segment in 0..segments {
        let bezier = bezier(basis, controls(segment));
        let knots = bezier.into_iter().zip(0u8..);
        let points = knots.map(|(p, i)| p.extend(radius(segment as f32 + f32::from(i) / 3.0)));
        strand.extend(points.skip(usize::from(segment > 0)));
    }
    strand
}

/// Converts a segment of degree 2 or 3 to a cubic Bézier curve, by the values of its blossom at the
/// segment's ends.
fn bezier(basis: Basis, p: &[Vec3]) -> [Vec3; 4] {
    let third = 1.0 / 3.0;
    match (basis, p) {
        (Basis::Bezier, &[a, b, c, d]) => [a, b, c, d],
        (Basis::Bezier, &[a, b, c]) => [a, a.lerp(b, 2.0 * third), c.lerp(b, 2.0 * third), c],
        (Basis::BSpline, &[a, b, c, d]) => {
            let [b1, b2] = [b.lerp(c, third), b.lerp(c, 2.0 * third)];
            [a.lerp(b, 2.0 * third).midpoint(b1), b1, b2, b2.midpoint(c.lerp(d, third))]
        }
        (Basis::BSpline, &[a, b, c]) => bezier(Basis::Bezier, &[a.midpoint(b), b, b.midpoint(c)]),
        _ => unreachable!("degrees are 2 and 3"),
    }
}

/// Point and derivative (any length) of a curve of degree 2 or 3 at `t` from 0 to 1, by de
/// Casteljau's and de Boor's schemes.
fn evaluate(basis: Basis, p: &[Vec3], t: f32) -> (Vec3, Vec3) {
    let degree = p.len() - 1;
    let mut q = [Vec3::ZERO; 4];
    q[..p.len()].copy_from_slice(p);
    let mut tangent = Vec3::ZERO;
    for round in 0..degree {
        let left = degree - round;
        if left == 1 {
            tangent = q[1] - q[0];
        }
        for i in 0..left {
            let weight = match basis {
                Basis::Bezier => t,
                // Uniform knots: the interval of this round is `left` long and begins
                // `left - 1 - i` before the segment.
                Basis::BSpline => (t + (left - 1 - i) as f32) / left as f32,
            };
            q[i] = q[i].lerp(q[i + 1], weight);
        }
    }
    (q[0], tangent)
}
