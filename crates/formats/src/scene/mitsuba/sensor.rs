//! Sensors with their films and samplers, and the integrator.

use super::Builder;
use super::object::Object;
use crate::scene::fault::Fault;
use snell_math::{DAffine3, DVec3};
use snell_scene::camera::Intrinsics;
use snell_scene::{Background, Camera, Projection};

/// Default size of the film.
const SIZE: [i64; 2] = [768, 576];
/// The size of a film in pixels, and the part of it that is shown.
#[derive(Clone, Copy, Debug)]
struct Film {
    size: [u32; 2],
    crop_offset: [u32; 2],
    crop_size: [u32; 2],
}

impl Film {
    /// A film of this size, all of which is shown.
    fn whole(size: [u32; 2]) -> Self {
        Self { size, crop_offset: [0; 2], crop_size: size }
    }

    fn is_cropped(&self) -> bool {
        self.crop_size != self.size
    }
}

/// Number of bounces that means no limit.
const UNLIMITED: i64 = 1 << 20;

impl Builder<'_> {
    /// Adds a camera. The film and sampler of the first one are those of the scene, and its
    /// handedness decides whether the world is mirrored.
    pub(super) fn sensor(&mut self, object: &Object) -> Result<(), Fault> {
        let is_first = self.scene.cameras.is_empty();
        let film = self.inner(object, |o| o.class == "film")?;
        let film = match &film {
            Some(film) => self.film(film, is_first)?,
            None => Film::whole(SIZE.map(|s| s as u32)),
        };
        if let Some(sampler) = self.inner(object, |o| o.class == "sampler")? {
            self.sampler(&sampler, is_first)?;
        }
        if let Some(medium) = self.inner(object, |o| o.class == "medium")? {
            let medium = self.medium(&medium)?;
            if is_first {
                self.around_camera = medium;
            }
        }
        let place = object.transform("to_world")?;
        if is_first && place.matrix3.determinant() < 0.0 {
            self.world_from_file = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        }
        let mut camera = self.camera(object, self.world_from_file * place, film)?;
        camera.name = object.id.clone().unwrap_or_default();
        camera.resolution = Some(film.crop_size);
        for name in ["near_clip", "far_clip"] {
            // Clipping planes are ignored: cameras see everything.
            object.get(name);
        }
        for name in ["shutter_open", "shutter_close"] {
            object.get(name);
        }
        self.scene.cameras.push(camera);
        self.note_unused(object);
        Ok(())
    }

    fn camera(&mut self, object: &Object, place: DAffine3, film: Film) -> Result<Camera, Fault> {
        // The camera's x axis points to the left, as seen from behind the camera.
        let [up, towards] = [DVec3::Y, DVec3::Z].map(|axis| place.transform_vector3(axis));
        if !towards.is_finite() || towards.cross(up).length() == 0.0 {
            return Err(object.fault("its transform is singular", "correct to_world"));
        }
        let scale = towards.length();
        let ratio = f64::from(film.size[1]) / f64::from(film.size[0]);
        let mut eye = place.translation;
        let projection = match object.kind.as_str() {
            "orthographic" => {
                let right = place.transform_vector3(DVec3::NEG_X);
                let half = [right.length(), up.length() * ratio];
                // The middle and the size of what is shown, in halves of the film.
                let part = |i: usize| {
                    let [offset, shown, all] =
                        [film.crop_offset[i], film.crop_size[i], film.size[i]].map(f64::from);
                    ((2.0 * offset + shown) / all - 1.0, shown / all)
                };
                eye += right * part(0).0 - up * ratio * part(1).0;
                Projection::Orthographic { half_size: [0, 1].map(|i| Some(half[i] * part(i).1)) }
            }
            "perspective" | "thinlens" => self.perspective(object, film)?,
            _ => {
                let owner = object.owner();
                self.ignore_all(object);
                self.note(owner.clone(), object.at, || {
                    format!("{owner}: a perspective camera was used instead")
                });
                self.perspective(object, film)?
            }
        };
        let camera = Camera::from_direction(eye, towards, up, projection);
        if object.kind != "thinlens" {
            object.get("focus_distance");
            return Ok(camera);
        }
        let aperture = object.float_within("aperture_radius", 0.0, [0.0, 1e30])?;
        let focus = object.positive("focus_distance", 1e4)?;
        if object.get("aperture_map").is_some() || object.has("aperture") {
            self.note("aperture", object.at, || {
                "an aperture of another shape; it became a disk".into()
            });
        }
        Ok(camera.with_lens(aperture * scale, focus * scale))
    }

    fn perspective(&mut self, object: &Object, film: Film) -> Result<Projection, Fault> {
        let [w, h] = film.size.map(f64::from);
        let tan = self.tan_half_fov_x(object, w / h)?;
        let offset = [
            object.float_or("principal_point_offset_x", 0.0)?,
            object.float_or("principal_point_offset_y", 0.0)?,
        ];
        if offset == [0.0; 2] && !film.is_cropped() {
            let tan_half_fov =
                if w >= h { [Some(tan), None] } else { [Some(tan), Some(tan * h / w)] };
            return Ok(Projection::Perspective { tan_half_fov });
        }
        let focal = w / (2.0 * tan);
        // Offsets are added to the place in the film before it is projected, so a positive one
        // moves what is seen to the left and up.
        let [left, top] = film.crop_offset.map(f64::from);
        let principal_point = [w * (0.5 - offset[0]) - left, h * (0.5 - offset[1]) - top];
        Ok(Projection::Intrinsics(Intrinsics {
            focal_length: [focal; 2],
            principal_point,
            skew: 0.0,
            size: film.crop_size,
        }))
    }

    /// Half of the width seen at distance 1, for a picture of this aspect ratio.
    pub(super) fn tan_half_fov_x(&mut self, object: &Object, aspect: f64) -> Result<f64, Fault> {
        let (axis, at) = object.string("fov_axis")?.unwrap_or(("x", object.at));
        if !["x", "y", "smaller", "larger", "diagonal"].contains(&axis) {
            let problem =
                format!("\"{}\" is not an axis of the picture", super::value::shortened(axis));
            return Err(Fault::new(at, problem, "use x, y, diagonal, smaller or larger"));
        }
        let of_diagonal = |tan: f64| tan * aspect / (1.0 + aspect * aspect).sqrt();
        let focal_length = object.string("focal_length")?;
        if focal_length.is_some() || !object.has("fov") {
            object.get("fov");
            let (text, at) = focal_length.unwrap_or(("50mm", object.at));
            let length = super::value::number(text.trim().trim_end_matches("mm"));
            let length = length.ok().filter(|l| *l > 0.0);
            let Some(length) = length else {
                return Err(Fault::new(at, "this is not a focal length", "write one like 50mm"));
            };
            // Half of the diagonal of 35 mm film.
            return Ok(of_diagonal(36f64.hypot(24.0) / (2.0 * length)));
        }
        let fov = object.float_within("fov", 0.0, [1e-6, 179.999])?;
        let tan = (fov * 0.5).to_radians().tan();
        Ok(match axis {
            "x" => tan,
            "y" => tan * aspect,
            "smaller" => tan * aspect.max(1.0),
            "larger" => tan * aspect.min(1.0),
            _ => of_diagonal(tan),
        })
    }

    fn film(&mut self, film: &Object, is_first: bool) -> Result<Film, Fault> {
        let range = [1, 1 << 16];
        let size = [
            film.integer_within("width", range)?.unwrap_or(SIZE[0]),
            film.integer_within("height", range)?.unwrap_or(SIZE[1]),
        ];
        let filter = self.inner(film, |o| o.class == "rfilter")?;
        let (mut crop_offset, mut crop_size) = ([0; 2], size);
        for (i, [offset, extent]) in
            [["crop_offset_x", "crop_width"], ["crop_offset_y", "crop_height"]].iter().enumerate()
        {
            crop_offset[i] = film.integer_within(offset, [0, size[i] - 1])?.unwrap_or(0);
            let room = size[i] - crop_offset[i];
            crop_size[i] = film.integer_within(extent, [1, room])?.unwrap_or(room);
        }
        let [size, crop_offset, crop_size] =
            [size, crop_offset, crop_size].map(|pair| pair.map(|s| s as u32));
        if is_first {
            self.scene.settings.size = Some(crop_size);
            match &filter {
                Some(filter) => self.filter(filter)?,
                None => self.scene.settings.filter = Some("gaussian".into()),
            }
        }
        // The file format of the picture is set on the command line.
        for name in [
            "filename",
            "file_format",
            "pixel_format",
            "component_format",
            "gamma",
            "banner",
            "attach_log",
            "sample_border",
            "high_quality_edges",
            "tonemap_method",
            "exposure",
            "key",
            "burn",
            "fast_approx",
            "compensate",
        ] {
            film.get(name);
        }
        self.note_unused(film);
        Ok(Film { size, crop_offset, crop_size })
    }

    fn filter(&mut self, filter: &Object) -> Result<(), Fault> {
        let ours = match filter.kind.as_str() {
            "box" => "box",
            "tent" => "tent",
            "gaussian" => "gaussian",
            "mitchell" => "mitchell",
            "lanczos" => "lanczos",
            _ => {
                let owner = filter.owner();
                self.note(owner.clone(), filter.at, || {
                    format!("{owner}: the filter mitchell was used instead")
                });
                "mitchell"
            }
        };
        self.scene.settings.filter = Some(ours.into());
        if filter.float_or("stddev", 0.5)? != 0.5 || filter.float_or("radius", 0.0)? != 0.0 {
            let owner = filter.owner();
            self.note(format!("{owner} size"), filter.at, || {
                format!("{owner} of another size: the default size was used")
            });
        }
        for name in ["lobes", "b", "c"] {
            filter.get(name);
        }
        self.note_unused(filter);
        Ok(())
    }

    fn sampler(&mut self, sampler: &Object, is_first: bool) -> Result<(), Fault> {
        let spp = sampler.integer_within("sample_count", [1, 1 << 24])?.unwrap_or(4);
        if is_first {
            self.scene.settings.spp = Some(spp as u32);
            let plain =
                ["independent", "stratified"].into_iter().find(|kind| *kind == sampler.kind);
            self.scene.settings.sampler = plain.map(String::from);
        }
        for name in ["seed", "jitter", "dimension", "scramble"] {
            sampler.get(name);
        }
        self.note_unused(sampler);
        Ok(())
    }

    pub(super) fn integrator(&mut self, object: &Object) -> Result<(), Fault> {
        let inner = self.inner(object, |o| o.class == "integrator")?;
        if let Some(inner) = inner {
            if object.get("aovs").is_some() {
                self.mention("aovs", object.at, || {
                    "the layers of an aov integrator were ignored: give --aov instead".into()
                });
            }
            self.integrator(&inner)?;
            return Ok(());
        }
        // Mitsuba counts path edges: 1 shows emitters, 2 their light on surfaces.
        let edges = object.integer_within("max_depth", [-1, UNLIMITED])?.unwrap_or(-1);
        let bounces = if edges < 0 { UNLIMITED } else { (edges - 1).max(0) };
        self.scene.settings.max_depth = Some(bounces as u32);
        let ours = match object.kind.as_str() {
            "direct" => {
                self.scene.settings.max_depth = None;
                "direct"
            }
            "ao" => "ao",
            _ => "path",
        };
        self.scene.settings.integrator = Some(ours.into());
        let exact = [
            "path",
            "volpath",
            "volpathmis",
            "volpath_simple",
            "direct",
            "ao",
            "prb",
            "prb_basic",
            "prbvolpath",
        ];
        if !exact.contains(&object.kind.as_str()) {
            let owner = object.owner();
            self.mention(owner.clone(), object.at, || {
                format!("{owner}: the integrator {ours} was used instead")
            });
        }
        if object.bool_or("hide_emitters", false)? {
            self.scene.background = Background::Transparent;
            self.hides_emitters = true;
        }
        // These parameters affect only the noise.
        for name in [
            "rr_depth",
            "strict_normals",
            "samples_per_pass",
            "block_size",
            "emitter_samples",
            "bsdf_samples",
            "shading_samples",
            "timeout",
            "sample_num",
            "delta",
        ] {
            object.get(name);
        }
        self.note_unused(object);
        Ok(())
    }
}
