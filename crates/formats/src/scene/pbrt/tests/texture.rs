//! Textures.

use super::*;
use snell_math::Vec2;
use snell_scene::material::MaterialKind;

#[test]
fn a_checkerboard_has_its_checks_upright() {
    let scene = world(
        "Texture \"checks\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"float vscale\" 4 \
            \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 0 1]\n\
         Material \"diffuse\" \"texture reflectance\" \"checks\" Shape \"sphere\"",
    );
    assert!(scene.images.is_empty() && scene.textures.len() == 1, "it is computed");
    let set = snell_scene::TextureSet::new(&scene.textures, &scene.images);
    for (u, v, first) in [(0.1, 0.1, true), (0.3, 0.1, false), (0.3, 0.3, true), (0.6, 0.9, false)]
    {
        // Coordinates of the scene have v downwards.
        let [r, ..] = set.lookup_at(snell_scene::TextureId(0), Vec2::new(u, 1.0 - v), 0.0);
        assert_eq!(r == 1.0, first, "{u} {v}");
    }
}

#[test]
fn textures_of_textures_are_computed() {
    let scene = world(
        "Texture \"a\" \"float\" \"constant\" \"float value\" 0.5\nTexture \"b\" \"float\" \
            \"scale\" \"texture tex\" \"a\" \"float scale\" 0.5\n\
         Texture \"c\" \"float\" \"mix\" \"texture tex1\" \"b\" \"float tex2\" 1 \"float amount\" \
         0.5\n\
         Material \"dielectric\" \"texture roughness\" \"c\" \"bool remaproughness\" false Shape \
         \"sphere\"",
    );
    let MaterialKind::Dielectric(glass) = &material(&scene).kind else { panic!("no glass") };
    assert!(close(glass.roughness.factor, 0.625f32.sqrt()) && scene.textures.is_empty());
}

#[test]
fn patterns_in_space_lie_where_their_transform_puts_them() {
    let block = "Texture \"t\" \"spectrum\" \"checkerboard\" \"integer dimension\" 3 \"rgb tex1\" \
        [1 0 0] \"rgb tex2\" [0 0 1]\n";
    let user = "Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\"";
    let here = world(&format!("{block}{user}"));
    assert!(
        shown(&here, [0.5, 0.5, 0.5], 0.0) == [1.0, 0.0, 0.0]
            && shown(&here, [1.5, 0.5, 0.5], 0.0) == [0.0, 0.0, 1.0]
    );
    let there =
        world(&format!("AttributeBegin Translate 1 0 0 Scale 2 2 2 {block} AttributeEnd {user}"));
    for (x, is_first) in [(1.1, true), (2.9, true), (3.1, false), (0.9, false)] {
        assert_eq!(shown(&there, [x, 0.5, 0.5], 0.0)[0] == 1.0, is_first, "{x}");
    }
    // A picture that would be mirrored is flipped, and so are the scene's patterns.
    let text =
        format!("LookAt 0 0 5  0 0 0  0 1 0\nCamera \"perspective\"\nWorldBegin\n{block}{user}");
    let mirrored = super::scene(&text);
    assert_eq!(shown(&mirrored, [1.5, 0.5, 0.5], 0.0), [0.0, 0.0, 1.0]);
}

#[test]
fn the_inside_of_dots_is_between_them_as_in_pbrt() {
    let scene = world(
        "Texture \"t\" \"spectrum\" \"dots\" \"rgb inside\" [1 0 0] \"rgb outside\" [0 0 1]\n\
            Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\"",
    );
    let Some(snell_scene::texture::Pattern::Dots(dots)) = scene.textures[0].as_pattern() else {
        panic!("{:?}", scene.textures)
    };
    assert_eq!([dots.inside.factor, dots.outside.factor].map(|c| c.r), [0.0, 1.0]);
}

#[test]
fn coordinates_are_a_texture() {
    let at = |text: &str, u: f32, v: f32| {
        let scene = world(&format!(
            "Texture \"t\" \"color\" \"uv\" {text}\n\
                Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\""
        ));
        assert_eq!((scene.images.len(), scene.textures.len()), (1, 1));
        let set = snell_scene::TextureSet::new(&scene.textures, &scene.images);
        // Coordinates of the scene have v downwards.
        let [r, g, b, _] = set.lookup_at(snell_scene::TextureId(0), Vec2::new(u, 1.0 - v), 0.0);
        [r, g, b]
    };
    for (text, u, v, expected) in [
        ("", 0.25, 0.75, [0.25, 0.75, 0.0]),
        ("", 0.7, 0.01, [0.7, 0.01, 0.0]),
        ("\"float uscale\" 4 \"float vdelta\" 0.5", 0.3, 0.75, [0.2, 0.25, 0.0]),
        ("\"float uscale\" -1", 0.25, 0.5, [0.75, 0.5, 0.0]),
    ] {
        let found = at(text, u, v);
        assert!((0..3).all(|c| (found[c] - expected[c]).abs() < 1e-4), "{text}: {found:?}");
    }
    // Two textures share the picture; there is none of numbers.
    let two = "Texture \"a\" \"color\" \"uv\" Texture \"b\" \"color\" \"uv\" \"float uscale\" 2\n";
    assert_eq!(world(two).images.len(), 1);
    assert!(warnings(&format!("{two} Texture \"c\" \"float\" \"uv\"")).contains("is not known"));
}

