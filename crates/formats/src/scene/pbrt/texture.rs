//! Textures: a tree of patterns, and how materials use them.
//!
//! Pictures and patterns become textures of the scene when a material uses them. If the values of a
//! picture are not its texels (a power, a function of them, grey instead of colours), the picture
//! is copied with the computed values.

use super::Builder;
use super::lexer::{Lexer, quoted};
use super::options::is_kind;
use super::params::{Params, Type};
use super::spectrum::Role;
use super::state::Target;
use crate::scene::fault::{Fault, Spot};
use snell_math::{DAffine3, Rgb, Vec3, real};
use snell_scene::graph::ImageId;
use snell_scene::material::{ColorParam, ScalarParam};
use snell_scene::texture::mapping::{IDENTITY, Rows};
use snell_scene::texture::{self, Filtering, MAX_PARTS, Mapping, Wrap, pattern};
use snell_scene::{Encoding, Image, ImageTexture, Texture, TextureId};
use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;

/// A picture.
#[derive(Clone, Debug)]
pub struct Picture {
    image: ImageId,
    encoding: Encoding,
    /// Decoding exponent, for encodings that are powers.
    gamma: Option<f32>,
    /// Factor on the decoded values.
    scale: f32,
    /// True if values are inverted (1 minus the value).
    invert: bool,
    wrap: Wrap,
    filtering: Filtering,
    mapping: Mapping,
}

/// A function of each value of a texture.
#[derive(Clone, Copy, Debug)]
pub struct Function {
    /// The function, for arguments that are not negative.
    pub apply: fn(f32) -> f32,
    /// The exponent, if it is a power.
    pub exponent: Option<f32>,
}

/// The content of a texture.
#[derive(Clone, Debug)]
pub enum Pattern {
    Constant(Rgb),
    Picture(Picture),
    Product(Rc<Pattern>, Rc<Pattern>),
    /// The first pattern where the third is 0, the second where the third is 1.
    Mix([Rc<Pattern>; 3]),
    Checkerboard([Rc<Pattern>; 2], Mapping),
    SolidCheckerboard([Rc<Pattern>; 2], Rows),
    /// The first pattern where the surface normal points along the axis, else the second.
    DirectionMix([Rc<Pattern>; 2], Vec3),
    /// The patterns inside and outside the dots.
    Dots([Rc<Pattern>; 2], Mapping),
    /// A pattern that has no other patterns as inputs.
    Whole(texture::Pattern),
    Map(Rc<Pattern>, Function),
}

/// The textures of a scene.
#[derive(Debug, Default)]
pub struct Patterns {
    colors: HashMap<String, Rc<Pattern>>,
    scalars: HashMap<String, Rc<Pattern>>,
    /// Textures already in the scene, by address; the pattern is kept so that its address stays
    /// unique.
    placed: HashMap<(*const Pattern, bool), (Rc<Pattern>, Rgb, Option<TextureId>)>,
    /// Pictures with converted values, keyed by the original, its encoding, the power, whether it
    /// holds colours, and the function applied.
    copies: HashMap<(ImageId, bool, Option<u32>, bool, Option<(usize, [u32; 3])>), ImageId>,
    /// Total number of pixels of all copies.
    copied: usize,
    /// The picture of the coordinates of a surface.
    coordinates: Option<ImageId>,
}

/// Maximum number of pixels of all copies.
const MAX_COPIED: usize = 1 << 28;

impl Pattern {
    /// A constant pattern.
    pub fn constant(value: f32) -> Rc<Self> {
        Rc::new(Self::Constant(Rgb::splat(value)))
    }

    /// The value of a constant pattern.
    pub fn as_constant(&self) -> Option<Rgb> {
        match self {
            Self::Constant(color) => Some(*color),
            Self::Product(a, b) => Some(a.as_constant()? * b.as_constant()?),
            Self::Mix([a, b, t]) => {
                let (a, b, t) = (a.as_constant()?, b.as_constant()?, t.as_constant()?);
                Some(a * t.map(|t| 1.0 - t) + b * t)
            }
            Self::Map(of, function) => Some(of.as_constant()?.map(function.apply)),
            _ => None,
        }
    }

