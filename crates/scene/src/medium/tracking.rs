//! Travel by chance collisions: media whose density is on a grid.
//!
//! Collisions are tried at the rate of an upper bound of the extinction, cell by cell; each is real or null. All lanes share one
//! sequence of collisions, and which kind a collision is goes by the mean over lanes, weighted by the throughput (Kutz et al.,
//! Spectral and Decomposition Tracking for Rendering Heterogeneous Volumes, SIGGRAPH 2017, with history-aware probabilities): the
//! sum of the lanes of the throughput then never grows. What is absorbed is taken off the weight and ends no path. Light rays
//! multiply the probabilities of null collisions instead: ratio tracking (Novák et al., Residual Ratio Tracking, SIGGRAPH Asia 2014).

use super::majorant::{BoundedPart, MajorantGrid};
use super::{Grid, MediumProperties, Scattering, Segment, Travel};
use snell_math::{ColorMode, DAffine3, SampledSpectrum, Vec2, Vec3};

/// Optical thickness of one cell of the grid beyond which more makes no difference, but collisions would be tried forever.
const MAX_DEPTH_OF_CELL: f64 = 64.0;
/// Below this share of what it was at the start, a weight goes on only by chance.
const ROULETTE_BELOW: f32 = 0.05;
/// With this probability.
const SURVIVAL: f32 = 0.25;

/// A grid medium with its upper bounds.
#[derive(Clone, Debug)]
pub struct TrackedGrid {
    grid: Grid,
    /// `None` if the map cannot be undone: then the medium is nowhere.
    grid_from_world: Option<DAffine3>,
    densities: MajorantGrid,
    /// Bounds of the emission, if it does not follow the density.
    emissions: Option<MajorantGrid>,
    /// No density counts as more than this.
    most: f32,
}

impl TrackedGrid {
    /// Makes the bounds.
    pub fn new(grid: &Grid) -> Self {
        let inverse = grid.world_from_grid.inverse();
        let is_invertible = grid.world_from_grid.matrix3.determinant() != 0.0 && inverse.is_finite();
        let mut size = MajorantGrid::size_for(&grid.density);
        let scale = grid.emission_scale.as_ref().filter(|_| !grid.emission.is_black());
        if let Some(scale) = scale {
            let other = MajorantGrid::size_for(scale);
            size = std::array::from_fn(|axis| size[axis].max(other[axis]));
        }
        // Both on the same cells, so that one walk reads both.
        let densities = MajorantGrid::new(&grid.density, size);
        let emissions = scale.map(|scale| MajorantGrid::new(scale, size));
        Self {
            grid: grid.clone(),
            grid_from_world: is_invertible.then_some(inverse),
            densities,
            emissions,
            most: most_density(grid),
        }
    }

    /// Coefficients where density and emission scale are 1.
    fn base(&self, mode: ColorMode) -> MediumProperties {
        let Grid { sigma_a, sigma_s, emission, g, .. } = self.grid;
        MediumProperties::from_colors(sigma_a, sigma_s, emission, g, mode)
    }

    /// Visits the parts of a segment that are in the grid, with the segment in its coordinates.
    fn walk(&self, segment: &Segment, mut visit: impl FnMut(BoundedPart, Vec3, Vec3) -> bool) {
        let Some(map) = &self.grid_from_world else { return };
        let origin = map.transform_point3(segment.origin.as_dvec3()).as_vec3();
        let direction = map.transform_vector3(segment.direction.as_dvec3()).as_vec3();
        self.densities.walk(origin, direction, segment.length, |part| visit(part, origin, direction));
    }

    /// From the world to the unit cube of the grid.
    pub(super) fn grid_from_world(&self) -> Option<&DAffine3> {
        self.grid_from_world.as_ref()
    }

    /// Cells of the bounds along each axis.
    pub(super) fn cells(&self) -> [usize; 3] {
        MajorantGrid::size_for(self.grid.emission_scale.as_ref().unwrap_or(&self.grid.density))
    }

    /// False if nothing is emitted anywhere.
    pub(super) fn emits(&self) -> bool {
        !self.grid.emission.is_black()
    }

    /// Radiance emitted per unit of length at a point of the unit cube.
    pub(super) fn emission(&self, p: Vec3, mode: ColorMode) -> SampledSpectrum {
        self.grid.emitted(p, self.density(p), mode)
    }

    fn density(&self, p: Vec3) -> f32 {
        self.grid.density.lookup(p).min(self.most)
    }

