//! Curves as tubes and ribbons of triangles.

use super::super::Builder;
use super::super::lexer::quoted;
use super::super::params::Params;
use super::Made;
use crate::scene::fault::Fault;
use snell_intersect::TriangleMesh;
use snell_math::{Vec2, Vec3};

/// Most pieces of a segment along the curve.
const ALONG: usize = 8;
/// A piece of a segment turns by no more than this, radians.
const TURN: f32 = 0.25;
/// Sides of a tube.
const SIDES: usize = 5;

/// How control points make a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Basis {
    Bezier,
    BSpline,
}

impl Builder<'_> {
    pub(super) fn curve(&mut self, params: &Params) -> Result<Made, Fault> {
        let points = self.points(params)?;
        let width = params.float_or("width", 1.0)?;
        let widths = [params.float_or("width0", width)? as f32, params.float_or("width1", width)? as f32];
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
            Basis::Bezier if points.len() > degree && (points.len() - 1) % degree == 0 => (points.len() - 1) / degree,
            Basis::BSpline if points.len() > degree => points.len() - degree,
            _ => {
                let problem = format!("{} points do not make curves of degree {degree}", points.len());
                return Err(
                    params.fault(problem, "give 1 more than a multiple of the degree (bspline: more than the degree)")
                );
            }
        };
        let normals = params.directions("N")?;
        let is_ribbon = match params.string("type")?.unwrap_or("flat") {
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
        self.note("curves", params.at, || {
            "curves are made of triangles: ribbons where they have normals, tubes of five sides elsewhere".into()
        });
        let at = |position: f32| {
            let segment = (position as usize).min(segments - 1);
            let stride = if basis == Basis::Bezier { degree } else { 1 };
            let p = &points[segment * stride..=segment * stride + degree];
            evaluate(basis, p, position - segment as f32)
        };
        let pieces = pieces(segments, at);
        let rings = segments * pieces;
        let sides = if is_ribbon { 1 } else { SIDES };
        if !self.may_make(params, 2 * rings * sides) {
            return Ok(Made::Nothing);
        }
        let mut strip = Strip { mesh: TriangleMesh::default(), sides, side: Vec3::ZERO };
        for ring in 0..=rings {
            let position = ring as f32 / pieces as f32;
            let (center, tangent) = at(position);
            let v = position / segments as f32;
            let radius = 0.5 * (widths[0] + (widths[1] - widths[0]) * v);
            let normal = is_ribbon.then(|| {
                let segment = (position as usize).min(segments - 1);
                let t = position - segment as f32;
                normals[segment] * (1.0 - t) + normals[segment + 1] * t
            });
            strip.add_ring(center, tangent, radius, v, normal);
        }
        Ok(self.finish_mesh(strip.mesh))
    }
}

/// Into how many pieces each segment is cut, by how much the most bent one turns.
fn pieces(segments: usize, at: impl Fn(f32) -> (Vec3, Vec3)) -> usize {
    let tangent = |segment: usize, t: f32| at(segment as f32 + t).1.normalize_or_zero();
    let turn = |segment: usize| {
        let [a, b, c] = [1e-3, 0.5, 0.999].map(|t| tangent(segment, t));
        a.angle_between(b) + b.angle_between(c)
    };
    let most = (0..segments).map(turn).fold(0.0, f32::max);
    (most / TURN).ceil().clamp(1.0, ALONG as f32) as usize
}

/// Point and derivative (any length) of a curve of degree 2 or 3 at `t` from 0 to 1, by de Casteljau's and de Boor's schemes.
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
                // Uniform knots: the interval of this round is `left` long and begins `left - 1 - i` before the segment.
                Basis::BSpline => (t + (left - 1 - i) as f32) / left as f32,
            };
            q[i] = q[i].lerp(q[i + 1], weight);
        }
    }
    (q[0], tangent)
}

/// Rings of vertices along a curve, joined by triangles.
struct Strip {
    mesh: TriangleMesh,
    sides: usize,
    /// A direction across the curve, carried along it.
    side: Vec3,
}

impl Strip {
    fn add_ring(&mut self, center: Vec3, tangent: Vec3, radius: f32, v: f32, normal: Option<Vec3>) {
        let along = tangent.normalize_or(Vec3::Z);
        let carried = self.side - along * self.side.dot(along);
        self.side = carried.try_normalize().unwrap_or_else(|| along.any_orthonormal_vector());
        let first = self.mesh.positions.len() as u32;
        let points = self.sides + 1;
        for i in 0..points {
            let u = i as f32 / self.sides as f32;
            let (position, outward) = match normal {
                Some(normal) => {
                    let across = normal.cross(along).normalize_or(self.side);
                    (center + across * (radius * (2.0 * u - 1.0)), normal)
                }
                None => {
                    let (sin, cos) = (u * std::f32::consts::TAU).sin_cos();
                    let outward = self.side * cos + along.cross(self.side) * sin;
                    (center + outward * radius, outward)
                }
            };
            self.mesh.positions.push(position);
            self.mesh.normals.push(outward);
            self.mesh.uvs[0].push(Vec2::new(v, u));
        }
        let Some(before) = first.checked_sub(points as u32) else { return };
        for i in 0..self.sides as u32 {
            let [a, b] = [before + i, first + i];
            self.mesh.indices.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
        }
    }
}
