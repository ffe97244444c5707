//! Portals: parallelograms through which alone the environment is seen, such as the windows of a
//! room (Bitterli, Novák and Jarosz, Portal-Masked Environment Map Sampling, EGSR 2015).

use serde::{Deserialize, Serialize};
use snell_math::{DVec3, Vec2, Vec3};

/// A parallelogram through which points on its inner side see the environment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Portal {
    /// One of the corners in the world.
    pub corner: DVec3,
    /// The edges from this corner. Their cross product points to the environment.
    pub edges: [DVec3; 2],
}

/// A portal prepared for rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct PortalSampler {
    corner: Vec3,
    edges: [Vec3; 2],
    /// Vectors whose products with an offset from the corner are its coordinates by the edges.
    duals: [Vec3; 2],
    /// Unit vector towards the environment.
    normal: Vec3,
    area: f32,
}

impl PortalSampler {
    /// Prepares a portal; `None` if it has no area.
    pub fn new(portal: &Portal) -> Option<Self> {
        let [a, b] = portal.edges;
        let area = a.cross(b).length();
        let normal = a.cross(b).try_normalize()?;
        let edges = portal.edges.map(|edge| edge.as_vec3());
        let prepared = Self {
            corner: portal.corner.as_vec3(),
            edges,
            duals: [
                b.cross(normal) / a.dot(b.cross(normal)),
                normal.cross(a) / b.dot(normal.cross(a)),
            ]
            .map(|dual| dual.as_vec3()),
            normal: normal.as_vec3(),
            area: area as f32,
        };
        (prepared.area > 0.0 && prepared.area.is_finite()).then_some(prepared)
    }

    /// The density per steradian with which [`Self::sample`] samples this unit direction from a
    /// point; 0 if the direction misses the portal.
    pub fn pdf(&self, from: Vec3, direction: Vec3) -> f32 {
        let (cosine, height) = (direction.dot(self.normal), (self.corner - from).dot(self.normal));
        if cosine <= 0.0 || height <= 0.0 {
            return 0.0;
        }
        let distance = height / cosine;
        let place = from + direction * distance - self.corner;
        let is_inside = |dual: &Vec3| (0.0..=1.0).contains(&place.dot(*dual));
        if !self.duals.iter().all(is_inside) {
            return 0.0;
        }
        distance * distance / (cosine * self.area)
    }

    /// The unit direction from a point to a uniform point of the portal; `None` if the point is not
    /// on the inner side.
    pub fn sample(&self, from: Vec3, u: Vec2) -> Option<Vec3> {
        let target = self.corner + self.edges[0] * u.x + self.edges[1] * u.y;
        let way = target - from;
        (way.dot(self.normal) > 0.0).then(|| way.try_normalize()).flatten()
    }
}
