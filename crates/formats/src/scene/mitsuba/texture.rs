//! Textures, as materials use them.
//!
//! Coordinates: Mitsuba's images have v downwards, as ours; its mesh readers flip the coordinates
//! of files instead.

use super::Builder;
use super::color;
use super::object::Object;
use super::value::Value;
use crate::scene::fault::Fault;
use snell_math::{DAffine3, Rgb};
use snell_scene::graph::ImageId;
use snell_scene::material::{ColorParam, ScalarParam};
use snell_scene::texture::{Filtering, Wrap};
use snell_scene::{Encoding, Image, ImageTexture, TextureId};
use std::collections::{HashMap, HashSet};
use std::rc::Rc;
use std::sync::Arc;

/// A function of a texture's value.
pub type Function = fn(f32) -> f32;

/// The textures of a scene.
#[derive(Debug, Default)]
pub struct Textures {
    /// Patterns by the address of their object, which lives until the scene is built.
    known: HashMap<*const Object, Pattern>,
    /// Images of checkerboards.
    checkers: HashSet<ImageId>,
    /// Textures in the scene, by their debug text.
    ids: HashMap<String, TextureId>,
    /// Scalar images derived from others, by image, encoding and function.
    scalars: HashMap<(ImageId, bool, Option<usize>), ImageId>,
    /// Pairs of numbers that are functions of two patterns, by the debug text of the patterns and
    /// the name of the function; `None` if there was no memory for them.
    both: HashMap<String, Option<[ScalarParam; 2]>>,
}

/// The content of a texture.
#[derive(Clone, Debug)]
pub enum Pattern {
    Constant(ColorParam),
    /// An image with a factor.
    Picture(Rgb, ImageTexture),
    /// An attribute of the mesh by its name, such as `vertex_color`, with a factor.
    Attribute(String, Rgb),
}

/// The attributes of the mesh that a surface shows, by name. A mesh has room for one of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attributes {
    /// The attribute that the vertex colours hold.
    pub color: Option<String>,
    /// The attribute that the second set of texture coordinates holds, for numbers.
    pub number: Option<String>,
    /// True if another attribute is shown for which there is no room.
    pub is_crowded: bool,
}

impl Attributes {
    /// Adds those of another part of the surface, where there is room.
    pub fn add(&mut self, other: &Self) {
        self.is_crowded |= other.is_crowded;
        other.color.iter().for_each(|name| self.add_color(name));
        other.number.iter().for_each(|name| self.add_number(name));
    }

    /// Adds an attribute that is shown as a colour.
    pub fn add_color(&mut self, name: &str) {
        self.is_crowded |= self.color.get_or_insert_with(|| name.into()) != name;
    }

    /// Adds an attribute that is shown as a number.
    fn add_number(&mut self, name: &str) {
        self.is_crowded |= self.number.get_or_insert_with(|| name.into()) != name;
    }
}

