//! Travel by random collisions, for media whose density is given on a grid.
//!
//! Tentative collisions occur at the rate of an upper bound of the extinction, cell by cell; each
//! is real or null. All lanes share one sequence of collisions, and the kind of a collision is
//! chosen by the mean over lanes, weighted by the throughput (Kutz et al., Spectral and
//! Decomposition Tracking for Rendering Heterogeneous Volumes, SIGGRAPH 2017, with history-aware
//! probabilities). The sum of the throughput's lanes then never grows. Absorption reduces the
//! weight and ends no path. Light rays are multiplied by the probabilities of null collisions
//! instead, which is ratio tracking (Novák et al., Residual Ratio Tracking, SIGGRAPH Asia 2014).

use super::majorant::{BoundedPart, MajorantGrid};
use super::{ColorGrid, Grid, MediumProperties, Scattering, Segment, Travel, coefficient, sane};
use snell_math::exponentials::ln;
use snell_math::{ColorMode, DAffine3, Rgb, SampledSpectrum, Vec2, Vec3};
use std::sync::Arc;

/// Maximum optical thickness of one cell of the grid. More would make no visible difference, but
/// would need many more collisions.
const MAX_DEPTH_OF_CELL: f64 = 64.0;
/// The fraction of its start value below which a weight is subject to Russian roulette.
const ROULETTE_BELOW: f32 = 0.05;
/// The survival probability of Russian roulette.
const SURVIVAL: f32 = 0.25;

/// A grid medium with upper bounds of its density.
#[derive(Clone, Debug)]
pub struct TrackedGrid {
    grid: Grid,
    /// The map to the grid; `None` if it is singular, so that the medium is nowhere.
    grid_from_world: Option<DAffine3>,
    densities: MajorantGrid,
    /// Bounds of the extinction over all colours, if coefficients have tints.
    extinctions: Option<MajorantGrid>,
    /// Bounds of the factor on the emission, if the emission is not proportional to the density.
    emissions: Option<MajorantGrid>,
    /// Maximum density, to which higher ones are clamped.
    most: f32,
}

impl TrackedGrid {
    /// Computes the bounds of a grid medium.
    pub fn new(grid: &Grid) -> Self {
        let inverse = grid.world_from_grid.inverse();
        let is_invertible =
            grid.world_from_grid.matrix3.determinant() != 0.0 && inverse.is_finite();
        let glows = !grid.emission.is_black();
        let scale = grid.emission_scale.as_deref().filter(|_| glows);
        let tint = grid.emission_tint.as_deref().filter(|_| glows);
        // All bounds have the same cells, so that one traversal serves all.
        let size = MajorantGrid::size_for(grid.size());
        let densities = MajorantGrid::new(&grid.density, size);
        let most = most_density(grid);
        let emissions = (scale.is_some() || tint.is_some()).then(|| {
            let scales = scale.map(|scale| MajorantGrid::new(scale, size));
            let tints = tint.map(|tint| bounds_by_channel(tint, size));
            MajorantGrid::made(size, |cell| {
                let tint = tints
                    .as_ref()
                    .map_or(1.0, |t| t.iter().map(|c| c.bound(cell)).fold(0.0, f32::max));
                scales.as_ref().unwrap_or(&densities).bound(cell) * tint
            })
        });
        Self {
            grid: grid.clone(),
            grid_from_world: is_invertible.then_some(inverse),
            extinctions: grid.is_tinted().then(|| extinctions(grid, &densities, most, size)),
            densities,
            emissions,
            most,
        }
    }

    /// The coefficients where density and emission scale are 1.
    fn base(&self, mode: ColorMode) -> MediumProperties {
        let Grid { sigma_a, sigma_s, emission, g, .. } = self.grid;
        MediumProperties::from_colors(sigma_a, sigma_s, emission, g, mode)
    }

    /// Visits the parts of a segment that are in the grid. The segment is passed in the grid's
    /// coordinates.
    fn walk(&self, segment: &Segment, mut visit: impl FnMut(BoundedPart, Vec3, Vec3) -> bool) {
        let Some(map) = &self.grid_from_world else { return };
        let origin = map.transform_point3(segment.origin.as_dvec3()).as_vec3();
        let direction = map.transform_vector3(segment.direction.as_dvec3()).as_vec3();
        self.densities
            .walk(origin, direction, segment.length, |part| visit(part, origin, direction));
    }

