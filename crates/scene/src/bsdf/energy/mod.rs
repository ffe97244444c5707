//! Albedos of rough interfaces for a single bounce off the facets, and thus the energy that is
//! missing: light that bounces between facets.
//!
//! The lobes add the missing energy as a diffuse lobe, in proportion to what is missing for the
//! incident and for the outgoing direction (Kelemen and Szirmay-Kalos 2001; Kulla and Conty,
//! Revisiting Physically Based Shading at Imageworks, SIGGRAPH 2017 course). That is reciprocal and
//! conserves energy. Layered materials use the same numbers for the fraction of light that reaches
//! the layers below.
//!
//! The tables in `tables.bin`, for isotropic surfaces, were integrated by `generate.rs`. Half of
//! their nodes along the direction follow the cosine in units of the roughness
//! ([`Widths::steepness`]), in which albedos are smooth even for nearly smooth surfaces at grazing
//! angles, and half the cosine itself, for the critical angle.

mod anisotropic;
#[cfg(test)]
mod generate;

use super::{MicrofacetShape, Microfacets, Widths};
use anisotropic::Anisotropic;
use snell_math::{Vec2, Vec3, exponentials, real};
use std::f32::consts::FRAC_1_PI;

/// Number of nodes along the direction.
const STEEPNESSES: usize = 48;
/// Number of nodes in roughness, which is the square root of `alpha`.
const ROUGHNESSES: usize = 28;
/// The roughness of the first node, which is not 0.
const LEAST_ROUGHNESS: f32 = 0.0141;
/// Number of nodes in the index of refraction.
const INDICES: usize = 32;
/// Number of values in a row: the albedos and their mean.
const ROW: usize = STEEPNESSES + 1;

/// All values as 16-bit numbers, little-endian: albedos in units of 1/65535, means by their
/// logarithms. The first half is for [`super::Ggx`], the second for [`super::Beckmann`].
static NUMBERS: [u16; 2 * HALF] = {
    let (bytes, mut numbers) = (include_bytes!("tables.bin"), [0; 2 * HALF]);
    let mut i = 0;
    while i < numbers.len() {
        numbers[i] = u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]);
        i += 1;
    }
    numbers
};

/// Number of values for each distribution.
const HALF: usize = ROUGHNESSES * ROW * (FACETS.indices + 3 * INDICES);

/// A table in [`NUMBERS`]. It has a row for each roughness, and each value of a row is stored for
/// all indices of refraction, one after the other.
#[derive(Clone, Copy, Debug)]
struct Table {
    start: usize,
    indices: usize,
}

/// The loss of facets that reflect everything, stored four times in place of four indices of
/// refraction.
const FACETS: Table = Table { start: 0, indices: 4 };
/// The albedo of a dielectric from outside, divided by the reflectance of a smooth surface at the
/// angle of a typical facet, in units of [`MOST`].
const REFLECTED: Table = Table::of_dielectrics(0);
/// The loss of a dielectric, from outside and from inside.
const LOST: [Table; 2] = [Table::of_dielectrics(1), Table::of_dielectrics(2)];

impl Table {
    const fn of_dielectrics(number: usize) -> Self {
        Self { start: ROUGHNESSES * ROW * (FACETS.indices + number * INDICES), indices: INDICES }
    }

    /// The start of the table for a microfacet distribution.
    fn of(self, shape: MicrofacetShape) -> usize {
        match shape {
            MicrofacetShape::Ggx => self.start,
            MicrofacetShape::Beckmann => self.start + HALF,
        }
    }
}

/// The square root of the reflectance at normal incidence at the last node of the index of
/// refraction. It grows with the power 2.5 of the node's number.
const MOST_ROOT_F0: f64 = 0.98;

/// A value for four successive indices of refraction.
#[inline(always)]
fn four(at: usize) -> [f32; 4] {
    let [a, b, c, d] = NUMBERS[at..at + 4].as_chunks().0[0];
    let number = |x: u16| f32::from(x) * (1.0 / 65535.0);
    [number(a), number(b), number(c), number(d)]
}

/// The logarithm of the smallest mean. At low roughness almost nothing is lost on average but much
/// at grazing angles, and the ratio matters.
const DEEPEST: f32 = -16.0;

/// The largest ratio between the reflectance of a rough and of a smooth dielectric, both at the
/// cosine at which a typical visible facet is seen ([`Widths::root`]).
const MOST: f32 = 16.0;

