//! Options before `WorldBegin`: camera, film, sampler, filter and integrator.

use super::lexer::quoted;
use super::params::Params;
use super::state::Motion;
use super::{Builder, camera};
use crate::scene::fault::{Fault, Spot};
use snell_math::spectrum::WHITE_TEMPERATURES;
use snell_scene::Material;

/// The options of a scene as written.
#[derive(Debug, Default)]
pub struct RenderOptions {
    /// The camera, and the map from the world to camera space.
    pub camera: Option<(Params, Motion, Spot)>,
    film: Option<Params>,
    sampler: Option<Params>,
    filter: Option<Params>,
    integrator: Option<Params>,
    /// The part of the film that is shown, if it is not all.
    crop: Option<Crop>,
    /// The diagonal of the film in mm, if it is given.
    pub diagonal: Option<f64>,
}

/// A part of the film in pixels: left, top, width and height.
#[derive(Clone, Copy, Debug)]
pub struct Crop {
    /// The first column and row.
    pub offset: [u32; 2],
    /// Columns and rows.
    pub size: [u32; 2],
}

/// Default size of the picture.
const SIZE: [i64; 2] = [1280, 720];
/// The default of pbrt-v3.
const SIZE_V3: [i64; 2] = [640, 480];

impl Builder<'_> {
    /// Reads `Camera`, `Film` and the like.
    pub(super) fn render_option(&mut self, directive: &str, params: Params) -> Result<(), Fault> {
        if self.in_world {
            return Err(params.fault("options must come before WorldBegin", "move it up"));
        }
        match directive {
            "Camera" => {
                let transform = self.state.transform;
                let Some(inverse) = transform.inverse() else {
                    return Err(params.fault(
                        "the current transform is singular",
                        "correct the transforms above it",
                    ));
                };
                self.coordinate_systems.insert("camera".into(), inverse);
                let at = params.at;
                self.media.around_camera = Some(self.state.media[1].clone());
                self.options.camera = Some((params, transform, at));
            }
            "Film" => {
                self.is_v3 |= is_kind(&params, "image");
                self.options.film = Some(params);
            }
            "Sampler" => self.options.sampler = Some(params),
            "PixelFilter" => self.options.filter = Some(params),
            "Integrator" => self.options.integrator = Some(params),
            // Accelerators do not affect the picture.
            _ => {}
        }
        Ok(())
    }

    /// Determines what the world needs: the film's size, the camera, and whether the scene is
    /// mirrored.
    pub(super) fn start_world(&mut self) -> Result<(), Fault> {
        if let Some(film) = self.options.film.take() {
            self.film(&film)?;
        } else if self.in_world {
            self.set_size(SIZE);
        }
        let Some((params, camera_from_file, _)) = self.options.camera.take() else {
            if self.in_world && self.scene.cameras.is_empty() {
                let params = Params::default().of("the default camera".into());
                self.camera(&params, Motion::IDENTITY)?;
            }
            return Ok(());
        };
        self.camera(&params, camera_from_file)?;
        self.note_unused(&params);
        Ok(())
    }

    /// Handles the remaining options at the end of the scene.
    pub(super) fn finish_options(&mut self) -> Result<(), Fault> {
        if !self.in_world {
            self.start_world()?;
        }
        for (what, params) in [
            ("Sampler", self.options.sampler.take()),
            ("PixelFilter", self.options.filter.take()),
            ("Integrator", self.options.integrator.take()),
        ] {
            let Some(params) = params else { continue };
            match what {
                "Sampler" => self.sampler(&params)?,
                "PixelFilter" => self.filter(&params)?,
                _ => self.integrator(&params)?,
            }
            self.note_unused(&params);
        }
        Ok(())
    }

    fn camera(&mut self, params: &Params, camera_from_file: Motion) -> Result<(), Fault> {
        let [start, end] = camera_from_file.0;
        self.note_camera_motion(params, [start, end].map(|m| m.inverse()))?;
        let size = self.scene.settings.size.unwrap_or(SIZE.map(|s| s as u32));
        let crop = self.options.crop;
        let built = camera::build(self, params, start.inverse(), size, crop)?;
        self.scene.settings.size = built.camera.resolution;
        self.world_from_file = built.world_from_file;
        self.scene.cameras = vec![built.camera];
        Ok(())
    }

    /// Seconds that the shutter of the camera is open.
    fn shutter_time(&self) -> Result<f64, Fault> {
        let Some((params, ..)) = &self.options.camera else { return Ok(1.0) };
        Ok(params.float_or("shutterclose", 1.0)? - params.float_or("shutteropen", 0.0)?)
    }

    fn set_size(&mut self, size: [i64; 2]) {
        self.scene.settings.size = Some(size.map(|s| s as u32));
    }

    fn film(&mut self, params: &Params) -> Result<(), Fault> {
        let default = if self.is_v3 { SIZE_V3 } else { SIZE };
        let size = [
            params.integer("xresolution")?.unwrap_or(default[0]),
            params.integer("yresolution")?.unwrap_or(default[1]),
        ];
        if size.iter().any(|s| !(1..=1 << 16).contains(s)) {
            let problem = format!("a picture of {} x {} pixels", size[0], size[1]);
            return Err(params.fault(problem, "give sizes from 1 to 65536"));
        }
        self.set_size(size);
        self.sensor(params)?;
        self.options.crop = crop(params, size)?;
        self.note_ignored(
            params,
            &["maxcomponentvalue", "maxsampleluminance"],
            "samples are not clamped",
        );
        self.options.diagonal = params.float("diagonal")?;
        // File name and file format of the picture are set on the command line.
        for name in ["filename", "savefp16", "coordinatesystem"] {
            params.get(name);
        }
        self.note_unused(params);
        Ok(())
    }

    /// Reads the sensor (`PixelSensor::Create` of pbrt-v4).
    fn sensor(&mut self, params: &Params) -> Result<(), Fault> {
        // Films of pbrt-v3 have a factor instead of a sensitivity.
        let ratio = match self.is_v3 {
            true => params.float_or("scale", 1.0)?,
            false => self.shutter_time()? * params.float_or("iso", 100.0)? / 100.0,
        };
        if ratio < 0.0 {
            self.note("imaging ratio", params.at, || {
                format!("the film multiplies light by {ratio}: the picture is black")
            });
        }
        let sensor = params.string("sensor")?.unwrap_or("cie1931");
        let mut white = params.float_or("whitebalance", 0.0)?;
        if sensor != "cie1931" {
            let sensor = quoted(sensor.as_bytes());
            self.note("sensor", params.at, || {
                format!(
                    "the sensor {sensor}: colours are those of the CIE observer with its white \
                    balance instead"
                )
            });
            // Sensors of real cameras have a white balance by default.
            white = if white == 0.0 { 6500.0 } else { white };
        }
        if white != 0.0 && !WHITE_TEMPERATURES.contains(&white) {
            let (coldest, hottest) = WHITE_TEMPERATURES.into_inner();
            self.note("whitebalance", params.at, || {
                format!(
                    "a white balance of {white} K: the nearest temperature from {coldest} to \
                    {hottest} K was used"
                )
            });
        }
        self.scene.settings.imaging_ratio = Some(ratio).filter(|ratio| *ratio != 1.0);
        self.scene.settings.white_balance = Some(white).filter(|white| *white != 0.0);
        Ok(())
    }

    fn sampler(&mut self, params: &Params) -> Result<(), Fault> {
        let stratified = match (params.integer("xsamples")?, params.integer("ysamples")?) {
            (Some(x), Some(y)) => Some(x.saturating_mul(y)),
            _ => None,
        };
        let spp = params.integer("pixelsamples")?.or(stratified).unwrap_or(16);
        if !(1..=1 << 24).contains(&spp) {
            return Err(params
                .fault(format!("{spp} samples per pixel"), "give a number from 1 to 16777216"));
        }
        self.scene.settings.spp = Some(spp as u32);
        // All better samplers of pbrt are replaced by Snell's default.
        let plain = ["independent", "stratified"].into_iter().find(|n| is_kind(params, n));
        self.scene.settings.sampler = plain.map(String::from);
        for name in ["randomization", "seed", "jitter", "dimensions"] {
            params.get(name);
        }
        Ok(())
    }

    fn filter(&mut self, params: &Params) -> Result<(), Fault> {
        // pbrt's name, Snell's name, and the default radius in pixels.
        let known = [
            ("box", "box", 0.5),
            ("triangle", "tent", 1.0),
            ("gaussian", "gaussian", 1.5),
            ("mitchell", "mitchell", 2.0),
            ("sinc", "lanczos", 3.0),
        ];
        let Some((_, ours, radius)) = known.into_iter().find(|(kind, ..)| is_kind(params, kind))
        else {
            let owner = params.owner.clone();
            self.note(owner.clone(), params.at, || {
                format!("{owner} is not known; the default filter was used")
            });
            return Ok(());
        };
        self.scene.settings.filter = Some(ours.into());
        let mut given = Vec::new();
        for name in ["xradius", "yradius", "xwidth", "ywidth"] {
            given.extend(params.float(name)?);
        }
        if let Some(other) = given.into_iter().find(|r| *r != radius) {
            let owner = params.owner.clone();
            self.note(format!("{owner} radius"), params.at, || {
                format!(
                    "{owner} of radius {other}: radius {radius} was used, the only one of this \
                    filter"
                )
            });
        }
        if params.float_or("sigma", 0.5)? != 0.5 || params.float_or("alpha", 2.0)? != 2.0 {
            self.note("filter sigma", params.at, || {
                "a Gaussian of another width: the standard deviation 0.5 was used".into()
            });
        }
        for name in ["B", "C", "tau"] {
            params.get(name);
        }
        Ok(())
    }

    /// Lifts the limit of bounces in scenes with subsurface scattering: in pbrt, the way from where
    /// light enters to where it leaves is one bounce, and here each scattering on it is a bounce.
    fn give_room_below(&mut self, depth: i64, at: Spot) {
        if depth > 0 && self.scene.materials.iter().any(Material::has_own_medium) {
            self.scene.settings.max_depth = None;
            self.mention("depth of subsurface", at, || {
                format!(
                    "\"maxdepth\" {depth} was ignored, because each scattering below a surface is \
                    a bounce here: paths end by Russian roulette"
                )
            });
        }
    }

    fn integrator(&mut self, params: &Params) -> Result<(), Fault> {
        let depth = params.integer("maxdepth")?.unwrap_or(5);
        if !(0..=1 << 20).contains(&depth) {
            return Err(
                params.fault(format!("a depth of {depth}"), "give a number from 0 to 1048576")
            );
        }
        self.scene.settings.max_depth = Some(depth as u32);
        let ours = if is_kind(params, "whitted") {
            // Mirrors and glass, and a random point of each light at every hit. The first hit
            // counts in pbrt-v3, and bounces are counted here.
            self.scene.settings.max_depth = Some((depth as u32).saturating_sub(1));
            self.scene.settings.shadows = Some("soft".into());
            "whitted"
        } else if is_kind(params, "ambientocclusion") || is_kind(params, "ao") {
            "ao"
        } else if is_kind(params, "directlighting") {
            "direct"
        } else {
            "path"
        };
        self.scene.settings.integrator = Some(ours.into());
        if ours != "whitted" {
            self.give_room_below(depth, params.at);
        }
        // Those that are made for caustics.
        let by_photons = ["sppm", "vcm", "photonmap", "exphotonmap"];
        if by_photons.iter().any(|kind| is_kind(params, kind)) {
            self.scene.settings.caustics = Some("on".into());
            let owner = params.owner.clone();
            self.mention(owner.clone(), params.at, || {
                format!("{owner}: the integrator path with --caustics on was used instead")
            });
        }
        let exact = [
            "sppm",
            "vcm",
            "photonmap",
            "exphotonmap",
            "whitted",
            "path",
            "volpath",
            "simplepath",
            "simplevolpath",
            "directlighting",
            "ambientocclusion",
            "ao",
        ];
        if !exact.iter().any(|kind| is_kind(params, kind)) {
            let owner = params.owner.clone();
            self.mention(owner.clone(), params.at, || {
                format!("{owner}: the integrator {ours} was used instead")
            });
        }
        // The choice of lights and the ends of paths affect only the noise.
        for name in [
            "lightsampler",
            "lightsamplestrategy",
            "regularize",
            "rrthreshold",
            "samplelights",
            "samplebsdf",
        ] {
            params.get(name);
        }
        let names = [
            "photonsperiteration",
            "radius",
            "seed",
            "iterations",
            "numiterations",
            "mutationsperpixel",
            "cossample",
        ];
        self.mention_ignored(params, &names, "it belongs to another integrator");
        Ok(())
    }
}

