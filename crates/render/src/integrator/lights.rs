//! Light samples of many vertices at once, where the chosen lights are flat and shine alike everywhere, and are far, or rectangles and triangles: what
//! [`super::estimators::sample_light`] gives one at a time, bit for bit.

use super::estimators::SHADOW_END;
use super::lanes::{ZERO, at};
use super::light_part::LightSource;
use super::{Context, dimension};
use crate::compile::{CompiledLight, CompiledScene, PlainEmission};
use crate::light_sampler::{ChosenLights, NONE, Receivers};
use crate::sampler::ManyRandoms;
use crate::settings::LightStrategy;
use snell_intersect::TrianglePoints;
use snell_intersect::smooth::lifted_ray_origin;
use snell_intersect::triangles::{HitLanes, HitVectors, TRIANGLE_HITS as LANES};
use snell_math::simd::Wide;
use snell_math::{DVec2, DVec3, Ray, Vec2, Vec3, at_level, sampling};
use snell_scene::light::area::{AreaLight, FlatPart, FlatSample, NearPart, NearRectangle, NearSample, NearTriangle};
use snell_scene::medium::HenyeyGreenstein;
use std::f32::consts::FRAC_1_PI;

/// The lights of the lanes. Lanes without a light hold anything.
#[derive(Debug)]
pub struct FlatLights {
    /// What was chosen.
    pub chosen: ChosenLights,
    /// Which part of which light is there already: mostly the one that comes next.
    light: [u32; LANES],
    part: [u32; LANES],
    /// How each is sampled.
    pub how: [u32; LANES],
    /// How each is sampled from near points; [`ALONE`] for what is not flat too.
    how_near: [u32; LANES],
    /// What gives the light of each.
    pub source: [LightSource; LANES],
    /// Emitted radiance, by channel.
    pub radiance: HitVectors,
    corner: HitVectors,
    edges: [HitVectors; 2],
    normal: HitVectors,
    error: HitVectors,
    middle: HitVectors,
    /// Infinite for what is not flat.
    far: HitLanes,
    /// Density per unit of area.
    pdf: HitLanes,
    /// 1 for a triangle, 0 for a rectangle.
    is_triangle: [u32; LANES],
    /// 1 if both sides shine.
    on_both_sides: [u32; LANES],
    near: NearLanes,
}

/// There is no light.
pub const DARK: u32 = 0;
/// By area.
const FAR: u32 = 1;
/// By solid angle.
const NEAR: u32 = 2;
/// The light is not one of these.
pub const ALONE: u32 = 3;

/// Near rectangles that are sampled together.
const NEAR_LANES: usize = 16;

/// Samples of near rectangles and triangles.
#[derive(Debug, Default)]
struct NearLanes {
    /// The lanes that have one, and those of either kind.
    lanes: Vec<u32>,
    of_kind: Vec<u32>,
    rectangles: NearRectangles,
    triangles: NearTriangles,
    found: NearSamples<NEAR_LANES>,
    /// By lane.
    samples: NearSamples<LANES>,
}

/// Rectangles, and who sees them.
#[derive(Debug, Default)]
struct NearRectangles {
    from: [[f32; NEAR_LANES]; 3],
    u: [[f32; NEAR_LANES]; 2],
    center: [[f64; NEAR_LANES]; 3],
    axes: [[[f64; NEAR_LANES]; 3]; 2],
    half: [[f64; NEAR_LANES]; 2],
}

/// Triangles, and who sees them.
#[derive(Debug, Default)]
struct NearTriangles {
    from: [[f32; NEAR_LANES]; 3],
    u: [[f32; NEAR_LANES]; 2],
    corner: [[f32; NEAR_LANES]; 3],
    edges: [[[f32; NEAR_LANES]; 3]; 2],
}

/// See [`NearSample`].
#[derive(Debug)]
struct NearSamples<const N: usize> {
    position: [[f32; N]; 3],
    direction: [[f32; N]; 3],
    pdf: [f32; N],
    is_seen: [u32; N],
    exists: [u32; N],
}

/// What light samples bring to vertices.
#[derive(Debug)]
pub struct FlatArrivals {
    origin: HitVectors,
    /// Direction of the light ray, and where it ends.
    way: HitVectors,
    end: HitLanes,
    /// Direction from the vertex, and the density with which it was chosen.
    direction: HitVectors,
    pub density: HitLanes,
    /// Density with which the path itself would go there, unguided: at Lambertian surfaces the cosine of incidence over pi.
    pub share: HitLanes,
    /// Weight by multiple importance sampling.
    pub weight: HitLanes,
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

/// What light samples come to: surfaces, or points of media.
pub trait Scatterers {
    fn position(&self) -> &HitVectors;

