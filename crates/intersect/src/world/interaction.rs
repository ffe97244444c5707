//! Computes the surface interaction of a hit.

use super::double::DWorld;
use super::{Geometry, GeometryId, GroupId, World, abs_matrix};
use crate::hit::{DHit, DSurfacePoint, Hit, SurfaceInteraction, SurfacePoint};
use crate::mesh::{TriangleMesh, UV_SETS};
use crate::precision::Double;
use crate::search::rays::{RayQuery, clamped_time};
use crate::shape::ShapeSurface;
use snell_math::{DRay, DVec2, DVec3, Frame, Ray, Transform, Vec2, Vec3};

/// A generous bound on the relative error of a mapped coordinate in `f64` (four products, three
/// sums).
pub(super) const MAP_ERROR: f64 = 1.0 / (1u64 << 49) as f64;

/// A surface point in the coordinates of a group, mapped from group to group until it is in the
/// world's.
struct LocalSurface {
    position: DVec3,
    /// Bound on the error of each coordinate of the position, and of the origin of the next ray
    /// when it is transformed back to this group.
    error: DVec3,
    normal: DVec3,
    shading_normal: DVec3,
    dpdu: DVec3,
    dpdv: DVec3,
    tangent: Option<(DVec3, f32)>,
    uv: [Vec2; UV_SETS],
    color: [f32; 4],
    on_curve: bool,
}

impl LocalSurface {
    /// The surface in the coordinates of the parent group.
    #[inline(always)]
    fn mapped(self, map: &Transform) -> Self {
        let (m, inverse) = (map.matrix(), map.inverse_matrix());
        let grow = abs_matrix(&m.matrix3);
        let position = map.point(self.position);
        let up = (grow * self.position.abs() + m.translation.abs()) * MAP_ERROR;
        // The error that the origin of the next ray gets in this group, mapped to the parent.
        let down =
            (abs_matrix(&inverse.matrix3) * position.abs() + inverse.translation.abs()) * MAP_ERROR;
        Self {
            position,
            error: grow * (self.error + down) + up,
            normal: map.normal(self.normal).normalize_or(DVec3::Z),
            shading_normal: map.normal(self.shading_normal).normalize_or_zero(),
            dpdu: map.vector(self.dpdu),
            dpdv: map.vector(self.dpdv),
            tangent: self
                .tangent
                .map(|(t, sign)| (map.vector(t), if map.is_mirrored() { -sign } else { sign })),
            ..self
        }
    }
}

impl World {
    /// The surface interaction at `hit`, which `ray` found; a ray with a time if anything moves.
    ///
    /// Positions are computed in `f64`, from the barycentrics of triangles or by moving the point
    /// onto the shape. The error bound covers the transformation of the point to the world, and
    /// that of the next ray's origin from the world back to the geometry's coordinates (the idea of
    /// Wächter and Binder, A Fast and Robust Method for Avoiding Self-Intersection, Ray Tracing
    /// Gems 2019; the bounds as in Pharr, Jakob and Humphreys, 4th edition, section 6.8).
    ///
    /// # Panics
    /// If `hit` is a miss or does not belong to this world.
    pub fn interaction<'a>(&self, ray: impl Into<RayQuery<'a>>, hit: &Hit) -> SurfaceInteraction {
        self.surface(ray.into(), hit)
    }

    /// The part of [`Self::interaction`] that is needed to spawn rays, without the parts that only
    /// materials need. On triangles it takes half the time.
    ///
    /// # Panics
    /// If `hit` is a miss or does not belong to this world.
    pub fn point<'a>(&self, ray: impl Into<RayQuery<'a>>, hit: &Hit) -> SurfacePoint {
        let query = ray.into();
        // After inlining, the unused fields are not computed.
        self.shape_point(query.ray, hit)
            .unwrap_or_else(|| SurfacePoint::from(&self.surface(query, hit)))
    }

    /// Computes [`Self::point`] for a hit on an analytic shape that is not instanced, where the
    /// shading normal equals the geometric normal; `None` for all other hits.
    pub fn shape_point(&self, ray: &Ray, hit: &Hit) -> Option<SurfacePoint> {
        if self.step(GroupId(0), hit.instance).is_some() {
            return None;
        }
        let Geometry::Shape(shape, placed) = self.geometry(GeometryId(hit.geometry)) else {
            return None;
        };
        let position = placed.inverse().ray(&DRay::from(ray)).at(hit.t.into());
        let (position, normal) = shape.normal(position, hit.primitive);
        let local = ShapeSurface { position, normal, ..ShapeSurface::bare() };
        Some(SurfacePoint::from(&in_world(shape_surface(local).mapped(placed), hit)))
    }

    #[inline(always)]
    fn surface(&self, RayQuery { ray, time, .. }: RayQuery, hit: &Hit) -> SurfaceInteraction {
        // The most common case has a separate path that stays in registers.
        if let (None, Geometry::Mesh(mesh)) =
            (self.step(GroupId(0), hit.instance), self.geometry(GeometryId(hit.geometry)))
        {
            return in_world(triangle_surface(mesh, &ray.direction.as_dvec3(), hit), hit);
        }
        in_world(
            self.surface_in_group(
                GroupId(0),
                hit.instance,
                &DRay::from(ray),
                clamped_time(time),
                hit,
            ),
            hit,
        )
    }

    /// The surface in the coordinates of `group`, for the occurrence numbered `rest` relative to
    /// it. `ray` is in the same coordinates.
    fn surface_in_group(
        &self,
        group: GroupId,
        rest: u32,
        ray: &DRay,
        time: f32,
        hit: &Hit,
    ) -> LocalSurface {
        if let Some((step, left)) = self.step(group, rest) {
            let instance = &self.group(group).instances[step];
            let map = instance.at(time);
            return self
                .surface_in_group(instance.child, left, &map.inverse().ray(ray), time, hit)
                .mapped(&map);
        }
        geometry_surface(self.geometry(GeometryId(hit.geometry)), ray, time, hit)
    }
}

