//! The textbook renderer: one recursive call per ray, without batches or optimisations. It is the
//! first file to read, and the oracle with which tests compare the batched renderer.
//!
//! This renderer makes the same queries of the same scene with the same random numbers as the
//! batched one, so its pictures must be the same up to rounding.

use crate::compile::{CameraFilter, CompiledScene};
use crate::film::filter::FilterSampler;
use crate::integrator::camera_path::{FILM, camera_path, film_point};
use crate::integrator::carried::Carried;
use crate::integrator::{Context, MediumVertex, Outputs, PathState, SurfaceVertex, Vertex};
use crate::sampler::{Random, Sampler};
use crate::settings::Settings;
use crate::volume::{Insides, LightStep, Numbers, OwnMedia, PathStep, Walker};
use snell_intersect::{Hit, RayQuery};
use snell_math::{ColorMode, Ray, Rgb, SampledSpectrum, Vec3};
use snell_scene::Camera;

/// Renders a picture: for each pixel, row by row from the top, the filtered mean of its samples.
pub fn ray_cast(scene: &CompiledScene, camera: &Camera, settings: &Settings) -> Vec<Rgb> {
    let view = camera.view(settings.size);
    let [width, height] = settings.size;
    let sampler = Sampler::of(settings);
    let filter = FilterSampler::of(settings.filter);
    let lights = scene.light_sampler(settings.light_sampler, settings.light_strategy);
    let context = Context { scene, settings, lights: &lights, field: None, wants_lobes: false };
    let mut image = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (mut plain, mut sum, mut weights) = (Rgb::BLACK, Rgb::BLACK, 0.0);
            for number in 0..settings.spp {
                let random = sampler.random([x, y], number);
                let (film, weight) = film_point(settings, filter, [x, y], random.pair(FILM));
                let (ray, state) = camera_path(&view, settings, scene.moves, &random, film);
                let mut media = Media::new(&context, camera.eye.as_vec3(), state.mode);
                let light =
                    state.mode.to_rgb(radiance(&context, &ray, &state, random, 0, &mut media));
                let color = settings.sensor.map_or(light, |sensor| sensor.response(light));
                plain = plain + color;
                sum = sum + color * weight;
                weights += weight;
            }
            // The weights of a filter with negative lobes may add up to 0, so only differences from
            // the unweighted mean are weighted.
            let n = settings.spp as f32;
            let mean = plain * (1.0 / n);
            image.push(mean + (sum + mean * -weights) * (1.0 / (n * filter.mean_weight() as f32)));
        }
    }
    image
}

/// Radiance along a ray: emission at its end, the contributions of unoccluded light rays, and the
/// radiance along all next rays of the integrator.
fn radiance(
    context: &Context,
    ray: &Ray,
    state: &PathState,
    random: Random,
    depth: u32,
    media: &mut Option<Media>,
) -> SampledSpectrum {
    if state.throughput.is_black() {
        return SampledSpectrum::ZERO;
    }
    let scene = context.scene;
    let numbers = random.at_vertex(state.stream, depth);
    let (mut ray, mut state, mut sum) = (*ray, *state, SampledSpectrum::ZERO);
    let (hit, medium) = match media {
        Some(media) => media.travel(scene, depth, &mut ray, &mut state, numbers, &mut sum),
        None => {
            let filter = CameraFilter::new(scene, scene);
            (scene.world.closest_one(timed(&ray, state.time), filter.at(depth)), None)
        }
    };
    if state.throughput.is_black() {
        return sum;
    }
    let interaction = hit.is_hit().then(|| scene.interaction(&ray, state.time, &hit));
    let surface = interaction.as_ref().map(|interaction| SurfaceVertex {
        hit: &hit,
        interaction,
        material: scene.material(scene.material_id(&hit)),
        prepared: scene.prepared(scene.material_id(&hit)),
        footprint: state.cone_width + state.cone_spread * hit.t,
        mode: state.mode,
        outside_ior: media.as_ref().map_or(1.0, |m| m.walker.outside_ior(&m.insides, &hit)),
    });
    let vertex = Vertex { depth, ray: &ray, state: &state, random: numbers, surface, medium };
    sum + leaving(context, &vertex, random, media)
}

