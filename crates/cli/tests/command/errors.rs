//! Each kind of error, as the user sees it: exit code and message.

use super::support::Place;

/// The exit code and the messages of a failing command.
fn failure(place: &Place, words: &str) -> String {
    let run = place.run(words);
    assert!(run.out.is_empty(), "{words}");
    format!("{}\n{}", run.code, run.err)
}

#[test]
fn a_wrong_name_suggests_the_nearest() {
    let place = Place::new();
    insta::assert_snapshot!(failure(&place, "render -i pth"), @r#"
    2
    error: invalid value 'pth' for '--integrator <NAME>': expected one of flat, raycast, whitted, direct, ao, path, aov; did you mean path?

    For more information, try '--help'.
    "#);
    insta::assert_snapshot!(failure(&place, "render --sampler sobel"), @r#"
    2
    error: invalid value 'sobel' for '--sampler <NAME>': expected one of independent, stratified, sobol, zsobol; did you mean sobol?

    For more information, try '--help'.
    "#);
    insta::assert_snapshot!(failure(&place, "render --filter gausian"), @r#"
    2
    error: invalid value 'gausian' for '--filter <NAME>': expected one of box, tent, gaussian, mitchell, blackman-harris, lanczos; did you mean gaussian?

    For more information, try '--help'.
    "#);
    insta::assert_snapshot!(failure(&place, "render --aov norml"), @r#"
    2
    error: invalid value 'norml' for '--aov <LIST>': expected one of depth, distance, position, normal, geometric-normal, uv, albedo, instance-id, geometry-id, primitive-id, material-id, facing, barycentrics, motion, nodes-visited, primitives-tested, noise, samples, crypto-object, crypto-material, emission, direct, indirect, diffuse-direct, diffuse-indirect, specular-direct, specular-indirect, transmission-direct, transmission-indirect, volume-direct, volume-indirect; did you mean normal?

    For more information, try '--help'.
    "#);
    insta::assert_snapshot!(failure(&place, "render --tonemap acs"), @r#"
    2
    error: there is no tone map "acs"; did you mean aces? (known: none, aces, agx)
    "#);
    insta::assert_snapshot!(failure(&place, "render cornel-box"), @"
    1
    error: cornel-box: neither a file nor a built-in scene; did you mean cornell-box? `snell \
    scenes` lists the built-in ones
    ");
    insta::assert_snapshot!(failure(&place, "rendr"), @"
    2
    error: unrecognized subcommand 'rendr'

      tip: a similar subcommand exists: 'render'

    Usage: snell <COMMAND>

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(failure(&place, "render --sise 3x3"), @"
    2
    error: unexpected argument '--sise' found

      tip: a similar argument exists: '--size'

    Usage: snell render --size <WxH> [SCENE]

    For more information, try '--help'.
    ");
}

#[test]
fn a_wrong_value_says_what_is_expected() {
    let place = Place::new();
    insta::assert_snapshot!(failure(&place, "render --size 640"), @r#"
    2
    error: invalid value '640' for '--size <WxH>': expected width and height, such as 1280x720, each from 1 to 65536

    For more information, try '--help'.
    "#);
    insta::assert_snapshot!(failure(&place, "render --spp 0"), @"
    2
    error: invalid value '0' for '--spp <N>': expected a whole number from 1 to 16777216

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(failure(&place, "render --time 5x"), @r#"
    2
    error: invalid value '5x' for '--time <TIME>': expected seconds, or a duration such as 30s, 5m, 1h or 1h30m

    For more information, try '--help'.
    "#);
    insta::assert_snapshot!(failure(&place, "render --crop 0,0,5000,10"), @"
    2
    error: --crop 0,0,5000,10 reaches beyond the picture of 512x512 pixels
    ");
    insta::assert_snapshot!(failure(&place, "render --background blue"), @"
    2
    error: --background blue: expected environment, studio, transparent (or none), white, \
    black, #rrggbb or r,g,b
    ");
    insta::assert_snapshot!(failure(&place, "render --environment nan,0,0"), @"
    2
    error: --environment nan,0,0: not a color; expected white, black, #rrggbb or r,g,b (finite and \
    not negative), none, sky, sky:…, or the name of a picture
    ");
    insta::assert_snapshot!(failure(&place, "render -o a.png --stats ./a.png"), @"
    2
    error: --stats ./a.png: the picture would be written there too; give one of them another name
    ");
    insta::assert_snapshot!(failure(&place, "render -D material.nothere.x=1"), @r#"
    2
    error: -D material.nothere.x: there is no material "nothere" (known: white, red, green, lamp)
    "#);
    insta::assert_snapshot!(failure(&place, "render -D light"), @"
    2
    error: -D light: expected key=value, such as material.floor.reflectance.factor=[1,0,0]
    ");
    insta::assert_snapshot!(failure(&place, "render --size 60000x60000"), @"
    2
    error: a picture of 60000x60000 pixels is larger than the limit of 268435456 pixels; make it \
    smaller with --size, or render parts of it with --crop
    ");
    insta::assert_snapshot!(failure(&place, "render --exposure nan"), @r#"
    2
    error: invalid value 'nan' for '--exposure <EV>': expected a number from -100 to 100

    For more information, try '--help'.
    "#);
    insta::assert_snapshot!(failure(&place, "render --ao-distance=-1"), @r#"
    2
    error: invalid value '-1' for '--ao-distance <DISTANCE>': expected a positive number

    For more information, try '--help'.
    "#);
}

#[test]
fn a_broken_file_names_place_problem_and_remedy() {
    let place = Place::new();
    let files: [(&str, &[u8]); 17] = [
        ("syntax.gltf", br#"{"asset": {"version": "2.0"}, "#),
        ("range.gltf", br#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [7]}]}"#),
        ("version.gltf", br#"{"asset": {"version": "3.0"}}"#),
        ("required.gltf", br#"{"asset": {"version": "2.0"}, "extensionsRequired": ["EXT_unheard_of"], "extensionsUsed": ["EXT_unheard_of"], "meshes": [{"extensions": {"EXT_unheard_of": {}}}]}"#),
        ("buffer.gltf", br#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4, "uri": "missing.bin"}], "bufferViews": [{"buffer": 0, "byteLength": 4}], "accessors": [{"bufferView": 0, "componentType": 5126, "count": 1, "type": "VEC3"}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}"#),
        ("cut.glb", b"glTF\x02\0\0\0\xff\0\0\0"),
        ("index.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"),
        ("number.obj", b"v 0 0 zero\n"),
        ("count.ply", b"ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float \
            x\nproperty float y\nproperty float z\nend_header\n"),
        ("short.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float \
            y\nproperty float z\nend_header\n0 0 0\n"),
        ("short.stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0"),
        ("short.off", b"OFF\n3 1 0\n0 0 0\n"),
        ("word.scn", b"material 0 0 0 1 1 1 0 0 0 0 0 0 0 0 0 1 1 0\nsphere 0 0 0 0 big\n"),
        ("short.nff", b"v\nfrom 0 0 1\n"),
        ("word.pbrt", b"WorldBegin\n  Shape \"sphere\" \"float radius\" [ big ]\n"),
        ("what.xyz", b"nothing that is known"),
        ("empty.obj", b""),
    ];
    let mut found = String::new();
    for (name, content) in files {
        place.write(name, content);
        let run = place.run(&format!("render {name} --size 8x8 --spp 1 -t 1 -q"));
        found +=
            &format!("{} {}", run.code, if run.err.is_empty() { "rendered\n" } else { &run.err });
    }
    insta::assert_snapshot!(found, @r#"
    1 error: syntax.gltf:1:30: not valid JSON: EOF while parsing a value; export the file again, or check it with the glTF validator
    1 error: range.gltf:1:65: at /scenes/0/nodes/0: it refers to number 7 of "nodes", but there are 0; export the file again, or check it with the glTF validator
    1 error: version.gltf:1:23: at /asset/version: this is glTF "3.0", expected 2.0; convert it to glTF 2.0, for example with gltf-pipeline or Blender
    1 error: required.gltf:1:54: at /extensionsRequired/0: the file requires the extension EXT_unheard_of for its geometry, and Snell does not support it; export the file again without this extension, or as optional
    1 error: buffer.gltf:1:148: at /accessors/0: 1 elements of 12 bytes, 12 bytes apart, from byte 0 do not fit into the 4 bytes of the buffer view; export the file again, or check it with the glTF validator
    1 error: cut.glb: at byte 8: the header promises 255 bytes, but the file has 12; the file is cut off: copy or export it again
    1 error: index.off:6:7: vertex 9 of a face, but there are 3 vertices; vertices count from 0; export the file again
    1 error: number.obj:1:7: found "zero", expected a coordinate of a vertex; write a decimal number
    1 error: count.ply:3:9: more than 500000000 vertices, the limit; split the file
    1 error: short.ply:9:1: the file ends where another value is expected; the file seems cut off; export or copy it again
    1 error: short.stl:4:11: the file ends where a coordinate of a vertex is expected; the file seems cut off; export or copy it again
    1 error: short.off:4:1: the file ends where a coordinate of vertex 1 of 3 is expected; the file seems cut off; export or copy it again
    1 error: word.scn:2:16: found "big", expected the radius of the sphere, a number; write it as: sphere material center(3) radius
    1 error: short.nff:3: the file ends where `at` was expected; write it as: v from x y z at x y z up x y z angle degrees hither distance resolution width height
    1 error: word.pbrt:2:35: found "big", expected a number of radius; write a number
    1 error: what.xyz: this is not a scene or mesh format that Snell knows, neither by its content nor by its extension; use one of: snell, gltf, minray, nff, nanovdb, pbrt, mitsuba, scn, ply, pcd, off, stl, ray, obj (`snell formats` says more)
    0 rendered
    "#);
}

#[test]
fn files_that_are_no_files_are_errors() {
    let place = Place::new();
    std::fs::create_dir(place.path("folder")).expect("the folder is writable");
    place.write("a.exr", b"\x76\x2f\x31\x01 and then nothing").write("a.png", b"\x89PNG\r\n\x1a\n");
    insta::assert_snapshot!(failure(&place, "render folder"), @"
    1
    error: folder: this is a folder, not a file; name the scene file inside it
    ");
    insta::assert_snapshot!(failure(&place, "render missing.glb"), @"
    1
    error: missing.glb: cannot open: No such file or directory (os error 2); check the name and \
    that you may read it
    ");
    insta::assert_snapshot!(failure(&place, "compare a.exr a.png"), @"
    1
    error: a.exr: the OpenEXR file is damaged or of an unsupported kind: not supported: too new \
    file feature flags; render or export it again as scan lines with ZIP compression
    ");
    insta::assert_snapshot!(failure(&place, "compare a.png missing.png"), @"
    1
    error: a.png: the image is damaged or cut off: unexpected end of file; export the image again
    ");
    insta::assert_snapshot!(failure(&place, "render --environment a.exr"), @"
    1
    error: a.exr: the OpenEXR file is damaged or of an unsupported kind: not supported: too new \
    file feature flags; render or export it again as scan lines with ZIP compression
    ");
}

#[test]
fn the_viewer_refuses_what_it_cannot_serve() {
    let place = Place::new();
    let first = |words: &str| {
        let text = failure(&place, words);
        text.lines().take(2).collect::<Vec<_>>().join(" ")
    };
    assert!(
        first("view cornel-box")
            .starts_with("1 error: cornel-box: neither a file nor a built-in scene")
    );
    assert!(first("view --fps 0").starts_with("2 error: --fps 0: from 1 to 240"));
    assert!(
        first("view --token short")
            .starts_with("2 error: invalid value 'short' for '--token <TOKEN>'")
    );
    assert!(
        first("view cornell-box -- --spp none")
            .starts_with("2 error: invalid value 'none' for '--spp <N>'")
    );
}
