//! Hits of random rays in random worlds, as a number: it is the same on every machine whose hits
//! are the same. `cargo xtask bits` compares machines by it.

use snell_intersect::shape::AnyShape;
use snell_intersect::{
    AcceptAll, BuildOptions, CubicCurves, CurveBasis, DHit, DTriangleMesh, DWorldBuilder, Grouping,
    Hit, Instance, LinearCurves, Spheres, TriangleMesh, WorldBuilder, WorldError,
};
use snell_math::rng::{pcg4d, to_unit};
use snell_math::simd::Level;
use snell_math::{DAffine3, DRay, DVec3, Ray, Transform, Vec3, Vec4, rotation};
use std::ops::Range;
use std::sync::Arc;

/// The number of rays that are traced in each world.
pub const RAYS_PER_WORLD: u32 = 4096;

/// What rays hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answers {
    /// How many rays hit something.
    pub hits: u64,
    /// A hash of all hits: their ids, and the bits of their distances and parameters.
    pub digest: u64,
}

impl Answers {
    const NONE: Self = Self { hits: 0, digest: 0xcbf2_9ce4_8422_2325 };

    /// Adds a number to the hash, which depends on the order.
    fn add(&mut self, number: u64) {
        self.digest = (self.digest ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    }

    fn add_hit(&mut self, ids: [u32; 3], bits: [u64; 3]) {
        self.hits += u64::from(ids[1] != Hit::NONE);
        for number in ids.map(u64::from).into_iter().chain(bits) {
            self.add(number);
        }
    }
}

/// Traces the rays of the worlds with these numbers.
///
/// # Errors
/// If a world cannot be built, which does not happen with memory left.
pub fn random_rays(worlds: Range<u32>, simd: Level) -> Result<Answers, WorldError> {
    let mut answers = Answers::NONE;
    for number in worlds {
        let mut random = Random { number, count: 0 };
        if number % 4 == 3 {
            random.in_double_precision(simd, &mut answers)?;
        } else {
            random.in_single_precision(simd, &mut answers)?;
        }
    }
    Ok(answers)
}

/// The random numbers of a world.
struct Random {
    number: u32,
    count: u32,
}

impl Random {
    fn numbers(&mut self) -> [u32; 4] {
        self.count += 1;
        pcg4d([self.number, self.count, 3, 11])
    }

    fn below(&mut self, n: u32) -> u32 {
        self.numbers()[0] % n
    }

    /// A point between -2 and 2, often of a coarse lattice, so that things touch and coincide.
    fn point(&mut self) -> Vec3 {
        let [x, y, z, kind] = self.numbers();
        let p = Vec3::from([x, y, z].map(to_unit)) * 4.0 - 2.0;
        if kind % 3 == 0 { (p * 2.0).round() * 0.5 } else { p }
    }

    fn balls(&mut self, count: u32) -> Vec<Vec4> {
        (0..count).map(|_| self.point().extend(to_unit(self.numbers()[1]) * 0.3)).collect()
    }

    fn transform(&mut self) -> Transform {
        let turn = rotation::about(
            self.point().as_dvec3().normalize_or(DVec3::Z),
            f64::from(self.point().x) * 2.0,
        );
        let scale = [DVec3::ONE, DVec3::splat(0.25), DVec3::new(1.0, -0.5, 2.0)];
        let scale = scale[self.below(3) as usize];
        let map = DAffine3::from_mat3_translation(turn, self.point().as_dvec3());
        Transform::new(map * DAffine3::from_scale(scale)).unwrap_or(Transform::IDENTITY)
    }

    /// Triangles among a few vertices, which share many edges, or many small ones.
    fn mesh(&mut self) -> TriangleMesh {
        let (vertices, triangles, size) =
            [(12, 30, 1.0), (40, 60, 1.0), (900, 900, 1.0), (30, 40, 1e4)][self.below(4) as usize];
        let positions: Vec<_> = (0..vertices).map(|_| self.point() * size).collect();
        let indices = (0..triangles).map(|i| match vertices > 100 {
            true => [i, i + 1, i + 2].map(|k| k % vertices),
            false => [0; 3].map(|_| self.below(vertices)),
        });
        TriangleMesh { indices: indices.collect(), positions, ..TriangleMesh::default() }
    }

    /// Rays at points, along axes and everywhere, those of each sixteen from one origin.
    fn rays(&mut self, aims: &[Vec3]) -> Vec<Ray> {
        let mut origin = Vec3::ZERO;
        let ray = |i| {
            if i % 16 == 0 {
                origin = self.point() * if self.below(3) == 0 { 4.0 } else { 1.0 };
            }
            let [kind, which, other, part] = self.numbers();
            let aim = |n: u32| aims.get(n as usize % aims.len().max(1)).copied().unwrap_or(Vec3::X);
            let direction = match kind % 8 {
                0 => [Vec3::X, Vec3::NEG_Y, Vec3::Z][which as usize % 3],
                1 => aim(which) - origin,
                2..5 => aim(which).lerp(aim(other), to_unit(part)) - origin,
                _ => self.point() - origin,
            };
            let t_max = if kind % 11 == 0 { to_unit(part) * 2.0 } else { f32::INFINITY };
            Ray::new(origin, direction).with_t_max(t_max)
        };
        (0..RAYS_PER_WORLD).map(ray).collect()
    }