/// Factor on [`MOST`] for a distribution: at grazing angles, more of Beckmann's visible facets are
/// seen edge-on, where even an index close to 1 reflects light.
fn range(shape: MicrofacetShape) -> f32 {
    match shape {
        MicrofacetShape::Ggx => 1.0,
        MicrofacetShape::Beckmann => 4.0,
    }
}

/// The first of the two nodes around a position in `[0, 1]` on a grid of `n` nodes, and the weight
/// of the second.
#[inline(always)]
pub(super) fn nodes(x: f32, n: usize) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
    let i = (x as i32).min(n as i32 - 2);
    (i as usize, x - i as f32)
}

/// The position of a direction among the nodes, in `[0, 1]`.
#[inline(always)]
fn position(widths: Widths, w: Vec3) -> f32 {
    0.5 * (widths.steepness(w).sqrt() + w.z)
}

#[inline(always)]
fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// One quantity of one surface, as a function of direction.
#[derive(Clone, Copy, Debug)]
struct Albedo {
    /// The place in the table of the first of four rows around the roughness, for the first of four
    /// indices of refraction around that of the surface.
    start: usize,
    /// See [`Table`].
    indices: usize,
    /// Weights of the four rows and of the four indices of refraction, for cubic interpolation.
    rows: [f32; 4],
    planes: [f32; 4],
    /// The value relative to which the mean is stored.
    reference: f32,
    /// True if the step to the last node, the normal, is interpolated in the square of the angle,
    /// with which albedos change. Those of GGX change less there.
    is_round: bool,
}

/// An upper estimate of the mean loss for a width of the distribution.
fn mean_reference(alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    4.0 * a2 * real::ln_1p(1.0 / a2)
}

/// Weights of the values at 0, 1, 2 and 3 for the cubic through them, at `x`.
fn cubic(x: f32) -> [f32; 4] {
    let [a, b, c, d] = [x, x - 1.0, x - 2.0, x - 3.0];
    [b * c * d * (-1.0 / 6.0), a * c * d * 0.5, a * b * d * -0.5, a * b * c * (1.0 / 6.0)]
}

/// Weights of the values at four places for the cubic through them, at `x`.
fn cubic_through(places: [f32; 4], x: f32) -> [f32; 4] {
    std::array::from_fn(|i| {
        let others = (0..4).filter(|&k| k != i);
        others.map(|k| (x - places[k]) / (places[i] - places[k])).product()
    })
}

impl Albedo {
    fn new(facets: Microfacets, table: Table, (index, planes): (usize, [f32; 4])) -> Self {
        let steps = (ROUGHNESSES - 1) as f32;
        let row = facets.widths().alpha().sqrt().min(1.0) * steps;
        let first = (row as usize).saturating_sub(1).min(ROUGHNESSES - 4);
        let rows = match first {
            0 => cubic_through([LEAST_ROUGHNESS * steps, 1.0, 2.0, 3.0], row),
            _ => cubic(row - first as f32),
        };
        let start = table.of(facets.shape()) + first * ROW * table.indices + index;
        let is_round = facets.shape() == MicrofacetShape::Beckmann;
        Self { start, indices: table.indices, rows, planes, reference: 1.0, is_round }
    }

    /// The albedo of a loss, whose mean is stored relative to [`mean_reference`].
    fn loss(facets: Microfacets, table: Table, indices: (usize, [f32; 4])) -> Self {
        let reference = mean_reference(facets.widths().alpha().clamp(1e-4, 1.0));
        Self { reference, ..Self::new(facets, table, indices) }
    }

    /// The albedo of a reflection, in units of [`MOST`].
    fn reflected(facets: Microfacets, (index, planes): (usize, [f32; 4])) -> Self {
        let range = range(facets.shape());
        let made = Self::new(facets, REFLECTED, (index, planes.map(|weight| range * weight)));
        // The range applies to directions, not to the mean.
        Self { reference: 1.0 / range, ..made }
    }

    /// Interpolates a value between the four rows, for each of four indices of refraction.
    #[inline(always)]
    fn over_rows(&self, number: impl Fn(usize) -> [f32; 4]) -> [f32; 4] {
        let mut sums = [0.0; 4];
        for (row, weight) in self.rows.iter().enumerate() {
            let numbers = number(self.start + row * ROW * self.indices);
            for (sum, number) in sums.iter_mut().zip(numbers) {
                *sum += weight * number;
            }
        }
        sums
    }

