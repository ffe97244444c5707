//! The front end shared by all methods: converts a world to facets in the picture's plane.

use super::facet::{Facet, Nearness, centre};
use super::{VisibleError, facet};
use crate::coherence::{PrimitiveId, View};
use snell_intersect::{Geometry, GroupId, World};
use snell_math::{DVec2, DVec3};

/// The largest number of triangles in a world; a facet takes about four hundred bytes.
const MOST_TRIANGLES: u64 = 8_000_000;

/// The depth of the near plane, relative to the maximum depth.
const NEAR: f64 = 1e-8;

/// A triangle in world coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub id: PrimitiveId,
    pub corners: [DVec3; 3],
}

/// A world of triangles projected to a picture: the input of all methods.
///
/// Triangles are transformed to the world, clipped at a near plane just in front of the eye, and
/// projected to places of the picture (in pixels, with a corner of the picture at 0), with their
/// *nearness*, the reciprocal of the depth. In these coordinates planes remain planes, all rays are
/// parallel, and a greater nearness is nearer to the eye.
#[derive(Debug)]
pub struct Screen {
    pub(super) size: [u32; 2],
    pub(super) view: View,
    /// All triangles that can be hit, in ascending order of ids.
    pub(super) triangles: Vec<Triangle>,
    /// The facets that overlap the picture, in ascending order of ids.
    pub(super) facets: Vec<Facet>,
    /// The facets that may cover a pixel centre.
    pub(super) sampled: Vec<u32>,
    /// The facet of each triangle, or [`super::NOTHING`].
    facet_of: Vec<u32>,
    /// Triangles within the picture that are seen edge-on.
    edge_on: u64,
}

/// The homogeneous place of a point: x and y times depth, and depth.
fn homogeneous(view: &View, p: DVec3) -> DVec3 {
    let (rows, p) = (view.rows(), p.extend(1.0));
    DVec3::new(rows.x.dot(p), rows.y.dot(p), rows.depth.dot(p))
}

impl Screen {
    /// Projects a world to a view. The picture has the places from (0, 0) to `size`, and each pixel
    /// is a square of side 1.
    pub fn new(world: &World, view: &View, size: [u32; 2]) -> Result<Self, VisibleError> {
        if view.apex().is_none() {
            return Err(VisibleError::NotPinhole);
        }
        let triangles = triangles(world)?;
        let deepest = triangles
            .iter()
            .flat_map(|t| t.corners)
            .map(|p| homogeneous(view, p).z)
            .fold(0.0, f64::max);
        let mut screen = Self {
            size,
            view: *view,
            facets: Vec::new(),
            sampled: Vec::new(),
            facet_of: vec![super::NOTHING; triangles.len()],
            edge_on: 0,
            triangles,
        };
        let near = deepest * NEAR;
        for i in 0..screen.triangles.len() {
            screen.add(i as u32, near);
        }
        Ok(screen)
    }