    /// The map from the world to the unit cube of the grid.
    pub(super) fn grid_from_world(&self) -> Option<&DAffine3> {
        self.grid_from_world.as_ref()
    }

    /// The number of cells of the bounds along each axis.
    pub(super) fn cells(&self) -> [usize; 3] {
        self.densities.size()
    }

    /// False if the grid emits nothing.
    pub(super) fn emits(&self) -> bool {
        !self.grid.emission.is_black()
    }

    /// Radiance emitted per scene unit of length at a point of the unit cube.
    pub(super) fn emission(&self, p: Vec3, mode: ColorMode) -> SampledSpectrum {
        self.grid.emitted(p, self.density(p), mode)
    }

    fn density(&self, p: Vec3) -> f32 {
        self.grid.density.lookup(p).min(self.most)
    }

    /// An upper bound of the extinction in a cell, over the lanes with any throughput. `thickest`
    /// is the largest extinction of these lanes for density 1.
    fn extinction_bound(&self, cell: usize, thickest: f32, mode: ColorMode) -> f32 {
        match &self.extinctions {
            None => self.densities.bound(cell).min(self.most) * thickest,
            // Between red, green and blue a spectrum may exceed all three, but at most by the
            // factor 2 for which `coefficient` leaves room.
            Some(bounds) => bounds.bound(cell) * if mode == ColorMode::Rgb { 1.0 } else { 2.0 },
        }
    }

    /// Extinction and scattering at a point of the unit cube with this density. `base` is the
    /// result of [`Self::base`].
    fn coefficients(
        &self,
        p: Vec3,
        density: f32,
        base: &MediumProperties,
        mode: ColorMode,
    ) -> [SampledSpectrum; 2] {
        let (sigma_t, sigma_s) = if self.extinctions.is_some() {
            let [sigma_a, sigma_s] = self.grid.tinted(p).map(|sigma| coefficient(sigma, mode));
            (sigma_a + sigma_s, sigma_s)
        } else {
            (base.sigma_t(), base.sigma_s)
        };
        [sigma_t * density, sigma_s * density]
    }

