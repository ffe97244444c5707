//! The closed bodies of a mesh, and which of them a point is inside: exactly, by the crossings of a
//! ray with the bodies.
//!
//! The ray runs along an axis, so that a triangle is crossed if the point is in its projection, and
//! every sign is exact. The difference of the crossings outwards and inwards is the winding number
//! of the body around the point (Hormann and Agathos, The Point in Polygon Problem for Arbitrary
//! Polygons, 2001, a dimension higher).

use super::bodies::{Bodies, ClosedBody};
use super::boxes::Boxes;
use super::sign::{height, is_on, rounds};
use super::{Side, Triangles};
use rayon::prelude::*;
use snell_math::{Bounds3d, DVec3};

/// Coordinates beyond this are scaled, so that no product of three overflows or underflows.
const LARGE: f64 = 1e75;

/// Closed bodies, ready for points.
#[derive(Debug, Default)]
pub struct Crossings {
    boxes: Boxes,
    /// The vertices of the triangles in the order of the items of the tree, and the body of each.
    triangles: Vec<([u32; 3], u32)>,
    bodies: Vec<Body>,
    /// A power of two by which coordinates are multiplied.
    scale: f64,
}

/// A closed body.
#[derive(Clone, Copy, Debug)]
struct Body {
    /// True if the winding number of the body decides; otherwise the parity of the crossings does.
    is_oriented: bool,
    /// 1 for a solid, -1 for a cavity in one.
    role: i32,
}

/// The crossings of a ray with a body.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    body: u32,
    /// Crossings outwards less crossings inwards.
    outwards: i32,
    crossings: u32,
}

/// The crossings of a ray with all bodies.
struct Tally {
    /// The first body that is crossed, most often the only one.
    first: Count,
    others: Vec<Count>,
    is_on_surface: bool,
}

impl Tally {
    fn add(&mut self, body: u32, outwards: i32) {
        if self.first.crossings == 0 {
            self.first.body = body;
        }
        let count = if self.first.body == body {
            &mut self.first
        } else if let Some(place) = self.others.iter().position(|c| c.body == body) {
            &mut self.others[place]
        } else {
            self.others.push(Count { body, ..Count::default() });
            let last = self.others.len() - 1;
            &mut self.others[last]
        };
        count.outwards += outwards;
        count.crossings += 1;
    }

    fn counts(&self) -> impl Iterator<Item = &Count> {
        std::iter::once(&self.first).filter(|c| c.crossings > 0).chain(&self.others)
    }
}

impl Crossings {
    /// Prepares the closed bodies of a mesh.
    pub fn of(mesh: &Triangles, parts: &Bodies) -> Self {
        let bounds: Vec<Bounds3d> =
            parts.triangles.par_iter().map(|t| Bounds3d::of(mesh.corners(t.0 as usize))).collect();
        let all = bounds.iter().fold(Bounds3d::EMPTY, |all, b| all.union(b));
        let (boxes, order) = Boxes::build(&bounds);
        let triangle = |&i: &u32| {
            let (triangle, body) = parts.triangles[i as usize];
            (mesh.indices()[triangle as usize], body)
        };
        let triangles = order.iter().map(triangle).collect();
        let largest = all.min.abs().max(all.max.abs()).max_element();
        let ordinary = parts.triangles.is_empty() || (1.0 / LARGE..LARGE).contains(&largest);
        let scale = if ordinary { 1.0 } else { power_of_two_near(1.0 / largest) };
        let body = |b: &ClosedBody| Body { is_oriented: b.is_oriented, role: 1 };
        let bodies = parts.closed.iter().map(body).collect();
        let mut this = Self { boxes, triangles, bodies, scale };
        if this.bodies.len() > 1 {
            this.find_cavities(mesh, &parts.closed);
        }
        this
    }

