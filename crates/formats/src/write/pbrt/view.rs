//! Camera, film and the scene's render settings.

use super::{File, point, quoted, transform};
use snell_math::{DAffine3, DMat3, DVec3, Transform, real};
use snell_scene::{Camera, Projection};

/// Default size of pictures.
pub(super) const SIZE: [u32; 2] = [960, 720];

impl File<'_, '_> {
    /// Writes everything before `WorldBegin` except media.
    pub fn view(&mut self) {
        let scene = self.scene;
        let camera = scene.cameras.first();
        let size = scene.settings.size.or(camera.and_then(|c| c.resolution)).unwrap_or(SIZE);
        if let Some(id) = scene.medium {
            self.line(format!("MediumInterface \"\" \"medium-{}\"", id.0));
        }
        if let Some(camera) = camera {
            self.camera(camera, size);
            if camera.clip.is_some() {
                self.output.lose("the plane that clips the camera is left out");
            }
        }
        if scene.cameras.len() > 1 {
            self.output.lose("all cameras but the first are left out");
        }
        let settings = &scene.settings;
        let ratio =
            settings.imaging_ratio.unwrap_or(1.0) * real::exp2(settings.exposure.unwrap_or(0.0));
        let number = |name: &str, value: f64| format!(" \"float {name}\" [ {value} ]");
        let iso =
            Some(ratio).filter(|ratio| *ratio != 1.0).map(|ratio| number("iso", 100.0 * ratio));
        let white = settings.white_balance.map(|kelvin| number("whitebalance", kelvin));
        let picture = quoted(&format!("{}.exr", self.output.stem));
        self.line(format!(
            "Film \"rgb\" \"integer xresolution\" [ {} ] \"integer yresolution\" [ {} ] \"string \
                filename\" [ {picture} ]{}{}",
            size[0],
            size[1],
            iso.unwrap_or_default(),
            white.unwrap_or_default()
        ));
        let is_known = |name: &&str| ["independent", "stratified"].contains(name);
        let sampler = scene.settings.sampler.as_deref().filter(is_known).unwrap_or("zsobol");
        if let Some(spp) = scene.settings.spp {
            if sampler == "stratified" {
                self.line(format!(
                    "Sampler \"stratified\" \"integer xsamples\" [ {spp} ] \"integer \
                    ysamples\" [ 1 ]"
                ));
            } else {
                self.line(format!("Sampler \"{sampler}\" \"integer pixelsamples\" [ {spp} ]"));
            }
        }
        let depth = scene.settings.max_depth.unwrap_or(100);
        self.line(format!("Integrator \"volpath\" \"integer maxdepth\" [ {depth} ]"));
        if let Some((_, filter)) = [
            ("box", "box"),
            ("tent", "triangle"),
            ("gaussian", "gaussian"),
            ("mitchell", "mitchell"),
            ("lanczos", "sinc"),
        ]
        .into_iter()
        .find(|(ours, _)| scene.settings.filter.as_deref() == Some(ours))
        {
            self.line(format!("PixelFilter \"{filter}\""));
        }
        if scene.settings.pixel_position.is_some() || scene.settings.tonemap.is_some() {
            self.output.lose("the position of samples in pixels, and the tone map, are left out");
        }
    }

    fn camera(&mut self, camera: &Camera, size: [u32; 2]) {
        let [w, h] = size.map(|n| f64::from(n.max(1)));
        let window = |x: [f64; 2], y: [f64; 2]| {
            format!("\"float screenwindow\" [ {} {} {} {} ]", x[0], x[1], y[0], y[1])
        };
        let both = |half: [Option<f64>; 2]| match half {
            [Some(x), Some(y)] => [x, y],
            [Some(x), None] => [x, x * h / w],
            [None, Some(y)] => [y * w / h, y],
            [None, None] => [w / h, 1.0],
        };
        let text = match &camera.projection {
            Projection::Perspective { tan_half_fov } => {
                let [x, y] = both(*tan_half_fov);
                let is_plain = (x * h / (y * w) - 1.0).abs() < 1e-9;
                let least = x.min(y);
                let fov = format!(
                    "\"perspective\" \"float fov\" [ {} ]",
                    2.0 * real::atan(least).to_degrees()
                );
                let (x, y) = (x / least, y / least);
                if is_plain { fov } else { format!("{fov} {}", window([-x, x], [-y, y])) }
            }
            Projection::Intrinsics(k) => {
                if k.skew != 0.0 {
                    self.output.lose("the skew of the camera matrix is left out");
                }
                if k.is_distorted() {
                    self.output.lose("the distortion of the camera's lens is left out");
                }
                let ([fx, fy], [cx, cy]) = (k.focal_length, k.principal_point_on_film());
                let [kw, kh] = k.size.map(f64::from);
                let (x, y) = ([-cx / fx, (kw - cx) / fx], [(cy - kh) / fy, cy / fy]);
                format!("\"perspective\" \"float fov\" [ 90 ] {}", window(x, y))
            }
            Projection::Orthographic { half_size } => {
                let [x, y] = both(*half_size);
                format!("\"orthographic\" {}", window([-x, x], [-y, y]))
            }
            Projection::Panoramic => {
                "\"spherical\" \"string mapping\" [ \"equirectangular\" ]".into()
            }
            Projection::EqualArea => "\"spherical\" \"string mapping\" [ \"equalarea\" ]".into(),
            Projection::Fisheye { .. } => {
                self.output.lose("a fisheye camera became a perspective one of 90 degrees");
                "\"perspective\" \"float fov\" [ 90 ]".into()
            }
        };
        if camera.projection == Projection::Panoramic {
            // The middle of pbrt's picture is -x in camera space, and its right is -z.
            let axes = DMat3::from_cols(-camera.towards, camera.up, -camera.right());
            let world_from_camera = DAffine3 { matrix3: axes, translation: camera.eye };
            let inverse = Transform::new(world_from_camera)
                .map_or(world_from_camera, |t| *t.inverse_matrix());
            self.line(transform(&inverse));
        } else {
            self.line("Scale -1 1 1");
            let bare = |p: DVec3| point(p).trim_matches(['[', ']', ' ']).to_string();
            let target = camera.eye + camera.towards * camera.focus_distance.clamp(1e-6, 1e6);
            self.line(format!(
                "LookAt {}  {}  {}",
                bare(camera.eye),
                bare(target),
                bare(camera.up)
            ));
        }
        let lens = match camera.aperture_radius {
            r if r > 0.0 => {
                format!(
                    " \"float lensradius\" [ {r} ] \"float focaldistance\" [ {} ]",
                    camera.focus_distance
                )
            }
            _ => String::new(),
        };
        self.line(format!("Camera {text}{lens}"));
    }
}