    /// Interpolates between four indices of refraction; the result is at least 0.
    #[inline(always)]
    fn over_planes(&self, numbers: [f32; 4]) -> f32 {
        self.planes
            .iter()
            .zip(numbers)
            .map(|(weight, number)| weight * number)
            .sum::<f32>()
            .max(0.0)
    }

    /// The two nodes from `first` on, precomputed.
    #[inline(always)]
    fn near(&self, first: u32) -> Near {
        let first = first as usize;
        Near([self.node(first + first % 2), self.node(first | 1)])
    }

    /// All nodes, precomputed.
    fn line(&self) -> Line {
        let mut line = Line([0.0; LINE]);
        for (i, node) in line.0.iter_mut().enumerate().take(STEEPNESSES) {
            *node = self.node(i);
        }
        line
    }

    /// The mean over directions, weighted by the cosine.
    fn average(&self) -> f32 {
        let logarithms = self.over_rows(|row| four(row + STEEPNESSES * self.indices));
        // Means with weight 0 are not computed.
        let mean = |plane: usize| match self.planes[plane] {
            0.0 => 0.0,
            _ => self.reference * real::exp(logarithms[plane] * DEEPEST),
        };
        self.over_planes(std::array::from_fn(mean))
    }
}

/// A share of light as a function of the direction that it comes from or goes to.
pub(super) trait Directional {
    /// The share for a direction above.
    fn towards(&self, w: Vec3) -> f32;
}

/// A function of direction by its values at the nodes along it.
pub(super) trait Nodes {
    fn node(&self, i: usize) -> f32;

    /// The value for a direction at this position among the nodes.
    #[inline(always)]
    fn directional(&self, position: f32) -> f32 {
        let (i, t) = nodes(position, STEEPNESSES);
        lerp(self.node(i), self.node(i + 1), t)
    }
}

impl Nodes for Albedo {
    #[inline(always)]
    fn node(&self, i: usize) -> f32 {
        self.over_planes(self.over_rows(|row| four(row + i * self.indices)))
    }

    #[inline(always)]
    fn directional(&self, position: f32) -> f32 {
        let (i, t) = nodes(position, STEEPNESSES);
        let t = if self.is_round && i == STEEPNESSES - 2 { t * (2.0 - t) } else { t };
        lerp(self.node(i), self.node(i + 1), t)
    }
}

/// Length of the array of nodes. It is a power of two, so that masked indices need no bounds check.
const LINE: usize = STEEPNESSES.next_power_of_two();

/// Precomputed nodes, for many evaluations of one surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line([f32; LINE]);

impl Nodes for Line {
    #[inline(always)]
    fn node(&self, i: usize) -> f32 {
        self.0[i % LINE]
    }
}

/// The two nodes around a position, the one with the even number first. They suffice for
/// evaluations there.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Near([f32; 2]);

impl Nodes for Near {
    #[inline(always)]
    fn node(&self, i: usize) -> f32 {
        if i.is_multiple_of(2) { self.0[0] } else { self.0[1] }
    }
}

/// The first of the two nodes around a direction above the surface.
#[inline(always)]
pub(super) fn first_node(widths: Widths, w: Vec3) -> u32 {
    nodes(position(widths, w), STEEPNESSES).0 as u32
}

/// The index of refraction for quantities that do not depend on one.
const NO_INDEX: (usize, [f32; 4]) = (0, [1.0, 0.0, 0.0, 0.0]);

/// Directions above the surface for light that bounced off several facets. Smooth surfaces lose
/// light only at grazing angles and must regain it there, so the square of the cosine has the
/// unnormalised density `1 / (mu^2 + alpha^2)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct BouncedLobe {
    /// The squared width, bounded from below, so that the logarithm is finite.
    squared_width: f32,
    /// The integral of the unnormalised density.
    integral: f32,
}

impl BouncedLobe {
    pub(super) fn new(widths: Widths) -> Self {
        let width = widths.x.max(widths.y);
        let squared_width = (width * width).max(1e-6);
        Self { squared_width, integral: real::ln_1p(1.0 / squared_width) }
    }

