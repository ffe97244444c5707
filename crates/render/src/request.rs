//! What a user asks of a render, and the settings that follow. A wish of the user counts first,
//! then what the scene asks for, then the default. The command line and Python both fill a
//! [`Request`], so they have the same defaults, ranges and refusals.

use crate::film::filter::Filter;
use crate::guiding::Guiding;
use crate::integrator::IntegratorKind;
use crate::integrator::aov::Aov;
use crate::layers::{add_light_group, needed_aovs};
use crate::light_sampler::LightSamplerKind;
use crate::sampler::SamplerKind;
use crate::settings::{Crop, LightGroup, LightStrategy, Settings, Shadows, Terminator};
use snell_intersect::AcceleratorKind;
use snell_intersect::{BuildOptions, Quality};
use snell_math::ColorModel;
use snell_math::simd::Level;
use snell_scene::{Camera, Scene, SceneSettings};
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

/// How many training passes path guiding makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuidingPasses {
    /// As many as fit into [`Guiding::SHARE`] of the samples, or of the time.
    Auto,
    /// This many, from 1 to [`Guiding::MAX_PASSES`].
    Count(u32),
}

/// Wishes for a render. `None` leaves a choice to the scene, or else to the default.
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
    /// Width and height in pixels, each in [`Request::SIDE`]. Default: the scene's, else the
    /// camera's, else [`Request::DEFAULT_SIZE`].
    pub size: Option<[u32; 2]>,
    /// The part that is rendered: not empty, and within the picture. Default: all of it.
    pub crop: Option<Crop>,
    /// How light is computed. Default: as the scene says, else `path`.
    pub integrator: Option<IntegratorKind>,
    /// Three channels, or wavelengths. Default: `rgb`.
    pub color: Option<ColorModel>,
    /// Samples per pixel, in [`Request::SPP`]. Default: [`Request::SPP_OF_LIMITS`] with `noise` or
    /// `time`, else the scene's, else [`IntegratorKind::default_spp`].
    pub spp: Option<u32>,
    /// The error at which a pixel stops, in [`Request::NOISE`], see [`crate::film::noise`].
    /// Default: pixels do not stop before they have `spp` samples.
    pub noise: Option<f64>,
    /// The time after which the render stops, once every pixel has a sample: at most
    /// [`Request::MAX_SECONDS`]. To stop is left to the caller. Default: no limit.
    pub time: Option<Duration>,
    /// Bounces after the first hit; more than [`Settings::MAX_DEPTH`] count as that. Default: the
    /// scene's, else [`IntegratorKind::default_max_depth`].
    pub max_depth: Option<u32>,
    /// Seed of the random numbers. Default: 0.
    pub seed: Option<u32>,
    /// Source of the random numbers. Default: as the scene says, else `zsobol`.
    pub sampler: Option<SamplerKind>,
    /// Reconstruction filter. Default: as the scene says, else `blackman-harris`.
    pub filter: Option<Filter>,
    /// Shadows of `raycast` and `whitted`. Default: `hard`.
    pub shadows: Option<Shadows>,
    /// Where meshes with smooth normals have their shadow terminator. Default: `smooth`.
    pub terminator: Option<Terminator>,
    /// Which samples find lights. Default: `mis`.
    pub light_samples: Option<LightStrategy>,
    /// How a light is chosen among many. Default: `bvh`.
    pub light_sampler: Option<LightSamplerKind>,
    /// Path guiding, which only the integrator `path` has. Default: off.
    pub guiding: Option<GuidingPasses>,
    /// How far `ao` looks, in scene units: positive. Default: half of the scene's radius.
    pub ao_distance: Option<f32>,
    /// Radiance to which light of two or more bounces is dimmed: positive and finite. Default: off.
    pub clamp: Option<f32>,
    /// Names of light groups with their lights: numbers, names of emissive materials, and
    /// `environment`. Default: none.
    pub light_groups: Option<Vec<(String, Vec<String>)>>,
    /// Extra layers. Default: none, but `normal` for the integrator `aov`.
    pub aovs: Option<Vec<Aov>>,
    /// Whether noise will be removed, for which there are layers that guide a denoiser.
    /// Default: no.
    pub denoise: Option<bool>,
    /// Exposure in stops with which `noise` looks at the picture, in [`Request::EXPOSURE`].
    /// Default: the scene's, else 0.
    pub exposure: Option<f64>,
    /// Acceleration structure. Default: `bvh`.
    pub accelerator: Option<AcceleratorKind>,
    /// How the `bvh` is built. Default: `medium`.
    pub quality: Option<Quality>,
    /// Whether the `bvh` is kept in less memory, see [`BuildOptions::compact`]. Default: no.
    pub bvh_compact: Option<bool>,
    /// A folder that keeps the `bvh` of large meshes, see [`BuildOptions::cache`]. Default: none.
    pub bvh_cache: Option<PathBuf>,
    /// Instructions that the kernels use. Default: the best that the processor has.
    pub simd: Option<Level>,
}

