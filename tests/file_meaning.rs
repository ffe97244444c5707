//! What scene files of other renderers mean: small files, and the radiance that the renderer they
//! are written for, or a closed form, gives for them.

use snell_formats::{ReadOptions, read_scene_bytes};
use snell_render::{
    CompiledScene, Filter, IntegratorKind, LightStrategy, Request, Settings, reference,
};
use snell_scene::Scene;
use snell_tests::{colors, render, settings};

/// A scene file with pictures beside it: `quarters.pfm` is red, green, blue and white, and
/// `green.pfm` a normal map that leans towards its green.
fn read(name: &str, text: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).expect("written");
    };
    // The rows of PFM run upwards.
    let quarters: [f32; 12] = [0., 0., 1., 1., 1., 1., 1., 0., 0., 0., 1., 0.];
    write("quarters.pfm", &pfm(2, &quarters));
    write("green.pfm", &pfm(1, &GREEN));
    let square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0 0 1\n";
    let faces = "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n";
    let coordinates = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    write("obj.obj", format!("{square}{coordinates}{faces}").as_bytes());
    let coordinates = "vt 1 0\nvt 0 0\nvt 0 1\nvt 1 1\n";
    write("bare.obj", b"v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3\nf 1 3 4\n");
    write("mirrored.obj", format!("{square}{coordinates}{faces}").as_bytes());
    read_scene_bytes(name, text.into(), folder.path(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"))
}

/// The colour of a texel whose normal is 0.6 along green and 0.8 along the surface's normal.
const GREEN: [f32; 3] = [0.5, 0.8, 0.9];

fn pfm(size: usize, values: &[f32]) -> Vec<u8> {
    let mut file = format!("PF\n{size} {size}\n-1.0\n").into_bytes();
    file.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    file
}

/// The pixels of a picture of direct light, one ray through the middle of each.
fn picture(scene: &Scene, size: [u32; 2], spp: u32) -> Vec<[f64; 3]> {
    let settings = Settings {
        size,
        spp,
        integrator: IntegratorKind::Direct,
        filter: Filter::Box,
        pixel_position: Some([0.5, 0.5]),
        ..Settings::default()
    };
    colors(&render(scene, &scene.cameras[0], &settings).image())
}

fn mitsuba(camera: &str, size: [u32; 2], body: &str) -> Scene {
    let [w, h] = size;
    read(
        "scene.xml",
        &format!(
            "<scene version='3.0.0'><sensor type='perspective'>\
            <transform name='to_world'>\
            <lookat origin='0,0,5' target='0,0,0' up='0,1,0'/></transform>{camera}\
            <film type='hdrfilm'><integer name='width' value='{w}'/>\
            <integer name='height' value='{h}'/></film></sensor>{body}</scene>"
        ),
    )
}

const FOV: &str = "<float name='fov' value='30'/>";

/// The quarters as the radiance of an emitter.
const SHOWN: &str = "<emitter type='area'><texture name='radiance' type='bitmap'>\
    <string name='filename' value='quarters.pfm'/><boolean name='raw' value='true'/>\
    <string name='filter_type' value='nearest'/></texture></emitter>";

/// One letter for each pixel.
fn letters(pixels: &[[f64; 3]]) -> String {
    let letter = |[r, g, b]: &[f64; 3]| match [*r > 0.5, *g > 0.5, *b > 0.5] {
        [true, false, false] => 'r',
        [false, true, false] => 'g',
        [false, false, true] => 'b',
        [true, true, true] => 'w',
        _ => '.',
    };
    pixels.iter().map(letter).collect()
}

#[test]
fn pictures_on_mitsuba_emitters_lie_as_in_mitsuba() {
    // Rays through the middles of pixels in Mitsuba 3.9.1.
    let disk = [
        "........", "..gggg..", ".gggggg.", ".ggrrgg.", ".wwbbww.", ".wwwwww.", "..wwww..",
        "........",
    ];
    let cases = [
        ("rectangle", 22, "bbwwbbwwrrggrrgg".into()),
        ("sphere", 22, "rrgg".into()),
        ("disk", 30, disk.concat()),
    ];
    for (shape, fov, expected) in cases {
        let size = [expected.len().isqrt() as u32; 2];
        let camera = format!("<float name='fov' value='{fov}'/>");
        let scene = mitsuba(&camera, size, &format!("<shape type='{shape}'>{SHOWN}</shape>"));
        assert_eq!(letters(&picture(&scene, size, 1)), expected, "{shape}");
    }
}

#[test]
fn the_principal_point_of_mitsuba_moves_the_picture_left_and_up() {
    // 0.2 of ten pixels are two.
    let shape = format!("<shape type='rectangle'>{SHOWN}</shape>");
    let shown = |offset: &str| {
        let scene = mitsuba(&format!("{FOV}{offset}"), [10; 2], &shape);
        letters(&picture(&scene, [10; 2], 1))
    };
    let plain = shown("");
    let moved = shown(
        "<float name='principal_point_offset_x' value='0.2'/>\
        <float name='principal_point_offset_y' value='0.1'/>",
    );
    let row = |text: &str, y: usize| text[y * 10..][..10].to_string();
    for y in 1..7 {
        assert_eq!(row(&moved, y)[..8], row(&plain, y + 1)[2..], "row {y}");
    }
    assert!(plain.contains('r') && row(&plain, 0) != row(&plain, 2));
}

#[test]
fn a_number_as_the_spectrum_of_a_mitsuba_emitter_is_light_of_equal_energy() {
    // Mitsuba 3.9.1, scalar_rgb; the linear Rec. 709 colour of illuminant E is 1.2048, 0.9483,
    // 0.9087.
    for (value, expected) in [
        ("<spectrum name='radiance' value='2'/>", [2.4096, 1.8966, 1.8178]),
        ("<spectrum name='radiance' value='360:2,830:2'/>", [2.4098, 1.8965, 1.8185]),
        ("<rgb name='radiance' value='2'/>", [2.0; 3]),
        ("<float name='radiance' value='2'/>", [2.0; 3]),
    ] {
        for emitter in ["constant", "area"] {
            let emitter = format!("<emitter type='{emitter}'>{value}</emitter>");
            let lamp = format!("<shape type='sphere'>{emitter}</shape>");
            let body = if emitter.contains("area") { lamp } else { emitter };
            let pixel = picture(&mitsuba(FOV, [1; 2], &body), [1; 2], 1)[0];
            let differs = |c: usize| (pixel[c] - expected[c]).abs() > 0.003 * expected[c];
            assert!(!(0..3).any(differs), "{body}: {pixel:?} is not {expected:?}");
        }
    }
}

#[test]
fn a_projector_of_mitsuba_lights_a_wall_evenly() {
    // Radiance 0.8 / pi times an irradiance of 2 pi / 5^2 (projector.cpp, sample_direction).
    let wall = "<shape type='rectangle'><transform name='to_world'><scale value='5'/></transform>\
        <bsdf type='diffuse'><rgb name='reflectance' value='0.8'/></bsdf></shape>";
    let lit = |irradiance: &str| {
        let projector = format!(
            "<emitter type='projector'><transform name='to_world'>\
            <lookat origin='0,0,5' target='0,0,0' up='0,1,0'/></transform>\
            <float name='scale' value='2'/>\
            <float name='fov' value='60'/>{irradiance}</emitter>{wall}"
        );
        let camera = "<float name='fov' value='56'/>";
        picture(&mitsuba(camera, [6; 2], &projector), [6; 2], 1)
    };
    for irradiance in ["", "<rgb name='irradiance' value='1'/>"] {
        for pixel in lit(irradiance) {
            assert!(pixel.iter().all(|x| (x - 0.064).abs() < 1e-4), "{pixel:?}");
        }
    }
    let texture = SHOWN.replace("radiance", "irradiance");
    let texture = texture.split_once('>').expect("a tag").1.replace("</emitter>", "");
    let quarters = lit(&texture).iter().map(|p| p.map(|x| x / 0.064)).collect::<Vec<_>>();
    assert_eq!(letters(&quarters), "rrrggg".repeat(3) + &"bbbwww".repeat(3));
    assert!(quarters[0][0] > 0.99 && quarters[0][0] < 1.01);
}

/// The radiance of a surface of albedo 0.8 whose normal map leans towards `green`, a world
/// direction, lit from the side of `green`.
fn leaning(n: [f64; 3], green: [f64; 3]) -> (String, f64) {
    let light = [0, 1, 2].map(|i| -(n[i] + 0.5 * green[i]));
    let length = light.map(|x| x * x).iter().sum::<f64>().sqrt();
    let bent = [0, 1, 2].map(|i| 0.6 * green[i] + 0.8 * n[i]);
    let cosine = -(0..3).map(|i| light[i] * bent[i]).sum::<f64>() / length;
    let [x, y, z] = light.map(|x| x / length);
    (format!("{x} {y} {z}"), 0.8 / std::f64::consts::PI * 3.0 * cosine)
}

#[test]
fn green_of_mitsuba_normal_maps_is_the_normal_times_u() {
    // The green axes of Mitsuba 3.9.1, found from its BSDF at the point that is seen: upright,
    // and mirrored in x. With flip_normals they are opposite.
    let (y, down) = ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]);
    let (out, along) = ([0.3, 0.2, 0.932738], [-0.776085, -0.517390, 0.360555]);
    let cases = [
        ("sphere", "", out, along, along),
        ("rectangle", "", [0.0, 0.0, 1.0], y, down),
        ("disk", "", [0.0, 0.0, 1.0], [-0.5547, 0.83205, 0.0], [-0.5547, 0.83205, 0.0]),
        ("cube", "", [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]),
        ("obj", "", [0.0, 0.0, 1.0], y, down),
        ("obj", "<boolean name='flip_tex_coords' value='false'/>", [0.0, 0.0, 1.0], y, down),
        ("mirrored", "", [0.0, 0.0, 1.0], down, y),
        (
            "cylinder",
            "<point name='p0' value='0 -1 0'/><point name='p1' value='0 1 0'/>",
            [0.0, 0.0, 1.0],
            y,
            down,
        ),
    ];
    for (kind, more, n, upright, mirrored) in cases {
        for (scale, flip, green) in [
            ("1,1,1", false, upright),
            ("-1,1,1", false, mirrored),
            ("1,1,1", true, upright.map(|x: f64| -x)),
            ("-1,1,1", true, mirrored.map(|x: f64| -x)),
        ] {
            let more = format!("{more}<boolean name='flip_normals' value='{flip}'/>");
            let (light, expected) = leaning(n, green);
            let file = if ["sphere", "rectangle", "disk", "cube", "cylinder"].contains(&kind) {
                String::new()
            } else {
                format!("<string name='filename' value='{kind}.obj'/>")
            };
            let class = if file.is_empty() { kind } else { "obj" };
            let body = format!(
                "<shape type='{class}'>{file}{more}<transform name='to_world'>\
                <scale value='{scale}'/></transform>\
                <bsdf type='twosided'><bsdf type='normalmap'>\
                <texture name='normalmap' type='bitmap'>\
                <string name='filename' value='green.pfm'/><boolean name='raw' value='true'/>\
                </texture>\
                <bsdf type='diffuse'><rgb name='reflectance' value='0.8'/></bsdf></bsdf>\
                </bsdf></shape>\
                <emitter type='directional'><vector name='direction' value='{light}'/>\
                <rgb name='irradiance' value='3'/></emitter>"
            );
            let scene = mitsuba("<float name='fov' value='1e-3'/>", [1; 2], &body);
            // Along an edge of the cylinder's tessellation.
            let scene = aimed(scene, if kind == "cylinder" { 0.0 } else { 0.3 });
            let found = picture(&scene, [1; 2], 1)[0][0];
            assert!(
                (found - expected).abs() < 1e-3,
                "{kind} {more} {scale}: {found}, not {expected}"
            );
        }
    }
}

