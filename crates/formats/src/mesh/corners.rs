//! Lists the triangle corners that meet at each point, for one range of points at a time: for all
//! points at once, the lists would take more memory than the mesh.

use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// The number of ranges into which the points of large meshes are divided.
const PARTS: usize = 4;
/// The minimum number of corners in a range, unless it is the last.
const LEAST_CORNERS: usize = 1 << 20;
/// Triangles that one thread processes at a time.
const PIECE: usize = 1 << 12;

/// The points of a triangle's corners.
#[inline]
fn points_of(triangle: &[u32; 3], points: &[u32]) -> [usize; 3] {
    triangle.map(|vertex| points[vertex as usize] as usize)
}

/// The position of each point's corners in the list of all corners, sorted by point. A corner's
/// number is 3 times the triangle plus 0, 1 or 2.
pub struct Corners {
    /// For each point, the end of its corners if its range has been listed already; otherwise their
    /// beginning.
    places: Vec<AtomicU32>,
    parts: Vec<Range<usize>>,
    /// The lowest and the highest point of each piece of the triangles. Triangles that are adjacent
    /// in the file are often close in space too; then few pieces concern a range.
    reach: Vec<[usize; 2]>,
}

impl Corners {
    /// Counts the corners of each point. `points` has the point of each vertex.
    pub fn count(indices: &[[u32; 3]], points: &[u32]) -> Self {
        let mut places: Vec<AtomicU32> = Vec::new();
        places.resize_with(points.len(), AtomicU32::default);
        let count_piece = |piece: &[[u32; 3]]| {
            let mut reach = [usize::MAX, 0];
            for point in piece.iter().flat_map(|triangle| points_of(triangle, points)) {
                places[point].fetch_add(1, Relaxed);
                reach = [reach[0].min(point), reach[1].max(point)];
            }
            reach
        };
        let reach = indices.par_chunks(PIECE).map(count_piece).collect();
        let most = (indices.len() * 3).div_ceil(PARTS).max(LEAST_CORNERS);
        let (mut parts, mut first, mut before, mut start) = (Vec::new(), 0, 0u32, 0u32);
        for (point, place) in places.iter_mut().enumerate() {
            let number = std::mem::replace(place.get_mut(), start);
            start += number;
            if (start - before) as usize > most {
                parts.push(first..point + 1);
                (first, before) = (point + 1, start);
            }
        }
        parts.push(first..points.len());
        Self { places, parts, reach }
    }

    /// The ranges of points. Their corners must be requested in this order, once for each range.
    pub fn parts(&self) -> Vec<Range<usize>> {
        self.parts.clone()
    }

    /// Lists the corners of a range of points.
    pub fn of_points(
        &mut self,
        indices: &[[u32; 3]],
        points: &[u32],
        range: Range<usize>,
    ) -> Part<'_> {
        let places = &self.places;
        let end =
            places.get(range.end).map_or(indices.len() as u32 * 3, |place| place.load(Relaxed));
        let start = places.get(range.start).map_or(end, |place| place.load(Relaxed));
        let mut corners = Vec::new();
        corners.resize_with((end - start) as usize, AtomicU32::default);
        let pieces = indices.par_chunks(PIECE).zip(&self.reach).enumerate();
        let concerned = pieces
            .filter(|(_, (_, [lowest, highest]))| *lowest < range.end && *highest >= range.start);
        concerned.for_each(|(number, (piece, _))| {
            let all = piece.iter().flat_map(|triangle| points_of(triangle, points));
            for (corner, point) in (3 * PIECE * number..).zip(all) {
                if range.contains(&point) {
                    let place = places[point].fetch_add(1, Relaxed) - start;
                    corners[place as usize].store(corner as u32, Relaxed);
                }
            }
        });
        Part { ends: places, start, first: range.start, corners }
    }
}

/// The corners of a range of points.
pub struct Part<'a> {
    ends: &'a [AtomicU32],
    /// Number of corners in earlier ranges.
    start: u32,
    first: usize,
    corners: Vec<AtomicU32>,
}

impl Part<'_> {
    /// Numbers of the corners that meet at a point of the range, in any order.
    pub fn around(&self, point: usize) -> impl Iterator<Item = u32> {
        let start =
            if point == self.first { self.start } else { self.ends[point - 1].load(Relaxed) };
        let corners =
            (start - self.start) as usize..(self.ends[point].load(Relaxed) - self.start) as usize;
        self.corners[corners].iter().map(|corner| corner.load(Relaxed))
    }
}