/// Why a request has no settings.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// The value of a parameter is impossible: by itself, or together with the others.
    #[error("{parameter} {problem}")]
    Parameter {
        /// The field of [`Request`].
        parameter: &'static str,
        /// What is wrong with it, to be read after its name.
        problem: String,
    },
    /// A group of `light_groups` cannot be made.
    #[error("light_groups[{group:?}]: {problem}")]
    LightGroup {
        /// The name of the group.
        group: String,
        /// What is wrong with it.
        problem: String,
    },
    /// What would be rendered has more than [`Request::MAX_PIXELS`].
    #[error(
        "a picture of {}x{} pixels is larger than the limit of {} pixels",
        .size[0], .size[1], Request::MAX_PIXELS
    )]
    TooManyPixels {
        /// Width and height of what would be rendered.
        size: [u32; 2],
    },
    /// The scene's own settings have a name that is not known.
    #[error("the scene asks for the {parameter} \"{name}\", which is none of {known}")]
    SceneName {
        /// The field of [`Request`], and of the scene's settings.
        parameter: &'static str,
        /// The unknown name.
        name: String,
        /// The known ones.
        known: String,
    },
}

/// An error that names a parameter.
fn refused<T>(parameter: &'static str, problem: String) -> Result<T, RequestError> {
    Err(RequestError::Parameter { parameter, problem })
}

impl Request {
    /// Size of a picture for which neither user, scene nor camera has one.
    pub const DEFAULT_SIZE: [u32; 2] = [960, 720];
    /// Width and height of a picture.
    pub const SIDE: RangeInclusive<u32> = 1..=1 << 16;
    /// Most pixels that are rendered: as many as Snell would read back. (Whether there is memory
    /// for them is another matter, see [`crate::memory`].)
    pub const MAX_PIXELS: u64 = 1 << 28;
    /// Samples per pixel.
    pub const SPP: RangeInclusive<u32> = 1..=1 << 24;
    /// Samples per pixel that a limit of time or noise alone allows.
    pub const SPP_OF_LIMITS: u32 = 1 << 16;
    /// Most samples per pixel that are taken in one pass.
    const SPP_OF_ONE_PASS: u32 = 16;
    /// Longest time limit, in seconds.
    pub const MAX_SECONDS: f64 = 1e9;
    /// Error at which a pixel stops.
    pub const NOISE: RangeInclusive<f64> = 1e-5..=10.0;
    /// Exposure in stops.
    pub const EXPOSURE: RangeInclusive<f64> = -100.0..=100.0;

    /// The settings of a render of this scene by this camera.
    pub fn resolve(&self, scene: &Scene, camera: &Camera) -> Result<Settings, RequestError> {
        self.check_ranges()?;
        let (hints, default) = (&scene.settings, Settings::default());
        let integrators = (&IntegratorKind::ALL, IntegratorKind::name);
        let integrator = chosen(self.integrator, ("integrator", &hints.integrator), integrators)?;
        let samplers = (&SamplerKind::ALL, SamplerKind::name);
        let sampler = chosen(self.sampler, ("sampler", &hints.sampler), samplers)?;
        let filters = (&Filter::ALL, Filter::name);
        let filter = chosen(self.filter, ("filter", &hints.filter), filters)?;
        let size = self.size.or(hints.size).or(camera.resolution).unwrap_or(Self::DEFAULT_SIZE);
        let crop = self.crop_within(size)?;
        check_pixels(crop.unwrap_or(Crop::full(size)).size())?;
        let spp = self.resolve_spp(hints, integrator);
        let light_groups = self.resolve_light_groups(scene)?;
        let asked = self.aovs.as_deref().unwrap_or_default();
        let denoise = self.denoise.unwrap_or(false);
        let exposure = self.exposure.or(hints.exposure).unwrap_or(0.0);
        let max_depth = self.max_depth.or(hints.max_depth);
        Ok(Settings {
            size,
            crop,
            spp,
            noise: self.noise,
            noise_floor: Settings::NOISE_FLOOR / exposure.exp2(),
            progressive: self.time.is_some() || spp > Self::SPP_OF_ONE_PASS,
            seed: self.seed.unwrap_or(default.seed),
            sampler,
            filter,
            pixel_position: hints.pixel_position.filter(|_| self.leaves_pixel_position()),
            integrator,
            color: self.color.unwrap_or_default(),
            max_depth: max_depth.unwrap_or(integrator.default_max_depth()).min(Settings::MAX_DEPTH),
            shadows: self.shadows.unwrap_or_default(),
            terminator: self.terminator.unwrap_or_default(),
            light_strategy: self.light_samples.unwrap_or_default(),
            light_sampler: self.light_sampler.unwrap_or_default(),
            guiding: self.resolve_guiding(integrator, size, spp)?,
            ao_distance: self.ao_distance,
            clamp: self.clamp,
            aovs: needed_aovs(asked, integrator, &light_groups, denoise),
            light_groups,
            build: self.build(),
            ..default
        })
    }

