//! Light samples by solid angle, from near rectangles and triangles and from spheres: sixteen at
//! once, in double precision.

use crate::lanes::{LANES, put};
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::Wide;
use snell_math::{DVec2, DVec3, Vec2, Vec3, at_level};
use snell_scene::light::area::{
    NearPart, NearRectangle, NearSample, NearSphere, NearTriangle, RoundSample,
};

/// The number of near parts of one kind that are sampled together.
const NEAR_LANES: usize = 16;

/// The kinds of near parts.
pub const RECTANGLE: u32 = 0;
pub const TRIANGLE: u32 = 1;
pub const SPHERE: u32 = 2;

/// Samples of the near parts of lights.
#[derive(Debug, Default)]
pub struct NearLights {
    /// The lanes that have a near part, and the lanes among them that have one kind.
    pub lanes: Vec<u32>,
    of_kind: Vec<u32>,
    viewers: Viewers,
    rectangles: NearRectangles,
    triangles: NearTriangles,
    spheres: NearSpheres,
    round: RoundSamples,
    found: NearSamples<NEAR_LANES>,
    /// The samples, by lane.
    pub samples: NearSamples<LANES>,
}

/// The receivers, random numbers and precomputed data of the samples, by lane.
#[derive(Clone, Copy, Debug)]
pub struct NearParts<'a> {
    pub positions: &'a HitVectors,
    pub u: &'a [HitLanes; 2],
    pub kind: &'a [u32; LANES],
    /// The columns of [`FlatPart`](snell_scene::light::area::FlatPart).
    pub corner: &'a HitVectors,
    pub edges: &'a [HitVectors; 2],
}

/// The points that receive the samples, and the samples' random numbers.
#[derive(Debug, Default)]
struct Viewers {
    from: [[f32; NEAR_LANES]; 3],
    u: [[f32; NEAR_LANES]; 2],
}

/// The columns of the rectangles that are sampled together.
#[derive(Debug, Default)]
struct NearRectangles {
    center: [[f64; NEAR_LANES]; 3],
    axes: [[[f64; NEAR_LANES]; 3]; 2],
    half: [[f64; NEAR_LANES]; 2],
}

/// The columns of the triangles that are sampled together.
#[derive(Debug, Default)]
struct NearTriangles {
    corner: [[f32; NEAR_LANES]; 3],
    edges: [[[f32; NEAR_LANES]; 3]; 2],
}

/// The columns of the spheres that are sampled together.
#[derive(Debug, Default)]
struct NearSpheres {
    center: [[f64; NEAR_LANES]; 3],
    radius: [f64; NEAR_LANES],
}

/// The columns of [`RoundSample`].
#[derive(Debug, Default)]
struct RoundSamples {
    normal: [[f32; NEAR_LANES]; 3],
    error: [[f32; NEAR_LANES]; 3],
}

/// The columns of [`NearSample`].
#[derive(Debug)]
pub struct NearSamples<const N: usize> {
    position: [[f32; N]; 3],
    direction: [[f32; N]; 3],
    pdf: [f32; N],
    is_seen: [u32; N],
    exists: [u32; N],
}

impl<const N: usize> Default for NearSamples<N> {
    fn default() -> Self {
        let zero = [[0.0; N]; 3];
        Self { position: zero, direction: zero, pdf: [0.0; N], is_seen: [0; N], exists: [0; N] }
    }
}