    fn in_single_precision(
        &mut self,
        simd: Level,
        answers: &mut Answers,
    ) -> Result<(), WorldError> {
        let mut builder = WorldBuilder::default();
        let child = builder.add_group();
        let (shapes, mut aims) = (AnyShape::examples(), Vec::new());
        for group in [WorldBuilder::ROOT, child] {
            let mesh = self.mesh();
            aims.extend_from_slice(&mesh.positions);
            builder.add_mesh(group, Arc::new(mesh));
            for _ in 0..self.below(4) {
                let shape = shapes[self.below(shapes.len() as u32) as usize].clone();
                builder.add_shape(group, Arc::new(shape), self.transform());
            }
            if self.below(2) == 0 {
                let spheres = self.balls(20);
                builder.add_set(group, Arc::new(Spheres { spheres, ..Spheres::default() }));
            }
            if self.below(3) == 0 {
                let points = self.balls(8);
                builder.add_set(group, Arc::new(LinearCurves::chain(points)));
            }
            if self.below(4) == 0 {
                let points = self.balls(10);
                let curves = CubicCurves {
                    basis: CurveBasis::BSpline,
                    points,
                    segments: (0..7).collect(),
                    ..CubicCurves::default()
                };
                builder.add_set(group, Arc::new(curves));
            }
        }
        for _ in 0..self.below(3) {
            builder.add(WorldBuilder::ROOT, Instance::new(child, self.transform()));
        }
        let world = builder.build(&BuildOptions { simd, ..BuildOptions::default() })?;
        let rays = self.rays(&aims);
        let grouping =
            if self.number.is_multiple_of(2) { Grouping::None } else { Grouping::Coherent };
        let mut hits = vec![Hit::MISS; rays.len()];
        world.closest(&rays[..], grouping, &AcceptAll, &mut hits);
        for Hit { t, uv, instance, geometry, primitive } in hits {
            let bits = [t, uv.x, uv.y].map(|x| x.to_bits().into());
            answers.add_hit([instance, geometry, primitive], bits);
        }
        let mut blocked = vec![false; rays.len()];
        world.occluded(&rays[..], grouping, &AcceptAll, &mut blocked);
        blocked.into_iter().for_each(|blocked| answers.add(blocked.into()));
        Ok(())
    }

    fn in_double_precision(
        &mut self,
        simd: Level,
        answers: &mut Answers,
    ) -> Result<(), WorldError> {
        let mut builder = DWorldBuilder::default();
        let place = self.point().as_dvec3() * [1.0, 1e6, 1e9][self.below(3) as usize];
        let mut mesh = DTriangleMesh::from(&self.mesh());
        let aims: Vec<_> = mesh.positions.iter().map(|p| p.as_vec3()).collect();
        mesh.positions.iter_mut().for_each(|p| *p += place);
        builder.add_mesh(WorldBuilder::ROOT, Arc::new(mesh));
        let shapes = AnyShape::examples();
        for _ in 0..self.below(4) {
            let shape = shapes[self.below(shapes.len() as u32) as usize].clone();
            let mut map = *self.transform().matrix();
            map.translation += place;
            let transform = Transform::new(map).unwrap_or(Transform::IDENTITY);
            builder.add_shape(WorldBuilder::ROOT, Arc::new(shape), transform);
        }
        let world = builder.build(&BuildOptions { simd, ..BuildOptions::default() })?;
        let moved = |ray: &Ray| DRay {
            t_max: ray.t_max.into(),
            ..DRay::new(ray.origin.as_dvec3() + place, ray.direction.as_dvec3())
        };
        let rays: Vec<_> = self.rays(&aims).iter().map(moved).collect();
        let mut hits = vec![DHit::MISS; rays.len()];
        world.closest(&rays[..], Grouping::None, &AcceptAll, &mut hits);
        for DHit { t, uv, instance, geometry, primitive } in hits {
            answers.add_hit([instance, geometry, primitive], [t, uv.x, uv.y].map(f64::to_bits));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers are those of x86-64; whatever machine runs this test must find them.
    #[test]
    fn random_rays_hit_the_same_on_every_machine() {
        let expected = Answers { hits: 90_091, digest: 0xa5c9_2893_0e31_1bce };
        for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            let answers = random_rays(0..24, level).expect("worlds");
            assert_eq!(answers, expected, "{level}");
        }
    }
}
