//! A user's request for a render, and the settings that follow from it. The user's values take
//! precedence over the scene's, and the scene's over the defaults. The command line and Python both
//! fill a [`Request`], so they have the same defaults, ranges and errors.

mod choices;
mod reference;
mod setting;
mod wish;

pub use choices::{integrators_page, samplers_page};
pub use reference::{page, python_types};
pub use setting::{Form, Heading, Problem, Setting};
use snell_math::real;
pub use wish::{Wish, seconds_of};

use crate::film::filter::Filter;
use crate::film::sensor::Sensor;
use crate::guiding::Guiding;
use crate::integrator::IntegratorKind;
use crate::integrator::aov::Aov;
use crate::layers::{add_light_group, needed_aovs};
use crate::light_sampler::LightSamplerKind;
use crate::sampler::SamplerKind;
use crate::settings::{
    CausticsMode, Crop, LightGroup, LightStrategy, Settings, Shadows, Terminator,
};
use setting::settings;
use snell_intersect::AcceleratorKind;
use snell_intersect::{BuildOptions, Quality};
use snell_math::ColorModel;
use snell_math::parameters::Range;
use snell_math::simd::Level;
use snell_scene::{Camera, Scene, SceneSettings};
use std::path::PathBuf;
use std::sync::LazyLock;
use std::time::Duration;

/// The number of training passes of path guiding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuidingPasses {
    /// As many as fit into [`Guiding::SHARE`] of the samples, or of the time.
    Auto,
    /// This many, from 1 to [`Guiding::MAX_PASSES`].
    Count(u32),
}

/// How noise is removed from the picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Denoise {
    /// By Open Image Denoise, wherever the system finds it.
    Found,
    /// By Open Image Denoise at this path, which is its library or the folder that holds it.
    At(PathBuf),
}

