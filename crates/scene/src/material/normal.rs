//! Shading normals: normal maps, and corrections of normals that face away from the viewer.

use super::{Bitangent, BumpMap, NormalMap, ShadingPoint};
use crate::bsdf::{Bsdf, Lobes, fresnel, unit_or};
use snell_math::simd::{min, select};
use snell_math::{Frame, Vec3, real};

/// The frame of the shading normal with maps applied, on the side of the geometric normal.
pub(super) fn shading_frame(
    map: Option<&NormalMap>,
    bumps: Option<&BumpMap>,
    point: &ShadingPoint,
) -> Frame {
    let surface = point.surface;
    let smooth = surface.shading_normal;
    let Some(bend) = Bend::of(map, bumps, point) else {
        return Frame::from_z_and_x(smooth, surface.dpdu);
    };
    Frame::from_z_and_x(bend.normal(smooth, surface.geometric_normal), bend.axes(smooth).0)
}

/// The combined result of a normal map and a bump map at a point.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bend {
    /// The normal in the frame of tangent, bitangent and shading normal, of any length.
    pub local: Vec3,
    /// The direction along the rows of the image, to the right.
    pub tangent: Vec3,
    /// The upward direction of the image's columns, used where it does not follow from the tangent.
    pub upwards: Vec3,
    /// 1 if the bitangent is to the left of the tangent, -1 if it is to the right, 0 if it is along
    /// `upwards`.
    pub side: f32,
}

impl Bend {
    /// Evaluates the maps at a point; `None` if there are none. Bumps are applied on top of the
    /// normal map.
    #[inline]
    pub(super) fn of(
        map: Option<&NormalMap>,
        bumps: Option<&BumpMap>,
        point: &ShadingPoint,
    ) -> Option<Self> {
        match (map, bumps) {
            (map, None) => map.map(|map| Self::of_normals(map, point)),
            (map, Some(bumps)) => Some(Self::of_bumps(bumps, map, point)),
        }
    }

    /// Evaluates a bump map, whose slopes are added to those of the normal map.
    #[inline(never)]
    fn of_bumps(bumps: &BumpMap, map: Option<&NormalMap>, point: &ShadingPoint) -> Self {
        let plain =
            Self { local: Vec3::Z, tangent: point.surface.dpdu, upwards: Vec3::ZERO, side: 1.0 };
        let below = map.map_or(plain, |map| Self::of_normals(map, point));
        let (tangent, bitangent) = below.axes(point.surface.shading_normal);
        let uphill = bumps.gradient(point);
        let flat = below.local / below.local.z.max(1e-3);
        Self {
            local: Vec3::new(flat.x - uphill.dot(tangent), flat.y - uphill.dot(bitangent), 1.0),
            ..below
        }
    }

    fn of_normals(map: &NormalMap, point: &ShadingPoint) -> Self {
        let [r, g, b, _] = point.textures.lookup(map.texture, point.surface, point.footprint);
        let local =
            Vec3::new((2.0 * r - 1.0) * map.scale, (2.0 * g - 1.0) * map.scale, 2.0 * b - 1.0);
        let surface = point.surface;
        let crossed = |side| Self { local, tangent: surface.dpdu, upwards: Vec3::ZERO, side };
        match map.bitangent {
            Bitangent::Upwards => {}
            Bitangent::Crossed => return crossed(1.0),
            Bitangent::CrossedMirrored => return crossed(-1.0),
        }
        let transform = point.textures.image(map.texture).map(|t| t.uv_transform);
        let [[a, b, _], [c, d, _]] = transform.unwrap_or([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let determinant = a * d - b * c;
        if let Some((tangent, sign)) = surface.tangent {
            let side = 1.0f32.copysign(sign);
            let plain = Self { local, tangent, upwards: Vec3::ZERO, side };
            let keeps = (b == 0.0) & (c == 0.0) & (a > 0.0) & (d > 0.0);
            if keeps || !determinant.is_normal() {
                return plain;
            }
            // The stored tangents are those of the mesh's coordinates: they turn with the picture.
            let right = tangent * surface.dpdu.length();
            let up = surface.shading_normal.cross(tangent) * side * surface.dpdv.length();
            let tangent = (right * d + up * c) / determinant;
            return Self { tangent, side: side.copysign(side * determinant), ..plain };
        }
        // Derivatives by the texture's own coordinates, its transform undone; a singular one leaves
        // the surface's.
        let (dpdu, dpdv) = if determinant.is_normal() {
            (
                (surface.dpdu * d - surface.dpdv * c) / determinant,
                (surface.dpdv * a - surface.dpdu * b) / determinant,
            )
        } else {
            (surface.dpdu, surface.dpdv)
        };
        // Texture coordinates run down the image, whereas normal maps point up.
        Self { local, tangent: dpdu, upwards: -dpdv, side: 0.0 }
    }

    /// Unit tangent and bitangent perpendicular to the shading normal.
    #[inline(always)]
    fn axes(&self, n: Vec3) -> (Vec3, Vec3) {
        let frame = Frame::from_z_and_x(n, self.tangent);
        let side = if frame.y.dot(self.upwards) < 0.0 { -1.0 } else { 1.0 };
        (frame.x, frame.y * if self.side != 0.0 { self.side } else { side })
    }

    /// The perturbed shading normal, lifted to a small angle above the surface if it lies below. It
    /// has no branches, so that loops over it become vector code.
    #[inline(always)]
    pub fn normal(&self, smooth: Vec3, geometric_normal: Vec3) -> Vec3 {
        const LEAST: f32 = 1e-2;
        let (tangent, bitangent) = self.axes(smooth);
        let bent = unit_or(
            tangent * self.local.x + bitangent * self.local.y + smooth * self.local.z,
            smooth,
        );
        let height = bent.dot(geometric_normal);
        select(height >= LEAST, bent, unit_or(bent + geometric_normal * (LEAST - height), smooth))
    }
}

/// The frame, rotated counter-clockwise about its normal by an angle in radians.
pub(super) fn turned(frame: Frame, angle: f32) -> Frame {
    if angle == 0.0 {
        return frame;
    }
    let (sin, cos) = real::sin_cos(angle);
    Frame { x: frame.x * cos + frame.y * sin, y: frame.y * cos - frame.x * sin, z: frame.z }
}

/// What a BSDF needs of its frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameNeeds {
    /// True if the normal must reflect the viewer away from the surface ([`reflecting_normal`]),
    /// false if it need only be visible ([`visible_normal`]).
    pub mirrors: bool,
    /// True if tangents matter. Otherwise the cheapest frame is used.
    pub has_tangent: bool,
}

impl FrameNeeds {
    /// The needs of a BSDF.
    pub fn of(bsdf: &Bsdf) -> Self {
        Self { mirrors: mirrors(bsdf), has_tangent: bsdf.has_tangent() }
    }