    /// The density with which the path of a lane itself would go in a direction, and whether any light from there counts.
    fn share(&self, lane: usize, direction: Vec3) -> (f32, bool);

    /// Where a ray of this direction starts that leaves the vertex of a lane.
    fn ray_origin(&self, lane: usize, direction: Vec3) -> Vec3;

    /// See [`FlatLights::arrivals`]. `with_near` if there are samples of near lights.
    fn arrive(
        &self,
        with_near: bool,
        lights: &FlatLights,
        u: &[HitLanes; 2],
        wide: Option<Wide>,
        arrivals: &mut FlatArrivals,
    );
}

/// [`Scatterers::arrive`] compiled for wide registers.
macro_rules! arrive_at_level {
    ($scatterers:ty) => {
        fn arrive(
            &self,
            with_near: bool,
            lights: &FlatLights,
            u: &[HitLanes; 2],
            wide: Option<Wide>,
            arrivals: &mut FlatArrivals,
        ) {
            arrive_at_level!(with_near, wide, $scatterers, self, lights, u, arrivals, [true, false])
        }
    };
    ($with_near:ident, $wide:ident, $scatterers:ty, $to:ident, $lights:ident, $u:ident, $arrivals:ident, [$($with:literal),*]) => {
        match $with_near {
            $($with => at_level!(
                $wide,
                arrive::<$with, $scatterers>,
                (
                    lights: &FlatLights = $lights,
                    to: &$scatterers = $to,
                    u: &[HitLanes; 2] = $u,
                    arrivals: &mut FlatArrivals = $arrivals,
                )
            ),)*
        }
    };
}

impl Scatterers for Surfaces<'_> {
    fn position(&self) -> &HitVectors {
        &self.points.position
    }

    #[inline(always)]
    fn share(&self, lane: usize, direction: Vec3) -> (f32, bool) {
        let (n, flat, wo) = (at(self.normal, lane), at(&self.points.geometric_normal, lane), at(self.wo, lane));
        let (cos_i, horizon) = (n.dot(direction), horizon(flat, n, at(self.lift, lane)));
        let is_seen = (n.dot(wo) * cos_i > 0.0) & (horizon.dot(wo) * horizon.dot(direction) > 0.0);
        (if is_seen { cos_i.abs() * FRAC_1_PI } else { 0.0 }, is_seen)
    }

    #[inline(always)]
    fn ray_origin(&self, lane: usize, direction: Vec3) -> Vec3 {
        ray_origin(self.points, self.lift, lane, direction)
    }

    arrive_at_level!(Surfaces);
}

/// Surfaces of which no more is known here than where they are: how they scatter must be asked one by one, and the density with which
/// a path goes somewhere is to be weighed in later ([`FlatArrivals::weigh`]).
#[derive(Clone, Copy, Debug)]
pub struct Skins<'a> {
    pub points: &'a TrianglePoints,
    /// See [`super::estimators::Skin::lift`].
    pub lift: &'a HitVectors,
}

impl Scatterers for Skins<'_> {
    fn position(&self) -> &HitVectors {
        &self.points.position
    }

    #[inline(always)]
    fn share(&self, _: usize, _: Vec3) -> (f32, bool) {
        (0.0, true)
    }

    #[inline(always)]
    fn ray_origin(&self, lane: usize, direction: Vec3) -> Vec3 {
        ray_origin(self.points, self.lift, lane, direction)
    }

    arrive_at_level!(Skins);
}

/// Where a ray of this direction starts that leaves the surface of a lane.
#[inline(always)]
pub fn ray_origin(points: &TrianglePoints, lift: &HitVectors, lane: usize, direction: Vec3) -> Vec3 {
    let (position, error) = (at(&points.position, lane), at(&points.position_error, lane));
    lifted_ray_origin(position, error, at(&points.geometric_normal, lane), at(lift, lane), direction)
}

/// Points of media.
#[derive(Clone, Copy, Debug)]
pub struct MediumPoints<'a> {
    pub position: &'a HitVectors,
    /// Directions to where the paths come from.
    pub wo: &'a HitVectors,
    /// Of the phase functions.
    pub phase: &'a [HenyeyGreenstein; LANES],
}

