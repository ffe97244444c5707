//! Heckbert's minimal ray tracer: scenes of spheres, as in the ACM contest of 1987 and on the
//! author's business card (P. Heckbert, A Minimal Ray Tracer, Graphics Gems IV, 1994).

use super::palette::minimal;
use crate::camera::{Camera, Projection};
use crate::graph::{Background, Node, Scene, Surface};
use crate::light::{Attenuation, Light, Point};
use serde::{Deserialize, Serialize};
use snell_intersect::shape::Sphere;
use snell_math::{DAffine3, DVec3, Rgb, real};
use std::f32::consts::PI;

/// A scene in the terms of the original program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MinrayDescription {
    /// Name of the scene.
    #[serde(default)]
    pub name: String,
    /// Maximal depth of the ray tree: 1 follows primary rays only.
    pub depth: u32,
    /// The picture has `size` times `size` pixels.
    pub size: u32,
    /// Total angle of view in degrees, horizontal and vertical.
    pub aov_degrees: f64,
    /// Radiance of the ambient light and of the background.
    pub ambient: [f32; 3],
    /// The spheres, which are the only primitives.
    pub spheres: Vec<MinraySphere>,
}

/// A sphere. The fields have the names of the original's data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MinraySphere {
    /// x coordinate of the centre.
    pub x: f64,
    /// y coordinate of the centre.
    pub y: f64,
    /// z coordinate of the centre; z points up.
    pub z: f64,
    /// Red of the colour.
    pub r: f32,
    /// Green of the colour.
    pub g: f32,
    /// Blue of the colour.
    pub b: f32,
    /// Radius.
    pub rad: f64,
    /// Diffuse coefficient, multiplied by the colour.
    pub kd: f32,
    /// Coefficient of the reflected ray's radiance.
    pub ks: f32,
    /// Coefficient of the refracted ray's radiance.
    pub kt: f32,
    /// Luminosity, multiplied by the colour. A sphere with a positive one is a light.
    pub kl: f32,
    /// Index of refraction.
    pub ir: f32,
}

/// The reason why a description cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MinrayError {
    /// A number is out of range.
    #[error("{name} is {found}; expected {expected}")]
    OutOfRange {
        /// The name of the number.
        name: &'static str,
        /// The value that was given.
        found: f64,
        /// The values that are allowed.
        expected: &'static str,
    },
    /// A number of a sphere is invalid.
    #[error("sphere {number} (counted from 1): {name} is {found}; expected {expected}")]
    Sphere {
        /// The sphere's position in the list, from 1.
        number: usize,
        /// The name of the number.
        name: &'static str,
        /// The value that was given.
        found: f64,
        /// The values that are allowed.
        expected: &'static str,
    },
}

impl MinrayDescription {
    fn check(&self) -> Result<(), MinrayError> {
        let error = |name, found, expected| Err(MinrayError::OutOfRange { name, found, expected });
        if self.depth == 0 {
            return error("depth", 0.0, "at least 1 (0 would be a black picture)");
        }
        if self.size == 0 || self.size > 65_536 {
            return error("size", self.size.into(), "1 to 65536 pixels");
        }
        if !(self.aov_degrees > 0.0 && self.aov_degrees < 180.0) {
            return error(
                "aov_degrees",
                self.aov_degrees,
                "an angle of view between 0 and 180 degrees",
            );
        }
        if let Some(&a) = self.ambient.iter().find(|a| !a.is_finite()) {
            return error("ambient", a.into(), "a finite number");
        }
        self.spheres.iter().enumerate().try_for_each(|(i, s)| s.check(i + 1))
    }
}

impl MinraySphere {
    fn check(&self, number: usize) -> Result<(), MinrayError> {
        let floats = [
            ("r", self.r),
            ("g", self.g),
            ("b", self.b),
            ("kd", self.kd),
            ("ks", self.ks),
            ("kt", self.kt),
        ];
        let floats = floats
            .into_iter()
            .chain([("kl", self.kl), ("ir", self.ir)])
            .map(|(name, x)| (name, f64::from(x)));
        let doubles = [("x", self.x), ("y", self.y), ("z", self.z), ("rad", self.rad)];
        if let Some((name, found)) = floats.chain(doubles).find(|(_, x)| !x.is_finite()) {
            return Err(MinrayError::Sphere { number, name, found, expected: "a finite number" });
        }
        if self.rad <= 0.0 {
            let (name, found) = ("rad", self.rad);
            return Err(MinrayError::Sphere { number, name, found, expected: "a radius above 0" });
        }
        if self.ir <= 0.0 {
            let (name, found) = ("ir", self.ir.into());
            return Err(MinrayError::Sphere {
                number,
                name,
                found,
                expected: "an index of refraction above 0",
            });
        }
        Ok(())
    }

    fn center(&self) -> DVec3 {
        DVec3::new(self.x, self.y, self.z)
    }

    fn color(&self) -> Rgb {
        Rgb::new(self.r, self.g, self.b)
    }

