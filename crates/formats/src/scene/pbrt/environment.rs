//! Infinite lights.
//!
//! Pictures of pbrt-v4 cover the sphere by an equal-area octahedral map of a square; they are
//! resampled as latitude-longitude pictures. Those of pbrt-v3 have that form already.

use super::Builder;
use super::params::{Params, Type};
use super::spectrum::Role;
use crate::scene::fault::Fault;
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb, real};
use snell_scene::camera::{equal_area_direction, equal_area_place};
use snell_scene::light::environment::Portal;
use snell_scene::{Environment, Image};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Maximum height of a resampled picture.
const MAX_HEIGHT: u32 = 4096;

impl Builder<'_> {
    pub(super) fn environment(
        &mut self,
        params: &Params,
        world_from_light: DAffine3,
    ) -> Result<(), Fault> {
        let kinds = [Type::Rgb, Type::Spectrum, Type::Blackbody, Type::Xyz];
        let color = match params.typed("L", &kinds)? {
            Some(param) => Some(self.color(param, Role::Light)?),
            None => None,
        };
        let mut scale = match params.get("scale") {
            Some(param) => self.color(param, Role::Factor)?,
            None => Rgb::WHITE,
        };
        let illuminance = params.float("illuminance")?.filter(|e| *e > 0.0);
        let portal = self.portal(params)?;
        let is_latlong = params.has("mapname");
        let Some((name, _)) =
            self.file_name(params, if is_latlong { "mapname" } else { "filename" })?
        else {
            let color = color.unwrap_or(Rgb::WHITE);
            if let Some(illuminance) = illuminance {
                // Behind a portal, pbrt makes the light a picture.
                let own = portal.map_or(PI, |_| TAU * f64::from(color.luminance()));
                scale = scale * if own > 0.0 { (illuminance / own) as f32 } else { 0.0 };
            }
            self.set_environment(params, Environment::Constant(color * scale), portal);
            return Ok(());
        };
        if let Some(color) = color {
            if !is_latlong {
                return Err(params.fault("both L and filename are given", "remove one of them"));
            }
            scale = scale * color;
        }
        let image = self.picture_of_light(name, is_latlong);
        if let Some(illuminance) = illuminance
            && !is_latlong
        {
            let own = illuminance_from_above(&image);
            scale = scale * if own > 0.0 { (illuminance / own) as f32 } else { 0.0 };
        }
        let (image, light_from_environment) = if is_latlong {
            // Column 0 is +x and columns grow towards +y. The middle of the picture is -x in pbrt
            // and -z in the scene.
            (image, DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::X))
        } else {
            if image.width != image.height {
                let at = params.at;
                self.note("environment shape", at, || {
                    "the picture of the infinite light is not square, as pbrt-v4 has them; it was \
                        taken for an equal-area map nevertheless"
                        .into()
                });
            }
            (
                Arc::new(latlong(&image, environment_direction)),
                DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
            )
        };
        let world_from_environment =
            DAffine3::from_mat3(world_from_light.matrix3 * light_from_environment);
        let environment = Environment::Image { image, scale, world_from_environment };
        self.set_environment(params, environment, portal);
        Ok(())
    }

    /// The portal of the light, whose corners are in the file's world (`PortalImageInfiniteLight`
    /// of pbrt-v4).
    fn portal(&mut self, params: &Params) -> Result<Option<Portal>, Fault> {
        let points: Vec<DVec3> = params.points("portal")?.iter().map(|p| p.as_dvec3()).collect();
        let &[corner, b, opposite, d] = &points[..] else {
            return match points.len() {
                0 => Ok(None),
                found => Err(params.fault(
                    format!("a portal of {found} corners"),
                    "give four, those of a rectangle, in order around it",
                )),
            };
        };
        let edges = [d - corner, b - corner];
        let size = edges[0].length() + edges[1].length();
        let area = edges[0].cross(edges[1]).length();
        if area.is_nan() || area <= 0.0 {
            self.note("portal area", params.at, || {
                "a portal without area: the environment is not seen through it".into()
            });
        }
        let is_rectangle = (corner + edges[0] + edges[1] - opposite).length() <= 1e-3 * size
            && edges[0].dot(edges[1]).abs() <= 1e-3 * edges[0].length() * edges[1].length();
        if !is_rectangle {
            self.note("portal shape", params.at, || {
                "a portal that is not a rectangle: the parallelogram of its first, second and \
                    fourth corners was used"
                    .into()
            });
        }
        let world_from_file = self.world_from_file;
        let [a, b] = edges.map(|edge| world_from_file.transform_vector3(edge));
        // A mirror turns the cross product over.
        let is_mirrored = world_from_file.matrix3.determinant() < 0.0;
        let edges = if is_mirrored { [b, a] } else { [a, b] };
        Ok(Some(Portal { corner: world_from_file.transform_point3(corner), edges }))
    }

    fn set_environment(
        &mut self,
        params: &Params,
        environment: Environment,
        portal: Option<Portal>,
    ) {
        let had_portals = !self.scene.portals.is_empty();
        match (&self.scene.environment, &environment) {
            // The same light through another window.
            (Some(known), new) if had_portals && portal.is_some() && known == new => {
                self.scene.portals.extend(portal);
                return;
            }
            (Some(Environment::Constant(a)), Environment::Constant(b))
                if !had_portals && portal.is_none() =>
            {
                self.scene.environment = Some(Environment::Constant(*a + *b));
                return;
            }
            (Some(_), _) => self.note("second environment", params.at, || {
                "a second infinite light; it replaces the first instead of adding to it".into()
            }),
            (None, _) => {}
        }
        self.scene.environment = Some(environment);
        self.scene.portals = portal.into_iter().collect();
    }
}