/// The scene seen from above the point (x, 0.2).
fn aimed(mut scene: Scene, x: f64) -> Scene {
    scene.cameras[0].eye = snell_math::DVec3::new(x, 0.2, 5.0);
    scene
}

#[test]
fn a_file_whose_lamps_are_all_off_is_dark() {
    let pbrt = |lamp: &str| {
        format!(
            "LookAt 0 0 5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 20 WorldBegin \
            Shape \"sphere\" \"float radius\" 2 {lamp} Shape \"sphere\""
        )
    };
    let xml = |emitter: &str| {
        format!(
            "<scene version='3.0.0'><shape type='sphere'>{emitter}</shape>\
            <shape type='sphere'><float name='radius' value='2'/></shape></scene>"
        )
    };
    let gltf = |emission: &str| {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}],
            "nodes": [{{"mesh": 0}}], "materials": [{{{emission}}}], "meshes": [{{"primitives": [
            {{"attributes": {{"POSITION": 0}}, "material": 0}}]}}],
            "accessors": [{{"componentType": 5126, "count": 3, "type": "VEC3"}}]}}"#
        )
    };
    let off = "\"emissiveFactor\": [1, 1, 1], \"extensions\": \
        {\"KHR_materials_emissive_strength\": {\"emissiveStrength\": 0}}";
    for (name, text, is_dark) in [
        ("a.pbrt", pbrt("AreaLightSource \"diffuse\" \"rgb L\" [0 0 0]"), true),
        ("a.pbrt", pbrt(""), false),
        ("a.xml", xml("<emitter type='area'><rgb name='radiance' value='0'/></emitter>"), true),
        ("a.xml", xml(""), false),
        ("a.gltf", gltf(off), true),
        ("a.gltf", gltf("\"emissiveFactor\": [0, 0, 0]"), false),
    ] {
        let mut scene = read(name, &text);
        snell_scene::framing::prepare(&mut scene, &Default::default()).expect("no cycles");
        let pixels = picture(&scene, [4; 2], 1);
        let sum: f64 = pixels.iter().flatten().sum();
        assert_eq!(sum == 0.0, is_dark, "{text}: {sum}");
    }
}

