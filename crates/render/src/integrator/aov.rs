//! Arbitrary output variables: what the first hit is, apart from its light.

use super::first_surface::FirstSurface;
use super::light_part::{LightPart, Lobe, Scatterings};
use super::{Context, motion, outgoing};
use snell_intersect::Hit;
use snell_math::{Ray, Rgb};
use snell_scene::Camera;

/// How the samples of a pixel make its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AovKind {
    /// Their mean.
    Averaged,
    /// The first sample's value: for ids, of which a mean means nothing.
    First,
    /// What the film knows of the pixel, not the samples.
    OfFilm,
    /// Which share of them has which value, see [`crate::Film::coverage`]. No layer by itself.
    Coverage,
}

/// What a camera ray has hit.
#[derive(Debug)]
pub struct FirstHit<'a> {
    /// The ray.
    pub ray: &'a Ray,
    /// What it has hit, if anything.
    pub hit: &'a Hit,
    /// When the ray is traced, from 0 to 1.
    pub time: f32,
    /// The surface that was hit, if any AOV [needs it](Aov::needs_surface).
    pub surface: Option<FirstSurface>,
    /// Nodes visited and primitives tested, if any AOV [needs them](Aov::needs_counters).
    pub counters: [u32; 2],
}

/// The key of a sample that nothing covers.
pub const NOTHING: u64 = u64::MAX;

/// An extra layer of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aov {
    /// Distance from the eye along the view direction, scene units; 0 where nothing is hit.
    Depth,
    /// Distance from the eye along the ray, scene units; 0 where nothing is hit.
    Distance,
    /// Position in the world.
    Position,
    /// Shading normal in the world (normal map not applied), on the outer side.
    Normal,
    /// Normal of the surface itself in the world, on the outer side.
    GeometricNormal,
    /// First texture coordinates.
    Uv,
    /// Share of light that the material reflects or transmits.
    Albedo,
    /// Number of the instance; -1 where nothing is hit.
    InstanceId,
    /// Number of the geometry; -1 where nothing is hit.
    GeometryId,
    /// Number of the triangle or face; -1 where nothing is hit.
    PrimitiveId,
    /// Number of the material; -1 where nothing is hit.
    MaterialId,
    /// Cosine between the ray and the geometric normal: positive on the outer side.
    Facing,
    /// Barycentric coordinates of the hit triangle.
    Barycentrics,
    /// Way over the picture of what is hit while the shutter is open, in pixels: to the right and
    /// down.
    Motion,
    /// Nodes of acceleration structures that the camera ray visited.
    NodesVisited,
    /// Triangles and shapes that the camera ray was tested against.
    PrimitivesTested,
    /// Error of the pixel: half of its 95 % confidence interval in tone-mapped units, see
    /// [`crate::film::noise`].
    Noise,
    /// Number of samples of the pixel.
    Samples,
    /// Which objects cover the pixel: for Cryptomatte.
    CryptoObject,
    /// Which materials cover the pixel: for Cryptomatte.
    CryptoMaterial,
    /// Some of the light. Only `path` and `direct` tell light apart; with other integrators it is
    /// black.
    Light(LightPart),
}

impl Aov {
    /// All AOVs.
    pub const ALL: [Self; 31] = [
        Self::Depth,
        Self::Distance,
        Self::Position,
        Self::Normal,
        Self::GeometricNormal,
        Self::Uv,
        Self::Albedo,
        Self::InstanceId,
        Self::GeometryId,
        Self::PrimitiveId,
        Self::MaterialId,
        Self::Facing,
        Self::Barycentrics,
        Self::Motion,
        Self::NodesVisited,
        Self::PrimitivesTested,
        Self::Noise,
        Self::Samples,
        Self::CryptoObject,
        Self::CryptoMaterial,
        light(None, Some(Scatterings::None)),
        light(None, Some(Scatterings::One)),
        light(None, Some(Scatterings::Many)),
        light(Some(Lobe::Diffuse), Some(Scatterings::One)),
        light(Some(Lobe::Diffuse), Some(Scatterings::Many)),
        light(Some(Lobe::Specular), Some(Scatterings::One)),
        light(Some(Lobe::Specular), Some(Scatterings::Many)),
        light(Some(Lobe::Transmission), Some(Scatterings::One)),
        light(Some(Lobe::Transmission), Some(Scatterings::Many)),
        light(Some(Lobe::Volume), Some(Scatterings::One)),
        light(Some(Lobe::Volume), Some(Scatterings::Many)),
    ];

