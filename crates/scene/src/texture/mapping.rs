//! Mappings from points on surfaces to the coordinates of patterns.

use crate::material::ShadingPoint;
use serde::{Deserialize, Serialize};
use snell_intersect::UV_SETS;
use snell_math::{DVec3, Vec2, Vec3, real};
use std::f32::consts::PI;

/// Rows of an affine map of points in space: `x' = m[0] . (x, y, z, 1)`, and so on.
pub type Rows = [[f64; 4]; 3];

/// The identity map.
pub const IDENTITY: Rows = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// Moves what an affine map of points in the world shows by a vector; given are rows of the map.
pub fn translate(rows: &mut [[f64; 4]], by: DVec3) {
    for [a, b, c, d] in rows {
        *d -= DVec3::new(*a, *b, *c).dot(by);
    }
}

/// A point in the space of a three-dimensional pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpacePoint {
    /// Coordinates in the pattern's space; always finite.
    pub p: Vec3,
    /// Extent of the filter footprint along each axis; not negative, 0 for no filtering.
    pub width: Vec3,
}

impl SpacePoint {
    /// The point in a pattern's space that belongs to a point in the world.
    ///
    /// Patterns are fixed in the world: an object that moves passes through them as if it were
    /// carved anew from a solid block, as in pbrt.
    pub fn new(point: &ShadingPoint, texture_from_world: &Rows) -> Self {
        let [x, y, z] = point.surface.position.to_array().map(f64::from);
        let p = texture_from_world.map(|[a, b, c, d]| a * x + b * y + c * z + d);
        let width = texture_from_world.map(|[a, b, c, _]| (a * a + b * b + c * c).sqrt());
        let finite = |x: f64| if (x as f32).is_finite() { x as f32 } else { 0.0 };
        let reach = |x: f64| finite(x * f64::from(point.footprint)).max(0.0);
        Self { p: Vec3::from_array(p.map(finite)), width: Vec3::from_array(width.map(reach)) }
    }
}

/// A point in the plane of a two-dimensional pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanePoint {
    /// Coordinates `(s, t)`, where `t` grows upwards; always finite.
    pub st: Vec2,
    /// Extent of the filter footprint along each axis; not negative, 0 for no filtering.
    pub width: Vec2,
}

snell_math::declare! {
    /// Map from a point to the coordinates `(s, t)` of a pattern. The kinds are those of pbrt
    /// (Pharr, Jakob, Humphreys, Physically Based Rendering, 4th edition, section 10.2).
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub enum Mapping {
        /// Texture coordinates of the surface, after an affine map.
        "uv" => Uv {
            /// Number of the set of texture coordinates: 0 to 3.
            #[serde(default)]
            uv_set: u32,
            /// Rows of the affine map: `s = m[0] . (u, v, 1)`, and `t` likewise with `m[1]`. `v`
            /// grows downwards, as in images.
            uv_transform: [[f32; 3]; 2],
        },
        /// Spherical coordinates of a space: `s` is the angle from its z axis divided by pi, and
        /// `t` the angle about the z axis divided by 2 pi, from 0 to 1.
        "spherical" => Spherical {
            /// Rows of the affine map from the world to the space.
            texture_from_world: Rows,
        },
        /// Cylindrical coordinates of a space: `s` is the angle about its z axis, from 0 to 1, and
        /// `t` the height along the z axis.
        "cylindrical" => Cylindrical {
            /// Rows of the affine map from the world to the space.
            texture_from_world: Rows,
        },
        /// Two affine functions of the position in the world.
        "planar" => Planar {
            /// Rows of the affine map: `s = m[0] . (x, y, z, 1)`, and `t` likewise with `m[1]`.
            st_from_world: [[f64; 4]; 2],
        },
    }
}

impl Default for Mapping {
    /// The mapping `(u, 1 - v)`, which shows the pattern upright and once over the surface.
    fn default() -> Self {
        Self::upright([1.0, 1.0], [0.0, 0.0])
    }
}