#[test]
fn a_lamp_of_pbrt_with_alpha_0_lights_and_is_not_seen() {
    // F3 of the reports: a sphere of radiance 10 and radius 0.5 at (3, 0, 2) above a white plane
    // gives the irradiance L pi r^2 z / d^3 below it.
    let text = |alpha: &str| {
        format!(
            "LookAt 0 0 5  0 0 0  0 1 0 Camera \"perspective\" \"float fov\" 120 WorldBegin \
            AttributeBegin Translate -3 0 2 AreaLightSource \"diffuse\" \"rgb L\" [10 10 10] \
            Shape \"sphere\" \"float radius\" .5 {alpha} AttributeEnd \
            Material \"diffuse\" \"rgb reflectance\" [1 1 1] Shape \"trianglemesh\" \"point3 P\" \
            [-9 -9 0  9 -9 0  9 9 0 -9 9 0] \"integer indices\" [0 1 2 0 2 3]"
        )
    };
    const SIZE: usize = 33;
    let shown = |alpha: &str| {
        let scene = read("lamp.pbrt", &text(alpha));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        picture(&scene, [SIZE as u32; 2], 64)
    };
    let (hidden, seen) = (shown("\"float alpha\" 0"), shown(""));
    let middle = hidden[SIZE * SIZE / 2][0];
    let expected = 10.0 * 0.25 * 2.0 / 13f64.powf(1.5);
    assert!((middle / expected - 1.0).abs() < 0.02, "{middle} is not {expected}");
    assert!(seen.iter().any(|p| p[0] > 9.9), "the other lamp is seen");
    assert!(hidden.iter().all(|p| p[0] < 5.0), "the lamp is not seen");
}