    /// The name on the command line, and of the layer.
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Distance => "distance",
            Self::Position => "position",
            Self::Normal => "normal",
            Self::GeometricNormal => "geometric-normal",
            Self::Uv => "uv",
            Self::Albedo => "albedo",
            Self::InstanceId => "instance-id",
            Self::GeometryId => "geometry-id",
            Self::PrimitiveId => "primitive-id",
            Self::MaterialId => "material-id",
            Self::Facing => "facing",
            Self::Barycentrics => "barycentrics",
            Self::Motion => "motion",
            Self::NodesVisited => "nodes-visited",
            Self::PrimitivesTested => "primitives-tested",
            Self::Noise => "noise",
            Self::Samples => "samples",
            Self::CryptoObject => "crypto-object",
            Self::CryptoMaterial => "crypto-material",
            Self::Light(part) => light_name(part),
        }
    }

    /// Names of the channels.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Position | Self::Normal | Self::GeometricNormal => &["X", "Y", "Z"],
            Self::Uv | Self::Barycentrics => &["U", "V"],
            Self::Motion => &["X", "Y"],
            Self::Albedo | Self::Light(_) => &["R", "G", "B"],
            Self::Depth => &["Z"],
            Self::CryptoObject | Self::CryptoMaterial => &[],
            Self::InstanceId | Self::GeometryId | Self::PrimitiveId | Self::MaterialId => &["id"],
            _ => &["V"],
        }
    }

    /// How samples are combined.
    pub fn kind(self) -> AovKind {
        match self {
            Self::InstanceId | Self::GeometryId | Self::PrimitiveId | Self::MaterialId => {
                AovKind::First
            }
            Self::Noise | Self::Samples => AovKind::OfFilm,
            Self::CryptoObject | Self::CryptoMaterial => AovKind::Coverage,
            _ => AovKind::Averaged,
        }
    }

    /// How many values each sample brings.
    pub fn sampled_channels(self) -> usize {
        if matches!(self.kind(), AovKind::OfFilm | AovKind::Coverage) {
            0
        } else {
            self.channels().len()
        }
    }

    /// What covers a sample, as the key of [`crate::Film::coverage`]: for an object instance and
    /// geometry, for a material its number.
    pub fn key(self, context: &Context, hit: &Hit) -> u64 {
        match self {
            _ if !hit.is_hit() => NOTHING,
            Self::CryptoObject => u64::from(hit.instance) << 32 | u64::from(hit.geometry),
            _ => u64::from(context.scene.material_id(hit).0),
        }
    }

    /// True if the camera ray must be traced with counters.
    pub fn needs_counters(self) -> bool {
        matches!(self, Self::NodesVisited | Self::PrimitivesTested)
    }

    /// True if the surface that a camera ray hits must be known, and not only where that is on the
    /// ray.
    pub fn needs_surface(self, context: &Context) -> bool {
        match self {
            Self::Motion => motion::is_any(context),
            _ => matches!(
                self,
                Self::Position
                    | Self::Normal
                    | Self::GeometricNormal
                    | Self::Uv
                    | Self::Albedo
                    | Self::Facing
            ),
        }
    }

    /// Appends the values of what a camera ray has hit.
    pub fn extend(
        self,
        context: &Context,
        first: &FirstHit,
        camera: &Camera,
        values: &mut Vec<f32>,
    ) {
        let FirstHit { ray, hit, surface, counters, .. } = first;
        match (self, surface) {
            _ if matches!(self.kind(), AovKind::OfFilm | AovKind::Coverage) => {}
            // Found on the way.
            (Self::Light(_), _) => values.extend([0.0; 3]),
            (Self::NodesVisited, _) => values.push(counters[0] as f32),
            (Self::PrimitivesTested, _) => values.push(counters[1] as f32),
            (Self::Motion, _) => values.extend(motion::on_the_picture(context, camera, first)),
            _ if !hit.is_hit() => {
                let miss = if self.kind() == AovKind::First { -1.0 } else { 0.0 };
                values.extend(self.channels().iter().map(|_| miss));
            }
            (Self::Depth, _) => {
                let along = ray.direction.normalize().dot(camera.towards.as_vec3());
                values.push(hit.t * ray.direction.length() * along);
            }
            (Self::Distance, _) => values.push(hit.t * ray.direction.length()),
            (Self::InstanceId, _) => values.push(hit.instance as f32),
            (Self::GeometryId, _) => values.push(hit.geometry as f32),
            (Self::PrimitiveId, _) => values.push(hit.primitive as f32),
            (Self::MaterialId, _) => values.push(context.scene.material_id(hit).0 as f32),
            (Self::Barycentrics, _) => values.extend(hit.uv.to_array()),
            (Self::Position, Some(surface)) => values.extend(surface.position.to_array()),
            (Self::Normal, Some(surface)) => values.extend(surface.shading_normal.to_array()),
            (Self::GeometricNormal, Some(surface)) => {
                values.extend(surface.geometric_normal.to_array())
            }
            (Self::Uv, Some(surface)) => values.extend(surface.uv.to_array()),
            (Self::Albedo, Some(surface)) => values.extend(surface.albedo.to_array()),
            (Self::Facing, Some(surface)) => {
                values.push(outgoing(ray).dot(surface.geometric_normal))
            }
            _ => {}
        }
    }

    /// A colour that shows the value in a picture: directions as colours, distances relative to the
    /// scene's radius, ids by hash, counts as a heat map by their logarithm, up to 255.
    pub fn preview(self, values: &[f32], scene_radius: f32) -> Rgb {
        let v = |i: usize| values.get(i).copied().unwrap_or(0.0);
        match self {
            Self::Depth | Self::Distance => {
                let d = v(0) / (4.0 * scene_radius);
                Rgb::splat(if v(0) > 0.0 { 1.0 / (1.0 + d * 2.0) } else { 0.0 })
            }
            Self::Normal | Self::GeometricNormal => {
                if (v(0), v(1), v(2)) == (0.0, 0.0, 0.0) {
                    Rgb::BLACK
                } else {
                    Rgb::new(v(0) * 0.5 + 0.5, v(1) * 0.5 + 0.5, v(2) * 0.5 + 0.5)
                }
            }
            Self::Position => {
                let f = |x: f32| (x / scene_radius * 0.5 + 0.5).rem_euclid(1.0);
                Rgb::new(f(v(0)), f(v(1)), f(v(2)))
            }
            Self::Uv | Self::Barycentrics => {
                Rgb::new(v(0).rem_euclid(1.0), v(1).rem_euclid(1.0), 0.0)
            }
            Self::Albedo | Self::Light(_) => Rgb::new(v(0), v(1), v(2)),
            Self::InstanceId | Self::GeometryId | Self::PrimitiveId | Self::MaterialId => {
                id_color(v(0))
            }
            Self::CryptoObject | Self::CryptoMaterial => Rgb::BLACK,
            Self::Facing => {
                if v(0) >= 0.0 {
                    Rgb::splat(v(0))
                } else {
                    Rgb::new(-v(0), 0.0, 0.0)
                }
            }
            // As normal maps are seen: grey where nothing moves; 64 pixels are as much as is shown.
            Self::Motion => {
                let f = |x: f32| (x / 128.0 + 0.5).clamp(0.0, 1.0);
                Rgb::new(f(v(0)), f(v(1)), 0.5)
            }
            Self::Noise => heat((v(0) * 10.0).clamp(0.0, 1.0)),
            Self::Samples => heat(((1.0 + v(0).max(0.0)).log2() / 14.0).min(1.0)),
            Self::NodesVisited | Self::PrimitivesTested => {
                heat(((1.0 + v(0).max(0.0)).log2() / 8.0).min(1.0))
            }
        }
    }
}