#[test]
fn every_pattern_and_mapping_of_pbrt_is_read() {
    use snell_scene::texture::{Mapping, Pattern};
    let one = |kind: &str, text: &str| {
        let user = if kind == "float" {
            "Material \"diffuse\" Shape \"sphere\" \"texture alpha\" \"t\""
        } else {
            "Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\""
        };
        let scene = world(&format!("Texture \"t\" \"{kind}\" {text}\n{user}"));
        assert!(scene.warnings.is_empty(), "{text}: {:?}", scene.warnings);
        scene
            .textures
            .last()
            .and_then(|t| t.as_pattern())
            .cloned()
            .unwrap_or_else(|| panic!("{text}"))
    };
    for (kind, text, name) in [
        ("float", "\"fbm\" \"integer octaves\" 3 \"float roughness\" 0.4", "fbm"),
        ("float", "\"wrinkled\"", "wrinkled"),
        ("float", "\"windy\"", "windy"),
        ("spectrum", "\"marble\" \"float scale\" 4 \"float variation\" 1", "marble"),
        ("spectrum", "\"dots\" \"rgb inside\" [1 0 0]", "dots"),
        ("spectrum", "\"bilerp\" \"rgb v00\" [1 0 0]", "bilerp"),
        ("spectrum", "\"directionmix\" \"vector dir\" [1 0 0]", "direction-mix"),
        ("spectrum", "\"checkerboard\"", "checkerboard"),
        ("float", "\"checkerboard\" \"integer dimension\" 3", "solid-checkerboard"),
    ] {
        assert_eq!(one(kind, text).name(), name);
    }
    assert!(matches!(one("float", "\"fbm\" \"integer octaves\" \
            1000000000"), Pattern::Fbm(p) if p.octaves == 1_000_000_000));
    for (name, is) in [("spherical", 0), ("cylindrical", 1), ("planar", 2)] {
        let Pattern::Dots(dots) =
            one("spectrum", &format!("\"dots\" \"string mapping\" \"{name}\""))
        else {
            panic!("dots")
        };
        let found = match dots.mapping {
            Mapping::Spherical { .. } => 0,
            Mapping::Cylindrical { .. } => 1,
            Mapping::Planar { .. } => 2,
            Mapping::Uv { .. } => 3,
        };
        assert_eq!(found, is);
    }
    // Octaves without number end, too.
    let scene = world(
        "Texture \"t\" \"float\" \"wrinkled\" \"integer octaves\" 1000000000 Material \"diffuse\" \
            Shape \"sphere\" \"texture alpha\" \"t\"",
    );
    assert!(shown(&scene, [0.3, 0.7, 0.1], 0.0)[0].is_finite());
}

#[test]
fn what_is_wrong_with_a_pattern_is_an_error_with_its_place() {
    for (text, said) in [
        ("\"fbm\" \"integer octaves\" -1", "octaves is -1"),
        ("\"fbm\" \"float roughness\" 1e99", "\"1e99\" in roughness is not a number"),
        ("\"checkerboard\" \"integer dimension\" 4", "dimension is 4"),
        ("\"dots\" \"string mapping\" \"cubic\"", "\"cubic\" is not a mapping"),
        (
            "\"dots\" \"string mapping\" \"planar\" \"vector v1\" [1 0 0 0 1 0]",
            "v1 is not one vector",
        ),
        ("\"directionmix\" \"vector dir\" [0 0 0]", "dir has no direction"),
    ] {
        let error = fault(&format!("WorldBegin\nTexture \"t\" \"spectrum\" {text}\n"));
        assert!(error.contains(":2:") && error.contains(said), "{text}: {error}");
    }
}

#[test]
fn textures_doubled_again_and_again_are_an_error() {
    let mut text = "WorldBegin\nTexture \"t0\" \"spectrum\" \"marble\"\n".to_string();
    for i in 1..40 {
        let before = i - 1;
        text += &format!(
            "Texture \"t{i}\" \"spectrum\" \"mix\" \"texture tex1\" \"t{before}\" \"texture tex2\" \
                \"t{before}\"\n"
        );
    }
    assert!(fault(&text).contains("made of more than 256 textures"));
}
