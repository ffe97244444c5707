//! Samples of lights without a surface, for many vertices at once: [punctual](PunctualLight) lights
//! are evaluated together, others (pictures, tables, panels) one by one.

use super::{LightArrivals, Scatterers};
use crate::compile::BareLight;
use crate::integrator::estimators::SHADOW_END;
use crate::lanes::{HitColors, LANES, NOUGHTS, ZERO, at, put, put_color};
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::{Wide, mask_select};
use snell_math::{ColorMode, DVec3, Rgb, Vec2, Vec3, at_level};
use snell_scene::light::Attenuation;
use snell_scene::light::punctual::{Cone, PunctualLight, PunctualSample};

type Doubles = [f64; LANES];

/// The lights of the lanes without a surface, and the light incident from them. Lanes without such
/// a light hold arbitrary values.
#[derive(Debug)]
pub struct DeltaSamples {
    lights: PunctualLights,
    /// 1 for lanes that sample such a light, 0 for others.
    has: [u32; LANES],
    /// See [`PunctualSample`] for this field and the next two.
    direction: HitVectors,
    distance: HitLanes,
    factor: HitLanes,
    /// 1 if light arrives, 0 if not.
    arrives: [u32; LANES],
}

/// The columns of [`PunctualLight`], by lane.
#[derive(Debug)]
struct PunctualLights {
    /// 1 for punctual lights, 0 for others.
    is_punctual: [u32; LANES],
    position: [Doubles; 3],
    direction: [Doubles; 3],
    color: HitVectors,
    attenuation: HitVectors,
    body_radius: Doubles,
    outer: Doubles,
    inner: Doubles,
    edge: [Doubles; 3],
    /// 1 for true, 0 for false.
    is_parallel: [u32; LANES],
}

impl Default for DeltaSamples {
    fn default() -> Self {
        let (mark, doubles) = ([0; LANES], [0.0; LANES]);
        let lights = PunctualLights {
            is_punctual: mark,
            position: [doubles; 3],
            direction: [doubles; 3],
            color: ZERO,
            attenuation: ZERO,
            body_radius: doubles,
            outer: doubles,
            inner: doubles,
            edge: [doubles; 3],
            is_parallel: mark,
        };
        Self {
            lights,
            has: mark,
            direction: ZERO,
            distance: NOUGHTS,
            factor: NOUGHTS,
            arrives: mark,
        }
    }
}

impl DeltaSamples {
    /// Puts a light into a lane; `None` stands for a light that is not punctual.
    pub fn put(&mut self, lane: usize, light: Option<&PunctualLight>) {
        self.lights.is_punctual[lane] = u32::from(light.is_some());
        if let Some(light) = light {
            self.lights.put(lane, light);
        }
    }

    /// Samples the lights of `lanes` for paths at `positions` in these colour modes, with the
    /// random numbers `u`. Stores the radiance in the lanes, except for punctual lights in spectral
    /// mode, whose spectrum is applied later.
    pub fn sample<'a>(
        &mut self,
        lanes: &[u32],
        light: impl Fn(usize) -> Option<&'a BareLight>,
        (positions, modes): (&HitVectors, &[ColorMode; LANES]),
        u: &[HitLanes; 2],
        radiance: &mut HitColors,
        wide: Option<Wide>,
    ) {
        self.has = [0; LANES];
        lanes.iter().for_each(|&lane| self.has[lane as usize % LANES] = 1);
        at_level!(
            wide,
            sample_punctual,
            (
                positions: &HitVectors = positions,
                to: &mut DeltaSamples = self,
                radiance: &mut HitColors = radiance
            )
        );
        for &lane in lanes {
            let lane = lane as usize % LANES;
            if self.lights.is_punctual[lane] != 0 {
                continue;
            }
            let u = Vec2::new(u[0][lane], u[1][lane]);
            let sample =
                light(lane).and_then(|light| light.sample(at(positions, lane), u, modes[lane]));
            self.arrives[lane] = u32::from(sample.is_some());
            if let Some(sample) = sample {
                put(&mut self.direction, lane, sample.direction);
                self.distance[lane] = sample.distance;
                put_color(radiance, lane, sample.radiance);
            }
        }
    }

    /// The factor on the colour of the light of a lane; `None` if the light is not punctual.
    pub fn factor(&self, lane: usize) -> Option<f32> {
        (self.lights.is_punctual[lane] != 0).then_some(self.factor[lane])
    }
}

impl PunctualLights {
    fn put(&mut self, lane: usize, light: &PunctualLight) {
        let &PunctualLight {
            position,
            direction,
            color,
            attenuation,
            body_radius,
            cone,
            is_parallel,
        } = light;
        for axis in 0..3 {
            self.position[axis][lane] = position[axis];
            self.direction[axis][lane] = direction[axis];
            self.attenuation[axis][lane] = attenuation.0[axis];
            self.edge[axis][lane] = cone.edge[axis];
        }
        put(&mut self.color, lane, Vec3::new(color.r, color.g, color.b));
        let Cone { outer, inner, .. } = cone;
        (self.body_radius[lane], self.outer[lane], self.inner[lane]) = (body_radius, outer, inner);
        self.is_parallel[lane] = u32::from(is_parallel);
    }

    #[inline(always)]
    fn get(&self, i: usize) -> PunctualLight {
        let vector = |v: &[Doubles; 3]| DVec3::new(v[0][i], v[1][i], v[2][i]);
        let ([c0, c1, c2], [e0, e1, e2]) = (&self.attenuation, &self.edge);
        PunctualLight {
            position: vector(&self.position),
            direction: vector(&self.direction),
            color: Rgb::new(self.color[0][i], self.color[1][i], self.color[2][i]),
            attenuation: Attenuation([c0[i], c1[i], c2[i]]),
            body_radius: self.body_radius[i],
            cone: Cone { outer: self.outer[i], inner: self.inner[i], edge: [e0[i], e1[i], e2[i]] },
            is_parallel: self.is_parallel[i] != 0,
        }
    }
}

