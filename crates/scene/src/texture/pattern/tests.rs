use super::*;
use crate::graph::ImageId;
use crate::image::{Encoding, Image};
use crate::texture::{ImageTexture, Mapping, Texture, TextureError, TextureSet, errors};
use snell_intersect::SurfaceInteraction;
use snell_math::{Vec2, Vec3, rng};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// A point on a sphere of radius 1 around the origin, with the texture coordinates of a sphere
/// whose z points up.
fn on_sphere(p: Vec3) -> SurfaceInteraction {
    let n = p.normalize_or(Vec3::Z);
    let across = n.truncate().length();
    let around = Vec3::new(-n.y, n.x, 0.0).normalize_or(Vec3::X);
    SurfaceInteraction {
        uv: [Vec2::new(n.y.atan2(n.x) / TAU, n.z.clamp(-1.0, 1.0).acos() / PI);
            snell_intersect::UV_SETS],
        dpdu: around * (TAU * across).max(1e-3),
        dpdv: n.cross(around) * PI,
        ..crate::texture::surface_at(p, n, Vec2::ZERO)
    }
}

fn somewhere(i: u32) -> Vec3 {
    let (a, b) = (rng::uniform2([i, 1, 2, 3]), rng::uniform2([i, 4, 5, 6]));
    Vec3::new(a.x, a.y, b.x) * 40.0 - 20.0
}

fn alone(pattern: impl Into<Pattern>) -> TextureSet {
    TextureSet::new(&[pattern.into().into()], &[])
}

fn value(set: &TextureSet, at: &SurfaceInteraction, footprint: f32) -> Rgb {
    let [r, g, b, a] = set.lookup(TextureId(0), at, footprint);
    assert_eq!(a, 1.0, "patterns are opaque");
    Rgb::new(r, g, b)
}

#[test]
fn every_pattern_has_a_finite_value_everywhere() {
    assert!(
        Pattern::NAMES.iter().all(|name| Pattern::examples().iter().any(|p| p.name() == *name))
    );
    for pattern in Pattern::examples() {
        let set = alone(pattern.clone());
        for x in [0.0, -0.0, 1e-40, 0.3, 1e9, -1e30, f32::MAX, f32::NAN, f32::INFINITY] {
            for position in [Vec3::new(x, 0.2, 0.7), Vec3::new(0.0, 0.0, x), Vec3::splat(x)] {
                for footprint in [0.0, 1e-30, 0.1, 10.0, 1e30, f32::INFINITY, f32::NAN, -1.0] {
                    let value = value(&set, &on_sphere(position), footprint);
                    assert!(value.is_finite(), "{pattern:?} {position} {footprint}");
                }
            }
        }
        assert!(set.lookup_at(TextureId(0), Vec2::NAN, 0.0).iter().all(|x| x.is_finite()));
    }
}

