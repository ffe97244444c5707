//! The primitives of one group, numbered: first the triangles of its meshes in order, then its
//! shapes and instances, then the primitives of its sets.

use super::box_ray::margin_of;
use crate::group::GroupList;
use rayon::prelude::*;
use snell_math::{Bounds3, Bounds3d, DVec3, Vec3};

/// Thickness of the [`Region`] of a triangle, relative to the longest side of the group's box.
pub(crate) const MARGIN: f64 = 5e-5;

/// The least size of triangles that have a region, in margins; for smaller ones the box is as good.
const LARGE: f64 = 40.0;

/// The number of primitives up to which one thread is enough.
pub(crate) const PARALLEL: usize = 4096;

/// A primitive, and a box that contains every possible hit on it (or on a part of the primitive).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub min: Vec3,
    pub id: u32,
    pub max: Vec3,
}

impl Item {
    pub fn bounds(&self) -> Bounds3 {
        Bounds3 { min: self.min, max: self.max }
    }

    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }
}

/// The contents of a group, for builders.
pub(crate) struct Primitives<'a> {
    list: &'a GroupList,
    /// For each mesh the number of its first triangle.
    first: Vec<u32>,
    /// The number of triangles; shapes and instances are numbered from here on.
    pub triangles: u32,
    /// The primitives that can be hit and have finite bounds, in ascending order.
    pub items: Vec<Item>,
    /// The numbers of shapes and instances without finite bounds.
    pub unbounded: Vec<u32>,
    /// The box around all items.
    pub bounds: Bounds3,
    /// The margin of [`Region`]s in this group.
    pub margin: f64,
}

impl<'a> Primitives<'a> {
    /// Numbers the contents. `boxes` are the boxes of the objects of the list, in order. Returns an
    /// error if there are too many primitives.
    pub fn new(list: &'a GroupList, boxes: &[Bounds3]) -> Result<Self, String> {
        let count: usize = list.meshes.iter().map(|(_, mesh)| mesh.indices.len()).sum::<usize>()
            + list.objects.len();
        if count > MAX_PRIMITIVES {
            return Err(format!(
                "a group holds {count} primitives; the limit is {MAX_PRIMITIVES}: spread them over \
                    several groups"
            ));
        }
        let mut first = Vec::with_capacity(list.meshes.len());
        let mut items = Vec::new();
        let mut next = 0;
        for (_, mesh) in &list.meshes {
            let item = |i: usize| {
                let [a, b, c] = mesh.corners(i);
                let id = next + i as u32;
                (!mesh.is_degenerate(i)).then(|| Item {
                    min: a.min(b).min(c),
                    id,
                    max: a.max(b).max(c),
                })
            };
            items.par_extend(
                (0..mesh.indices.len()).into_par_iter().with_min_len(PARALLEL).filter_map(item),
            );
            first.push(next);
            next += mesh.indices.len() as u32;
        }
        let mut unbounded = Vec::new();
        for (b, id) in boxes.iter().zip(next..) {
            if b.is_finite() {
                items.push(Item { min: b.min, id, max: b.max });
            } else if !b.is_empty() {
                unbounded.push(id);
            }
        }
        let bounds = bounds_of(&items);
        let margin = if bounds.is_empty() { 0.0 } else { margin_of(&bounds.into()) };
        Ok(Self { list, first, triangles: next, items, unbounded, bounds, margin })
    }

    /// The ranges of primitives that belong to one geometry or instance, as first and end.
    pub fn geometries(&self) -> impl Iterator<Item = (u32, u32)> {
        let meshes = self
            .first
            .iter()
            .zip(&self.list.meshes)
            .map(|(&first, m)| (first, first + m.1.indices.len() as u32));
        meshes.chain(
            self.list
                .objects
                .geometries()
                .map(|(first, end)| (self.triangles + first, self.triangles + end)),
        )
    }

    /// The corners of a triangle; `None` for a shape or an instance.
    pub fn corners(&self, id: u32) -> Option<[Vec3; 3]> {
        if id >= self.triangles {
            return None;
        }
        let mesh = self.first.partition_point(|&first| first <= id).checked_sub(1)?;
        Some(self.list.meshes[mesh].1.corners((id - self.first[mesh]) as usize))
    }

    /// The region of a triangle; `None` if its box is as good, or for another primitive.
    pub fn region(&self, id: u32, bounds: &Bounds3) -> Option<Region> {
        let least = LARGE * self.margin;
        let large = |x: f32| f64::from(x) > least;
        let size = bounds.size();
        // A box that is flat along an axis lies near the plane anyway.
        if !(large(size.x) && large(size.y) && large(size.z)) {
            return None;
        }
        Some(Region::new(&self.corners(id)?, self.margin))
    }