    /// Samples a direction. The function has no branches, so that loops over it become vector code.
    #[inline(always)]
    pub(super) fn sample(&self, u: Vec2) -> Vec3 {
        let grown = exponentials::exp(f64::from(u.x * self.integral)) - 1.0;
        let z2 = (self.squared_width * grown as f32).clamp(0.0, 1.0);
        let (sin, cos) = super::turn(u.y);
        let r = (1.0 - z2).sqrt();
        Vec3::new(r * cos, r * sin, z2.sqrt())
    }

    /// Density of [`Self::sample`] per steradian, for a direction above the surface with this
    /// cosine.
    #[inline(always)]
    pub(super) fn pdf(&self, cos: f32) -> f32 {
        cos * FRAC_1_PI / ((cos * cos + self.squared_width) * self.integral)
    }
}

/// The loss of perfectly reflecting facets that shadow each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct FacetLoss {
    widths: Widths,
    loss: Albedo,
    anisotropic: Option<Anisotropic>,
}

impl Directional for FacetLoss {
    /// Share of light lost towards (equally: from) a direction above.
    fn towards(&self, w: Vec3) -> f32 {
        match &self.anisotropic {
            _ if self.widths.is_smooth() => 0.0,
            Some(anisotropic) => anisotropic.directional(w).min(1.0),
            None => self.loss.directional(position(self.widths, w)),
        }
    }
}

impl FacetLoss {
    pub(super) fn new(facets: Microfacets) -> Self {
        Self {
            widths: facets.widths(),
            loss: Albedo::loss(facets, FACETS, NO_INDEX),
            anisotropic: Anisotropic::loss(facets, FACETS, 1.0),
        }
    }

    /// The nodes of a rough isotropic surface, for many evaluations.
    pub(super) fn line(&self) -> FacetLossBy<Line> {
        FacetLossBy { widths: self.widths, loss: self.loss.line() }
    }

    /// The two nodes of a rough surface from [`first_node`] on.
    #[inline(always)]
    pub(super) fn near(&self, first: u32) -> Near {
        self.loss.near(first)
    }

    /// The fraction of diffuse light that is lost.
    pub(super) fn average(&self) -> f32 {
        match &self.anisotropic {
            _ if self.widths.is_smooth() => 0.0,
            Some(anisotropic) => anisotropic.average(),
            None => self.loss.average(),
        }
    }
}

/// [`FacetLoss`] of a rough surface by its nodes, for many evaluations.
#[derive(Clone, Copy, Debug)]
pub(super) struct FacetLossBy<N> {
    pub widths: Widths,
    pub loss: N,
}

impl<N: Nodes> Directional for FacetLossBy<N> {
    #[inline(always)]
    fn towards(&self, w: Vec3) -> f32 {
        self.loss.directional(position(self.widths, w))
    }
}

/// Four indices of refraction around `ior` (at least 1): the number of the first, and the weights
/// of all for cubic interpolation.
fn indices(ior: f32) -> (usize, [f32; 4]) {
    let s = f64::from((ior - 1.0) / (ior + 1.0));
    let x = real::powf((s / MOST_ROOT_F0).clamp(0.0, 1.0), 1.0 / 2.5) * (INDICES - 1) as f64;
    let first = (x as usize).saturating_sub(1).min(INDICES - 4);
    (first, cubic((x - first as f64) as f32))
}

/// The albedo of a dielectric seen from the side of lower index.
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricReflection {
    widths: Widths,
    ior: f32,
    /// The indices of refraction around that of the surface, and their weights.
    indices: (usize, [f32; 4]),
    reflected: Albedo,
    anisotropic: Option<Anisotropic>,
}

impl Directional for DielectricReflection {
    /// Share of light reflected once towards a direction above.
    fn towards(&self, w: Vec3) -> f32 {
        match &self.anisotropic {
            _ if self.widths.is_smooth() => super::fresnel::dielectric(w.z, self.ior),
            Some(anisotropic) => {
                let reference = super::fresnel::dielectric(self.widths.root(w).min(1.0), self.ior);
                (reference * anisotropic.directional(w)).min(1.0)
            }
            None => reflected_towards(self.widths, self.ior, &self.reflected, w),
        }
    }
}

impl DielectricReflection {
    /// Seen from the side of lower index; `ior` is the other side's over this one's, at least 1.
    pub(super) fn new(facets: Microfacets, ior: f32) -> Self {
        Self::at(facets, ior, indices(ior))
    }

