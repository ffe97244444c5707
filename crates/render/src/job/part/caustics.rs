//! Photons in the renderer of parts: what paths gather at surfaces and in media, and what they
//! leave to photons ([`crate::job::caustics`]).

use super::PartRenderer;
use crate::film::BLOCK;
use crate::integrator::MediumVertex;
use crate::integrator::carried::Chain;
use crate::integrator::light_part::{LightSource, LightTag, LobeShares};
use crate::job::caustics::{Caustics, PhotonMap, PhotonMaps, Windows};
use crate::job::journal::Event;
use crate::job::volumes::VolumeBatch;
use snell_intersect::SurfaceInteraction;
use snell_math::spectrum::LANES as COLORS;
use snell_math::{SampledSpectrum, Vec3};
use snell_scene::material::ShadingBsdf;
use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::Arc;

/// How far from the tangent plane photons are gathered, in radii.
const THICKNESS: f32 = 0.3;
/// The least cosine of a photon's direction with the surface. It bounds what a photon brings.
const LEAST_COS: f32 = 1e-3;

/// The number of tags among which a photon's is looked for. Most photons near a point have one of
/// a few.
const RECENT: usize = 8;

/// The photons that a renderer of parts uses.
pub struct Gathering<'a> {
    technique: &'a Caustics<'a>,
    /// The maps of the current block; `None` while a guiding field is trained.
    maps: Option<(Arc<PhotonMaps>, Windows)>,
    /// True if photons are gathered at all.
    gathers: bool,
    /// What each path has arrived at.
    arrivals: Vec<Arrival>,
}

/// What a path has arrived at, as far as photons are concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Arrival {
    /// Nothing that scatters it.
    Nowhere,
    /// A caster.
    Caster,
    /// Another surface or a point of a medium, without photons nearby.
    Receiver,
    /// Another surface or a point of a medium, perhaps with photons nearby.
    NearPhotons,
}

impl<'a> Gathering<'a> {
    /// For renders of the picture.
    pub fn new(technique: &'a Caustics<'a>) -> Self {
        Self { technique, maps: None, gathers: true, arrivals: Vec::new() }
    }

    /// For the training of a guiding field, which need not find what photons bring.
    pub fn of_training(technique: &'a Caustics<'a>) -> Self {
        Self { gathers: false, ..Self::new(technique) }
    }
}

/// What a path has gathered at a point.
#[derive(Default)]
struct Sum {
    light: SampledSpectrum,
    photons: u32,
    /// The same by tag, if layers need it.
    parts: Vec<(SampledSpectrum, LightTag)>,
}

impl Sum {
    fn add(&mut self, light: SampledSpectrum, tag: Option<LightTag>) {
        self.light += light;
        self.photons += 1;
        let Some(tag) = tag else { return };
        match self.parts.iter_mut().rev().take(RECENT).find(|(_, known)| *known == tag) {
            Some((sum, _)) => *sum += light,
            None => self.parts.push((light, tag)),
        }
    }
}

/// Which photons a path sees at a vertex.
struct Sight {
    /// The random number that chose the wavelengths of the path; `None` in RGB mode.
    hue: Option<f32>,
    time: f32,
    windows: Windows,
    /// The largest number of casters on the way of a photon.
    most_bounces: u32,
}

impl Sight {
    /// The power of a photon in the colours of the path, and a factor on it; `None` if the path
    /// does not see it.
    #[inline]
    fn power(&self, map: &PhotonMap, photon: u32) -> Option<(SampledSpectrum, f32)> {
        let mut flux = map.flux(photon);
        if let Some(hue) = self.hue {
            flux = seen_at(flux, map.hue(photon), hue, self.windows.hue);
            if flux.is_black() {
                return None;
            }
        }
        let moment = map.time(photon).map_or(1.0, |t| weight_of(t, self.time, self.windows.time));
        (moment != 0.0).then_some((flux, moment))
    }
}

impl<'a> PartRenderer<'a> {
    /// Makes the maps of the block of a sample, if photons are to be gathered.
    pub(super) fn take_map(&mut self, sample: u32) {
        let Some(gathering) = self.caustics.as_mut().filter(|gathering| gathering.gathers) else {
            return;
        };
        let pass = sample / BLOCK;
        let maps = gathering.technique.maps(pass, &mut self.tracer);
        gathering.maps = maps.map(|maps| (maps, gathering.technique.windows(pass)));
    }