impl NearLights {
    /// Samples the near parts of the lanes in [`Self::lanes`]. `part` gives the data of rectangles
    /// and spheres that `parts` lacks. Normals and error bounds of sampled points on spheres are
    /// written to the columns given for them.
    #[inline(never)]
    pub fn sample(
        &mut self,
        parts: &NearParts,
        part: impl Fn(usize) -> Option<NearPart>,
        [normal, error]: [&mut HitVectors; 2],
        wide: Option<Wide>,
    ) {
        let Self { lanes, of_kind, viewers, round, found, samples, .. } = self;
        let Self { rectangles, triangles, spheres, .. } = self;
        samples.is_seen = [0; LANES];
        for kind in [RECTANGLE, TRIANGLE, SPHERE] {
            of_kind.clear();
            of_kind.extend(lanes.iter().filter(|&&lane| parts.kind[lane as usize] == kind));
            for lanes in of_kind.chunks(NEAR_LANES) {
                viewers.gather(lanes, parts);
                let by: &Viewers = viewers;
                match kind {
                    RECTANGLE => {
                        rectangles.gather(lanes, &part);
                        let of: &NearRectangles = rectangles;
                        at_level!(
                            wide,
                            near_rectangles,
                            (
                                of: &NearRectangles = of,
                                by: &Viewers = by,
                                to: &mut NearSamples<NEAR_LANES> = found
                            )
                        );
                    }
                    TRIANGLE => {
                        triangles.gather(lanes, parts);
                        let of: &NearTriangles = triangles;
                        at_level!(
                            wide,
                            near_triangles,
                            (
                                of: &NearTriangles = of,
                                by: &Viewers = by,
                                to: &mut NearSamples<NEAR_LANES> = found
                            )
                        );
                    }
                    _ => {
                        spheres.gather(lanes, &part);
                        let of: &NearSpheres = spheres;
                        at_level!(
                            wide,
                            near_spheres,
                            (
                                of: &NearSpheres = of,
                                by: &Viewers = by,
                                to: &mut NearSamples<NEAR_LANES> = found,
                                round: &mut RoundSamples = round,
                            )
                        );
                        for (i, &lane) in lanes.iter().enumerate() {
                            put(normal, lane as usize, vector(&round.normal, i));
                            put(error, lane as usize, vector(&round.error, i));
                        }
                    }
                }
                samples.take(lanes, found);
            }
        }
    }
}

impl Viewers {
    fn gather(&mut self, lanes: &[u32], NearParts { positions, u, .. }: &NearParts) {
        for (i, &lane) in lanes.iter().enumerate() {
            let lane = lane as usize;
            for (from, positions) in self.from.iter_mut().zip(*positions) {
                from[i] = positions[lane];
            }
            (self.u[0][i], self.u[1][i]) = (u[0][lane], u[1][lane]);
        }
    }

    /// The point that receives sample `i`, and the random numbers of the sample.
    #[inline(always)]
    fn get(&self, i: usize) -> (Vec3, Vec2) {
        (vector(&self.from, i), Vec2::new(self.u[0][i], self.u[1][i]))
    }
}

impl NearRectangles {
    fn gather(&mut self, lanes: &[u32], part: impl Fn(usize) -> Option<NearPart>) {
        for (i, &lane) in lanes.iter().enumerate() {
            let Some(NearPart::Rectangle(rectangle)) = part(lane as usize) else { continue };
            for axis in 0..3 {
                self.center[axis][i] = rectangle.center[axis];
                self.axes[0][axis][i] = rectangle.axes[0][axis];
                self.axes[1][axis][i] = rectangle.axes[1][axis];
            }
            (self.half[0][i], self.half[1][i]) = (rectangle.half.x, rectangle.half.y);
        }
    }
}

impl NearTriangles {
    fn gather(&mut self, lanes: &[u32], NearParts { corner, edges, .. }: &NearParts) {
        for (i, &lane) in lanes.iter().enumerate() {
            let lane = lane as usize;
            for axis in 0..3 {
                self.corner[axis][i] = corner[axis][lane];
                self.edges[0][axis][i] = edges[0][axis][lane];
                self.edges[1][axis][i] = edges[1][axis][lane];
            }
        }
    }
}

impl NearSpheres {
    fn gather(&mut self, lanes: &[u32], part: impl Fn(usize) -> Option<NearPart>) {
        for (i, &lane) in lanes.iter().enumerate() {
            let Some(NearPart::Sphere(NearSphere { center, radius })) = part(lane as usize) else {
                continue;
            };
            for axis in 0..3 {
                self.center[axis][i] = center[axis];
            }
            self.radius[i] = radius;
        }
    }
}

/// The vector of a lane.
#[inline(always)]
fn vector<const N: usize>(v: &[[f32; N]; 3], i: usize) -> Vec3 {
    Vec3::new(v[0][i], v[1][i], v[2][i])
}

impl<const N: usize> NearSamples<N> {
    #[inline(always)]
    fn put(&mut self, i: usize, sample: &NearSample) {
        for axis in 0..3 {
            self.position[axis][i] = sample.position[axis];
            self.direction[axis][i] = sample.direction[axis];
        }
        self.pdf[i] = sample.pdf;
        self.is_seen[i] = u32::from(sample.is_seen);
        self.exists[i] = u32::from(sample.exists);
    }

    #[inline(always)]
    pub fn get(&self, i: usize) -> NearSample {
        NearSample {
            position: vector(&self.position, i),
            direction: vector(&self.direction, i),
            pdf: self.pdf[i],
            is_seen: self.is_seen[i] != 0,
            exists: self.exists[i] != 0,
        }
    }

