//! Light samples from an environment image: the tables are searched lane by lane, and the rest is
//! computed in batches. Also the look-up positions of paths that leave the scene.

use super::{LightArrivals, Scatterers};
use crate::lanes::{LANES, ZERO, at, put};
use snell_intersect::triangles::{HitLanes, HitVectors};
use snell_math::simd::{Wide, mask_select};
use snell_math::{Mat3, Vec2, Vec3, at_level, sampling};
use snell_scene::light::environment::{DrawnDirection, EnvironmentLight, SkySample, place_of};

/// Samples of an environment, by lane. Lanes without a sample hold arbitrary values.
#[derive(Debug)]
pub struct SkySamples {
    /// The columns of [`DrawnDirection`].
    height: [f64; LANES],
    turn: [f64; LANES],
    pdf: HitLanes,
    /// 1 where a sample exists, 0 elsewhere.
    exists: [u32; LANES],
    world_from_environment: Mat3,
}

/// The look-up positions in the image ([`EnvironmentLight::place`]), by lane.
pub type SkyPlaces = [HitLanes; 2];

/// Arbitrary positions, for lanes that use none.
pub const NO_PLACES: SkyPlaces = [[0.0; LANES]; 2];

impl Default for SkySamples {
    fn default() -> Self {
        Self {
            height: [0.0; LANES],
            turn: [0.0; LANES],
            pdf: [0.0; LANES],
            exists: [0; LANES],
            world_from_environment: Mat3::IDENTITY,
        }
    }
}

impl SkySamples {
    /// Samples the environment for these lanes, with the random numbers `u`.
    pub fn draw(&mut self, sky: &EnvironmentLight, lanes: &[u32], u: &[HitLanes; 2]) {
        self.exists = [0; LANES];
        self.world_from_environment = sky.world_from_environment();
        for &lane in lanes {
            let lane = lane as usize % LANES;
            let drawn = sky.draw_compensated(Vec2::new(u[0][lane], u[1][lane]));
            let DrawnDirection { height, turn, pdf } = drawn.unwrap_or_default();
            (self.height[lane], self.turn[lane], self.pdf[lane]) = (height, turn, pdf);
            self.exists[lane] = u32::from(drawn.is_some());
        }
    }

    #[inline(always)]
    fn get(&self, lane: usize) -> SkySample {
        let drawn = DrawnDirection {
            height: self.height[lane],
            turn: self.turn[lane],
            pdf: self.pdf[lane],
        };
        SkySample::new(drawn, &self.world_from_environment)
    }
}

/// Writes the arrivals of samples of an environment that was chosen with these probabilities.
#[inline(always)]
pub fn arrive_from_sky<S: Scatterers>(
    from: &SkySamples,
    probability: &HitLanes,
    to: &S,
    places: &mut SkyPlaces,
    arrivals: &mut LightArrivals,
) {
    for i in 0..LANES {
        let SkySample { direction, pdf, place } = from.get(i);
        let (share, is_seen) = to.share(i, direction);
        let density = pdf * probability[i];
        let weight = sampling::power_heuristic(density, share);
        let origin = to.ray_origin(i, direction);
        (places[0][i], places[1][i]) = (place.x, place.y);
        let exists = from.exists[i];
        for axis in 0..3 {
            arrivals.origin[axis][i] = mask_select(exists, origin[axis], arrivals.origin[axis][i]);
            arrivals.way[axis][i] = mask_select(exists, direction[axis], arrivals.way[axis][i]);
            arrivals.direction[axis][i] =
                mask_select(exists, direction[axis], arrivals.direction[axis][i]);
        }
        arrivals.density[i] = mask_select(exists, density, arrivals.density[i]);
        arrivals.end[i] = mask_select(exists, f32::INFINITY, arrivals.end[i]);
        arrivals.share[i] = mask_select(exists, share, arrivals.share[i]);
        arrivals.weight[i] = mask_select(exists, weight, arrivals.weight[i]);
        arrivals.scale[i] = mask_select(exists, weight / density, arrivals.scale[i]);
        arrivals.exists[i] = mask_select(exists, u32::from(is_seen), arrivals.exists[i]);
    }
}

/// The look-up position in the image for each of these directions, of which there are at most
/// [`LANES`] ([`EnvironmentLight::place`]).
pub fn places_of(
    sky: &EnvironmentLight,
    directions: impl Iterator<Item = Vec3>,
    wide: Option<Wide>,
) -> SkyPlaces {
    let (mut of, mut places) = (ZERO, NO_PLACES);
    for (lane, direction) in directions.enumerate().take(LANES) {
        put(&mut of, lane, direction);
    }
    at_level!(
        wide,
        look_up,
        (
            world_from_environment: &Mat3 = &sky.world_from_environment(),
            directions: &HitVectors = &of,
            places: &mut SkyPlaces = &mut places,
        )
    );
    places
}

#[inline(always)]
fn look_up(world_from_environment: &Mat3, directions: &HitVectors, places: &mut SkyPlaces) {
    let [x, y] = places;
    for (i, (x, y)) in x.iter_mut().zip(y).enumerate() {
        (*x, *y) = place_of(world_from_environment, at(directions, i)).into();
    }
}
