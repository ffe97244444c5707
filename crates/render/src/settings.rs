//! The settings of a render: everything except the scene.

use crate::film::filter::Filter;
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
    /// Light samples only, except where a delta lobe or an unsampled light leaves no choice.
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
    /// The terminator is that of the smooth surface, see [`snell_intersect::smooth`].
    #[default]
    Smooth,
    /// The terminator follows the edges of the triangles, as in renderers without correction.
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

/// A rectangle of pixels, right and lower border exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// Left, upper.
    pub min: [u32; 2],
    /// Right, lower (exclusive).
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
    /// From the last to the first.
    Reversed,
    /// In random order, with this seed.
    Shuffled(u32),
}

/// A light group, shown as a layer of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LightGroup {
    /// Its name.
    pub name: String,
    /// The emitters of the group. An emitter in several groups belongs to the first.
    pub sources: Vec<LightSource>,
}

/// Settings of a render.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Width and height of the whole picture in pixels.
    pub size: [u32; 2],
    /// Only this part is rendered.
    pub crop: Option<Crop>,
    /// Samples per pixel.
    pub spp: u32,
    /// If set, a pixel takes samples only until its error is at most this, see
    /// [`crate::film::noise`]; `spp` is the most.
    pub noise: Option<f64>,
    /// Intensity that is added to that of a pixel before its error is divided by it, see
    /// [`crate::film::noise`].
    pub noise_floor: f64,
    /// Render in passes that grow from one sample, so that a render that is stopped early leaves a
    /// complete picture. Never changes the bits.
    pub progressive: bool,
    /// Seed of all random numbers.
    pub seed: u32,
    /// The sampler.
    pub sampler: SamplerKind,
    /// Further keys of a moving camera, after its position when the shutter opens: evenly spaced in
    /// time. Empty for a static camera.
    pub later_cameras: Vec<Camera>,
    /// Reconstruction filter.
    pub filter: Filter,
    /// If set, every sample of a pixel is taken at this position in it, and the filter is not used.
    pub pixel_position: Option<[f64; 2]>,
    /// The integrator.
    pub integrator: IntegratorKind,
    /// The representation of colour in light transport.
    pub color: ColorModel,
    /// How many bounces after the camera ray's hit are followed at most: 0 shows light that reaches
    /// the camera from the first surface itself, 1 adds direct light (in `path`), and so on.
    pub max_depth: u32,
    /// The number of bounces from which Russian roulette may end paths that have lost light; as
    /// many as `max_depth` switch it off. `None` is 1, or 4 where most light comes uniformly from
    /// all directions.
    pub roulette_depth: Option<u32>,
    /// How occlusion of lights is treated by the classic integrators.
    pub shadows: Shadows,
    /// Where meshes with vertex normals have their shadow terminator.
    pub terminator: Terminator,
    /// The strategy of sampling lights.
    pub light_strategy: LightStrategy,
    /// The light sampler.
    pub light_sampler: LightSamplerKind,
    /// If set, `path` uses path guiding, trained before the render.
    pub guiding: Option<Guiding>,
    /// Added to the scene's ambient light in `raycast` and `whitted`: a cheap substitute for
    /// indirect light.
    pub fill: Rgb,
    /// How far `ao` looks for occluders; `None` is half of the scene's radius.
    pub ao_distance: Option<f32>,
    /// Light that was scattered more than once and is brighter than this, in any channel, is
    /// clamped to it: this removes fireflies, but the picture is too dark.
    pub clamp: Option<f32>,
    /// Light groups, each with a layer of its own.
    pub light_groups: Vec<LightGroup>,
    /// Extra layers.
    pub aovs: Vec<Aov>,
    /// Order of the tiles.
    pub tile_order: TileOrder,
    /// Acceleration structure and SIMD level.
    pub build: BuildOptions,
}

impl Settings {
    /// The default limit of the path length. Russian roulette ends practically all paths long
    /// before, unless they lose nothing.
    pub const MAX_DEPTH: u32 = 1000;
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
            integrator: IntegratorKind::default(),
            color: ColorModel::default(),
            max_depth: Self::MAX_DEPTH,
            roulette_depth: None,
            shadows: Shadows::default(),
            terminator: Terminator::default(),
            light_strategy: LightStrategy::default(),
            light_sampler: LightSamplerKind::default(),
            guiding: None,
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
