//! Finds, for batches of rays that pass interfaces, the points where they continue, with the same
//! bits as [`snell_intersect::SurfacePoint`].

use crate::compile::CompiledScene;
use crate::lanes::{LANES, ZERO, at, put};
use snell_intersect::triangles::{HitVectors, PlainMesh};
use snell_intersect::{GeometryId, Hit, RayQuery, SurfacePoint, TriangleHits, TrianglePoints};
use snell_math::simd::Wide;
use snell_math::{Ray, Vec3, at_level, robust};

/// Batches of at most this many rays are processed one by one.
const FEW: usize = 6;

/// The point of an interface where a ray continues.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InterfaceCrossing {
    /// The origin of the continued ray.
    pub origin: Vec3,
    /// True if the ray arrives from the outer side.
    pub enters: bool,
    /// True if the point is on the outside of a curve.
    pub on_curve: bool,
}

/// Finds [`InterfaceCrossing`]s for batches of rays.
#[derive(Debug)]
pub struct InterfaceCrossings<'a> {
    scene: &'a CompiledScene,
    /// The triangles of each geometry that is a plain mesh; `None` for other geometries.
    meshes: Vec<Option<PlainMesh<'a>>>,
    wide: Option<Wide>,
    triangles: TriangleHits,
    points: TrianglePoints,
    ways: Ways,
    /// The crossings of the last batch of rays.
    found: Vec<InterfaceCrossing>,
}

/// Directions and new origins of rays, by lane.
#[derive(Debug)]
struct Ways {
    direction: HitVectors,
    origin: HitVectors,
    enters: [u32; LANES],
}

impl InterfaceCrossing {
    fn of(point: &SurfacePoint, direction: Vec3) -> Self {
        Self {
            origin: point.ray_origin(direction),
            enters: point.is_front_facing(direction),
            on_curve: point.on_curve,
        }
    }
}

impl<'a> InterfaceCrossings<'a> {
    /// Finds crossings of the interfaces of this scene.
    pub fn new(scene: &'a CompiledScene) -> Self {
        let plain = |geometry: usize| scene.world.plain_mesh(GeometryId(geometry as u32));
        Self {
            scene,
            meshes: (0..scene.world.geometry_count()).map(plain).collect(),
            wide: scene.world.simd().wide(),
            triangles: TriangleHits::default(),
            points: TrianglePoints::default(),
            ways: Ways { direction: ZERO, origin: ZERO, enters: [0; LANES] },
            found: Vec::new(),
        }
    }

    /// The crossings of the last batch, in order.
    pub fn found(&self) -> &[InterfaceCrossing] {
        &self.found
    }

    /// Computes the points where rays continue from these hits. `times` are the times of the rays.
    pub fn find(&mut self, rays: &[Ray], times: &[f32], hits: &[Hit]) {
        self.found.clear();
        self.found.resize(rays.len(), InterfaceCrossing::default());
        for first in (0..rays.len()).step_by(LANES) {
            let some = first..rays.len().min(first + LANES);
            if some.len() <= FEW {
                some.for_each(|i| self.found[i] = self.find_one(&rays[i], times[i], &hits[i]));
                continue;
            }
            self.find_plain(&rays[some.clone()], &hits[some.clone()]);
            for i in some {
                let lane = i - first;
                let is_found =
                    plain(&self.meshes, &hits[i]).is_some() && self.points.is_sound[lane] != 0;
                self.found[i] = match is_found {
                    true => InterfaceCrossing {
                        origin: at(&self.ways.origin, lane),
                        enters: self.ways.enters[lane] != 0,
                        on_curve: false,
                    },
                    false => self.find_one(&rays[i], times[i], &hits[i]),
                };
            }
        }
    }

    fn find_one(&self, ray: &Ray, time: f32, hit: &Hit) -> InterfaceCrossing {
        let query = RayQuery { time, ..RayQuery::from(ray) };
        InterfaceCrossing::of(&self.scene.world.point(query, hit), ray.direction)
    }

    /// Computes the crossings of at most [`LANES`] hits on plain triangles.
    fn find_plain(&mut self, rays: &[Ray], hits: &[Hit]) {
        let Self { meshes, triangles, points, ways, wide, .. } = self;
        let on_mesh = |(lane, hit)| plain(meshes, hit).map(|mesh| (lane, mesh, hit));
        triangles.gather(hits.iter().enumerate().filter_map(on_mesh));
        triangles.points(points, *wide);
        rays.iter()
            .enumerate()
            .for_each(|(lane, ray)| put(&mut ways.direction, lane, ray.direction));
        at_level!(*wide, leave, (points: &TrianglePoints = points, ways: &mut Ways = ways));
    }
}

/// The mesh that was hit, if it is a plain one outside of instances.
#[inline(always)]
fn plain<'m, 'a>(meshes: &'m [Option<PlainMesh<'a>>], hit: &Hit) -> Option<&'m PlainMesh<'a>> {
    meshes[hit.geometry as usize].as_ref().filter(|_| hit.instance == 0)
}

/// Applies [`SurfacePoint::ray_origin`] and [`SurfacePoint::is_front_facing`] in every lane.
#[inline(always)]
fn leave(points: &TrianglePoints, ways: &mut Ways) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let (direction, normal) = (vector(&ways.direction), vector(&points.geometric_normal));
        let (position, error) = (vector(&points.position), vector(&points.position_error));
        let origin = robust::offset_ray_origin(position, error, normal, direction);
        for axis in 0..3 {
            ways.origin[axis][i] = origin[axis];
        }
        ways.enters[i] = u32::from(direction.dot(normal) < 0.0);
    }
}