    /// Gathers photons for all paths that have arrived on a surface, or that a medium scatters.
    pub(super) fn gather(&mut self, depth: u32) {
        let Some(mut gathering) = self.caustics.take() else { return };
        let maps = gathering.maps.clone();
        let scene = gathering.technique.scene;
        // (A short loop, in which many looks at the map are under way at once.)
        gathering.arrivals.clear();
        gathering.arrivals.extend((0..self.paths.len()).map(|path| {
            let hit = &self.paths.hits[path];
            let is_near = match self.scattered_at(path) {
                _ if self.paths.is_dead(path) => return Arrival::Nowhere,
                Some(at) => {
                    maps.as_ref().is_some_and(|(maps, _)| maps.in_media.may_be_near(at.position))
                }
                None if !hit.is_hit() => return Arrival::Nowhere,
                None if scene.casters().is_caster(scene.material_id(hit)) => {
                    return Arrival::Caster;
                }
                None => {
                    let point = self.paths.rays[path].at(hit.t);
                    maps.as_ref().is_some_and(|(maps, _)| maps.on_surfaces.may_be_near(point))
                }
            };
            if is_near { Arrival::NearPhotons } else { Arrival::Receiver }
        }));
        self.caustics = Some(gathering);
        let maps = maps.filter(|_| depth < self.context.max_depth());
        let Some((maps, windows)) = maps else { return };
        for path in 0..self.paths.len() {
            if self.arrival(path) != Arrival::NearPhotons {
                continue;
            }
            match self.scattered_at(path) {
                Some(at) => {
                    let sum = self.gathered_in_medium(depth, path, (&maps.in_media, windows), &at);
                    self.bring(path, &sum);
                }
                None => self.gather_at(depth, path, &maps.on_surfaces, windows),
            }
        }
    }

    fn arrival(&self, path: usize) -> Arrival {
        let arrivals = self.caustics.as_ref().map(|gathering| &gathering.arrivals[..]);
        arrivals.and_then(|all| all.get(path).copied()).unwrap_or(Arrival::Nowhere)
    }

    fn gather_at(&mut self, depth: u32, path: usize, map: &PhotonMap, windows: Windows) {
        let scene = self.context.scene;
        let interaction = self.paths.interaction(scene, path);
        let outside_ior = self.batch(depth).outside_ior(path);
        let surface = self.paths.surface(scene, path, &interaction, outside_ior);
        let wo = -self.paths.rays[path].direction;
        let point = surface.point(scene);
        let shading = surface.material.prepared_towards(surface.prepared, &point, wo);
        if shading.is_delta() {
            return;
        }
        let sum = self.gathered_at(depth, path, (map, windows), &interaction, &shading, wo);
        self.bring(path, &sum);
    }

    /// Adds to the light of a path what it has gathered.
    fn bring(&mut self, path: usize, sum: &Sum) {
        let throughput = self.paths.carried[path].throughput;
        let radiance = self.clamped(true, throughput * sum.light);
        if radiance.is_black() || !radiance.is_finite() {
            return;
        }
        let sample = self.paths.samples[path];
        self.samples[sample as usize].radiance += radiance;
        for (light, tag) in &sum.parts {
            let mode = self.facts[sample as usize].mode;
            self.light_parts.add(&mut self.aovs, sample, throughput * *light, tag, mode);
        }
        if let Some(journal) = &mut self.journal {
            let photons = sum.photons;
            journal.events.push(Event::Photons { path, sample, radiance, photons });
        }
    }

