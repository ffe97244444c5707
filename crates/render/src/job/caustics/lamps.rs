//! The lamps that send photons, and what of their light paths leave to the photons.

use crate::compile::casters::Target;
use crate::compile::{CompiledLight, CompiledScene};
use crate::integrator::light_part::LightSource;
use crate::settings::CausticsMode;
use snell_intersect::Hit;
use snell_math::{ColorMode, Vec2, Vec3, rng};
use snell_scene::MaterialId;
use snell_scene::light::environment::EnvironmentLight;

/// The light of an environment above this many times its mean is that of photons.
const ABOVE_MEAN: f64 = 8.0;
/// The least share of an environment's light that is worth photons.
const LEAST_SHARE: f64 = 0.01;
/// Samples that measure that share.
const SKY_SAMPLES: u32 = 4096;
/// The largest solid angle of a lamp, in sr, as seen from a target or from elsewhere in the scene,
/// that [`CausticsMode::Auto`] calls small.
const SMALL: f64 = 0.1;
/// The distance of "elsewhere", in radii of the scene.
const ELSEWHERE: f64 = 0.3;
/// The largest number of pairs of lamps and targets.
const MOST_PAIRS: usize = 1 << 18;

/// The lamps that send photons, each with the targets that it aims at.
#[derive(Debug, Default)]
pub struct Lamps {
    /// The pairs of a light's number and a target's, which are chosen by power and solid angle.
    pairs: Vec<[u32; 2]>,
    /// The sum of the probabilities of all pairs up to each.
    sums: Vec<f64>,
    of_light: Vec<bool>,
    of_material: Vec<bool>,
    /// The luminance above which the environment's light is that of photons, if it sends any.
    sky_limit: Option<f32>,
}

/// A lamp and a target that were chosen for a photon.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    /// The number of the light.
    pub light: usize,
    /// The number of the target.
    pub target: u32,
    /// The probability of the choice.
    pub probability: f32,
}

impl Lamps {
    /// The lamps of a scene that send photons at these targets.
    pub fn new(scene: &CompiledScene, targets: &[Target], mode: CausticsMode) -> Self {
        let mut lamps = Self {
            of_light: vec![false; scene.lights().len()],
            of_material: vec![false; scene.materials.len()],
            ..Self::default()
        };
        let mut share = vec![1.0; scene.lights().len()];
        let materials: Vec<Vec<MaterialId>> =
            scene.lights().iter().map(|light| materials_of(scene, light)).collect();
        // The light of a material is that of photons only if all of its lamps are small.
        let mut is_large = vec![false; scene.materials.len()];
        for (number, light) in scene.lights().iter().enumerate() {
            match light {
                CompiledLight::Light(_) => lamps.of_light[number] = true,
                CompiledLight::Area(_) | CompiledLight::Moving(_) => {
                    let is_small = mode == CausticsMode::On || is_small(scene, light, targets);
                    for id in &materials[number] {
                        lamps.of_material[id.index()] = true;
                        is_large[id.index()] |= !is_small;
                    }
                }
                CompiledLight::Medium(..) => {}
                CompiledLight::Environment => {
                    let sky = scene.environment.as_deref().filter(|sky| !sky.has_portals());
                    let bright = sky.and_then(bright_part);
                    lamps.sky_limit = bright.map(|(limit, _)| limit);
                    share[number] = bright.map_or(0.0, |(_, share)| share);
                    lamps.of_light[number] = bright.is_some();
                }
            }
        }
        lamps.of_material.iter_mut().zip(is_large).for_each(|(is, is_large)| *is &= !is_large);
        for (is_lamp, materials) in lamps.of_light.iter_mut().zip(&materials) {
            *is_lamp |= materials.iter().any(|id| lamps.of_material[id.index()]);
        }
        lamps.list(scene, targets, &share);
        lamps
    }

    /// Lists the pairs of lamps and targets.
    fn list(&mut self, scene: &CompiledScene, targets: &[Target], share: &[f64]) {
        let mut sum = 0.0;
        let count = self.of_light.iter().filter(|&&is| is).count();
        if count.saturating_mul(targets.len()) > MOST_PAIRS {
            return self.clear();
        }
        for number in (0..self.of_light.len()).filter(|&number| self.of_light[number]) {
            let power = scene.light_power(number) * share[number];
            if !(power > 0.0 && power.is_finite()) {
                continue;
            }
            let place = place_of(scene, &scene.lights()[number]);
            for (target, sphere) in (0..).zip(targets) {
                let seen = match place {
                    Some(place) => f64::from(sphere.share_seen_from(place)),
                    None => f64::from(sphere.radius / scene.radius).min(1.0),
                };
                // No pair is left out, because a lamp may be near with another of its ends.
                sum += power * seen.max(1e-4);
                self.pairs.push([number as u32, target]);
                self.sums.push(sum);
            }
        }
        self.sums.iter_mut().for_each(|part| *part /= sum);
    }

    /// No lamps.
    fn clear(&mut self) {
        self.of_light.fill(false);
        self.of_material.fill(false);
        self.sky_limit = None;
    }

    /// True if some lamp sends photons.
    pub fn exist(&self) -> bool {
        !self.pairs.is_empty()
    }

