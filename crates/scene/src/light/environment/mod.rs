//! Light from all directions, importance sampled.
//!
//! An image is looked up with bilinear interpolation. A direction is sampled in two steps: a cell
//! of a latitude-longitude table, with probability proportional to the interpolated luminance in
//! the cell times its solid angle, then a direction uniform in the solid angle of the cell (a
//! rectangle in longitude and height). The density is therefore constant over each cell and finite
//! at the poles.
//!
//! With multiple importance sampling, a second table from which the mean is subtracted is better,
//! because BSDF samples already find the uniform part of the light (Karlík, Šik, Vévoda, Skřivan
//! and Křivánek, MIS Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling,
//! 2019). A constant environment then needs no light samples.

mod portal;
mod table;
#[cfg(test)]
mod tests;

use crate::graph::{Environment, Scene};
use crate::image::Image;
use portal::PortalSampler;
use snell_math::{
    ColorMode, DMat3, DVec3, Mat3, Rgb, SampledSpectrum, Vec2, Vec3, angles, sampling,
};
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;
use table::{Cells, DirectionTable, Rows};

pub use portal::Portal;
pub use table::DrawnDirection;

/// An environment prepared for look-ups and sampling.
#[derive(Debug)]
pub struct EnvironmentLight {
    kind: Kind,
    mean_luminance: f64,
    /// The portals through which alone the environment is seen; empty if it is seen everywhere.
    portals: Vec<PortalSampler>,
}

/// A sampled direction from which light comes.
#[derive(Clone, Copy, Debug)]
pub struct SkySample {
    /// Unit vector towards the light.
    pub direction: Vec3,
    /// Density per steradian.
    pub pdf: f32,
    /// The position of the direction in the image; see [`EnvironmentLight::place`].
    pub place: Vec2,
}

#[derive(Debug)]
enum Kind {
    Constant(Rgb),
    Image(Box<ImageLight>),
}

#[derive(Debug)]
struct ImageLight {
    width: usize,
    height: usize,
    /// Scaled radiance, row by row from the zenith.
    texels: Vec<Rgb>,
    world_from_environment: Mat3,
    /// The table in proportion to the light from each direction.
    exact: DirectionTable,
    /// The table in proportion to the excess of the light over the mean; `None` if the light is
    /// almost constant.
    compensated: Option<DirectionTable>,
    /// The fraction of the light that exceeds the mean.
    excess: f64,
}

impl EnvironmentLight {
    /// Prepares an environment, which includes building the sampling tables of an image. Values
    /// that are negative or not finite count as 0, and the alpha of an image is ignored. Only the
    /// rotation (and mirroring) of the transform is used.
    pub fn new(environment: &Environment) -> Self {
        match environment {
            Environment::Constant(color) => {
                let color = color.map(sane);
                let mean_luminance = color.luminance().into();
                Self { kind: Kind::Constant(color), mean_luminance, portals: Vec::new() }
            }
            Environment::Image { image, scale, world_from_environment } => {
                let light = ImageLight::new(image, scale.map(sane), world_from_environment.matrix3);
                let (light, mean_luminance) = (Kind::Image(Box::new(light.0)), light.1);
                Self { kind: light, mean_luminance, portals: Vec::new() }
            }
        }
    }

    /// Prepares the environment of a scene with its portals; `None` if there is none.
    pub fn of_scene(scene: &Scene) -> Option<Self> {
        let portals: Vec<_> = scene.portals.iter().filter_map(PortalSampler::new).collect();
        // Nothing is seen through portals without area.
        if portals.is_empty() && !scene.portals.is_empty() {
            return None;
        }
        Some(Self { portals, ..Self::new(scene.environment.as_ref()?) })
    }

    /// True if the environment is seen through portals alone. [`Self::sample_from`] then takes the
    /// place of the samples that do not depend on the point.
    pub fn has_portals(&self) -> bool {
        !self.portals.is_empty()
    }

    /// True if the environment is seen from this point in this unit direction.
    pub fn is_seen(&self, from: Vec3, direction: Vec3) -> bool {
        self.portals.is_empty()
            || self.portals.iter().any(|portal| portal.pdf(from, direction) > 0.0)
    }

