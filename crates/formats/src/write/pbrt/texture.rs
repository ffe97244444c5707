//! Textures: pictures, and the patterns that pbrt has too.

use super::{File, quoted, rgb};
use crate::write::picture::Baked;
use snell_math::{DAffine3, DVec3, Rgb, Transform, real};
use snell_scene::material::ColorParam;
use snell_scene::texture::mapping::{IDENTITY, Rows};
use snell_scene::texture::{Filtering, Mapping, Pattern, Wrap, errors, pattern};
use snell_scene::{Encoding, Texture, TextureId};

/// Exponents of roughness patterns that pbrt can express. Snell's roughness is the square root of a
/// width, or the fourth root of a value that pbrt itself remaps to a width.
const ROOTS: [f32; 2] = [0.5, 0.25];

/// True for patterns that pbrt has too. Of power patterns, pbrt has only those with an exponent of
/// [`ROOTS`], as roughness.
pub fn is_known(pattern: &Pattern) -> bool {
    match pattern {
        Pattern::Power(power) => ROOTS.contains(&power.exponent),
        Pattern::Ramp(_) => false,
        Pattern::Projected(projected) => projected.texture.texture.is_some(),
        _ => true,
    }
}

/// The kind of a texture's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Color,
    Number,
}

impl Kind {
    fn name(self) -> &'static str {
        if self == Self::Color { "spectrum" } else { "float" }
    }
}

impl File<'_, '_> {
    /// The name of a texture, which is defined on first use: colours (`spectrum`) or numbers
    /// (`float`).
    pub fn texture(&mut self, id: TextureId, kind: &str, baked: Baked, who: &str) -> String {
        let is_sound = |id: TextureId| {
            errors(&self.scene.textures, self.scene.images.len())[id.index()].is_none()
        };
        let Some(Texture::Pattern(_)) =
            self.scene.textures.get(id.index()).filter(|_| is_sound(id))
        else {
            return self.picture(id, kind, baked, &Mapping::default(), who);
        };
        let kind = if kind == "float" { Kind::Number } else { Kind::Color };
        let factor = match baked {
            Baked::Tinted(factor) | Baked::Light(factor) => factor,
            Baked::UnderCoat { factor, .. } => {
                self.output.lose(format!(
                    "{who}: a pattern under a coat is written with its visible colour"
                ));
                factor
            }
            Baked::Scaled { factor, .. } => Rgb::splat(factor),
            Baked::Squared { factor, .. } => {
                self.output.lose(format!(
                    "{who}: a pattern as roughness is the square root of the width here, and the \
                        width in pbrt"
                ));
                Rgb::splat(factor)
            }
            Baked::Mask { .. } => {
                self.output
                    .lose(format!("{who}: a pattern as a mask is written without its threshold"));
                Rgb::WHITE
            }
        };
        self.pattern(id, kind, factor, who)
    }

    /// The texture of the microfacet width, if the roughness is a power pattern with an exponent of
    /// [`ROOTS`], and whether pbrt is to remap it. `factor` is a factor on the roughness.
    /// `None` for any other pattern.
    pub fn width(
        &mut self,
        id: TextureId,
        factor: f32,
        prefix: &str,
        who: &str,
    ) -> Option<(String, bool)> {
        let scene = self.scene;
        let Some(Texture::Pattern(Pattern::Power(power))) = scene.textures.get(id.index()) else {
            return None;
        };
        let (base, is_remapped) = (power.base.texture?, power.exponent == ROOTS[1]);
        // Materials with several layers have one remapping for all.
        if !ROOTS.contains(&power.exponent) || !prefix.is_empty() {
            return None;
        }
        let factor = power.base.factor
            * if is_remapped { real::powi(factor, 4) } else { real::powi(factor, 2) };
        Some((self.pattern(base, Kind::Number, factor, who), is_remapped))
    }