    /// The maximum number of textures that the pattern becomes in the scene; `None` if above
    /// `limit`.
    fn size_within(&self, limit: usize) -> Option<usize> {
        let left = limit.checked_sub(1)?;
        let parts: &[&Rc<Self>] = match self {
            Self::Constant(_) | Self::Whole(_) => &[],
            // The picture may need a remapping and an inversion.
            Self::Picture(_) => return (left >= 2).then_some(3),
            Self::Product(a, b)
            | Self::Checkerboard([a, b], _)
            | Self::SolidCheckerboard([a, b], _)
            | Self::DirectionMix([a, b], _)
            | Self::Dots([a, b], _) => &[a, b],
            Self::Mix([a, b, t]) => &[a, b, t],
            Self::Map(of, ..) => &[of],
        };
        let mut size = 1;
        for part in parts {
            size += part.size_within(left + 1 - size)?;
        }
        Some(size)
    }

    /// The factor and the picture, if the pattern is a picture times a constant.
    fn as_picture(&self) -> Option<(Rgb, &Picture)> {
        match self {
            Self::Picture(p) if !p.invert => Some((Rgb::splat(p.scale), p)),
            Self::Product(a, b) => {
                let (constant, other) = match (a.as_constant(), b.as_constant()) {
                    (Some(constant), _) => (constant, b),
                    (_, Some(constant)) => (constant, a),
                    _ => return None,
                };
                let (factor, picture) = other.as_picture()?;
                Some((constant * factor, picture))
            }
            _ => None,
        }
    }

    /// The pattern with a function applied to each of its values.
    pub fn mapped(self: &Rc<Self>, function: Function) -> Rc<Self> {
        let mapped = Self::Map(self.clone(), function);
        Rc::new(mapped.as_constant().map_or(mapped, Self::Constant))
    }
}