    /// The valid frame for `wo` that is closest to the plain one. It has no branches, so that loops
    /// over it become vector code.
    #[inline(always)]
    pub fn frame(self, plain: &Frame, geometric_normal: Vec3, wo: Vec3) -> Frame {
        let z = select(
            self.mirrors,
            reflecting_normal(plain.z, geometric_normal, wo),
            visible_normal(plain.z, geometric_normal, wo),
        );
        let is_bent = (z.x != plain.z.x) | (z.y != plain.z.y) | (z.z != plain.z.z);
        let with_tangent = Frame::from_z_and_x(z, plain.x).or(plain, is_bent);
        with_tangent.or(&Frame::from_z(z), self.has_tangent)
    }
}

/// True for BSDFs dominated by reflection, for which losing reflections below the surface is worse
/// than bending the normal.
fn mirrors(bsdf: &Bsdf) -> bool {
    let by_kind = match bsdf {
        Bsdf::Conductor(_) | Bsdf::Dielectric(_) => true,
        Bsdf::OpenPbr(layers) => layers.mirrors(),
        _ => false,
    };
    by_kind || bsdf.is_delta()
}

/// The normal closest to `n` that is valid for `wo`: by [`reflecting_normal`] for mirrors, by
/// [`visible_normal`] for others.
pub(super) fn valid_towards(n: Vec3, geometric_normal: Vec3, wo: Vec3, mirrors: bool) -> Vec3 {
    if mirrors {
        reflecting_normal(n, geometric_normal, wo)
    } else {
        visible_normal(n, geometric_normal, wo)
    }
}

/// A normal close to `n` that `wo` sees from the same side as the surface, and that reflects `wo`
/// to that side too. The idea is that of Keller et al., The Iray Light Transport Simulation and
/// Rendering System, 2017: pull the reflected vector up to the surface, and take the half vector.
/// It has no branches, so that loops over it become vector code.
#[inline(always)]
pub fn reflecting_normal(n: Vec3, geometric_normal: Vec3, wo: Vec3) -> Vec3 {
    let side = if wo.dot(geometric_normal) < 0.0 { -1.0 } else { 1.0 };
    let (n_up, ng) = (n * side, geometric_normal * side);
    let elevation = wo.dot(ng);
    let lowest = min(0.9 * elevation, 0.01);
    let reflected = fresnel::reflect(wo, n_up);
    let height = reflected.dot(ng);
    let flat = unit_or(reflected - ng * height, Vec3::ZERO) * (1.0 - lowest * lowest).sqrt();
    let bent = unit_or(wo + flat + ng * lowest, ng) * side;
    let keeps = (elevation <= 0.0) | ((height >= lowest) & (wo.dot(n_up) > 0.0));
    select(keeps, n, bent)
}

/// A normal close to `n` that `wo` sees from the same side as the surface. It has no branches, so
/// that loops over it become vector code.
#[inline(always)]
pub fn visible_normal(n: Vec3, geometric_normal: Vec3, wo: Vec3) -> Vec3 {
    let elevation = wo.dot(geometric_normal);
    let side = if elevation < 0.0 { -1.0 } else { 1.0 };
    let (n_up, ng, elevation) = (n * side, geometric_normal * side, elevation * side);
    let lowest = min(0.9 * elevation, 0.01);
    let seen = wo.dot(n_up);
    let lifted = n_up + wo * (lowest - seen);
    let keeps = (elevation <= 0.0) | (seen >= lowest);
    select(keeps, n, unit_or(lifted, ng) * side)
}
