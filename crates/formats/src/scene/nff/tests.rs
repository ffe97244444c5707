use super::*;
use crate::scene::testing::{self, data, error_of, files, geometries, meshes, read_text, summary};
use snell_intersect::Shape;
use snell_math::{DRay, Transform};
use snell_scene::light::Point;
use snell_scene::material::{MaterialKind, Phong};
use snell_scene::{Background, Geometry, Light, Projection};
use std::path::Path;

const VIEW: &str = "v\nfrom 0 0 8\nat 0 0 0\nup 0 1 1\nangle 90\nhither 1\nresolution 512 256\n";

fn scene(text: &str) -> Scene {
    read_text(&READER, text).expect("the scene is well-formed")
}

fn phong(scene: &Scene, id: usize) -> &Phong {
    match &scene.materials[id].kind {
        MaterialKind::Phong(phong) => phong,
        other => panic!("expected a Phong material, found {}", other.name()),
    }
}

#[test]
fn every_public_database_loads_with_all_it_holds() {
    let Some(folder) = data("nff") else { return };
    let mut lines = Vec::new();
    for file in files(&folder, "nff") {
        let scene = crate::read_scene(&file, &Default::default()).unwrap_or_else(|e| panic!("{e}"));
        lines.push(format!("{}: {}", scene.name, summary(&scene)));
    }
    insta::assert_snapshot!(lines.join("\n"), @r#"
    balls-s2: 1 mesh, 91 sphere, 2 triangle, 2 material, lights [point point point], 1 camera, background 0.078 0.361 0.753
    balls: 1 mesh, 7381 sphere, 2 triangle, 2 material, lights [point point point], 1 camera, background 0.078 0.361 0.753
    jacks-s2: 27 cylinder, 54 sphere, 1 material, lights [point], 1 camera, background 0.2 0.05 0.2
    lattice-s3: 144 cylinder, 64 sphere, 4 material, lights [point point point point point point], 1 camera, background 0.078 0.361 0.753
    mount: 1 mesh, 4 sphere, 8192 triangle, 2 material, lights [point], 1 camera, background 0.078 0.361 0.753
    tetra-s2: 1 mesh, 16 triangle, 1 material, lights [point], 1 camera, background 0.078 0.361 0.753
    tetra: 1 mesh, 4096 triangle, 1 material, lights [point], 1 camera, background 0.078 0.361 0.753
    tree-s3: 15 frustum, 1 mesh, 15 sphere, 2 triangle, 2 material, lights [point point point point point point point], 1 camera, background 0.078 0.361 0.753
    tree: 4095 frustum, 1 mesh, 4095 sphere, 2 triangle, 2 material, lights [point point point point point point point], 1 camera, background 0.078 0.361 0.753
    "#);
}

#[test]
fn the_view_is_a_camera_whose_angle_spans_the_centers_of_the_outer_rows() {
    let scene = scene(VIEW);
    let camera = &scene.cameras[0];
    assert_eq!((camera.eye, camera.towards, camera.up), (DVec3::Z * 8.0, DVec3::NEG_Z, DVec3::Y));
    assert_eq!((camera.resolution, scene.settings.size), (Some([512, 256]), Some([512, 256])));
    let Projection::Perspective { tan_half_fov: [None, Some(tan)] } = camera.projection else {
        panic!("expected a perspective camera with a vertical angle")
    };
    // The centre of the first row is at 1 - 1 / 256 of the half height.
    assert!((tan * (1.0 - 1.0 / 256.0) - 1.0).abs() < 1e-12, "{tan}");
}

#[test]
fn lights_without_a_color_share_by_the_square_root_and_do_not_fade() {
    let scene = scene("l 1 2 3\nl 4 5 6 .1 .2 .3\nl 0 0 0\nl 0 0 0\n");
    let pi = std::f32::consts::PI;
    let lights: Vec<_> = scene
        .lights
        .iter()
        .map(|l| match l {
            Light::Point(Point { position, intensity, attenuation, .. }) => {
                assert_eq!(attenuation.at(100.0), 1.0);
                (position.x, *intensity)
            }
            other => panic!("expected a point light, found {}", other.name()),
        })
        .collect();
    let default = Rgb::splat(pi / 2.0);
    assert_eq!(
        lights,
        [(1.0, default), (4.0, Rgb::new(0.1, 0.2, 0.3) * pi), (0.0, default), (0.0, default)]
    );
}

#[test]
fn a_fill_is_a_phong_material_and_equal_fills_are_one() {
    let scene = scene(
        "f 1 .5 .25  .5 .25 30 .125 1.5\ns 0 0 0 1\nf 1 1 1 1 0 1 0 0\ns 0 0 0 1\nf 1 .5 .25  .5 \
            .25 30 .125 1.5\ns 0 0 0 1",
    );
    assert_eq!(scene.materials.len(), 2);
    let fill = phong(&scene, 0);
    assert_eq!(fill.diffuse.factor, Rgb::new(0.5, 0.25, 0.125));
    assert_eq!(fill.specular.factor, Rgb::new(0.25, 0.125, 0.0625));
    assert_eq!((fill.reflection, fill.transmission.factor), (fill.specular, Rgb::splat(0.125)));
    assert_eq!((fill.shininess, fill.ior), (30.0, 1.5));
    assert_eq!(phong(&scene, 1).ior, 1.0, "an index of 0 means none");
}

#[test]
fn cones_and_cylinders_stand_between_their_ends_without_caps() {
    for (text, name) in [("c 1 2 3 .5  1 2 7 .25", "frustum"), ("c 1 2 3 .5 1 2 7 .5", "cylinder")]
    {
        let scene = scene(text);
        let node = &scene.nodes[1];
        let Geometry::Shape(shape) = &node.surfaces[0].geometry else { panic!("expected a shape") };
        assert_eq!(shape.name(), name);
        let object_from_world = Transform::new(node.transform).expect("not singular").inverse();
        let meets = |origin: [f64; 3], direction: DVec3| {
            let origin = DVec3::from_array(origin);
            let ray = DRay { origin, direction, t_min: 0.0, t_max: f64::INFINITY };
            shape.closest(&object_from_world.ray(&ray)).map(|hit| hit.t)
        };
        assert!(meets([1.0, 2.0, 0.0], DVec3::Z).is_none(), "open at both ends");
        // Close to the base the radius is that of the base.
        let near_base = meets([11.0, 2.0, 3.0 + 1e-9], DVec3::NEG_X).expect("a hit near the base");
        assert!((near_base - 9.5).abs() < 1e-6, "{near_base}");
        let near_apex = meets([11.0, 2.0, 7.0 - 1e-9], DVec3::NEG_X).expect("a hit near the apex");
        let radius = if name == "cylinder" { 0.5 } else { 0.25 };
        assert!((near_apex - (10.0 - radius)).abs() < 1e-6, "{near_apex}");
        assert!(meets([11.0, 2.0, 7.1], DVec3::NEG_X).is_none(), "it ends at the apex");
    }
}

#[test]
fn polygons_of_a_fill_become_one_mesh_and_concave_ones_are_cut_inside() {
    let arrow = "p 4  0 0 0  2 -1 0  0 2 0  -2 -1 0\n";
    let fill = "f 1 1 1 1 0 1 0 0\n";
    let scene =
        scene(&format!("{fill}{arrow}f 1 0 0 1 0 1 0 0\n{arrow}{fill}p 3 0 0 1  1 0 1  0 1 1\n"));
    let meshes = meshes(&scene);
    assert_eq!(meshes.iter().map(|m| m.indices.len()).collect::<Vec<_>>(), [3, 2]);
    let area: f32 = (0..2)
        .map(|i| {
            let [a, b, c] = meshes[1].corners(i);
            (b - a).cross(c - a).length() / 2.0
        })
        .sum();
    assert!((area - 4.0).abs() < 1e-6, "{area}");
}

#[test]
fn patches_keep_their_normals_and_zero_ones_become_the_face_normal() {
    let scene = scene("pp 3  0 0 0 0 0 2  1 0 0 0 1 0  0 1 0 0 0 0\np 3 0 0 0 1 0 0 0 1 0");
    let meshes = meshes(&scene);
    assert_eq!(meshes.len(), 2);
    assert!(meshes[0].normals.is_empty());
    assert_eq!(
        meshes[1].normals.iter().map(|n| n.to_array()).collect::<Vec<_>>(),
        [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    );
}

#[test]
fn what_assimp_adds_is_left_out_with_a_warning() {
    let scene = scene(
        "tess 4\nf 1 .5 .25 .5 .25 30 0 1 earth.jpg\ns 0 0 0 1\nf 1 .5 .25 .5 .25 30 0 1 s 1 0 0 \
            1\ndod 0 0 0 5\nhex 0 0 0 5 10 20\nshader moon.png\ns 2 0 0 1\n",
    );
    assert_eq!((geometries(&scene).len(), scene.materials.len()), (3, 1));
    let said: Vec<_> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    assert_eq!(
        said,
        [
            "`tess` of Assimp was ignored: spheres and cones are exact",
            "the picture \"earth.jpg\" of a fill is left out: the fill has its colour alone",
            "`dod` of Assimp is left out",
            "`hex` of Assimp is left out",
            "the picture \"moon.png\" of a fill is left out: the fill has its colour alone",
        ]
    );
    let error = error_of(&READER, "f 1 1 1 1 0 1 0 0\nearth.jpg");
    assert!(error.contains("unknown entity \"earth.jpg\""), "{error}");
}

#[test]
fn comments_may_stand_anywhere() {
    let scene = scene("# all\nb .1 # red\n.2 .3#blue\ns 0 0 0 1");
    assert_eq!(scene.background, Background::Color(Rgb::new(0.1, 0.2, 0.3)));
    assert_eq!(geometries(&scene).len(), 1);
}

#[test]
fn what_is_not_there_is_not_drawn() {
    let scene =
        scene("f 1 1 1 1 0 1 0 0\ns 0 0 0 0\nc 0 0 0 1 0 0 0 1\nc 0 0 0 0 1 1 1 0\ns 0 0 0 -2");
    assert_eq!(geometries(&scene).len(), 1, "the sphere seen from inside is there");
    assert_eq!(scene.warnings.iter().map(|w| w.count).collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn errors_name_the_place_and_the_way_out() {
    let errors = [
        "x 1 2 3",
        "s 1 2 3",
        "s 1 2 3 4 5",
        "p 2 0 0 0 1 1 1",
        "p 999999999999 0 0 0 1 1 1 2 2 2",
        "p 3 0 0 0\n1 1\ns 0 0 0 1",
        "v\nat 0 0 0",
        "v from 0 0 0 at 0 0 0 up 0 0 1 angle 45 hither 1 resolution 5 5",
        "v from 0 0 0 at 0 0 1 up 0 1 0 angle 200 hither 1 resolution 5 5",
        "v from 0 0 0 at 0 0 1 up 0 1 0 angle 20 hither 1 resolution 5 -5",
        "c 0 0 0 1 1 1 1 -1",
    ];
    let messages: Vec<_> = errors.iter().map(|text| error_of(&READER, text)).collect();
    insta::assert_snapshot!(messages.join("\n"), @r#"
    test:1:1: unknown entity "x"; check the number of values of the entity before it; the entities are v, b, l, f, c, s, p, pp
    test:1: the file ends where the radius of the sphere was expected; write it as: s x y z radius
    test:1:11: unknown entity "5"; check the number of values of the entity before it; the entities are v, b, l, f, c, s, p, pp
    test:1:3: a polygon has 2 corners; use at least 3
    test:1: the file ends where a corner of the polygon was expected; write it as: p n, then n times x y z
    test:3:1: found "s", expected a corner of the polygon, a number; write it as: p n, then n times x y z
    test:2:1: found "at", expected `from`; write it as: v from x y z at x y z up x y z angle degrees hither distance resolution width height
    test:1:1: the view looks from a point at the same point; make `from` and `at` differ
    test:1:38: the angle of view is 200 degrees; use an angle above 0 and below 180
    test:1:63: a side of the picture is -5 pixels; use 1 to 65536
    test:1:1: one radius of the cone is negative, the other positive; give both the same sign
    "#);
}

#[test]
fn the_language_is_recognised_by_its_view() {
    for text in [VIEW.to_string(), format!("# c\nb 0 0 0 # c\nl 1 2 3\n{VIEW}")] {
        assert!((READER.recognises)(text.as_bytes()), "{text}");
    }
    for text in ["", "v 1 2 3\nv 4 5 6\nf 1 2 3", "b 1 2 3", "OFF", "camera 0 0 0"] {
        assert!(!(READER.recognises)(text.as_bytes()), "{text}");
    }
}

#[test]
fn broken_files_end_in_errors() {
    let seed = format!(
        "{VIEW}b 0 0 1 # blue\nl 1 2 3\nf 1 1 1 .5 .5 3 0 1\nc 0 0 0 1 1 1 1 .5\ns 0 0 0 1\n\
         p 4 0 0 0 2 -1 0 0 2 0 -2 -1 0\npp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n"
    );
    testing::read_broken_versions(&READER, seed.as_bytes(), Path::new("."));
}
