//! Light samples of many vertices at once, where the chosen lights are flat, far and shine alike everywhere: what
//! [`super::estimators::sample_light`] gives one at a time, bit for bit.

use super::estimators::SHADOW_END;
use crate::compile::{CompiledLight, CompiledScene, PlainEmission};
use crate::light_sampler::ChosenLight;
use snell_intersect::TrianglePoints;
use snell_intersect::smooth::lifted_ray_origin;
use snell_intersect::triangles::{HitLanes, HitVectors, TRIANGLE_HITS as LANES};
use snell_math::simd::Wide;
use snell_math::{Ray, Vec2, Vec3, at_level, sampling};
use snell_scene::light::area::{FlatPart, FlatSample};
use std::f32::consts::FRAC_1_PI;

const ZERO: HitVectors = [[0.0; LANES]; 3];

/// The lights of the lanes. Lanes without a light hold anything.
#[derive(Debug)]
pub struct FlatLights {
    /// Which part of which light is there already: mostly the one that comes next.
    which: [Option<(usize, u32)>; LANES],
    /// Emitted radiance, by channel.
    pub radiance: HitVectors,
    corner: HitVectors,
    edges: [HitVectors; 2],
    normal: HitVectors,
    error: HitVectors,
    /// Density per unit of area.
    pdf: HitLanes,
    /// 1 for a triangle, 0 for a rectangle.
    is_triangle: [u32; LANES],
    /// 1 if both sides shine.
    on_both_sides: [u32; LANES],
    /// Probability of the choice of the light and its part.
    probability: HitLanes,
}

/// What light samples bring to Lambertian surfaces.
#[derive(Debug)]
pub struct FlatArrivals {
    origin: HitVectors,
    /// Direction of the light ray, and where it ends.
    way: HitVectors,
    end: HitLanes,
    /// Density with which the path itself would go there: the cosine of incidence over pi.
    pub cosine: HitLanes,
    /// Weight by multiple importance sampling.
    weight: HitLanes,
    /// The weight over the density of the sample.
    pub scale: HitLanes,
    /// 0 where there is no light.
    pub exists: [u32; LANES],
}

/// The surface seen from where paths come.
#[derive(Clone, Copy, Debug)]
pub struct Surfaces<'a> {
    pub points: &'a TrianglePoints,
    /// Shading normals.
    pub normal: &'a HitVectors,
    /// Directions to where the paths come from.
    pub wo: &'a HitVectors,
    /// See [`super::estimators::Skin::lift`].
    pub lift: &'a HitVectors,
}

impl Default for FlatLights {
    fn default() -> Self {
        Self {
            which: [None; LANES],
            radiance: ZERO,
            corner: ZERO,
            edges: [ZERO; 2],
            normal: ZERO,
            error: ZERO,
            pdf: [0.0; LANES],
            is_triangle: [0; LANES],
            on_both_sides: [0; LANES],
            probability: [0.0; LANES],
        }
    }
}

impl Default for FlatArrivals {
    fn default() -> Self {
        let (zero, exists) = ([0.0; LANES], [0; LANES]);
        Self { origin: ZERO, way: ZERO, end: zero, cosine: zero, weight: zero, scale: zero, exists }
    }
}

/// The part of a chosen light, if it is one of those that [`FlatLights`] holds.
#[inline]
pub fn flat_part<'a>(
    scene: &'a CompiledScene,
    chosen: &ChosenLight,
    from: Vec3,
) -> Option<(&'a FlatPart, &'a PlainEmission)> {
    let plain = scene.plain_emission(chosen.light)?;
    let CompiledLight::Area(area) = &scene.lights()[chosen.light] else { return None };
    let flat = area.flat(chosen.part?)?;
    (flat.is_far(from) && !plain.rgb.is_black()).then_some((flat, plain))
}