    /// Samples a direction from which light may arrive at a point through the portals: one of
    /// [`Self::sample`], or one through a uniform point of a portal.
    pub fn sample_from(&self, from: Vec3, u: Vec2) -> Option<SkySample> {
        let share = self.share_of_image();
        let direction = if u.x < share {
            self.sample(Vec2::new(u.x / share, u.y)).direction
        } else {
            let scaled = (u.x - share) / (1.0 - share) * self.portals.len() as f32;
            let number = (scaled as usize).min(self.portals.len().checked_sub(1)?);
            let rest = (scaled - number as f32).clamp(0.0, 1.0);
            self.portals[number].sample(from, Vec2::new(rest, u.y))?
        };
        let pdf = self.pdf_from(from, direction);
        Some(SkySample { direction, pdf, place: self.place(direction) })
    }

    /// Density per steradian with which [`Self::sample_from`] samples this unit direction.
    pub fn pdf_from(&self, from: Vec3, direction: Vec3) -> f32 {
        let share = self.share_of_image();
        let through: f32 = self.portals.iter().map(|portal| portal.pdf(from, direction)).sum();
        let through = through / self.portals.len() as f32 * (1.0 - share);
        if share > 0.0 { self.pdf(direction) * share + through } else { through }
    }

    /// The share of the samples of [`Self::sample_from`] that follow the image.
    fn share_of_image(&self) -> f32 {
        if self.constant().is_some() { 0.0 } else { 0.5 }
    }

    /// The radiance that arrives along a ray that leaves the scene in this unit direction.
    pub fn radiance(&self, direction: Vec3, mode: ColorMode) -> SampledSpectrum {
        self.radiance_at(self.place(direction), mode)
    }

    /// [`Self::radiance`] for the direction at this position in the image.
    #[inline]
    pub fn radiance_at(&self, place: Vec2, mode: ColorMode) -> SampledSpectrum {
        mode.rgb_illuminant(match &self.kind {
            Kind::Constant(color) => *color,
            Kind::Image(light) => light.texel(place),
        })
    }

    /// The position of a unit direction in the image: longitude and latitude, as a point of the
    /// unit square.
    pub fn place(&self, direction: Vec3) -> Vec2 {
        match &self.kind {
            Kind::Constant(_) => Vec2::ZERO,
            Kind::Image(light) => place_of(&light.world_from_environment, direction),
        }
    }

    /// The rotation from the image's coordinates to the world.
    pub fn world_from_environment(&self) -> Mat3 {
        match &self.kind {
            Kind::Constant(_) => Mat3::IDENTITY,
            Kind::Image(light) => light.world_from_environment,
        }
    }

    /// The radiance of a constant environment; `None` for an image.
    pub fn constant(&self) -> Option<Rgb> {
        match &self.kind {
            Kind::Constant(color) => Some(*color),
            Kind::Image(_) => None,
        }
    }

    /// Samples a direction from which light comes. The density is positive wherever there is light.
    pub fn sample(&self, u: Vec2) -> SkySample {
        let drawn = match &self.kind {
            Kind::Constant(_) => None,
            Kind::Image(light) => Some(light.exact.sample(u)).filter(|drawn| drawn.pdf > 0.0),
        };
        match drawn {
            Some(drawn) => SkySample::new(drawn, &self.world_from_environment()),
            None => {
                let direction = sampling::uniform_sphere(u);
                SkySample {
                    direction,
                    pdf: sampling::UNIFORM_SPHERE_PDF,
                    place: self.place(direction),
                }
            }
        }
    }