    fn add(&mut self, triangle: u32, near: f64) {
        let [w, h] = self.size.map(f64::from);
        let corners = self.triangles[triangle as usize].corners.map(|p| homogeneous(&self.view, p));
        let outside =
            |side: fn(&DVec3, f64) -> f64, bound: f64| corners.iter().all(|c| side(c, bound) < 0.0);
        if outside(|c, near| c.z - near, near)
            || outside(|c, _| c.x, 0.0)
            || outside(|c, w| w * c.z - c.x, w)
            || outside(|c, _| c.y, 0.0)
            || outside(|c, h| h * c.z - c.y, h)
        {
            return;
        }
        let mut polygon = [DVec3::ZERO; 4];
        let mut count = 0;
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            let mut push = |c: DVec3| {
                polygon[count] = DVec3::new(c.x / c.z, c.y / c.z, 1.0 / c.z);
                count += 1;
            };
            if a.z >= near && a.z > 0.0 {
                push(a);
            }
            if (a.z >= near) != (b.z >= near) {
                // The corners are ordered by depth, so that both triangles at this edge get the
                // same point.
                let (a, b) = if a.z < b.z { (a, b) } else { (b, a) };
                let at = a + (b - a) * ((near - a.z) / (b.z - a.z));
                push(DVec3::new(at.x, at.y, near));
            }
        }
        let polygon = &polygon[..count];
        let facet = plane(&corners)
            .and_then(|slope| {
                Some((slope, *polygon.iter().min_by(|a, b| self.nearest_first(a, b))?))
            })
            .map(|(slope, at)| Nearness { anchor: at.truncate(), slope, value: at.z })
            .filter(|n| polygon.iter().all(|p| p.is_finite()) && n.slope.is_finite())
            .and_then(|nearness| Facet::new(triangle, polygon, nearness, self.size));
        let Some(facet) = facet else {
            self.edge_on += 1;
            return;
        };
        let index = self.facets.len() as u32;
        self.facet_of[triangle as usize] = index;
        if facet.has_pixels() {
            self.sampled.push(index);
        }
        self.facets.push(facet);
    }

    /// Compares corners by their distance from the middle of the picture. Nearness is most accurate
    /// relative to the nearest corner; the result does not depend on the order of corners.
    fn nearest_first(&self, a: &DVec3, b: &DVec3) -> std::cmp::Ordering {
        let middle = DVec2::new(self.size[0].into(), self.size[1].into()) * 0.5;
        let key = |p: &DVec3| [(p.truncate() - middle).abs().max_element(), p.x, p.y];
        let (a, b) = (key(a), key(b));
        a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]))
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The number of triangles in the world that can be hit.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// The number of facets: triangles in the picture that are not seen edge-on.
    pub fn facet_count(&self) -> usize {
        self.facets.len()
    }

    /// The number of facets whose extent contains a pixel centre; the others cannot be sampled.
    pub fn sampled_count(&self) -> usize {
        self.sampled.len()
    }

    /// The number of triangles in the picture that are seen edge-on and therefore invisible.
    pub fn edge_on_count(&self) -> u64 {
        self.edge_on
    }

    /// The triangle of an item of a picture; `None` for the background.
    pub fn primitive(&self, item: u32) -> Option<PrimitiveId> {
        let facet = self.facets.get(item as usize)?;
        Some(self.triangles[facet.triangle as usize].id)
    }

    /// The item of a triangle of the world; [`super::NOTHING`] if it is not in the picture.
    pub(super) fn item(&self, id: PrimitiveId) -> u32 {
        match self.triangles.binary_search_by(|t| t.id.cmp(&id)) {
            Ok(triangle) => self.facet_of[triangle],
            Err(_) => super::NOTHING,
        }
    }

    /// The facet of a triangle, if it has one.
    pub(super) fn facet_of(&self, triangle: u32) -> Option<&Facet> {
        self.facets.get(self.facet_of[triangle as usize] as usize)
    }

    /// The nearness of a facet at the centre of a pixel.
    #[inline(always)]
    pub(super) fn nearness(&self, item: u32, x: u32, y: u32) -> f64 {
        self.facets[item as usize].nearness.at(centre(x, y))
    }

    /// The facet that is visible at a pixel, found by comparing all of the given ones.
    pub(super) fn nearest_of(&self, items: impl Iterator<Item = u32>, x: u32, y: u32) -> u32 {
        let mut best = (super::NOTHING, 0.0);
        for item in items {
            let facet = &self.facets[item as usize];
            if facet.covers(x, y) {
                let new = (item, facet.nearness.at(centre(x, y)));
                if best.0 == super::NOTHING || facet::is_nearer(new, best) {
                    best = new;
                }
            }
        }
        best.0
    }

    /// True if two methods may legitimately see different items at a pixel: its centre is within
    /// `tolerance` pixels of an edge of one of the items, or both are equally near there, or one is
    /// seen edge-on.
    pub fn is_borderline(&self, x: u32, y: u32, a: u32, b: u32, tolerance: f64) -> bool {
        let place = centre(x, y);
        let facet = |item: u32| self.facets.get(item as usize);
        let is_at_edge =
            |item: u32| facet(item).is_some_and(|f| f.inside(place).abs() <= tolerance);
        let near = |item: u32| {
            facet(item).map(|f| (f.nearness.at(place), f.nearness.slope.length(), f.slack))
        };
        let is_tie = match (near(a), near(b)) {
            (Some((a, slope_a, slack_a)), Some((b, slope_b, slack_b))) => {
                (a - b).abs()
                    <= (slope_a + slope_b) * tolerance
                        + slack_a
                        + slack_b
                        + 1e-6 * a.abs().max(b.abs())
            }
            _ => false,
        };
        is_at_edge(a) || is_at_edge(b) || is_tie
    }
}

/// The gradient of nearness on the plane of three homogeneous places, the same for any order of
/// them. `None` if the plane contains the eye.
fn plane(corners: &[DVec3; 3]) -> Option<DVec2> {
    let mut c = *corners;
    c.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    // The affine function a x + b y + c = 1 / depth, times depth, gives three linear equations.
    let (u, v) = (c[1] - c[0], c[2] - c[0]);
    let (n, volume) = (u.cross(v), c[0].dot(u.cross(v)));
    let slope = n.truncate() / volume;
    (volume != 0.0 && slope.is_finite()).then_some(slope)
}

/// All triangles that can be hit, in ascending order of ids.
fn triangles(world: &World) -> Result<Vec<Triangle>, VisibleError> {
    let count = world.instanced_triangle_count();
    if count > MOST_TRIANGLES {
        return Err(VisibleError::TooManyTriangles { count, most: MOST_TRIANGLES });
    }
    let mut all = Vec::with_capacity(count as usize);
    let mut instance = 0;
    // Occurrences are numbered depth first, a group before its contents.
    let mut stack = vec![(GroupId(0), snell_math::Transform::IDENTITY)];
    while let Some((group, placed)) = stack.pop() {
        let contents = world.group(group);
        let mut geometries = contents.geometries.clone();
        geometries.sort();
        for id in geometries {
            let Geometry::Mesh(mesh) = world.geometry(id) else {
                return Err(VisibleError::NotTriangles);
            };
            for (i, indices) in mesh.indices.iter().enumerate() {
                let local = indices.map(|k| mesh.positions[k as usize].as_dvec3());
                let corners = local.map(|p| if placed.is_identity() { p } else { placed.point(p) });
                let id = PrimitiveId { instance, geometry: id.0, primitive: i as u32 };
                if !mesh.is_degenerate(i) && corners.iter().all(|p| p.is_finite()) {
                    all.push(Triangle { id, corners });
                }
            }
        }
        if contents.instances.iter().any(|i| !i.later.is_empty()) {
            return Err(VisibleError::NotTriangles);
        }
        stack.extend(
            contents.instances.iter().rev().map(|i| (i.child, placed.compose(&i.group_from_child))),
        );
        instance += 1;
    }
    Ok(all)
}