impl DWorld {
    /// The point at `hit`, which `ray` found, with what is needed to spawn rays; see
    /// [`World::point`].
    ///
    /// # Panics
    /// If `hit` is a miss or does not belong to this world.
    pub fn point<'a>(&self, ray: impl Into<RayQuery<'a, Double>>, hit: &DHit) -> DSurfacePoint {
        let RayQuery { ray, time, .. } = ray.into();
        let LocalSurface { position, error, normal, .. } =
            self.point_in_group(GroupId(0), hit.instance, ray, clamped_time(time), hit);
        DSurfacePoint { position, position_error: error, geometric_normal: normal }
    }

    /// The point in the coordinates of `group`; see [`World::surface_in_group`].
    fn point_in_group(
        &self,
        group: GroupId,
        rest: u32,
        ray: &DRay,
        time: f32,
        hit: &DHit,
    ) -> LocalSurface {
        if let Some((step, left)) = self.world.step(group, rest) {
            let instance = &self.world.group(group).instances[step];
            let map = instance.at(time);
            return self
                .point_in_group(instance.child, left, &map.inverse().ray(ray), time, hit)
                .mapped(&map);
        }
        let place = ray.at(hit.t);
        match self.world.geometry(GeometryId(hit.geometry)) {
            Geometry::Heightfield(field) => {
                let corners = field.corners(hit.primitive as usize).unwrap_or_default();
                let weights = [1.0 - hit.uv.x - hit.uv.y, hit.uv.x, hit.uv.y];
                let (position, error, normal) = on_triangle(&corners, weights, &ray.direction);
                let flat = ShapeSurface { position, normal, ..ShapeSurface::bare() };
                LocalSurface { error, ..shape_surface(flat) }
            }
            Geometry::Mesh(_) => {
                let corners = self.data.corners(hit.geometry, hit.primitive);
                let weights = [1.0 - hit.uv.x - hit.uv.y, hit.uv.x, hit.uv.y];
                let (position, error, normal) = on_triangle(corners, weights, &ray.direction);
                let flat = ShapeSurface { position, normal, ..ShapeSurface::bare() };
                LocalSurface { error, ..shape_surface(flat) }
            }
            Geometry::Shape(shape, placed) => {
                let position = placed.inverse().ray(ray).at(hit.t);
                let (position, normal) = shape.normal(position, hit.primitive);
                shape_surface(ShapeSurface { position, normal, ..ShapeSurface::bare() })
                    .mapped(placed)
            }
            Geometry::Set(set) => {
                shape_surface(set.surface(hit.primitive as usize, place, hit.uv.as_vec2(), time))
            }
            other => {
                let &DHit { t, uv, instance, geometry, primitive } = hit;
                let hit = Hit { t: t as f32, uv: uv.as_vec2(), instance, geometry, primitive };
                geometry_surface(other, ray, time, &hit)
            }
        }
    }
}

impl ShapeSurface {
    /// A surface without texture coordinates and tangents, to be filled.
    const fn bare() -> Self {
        let nothing = DVec3::ZERO;
        Self { position: nothing, normal: nothing, uv: DVec2::ZERO, dpdu: nothing, dpdv: nothing }
    }
}

/// The surface interaction on a geometry at a hit of a ray; the ray and the interaction are in the
/// world. For callers that keep geometries of their own, such as meshes with more attributes than
/// those of the world that was queried.
pub fn interaction_on(
    geometry: &Geometry,
    world_from_group: &Transform,
    ray: &DRay,
    hit: &Hit,
) -> SurfaceInteraction {
    let inside = world_from_group.inverse().ray(ray);
    in_world(geometry_surface(geometry, &inside, 0.0, hit).mapped(world_from_group), hit)
}

