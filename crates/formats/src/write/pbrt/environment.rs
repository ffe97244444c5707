//! Environment lights. pbrt-v4 has its pictures on an equal-area octahedral square:
//! latitude-longitude pictures are resampled.

use super::{File, rgb, transform};
use crate::write::picture::encoded;
use rayon::prelude::*;
use snell_math::{DAffine3, DMat3, DVec3, real};
use snell_scene::light::environment::Portal;
use snell_scene::{Environment, Image};
use std::f64::consts::{FRAC_PI_4, PI, TAU};

/// Maximum side of the square.
const MAX_SIDE: u32 = 4096;

impl File<'_, '_> {
    pub fn environment(&mut self) {
        match &self.scene.environment {
            None => {}
            Some(Environment::Constant(color)) => {
                let color = rgb(*color);
                for portal in self.portals() {
                    self.line(format!("LightSource \"infinite\" \"rgb L\" {color}{portal}"));
                }
            }
            Some(Environment::Image { image, scale, world_from_environment }) => {
                self.output.lose(
                    "the picture of the environment is resampled on a square, as pbrt requires",
                );
                let mut square = square_of(image);
                if let snell_scene::Pixels::F32(values) = &mut square.pixels {
                    for pixel in values.chunks_exact_mut(3) {
                        pixel
                            .iter_mut()
                            .zip([scale.r, scale.g, scale.b])
                            .for_each(|(v, s)| *v *= s);
                    }
                }
                let name = self.output.file("environment.exr", encoded(&square).0);
                let axes = world_from_environment.matrix3 * LIGHT_FROM_ENVIRONMENT.inverse();
                let place = transform(&DAffine3::from_mat3(axes));
                for portal in self.portals() {
                    self.line(format!(
                        "AttributeBegin\n  {place}\n  LightSource \"infinite\" \"string \
                            filename\" [ \"{name}\" ]{portal}\nAttributeEnd"
                    ));
                }
            }
        }
    }

    /// The parameter of each portal, whose light is one of its own in pbrt; an empty one if there
    /// are no portals.
    fn portals(&self) -> Vec<String> {
        let bare = |p: DVec3| format!("{} {} {}", p.x, p.y, p.z);
        let text = |portal: &Portal| {
            let (p, [a, b]) = (portal.corner, portal.edges);
            let corners = [p, p + b, p + a + b, p + a].map(bare).join("  ");
            format!(" \"point3 portal\" [ {corners} ]")
        };
        match &self.scene.portals[..] {
            [] => vec![String::new()],
            portals => portals.iter().map(text).collect(),
        }
    }
}

/// The zenith is `z` in pbrt and `y` in the scene.
const LIGHT_FROM_ENVIRONMENT: DMat3 = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);

/// Resamples a latitude-longitude picture on the equal-area square.
fn square_of(image: &Image) -> Image {
    let side = (image.height * 2).clamp(16, MAX_SIDE);
    let row = |y: u32| {
        (0..side).flat_map(move |x| {
            // Each value is the mean at four points, so that small bright features keep about their
            // power.
            let mut sum = [0.0f32; 3];
            for (dx, dy) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
                let at = |i: u32, d: f64| (f64::from(i) + d) / f64::from(side);
                let direction =
                    LIGHT_FROM_ENVIRONMENT.inverse() * direction_of_square(at(x, dx), at(y, dy));
                let color = lookup(image, direction);
                (0..3).for_each(|c| sum[c] += 0.25 * color[c]);
            }
            sum
        })
    };
    let values: Vec<f32> = (0..side).into_par_iter().flat_map_iter(row).collect();
    Image::from_f32(side, side, 3, values)
}

/// The unit direction for a point of the unit square, `+z` in its middle (Clarberg, Fast Equal-Area
/// Mapping of the (Hemi)Sphere using SIMD, 2008).
pub(super) fn direction_of_square(u: f64, v: f64) -> DVec3 {
    let (u, v) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let distance = 1.0 - (u.abs() + v.abs());
    let radius = 1.0 - distance.abs();
    let angle =
        if radius == 0.0 { FRAC_PI_4 } else { ((v.abs() - u.abs()) / radius + 1.0) * FRAC_PI_4 };
    let z = (1.0 - radius * radius).copysign(distance);
    let around = radius * (2.0 - radius * radius).max(0.0).sqrt();
    let (sin, cos) = real::sin_cos(angle);
    DVec3::new((cos * around).copysign(u), (sin * around).copysign(v), z)
}

/// Radiance of a latitude-longitude picture, bilinear: `+y` is the zenith, `-z` the middle, `+x` to
/// its right.
fn lookup(image: &Image, d: DVec3) -> [f32; 3] {
    let (w, h) = (f64::from(image.width), f64::from(image.height));
    let x = (real::atan2(d.x, -d.z) / TAU + 0.5) * w - 0.5;
    let y = real::acos(d.y.clamp(-1.0, 1.0)) / PI * h - 0.5;
    let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
    let mut color = [0.0; 3];
    for (dx, dy, weight) in [
        (0.0, 0.0, (1.0 - fx) * (1.0 - fy)),
        (1.0, 0.0, fx * (1.0 - fy)),
        (0.0, 1.0, (1.0 - fx) * fy),
        (1.0, 1.0, fx * fy),
    ] {
        let column = (x.floor() + dx).rem_euclid(w) as u32;
        let row = (y.floor() + dy).clamp(0.0, h - 1.0) as u32;
        let texel = image.rgba(column.min(image.width - 1), row);
        (0..3).for_each(|c| color[c] += texel[c] * weight);
    }
    color
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_of_directions_shows_the_same_on_the_square() {
        // Radiance that is linear in the direction.
        let (w, h) = (256, 128);
        let of = |d: DVec3| [d.x, d.y, d.z].map(|c| c as f32 + 2.0);
        let mut values = Vec::new();
        for y in 0..h {
            for x in 0..w {
                let (theta, phi) = (
                    (f64::from(y) + 0.5) / f64::from(h) * PI,
                    ((f64::from(x) + 0.5) / f64::from(w) - 0.5) * TAU,
                );
                values.extend(of(DVec3::new(
                    theta.sin() * phi.sin(),
                    theta.cos(),
                    -theta.sin() * phi.cos(),
                )));
            }
        }
        let square = square_of(&Image::from_f32(w, h, 3, values));
        let mut sum = DVec3::ZERO;
        for y in 0..square.height {
            for x in 0..square.width {
                let at = |i: u32| (f64::from(i) + 0.5) / f64::from(square.width);
                let d = direction_of_square(at(x), at(y));
                sum += d;
                let (found, expected) =
                    (square.rgba(x, y), of(LIGHT_FROM_ENVIRONMENT.inverse() * d));
                for c in 0..3 {
                    assert!(
                        (found[c] - expected[c]).abs() < 0.03,
                        "{d}: {found:?}, expected {expected:?}"
                    );
                }
                assert!((d.length() - 1.0).abs() < 1e-9);
            }
        }
        // Equal areas: directions cancel out.
        assert!(sum.length() < 1e-6 * f64::from(square.width * square.height), "{sum}");
    }
}