    /// True if there are no closed bodies.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Makes a cavity of each body that is directly in a solid and turned the other way.
    fn find_cavities(&mut self, mesh: &Triangles, closed: &[ClosedBody]) {
        let size = |i: u32| closed[i as usize].volume.abs();
        // For each body, the smallest one around it.
        let around: Vec<Option<u32>> = (0..closed.len() as u32)
            .into_par_iter()
            .map(|i| {
                let tally = self.tally(mesh, closed[i as usize].corner);
                let others = tally.counts().filter(|c| c.body != i && self.is_in(c));
                let larger = others.map(|c| c.body).filter(|&b| size(b) > size(i));
                larger.min_by(|&a, &b| size(a).total_cmp(&size(b)).then(a.cmp(&b)))
            })
            .collect();
        let mut order: Vec<u32> = (0..closed.len() as u32).collect();
        order.sort_by(|&a, &b| size(b).total_cmp(&size(a)).then(a.cmp(&b)));
        for i in order {
            let Some(outer) = around[i as usize] else { continue };
            let turned = (closed[i as usize].volume < 0.0) != (closed[outer as usize].volume < 0.0);
            if self.bodies[outer as usize].role == 1 && turned {
                self.bodies[i as usize].role = -1;
            }
        }
    }

    fn is_in(&self, count: &Count) -> bool {
        if self.bodies[count.body as usize].is_oriented {
            count.outwards != 0
        } else {
            count.crossings % 2 == 1
        }
    }

    /// Where a point is. The surface is part of the bodies.
    pub fn side(&self, mesh: &Triangles, point: DVec3) -> Side {
        let tally = self.tally(mesh, point);
        if tally.is_on_surface {
            return Side::OnSurface;
        }
        let bodies = tally.counts().filter(|c| self.is_in(c));
        let sum: i32 = bodies.map(|c| self.bodies[c.body as usize].role).sum();
        if sum > 0 { Side::Inside } else { Side::Outside }
    }

    /// The sum of the winding numbers of the bodies that are oriented, and whether the point is on
    /// the surface; then the number is any of those beside it.
    pub fn winding_number(&self, mesh: &Triangles, point: DVec3) -> (i32, bool) {
        let tally = self.tally(mesh, point);
        let oriented = tally.counts().filter(|c| self.bodies[c.body as usize].is_oriented);
        (oriented.map(|c| c.outwards).sum(), tally.is_on_surface)
    }

    /// The crossings of a ray from a point.
    fn tally(&self, mesh: &Triangles, point: DVec3) -> Tally {
        match mesh {
            Triangles::Single(mesh) => self.cross(point, |i| mesh.positions[i as usize].as_dvec3()),
            Triangles::Double(mesh) => self.cross(point, |i| mesh.positions[i as usize]),
        }
    }

    #[inline(always)]
    fn cross(&self, point: DVec3, position: impl Fn(u32) -> DVec3) -> Tally {
        let mut tally = Tally { first: Count::default(), others: Vec::new(), is_on_surface: false };
        let [u, v, w] = self.boxes.axes();
        let p = point * self.scale;
        let flat = |x: DVec3| [x[u], x[v]];
        self.boxes.above(point, |item| {
            let (triangle, body) = self.triangles[item as usize];
            let corners = triangle.map(|i| position(i) * self.scale);
            let [a, b, c] = corners;
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let misses = (p[u] < low[u])
                | (p[u] > high[u])
                | (p[v] < low[v])
                | (p[v] > high[v])
                | (p[w] > high[w]);
            if misses {
                return false;
            }
            let rounds = rounds([flat(a), flat(b), flat(c)], flat(p));
            if p[w] < low[w] {
                // The whole triangle is above.
                if rounds != 0 {
                    tally.add(body, rounds);
                }
                return false;
            }
            let height = height(&corners, p);
            if height == 0 {
                tally.is_on_surface |= rounds != 0 || is_on(&corners, p);
            } else if rounds == height {
                tally.add(body, rounds);
            }
            false
        });
        tally
    }
}

/// The power of two nearest below a positive number.
fn power_of_two_near(x: f64) -> f64 {
    const SIGNIFICAND: u64 = (1 << 52) - 1;
    let power = f64::from_bits(x.to_bits() & !SIGNIFICAND);
    if power.is_normal() { power } else { f64::MIN_POSITIVE }
}