impl Scatterers for MediumPoints<'_> {
    fn position(&self) -> &HitVectors {
        self.position
    }

    #[inline(always)]
    fn share(&self, lane: usize, direction: Vec3) -> (f32, bool) {
        (self.phase[lane].pdf(-at(self.wo, lane), direction), true)
    }

    #[inline(always)]
    fn ray_origin(&self, lane: usize, _: Vec3) -> Vec3 {
        at(self.position, lane)
    }

    arrive_at_level!(MediumPoints);
}

impl Default for FlatLights {
    fn default() -> Self {
        Self {
            chosen: ChosenLights::default(),
            light: [NONE; LANES],
            part: [NONE; LANES],
            how: [DARK; LANES],
            how_near: [DARK; LANES],
            source: [LightSource::Medium; LANES],
            radiance: ZERO,
            corner: ZERO,
            edges: [ZERO; 2],
            normal: ZERO,
            error: ZERO,
            middle: ZERO,
            far: [0.0; LANES],
            pdf: [0.0; LANES],
            is_triangle: [0; LANES],
            on_both_sides: [0; LANES],
            near: NearLanes::default(),
        }
    }
}

impl<const N: usize> Default for NearSamples<N> {
    fn default() -> Self {
        let zero = [[0.0; N]; 3];
        Self { position: zero, direction: zero, pdf: [0.0; N], is_seen: [0; N], exists: [0; N] }
    }
}

impl Default for FlatArrivals {
    fn default() -> Self {
        let (zero, exists) = ([0.0; LANES], [0; LANES]);
        let (origin, way, direction) = (ZERO, ZERO, ZERO);
        Self { origin, way, end: zero, direction, density: zero, share: zero, weight: zero, scale: zero, exists }
    }
}

/// The part of a chosen light, if it is one of those that [`FlatLights`] holds: at least for far points.
fn flat_part(scene: &CompiledScene, light: u32, part: u32) -> Option<(&FlatPart, &PlainEmission)> {
    let plain = scene.plain_emission(light as usize)?;
    let flat = area_light(scene, light)?.flat(part)?;
    (!plain.rgb.is_black()).then_some((flat, plain))
}

fn area_light(scene: &CompiledScene, light: u32) -> Option<&AreaLight> {
    match &scene.lights()[light as usize] {
        CompiledLight::Area(area) => Some(area),
        _ => None,
    }
}

impl FlatLights {
    /// Chooses lights for these receivers, the first so many, and decides how each is sampled.
    pub fn choose(
        &mut self,
        context: &Context,
        receivers: &Receivers,
        randoms: &ManyRandoms<LANES>,
        count: usize,
        wide: Option<Wide>,
    ) {
        let choices = match context.lights.has_choice() {
            true => randoms.numbers(dimension::LIGHT_CHOICE, wide),
            false => [0.0; LANES],
        };
        context.lights.sample_many(receivers, &choices, count, &mut self.chosen);
        self.look_up(context.scene, receivers.position, count, wide);
        if context.settings.light_strategy != LightStrategy::Mis {
            self.how.iter_mut().filter(|how| **how != DARK).for_each(|how| *how = ALONE);
        }
    }

    /// Looks up the lights that were chosen for these points, the first so many, and decides how each is sampled.
    fn look_up(&mut self, scene: &CompiledScene, positions: &HitVectors, count: usize, wide: Option<Wide>) {
        for lane in 0..count {
            let (light, part) = (self.chosen.light[lane], self.chosen.part[lane]);
            if (self.light[lane] != light) | (self.part[lane] != part) {
                self.put(scene, lane, light, part);
            }
        }
        at_level!(wide, tell_far, (lights: &mut FlatLights = self, positions: &HitVectors = positions));
    }

    /// Puts a light into a lane.
    fn put(&mut self, scene: &CompiledScene, lane: usize, light: u32, part: u32) {
        (self.light[lane], self.part[lane]) = (light, part);
        // (Nothing is as far as that.)
        self.far[lane] = f32::INFINITY;
        self.how_near[lane] = if light == NONE { DARK } else { ALONE };
        if light == NONE || part == NONE {
            return;
        }
        let Some((flat, plain)) = flat_part(scene, light, part) else { return };
        if area_light(scene, light).is_some_and(|area| area.near(part).is_some()) {
            self.how_near[lane] = NEAR;
        }
        for axis in 0..3 {
            self.radiance[axis][lane] = plain.rgb.0[axis];
            self.corner[axis][lane] = flat.corner[axis];
            self.edges[0][axis][lane] = flat.edges[0][axis];
            self.edges[1][axis][lane] = flat.edges[1][axis];
            self.normal[axis][lane] = flat.normal[axis];
            self.error[axis][lane] = flat.error[axis];
            self.middle[axis][lane] = flat.middle[axis];
        }
        self.far[lane] = flat.far;
        self.pdf[lane] = flat.pdf;
        self.is_triangle[lane] = u32::from(flat.is_triangle);
        self.on_both_sides[lane] = u32::from(plain.on_both_sides);
        self.source[lane] = LightSource::Material(plain.material);
    }

