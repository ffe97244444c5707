//! Emitters.

use super::Builder;
use super::color;
use super::object::Object;
use super::texture::{Pattern, rgb_of};
use super::value::Value;
use crate::scene::fault::Fault;
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb, real};
use snell_scene::graph::{Environment, ImageId};
use snell_scene::light::sky::Sky;
use snell_scene::light::{
    Attenuation, Directional, IntensityTable, Point, Profile, Projector, Slide,
};
use snell_scene::material::ColorParam;
use snell_scene::texture::{Filtering, TextureSet};
use snell_scene::{Image, ImageTexture, MediumId, TextureId};
use std::sync::Arc;

/// The cut-off angle in degrees from which on a picture on a spot light is ignored: its square
/// would be too wide.
const MOST_CUTOFF: f64 = 85.0;

/// Texture coordinates as they are.
const UNMOVED: [[f32; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// What a surface emits.
#[derive(Clone, Debug)]
pub struct Emission {
    /// The radiance on the outer side.
    pub radiance: ColorParam,
    /// The attribute of the mesh that multiplies it.
    pub attribute: Option<String>,
}

impl Builder<'_> {
    /// Reads light, in linear Rec. 709, that must be constant (not textured).
    fn light_color(&mut self, object: &Object, name: &str, default: f32) -> Result<Rgb, Fault> {
        if let Some(property) = object.get(name)
            && let Value::Color(hue) = property.value
        {
            return Ok(color::light(hue));
        }
        Ok(self.constant(object, name)?.unwrap_or(Rgb::splat(default)))
    }

    /// The radiance of a surface that emits; `None` if its emitter is not supported.
    pub(super) fn area_emitter(&mut self, object: &Object) -> Result<Option<Emission>, Fault> {
        if object.class != "emitter" {
            return Err(object.fault("an emitter was expected here", "use an area emitter"));
        }
        let owner = object.owner();
        for name in ["sampling_weight", "samplingweight"] {
            object.get(name);
        }
        if object.kind != "area" {
            self.ignore_all(object);
            let what = match object.kind.as_str() {
                "directionalarea" => "light along the normal only is not supported; it became dark",
                _ => "a shape cannot emit this (only area); it was ignored",
            };
            self.note(owner.clone(), object.at, || format!("{owner}: {what}"));
            return Ok(None);
        }
        let mut attribute = None;
        let radiance = match object.get("radiance").map(|property| &property.value) {
            Some(Value::Color(hue)) => color::emission(*hue),
            _ => match self.pattern(object, "radiance")? {
                Some(Pattern::Attribute(name, factor)) => {
                    attribute = Some(name);
                    factor.into()
                }
                None => Rgb::WHITE.into(),
                Some(pattern) => self.color_of(pattern),
            },
        };
        self.has_lamps = true;
        self.note_unused(object);
        Ok(Some(Emission { radiance, attribute }))
    }

    pub(super) fn emitter(&mut self, object: &Object) -> Result<(), Fault> {
        let place = self.world_from_file * object.transform("to_world")?;
        for name in ["sampling_weight", "samplingweight"] {
            object.get(name);
        }
        match object.kind.as_str() {
            "point" => self.point(object, place)?,
            "spot" => self.spot(object, place)?,
            "directional" => self.directional(object, place)?,
            "projector" => self.projector(object, place)?,
            "constant" => {
                let radiance = self.light_color(object, "radiance", 1.0)?;
                self.surround(object, Environment::Constant(radiance));
            }
            "envmap" => self.envmap(object, place)?,
            "sunsky" | "sky" | "sun" => self.sky(object, place)?,
            kind => {
                let owner = object.owner();
                self.ignore_all(object);
                let what = match kind {
                    "area" | "directionalarea" => {
                        "belongs to no shape; put it inside of the shape that emits"
                    }
                    _ => "is not supported",
                };
                self.note(owner.clone(), object.at, || format!("{owner} {what}; it was left out"));
                return Ok(());
            }
        }
        if let Some(medium) = self.inner(object, |o| o.class == "medium")? {
            let _: Option<MediumId> = self.medium(&medium)?;
        }
        self.has_lamps = true;
        self.note_unused(object);
        Ok(())
    }

    fn point(&mut self, object: &Object, place: DAffine3) -> Result<(), Fault> {
        let intensity = self.light_color(object, "intensity", 1.0)?;
        let position = match object.vector("position")? {
            Some(position) => self.world_from_file.transform_point3(position),
            None => place.translation,
        };
        let attenuation = Attenuation::INVERSE_SQUARE;
        self.scene.add_light(Point { position, intensity, attenuation, body_radius: 0.0 });
        Ok(())
    }

    /// Reads a spot light. Its intensity falls linearly with the angle from the beam's edge to the
    /// cut-off; a picture multiplies it.
    fn spot(&mut self, object: &Object, place: DAffine3) -> Result<(), Fault> {
        let scale = self.light_color(object, "intensity", 1.0)?;
        let cutoff = object.float_within("cutoff_angle", 20.0, [0.0, 180.0])?.max(1e-3);
        let beam = object.float_or("beam_width", cutoff * 0.75)?.clamp(0.0, cutoff);
        let Some(axes) = unit_axes(place) else { return Ok(()) };
        let mut scale = scale;
        match self.pattern(object, "texture")? {
            Some(Pattern::Picture(factor, texture)) if cutoff < MOST_CUTOFF => {
                let slide = self.spot_slide(object, &texture, [beam, cutoff].map(f64::to_radians));
                if let Some(slide) = slide {
                    let (position, scale) = (place.translation, scale * factor);
                    let world_from_light =
                        axes * DMat3::from_cols(DVec3::NEG_X, DVec3::Y, DVec3::Z);
                    let even = false;
                    self.scene.add_light(Projector {
                        position,
                        world_from_light,
                        scale,
                        even,
                        slide,
                    });
                }
                return Ok(());
            }
            Some(Pattern::Constant(color)) => scale = scale * rgb_of(color),
            Some(_) => self.note("spot texture", object.at, || {
                "a spot light with a texture that is not a picture, or wider than 85 degrees: it \
                    shines evenly instead"
                    .into()
            }),
            None => {}
        }
        let mut polar = vec![0.0, beam.to_radians(), cutoff.to_radians()];
        let mut values = vec![Rgb::WHITE, Rgb::WHITE, Rgb::BLACK];
        if beam <= 0.0 {
            polar.remove(1);
            values.remove(1);
        } else if beam >= cutoff {
            polar[1] = polar[2] * (1.0 - 1e-6);
        }
        if let Some(table) = IntensityTable::new(polar, vec![0.0], values) {
            self.scene.add_light(Profile {
                position: place.translation,
                world_from_light: axes,
                scale,
                table,
            });
        }
        Ok(())
    }

    /// The intensities of a spot light with a picture, which fills the square around the cut-off
    /// (`SpotLight::direction_to_uv` of Mitsuba).
    fn spot_slide(
        &mut self,
        object: &Object,
        texture: &ImageTexture,
        [beam, cutoff]: [f64; 2],
    ) -> Option<Slide> {
        let key = format!("{texture:?} {beam} {cutoff}");
        let picture = self.scene.images[texture.image.index()].clone();
        let side = picture.width.max(picture.height).clamp(256, 1024);
        // Each light has a copy, so this is charged for each.
        let bytes = 36 * u64::from(side).pow(2);
        if let Err(error) = self.main.charge(bytes, "the picture of a spot light") {
            self.note("spot without memory", object.at, || {
                format!("a spot light with a picture was left out: {}", error.problem)
            });
            return None;
        }
        if let Some(known) = self.slides.get(&key) {
            return Some(known.clone());
        }
        let texture = ImageTexture { image: ImageId(0), ..texture.clone() };
        let textures = TextureSet::new(&[texture.into()], std::slice::from_ref(&picture));
        let half = real::tan(cutoff);
        let place = |i: u32| 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(side);
        let mut values = Vec::with_capacity((side * side * 3) as usize);
        for (left, up) in (0..side).flat_map(|y| (0..side).map(move |x| (place(x), place(y)))) {
            let angle = real::atan(half * real::hypot(left, up));
            let fall = if angle <= beam { 1.0 } else { (cutoff - angle) / (cutoff - beam) };
            let uv = (DVec2::new(left, up) * 0.5 + 0.5).as_vec2();
            let [r, g, b, _] = textures.lookup_at(TextureId(0), uv, 0.0);
            values.extend([r, g, b].map(|c| c * fall.max(0.0) as f32));
        }
        let slide = Slide::new(&Image::from_f32(side, side, 3, values), DVec2::splat(half))?;
        self.slides.insert(key, slide.clone());
        Some(slide)
    }

    fn directional(&mut self, object: &Object, place: DAffine3) -> Result<(), Fault> {
        let irradiance = self.light_color(object, "irradiance", 1.0)?;
        let direction = match object.vector("direction")? {
            Some(direction) => self.world_from_file.transform_vector3(direction),
            None => place.transform_vector3(DVec3::Z),
        };
        let Some(direction) = direction.try_normalize() else {
            return Err(object.fault("its direction is the zero vector", "give one"));
        };
        self.scene.add_light(Directional { direction, irradiance });
        Ok(())
    }

    fn projector(&mut self, object: &Object, place: DAffine3) -> Result<(), Fault> {
        let scale = object.float_or("scale", 1.0)? as f32;
        object.get("size");
        let pattern = match object.get("irradiance").map(|property| &property.value) {
            Some(Value::Color(hue)) => Some(Pattern::Constant(color::light(*hue).into())),
            _ => self.pattern(object, "irradiance")?,
        };
        let (factor, image) = match pattern {
            Some(Pattern::Picture(factor, texture)) => {
                if texture.filtering == Filtering::Nearest || texture.uv_transform != UNMOVED {
                    self.note("projected picture", object.at, || {
                        "a projected picture is interpolated and fills the view, whatever its \
                            filter_type and to_uv are"
                            .into()
                    });
                }
                (factor, self.scene.images[texture.image.index()].clone())
            }
            Some(Pattern::Constant(color)) => (color.factor, white()),
            Some(Pattern::Attribute(..)) | None => (Rgb::WHITE, white()),
        };
        let aspect = f64::from(image.width) / f64::from(image.height);
        let half = self.tan_half_fov_x(object, aspect)?;
        let half_size = DVec2::new(half, half / aspect);
        if let (Some(slide), Some(axes)) = (Slide::new(&image, half_size), unit_axes(place)) {
            // Mitsuba's x points to the left of the projected picture, as in its cameras.
            let world_from_light = axes * DMat3::from_cols(DVec3::NEG_X, DVec3::Y, DVec3::Z);
            let position = place.translation;
            // Mitsuba multiplies its "irradiance" by pi (projector.cpp, sample_direction).
            let scale = factor * scale * std::f32::consts::PI;
            let even = true;
            self.scene.add_light(Projector { position, world_from_light, scale, even, slide });
        }
        Ok(())
    }

    fn envmap(&mut self, object: &Object, place: DAffine3) -> Result<(), Fault> {
        let scale = Rgb::splat(object.float_or("scale", 1.0)? as f32);
        for name in ["mis_compensation", "cache", "gamma"] {
            object.get(name);
        }
        let image = if object.has("filename") {
            let (name, _) = object.file_name()?;
            self.image(name)
        } else {
            match self.pattern_of_child(object)? {
                Some(Pattern::Picture(_, texture)) => texture.image,
                _ => {
                    return Err(object.fault(
                        "there is no file name",
                        "add <string name=\"filename\" value=\"…\"/>",
                    ));
                }
            }
        };
        let image = self.scene.images[image.index()].clone();
        // In Mitsuba, the middle of the picture is +z and its right is -x; in the scene they are -z
        // and +x.
        let turned = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
        let world_from_environment = DAffine3::from_mat3(place.matrix3 * turned);
        self.surround(object, Environment::Image { image, scale, world_from_environment });
        Ok(())
    }

    fn pattern_of_child(&mut self, object: &Object) -> Result<Option<Pattern>, Fault> {
        let inner = self.inner(object, |o| o.class == "texture")?;
        inner.map(|texture| self.texture(&texture)).transpose()
    }

    /// The sky model of Hosek and Wilkie, with its sun: up is `+z`, as in Mitsuba 3, or `+y` in
    /// version 0.6.
    fn sky(&mut self, object: &Object, place: DAffine3) -> Result<(), Fault> {
        let is_old = self.version.starts_with("0.");
        let direction = object.vector("sun_direction")?;
        if direction.is_none() {
            self.note("time of day", object.at, || {
                "a sky by place and time of day: the sun stands 45 degrees high instead; give \
                    sun_direction"
                    .into()
            });
            for name in [
                "year",
                "month",
                "day",
                "hour",
                "minute",
                "second",
                "latitude",
                "longitude",
                "timezone",
            ] {
                object.get(name);
            }
        }
        let from_up = if is_old {
            DMat3::IDENTITY
        } else {
            DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y)
        };
        let towards =
            direction.map_or(DVec3::new(0.5, 0.5f64.sqrt(), 0.5), |d| from_up.transpose() * d);
        let towards = towards.try_normalize().unwrap_or(DVec3::Y);
        let has_sun = object.kind != "sky" && object.float_or("sun_scale", 1.0)? > 0.0;
        let albedo = self.constant(object, "albedo")?.map_or(0.3, |c| c.luminance());
        let sky = Sky {
            elevation: real::asin(towards.y.clamp(0.0, 1.0)).to_degrees(),
            azimuth: real::atan2(towards.x, -towards.z).to_degrees(),
            turbidity: object.float_within("turbidity", 3.0, [1.0, 10.0])?,
            ground: f64::from(albedo.clamp(0.0, 1.0)),
            sun: if has_sun { 0.5358 } else { 0.0 },
            scale: object.float_or("sky_scale", 1.0)?.clamp(0.0, 1e6),
        };
        for name in
            ["stretch", "resolution", "scale", "sun_radius_scale", "sun_aperture", "complex_sun"]
        {
            object.get(name);
        }
        self.note("sky", object.at, || {
            "the sky and its sun are those of Snell: full daylight on a white surface shows a \
                radiance of 1"
                .into()
        });
        let environment = sky.environment().map_err(|e| object.fault(e, "change it"))?;
        if let Environment::Image { image, scale, .. } = environment {
            let world_from_environment = DAffine3::from_mat3(place.matrix3 * from_up);
            self.surround(object, Environment::Image { image, scale, world_from_environment });
        }
        Ok(())
    }

    fn surround(&mut self, object: &Object, environment: Environment) {
        match (&self.scene.environment, &environment) {
            (Some(Environment::Constant(a)), Environment::Constant(b)) => {
                self.scene.environment = Some(Environment::Constant(*a + *b));
                return;
            }
            (Some(_), _) => self.note("second environment", object.at, || {
                "a second emitter around the scene; it replaces the first instead of adding to \
                    it"
                .into()
            }),
            (None, _) => {}
        }
        self.scene.environment = Some(environment);
    }
}

/// A picture of one white texel.
fn white() -> Arc<Image> {
    Arc::new(Image::from_f32(1, 1, 3, vec![1.0; 3]))
}

/// The normalised axes of a transform.
fn unit_axes(map: DAffine3) -> Option<DMat3> {
    let [x, y, z] =
        [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(DVec3::try_normalize);
    Some(DMat3::from_cols(x?, y?, z?))
}
