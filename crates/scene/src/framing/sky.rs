//! A neutral studio as a small picture: a soft gradient, a large soft key light and a weaker fill
//! light.

use crate::camera::Camera;
use crate::graph::Environment;
use crate::image::Image;
use snell_math::{DAffine3, DMat3, DVec3, Rgb, real, rotation};
use std::f64::consts::PI;
use std::sync::Arc;

const SIZE: [u32; 2] = [256, 128];

/// Mean luminance of the sky. Most of the light comes from above, and a white level surface has a
/// radiance of about 1.
const MEAN: f64 = 0.42;

/// The studio as seen along `-z` with `+y` up. Under it a grey of 0.5 is well exposed.
pub fn default_sky() -> Environment {
    let [w, h] = SIZE;
    let mut values = Vec::with_capacity((w * h * 3) as usize);
    let (mut sum, mut weights) = (0.0, 0.0);
    for y in 0..h {
        let (sin, cos) = real::sin_cos(PI * (f64::from(y) + 0.5) / f64::from(h));
        for x in 0..w {
            let (s, c) = real::sin_cos((f64::from(x) + 0.5) / f64::from(w) * 2.0 * PI - PI);
            let color = radiance(DVec3::new(sin * s, cos, -sin * c));
            sum += f64::from(Rgb::from(color).luminance()) * sin;
            weights += sin;
            values.extend(color);
        }
    }
    let factor = (MEAN * weights / sum) as f32;
    values.iter_mut().for_each(|v| *v *= factor);
    Environment::Image {
        image: Arc::new(Image::from_f32(w, h, 3, values)),
        scale: Rgb::WHITE,
        world_from_environment: DAffine3::IDENTITY,
    }
}

/// The studio turned so that its key light is at the upper left behind this camera.
pub fn sky_seen_by(camera: &Camera, up: DVec3) -> Environment {
    let up = up.try_normalize().filter(|u| u.is_finite()).unwrap_or(DVec3::Y);
    let level = |v: DVec3| (v - up * up.dot(v)).try_normalize().filter(|v| v.is_finite());
    // For a camera that looks straight down, the camera's up vector takes the place of the view
    // direction.
    let towards = level(camera.towards)
        .filter(|_| camera.towards.dot(up).abs() < 0.999)
        .or_else(|| level(camera.up));
    let back = -towards.unwrap_or_else(|| up.any_orthonormal_vector());
    let rotation = DAffine3::from_mat3(DMat3::from_cols(up.cross(back), up, back));
    match default_sky() {
        Environment::Image { image, scale, .. } => {
            Environment::Image { image, scale, world_from_environment: rotation }
        }
        constant => constant,
    }
}

/// Linear radiance from a unit direction, before scaling to the mean.
fn radiance(d: DVec3) -> [f32; 3] {
    // The gradient goes from the floor over the horizon to the ceiling.
    let gradient = 0.18 + 0.36 * smooth(-0.4, 0.9, d.y);
    let key = soft_box(d, DVec3::new(-0.55, 0.65, 0.55), 0.55, 8.0);
    let fill = soft_box(d, DVec3::new(0.9, 0.25, 0.3), 0.5, 0.5);
    let rim = soft_box(d, DVec3::new(0.5, 0.5, -0.8), 0.35, 1.8);
    // The key light is slightly warm, the others slightly cool.
    let channel = |warm: f64, cool: f64| (gradient + key * warm + (fill + rim) * cool) as f32;
    [channel(1.02, 0.98), channel(1.0, 1.0), channel(0.96, 1.03)]
}

/// Radiance in direction `d` from a round light with a soft edge around `toward`; `radius` is in
/// radians.
fn soft_box(d: DVec3, toward: DVec3, radius: f64, radiance: f64) -> f64 {
    let angle = rotation::angle_between(d, toward);
    radiance * (1.0 - smooth(0.4 * radius, radius, angle))
}

fn smooth(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Projection;
    use crate::light::environment::EnvironmentLight;
    use snell_math::{ColorMode, Vec3};

    fn luminance(light: &EnvironmentLight, d: Vec3) -> f32 {
        ColorMode::Rgb.to_rgb(light.radiance(d.normalize(), ColorMode::Rgb)).luminance()
    }

    #[test]
    fn the_exposure_suits_a_grey_surface_and_the_light_is_nearly_neutral() {
        let sky = default_sky();
        let light = EnvironmentLight::new(&sky);
        assert!((light.mean_luminance() - MEAN).abs() < 1e-3);
        // Computes the radiance of a white matte surface with this normal.
        let shown = |normal: Vec3| {
            let n = 4096;
            let frame = snell_math::Frame::from_z(normal);
            let values = (0..n).map(|i| {
                let u = snell_math::rng::uniform2([i, 0, 0, 0]);
                luminance(&light, frame.from_local(snell_math::sampling::cosine_hemisphere(u)))
            });
            values.sum::<f32>() / n as f32
        };
        assert!((0.8..1.3).contains(&shown(Vec3::Y)), "{}", shown(Vec3::Y));
        assert!((0.4..1.2).contains(&shown(Vec3::Z)), "{}", shown(Vec3::Z));
        assert!((0.2..0.8).contains(&shown(Vec3::NEG_Z)), "{}", shown(Vec3::NEG_Z));
        let Environment::Image { image, .. } = &sky else { panic!("the sky is a picture") };
        for (x, y) in [(0, 0), (100, 64), (30, 30), (200, 100)] {
            let [r, g, b, _] = image.rgba(x, y);
            assert!(r > 0.0 && (r / g - 1.0).abs() < 0.05 && (b / g - 1.0).abs() < 0.05);
        }
    }

    #[test]
    fn the_key_light_comes_from_the_upper_left_behind_the_camera() {
        for (towards, up) in [
            (DVec3::NEG_Z, DVec3::Y),
            (DVec3::X, DVec3::Y),
            (DVec3::Y, DVec3::Z),
            (DVec3::NEG_Y, DVec3::Y),
        ] {
            let camera = Camera::from_direction(DVec3::ZERO, towards, up, Projection::Panoramic);
            let light = EnvironmentLight::new(&sky_seen_by(&camera, up));
            let forward = if towards.dot(up).abs() > 0.9 { camera.up } else { camera.towards };
            let at = |right: f64, height: f64, back: f64| {
                let d = camera.right() * right + up * height - forward * back;
                luminance(&light, d.as_vec3())
            };
            let key = at(-0.55, 0.65, 0.55);
            assert!(
                key > 4.0 * at(0.55, 0.65, 0.55) && key > 4.0 * at(-0.55, 0.65, -0.55),
                "{towards}"
            );
            assert!(key > 8.0 * at(0.0, -1.0, 0.0));
        }
    }
}