/// The surface of a geometry in the coordinates of its group; `ray` is in the same coordinates.
fn geometry_surface(geometry: &Geometry, ray: &DRay, time: f32, hit: &Hit) -> LocalSurface {
    match geometry {
        Geometry::Mesh(mesh) => triangle_surface(mesh, &ray.direction, hit),
        Geometry::Quads(quads) => {
            triangle_surface(quads.triangles(), &ray.direction, &quads.triangle_hit(hit))
        }
        Geometry::MovingMesh(mesh) => {
            let alone = mesh.triangle_at(hit.primitive as usize, time);
            triangle_surface(&alone, &ray.direction, &Hit { primitive: 0, ..*hit })
        }
        Geometry::Heightfield(field) => {
            let alone = field.triangle_alone(hit.primitive as usize);
            triangle_surface(&alone, &ray.direction, &Hit { primitive: 0, ..*hit })
        }
        Geometry::Shape(shape, placed) => {
            let position = placed.inverse().ray(ray).at(hit.t.into());
            shape_surface(shape.surface(position, hit.primitive)).mapped(placed)
        }
        Geometry::Set(set) => {
            let (primitive, position) = (hit.primitive as usize, ray.at(hit.t.into()));
            LocalSurface {
                color: set.color(primitive, hit.uv),
                on_curve: set.is_curve(),
                ..shape_surface(set.surface(primitive, position, hit.uv, time))
            }
        }
    }
}

/// Converts the surface, which must be in world space, to single precision with a single rounding.
#[inline(always)]
fn in_world(local: LocalSurface, hit: &Hit) -> SurfaceInteraction {
    let (position, position_error) = rounded(local.position, local.error);
    let geometric_normal = unit(local.normal).unwrap_or(Vec3::Z);
    let shading_normal = match unit(local.shading_normal) {
        Some(n) if n.dot(geometric_normal) < 0.0 => -n,
        Some(n) => n,
        None => geometric_normal,
    };
    let (dpdu, dpdv) = (local.dpdu.as_vec3(), local.dpdv.as_vec3());
    let (dpdu, dpdv) = spanning(dpdu, dpdv, shading_normal);
    SurfaceInteraction {
        position,
        position_error,
        geometric_normal,
        shading_normal,
        uv: local.uv,
        dpdu,
        dpdv,
        tangent: local.tangent.and_then(|(t, sign)| Some((unit(t)?, sign))),
        color: local.color,
        on_curve: local.on_curve,
        t: hit.t,
        primitive_uv: hit.uv,
        instance: hit.instance,
        geometry: hit.geometry,
        primitive: hit.primitive,
    }
}

/// The position in single precision, and a bound on its error that includes the error of this
/// rounding.
fn rounded(position: DVec3, error: DVec3) -> (Vec3, Vec3) {
    let limit = DVec3::splat(f32::MAX.into());
    let single = position.clamp(-limit, limit).as_vec3();
    let error = ((position - single.as_dvec3()).abs() + error).min(limit).as_vec3();
    (single, error.map(f32::next_up))
}

fn unit(v: DVec3) -> Option<Vec3> {
    v.try_normalize().map(|n| n.as_vec3())
}

#[inline(always)]
fn shape_surface(surface: ShapeSurface) -> LocalSurface {
    let size = surface.position.abs().max_element();
    let uv = surface.uv.as_vec2();
    LocalSurface {
        position: surface.position,
        // Shapes are accurate to a few roundings of the largest coordinate.
        error: DVec3::splat(size * 4.0 * MAP_ERROR),
        normal: surface.normal,
        shading_normal: surface.normal,
        dpdu: surface.dpdu,
        dpdv: surface.dpdv,
        tangent: None,
        uv: [uv; UV_SETS],
        color: [1.0; 4],
        on_curve: false,
    }
}