/// Radiance that leaves a vertex towards the origin of its ray.
pub(crate) fn leaving(
    context: &Context,
    vertex: &Vertex,
    random: Random,
    media: &mut Option<Media>,
) -> SampledSpectrum {
    let (scene, settings) = (context.scene, context.settings);
    let (state, depth, numbers) = (vertex.state, vertex.depth, vertex.random);
    let mut out = Outputs::default();
    (settings.integrator.vertex_function())(context, vertex, &mut out);
    let mut sum = out.radiance;
    let here = media.as_ref().map(|m| m.insides);
    for (number, (light_ray, value)) in (0..).zip(&out.light_rays) {
        sum += match media {
            Some(media) => {
                media.go_on(here, vertex, light_ray);
                let numbers = Numbers::of_light_ray(numbers, number);
                let left =
                    media.arriving(scene, *light_ray, state.time, *value, state.mode, numbers);
                if media.walker.is_in(&media.insides, out.glowing) {
                    left
                } else {
                    SampledSpectrum::ZERO
                }
            }
            None if scene.world.occluded_one(timed(light_ray, state.time), scene) => {
                SampledSpectrum::ZERO
            }
            None => *value,
        };
    }
    for (next_ray, next_state) in &out.next {
        if let Some(media) = media {
            media.go_on(here, vertex, next_ray);
        }
        sum += radiance(context, next_ray, next_state, random, depth + 1, media);
    }
    sum
}

/// A ray with its time, as a query of the world.
fn timed(ray: &Ray, time: f32) -> RayQuery<'_> {
    RayQuery { time, ..RayQuery::from(ray) }
}

/// What a ray needs in scenes with media.
pub(crate) struct Media<'a> {
    walker: Walker<'a>,
    own: OwnMedia,
    insides: Insides,
}

impl<'a> Media<'a> {
    /// The media around the start of a path; `None` if there are none.
    pub(crate) fn new(context: &Context<'a>, start: Vec3, mode: ColorMode) -> Option<Self> {
        let walker = Walker::new(context).filter(|_| context.settings.integrator.is_path())?;
        let mut own = OwnMedia::new();
        let around = walker.surfaces_around(start);
        let insides = walker.insides_of(&mut own, &around, mode);
        Some(Self { walker, own, insides })
    }

    /// Follows the ray through interfaces until it hits another surface or a medium scatters it.
    fn travel(
        &mut self,
        scene: &CompiledScene,
        depth: u32,
        ray: &mut Ray,
        state: &mut PathState,
        random: Random,
        emitted: &mut SampledSpectrum,
    ) -> (Hit, Option<MediumVertex>) {
        let (mut carried, rest) = Carried::of(state);
        let mut numbers = Numbers::of_path(random, 0);
        loop {
            let filter = CameraFilter::new(scene, &self.walker);
            let hit = scene.world.closest_one(timed(ray, state.time), filter.at(depth));
            let insides = &mut self.insides;
            let path = (&mut carried, &rest);
            let step =
                self.walker.step(&mut self.own, ray, path, insides, &hit, &mut numbers, emitted);
            *state = carried.with(&rest);
            match step {
                PathStep::Arrived => return (hit, None),
                PathStep::Scattered(vertex) => return (Hit::MISS, Some(vertex)),
                PathStep::Passed => {}
            }
        }
    }

    /// The value of a light ray that arrives: its contribution multiplied by the transmittance.
    fn arriving(
        &mut self,
        scene: &CompiledScene,
        mut ray: Ray,
        time: f32,
        mut value: SampledSpectrum,
        mode: ColorMode,
        mut numbers: Numbers,
    ) -> SampledSpectrum {
        loop {
            let hit = scene.world.closest_one(timed(&ray, time), &self.walker);
            let insides = &mut self.insides;
            match self.walker.light_step(
                &mut self.own,
                &mut ray,
                time,
                &mut value,
                mode,
                insides,
                &hit,
                &mut numbers,
            ) {
                LightStep::Arrived => return value,
                LightStep::Blocked => return SampledSpectrum::ZERO,
                LightStep::Passed => {}
            }
        }
    }