    /// The light that photons near a point send to `wo`.
    fn gathered_at(
        &self,
        depth: u32,
        path: usize,
        (map, windows): (&PhotonMap, Windows),
        at: &SurfaceInteraction,
        shading: &ShadingBsdf,
        wo: Vec3,
    ) -> Sum {
        let (rest, mut sum) = (*self.paths.rest(path), Sum::default());
        let (normal, radius_squared) = (at.geometric_normal, map.radius * map.radius);
        let sight = self.sight(depth, path, windows);
        let (thickness, is_opaque) = (THICKNESS * map.radius, shading.is_opaque());
        let side = normal.dot(wo);
        // The most common surfaces scatter alike in all directions.
        let is_flat = shading.frame.z == normal || shading.frame.z == -normal;
        let matte = shading.bsdf.albedo_from_anywhere().filter(|_| is_flat && is_opaque);
        let matte = matte.map(|albedo| albedo * FRAC_1_PI);
        for photon in map.near(at.position).photons() {
            let offset = map.position(photon) - at.position;
            let height = offset.dot(normal);
            let distance_squared = offset.length_squared() - height * height;
            if distance_squared >= radius_squared || height.abs() > thickness {
                continue;
            }
            let (wi, bounces) = map.way(photon);
            let cos = normal.dot(wi);
            if bounces > sight.most_bounces || (is_opaque && cos * side <= 0.0) {
                continue;
            }
            let Some((flux, moment)) = sight.power(map, photon) else { continue };
            let value = match matte {
                Some(value) => value,
                None => shading.eval(wo, wi) * (1.0 / cos.abs().max(LEAST_COS)),
            };
            // A kernel that falls off towards the radius, of unit integral over the disk.
            let kernel = 2.0 * (1.0 - distance_squared / radius_squared) / (PI * radius_squared);
            let tag = (!self.light_parts.is_empty()).then(|| {
                let lobe = match self.context.wants_lobes && depth == 0 {
                    true => LobeShares::of_surface(shading, wo, wi, false),
                    false => rest.lobe,
                };
                self.tag_of_photon(map, photon, lobe, depth + 1 + bounces)
            });
            sum.add(flux * value * (kernel * moment), tag);
        }
        sum
    }

    /// The light that photons near a point of a medium send back along the path that the medium
    /// scatters there.
    fn gathered_in_medium(
        &self,
        depth: u32,
        path: usize,
        (map, windows): (&PhotonMap, Windows),
        at: &MediumVertex,
    ) -> Sum {
        let mut sum = Sum::default();
        let Some(media) = self.volumes.as_ref().map(VolumeBatch::surroundings) else { return sum };
        let medium = media.walker.medium_tag(media.known.get(media.insides[path]));
        let (forward, radius_squared) = (self.paths.rays[path].direction, map.radius * map.radius);
        let sight = self.sight(depth, path, windows);
        // A kernel that falls off towards the radius, of unit integral over the ball.
        let highest = 15.0 / (8.0 * PI * radius_squared * map.radius);
        for photon in map.near(at.position).photons() {
            let distance_squared = map.position(photon).distance_squared(at.position);
            if distance_squared >= radius_squared || map.medium(photon) != medium {
                continue;
            }
            let (wi, bounces) = map.way(photon);
            if bounces > sight.most_bounces {
                continue;
            }
            let Some((flux, moment)) = sight.power(map, photon) else { continue };
            let kernel = highest * (1.0 - distance_squared / radius_squared);
            let tag = (!self.light_parts.is_empty()).then(|| {
                let lobe = match self.context.wants_lobes && depth == 0 {
                    true => LobeShares::VOLUME,
                    false => self.paths.rest(path).lobe,
                };
                self.tag_of_photon(map, photon, lobe, depth + 1 + bounces)
            });
            sum.add(flux * (at.phase.pdf(forward, wi) * kernel * moment), tag);
        }
        sum
    }

    fn sight(&self, depth: u32, path: usize, windows: Windows) -> Sight {
        let most_bounces = self.context.max_depth().saturating_sub(depth + 1);
        Sight { hue: self.hue_of(path), time: self.paths.rest(path).time, windows, most_bounces }
    }

    fn tag_of_photon(
        &self,
        map: &PhotonMap,
        photon: u32,
        lobe: LobeShares,
        scatterings: u32,
    ) -> LightTag {
        self.tag(lobe, scatterings, map.source(photon).unwrap_or(LightSource::Medium))
    }

    /// The random number that chose the wavelengths of a path; `None` in RGB mode.
    fn hue_of(&self, path: usize) -> Option<f32> {
        if !matches!(self.paths.rest(path).mode, snell_math::ColorMode::Spectral(_)) {
            return None;
        }
        let key = self.keys[self.paths.samples[path] as usize];
        Some(self.sampler.numbers_of(key).number(crate::integrator::camera_path::WAVELENGTH))
    }

    /// The point at which a medium scatters a path; `None` if none does.
    fn scattered_at(&self, path: usize) -> Option<MediumVertex> {
        self.volumes.as_ref().and_then(|volumes| volumes.scattered[path])
    }

