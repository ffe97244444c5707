//! Lights that are not surfaces, and area lights.
//!
//! Brightness follows pbrt: a light's RGB colour times `scale` is its radiance, intensity or
//! irradiance; spectra other than RGB are scaled to luminance 1 first. `power` and `illuminance`
//! replace the brightness: the colour is multiplied so that a light of luminance 1 would emit this
//! power (or give this illuminance).

use super::Builder;
use super::environment::latlong;
use super::options::is_kind;
use super::params::{Params, Type};
use super::spectrum::Role;
use crate::scene::fault::Fault;
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb, Transform, real};
use snell_scene::light::{
    Attenuation, Directional, IntensityTable, Point, Profile, Projector, Slide, Spot, SpotFalloff,
};
use snell_scene::material::ColorParam;
use snell_scene::texture::Wrap;
use snell_scene::{Encoding, Image, ImageTexture};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// An area light, which makes the following shapes emit.
#[derive(Clone, Debug)]
pub struct AreaLight {
    /// Radiance in W/(m² sr), before it is scaled to `power`.
    radiance: ColorParam,
    /// Power that every piece of surface emits, in W; `None` if the radiance is used unscaled.
    power: Option<f64>,
    /// Mean luminance of the picture, if there is one; else 1.
    mean: f64,
    /// True if both sides emit.
    pub both_sides: bool,
}

impl AreaLight {
    /// Radiance of a surface that consists of pieces (triangles, or one whole shape) of this mean
    /// area.
    pub fn radiance(&self, piece_area: f64) -> ColorParam {
        let Some(power) = self.power else { return self.radiance };
        let sides = if self.both_sides { 2.0 } else { 1.0 };
        let emitted = sides * piece_area * PI * self.mean;
        let factor = if emitted > 0.0 { (power / emitted) as f32 } else { 0.0 };
        ColorParam { factor: self.radiance.factor * factor, ..self.radiance }
    }

    /// True if the radiance is that of a picture.
    pub fn shows_picture(&self) -> bool {
        self.radiance.texture.is_some()
    }

    /// True if the radiance depends on the size of the surface.
    pub fn depends_on_area(&self) -> bool {
        self.power.is_some()
    }
}

