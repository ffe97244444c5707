//! The floor of a background that catches shadows.

use snell_math::{Bounds3, Bounds3d, DMat3, DVec3, Ray, Rgb, SampledSpectrum, Vec2, Vec3, real};
use snell_scene::light::environment::EnvironmentLight;
use snell_scene::{Background, Environment, Image, Scene};
use std::f64::consts::PI;
use std::sync::Arc;

/// The size of the picture that stands for the light of a constant environment.
const CONSTANT_SIZE: [u32; 2] = [128, 64];

/// The largest picture of the light on a floor; that of the environment may be larger.
const MOST_SIZE: [u32; 2] = [1024, 512];

/// The number of light rays of a sample: few scenes cost more per ray, and shadows are less noisy
/// than surfaces then.
const LIGHT_RAYS: usize = 4;

/// The number of directions to the light along each axis of the square of random numbers. All have
/// the same weight, so that a shadow is the sum of as many shadows as there are directions.
const DIRECTIONS: usize = 64;

/// Shadows are looked for up to this distance from the scene, in radii of the scene.
const REACH: f32 = 50.0;

/// A floor that is seen by camera rays alone, with the light of the environment on it.
#[derive(Debug)]
pub(crate) struct Floor {
    /// The linear colour where nothing occludes the environment.
    pub color: Rgb,
    up: Vec3,
    height: f32,
    center: Vec3,
    reach: f32,
    /// Directions to the light, in proportion to the light that the floor receives.
    directions: Vec<Vec3>,
    /// What may be in the way of the light.
    occluders: Bounds3,
}

/// What a point of the floor receives of the light of the background.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Received {
    /// The light rays, of which each carries an equal part of the light.
    rays: [Ray; LIGHT_RAYS],
    /// The number of rays at the front that may be occluded; the others cannot.
    count: usize,
}

impl Received {
    /// The rays that may be occluded.
    pub fn uncertain(&self) -> &[Ray] {
        &self.rays[..self.count]
    }

    /// Divides the light of the background into that of each light ray, and that which arrives in
    /// any case.
    pub fn parts(&self, light: SampledSpectrum) -> [SampledSpectrum; 2] {
        let part = light / LIGHT_RAYS as f32;
        [part, part * (LIGHT_RAYS - self.count) as f32]
    }
}

impl Floor {
    /// The floor of the scene's background; `None` if it has none or no environment lights it.
    ///
    /// `bounds` are those of the scene without its infinite parts, `occluders` those of all of it.
    pub fn of(scene: &Scene, bounds: &Bounds3d, occluders: &Bounds3d) -> Option<Self> {
        let Background::ShadowCatcher(catcher) = scene.background else { return None };
        let up = catcher.up.try_normalize().filter(|up| up.is_finite())?;
        let light = EnvironmentLight::new(&received(scene.environment.as_ref()?, up));
        let cells = (0..DIRECTIONS * DIRECTIONS).map(|i| [i % DIRECTIONS, i / DIRECTIONS]);
        let direction = |[x, y]: [usize; 2]| {
            let u = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / DIRECTIONS as f32;
            light.sample(u).direction
        };
        let height = catcher.height as f32;
        let lights = light.mean_luminance() > 0.0 && height.is_finite() && !bounds.is_empty();
        lights.then(|| Self {
            color: catcher.color.map(super::finite),
            up: up.as_vec3(),
            height,
            center: bounds.center().as_vec3(),
            reach: REACH * bounds.radius() as f32,
            directions: cells.map(direction).collect(),
            occluders: padded(occluders),
        })
    }

    /// Rays from the point where a camera ray meets the floor towards the environment, in
    /// directions sampled in proportion to the light that the floor receives. `None` if the camera
    /// ray does not meet the floor from above, or only far from the scene.
    pub fn received(&self, ray: &Ray, u: impl FnOnce() -> Vec2) -> Option<Received> {
        let (above, slope) = (ray.origin.dot(self.up) - self.height, ray.direction.dot(self.up));
        if above <= 0.0 || slope >= 0.0 {
            return None;
        }
        let point = ray.origin - ray.direction * (above / slope);
        let is_near = (point - self.center).length() <= self.reach;
        is_near.then(|| {
            let u = u();
            let cell = |u: f32| ((u * DIRECTIONS as f32) as usize).min(DIRECTIONS - 1);
            let mut received = Received { rays: [Ray::new(point, self.up); LIGHT_RAYS], count: 0 };
            for i in 0..LIGHT_RAYS {
                let part = (u.x + i as f32) / LIGHT_RAYS as f32;
                let direction = self.directions[cell(u.y) * DIRECTIONS + cell(part)];
                if meets(&self.occluders, point, direction) {
                    received.rays[received.count].direction = direction;
                    received.count += 1;
                }
            }
            received
        })
    }
}

