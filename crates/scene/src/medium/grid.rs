//! A medium whose density is given on a regular grid.

use super::{MediumProperties, blackbody, coefficient, sane};
use crate::ranges::LIGHT;
use crate::texture::Wrap;
use serde::{Deserialize, Serialize};
use snell_math::parameters::{Kind, Range, Value, Visitor};
use snell_math::{ColorMode, DAffine3, Rgb, SampledSpectrum, Vec3};
use std::ops::{Add, Mul, Sub};
use std::sync::Arc;

/// A type that the value of a cell can have.
pub trait CellValue:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self>
{
    /// The value outside of the grid.
    const NOTHING: Self;

    /// The value with invalid components (negative or not finite) replaced by 0.
    fn sane(self) -> Self;
}

impl CellValue for f32 {
    const NOTHING: Self = 0.0;

    fn sane(self) -> Self {
        sane(self)
    }
}

impl CellValue for Rgb {
    const NOTHING: Self = Self::BLACK;

    fn sane(self) -> Self {
        self.map(sane)
    }
}

/// Numbers or colours on a regular grid over the unit cube. Each value belongs to the centre of its
/// cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellGrid<T> {
    size: [usize; 3],
    values: Vec<T>,
    is_stepped: bool,
    wrap: Wrap,
}

/// Numbers on a regular grid.
pub type ScalarGrid = CellGrid<f32>;

/// Colours on a regular grid.
pub type ColorGrid = CellGrid<Rgb>;

impl<T: CellValue> CellGrid<T> {
    /// A grid of `size` cells along x, y and z. `values` are ordered by z, then by y, then by x, so
    /// that x changes fastest. `None` if their number is not the product of the sizes. Values that
    /// are negative or not finite count as 0.
    pub fn new(size: [usize; 3], mut values: Vec<T>) -> Option<Self> {
        let cells = size[0].checked_mul(size[1])?.checked_mul(size[2])?;
        if cells != values.len() {
            return None;
        }
        values.iter_mut().for_each(|x| *x = x.sane());
        Some(Self { size, values, is_stepped: false, wrap: Wrap::Clamp })
    }

    /// The grid with values that are the same within each cell, or interpolated between cells.
    pub fn stepped(self, is_stepped: bool) -> Self {
        Self { is_stepped, ..self }
    }

    /// The grid with values beyond its outermost cells, with which those in the outer halves of
    /// these cells are interpolated. By default, these cells continue.
    pub fn wrapped(self, wrap: Wrap) -> Self {
        Self { wrap, ..self }
    }

    /// What is beyond the outermost cells.
    pub fn wrap(&self) -> Wrap {
        self.wrap
    }

    /// True if values are the same within each cell.
    pub fn is_stepped(&self) -> bool {
        self.is_stepped
    }

    /// The number of cells along x, y and z.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// All values, in the order of [`Self::new`].
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The value at a point of the unit cube, interpolated between the eight nearest cells unless
    /// the grid is stepped; 0 outside of the cube.
    pub fn lookup(&self, p: Vec3) -> T {
        self.corners(p).map_or(T::NOTHING, |corners| corners.interpolate(&self.values))
    }

    /// True if the cells are the same ones, and have the same interpolation.
    fn is_like(&self, other: &Self) -> bool {
        (self.size, self.is_stepped, self.wrap) == (other.size, other.is_stepped, other.wrap)
    }

    #[inline(always)]
    fn corners(&self, p: Vec3) -> Option<Corners> {
        let mut corners = Corners::of(self.size, self.wrap, p)?;
        if self.is_stepped {
            corners.f = corners.f.map(|f| f32::from(f >= 0.5));
            corners.inside = 1.0;
        }
        Some(corners)
    }
}

impl<T> Value for CellGrid<T> {
    const KIND: Kind = Kind::Cells;

