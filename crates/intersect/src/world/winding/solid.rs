//! A mesh as something that has an inside: its closed bodies, and its open surfaces.

use super::bodies::{Bodies, OpenPart};
use super::crossings::Crossings;
use super::sign::is_on;
use super::tree::{Moments, Tree, View};
use super::{ACCURACIES, Side, Triangles};
use crate::shape::winding::of_triangle;
use rayon::prelude::*;
use snell_math::{Bounds3d, DVec3};
use std::cell::Cell;

/// A mesh, ready for points.
#[derive(Debug)]
pub struct Solid {
    mesh: Triangles,
    bounds: Bounds3d,
    /// Bounds of everything that a point can be inside.
    inside: Bounds3d,
    closed: Crossings,
    /// The open surfaces, over which there is a tree.
    parts: Vec<Part>,
    open: Tree,
    /// What all open surfaces bound together; see [`Part::side`].
    side: f64,
}

/// An open surface.
#[derive(Debug)]
struct Part {
    tree: Tree,
    bounds: Bounds3d,
    /// 1 if the surface bounds something, -1 if its normals point into what it bounds, 0 if it
    /// bounds nothing by itself.
    side: f64,
}

impl Solid {
    /// Prepares a mesh.
    pub fn of(mesh: Triangles) -> Self {
        let finite = |b: Bounds3d, p: DVec3| if p.is_finite() { b.with_point(p) } else { b };
        let bounds =
            (0..mesh.vertex_count()).map(|i| mesh.position(i)).fold(Bounds3d::EMPTY, finite);
        let mut bodies = Bodies::of(&mesh, &bounds);
        let closed = Crossings::of(&mesh, &bodies);
        let of_closed = |t: &(u32, u32)| Bounds3d::of(mesh.corners(t.0 as usize));
        let mut inside =
            bodies.triangles.iter().map(of_closed).fold(Bounds3d::EMPTY, |all, b| all.union(&b));
        let whole = bodies.open.iter().fold(bodies.sheets.extent, |all, p| all.plus(&p.extent));
        bodies.open.push(std::mem::take(&mut bodies.sheets));
        // A closed body without orientation has no winding number of its own; its triangles are
        // summed for that number only.
        let unoriented: Vec<u32> = bodies
            .triangles
            .iter()
            .filter(|t| !bodies.closed[t.1 as usize].is_oriented)
            .map(|t| t.0)
            .collect();
        let mut parts: Vec<Part> =
            bodies.open.par_iter().map(|part| Part::of(&mesh, part)).collect();
        let mut side = whole.side();
        let open = parts.iter().fold(Bounds3d::EMPTY, |all, part| all.union(&part.bounds));
        parts.retain(|part| part.tree.moments().is_some());
        if parts.len() < 2 {
            side = 0.0;
        }
        for part in parts.iter().filter(|part| part.side != 0.0) {
            inside = inside.union(&part.bounds);
        }
        if side != 0.0 {
            inside = inside.union(&open);
        }
        if !unoriented.is_empty() {
            let mut part =
                Part::of(&mesh, &OpenPart { triangles: unoriented, ..OpenPart::default() });
            part.side = f64::NAN;
            parts.push(part);
        }
        let items: Vec<(u32, Moments)> =
            (0..).zip(&parts).filter_map(|(i, part)| Some((i, *part.tree.moments()?))).collect();
        let open = Tree::build(&items, |_| u64::MAX);
        Self { mesh, bounds, inside, closed, parts, open, side }
    }

    /// The bounds of everything that a point can be inside; empty if there is no such thing.
    pub fn inside(&self) -> &Bounds3d {
        &self.inside
    }

    /// The moments that approximate the mesh from a distance.
    pub fn moments(&self) -> Moments {
        let closed = Moments::of_closed(self.bounds);
        match self.open.moments() {
            Some(open) => Moments { bounds: self.bounds, ..*open },
            None => closed,
        }
    }

    /// Where a point is. The surface of what bounds something is part of it.
    pub fn side(&self, point: DVec3) -> Side {
        if !self.inside.contains(point) {
            return Side::Outside;
        }
        let side = if self.closed.is_empty() {
            Side::Outside
        } else {
            self.closed.side(&self.mesh, point)
        };
        let is_bounded = self.side != 0.0 || self.parts.iter().any(|part| part.side.abs() == 1.0);
        if side == Side::Outside && is_bounded { self.side_of_open(point) } else { side }
    }

    /// Where a point is with respect to the open surfaces: inside if the winding number of one that
    /// bounds something is more than a half, or that of all of them if together they bound
    /// something.
    fn side_of_open(&self, point: DVec3) -> Side {
        let view = View::world(point);
        for (accuracy, doubt) in ACCURACIES {
            let (is_inside, is_doubtful, is_on_surface) =
                (Cell::new(false), Cell::new(false), Cell::new(false));
            let decide = |number: f64| {
                is_inside.set(is_inside.get() || number > 0.5);
                is_doubtful.set(is_doubtful.get() || (number - 0.5).abs() < doubt);
            };
            let sum = self.open.winding_number(&view, accuracy, u64::MAX, &mut |part| {
                let part = &self.parts[part as usize];
                let decides = part.side != 0.0 && part.bounds.contains(point);
                if part.side.is_nan() || (self.side == 0.0 && !decides) {
                    return 0.0;
                }
                let bounds_something = self.side != 0.0 || part.side != 0.0;
                let number = part.tree.winding_number(&view, accuracy, u64::MAX, &mut |triangle| {
                    let corners = self.mesh.corners(triangle as usize);
                    if bounds_something && is_on(&corners, point) {
                        is_on_surface.set(true);
                    }
                    of_triangle(corners.map(|c| c - point))
                });
                if decides {
                    decide(number * part.side);
                }
                number
            });
            if self.side != 0.0 {
                decide(sum * self.side);
            }
            if is_on_surface.get() {
                return Side::OnSurface;
            }
            if !is_doubtful.get() || doubt == 0.0 {
                return if is_inside.get() { Side::Inside } else { Side::Outside };
            }
        }
        Side::Outside
    }

    /// The winding number of the whole mesh around a point that is seen as `view` has it.
    pub fn winding_number(&self, view: &View, accuracy: f64, is_on_surface: &Cell<bool>) -> f64 {
        let mut closed = 0;
        if !self.closed.is_empty() && self.bounds.contains(view.point) {
            let (number, is_on) = self.closed.winding_number(&self.mesh, view.point);
            closed = number;
            is_on_surface.set(is_on_surface.get() || is_on);
        }
        f64::from(closed)
            + self.open.winding_number(view, accuracy, u64::MAX, &mut |part| {
                let tree = &self.parts[part as usize].tree;
                tree.winding_number(view, accuracy, u64::MAX, &mut |triangle| {
                    let corners = self.mesh.corners(triangle as usize);
                    if is_on(&corners, view.point) {
                        is_on_surface.set(true);
                    }
                    of_triangle(corners.map(|c| view.linear * (c - view.point))) * view.orientation
                })
            })
    }
}

impl Part {
    fn of(mesh: &Triangles, part: &OpenPart) -> Self {
        let items: Vec<(u32, Moments)> = part
            .triangles
            .par_iter()
            .map(|&i| (i, Moments::of_triangle(mesh.corners(i as usize))))
            .filter(|(_, m)| m.area > 0.0 && m.area.is_finite())
            .collect();
        let bounds = items.iter().fold(Bounds3d::EMPTY, |all, (_, m)| all.union(&m.bounds));
        Self { tree: Tree::build(&items, |_| u64::MAX), bounds, side: part.extent.side() }
    }
}