settings! {
    /// A user's choices for a render. `None` leaves a choice to the scene, or else to the default.
    ///
    /// Each field is a setting. The first paragraph of its documentation is its line in the
    /// command's help and in the reference page.
    ///
    /// ```
    /// use snell_render::Request;
    ///
    /// let scene = snell_scene::builtin::builtin("cornell-box").unwrap();
    /// let request = Request { spp: Some(16), ..Request::default() };
    /// let settings = request.resolve(&scene, &scene.cameras[0]).unwrap();
    /// assert_eq!((settings.spp, settings.size), (16, [512, 512]));
    /// ```
    #[derive(Clone, Debug, Default)]
    pub struct Request {
        /// Integrator that computes light.
        ///
        /// The scene's own comes before the default.
        #[setting(Light, "NAME", "str", short 'i')]
        pub integrator: IntegratorKind,
        /// Samples per pixel.
        ///
        /// With `noise` or `time` this is an upper limit, by default 65536.
        #[setting(
            Light, "N", "int", alias "samples",
            range Range::Within(1.0, Request::MAX_SPP as f64), default samples()
        )]
        pub spp: u32,
        /// Size of the picture in pixels.
        #[setting(
            Picture, "WxH", "tuple[int, int]", short 's', range Range::Within(1.0, 65536.0),
            default "what the scene or its camera says, else 960x720"
        )]
        pub size: [u32; 2],
        /// Stop each pixel when its 95 % confidence interval is this narrow on both sides, such as
        /// 0.02. In bright regions the value is relative to the light; see the documentation. The
        /// number of samples and the time are upper limits.
        #[setting(Light, "ERROR", "float", range Range::Within(1e-5, 10.0))]
        pub noise: f64,
        /// Stop after this time, such as 30s, 5m or 1h (the first pass over the picture is always
        /// finished).
        ///
        /// Numbers without a unit are seconds.
        #[setting(Light, "TIME", "float | str", range Range::Within(f64::MIN_POSITIVE, 1e9))]
        pub time: Duration,
        /// Maximum number of bounces after the first hit.
        ///
        /// More than 100000 count as 100000. The scene's own comes before the default. In media,
        /// each scattering is a bounce.
        #[setting(Light, "N", "int", default max_depths())]
        pub max_depth: u32,
        /// Bounces after which `path` may end paths that have lost light, by Russian roulette.
        ///
        /// 0 is the first hit; a value of `max_depth` or more switches it off. Where no light is
        /// lost, as in a white cloud, it adds no noise, except to paths of more than 4000 bounces.
        #[setting(
            Light, "N", "int", default "1, or 4 where most light comes evenly from all directions";
            live
        )]
        pub roulette_depth: u32,
        /// Render only this rectangle of pixels (right and lower border exclusive).
        #[setting(Subject, "x0,y0,x1,y1", "tuple[int, int, int, int]")]
        pub crop: Crop,
        /// Seed of the random numbers.
        ///
        /// The picture depends on the seed, but not on the number of threads or the time of day.
        #[setting(Light, "N", "int", default "0"; live)]
        pub seed: u32,
        /// Colours in light transport (`spectral` has four wavelengths per sample).
        #[setting(Light, "NAME", "str"; live)]
        pub color: ColorModel,
        /// Source of random numbers.
        ///
        /// The scene's own comes before the default.
        #[setting(Light, "NAME", "str"; live)]
        pub sampler: SamplerKind,
        /// Reconstruction filter.
        ///
        /// The scene's own comes before the default.
        #[setting(Light, "NAME", "str"; live)]
        pub filter: Filter,
        /// Shadows of `raycast` and `whitted`.
        ///
        /// The scene's own comes before the default.
        #[setting(Light, "NAME", "str"; live)]
        pub shadows: Shadows,
        /// Shadow terminator on coarse meshes with smooth normals.
        #[setting(Light, "NAME", "str"; live)]
        pub terminator: Terminator,
        /// Samples that find lights in `path` and `direct`.
        #[setting(Light, "NAME", "str"; live)]
        pub light_samples: LightStrategy,
        /// Choice of a light among many.
        #[setting(Light, "NAME", "str"; live)]
        pub light_sampler: LightSamplerKind,
        /// Learn where light comes from before rendering, for caustics and hidden lights (`path`).
        /// The value is the number of training passes; `auto` takes a quarter of the samples or of
        /// the time.
        #[setting(
            Light, "PASSES", "bool | int", range Range::Within(1.0, Guiding::MAX_PASSES as f64),
            default "off"
        )]
        pub guiding: GuidingPasses,
        /// Find caustics of small lamps by photons (`path`): the light that glass, water and
        /// polished metal gather.
        ///
        /// `auto` takes photons where a look at the scene says that small lamps light something
        /// through such surfaces. The scene's own comes before the default.
        #[setting(Light, "NAME", "str"; live)]
        pub caustics: CausticsMode,
        /// Photons for each 16 samples of a pixel (`caustics`). A million take up to 32 MB, and 116
        /// MB in fog.
        #[setting(
            Light, "N", "int", range Range::Within(1.0, Request::MAX_PHOTONS as f64),
            default "twice as many as the picture has pixels, from 131072 to 4194304"; live
        )]
        pub photons: u32,
        /// Clamp light after two or more bounces to this radiance, which removes fireflies but
        /// makes the picture too dark.
        #[setting(
            Light, "RADIANCE", "float", range Range::Within(f64::MIN_POSITIVE, f32::MAX as f64),
            default "off"; live
        )]
        pub clamp: f32,
        /// Distance within which `ao` counts occluders, in scene units.
        #[setting(
            Light, "DISTANCE", "float", range Range::Positive,
            default "half of the scene's radius"; live
        )]
        pub ao_distance: f32,
        /// Acceleration structure, which never changes the picture.
        #[setting(Light, "NAME", "str")]
        pub accelerator: AcceleratorKind,
        /// Build quality of the bvh, which never changes the picture.
        #[setting(Light, "NAME", "str"; live)]
        pub quality: Quality,
        /// Keep acceleration structures of large meshes in this folder, for the next render.
        #[setting(Light, "FOLDER", "str | os.PathLike[str]")]
        pub bvh_cache: PathBuf,
        /// Store the bvh in about two thirds of the memory; rays take somewhat longer. Never
        /// changes the picture.
        #[setting(Light, "", "bool")]
        pub bvh_compact: bool,
        /// Extra layers, separated by commas, such as depth,normal,albedo (`all` for all).
        #[setting(Picture, "LIST", "str | Sequence[str]")]
        pub aovs: Vec<Aov>,
        /// Write the light of some lights as a separate layer: NAME=LIST of light numbers, names
        /// of emissive materials, and `environment`.
        #[setting(Picture, "NAME=LIST", "Mapping[str, Any]")]
        pub light_groups: Vec<(String, Vec<String>)>,
        /// Remove noise with Open Image Denoise, if it is installed; PATH is its library or folder.
        #[setting(Picture, "PATH", "bool | str | os.PathLike[str]", default "off")]
        pub denoise: Denoise,
        /// Exposure in stops, for display formats.
        ///
        /// The error of `noise` is that of the picture with this exposure. The scene's own comes
        /// before the default.
        #[setting(Picture, "EV", "float", range Range::Within(-100.0, 100.0), default "0")]
        pub exposure: f64,
    }
    beside {
        /// Instructions that the kernels use. Default: the best that the processor has.
        pub simd: Level,
    }
}

