//! The effect of `render` options on the picture.

use super::support::{BALL, Place};

/// The linear values of a small render.
fn pixels(place: &Place, words: &str) -> Vec<f32> {
    place.run(&format!("render {words} -t 1 -q -o p.exr")).done();
    place.layers("p.exr").layers.swap_remove(0).values
}

#[test]
fn a_crop_has_the_pixels_of_the_whole() {
    let place = Place::new();
    let words = "cornell-box --size 40x30 --spp 4";
    let whole = pixels(&place, words);
    let part = pixels(&place, &format!("{words} --crop 7,5,29,23"));
    assert_eq!(part.len(), 22 * 18 * 3);
    for y in 0..18 {
        let row = ((y + 5) * 40 + 7) * 3;
        assert_eq!(part[y * 66..][..66], whole[row..][..66], "row {y}");
    }
}

#[test]
fn the_seed_changes_the_noise() {
    let place = Place::new();
    let [a, b] = [0, 1]
        .map(|seed| pixels(&place, &format!("cornell-box --size 16x12 --spp 1 --seed {seed}")));
    assert_ne!(a, b);
}

#[test]
fn a_definition_changes_the_scene() {
    let place = Place::new();
    let info: serde_json::Value =
        serde_json::from_slice(&place.run("info cornell-box --json").done().out)
            .expect("it is JSON");
    let light = info["materials"]
        .as_array()
        .expect("a list")
        .iter()
        .position(|m| m["emission"]["factor"] != serde_json::json!([0.0, 0.0, 0.0]))
        .expect("the Cornell box has a lamp");
    let dark =
        format!("cornell-box --size 8x6 --spp 2 -D material.{light}.emission.factor=[0,0,0]");
    assert!(pixels(&place, &dark).iter().all(|&x| x == 0.0), "without a lamp the box is black");
    assert!(pixels(&place, "cornell-box --size 8x6 --spp 2").iter().any(|&x| x > 0.0));
}

#[test]
fn the_background_is_what_was_asked_for() {
    let place = Place::new();
    place.write("a.ply", BALL);
    let clear = pixels(&place, "a.ply --size 12x12 --spp 4 --background transparent");
    let alphas: Vec<_> = clear.chunks(4).map(|p| p[3]).collect();
    assert!(alphas.contains(&0.0) && alphas.contains(&1.0), "{alphas:?}");
    let corner = pixels(&place, "a.ply --size 12x12 --spp 4 --background 0.25,0.5,2")[..3].to_vec();
    assert_eq!(corner, [0.25, 0.5, 2.0]);
    place.run("render a.ply --size 12x12 --spp 1 -t 1 -q --background transparent -o a.png").done();
    assert_eq!(place.image("a.png").channels, 4);
}

#[test]
fn an_environment_file_lights_the_scene() {
    let place = Place::new();
    place.write("a.ply", BALL);
    place.run("render minray --size 16x8 --spp 1 -t 1 -q -o sky.hdr").done();
    let lit = pixels(&place, "a.ply --size 12x12 --spp 4 --environment sky.hdr");
    assert!(lit.iter().any(|&x| x > 0.0) && lit.iter().all(|x| x.is_finite()));
    let white = pixels(&place, "a.ply --size 4x4 --spp 1 --environment 1,1,1");
    assert_eq!(white[..3], [1.0; 3]);
    let run = place.run("render a.ply --environment nothere.hdr -o b.png");
    assert_eq!(
        (run.code, run.err.starts_with("error: nothere.hdr: cannot open")),
        (1, true),
        "{}",
        run.err
    );
}

#[test]
fn exposure_and_tone_map_change_display_formats_only() {
    let place = Place::new();
    let words = "render cornell-box --size 16x12 --spp 2 -t 1 -q";
    let mut pictures = Vec::new();
    for (i, options) in ["", "--exposure 1", "--exposure -2.5", "--tonemap aces", "--tonemap agx"]
        .iter()
        .enumerate()
    {
        place.run(&format!("{words} {options} -o {i}.png --stats {i}.json")).done();
        pictures
            .push(std::fs::read(place.path(&format!("{i}.png"))).expect("the picture was written"));
        assert_eq!(
            place.json(&format!("{i}.json"))["image_sha256"],
            place.json("0.json")["image_sha256"]
        );
    }
    pictures.sort();
    pictures.dedup();
    assert_eq!(pictures.len(), 5);
}

#[test]
fn a_camera_is_chosen_by_name_or_number() {
    let place = Place::new();
    let default = pixels(&place, "cornell-box --size 8x6 --spp 1");
    assert_eq!(pixels(&place, "cornell-box --size 8x6 --spp 1 --camera 0"), default);
    let run = place.run("render cornell-box --camera nothere");
    assert_eq!(run.code, 2);
    assert!(
        run.err.starts_with("error: there is no camera \"nothere\"; the scene has: 0 "),
        "{}",
        run.err
    );
}

#[test]
fn progress_in_json_is_one_object_a_line() {
    let place = Place::new();
    let run =
        place.run("render cornell-box --size 64x48 --time 1s -t 1 --progress json -o a.png").done();
    let lines: Vec<_> = run.err.lines().filter(|l| l.starts_with('{')).collect();
    assert!(lines.len() >= 2, "{}", run.err);
    let mut last = 0.0;
    for line in lines {
        let object: serde_json::Value =
            serde_json::from_str(line).expect("each line is one object");
        let done = object["done"].as_f64().expect("a share");
        assert!((last..=1.0).contains(&done), "{line}");
        last = done;
    }
}

#[test]
fn quiet_is_silent() {
    let place = Place::new();
    let run = place.run("render --size 8x6 --spp 1 -q").done();
    assert_eq!((run.out.len(), run.err.as_str()), (0, ""));
}

#[test]
fn values_that_mean_nothing_are_wrong_usage_and_the_message_says_what_would() {
    let place = Place::new();
    for (words, part) in [
        ("render --spp nan", "expected a whole number from 1 to"),
        ("render --seed 18446744073709551616", "expected a whole number from 0 to 4294967295"),
        ("render --aov ,,", "expected names of layers"),
        ("render --frames 0..1e9@24", "1e9 seconds are too many"),
        ("render --frames 0..1@5000", "rates are from 0.001 to 1000"),
        ("render --turntable 99999999999", "a turn has 1 to 100000"),
        (
            "render --light-group a=99 -o a.exr",
            "there is environment, and emissive materials: lamp",
        ),
        ("render --display tev://localhost:99999", "expected tev://HOST:PORT"),
        (
            "render -D material.lamp.emission.factor=[1e30,0,0]",
            "1e30 is not possible, expected 0 to 1e24",
        ),
        ("compare a.png b.png --max-relmse nan", "expected a number of at least 0"),
        ("explain cornell-box --pixel -1,0", "a pixel is a column and a row"),
        ("explain cornell-box --pixel 1,1 -- -o a.png", "--output belongs to `snell render`"),
    ] {
        let run = place.run(words);
        assert_eq!(run.code, 2, "{words}: {}", run.err);
        assert!(run.err.contains(part), "{words}: {}", run.err);
    }
    let run = place.run(
        "explain cornell-box --pixel 1,1 --structures none --svg nowhere/a.svg -- \
        --size 4x4 --spp 1",
    );
    assert!(
        run.code == 1 && !run.err.contains(".tmp"),
        "a temporary name says nothing: {}",
        run.err
    );
}
