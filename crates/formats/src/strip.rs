//! Tessellates curves: into ribbons, and into tubes where a format has no curves.

use snell_intersect::{Curves, TriangleMesh};
use snell_math::{DVec4, Vec2, Vec3, Vec4, real};

/// Maximum number of pieces of a segment along a curve.
const ALONG: usize = 8;
/// Maximum turn of a piece of a segment, in radians.
const TURN: f32 = 0.25;
/// Sides of a tube.
const SIDES: usize = 5;

/// The number of pieces into which each segment is cut, by how far the most strongly bent one
/// turns. `tangent` gets a segment and a parameter from 0 to 1; its length does not matter.
pub fn pieces(segments: usize, tangent: impl Fn(usize, f32) -> Vec3) -> usize {
    let turn = |segment: usize| {
        let [a, b, c] = [1e-3, 0.5, 0.999].map(|t| tangent(segment, t).normalize_or_zero());
        a.angle_between(b) + b.angle_between(c)
    };
    let most = (0..segments).map(turn).fold(0.0, f32::max);
    (most / TURN).ceil().clamp(1.0, ALONG as f32) as usize
}

/// Tessellates strands into tubes of five sides, open at the ends, with the strands' normals and
/// texture coordinates.
pub fn tubes(curves: &Curves) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for (strand, points) in curves.strand_points().enumerate() {
        if points.windows(2).all(|p| p[0] == p[1]) {
            if curves.segments_of(strand).any(|i| curves.bezier(i).is_some()) {
                add_ball(&mut mesh, points[0]);
            }
            color_rest(&mut mesh, curves, strand);
            continue;
        }
        // A degenerate segment is left out, and a new tube begins after it.
        let segments: Vec<Option<[DVec4; 4]>> =
            curves.segments_of(strand).map(|i| curves.bezier(i)).collect();
        let at = |segment: usize, t: f32| {
            let c = segments[segment].unwrap_or_default();
            let [ab, bc, cd] = [0, 1, 2].map(|i| c[i].lerp(c[i + 1], t.into()));
            let [abc, bcd] = [ab.lerp(bc, t.into()), bc.lerp(cd, t.into())];
            let ends = if abc.truncate() == bcd.truncate() { c[3] - c[0] } else { bcd - abc };
            (abc.lerp(bcd, t.into()).as_vec4(), ends.truncate().as_vec3())
        };
        let pieces = pieces(segments.len(), |segment, t| at(segment, t).1);
        let mut strip = Strip::new(&mut mesh, SIDES);
        for (number, _) in segments.iter().enumerate().filter(|(_, segment)| segment.is_some()) {
            let goes_on = number > 0 && segments[number - 1].is_some();
            if !goes_on {
                strip = Strip::new(strip.mesh, SIDES);
            }
            for piece in usize::from(goes_on)..=pieces {
                let t = piece as f32 / pieces as f32;
                let (center, tangent) = at(number, t);
                strip.add_ring(
                    center.truncate(),
                    tangent,
                    center.w,
                    (number as f32 + t) / segments.len() as f32,
                    None,
                );
            }
        }
        color_rest(&mut mesh, curves, strand);
    }
    mesh
}

/// Adds a ball as an octahedron with smooth normals.
fn add_ball(mesh: &mut TriangleMesh, ball: Vec4) {
    let first = mesh.positions.len() as u32;
    for axis in Vec3::AXES {
        for normal in [axis, -axis] {
            mesh.positions.push(ball.truncate() + normal * ball.w);
            mesh.normals.push(normal);
            mesh.uvs[0].push(Vec2::ZERO);
        }
    }
    for corner in 0..8u32 {
        let sides = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
        let [x, y, z] = [0, 2, 4].map(|axis| first + axis + sides[axis as usize / 2]);
        mesh.indices.push(if corner.count_ones() % 2 == 0 { [x, y, z] } else { [x, z, y] });
    }
}

/// Gives the last vertices, which are those of a strand, its colours.
fn color_rest(mesh: &mut TriangleMesh, curves: &Curves, strand: usize) {
    if !curves.colors().is_empty() {
        let along = &mesh.uvs[0][mesh.colors.len()..];
        mesh.colors.extend(along.iter().map(|uv| curves.color_of_strand(strand, uv.x)));
    }
}