/// The default of [`Request::max_depth`] in words.
fn max_depths() -> &'static str {
    static TEXT: LazyLock<String> =
        LazyLock::new(|| by_integrator(IntegratorKind::default_max_depth));
    &TEXT
}

/// The default of [`Request::spp`] in words.
fn samples() -> &'static str {
    static TEXT: LazyLock<String> = LazyLock::new(|| {
        format!("what the scene says, else {}", by_integrator(IntegratorKind::default_spp))
    });
    &TEXT
}

/// A number of each integrator, in words. The smallest number is given for all integrators that are
/// not named.
fn by_integrator(number: impl Fn(IntegratorKind) -> u32) -> String {
    let smallest = IntegratorKind::ALL.into_iter().map(&number).min().unwrap_or_default();
    let differs = |kind: &IntegratorKind| number(*kind) > smallest;
    let of = |kind: IntegratorKind| format!("{} for {}", number(kind), kind.name());
    let named: Vec<_> = IntegratorKind::ALL.into_iter().filter(differs).map(of).collect();
    format!("{}, else {smallest}", named.join(", "))
}

/// The reason why a request cannot become settings.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// The value of a parameter is invalid, by itself or together with the others.
    #[error("{parameter} {problem}")]
    Parameter {
        /// The name of the field of [`Request`].
        parameter: &'static str,
        /// What is wrong with the value, worded to follow the parameter's name.
        problem: String,
    },
    /// A group of `light_groups` is invalid.
    #[error("light_groups[{group:?}]: {problem}")]
    LightGroup {
        /// The name of the group.
        group: String,
        /// What is wrong with the group.
        problem: String,
    },
    /// The area to render has more pixels than [`Request::MAX_PIXELS`].
    #[error(
        "a picture of {}x{} pixels is larger than the limit of {} pixels",
        .size[0], .size[1], Request::MAX_PIXELS
    )]
    TooManyPixels {
        /// Width and height of the area to render.
        size: [u32; 2],
    },
    /// The scene's own settings contain an unknown name.
    #[error("the scene asks for the {parameter} \"{name}\", which is none of {known}")]
    SceneName {
        /// The name of the field of [`Request`] and of the scene's settings.
        parameter: &'static str,
        /// The unknown name.
        name: String,
        /// The valid names, separated by commas.
        known: String,
    },
}

/// An error that names a parameter.
fn refused<T>(parameter: &'static str, problem: String) -> Result<T, RequestError> {
    Err(RequestError::Parameter { parameter, problem })
}

impl Request {
    /// The size of a picture in pixels if neither user nor scene nor camera specifies one.
    pub const DEFAULT_SIZE: [u32; 2] = [960, 720];
    /// The largest number of pixels, equal to the limit of Snell's image readers. [`crate::memory`]
    /// estimates the memory that they need.
    pub const MAX_PIXELS: u64 = 1 << 28;
    /// The largest number of photons of a pass.
    pub const MAX_PHOTONS: u32 = 1 << 28;
    /// The largest number of samples per pixel.
    pub const MAX_SPP: u32 = 1 << 24;
    /// The limit of samples per pixel if the user limits only time or noise.
    pub const SPP_OF_LIMITS: u32 = 1 << 16;
    /// The largest number of samples per pixel that a single pass takes.
    const SPP_OF_ONE_PASS: u32 = 16;

