//! Textures: images, their wrap modes, and their placement on the surface.

use super::container::fetch_uri;
use super::json::Json;
use super::{REPLACED_BY_CHECKER, Reader};
use crate::image::read_image;
use crate::{Input, ReadError};
use rayon::prelude::*;
use snell_intersect::UV_SETS;
use snell_math::real;
use snell_scene::graph::ImageId;
use snell_scene::texture::{Filtering, Wrap, missing_texture_image};
use snell_scene::{Encoding, Image, ImageTexture, TextureId, WarningKind};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

/// The use of a texture.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(super) enum Use {
    /// Colours, encoded as sRGB. A missing image shows as a checkerboard.
    Color,
    /// Linear data. A missing image is left out: a checkerboard would only be noise there.
    Data,
}

/// The key of a texture in the scene: number in the file, use, coordinate set, bits of the
/// coordinate transform.
type Key = (usize, Use, u32, [u32; 6]);

/// Images of the file, and their ids in the scene.
#[derive(Default)]
pub(super) struct Textures {
    /// For each image of the file, the image, or the reason why it is unavailable. `None` if no
    /// texture names it.
    decoded: Vec<Option<Result<Arc<Image>, String>>>,
    /// Images in the scene, by number in the file.
    placed: BTreeMap<usize, ImageId>,
    missing: Option<ImageId>,
    /// Textures made of the maps of specular-glossiness materials, by the path of the extension.
    pub converted: BTreeMap<String, [TextureId; 2]>,
    // Never iterated, so order does not matter.
    known: HashMap<Key, TextureId>,
}

/// Numbers of the images that a texture may show, in the order in which they are tried: the
/// compressed or smaller one of an extension, the one of the standard, and those of extensions that
/// are not known.
fn sources(texture: &Json) -> Result<Vec<usize>, ReadError> {
    const KNOWN: [&str; 4] =
        ["KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds"];
    let of_extension = |name: &str| -> Result<Option<usize>, ReadError> {
        let Some(extension) = texture.extension(name)? else { return Ok(None) };
        extension.get("source")?.map(|source| source.size()).transpose()
    };
    let mut sources = Vec::new();
    for name in KNOWN {
        sources.extend(of_extension(name)?);
    }
    sources.extend(texture.get("source")?.map(|source| source.size()).transpose()?);
    for name in texture.extension_names()?.iter().filter(|name| !KNOWN.contains(&name.as_str())) {
        // Whatever it is, it may not be an object, or its source no number.
        sources.extend(of_extension(name).ok().flatten());
    }
    Ok(sources)
}

/// Decodes the images that textures name, in parallel. Failures are recorded, not returned; for
/// them the next image of the texture is decoded.
pub(super) fn decode_images(reader: &Reader) -> Result<Textures, ReadError> {
    let images = reader.root.items_of("images")?;
    let mut decoded: Vec<Option<Result<Arc<Image>, String>>> = vec![None; images.len()];
    let textures = reader.root.items_of("textures")?;
    let candidates: Vec<_> = textures.iter().map(sources).collect::<Result<_, _>>()?;
    let mut count = 0;
    // Images with the same content are decoded once.
    let mut image_of: BTreeMap<String, usize> = BTreeMap::new();
    loop {
        let mut used = BTreeSet::new();
        for sources in &candidates {
            let is_open = |&&i: &&usize| !matches!(decoded.get(i), None | Some(Some(Err(_))));
            used.extend(sources.iter().find(is_open).filter(|&&i| decoded[i].is_none()));
        }
        if used.is_empty() {
            return Ok(Textures { decoded, ..Textures::default() });
        }
        let mut sources = Vec::new();
        for &i in &used {
            let first = *image_of.entry(source_name(&images[i])?).or_insert(i);
            if first == i {
                sources.push((i, Source::of(reader, &images[i])));
            }
        }
        count += sources.len();
        let limit = reader.input.options.limits.files;
        if count > limit {
            let problem = format!("the file has more than {limit} images");
            return Err(reader.root.error_with(problem, "split the scene"));
        }
        let results: Vec<_> = sources
            .into_par_iter()
            .map(|(i, source)| {
                let image = source.and_then(|s| s.decode(reader.input)).map(Arc::new);
                (i, image.map_err(|e| e.to_string()))
            })
            .collect();
        results.into_iter().for_each(|(i, result)| decoded[i] = Some(result));
        for &i in &used {
            decoded[i] = decoded[image_of[&source_name(&images[i])?]].clone();
        }
    }
}