const fn light(lobe: Option<Lobe>, scatterings: Option<Scatterings>) -> Aov {
    Aov::Light(LightPart { lobe, scatterings, group: None })
}

/// The name of a part of the light, whatever the group.
fn light_name(part: LightPart) -> &'static str {
    use {Lobe as L, Scatterings as S};
    match (part.lobe, part.scatterings) {
        (None, None) => "light",
        (None, Some(S::None)) | (Some(_), Some(S::None)) => "emission",
        (None, Some(S::One)) => "direct",
        (None, Some(S::Many)) => "indirect",
        (Some(L::Diffuse), Some(S::One)) => "diffuse-direct",
        (Some(L::Diffuse), Some(S::Many)) => "diffuse-indirect",
        (Some(L::Specular), Some(S::One)) => "specular-direct",
        (Some(L::Specular), Some(S::Many)) => "specular-indirect",
        (Some(L::Transmission), Some(S::One)) => "transmission-direct",
        (Some(L::Transmission), Some(S::Many)) => "transmission-indirect",
        (Some(L::Volume), Some(S::One)) => "volume-direct",
        (Some(L::Volume), Some(S::Many)) => "volume-indirect",
        (Some(L::Diffuse), None) => "diffuse",
        (Some(L::Specular), None) => "specular",
        (Some(L::Transmission), None) => "transmission",
        (Some(L::Volume), None) => "volume",
    }
}

fn id_color(id: f32) -> Rgb {
    if id < 0.0 {
        return Rgb::BLACK;
    }
    let [r, g, b, _] = snell_math::rng::pcg4d([id as u32, 1, 2, 3])
        .map(|h| snell_math::rng::to_unit(h) * 0.8 + 0.1);
    Rgb::new(r, g, b)
}

/// Black, blue, magenta, orange, white: dark to bright for 0 to 1.
fn heat(x: f32) -> Rgb {
    const STOPS: [[f32; 3]; 5] = [
        [0.0, 0.0, 0.02],
        [0.08, 0.02, 0.4],
        [0.6, 0.05, 0.35],
        [0.98, 0.45, 0.05],
        [1.0, 1.0, 0.85],
    ];
    let p = x * 4.0;
    let i = (p as usize).min(3);
    let t = p - i as f32;
    let c = |k: usize| STOPS[i][k] * (1.0 - t) + STOPS[i + 1][k] * t;
    Rgb::new(c(0), c(1), c(2))
}