    /// The settings of a render of this scene by this camera. An error names the parameter that is
    /// invalid.
    pub fn resolve(&self, scene: &Scene, camera: &Camera) -> Result<Settings, RequestError> {
        self.check_ranges()?;
        let (hints, default) = (&scene.settings, Settings::default());
        let integrators = (&IntegratorKind::ALL, IntegratorKind::name);
        let integrator = chosen(self.integrator, ("integrator", &hints.integrator), integrators)?;
        let samplers = (&SamplerKind::ALL, SamplerKind::name);
        let sampler = chosen(self.sampler, ("sampler", &hints.sampler), samplers)?;
        let filters = (&Filter::ALL, Filter::name);
        let filter = chosen(self.filter, ("filter", &hints.filter), filters)?;
        let shadows =
            chosen(self.shadows, ("shadows", &hints.shadows), (&Shadows::ALL, Shadows::name))?;
        let size = self.size.or(hints.size).or(camera.resolution).unwrap_or(Self::DEFAULT_SIZE);
        let crop = self.crop_within(size)?;
        check_pixels(crop.unwrap_or(Crop::full(size)).size())?;
        let spp = self.resolve_spp(hints, integrator);
        let light_groups = self.resolve_light_groups(scene)?;
        let asked = self.aovs.as_deref().unwrap_or_default();
        let denoise = self.denoise.is_some();
        let exposure = self.exposure.or(hints.exposure).unwrap_or(0.0);
        let max_depth = self.max_depth.or(hints.max_depth);
        Ok(Settings {
            size,
            crop,
            spp,
            noise: self.noise,
            noise_floor: Settings::NOISE_FLOOR / real::exp2(exposure),
            progressive: self.time.is_some() || spp > Self::SPP_OF_ONE_PASS,
            seed: self.seed.unwrap_or(default.seed),
            sampler,
            filter,
            pixel_position: hints.pixel_position.filter(|_| self.leaves_pixel_position()),
            sensor: Sensor::new(hints).filter(|_| integrator != IntegratorKind::Aov),
            integrator,
            color: self.color.unwrap_or_default(),
            max_depth: max_depth.unwrap_or(integrator.default_max_depth()).min(Settings::DEEPEST),
            roulette_depth: self.roulette_depth,
            shadows,
            terminator: self.terminator.unwrap_or_default(),
            light_strategy: self.light_samples.unwrap_or_default(),
            light_sampler: self.light_sampler.unwrap_or_default(),
            guiding: self.resolve_guiding(integrator, size, spp)?,
            caustics: self.resolve_caustics(hints, integrator)?,
            photons: self.photons,
            ao_distance: self.ao_distance,
            clamp: self.clamp,
            aovs: needed_aovs(asked, integrator, &light_groups, denoise),
            light_groups,
            build: self.build(),
            ..default
        })
    }

    /// The options of building acceleration structures, which do not depend on the scene.
    pub fn build(&self) -> BuildOptions {
        let default = BuildOptions::default();
        BuildOptions {
            accelerator: self.accelerator.unwrap_or(default.accelerator),
            quality: self.quality.unwrap_or(default.quality),
            compact: self.bvh_compact.unwrap_or(default.compact),
            cache: self.bvh_cache.clone(),
            simd: self.simd.unwrap_or(default.simd),
            ..default
        }
    }

    /// The crop; an error if it is empty or not within a picture of this size.
    pub fn crop_within(&self, size: [u32; 2]) -> Result<Option<Crop>, RequestError> {
        let Some(crop) = self.crop else { return Ok(None) };
        let ([x0, y0], [x1, y1]) = (crop.min, crop.max);
        if x0 >= x1 || y0 >= y1 {
            let problem = format!("{x0},{y0},{x1},{y1} is empty, expected x0 < x1 and y0 < y1");
            return refused("crop", problem);
        }
        let [w, h] = size;
        if x1 > w || y1 > h {
            let place = format!("{x0},{y0},{x1},{y1}");
            let problem = format!("{place} reaches beyond the picture of {w}x{h} pixels");
            return refused("crop", problem);
        }
        Ok(Some(crop))
    }

    /// True if training for guiding ends after its fraction of the time. With a fixed number of
    /// passes the clock is ignored, so that the bits are reproducible.
    pub fn is_training_timed(&self) -> bool {
        self.guiding == Some(GuidingPasses::Auto) && self.time.is_some()
    }

    /// The options of `snell render` that make the same request.
    pub fn arguments(&self) -> Vec<String> {
        let of_setting = |setting: &Setting| -> Vec<String> {
            let option = setting.option();
            let argument = |text: String| match text.is_empty() {
                true => format!("--{option}"),
                false => format!("--{option}={text}"),
            };
            (setting.texts)(self).into_iter().map(argument).collect()
        };
        Self::SETTINGS.iter().flat_map(of_setting).collect()
    }