    /// Density per steradian with which [`Self::sample`] samples this unit direction.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        match &self.kind {
            Kind::Constant(_) => sampling::UNIFORM_SPHERE_PDF,
            Kind::Image(light) => light.exact.pdf(self.place(direction)),
        }
    }

    /// Samples a direction in proportion to the excess of the light over the mean, to be combined
    /// with BSDF samples by multiple importance sampling. The density is 0 in many directions.
    /// `None` if there is no excess.
    pub fn sample_compensated(&self, u: Vec2) -> Option<SkySample> {
        Some(SkySample::new(self.draw_compensated(u)?, &self.world_from_environment()))
    }

    /// The sample of [`Self::sample_compensated`], before [`SkySample::new`] computes its
    /// direction.
    #[inline]
    pub fn draw_compensated(&self, u: Vec2) -> Option<DrawnDirection> {
        match &self.kind {
            Kind::Constant(_) => None,
            Kind::Image(light) => {
                Some(light.compensated.as_ref()?.sample(u)).filter(|drawn| drawn.pdf > 0.0)
            }
        }
    }

    /// Density per steradian with which [`Self::sample_compensated`] samples this unit direction.
    pub fn pdf_compensated(&self, direction: Vec3) -> f32 {
        self.pdf_compensated_at(self.place(direction))
    }

    /// [`Self::pdf_compensated`] for the direction at this position in the image.
    #[inline]
    pub fn pdf_compensated_at(&self, place: Vec2) -> f32 {
        match &self.kind {
            Kind::Constant(_) => 0.0,
            Kind::Image(light) => light.compensated.as_ref().map_or(0.0, |table| table.pdf(place)),
        }
    }

    /// The fraction of the light that exceeds the mean, in `[0, 1]`, which
    /// [`Self::sample_compensated`] samples; 0 if that returns `None`. All of it counts if there
    /// are portals.
    pub fn excess(&self) -> f64 {
        match &self.kind {
            _ if self.has_portals() => 1.0,
            Kind::Image(light) if light.compensated.is_some() => light.excess,
            _ => 0.0,
        }
    }

    /// Mean radiance over the sphere (luminance); finite and not negative.
    pub fn mean_luminance(&self) -> f64 {
        self.mean_luminance
    }
}

/// Largest radiance that is kept, so that sums over a whole image stay finite.
const MAX_RADIANCE: f32 = 1e30;

fn sane(x: f32) -> f32 {
    if x > 0.0 && x.is_finite() { x.min(MAX_RADIANCE) } else { 0.0 }
}

impl ImageLight {
    /// The prepared image and its mean luminance.
    fn new(image: &Arc<Image>, scale: Rgb, matrix: DMat3) -> (Self, f64) {
        let texels = texels(image, scale);
        let (w, h) = (image.width as usize, image.height as usize);
        let cells = Cells::of(Smoothed::of(&texels, w), [w, h]);
        let (exact, mean_luminance) = DirectionTable::new(&cells, 0.0);
        let compensated = DirectionTable::new(&cells, mean_luminance);
        // A fraction this small is due to rounding.
        let excess = compensated.1 / mean_luminance.max(f64::MIN_POSITIVE);
        let compensated = (excess > 1e-4).then_some(compensated.0);
        let world_from_environment = rotation(matrix);
        (
            Self {
                width: w,
                height: h,
                texels,
                world_from_environment,
                exact,
                compensated,
                excess,
            },
            mean_luminance,
        )
    }

    /// The bilinear interpolation of the texels at a point of the unit square.
    fn texel(&self, p: Vec2) -> Rgb {
        let (w, h) = (self.width as i32, self.height as i32);
        // The position is shifted by one texel, so that it is not negative.
        let x = p.x * self.width as f32 + 0.5;
        let y = p.y * self.height as f32 + 0.5;
        let (left, top) = (x as i32, y as i32);
        let (fx, fy) = (x - left as f32, y - top as f32);
        // Positions wrap around in longitude and are clamped at the poles.
        let around = |x: i32| {
            (if x < 0 {
                x + w
            } else if x >= w {
                x - w
            } else {
                x
            }) as usize
        };
        let columns = [around(left - 1), around(left)];
        let row = |y: i32| y.clamp(0, h - 1) as usize * self.width;
        let blend = |row: usize| {
            self.texels[row + columns[0]] * (1.0 - fx) + self.texels[row + columns[1]] * fx
        };
        blend(row(top - 1)) * (1.0 - fy) + blend(row(top)) * fy
    }
}