    /// Makes what [`Self::new`] makes, which is cheaper if `self` has the same index of refraction.
    pub(super) fn again(&self, facets: Microfacets, ior: f32) -> Self {
        if ior == self.ior { Self::at(facets, ior, self.indices) } else { Self::new(facets, ior) }
    }

    fn at(facets: Microfacets, ior: f32, indices: (usize, [f32; 4])) -> Self {
        Self {
            widths: facets.widths(),
            ior,
            indices,
            reflected: Albedo::reflected(facets, indices),
            anisotropic: Anisotropic::reflected(facets, ior),
        }
    }

    /// The nodes of a rough isotropic surface, for many evaluations.
    pub(super) fn line(&self) -> DielectricReflectionBy<Line> {
        DielectricReflectionBy {
            widths: self.widths,
            ior: self.ior,
            reflected: self.reflected.line(),
        }
    }

    /// The two nodes of a rough surface from [`first_node`] on.
    #[inline(always)]
    pub(super) fn near(&self, first: u32) -> Near {
        self.reflected.near(first)
    }

    /// The fraction of diffuse light that is reflected in one bounce.
    pub(super) fn average(&self) -> f32 {
        match &self.anisotropic {
            _ if self.widths.is_smooth() => super::fresnel::dielectric_average(self.ior),
            Some(anisotropic) => anisotropic.average(),
            None => self.reflected.average(),
        }
    }
}

/// The fraction of light that a rough dielectric reflects in one bounce, towards a direction above
/// the surface.
#[inline(always)]
fn reflected_towards(widths: Widths, ior: f32, reflected: &impl Nodes, w: Vec3) -> f32 {
    let reference = super::fresnel::dielectric(widths.root(w).min(1.0), ior);
    (reference * MOST * reflected.directional(position(widths, w))).min(1.0)
}

/// [`DielectricReflection`] of a rough surface with precomputed nodes, for many evaluations.
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricReflectionBy<N> {
    pub widths: Widths,
    pub ior: f32,
    pub reflected: N,
}

impl<N: Nodes> Directional for DielectricReflectionBy<N> {
    #[inline(always)]
    fn towards(&self, w: Vec3) -> f32 {
        reflected_towards(self.widths, self.ior, &self.reflected, w)
    }
}

/// The loss of a dielectric: light that it neither reflects nor transmits in a single bounce.
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricLoss {
    widths: Widths,
    loss: Albedo,
    anisotropic: Option<Anisotropic>,
}

impl DielectricLoss {
    /// The loss on the side where `eta` is the index of refraction of the other side divided by
    /// that of this side.
    pub(super) fn new(facets: Microfacets, eta: f32) -> Self {
        let (table, ior) = if eta >= 1.0 { (LOST[0], eta) } else { (LOST[1], 1.0 / eta) };
        Self {
            widths: facets.widths(),
            loss: Albedo::loss(facets, table, indices(ior)),
            anisotropic: Anisotropic::loss(facets, table, ior),
        }
    }

    /// The fraction of light that is lost towards a direction above the surface, which equals that
    /// lost from it.
    pub(super) fn towards(&self, w: Vec3) -> f32 {
        match &self.anisotropic {
            Some(anisotropic) => anisotropic.directional(w).min(1.0),
            None => self.loss.directional(position(self.widths, w)),
        }
    }

    /// The fraction of diffuse light that is lost.
    pub(super) fn average(&self) -> f32 {
        match &self.anisotropic {
            Some(anisotropic) => anisotropic.average(),
            None => self.loss.average(),
        }
    }
}

/// [`DielectricLoss`] of a rough isotropic surface seen from its outer and its inner side, for many
/// evaluations.
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricLossLines {
    widths: Widths,
    sides: [Line; 2],
}

impl DielectricLossLines {
    pub(super) fn new(outer: &DielectricLoss, inner: &DielectricLoss) -> Self {
        Self { widths: outer.widths, sides: [outer.loss.line(), inner.loss.line()] }
    }

    /// The loss on the inner or outer side; see [`DielectricLoss::towards`].
    #[inline(always)]
    pub(super) fn towards(&self, is_inside: bool, w: Vec3) -> f32 {
        self.sides[usize::from(is_inside)].directional(position(self.widths, w))
    }
}