impl Builder<'_> {
    /// Reads `Texture "name" "spectrum" "imagemap" ...`.
    pub(super) fn texture(&mut self, lexer: &mut Lexer, at: Spot) -> Result<(), Fault> {
        let (name, _) = lexer.expect_string("the name of a texture")?;
        let (kind, kind_at) = lexer.expect_string("the type of a texture")?;
        let is_color = match kind {
            "spectrum" | "color" => true,
            "float" => false,
            _ => {
                let problem = format!("{} is not a type of textures", quoted(kind.as_bytes()));
                return Err(Fault::new(kind_at, problem, "use spectrum or float"));
            }
        };
        let params = self.params_of_texture(lexer, at)?;
        let pattern = self.pattern(&params, is_color)?;
        if pattern.size_within(MAX_PARTS).is_none() {
            return Err(params.fault(
                format!("made of more than {MAX_PARTS} textures, the limit"),
                "simplify it",
            ));
        }
        self.note_unused(&params);
        let table = if is_color { &mut self.patterns.colors } else { &mut self.patterns.scalars };
        if table.insert(name.into(), pattern).is_some() {
            let name = quoted(name.as_bytes());
            self.note(format!("texture {name}"), at, || {
                format!("the texture {name} is defined again; what follows uses the new one")
            });
        }
        Ok(())
    }

    fn params_of_texture(&mut self, lexer: &mut Lexer, at: Spot) -> Result<Params, Fault> {
        let (class, _) = lexer.expect_string("the class of a texture")?;
        let owner = format!("Texture {}", quoted(class.as_bytes()));
        let params = Params::read(lexer, owner, at, self.main.options.limits.elements)?;
        Ok(params.with_defaults(self.state.defaults(Target::Texture)))
    }

    fn pattern(&mut self, params: &Params, is_color: bool) -> Result<Rc<Pattern>, Fault> {
        let child = |builder: &mut Self, name: &str, default: f32| -> Result<Rc<Pattern>, Fault> {
            let found = builder.pattern_param(params, name, is_color)?;
            Ok(found.unwrap_or_else(|| Pattern::constant(default)))
        };
        let kind = |kind: &str| is_kind(params, kind);
        Ok(if kind("constant") {
            child(self, "value", 1.0)?
        } else if kind("scale") {
            let (a, b) = if params.has("tex1") { ("tex1", "tex2") } else { ("tex", "scale") };
            let first = child(self, a, 1.0)?;
            // The factor is a float in pbrt-v4 and may be a colour in pbrt-v3.
            let second = match self.pattern_param(params, b, b == "tex2" && is_color)? {
                Some(pattern) => pattern,
                None => Pattern::constant(1.0),
            };
            Rc::new(Pattern::Product(first, second))
        } else if kind("mix") {
            let amount = self
                .pattern_param(params, "amount", false)?
                .unwrap_or_else(|| Pattern::constant(0.5));
            Rc::new(Pattern::Mix([child(self, "tex1", 0.0)?, child(self, "tex2", 1.0)?, amount]))
        } else if kind("imagemap") {
            self.picture(params, is_color)?
        } else if kind("checkerboard") {
            params.get("aamode");
            let checks = [child(self, "tex1", 1.0)?, child(self, "tex2", 0.0)?];
            match params.integer("dimension")?.unwrap_or(2) {
                2 => Rc::new(Pattern::Checkerboard(checks, self.mapping(params)?)),
                3 => Rc::new(Pattern::SolidCheckerboard(checks, self.texture_from_world(params))),
                n => return Err(params.fault(format!("dimension is {n}"), "use 2 or 3")),
            }
        } else if kind("bilerp") {
            let mapping = self.mapping(params)?;
            let mut corner = |name: &str, default: f32| {
                let param = params.get(name);
                let color =
                    param.map_or(Ok(Rgb::splat(default)), |param| self.color(param, Role::Factor));
                color.map(ColorParam::from)
            };
            let (v00, v01) = (corner("v00", 0.0)?, corner("v01", 1.0)?);
            let (v10, v11) = (corner("v10", 0.0)?, corner("v11", 1.0)?);
            whole(pattern::Bilerp { v00, v01, v10, v11, mapping })
        } else if kind("dots") {
            let mapping = self.mapping(params)?;
            // In pbrt-v3 and v4 the constructor takes the value outside first, and is given that of
            // "inside" first: all their pictures show "inside" between the dots.
            Rc::new(Pattern::Dots(
                [child(self, "outside", 0.0)?, child(self, "inside", 1.0)?],
                mapping,
            ))
        } else if kind("uv") && is_color {
            self.coordinates(params)?
        } else if kind("directionmix") {
            let axis = match params.directions("dir")?[..] {
                [] => Vec3::Y,
                [axis] => axis,
                _ => return Err(params.fault("dir is more than one vector", "give three numbers")),
            };
            let axis = self
                .world_from_texture()
                .transform_vector3(axis.as_dvec3())
                .normalize_or_zero()
                .as_vec3();
            if axis == Vec3::ZERO || !axis.is_finite() {
                return Err(params.fault("dir has no direction", "give a vector that is not 0"));
            }
            Rc::new(Pattern::DirectionMix(
                [child(self, "tex1", 0.0)?, child(self, "tex2", 1.0)?],
                axis,
            ))
        } else if kind("ptex") {
            self.ptex(params)?
        } else {
            let texture_from_world = self.texture_from_world(params);
            if kind("windy") {
                whole(pattern::Windy { texture_from_world })
            } else if kind("fbm") {
                let (octaves, roughness) = octaves(params)?;
                whole(pattern::Fbm { octaves, roughness, texture_from_world })
            } else if kind("wrinkled") {
                let (octaves, roughness) = octaves(params)?;
                whole(pattern::Wrinkled { octaves, roughness, texture_from_world })
            } else if kind("marble") {
                let (octaves, roughness) = octaves(params)?;
                let [scale, variation] =
                    [finite(params, "scale", 1.0)?, finite(params, "variation", 0.2)?];
                whole(pattern::Marble { octaves, roughness, scale, variation, texture_from_world })
            } else {
                let owner = params.owner.clone();
                self.note(owner.clone(), params.at, || {
                    format!("{owner} is not known; grey was used instead")
                });
                Pattern::constant(0.5)
            }
        })
    }

    /// The coordinates (s, t) as red and green, repeated (`UVTexture` of pbrt-v3): a picture of
    /// them that is interpolated.
    fn coordinates(&mut self, params: &Params) -> Result<Rc<Pattern>, Fault> {
        const SIDE: u32 = 256;
        let at = |texel: u32| (texel as f32 + 0.5) / SIDE as f32;
        let image = match self.patterns.coordinates {
            Some(image) => image,
            None => {
                let rows = (0..SIDE).rev();
                let values = rows.flat_map(|y| (0..SIDE).flat_map(move |x| [at(x), at(y), 0.0]));
                let image = Image::from_f32(SIDE, SIDE, 3, values.collect());
                self.scene.add_image(Arc::new(image))
            }
        };
        self.patterns.coordinates = Some(image);
        Ok(Rc::new(Pattern::Picture(Picture {
            image,
            encoding: Encoding::Linear,
            gamma: None,
            scale: 1.0,
            invert: false,
            wrap: Wrap::Repeat,
            filtering: Filtering::Trilinear,
            mapping: self.mapping(params)?,
        })))
    }

    /// A per-face texture, which is not supported.
    fn ptex(&mut self, params: &Params) -> Result<Rc<Pattern>, Fault> {
        for name in ["filename", "encoding"] {
            params.get(name);
        }
        let owner = params.owner.clone();
        self.note(owner.clone(), params.at, || {
            format!("{owner} is not read; grey was used instead")
        });
        Ok(Pattern::constant(0.5 * params.float_or("scale", 1.0)? as f32))
    }

    /// The transform from a texture's space to the world: the current transform at the start of the
    /// motion.
    fn world_from_texture(&self) -> DAffine3 {
        self.world_from_file * self.state.transform.0[0]
    }

    /// The transform into the space of a texture.
    fn texture_from_world(&mut self, params: &Params) -> Rows {
        let inverse =
            snell_math::Transform::new(self.world_from_texture()).map(|map| *map.inverse_matrix());
        if inverse.is_none() {
            let owner = params.owner.clone();
            self.note(format!("{owner} in a flat space"), params.at, || {
                format!(
                    "{owner}: the current transform is flat; the world was used as the \
                    texture's space"
                )
            });
        }
        inverse.map_or(IDENTITY, rows)
    }

    fn mapping(&mut self, params: &Params) -> Result<Mapping, Fault> {
        let get = |name: &str, default| finite(params, name, default);
        Ok(match params.string("mapping")?.unwrap_or("uv") {
            "uv" => Mapping::upright(
                [get("uscale", 1.0)?, get("vscale", 1.0)?],
                [get("udelta", 0.0)?, get("vdelta", 0.0)?],
            ),
            "spherical" => {
                Mapping::Spherical { texture_from_world: self.texture_from_world(params) }
            }
            "cylindrical" => {
                Mapping::Cylindrical { texture_from_world: self.texture_from_world(params) }
            }
            "planar" => {
                let world = self.texture_from_world(params);
                let axis = |name: &str, default: Vec3, shift: f32| {
                    let axis = match params.directions(name)?[..] {
                        [] => default,
                        [axis] if axis.is_finite() => axis,
                        _ => {
                            let what = format!("{name} is not one vector");
                            return Err(params.fault(what, "give three numbers"));
                        }
                    };
                    Ok(planar(&world, axis, shift))
                };
                let (du, dv) = (get("udelta", 0.0)?, get("vdelta", 0.0)?);
                Mapping::Planar {
                    st_from_world: [axis("v1", Vec3::X, du)?, axis("v2", Vec3::Y, dv)?],
                }
            }
            other => {
                let what = quoted(other.as_bytes());
                return Err(params.fault(
                    format!("{what} is not a mapping"),
                    "use uv, spherical, cylindrical or planar",
                ));
            }
        })
    }

    fn picture(&mut self, params: &Params, is_color: bool) -> Result<Rc<Pattern>, Fault> {
        let Some((name, _)) = self.file_name(params, "filename")? else {
            return Err(params.fault("there is no file name", "add \"string filename\""));
        };
        let image = self.image(name);
        let stored = self.scene.images[image.index()].encoding;
        let (encoding, gamma) = encoding(params, stored, is_color, self.is_v3)?;
        let wrap = match params.string("wrap")?.unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "black" => Wrap::Black,
            "clamp" => Wrap::Clamp,
            "octahedralsphere" => {
                self.note("wrap", params.at, || {
                    "the wrap mode octahedralsphere became clamp".into()
                });
                Wrap::Clamp
            }
            other => {
                let problem = format!("{} is not a wrap mode", quoted(other.as_bytes()));
                return Err(params.fault(problem, "use repeat, black or clamp"));
            }
        };
        let filtering = if params.string("filter")? == Some("point") {
            Filtering::Nearest
        } else {
            Filtering::Trilinear
        };
        for name in ["maxanisotropy", "trilinear"] {
            params.get(name);
        }
        let picture = Picture {
            image,
            encoding,
            gamma,
            scale: finite(params, "scale", 1.0)?,
            invert: params.bool_or("invert", false)?,
            wrap,
            filtering,
            mapping: self.mapping(params)?,
        };
        Ok(Rc::new(Pattern::Picture(picture)))
    }

    /// The id of an image, which is read only once.
    pub(super) fn image(&mut self, name: &str) -> ImageId {
        let home = super::home(self.main, &self.included, name);
        self.images.image(&mut self.scene, home, name)
    }

    /// A parameter that may be a texture, a number or a colour.
    pub(super) fn pattern_param(
        &mut self,
        params: &Params,
        name: &str,
        is_color: bool,
    ) -> Result<Option<Rc<Pattern>>, Fault> {
        let kinds: &[Type] = if is_color {
            &[Type::Rgb, Type::Spectrum, Type::Blackbody, Type::Xyz, Type::Texture, Type::Float]
        } else {
            &[Type::Float, Type::Texture]
        };
        let Some(param) = params.typed(name, kinds)? else { return Ok(None) };
        if param.kind != Type::Texture {
            return Ok(Some(Rc::new(Pattern::Constant(self.color(param, Role::Factor)?))));
        }
        let [texture] = param.strings() else {
            return Err(param.fault("one texture was expected", "name one"));
        };
        let table = if is_color { &self.patterns.colors } else { &self.patterns.scalars };
        if let Some(pattern) = table.get(texture) {
            return Ok(Some(pattern.clone()));
        }
        // As in pbrt-v3, the parameter has its default then.
        let kind = if is_color { "spectrum" } else { "float" };
        let texture = quoted(texture.as_bytes());
        let what = format!("\"{} {}\"", param.kind.name(), param.name);
        self.note(format!("no {kind} texture {texture}"), param.at, || {
            format!(
                "{what}: there is no {kind} texture {texture} so far; its default was used: define \
                it above its first use"
            )
        });
        Ok(None)
    }

    /// A pattern as a colour parameter of a material.
    pub(super) fn color_param(&mut self, pattern: &Rc<Pattern>) -> ColorParam {
        let (factor, texture) = self.place_pattern(pattern, true);
        ColorParam::textured(factor, texture)
    }

    /// A pattern as a scalar parameter of a material.
    pub(super) fn scalar_param(&mut self, pattern: &Rc<Pattern>) -> ScalarParam {
        let (factor, texture) = self.place_pattern(pattern, false);
        ScalarParam { factor: factor.r, texture: texture.map(|id| (id, 0)) }
    }

    /// The factor and the texture for a pattern.
    fn place_pattern(&mut self, pattern: &Rc<Pattern>, is_color: bool) -> (Rgb, Option<TextureId>) {
        if let Some(constant) = pattern.as_constant() {
            return (constant, None);
        }
        let key = (Rc::as_ptr(pattern), is_color);
        if let Some((_, factor, texture)) = self.patterns.placed.get(&key) {
            return (*factor, *texture);
        }
        let (factor, texture) = self.new_texture(pattern, is_color);
        self.patterns.placed.insert(key, (pattern.clone(), factor, texture));
        (factor, texture)
    }

    fn new_texture(&mut self, pattern: &Rc<Pattern>, is_color: bool) -> (Rgb, Option<TextureId>) {
        let part = |builder: &mut Self, part: &Rc<Pattern>, is_color: bool| -> ColorParam {
            let (factor, texture) = builder.place_pattern(part, is_color);
            ColorParam::textured(factor, texture)
        };
        let texture: Texture = match &**pattern {
            Pattern::Constant(color) => return (*color, None),
            Pattern::Picture(picture) => {
                let shown = self.place_picture(picture, is_color, None);
                let factor = Rgb::splat(picture.scale);
                if !picture.invert {
                    return (factor, Some(shown));
                }
                let amount = ColorParam::textured(factor, Some(shown));
                pattern::Mix { first: Rgb::WHITE.into(), second: Rgb::BLACK.into(), amount }.into()
            }
            Pattern::Product(a, b) => {
                let (texture, scale) = (part(self, a, is_color), part(self, b, is_color));
                // A constant factor needs no texture.
                match (texture.texture, scale.texture) {
                    (id, None) | (None, id) => return (texture.factor * scale.factor, id),
                    _ => pattern::Scale { texture, scale }.into(),
                }
            }
            Pattern::Mix([a, b, t]) => {
                let (first, second) = (part(self, a, is_color), part(self, b, is_color));
                pattern::Mix { first, second, amount: part(self, t, false) }.into()
            }
            Pattern::Checkerboard([a, b], mapping) => {
                let (even, odd) = (part(self, a, is_color), part(self, b, is_color));
                pattern::Checkerboard { even, odd, mapping: mapping.clone() }.into()
            }
            Pattern::SolidCheckerboard([a, b], texture_from_world) => {
                let (even, odd) = (part(self, a, is_color), part(self, b, is_color));
                pattern::SolidCheckerboard { even, odd, texture_from_world: *texture_from_world }
                    .into()
            }
            Pattern::DirectionMix([a, b], axis) => {
                let (first, second) = (part(self, a, is_color), part(self, b, is_color));
                pattern::DirectionMix { first, second, axis: *axis }.into()
            }
            Pattern::Dots([a, b], mapping) => {
                let (inside, outside) = (part(self, a, is_color), part(self, b, is_color));
                pattern::Dots { inside, outside, mapping: mapping.clone() }.into()
            }
            Pattern::Whole(pattern) => pattern.clone().into(),
            Pattern::Map(of, function) => {
                if let Some((factor, picture)) = of.as_picture() {
                    return (
                        Rgb::WHITE,
                        Some(self.place_picture(picture, is_color, Some((factor, *function)))),
                    );
                }
                let base = part(self, of, is_color);
                match function.exponent {
                    Some(exponent) => pattern::Power { base, exponent }.into(),
                    None => pattern::Ramp { amount: base, colors: table(*function) }.into(),
                }
            }
        };
        (Rgb::WHITE, Some(self.scene.add_texture(texture)))
    }

    /// Adds the texture of a picture, without the picture's factor and inversion. `function`, if
    /// given, is applied to the picture's values times a factor.
    fn place_picture(
        &mut self,
        picture: &Picture,
        is_color: bool,
        function: Option<(Rgb, Function)>,
    ) -> TextureId {
        let (image, encoding) = self.copied(picture, is_color, function);
        let plain = ImageTexture {
            wrap: [picture.wrap; 2],
            filtering: picture.filtering,
            ..ImageTexture::new(image, encoding)
        };
        if let Mapping::Uv { uv_transform: [s, [a, b, c]], .. } = picture.mapping {
            // The rows of a picture are counted from the top.
            return self
                .scene
                .add_texture(ImageTexture { uv_transform: [s, [-a, -b, 1.0 - c]], ..plain });
        }
        let texture = ColorParam::textured(Rgb::WHITE, Some(self.scene.add_texture(plain)));
        self.scene.add_texture(pattern::Projected { texture, mapping: picture.mapping.clone() })
    }

    /// The picture itself, or a copy with converted values.
    fn copied(
        &mut self,
        picture: &Picture,
        is_color: bool,
        function: Option<(Rgb, Function)>,
    ) -> (ImageId, Encoding) {
        let image = self.scene.images[picture.image.index()].clone();
        // A scalar is the mean of the channels, so colours become grey.
        let stays_color = is_color || image.channels <= 2;
        if picture.gamma.is_none() && stays_color && function.is_none() {
            return (picture.image, picture.encoding);
        }
        let is_srgb = picture.encoding == Encoding::Srgb;
        let of =
            function.map(|(factor, f)| (f.apply as usize, factor.to_array().map(f32::to_bits)));
        let key = (picture.image, is_srgb, picture.gamma.map(f32::to_bits), is_color, of);
        if let Some(&known) = self.patterns.copies.get(&key) {
            return (known, Encoding::Linear);
        }
        self.patterns.copied += image.width as usize * image.height as usize;
        if self.patterns.copied > MAX_COPIED {
            self.note("copies", Spot::default(), || {
                "too many pictures with powers or in grey: further ones were used unchanged".into()
            });
            return (picture.image, picture.encoding);
        }
        let channels = if is_color { 3 } else { 1 };
        let mut values =
            Vec::with_capacity(image.width as usize * image.height as usize * channels as usize);
        for (y, x) in (0..image.height).flat_map(|y| (0..image.width).map(move |x| (y, x))) {
            let [r, g, b, _] = image.rgba_as(x, y, picture.encoding);
            let decoded = Rgb::new(r, g, b)
                .map(|v| picture.gamma.map_or(v, |gamma| real::powf(v.max(0.0), gamma)));
            let shown =
                |color: Rgb| function.map_or(color, |(factor, f)| (color * factor).map(f.apply));
            match is_color {
                true => values.extend(shown(decoded).to_array()),
                false => {
                    values.push(shown(Rgb::splat((decoded.r + decoded.g + decoded.b) / 3.0)).r)
                }
            }
        }
        let copy = self.scene.add_image(Arc::new(Image::from_f32(
            image.width,
            image.height,
            channels,
            values,
        )));
        self.patterns.copies.insert(key, copy);
        (copy, Encoding::Linear)
    }
}