impl Builder<'_> {
    /// The colour of a light times its scale.
    fn light_color(&mut self, params: &Params, name: &str) -> Result<Rgb, Fault> {
        let kinds = [Type::Rgb, Type::Spectrum, Type::Blackbody, Type::Xyz];
        let color = match params.typed(name, &kinds)? {
            Some(param) => self.color(param, Role::Light)?,
            None => Rgb::WHITE,
        };
        let scale = match params.get("scale") {
            // pbrt-v3 allowed colours as scales.
            Some(param) => self.color(param, Role::Factor)?,
            None => Rgb::WHITE,
        };
        Ok(color * scale)
    }

    /// A positive number of a parameter; pbrt ignores other numbers.
    fn positive(&mut self, params: &Params, name: &str) -> Result<Option<f64>, Fault> {
        let value = params.float(name)?;
        if let Some(ignored) = value.filter(|x| *x <= 0.0 || x.is_nan()) {
            let owner = params.owner.clone();
            self.mention(format!("{name} that is not positive"), params.at, || {
                format!(
                    "\"{name}\" {ignored} of {owner} was ignored, as in pbrt: the light has the \
                    brightness of its other parameters"
                )
            });
        }
        Ok(value.filter(|x| *x > 0.0))
    }

    /// Reads `LightSource "point" ...`.
    pub(super) fn light(&mut self, params: Params) -> Result<(), Fault> {
        let place = self.placement(params.at);
        let Some(world_from_light) = Transform::new(self.world_from_file * place) else {
            self.note_singular(params.at);
            return Ok(());
        };
        if self.object.is_some() {
            self.note("light in object", params.at, || {
                "a light within an object definition is placed in the world once".into()
            });
        }
        // These parameters only set the number of samples.
        for name in ["samples", "nsamples"] {
            params.get(name);
        }
        let map = *world_from_light.matrix();
        if is_kind(&params, "point") {
            self.point_light(&params, map)?;
        } else if is_kind(&params, "spot") {
            self.spot_light(&params, map)?;
        } else if is_kind(&params, "distant") {
            self.distant_light(&params, map)?;
        } else if is_kind(&params, "infinite") || is_kind(&params, "exinfinite") {
            self.environment(&params, map)?;
        } else if is_kind(&params, "goniometric") || is_kind(&params, "goniophotometric") {
            self.goniometric_light(&params, map)?;
        } else if is_kind(&params, "projection") {
            self.projection_light(&params, map)?;
        } else {
            let owner = params.owner.clone();
            self.note(owner.clone(), params.at, || {
                format!("{owner} is not known; it was left out")
            });
            return Ok(());
        }
        self.has_lamps = true;
        self.note_unused(&params);
        Ok(())
    }

    fn point_light(&mut self, params: &Params, map: DAffine3) -> Result<(), Fault> {
        let mut intensity = self.light_color(params, "I")?;
        if let Some(power) = self.positive(params, "power")? {
            intensity = intensity * (power / (4.0 * PI)) as f32;
        }
        let position = map.transform_point3(params.point("from")?.unwrap_or(DVec3::ZERO));
        let attenuation = Attenuation::INVERSE_SQUARE;
        self.scene.add_light(Point { position, intensity, attenuation, body_radius: 0.0 });
        Ok(())
    }

    fn spot_light(&mut self, params: &Params, map: DAffine3) -> Result<(), Fault> {
        let mut intensity = self.light_color(params, "I")?;
        let cone = params.float_or("coneangle", 30.0)?.clamp(0.0, 180.0);
        let delta = params.float_or("conedeltaangle", 5.0)?;
        let (outer, inner) = (cone.to_radians(), (cone - delta).clamp(0.0, cone).to_radians());
        if let Some(power) = self.positive(params, "power")? {
            let emitted =
                2.0 * PI * ((1.0 - real::cos(inner)) + (real::cos(inner) - real::cos(outer)) / 2.0);
            intensity = intensity * if emitted > 0.0 { (power / emitted) as f32 } else { 0.0 };
        }
        let Some((position, direction)) = self.axis(params, map)? else { return Ok(()) };
        let falloff = match self.is_v3 {
            false => SpotFalloff::Step { inner, outer },
            true => SpotFalloff::Fourth { inner, outer },
        };
        let attenuation = Attenuation::INVERSE_SQUARE;
        self.scene.add_light(Spot { position, direction, intensity, attenuation, falloff });
        Ok(())
    }

    /// The name of a light's picture, and true if it is given as in pbrt-v3.
    fn light_picture(&mut self, params: &Params) -> Result<(Arc<Image>, bool), Fault> {
        let is_old = params.has("mapname");
        let Some((name, _)) =
            self.file_name(params, if is_old { "mapname" } else { "filename" })?
        else {
            return Err(params.fault("there is no file name", "add \"string filename\""));
        };
        Ok((self.picture_of_light(name, is_old), is_old))
    }

    /// The picture of a light. pbrt-v3 takes the stored values of all pictures for linear ones.
    pub(super) fn picture_of_light(&mut self, name: &str, is_old: bool) -> Arc<Image> {
        let image = self.image(name);
        let image = self.scene.images[image.index()].clone();
        match image.encoding {
            Encoding::Srgb if is_old => {
                Arc::new(Image { encoding: Encoding::Linear, ..Arc::unwrap_or_clone(image) })
            }
            _ => image,
        }
    }

    /// Adds a light whose intensity is a picture of directions, in which y and z are exchanged.
    fn goniometric_light(&mut self, params: &Params, map: DAffine3) -> Result<(), Fault> {
        let mut scale = self.light_color(params, "I")?;
        let (mut image, is_old) = if params.has("mapname") || params.has("filename") {
            self.light_picture(params)?
        } else {
            let owner = params.owner.clone();
            self.mention(format!("{owner} without a picture"), params.at, || {
                format!("{owner} has no \"string filename\": it shines evenly, as in pbrt")
            });
            (Arc::new(Image::from_f32(1, 1, 3, vec![1.0; 3])), false)
        };
        if !is_old {
            image = Arc::new(grey(&image));
        }
        if let Some(power) = self.positive(params, "power")? {
            let pixels = f64::from(image.width) * f64::from(image.height);
            let all = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
            let mean = all.map(|(x, y)| f64::from(image.rgba(x, y)[0])).sum::<f64>() / pixels;
            scale = scale * if mean > 0.0 { (power / (4.0 * PI * mean)) as f32 } else { 0.0 };
        }
        let around = |theta: f64, turn: f64| {
            let ((sin, cos), (sin_phi, cos_phi)) =
                (real::sin_cos(theta), real::sin_cos(turn * TAU));
            DVec3::new(sin * cos_phi, sin * sin_phi, cos)
        };
        let table = if is_old {
            IntensityTable::from_picture(&image)
        } else {
            IntensityTable::from_picture(&latlong(&image, around))
        };
        let (Some(table), Some(axes)) = (table, unit_axes(map)) else { return Ok(()) };
        let world_from_light = axes * DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
        self.scene.add_light(Profile { position: map.translation, world_from_light, scale, table });
        Ok(())
    }

    /// Adds a light that projects a picture along `+z`; `fov` spans the picture's shorter side.
    fn projection_light(&mut self, params: &Params, map: DAffine3) -> Result<(), Fault> {
        let mut scale = self.light_color(params, "I")?;
        let fov = params.float_or("fov", 90.0)?;
        if !(fov > 0.0 && fov < 180.0) {
            return Err(params
                .fault(format!("a field of view of {fov} degrees"), "give one between 0 and 180"));
        }
        let (image, _) = self.light_picture(params)?;
        let aspect = f64::from(image.width) / f64::from(image.height);
        let half = real::tan((fov * 0.5).to_radians());
        let half_size = DVec2::new(aspect.max(1.0), (1.0 / aspect).max(1.0)) * half;
        let (Some(slide), Some(world_from_light)) = (Slide::new(&image, half_size), unit_axes(map))
        else {
            return Ok(());
        };
        if let Some(power) = self.positive(params, "power")? {
            let own = slide.power();
            scale = scale * if own > 0.0 { (power / own) as f32 } else { 0.0 };
        }
        self.scene.add_light(Projector {
            position: map.translation,
            world_from_light,
            scale,
            even: false,
            slide,
        });
        Ok(())
    }

    fn distant_light(&mut self, params: &Params, map: DAffine3) -> Result<(), Fault> {
        let mut irradiance = self.light_color(params, "L")?;
        if let Some(illuminance) = self.positive(params, "illuminance")? {
            irradiance = irradiance * illuminance as f32;
        }
        let Some((_, direction)) = self.axis(params, map)? else { return Ok(()) };
        self.scene.add_light(Directional { direction, irradiance });
        Ok(())
    }

    /// The position of a light, and the direction from `from` to `to`.
    fn axis(&mut self, params: &Params, map: DAffine3) -> Result<Option<(DVec3, DVec3)>, Fault> {
        let from = params.point("from")?.unwrap_or(DVec3::ZERO);
        let to = params.point("to")?.unwrap_or(DVec3::Z);
        let direction = map.transform_vector3(to - from).try_normalize();
        if direction.is_none() {
            let owner = params.owner.clone();
            self.note(format!("{owner} axis"), params.at, || {
                format!("{owner}: from and to coincide; it was left out")
            });
        }
        Ok(direction.map(|direction| (map.transform_point3(from), direction)))
    }

    /// Reads `AreaLightSource "diffuse" ...`.
    pub(super) fn area_light(&mut self, params: Params) -> Result<(), Fault> {
        if !is_kind(&params, "diffuse") && !is_kind(&params, "area") {
            let owner = params.owner.clone();
            self.note(owner.clone(), params.at, || {
                format!("{owner} is not known; it was taken for \"diffuse\"")
            });
        }
        let mut radiance: ColorParam = self.light_color(&params, "L")?.into();
        let mut mean = 1.0;
        if let Some((name, _)) = self.file_name(&params, "filename")? {
            let image = self.image(name);
            let pixels = &self.scene.images[image.index()];
            let count = f64::from(pixels.width) * f64::from(pixels.height);
            let all = (0..pixels.height).flat_map(|y| (0..pixels.width).map(move |x| (x, y)));
            let luminance = |(x, y)| {
                let [r, g, b, _] = pixels.rgba(x, y);
                f64::from(Rgb::new(r, g, b).luminance())
            };
            mean = all.map(luminance).sum::<f64>() / count;
            // Lamps show their picture once: beyond its edge it is clamped (pbrt's BilerpChannel).
            let encoding = pixels.encoding;
            let texture =
                ImageTexture { wrap: [Wrap::Clamp; 2], ..ImageTexture::new(image, encoding) };
            radiance.texture = Some(self.scene.add_texture(texture));
        }
        let power = self.positive(&params, "power")?;
        let both_sides = params.bool_or("twosided", false)?;
        for name in ["samples", "nsamples"] {
            params.get(name);
        }
        self.note_unused(&params);
        self.shapes.area_lights.push(AreaLight { radiance, power, mean, both_sides });
        self.has_lamps = true;
        self.state.area_light = Some(self.shapes.area_lights.len() - 1);
        Ok(())
    }
}

/// The mean of red, green and blue of a picture, which is all that pbrt-v4 takes of it.
fn grey(image: &Image) -> Image {
    let all = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let mean = |(x, y)| {
        let [r, g, b, _] = image.rgba(x, y);
        (r + g + b) / 3.0
    };
    Image::from_f32(image.width, image.height, 1, all.map(mean).collect())
}

/// The normalised axes of a transform.
fn unit_axes(map: DAffine3) -> Option<DMat3> {
    let [x, y, z] =
        [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(DVec3::try_normalize);
    Some(DMat3::from_cols(x?, y?, z?))
}