    /// Moves a path along a segment. `numbers` returns pairs of independent uniform numbers, and
    /// `weight` returns a factor on the light that is emitted at a distance from the segment's
    /// origin.
    pub fn travel(
        &self,
        segment: &Segment,
        throughput: SampledSpectrum,
        mode: ColorMode,
        weight: impl Fn(f32) -> f32,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> Travel {
        let medium = self.base(mode);
        let emits = !medium.emission.is_black();
        let thickest = largest_where(medium.sigma_t(), throughput);
        let start = throughput.max_element();
        let mut travel = Travel::unchanged(throughput);
        let mut depth = None;
        self.walk(segment, |part, origin, direction| {
            let mut rate = self.extinction_bound(part.cell, thickest, mode);
            let glows =
                emits && self.emissions.as_ref().unwrap_or(&self.densities).bound(part.cell) > 0.0;
            if glows {
                // The rate is high enough to find emission where there is nothing else.
                rate = rate.max(1.0 / (part.end - part.start));
            }
            if rate == 0.0 {
                return true;
            }
            let mut t = part.start;
            loop {
                let (rest, choice) = match depth.take() {
                    Some(depth) => depth,
                    None => drawn(numbers()),
                };
                let ahead = f64::from(rate) * f64::from(part.end - t);
                if rest.is_nan() || rest >= ahead {
                    depth = Some((rest - ahead, choice));
                    return true;
                }
                t = (t + (rest / f64::from(rate)) as f32).min(part.end);
                let p = origin + direction * t;
                let density = self.density(p);
                if glows {
                    let emitted = self.grid.emitted(p, density, mode);
                    if !emitted.is_black() {
                        travel.emitted += travel.throughput * emitted * (weight(t) / rate);
                    }
                }
                let [extinction, scattered] = self.coefficients(p, density, &medium, mode);
                let null = extinction.map(|sigma| (rate - sigma).max(0.0));
                let weigh =
                    |by_lane: SampledSpectrum| (travel.throughput * by_lane).0.iter().sum::<f32>();
                let (of_scattering, of_null) = (weigh(scattered), weigh(null));
                let both = of_scattering + of_null;
                if both.is_nan() || both <= 0.0 {
                    travel.throughput = SampledSpectrum::ZERO;
                    return false;
                }
                if choice * both < of_scattering {
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

    /// The value of a light ray at the end of a segment, on average over `numbers`.
    pub fn attenuate(
        &self,
        segment: &Segment,
        value: SampledSpectrum,
        mode: ColorMode,
        numbers: &mut dyn FnMut() -> Vec2,
    ) -> SampledSpectrum {
        let medium = self.base(mode);
        let thickest = largest_where(medium.sigma_t(), value);
        let start = value.max_element();
        let mut left = value;
        let mut depth = None;
        self.walk(segment, |part, origin, direction| {
            let rate = self.extinction_bound(part.cell, thickest, mode);
            if rate == 0.0 {
                return true;
            }
            let mut t = part.start;
            loop {
                let rest = match depth.take() {
                    Some(depth) => depth,
                    None => drawn(numbers()).0,
                };
                let ahead = f64::from(rate) * f64::from(part.end - t);
                if rest.is_nan() || rest >= ahead {
                    depth = Some(rest - ahead);
                    return true;
                }
                t = (t + (rest / f64::from(rate)) as f32).min(part.end);
                let p = origin + direction * t;
                let [extinction, _] = self.coefficients(p, self.density(p), &medium, mode);
                left *= extinction.map(|sigma| (1.0 - sigma / rate).max(0.0));
                if !survives(&mut left, start, numbers) {
                    return false;
                }
            }
        });
        left
    }
}

/// The optical depth up to the next collision, by the upper bounds, and a number that chooses the
/// kind of the collision. Depth that one part of the segment does not use up carries over to the
/// next part, so one random pair per collision suffices.
fn drawn(u: Vec2) -> (f64, f32) {
    (-ln(1.0 - f64::from(u.x)), u.y)
}

/// The largest lane of `sigma` among those with any throughput.
fn largest_where(sigma: SampledSpectrum, carried: SampledSpectrum) -> f32 {
    sigma.zip(carried, |s, c| if c > 0.0 { s } else { 0.0 }).max_element()
}

/// Applies Russian roulette to a weight that has become small. Returns false if the path ends.
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

/// Upper bounds of a colour grid, for red, green and blue.
fn bounds_by_channel(grid: &ColorGrid, size: [usize; 3]) -> [MajorantGrid; 3] {
    [|c: &Rgb| c.r, |c: &Rgb| c.g, |c: &Rgb| c.b].map(|channel: fn(&Rgb) -> f32| {
        MajorantGrid::of(grid, grid.values().iter().map(channel), size)
    })
}

/// Upper bounds of the extinction over all colours, for coefficients with tints.
fn extinctions(grid: &Grid, densities: &MajorantGrid, most: f32, size: [usize; 3]) -> MajorantGrid {
    let tints = [&grid.sigma_a_tint, &grid.sigma_s_tint];
    let tints = tints.map(|tint| tint.as_ref().map(|tint| bounds_by_channel(tint, size)));
    let sigmas = [grid.sigma_a, grid.sigma_s].map(|sigma| sigma.map(sane).to_array());
    MajorantGrid::made(size, |cell| {
        let tint = |which: usize, c: usize| {
            tints[which].as_ref().map_or(1.0, |channels| channels[c].bound(cell))
        };
        // Coefficients are limited in the same way as by `coefficient`.
        let sigma = |which: usize, c: usize| sane(sigmas[which][c] * tint(which, c));
        let thickest = (0..3).map(|c| sigma(0, c) + sigma(1, c)).fold(0.0, f32::max);
        densities.bound(cell).min(most) * thickest
    })
}

/// The density at which a cell of the grid is effectively opaque.
fn most_density(grid: &Grid) -> f32 {
    let axes = grid.world_from_grid.matrix3;
    let [nx, ny, nz] = grid.size().map(|n| n as f64);
    let sides = [axes.x_axis.length() / nx, axes.y_axis.length() / ny, axes.z_axis.length() / nz];
    let side = sides.into_iter().fold(f64::INFINITY, f64::min);
    let largest = |sigma: Rgb, tint: &Option<Arc<ColorGrid>>| {
        let tint = tint.as_ref().map_or(1.0, |tint| tint.max());
        f64::from(sane(sane(sigma.r.max(sigma.g).max(sigma.b)) * tint))
    };
    let sigma =
        largest(grid.sigma_a, &grid.sigma_a_tint) + largest(grid.sigma_s, &grid.sigma_s_tint);
    let most = MAX_DEPTH_OF_CELL / (sigma * side);
    if most.is_nan() { f32::MAX } else { most.min(f64::from(f32::MAX)) as f32 }
}

#[cfg(test)]
mod tests;