#[test]
fn every_pattern_is_written_and_read_again() {
    for pattern in Pattern::examples() {
        let texture = Texture::from(pattern);
        let text = serde_json::to_string(&texture).expect("written");
        assert_eq!(serde_json::from_str::<Texture>(&text).expect(&text), texture);
    }
    let marble: Texture =
        serde_json::from_str(r#"{"pattern": "marble", "scale": 3}"#).expect("defaults");
    assert_eq!(marble, Marble { scale: 3.0, ..Marble::default() }.into());
    for (text, said) in [
        (r#"{"pattern": "wood"}"#, "unknown variant `wood`, expected one of `checkerboard`"),
        (r#"{"pattern": "fbm", "octave": 3}"#, "unknown field `octave`, expected one of `octaves`"),
        (r#"{"pattern": "fbm", "octaves": -3}"#, "invalid value"),
        (r#"{"image": 0}"#, "missing field `encoding`"),
        ("3", "invalid type"),
    ] {
        let error = serde_json::from_str::<Texture>(text).expect_err(text).to_string();
        assert!(error.contains(said), "{text}: {error}");
    }
}

#[test]
fn much_seen_at_once_shows_the_mean() {
    let n = 20_000;
    let solid: [Pattern; 6] = [
        SolidCheckerboard::default().into(),
        Fbm::default().into(),
        Wrinkled::default().into(),
        Windy::default().into(),
        Marble { variation: 1.0, ..Marble::default() }.into(),
        Dots {
            mapping: Mapping::Planar {
                st_from_world: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]],
            },
            ..Dots::default()
        }
        .into(),
    ];
    for pattern in solid {
        let set = alone(pattern.clone());
        let mean = |footprint: f32| {
            let points =
                (0..n).map(|i| value(&set, &on_sphere(somewhere(i)), footprint).luminance());
            points.sum::<f32>() / n as f32
        };
        let (fine, coarse) = (mean(0.0), value(&set, &on_sphere(somewhere(7)), 100.0).luminance());
        assert!(
            (fine - coarse).abs() < 0.02 * fine.abs().max(1.0),
            "{pattern:?}: {fine}, seen at once {coarse}"
        );
        assert!((fine - mean(0.3)).abs() < 0.02, "{pattern:?}: {fine} {}", mean(0.3));
    }
}

#[test]
fn checks_and_corners_are_where_they_are_said_to_be() {
    let checks = alone(Checkerboard {
        mapping: Mapping::upright([2.0, 2.0], [0.0, 0.0]),
        ..Checkerboard::default()
    });
    let at = |u: f32, v: f32| checks.lookup_at(TextureId(0), Vec2::new(u, 1.0 - v), 0.0)[0];
    assert_eq!(
        [at(0.2, 0.2), at(0.7, 0.2), at(0.2, 0.7), at(0.7, 0.7), at(-0.2, 0.2)],
        [1.0, 0.0, 0.0, 1.0, 0.0]
    );
    let corner = |x: f32| Rgb::splat(x).into();
    let bilerp = alone(Bilerp {
        v00: corner(1.0),
        v01: corner(2.0),
        v10: corner(3.0),
        v11: corner(4.0),
        ..Bilerp::default()
    });
    let at = |u: f32, v: f32| bilerp.lookup_at(TextureId(0), Vec2::new(u, 1.0 - v), 0.0)[0];
    assert_eq!(
        [at(0.0, 0.0), at(0.0, 1.0), at(1.0, 0.0), at(1.0, 1.0), at(0.5, 0.5)],
        [1.0, 2.0, 3.0, 4.0, 2.5]
    );
    let block = alone(SolidCheckerboard {
        texture_from_world: [[2.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]],
        ..SolidCheckerboard::default()
    });
    let at = |p: [f32; 3]| value(&block, &on_sphere(Vec3::from_array(p)), 0.0).r;
    assert_eq!(
        [at([0.2, 0.2, 0.2]), at([0.7, 0.2, 0.2]), at([-0.2, 0.2, 0.2]), at([0.7, 0.7, -0.2])],
        [0.0, 1.0, 1.0, 1.0]
    );
}

#[test]
fn mappings_of_space_give_the_coordinates_and_widths_of_their_formulas() {
    let [spherical, cylindrical] = [
        Mapping::Spherical { texture_from_world: crate::texture::mapping::IDENTITY },
        Mapping::Cylindrical { texture_from_world: crate::texture::mapping::IDENTITY },
    ];
    let planar = Mapping::Planar { st_from_world: [[2.0, 0.0, 0.0, 0.5], [0.0, 0.0, -1.0, 0.0]] };
    let textures = TextureSet::default();
    let at = |mapping: &Mapping, p: Vec3| {
        let (surface, mode) = (on_sphere(p), snell_math::ColorMode::Rgb);
        let point = ShadingPoint {
            surface: &surface,
            footprint: 0.01,
            textures: &textures,
            mode,
            outside_ior: 1.0,
        };
        mapping.at(&point)
    };
    let close = |a: Vec2, b: [f32; 2]| (a - Vec2::from_array(b)).length() < 1e-5;
    assert!(close(at(&spherical, Vec3::new(0.0, 2.0, 0.0)).st, [0.5, 0.25]));
    assert!(close(at(&spherical, Vec3::new(1.0, -1e-7, 1.0)).st, [0.25, 1.0]));
    assert!(close(at(&cylindrical, Vec3::new(3.0, 0.0, 4.0)).st, [0.5, 4.0]));
    assert!(close(at(&cylindrical, Vec3::new(0.0, 3.0, 4.0)).st, [0.75, 4.0]));
    assert!(close(at(&planar, Vec3::new(1.0, 2.0, 3.0)).st, [2.5, -3.0]));
    assert!(close(at(&planar, Vec3::new(1.0, 2.0, 3.0)).width, [0.02, 0.01]));
    // The filter width must be at least the change of the coordinates over a step of the footprint.
    for mapping in [spherical, cylindrical, planar] {
        for i in 0..300 {
            let p = somewhere(i) * 0.1;
            let here = at(&mapping, p);
            for step in [Vec3::X, Vec3::Y, Vec3::Z] {
                let change = (at(&mapping, p + step * 0.001).st - here.st).abs() * 10.0;
                let wraps = change.max_element() > 4.0;
                assert!(
                    wraps || change.cmple(here.width * 1.1 + 1e-3).all(),
                    "{mapping:?} {p} {change} {}",
                    here.width
                );
            }
        }
    }
}

#[test]
fn patterns_of_patterns_and_images_are_what_they_are_made_of() {
    let image = Arc::new(Image::from_f32(2, 1, 1, vec![0.25, 0.75]));
    let texture = |id| ColorParam::textured(Rgb::WHITE, Some(TextureId(id)));
    let nearest = ImageTexture {
        filtering: crate::texture::Filtering::Nearest,
        ..ImageTexture::new(ImageId(0), Encoding::Linear)
    };
    let inverted = Mix { first: Rgb::WHITE.into(), second: Rgb::BLACK.into(), amount: texture(0) };
    let root = Power { base: ColorParam { factor: Rgb::splat(4.0), ..texture(1) }, exponent: 0.5 };
    let thrice = Scale { texture: texture(2), scale: Rgb::splat(3.0).into() };
    let ramp = Ramp { amount: texture(0), colors: vec![Rgb::BLACK, Rgb::WHITE, Rgb::BLACK] };
    let flipped =
        Projected { texture: texture(0), mapping: Mapping::upright([-1.0, 1.0], [1.0, 0.0]) };
    let table: [Texture; 6] =
        [nearest.into(), inverted.into(), root.into(), thrice.into(), ramp.into(), flipped.into()];
    assert!(errors(&table, 1).iter().all(Option::is_none));
    let set = TextureSet::new(&table, &[image]);
    let at = |id, u| set.lookup_at(TextureId(id), Vec2::new(u, 0.5), 0.0)[0];
    assert_eq!([at(0, 0.2), at(1, 0.2), at(4, 0.2), at(5, 0.2)], [0.25, 0.75, 0.5, 0.75]);
    assert!((at(2, 0.2) - 3f32.sqrt()).abs() < 1e-6 && (at(3, 0.7) - 3.0).abs() < 1e-5);
}

#[test]
fn tables_that_make_no_sense_are_named_and_magenta() {
    let mix = |id: u32| -> Texture {
        let texture = ColorParam::textured(Rgb::WHITE, Some(TextureId(id)));
        Mix { first: texture, second: texture, ..Mix::default() }.into()
    };
    let itself = [mix(0)];
    assert_eq!(errors(&itself, 0), [Some(TextureError::NotAbove { id: 0 })]);
    let below = [mix(1), mix(0)];
    assert_eq!(errors(&below, 0), [Some(TextureError::NotAbove { id: 1 }), None]);
    // Each mixture uses the one before twice, so the 8th has 257 parts or more.
    let doubling: Vec<Texture> =
        std::iter::once(Marble::default().into()).chain((0..40).map(mix)).collect();
    let found = errors(&doubling, 0);
    assert!(found.contains(&Some(TextureError::TooManyParts)));
    for table in [&itself[..], &below, &doubling] {
        let set = TextureSet::new(table, &[]);
        for id in 0..=table.len() as u32 {
            assert!(set.lookup_at(TextureId(id), Vec2::ZERO, 0.0).iter().all(|x| x.is_finite()));
        }
        let broken = errors(table, 0).iter().position(Option::is_some).expect("one is broken");
        assert_eq!(set.lookup_at(TextureId(broken as u32), Vec2::ZERO, 0.0), [1.0, 0.0, 1.0, 1.0]);
    }
    let image: Texture = ImageTexture::new(ImageId(3), Encoding::Linear).into();
    assert_eq!(errors(&[image], 2), [Some(TextureError::NoImage { id: 3, count: 2 })]);
}

#[test]
fn the_axis_of_a_direction_mix_decides() {
    let set = alone(DirectionMix { axis: Vec3::new(0.0, 0.0, 3.0), ..DirectionMix::default() });
    assert_eq!(value(&set, &on_sphere(Vec3::Z), 0.0), Rgb::BLACK);
    assert_eq!(value(&set, &on_sphere(Vec3::X), 0.0), Rgb::WHITE);
    assert!(
        (value(&set, &on_sphere(Vec3::new(1.0, 0.0, -1.0)), 0.0).r - (1.0 - 0.5f32.sqrt())).abs()
            < 1e-6
    );
}
