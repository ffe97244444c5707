//! The camera, and the defaults of a scene without one.

use super::Builder;
use super::file::File;
use super::light::default_lights;
use crate::ReadError;
use snell_math::{DVec3, Rgb, real};
use snell_scene::{Camera, Projection};

/// Half of the horizontal angle of view of the default camera, radians.
const DEFAULT_XFOV: f64 = 0.25;

/// The assignments' default size of pictures.
const DEFAULT_SIZE: [u32; 2] = [256, 256];

impl Builder {
    /// Reads `camera`; the last one counts. The near and far distances were meant for a previewer:
    /// here, rays are not clipped.
    pub fn read_camera(&mut self, file: &mut File) -> Result<(), ReadError> {
        let eye = file.tokens.vector("the eye")?;
        let towards = file.tokens.direction("the view direction")?;
        let up = file.tokens.vector("the up vector")?;
        let token = file.tokens.peek();
        let xfov = file.tokens.number("the half-angle of view")?;
        if let (false, Some(token)) = (xfov > 0.0 && xfov < std::f64::consts::FRAC_PI_2, token) {
            let problem = format!("the half-angle of view is {xfov}");
            let remedy =
                "use radians above 0 and below pi / 2 for half of the horizontal angle of view";
            return Err(file.tokens.error(&token, problem, remedy));
        }
        file.tokens.numbers::<2>("the near or far distance")?;
        let right = towards.cross(up).try_normalize().unwrap_or_else(|| {
            self.scene.warn(
                "the camera's up vector is parallel to its view direction; another one was chosen",
            );
            towards.any_orthonormal_vector()
        });
        self.camera = Some(camera(eye, towards, right.cross(towards), xfov));
        Ok(())
    }

    /// Reads a colour. Negative components become 0.
    pub fn color(&mut self, file: &mut File, what: &str) -> Result<Rgb, ReadError> {
        let color = file.tokens.color(what)?;
        if color.r.min(color.g).min(color.b) < 0.0 {
            self.scene.warn(format!("{what} has a negative component, which counts as 0"));
        }
        Ok(color.map(|x| x.max(0.0)))
    }

    /// Adds a default camera, lights and size, if the scene has none, once all files are read.
    pub fn add_defaults(&mut self) {
        if self.scene.lights.is_empty() {
            self.scene.lights.extend(default_lights());
        }
        let camera = self.camera.take().or_else(|| self.default_camera());
        self.scene.cameras.extend(camera);
        self.scene.settings.size = Some(DEFAULT_SIZE);
        // The programs of the courses write clamped linear values; lights and materials were chosen
        // to look right that way.
        self.scene.settings.raw_display = true;
        // These programs evaluate the format's own shading model: ambient light, Phong highlights,
        // perfect mirrors, hard shadows.
        self.scene.settings.integrator = Some("whitted".into());
    }

    /// A camera on the z axis of the scene's bounding box, three half-diagonals away. `None` if the
    /// scene is empty.
    fn default_camera(&self) -> Option<Camera> {
        let bounds = self.scene.bounds().ok()?.union(&self.line_bounds);
        let radius = bounds.size().length() / 2.0;
        let eye = bounds.center() + DVec3::Z * (3.0 * radius);
        // Far beyond this, distances overflow in single precision.
        let is_near = eye.abs().max_element() < 1e30;
        (!bounds.is_empty() && radius > 0.0 && is_near)
            .then(|| camera(eye, DVec3::NEG_Z, DVec3::Y, DEFAULT_XFOV))
    }
}

fn camera(eye: DVec3, towards: DVec3, up: DVec3, xfov: f64) -> Camera {
    Camera {
        name: "camera".into(),
        eye,
        towards,
        up,
        projection: Projection::Perspective { tan_half_fov: [Some(real::tan(xfov)), None] },
        aperture_radius: 0.0,
        focus_distance: 1.0,
        resolution: None,
        clip: None,
    }
}