    /// The name of a pattern or picture times a factor.
    fn pattern(&mut self, id: TextureId, kind: Kind, factor: Rgb, who: &str) -> String {
        let scene = self.scene;
        let Some(Texture::Pattern(pattern)) = scene.textures.get(id.index()) else {
            return self.scaled_picture(id, kind, factor, &Mapping::default(), who);
        };
        let text = match pattern {
            Pattern::Checkerboard(p) => {
                let parts = self.inputs(kind, factor, who, [("tex1", &p.even), ("tex2", &p.odd)]);
                self.class(kind, "checkerboard", &parts, Some(&p.mapping), who)
            }
            Pattern::SolidCheckerboard(p) => {
                let parts = self.inputs(kind, factor, who, [("tex1", &p.even), ("tex2", &p.odd)]);
                self.class(
                    kind,
                    "checkerboard",
                    &format!("{parts} \"integer dimension\" [ 3 ]"),
                    None,
                    who,
                )
            }
            Pattern::Dots(p) => {
                // pbrt shows "inside" between the dots; see the reader.
                let parts = self.inputs(
                    kind,
                    factor,
                    who,
                    [("inside", &p.outside), ("outside", &p.inside)],
                );
                self.class(kind, "dots", &parts, Some(&p.mapping), who)
            }
            Pattern::Bilerp(p) => {
                let corners = [("v00", &p.v00), ("v01", &p.v01), ("v10", &p.v10), ("v11", &p.v11)];
                if corners.iter().any(|(_, corner)| corner.texture.is_some()) {
                    self.output.lose(format!(
                        "{who}: corners of a pattern that have textures are written without them"
                    ));
                }
                let bare =
                    corners.map(|(name, corner)| (name, ColorParam { texture: None, ..*corner }));
                let parts = self.inputs(
                    kind,
                    factor,
                    who,
                    bare.each_ref().map(|(name, corner)| (*name, corner)),
                );
                self.class(kind, "bilerp", &parts, Some(&p.mapping), who)
            }
            Pattern::Mix(p) => {
                let parts =
                    self.inputs(kind, factor, who, [("tex1", &p.first), ("tex2", &p.second)]);
                let amount = self.input("amount", Kind::Number, Rgb::WHITE, &p.amount, who);
                self.class(kind, "mix", &format!("{parts}{amount}"), None, who)
            }
            Pattern::DirectionMix(p) => {
                let parts =
                    self.inputs(kind, factor, who, [("tex1", &p.first), ("tex2", &p.second)]);
                let axis = format!(" \"vector dir\" [ {} {} {} ]", p.axis.x, p.axis.y, p.axis.z);
                self.class(kind, "directionmix", &format!("{parts}{axis}"), None, who)
            }
            Pattern::Scale(p) => {
                let part = self.input("tex", kind, factor, &p.texture, who);
                let scale = self.input("scale", Kind::Number, Rgb::WHITE, &p.scale, who);
                self.class(kind, "scale", &format!("{part}{scale}"), None, who)
            }
            Pattern::Projected(p) => {
                let (factor, child) = (factor * p.texture.factor, p.texture.texture);
                return match child.map(|child| (child, scene.textures.get(child.index()))) {
                    Some((child, Some(Texture::Image(_)))) => {
                        self.scaled_picture(child, kind, factor, &p.mapping, who)
                    }
                    _ => {
                        self.output.lose(format!(
                            "{who}: the mapping of a pattern of a pattern is left out"
                        ));
                        child.map_or_else(String::new, |child| {
                            self.pattern(child, kind, factor, who)
                        })
                    }
                };
            }
            Pattern::Fbm(pattern::Fbm { octaves, roughness, .. })
            | Pattern::Wrinkled(pattern::Wrinkled { octaves, roughness, .. }) => {
                let numbers = format!(
                    " \"integer octaves\" [ {octaves} ] \"float roughness\" [ {roughness} ]"
                );
                return self.noise(kind, factor, pattern, &numbers);
            }
            Pattern::Windy(_) => return self.noise(kind, factor, pattern, ""),
            Pattern::Marble(p) => {
                let pattern::Marble { octaves, roughness, scale, variation, .. } = p;
                let numbers = format!(
                    " \"integer octaves\" [ {octaves} ] \"float roughness\" [ {roughness} ] \
                        \"float scale\" [ {scale} ] \"float variation\" [ {variation} ]"
                );
                let text = format!("\"spectrum\" \"marble\"{numbers}");
                let name = self.define(text, Some(&p.texture_from_world));
                if kind == Kind::Number {
                    self.output.lose(format!("{who}: marble is a colour in pbrt, not a number"));
                }
                if factor == Rgb::WHITE {
                    return name;
                }
                if factor.r != factor.g || factor.g != factor.b {
                    self.output
                        .lose(format!("{who}: the tint of marble is written as its brightness"));
                }
                format!(
                    "\"spectrum\" \"scale\" \"texture tex\" [ \"{name}\" ] \"float scale\" [ {} ]",
                    factor.luminance()
                )
            }
            Pattern::Power(p) => {
                self.output.lose(format!(
                    "{who}: a root of a pattern is left out where it is not a roughness"
                ));
                let part = self.input("tex", kind, factor, &p.base, who);
                self.class(kind, "scale", &part, None, who)
            }
            Pattern::Ramp(_) => return String::new(),
        };
        let space = match pattern {
            Pattern::SolidCheckerboard(p) => Some(&p.texture_from_world),
            Pattern::Checkerboard(pattern::Checkerboard { mapping, .. })
            | Pattern::Dots(pattern::Dots { mapping, .. })
            | Pattern::Bilerp(pattern::Bilerp { mapping, .. }) => space(mapping),
            Pattern::DirectionMix(_) => Some(&IDENTITY),
            _ => None,
        };
        self.define(text, space)
    }

