//! Rays and triangles in lanes: a triangle for all rays, or all triangles for two rays.

use super::bundle::PerRay;
use super::leaf::SeenBlock;
use super::lines::Lines;
use super::planes::Planes;
use snell_math::simd::{Lanes8, Lanes16};

/// [`Lines`] in lanes: of all rays, for a triangle; or of two rays, for all triangles.
pub(super) struct LineLanes<W> {
    slope: [W; 2],
    moment: Option<[W; 3]>,
    begin: W,
    pub end: W,
}

impl<W: Lanes16> LineLanes<W> {
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    pub unsafe fn all(lines: &Lines) -> Self {
        let ([sx, sy], [mx, my, mz]) = (&lines.slope, &lines.moment);
        // SAFETY: passed on to the caller.
        unsafe {
            Self {
                slope: [W::load(sx), W::load(sy)],
                moment: if lines.apart {
                    Some([W::load(mx), W::load(my), W::load(mz)])
                } else {
                    None
                },
                begin: W::load(&lines.begin),
                end: W::load(&lines.end),
            }
        }
    }

    /// # Safety
    /// The machine must have the instructions of `W`; the rays must be below 16.
    #[inline(always)]
    pub unsafe fn two(lines: &Lines, a: usize, b: usize) -> Self {
        let ([sx, sy], [mx, my, mz]) = (&lines.slope, &lines.moment);
        // SAFETY: passed on to the caller.
        unsafe {
            Self {
                slope: [both(sx, a, b), both(sy, a, b)],
                moment: if lines.apart {
                    Some([both(mx, a, b), both(my, a, b), both(mz, a, b)])
                } else {
                    None
                },
                begin: both(&lines.begin, a, b),
                end: both(&lines.end, a, b),
            }
        }
    }
}

/// Some of [`SeenBlock`] in lanes: of a triangle, for all rays; or of all triangles, for two rays.
pub(super) struct TriangleLanes<W> {
    normal: [W; 3],
    areas: [[W; 3]; 2],
    edges: [[W; 3]; 2],
    pub bound: W,
    pub nearest: W,
    farthest: W,
}

/// [`Planes`](super::planes::Planes) in lanes.
pub(super) struct PlaneLanes<W> {
    height: W,
    error: W,
    upright: W,
}

impl<W: Lanes16> TriangleLanes<W> {
    /// A triangle, for all rays.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; the triangle must be below 8.
    #[inline(always)]
    pub unsafe fn one(seen: &SeenBlock, triangle: usize) -> Self {
        let i = triangle;
        // SAFETY: passed on to the caller.
        unsafe {
            Self {
                normal: of3(&seen.normal, i),
                areas: [of3(&seen.areas[0], i), of3(&seen.areas[1], i)],
                edges: [of3(&seen.edges[0], i), of3(&seen.edges[1], i)],
                bound: of(&seen.bound, i),
                nearest: of(&seen.nearest, i),
                farthest: of(&seen.farthest, i),
            }
        }
    }