    /// The share of the light that a path finds at its vertex that is not that of photons.
    pub(super) fn left_to_path(&self, path: usize) -> f32 {
        let Some(Gathering { technique, .. }) = &self.caustics else { return 1.0 };
        if self.paths.carried[path].marks.chain() != Chain::Casters
            || self.scattered_at(path).is_some()
        {
            return 1.0;
        }
        let direction = self.paths.rays[path].direction;
        technique.lamps().left_of_hit(technique.scene, &self.paths.hits[path], direction)
    }

    /// The share of the light from a source in a direction that is not that of photons, at the
    /// vertex of a path.
    pub(super) fn left_to_light_ray(
        &self,
        path: usize,
        source: Option<LightSource>,
        direction: Vec3,
    ) -> f32 {
        let (Some(Gathering { technique, .. }), Some(source)) = (&self.caustics, source) else {
            return 1.0;
        };
        match self.chain_after(path, 1.0) {
            Chain::Casters => technique.lamps().left_of_source(technique.scene, source, direction),
            _ => 1.0,
        }
    }

    /// What a path has met since photons were gathered, after its current vertex, given the density
    /// with which its next direction was chosen (0 for a delta lobe).
    pub(super) fn chain_after(&self, path: usize, pdf: f32) -> Chain {
        match (self.arrival(path), self.paths.carried[path].marks.chain()) {
            (Arrival::Nowhere, _) | (Arrival::Caster, Chain::Free) => Chain::Free,
            (Arrival::Caster, Chain::Receiver | Chain::Casters) => Chain::Casters,
            (Arrival::Receiver | Arrival::NearPhotons, _) if pdf > 0.0 => Chain::Receiver,
            (Arrival::Receiver | Arrival::NearPhotons, _) => Chain::Free,
        }
    }
}

/// The part of a photon's power that paths of other wavelengths see, through a window of this
/// half-width. Both have their wavelengths at equal steps of the distribution function, so they
/// match after a rotation.
fn seen_at(flux: SampledSpectrum, of_photon: f32, of_path: f32, window: f32) -> SampledSpectrum {
    let steps = (of_path - of_photon) * COLORS as f32;
    let turn = (steps + 0.5).floor();
    if (steps - turn).abs() >= window * COLORS as f32 {
        return SampledSpectrum::ZERO;
    }
    let scale = 1.0 / (2.0 * COLORS as f32 * window);
    let turn = turn.rem_euclid(COLORS as f32) as usize;
    SampledSpectrum(std::array::from_fn(|lane| flux.0[(lane + turn) % COLORS] * scale))
}

/// The weight of a photon of a moment for a path of another one, through a window of this
/// half-width. Windows end where the shutter closes.
fn weight_of(of_photon: f32, of_path: f32, window: f32) -> f32 {
    if (of_photon - of_path).abs() >= window {
        return 0.0;
    }
    1.0 / ((of_path + window).min(1.0) - (of_path - window).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_keep_the_mean_of_what_is_seen_through_them() {
        const N: u32 = 4000;
        let each = |f: &dyn Fn(f32) -> f32| {
            (0..N).map(|i| f64::from(f((i as f32 + 0.5) / N as f32))).sum::<f64>() / f64::from(N)
        };
        for window in [0.125, 0.03, 0.01] {
            for path in [0.0, 0.1, 0.49, 0.9999] {
                // A photon of one wavelength that stands for all four.
                let hero = SampledSpectrum([4.0, 0.0, 0.0, 0.0]);
                for flux in [SampledSpectrum::ONE, hero] {
                    for lane in 0..COLORS {
                        let mean = each(&|photon| seen_at(flux, photon, path, window)[lane]);
                        assert!((mean - 1.0).abs() < 0.05, "{window} {path} {lane}: {mean}");
                    }
                }
                let mean = each(&|photon| weight_of(photon, path, window));
                assert!((mean - 1.0).abs() < 0.05, "{window} {path}: {mean}");
            }
        }
        // The lanes that match have the same wavelength.
        let flux = SampledSpectrum([1.0, 2.0, 3.0, 4.0]);
        for (photon, path, first) in [(0.1, 0.11, 1.0), (0.1, 0.36, 2.0), (0.6, 0.1, 3.0)] {
            assert_eq!(seen_at(flux, photon, path, 0.125)[0], first, "{photon} {path}");
        }
    }
}