/// Applies [`PunctualLight::sample`] in every lane.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "plain loops become vector code")]
fn sample_punctual(positions: &HitVectors, to: &mut DeltaSamples, radiance: &mut HitColors) {
    for i in 0..LANES {
        let light = to.lights.get(i);
        let PunctualSample { direction, distance, factor, arrives } =
            light.sample(at(positions, i));
        for axis in 0..3 {
            to.direction[axis][i] = direction[axis];
        }
        (to.distance[i], to.factor[i], to.arrives[i]) = (distance, factor, u32::from(arrives));
        let has = to.has[i] & to.lights.is_punctual[i];
        let color = light.color * factor;
        for (channel, color) in [color.r, color.g, color.b].into_iter().enumerate() {
            radiance[channel][i] = mask_select(has, color, radiance[channel][i]);
        }
    }
}

/// Writes the arrivals of samples of lights that were chosen with these probabilities. BSDF samples
/// cannot find these lights, so the MIS weight is 1.
#[inline(always)]
pub fn arrive_from_delta<S: Scatterers>(
    from: &DeltaSamples,
    probability: &HitLanes,
    to: &S,
    arrivals: &mut LightArrivals,
) {
    for i in 0..LANES {
        let (has, direction, distance) = (from.has[i], at(&from.direction, i), from.distance[i]);
        let (share, is_seen) = to.share(i, direction);
        let (position, origin) = (at(to.position(), i), to.ray_origin(i, direction));
        let target = position + direction * distance;
        let is_far = distance == f32::INFINITY;
        for axis in 0..3 {
            let way = if is_far { direction[axis] } else { target[axis] - origin[axis] };
            arrivals.origin[axis][i] = mask_select(has, origin[axis], arrivals.origin[axis][i]);
            arrivals.way[axis][i] = mask_select(has, way, arrivals.way[axis][i]);
            arrivals.direction[axis][i] =
                mask_select(has, direction[axis], arrivals.direction[axis][i]);
        }
        let (probability, end) = (probability[i], if is_far { f32::INFINITY } else { SHADOW_END });
        arrivals.density[i] = mask_select(has, probability, arrivals.density[i]);
        arrivals.end[i] = mask_select(has, end, arrivals.end[i]);
        arrivals.share[i] = mask_select(has, share, arrivals.share[i]);
        arrivals.weight[i] = mask_select(has, 1.0, arrivals.weight[i]);
        arrivals.scale[i] = mask_select(has, 1.0 / probability, arrivals.scale[i]);
        arrivals.is_delta[i] = has;
        arrivals.exists[i] =
            mask_select(has, from.arrives[i] & u32::from(is_seen), arrivals.exists[i]);
    }
}

#[cfg(test)]
mod tests {
    use crate::batch::twins::{assert_same_at_every_level, every_second_node};
    use crate::compile::Moving;
    use crate::{Guiding, Settings};
    use snell_math::{ColorModel, Rgb};
    use snell_scene::Light;
    use snell_scene::builtin::builtin;
    use snell_scene::light::{Spot, SpotFalloff};
    use snell_scene::material::{Diffuse, MaterialKind};
    use snell_scene::medium::Homogeneous;

    /// One light of every kind, and spot lights with the edges of both versions of pbrt.
    fn lights() -> Vec<Light> {
        let mut lights = Light::examples();
        let (inner, outer) = (0.2, 0.6);
        for falloff in [SpotFalloff::Step { inner, outer }, SpotFalloff::Fourth { inner, outer }] {
            let of_cosines = |spot| Light::from(Spot { falloff, ..spot });
            lights.extend(Spot::examples().into_iter().take(1).map(of_cosines));
        }
        lights
    }

    #[test]
    fn lights_without_a_surface_bring_the_bits_of_one_at_a_time() {
        let guiding = Some(Guiding { passes: 2, photons: 1 << 13 });
        let only = |light: Light| vec![light];
        let of_each = lights().into_iter().map(only).chain([lights()]);
        for (number, lights) in of_each.enumerate() {
            let mut scene = builtin("spheres").expect("the scene is built in");
            (scene.environment, scene.lights) = (None, lights);
            let kinds = MaterialKind::examples();
            for (i, material) in scene.materials.iter_mut().enumerate() {
                material.kind = match i % 2 {
                    0 => Diffuse::new(Rgb::new(0.9, 0.6, 0.3)).into(),
                    _ => kinds[(number + i) % kinds.len()].clone(),
                };
            }
            if number % 3 == 2 {
                let colors = (Rgb::new(0.05, 0.07, 0.1), Rgb::new(0.9, 0.8, 1.0));
                scene.medium =
                    Some(scene.add_medium(Homogeneous::scattering(colors.0, colors.1, 0.4)));
            }
            let ways =
                [(ColorModel::Rgb, None), (ColorModel::Spectral, None), (ColorModel::Rgb, guiding)];
            for (color, guiding) in ways {
                let settings = Settings {
                    size: [32, 24],
                    spp: 4,
                    max_depth: 5,
                    color,
                    guiding,
                    ..Settings::default()
                };
                let picture = assert_same_at_every_level(&scene, &Moving::default(), &settings);
                assert!(picture.iter().any(|&x| x > 0.0), "{number} {:?}", scene.lights);
            }
            let settings = Settings { size: [32, 24], spp: 4, ..Settings::default() };
            assert_same_at_every_level(&scene, &every_second_node(&scene), &settings);
        }
    }
}
