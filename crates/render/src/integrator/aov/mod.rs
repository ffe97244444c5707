//! Arbitrary output variables: properties of the first hit other than its light. Each is a line of
//! the list below, and is declared in a file of this folder; all other code reads the list.

mod colors;
mod cost;
mod coverage;
mod distance;
mod film;
mod ids;
mod light;
mod motion;
mod surface;

use super::first_surface::FirstSurface;
use super::light_part::LightPart;
use super::{Context, Family, Integrator};
use snell_intersect::Hit;
use snell_math::{Ray, Rgb};
use snell_scene::Camera;

/// The integrator `aov`: no light, the first of the chosen AOVs as a picture.
pub(crate) const AOV: Integrator =
    Integrator { name: "aov", shade: |_, _, _| {}, family: Family::Other, max_depth: 1, spp: 16 };

/// How the samples of a pixel are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AovKind {
    /// Their mean.
    Averaged,
    /// The first sample's value: for ids, of which a mean means nothing.
    First,
    /// A value that comes from the film, not from samples.
    OfFilm,
    /// The fraction of samples with each value, see [`crate::Film::coverage`]. Not a layer by
    /// itself.
    Coverage,
}

/// The hit of a camera ray.
#[derive(Debug)]
pub struct FirstHit<'a> {
    /// The ray.
    pub ray: &'a Ray,
    /// The hit, if there is one.
    pub hit: &'a Hit,
    /// The time of the ray, from 0 to 1.
    pub time: f32,
    /// The surface that was hit, if any AOV [needs it](Aov::needs_surface).
    pub surface: Option<FirstSurface>,
    /// Nodes visited and primitives tested, if any AOV [needs them](Aov::needs_counters).
    pub counters: [u32; 2],
}

/// The key of a sample that nothing covers.
pub const NOTHING: u64 = u64::MAX;

/// The declaration of an AOV, in its file.
struct Declared {
    /// The name on the command line, and of the layer.
    name: &'static str,
    /// Names of the channels.
    channels: &'static [&'static str],
    /// How samples are combined.
    kind: AovKind,
    /// The data of the hit that it needs.
    needs: Needs,
    /// Appends the values of a hit; for [`Needs`] that misses satisfy too, of any ray.
    values: Values,
    /// The preview colour of the values, given the scene's radius.
    preview: fn(&[f32], f32) -> Rgb,
}

type Values = fn(&Context, &FirstHit, &Camera, &mut Vec<f32>);

/// The data that an AOV needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Needs {
    /// The hit.
    Hit,
    /// The surface that was hit.
    Surface,
    /// The surface, in a scene with motion. Misses have a value, too.
    Motion,
    /// The counters of the ray. Misses have a value, too.
    Counters,
    /// No data: the value is computed elsewhere.
    Nothing,
}