    /// The values were checked when the grid was made.
    fn visit(&self, _: &mut Visitor<'_>) {}
}

impl ColorGrid {
    /// The largest value of any channel.
    pub fn max(&self) -> f32 {
        self.values.iter().map(|c| c.r.max(c.g).max(c.b)).fold(0.0, f32::max)
    }
}

/// The eight cells around a point of the unit cube, and the position of the point between them.
struct Corners {
    /// Offsets, in the list of values, of the two cells along each axis.
    steps: [[usize; 2]; 3],
    f: [f32; 3],
    /// The share of the interpolated value that is not that of the nothing around the grid.
    inside: f32,
}

impl Corners {
    /// The cells around `p`; `None` outside of the cube, or if there are no cells.
    #[inline(always)]
    fn of(size: [usize; 3], wrap: Wrap, p: Vec3) -> Option<Self> {
        if size.contains(&0) || !(p.cmpge(Vec3::ZERO).all() && p.cmple(Vec3::ONE).all()) {
            return None;
        }
        let (mut steps, mut f) = ([[0; 2]; 3], [0.0; 3]);
        let (mut stride, mut inside) = (1, 1.0);
        for axis in 0..3 {
            let n = size[axis];
            let scaled = p[axis] * n as f32 - 0.5;
            // The number is above -1, so this rounds it down.
            let truncated = scaled as i64;
            let low = truncated - i64::from(scaled < truncated as f32);
            f[axis] = scaled - low as f32;
            let [near, far] = [low, low + 1].map(|i| match wrap {
                Wrap::Clamp => Some(i.clamp(0, n as i64 - 1) as usize),
                _ => wrap.index(i as i32, n as u32).map(|cell| cell as usize),
            });
            // At most one of the two is outside, where there is nothing.
            inside *= match (near, far) {
                (None, _) => f[axis],
                (_, None) => 1.0 - f[axis],
                _ => 1.0,
            };
            let [near, far] = [near.or(far), far.or(near)].map(Option::unwrap_or_default);
            steps[axis] = [near * stride, far * stride];
            stride *= n;
        }
        Some(Self { steps, f, inside })
    }

    #[inline(always)]
    fn interpolate<T: CellValue>(&self, values: &[T]) -> T {
        let [[x, next_x], [y, next_y], [z, next_z]] = self.steps;
        let row = |start: usize| lerp(values[start + x], values[start + next_x], self.f[0]);
        let near = lerp(row(z + y), row(z + next_y), self.f[1]);
        let far = lerp(row(next_z + y), row(next_z + next_y), self.f[1]);
        lerp(near, far, self.f[2]) * self.inside
    }
}

#[inline(always)]
fn lerp<T: CellValue>(a: T, b: T, t: f32) -> T {
    a + (b - a) * t
}

snell_math::declare! {
    /// A medium on a grid: coefficients multiplied by a density. Outside of the grid's box there is
    /// no medium.
    ///
    /// Where its colour varies, each coefficient may have a factor of its own for each colour and
    /// place: `sigma_a_tint`, `sigma_s_tint` and `emission_tint`, which are 1 if they are not
    /// given.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default)]
    pub struct Grid {
        /// Absorption coefficient per scene unit of length where the density is 1.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        pub sigma_a: Rgb,
        /// Scattering coefficient per scene unit of length where the density is 1.
        #[range(Range::AMOUNT)]
        #[unit("per scene unit")]
        pub sigma_s: Rgb,
        /// Mean cosine of the angle by which light is deflected, in `(-1, 1)`.
        #[range(Range::Between(-1.0, 1.0))]
        pub g: f32,
        /// Density at each place, a factor on both coefficients.
        #[serde(skip)]
        pub density: Arc<ScalarGrid>,
        /// Radiance emitted per scene unit of length, W / (m^2 sr), where `emission_scale` is 1.
        #[range(LIGHT)]
        #[unit("W / (m^2 sr) per scene unit")]
        pub emission: Rgb,
        /// Factor on the emission at each place; without it, the density.
        #[serde(skip)]
        pub emission_scale: Option<Arc<ScalarGrid>>,
        /// Temperature in kelvin. The emitted light is that of a black body of luminance 1,
        /// multiplied by `emission` and its scale. Without it, the colour of `emission` alone.
        #[serde(skip)]
        pub temperature: Option<Arc<ScalarGrid>>,
        /// Factor on `sigma_a` at each place, besides the density.
        #[serde(skip)]
        pub sigma_a_tint: Option<Arc<ColorGrid>>,
        /// Factor on `sigma_s` at each place, besides the density.
        #[serde(skip)]
        pub sigma_s_tint: Option<Arc<ColorGrid>>,
        /// Factor on `emission` at each place, besides its scale.
        #[serde(skip)]
        pub emission_tint: Option<Arc<ColorGrid>>,
        /// Map from the unit cube of the grids to the world.
        pub world_from_grid: DAffine3,
    }
}

impl Grid {
    /// A grid medium that does not emit.
    pub fn new(
        sigma_a: Rgb,
        sigma_s: Rgb,
        g: f32,
        density: ScalarGrid,
        world_from_grid: DAffine3,
    ) -> Self {
        Self {
            sigma_a,
            sigma_s,
            g,
            density: Arc::new(density),
            emission: Rgb::BLACK,
            emission_scale: None,
            temperature: None,
            sigma_a_tint: None,
            sigma_s_tint: None,
            emission_tint: None,
            world_from_grid,
        }
    }