impl Builder<'_> {
    /// The pattern of a property or inner texture of this name.
    pub(super) fn pattern(
        &mut self,
        object: &Object,
        name: &str,
    ) -> Result<Option<Pattern>, Fault> {
        if let Some(property) = object.get(name) {
            return match property.value {
                Value::Color(hue) => Ok(Some(Pattern::Constant(color::reflectance(hue)))),
                Value::Float(x) => Ok(Some(Pattern::Constant(Rgb::splat(x as f32).into()))),
                Value::Integer(x) => Ok(Some(Pattern::Constant(Rgb::splat(x as f32).into()))),
                _ => Err(property.fault(
                    format!("a {}, where a colour or texture was expected", property.value.kind()),
                    "write an rgb, a spectrum, a float or a texture",
                )),
            };
        }
        match self.child_named(object, name)? {
            Some(texture) => self.texture(&texture).map(Some),
            None => Ok(None),
        }
    }

    /// The pattern of a property or inner texture of this name, if it is used as a number: Mitsuba
    /// swaps the squares of its checkerboards then (`Checkerboard::eval_1`).
    pub(super) fn number_pattern(
        &mut self,
        object: &Object,
        name: &str,
    ) -> Result<Option<Pattern>, Fault> {
        let mut pattern = self.pattern(object, name)?;
        if let Some(Pattern::Picture(_, texture)) = &mut pattern
            && self.textures.checkers.contains(&texture.image)
        {
            texture.uv_transform[0][2] += 0.5;
        }
        Ok(pattern)
    }

    /// The colour parameter for a property, or for its default.
    pub(super) fn color(
        &mut self,
        object: &Object,
        name: &str,
        default: f32,
    ) -> Result<ColorParam, Fault> {
        Ok(match self.pattern(object, name)? {
            Some(pattern) => self.color_of(pattern),
            None => Rgb::splat(default).into(),
        })
    }

    pub(super) fn color_of(&mut self, pattern: Pattern) -> ColorParam {
        match pattern {
            Pattern::Constant(color) => color,
            Pattern::Picture(factor, texture) => {
                ColorParam::textured(factor, Some(self.texture_id(texture)))
            }
            Pattern::Attribute(name, factor) => {
                self.attributes.add_color(&name);
                factor.into()
            }
        }
    }

    /// The scalar parameter for a property, or for its default.
    pub(super) fn scalar(
        &mut self,
        object: &Object,
        name: &str,
        default: f32,
    ) -> Result<ScalarParam, Fault> {
        self.mapped(object, name, default, None)
    }

    /// A scalar parameter: `function` applied to the values of a property, or to its default.
    pub(super) fn mapped(
        &mut self,
        object: &Object,
        name: &str,
        default: f32,
        function: Option<Function>,
    ) -> Result<ScalarParam, Fault> {
        let apply = |x: f32| function.map_or(x, |f| f(x));
        Ok(match self.number_pattern(object, name)? {
            None => apply(default).into(),
            Some(Pattern::Constant(color)) => apply(gray(color)).into(),
            Some(Pattern::Picture(factor, texture)) => {
                let texture = self.scalar_texture(&texture, function);
                let id = self.texture_id(texture);
                ScalarParam { factor: apply(factor.luminance()), texture: Some((id, 0)) }
            }
            Some(Pattern::Attribute(name, factor)) => {
                self.attributes.add_number(&name);
                self.ramp(factor.luminance(), function)
            }
        })
    }

    /// A function of the attribute that is the first of the second texture coordinates, from 0 to
    /// 1.
    fn ramp(&mut self, scale: f32, function: Option<Function>) -> ScalarParam {
        // A straight line needs two texels; their middles are the ends of the range.
        let count = if function.is_some() { 256 } else { 2 };
        let value = |i: u32| {
            let x = scale * i as f32 / (count - 1) as f32;
            function.map_or(x, |f| f(x))
        };
        let image = Image::from_f32(count, 1, 1, (0..count).map(value).collect());
        let image = self.scene.add_image(Arc::new(image));
        let of_texels = |texels: f32| texels / count as f32;
        let texture = ImageTexture {
            wrap: [Wrap::Clamp; 2],
            uv_set: 1,
            uv_transform: [[of_texels((count - 1) as f32), 0.0, of_texels(0.5)], [0.0, 0.0, 0.5]],
            ..ImageTexture::new(image, Encoding::Linear)
        };
        ScalarParam { factor: 1.0, texture: Some((self.texture_id(texture), 0)) }
    }

    /// The colour of a property that must be constant (not textured).
    pub(super) fn constant(&mut self, object: &Object, name: &str) -> Result<Option<Rgb>, Fault> {
        match self.pattern(object, name)? {
            None => Ok(None),
            Some(Pattern::Constant(color)) => Ok(Some(rgb_of(color))),
            Some(Pattern::Picture(..) | Pattern::Attribute(..)) => {
                let owner = object.owner();
                self.note(format!("{owner} textured {name}"), object.at, || {
                    format!("{owner}: a texture as \"{name}\"; its default was used instead")
                });
                Ok(None)
            }
        }
    }

    fn texture_id(&mut self, texture: ImageTexture) -> TextureId {
        // The debug form of a float is exact, so equal text means equal textures.
        let scene = &mut self.scene;
        *self
            .textures
            .ids
            .entry(format!("{texture:?}"))
            .or_insert_with(|| scene.add_texture(texture))
    }

    /// A copy of a texture for a scalar parameter: its colours become grey, and `function` is
    /// applied to the values.
    fn scalar_texture(
        &mut self,
        texture: &ImageTexture,
        function: Option<Function>,
    ) -> ImageTexture {
        let image = self.scene.images[texture.image.index()].clone();
        if image.channels <= 2 && function.is_none() && texture.encoding == Encoding::Linear {
            return texture.clone();
        }
        let is_srgb = texture.encoding == Encoding::Srgb;
        let key = (texture.image, is_srgb, function.map(|f| f as usize));
        let id = match self.textures.scalars.get(&key) {
            Some(id) => *id,
            None => {
                let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
                let value = |(x, y)| {
                    let [r, g, b, _] = image.rgba_as(x, y, texture.encoding);
                    let value = if image.channels <= 2 { r } else { Rgb::new(r, g, b).luminance() };
                    function.map_or(value, |f| f(value))
                };
                let values = pixels.map(value).collect();
                let id = self.scene.add_image(Arc::new(Image::from_f32(
                    image.width,
                    image.height,
                    1,
                    values,
                )));
                self.textures.scalars.insert(key, id);
                id
            }
        };
        ImageTexture { image: id, encoding: Encoding::Linear, ..texture.clone() }
    }

    /// Two scalar parameters that are functions of two patterns: constants, pictures with the same
    /// texels and place, or one picture and a constant. `None` for other pairs, and with a warning
    /// if the scene may take no more memory. `name` is that of the function.
    pub(super) fn numbers_of_both(
        &mut self,
        object: &Object,
        [a, b]: [&Pattern; 2],
        name: &str,
        function: impl Fn(f32, f32) -> [f32; 2],
    ) -> Option<[ScalarParam; 2]> {
        let key = format!("{name} {a:?} {b:?}");
        if let Some(known) = self.textures.both.get(&key) {
            return *known;
        }
        let numbers = self.new_numbers_of_both(object, [a, b], function);
        self.textures.both.insert(key, numbers);
        numbers
    }

    fn new_numbers_of_both(
        &mut self,
        object: &Object,
        [a, b]: [&Pattern; 2],
        function: impl Fn(f32, f32) -> [f32; 2],
    ) -> Option<[ScalarParam; 2]> {
        let texture = match (a, b) {
            (Pattern::Picture(_, a), Pattern::Picture(_, b)) => {
                let [a_image, b_image] = [a, b].map(|t| &self.scene.images[t.image.index()]);
                let size = |image: &Image| [image.width, image.height];
                let of_a = ImageTexture { image: a.image, encoding: a.encoding, ..b.clone() };
                let fits = size(a_image) == size(b_image) && of_a == *a;
                Some(a).filter(|_| fits)?
            }
            (Pattern::Picture(_, texture), Pattern::Constant(_))
            | (Pattern::Constant(_), Pattern::Picture(_, texture)) => texture,
            (Pattern::Constant(a), Pattern::Constant(b)) => {
                return Some(function(gray(*a), gray(*b)).map(ScalarParam::constant));
            }
            _ => return None,
        };
        let image = self.scene.images[texture.image.index()].clone();
        let bytes = 16 * u64::from(image.width) * u64::from(image.height);
        if let Err(error) = self.main.charge(bytes, "two numbers of a picture") {
            let owner = object.owner();
            self.note("two numbers without memory", object.at, || {
                format!("{owner}: its textures are not shown: {}", error.problem)
            });
            return None;
        }
        let value = |pattern: &Pattern, x: u32, y: u32| match pattern {
            Pattern::Picture(factor, texture) => {
                let image = &self.scene.images[texture.image.index()];
                let [r, g, b, _] = image.rgba_as(x, y, texture.encoding);
                (*factor * Rgb::new(r, g, b)).luminance()
            }
            Pattern::Constant(color) => gray(*color),
            Pattern::Attribute(..) => 0.0,
        };
        let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
        let values: Vec<[f32; 2]> =
            pixels.map(|(x, y)| function(value(a, x, y), value(b, x, y))).collect();
        Some([0, 1].map(|i| {
            let values = values.iter().map(|both| both[i]).collect();
            let image = Image::from_f32(image.width, image.height, 1, values);
            let image = self.scene.add_image(Arc::new(image));
            let texture = ImageTexture { image, encoding: Encoding::Linear, ..texture.clone() };
            ScalarParam { factor: 1.0, texture: Some((self.texture_id(texture), 0)) }
        }))
    }

    pub(super) fn texture(&mut self, object: &Rc<Object>) -> Result<Pattern, Fault> {
        let key = Rc::as_ptr(object);
        if let Some(known) = self.textures.known.get(&key) {
            return Ok(known.clone());
        }
        self.enter(object)?;
        let pattern = self.new_texture(object)?;
        self.leave();
        self.note_unused(object);
        self.textures.known.insert(key, pattern.clone());
        Ok(pattern)
    }

    fn new_texture(&mut self, object: &Object) -> Result<Pattern, Fault> {
        if !matches!(object.class.as_str(), "texture" | "spectrum") {
            return Err(object.fault("a texture was expected here", "use a texture or a colour"));
        }
        match object.kind.as_str() {
            "bitmap" | "ldrtexture" => self.bitmap(object),
            "checkerboard" => self.checkerboard(object),
            "mesh_attribute" | "vertexcolors" => {
                let name = object.string("name")?.map_or("vertex_color", |(name, _)| name);
                let is_named = name.starts_with("vertex_") || name.starts_with("face_");
                let name = if is_named { name } else { "vertex_color" };
                let factor = object.float_or("scale", 1.0)? as f32;
                Ok(Pattern::Attribute(name.to_string(), Rgb::splat(factor)))
            }
            "scale" => {
                let factor = self.constant(object, "scale")?.unwrap_or(Rgb::WHITE);
                let inner = self.inner(object, |o| o.class == "texture")?;
                Ok(match inner.map(|inner| self.texture(&inner)).transpose()? {
                    Some(Pattern::Picture(own, texture)) => Pattern::Picture(own * factor, texture),
                    Some(Pattern::Constant(color)) => {
                        Pattern::Constant(ColorParam { factor: color.factor * factor, ..color })
                    }
                    Some(Pattern::Attribute(name, own)) => Pattern::Attribute(name, own * factor),
                    None => Pattern::Constant(factor.into()),
                })
            }
            "rawconstant" if object.has("value") && object.vector("value").is_ok() => {
                let value = object.vector("value")?.unwrap_or_default().as_vec3();
                Ok(Pattern::Constant(Rgb::new(value.x, value.y, value.z).into()))
            }
            "constant" | "rawconstant" | "uniform" | "srgb" => {
                let name = if object.kind == "srgb" { "color" } else { "value" };
                Ok(Pattern::Constant(self.color(object, name, 1.0)?))
            }
            _ => Ok(self.plain_texture(object, Rgb::splat(0.5), "it".into())),
        }
    }

    fn plain_texture(&mut self, object: &Object, color: Rgb, what: String) -> Pattern {
        object.properties.iter().for_each(|p| p.used.set(true));
        object.children.iter().for_each(|c| c.used.set(true));
        let owner = object.owner();
        self.note(format!("{owner} {what}"), object.at, || {
            format!("{owner}: {what} is not supported; grey was used instead")
        });
        Pattern::Constant(color.into())
    }

    /// The affine transform of texture coordinates: `to_uv`, or the scales and offsets of version
    /// 0.6.
    fn uv_transform(&mut self, object: &Object) -> Result<[[f32; 3]; 2], Fault> {
        let map: DAffine3 = object.transform("to_uv")?;
        let both = [object.float_or("uvscale", 1.0)?, object.float_or("uvoffset", 0.0)?];
        let scale = [object.float_or("uscale", both[0])?, object.float_or("vscale", both[0])?];
        let offset = [object.float_or("uoffset", both[1])?, object.float_or("voffset", both[1])?];
        let (x, y, t) = (map.matrix3.x_axis, map.matrix3.y_axis, map.translation);
        let row = |i: usize| {
            [
                (x[i] * scale[i]) as f32,
                (y[i] * scale[i]) as f32,
                (t[i] * scale[i] + offset[i]) as f32,
            ]
        };
        Ok([row(0), row(1)])
    }

    fn bitmap(&mut self, object: &Object) -> Result<Pattern, Fault> {
        let (name, _) = object.file_name()?;
        let image = self.image(name);
        let stored = self.scene.images[image.index()].encoding;
        let gamma = object.float("gamma")?;
        let is_raw = object.bool_or("raw", false)? || gamma == Some(1.0);
        if let Some(gamma) = gamma.filter(|g| *g != 1.0 && *g > 0.0) {
            self.note("gamma", object.at, || {
                format!("a gamma of {gamma}: the picture was taken for an sRGB one")
            });
        }
        let mut texture = ImageTexture::new(image, if is_raw { Encoding::Linear } else { stored });
        let wrap = |text: &str| match text {
            "clamp" => Some(Wrap::Clamp),
            "mirror" => Some(Wrap::Mirror),
            "zero" => Some(Wrap::Black),
            "repeat" => Some(Wrap::Repeat),
            _ => None,
        };
        for (name, axes) in [
            ("wrap_mode", [true, true]),
            ("wrap_mode_u", [true, false]),
            ("wrap_mode_v", [false, true]),
        ] {
            let Some((text, at)) = object.string(name)? else { continue };
            let Some(mode) = wrap(text) else {
                let problem = format!("\"{}\" is not a way to wrap", super::value::shortened(text));
                return Err(Fault::new(at, problem, "use repeat, mirror, clamp or zero"));
            };
            (0..2).filter(|i| axes[*i]).for_each(|i| texture.wrap[i] = mode);
        }
        if object.string("filter_type")?.is_some_and(|(t, _)| t == "nearest") {
            texture.filtering = Filtering::Nearest;
        }
        for name in ["channel", "max_anisotropy", "cache", "format", "accel"] {
            object.get(name);
        }
        texture.uv_transform = self.uv_transform(object)?;
        Ok(Pattern::Picture(Rgb::WHITE, texture))
    }

    fn checkerboard(&mut self, object: &Object) -> Result<Pattern, Fault> {
        let mut color = |name: &str, default: f32| -> Result<Rgb, Fault> {
            Ok(self.constant(object, name)?.unwrap_or(Rgb::splat(default)))
        };
        let (a, b) = (color("color0", 0.4)?, color("color1", 0.2)?);
        // The first colour is used where both coordinates are in the same half of a period.
        let values = [a, b, b, a].iter().flat_map(|c| c.to_array()).collect();
        let image = self.scene.add_image(Arc::new(Image::from_f32(2, 2, 3, values)));
        self.textures.checkers.insert(image);
        let mut texture = ImageTexture::new(image, Encoding::Linear);
        texture.filtering = Filtering::Nearest;
        texture.uv_transform = self.uv_transform(object)?;
        Ok(Pattern::Picture(Rgb::WHITE, texture))
    }
}

/// The RGB colour of a parameter without texture.
pub fn rgb_of(color: ColorParam) -> Rgb {
    color.spectrum.map_or(color.factor, |s| color.factor * s.reflectance_rgb())
}

fn gray(color: ColorParam) -> f32 {
    rgb_of(color).luminance()
}