/// The bounds, larger by what rounding could matter.
fn padded(bounds: &Bounds3d) -> Bounds3 {
    let Bounds3 { min, max } = bounds.outward_f32();
    let pad = 1e-5 * (min.abs().max(max.abs()) + (max - min));
    Bounds3 { min: min - pad, max: max + pad }
}

/// True if a ray that starts at this point may meet the box (Kay and Kajiya, Ray Tracing Complex
/// Scenes, 1986).
fn meets(bounds: &Bounds3, origin: Vec3, direction: Vec3) -> bool {
    let inverse = direction.recip();
    let (a, b) = ((bounds.min - origin) * inverse, (bounds.max - origin) * inverse);
    let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
    near <= far || near.is_nan() || far.is_nan()
}

/// The irradiance that a surface with this normal receives from each direction, per solid angle.
fn received(environment: &Environment, up: DVec3) -> Environment {
    let (picture, scale, placement) = match environment {
        Environment::Constant(color) => (None, *color, DMat3::IDENTITY),
        Environment::Image { image, scale, world_from_environment } => {
            (Some(image), *scale, world_from_environment.matrix3)
        }
    };
    let [columns, rows] = picture.map_or(CONSTANT_SIZE, |picture| [picture.width, picture.height]);
    let [width, height] = [columns.min(MOST_SIZE[0]), rows.min(MOST_SIZE[1])];
    let along = |i: u32, cells: u32, pixels: u32| {
        let at = |i: u32| (u64::from(i) * u64::from(pixels) / u64::from(cells)) as u32;
        at(i)..at(i + 1)
    };
    let mut values = Vec::with_capacity(width as usize * height as usize * 3);
    for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
        // The mean over the pixels of a cell, with the cosine of each.
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for y in along(row, height, rows) {
            let (sin, cos) = real::sin_cos(PI * (f64::from(y) + 0.5) / f64::from(rows));
            for x in along(column, width, columns) {
                let (s, c) =
                    real::sin_cos((f64::from(x) + 0.5) / f64::from(columns) * 2.0 * PI - PI);
                let direction = placement * DVec3::new(sin * s, cos, -sin * c);
                let cosine = direction.normalize_or_zero().dot(up).max(0.0) as f32;
                let [r, g, b, _] = picture.map_or([1.0; 4], |picture| picture.rgba(x, y));
                for (sum, value) in sum.iter_mut().zip([r, g, b]) {
                    *sum += value * cosine;
                }
                count += 1.0;
            }
        }
        values.extend(sum.map(|sum| sum / count));
    }
    Environment::Image {
        image: Arc::new(Image::from_f32(width, height, 3, values)),
        scale,
        world_from_environment: match environment {
            Environment::Constant(_) => snell_math::DAffine3::IDENTITY,
            Environment::Image { world_from_environment, .. } => *world_from_environment,
        },
    }
}

#[cfg(test)]
mod tests {
    use crate::integrator::aov::Aov;
    use crate::job::Job;
    use crate::{CompiledScene, Settings};
    use snell_intersect::shape::BoxShape;
    use snell_math::{DVec3, Rgb, Vec3};
    use snell_scene::framing::default_material;
    use snell_scene::light::environment::EnvironmentLight;
    use snell_scene::{Background, Camera, Environment, Node, Scene, ShadowCatcher, Surface};

    /// A square plate of side 2 at a height of 1 over the origin, under this environment.
    fn plate(environment: Environment) -> Scene {
        let mut scene = Scene::new("plate");
        let grey = scene.add_material(default_material());
        let plate = BoxShape { min: DVec3::new(-1.0, 1.0, -1.0), max: DVec3::new(1.0, 1.001, 1.0) };
        let surfaces = vec![Surface::shape(plate, grey)];
        scene.add_child(scene.root, Node { surfaces, ..Node::default() });
        scene.environment = Some(environment);
        scene.background = Background::ShadowCatcher(ShadowCatcher {
            color: Rgb::new(0.2, 0.4, 0.8),
            up: DVec3::Y * 3.0,
            height: 0.0,
        });
        scene
    }