fn whole(pattern: impl Into<texture::Pattern>) -> Rc<Pattern> {
    Rc::new(Pattern::Whole(pattern.into()))
}

/// The parameter `name` as a finite number, or its default.
fn finite(params: &Params, name: &str, default: f64) -> Result<f32, Fault> {
    let value = params.float_or(name, default)? as f32;
    if value.is_finite() {
        Ok(value)
    } else {
        Err(params.fault(format!("{name} is {value}"), "give a finite number"))
    }
}

/// The number of octaves of noise, and its roughness.
fn octaves(params: &Params) -> Result<(u32, f32), Fault> {
    let octaves = params.integer("octaves")?.unwrap_or(8);
    let Ok(octaves) = u32::try_from(octaves) else {
        return Err(params.fault(format!("octaves is {octaves}"), "give a number from 0 to 32"));
    };
    Ok((octaves, finite(params, "roughness", 0.5)?))
}

fn rows(map: DAffine3) -> Rows {
    let [x, y, z, w] = map.to_cols_array_2d();
    std::array::from_fn(|i| [x[i], y[i], z[i], w[i]])
}

/// The coordinate along `axis` in a texture's space, plus `shift`, as a linear function of the
/// world point.
fn planar(texture_from_world: &Rows, axis: Vec3, shift: f32) -> [f64; 4] {
    let axis = axis.to_array().map(f64::from);
    let mut row: [f64; 4] =
        std::array::from_fn(|i| (0..3).map(|k| axis[k] * texture_from_world[k][i]).sum());
    row[3] += f64::from(shift);
    row
}

