//! The settings of a render: everything except the scene.

use crate::film::filter::Filter;
use crate::film::sensor::Sensor;
use crate::guiding::Guiding;
use crate::integrator::IntegratorKind;
use crate::integrator::aov::Aov;
use crate::integrator::light_part::LightSource;
use crate::light_sampler::LightSamplerKind;
use crate::sampler::SamplerKind;
use snell_intersect::BuildOptions;
use snell_math::ColorModel;
use snell_math::Rgb;
use snell_scene::Camera;

/// How `raycast` and `whitted` treat occlusion of lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shadows {
    /// No shadow rays.
    None,
    /// One shadow ray to the middle of each light.
    #[default]
    Hard,
    /// A shadow ray to a random point of each light.
    Soft,
}

impl Shadows {
    /// All choices.
    pub const ALL: [Self; 3] = [Self::None, Self::Hard, Self::Soft];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Hard => "hard",
            Self::Soft => "soft",
        }
    }
}

/// Which samples `path` and `direct` use to find lights. All converge to the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightStrategy {
    /// Light samples and BSDF samples, combined by the power heuristic (Veach and Guibas, 1995).
    #[default]
    Mis,
    /// Light samples only, except for delta lobes and lights that are not sampled.
    Light,
    /// BSDF samples only, except for lights that no BSDF sample can find.
    Bsdf,
}

impl LightStrategy {
    /// All strategies.
    pub const ALL: [Self; 3] = [Self::Mis, Self::Light, Self::Bsdf];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mis => "mis",
            Self::Light => "light",
            Self::Bsdf => "bsdf",
        }
    }
}

/// The treatment of the shadow terminator on coarse meshes with vertex normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Terminator {
    /// The terminator of the smooth surface that the normals imply; see
    /// [`snell_intersect::smooth`].
    #[default]
    Smooth,
    /// The terminator along the edges of the triangles, as in renderers without correction.
    Faceted,
}

impl Terminator {
    /// All choices.
    pub const ALL: [Self; 2] = [Self::Smooth, Self::Faceted];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smooth => "smooth",
            Self::Faceted => "faceted",
        }
    }
}

/// Whether `path` finds caustics by photons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CausticsMode {
    /// Where a look at the scene says that small lamps light something through casters.
    #[default]
    Auto,
    /// Wherever there are casters, by the photons of lamps of any size.
    On,
    /// Never.
    Off,
}

impl CausticsMode {
    /// All choices.
    pub const ALL: [Self; 3] = [Self::Auto, Self::On, Self::Off];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::On => "on",
            Self::Off => "off",
        }
    }
}

/// A rectangle of pixels, right and lower border exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Crop {
    /// Left and upper border (inclusive).
    pub min: [u32; 2],
    /// Right and lower border (exclusive).
    pub max: [u32; 2],
}

impl Crop {
    /// The whole picture.
    pub fn full(size: [u32; 2]) -> Self {
        Self { min: [0, 0], max: size }
    }

    /// Width and height.
    pub fn size(&self) -> [u32; 2] {
        [self.max[0].saturating_sub(self.min[0]), self.max[1].saturating_sub(self.min[1])]
    }
}

/// The order in which tiles are rendered. Never changes the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TileOrder {
    /// Row by row from the top.
    #[default]
    Rows,
    /// Row by row, from the last tile to the first.
    Reversed,
    /// In random order; the number is the seed.
    Shuffled(u32),
}

/// A light group, shown as a layer of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LightGroup {
    /// The group's name, from which its layers are named.
    pub name: String,
    /// The emitters of the group. An emitter in several groups belongs to the first.
    pub sources: Vec<LightSource>,
}

