//! The files that a render writes, and their contents.

use super::support::{BALL, Place};

#[test]
fn a_render_without_anything_writes_the_cornell_box_and_says_what_is_next() {
    let place = Place::new();
    let run = place.run("render --size 24x18 --spp 2 -t 1").done();
    assert_eq!(place.files(), ["cornell-box.png"]);
    assert_eq!(
        (place.image("cornell-box.png").width, place.image("cornell-box.png").height),
        (24, 18)
    );
    assert!(
        run.err.starts_with("cornell-box.png: 24x18, 2 samples per pixel, path in "),
        "{}",
        run.err
    );
    assert!(run.err.contains("Next: `snell render FILE`"), "{}", run.err);
    assert!(run.out.is_empty());
}

#[test]
fn the_extension_decides_the_format() {
    let place = Place::new();
    let starts: [(&str, &[u8]); 6] = [
        ("a.png", b"\x89PNG\r\n\x1a\n"),
        ("a.jpg", &[0xff, 0xd8, 0xff]),
        ("a.exr", &[0x76, 0x2f, 0x31, 0x01]),
        ("a.hdr", b"#?RADIANCE"),
        ("a.pfm", b"PF"),
        ("a.ppm", b"P6"),
    ];
    for (name, start) in starts {
        place.run(&format!("render minray --size 8x6 --spp 1 -t 1 -q -o {name}")).done();
        let bytes = std::fs::read(place.path(name)).expect("the picture was written");
        assert!(bytes.starts_with(start), "{name}: {:?}", &bytes[..12]);
        assert_eq!((place.image(name).width, place.image(name).height), (8, 6), "{name}");
    }
}

#[test]
fn a_dash_writes_a_png_to_standard_output_and_nothing_else() {
    let place = Place::new();
    let run = place.run("render cornell-box --size 8x6 --spp 1 -t 1 -o -").done();
    assert!(place.files().is_empty());
    place.write("out.png", &run.out);
    assert_eq!(place.image("out.png").width, 8);
    assert!(run.out.ends_with(b"IEND\xaeB`\x82"), "nothing follows the picture");
}

#[test]
fn the_scene_may_come_from_standard_input() {
    let place = Place::new();
    let words = "render - -o a.png --size 8x6 --spp 1 -t 1 -q";
    place.run_with_input(words, BALL.as_bytes()).done();
    assert_eq!(place.files(), ["a.png"]);
    let run = place.run_with_input("info -", b"no scene at all");
    assert_eq!(run.code, 1);
    assert!(run.err.starts_with("error: standard input: "), "{}", run.err);
}

#[test]
fn the_order_of_options_does_not_matter() {
    let place = Place::new();
    place.run("render -o a.pfm --size 8x6 cornell-box --spp 2 -t 1 --seed 3 -q").done();
    place.run("render -q --seed 3 --spp 2 cornell-box -t 1 --size=8x6 -oa2.pfm").done();
    let read = |name| std::fs::read(place.path(name)).expect("the picture was written");
    assert_eq!(read("a.pfm"), read("a2.pfm"));
}

#[test]
fn a_picture_carries_its_settings() {
    let place = Place::new();
    for name in ["a.png", "a.exr"] {
        place
            .run(&format!("render minray -i direct --size 8x6 --spp 3 --seed 7 -t 1 -q -o {name}"))
            .done();
    }
    let found = place.layers("a.exr").metadata;
    let png = std::fs::read(place.path("a.png")).expect("the picture was written");
    let has = |text: &str| png.windows(text.len()).any(|w| w == text.as_bytes());
    for (key, value) in
        [("Integrator", "direct"), ("Samples", "3"), ("Seed", "7"), ("Scene", "minray")]
    {
        assert!(has(&format!("{key}\0{value}")), "{key} in the PNG");
        assert!(found.iter().any(|(k, v)| k == key && v == value), "{key} in {found:?}");
    }
    assert!(found.iter().any(|(k, v)| k == "Software" && v.starts_with("Snell ")), "{found:?}");
}

#[test]
fn layers_are_named_in_openexr() {
    let place = Place::new();
    place
        .run("render cornell-box --size 8x6 --spp 2 -t 1 -q --aov depth,normal --variance -o a.exr")
        .done();
    let names: Vec<_> = place.layers("a.exr").layers.into_iter().map(|l| l.name).collect();
    assert!(
        ["", "depth", "normal", "variance"].iter().all(|n| names.iter().any(|m| m == n)),
        "{names:?}"
    );
}

#[test]
fn a_failed_render_leaves_the_old_picture() {
    let place = Place::new();
    place.write("a.png", "precious").write("bad.ply", "ply\nformat ascii 1.0\nnonsense\n");
    for words in [
        "render bad.ply -o a.png",
        "render missing.obj -o a.png",
        "render -i pth -o a.png",
        "render --tonemap acs -o a.png",
    ] {
        assert_ne!(place.run(words).code, 0, "{words}");
    }
    assert_eq!(std::fs::read(place.path("a.png")).expect("still there"), b"precious");
    assert_eq!(place.files(), ["a.png", "bad.ply"]);
}