    /// Examples for tests and galleries.
    pub fn examples() -> Vec<Self> {
        let ball = |n: usize| {
            let value = |i: usize| {
                let [x, y, z] =
                    [i % n, i / n % n, i / n / n].map(|c| (c as f32 + 0.5) / n as f32 - 0.5);
                (1.0 - 4.0 * (x * x + y * y + z * z)).max(0.0)
            };
            ScalarGrid::new([n; 3], (0..n * n * n).map(value).collect()).unwrap_or_default()
        };
        let (thin, thick) = (Rgb::splat(0.2), Rgb::new(4.0, 2.0, 1.0));
        let colors = |n: usize| {
            let value = |i: usize| {
                Rgb::from([1, n, n * n].map(|step| (i / step % n) as f32 / (n - 1) as f32))
            };
            ColorGrid::new([n; 3], (0..n * n * n).map(value).collect()).map(Arc::new)
        };
        vec![
            Self::new(thin, thick, 0.3, ball(12), DAffine3::IDENTITY),
            Self {
                emission: Rgb::splat(0.5),
                sigma_a_tint: colors(3),
                sigma_s_tint: colors(4),
                emission_tint: colors(2),
                ..Self::new(thin, thick, 0.0, ball(6), DAffine3::IDENTITY)
            },
            Self {
                emission: Rgb::new(3.0, 1.0, 0.2),
                ..Self::new(thick, thin, 0.0, ball(5), DAffine3::IDENTITY)
            },
            Self::new(thin, thin, 0.0, ScalarGrid::default(), DAffine3::IDENTITY),
        ]
    }

    /// The number of cells along x, y and z: along each axis, the largest of all grids.
    pub fn size(&self) -> [usize; 3] {
        let tints =
            [&self.sigma_a_tint, &self.sigma_s_tint, &self.emission_tint].into_iter().flatten();
        let others =
            [&self.emission_scale, &self.temperature].into_iter().flatten().map(|grid| grid.size());
        let others = others.chain(tints.map(|tint| tint.size()));
        others.fold(self.density.size(), |a, b| std::array::from_fn(|axis| a[axis].max(b[axis])))
    }

    /// The properties of the medium at a point of the world.
    pub fn properties(&self, p: Vec3, mode: ColorMode) -> MediumProperties {
        let grid_from_world = self.world_from_grid.inverse();
        let p = grid_from_world.transform_point3(p.as_dvec3()).as_vec3();
        let density = self.density.lookup(p);
        let [sigma_a, sigma_s] = self.tinted(p).map(|sigma| sigma * density);
        let emission = self.emitted(p, density, mode);
        MediumProperties {
            emission,
            ..MediumProperties::from_colors(sigma_a, sigma_s, Rgb::BLACK, self.g, mode)
        }
    }

    /// True if absorption or scattering varies in colour.
    pub(super) fn is_tinted(&self) -> bool {
        self.sigma_a_tint.is_some() || self.sigma_s_tint.is_some()
    }