    /// Sends a path along a segment. `numbers` gives pairs of independent uniform numbers, `weight` a factor on the light that is
    /// emitted at a distance from the segment's origin.
    pub fn travel(
        &self,
        segment: &Segment,
        throughput: SampledSpectrum,
        mode: ColorMode,
        weight: impl Fn(f32) -> f32,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> Travel {
        let medium = self.base(mode);
        let (sigma_t, emits) = (medium.sigma_t(), !medium.emission.is_black());
        let thickest = largest_where(sigma_t, throughput);
        let start = throughput.max_element();
        let mut travel = Travel::unchanged(throughput);
        self.walk(segment, |part, origin, direction| {
            let bound = self.densities.bound(part.cell).min(self.most);
            let mut rate = bound * thickest;
            let glows = emits && self.emissions.as_ref().map_or(bound, |e| e.bound(part.cell)) > 0.0;
            if glows {
                // Often enough to see what glows where nothing else is.
                rate = rate.max(1.0 / (part.end - part.start));
            }
            if rate == 0.0 {
                return true;
            }
            let mut t = part.start;
            loop {
                let u = numbers();
                t += -(-u.x).ln_1p() / rate;
                if t.is_nan() || t >= part.end {
                    return true;
                }
                let p = origin + direction * t;
                let density = self.density(p);
                if glows {
                    let emitted = self.grid.emitted(p, density, mode);
                    if !emitted.is_black() {
                        travel.emitted += travel.throughput * emitted * (weight(t) / rate);
                    }
                }
                let scattered = medium.sigma_s * density;
                let null = (sigma_t * density).map(|sigma| (rate - sigma).max(0.0));
                let weigh = |by_lane: SampledSpectrum| (travel.throughput * by_lane).0.iter().sum::<f32>();
                let (of_scattering, of_null) = (weigh(scattered), weigh(null));
                let both = of_scattering + of_null;
                if both.is_nan() || both <= 0.0 {
                    travel.throughput = SampledSpectrum::ZERO;
                    return false;
                }
                if u.y * both < of_scattering {
                    travel.throughput *= scattered * (both / (rate * of_scattering));
                    travel.scattered = Some(Scattering { distance: t, phase: medium.phase });
                    return false;
                }
                travel.throughput *= null * (both / (rate * of_null));
                if !survives(&mut travel.throughput, start, numbers) {
                    return false;
                }
            }
        });
        travel
    }

    /// What is left of a light ray's value at the end of a segment, on average.
    pub fn attenuate(
        &self,
        segment: &Segment,
        value: SampledSpectrum,
        mode: ColorMode,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> SampledSpectrum {
        let sigma_t = self.base(mode).sigma_t();
        let thickest = largest_where(sigma_t, value);
        let start = value.max_element();
        let mut left = value;
        self.walk(segment, |part, origin, direction| {
            let rate = self.densities.bound(part.cell).min(self.most) * thickest;
            if rate == 0.0 {
                return true;
            }
            let mut t = part.start;
            loop {
                t += -(-numbers().x).ln_1p() / rate;
                if t.is_nan() || t >= part.end {
                    return true;
                }
                let share = self.density(origin + direction * t) / rate;
                left *= sigma_t.map(|sigma| (1.0 - sigma * share).max(0.0));
                if !survives(&mut left, start, numbers) {
                    return false;
                }
            }
        });
        left
    }
}

/// The largest lane of `sigma` among those that carry anything.
fn largest_where(sigma: SampledSpectrum, carried: SampledSpectrum) -> f32 {
    sigma.zip(carried, |s, c| if c > 0.0 { s } else { 0.0 }).max_element()
}

/// Russian roulette for weights that have become small.
fn survives(weight: &mut SampledSpectrum, start: f32, numbers: &mut dyn FnMut() -> Vec2) -> bool {
    let largest = weight.max_element();
    if largest >= ROULETTE_BELOW * start {
        return true;
    }
    if largest.is_nan() || largest <= 0.0 || numbers().x >= SURVIVAL {
        *weight = SampledSpectrum::ZERO;
        return false;
    }
    *weight *= 1.0 / SURVIVAL;
    true
}

/// The density at which a cell is as good as opaque.
fn most_density(grid: &Grid) -> f32 {
    let axes = grid.world_from_grid.matrix3;
    let [nx, ny, nz] = grid.density.size().map(|n| n as f64);
    let sides = [axes.x_axis.length() / nx, axes.y_axis.length() / ny, axes.z_axis.length() / nz];
    let side = sides.into_iter().fold(f64::INFINITY, f64::min);
    let sigma =
        [grid.sigma_a, grid.sigma_s].map(|c| f64::from(super::sane(c.r.max(c.g).max(c.b)))).into_iter().sum::<f64>();
    let most = MAX_DEPTH_OF_CELL / (sigma * side);
    if most.is_nan() { f32::MAX } else { most.min(f64::from(f32::MAX)) as f32 }
}

#[cfg(test)]
mod tests;
