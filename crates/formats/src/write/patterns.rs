//! Patterns for formats that cannot express them: they are drawn into pictures if they depend only
//! on the surface's coordinates, and are replaced by their mean otherwise.

use super::Output;
use snell_math::{Bounds3d, DVec3, Rgb, Vec2, rng};
use snell_scene::texture::{Mapping, Pattern, TextureSet, Wrap, errors, surface_at};
use snell_scene::{Encoding, Image, ImageTexture, Material, Scene, Texture, TextureId};
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Minimum pixels per unit of the coordinates.
const DETAIL: f32 = 256.0;
/// Maximum number of pixels along a side.
const MAX_SIZE: f32 = 2048.0;
/// Longest period that is tried.
const MAX_PERIOD: u8 = 8;
/// Maximum difference of values that count as equal.
const SAME: f32 = 1e-3;

/// The scene with every pattern replaced that the format does not know.
pub fn drawn<'a>(
    scene: &'a Scene,
    known: fn(&Pattern) -> bool,
    output: &mut Output,
) -> Cow<'a, Scene> {
    let is_strange =
        |texture: &Texture| texture.as_pattern().is_some_and(|pattern| !known(pattern));
    if !scene.textures.iter().any(is_strange) {
        return Cow::Borrowed(scene);
    }
    // Only textures of materials, and inputs of known patterns, are written.
    let mut used: BTreeSet<TextureId> =
        scene.materials.iter().flat_map(Material::textures).collect();
    for (i, texture) in scene.textures.iter().enumerate().rev() {
        if let Some(pattern) = texture
            .as_pattern()
            .filter(|pattern| used.contains(&TextureId(i as u32)) && known(pattern))
        {
            used.extend(pattern.textures());
        }
    }
    let mut drawing = Drawing { scene, set: TextureSet::new(&scene.textures, &scene.images) };
    let broken = errors(&scene.textures, scene.images.len());
    let mut copy = scene.clone();
    for id in used {
        let Some(pattern) =
            scene.textures.get(id.index()).filter(|t| is_strange(t)).and_then(Texture::as_pattern)
        else {
            continue;
        };
        let who = format!("texture {} ({})", id.0, pattern.name());
        let texture = if broken[id.index()].is_some() {
            let magenta = Rgb::new(1.0, 0.0, 1.0);
            Drawn { image: plain(magenta), period: 1.0, wrap: Wrap::Repeat }
        } else if drawing.is_on_surface(id) {
            let (drawn, repeats) = drawing.picture(id);
            let how = if repeats {
                ""
            } else {
                "; it does not repeat, and is drawn for coordinates from 0 to 1"
            };
            output.lose(format!("{who} is drawn into a picture{how}"));
            drawn
        } else {
            output.lose(format!(
                "{who} is a pattern in space, which the format cannot express: \
                its mean is written"
            ));
            Drawn { image: plain(drawing.mean(id)), period: 1.0, wrap: Wrap::Repeat }
        };
        let image = copy.add_image(Arc::new(texture.image));
        let scale = 1.0 / texture.period;
        copy.textures[id.index()] = Texture::Image(ImageTexture {
            wrap: [texture.wrap; 2],
            uv_transform: [[scale, 0.0, 0.0], [0.0, scale, 0.0]],
            ..ImageTexture::new(image, Encoding::Linear)
        });
    }
    Cow::Owned(copy)
}

fn plain(color: Rgb) -> Image {
    Image::from_f32(1, 1, 3, color.to_array().to_vec())
}

/// A pattern drawn into a picture.
struct Drawn {
    image: Image,
    /// The picture covers coordinates from 0 to this number.
    period: f32,
    wrap: Wrap,
}

/// State for drawing patterns.
struct Drawing<'a> {
    scene: &'a Scene,
    set: TextureSet,
}