    /// Absorption and scattering coefficients at a point of the unit cube, for a density of 1.
    pub(super) fn tinted(&self, p: Vec3) -> [Rgb; 2] {
        match (&self.sigma_a_tint, &self.sigma_s_tint) {
            // One look-up of the cells serves both tints.
            (Some(a), Some(s)) if a.is_like(s) => match a.corners(p) {
                Some(at) => [
                    self.sigma_a * at.interpolate(&a.values),
                    self.sigma_s * at.interpolate(&s.values),
                ],
                None => [Rgb::BLACK; 2],
            },
            (a, s) => {
                let of = |sigma: Rgb, tint: &Option<Arc<ColorGrid>>| match tint {
                    Some(tint) => sigma * tint.lookup(p),
                    None => sigma,
                };
                [of(self.sigma_a, a), of(self.sigma_s, s)]
            }
        }
    }

    /// Radiance emitted per scene unit of length, at a point of the unit cube with this density.
    pub(super) fn emitted(&self, p: Vec3, density: f32, mode: ColorMode) -> SampledSpectrum {
        let scale = self.emission_scale.as_ref().map_or(density, |scale| scale.lookup(p));
        let emission = self
            .emission_tint
            .as_ref()
            .map_or(self.emission, |tint| self.emission * tint.lookup(p));
        match &self.temperature {
            None => mode.illuminant(emission.map(sane)) * scale,
            Some(kelvin) => coefficient(emission, mode) * blackbody(kelvin.lookup(p), mode) * scale,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stepped_grids_are_even_within_each_cell() {
        let values: Vec<f32> = (0..8).map(|i| i as f32).collect();
        let grid = ScalarGrid::new([2, 1, 4], values).expect("eight cells").stepped(true);
        for i in 0..200 {
            let [x, z] = [i % 20, i / 20 % 10].map(|k| (k as f32 + 0.51) / 20.0);
            let cell = (x * 2.0).floor() + 2.0 * (z * 4.0).floor();
            assert_eq!(grid.lookup(Vec3::new(x, 0.3, z)), cell, "{x} {z}");
        }
        assert_eq!(grid.lookup(Vec3::new(1.1, 0.5, 0.5)), 0.0);
    }

    #[test]
    fn lookups_give_the_cells_at_their_middles_and_lines_between_them() {
        let grid =
            ScalarGrid::new([2, 1, 3], vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]).expect("six values");
        let at = |x, z| grid.lookup(Vec3::new(x, 0.5, z));
        assert_eq!([at(0.25, 1.0 / 6.0), at(0.75, 0.5), at(0.5, 5.0 / 6.0)], [0.0, 3.0, 4.5]);
        assert_eq!([at(0.0, 0.0), at(1.0, 1.0)], [0.0, 5.0], "beyond the last middles as there");
        assert_eq!([at(-0.001, 0.5), at(f32::NAN, 0.5)], [0.0; 2], "nothing outside");
    }

    #[test]
    fn beyond_the_outermost_cells_are_others_or_nothing() {
        let grid =
            |wrap| ScalarGrid::new([2, 1, 1], vec![1.0, 3.0]).expect("two values").wrapped(wrap);
        for (wrap, [start, quarter, end]) in [
            (Wrap::Clamp, [1.0, 1.0, 3.0]),
            (Wrap::Mirror, [1.0, 1.0, 3.0]),
            (Wrap::Repeat, [2.0, 1.5, 2.0]),
            (Wrap::Black, [0.5, 0.75, 1.5]),
        ] {
            let at = |x| grid(wrap).lookup(Vec3::new(x, 0.5, 0.5));
            assert_eq!([at(0.0), at(0.125), at(1.0)], [start, quarter, end], "{wrap:?}");
        }
        let corner = grid(Wrap::Black).lookup(Vec3::ZERO);
        assert_eq!(corner, 0.125);
        let stepped = grid(Wrap::Black).stepped(true);
        assert_eq!(stepped.lookup(Vec3::ZERO), 1.0);
    }

    #[test]
    fn a_wrong_number_of_values_is_refused_and_wild_values_count_as_nothing() {
        assert!(ScalarGrid::new([2, 2, 2], vec![1.0; 7]).is_none());
        assert!(ScalarGrid::new([usize::MAX, 2, 2], vec![1.0; 7]).is_none());
        let wild =
            ScalarGrid::new([3, 1, 1], vec![f32::NAN, -1.0, f32::INFINITY]).expect("three values");
        assert!(wild.values().iter().all(|x| x.is_finite()) && wild.values()[..2] == [0.0; 2]);
    }
}