#[test]
fn green_of_pbrt_normal_maps_is_the_normal_times_u() {
    // pbrt's NormalMap(): the frame of the shading normal and dpdu, whatever v does. The camera
    // looks along z at a square whose outer side faces it, except in the last case.
    let plain = "[0 0 1 0 1 1 0 1]";
    let mirrored = "[1 0 0 0 0 1 1 1]";
    let (up, down) = ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]);
    for (uv, change, green) in [
        // -z times x.
        (plain, "ReverseOrientation", down),
        (mirrored, "ReverseOrientation", up),
        (plain, "ReverseOrientation Scale -1 1 1", up),
        (mirrored, "ReverseOrientation Scale -1 1 1", down),
        // z times x, seen from behind.
        (plain, "", down),
    ] {
        let (light, expected) = leaning([0.0, 0.0, -1.0], green);
        let text = format!(
            "LookAt 0 0 -5  0 0 0  0 1 0 Camera \"perspective\" \"float fov\" 0.01 WorldBegin \
            LightSource \"distant\" \"rgb L\" [3 3 3] \"point3 from\" [0 0 0] \"point3 to\" \
            [{light}] \
            MakeNamedMaterial \"m\" \"string type\" \"diffuse\" \"rgb reflectance\" [.8 .8 .8] \
            \"string normalmap\" \"green.pfm\" NamedMaterial \"m\" {change} \
            Shape \"trianglemesh\" \"point3 P\" [-1 -1 0  1 -1 0  1 1 0 -1 1 0] \
            \"point2 uv\" {uv} \"integer indices\" [0 1 2 0 2 3]"
        );
        let found = picture(&read("n.pbrt", &text), [1; 2], 1)[0][0];
        assert!((found - expected).abs() < 1e-3, "{uv} {change}: {found}, not {expected}");
    }
}