    /// Notes what gave the light of a lane that was sampled alone.
    pub fn note_alone(&mut self, lane: usize, source: LightSource) {
        (self.light[lane], self.source[lane]) = (NONE - 1, source);
    }

    /// Samples the lights of the first lanes, so many, weighted against the directions that a path would take by itself.
    pub fn arrivals(
        &mut self,
        scene: &CompiledScene,
        to: &impl Scatterers,
        u: &[HitLanes; 2],
        count: usize,
        wide: Option<Wide>,
        arrivals: &mut FlatArrivals,
    ) {
        if self.how[..count].iter().all(|&how| how == DARK) {
            arrivals.exists = [0; LANES];
            return;
        }
        self.near.lanes.clear();
        self.near.lanes.extend((0..count as u32).filter(|&lane| self.how[lane as usize] == NEAR));
        let with_near = !self.near.lanes.is_empty();
        if with_near {
            self.sample_near(scene, to.position(), u, wide);
        }
        to.arrive(with_near, self, u, wide, arrivals);
    }

    /// Samples the rectangles and triangles that are near.
    #[inline(never)]
    fn sample_near(&mut self, scene: &CompiledScene, positions: &HitVectors, u: &[HitLanes; 2], wide: Option<Wide>) {
        let near = &mut self.near;
        near.samples.is_seen = [0; LANES];
        for kind in [0, 1] {
            near.of_kind.clear();
            near.of_kind.extend(near.lanes.iter().filter(|&&lane| self.is_triangle[lane as usize] == kind));
            for lanes in near.of_kind.chunks(NEAR_LANES) {
                if kind == 0 {
                    near.rectangles.gather(lanes, positions, u, |lane| {
                        match area_light(scene, self.light[lane])?.near(self.part[lane])? {
                            NearPart::Rectangle(rectangle) => Some(rectangle),
                            NearPart::Triangle(_) => None,
                        }
                    });
                    let of: &NearRectangles = &near.rectangles;
                    let to = &mut near.found;
                    at_level!(
                        wide,
                        near_rectangles,
                        (of: &NearRectangles = of, to: &mut NearSamples<NEAR_LANES> = to)
                    );
                } else {
                    near.triangles.gather(lanes, positions, u, &self.corner, &self.edges);
                    let of: &NearTriangles = &near.triangles;
                    let to = &mut near.found;
                    at_level!(
                        wide,
                        near_triangles,
                        (of: &NearTriangles = of, to: &mut NearSamples<NEAR_LANES> = to)
                    );
                }
                near.samples.take(lanes, &near.found);
            }
        }
    }
}

impl NearRectangles {
    fn gather(
        &mut self,
        lanes: &[u32],
        positions: &HitVectors,
        u: &[HitLanes; 2],
        rectangle: impl Fn(usize) -> Option<NearRectangle>,
    ) {
        for (i, &lane) in lanes.iter().enumerate() {
            let lane = lane as usize;
            let Some(rectangle) = rectangle(lane) else { continue };
            for (axis, positions) in positions.iter().enumerate() {
                self.from[axis][i] = positions[lane];
                self.center[axis][i] = rectangle.center[axis];
                self.axes[0][axis][i] = rectangle.axes[0][axis];
                self.axes[1][axis][i] = rectangle.axes[1][axis];
            }
            (self.half[0][i], self.half[1][i]) = (rectangle.half.x, rectangle.half.y);
            (self.u[0][i], self.u[1][i]) = (u[0][lane], u[1][lane]);
        }
    }
}