impl Mapping {
    /// The scaled and shifted texture coordinates of the surface, upright:
    /// `(scale u + offset, scale (1 - v) + offset)`.
    pub fn upright([su, sv]: [f32; 2], [du, dv]: [f32; 2]) -> Self {
        Self::Uv { uv_set: 0, uv_transform: [[su, 0.0, du], [0.0, -sv, sv + dv]] }
    }

    /// True if the mapping depends on the texture coordinates of the surface only.
    pub fn is_on_surface(&self) -> bool {
        matches!(self, Self::Uv { .. })
    }

    /// Moves what is mapped by a vector in the world.
    pub fn translate(&mut self, by: DVec3) {
        match self {
            Self::Uv { .. } => {}
            Self::Spherical { texture_from_world } | Self::Cylindrical { texture_from_world } => {
                translate(texture_from_world, by);
            }
            Self::Planar { st_from_world } => translate(st_from_world, by),
        }
    }

    /// Mappings for tests.
    pub fn examples() -> Vec<Self> {
        let planar = Self::Planar { st_from_world: [[0.5, 0.0, 0.0, 0.25], [0.0, 0.5, 1.0, 0.0]] };
        let [spherical, cylindrical] = [
            Self::Spherical { texture_from_world: IDENTITY },
            Self::Cylindrical { texture_from_world: IDENTITY },
        ];
        vec![
            Self::default(),
            Self::upright([4.0, -2.0], [0.5, 0.25]),
            spherical,
            cylindrical,
            planar,
        ]
    }

    /// The coordinates of the pattern at a point, with the filter footprint.
    pub fn at(&self, point: &ShadingPoint) -> PlanePoint {
        let (st, width) = match self {
            Self::Uv { uv_set, uv_transform } => on_surface(point, *uv_set, uv_transform),
            Self::Spherical { texture_from_world } => {
                let SpacePoint { p, width } = SpacePoint::new(point, texture_from_world);
                let (across, reach, distance) =
                    (p.truncate().length(), width.max_element(), p.length());
                let st = Vec2::new(real::atan2(across, p.z) / PI, turn(p));
                (st, Vec2::new(reach / (PI * distance), reach / (2.0 * PI * across)))
            }
            Self::Cylindrical { texture_from_world } => {
                let SpacePoint { p, width } = SpacePoint::new(point, texture_from_world);
                let around = width.max_element() / (2.0 * PI * p.truncate().length());
                (Vec2::new((turn(p) + 0.5).fract(), p.z), Vec2::new(around, width.z))
            }
            Self::Planar { st_from_world: [s, t] } => {
                let SpacePoint { p, width } = SpacePoint::new(point, &[*s, *t, [0.0; 4]]);
                (p.truncate(), width.truncate())
            }
        };
        let st = if st.is_finite() { st } else { Vec2::ZERO };
        // Widths are infinite at the poles, where the footprint covers everything.
        let bounded = |w: f32| crate::bsdf::bounded(w, 1e9);
        PlanePoint { st, width: Vec2::new(bounded(width.x), bounded(width.y)) }
    }
}

/// The angle about the z axis as a fraction of a turn, from 0 to 1, counter-clockwise from the x
/// axis.
fn turn(p: Vec3) -> f32 {
    let turn = real::atan2(p.y, p.x) / (2.0 * PI);
    if turn < 0.0 { turn + 1.0 } else { turn }
}

fn on_surface(
    point: &ShadingPoint,
    uv_set: u32,
    [[a, b, c], [d, e, f]]: &[[f32; 3]; 2],
) -> (Vec2, Vec2) {
    let surface = point.surface;
    let uv = surface.uv[(uv_set as usize).min(UV_SETS - 1)];
    let st = Vec2::new(a * uv.x + b * uv.y + c, d * uv.x + e * uv.y + f);
    if point.footprint == 0.0 {
        return (st, Vec2::ZERO);
    }
    let reach = Vec2::new(surface.dpdu.length(), surface.dpdv.length())
        .map(|length| point.footprint / length);
    (st, Vec2::new(a.abs() * reach.x + b.abs() * reach.y, d.abs() * reach.x + e.abs() * reach.y))
}
