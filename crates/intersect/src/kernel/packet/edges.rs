//! Edge tests in lanes: one triangle against all rays, or all triangles of a block against two
//! rays.

use super::frustum::{PerRay, RAYS};
use super::leaf::SeenBlock;
use super::planes::Planes;
use super::rays::PacketRays;
use snell_math::simd::{Lanes8, Lanes16};

/// [`PacketRays`] in lanes: all rays, for one triangle; or two rays, each repeated for all
/// triangles.
pub(super) struct LineLanes<W> {
    slope: [W; 2],
    moment: Option<[W; 3]>,
    begin: W,
    pub end: W,
}

impl<W: Lanes16> LineLanes<W> {
    #[inline(always)]
    pub fn all(token: W::Token, packet_rays: &PacketRays) -> Self {
        let ([sx, sy], [mx, my, mz]) = (&packet_rays.slope, &packet_rays.moment);
        Self {
            slope: [W::load(token, sx), W::load(token, sy)],
            moment: if packet_rays.separate {
                Some([W::load(token, mx), W::load(token, my), W::load(token, mz)])
            } else {
                None
            },
            begin: W::load(token, &packet_rays.begin),
            end: W::load(token, &packet_rays.end),
        }
    }

    #[inline(always)]
    pub fn two(token: W::Token, packet_rays: &PacketRays, a: usize, b: usize) -> Self {
        let ([sx, sy], [mx, my, mz]) = (&packet_rays.slope, &packet_rays.moment);
        Self {
            slope: [both(token, sx, a, b), both(token, sy, a, b)],
            moment: if packet_rays.separate {
                Some([both(token, mx, a, b), both(token, my, a, b), both(token, mz, a, b)])
            } else {
                None
            },
            begin: both(token, &packet_rays.begin, a, b),
            end: both(token, &packet_rays.end, a, b),
        }
    }
}

/// The data of [`SeenBlock`] in lanes: one triangle, repeated for all rays; or all triangles, for
/// two rays.
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
    /// The data of one triangle, for all rays.
    #[inline(always)]
    pub fn one(token: W::Token, seen: &SeenBlock, triangle: usize) -> Self {
        let i = triangle;
        Self {
            normal: of3(token, &seen.normal, i),
            areas: [of3(token, &seen.areas[0], i), of3(token, &seen.areas[1], i)],
            edges: [of3(token, &seen.edges[0], i), of3(token, &seen.edges[1], i)],
            bound: of(token, &seen.bound, i),
            nearest: of(token, &seen.nearest, i),
            farthest: of(token, &seen.farthest, i),
        }
    }

    /// The data of all triangles, for two rays.
    #[inline(always)]
    pub fn all(token: W::Token, seen: &SeenBlock) -> Self {
        Self {
            normal: twice3(token, &seen.normal),
            areas: [twice3(token, &seen.areas[0]), twice3(token, &seen.areas[1])],
            edges: [twice3(token, &seen.edges[0]), twice3(token, &seen.edges[1])],
            bound: twice(token, &seen.bound),
            nearest: twice(token, &seen.nearest),
            farthest: twice(token, &seen.farthest),
        }
    }

    #[inline(always)]
    pub fn areas(&self, packet_rays: &LineLanes<W>, zero: W) -> Areas<W> {
        let sum = along(self.normal, packet_rays.slope);
        let (mut a1, mut a2) =
            (along(self.areas[0], packet_rays.slope), along(self.areas[1], packet_rays.slope));
        if let Some(moment) = packet_rays.moment {
            // The contribution of the positions of the rays.
            (a1, a2) = (a1.add(dot(self.edges[0], moment)), a2.add(dot(self.edges[1], moment)));
        }
        let a0 = sum.sub(a1).sub(a2);
        let inside = a0.min(a1).min(a2).max(zero.sub(a0.max(a1).max(a2)));
        Areas { sum, a1, a2, inside }
    }

    /// The lanes where a ray certainly misses the triangle, or hits it before its start or beyond
    /// its end.
    #[inline(always)]
    pub fn missed(
        &self,
        token: W::Token,
        planes: &PlaneLanes<W>,
        packet_rays: &LineLanes<W>,
    ) -> u32 {
        self.missed_by(token, &self.areas(packet_rays, W::splat(token, 0.0)), planes, packet_rays)
    }

    /// Performs [`Self::missed`] with areas that are already computed.
    #[inline(always)]
    fn missed_by(
        &self,
        token: W::Token,
        areas: &Areas<W>,
        planes: &PlaneLanes<W>,
        packet_rays: &LineLanes<W>,
    ) -> u32 {
        self.outside(token, areas)
            | packet_rays.end.lt(self.nearest)
            | planes.behind(token, self, areas, packet_rays)
    }

    /// The lanes where a ray certainly misses the triangle.
    #[inline(always)]
    pub fn outside(&self, token: W::Token, areas: &Areas<W>) -> u32 {
        // NaN is never certain.
        areas.inside.add(self.bound).lt(W::splat(token, 0.0))
    }

    /// The rays that may hit a triangle within their intervals, and the rays that certainly do.
    #[inline(always)]
    fn edge_tests(
        &self,
        token: W::Token,
        planes: &PlaneLanes<W>,
        packet_rays: &LineLanes<W>,
        [certain_begin, certain_end]: [W; 2],
    ) -> [u32; 2] {
        let areas = self.areas(packet_rays, W::splat(token, 0.0));
        let (size, missed) = (areas.sum.abs(), self.missed_by(token, &areas, planes, packet_rays));
        let ahead = planes.distance(token, self, &areas, packet_rays).sub(certain_begin.mul(size));
        let ahead = planes.error.lt(ahead) & planes.upright.lt(size);
        // A ray through the interior of a triangle hits it between the depths of its corners.
        let inside = self.bound.add(self.bound).lt(areas.inside);
        [!missed & 0xffff, inside & ahead & self.farthest.lt(certain_end) & !missed]
    }
}

