//! Textures: a tree of patterns, and what materials see of it.
//!
//! A picture with factors is used as it is. Patterns that combine others are *baked*: drawn once into a picture over the part of the
//! texture coordinates in which they repeat. Patterns in space, which texture coordinates cannot say, become their mean.

mod bake;

use super::Builder;
use super::lexer::{Lexer, quoted};
use super::options::is_kind;
use super::params::{Params, Type};
use super::spectrum::Role;
use super::state::Target;
use crate::scene::fault::{Fault, Spot};
use bake::bake;
use snell_math::{Rgb, Vec2};
use snell_scene::graph::ImageId;
use snell_scene::material::{ColorParam, ScalarParam};
use snell_scene::texture::{Filtering, Wrap};
use snell_scene::{Encoding, Texture, TextureId};
use std::collections::HashMap;
use std::rc::Rc;

/// Affine map of the texture coordinates: `(su u + du, sv v + dv)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapping {
    scale: Vec2,
    offset: Vec2,
}

/// A picture.
#[derive(Clone, Debug)]
pub struct Picture {
    image: ImageId,
    encoding: Encoding,
    /// Exponent that decodes values, for encodings that are powers.
    gamma: Option<f32>,
    /// Factor on the decoded values.
    scale: f32,
    /// True if values count as 1 minus them.
    invert: bool,
    wrap: Wrap,
    filtering: Filtering,
    mapping: Mapping,
}

/// What a texture shows.
#[derive(Clone, Debug)]
pub enum Pattern {
    Constant(Rgb),
    Picture(Picture),
    Product(Rc<Pattern>, Rc<Pattern>),
    /// The first where the third is 0, the second where it is 1.
    Mix([Rc<Pattern>; 3]),
    Checkerboard([Rc<Pattern>; 2], Mapping),
    /// Values at (0, 0), (0, 1), (1, 0) and (1, 1).
    Bilinear([Rgb; 4], Mapping),
    /// Inside and outside of dots.
    Dots([Rc<Pattern>; 2], Mapping),
    /// A function of each value of another, and of a constant.
    Map(Rc<Pattern>, fn(f32, f32) -> f32, f32),
}

/// The textures of a scene.
#[derive(Debug, Default)]
pub struct Patterns {
    colors: HashMap<String, Rc<Pattern>>,
    scalars: HashMap<String, Rc<Pattern>>,
    /// What was baked or placed already, by address; the pattern is kept so that its address stays its own.
    placed: HashMap<(*const Pattern, bool), (Rc<Pattern>, Rgb, Option<TextureId>)>,
    /// Pixels baked so far.
    baked: usize,
}

/// Most patterns that a texture is made of.
const MAX_PARTS: usize = 256;
/// Most pixels of all baked pictures.
const MAX_BAKED: usize = 1 << 28;

impl Pattern {
    /// The same everywhere.
    pub fn constant(value: f32) -> Rc<Self> {
        Rc::new(Self::Constant(Rgb::splat(value)))
    }

    /// The value, if it is the same everywhere.
    pub fn as_constant(&self) -> Option<Rgb> {
        match self {
            Self::Constant(color) => Some(*color),
            Self::Product(a, b) => Some(a.as_constant()? * b.as_constant()?),
            Self::Mix([a, b, t]) => {
                let (a, b, t) = (a.as_constant()?, b.as_constant()?, t.as_constant()?);
                Some(a * t.map(|t| 1.0 - t) + b * t)
            }
            Self::Map(of, function, constant) => Some(of.as_constant()?.map(|x| function(x, *constant))),
            _ => None,
        }
    }

