//! Sensors with their films and samplers, and the integrator.

use super::Builder;
use super::object::Object;
use crate::scene::fault::{Fault, Spot};
use snell_math::{DAffine3, DVec3, real};
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

/// The clipping planes of a camera, by its number: the distances along the view.
#[derive(Clone, Copy, Debug)]
pub struct Clip {
    camera: usize,
    range: [f64; 2],
    at: Spot,
}

/// Sensors with a view of their own.
const KNOWN: [&str; 3] = ["perspective", "thinlens", "orthographic"];

/// Tangent of half of the angle that a sensor of one ray sees.
const ONE_RAY: f64 = 1e-4;

/// Distance of a near plane that hides something of a scene around the camera, relative to the
/// size of the scene.
const MANY_THINGS: f64 = 0.02;

/// Number of bounces that means no limit.
const UNLIMITED: i64 = 1 << 20;

impl Builder<'_> {
    /// Adds a camera, or the cameras of a batch. The film and sampler of the first one are those of
    /// the scene, and its handedness decides whether the world is mirrored.
    pub(super) fn sensor(&mut self, object: &Object) -> Result<(), Fault> {
        match object.kind.as_str() {
            "batch" => self.batch(object),
            _ => self.view(object, None),
        }
    }

    /// Adds the cameras of sensors that share a film side by side.
    fn batch(&mut self, object: &Object) -> Result<(), Fault> {
        let is_first = self.scene.cameras.is_empty();
        let mut sensors = Vec::new();
        for child in &object.children {
            let inner = self.resolve(child)?;
            if inner.class == "sensor" {
                child.used.set(true);
                sensors.push((child.name.clone(), inner));
            }
        }
        let count = sensors.len() as u32;
        if count == 0 {
            return Err(object.fault("there is no sensor in it", "put one in"));
        }
        let film = match self.inner(object, |o| o.class == "film")? {
            Some(film) => self.film(&film, is_first)?,
            None => Film::whole(SIZE.map(|s| s as u32)),
        };
        if let Some(sampler) = self.inner(object, |o| o.class == "sampler")? {
            self.sampler(&sampler, is_first)?;
        }
        let part = Film::whole([(film.size[0] / count).max(1), film.size[1]]);
        for name in ["shutter_open", "shutter_close"] {
            object.get(name);
        }
        let before = self.scene.cameras.len();
        for (number, (name, sensor)) in (1..).zip(&sensors) {
            if sensor.kind == "batch" {
                return Err(
                    sensor.fault("a batch in a batch", "put its sensors into the outer one")
                );
            }
            let known = self.scene.cameras.len();
            self.view(sensor, Some(part))?;
            if let Some(camera) = self.scene.cameras.get_mut(known)
                && camera.name.is_empty()
            {
                let batch = object.id.as_deref().unwrap_or("batch");
                camera.name =
                    if name.is_empty() { format!("{batch}-{number}") } else { name.clone() };
            }
        }
        if is_first {
            self.scene.settings.size = Some(part.size);
        }
        if let [_, others @ ..] = &self.scene.cameras[before..]
            && !others.is_empty()
        {
            let others: Vec<_> = others.iter().map(|c| format!("\"{}\"", c.name)).collect();
            let owner = object.owner();
            self.mention(owner.clone(), object.at, || {
                format!(
                    "{owner}: its sensors became cameras of their own, of which one is shown; \
                    --camera shows the others: {}",
                    others.join(", ")
                )
            });
        }
        self.note_unused(object);
        Ok(())
    }

    /// Adds the camera of a sensor, with its own film or a part of one that others share.
    fn view(&mut self, object: &Object, shared: Option<Film>) -> Result<(), Fault> {
        let is_first = self.scene.cameras.is_empty();
        let own = self.inner(object, |o| o.class == "film")?;
        let film = match (shared, &own) {
            (Some(film), _) => film,
            (None, Some(film)) => self.film(film, is_first)?,
            (None, None) => Film::whole(SIZE.map(|s| s as u32)),
        };
        if let Some(sampler) = self.inner(object, |o| o.class == "sampler")?
            && shared.is_none()
        {
            self.sampler(&sampler, is_first)?;
        }
        if let Some(medium) = self.inner(object, |o| o.class == "medium")? {
            let medium = self.medium(&medium)?;
            if is_first {
                self.around_camera = medium;
            }
        }
        let is_placed = object.has("to_world");
        let place = match object.kind.as_str() {
            "radiancemeter" => self.meter(object)?,
            kind if KNOWN.contains(&kind) || is_placed => object.transform("to_world")?,
            _ => {
                let owner = object.owner();
                self.ignore_all(object);
                self.note(owner.clone(), object.at, || {
                    format!("{owner} is not supported; a camera that sees the whole scene was used")
                });
                return Ok(());
            }
        };
        if is_first && place.matrix3.determinant() < 0.0 {
            self.world_from_file = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        }
        let mut camera = self.camera(object, self.world_from_file * place, film)?;
        camera.name = object.id.clone().unwrap_or_default();
        camera.resolution = Some(film.crop_size);
        let near = object.float_or("near_clip", 0.0)?;
        let far = object.float_or("far_clip", f64::INFINITY)?;
        let clip = object.properties.iter().find(|p| p.name == "far_clip" || p.name == "near_clip");
        if let Some(clip) = clip {
            self.clips.push(Clip {
                camera: self.scene.cameras.len(),
                range: [near, far],
                at: clip.at,
            });
        }
        for name in ["shutter_open", "shutter_close"] {
            object.get(name);
        }
        self.scene.cameras.push(camera);
        self.note_unused(object);
        Ok(())
    }

    /// The place of a sensor that sees along one ray.
    fn meter(&mut self, object: &Object) -> Result<DAffine3, Fault> {
        let (origin, direction) = (object.vector("origin")?, object.vector("direction")?);
        let owner = object.owner();
        self.mention(owner.clone(), object.at, || {
            format!("{owner} became a camera with a very narrow view: all pixels show one ray")
        });
        if object.has("to_world") {
            return object.transform("to_world");
        }
        let (Some(origin), Some(direction)) = (origin, direction) else {
            if origin.is_some() || direction.is_some() {
                let problem = "its origin or its direction is missing";
                return Err(object.fault(problem, "give both, or to_world"));
            }
            return Ok(DAffine3::IDENTITY);
        };
        let Some(z) = direction.try_normalize() else {
            return Err(object.fault("its direction has no length", "correct it"));
        };
        let (x, y) = z.any_orthonormal_pair();
        Ok(DAffine3::from_cols(x, y, z, origin))
    }

    /// Notes clipping planes that cut something off: cameras see all of a scene.
    pub(super) fn note_clips(&mut self) {
        if self.clips.is_empty() {
            return;
        }
        let Ok(bounds) = self.scene.bounds() else { return };
        if bounds.is_empty() || !bounds.is_finite() {
            return;
        }
        let diagonal = (bounds.max - bounds.min).length();
        for Clip { camera, range: [near, far], at } in std::mem::take(&mut self.clips) {
            let Some(camera) = self.scene.cameras.get(camera) else { continue };
            let depths = (0..8).map(|i| {
                let corner = DVec3::new(
                    if i & 1 == 0 { bounds.min.x } else { bounds.max.x },
                    if i & 2 == 0 { bounds.min.y } else { bounds.max.y },
                    if i & 4 == 0 { bounds.min.z } else { bounds.max.z },
                );
                (corner - camera.eye).dot(camera.towards)
            });
            let [low, high] =
                depths.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], d| [l.min(d), h.max(d)]);
            // A camera in the midst of a scene often has a near plane that cuts nothing.
            let is_cut_near = near > if low > 0.0 { low } else { MANY_THINGS * diagonal };
            if is_cut_near || far < high {
                self.note("clipping planes", at, || {
                    "\"near_clip\" and \"far_clip\" do not clip: the camera also sees what they \
                    hide in Mitsuba"
                        .into()
                });
            }
        }
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
            "radiancemeter" => Projection::Perspective { tan_half_fov: [Some(ONE_RAY), None] },
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
        Ok(Projection::Intrinsics(Intrinsics::new([focal; 2], principal_point, film.crop_size)))
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
            if let (Some(fov), true) = (object.get("fov"), focal_length.is_some()) {
                self.note("fov and focal_length", fov.at, || {
                    "\"fov\" beside \"focal_length\": the focal length was used; Mitsuba refuses \
                    both"
                        .into()
                });
            }
            let (text, at) = focal_length.unwrap_or(("50mm", object.at));
            let length = super::value::number(text.trim().trim_end_matches("mm"));
            let length = length.ok().filter(|l| *l > 0.0);
            let Some(length) = length else {
                return Err(Fault::new(at, "this is not a focal length", "write one like 50mm"));
            };
            // Half of the diagonal of 35 mm film.
            return Ok(of_diagonal(real::hypot(36f64, 24.0) / (2.0 * length)));
        }
        let fov = object.float_within("fov", 0.0, [1e-6, 179.999])?;
        let tan = real::tan((fov * 0.5).to_radians());
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
        if edges == 0 {
            self.note("max_depth 0", object.at, || {
                "\"max_depth\" of 0: nothing is seen in Mitsuba; here emitters are, as with 1"
                    .into()
            });
        }
        // Those that see media have it in their name.
        self.without_media = (object.kind != "ao" && !object.kind.contains("vol"))
            .then(|| (object.owner(), object.at));
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
        // Those that are made for caustics.
        if ["ptracer", "photonmapper", "ppm", "sppm", "vcm"].contains(&object.kind.as_str()) {
            self.scene.settings.caustics = Some("on".into());
            let owner = object.owner();
            self.mention(owner.clone(), object.at, || {
                format!("{owner}: the integrator path with --caustics on was used instead")
            });
        }
        let exact = [
            "ptracer",
            "photonmapper",
            "ppm",
            "sppm",
            "vcm",
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