impl<W: Lanes16> PlaneLanes<W> {
    /// The planes of one triangle, for all rays.
    #[inline(always)]
    pub fn one(token: W::Token, seen: &SeenBlock, triangle: usize) -> Self {
        let Planes { height, error, upright } = seen.planes();
        Self {
            height: of(token, height, triangle),
            error: of(token, error, triangle),
            upright: of(token, upright, triangle),
        }
    }

    /// The planes of all triangles, for two rays.
    #[inline(always)]
    pub fn all(token: W::Token, seen: &SeenBlock) -> Self {
        let Planes { height, error, upright } = seen.planes();
        Self {
            height: twice(token, height),
            error: twice(token, error),
            upright: twice(token, upright),
        }
    }

    /// The lanes where a ray certainly begins behind the plane, decided without a division.
    #[inline(always)]
    pub fn behind(
        &self,
        token: W::Token,
        of_triangle: &TriangleLanes<W>,
        areas: &Areas<W>,
        packet_rays: &LineLanes<W>,
    ) -> u32 {
        let size = areas.sum.abs();
        let ahead =
            self.distance(token, of_triangle, areas, packet_rays).sub(packet_rays.begin.mul(size));
        ahead.add(self.error).lt(W::splat(token, 0.0)) & self.upright.lt(size)
    }

    /// The `z` at which rays cross planes, times the magnitude of the dot product of normal and
    /// direction.
    #[inline(always)]
    fn distance(
        &self,
        token: W::Token,
        of_triangle: &TriangleLanes<W>,
        areas: &Areas<W>,
        packet_rays: &LineLanes<W>,
    ) -> W {
        let (mut height, [x, y, _]) = (self.height, of_triangle.normal);
        if let Some([mx, my, _]) = packet_rays.moment {
            height = x.mul_add(my, height).sub(y.mul(mx));
        }
        let zero = W::splat(token, 0.0);
        height.where_less(areas.sum, zero, zero.sub(height))
    }
}

/// The triangles of a block that occlusion rays may hit.
pub(super) struct EdgeTests {
    /// The triangles that some ray may hit.
    pub near: u32,
    /// The triangles that some ray certainly hits.
    pub certain: u32,
    /// For each tested triangle, the rays that may hit it, and the rays that certainly do.
    pub rays: [[u32; 2]; 8],
}