    /// The part of an item in a cell; `None` if the item does not reach into the cell.
    pub fn clipped(&self, item: &Item, cell: &Bounds3d) -> Option<Item> {
        let wide: Bounds3d = item.bounds().into();
        let mut part = wide.intersection(cell);
        if part.is_empty() {
            return None;
        }
        if let Some(region) = self.region(item.id, &item.bounds()) {
            part = region.clipped(&part);
            if part.is_empty() {
                return None;
            }
        }
        let part = part.outward_f32();
        // Rounding must not make the part larger than the item.
        Some(Item { min: part.min.max(item.min), id: item.id, max: part.max.min(item.max) })
    }
}

/// The largest number of primitives, so that flags fit beside it in 32 bits.
pub(crate) const MAX_PRIMITIVES: usize = 1 << 30;

/// The box around items.
pub(crate) fn bounds_of(items: &[Item]) -> Bounds3 {
    let add = |b: Bounds3, i: &Item| b.union(&i.bounds());
    if items.len() < PARALLEL {
        return items.iter().fold(Bounds3::EMPTY, add);
    }
    let chunk = |c: &[Item]| c.iter().fold(Bounds3::EMPTY, add);
    items.par_chunks(PARALLEL).map(chunk).reduce(|| Bounds3::EMPTY, |a, b| a.union(&b))
}

/// Half the area of a box, without overflow.
pub(crate) fn half_area(b: &Bounds3) -> f64 {
    Bounds3d::from(*b).half_area()
}

/// The part of a triangle's box where a ray can hit the triangle: near its plane. (It is not only
/// the triangle itself, because the distance of a ray that grazes it may be inaccurate; see
/// [`super::box_ray`].)
#[derive(Clone, Copy, Debug)]
pub(crate) struct Region {
    normal: DVec3,
    point: DVec3,
    /// The margin times the length of the normal.
    thickness: f64,
}

impl Region {
    fn new(corners: &[Vec3; 3], margin: f64) -> Self {
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        let normal = (b - a).cross(c - a);
        Self { normal, point: a, thickness: normal.length() * margin }
    }

    /// A part of a box that contains the region's intersection with it: the plane's equation is
    /// solved for each coordinate, with the bounds of the other two. Empty if the plane misses the
    /// box.
    pub fn clipped(&self, b: &Bounds3d) -> Bounds3d {
        let (low, high) = ((b.min - self.point) * self.normal, (b.max - self.point) * self.normal);
        let (low, high) = (low.min(high), low.max(high));
        let mut part = *b;
        for axis in 0..3 {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            if self.normal[axis] == 0.0 {
                if low[j] + low[k] > self.thickness || high[j] + high[k] < -self.thickness {
                    return Bounds3d::EMPTY;
                }
                continue;
            }
            let inverse = 1.0 / self.normal[axis];
            let x = (-self.thickness - high[j] - high[k]) * inverse;
            let y = (self.thickness - low[j] - low[k]) * inverse;
            // NaN, which arises from overflow, is ignored.
            part.min[axis] = part.min[axis].max(x.min(y) + self.point[axis]);
            part.max[axis] = part.max[axis].min(x.max(y) + self.point[axis]);
        }
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_region_in_a_cell_holds_every_point_of_the_triangle_there(
            c in prop::array::uniform3(prop::array::uniform3(-1.0f32..1.0)),
            u in 0.0f64..1.0, v in 0.0f64..1.0, size in 0.001f64..0.5,
        ) {
            let corners = c.map(Vec3::from_array);
            let [p, q, r] = corners.map(|v| v.as_dvec3());
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let point = p + (q - p) * u + (r - p) * v;
            let above = DVec3::new(size, size * 0.5, size * 0.1);
            let cell = Bounds3d { min: point - DVec3::splat(size), max: point + above };
            let part = Region::new(&corners, 1e-6).clipped(&cell);
            prop_assert!(part.contains(point), "{part:?} {point}");
            prop_assert!(part.min.cmpge(cell.min).all() && part.max.cmple(cell.max).all());
        }
    }

    #[test]
    fn a_cell_beside_the_plane_is_empty() {
        let region =
            Region::new(&[Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.0)], 1e-5);
        let cell =
            |z: f64| Bounds3d { min: DVec3::new(0.1, 0.1, z), max: DVec3::new(0.2, 0.2, z + 0.1) };
        assert!(region.clipped(&cell(0.5)).is_empty());
        let part = region.clipped(&cell(0.15));
        assert!((part.min.z - 0.2).abs() < 1e-4 && part.max.z == 0.25, "{part:?}");
    }
}