    /// Of how many patterns it is made; `None` if more than this.
    fn size_within(&self, limit: usize) -> Option<usize> {
        let left = limit.checked_sub(1)?;
        let parts: &[&Rc<Self>] = match self {
            Self::Constant(_) | Self::Picture(_) | Self::Bilinear(..) => &[],
            Self::Product(a, b) | Self::Checkerboard([a, b], _) | Self::Dots([a, b], _) => &[a, b],
            Self::Mix([a, b, t]) => &[a, b, t],
            Self::Map(of, ..) => &[of],
        };
        let mut size = 1;
        for part in parts {
            size += part.size_within(left + 1 - size)?;
        }
        Some(size)
    }

    /// A factor and a picture, if that is all there is.
    fn as_picture(&self) -> Option<(Rgb, &Picture)> {
        match self {
            Self::Picture(p) if !p.invert && p.gamma.is_none() => Some((Rgb::splat(p.scale), p)),
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

    /// The same with a function of each value and of a constant.
    pub fn mapped(self: &Rc<Self>, function: fn(f32, f32) -> f32, constant: f32) -> Rc<Self> {
        let mapped = Self::Map(self.clone(), function, constant);
        Rc::new(mapped.as_constant().map_or(mapped, Self::Constant))
    }
}

impl Builder<'_> {
    /// `Texture "name" "spectrum" "imagemap" ...`
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
            return Err(params.fault(format!("made of more than {MAX_PARTS} textures, the limit"), "simplify it"));
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
            let amount = self.pattern_param(params, "amount", false)?.unwrap_or_else(|| Pattern::constant(0.5));
            Rc::new(Pattern::Mix([child(self, "tex1", 0.0)?, child(self, "tex2", 1.0)?, amount]))
        } else if kind("imagemap") {
            self.picture(params, is_color)?
        } else if kind("checkerboard") && params.integer("dimension")?.unwrap_or(2) == 2 {
            params.get("aamode");
            let mapping = self.mapping(params)?;
            Rc::new(Pattern::Checkerboard([child(self, "tex1", 1.0)?, child(self, "tex2", 0.0)?], mapping))
        } else if kind("bilerp") {
            let mapping = self.mapping(params)?;
            let mut corners = [Rgb::BLACK; 4];
            for (corner, (name, default)) in
                corners.iter_mut().zip([("v00", 0.0), ("v01", 1.0), ("v10", 0.0), ("v11", 1.0)])
            {
                *corner = match params.get(name) {
                    Some(param) => self.color(param, Role::Factor)?,
                    None => Rgb::splat(default),
                };
            }
            Rc::new(Pattern::Bilinear(corners, mapping))
        } else if kind("dots") {
            let mapping = self.mapping(params)?;
            Rc::new(Pattern::Dots([child(self, "inside", 1.0)?, child(self, "outside", 0.0)?], mapping))
        } else {
            self.mean_pattern(params, is_color)?
        })
    }

    /// What stands in for a pattern that texture coordinates cannot say.
    fn mean_pattern(&mut self, params: &Params, is_color: bool) -> Result<Rc<Pattern>, Fault> {
        let pair = |builder: &mut Self| -> Result<Rc<Pattern>, Fault> {
            let get = |builder: &mut Self, name: &str, default| {
                Ok::<_, Fault>(
                    builder.pattern_param(params, name, is_color)?.unwrap_or_else(|| Pattern::constant(default)),
                )
            };
            let (a, b) = (get(builder, "tex1", 0.0)?, get(builder, "tex2", 1.0)?);
            Ok(Rc::new(Pattern::Mix([a, b, Pattern::constant(0.5)])))
        };
        let (pattern, what) = if is_kind(params, "checkerboard") || is_kind(params, "directionmix") {
            params.get("dir");
            (pair(self)?, "the mean of its two textures")
        } else if is_kind(params, "marble") {
            (Rc::new(Pattern::Constant(Rgb::new(0.45, 0.43, 0.45))), "its mean colour")
        } else if is_kind(params, "ptex") {
            params.get("filename");
            (Pattern::constant(0.5 * params.float_or("scale", 1.0)? as f32), "grey")
        } else {
            (Pattern::constant(if is_kind(params, "fbm") { 0.0 } else { 0.5 }), "its mean")
        };
        for name in ["octaves", "roughness", "scale", "variation", "dimension", "encoding", "aamode"] {
            params.get(name);
        }
        let owner = params.owner.clone();
        self.note(owner.clone(), params.at, || format!("{owner} is a pattern in space; {what} was used instead"));
        Ok(pattern)
    }

    fn mapping(&mut self, params: &Params) -> Result<Mapping, Fault> {
        let get = |name: &str, default| Ok::<_, Fault>(params.float_or(name, default)? as f32);
        let kind = params.string("mapping")?.unwrap_or("uv").to_string();
        if kind != "uv" {
            let what = quoted(kind.as_bytes());
            self.note(format!("mapping {what}"), params.at, || {
                format!("{} with the mapping {what}: the texture coordinates were used instead", params.owner)
            });
            for name in ["v1", "v2"] {
                params.get(name);
            }
        }
        Ok(Mapping {
            scale: Vec2::new(get("uscale", 1.0)?, get("vscale", 1.0)?),
            offset: Vec2::new(get("udelta", 0.0)?, get("vdelta", 0.0)?),
        })
    }

    fn picture(&mut self, params: &Params, is_color: bool) -> Result<Rc<Pattern>, Fault> {
        let Some((name, at)) = self.file_name(params, "filename")? else {
            return Err(params.fault("there is no file name", "add \"string filename\""));
        };
        let image = self.image(name, at)?;
        let stored = self.scene.images[image.index()].encoding;
        let (encoding, gamma) = encoding(params, stored, is_color, self.is_v3)?;
        let wrap = match params.string("wrap")?.unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "black" => Wrap::Black,
            "clamp" => Wrap::Clamp,
            "octahedralsphere" => {
                self.note("wrap", params.at, || "the wrap mode octahedralsphere became clamp".into());
                Wrap::Clamp
            }
            other => {
                let problem = format!("{} is not a wrap mode", quoted(other.as_bytes()));
                return Err(params.fault(problem, "use repeat, black or clamp"));
            }
        };
        let filtering =
            if params.string("filter")? == Some("point") { Filtering::Nearest } else { Filtering::Trilinear };
        for name in ["maxanisotropy", "trilinear"] {
            params.get(name);
        }
        let picture = Picture {
            image,
            encoding,
            gamma,
            scale: params.float_or("scale", 1.0)? as f32,
            invert: params.bool_or("invert", false)?,
            wrap,
            filtering,
            mapping: self.mapping(params)?,
        };
        Ok(Rc::new(Pattern::Picture(picture)))
    }

    /// An image, read once.
    pub(super) fn image(&mut self, name: &str, at: Spot) -> Result<ImageId, Fault> {
        let main = self.main;
        self.images.image(&mut self.scene, main, name).map_err(|error| Fault::new(at, error.problem, error.remedy))
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
        let [texture] = param.strings() else { return Err(param.fault("one texture was expected", "name one")) };
        let table = if is_color { &self.patterns.colors } else { &self.patterns.scalars };
        if let Some(pattern) = table.get(texture) {
            return Ok(Some(pattern.clone()));
        }
        let kind = if is_color { "spectrum" } else { "float" };
        let problem = format!("there is no {kind} texture {} so far", quoted(texture.as_bytes()));
        Err(param.fault(problem, "define it above its first use"))
    }

    /// A pattern as a parameter of a material.
    pub(super) fn color_param(&mut self, pattern: &Rc<Pattern>) -> ColorParam {
        let (factor, texture) = self.place_pattern(pattern, true);
        ColorParam::textured(factor, texture)
    }

    /// A pattern as a scalar parameter of a material.
    pub(super) fn scalar_param(&mut self, pattern: &Rc<Pattern>) -> ScalarParam {
        let (factor, texture) = self.place_pattern(pattern, false);
        ScalarParam { factor: factor.r, texture: texture.map(|id| (id, 0)) }
    }

    /// A factor and a texture that show a pattern.
    fn place_pattern(&mut self, pattern: &Rc<Pattern>, is_color: bool) -> (Rgb, Option<TextureId>) {
        if let Some(constant) = pattern.as_constant() {
            return (constant, None);
        }
        let key = (Rc::as_ptr(pattern), is_color);
        if let Some((_, factor, texture)) = self.patterns.placed.get(&key) {
            return (*factor, *texture);
        }
        let plain = pattern.as_picture().filter(|(_, p)| {
            // A scalar is the mean of the channels, so colours must be drawn as grey.
            is_color || self.scene.images[p.image.index()].channels <= 2
        });
        let (factor, texture) = match plain {
            Some((factor, picture)) => (factor, picture.texture()),
            None => (Rgb::WHITE, self.baked(pattern, is_color)),
        };
        let id = self.scene.add_texture(texture);
        self.patterns.placed.insert(key, (pattern.clone(), factor, Some(id)));
        (factor, Some(id))
    }

    fn baked(&mut self, pattern: &Pattern, is_color: bool) -> Texture {
        let pixels = (MAX_BAKED - self.patterns.baked) / pattern.size_within(MAX_PARTS).unwrap_or(MAX_PARTS);
        let baked = bake(pattern, &self.scene.images, is_color, pixels.max(1));
        let drawn = baked.image.width as usize * baked.image.height as usize;
        self.patterns.baked = (self.patterns.baked + drawn).min(MAX_BAKED);
        if !baked.repeats {
            self.note("baked", Spot::default(), || {
                "textures of different scales do not repeat together; they were drawn together for coordinates from 0 to 8".into()
            });
        }
        let image = self.scene.add_image(std::sync::Arc::new(baked.image));
        let mut texture = Texture::new(image, Encoding::Linear);
        let scale = 1.0 / baked.period;
        texture.uv_transform = [[scale, 0.0, 0.0], [0.0, scale, 1.0 - scale]];
        texture.filtering = baked.filtering;
        texture.wrap = [baked.wrap; 2];
        texture
    }
}