    /// The setting of this name; `None` if there is none.
    pub fn setting(name: &str) -> Option<&'static Setting> {
        Self::SETTINGS.iter().find(|setting| setting.name == name)
    }

    fn check_ranges(&self) -> Result<(), RequestError> {
        let problem = |setting: &Setting| Some((setting.name, (setting.check)(self)?));
        match Self::SETTINGS.iter().find_map(problem) {
            Some((parameter, [value, expected])) => {
                refused(parameter, format!("is {value}, expected {expected}"))
            }
            None => Ok(()),
        }
    }

    fn resolve_spp(&self, hints: &SceneSettings, integrator: IntegratorKind) -> u32 {
        let is_limited = self.time.is_some() || self.noise.is_some();
        let default = if is_limited {
            Self::SPP_OF_LIMITS
        } else {
            let spp = hints.spp.unwrap_or(integrator.default_spp());
            spp.clamp(1, Self::MAX_SPP)
        };
        self.spp.unwrap_or(default)
    }

    /// True if neither a filter nor more than one sample per pixel is requested.
    fn leaves_pixel_position(&self) -> bool {
        self.filter.is_none() && self.spp.unwrap_or(1) == 1
    }

    fn resolve_guiding(
        &self,
        integrator: IntegratorKind,
        size: [u32; 2],
        spp: u32,
    ) -> Result<Option<Guiding>, RequestError> {
        let Some(passes) = self.guiding else { return Ok(None) };
        if integrator != IntegratorKind::Path {
            let name = integrator.name();
            return refused("guiding", format!("is for the integrator path, not for {name}"));
        }
        Ok(Some(match passes {
            GuidingPasses::Count(passes) => Guiding::with_passes(passes),
            GuidingPasses::Auto if self.spp.is_none() && self.time.is_some() => {
                Guiding::with_passes(Guiding::MAX_PASSES)
            }
            GuidingPasses::Auto => Guiding::for_picture(size, spp),
        }))
    }

    fn resolve_caustics(
        &self,
        hints: &SceneSettings,
        integrator: IntegratorKind,
    ) -> Result<CausticsMode, RequestError> {
        if integrator == IntegratorKind::Path {
            let modes = (&CausticsMode::ALL, CausticsMode::name);
            let mode = chosen(self.caustics, ("caustics", &hints.caustics), modes)?;
            if mode == CausticsMode::Off && self.photons.is_some() {
                return refused("photons", "is for caustics, which are off".into());
            }
            return Ok(mode);
        }
        let name = integrator.name();
        for (setting, is_given) in [
            ("caustics", self.caustics == Some(CausticsMode::On)),
            ("photons", self.photons.is_some()),
        ] {
            if is_given {
                return refused(setting, format!("is for the integrator path, not for {name}"));
            }
        }
        Ok(CausticsMode::Off)
    }

    fn resolve_light_groups(&self, scene: &Scene) -> Result<Vec<LightGroup>, RequestError> {
        let mut groups = Vec::new();
        for (name, lights) in self.light_groups.iter().flatten() {
            add_light_group(&mut groups, name, lights, scene)
                .map_err(|problem| RequestError::LightGroup { group: name.clone(), problem })?;
        }
        Ok(groups)
    }
}