    /// How acceleration structures are built; the scene has no say in it.
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

    /// The crop; an error if it is empty, or not within a picture of this size.
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

    /// True if training for guiding ends when it has had its share of the time. Where passes are
    /// counted the clock has no say: bits must repeat.
    pub fn is_training_timed(&self) -> bool {
        self.guiding == Some(GuidingPasses::Auto) && self.time.is_some()
    }

    fn check_ranges(&self) -> Result<(), RequestError> {
        for side in self.size.into_iter().flatten() {
            check("size", Some(side), &Self::SIDE, "sides")?;
        }
        check("spp", self.spp, &Self::SPP, "a whole number")?;
        check("noise", self.noise, &Self::NOISE, "a number")?;
        check("exposure", self.exposure, &Self::EXPOSURE, "a number")?;
        if let Some(GuidingPasses::Count(passes)) = self.guiding {
            check("guiding", Some(passes), &(1..=Guiding::MAX_PASSES), "a whole number")?;
        }
        check_positive("ao_distance", self.ao_distance, f32::INFINITY)?;
        check_positive("clamp", self.clamp, f32::MAX)
    }

    fn resolve_spp(&self, hints: &SceneSettings, integrator: IntegratorKind) -> u32 {
        let is_limited = self.time.is_some() || self.noise.is_some();
        let default = if is_limited {
            Self::SPP_OF_LIMITS
        } else {
            let spp = hints.spp.unwrap_or(integrator.default_spp());
            spp.clamp(*Self::SPP.start(), *Self::SPP.end())
        };
        self.spp.unwrap_or(default)
    }

    /// True unless a filter, or samples that it would spread, are asked for.
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

    fn resolve_light_groups(&self, scene: &Scene) -> Result<Vec<LightGroup>, RequestError> {
        let mut groups = Vec::new();
        for (name, lights) in self.light_groups.iter().flatten() {
            add_light_group(&mut groups, name, lights, scene)
                .map_err(|problem| RequestError::LightGroup { group: name.clone(), problem })?;
        }
        Ok(groups)
    }
}

/// What the user asks for, else the scene by one of the names of all choices, else the default.
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

fn check<T: PartialOrd + Display>(
    parameter: &'static str,
    value: Option<T>,
    range: &RangeInclusive<T>,
    what: &str,
) -> Result<(), RequestError> {
    match value {
        Some(value) if !range.contains(&value) => {
            let (low, high) = (range.start(), range.end());
            refused(parameter, format!("is {value}, expected {what} from {low} to {high}"))
        }
        _ => Ok(()),
    }
}

fn check_positive(name: &'static str, value: Option<f32>, most: f32) -> Result<(), RequestError> {
    match value {
        Some(value) if !(value > 0.0 && value <= most) => {
            refused(name, format!("is {value}, expected a positive number"))
        }
        _ => Ok(()),
    }
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

    /// What the error says.
    fn problem(request: Request) -> String {
        let scene = Scene::new("empty");
        request.resolve(&scene, &camera()).expect_err("the request is impossible").to_string()
    }

    #[test]
    fn defaults_are_those_of_the_manual() {
        let settings = resolved(Request::default(), |_| {});
        assert_eq!((settings.size, settings.spp, settings.max_depth), ([960, 720], 64, 1000));
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
        assert_eq!(settings.noise_floor, Settings::NOISE_FLOOR / 2.0);
        assert_eq!(settings.pixel_position, Some([0.0, 0.0]));
        let huge = resolved(Request::default(), |hints| {
            (hints.spp, hints.max_depth) = (Some(u32::MAX), Some(u32::MAX));
        });
        assert_eq!((huge.spp, huge.max_depth), (1 << 24, 1000));
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
            sampler: Some(SamplerKind::Independent),
            filter: Some(Filter::Box),
            exposure: Some(2.0),
            ..Request::default()
        };
        let settings = resolved(request, ask);
        assert_eq!((settings.size, settings.spp, settings.max_depth), ([20, 10], 2, 1000));
        assert_eq!(settings.integrator, IntegratorKind::Ao);
        assert_eq!((settings.sampler, settings.filter), (SamplerKind::Independent, Filter::Box));
        assert_eq!(settings.noise_floor, Settings::NOISE_FLOOR / 4.0);
        assert_eq!(settings.pixel_position, None);
        // A name of the scene that nobody needs does no harm.
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
        let denoised = Request { denoise: Some(true), ..Request::default() };
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