/// The settings of a render.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Width and height of the whole picture in pixels.
    pub size: [u32; 2],
    /// The part of the picture that is rendered; `None` for all of it.
    pub crop: Option<Crop>,
    /// Samples per pixel.
    pub spp: u32,
    /// If set, a pixel takes samples only until its error is at most this, see
    /// [`crate::film::noise`]; `spp` is the upper limit.
    pub noise: Option<f64>,
    /// The floor f that is added to a pixel's intensity when its error is computed, see
    /// [`crate::film::noise`].
    pub noise_floor: f64,
    /// True to render in passes that grow from one sample, so that a render that is stopped early
    /// leaves a complete picture. This never changes the bits.
    pub progressive: bool,
    /// Seed of all random numbers.
    pub seed: u32,
    /// The sampler.
    pub sampler: SamplerKind,
    /// The poses of a moving camera at equal times after the shutter opens, up to its closing.
    /// Empty for a static camera.
    pub later_cameras: Vec<Camera>,
    /// Reconstruction filter.
    pub filter: Filter,
    /// If set, every sample of a pixel is taken at this position in the pixel, from (0, 0) to (1,
    /// 1), and the filter is not used.
    pub pixel_position: Option<[f64; 2]>,
    /// The sensor of the camera; `None` if the picture is the light itself.
    pub sensor: Option<Sensor>,
    /// The integrator that computes light.
    pub integrator: IntegratorKind,
    /// The representation of colour in light transport.
    pub color: ColorModel,
    /// The largest number of bounces after the camera ray's hit. 0 shows light that reaches the
    /// camera from the first surface itself, 1 adds direct light (in `path`), and so on.
    pub max_depth: u32,
    /// The number of bounces from which Russian roulette may end paths that have lost light; as
    /// many as `max_depth` switch it off. `None` is 1, or 4 where most light comes uniformly from
    /// all directions.
    pub roulette_depth: Option<u32>,
    /// How occlusion of lights is treated by the classic integrators.
    pub shadows: Shadows,
    /// Which shadow terminator meshes with vertex normals have.
    pub terminator: Terminator,
    /// The strategy of sampling lights.
    pub light_strategy: LightStrategy,
    /// How one light is chosen among many.
    pub light_sampler: LightSamplerKind,
    /// If set, `path` uses path guiding, trained before the render.
    pub guiding: Option<Guiding>,
    /// Whether `path` finds caustics by photons.
    pub caustics: CausticsMode,
    /// The number of photons that are shot for each block of 16 samples; `None` for about one per
    /// pixel.
    pub photons: Option<u32>,
    /// Light that is added to the scene's ambient light in `raycast` and `whitted`, as a cheap
    /// substitute for indirect light.
    pub fill: Rgb,
    /// The distance within which `ao` counts occluders, in scene units; `None` means half of the
    /// scene's radius.
    pub ao_distance: Option<f32>,
    /// Radiance to which light that was scattered more than once is clamped, in every channel.
    /// Clamping removes fireflies, but makes the picture too dark.
    pub clamp: Option<f32>,
    /// Light groups, each with a layer of its own.
    pub light_groups: Vec<LightGroup>,
    /// The AOVs that become extra layers.
    pub aovs: Vec<Aov>,
    /// The order in which tiles are rendered.
    pub tile_order: TileOrder,
    /// Options of the acceleration structure, including the SIMD level.
    pub build: BuildOptions,
}

impl Settings {
    /// The default limit of the path length. Russian roulette ends practically all paths long
    /// before, unless they lose nothing: in a white cloud of optical radius 50, 2 % of the paths
    /// scatter more than 1,000 times, and practically none more than 10,000 times.
    pub const MAX_DEPTH: u32 = 10_000;
    /// The largest limit of the path length.
    pub const DEEPEST: u32 = 100_000;
    /// The default [`Settings::noise_floor`] for a picture whose white is 1: somewhat darker than
    /// middle grey.
    pub const NOISE_FLOOR: f64 = 0.1;
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            size: [640, 480],
            crop: None,
            spp: 64,
            noise: None,
            noise_floor: Self::NOISE_FLOOR,
            progressive: false,
            seed: 0,
            sampler: SamplerKind::default(),
            later_cameras: Vec::new(),
            filter: Filter::default(),
            pixel_position: None,
            sensor: None,
            integrator: IntegratorKind::default(),
            color: ColorModel::default(),
            max_depth: Self::MAX_DEPTH,
            roulette_depth: None,
            shadows: Shadows::default(),
            terminator: Terminator::default(),
            light_strategy: LightStrategy::default(),
            light_sampler: LightSamplerKind::default(),
            guiding: None,
            caustics: CausticsMode::Off,
            photons: None,
            fill: Rgb::BLACK,
            ao_distance: None,
            clamp: None,
            light_groups: Vec::new(),
            aovs: Vec::new(),
            tile_order: TileOrder::default(),
            build: BuildOptions::default(),
        }
    }
}
