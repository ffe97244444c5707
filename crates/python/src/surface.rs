//! The surface at a hit: position, normals and texture coordinates, in double precision even if the
//! hit is in single precision.

use crate::assemble::{Form, Snapshot, Surface};
use crate::mesh::Mesh;
use crate::precision::{Found, Precision};
use snell_intersect::{PrimitiveSet, Shape};
use snell_math::{DRay, DVec2, DVec3, Transform, Vec2};

/// The local properties of a point of a surface, in world coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Local {
    /// The point in the world.
    pub position: DVec3,
    /// Unit normal of the surface itself, on its outer side (right-hand rule for triangles).
    pub geometric_normal: DVec3,
    /// Unit normal for shading, on the same side of the surface.
    pub normal: DVec3,
    /// Texture coordinates.
    pub uv: DVec2,
}

impl Local {
    /// The surface of a miss.
    pub const NONE: Self = Self {
        position: DVec3::NAN,
        geometric_normal: DVec3::ZERO,
        normal: DVec3::ZERO,
        uv: DVec2::ZERO,
    };
}

/// Computes surfaces at hits. It remembers the transform of the last occurrence, because
/// consecutive hits are often in one occurrence and at one time.
#[derive(Debug)]
pub struct Surfaces<'a, F: Form> {
    snapshot: &'a Snapshot<F>,
    occurrence: u32,
    time: f32,
    placed: Transform,
}

impl<'a, F: Form> Surfaces<'a, F> {
    /// Starts with no occurrence remembered.
    pub fn new(snapshot: &'a Snapshot<F>) -> Self {
        Self { snapshot, occurrence: 0, time: 0.0, placed: Transform::IDENTITY }
    }

    /// The surface at the hit `found` of `ray`, which has this time of the world.
    pub fn at<P: Precision>(&mut self, ray: &DRay, time: f32, found: &Found<P>) -> Local {
        let Some(surface) = self.snapshot.names.surfaces.get(found.geometry as usize) else {
            return Local::NONE;
        };
        if self.occurrence != found.occurrence || self.time != time {
            (self.occurrence, self.time) = (found.occurrence, time);
            self.placed = F::placed(&self.snapshot.world, found.occurrence, time);
        }
        let placed = &self.placed;
        let position = || placed.inverse().ray(ray).at(found.t.into());
        match surface {
            Surface::Mesh(mesh) => {
                on_mesh(mesh, &placed.inverse().vector(ray.direction), found).placed(placed)
            }
            Surface::Shape(shape, group_from_shape) => {
                let position = group_from_shape.inverse().point(position());
                let surface = shape.surface(position, found.primitive);
                Local::of(surface.position, surface.normal, surface.uv)
                    .placed(group_from_shape)
                    .placed(placed)
            }
            Surface::Spheres(spheres) => {
                let surface =
                    spheres.surface(found.primitive as usize, position(), Vec2::ZERO, 0.0);
                Local::of(surface.position, surface.normal, surface.uv).placed(placed)
            }
            Surface::Curves(curves) => {
                let [u, v] = found.uv.map(|x| Into::<f64>::into(x) as f32);
                let surface =
                    curves.surface(found.primitive as usize, position(), Vec2::new(u, v), 0.0);
                Local::of(surface.position, surface.normal, surface.uv).placed(placed)
            }
            Surface::Gone => Local::NONE,
        }
    }
}

impl Local {
    fn of(position: DVec3, normal: DVec3, uv: DVec2) -> Self {
        Self { position, geometric_normal: normal, normal, uv }
    }

    fn placed(self, map: &Transform) -> Self {
        if map.is_identity() {
            return self;
        }
        let geometric_normal = map.normal(self.geometric_normal).normalize_or(DVec3::Z);
        let normal = map.normal(self.normal).normalize_or(geometric_normal);
        Self { position: map.point(self.position), geometric_normal, normal, ..self }
    }
}

/// The surface of a mesh, in its coordinates.
fn on_mesh<P: Precision>(mesh: &Mesh, direction: &DVec3, found: &Found<P>) -> Local {
    let p = mesh.corners(found.primitive as usize);
    let [b1, b2] = found.uv.map(Into::into);
    let b = [1.0 - b1 - b2, b1, b2];
    let indices = mesh.indices()[found.primitive as usize].map(|i| i as usize);
    let position = p[0] * b[0] + p[1] * b[1] + p[2] * b[2];
    let normal = (p[1] - p[0])
        .cross(p[2] - p[0])
        .try_normalize()
        .unwrap_or_else(|| line_normal(&p, direction));
    let mut local = Local::of(position, normal, DVec2::ZERO);
    let attributes = mesh.attributes();
    if !attributes.normals.is_empty() {
        let blend: DVec3 =
            indices.iter().zip(b).map(|(&i, b)| attributes.normals[i].as_dvec3() * b).sum();
        let blend = blend.normalize_or(normal);
        local.normal = if blend.dot(normal) < 0.0 { -blend } else { blend };
    }
    if !attributes.uvs.is_empty() {
        local.uv = indices.iter().zip(b).map(|(&i, b)| attributes.uvs[i].as_dvec2() * b).sum();
    }
    local
}

/// The normal of a degenerate triangle: perpendicular to the line of the triangle, on the side of
/// the ray's origin.
fn line_normal(p: &[DVec3; 3], direction: &DVec3) -> DVec3 {
    let edges = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
    let longest = edges
        .into_iter()
        .fold(DVec3::ZERO, |a, b| if b.length_squared() > a.length_squared() { b } else { a });
    let across = longest.cross(longest.cross(*direction)).try_normalize();
    across.unwrap_or_else(|| -direction.normalize_or(DVec3::NEG_Z))
}