    /// Copies the samples in `found` to their lanes.
    fn take(&mut self, lanes: &[u32], found: &NearSamples<NEAR_LANES>) {
        for (i, &lane) in lanes.iter().enumerate() {
            self.put(lane as usize, &found.get(i));
        }
    }
}

/// Applies [`NearRectangle::sample`] to all columns.
#[inline(always)]
fn near_rectangles(of: &NearRectangles, by: &Viewers, to: &mut NearSamples<NEAR_LANES>) {
    for i in 0..NEAR_LANES {
        let vector = |v: &[[f64; NEAR_LANES]; 3]| DVec3::new(v[0][i], v[1][i], v[2][i]);
        let rectangle = NearRectangle {
            center: vector(&of.center),
            axes: [vector(&of.axes[0]), vector(&of.axes[1])],
            half: DVec2::new(of.half[0][i], of.half[1][i]),
        };
        let (from, u) = by.get(i);
        to.put(i, &rectangle.sample(from, u));
    }
}

/// Applies [`NearTriangle::sample`] to all columns.
#[inline(always)]
fn near_triangles(of: &NearTriangles, by: &Viewers, to: &mut NearSamples<NEAR_LANES>) {
    for i in 0..NEAR_LANES {
        let edges = [vector(&of.edges[0], i), vector(&of.edges[1], i)];
        let triangle = NearTriangle { corner: vector(&of.corner, i), edges };
        let (from, u) = by.get(i);
        to.put(i, &triangle.sample(from, u));
    }
}