impl FlatLights {
    /// Puts a light of [`flat_part`] into a lane.
    pub fn put(&mut self, lane: usize, chosen: &ChosenLight, flat: &FlatPart, plain: &PlainEmission) {
        self.probability[lane] = chosen.probability;
        let which = chosen.part.map(|part| (chosen.light, part));
        if self.which[lane] == which {
            return;
        }
        self.which[lane] = which;
        for axis in 0..3 {
            self.radiance[axis][lane] = plain.rgb.0[axis];
            self.corner[axis][lane] = flat.corner[axis];
            self.edges[0][axis][lane] = flat.edges[0][axis];
            self.edges[1][axis][lane] = flat.edges[1][axis];
            self.normal[axis][lane] = flat.normal[axis];
            self.error[axis][lane] = flat.error[axis];
        }
        self.pdf[lane] = flat.pdf;
        self.is_triangle[lane] = u32::from(flat.is_triangle);
        self.on_both_sides[lane] = u32::from(plain.on_both_sides);
    }

    /// Samples the lights of all lanes, weighted against the directions that a path would take by itself.
    pub fn arrivals(&self, to: &Surfaces, u: &[HitLanes; 2], wide: Option<Wide>, arrivals: &mut FlatArrivals) {
        at_level!(
            wide,
            arrive,
            (lights: &FlatLights = self, to: &Surfaces = to, u: &[HitLanes; 2] = u, arrivals: &mut FlatArrivals = arrivals)
        );
    }
}

impl FlatArrivals {
    /// The interval that must be free.
    #[inline(always)]
    pub fn shadow_ray(&self, lane: usize) -> Ray {
        let at = |v: &HitVectors| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
        Ray::new(at(&self.origin), at(&self.way)).with_t_max(self.end[lane])
    }

    /// Weight by multiple importance sampling.
    pub fn weight(&self, lane: usize) -> f32 {
        self.weight[lane]
    }

    /// Puts a sample of another light into a lane.
    pub fn put(&mut self, lane: usize, shadow_ray: &Ray, weight: f32) {
        for axis in 0..3 {
            self.origin[axis][lane] = shadow_ray.origin[axis];
            self.way[axis][lane] = shadow_ray.direction[axis];
        }
        (self.end[lane], self.weight[lane]) = (shadow_ray.t_max, weight);
    }
}

/// The normal of the plane below which nothing is reflected: that of the surface itself, or where it is lifted the shading normal.
#[inline(always)]
pub fn horizon(flat: Vec3, normal: Vec3, lift: Vec3) -> Vec3 {
    let is_lifted = lift != Vec3::ZERO;
    let pick = |flat: f32, normal: f32| if is_lifted { normal } else { flat };
    Vec3::new(pick(flat.x, normal.x), pick(flat.y, normal.y), pick(flat.z, normal.z))
}

#[inline(always)]
fn arrive(lights: &FlatLights, to: &Surfaces, u: &[HitLanes; 2], arrivals: &mut FlatArrivals) {
    let Surfaces { points, normal, wo, lift } = *to;
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let (position, flat_normal, n) = (vector(&points.position), vector(&points.geometric_normal), vector(normal));
        let part = FlatPart::lane(
            vector(&lights.corner),
            [vector(&lights.edges[0]), vector(&lights.edges[1])],
            vector(&lights.normal),
            vector(&lights.error),
            lights.pdf[i],
            lights.is_triangle[i] != 0,
        );
        let FlatSample { direction, pdf, end, is_front, exists } = part.sample(position, Vec2::new(u[0][i], u[1][i]));
        let (wo, lift) = (vector(wo), vector(lift));
        let (cos_i, horizon) = (n.dot(direction), horizon(flat_normal, n, lift));
        let is_seen = (n.dot(wo) * cos_i > 0.0) & (horizon.dot(wo) * horizon.dot(direction) > 0.0);
        let cosine = if is_seen { cos_i.abs() * FRAC_1_PI } else { 0.0 };
        let density = pdf * lights.probability[i];
        let weight = sampling::power_heuristic(density, cosine);
        let origin = lifted_ray_origin(position, vector(&points.position_error), flat_normal, lift, direction);
        let is_lit = is_front | (lights.on_both_sides[i] != 0);
        for axis in 0..3 {
            arrivals.origin[axis][i] = origin[axis];
            arrivals.way[axis][i] = end[axis] - origin[axis];
        }
        arrivals.end[i] = SHADOW_END;
        arrivals.cosine[i] = cosine;
        arrivals.weight[i] = weight;
        arrivals.scale[i] = weight / density;
        arrivals.exists[i] = u32::from(exists & is_lit & is_seen);
    }
}