impl SkySample {
    /// The sample for a direction drawn from an environment with this rotation. It has no branches,
    /// so that loops over it become vector code.
    #[inline(always)]
    pub fn new(drawn: DrawnDirection, world_from_environment: &Mat3) -> Self {
        let (direction, place) = drawn.to_vector();
        Self { direction: *world_from_environment * direction, pdf: drawn.pdf, place }
    }
}

/// [`EnvironmentLight::place`] for an environment with this rotation. It has no branches, so that
/// loops over it become vector code.
#[inline(always)]
pub fn place_of(world_from_environment: &Mat3, direction: Vec3) -> Vec2 {
    let Mat3 { x_axis, y_axis, z_axis } = *world_from_environment;
    let (x, y, z) = (x_axis.dot(direction), y_axis.dot(direction), z_axis.dot(direction));
    let phi = angles::atan2(x, -z);
    let theta = angles::atan2((x * x + z * z).sqrt(), y);
    let number = |p: f32| if p.is_nan() { 0.5 } else { p };
    Vec2::new(number(0.5 + phi * (0.5 * FRAC_1_PI)), number(theta * FRAC_1_PI))
}

/// The rotation (or rotation with mirroring) that keeps the direction of the map's y axis and the
/// half-plane of its y and z axes; the identity if these axes do not determine one.
fn rotation(m: DMat3) -> Mat3 {
    let unit = |v: DVec3| v.try_normalize().filter(|v| v.is_finite());
    let orthonormal = || {
        let y = unit(m.y_axis)?;
        let z = unit(m.z_axis - y * y.dot(m.z_axis))?;
        let x = y.cross(z);
        Some(DMat3::from_cols(if x.dot(m.x_axis) < 0.0 { -x } else { x }, y, z))
    };
    orthonormal().unwrap_or(DMat3::IDENTITY).as_mat3()
}

/// The scaled radiance of every texel.
fn texels(image: &Image, scale: Rgb) -> Vec<Rgb> {
    let texel = |x, y| {
        let [r, g, b, _] = image.rgba(x, y);
        (Rgb::new(sane(r), sane(g), sane(b)) * scale).map(sane)
    };
    (0..image.height).flat_map(|y| (0..image.width).map(move |x| texel(x, y))).collect()
}

/// The mean luminance of the bilinear interpolation over the square of each texel, which is the
/// image filtered by `[1 6 1] / 8` both ways. It is positive wherever any interpolated radiance is.
/// It is computed row by row, because a copy of a large image takes much memory.
struct Smoothed<'a> {
    texels: &'a [Rgb],
    width: usize,
    /// Rows that were filtered horizontally, each with its number. They are the last three that
    /// were needed; row `y` is at `y % 3`.
    across: [(usize, Vec<f32>); 3],
}

impl<'a> Smoothed<'a> {
    fn of(texels: &'a [Rgb], width: usize) -> Self {
        Self { texels, width, across: std::array::from_fn(|_| (usize::MAX, Vec::new())) }
    }
}

fn filter(a: f32, b: f32, c: f32) -> f32 {
    (a + c) * 0.125 + b * 0.75
}

impl Rows for Smoothed<'_> {
    fn row(&mut self, y: usize) -> Vec<f32> {
        let (w, last) = (self.width, self.texels.len() / self.width - 1);
        let near = [y.saturating_sub(1), y, (y + 1).min(last)];
        for y in near {
            let (number, across) = &mut self.across[y % 3];
            if *number != y {
                *number = y;
                let plain: Vec<f32> =
                    self.texels[y * w..][..w].iter().map(|t| sane(t.luminance())).collect();
                across.clear();
                across.extend(
                    (0..w).map(|x| filter(plain[(x + w - 1) % w], plain[x], plain[(x + 1) % w])),
                );
            }
        }
        let [above, here, below] = near.map(|y| &self.across[y % 3].1);
        (0..w).map(|x| filter(above[x], here[x], below[x])).collect()
    }
}
