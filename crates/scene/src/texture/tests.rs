use super::*;
use crate::graph::ImageId;
use crate::image::Pixels;
use snell_math::Vec3;

fn at(uv: Vec2, world_per_uv: f32) -> SurfaceInteraction {
    SurfaceInteraction {
        uv: [uv, Vec2::new(uv.y, uv.x), Vec2::ZERO, Vec2::ONE - uv],
        dpdu: Vec3::X * world_per_uv,
        dpdv: Vec3::Y * world_per_uv,
        t: 1.0,
        ..SurfaceInteraction::plain(Vec3::ZERO, Vec3::Z)
    }
}

fn set(texture: ImageTexture, image: Image) -> TextureSet {
    TextureSet::new(&[texture.into()], &[Arc::new(image)])
}

fn linear() -> ImageTexture {
    ImageTexture::new(ImageId(0), Encoding::Linear)
}

/// A 2 x 2 image with the values 0, 1 above 2, 3.
fn four() -> Image {
    Image::from_f32(2, 2, 1, vec![0.0, 1.0, 2.0, 3.0])
}

fn grey(set: &TextureSet, u: f32, v: f32) -> f32 {
    let [r, g, b, _] = set.lookup_at(TextureId(0), Vec2::new(u, v), 0.0);
    assert!(r == g && g == b);
    r
}

#[test]
fn texel_centres_show_texels_and_halfway_shows_the_mean() {
    let clamp = set(ImageTexture { wrap: [Wrap::Clamp; 2], ..linear() }, four());
    assert_eq!(
        [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)].map(|(u, v)| grey(&clamp, u, v)),
        [0.0, 1.0, 2.0, 3.0]
    );
    assert_eq!(grey(&clamp, 0.5, 0.5), 1.5);
    assert_eq!(grey(&clamp, 0.375, 0.25), 0.25);
    assert_eq!(grey(&clamp, -5.0, 0.25), 0.0);
    assert_eq!(grey(&clamp, 5.0, 9.0), 3.0);
}

#[test]
fn each_wrap_mode_continues_the_picture_in_its_way() {
    let with = |wrap| set(ImageTexture { wrap: [wrap, Wrap::Clamp], ..linear() }, four());
    // At the left border the value lies between the first texel and the one that the wrap mode puts
    // before it.
    assert_eq!(grey(&with(Wrap::Repeat), 0.0, 0.25), 0.5);
    assert_eq!(grey(&with(Wrap::Mirror), 0.0, 0.25), 0.0);
    assert_eq!(grey(&with(Wrap::Repeat), 1.25, 0.25), 0.0);
    assert_eq!(grey(&with(Wrap::Mirror), 1.25, 0.25), 1.0);
    assert_eq!(grey(&with(Wrap::Mirror), -0.75, 0.25), 1.0);
    assert_eq!(with(Wrap::Black).lookup_at(TextureId(0), Vec2::new(1.3, 0.25), 0.0), [0.0; 4]);
    assert_eq!(with(Wrap::Black).lookup_at(TextureId(0), Vec2::new(1.0, 0.25), 0.0), [0.5; 4]);
}

#[test]
fn nearest_filtering_does_not_mix() {
    let nearest = set(ImageTexture { filtering: Filtering::Nearest, ..linear() }, four());
    assert_eq!(
        [0.0, 0.49, 0.51, 0.99, 1.01].map(|u| grey(&nearest, u, 0.1)),
        [0.0, 0.0, 1.0, 1.0, 0.0]
    );
    assert_eq!(nearest.bytes(), 0, "no mip maps are needed");
}

#[test]
fn srgb_is_decoded_before_anything_is_mixed() {
    let codes = Image {
        width: 2,
        height: 1,
        channels: 4,
        pixels: Pixels::U8(vec![0, 0, 0, 0, 255, 188, 55, 128]),
        encoding: Encoding::Linear,
    };
    let srgb = set(ImageTexture::new(ImageId(0), Encoding::Srgb), codes);
    let [r, g, b, a] = srgb.lookup_at(TextureId(0), Vec2::new(0.75, 0.5), 0.0);
    let decode = |code: f32| snell_math::spectrum::srgb_to_linear(code / 255.0);
    assert_eq!([r, g, b, a], [1.0, decode(188.0), decode(55.0), 128.0 / 255.0]);
    let middle = srgb.lookup_at(TextureId(0), Vec2::new(0.5, 0.5), 0.0);
    assert!((middle[0] - 0.5).abs() < 1e-6, "the mean of light, not of codes");
    let coarse = srgb.lookup_at(TextureId(0), Vec2::new(0.1, 0.5), 9.0);
    assert!((coarse[0] - 0.5).abs() < 1e-4 && (coarse[1] - decode(188.0) / 2.0).abs() < 1e-4);
}

#[test]
fn every_level_has_the_mean_of_the_image() {
    for (width, height) in [(8, 8), (7, 5), (1, 9), (13, 2)] {
        let values: Vec<f32> = (0..width * height).map(|i| (i * 7 % 11) as f32).collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let set = set(linear(), Image::from_f32(width, height, 1, values));
        assert!(
            (set.lookup_at(TextureId(0), Vec2::splat(0.37), 99.0)[0] - mean).abs() < 1e-4,
            "{width} x {height}"
        );
    }
}