    /// All triangles, for two rays.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    pub unsafe fn all(seen: &SeenBlock) -> Self {
        // SAFETY: passed on to the caller.
        unsafe {
            Self {
                normal: twice3(&seen.normal),
                areas: [twice3(&seen.areas[0]), twice3(&seen.areas[1])],
                edges: [twice3(&seen.edges[0]), twice3(&seen.edges[1])],
                bound: twice(&seen.bound),
                nearest: twice(&seen.nearest),
                farthest: twice(&seen.farthest),
            }
        }
    }

    #[inline(always)]
    pub fn areas(&self, lines: &LineLanes<W>, zero: W) -> Areas<W> {
        let sum = along(self.normal, lines.slope);
        let (mut a1, mut a2) =
            (along(self.areas[0], lines.slope), along(self.areas[1], lines.slope));
        if let Some(moment) = lines.moment {
            // What the places of rays add.
            (a1, a2) = (a1.add(dot(self.edges[0], moment)), a2.add(dot(self.edges[1], moment)));
        }
        let a0 = sum.sub(a1).sub(a2);
        let inside = a0.min(a1).min(a2).max(zero.sub(a0.max(a1).max(a2)));
        Areas { sum, a1, a2, inside }
    }

    /// Where rays surely do not meet triangles, or before they begin, or beyond where they end.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    pub unsafe fn missed(&self, planes: &PlaneLanes<W>, lines: &LineLanes<W>) -> u32 {
        // SAFETY: passed on to the caller.
        unsafe { self.missed_by(&self.areas(lines, W::splat(0.0)), planes, lines) }
    }

    /// The same by the areas.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    unsafe fn missed_by(
        &self,
        areas: &Areas<W>,
        planes: &PlaneLanes<W>,
        lines: &LineLanes<W>,
    ) -> u32 {
        // SAFETY: passed on to the caller.
        unsafe {
            self.outside(areas) | lines.end.lt(self.nearest) | planes.behind(self, areas, lines)
        }
    }

    /// Where lines surely pass by.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    pub unsafe fn outside(&self, areas: &Areas<W>) -> u32 {
        // SAFETY: passed on to the caller. (NaN is never sure.)
        unsafe { areas.inside.add(self.bound).lt(W::splat(0.0)) }
    }

    /// The rays that may hit a triangle where that may matter, and those that surely do within
    /// their intervals.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    unsafe fn facing(
        &self,
        planes: &PlaneLanes<W>,
        lines: &LineLanes<W>,
        [sure_begin, sure_end]: [W; 2],
    ) -> [u32; 2] {
        // SAFETY: passed on to the caller.
        unsafe {
            let areas = self.areas(lines, W::splat(0.0));
            let (size, missed) = (areas.sum.abs(), self.missed_by(&areas, planes, lines));
            let ahead = planes.distance(self, &areas, lines).sub(sure_begin.mul(size));
            let ahead = planes.error.lt(ahead) & planes.upright.lt(size);
            // Rays through the inside of a triangle hit it between its corners.
            let inside = self.bound.add(self.bound).lt(areas.inside);
            [!missed & 0xffff, inside & ahead & self.farthest.lt(sure_end) & !missed]
        }
    }
}

impl<W: Lanes16> PlaneLanes<W> {
    /// Of a triangle, for all rays.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; the triangle must be below 8, and planes must
    /// have been wanted.
    #[inline(always)]
    pub unsafe fn one(seen: &SeenBlock, triangle: usize) -> Self {
        // SAFETY: passed on to the caller.
        unsafe {
            let Planes { height, error, upright } = seen.planes.assume_init_ref();
            Self {
                height: of(height, triangle),
                error: of(error, triangle),
                upright: of(upright, triangle),
            }
        }
    }

    /// Of all triangles, for two rays.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; planes must have been wanted.
    #[inline(always)]
    pub unsafe fn all(seen: &SeenBlock) -> Self {
        // SAFETY: passed on to the caller.
        unsafe {
            let Planes { height, error, upright } = seen.planes.assume_init_ref();
            Self { height: twice(height), error: twice(error), upright: twice(upright) }
        }
    }

    /// Where rays surely begin behind planes: without a quotient.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    pub unsafe fn behind(
        &self,
        of_triangle: &TriangleLanes<W>,
        areas: &Areas<W>,
        lines: &LineLanes<W>,
    ) -> u32 {
        let size = areas.sum.abs();
        // SAFETY: passed on to the caller.
        unsafe {
            let ahead = self.distance(of_triangle, areas, lines).sub(lines.begin.mul(size));
            ahead.add(self.error).lt(W::splat(0.0)) & self.upright.lt(size)
        }
    }

    /// Where lines meet planes along the axis, times the product of the normal and the direction,
    /// without its sign.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`.
    #[inline(always)]
    unsafe fn distance(
        &self,
        of_triangle: &TriangleLanes<W>,
        areas: &Areas<W>,
        lines: &LineLanes<W>,
    ) -> W {
        let (mut height, [x, y, _]) = (self.height, of_triangle.normal);
        if let Some([mx, my, _]) = lines.moment {
            height = x.mul_add(my, height).sub(y.mul(mx));
        }
        // SAFETY: passed on to the caller.
        let zero = unsafe { W::splat(0.0) };
        height.where_less(areas.sum, zero, zero.sub(height))
    }
}

/// What rays may hit of a block where any hit will do.
pub(super) struct Facing {
    /// Triangles that any may hit, and that any surely hit.
    pub near: u32,
    pub sure: u32,
    /// By triangle, of those that were asked about: rays that may hit it, and that surely do.
    pub rays: [[u32; 2]; 8],
}