impl SeenBlock {
    /// The triangles of a subset that any of some rays may hit within its interval, found without a
    /// branch for each triangle. Efficient for many rays.
    #[inline(always)]
    pub fn near_any<W: Lanes16>(
        &self,
        token: W::Token,
        packet_rays: &PacketRays,
        rays: u32,
        mut triangles: u32,
    ) -> u32 {
        let mut near = 0;
        let packet_rays = LineLanes::<W>::all(token, packet_rays);
        while triangles != 0 {
            let triangle = triangles.trailing_zeros();
            triangles &= triangles - 1;
            let i = triangle as usize & 7;
            let missed = TriangleLanes::one(token, self, i).missed(
                token,
                &PlaneLanes::one(token, self, i),
                &packet_rays,
            );
            near |= u32::from(rays & !missed != 0) << triangle;
        }
        near
    }

    /// Tests some rays with the triangles of a subset, without branches.
    #[inline(always)]
    pub fn edge_tests<W: Lanes16>(
        &self,
        token: W::Token,
        packet_rays: &PacketRays,
        rays: u32,
        mut triangles: u32,
    ) -> EdgeTests {
        let mut edge_tests = EdgeTests { near: 0, certain: 0, rays: [[0; 2]; 8] };
        let of_rays = LineLanes::<W>::all(token, packet_rays);
        let limits =
            [W::load(token, &packet_rays.certain_begin), W::load(token, &packet_rays.certain_end)];
        while triangles != 0 {
            let triangle = triangles.trailing_zeros();
            triangles &= triangles - 1;
            let i = triangle as usize & 7;
            let [possible, certain] = TriangleLanes::one(token, self, i).edge_tests(
                token,
                &PlaneLanes::one(token, self, i),
                &of_rays,
                limits,
            );
            edge_tests.rays[i] = [possible & rays, certain & rays];
            edge_tests.near |= u32::from(possible & rays != 0) << triangle;
            edge_tests.certain |= u32::from(certain & rays != 0) << triangle;
        }
        edge_tests
    }
}

/// The sum of the three signed areas of an edge test, two of them, and the least distance of all
/// three from zero on their common side (negative if the signs differ).
pub(super) struct Areas<W> {
    pub sum: W,
    pub a1: W,
    pub a2: W,
    pub inside: W,
}

/// A value of one triangle, for all rays.
#[inline(always)]
pub(super) fn of<W: Lanes16>(token: W::Token, row: &[f32; 8], triangle: usize) -> W {
    W::splat(token, row[triangle & 7])
}

/// A vector of one triangle, for all rays.
#[inline(always)]
fn of3<W: Lanes16>(token: W::Token, [x, y, z]: &[[f32; 8]; 3], triangle: usize) -> [W; 3] {
    [of(token, x, triangle), of(token, y, triangle), of(token, z, triangle)]
}

/// A value of each triangle, for two rays.
#[inline(always)]
fn twice<W: Lanes16>(token: W::Token, row: &[f32; 8]) -> W {
    W::load_halves(token, row, row)
}

/// A vector of each triangle, for two rays.
#[inline(always)]
fn twice3<W: Lanes16>(token: W::Token, [x, y, z]: &[[f32; 8]; 3]) -> [W; 3] {
    [twice(token, x), twice(token, y), twice(token, z)]
}

/// The values of two rays, each repeated for all triangles.
#[inline(always)]
fn both<W: Lanes16>(token: W::Token, values: &PerRay<f32>, a: usize, b: usize) -> W {
    let half = W::half_token(token);
    let [a, b] = [values[a & (RAYS - 1)], values[b & (RAYS - 1)]];
    W::from_halves(token, Lanes8::splat(half, a), Lanes8::splat(half, b))
}

/// The dot product of a vector and the directions of rays, whose third component is 1.
#[inline(always)]
fn along<W: Lanes16>([x, y, z]: [W; 3], slope: [W; 2]) -> W {
    slope[0].mul_add(x, slope[1].mul_add(y, z))
}

#[inline(always)]
fn dot<W: Lanes16>(a: [W; 3], b: [W; 3]) -> W {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2].mul(b[2])))
}