/// The user's choice, otherwise the scene's choice by its name, otherwise the default.
fn chosen<T: Copy + Default, const N: usize>(
    wish: Option<T>,
    (parameter, hint): (&'static str, &Option<String>),
    (all, name_of): (&[T; N], impl Fn(T) -> &'static str),
) -> Result<T, RequestError> {
    let (None, Some(name)) = (wish, hint) else { return Ok(wish.unwrap_or_default()) };
    all.iter().copied().find(|&one| name_of(one) == name).ok_or_else(|| {
        let known: Vec<_> = all.iter().map(|&one| name_of(one)).collect();
        RequestError::SceneName { parameter, name: name.clone(), known: known.join(", ") }
    })
}

fn check_pixels(size: [u32; 2]) -> Result<(), RequestError> {
    let [w, h] = size.map(u64::from);
    if w * h > Request::MAX_PIXELS {
        return Err(RequestError::TooManyPixels { size });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use snell_math::Vec3;

    fn camera() -> Camera {
        Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 0.5)
    }

    fn resolved(request: Request, change: impl FnOnce(&mut SceneSettings)) -> Settings {
        let mut scene = Scene::new("empty");
        change(&mut scene.settings);
        request.resolve(&scene, &camera()).expect("the request is possible")
    }

    /// The text of the error that a request gives.
    fn problem(request: Request) -> String {
        let scene = Scene::new("empty");
        request.resolve(&scene, &camera()).expect_err("the request is impossible").to_string()
    }

    #[test]
    fn defaults_are_those_of_the_manual() {
        let settings = resolved(Request::default(), |_| {});
        assert_eq!((settings.size, settings.spp, settings.max_depth), ([960, 720], 64, 10_000));
        assert_eq!((settings.crop, settings.noise, settings.guiding), (None, None, None));
        assert_eq!(settings.integrator, IntegratorKind::Path);
        assert_eq!(settings.build.quality, Quality::Medium);
        assert!(settings.progressive && settings.aovs.is_empty());
        let of = |integrator| {
            let request = Request { integrator: Some(integrator), ..Request::default() };
            let settings = resolved(request, |_| {});
            (settings.spp, settings.max_depth)
        };
        assert_eq!(of(IntegratorKind::Direct), (64, 1));
        assert_eq!(of(IntegratorKind::Ao), (32, 1));
        assert_eq!(of(IntegratorKind::Whitted), (16, 8));
        assert_eq!(of(IntegratorKind::Flat), (16, 1));
    }

    fn ask(hints: &mut SceneSettings) {
        hints.size = Some([100, 50]);
        hints.integrator = Some("whitted".into());
        hints.spp = Some(5);
        hints.max_depth = Some(3);
        hints.sampler = Some("sobol".into());
        hints.shadows = Some("soft".into());
        hints.filter = Some("tent".into());
        hints.exposure = Some(1.0);
        hints.pixel_position = Some([0.0, 0.0]);
    }

    #[test]
    fn the_scene_has_a_say() {
        let settings = resolved(Request::default(), ask);
        assert_eq!((settings.size, settings.spp, settings.max_depth), ([100, 50], 5, 3));
        assert_eq!(settings.integrator, IntegratorKind::Whitted);
        assert_eq!((settings.sampler, settings.filter), (SamplerKind::Sobol, Filter::Tent));
        assert_eq!(settings.shadows, Shadows::Soft);
        assert_eq!(settings.noise_floor, Settings::NOISE_FLOOR / 2.0);
        assert_eq!(settings.pixel_position, Some([0.0, 0.0]));
        let huge = resolved(Request::default(), |hints| {
            (hints.spp, hints.max_depth) = (Some(u32::MAX), Some(u32::MAX));
        });
        assert_eq!((huge.spp, huge.max_depth), (1 << 24, 100_000));
        let camera = Camera { resolution: Some([7, 9]), ..camera() };
        let of_camera = Request::default().resolve(&Scene::new("empty"), &camera);
        assert_eq!(of_camera.map(|settings| settings.size), Ok([7, 9]));
    }

    #[test]
    fn the_user_has_the_last_word() {
        let request = Request {
            size: Some([20, 10]),
            integrator: Some(IntegratorKind::Ao),
            spp: Some(2),
            max_depth: Some(4000),
            roulette_depth: Some(7),
            sampler: Some(SamplerKind::Independent),
            filter: Some(Filter::Box),
            exposure: Some(2.0),
            ..Request::default()
        };
        let settings = resolved(request, ask);
        assert_eq!((settings.size, settings.spp, settings.max_depth), ([20, 10], 2, 4000));
        assert_eq!((settings.integrator, settings.roulette_depth), (IntegratorKind::Ao, Some(7)));
        assert_eq!((settings.sampler, settings.filter), (SamplerKind::Independent, Filter::Box));
        assert_eq!(settings.noise_floor, Settings::NOISE_FLOOR / 4.0);
        assert_eq!(settings.pixel_position, None);
        // An unknown name in the scene is no error if the user's choice overrides it.
        let path = Request { integrator: Some(IntegratorKind::Path), ..Request::default() };
        resolved(path, |hints| hints.integrator = Some("photons".into()));
    }

    #[test]
    fn one_sample_may_stay_where_the_scene_wants_it() {
        let position = |spp, filter| {
            let request = Request { spp, filter, ..Request::default() };
            resolved(request, ask).pixel_position
        };
        assert!(position(Some(1), None).is_some());
        assert!(position(Some(2), None).is_none());
        assert!(position(Some(1), Some(Filter::Box)).is_none());
    }

    #[test]
    fn limits_allow_many_samples() {
        let noise = Request { noise: Some(0.1), ..Request::default() };
        let time = Request { time: Some(Duration::from_secs(1)), ..Request::default() };
        assert_eq!(resolved(noise.clone(), ask).spp, 65536);
        assert_eq!(resolved(time, ask).spp, 65536);
        assert_eq!(resolved(Request { spp: Some(8), ..noise }, ask).spp, 8);
    }

    #[test]
    fn guiding_has_its_share_of_what_is_limited() {
        let passes = |guiding, spp, time: Option<u64>| {
            let time = time.map(Duration::from_secs);
            let request = Request { guiding: Some(guiding), spp, time, ..Request::default() };
            let is_timed = request.is_training_timed();
            (resolved(request, |_| {}).guiding.map(|guiding| guiding.passes), is_timed)
        };
        let share = Guiding::for_picture([960, 720], 64).passes;
        assert_eq!(passes(GuidingPasses::Auto, None, None), (Some(share), false));
        assert_eq!(passes(GuidingPasses::Auto, Some(64), Some(9)), (Some(share), true));
        assert_eq!(passes(GuidingPasses::Auto, None, Some(9)), (Some(Guiding::MAX_PASSES), true));
        assert_eq!(passes(GuidingPasses::Count(3), None, Some(9)), (Some(3), false));
    }

    #[test]
    fn layers_are_what_is_asked_for_and_needed() {
        let denoised = Request { denoise: Some(Denoise::Found), ..Request::default() };
        assert_eq!(resolved(denoised, |_| {}).aovs, [Aov::Albedo, Aov::Normal]);
        let groups = vec![("sky".to_string(), vec!["environment".to_string()])];
        let grouped = Request { light_groups: Some(groups), ..Request::default() };
        let settings = resolved(grouped, |_| {});
        assert_eq!((settings.light_groups.len(), settings.aovs.len()), (1, 2));
    }

    #[test]
    fn errors_name_the_parameter() {
        let empty = Request::default;
        let crop = |min, max| Request { crop: Some(Crop { min, max }), ..empty() };
        let guided = |passes| Request { guiding: Some(passes), ..empty() };
        let groups = vec![("key".to_string(), vec!["lmp".to_string()])];
        let ao = Some(IntegratorKind::Ao);
        let unguided = Request { integrator: ao, ..guided(GuidingPasses::Auto) };
        let off = Some(CausticsMode::Off);
        let dark = Request { caustics: off, photons: Some(1000), ..empty() };
        for (request, expected) in [
            (Request { spp: Some(0), ..empty() }, "spp is 0, expected a whole number from 1 to"),
            (Request { size: Some([0, 5]), ..empty() }, "size is 0, expected sides from 1 to"),
            (Request { noise: Some(0.0), ..empty() }, "noise is 0, expected a number from 0.00"),
            (Request { exposure: Some(f64::NAN), ..empty() }, "exposure is NaN, expected a"),
            (Request { clamp: Some(f32::INFINITY), ..empty() }, "clamp is inf, expected a pos"),
            (Request { ao_distance: Some(-1.0), ..empty() }, "ao_distance is -1, expected a"),
            (crop([0, 0], [961, 1]), "crop 0,0,961,1 reaches beyond the picture of 960x720"),
            (crop([5, 0], [5, 1]), "crop 5,0,5,1 is empty"),
            (guided(GuidingPasses::Count(21)), "guiding is 21, expected a whole number from 1"),
            (unguided, "guiding is for the integrator path, not for ao"),
            (dark, "photons is for caustics, which are off"),
            (Request { light_groups: Some(groups), ..empty() }, "light_groups[\"key\"]: there"),
            (Request { size: Some([65536; 2]), ..empty() }, "a picture of 65536x65536 pixels"),
        ] {
            let problem = problem(request);
            assert!(problem.starts_with(expected), "{problem}");
        }
        let mut scene = Scene::new("empty");
        scene.settings.filter = Some("sinc".into());
        let error = Request::default().resolve(&scene, &camera()).expect_err("no such filter");
        let problem = error.to_string();
        let expected = "the scene asks for the filter \"sinc\", which is none of box, tent, ";
        assert!(problem.starts_with(expected), "{problem}");
    }

    #[test]
    fn a_part_of_a_picture_may_have_what_the_whole_may_not() {
        let crop = Some(Crop { min: [60000, 60000], max: [60010, 60020] });
        let request = Request { size: Some([65536; 2]), crop, ..Request::default() };
        assert_eq!(resolved(request, |_| {}).crop, crop);
    }
}