impl Drawing<'_> {
    fn pattern(&self, id: TextureId) -> Option<&Pattern> {
        self.scene.textures.get(id.index()).and_then(Texture::as_pattern)
    }

    /// True if the pattern depends only on the surface's first set of texture coordinates.
    fn is_on_surface(&self, id: TextureId) -> bool {
        self.pattern(id).is_none_or(|p| {
            p.is_on_surface() && p.textures().into_iter().all(|id| self.is_on_surface(id))
        })
    }

    fn at(&self, id: TextureId, uv: Vec2) -> Rgb {
        let [r, g, b, _] = self.set.lookup_at(id, uv, 0.0);
        Rgb::new(r, g, b)
    }

    /// Draws a pattern over one period; the second result is true if it has a period.
    fn picture(&mut self, id: TextureId) -> (Drawn, bool) {
        let period = (1..=MAX_PERIOD).map(f32::from).find(|&period| self.repeats_after(id, period));
        let length = period.unwrap_or(1.0);
        let [width, height] =
            self.detail(id).map(|pixels| (pixels * length).ceil().clamp(1.0, MAX_SIZE) as u32);
        let mut values = Vec::with_capacity(width as usize * height as usize * 3);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let place =
                Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            values.extend(self.at(id, place * length).to_array());
        }
        let image = Image::from_f32(width, height, 3, values);
        let wrap = if period.is_some() { Wrap::Repeat } else { Wrap::Clamp };
        (Drawn { image, period: length, wrap }, period.is_some())
    }

    /// True if a pattern has the same values one period further, tested at 256 random points.
    fn repeats_after(&self, id: TextureId, period: f32) -> bool {
        (0..256u32).all(|i| {
            let uv = rng::uniform2([i, 11, 0, 0]) * 8.0;
            let here = self.at(id, uv).to_array();
            [Vec2::X, Vec2::Y, -Vec2::X].into_iter().all(|step| {
                let there = self.at(id, uv + step * period).to_array();
                here.iter().zip(there).all(|(a, b)| (a - b).abs() <= SAME * (1.0 + a.abs()))
            })
        })
    }

    /// Pixels per unit of the coordinates needed to show all detail.
    fn detail(&self, id: TextureId) -> [f32; 2] {
        let stretch = |mapping: &Mapping| match mapping {
            Mapping::Uv { uv_transform: [[a, b, _], [c, d, _]], .. } => {
                [a.abs().max(c.abs()), b.abs().max(d.abs())]
            }
            _ => [1.0; 2],
        };
        let own = match self.scene.textures.get(id.index()) {
            Some(Texture::Image(texture)) => {
                let size = self
                    .scene
                    .images
                    .get(texture.image.index())
                    .map_or([1.0; 2], |i| [i.width as f32, i.height as f32]);
                let [[a, _, _], [_, d, _]] = texture.uv_transform;
                [size[0] * a.abs(), size[1] * d.abs()]
            }
            Some(Texture::Pattern(Pattern::Checkerboard(p))) => {
                stretch(&p.mapping).map(|s| s * 64.0)
            }
            Some(Texture::Pattern(Pattern::Dots(p))) => stretch(&p.mapping).map(|s| s * 64.0),
            _ => [1.0; 2],
        };
        let parts = self.pattern(id).map(Pattern::textures).unwrap_or_default();
        parts.into_iter().fold(own.map(|own| own.max(DETAIL)), |most, part| {
            let part = self.detail(part);
            [most[0].max(part[0]), most[1].max(part[1])]
        })
    }

    /// The mean at random places of the scene's bounds.
    fn mean(&self, id: TextureId) -> Rgb {
        const COUNT: u32 = 4096;
        let bounds = self.scene.bounds().unwrap_or(Bounds3d::EMPTY);
        let bounds = match (bounds.min.is_finite(), bounds.max.is_finite()) {
            (true, true) if !bounds.is_empty() => bounds,
            _ => Bounds3d { min: DVec3::splat(-10.0), max: DVec3::splat(10.0) },
        };
        let mut sum = [0.0f64; 3];
        for i in 0..COUNT {
            let (a, b) = (rng::uniform2([i, 21, 0, 0]), rng::uniform2([i, 22, 0, 0]));
            let share = DVec3::new(a.x.into(), a.y.into(), b.x.into());
            let normal = snell_math::sampling::uniform_sphere(rng::uniform2([i, 23, 0, 0]));
            let position = (bounds.min + (bounds.max - bounds.min) * share).as_vec3();
            let surface = surface_at(position, normal, rng::uniform2([i, 24, 0, 0]));
            let [r, g, b, _] = self.set.lookup(id, &surface, 0.0);
            sum.iter_mut()
                .zip([r, g, b])
                .for_each(|(sum, x)| *sum += f64::from(x) / f64::from(COUNT));
        }
        Rgb::from(sum.map(|x| x as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::memory::Available;
    use snell_scene::material::{ColorParam, Diffuse};
    use snell_scene::texture::pattern;
    use std::path::Path;

    fn scene(textures: Vec<Texture>) -> Scene {
        let last = TextureId(textures.len() as u32 - 1);
        let reflectance = ColorParam::textured(Rgb::WHITE, Some(last));
        let mut scene = Scene { textures, ..Scene::new("patterns") };
        scene.add_material(Material::new("m", Diffuse { reflectance }));
        scene
    }

    #[test]
    fn patterns_of_coordinates_are_drawn_and_those_of_space_become_their_mean() {
        let checks = pattern::Checkerboard {
            mapping: Mapping::upright([4.0, 2.0], [0.0, 0.0]),
            ..Default::default()
        };
        let scale = pattern::Scale {
            texture: ColorParam::textured(Rgb::splat(0.5), Some(TextureId(0))),
            ..Default::default()
        };
        let scene = scene(vec![checks.into(), scale.into()]);
        let mut output = Output::new(Path::new("a.gltf"), Available::UNKNOWN);
        let drawn = drawn(&scene, |_| false, &mut output);
        assert_eq!(output.losses.len(), 1, "{:?}", output.losses);
        assert!(output.losses[0].message.contains("texture 1 (scale) is drawn into a picture"));
        let sets = [&scene, &*drawn].map(|scene| TextureSet::new(&scene.textures, &scene.images));
        for i in 0..400 {
            let uv = rng::uniform2([i, 0, 0, 0]) * 6.0 - 3.0;
            // Points away from the edges of the checks.
            if (uv * Vec2::new(4.0, 2.0)).fract().abs().clamp(Vec2::splat(0.1), Vec2::splat(0.9))
                != (uv * Vec2::new(4.0, 2.0)).fract().abs()
            {
                continue;
            }
            let [a, b] = [0, 1].map(|k| sets[k].lookup_at(TextureId(1), uv, 0.0)[1]);
            assert!((a - b).abs() < 1e-3, "{uv}: {a} {b}");
        }
    }

    #[test]
    fn patterns_of_space_become_their_mean() {
        let scene = scene(vec![pattern::SolidCheckerboard::default().into()]);
        let mut output = Output::new(Path::new("a.gltf"), Available::UNKNOWN);
        let drawn = drawn(&scene, |_| false, &mut output);
        assert!(
            output.losses[0]
                .message
                .contains("texture 0 (solid-checkerboard) is a pattern in space"),
            "{:?}",
            output.losses
        );
        let set = TextureSet::new(&drawn.textures, &drawn.images);
        assert!((set.lookup_at(TextureId(0), Vec2::ZERO, 0.0)[0] - 0.5).abs() < 0.05);
    }
}