#[test]
fn cropped_films_show_a_part_of_the_picture() {
    let shape = format!("<shape type='rectangle'>{SHOWN}</shape>");
    let square = "AreaLightSource \"diffuse\" \"string filename\" \"quarters.pfm\" \
        Shape \"trianglemesh\" \"point3 P\" [-1 -1 0  1 -1 0  1 1 0 -1 1 0] \
        \"point2 uv\" [0 0 1 0 1 1 0 1] \"integer indices\" [0 1 2 0 2 3]";
    for (kind, angle) in [("perspective", 40), ("orthographic", 40)] {
        let mitsuba = |crop: &str, size: [u32; 2]| {
            let camera = format!("<float name='fov' value='{angle}'/>");
            let text = |scene: &str| scene.replace("perspective", kind);
            let film = format!("<integer name='height' value='12'/>{crop}");
            let scene = format!(
                "<scene version='3.0.0'><sensor type='perspective'>\
                <transform name='to_world'><scale value='1.5'/>\
                <lookat origin='0,0,5' target='0,0,0' up='0,1,0'/></transform>{camera}\
                <film type='hdrfilm'><integer name='width' value='20'/>{film}</film>\
                </sensor>{shape}</scene>"
            );
            let scene = read("a.xml", &text(&scene));
            assert_eq!(scene.settings.size, Some(size));
            letters(&picture(&scene, size, 1))
        };
        let pbrt = |crop: &str, size: [u32; 2]| {
            let lens = if kind == "perspective" { "\"float fov\" 40" } else { "" };
            let scene = read(
                "a.pbrt",
                &format!(
                    "Scale -1 1 1 LookAt 0 0 5  0 0 0  0 1 0 Camera \"{kind}\" {lens} Film \"rgb\" \
                    \"integer xresolution\" 20 \"integer yresolution\" 12 {crop} WorldBegin \
                    {square}"
                ),
            );
            assert_eq!(scene.settings.size, Some(size));
            letters(&picture(&scene, size, 1))
        };
        let part = |whole: &str, [x, y]: [usize; 2], [w, h]: [usize; 2]| -> String {
            (y..y + h).map(|row| &whole[row * 20 + x..][..w]).collect()
        };
        let whole = mitsuba("", [20, 12]);
        let cropped = mitsuba(
            "<integer name='crop_offset_x' value='7'/><integer name='crop_offset_y' value='4'/>\
            <integer name='crop_width' value='9'/><integer name='crop_height' value='5'/>",
            [9, 5],
        );
        assert_eq!(cropped, part(&whole, [7, 4], [9, 5]), "Mitsuba, {kind}");
        let whole = pbrt("", [20, 12]);
        let expected = part(&whole, [7, 3], [9, 6]);
        for crop in
            ["\"integer pixelbounds\" [7 16 3 9]", "\"float cropwindow\" [0.35 0.8 0.25 0.75]"]
        {
            assert_eq!(pbrt(crop, [9, 6]), expected, "pbrt, {kind}, {crop}");
        }
        assert!(expected.contains('r') && expected.contains('w'), "{kind}: {expected}");
    }
}