impl NearTriangles {
    fn gather(
        &mut self,
        lanes: &[u32],
        positions: &HitVectors,
        u: &[HitLanes; 2],
        corner: &HitVectors,
        edges: &[HitVectors; 2],
    ) {
        for (i, &lane) in lanes.iter().enumerate() {
            let lane = lane as usize;
            for axis in 0..3 {
                self.from[axis][i] = positions[axis][lane];
                self.corner[axis][i] = corner[axis][lane];
                self.edges[0][axis][i] = edges[0][axis][lane];
                self.edges[1][axis][i] = edges[1][axis][lane];
            }
            (self.u[0][i], self.u[1][i]) = (u[0][lane], u[1][lane]);
        }
    }
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
    fn get(&self, i: usize) -> NearSample {
        let vector = |v: &[[f32; N]; 3]| Vec3::new(v[0][i], v[1][i], v[2][i]);
        NearSample {
            position: vector(&self.position),
            direction: vector(&self.direction),
            pdf: self.pdf[i],
            is_seen: self.is_seen[i] != 0,
            exists: self.exists[i] != 0,
        }
    }

    /// Takes what was found for these lanes.
    fn take(&mut self, lanes: &[u32], found: &NearSamples<NEAR_LANES>) {
        for (i, &lane) in lanes.iter().enumerate() {
            self.put(lane as usize, &found.get(i));
        }
    }
}

impl FlatArrivals {
    /// The interval that must be free.
    #[inline(always)]
    pub fn shadow_ray(&self, lane: usize) -> Ray {
        Ray::new(at(&self.origin, lane), at(&self.way, lane)).with_t_max(self.end[lane])
    }

    /// Directions from vertices to where the light comes from.
    pub fn directions(&self) -> &HitVectors {
        &self.direction
    }

    /// Weighs the sample of a lane against paths that would go there with this density.
    #[inline(always)]
    pub fn weigh(&mut self, lane: usize, pdf: f32) {
        let weight = sampling::power_heuristic(self.density[lane], pdf);
        (self.weight[lane], self.scale[lane]) = (weight, weight / self.density[lane]);
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
fn tell_far(lights: &mut FlatLights, positions: &HitVectors) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        // As `FlatPart::is_far`.
        let is_far = (vector(&lights.middle) - vector(positions)).length_squared() > lights.far[i];
        lights.how[i] = if is_far { FAR } else { lights.how_near[i] };
    }
}

/// See [`NearRectangle::sample`].
#[inline(always)]
fn near_rectangles(of: &NearRectangles, to: &mut NearSamples<NEAR_LANES>) {
    for i in 0..NEAR_LANES {
        let vector = |v: &[[f64; NEAR_LANES]; 3]| DVec3::new(v[0][i], v[1][i], v[2][i]);
        let rectangle = NearRectangle {
            center: vector(&of.center),
            axes: [vector(&of.axes[0]), vector(&of.axes[1])],
            half: DVec2::new(of.half[0][i], of.half[1][i]),
        };
        let from = Vec3::new(of.from[0][i], of.from[1][i], of.from[2][i]);
        to.put(i, &rectangle.sample(from, Vec2::new(of.u[0][i], of.u[1][i])));
    }
}

/// See [`NearTriangle::sample`].
#[inline(always)]
fn near_triangles(of: &NearTriangles, to: &mut NearSamples<NEAR_LANES>) {
    for i in 0..NEAR_LANES {
        let vector = |v: &[[f32; NEAR_LANES]; 3]| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let triangle = NearTriangle { corner: vector(&of.corner), edges: [vector(&of.edges[0]), vector(&of.edges[1])] };
        to.put(i, &triangle.sample(vector(&of.from), Vec2::new(of.u[0][i], of.u[1][i])));
    }
}