    /// Enters or leaves the medium that the vertex's surface bounds, if `ray` continues on the
    /// other side of the surface.
    fn go_on(&mut self, here: Option<Insides>, vertex: &Vertex, ray: &Ray) {
        self.insides = here.unwrap_or_default();
        let Some(surface) = &vertex.surface else { return };
        let (normal, direction) = (surface.interaction.geometric_normal, ray.direction);
        if direction.dot(normal) * vertex.ray.direction.dot(normal) > 0.0 {
            let own = &mut self.own;
            self.insides = self.walker.beyond(
                own,
                &self.insides,
                surface.interaction,
                surface.hit,
                direction,
                surface.mode,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::filter::Filter;
    use crate::integrator::IntegratorKind;
    use crate::job::Job;
    use snell_intersect::shape::{BoxShape, Sphere};
    use snell_math::{DAffine3, DVec3};
    use snell_scene::material::Diffuse;
    use snell_scene::{Background, Environment, Material, Node, Scene, Surface};

    fn two_balls() -> (Scene, Camera) {
        let mut scene = Scene::new("two balls");
        let white = scene.add_material(Material::new("white", Diffuse::new(Rgb::splat(0.8))));
        let lamp = scene.add_material(
            Material::new("lamp", Diffuse::new(Rgb::BLACK)).emitting(Rgb::splat(5.0)),
        );
        for (x, material) in [(-1.2, white), (1.2, lamp)] {
            let transform = DAffine3::from_translation(DVec3::new(x, 0.0, 0.0));
            let surfaces = vec![Surface::shape(Sphere { radius: 1.0 }, material)];
            scene.add_child(scene.root, Node { transform, surfaces, ..Node::default() });
        }
        scene.environment = Some(Environment::Constant(Rgb::new(0.1, 0.2, 0.3)));
        (scene, Camera::look_at(Vec3::new(0.0, 0.0, 6.0), Vec3::ZERO, Vec3::Y, 0.5))
    }

    #[test]
    fn the_batched_renderer_agrees_with_the_textbook() {
        let (scene, camera) = two_balls();
        for integrator in IntegratorKind::ALL {
            if integrator == IntegratorKind::Aov {
                continue;
            }
            let settings = Settings {
                size: [24, 18],
                spp: 5,
                integrator,
                max_depth: 4,
                ..Settings::default()
            };
            let compiled = CompiledScene::new(&scene, &settings.build).expect("a valid scene");
            let (film, _) = Job::new(&compiled, &camera, &settings).run(2, &|_| true);
            let batched = film.image();
            for (i, expected) in ray_cast(&compiled, &camera, &settings).iter().enumerate() {
                for c in 0..3 {
                    let (a, b) = (batched.layers[0].values[i * 4 + c], expected.to_array()[c]);
                    assert!(
                        (a - b).abs() <= 1e-5 * b.abs().max(1.0),
                        "{integrator:?} pixel {i}: {a} {b}"
                    );
                }
            }
        }
    }

    /// With one sample at the centre of each pixel, as in the lecture, edges would be ragged.
    #[test]
    fn errata_e9_samples_are_spread_over_the_pixel_and_filtered() {
        let mut scene = Scene::new("edge");
        let white = scene.add_material(Material::new("white", Diffuse::new(Rgb::WHITE)));
        let half = BoxShape { min: DVec3::new(0.0, -99.0, -1.0), max: DVec3::new(99.0, 99.0, 0.0) };
        scene.add_child(
            scene.root,
            Node { surfaces: vec![Surface::shape(half, white)], ..Node::default() },
        );
        scene.background = Background::Color(Rgb::BLACK);
        // The edge runs through the middle of the only column of pixels that it touches.
        let camera = Camera::look_at(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 0.5);
        let settings = |filter, spp| Settings {
            size: [9, 1],
            spp,
            filter,
            integrator: IntegratorKind::Flat,
            ..Settings::default()
        };
        for filter in Filter::ALL {
            let settings = settings(filter, 400);
            let compiled = CompiledScene::new(&scene, &settings.build).expect("a valid scene");
            let (film, _) = Job::new(&compiled, &camera, &settings).run(1, &|_| true);
            let image = film.image();
            let row: Vec<f32> = (0..9).map(|x| image.layers[0].values[x * 4]).collect();
            assert!(
                (row[4] - 0.5).abs() < 0.06,
                "{filter:?}: half of the edge's pixel is covered: {row:?}"
            );
            assert!(row[0].abs() < 1e-3 && (row[8] - 1.0).abs() < 1e-3, "{filter:?}: {row:?}");
        }
    }
}