#[test]
fn what_cannot_be_written_is_known_before_the_render() {
    let place = Place::new();
    std::fs::create_dir(place.path("folder.png")).expect("the folder is writable");
    // A render of this size would take hours.
    let long = "render cornell-box --size 4000x4000 --spp 100000 -t 1 -q";
    for (options, message) in [
        (
            "-o a.gif",
            "error: a.gif: \"gif\" is not an image format that Snell writes; use one of: .exr .png \
                .jpg .hdr .pfm .ppm\n",
        ),
        (
            "-o picture",
            "error: picture: the name has no extension that says which image format to write; use \
                one of: .exr .png .jpg .hdr .pfm .ppm\n",
        ),
        ("-o no/a.png", "error: no/a.png: the folder no does not exist; create it first\n"),
        ("-o folder.png", "error: folder.png: this is a folder; name a file in it\n"),
        ("--stats no/a.json", "error: no/a.json: the folder no does not exist; create it first\n"),
    ] {
        let run = place.run(&format!("{long} {options}"));
        assert_eq!((run.code, run.err.as_str()), (1, message), "{options}");
    }
    for options in ["--tonemap acs", "--bits 12", "--size 65536x65536"] {
        let run = place.run(
            &format!("{long} -o a.png {options}")
                .replace("--size 4000x4000 --spp 100000 -t 1 -q -o a.png --size", "--size"),
        );
        assert_eq!(run.code, 2, "{options}: {}", run.err);
        assert!(run.err.starts_with("error: "), "{}", run.err);
    }
    assert_eq!(place.files(), ["folder.png"]);
}

#[test]
fn a_reader_that_stops_reading_is_no_fault() {
    let place = Place::new();
    for words in [
        "info cornell-box",
        "formats",
        "scenes",
        "man",
        "completions bash",
        "render minray --size 8x8 --spp 1 -q -o -",
    ] {
        let mut child = place.command(words).spawn().expect("the command exists");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("the command was started");
        assert!(output.status.success(), "{words}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn light_groups_and_cryptomatte_have_their_names_in_openexr() {
    let place = Place::new();
    let words = "render cornell-box --size 16x12 --spp 4 -t 1 -q --aov \
        direct,crypto-object,crypto-material --variance \
                 --light-group lamp=lamp -o a.exr";
    place.run(words).done();
    let picture = place.layers("a.exr");
    let names: Vec<&str> = picture.layers.iter().map(|l| l.name.as_str()).collect();
    for name in [
        "direct",
        "light_lamp",
        "light_other",
        "direct_lamp",
        "direct_lamp.variance",
        "CryptoObject00",
        "CryptoMaterial02",
    ] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    let values = |name: &str| picture.layer(name).expect("the layer is there").values.clone();
    assert!(values("light_other").iter().all(|&v| v == 0.0), "there is one lamp");
    let manifest =
        picture.metadata.iter().find(|(k, v)| k.ends_with("/manifest") && v.contains("\"white\":"));
    assert!(manifest.is_some_and(|(k, _)| k.starts_with("cryptomatte/")), "{:?}", picture.metadata);
    // The manifest has the hash of the material with the largest share of a pixel, bit for bit.
    let material = picture.layer("CryptoMaterial00").expect("the layer is there");
    let red = material
        .channels
        .iter()
        .position(|c| c.eq_ignore_ascii_case("R"))
        .expect("the first rank is in R and G");
    let pixels = material.values.chunks(material.channels.len());
    let found = pixels.map(|ranks| ranks[red].to_bits()).find(|hash| *hash != 0);
    let hash = format!("{:08x}", found.expect("some pixel shows a surface"));
    assert!(
        picture.metadata.iter().any(|(k, v)| k.ends_with("/manifest") && v.contains(&hash)),
        "{hash}"
    );
}

#[test]
fn a_light_group_or_a_denoiser_that_is_not_there_is_an_error_that_tells_what_to_do() {
    let place = Place::new();
    for (option, remedy) in [
        ("--light-group key=9", "emissive materials: lamp"),
        ("--light-group key", "expected NAME=LIST"),
        ("--denoise=nowhere", "pip install pyoidn"),
        ("--noise 0", "expected a number from 0.00001"),
        ("--clamp=-1", "expected a positive number"),
    ] {
        let run = place.run(&format!("render cornell-box {option} -o a.png"));
        assert!(run.code != 0 && run.err.contains(remedy), "{option}: {}", run.err);
    }
    assert!(place.files().is_empty(), "{:?}", place.files());
}

#[test]
fn a_render_to_a_stated_error_says_how_far_it_came() {
    let place = Place::new();
    let words = "render cornell-box --size 12x8 --noise 0.5 --spp 512 --max-depth 2 -t 2 --aov \
        noise,samples --stats s.json -o a.exr";
    let run = place.run(words).done();
    assert!(run.err.contains("% of the pixels within 0.5"), "{}", run.err);
    let s = place.json("s.json");
    assert_eq!(s["noise"], 0.5);
    let number = |key: &str| s[key].as_f64().unwrap_or(-1.0);
    assert!(
        number("spp") >= 128.0
            && number("spp_most") <= 512.0
            && number("spp_mean") >= number("spp"),
        "{s}"
    );
    assert!(number("converged") > 0.5, "{s}");
    let picture = place.layers("a.exr");
    let samples = &picture.layer("samples").expect("the layer is there").values;
    assert_eq!(samples.iter().fold(0.0f32, |a, &b| a.max(b)) as f64, number("spp_most"));
}
