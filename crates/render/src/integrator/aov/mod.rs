//! Arbitrary output variables: properties of the first hit other than its light. Each AOV is
//! declared in a file of this folder and is a line of the list below, which all other code reads.

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

/// The integrator `aov`: no light is transported, and the picture shows the first of the chosen
/// AOVs.
pub(crate) const AOV: Integrator =
    Integrator { name: "aov", shade: |_, _, _| {}, family: Family::Other, max_depth: 1, spp: 16 };

/// How the samples of a pixel are combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AovKind {
    /// The value is the mean of the samples.
    Averaged,
    /// The value is that of the first sample, for ids, whose mean would be meaningless.
    First,
    /// The film computes the value; samples have none.
    OfFilm,
    /// Each value is kept with the fraction of the samples that have it; see
    /// [`crate::Film::coverage`]. The AOV is not a layer by itself.
    Coverage,
}

/// The hit of a camera ray.
#[derive(Debug)]
pub struct FirstHit<'a> {
    /// The ray from the camera.
    pub ray: &'a Ray,
    /// The hit, which may be a miss.
    pub hit: &'a Hit,
    /// The time of the ray, from 0 to 1.
    pub time: f32,
    /// The surface that was hit, if any AOV [needs it](Aov::needs_surface).
    pub surface: Option<FirstSurface>,
    /// Nodes visited and primitives tested, if any AOV [needs them](Aov::needs_counters).
    pub counters: [u32; 2],
}

/// The key of a sample whose camera ray hits nothing.
pub const NOTHING: u64 = u64::MAX;

/// The declaration of an AOV.
struct Declared {
    /// The name on the command line and of the layer.
    name: &'static str,
    /// Names of the channels.
    channels: &'static [&'static str],
    /// How the samples of a pixel are combined.
    kind: AovKind,
    /// The data of the hit that the AOV needs.
    needs: Needs,
    /// Appends the values of a hit. It is called for misses too if [`Self::needs`] says that misses
    /// have a value.
    values: Values,
    /// The preview colour of the values; the second argument is the scene's radius.
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
    /// The surface, in a scene with motion. Misses have a value too.
    Motion,
    /// The counters of the ray. Misses have a value too.
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
            /// A part of the light. Only `path` and `direct` separate parts; with other integrators
            /// the layer is black.
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
    /// Distance from the eye along the view direction in scene units; 0 where nothing is hit.
    Depth: distance::DEPTH,
    /// Distance from the eye along the ray in scene units; 0 where nothing is hit.
    Distance: distance::DISTANCE,
    /// Position in the world.
    Position: surface::POSITION,
    /// Shading normal in the world, on the outer side. Normal maps are not applied.
    Normal: surface::NORMAL,
    /// Geometric normal in the world, on the outer side.
    GeometricNormal: surface::GEOMETRIC_NORMAL,
    /// First set of texture coordinates.
    Uv: surface::UV,
    /// Fraction of light that the material reflects or transmits.
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
    /// Motion in the picture of the point that is hit, while the shutter is open, in pixels to the
    /// right and down.
    Motion: motion::MOTION,
    /// Nodes of acceleration structures that the camera ray visited.
    NodesVisited: cost::NODES_VISITED,
    /// Triangles and shapes that the camera ray was tested against.
    PrimitivesTested: cost::PRIMITIVES_TESTED,
    /// Error of the pixel: half of the width of its 95 % confidence interval in tone-mapped units,
    /// see [`crate::film::noise`].
    Noise: film::NOISE,
    /// Number of samples of the pixel.
    Samples: film::SAMPLES,
    /// The objects that cover the pixel, for Cryptomatte.
    CryptoObject: coverage::CRYPTO_OBJECT,
    /// The materials that cover the pixel, for Cryptomatte.
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

    /// The name on the command line and of the layer.
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

    /// How the samples of a pixel are combined.
    pub fn kind(self) -> AovKind {
        self.declared().kind
    }

    /// The number of values that each sample has.
    pub fn sampled_channels(self) -> usize {
        if matches!(self.kind(), AovKind::OfFilm | AovKind::Coverage) {
            0
        } else {
            self.channels().len()
        }
    }

    /// The key that covers a sample; see [`crate::Film::coverage`].
    pub fn key(self, context: &Context, hit: &Hit) -> u64 {
        if hit.is_hit() { coverage::key(self, context, hit) } else { NOTHING }
    }

    /// True if the camera ray must be traced with counters.
    pub fn needs_counters(self) -> bool {
        self.declared().needs == Needs::Counters
    }

    /// True if the AOV needs the surface that a camera ray hits, and not only the distance of the
    /// hit.
    pub fn needs_surface(self, context: &Context) -> bool {
        match self.declared().needs {
            Needs::Surface => true,
            Needs::Motion => motion::is_any(context),
            Needs::Hit | Needs::Counters | Needs::Nothing => false,
        }
    }

    /// Appends the values for what a camera ray has hit.
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

    /// A colour that shows the values in a picture. Directions become colours, distances are
    /// relative to the scene's radius, ids are hashed, and counts up to 255 are shown as a
    /// logarithmic heat map.
    pub fn preview(self, values: &[f32], scene_radius: f32) -> Rgb {
        (self.declared().preview)(values, scene_radius)
    }
}