    /// Writes scalar noise, times a factor.
    fn noise(&mut self, kind: Kind, factor: Rgb, pattern: &Pattern, numbers: &str) -> String {
        let space = match pattern {
            Pattern::Fbm(p) => &p.texture_from_world,
            Pattern::Wrinkled(p) => &p.texture_from_world,
            Pattern::Windy(p) => &p.texture_from_world,
            _ => &IDENTITY,
        };
        let name = self.define(format!("\"float\" \"{}\"{numbers}", pattern.name()), Some(space));
        match kind {
            Kind::Number if factor == Rgb::WHITE => name,
            Kind::Number => self.define(
                format!(
                    "\"float\" \"scale\" \"texture tex\" [ \"{name}\" ] \"float scale\" [ {} ]",
                    factor.r
                ),
                None,
            ),
            // Noise is scalar in pbrt: as the amount of a mix of black and the factor it becomes a
            // colour.
            Kind::Color => {
                let black = rgb(Rgb::BLACK);
                let text = format!(
                    "\"spectrum\" \"mix\" \"rgb tex1\" {black} \"rgb tex2\" {} \"texture amount\" \
                        [ \"{name}\" ]",
                    rgb(factor)
                );
                self.define(text, None)
            }
        }
    }

    /// The class of a pattern and its parameters.
    fn class(
        &mut self,
        kind: Kind,
        class: &str,
        parts: &str,
        mapping: Option<&Mapping>,
        who: &str,
    ) -> String {
        let mapping = mapping.map_or_else(String::new, |mapping| self.mapping(mapping, who));
        format!("\"{}\" \"{class}\"{parts}{mapping}", kind.name())
    }

    fn inputs<const N: usize>(
        &mut self,
        kind: Kind,
        factor: Rgb,
        who: &str,
        parts: [(&str, &ColorParam); N],
    ) -> String {
        parts.map(|(name, part)| self.input(name, kind, factor, part, who)).concat()
    }

    /// A parameter of a pattern: a constant, or the name of a texture.
    fn input(
        &mut self,
        name: &str,
        kind: Kind,
        factor: Rgb,
        part: &ColorParam,
        who: &str,
    ) -> String {
        let own =
            part.spectrum.map_or(part.factor, |spectrum| part.factor * spectrum.reflectance_rgb());
        let factor = factor * own;
        if kind == Kind::Number && (factor.r != factor.g || factor.g != factor.b) {
            self.output.lose(format!(
                "{who}: where pbrt has a number, only the red of a colour is written"
            ));
        }
        match (part.texture, kind) {
            (Some(id), _) => {
                format!(" \"texture {name}\" [ \"{}\" ]", self.pattern(id, kind, factor, who))
            }
            (None, Kind::Color) => format!(" \"rgb {name}\" {}", rgb(factor)),
            (None, Kind::Number) => format!(" \"float {name}\" [ {} ]", factor.r),
        }
    }

    fn scaled_picture(
        &mut self,
        id: TextureId,
        kind: Kind,
        factor: Rgb,
        mapping: &Mapping,
        who: &str,
    ) -> String {
        let baked = match kind {
            Kind::Color => Baked::Tinted(factor),
            Kind::Number => Baked::Scaled { channel: 0, factor: factor.r },
        };
        self.picture(id, kind.name(), baked, mapping, who)
    }