/// A table of the values of a function over `[0, 1]`.
fn table(function: Function) -> Vec<Rgb> {
    const STEPS: u16 = 256;
    (0..=STEPS).map(|i| Rgb::splat((function.apply)(f32::from(i) / f32::from(STEPS)))).collect()
}

/// The encoding of a picture, and the exponent if it is a power.
fn encoding(
    params: &Params,
    stored: Encoding,
    is_color: bool,
    is_v3: bool,
) -> Result<(Encoding, Option<f32>), Fault> {
    // pbrt-v3: a flag, and only for 8-bit pictures; by default for colours only.
    if let Some(param) = params.get("gamma") {
        let linear = param.numbers() == [1.0]
            || matches!(param.values, super::params::Values::Bools(ref b) if b == &[false]);
        return Ok((if linear { Encoding::Linear } else { stored }, None));
    }
    match params.string("encoding")? {
        None if is_v3 && !is_color => Ok((Encoding::Linear, None)),
        None => Ok((stored, None)),
        Some("sRGB") => Ok((Encoding::Srgb, None)),
        Some("linear") => Ok((Encoding::Linear, None)),
        Some(other) => {
            match other.strip_prefix("gamma ").and_then(|g| g.trim().parse::<f32>().ok()) {
                Some(gamma) if gamma > 0.0 => Ok((Encoding::Linear, Some(gamma))),
                _ => {
                    let problem = format!("{} is not an encoding", quoted(other.as_bytes()));
                    Err(params.fault(problem, "use sRGB, linear or gamma and a number"))
                }
            }
        }
    }
}