/// `WITH_NEAR` if there are samples of near lights.
#[inline(always)]
fn arrive<const WITH_NEAR: bool, S: Scatterers>(
    lights: &FlatLights,
    to: &S,
    u: &[HitLanes; 2],
    arrivals: &mut FlatArrivals,
) {
    for i in 0..LANES {
        let vector = |v: &HitVectors| Vec3::new(v[0][i], v[1][i], v[2][i]);
        let position = vector(to.position());
        let part = FlatPart {
            corner: vector(&lights.corner),
            edges: [vector(&lights.edges[0]), vector(&lights.edges[1])],
            normal: vector(&lights.normal),
            error: vector(&lights.error),
            pdf: lights.pdf[i],
            is_triangle: lights.is_triangle[i] != 0,
            middle: Vec3::ZERO,
            far: 0.0,
        };
        let u = Vec2::new(u[0][i], u[1][i]);
        let sample = if WITH_NEAR {
            part.near_or_by_area(lights.near.samples.get(i), position, u)
        } else {
            part.sample(position, u)
        };
        let FlatSample { direction, pdf, end, is_front, exists } = sample;
        let (share, is_seen) = to.share(i, direction);
        let density = pdf * lights.chosen.probability[i];
        let weight = sampling::power_heuristic(density, share);
        let origin = to.ray_origin(i, direction);
        let is_lit = is_front | (lights.on_both_sides[i] != 0);
        let is_here = (lights.how[i] == FAR) | (lights.how[i] == NEAR);
        for axis in 0..3 {
            arrivals.origin[axis][i] = origin[axis];
            arrivals.way[axis][i] = end[axis] - origin[axis];
            arrivals.direction[axis][i] = direction[axis];
        }
        arrivals.density[i] = density;
        arrivals.end[i] = SHADOW_END;
        arrivals.share[i] = share;
        arrivals.weight[i] = weight;
        arrivals.scale[i] = weight / density;
        arrivals.exists[i] = u32::from(exists & is_lit & is_seen & is_here);
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
        let vector = |i: u32, k: u32| Vec3::new(number(i, 3 * k), number(i, 3 * k + 1), number(i, 3 * k + 2));
        let mut of = NearRectangles::default();
        let cases: [_; NEAR_LANES] = std::array::from_fn(|i| {
            let (x, y) = vector(i as u32, 0).as_dvec3().normalize().any_orthonormal_pair();
            let rectangle = NearRectangle {
                center: vector(i as u32, 1).as_dvec3(),
                axes: [x, y],
                half: vector(i as u32, 2).as_dvec3().abs().truncate(),
            };
            let (from, u) = (vector(i as u32, 3) * 0.5, uniform2([i as u32, 9, 5, 5]));
            for axis in 0..3 {
                of.from[axis][i] = from[axis];
                of.center[axis][i] = rectangle.center[axis];
                of.axes[0][axis][i] = x[axis];
                of.axes[1][axis][i] = y[axis];
            }
            ([of.half[0][i], of.half[1][i]], [of.u[0][i], of.u[1][i]]) = (rectangle.half.to_array(), u.to_array());
            (rectangle, from, u)
        });
        for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            let mut found = NearSamples::default();
            let of = &of;
            at_level!(
                level.wide(),
                near_rectangles,
                (of: &NearRectangles = of, to: &mut NearSamples<NEAR_LANES> = &mut found)
            );
            for (i, (rectangle, from, u)) in cases.iter().enumerate() {
                let single = rectangle.sample(*from, *u);
                let at = |v: &[[f32; NEAR_LANES]; 3]| Vec3::new(v[0][i], v[1][i], v[2][i]);
                assert!(single.exists);
                assert_eq!((at(&found.position), at(&found.direction)), (single.position, single.direction), "{level}");
                assert_eq!((found.pdf[i], found.exists[i]), (single.pdf, 1), "{level}");
            }
        }
    }

    #[test]
    fn near_triangles_are_sampled_alike_at_every_level() {
        let number = |i: u32, k: u32| uniform2([i, k, 7, 7]).x * 2.0 - 1.0;
        let vector = |i: u32, k: u32| Vec3::new(number(i, 3 * k), number(i, 3 * k + 1), number(i, 3 * k + 2));
        let mut of = NearTriangles::default();
        let cases: [_; NEAR_LANES] = std::array::from_fn(|lane| {
            let i = lane as u32;
            let triangle = NearTriangle { corner: vector(i, 1), edges: [vector(i, 2), vector(i, 3)] };
            let (from, u) = (vector(i, 4), uniform2([i, 9, 5, 5]));
            for axis in 0..3 {
                of.from[axis][lane] = from[axis];
                of.corner[axis][lane] = triangle.corner[axis];
                of.edges[0][axis][lane] = triangle.edges[0][axis];
                of.edges[1][axis][lane] = triangle.edges[1][axis];
            }
            [of.u[0][lane], of.u[1][lane]] = u.to_array();
            (triangle, from, u)
        });
        for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            let (mut found, of) = (NearSamples::default(), &of);
            at_level!(
                level.wide(),
                near_triangles,
                (of: &NearTriangles = of, to: &mut NearSamples<NEAR_LANES> = &mut found)
            );
            for (i, (triangle, from, u)) in cases.iter().enumerate() {
                let (single, found) = (triangle.sample(*from, *u), found.get(i));
                assert!(single.exists);
                assert_eq!((found.position, found.direction), (single.position, single.direction), "{level}");
                assert_eq!((found.pdf, found.exists), (single.pdf, true), "{level}");
                assert_eq!(found.is_seen, single.is_seen, "{level}");
            }
        }
    }
}