#[inline(always)]
fn triangle_surface(mesh: &TriangleMesh, direction: &DVec3, hit: &Hit) -> LocalSurface {
    let triangle = hit.primitive as usize;
    let indices = mesh.indices[triangle].map(|i| i as usize);
    let p = indices.map(|i| mesh.positions[i].as_dvec3());
    let (b1, b2) = (f64::from(hit.uv.x), f64::from(hit.uv.y));
    let b = [1.0 - b1 - b2, b1, b2];
    let single = b.map(|x| x as f32);
    let (position, error, normal) = on_triangle(&p, b, direction);
    let blend =
        |v: &[Vec3]| indices.iter().zip(b).map(|(&i, b)| v[i].as_dvec3() * b).sum::<DVec3>();
    let uv = |v: &[Vec2]| indices.iter().zip(single).map(|(&i, b)| v[i] * b).sum::<Vec2>();
    let present = |v: &[Vec2]| if v.is_empty() { Vec2::ZERO } else { uv(v) };
    let (dpdu, dpdv) = if mesh.uvs[0].is_empty() {
        (DVec3::ZERO, DVec3::ZERO)
    } else {
        derivatives(&p, indices.map(|i| mesh.uvs[0][i].as_dvec2()), normal)
    };
    let tangent = || {
        let direction =
            indices.iter().zip(b).map(|(&i, b)| mesh.tangents[i].truncate().as_dvec3() * b).sum();
        (direction, if mesh.tangents[indices[0]].w < 0.0 { -1.0 } else { 1.0 })
    };
    let color = || {
        std::array::from_fn(|c| {
            indices.iter().zip(single).map(|(&i, b)| mesh.colors[i][c] * b).sum()
        })
    };
    LocalSurface {
        position,
        error,
        normal,
        shading_normal: if mesh.normals.is_empty() { normal } else { blend(&mesh.normals) },
        dpdu,
        dpdv,
        tangent: (!mesh.tangents.is_empty()).then(tangent),
        uv: mesh.uvs.each_ref().map(|set| present(set)),
        color: if mesh.colors.is_empty() { [1.0; 4] } else { color() },
        on_curve: false,
    }
}

/// The point of a triangle with these barycentrics, a bound on its error, and the unit normal.
#[inline(always)]
fn on_triangle(p: &[DVec3; 3], b: [f64; 3], direction: &DVec3) -> (DVec3, DVec3, DVec3) {
    let normal = (p[1] - p[0])
        .cross(p[2] - p[0])
        .try_normalize()
        .unwrap_or_else(|| line_normal(p, direction));
    // The next ray's distance to the plane is found in `f64` from these corners.
    let size = p.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    (p[0] * b[0] + p[1] * b[1] + p[2] * b[2], DVec3::splat(size * 4.0 * MAP_ERROR), normal)
}

/// A substitute for the normal of three collinear vertices: perpendicular to their line, on the
/// side of the ray's origin.
fn line_normal(p: &[DVec3; 3], direction: &DVec3) -> DVec3 {
    let edges = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
    let longest = edges
        .into_iter()
        .fold(DVec3::ZERO, |a, b| if b.length_squared() > a.length_squared() { b } else { a });
    let across = longest.cross(longest.cross(*direction)).try_normalize();
    across.unwrap_or_else(|| -direction.normalize_or(DVec3::NEG_Z))
}

/// The given derivatives, or arbitrary tangents if the derivatives are degenerate.
#[inline(always)]
pub(super) fn spanning(dpdu: Vec3, dpdv: Vec3, shading_normal: Vec3) -> (Vec3, Vec3) {
    let usable = |v: Vec3| {
        let is_finite =
            (v.x.abs() < f32::INFINITY) & (v.y.abs() < f32::INFINITY) & (v.z.abs() < f32::INFINITY);
        is_finite & ((v.x != 0.0) | (v.y != 0.0) | (v.z != 0.0))
    };
    let are_usable = usable(dpdu) & usable(dpdv);
    let frame = Frame::from_z(shading_normal);
    let either = |a: Vec3, b: Vec3| {
        let one = |a: f32, b: f32| if are_usable { a } else { b };
        Vec3::new(one(a.x, b.x), one(a.y, b.y), one(a.z, b.z))
    };
    (either(dpdu, frame.x), either(dpdv, frame.y))
}

/// Derivatives of the position by the texture coordinates (Pharr, Jakob and Humphreys, 4th edition,
/// section 6.5.2); zero where the coordinates do not span a plane. The function has no branches, so
/// that loops over it are vectorised.
#[inline(always)]
pub(super) fn derivatives(p: &[DVec3; 3], uv: [DVec2; 3], normal: DVec3) -> (DVec3, DVec3) {
    let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
    let (t1, t2) = (uv[1] - uv[0], uv[2] - uv[0]);
    let determinant = t1.perp_dot(t2);
    let dpdu = (e1 * t2.y - e2 * t1.y) / determinant;
    let dpdv = (e2 * t1.x - e1 * t2.x) / determinant;
    // `dpdu` and `dpdv` lie in the plane of the triangle and must span it.
    let [u_scale, v_scale] = [1.0 / dpdu.length(), 1.0 / dpdv.length()];
    let has_length = |scale: f64| (scale > 0.0) & (scale < f64::INFINITY);
    let spans = (dpdu * u_scale).dot((dpdv * v_scale).cross(normal)).abs() > 1e-9;
    let exist = (determinant != 0.0) & spans & has_length(u_scale) & has_length(v_scale);
    let kept = |v: DVec3| {
        let one = |x: f64| if exist { x } else { 0.0 };
        DVec3::new(one(v.x), one(v.y), one(v.z))
    };
    (kept(dpdu), kept(dpdv))
}