#[test]
fn films_of_pbrt_have_their_sensitivity_exposure_time_and_white_balance() {
    // A light of 1, 0.5, 0.25 after 0.5 s at ISO 400, and 2 X adapted by Bradford's method from the
    // white of a black body of 3201.8 K to D65, computed from the CIE's tables.
    for (white, expected) in
        [("", [2.0, 1.0, 0.5]), ("\"float whitebalance\" 3200", [1.19441, 1.15199, 1.46824])]
    {
        let text = format!(
            "Camera \"perspective\" \"float shutterclose\" .5 Film \"rgb\" \"float iso\" 400 \
            {white} WorldBegin LightSource \"infinite\" \"rgb L\" [1 .5 .25]"
        );
        let scene = read("a.pbrt", &text);
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let camera = &scene.cameras[0];
        let request = Request { size: Some([1; 2]), spp: Some(1), ..Request::default() };
        let settings = request.resolve(&scene, camera).expect("valid settings");
        let film = render(&scene, camera, &settings);
        let pixel = colors(&film.image())[0];
        let off = (0..3).map(|c| (pixel[c] / expected[c] - 1.0).abs()).fold(0.0, f64::max);
        assert!(off < 2e-3, "{pixel:?} is not {expected:?}");
        let compiled = CompiledScene::new(&scene, &settings.build).expect("valid");
        let plain = reference::ray_cast(&compiled, camera, &settings)[0];
        assert!((f64::from(plain.g) - pixel[1]).abs() < 1e-5, "{plain:?} is not {pixel:?}");
    }
}

#[test]
fn spherical_cameras_of_pbrt_show_an_equal_area_square() {
    // SphericalCamera::GenerateRay: the middle of the picture is y, the right edge's x, the bottom
    // edge's z, and the corners are -y.
    let ball = |place: &str, color: &str| {
        format!(
            "AttributeBegin Translate {place} AreaLightSource \"diffuse\" \"rgb L\" [{color}] \
            Shape \"sphere\" \"float radius\" .3 AttributeEnd "
        )
    };
    let text = format!(
        "Camera \"spherical\" Film \"rgb\" \"integer xresolution\" 5 \"integer yresolution\" 5 \
        WorldBegin {}{}{}{}",
        ball("0 2 0", "1 1 1"),
        ball("2 0 0", "1 0 0"),
        ball("0 0 2", "0 1 0"),
        ball("0 -2 0", "0 0 1"),
    );
    let scene = read("a.pbrt", &text);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let pixels = letters(&picture(&scene, [81; 2], 1));
    let at = |x: usize, y: usize| &pixels[y * 81 + x..][..1];
    assert_eq!([at(40, 40), at(79, 40), at(40, 79), at(1, 1), at(1, 40)].concat(), "wrgb.");
}

#[test]
fn grids_of_pbrt_fade_over_the_outer_halves_of_their_cells() {
    // SampledGrid::Lookup() of pbrt-v4 interpolates with 0 beyond the grid: the density is 0.5 at
    // its faces and 1 between the middles of its cells, whose distance is 1.
    let text = "LookAt 0 0 5  0 0 0  0 1 0 Camera \"orthographic\" \"float screenwindow\" \
        [-.01 .01 -.01 .01] WorldBegin LightSource \"infinite\" \"rgb L\" [1 1 1] \
        MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"integer ny\" 2 \
        \"integer nz\" 2 \"float density\" [1 1 1 1 1 1 1 1] \"rgb sigma_a\" [1 1 1] \
        \"rgb sigma_s\" [0 0 0] \"point3 p0\" [-1 -1 -1] \"point3 p1\" [1 1 1] \
        MediumInterface \"m\" \"\" Material \"interface\" Shape \"sphere\" \"float radius\" 3";
    let scene = read("a.pbrt", text);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let pixels = picture(&scene, [16; 2], 64);
    let mean = pixels.iter().map(|pixel| pixel[0]).sum::<f64>() / 256.0;
    let expected = (-1.75f64).exp();
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} is not {expected}");
}