impl SeenBlock {
    /// Those of some triangles that any of some rays may meet where that may matter: without a
    /// branch on it, for many rays.
    ///
    /// # Safety
    /// As [`Self::facing`].
    #[inline(always)]
    pub unsafe fn near_any<W: Lanes16>(&self, lines: &Lines, rays: u32, mut triangles: u32) -> u32 {
        let mut near = 0;
        // SAFETY: passed on to the caller.
        unsafe {
            let lines = LineLanes::<W>::all(lines);
            while triangles != 0 {
                let triangle = triangles.trailing_zeros();
                triangles &= triangles - 1;
                let i = triangle as usize & 7;
                let missed = TriangleLanes::one(self, i).missed(&PlaneLanes::one(self, i), &lines);
                near |= u32::from(rays & !missed != 0) << triangle;
            }
        }
        near
    }

    /// What some rays may hit of some triangles, without a branch on it.
    ///
    /// # Safety
    /// The machine must have the instructions of `W`; the triangles must be below 8, and planes
    /// must have been wanted.
    #[inline(always)]
    pub unsafe fn facing<W: Lanes16>(
        &self,
        lines: &Lines,
        rays: u32,
        mut triangles: u32,
    ) -> Facing {
        let mut facing = Facing { near: 0, sure: 0, rays: [[0; 2]; 8] };
        // SAFETY: passed on to the caller.
        unsafe {
            let of_rays = LineLanes::<W>::all(lines);
            let limits = [W::load(&lines.sure_begin), W::load(&lines.sure_end)];
            while triangles != 0 {
                let triangle = triangles.trailing_zeros();
                triangles &= triangles - 1;
                let i = triangle as usize & 7;
                let [possible, sure] =
                    TriangleLanes::one(self, i).facing(&PlaneLanes::one(self, i), &of_rays, limits);
                facing.rays[i] = [possible & rays, sure & rays];
                facing.near |= u32::from(possible & rays != 0) << triangle;
                facing.sure |= u32::from(sure & rays != 0) << triangle;
            }
        }
        facing
    }
}

/// The sum of three signed areas, two of them, and how far all are on one side, on the better side.
pub(super) struct Areas<W> {
    pub sum: W,
    pub a1: W,
    pub a2: W,
    pub inside: W,
}

/// A number of a triangle, for all rays.
///
/// # Safety
/// The machine must have the instructions of `W`; the triangle must be below 8.
#[inline(always)]
pub(super) unsafe fn of<W: Lanes16>(row: &[f32; 8], triangle: usize) -> W {
    // SAFETY: passed on to the caller.
    unsafe { W::splat(*row.get_unchecked(triangle)) }
}

/// A vector of a triangle, for all rays.
///
/// # Safety
/// As [`of`].
#[inline(always)]
unsafe fn of3<W: Lanes16>([x, y, z]: &[[f32; 8]; 3], triangle: usize) -> [W; 3] {
    // SAFETY: passed on to the caller.
    unsafe { [of(x, triangle), of(y, triangle), of(z, triangle)] }
}

/// A number of all triangles, for two rays.
///
/// # Safety
/// The machine must have the instructions of `W`.
#[inline(always)]
unsafe fn twice<W: Lanes16>(row: &[f32; 8]) -> W {
    // SAFETY: passed on to the caller.
    unsafe { W::load_halves(row, row) }
}

/// The vectors of all triangles, for two rays.
///
/// # Safety
/// The machine must have the instructions of `W`.
#[inline(always)]
unsafe fn twice3<W: Lanes16>([x, y, z]: &[[f32; 8]; 3]) -> [W; 3] {
    // SAFETY: passed on to the caller.
    unsafe { [twice(x), twice(y), twice(z)] }
}

/// The numbers of two rays, for all triangles.
///
/// # Safety
/// The machine must have the instructions of `W`; the rays must be below 16.
#[inline(always)]
unsafe fn both<W: Lanes16>(values: &PerRay<f32>, a: usize, b: usize) -> W {
    // SAFETY: passed on to the caller.
    unsafe {
        W::from_halves(
            Lanes8::splat(*values.get_unchecked(a)),
            Lanes8::splat(*values.get_unchecked(b)),
        )
    }
}

/// The product of a vector and directions.
#[inline(always)]
fn along<W: Lanes16>([x, y, z]: [W; 3], slope: [W; 2]) -> W {
    slope[0].mul_add(x, slope[1].mul_add(y, z))
}

#[inline(always)]
fn dot<W: Lanes16>(a: [W; 3], b: [W; 3]) -> W {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2].mul(b[2])))
}