/// A key that is equal for images with the same content.
fn source_name(image: &Json) -> Result<String, ReadError> {
    Ok(match (image.get("uri")?, image.get("bufferView")?) {
        (Some(uri), _) => format!("uri {}", uri.string()?),
        (None, Some(view)) => format!("view {}", view.size()?),
        (None, None) => format!("nothing at {}", image.path()),
    })
}

/// The source of an image's bytes.
enum Source<'s, 'a> {
    Bytes(Json<'a>, &'s [u8]),
    Uri(Json<'a>),
}

impl<'s, 'a> Source<'s, 'a> {
    fn of(reader: &'s Reader<'a>, image: &Json<'a>) -> Result<Self, ReadError> {
        match (image.get("uri")?, image.get("bufferView")?) {
            (Some(uri), _) => Ok(Self::Uri(uri)),
            (None, Some(view)) => {
                Ok(Self::Bytes(image.clone(), reader.accessors.buffers().view_bytes(&view)?))
            }
            (None, None) => Err(image.error("the image has neither \"uri\" nor \"bufferView\"")),
        }
    }

    fn decode(self, input: &Input) -> Result<Image, ReadError> {
        let (name, bytes) = match self {
            Self::Bytes(image, bytes) => {
                (format!("{}: image at {}", input.name, image.path()), bytes.to_vec())
            }
            Self::Uri(uri) => {
                let text = uri.string()?;
                let shown = if text.starts_with("data:") {
                    format!("image at {}", uri.path())
                } else {
                    text.into()
                };
                (shown, fetch_uri(input, &uri)?)
            }
        };
        read_image(&input.part(&name, bytes))
    }
}

/// Adds the texture that a `textureInfo` object names to the scene. `None` if its image is missing
/// and the texture holds data, not colours.
pub(super) fn read(
    reader: &mut Reader,
    info: &Json,
    used_for: Use,
) -> Result<Option<TextureId>, ReadError> {
    let index = info.require("index")?;
    let texture = &reader.root.entry("textures", &index)?;
    let (set, uv_transform) = placement(info)?;
    let uv_set = reader.uv_sets.iter().position(|&stored| stored == set).unwrap_or_else(|| {
        let first = reader.uv_sets[0];
        reader.scene.warn(format!(
            "a material uses more than {UV_SETS} sets of texture coordinates; set {first} is used \
                instead of set {set}"
        ));
        0
    }) as u32;
    let key = (
        index.size()?,
        used_for,
        uv_set,
        uv_transform.as_flattened().try_into().map_or([0; 6], bits),
    );
    let transform = format!("{}/extensions/KHR_texture_transform", info.path());
    let is_moving = reader.pointers.iter().any(|pointer| pointer.below(&transform).is_some());
    let known = if is_moving {
        reader.moving_textures.get(info.path())
    } else {
        reader.textures.known.get(&key)
    };
    if let Some(&id) = known {
        return Ok(Some(id));
    }
    let Some(image) = image(reader, texture, used_for)? else { return Ok(None) };
    let (wrap, filtering) = sampler(reader, texture)?;
    let encoding = if used_for == Use::Color { Encoding::Srgb } else { Encoding::Linear };
    let id = reader.scene.add_texture(ImageTexture {
        image,
        encoding,
        wrap,
        filtering,
        uv_set,
        uv_transform,
    });
    if is_moving {
        reader.moving_textures.insert(info.path().to_owned(), id);
    } else {
        reader.textures.known.insert(key, id);
    }
    Ok(Some(id))
}

fn bits(values: [f32; 6]) -> [u32; 6] {
    values.map(f32::to_bits)
}

/// The image of a texture in the scene.
fn image(reader: &mut Reader, texture: &Json, used_for: Use) -> Result<Option<ImageId>, ReadError> {
    let mut problems = Vec::new();
    for i in sources(texture)? {
        match reader.textures.decoded.get(i).cloned().flatten() {
            Some(Ok(image)) => {
                for problem in problems {
                    reader.scene.warn_of(
                        WarningKind::Missing,
                        format!(
                            "{problem}; another image of the texture at {} is shown instead",
                            texture.path()
                        ),
                    );
                }
                if let Some(&id) = reader.textures.placed.get(&i) {
                    return Ok(Some(id));
                }
                let id = reader.scene.add_image(image);
                reader.textures.placed.insert(i, id);
                return Ok(Some(id));
            }
            Some(Err(problem)) => problems.push(problem),
            None => {}
        }
    }
    let nothing = || format!("the texture at {} names no image", texture.path());
    let problem = problems.into_iter().next().unwrap_or_else(nothing);
    if used_for == Use::Data {
        reader.scene.warn_of(
            WarningKind::Missing,
            format!("{problem}; the surface is shown without this map"),
        );
        return Ok(None);
    }
    reader.scene.warn_of(WarningKind::Missing, format!("{problem}; {REPLACED_BY_CHECKER}"));
    let id = match reader.textures.missing {
        Some(id) => id,
        None => reader.scene.add_image(Arc::new(missing_texture_image())),
    };
    reader.textures.missing = Some(id);
    Ok(Some(id))
}

/// Wrap modes and filtering of a texture.
fn sampler(reader: &mut Reader, texture: &Json) -> Result<([Wrap; 2], Filtering), ReadError> {
    let Some(index) = texture.get("sampler")? else {
        return Ok(([Wrap::Repeat; 2], Filtering::Trilinear));
    };
    let sampler = reader.root.entry("samplers", &index)?;
    let mut wrap = [Wrap::Repeat; 2];
    for (wrap, key) in wrap.iter_mut().zip(["wrapS", "wrapT"]) {
        *wrap = match sampler.size_or(key, 10497)? {
            10497 => Wrap::Repeat,
            33071 => Wrap::Clamp,
            33648 => Wrap::Mirror,
            other => {
                reader.scene.warn(format!("{other} is not a wrap mode; the texture repeats"));
                Wrap::Repeat
            }
        };
    }
    const NEAREST: usize = 9728;
    let is_nearest = sampler.size_or("magFilter", 0)? == NEAREST;
    Ok((wrap, if is_nearest { Filtering::Nearest } else { Filtering::Trilinear }))
}

/// Reads the coordinate set of a texture and its coordinate transform (`KHR_texture_transform`).
pub(super) fn placement(info: &Json) -> Result<(usize, [[f32; 3]; 2]), ReadError> {
    let mut set = info.size_or("texCoord", 0)?;
    let mut map = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    if let Some(transform) = info.extension("KHR_texture_transform")? {
        set = transform.size_or("texCoord", set)?;
        let [tx, ty] = transform.numbers_or("offset", [0.0; 2])?;
        let [sx, sy] = transform.numbers_or("scale", [1.0; 2])?;
        let (sin, cos) = real::sin_cos(transform.number_or("rotation", 0.0)?);
        // Coordinates are scaled, rotated counter-clockwise as seen with v downwards, then
        // translated. (The formula in the extension's text rotates the other way; its test model
        // and common viewers agree on this one.)
        map =
            [[cos * sx, sin * sy, tx], [-sin * sx, cos * sy, ty]].map(|row| row.map(|x| x as f32));
        if map.as_flattened().iter().any(|x| !x.is_finite()) {
            return Err(transform.error("the transform is too large to be computed"));
        }
    }
    Ok((set, map))
}