/// Rings of vertices along a curve, joined by triangles.
pub struct Strip<'a> {
    mesh: &'a mut TriangleMesh,
    sides: usize,
    /// A unit vector across the curve, carried from ring to ring with little twist.
    side: Vec3,
    /// The first vertex of the previous ring.
    before: Option<u32>,
}

impl<'a> Strip<'a> {
    /// A strip that grows in a mesh: a tube with this many sides, or a ribbon with one.
    pub fn new(mesh: &'a mut TriangleMesh, sides: usize) -> Self {
        Self { mesh, sides, side: Vec3::ZERO, before: None }
    }

    /// Adds a ring of vertices around a point of the curve (for ribbons: across it, at right angles
    /// to a normal), and triangles that join it to the previous ring. `along` is their first
    /// texture coordinate.
    pub fn add_ring(
        &mut self,
        center: Vec3,
        tangent: Vec3,
        radius: f32,
        along: f32,
        normal: Option<Vec3>,
    ) {
        let axis = tangent.normalize_or(Vec3::Z);
        let carried = self.side - axis * self.side.dot(axis);
        self.side = carried.try_normalize().unwrap_or_else(|| axis.any_orthonormal_vector());
        let first = self.mesh.positions.len() as u32;
        for i in 0..=self.sides {
            let u = i as f32 / self.sides as f32;
            let (position, outward) = match normal {
                Some(normal) => {
                    let across = normal.cross(axis).normalize_or(self.side);
                    (center + across * (radius * (2.0 * u - 1.0)), normal)
                }
                None => {
                    let (sin, cos) = real::sin_cos(u * std::f32::consts::TAU);
                    let outward = self.side * cos + axis.cross(self.side) * sin;
                    (center + outward * radius, outward)
                }
            };
            self.mesh.positions.push(position);
            self.mesh.normals.push(outward);
            self.mesh.uvs[0].push(Vec2::new(along, u));
        }
        let Some(before) = self.before.replace(first) else { return };
        for i in 0..self.sides as u32 {
            let [a, b] = [before + i, first + i];
            self.mesh.indices.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
        }
    }
}

/// The maximum number of triangles that [`tubes`] makes.
pub fn most_triangles(curves: &Curves) -> usize {
    curves.segment_count().saturating_mul(ALONG * SIDES * 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_intersect::StrandBasis;

    #[test]
    fn tubes_have_about_the_area_of_their_strands_and_skip_what_is_never_hit() {
        let mut points: Vec<Vec4> = (0..7).map(|i| Vec4::new(i as f32, 0.0, 0.0, 0.1)).collect();
        let straight =
            Curves::new(StrandBasis::Linear, points.clone(), vec![3, 4]).expect("two strands");
        let mesh = tubes(&straight);
        mesh.validate().expect("a sound mesh");
        let area: f32 = (0..mesh.indices.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                assert!(
                    (b - a).cross(c - a).dot(mesh.normals[mesh.indices[t][0] as usize]) > 0.0,
                    "looks outwards"
                );
                (b - a).cross(c - a).length() * 0.5
            })
            .sum();
        // Five sides have 0.935 of the circumference; 2 + 3 units of length.
        assert!((area - 5.0 * 0.2 * std::f32::consts::PI * 0.9355).abs() < 1e-3, "{area}");
        assert!(mesh.uvs[0].iter().all(|uv| (0.0..=1.0).contains(&uv.x)));
        points[4].w = -1.0;
        let broken = Curves::new(StrandBasis::Linear, points, vec![3, 4]).expect("two strands");
        assert_eq!(tubes(&broken).indices.len(), 3 * 10);
        assert!(most_triangles(&straight) >= 50);
    }

    #[test]
    fn a_ball_looks_outwards_and_has_its_colour() {
        let red = [1.0, 0.0, 0.0, 1.0];
        let ball =
            Curves::new(StrandBasis::Linear, vec![Vec4::new(1.0, 2.0, 3.0, 0.5); 2], vec![2])
                .and_then(|ball| ball.with_colors(vec![red; 2]))
                .expect("a ball");
        let mesh = tubes(&ball);
        mesh.validate().expect("a sound mesh");
        assert_eq!((mesh.indices.len(), &mesh.colors), (8, &vec![red; 6]));
        for t in 0..8 {
            let [a, b, c] = mesh.corners(t);
            let middle = (a + b + c) / 3.0 - Vec3::new(1.0, 2.0, 3.0);
            assert!((b - a).cross(c - a).dot(middle) > 0.0, "{t}");
        }
    }
}