    /// True if the light of surfaces of this material is that of photons.
    pub fn has_material(&self, material: MaterialId) -> bool {
        self.of_material[material.index()]
    }

    /// Chooses a lamp and a target.
    pub fn choose(&self, u: f32) -> Option<Aim> {
        let u = f64::from(u);
        let at = self.sums.partition_point(|&sum| sum <= u).min(self.sums.len().checked_sub(1)?);
        let before = if at == 0 { 0.0 } else { self.sums[at - 1] };
        let probability = (self.sums[at] - before) as f32;
        let [light, target] = self.pairs[at];
        (probability > 0.0).then_some(Aim { light: light as usize, target, probability })
    }

    /// The share of the light of a light sample in this direction that is left to paths.
    pub fn left_of_source(
        &self,
        scene: &CompiledScene,
        source: LightSource,
        direction: Vec3,
    ) -> f32 {
        match source {
            LightSource::Light(light) => f32::from(!self.of_light[light as usize]),
            LightSource::Material(material) => f32::from(!self.of_material[material.index()]),
            LightSource::Environment => self.left_of_sky(scene, direction),
            LightSource::Medium => 1.0,
        }
    }

    /// The share of the light that a path has found along a ray in this direction that is left to
    /// paths.
    pub fn left_of_hit(&self, scene: &CompiledScene, hit: &Hit, direction: Vec3) -> f32 {
        if !hit.is_hit() {
            return self.left_of_sky(scene, direction);
        }
        let is_photons = self.of_material[scene.material_id(hit).index()]
            && scene.light_of(hit.instance, hit.geometry).is_some();
        f32::from(!is_photons)
    }

    /// The share of the environment's light from a direction that is left to paths.
    pub fn left_of_sky(&self, scene: &CompiledScene, direction: Vec3) -> f32 {
        match (&scene.environment, self.sky_limit) {
            (Some(sky), Some(limit)) => below(sky, sky.place(direction), limit),
            _ => 1.0,
        }
    }
}

/// The share of the environment's light at a place that is below a luminance.
fn below(sky: &EnvironmentLight, place: Vec2, limit: f32) -> f32 {
    let luminance = ColorMode::Rgb.to_rgb(sky.radiance_at(place, ColorMode::Rgb)).luminance();
    if luminance > limit { limit / luminance } else { 1.0 }
}

/// The luminance above which an environment's light is that of photons, and the share of all of its
/// light that this is; `None` if it is not worth it.
fn bright_part(sky: &EnvironmentLight) -> Option<(f32, f64)> {
    let mean = sky.mean_luminance();
    let limit = (mean * ABOVE_MEAN) as f32;
    if !(limit > 0.0 && limit.is_finite()) {
        return None;
    }
    let mut above = 0.0;
    for i in 0..SKY_SAMPLES {
        let Some(sample) = sky.sample_compensated(rng::uniform2([i, 0, 0, 0])) else { continue };
        let radiance = sky.radiance_at(sample.place, ColorMode::Rgb);
        let luminance = ColorMode::Rgb.to_rgb(radiance).luminance();
        above += f64::from((luminance - limit).max(0.0) / sample.pdf);
    }
    let share = above / (f64::from(SKY_SAMPLES) * 4.0 * std::f64::consts::PI * mean);
    (share > LEAST_SHARE).then_some((limit, share.min(1.0)))
}

/// The materials of an emissive surface; none for other lights.
fn materials_of(scene: &CompiledScene, light: &CompiledLight) -> Vec<MaterialId> {
    let area = match light {
        CompiledLight::Area(area) => area,
        CompiledLight::Moving(moving) => &moving.first,
        _ => return Vec::new(),
    };
    let (instance, geometry) = area.ids;
    let of_part = |part| {
        let primitive = area.primitive_of(part);
        scene.material_id(&Hit { instance, geometry, primitive, ..Hit::MISS })
    };
    let mut all: Vec<MaterialId> = (0..area.part_count()).map(of_part).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// A point of a light; `None` for light from far.
fn place_of(scene: &CompiledScene, light: &CompiledLight) -> Option<Vec3> {
    match light {
        CompiledLight::Light(bare) => bare.light.position().map(|p| p.as_vec3()),
        CompiledLight::Area(area) => area.sample(Vec2::splat(0.5)).map(|s| s.surface.position),
        CompiledLight::Moving(moving) => {
            moving.first.sample(Vec2::splat(0.5)).map(|s| s.surface.position)
        }
        CompiledLight::Medium(..) => Some(scene.center),
        CompiledLight::Environment => None,
    }
}

/// True if a lamp is small as seen from the nearest target, or else from elsewhere in the scene.
fn is_small(scene: &CompiledScene, light: &CompiledLight, targets: &[Target]) -> bool {
    let (area, place) = match light {
        CompiledLight::Area(area) => (area.area(), place_of(scene, light)),
        CompiledLight::Moving(moving) => (moving.first.area(), place_of(scene, light)),
        _ => return false,
    };
    let Some(place) = place else { return false };
    let nearest =
        targets.iter().map(|target| target.center.distance(place)).fold(f32::INFINITY, f32::min);
    let distance = f64::from(nearest).max(ELSEWHERE * f64::from(scene.radius));
    // About a quarter of the surface of a body is seen, and half of a sheet.
    area * 0.25 < SMALL * distance * distance
}
