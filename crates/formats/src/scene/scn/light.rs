//! The lights. They are in world coordinates, even inside groups.

use super::Builder;
use super::file::File;
use crate::ReadError;
use snell_math::{DVec3, Rgb};
use snell_scene::Light;
use snell_scene::light::{Attenuation, Directional, Disk, Point, Rectangle, Spot, SpotFalloff};
use std::f32::consts::PI;

/// The diffuse term of the assignments is `c kd cos`; with `kd / pi` for a BRDF the light must be
/// pi times brighter.
fn irradiance(color: Rgb) -> Rgb {
    color * PI
}

fn attenuation(file: &mut File) -> Result<Attenuation, ReadError> {
    Ok(Attenuation(file.tokens.numbers::<3>("an attenuation coefficient")?.map(|x| x as f32)))
}

/// The default lights of a scene without any: from the upper right front, and weaker from below.
pub fn default_lights() -> [Light; 2] {
    let light = |color, x, y, z| {
        let direction = DVec3::new(x, y, z).normalize();
        Directional { direction, irradiance: irradiance(Rgb::splat(color)) }.into()
    };
    [light(1.0, -3.0, -4.0, -5.0), light(0.5, 3.0, 2.0, 3.0)]
}

impl Builder {
    fn light_color(&mut self, file: &mut File) -> Result<Rgb, ReadError> {
        self.color(file, "the color of the light").map(irradiance)
    }

    pub fn read_directional_light(&mut self, file: &mut File) -> Result<(), ReadError> {
        let irradiance = self.light_color(file)?;
        let direction = file.tokens.direction("the direction of the light")?;
        self.scene.add_light(Directional { direction, irradiance });
        Ok(())
    }

    pub fn read_point_light(&mut self, file: &mut File) -> Result<(), ReadError> {
        let intensity = self.light_color(file)?;
        let position = file.tokens.vector("the position of the light")?;
        let attenuation = attenuation(file)?;
        self.scene.add_light(Point { position, intensity, attenuation, body_radius: 0.0 });
        Ok(())
    }

    pub fn read_spot_light(&mut self, file: &mut File) -> Result<(), ReadError> {
        let intensity = self.light_color(file)?;
        let position = file.tokens.vector("the position of the light")?;
        let direction = file.tokens.direction("the direction of the light")?;
        let attenuation = attenuation(file)?;
        let cutoff = file.tokens.number("the cut-off angle")?.clamp(0.0, std::f64::consts::PI);
        let exponent = file.tokens.number("the drop-off exponent")?.max(0.0);
        let falloff = SpotFalloff::Power { cutoff, exponent };
        self.scene.add_light(Spot { position, direction, intensity, attenuation, falloff });
        Ok(())
    }

    pub fn read_area_light(&mut self, file: &mut File) -> Result<(), ReadError> {
        let emission = self.light_color(file)?;
        let position = file.tokens.vector("the position of the light")?;
        let direction = file.tokens.direction("the direction of the light")?;
        let radius = file.tokens.number("the radius of the light")?.abs();
        let attenuation = attenuation(file)?;
        self.scene.add_light(Disk { position, direction, radius, emission, attenuation });
        Ok(())
    }

    pub fn read_rect_light(&mut self, file: &mut File) -> Result<(), ReadError> {
        let emission = self.light_color(file)?;
        let center = file.tokens.vector("the position of the light")?;
        let first = file.tokens.peek();
        let axes =
            [file.tokens.direction("the first axis")?, file.tokens.direction("the second axis")?];
        if let (true, Some(first)) = (axes[0].cross(axes[1]).length_squared() < 1e-20, first) {
            let problem = "the axes of the light are parallel and span no rectangle";
            return Err(file.tokens.error(&first, problem, "use perpendicular axes"));
        }
        let lengths = file.tokens.numbers::<2>("the length of a side")?.map(f64::abs);
        let attenuation = attenuation(file)?;
        self.scene.add_light(Rectangle { center, axes, lengths, emission, attenuation });
        Ok(())
    }
}