#[test]
fn the_footprint_chooses_the_level() {
    // All levels of this checker of single texels are flat except level 0.
    let checker = (0..64 * 64).map(|i| ((i + i / 64) % 2) as f32).collect();
    let set = set(linear(), Image::from_f32(64, 64, 1, checker));
    let uv = Vec2::splat(0.5 / 64.0);
    let seen =
        |world_per_uv, footprint| set.lookup(TextureId(0), &at(uv, world_per_uv), footprint)[0];
    assert_eq!(seen(1.0, 0.0), 0.0);
    assert_eq!(seen(1.0, 1.0 / 64.0), 0.0, "one texel");
    assert_eq!(seen(1.0, 2.0 / 64.0), 0.5, "two texels");
    assert!((seen(1.0, 2f32.sqrt() / 64.0) - 0.25).abs() < 1e-4, "halfway between two levels");
    assert_eq!(seen(10.0, 10.0 / 64.0), 0.0, "a larger surface");
    assert_eq!(seen(1.0, f32::INFINITY), 0.5);
    assert_eq!(seen(0.0, 1.0), 0.5);
    assert_eq!(seen(1.0, f32::NAN), 0.0);
}

#[test]
fn the_transform_counts_in_place_and_level() {
    let twice = ImageTexture {
        uv_transform: [[2.0, 0.0, 0.25], [0.0, 2.0, 0.0]],
        filtering: Filtering::Nearest,
        ..linear()
    };
    assert_eq!(grey(&set(twice.clone(), four()), 0.0, 0.0), 0.0);
    assert_eq!(grey(&set(twice.clone(), four()), 0.13, 0.3), 3.0);
    let checker = Image::from_f32(2, 2, 1, vec![0.0, 1.0, 1.0, 0.0]);
    let trilinear = set(ImageTexture { filtering: Filtering::Trilinear, ..twice }, checker);
    assert_eq!(
        trilinear.lookup(TextureId(0), &at(Vec2::ZERO, 1.0), 0.25)[0],
        0.5 * 0.5 + 0.5 * 0.5
    );
    assert_eq!(
        trilinear.lookup(TextureId(0), &at(Vec2::new(0.0, 0.125), 1.0), 0.25)[0],
        0.0,
        "one texel after the transform"
    );
    assert_eq!(
        trilinear.lookup(TextureId(0), &at(Vec2::new(0.0, 0.125), 1.0), 0.5)[0],
        0.5,
        "two texels"
    );
}

#[test]
fn another_set_of_coordinates_is_used_when_asked_for() {
    let point = at(Vec2::new(0.25, 0.75), 1.0);
    let first = set(linear(), four()).lookup(TextureId(0), &point, 0.0)[0];
    let second =
        set(ImageTexture { uv_set: 1, ..linear() }, four()).lookup(TextureId(0), &point, 0.0)[0];
    let fourth =
        set(ImageTexture { uv_set: 3, ..linear() }, four()).lookup(TextureId(0), &point, 0.0)[0];
    assert_eq!((first, second, fourth), (2.0, 1.0, 1.0));
}

#[test]
fn broken_pixels_coordinates_ids_and_images_have_defined_results() {
    let broken = set(linear(), Image::from_f32(2, 1, 1, vec![f32::NAN, f32::INFINITY]));
    assert_eq!(grey(&broken, 0.25, 0.5), 0.0);
    assert_eq!(grey(&broken, 0.75, 0.5), 65504.0);
    assert!(broken.lookup_at(TextureId(0), Vec2::ZERO, 5.0)[0].is_finite());
    for uv in [Vec2::NAN, Vec2::INFINITY, Vec2::new(1e38, -1e38), Vec2::new(-1e-20, 0.5)] {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp, Wrap::Black] {
            for filtering in [Filtering::Nearest, Filtering::Trilinear] {
                let set = set(ImageTexture { wrap: [wrap; 2], filtering, ..linear() }, four());
                assert!(set.lookup_at(TextureId(0), uv, 0.5).iter().all(|x| x.is_finite()));
            }
        }
    }
    assert_eq!(broken.lookup_at(TextureId(7), Vec2::ZERO, 0.0), MISSING);
    let short = Image { width: 1 << 20, height: 1 << 20, ..four() };
    for (id, image) in [(0, short), (5, four())] {
        let set = set(ImageTexture::new(ImageId(id), Encoding::Srgb), image);
        assert_eq!(
            set.lookup_at(TextureId(0), Vec2::splat(0.5 / 8.0), 0.0),
            [1.0, 0.0, 1.0, 1.0],
            "the checker's first texel"
        );
    }
}

#[test]
fn images_of_one_encoding_share_their_mip_maps() {
    let image = || {
        Arc::new(Image {
            width: 16,
            height: 16,
            channels: 3,
            pixels: Pixels::U8(vec![9; 768]),
            encoding: Encoding::Srgb,
        })
    };
    let srgb = ImageTexture::new(ImageId(0), Encoding::Srgb);
    let one = TextureSet::new(&[srgb.clone().into()], &[image()]);
    let two = TextureSet::new(
        &[srgb.clone().into(), ImageTexture { wrap: [Wrap::Clamp; 2], ..srgb.clone() }.into()],
        &[image()],
    );
    let both = TextureSet::new(&[srgb.into(), linear().into()], &[image()]);
    assert_eq!(one.bytes(), (64 + 16 + 4 + 1) * 3 * 2);
    assert_eq!(two.bytes(), one.bytes());
    assert_eq!(both.bytes(), 2 * one.bytes());
}

#[test]
fn a_single_pixel_is_a_constant() {
    let set = set(linear(), Image::from_f32(1, 1, 3, vec![0.1, 0.2, 0.3]));
    assert_eq!(set.lookup(TextureId(0), &at(Vec2::NAN, 0.0), f32::NAN), [0.1, 0.2, 0.3, 1.0]);
}