macro_rules! aovs {
    ($($(#[$doc:meta])* $aov:ident: $declared:path,)*) => {
        /// An extra layer of the picture.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Aov {
            $($(#[$doc])* $aov,)*
            /// Some of the light. Only `path` and `direct` can take light apart; with other
            /// integrators it is black.
            Light(LightPart),
        }

        impl Aov {
            const FIXED: [Self; [$(stringify!($aov)),*].len()] = [$(Self::$aov),*];

            fn declared(self) -> &'static Declared {
                match self {
                    $(Self::$aov => &$declared,)*
                    Self::Light(_) => &light::LIGHT,
                }
            }
        }
    };
}

aovs! {
    /// Distance from the eye along the view direction, scene units; 0 where nothing is hit.
    Depth: distance::DEPTH,
    /// Distance from the eye along the ray, scene units; 0 where nothing is hit.
    Distance: distance::DISTANCE,
    /// Position in the world.
    Position: surface::POSITION,
    /// Shading normal in the world (normal map not applied), on the outer side.
    Normal: surface::NORMAL,
    /// Normal of the surface itself in the world, on the outer side.
    GeometricNormal: surface::GEOMETRIC_NORMAL,
    /// First texture coordinates.
    Uv: surface::UV,
    /// Share of light that the material reflects or transmits.
    Albedo: surface::ALBEDO,
    /// Number of the instance; -1 where nothing is hit.
    InstanceId: ids::INSTANCE,
    /// Number of the geometry; -1 where nothing is hit.
    GeometryId: ids::GEOMETRY,
    /// Number of the triangle or face; -1 where nothing is hit.
    PrimitiveId: ids::PRIMITIVE,
    /// Number of the material; -1 where nothing is hit.
    MaterialId: ids::MATERIAL,
    /// Cosine between the ray and the geometric normal: positive on the outer side.
    Facing: surface::FACING,
    /// Barycentric coordinates of the hit triangle.
    Barycentrics: surface::BARYCENTRICS,
    /// Way over the picture of what is hit while the shutter is open, in pixels: to the right and
    /// down.
    Motion: motion::MOTION,
    /// Nodes of acceleration structures that the camera ray visited.
    NodesVisited: cost::NODES_VISITED,
    /// Triangles and shapes that the camera ray was tested against.
    PrimitivesTested: cost::PRIMITIVES_TESTED,
    /// Error of the pixel: half of its 95 % confidence interval in tone-mapped units, see
    /// [`crate::film::noise`].
    Noise: film::NOISE,
    /// Number of samples of the pixel.
    Samples: film::SAMPLES,
    /// Which objects cover the pixel: for Cryptomatte.
    CryptoObject: coverage::CRYPTO_OBJECT,
    /// Which materials cover the pixel: for Cryptomatte.
    CryptoMaterial: coverage::CRYPTO_MATERIAL,
}

impl Aov {
    /// All AOVs.
    pub const ALL: [Self; Self::FIXED.len() + light::PARTS.len()] = {
        let mut all = [Self::Depth; Self::FIXED.len() + light::PARTS.len()];
        let mut i = 0;
        while i < all.len() {
            all[i] = match i < Self::FIXED.len() {
                true => Self::FIXED[i],
                false => Self::Light(light::PARTS[i - Self::FIXED.len()]),
            };
            i += 1;
        }
        all
    };

    /// The name on the command line, and of the layer.
    pub fn name(self) -> &'static str {
        match self {
            Self::Light(part) => light::name(part),
            _ => self.declared().name,
        }
    }

    /// Names of the channels.
    pub fn channels(self) -> &'static [&'static str] {
        self.declared().channels
    }

    /// How samples are combined.
    pub fn kind(self) -> AovKind {
        self.declared().kind
    }

    /// The number of values of each sample.
    pub fn sampled_channels(self) -> usize {
        if matches!(self.kind(), AovKind::OfFilm | AovKind::Coverage) {
            0
        } else {
            self.channels().len()
        }
    }

    /// The key of a sample, see [`crate::Film::coverage`].
    pub fn key(self, context: &Context, hit: &Hit) -> u64 {
        if hit.is_hit() { coverage::key(self, context, hit) } else { NOTHING }
    }

    /// True if the camera ray must be traced with counters.
    pub fn needs_counters(self) -> bool {
        self.declared().needs == Needs::Counters
    }

    /// True if it needs the surface that a camera ray hits, and not only the distance.
    pub fn needs_surface(self, context: &Context) -> bool {
        match self.declared().needs {
            Needs::Surface => true,
            Needs::Motion => motion::is_any(context),
            Needs::Hit | Needs::Counters | Needs::Nothing => false,
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
        let Declared { kind, channels, needs, values: append, .. } = self.declared();
        let is_missed = matches!(needs, Needs::Hit | Needs::Surface) && !first.hit.is_hit();
        match kind {
            AovKind::OfFilm | AovKind::Coverage => {}
            AovKind::First if is_missed => values.extend(channels.iter().map(|_| -1.0)),
            AovKind::Averaged if is_missed => values.extend(channels.iter().map(|_| 0.0)),
            AovKind::First | AovKind::Averaged => append(context, first, camera, values),
        }
    }

    /// A colour that shows the value in a picture: directions as colours, distances relative to the
    /// scene's radius, ids by hash, counts as a heat map by their logarithm, up to 255.
    pub fn preview(self, values: &[f32], scene_radius: f32) -> Rgb {
        (self.declared().preview)(values, scene_radius)
    }
}
