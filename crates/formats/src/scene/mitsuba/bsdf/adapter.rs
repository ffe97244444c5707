//! Converts BSDFs that contain other BSDFs.

use super::super::Builder;
use super::super::object::Object;
use super::super::texture::{Pattern, rgb_of};
use super::super::value;
use super::Look;
use crate::scene::fault::Fault;
use crate::scene::layers::{self, MAX_LAYERS};
use crate::scene::shapes::crossed;
use snell_math::Rgb;
use snell_scene::material::{BumpMap, HeightUnit, NormalMap, ScalarParam};
use snell_scene::texture::Filtering;
use snell_scene::{Encoding, Image, ImageTexture};
use std::rc::Rc;
use std::sync::Arc;

impl Builder<'_> {
    /// Converts a BSDF that contains other BSDFs.
    pub(super) fn adapter(&mut self, object: &Rc<Object>) -> Result<Look, Fault> {
        match object.kind.as_str() {
            "null" => Ok(Look::default()),
            "mask" => self.mask(object),
            "twosided" => self.twosided(object),
            "blendbsdf" | "mixturebsdf" => self.blend(object),
            "normalmap" => self.normal_map(object),
            _ => self.bump_map(object),
        }
    }

    pub(super) fn inner_bsdf(&mut self, object: &Object) -> Result<Look, Fault> {
        match self.inner(object, |o| o.class == "bsdf")? {
            Some(inner) => self.bsdf(&inner),
            None => {
                Err(object.fault("there is no bsdf in it", "put one in, or a reference to one"))
            }
        }
    }

    /// The texture of this name, or the only one.
    fn inner_texture(&mut self, object: &Object, name: &str) -> Result<Rc<Object>, Fault> {
        let texture = match self.child_named(object, name)? {
            Some(texture) => Some(texture),
            None => self.inner(object, |o| o.class == "texture")?,
        };
        texture.ok_or_else(|| object.fault("there is no texture in it", "put one in"))
    }

    fn mask(&mut self, object: &Object) -> Result<Look, Fault> {
        let mut look = self.inner_bsdf(object)?.with_solid_panes();
        let opacity = self.scalar(object, "opacity", 0.5)?;
        let (layers, is_exact) = layers::mask(look.layers, opacity);
        look.layers = layers;
        if !look.back.is_empty() {
            look.back = layers::mask(look.back, opacity).0;
        }
        if !is_exact {
            self.note("mask of blend", object.at, || {
                "a mask with a texture around a blend: the mask was put on the blend's last bsdf \
                    only"
                    .into()
            });
        }
        Ok(look)
    }

    fn twosided(&mut self, object: &Object) -> Result<Look, Fault> {
        let inner: Vec<_> = object.children_where(|_| true).collect();
        let mut sides = Vec::new();
        for child in inner {
            let side = self.resolve(child)?;
            if side.class == "bsdf" {
                sides.push(side);
            }
        }
        let [first, rest @ ..] = &sides[..] else {
            return Err(object.fault("there is no bsdf in it", "put one in, or a reference to one"));
        };
        object.bool_or("allow_transmission", false)?;
        let mut look = Look { is_one_sided: false, ..self.bsdf(first)? };
        let back = match rest.first() {
            Some(second) => self.bsdf(second)?,
            None => look.clone(),
        };
        // Both sides have one tangent frame, so green has the other handedness on the back.
        let has_normal_map = back.layers.iter().any(|layer| layer.normal_map.is_some());
        if !rest.is_empty() || has_normal_map {
            look.back = back.layers;
            look.attributes.add(&back.attributes);
            let maps = look.back.iter_mut().filter_map(|layer| layer.normal_map.as_mut());
            maps.for_each(|map| map.bitangent = map.bitangent.mirrored());
        }
        Ok(look)
    }

    /// A blend of two BSDFs: `weight` is the share of the second. In version 0.6 it may also be a
    /// mixture of any number of BSDFs with `weights`.
    fn blend(&mut self, object: &Object) -> Result<Look, Fault> {
        let mut parts = Vec::new();
        for child in object.children_where(|c| c.name != "weight") {
            let part = self.resolve(child)?;
            if part.class == "bsdf" {
                let look = self.bsdf(&part)?.with_solid_panes();
                if !look.back.is_empty() {
                    self.note("blended back", object.at, || {
                        "a blend of bsdfs with two sides: the fronts were used on both".into()
                    });
                }
                parts.push(Look { back: Vec::new(), ..look });
            } else {
                child.used.set(false);
            }
        }
        if parts.iter().map(|part| part.layers.len()).sum::<usize>() > MAX_LAYERS {
            let problem =
                format!("blends of blends make more than {MAX_LAYERS} bsdfs of one, the limit");
            return Err(object.fault(problem, "blend fewer"));
        }
        if object.kind == "mixturebsdf" {
            return self.mixture(object, parts);
        }
        let [first, second] = &parts[..] else {
            return Err(
                object.fault(format!("{} bsdfs, where two were expected", parts.len()), "give two")
            );
        };
        let weight = self.scalar(object, "weight", 0.5)?;
        Ok(on_each_other(second.clone(), first.clone(), weight))
    }

    fn mixture(&mut self, object: &Object, parts: Vec<Look>) -> Result<Look, Fault> {
        let weights = match object.string("weights")? {
            Some((text, at)) => value::numbers(text)
                .map_err(|p| Fault::new(at, p, "give a number for each bsdf"))?,
            None => vec![1.0 / parts.len().max(1) as f64; parts.len()],
        };
        if weights.len() != parts.len() || parts.is_empty() || weights.iter().any(|w| *w < 0.0) {
            let problem = format!("{} weights for {} bsdfs", weights.len(), parts.len());
            return Err(object.fault(problem, "give one positive weight for each"));
        }
        let (mut look, mut sum) = (Look::default(), 0.0);
        for (part, weight) in parts.into_iter().zip(weights) {
            sum += weight;
            let share = if sum > 0.0 { (weight / sum) as f32 } else { 0.0 };
            look =
                if look.layers.is_empty() { part } else { on_each_other(part, look, share.into()) };
        }
        Ok(look)
    }

    fn normal_map(&mut self, object: &Object) -> Result<Look, Fault> {
        let mut look = self.inner_bsdf(object)?;
        let map = self.inner_texture(object, "normalmap")?;
        self.note_flags_of_normals(object)?;
        let pattern = match self.texture(&map)? {
            // One direction everywhere that is not the normal itself.
            Pattern::Constant(color) if rgb_of(color) != Rgb::new(0.5, 0.5, 1.0) => {
                let values = rgb_of(color).to_array().to_vec();
                let image = self.scene.add_image(Arc::new(Image::from_f32(1, 1, 3, values)));
                Pattern::Picture(Rgb::WHITE, ImageTexture::new(image, Encoding::Linear))
            }
            pattern => pattern,
        };
        if let Pattern::Picture(_, mut texture) = pattern {
            // Directions are linear, whatever the image declares.
            texture.encoding = Encoding::Linear;
            keep_details(&mut texture);
            let texture = self.scene.add_texture(texture);
            let bitangent = crossed(&self.world_from_file);
            let map = NormalMap { bitangent, ..NormalMap::new(texture, 1.0) };
            look.layers.iter_mut().for_each(|l| l.normal_map = Some(map));
        }
        Ok(look)
    }

    /// Warns of what Mitsuba can do about bent normals, if the file asks for it.
    fn note_flags_of_normals(&mut self, object: &Object) -> Result<(), Fault> {
        for (name, what) in [
            ("flip_invalid_normals", "normals that point away from the viewer are not turned"),
            ("use_shadowing_function", "light near the edge of its shadow is not dimmed"),
        ] {
            if object.bool_or(name, false)? {
                let owner = object.owner();
                self.note(format!("{owner} {name}"), object.at, || {
                    format!("{owner}: \"{name}\" is not done: {what}")
                });
            }
        }
        Ok(())
    }

    fn bump_map(&mut self, object: &Object) -> Result<Look, Fault> {
        let mut look = self.inner_bsdf(object)?;
        self.note_flags_of_normals(object)?;
        let map = self.inner_texture(object, "arbitrary")?;
        let scale = object.float_or("scale", 1.0)? as f32;
        if let Pattern::Picture(factor, mut texture) = self.texture(&map)? {
            keep_details(&mut texture);
            let height = factor.luminance() * scale;
            let texture = self.scene.add_texture(texture);
            let map = BumpMap { texture, channel: None, height, unit: HeightUnit::Scene };
            look.layers.iter_mut().for_each(|l| l.bump_map = Some(map));
        }
        Ok(look)
    }
}

/// Switches mip maps off, which Mitsuba lacks: the mean of a bump is flat.
fn keep_details(texture: &mut ImageTexture) {
    if texture.filtering == Filtering::Trilinear {
        texture.filtering = Filtering::Bilinear;
    }
}

/// Puts `top` on `share` of the surface and `rest` on the remainder.
fn on_each_other(top: Look, rest: Look, share: ScalarParam) -> Look {
    let mut attributes = top.attributes;
    attributes.add(&rest.attributes);
    let layers = layers::blend(top.layers, rest.layers, share);
    let is_one_sided = top.is_one_sided && rest.is_one_sided;
    Look { layers, back: Vec::new(), is_one_sided, attributes }
}