    /// The light of a luminous sphere: a point light at its centre, without attenuation. The
    /// original adds `kl colour cos` to what `kd` multiplies, whereas a Lambertian surface of
    /// reflectance `kd` reflects `1 / pi` of its irradiance.
    fn light(&self) -> Light {
        Light::Point(Point {
            position: self.center(),
            intensity: self.color() * (self.kl * PI),
            attenuation: Attenuation::NONE,
            body_radius: self.rad,
        })
    }
}

/// The scene of a description, with the settings for which the integrator `whitted` gives the
/// original's picture.
pub fn minray_scene(description: &MinrayDescription) -> Result<Scene, MinrayError> {
    description.check()?;
    let mut scene = Scene::new(&description.name);
    for (i, sphere) in description.spheres.iter().enumerate() {
        let material = minimal(&format!("sphere {}", i + 1), sphere);
        let material = scene.add_material(material);
        let shape = Surface::shape(Sphere { radius: sphere.rad }, material);
        let transform = DAffine3::from_translation(sphere.center());
        let node =
            Node { transform, surfaces: vec![shape], ..Node::named(format!("sphere {}", i + 1)) };
        scene.add_child(scene.root, node);
        if sphere.kl > 0.0 {
            scene.lights.push(sphere.light());
        }
    }
    scene.ambient = description.ambient.into();
    scene.background = Background::Color(scene.ambient);
    set_view(&mut scene, description);
    scene.settings.integrator = Some("whitted".into());
    scene.settings.max_depth = Some(description.depth - 1);
    scene.settings.spp = Some(1);
    scene.settings.raw_display = true;
    Ok(scene)
}

/// Sets a camera at the origin that looks along `+y`, with `z` up. With `h = size / 2` rounded
/// down, the ray of pixel `(x, y)` has the direction `(x - h, h / tan(aov / 2), h - y)`. For an
/// even size, these rays pass through the upper left corners of the pixels of a view with that
/// angle. For an odd size, they pass through the pixels' centres in a view that is wider by
/// `size / (2 h)`.
fn set_view(scene: &mut Scene, description: &MinrayDescription) {
    let size = description.size;
    let half = f64::from((size / 2).max(1));
    let widened = f64::from(size) / (2.0 * half);
    let tan = real::tan(description.aov_degrees.to_radians() / 2.0) * widened;
    let projection = Projection::Perspective { tan_half_fov: [Some(tan), Some(tan)] };
    let camera = Camera::from_direction(DVec3::ZERO, DVec3::Y, DVec3::Z, projection);
    scene.cameras.push(Camera { name: "eye".into(), resolution: Some([size, size]), ..camera });
    scene.settings.size = Some([size, size]);
    let position = if size.is_multiple_of(2) { 0.0 } else { 0.5 };
    scene.settings.pixel_position = Some([position, position]);
}

/// The built-in scene of the business card: `test1` of the contest.
pub fn scene() -> Scene {
    // Each row holds x y z, r g b, rad, kd ks kt kl, ir.
    let spheres: [[f64; 12]; 5] = [
        [0.0, 6.0, 0.5, 1.0, 1.0, 1.0, 0.9, 0.05, 0.2, 0.85, 0.0, 1.7],
        [-1.0, 8.0, -0.5, 1.0, 0.5, 0.2, 1.0, 0.7, 0.3, 0.0, 0.05, 1.2],
        [1.0, 8.0, -0.5, 0.1, 0.8, 0.8, 1.0, 0.3, 0.7, 0.0, 0.0, 1.2],
        [3.0, -6.0, 15.0, 1.0, 0.8, 1.0, 7.0, 0.0, 0.0, 0.0, 0.6, 1.5],
        [-3.0, -3.0, 12.0, 0.8, 1.0, 1.0, 5.0, 0.0, 0.0, 0.0, 0.5, 1.5],
    ];
    let description = MinrayDescription {
        name: "minray".into(),
        depth: 3,
        size: 32,
        aov_degrees: 25.0,
        ambient: [0.02; 3],
        spheres: spheres.map(MinraySphere::from).to_vec(),
    };
    minray_scene(&description).expect("the numbers are in range")
}