/// A white floor of pbrt below infinite lights, seen from above.
fn floor_below(lights: &str) -> Scene {
    let text = format!(
        "LookAt 0 0 5  0 0 0  0 1 0 Camera \"perspective\" \"float fov\" 1 WorldBegin {lights} \
        Material \"diffuse\" \"rgb reflectance\" [1 1 1] Shape \"trianglemesh\" \"point3 P\" \
        [-9 -9 0  9 -9 0  9 9 0 -9 9 0] \"integer indices\" [0 1 2 0 2 3]"
    );
    let scene = read("a.pbrt", &text);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    scene
}

#[test]
fn portals_of_pbrt_show_the_light_behind_them_alone() {
    let light = |what: &str, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2]| {
        format!(
            "LightSource \"infinite\" {what} \"point3 portal\" [{x0} {y0} 2  {x0} {y1} 2  \
            {x1} {y1} 2  {x1} {y0} 2] "
        )
    };
    let (white, picture) = ("\"rgb L\" [1 1 1]", "\"string filename\" \"quarters.pfm\"");
    let whole = |what: &str| light(what, [-1.0, 1.0], [-1.0, 1.0]);
    let halves = |what: &str| {
        light(what, [-1.0, 0.25], [-1.0, 1.0]) + &light(what, [0.25, 1.0], [-1.0, 1.0])
    };
    let mean = |lights: &str, light_strategy: LightStrategy| {
        let scene = floor_below(lights);
        let settings =
            Settings { integrator: IntegratorKind::Direct, light_strategy, ..settings(8, 512) };
        let pixels = colors(&render(&scene, &scene.cameras[0], &settings).image());
        [0, 1, 2].map(|c| pixels.iter().map(|pixel| pixel[c]).sum::<f64>() / pixels.len() as f64)
    };
    // The form factor of a square of side 2 at distance 2 above its middle. In pbrt, light comes
    // from the side of the cross product of the edges to the last and the second corner.
    let corner = 0.5 / 1.25f64.sqrt();
    let form_factor = 4.0 / std::f64::consts::PI * corner * corner.atan();
    for strategy in LightStrategy::ALL {
        for lights in [whole(white), halves(white)] {
            let found = mean(&lights, strategy)[0];
            assert!((found / form_factor - 1.0).abs() < 0.02, "{strategy:?}: {found}");
        }
        let backwards = light(white, [1.0, -1.0], [-1.0, 1.0]);
        assert_eq!(mean(&backwards, strategy), [0.0; 3], "{strategy:?}");
    }
    // The picture as a whole has as much light in all of its estimates.
    let [mis, light, bsdf] = LightStrategy::ALL.map(|strategy| mean(&whole(picture), strategy));
    let halved = mean(&halves(picture), LightStrategy::Mis);
    for c in 0..3 {
        for other in [light[c], bsdf[c], halved[c]] {
            assert!((mis[c] - other).abs() < 0.02 * form_factor, "{mis:?} {light:?} {bsdf:?}");
        }
    }
    assert!(mis.iter().sum::<f64>() > 0.1, "{mis:?}");
    // The textbook renderer sees the same.
    let scene = floor_below(&halves(picture));
    let how = Settings { integrator: IntegratorKind::Direct, ..settings(8, 512) };
    let compiled = CompiledScene::new(&scene, &how.build).expect("valid");
    let plain = reference::ray_cast(&compiled, &scene.cameras[0], &how);
    let red = plain.iter().map(|c| f64::from(c.r)).sum::<f64>() / plain.len() as f64;
    assert!((red - halved[0]).abs() < 1e-4, "{red} is not {}", halved[0]);
}