    /// The colour and alpha that a narrow camera at `eye` sees around a point of the floor, and the
    /// depth.
    fn seen(scene: &Scene, eye: Vec3, point: Vec3) -> ([f32; 4], f32) {
        let camera = Camera::look_at(eye, point, Vec3::Y, 1e-3);
        let aovs = vec![Aov::Depth];
        let settings = Settings { size: [1, 1], spp: 1024, aovs, ..Settings::default() };
        let compiled = CompiledScene::new(scene, &settings.build).expect("a valid scene");
        let image = Job::new(&compiled, &camera, &settings).run(1, &|_| true).0.image();
        let [r, g, b, a] = std::array::from_fn(|i| image.layers[0].values[i]);
        ([r, g, b, a], image.layers[1].values[0])
    }

    #[test]
    fn the_shadow_is_the_light_that_an_occluder_takes() {
        let scene = plate(Environment::Constant(Rgb::new(3.0, 2.0, 1.0)));
        let eye = Vec3::new(20.0, 3.0, 0.0);
        // The form factor of a square seen from under its middle.
        let blocked = 4.0 / std::f32::consts::PI / 2f32.sqrt() * (1.0 / 2f32.sqrt()).atan();
        let (shadow, depth) = seen(&scene, eye, Vec3::ZERO);
        for (found, full) in shadow.into_iter().zip([0.2, 0.4, 0.8]) {
            assert!((found / full - (1.0 - blocked)).abs() < 0.01, "{shadow:?}, {blocked}");
        }
        assert!(shadow[3] == 1.0 && depth == 0.0, "the floor is no surface: {depth}");
        // Where nothing is in the way of the light there is no noise, and above the horizon there
        // is no floor.
        for point in [Vec3::new(-300.0, 0.0, 0.0), Vec3::new(0.0, 50.0, 0.0)] {
            let (lit, _) = seen(&scene, eye, point);
            let is_full = lit.iter().zip([0.2, 0.4, 0.8]).all(|(a, b)| (a - b).abs() < 1e-5);
            assert!(is_full, "{lit:?}");
        }
        let (below, _) = seen(&scene, Vec3::new(20.0, -3.0, 0.0), Vec3::new(0.0, -0.5, 0.0));
        assert!((below[0] - 0.2).abs() < 1e-5, "seen from below: {below:?}");
    }

    #[test]
    fn the_batched_renderer_agrees_with_the_textbook_on_shadows() {
        let scene = plate(snell_scene::framing::default_sky());
        let camera = Camera::look_at(Vec3::new(9.0, 5.0, 1.0), Vec3::ZERO, Vec3::Y, 0.6);
        for color in snell_math::ColorModel::ALL {
            let settings = Settings { size: [24, 18], spp: 5, color, ..Settings::default() };
            let compiled = CompiledScene::new(&scene, &settings.build).expect("a valid scene");
            let image = Job::new(&compiled, &camera, &settings).run(2, &|_| true).0.image();
            let expected = crate::reference::ray_cast(&compiled, &camera, &settings);
            let mut shadowed = 0;
            for (i, expected) in expected.iter().map(|color| color.to_array()).enumerate() {
                let found = &image.layers[0].values[i * 4..][..3];
                let is_equal =
                    found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 1e-5 * b.max(1.0));
                assert!(is_equal, "{color:?} pixel {i}: {found:?} {expected:?}");
                shadowed += usize::from(found[2] < 0.75 && found[0] < 0.19);
            }
            assert!(shadowed > 10, "{shadowed}");
        }
    }

    #[test]
    fn directions_are_sampled_by_the_light_that_the_floor_receives() {
        let sky = snell_scene::framing::default_sky();
        let light = EnvironmentLight::new(&super::received(&sky, DVec3::Y));
        let all = EnvironmentLight::new(&sky);
        for direction in [Vec3::new(-0.5, 0.6, 0.5), Vec3::new(0.3, 0.2, -0.9)].map(Vec3::normalize)
        {
            let mode = snell_math::ColorMode::Rgb;
            let expected = all.radiance(direction, mode) * direction.y;
            let found = light.radiance(direction, mode);
            assert!((found.0[1] / expected.0[1] - 1.0).abs() < 0.03, "{found:?} {expected:?}");
        }
        assert!(light.radiance(Vec3::NEG_Y, snell_math::ColorMode::Rgb).is_black());
    }
}