    /// The name of a texture that is a picture, stored beside the file.
    fn picture(
        &mut self,
        id: TextureId,
        kind: &str,
        baked: Baked,
        mapping: &Mapping,
        who: &str,
    ) -> String {
        let texture = self.pictures.texture(id);
        let file = self.pictures.baked(self.output, id, baked);
        let encoding = self.pictures.encoding_of_baked(id, baked);
        let wrap = match texture.wrap {
            [Wrap::Repeat, Wrap::Repeat] => "",
            [Wrap::Clamp, Wrap::Clamp] => " \"string wrap\" [ \"clamp\" ]",
            [Wrap::Black, Wrap::Black] => " \"string wrap\" [ \"black\" ]",
            _ => {
                self.output.lose(format!(
                    "{who}: a texture that is mirrored, or differs by direction, now repeats"
                ));
                ""
            }
        };
        let encoding = match (file.ends_with(".exr"), encoding) {
            (true, _) => "",
            (false, Encoding::Srgb) => " \"string encoding\" [ \"sRGB\" ]",
            (false, Encoding::Linear) => " \"string encoding\" [ \"linear\" ]",
        };
        let filter = if texture.filtering == Filtering::Nearest {
            " \"string filter\" [ \"point\" ]"
        } else {
            ""
        };
        // The picture's rows are counted from the top, but pbrt's second coordinate points up.
        let own = match (mapping, texture.uv_transform) {
            (Mapping::Uv { .. }, [s, [a, b, c]]) => {
                Mapping::Uv { uv_set: texture.uv_set, uv_transform: [s, [-a, -b, 1.0 - c]] }
            }
            (space, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) => space.clone(),
            (space, _) => {
                self.output
                    .lose(format!("{who}: the placement of a projected picture is left out"));
                space.clone()
            }
        };
        let placement = self.mapping(&own, who);
        let text = format!(
            "\"{kind}\" \"imagemap\" \"string filename\" [ {} ]{encoding}{wrap}{filter}{placement}",
            quoted(&file)
        );
        self.define(text, space(&own))
    }

    /// The parameters of a mapping, without its space.
    fn mapping(&mut self, mapping: &Mapping, who: &str) -> String {
        match mapping {
            Mapping::Uv { uv_set, uv_transform: [[a, b, c], [d, e, f]] } => {
                if *b != 0.0 || *d != 0.0 || *uv_set != 0 {
                    self.output.lose(format!(
                        "{who}: a rotated texture, or one on the second coordinates, is placed \
                            otherwise"
                    ));
                }
                let numbers = [
                    ("uscale", *a, 1.0),
                    ("vscale", -*e, 1.0),
                    ("udelta", *c, 0.0),
                    ("vdelta", *e + *f, 0.0),
                ];
                let said = numbers.iter().filter(|(_, value, default)| value != default);
                said.map(|(name, value, _)| format!(" \"float {name}\" [ {value} ]")).collect()
            }
            Mapping::Spherical { .. } => " \"string mapping\" [ \"spherical\" ]".into(),
            Mapping::Cylindrical { .. } => " \"string mapping\" [ \"cylindrical\" ]".into(),
            Mapping::Planar { st_from_world: [[a, b, c, d], [e, f, g, h]] } => format!(
                " \"string mapping\" [ \"planar\" ] \"vector v1\" [ {a} {b} {c} ] \"vector v2\" [ \
                    {e} {f} {g} ] \"float udelta\" [ {d} ] \"float vdelta\" [ {h} ]"
            ),
        }
    }

    /// The name of a texture with this text, which is defined in this space on first use.
    pub fn define(&mut self, text: String, texture_from_world: Option<&Rows>) -> String {
        let key = format!("{text} {texture_from_world:?}");
        if let Some(name) = self.textures.get(&key) {
            return name.clone();
        }
        let name = format!("texture-{}", self.texture_count);
        self.texture_count += 1;
        let statement = format!("Texture \"{name}\" {text}");
        match texture_from_world {
            None => self.line(statement),
            Some(rows) => {
                let [x, y, z] = *rows;
                let column = |i: usize| DVec3::new(x[i], y[i], z[i]);
                let map = DAffine3::from_cols(column(0), column(1), column(2), column(3));
                match Transform::new(map) {
                    Some(map) => {
                        let transform = super::transform(map.inverse_matrix());
                        self.line(format!(
                            "AttributeBegin\n{transform}\n{statement}\nAttributeEnd"
                        ));
                    }
                    None => {
                        self.output.lose("the flat space of a pattern is left out");
                        self.line(statement);
                    }
                }
            }
        }
        self.textures.insert(key, name.clone());
        name
    }
}

/// The space of a mapping; the world's for one in world coordinates.
fn space(mapping: &Mapping) -> Option<&Rows> {
    match mapping {
        Mapping::Uv { .. } => None,
        Mapping::Spherical { texture_from_world } | Mapping::Cylindrical { texture_from_world } => {
            Some(texture_from_world)
        }
        Mapping::Planar { .. } => Some(&IDENTITY),
    }
}