/// True if a directive is of this kind: `Sampler "halton"`.
pub fn is_kind(params: &Params, kind: &str) -> bool {
    params.owner.ends_with(&format!(" {}", quoted(kind.as_bytes())))
}

/// The part of the film that `cropwindow` or `pixelbounds` shows (FilmBaseParameters of pbrt-v4).
fn crop(params: &Params, size: [i64; 2]) -> Result<Option<Crop>, Fault> {
    let bounds: Vec<i64> = params.floats("pixelbounds")?.iter().map(|x| *x as i64).collect();
    let window = params.floats("cropwindow")?;
    let ends: [[i64; 2]; 2] = match (window, &bounds[..]) {
        (&[x0, x1, y0, y1], _) => {
            let end = |t: f64, i: usize| (t.clamp(0.0, 1.0) * size[i] as f64).ceil() as i64;
            let ends = |a: f64, b: f64, i: usize| [end(a.min(b), i), end(a.max(b), i)];
            [ends(x0, x1, 0), ends(y0, y1, 1)]
        }
        ([], &[x0, x1, y0, y1]) => [[x0, x1], [y0, y1]],
        ([], []) => return Ok(None),
        _ => {
            let problem = "the part of the film is not x from, x to, y from, y to";
            return Err(params.fault(problem, "give four numbers"));
        }
    };
    let ends = [0, 1].map(|i| ends[i].map(|end| end.clamp(0, size[i]) as u32));
    if ends.iter().any(|[from, to]| from >= to) {
        return Err(params.fault("the part of the film that is shown is empty", "enlarge it"));
    }
    let (offset, shown) = (ends.map(|[from, _]| from), ends.map(|[from, to]| to - from));
    Ok((shown.map(i64::from) != size).then_some(Crop { offset, size: shown }))
}