/// Applies [`NearSphere::sample`] to all columns.
#[inline(always)]
fn near_spheres(
    of: &NearSpheres,
    by: &Viewers,
    to: &mut NearSamples<NEAR_LANES>,
    round: &mut RoundSamples,
) {
    for i in 0..NEAR_LANES {
        let center = DVec3::new(of.center[0][i], of.center[1][i], of.center[2][i]);
        let sphere = NearSphere { center, radius: of.radius[i] };
        let (from, u) = by.get(i);
        let RoundSample { seen, normal, error } = sphere.sample(from, u);
        to.put(i, &seen);
        for axis in 0..3 {
            round.normal[axis][i] = normal[axis];
            round.error[axis][i] = error[axis];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::rng::uniform2;
    use snell_math::simd::Level;

    #[test]
    fn near_rectangles_are_sampled_alike_at_every_level() {
        let number = |i: u32, k: u32| uniform2([i, k, 5, 5]).x * 2.0 - 1.0;
        let vector = |i: u32, k: u32| {
            Vec3::new(number(i, 3 * k), number(i, 3 * k + 1), number(i, 3 * k + 2))
        };
        let (mut of, mut by) = (NearRectangles::default(), Viewers::default());
        let cases: [_; NEAR_LANES] = std::array::from_fn(|i| {
            let (x, y) = vector(i as u32, 0).as_dvec3().normalize().any_orthonormal_pair();
            let rectangle = NearRectangle {
                center: vector(i as u32, 1).as_dvec3(),
                axes: [x, y],
                half: vector(i as u32, 2).as_dvec3().abs().truncate(),
            };
            let (from, u) = (vector(i as u32, 3) * 0.5, uniform2([i as u32, 9, 5, 5]));
            for axis in 0..3 {
                by.from[axis][i] = from[axis];
                of.center[axis][i] = rectangle.center[axis];
                of.axes[0][axis][i] = x[axis];
                of.axes[1][axis][i] = y[axis];
            }
            ([of.half[0][i], of.half[1][i]], [by.u[0][i], by.u[1][i]]) =
                (rectangle.half.to_array(), u.to_array());
            (rectangle, from, u)
        });
        for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            let mut found = NearSamples::default();
            let (of, by) = (&of, &by);
            at_level!(
                level.wide(),
                near_rectangles,
                (
                    of: &NearRectangles = of,
                    by: &Viewers = by,
                    to: &mut NearSamples<NEAR_LANES> = &mut found
                )
            );
            for (i, (rectangle, from, u)) in cases.iter().enumerate() {
                let single = rectangle.sample(*from, *u);
                let at = |v: &[[f32; NEAR_LANES]; 3]| Vec3::new(v[0][i], v[1][i], v[2][i]);
                assert!(single.exists);
                assert_eq!(
                    (at(&found.position), at(&found.direction)),
                    (single.position, single.direction),
                    "{level}"
                );
                assert_eq!((found.pdf[i], found.exists[i]), (single.pdf, 1), "{level}");
            }
        }
    }

    #[test]
    fn near_triangles_are_sampled_alike_at_every_level() {
        let number = |i: u32, k: u32| uniform2([i, k, 7, 7]).x * 2.0 - 1.0;
        let vector = |i: u32, k: u32| {
            Vec3::new(number(i, 3 * k), number(i, 3 * k + 1), number(i, 3 * k + 2))
        };
        let (mut of, mut by) = (NearTriangles::default(), Viewers::default());
        let cases: [_; NEAR_LANES] = std::array::from_fn(|lane| {
            let i = lane as u32;
            let triangle =
                NearTriangle { corner: vector(i, 1), edges: [vector(i, 2), vector(i, 3)] };
            let (from, u) = (vector(i, 4), uniform2([i, 9, 5, 5]));
            for axis in 0..3 {
                by.from[axis][lane] = from[axis];
                of.corner[axis][lane] = triangle.corner[axis];
                of.edges[0][axis][lane] = triangle.edges[0][axis];
                of.edges[1][axis][lane] = triangle.edges[1][axis];
            }
            [by.u[0][lane], by.u[1][lane]] = u.to_array();
            (triangle, from, u)
        });
        for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            let (mut found, of, by) = (NearSamples::default(), &of, &by);
            at_level!(
                level.wide(),
                near_triangles,
                (
                    of: &NearTriangles = of,
                    by: &Viewers = by,
                    to: &mut NearSamples<NEAR_LANES> = &mut found
                )
            );
            for (i, (triangle, from, u)) in cases.iter().enumerate() {
                let (single, found) = (triangle.sample(*from, *u), found.get(i));
                assert!(single.exists);
                assert_eq!(
                    (found.position, found.direction),
                    (single.position, single.direction),
                    "{level}"
                );
                assert_eq!((found.pdf, found.exists), (single.pdf, true), "{level}");
                assert_eq!(found.is_seen, single.is_seen, "{level}");
            }
        }
    }

    #[test]
    fn near_spheres_are_sampled_alike_at_every_level() {
        let number = |i: u32, k: u32| uniform2([i, k, 9, 9]).x * 2.0 - 1.0;
        let point = |i: u32, k: u32| {
            Vec3::new(number(i, 3 * k), number(i, 3 * k + 1), number(i, 3 * k + 2))
        };
        let (mut of, mut by) = (NearSpheres::default(), Viewers::default());
        // Viewpoints lie outside of the sphere, inside, and at its middle.
        let cases: [_; NEAR_LANES] = std::array::from_fn(|lane| {
            let i = lane as u32;
            let (center, from) = (
                point(i, 1),
                if lane == 3 { point(i, 1) } else { point(i, 2) * (1 << (i % 4)) as f32 },
            );
            let sphere = NearSphere {
                center: center.as_dvec3(),
                radius: f64::from(uniform2([i, 7, 9, 9]).x),
            };
            let u = uniform2([i, 9, 9, 9]);
            for axis in 0..3 {
                by.from[axis][lane] = from[axis];
                of.center[axis][lane] = sphere.center[axis];
            }
            of.radius[lane] = sphere.radius;
            [by.u[0][lane], by.u[1][lane]] = u.to_array();
            (sphere, from, u)
        });
        assert!(
            cases
                .iter()
                .any(|(sphere, from, _)| from.as_dvec3().distance(sphere.center) < sphere.radius)
        );
        for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            let (mut found, mut round) = (NearSamples::default(), RoundSamples::default());
            let (of, by) = (&of, &by);
            at_level!(
                level.wide(),
                near_spheres,
                (
                    of: &NearSpheres = of, by: &Viewers = by,
                    to: &mut NearSamples<NEAR_LANES> = &mut found,
                    round: &mut RoundSamples = &mut round,
                )
            );
            for (i, (sphere, from, u)) in cases.iter().enumerate() {
                let (RoundSample { seen, normal, error }, found) =
                    (sphere.sample(*from, *u), found.get(i));
                assert!(seen.exists && seen.is_seen && found.exists && found.is_seen);
                assert_eq!(
                    (found.position, found.direction, found.pdf),
                    (seen.position, seen.direction, seen.pdf)
                );
                assert_eq!(
                    (vector(&round.normal, i), vector(&round.error, i)),
                    (normal, error),
                    "{level}"
                );
            }
        }
    }
}