/// The point of the unit square for a unit direction.
fn square_from_direction(d: DVec3) -> [f64; 2] {
    ((equal_area_place(d) + 1.0) * 0.5).to_array()
}

/// The z of the direction for a point of the unit square.
fn height_of_square(p: [f64; 2]) -> f64 {
    equal_area_direction(DVec2::from(p) * 2.0 - 1.0).z
}

/// The illuminance that pbrt computes for a surface that faces up (`+z`) under an equal-area map:
/// half of the true one, because pbrt counts the whole square as a hemisphere. Scenes are tuned to
/// that value.
fn illuminance_from_above(image: &Image) -> f64 {
    let mut sum = 0.0;
    for y in 0..image.height {
        for x in 0..image.width {
            let at = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
            let cosine = height_of_square([at(x, image.width), at(y, image.height)]);
            if cosine > 0.0 {
                let [r, g, b, _] = image.rgba(x, y);
                sum += f64::from(Rgb::new(r, g, b).luminance()) * cosine;
            }
        }
    }
    sum * TAU / (f64::from(image.width) * f64::from(image.height))
}

/// The direction in pbrt's light space, `+z` up, for a polar angle in radians and a fraction of a
/// full turn in the scene's latitude-longitude picture. The picture's x is x, its y is z, and its
/// middle, `-z`, is y.
fn environment_direction(theta: f64, turn: f64) -> DVec3 {
    let ((sin, cos), (sin_phi, cos_phi)) =
        (real::sin_cos(theta), real::sin_cos((turn - 0.5) * TAU));
    DVec3::new(sin * sin_phi, sin * cos_phi, cos)
}

/// Resamples an equal-area map as a latitude-longitude picture. `direction` maps a polar angle in
/// radians and a fraction of a full turn to a unit direction.
pub fn latlong(image: &Image, direction: impl Fn(f64, f64) -> DVec3) -> Image {
    let height = image.height.clamp(2, MAX_HEIGHT);
    let width = 2 * height;
    let mut values = Vec::with_capacity(width as usize * height as usize * 3);
    for row in 0..height {
        let theta = (f64::from(row) + 0.5) / f64::from(height) * PI;
        for column in 0..width {
            let turn = (f64::from(column) + 0.5) / f64::from(width);
            values.extend(lookup(image, square_from_direction(direction(theta, turn))));
        }
    }
    Image::from_f32(width, height, 3, values)
}

/// Bilinear lookup in the square; the border is extended at its edges.
fn lookup(image: &Image, [u, v]: [f64; 2]) -> [f32; 3] {
    let (x, y) = (u * f64::from(image.width) - 0.5, v * f64::from(image.height) - 0.5);
    let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
    let texel = |x: f64, y: f64| {
        let index = |i: f64, n: u32| (i.max(0.0) as u32).min(n - 1);
        image.rgba(index(x, image.width), index(y, image.height))
    };
    let mut color = [0.0; 3];
    for (dx, dy, weight) in [
        (0.0, 0.0, (1.0 - fx) * (1.0 - fy)),
        (1.0, 0.0, fx * (1.0 - fy)),
        (0.0, 1.0, (1.0 - fx) * fy),
        (1.0, 1.0, fx * fy),
    ] {
        let texel = texel(x.floor() + dx, y.floor() + dy);
        for c in 0..3 {
            color[c] += texel[c] * weight;
        }
    }
    color
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_square_covers_the_sphere_evenly() {
        assert_eq!(square_from_direction(DVec3::Z), [0.5, 0.5]);
        let corner = square_from_direction(DVec3::new(1e-9, 1e-9, -1.0));
        assert!((corner[0] - 1.0).abs() < 1e-6 && (corner[1] - 1.0).abs() < 1e-6, "{corner:?}");
        let right = square_from_direction(DVec3::X);
        assert!((right[0] - 1.0).abs() < 1e-6 && (right[1] - 0.5).abs() < 1e-6, "{right:?}");
        // Equal areas: half of the square faces up, and the mean height there is that of a
        // hemisphere.
        let n = 200;
        let cell = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        let heights: Vec<_> = (0..n * n)
            .map(|i| height_of_square([cell(i % n), cell(i / n)]))
            .filter(|z| *z > 0.0)
            .collect();
        let mean = heights.iter().sum::<f64>() / heights.len() as f64;
        assert!(
            (mean - 0.5).abs() < 0.01 && heights.len().abs_diff((n * n / 2) as usize) < 400,
            "{mean} {}",
            heights.len()
        );
    }

    #[test]
    fn directions_have_the_height_of_their_place() {
        for i in 0..100u32 {
            let d = snell_math::sampling::uniform_sphere(snell_math::Vec2::new(
                i as f32 / 100.0,
                (i * 37 % 100) as f32 / 100.0,
            ));
            let d = d.as_dvec3().normalize();
            assert!((height_of_square(square_from_direction(d)) - d.z).abs() < 1e-6, "{d}");
        }
    }

    #[test]
    fn the_illuminance_of_a_constant_map_is_that_of_pbrt() {
        let image = Image::from_f32(64, 64, 3, vec![2.0; 64 * 64 * 3]);
        assert!((illuminance_from_above(&image) / PI - 1.0).abs() < 0.01);
        let snell_scene::Pixels::F32(values) = latlong(&image, environment_direction).pixels else {
            panic!("its pixels are of another type");
        };
        assert!(values.iter().all(|x| (*x - 2.0).abs() < 1e-5));
    }
}
