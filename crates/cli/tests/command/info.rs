//! `info`, `compare` and the lists.

use super::support::{BALL, Place};

#[test]
fn info_shows_tree_materials_lights_and_cameras() {
    let place = Place::new();
    place.write("a.ply", BALL);
    insta::assert_snapshot!(place.run("info a.ply").done().text(), @"
    a
    2 nodes, 1 meshes (1 triangles, 3 vertices), 0 shapes
    bounds: [0.0000, 0.0000, 0.0000] to [1.0000, 1.0000, 0.0000], size [1.0000, 1.0000, 0.0000]

    Tree
      root
        a  mesh of 1 triangles

    Lights: 0 and environment: none

    Cameras: none (one is made that frames the scene)
    ");
}

#[test]
fn info_in_json_has_the_same_facts() {
    let place = Place::new();
    for scene in ["cornell-box", "minray", "night-town", "spheres", "teapot"] {
        let info: serde_json::Value =
            serde_json::from_slice(&place.run(&format!("info {scene} --json")).done().out)
                .expect("it is JSON");
        assert_eq!(info["name"], scene);
        for key in [
            "nodes",
            "triangles",
            "bounds",
            "materials",
            "lights",
            "cameras",
            "warnings",
            "tree",
            "environment",
        ] {
            assert!(!info[key].is_null(), "{scene}: {key}");
        }
    }
}

#[test]
fn comparing_tells_how_far_pictures_are_apart() {
    let place = Place::new();
    place.run("render cornell-box --size 16x12 --spp 2 -t 1 -q -o a.exr").done();
    place.run("render cornell-box --size 16x12 --spp 2 -t 1 -q -o b.exr --seed 1").done();
    place.run("render cornell-box --size 12x12 --spp 1 -t 1 -q -o small.exr").done();
    for (file, kinds) in [("c.exr", "albedo"), ("d.exr", "albedo,normal")] {
        let words =
            format!("render cornell-box --size 16x12 --spp 2 -t 1 -q --aov {kinds} -o {file}");
        place.run(&words).done();
    }
    place.run("compare c.exr d.exr --layer albedo --max-relmse 0").done();
    let run = place.run("compare c.exr d.exr --layer normal");
    assert_eq!(run.code, 1);
    insta::assert_snapshot!(run.err, @r#"error: c.exr: there is no layer "normal" beside the picture; the others are: albedo"#);
    let run = place.run("compare a.exr a.exr --max-relmse 0 --max-flip 0 --max-different 0").done();
    assert!(run.text().contains("PSNR             equal\n"), "{}", run.text());
    let run = place.run("compare a.exr b.exr --max-relmse 0.000001 -o d.png --json");
    assert_eq!(run.code, 1);
    assert!(run.err.starts_with("over the limit: relative MSE is "), "{}", run.err);
    let numbers: serde_json::Value = serde_json::from_slice(&run.out).expect("it is JSON");
    assert!(numbers["mse"].as_f64().is_some_and(|x| x > 0.0), "{numbers}");
    assert_eq!(place.image("d.png").width, 16);
    let run = place.run("compare a.exr small.exr");
    assert_eq!(run.code, 1);
    insta::assert_snapshot!(run.err, @"error: a.exr and small.exr: the sizes differ: the reference \
        has 16 x 12 pixels, the other picture 12 x 12; render or scale one of them to the size of \
        the other");
}

#[test]
fn the_lists_name_what_there_is() {
    let place = Place::new();
    for (words, expected) in [("scenes", ["cornell-box", "teapot"]), ("formats", [".gltf", ".exr"])]
    {
        let run = place.run(words).done();
        assert!(expected.iter().all(|e| run.text().contains(e)), "{}", run.text());
    }
}

#[test]
fn completions_and_the_manual_know_the_options() {
    let place = Place::new();
    for shell in ["bash", "zsh", "fish"] {
        let run = place.run(&format!("completions {shell}")).done();
        assert!(run.text().contains("max-depth"), "{shell}");
    }
    let run = place.run("man").done();
    assert!(run.text().contains(".TH snell") && run.text().contains("max\\-depth"));
}

#[test]
fn no_command_shows_the_help_and_is_wrong_usage() {
    let run = Place::new().run("");
    assert_eq!(run.code, 2);
    assert!(
        run.err.contains("Usage: snell <COMMAND>")
            && run.err.contains("Render a scene to a picture"),
        "{}",
        run.err
    );
}

#[test]
fn help_is_help_and_not_an_error() {
    let place = Place::new();
    for words in
        ["--help", "help render", "render --help", "info -h", "compare --help", "--version"]
    {
        let run = place.run(words).done();
        assert!(!run.out.is_empty() && run.err.is_empty(), "{words}");
        assert!(run.text().lines().all(|l| l.chars().count() <= 110), "{words}");
    }
}

#[test]
fn info_and_convert_take_definitions() {
    let place = Place::new();
    place.write(
        "a.xml",
        "<scene version=\"3.0.0\"><default name=\"r\" value=\"1\"/><shape type=\"sphere\">\
        <float name=\"radius\" value=\"$r\"/><bsdf type=\"diffuse\" id=\"skin\"/></shape></scene>",
    );
    let info = |define: &str| {
        let run = place.run(&format!("info a.xml --json {define}")).done();
        serde_json::from_slice::<serde_json::Value>(&run.out).expect("it is JSON")
    };
    let changed = info("-D r=3 -D material.skin.reflectance.factor=[.25,.25,.25]");
    assert_eq!(changed["bounds"]["max"][0], 3.0, "{}", changed["bounds"]);
    assert_eq!(changed["materials"][0]["kind"]["reflectance"]["factor"][0], 0.25);
    place.run("convert a.xml b.snell -D r=2").done();
    assert_eq!(
        serde_json::from_slice::<serde_json::Value>(&place.run("info b.snell --json").done().out)
            .expect("it is JSON")["bounds"]["max"][0],
        2.0
    );
    let wrong = place.run("info a.xml -D radius=2");
    assert!(wrong.code != 0 && wrong.err.contains("radius: unknown key"), "{}", wrong.err);
}

#[test]
fn info_shows_the_parameters_of_a_kind() {
    let place = Place::new();
    let text = place.run("info --kind homogeneous").done();
    assert!(text.text().starts_with("medium \"homogeneous\": "), "{}", text.text());
    assert!(text.text().contains("sigma_s: colour, per scene unit, 0 or more, default "));
    assert!(place.run("info --kind light").done().text().starts_with("kinds of light: "));
    let wrong = place.run("info --kind open-pbrr");
    assert!(wrong.code != 0 && wrong.err.contains("did you mean open-pbr?"), "{}", wrong.err);
}