impl Picture {
    fn texture(&self) -> Texture {
        let Mapping { scale, offset } = self.mapping;
        Texture {
            wrap: [self.wrap; 2],
            filtering: self.filtering,
            // Meshes and shapes have v downwards (see `shape`), pbrt upwards.
            uv_transform: [[scale.x, 0.0, offset.x], [0.0, scale.y, 1.0 - scale.y - offset.y]],
            ..Texture::new(self.image, self.encoding)
        }
    }
}

/// The encoding of a picture, and the exponent if it is a power.
fn encoding(params: &Params, stored: Encoding, is_color: bool, is_v3: bool) -> Result<(Encoding, Option<f32>), Fault> {
    // pbrt-v3: a flag, and only for 8-bit pictures; by default for colours only.
    if let Some(param) = params.get("gamma") {
        let linear =
            param.numbers() == [1.0] || matches!(param.values, super::params::Values::Bools(ref b) if b == &[false]);
        return Ok((if linear { Encoding::Linear } else { stored }, None));
    }
    match params.string("encoding")? {
        None if is_v3 && !is_color => Ok((Encoding::Linear, None)),
        None => Ok((stored, None)),
        Some("sRGB") => Ok((Encoding::Srgb, None)),
        Some("linear") => Ok((Encoding::Linear, None)),
        Some(other) => match other.strip_prefix("gamma ").and_then(|g| g.trim().parse::<f32>().ok()) {
            Some(gamma) if gamma > 0.0 => Ok((Encoding::Linear, Some(gamma))),
            _ => {
                let problem = format!("{} is not an encoding", quoted(other.as_bytes()));
                Err(params.fault(problem, "use sRGB, linear or gamma and a number"))
            }
        },
    }
}