#[test]
fn both_sides_of_twosided_are_those_of_mitsuba() {
    // Directional light along the view: radiance is albedo / pi times the irradiance of 3.
    for (shape, flip) in [
        ("rectangle", false),
        ("rectangle", true),
        ("disk", false),
        ("cube", true),
        ("sphere", true),
    ] {
        let two = "<bsdf type='twosided'><bsdf type='diffuse'><rgb name='reflectance' value='0.8'/>\
            </bsdf><bsdf type='diffuse'><rgb name='reflectance' value='0.2'/></bsdf></bsdf>";
        let body = format!(
            "<shape type='{shape}'><boolean name='flip_normals' value='{flip}'/>{two}</shape>\
            <emitter type='directional'><vector name='direction' value='0 0 -1'/>\
            <rgb name='irradiance' value='3'/></emitter>"
        );
        let scene = mitsuba("<float name='fov' value='1e-3'/>", [1; 2], &body);
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let found = picture(&scene, [1; 2], 1)[0][0];
        let expected = if flip { 0.2 } else { 0.8 } * 3.0 / std::f64::consts::PI;
        assert!((found - expected).abs() < 1e-3, "{shape} {flip}: {found}, not {expected}");
    }
}

#[test]
fn lamps_of_mitsuba_shine_on_the_side_that_mitsuba_means() {
    // Mitsuba 3.9.1: normals of files are kept by a mirror, those it computes are turned over.
    let flat = "<boolean name='face_normals' value='true'/>";
    for (file, more, scale, flip, shines) in [
        ("obj", "", 1, false, true),
        ("obj", "", -1, false, true),
        ("obj", "", -1, true, false),
        ("obj", flat, -1, false, false),
        ("obj", flat, -1, true, true),
        ("bare", "", 1, false, true),
        ("bare", "", 1, true, false),
        ("bare", "", -1, false, false),
        ("bare", "", -1, true, true),
    ] {
        let body = format!(
            "<shape type='obj'><string name='filename' value='{file}.obj'/>{more}\
            <boolean name='flip_normals' value='{flip}'/><transform name='to_world'>\
            <scale x='{scale}' y='1' z='1'/></transform><emitter type='area'/></shape>"
        );
        let found = picture(&mitsuba(FOV, [1; 2], &body), [1; 2], 1)[0][0];
        assert_eq!(found > 0.5, shines, "{file} {more} {scale} {flip}");
    }
}

#[test]
fn hidden_emitters_of_mitsuba_are_seen_in_mirrors_only_and_cast_shadows() {
    // The middle of the picture in Mitsuba 3.9.1, where a lamp stands before a mirror or a grey
    // wall, and the corner, where the ray leaves the scene.
    let mirror = "<bsdf type='conductor'><string name='material' value='none'/></bsdf>";
    for (hides, wall, middle, corner) in [
        (false, mirror, 10.0, 0.5),
        (true, mirror, 10.0, 0.0),
        (false, "<bsdf type='diffuse'/>", 10.0, 0.5),
        (true, "<bsdf type='diffuse'/>", 0.357, 0.0),
    ] {
        let body = format!(
            "<integrator type='path'><boolean name='hide_emitters' value='{hides}'/></integrator>\
            <shape type='sphere'><point name='center' value='0 0 2'/><float name='radius' \
            value='0.3'/><emitter type='area'><rgb name='radiance' value='10'/></emitter></shape>\
            <shape type='rectangle'>{wall}</shape><emitter type='constant'><rgb name='radiance' \
            value='0.5'/></emitter>"
        );
        let scene = mitsuba(FOV, [9; 2], &body);
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let (camera, how) = (&scene.cameras[0], Settings { size: [9; 2], ..settings(9, 1024) });
        let pixels = colors(&render(&scene, camera, &how).image());
        assert!((pixels[40][0] / middle - 1.0).abs() < 0.02, "{hides} {wall}: {}", pixels[40][0]);
        assert!((pixels[0][0] - corner).abs() < 1e-6, "{hides} {wall}: {}", pixels[0][0]);
        let compiled = CompiledScene::new(&scene, &how.build).expect("valid");
        let plain = reference::ray_cast(&compiled, camera, &how)[40];
        assert!((f64::from(plain.r) / middle - 1.0).abs() < 0.02, "{hides} {wall}: {plain:?}");
    }
}