impl From<[f64; 12]> for MinraySphere {
    /// The sphere with these twelve numbers, in the order of the original.
    fn from([x, y, z, r, g, b, rad, kd, ks, kt, kl, ir]: [f64; 12]) -> Self {
        let [r, g, b, kd, ks, kt, kl, ir] = [r, g, b, kd, ks, kt, kl, ir].map(|x| x as f32);
        Self { x, y, z, r, g, b, rad, kd, ks, kt, kl, ir }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CameraSample;
    use snell_math::{DVec2, Vec2};

    fn description(size: u32) -> MinrayDescription {
        let sphere =
            MinraySphere::from([0.0, 5.0, 0.0, 1.0, 0.5, 0.2, 1.0, 0.7, 0.2, 0.1, 0.3, 1.5]);
        let (name, ambient) = ("test".into(), [0.1, 0.2, 0.3]);
        MinrayDescription {
            name,
            depth: 2,
            size,
            aov_degrees: 40.0,
            ambient,
            spheres: vec![sphere],
        }
    }

    #[test]
    fn rays_are_those_of_the_original_for_even_and_odd_sizes() {
        for size in [2, 3, 31, 32] {
            let scene = minray_scene(&description(size)).expect("in range");
            let [px, py] = scene.settings.pixel_position.expect("a position");
            let h = f64::from(size / 2);
            for (x, y) in [(0, 0), (size - 1, 0), (size / 2, size / 2), (1, size - 1)] {
                let film = DVec2::new(f64::from(x) + px, f64::from(y) + py);
                let found = scene.cameras[0]
                    .ray(&CameraSample { film, lens: Vec2::ZERO }, [size, size])
                    .ray
                    .direction;
                let (x, y) = (f64::from(x), f64::from(y));
                let expected = DVec3::new(x - h, h / 20f64.to_radians().tan(), h - y).normalize();
                assert!(
                    (found.as_dvec3() - expected).length() < 1e-6,
                    "{size} {x} {y}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn luminous_spheres_are_lights_with_a_body() {
        let scene = minray_scene(&description(32)).expect("in range");
        let Light::Point(Point { position, intensity, attenuation, body_radius }) =
            &scene.lights[0]
        else {
            panic!("a point")
        };
        assert_eq!((*position, *body_radius), (DVec3::new(0.0, 5.0, 0.0), 1.0));
        assert_eq!(*attenuation, Attenuation::NONE);
        assert!((intensity.g - 0.15 * PI).abs() < 1e-6);
        let material = &scene.materials[0];
        assert_eq!(material.emission.factor, Rgb::new(1.0, 0.5, 0.2) * 0.3);
        assert!(material.emits_on_both_sides);
    }

    #[test]
    fn settings_ask_for_the_originals_picture() {
        let scene = minray_scene(&description(32)).expect("in range");
        let settings = &scene.settings;
        assert_eq!(
            (settings.size, settings.spp, settings.max_depth),
            (Some([32, 32]), Some(1), Some(1))
        );
        assert_eq!(settings.integrator.as_deref(), Some("whitted"));
        assert!(settings.raw_display);
        assert_eq!(scene.background, Background::Color(Rgb::new(0.1, 0.2, 0.3)));
        assert_eq!(scene.ambient, Rgb::new(0.1, 0.2, 0.3));
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let refused = |change: fn(&mut MinrayDescription)| {
            let mut d = description(32);
            change(&mut d);
            minray_scene(&d).expect_err("out of range").to_string()
        };
        assert!(refused(|d| d.depth = 0).contains("depth is 0"));
        assert!(refused(|d| d.size = 0).contains("size is 0"));
        assert!(refused(|d| d.aov_degrees = f64::NAN).contains("aov_degrees is NaN"));
        assert!(
            refused(|d| d.spheres[0].rad = -1.0).contains("sphere 1 (counted from 1): rad is -1")
        );
        assert!(refused(|d| d.spheres[0].kd = f32::INFINITY).contains("kd is inf"));
        assert!(refused(|d| d.spheres[0].ir = 0.0).contains("index of refraction"));
    }

    /// The listing in the lecture is damaged; these numbers are those of the contest's data.
    #[test]
    fn errata_e10_the_card_has_five_spheres_of_which_three_shine_and_three_levels() {
        let scene = scene();
        let radii = scene.nodes.iter().flat_map(|n| &n.surfaces).map(|s| s.geometry.bounds().max.x);
        assert_eq!(radii.collect::<Vec<_>>(), [0.9, 1.0, 1.0, 7.0, 5.0]);
        assert_eq!((scene.lights.len(), scene.settings.max_depth), (3, Some(2)));
        assert_eq!((scene.settings.size, scene.ambient), (Some([32, 32]), Rgb::splat(0.02)));
        let angle = 2.0
            * (scene.cameras[0]
                .ray(&CameraSample { film: DVec2::new(0.0, 16.0), lens: Vec2::ZERO }, [32, 32]))
            .ray
            .direction
            .dot(snell_math::Vec3::Y)
            .acos();
        assert!(
            (f64::from(angle) - 25f64.to_radians()).abs() < 1e-4,
            "the picture is 25 degrees wide"
        );
    }

    #[test]
    fn the_built_in_scene_is_the_contests_test1() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/minray/test1.json");
        let Ok(text) = std::fs::read_to_string(path) else {
            eprintln!("skipped: {path} is not there");
            return;
        };
        let read: MinrayDescription =
            serde_json::from_str(&text).expect("the description's own JSON");
        let (a, b) = (minray_scene(&read).expect("in range"), scene());
        let centers = |s: &Scene| s.nodes.iter().map(|n| n.transform).collect::<Vec<_>>();
        assert_eq!(centers(&a), centers(&b));
        assert_eq!((a.ambient, a.background), (b.ambient, b.background));
        assert_eq!(
            (a.materials, a.lights, a.cameras, a.settings),
            (b.materials, b.lights, b.cameras, b.settings)
        );
    }
}
