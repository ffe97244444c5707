//! The effect of directives.

use super::*;
use crate::scene::testing::geometries;
use snell_intersect::{Curves, Shape};
use snell_math::{DVec2, DVec3, Rgb, Vec2, Vec3};
use snell_scene::light::{Directional, Point, Spot, SpotFalloff};
use snell_scene::material::{ConductorSpectrum, HeightUnit, MaterialKind};
use snell_scene::{Environment, Geometry, Light, Material, Projection};

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-4 * b.abs().max(1e-3)
}

fn colors_are(color: Rgb, expected: [f32; 3]) {
    let found = color.to_array();
    assert!(
        found.iter().zip(expected).all(|(a, b)| close(*a, b)),
        "{found:?} instead of {expected:?}"
    );
}

use std::sync::Arc;

/// The only material in use.
fn material(scene: &Scene) -> &Material {
    assert_eq!(scene.materials.len(), 1);
    &scene.materials[0]
}

/// The image position of a point of the file, as fractions of the size from the upper left corner.
fn seen(scene: &Scene, point: DVec3) -> DVec2 {
    let point = scene.nodes[scene.root.index()].transform.transform_point3(point);
    let size = scene.settings.size.expect("the reader sets a size");
    let film = scene.cameras[0].project(point, size).expect("in view");
    film / DVec2::new(f64::from(size[0]), f64::from(size[1]))
}

#[test]
fn pictures_are_not_mirrored() {
    // pbrt's cameras see +x on the right in whatever direction LookAt points; only a transform that
    // mirrors flips them.
    for (text, right) in [
        ("", DVec3::new(0.2, 0.0, 1.0)),
        ("LookAt 0 0 -5  0 0 0  0 1 0", DVec3::new(0.5, 0.0, 0.0)),
        ("Scale -1 1 1 LookAt 0 0 -5  0 0 0  0 1 0", DVec3::new(-0.5, 0.0, 0.0)),
        ("LookAt 0 0 5  0 0 0  0 1 0", DVec3::new(-0.5, 0.0, 0.0)),
    ] {
        let scene = scene(&format!("{text} Camera \"perspective\" WorldBegin"));
        let at = seen(&scene, right + DVec3::Y * 0.1);
        assert!(at.x > 0.51 && at.y < 0.499, "{text}: {at}");
    }
}

#[test]
fn the_field_of_view_spans_the_shorter_side() {
    for (size, top) in
        [([200, 100], DVec3::new(0.0, 1.0, 1.0)), ([100, 200], DVec3::new(1.0, 0.0, 1.0))]
    {
        let text = format!(
            "Film \"rgb\" \"integer xresolution\" {} \"integer yresolution\" [{}] Camera \
                \"perspective\" \"float fov\" 90 WorldBegin",
            size[0], size[1]
        );
        let scene = scene(&text);
        let at = seen(&scene, top);
        assert!(at.x > 0.999 || at.y < 0.001, "{at}");
    }
}

#[test]
fn a_screen_window_cuts_a_part_out_of_the_view() {
    let film = "Film \"rgb\" \"integer xresolution\" 100 \"integer yresolution\" 100";
    let scene = scene(&format!(
        "{film} Camera \"perspective\" \"float screenwindow\" [0 1 -1 0] WorldBegin"
    ));
    assert!((seen(&scene, DVec3::Z) - DVec2::new(0.0, 0.0)).length() < 1e-9);
    assert!((seen(&scene, DVec3::new(1.0, -1.0, 1.0)) - DVec2::ONE).length() < 1e-9);
    assert!(scene.warnings.is_empty());
}

#[test]
fn an_orthographic_camera_is_scaled_by_its_transform() {
    let scene = scene("Scale .5 .5 .5 Camera \"orthographic\" WorldBegin");
    let Projection::Orthographic { half_size } = scene.cameras[0].projection else {
        panic!("not orthographic")
    };
    assert_eq!(half_size, [None, Some(2.0)]);
}

#[test]
fn options_become_settings() {
    let scene = scene(
        "Film \"rgb\" \"integer xresolution\" 320 \"integer yresolution\" 200 \"float iso\" \
            400\nSampler \"halton\" \"integer pixelsamples\" 77\n\
         PixelFilter \"triangle\" \"float xradius\" 1 \"float yradius\" 1\nIntegrator \"volpath\" \
         \"integer maxdepth\" 9\nWorldBegin",
    );
    let settings = &scene.settings;
    assert_eq!(
        (settings.size, settings.spp, settings.max_depth),
        (Some([320, 200]), Some(77), Some(9))
    );
    assert_eq!((settings.filter.as_deref(), settings.imaging_ratio), (Some("tent"), Some(4.0)));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(super::scene("WorldBegin").settings.size, Some([1280, 720]));
    assert_eq!(super::scene("Film \"image\" WorldBegin").settings.size, Some([640, 480]));
}

#[test]
fn films_of_version_3_have_a_factor_and_no_clamp() {
    let text = "Film \"image\" \"float scale\" 8 \"float maxsampleluminance\" 2\nWorldBegin";
    assert_eq!(scene(text).settings.imaging_ratio, Some(8.0));
    assert!(warnings(text).contains("maxsampleluminance"));
}

#[test]
fn sensors_have_their_sensitivity_and_white_balance() {
    let read = |film: &str| {
        let text = format!("Film \"rgb\" {film}\nWorldBegin");
        let settings = scene(&text).settings;
        (settings.imaging_ratio, settings.white_balance, warnings(&text))
    };
    let silent = String::new;
    assert_eq!(read("\"string sensor\" \"cie1931\""), (None, None, silent()));
    assert_eq!(read("\"float whitebalance\" 3200"), (None, Some(3200.0), silent()));
    let (ratio, white, said) = read("\"string sensor\" \"canon_eos_5d\" \"float iso\" 50");
    assert_eq!((ratio, white), (Some(0.5), Some(6500.0)));
    assert!(said.contains("the sensor \"canon_eos_5d\""), "{said}");
    for (film, message) in [
        ("\"float iso\" -100", "multiplies light by -1: the picture is black"),
        ("\"float whitebalance\" 500", "the nearest temperature from 1000 to 25000 K"),
    ] {
        let said = read(film).2;
        assert!(said.contains(message), "{said}");
    }
}

#[test]
fn power_that_is_not_positive_is_ignored_with_a_note() {
    for light in [
        "LightSource \"point\" \"float power\" -3",
        "LightSource \"distant\" \"float illuminance\" -3",
        "AreaLightSource \"diffuse\" \"float power\" -3 Shape \"sphere\"",
    ] {
        let said = warnings(&format!("WorldBegin {light}"));
        assert!(said.contains("-3 of ") && said.contains("was ignored, as in pbrt"), "{said}");
    }
}

#[test]
fn subsurface_scattering_lifts_the_limit_of_bounces() {
    let text = |depth: i32, material: &str| {
        format!(
            "Integrator \"volpath\" \"integer maxdepth\" {depth}\nWorldBegin Material {material} \
            Shape \"sphere\""
        )
    };
    let below = "\"subsurface\" \"rgb mfp\" [.02 .02 .02] \"rgb reflectance\" [.8 .8 .8]";
    let depth = |text: &str| scene(text).settings.max_depth;
    assert_eq!(depth(&text(5, below)), None);
    assert!(warnings(&text(5, below)).contains("\"maxdepth\" 5 was ignored"));
    assert_eq!(depth(&text(0, below)), Some(0), "only what emits");
    assert_eq!(depth(&text(5, "\"diffuse\"")), Some(5));
    assert_eq!(depth(&text(5, "\"diffusetransmission\"")), Some(5), "a thin sheet");
}

#[test]
fn goniometric_lights_take_the_mean_of_their_colours() {
    let folder = tempfile::tempdir().expect("a folder");
    let picture = b"PF\n1 1\n-1.0\n".iter().copied();
    let texel = [6.0f32, 3.0, 0.0].map(f32::to_le_bytes).concat();
    std::fs::write(folder.path().join("g.pfm"), picture.chain(texel).collect::<Vec<_>>())
        .expect("written");
    let intensity = |power: &str| {
        let text =
            format!("WorldBegin LightSource \"goniometric\" \"string filename\" \"g.pfm\" {power}");
        let scene =
            testing::read_in(&READER, folder.path(), &text).unwrap_or_else(|e| panic!("{e}"));
        let Light::Profile(profile) = &scene.lights[0] else { panic!("{:?}", scene.lights) };
        profile.table.at(DVec3::Z) * profile.scale
    };
    colors_are(intensity(""), [3.0; 3]);
    let power = 4.0 * std::f32::consts::PI;
    colors_are(intensity(&format!("\"float power\" {power}")), [1.0; 3]);
}

#[test]
fn power_in_ply_files_is_that_of_each_face() {
    let folder = tempfile::tempdir().expect("a folder");
    let ply = |faces: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n\
            property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
            0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 0\n{faces}"
        )
    };
    let radiance = |faces: &str| {
        std::fs::write(folder.path().join("a.ply"), ply(faces)).expect("written");
        let text = "WorldBegin AreaLightSource \"diffuse\" \"float power\" 1 \
            Shape \"plymesh\" \"string filename\" \"a.ply\"";
        let scene =
            testing::read_in(&READER, folder.path(), text).unwrap_or_else(|e| panic!("{e}"));
        let said: Vec<_> = scene.warnings.iter().map(|w| w.message.clone()).collect();
        (scene.materials[0].emission.factor, said.join("\n"))
    };
    let of_mean = |area: f32| [1.0 / (std::f32::consts::PI * area); 3];
    let (color, said) = radiance("3 0 1 2\n3 0 2 3\n");
    colors_are(color, of_mean(0.5));
    assert_eq!(said, "");
    // A quadrilateral is one light.
    let (color, said) = radiance("4 0 1 2 3\n3 1 4 2\n");
    colors_are(color, of_mean(0.75));
    assert!(said.contains("power\" is that of each bilinear patch"), "{said}");
}

#[test]
fn transforms_apply_in_the_order_of_pbrt() {
    let scene =
        world("Translate 1 0 0 Rotate 90 0 0 1 Scale 2 2 2 Shape \"sphere\" \"float radius\" 0.5");
    let place = scene.nodes[1].transform;
    // The point on the +x side goes to +y by the rotation.
    let sphere_x = place.transform_point3(DVec3::Z * 0.5);
    assert!((sphere_x - DVec3::new(1.0, 1.0, 0.0)).length() < 1e-12, "{sphere_x}");
    let matrix = world("Transform [2 0 0 0  0 2 0 0  0 0 2 0  5 6 7 1] Shape \"disk\"");
    assert_eq!(matrix.nodes[1].transform.translation, DVec3::new(5.0, 6.0, 7.0));
}

#[test]
fn blocks_keep_the_state_and_coordinate_systems_name_it() {
    let scene = world(
        "AttributeBegin Translate 5 0 0 CoordinateSystem \"there\" Material \"diffuse\" \"rgb \
            reflectance\" [1 0 0] AttributeEnd\n\
         Shape \"disk\"\nTransformBegin CoordSysTransform \"there\" Shape \"disk\" \
         TransformEnd\nShape \"disk\"",
    );
    let places: Vec<f64> = scene.nodes[1..].iter().map(|n| n.transform.translation.x).collect();
    assert_eq!(places, [0.0, 5.0, 0.0]);
    colors_are(diffuse(material(&scene)), [0.5; 3]);
}

fn diffuse(material: &Material) -> Rgb {
    match &material.kind {
        MaterialKind::Diffuse(diffuse) => diffuse.reflectance.factor,
        other => panic!("expected a diffuse material, found {}", other.name()),
    }
}

#[test]
fn attribute_sets_defaults_that_shapes_may_override() {
    let scene = world(
        "Attribute \"shape\" \"float radius\" 3\nShape \"sphere\"\nShape \"sphere\" \"float \
            radius\" 1",
    );
    let radii: Vec<_> = testing::geometries(&scene)
        .iter()
        .map(|g| if let Geometry::Shape(shape) = g { shape.bounds().max.x } else { 0.0 })
        .collect();
    assert_eq!(radii, [3.0, 1.0]);
}

#[test]
fn the_outer_side_of_triangles_is_that_of_their_normals() {
    let triangle = "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]";
    let normal = |text: &str| {
        let scene = world(text);
        let mesh = meshes(&scene)[0].clone();
        let [a, b, c] = mesh.corners(0);
        (b - a).cross(c - a).normalize()
    };
    assert_eq!(normal(triangle), Vec3::Z);
    assert_eq!(normal(&format!("ReverseOrientation {triangle}")), Vec3::NEG_Z);
    assert_eq!(normal(&format!("{triangle} \"normal N\" [0 0 -1 0 0 -1 0 0 -1]")), Vec3::NEG_Z);
    assert_eq!(
        normal(&format!("ReverseOrientation {triangle} \"normal N\" [0 0 -1 0 0 -1 0 0 -1]")),
        Vec3::Z
    );
}

#[test]
fn texture_coordinates_grow_downwards_on_meshes_as_on_shapes() {
    let scene = world(
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"point2 uv\" [0 0 1 0 0 1]",
    );
    assert_eq!(meshes(&scene)[0].uvs[0], [Vec2::Y, Vec2::ONE, Vec2::ZERO]);
}

#[test]
fn parts_of_quadrics_are_made_of_triangles() {
    let area = |text: &str| {
        let scene = world(text);
        let mesh = meshes(&scene)[0].clone();
        let area = |t| {
            let [a, b, c] = mesh.corners(t);
            0.5 * (b - a).cross(c - a).length()
        };
        assert!(mesh.indices.iter().enumerate().all(|(t, i)| {
            let [a, b, c] = mesh.corners(t);
            let normal = (b - a).cross(c - a);
            normal.length() < 1e-9
                || normal.dot(i.iter().map(|&i| mesh.normals[i as usize]).sum()) > 0.0
        }));
        (0..mesh.indices.len()).map(area).sum::<f32>()
    };
    use std::f32::consts::PI;
    for (text, expected) in [
        ("Shape \"sphere\" \"float phimax\" 180", 2.0 * PI),
        ("Shape \"sphere\" \"float zmin\" 0", 2.0 * PI),
        ("ReverseOrientation Shape \"sphere\"", 4.0 * PI),
        (
            "Shape \"cylinder\" \"float phimax\" 90 \"float zmin\" 0 \"float zmax\" 3",
            0.5 * PI * 3.0,
        ),
        (
            "Shape \"disk\" \"float phimax\" 90 \"float radius\" 2 \"float innerradius\" 1",
            0.25 * PI * 3.0,
        ),
    ] {
        let found = area(text);
        // The normals of a reversed sphere point inwards.
        assert!((found / expected - 1.0).abs() < 1e-3, "{text}: {found} instead of {expected}");
    }
}

#[test]
fn a_bilinear_patch_is_two_triangles_if_flat_and_more_if_not() {
    let patch =
        |z: f32| world(&format!("Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 {z}]"));
    assert_eq!(meshes(&patch(0.0))[0].indices.len(), 2);
    let bent = patch(1.0);
    let mesh = &meshes(&bent)[0];
    assert_eq!((mesh.indices.len(), mesh.normals.len()), (128, 81));
    assert_eq!(mesh.positions[40], Vec3::new(0.5, 0.5, 0.25));
}

/// The curves of a scene.
fn curves(scene: &Scene) -> Vec<Arc<Curves>> {
    let curves = |g| if let Geometry::Curves(curves) = g { Some(curves) } else { None };
    geometries(scene).into_iter().filter_map(curves).collect()
}

#[test]
fn curves_go_through_their_ends() {
    for (text, ends) in [
        ("\"point3 P\" [0 0 0 1 0 0 1 1 0 2 2 2]", [Vec3::ZERO, Vec3::splat(2.0)]),
        (
            "\"integer degree\" 2 \"point3 P\" [0 0 0 1 0 0 1 1 0]",
            [Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)],
        ),
        (
            "\"string basis\" \"bspline\" \"point3 P\" [0 0 0 3 0 0 6 0 0 9 0 0]",
            [Vec3::new(3.0, 0.0, 0.0), Vec3::new(6.0, 0.0, 0.0)],
        ),
        (
            "\"string basis\" \"bspline\" \"integer degree\" 2 \"point3 P\" [0 0 0 2 0 0 2 4 0 0 4 \
                0]",
            [Vec3::new(1.0, 0.0, 0.0), Vec3::new(1.0, 4.0, 0.0)],
        ),
    ] {
        for kind in ["flat", "cylinder"] {
            let kind =
                format!("\"string type\" \"{kind}\" \"float width0\" 0.2 \"float width1\" 0.1");
            let scene = scene(&format!("WorldBegin Shape \"curve\" {kind} {text}"));
            let points = curves(&scene)[0].points().to_vec();
            let [first, last] = [points[0], points[points.len() - 1]];
            assert_eq!([first, last].map(|p| p.truncate()), ends, "{text}");
            assert_eq!([first.w, last.w], [0.1, 0.05]);
        }
    }
}

#[test]
fn cubic_b_splines_become_the_bezier_curves_they_are() {
    let scene = scene(
        "WorldBegin Shape \"curve\" \"string basis\" \"bspline\" \"point3 P\" [0 0 0 6 0 0 6 6 0 0 \
            6 6 0 0 6]",
    );
    let curves = &curves(&scene)[0];
    // The ends have the weights 1, 4, 1 over 6; the inner points divide the inner sides in thirds.
    let expected: [[f32; 3]; 7] = [
        [5.0, 1.0, 0.0],
        [6.0, 2.0, 0.0],
        [6.0, 4.0, 0.0],
        [5.0, 5.0, 1.0],
        [4.0, 6.0, 2.0],
        [2.0, 6.0, 4.0],
        [1.0, 5.0, 5.0],
    ];
    for (point, expected) in curves.points().iter().zip(expected) {
        assert!(
            (point.truncate() - Vec3::from(expected)).length() < 1e-5,
            "{point}, not {expected:?}"
        );
    }
    assert_eq!((curves.strands(), curves.points().len()), (&[7][..], 7));
}

#[test]
fn curves_of_one_place_and_material_are_one_object_and_ribbons_are_triangles() {
    let curve = "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 1 1 0 2 2 2]";
    let ribbon = format!("{curve} \"string type\" \"ribbon\" \"normal N\" [0 0 1 0 0 1]");
    let scene = scene(&format!(
        "WorldBegin Material \"diffuse\" {curve} {curve} {ribbon} {curve} Material \"dielectric\" \
            {curve} Translate 1 0 0 {curve}"
    ));
    let strands: Vec<_> = curves(&scene).iter().map(|c| c.strands().len()).collect();
    assert_eq!(strands, [3, 1, 1]);
    assert_eq!(meshes(&scene).len(), 1);
    let moved = scene
        .nodes
        .iter()
        .filter(|n| n.surfaces.iter().any(|s| matches!(s.geometry, Geometry::Curves(_))));
    assert_eq!(moved.map(|n| n.transform.translation.x).collect::<Vec<_>>(), [0.0, 1.0]);
}

#[test]
fn objects_are_stored_once() {
    let scene = world(
        "ObjectBegin \"ball\" Translate 0 1 0 Shape \"sphere\" ObjectEnd\nTranslate 5 0 0 \
            ObjectInstance \"ball\"\nTranslate 5 0 0 ObjectInstance \"ball\"",
    );
    let instances: Vec<_> = scene.nodes.iter().filter(|n| n.name == "instance").collect();
    assert_eq!(instances.len(), 2);
    assert_eq!(instances[0].children, instances[1].children);
    // With the default camera, the world is mirrored in x.
    let bounds = scene.bounds().expect("no cycles");
    assert!(
        bounds.min.abs_diff_eq(DVec3::new(-11.0, 0.0, -1.0), 1e-9)
            && bounds.max.abs_diff_eq(DVec3::new(-4.0, 2.0, 1.0), 1e-9)
    );
}

#[test]
fn brightness_means_what_it_means_in_pbrt() {
    let light = |text: &str| world(&format!("LightSource {text}")).lights[0].clone();
    let Light::Point(Point { intensity, .. }) =
        light("\"point\" \"rgb I\" [1 2 3] \"float scale\" 2")
    else {
        panic!("no point")
    };
    colors_are(intensity, [2.0, 4.0, 6.0]);
    let Light::Point(Point { intensity, .. }) = light("\"point\" \"float power\" 100") else {
        panic!("no point")
    };
    colors_are(intensity, [100.0 / (4.0 * std::f32::consts::PI); 3]);
    let Light::Directional(Directional { irradiance, direction }) = light(
        "\"distant\" \"float illuminance\" 50 \"point3 from\" [0 0 0] \"point3 to\" [0 0 -2]",
    ) else {
        panic!("no distant light")
    };
    colors_are(irradiance, [50.0; 3]);
    assert_eq!(direction, DVec3::NEG_Z);
    let Light::Spot(Spot { falloff, position, direction, .. }) =
        light("\"spot\" \"float coneangle\" 40 \"point3 from\" [1 0 0] \"point3 to\" [1 0 5]")
    else {
        panic!("no spot")
    };
    // With the default camera, the world is mirrored in x.
    assert_eq!((position, direction), (DVec3::NEG_X, DVec3::Z));
    assert!(
        (falloff.at(34f64.to_radians().cos()), falloff.at(41f64.to_radians().cos())) == (1.0, 0.0),
        "{falloff:?}"
    );
    assert!(matches!(falloff, SpotFalloff::Step { .. }));
    // A black body has luminance 1 whatever its temperature.
    let Light::Point(Point { intensity, .. }) = light("\"point\" \"blackbody I\" 3000") else {
        panic!("no point")
    };
    assert!(
        (intensity.luminance() - 1.0).abs() < 0.02 && intensity.r > 2.0 * intensity.b,
        "{intensity:?}"
    );
}

#[test]
fn area_lights_emit_their_radiance_or_their_power() {
    let emission = |light: &str, shape: &str| {
        let scene = world(&format!("AreaLightSource \"diffuse\" {light} Shape {shape}"));
        let material = material(&scene);
        (material.emission.factor, material.emits_on_both_sides)
    };
    colors_are(emission("\"rgb L\" [4 5 6] \"float scale\" 0.5", "\"sphere\"").0, [2.0, 2.5, 3.0]);
    // The area is 4 pi, and each unit of area emits its radiance times pi.
    let power = 4.0 * std::f32::consts::PI * std::f32::consts::PI;
    colors_are(emission(&format!("\"float power\" {power}"), "\"sphere\"").0, [1.0; 3]);
    let (color, both) =
        emission(&format!("\"float power\" {power} \"bool twosided\" true"), "\"sphere\"");
    colors_are(color, [0.5; 3]);
    assert!(both);
    // Each triangle of a mesh emits the power.
    let square =
        "\"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 1 1 0 0 1 0] \"integer indices\" [0 1 2 0 2 3]";
    colors_are(emission(&format!("\"float power\" {}", std::f32::consts::PI), square).0, [2.0; 3]);
}

#[test]
fn power_is_that_of_a_whole_shape_or_of_each_patch() {
    let radiance = |shape: &str| {
        let scene = world(&format!("AreaLightSource \"diffuse\" \"float power\" 1 {shape}"));
        material(&scene).emission.factor
    };
    let of_area = |area: f64| [1.0 / (std::f64::consts::PI * area) as f32; 3];
    let turn = std::f64::consts::TAU;
    let [low, half] = ["\"float zmin\" -0.25", "\"float phimax\" 180"];
    for (shape, area) in [
        (format!("Shape \"sphere\" \"float radius\" 0.5 {low}"), turn * 0.5 * 0.75),
        (format!("Shape \"sphere\" {half}"), turn),
        ("ReverseOrientation Shape \"sphere\"".into(), 2.0 * turn),
        (format!("Shape \"disk\" \"float innerradius\" 0.5 {half}"), turn * 0.25 * 0.75),
        ("ReverseOrientation Shape \"disk\"".into(), turn * 0.5),
        (format!("Shape \"cylinder\" \"float radius\" 0.5 {half}"), turn * 0.5),
        ("Shape \"cone\" \"float height\" 2".into(), turn * 0.5 * 5f64.sqrt()),
        ("Shape \"paraboloid\"".into(), turn / 12.0 * (5f64.powf(1.5) - 1.0)),
    ] {
        colors_are(radiance(&shape), of_area(area));
    }
    // Each of two patches of the area 2 has the power; the bent one is of many triangles.
    let patches = "Shape \"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0 0 2 0 2 2 0] \
        \"integer indices\" [0 1 2 3 2 3 4 5]";
    colors_are(radiance(patches), of_area(2.0));
    let text = "WorldBegin AreaLightSource \"diffuse\" \"float power\" 1 \
        Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0 0 3 0 1 3 0] \
        \"integer indices\" [0 1 2 3 2 3 4 5]";
    assert!(warnings(text).contains("power\" is that of each bilinear patch"));
}

#[test]
fn infinite_lights_without_a_picture_are_constant() {
    let environment =
        |text: &str| match world(&format!("LightSource \"infinite\" {text}")).environment {
            Some(Environment::Constant(color)) => color,
            other => panic!("{other:?}"),
        };
    colors_are(environment("\"rgb L\" [.4 .5 .6] \"float scale\" 2"), [0.8, 1.0, 1.2]);
    colors_are(environment("\"float illuminance\" 10"), [10.0 / std::f32::consts::PI; 3]);
}

#[test]
fn materials_map_to_ours() {
    let of = |text: &str| {
        let scene = world(&format!("{text} Shape \"sphere\""));
        material(&scene).kind.clone()
    };
    let MaterialKind::Conductor(metal) = of("Material \"conductor\" \"float roughness\" 0.04")
    else {
        panic!("no metal")
    };
    // In pbrt the parameter alpha of the microfacets is the root of the roughness; in Snell alpha
    // is the square of the roughness.
    assert!(
        close(metal.roughness.factor, 0.04f32.sqrt().sqrt())
            && matches!(metal.spectrum, ConductorSpectrum::Metal(_))
    );
    let MaterialKind::Conductor(metal) =
        of("Material \"conductor\" \"float roughness\" 0.04 \"bool remaproughness\" false")
    else {
        panic!("no metal")
    };
    assert!(close(metal.roughness.factor, 0.2));
    let MaterialKind::Dielectric(glass) = of("Material \"dielectric\" \"float eta\" 1.33") else {
        panic!("no glass")
    };
    assert_eq!((glass.ior.at_line_d(), glass.roughness.factor), (1.33, 0.0));
    let MaterialKind::CoatedDiffuse(coated) =
        of("Material \"coateddiffuse\" \"rgb reflectance\" [1 0 0]")
    else {
        panic!("no coat")
    };
    assert_eq!((coated.reflectance.factor, coated.ior), (Rgb::new(1.0, 0.0, 0.0), 1.5));
    let MaterialKind::CoatedConductor(coated) =
        of("Material \"coatedconductor\" \"float interface.roughness\" 0.04")
    else {
        panic!("no coat")
    };
    assert!(close(coated.roughness.factor, 0.04f32.sqrt().sqrt()));
    let MaterialKind::Conductor(stretched) =
        of("Material \"conductor\" \"float uroughness\" 0.04 \"float vroughness\" 0.01 \"bool \
            remaproughness\" false")
    else {
        panic!("no stretched metal")
    };
    assert!(close(stretched.anisotropy.factor, 0.75));
    let MaterialKind::Diffuse(_) =
        of("MakeNamedMaterial \"a\" \"string type\" \"diffuse\" NamedMaterial \"a\"")
    else {
        panic!("not diffuse")
    };
}

#[test]
fn materials_of_the_third_version_are_understood() {
    let of = |text: &str| material(&world(&format!("{text} Shape \"sphere\""))).kind.clone();
    let MaterialKind::Plastic(plastic) = of(
        "Material \"plastic\" \"color Kd\" [.4 .2 .2] \"color Ks\" [.5 .5 .5] \"float roughness\" \
            .025",
    ) else {
        panic!("no plastic")
    };
    assert_eq!(
        (plastic.diffuse.factor, plastic.specular.factor),
        (Rgb::new(0.4, 0.2, 0.2), Rgb::splat(0.5))
    );
    assert!(
        (plastic.roughness.factor.powi(2) - 0.2156).abs() < 0.001,
        "{}",
        plastic.roughness.factor.powi(2)
    );
    let MaterialKind::Diffuse(_) = of("Material \"matte\" \"float sigma\" 0") else {
        panic!("not diffuse")
    };
    let MaterialKind::Mirror(_) = of("Material \"mirror\"") else { panic!("no mirror") };
    let MaterialKind::Dielectric(glass) =
        of("Material \"glass\" \"float index\" 1.2 \"rgb Kt\" [1 0 0]")
    else {
        panic!("no glass")
    };
    assert_eq!((glass.ior.at_line_d(), glass.tint.factor), (1.2, Rgb::new(1.0, 0.0, 0.0)));
}

#[test]
fn displacement_is_a_map_of_bumps_in_units_of_the_scene() {
    let noise = "Texture \"h\" \"float\" \"wrinkled\" Texture \"low\" \"float\" \"scale\" \
        \"texture tex\" \"h\" \"float scale\" 0.25 ";
    for name in ["displacement", "bumpmap"] {
        let text =
            format!("{noise} Material \"diffuse\" \"texture {name}\" \"low\" Shape \"sphere\"");
        let scene = world(&text);
        assert_eq!(scene.warnings, [], "{name}");
        let map = material(&scene).bump_map.expect("a map");
        assert_eq!((map.height, map.unit), (0.25, HeightUnit::Scene), "{name}");
    }
    let flat = world("Material \"diffuse\" \"float displacement\" 3 Shape \"sphere\"");
    assert_eq!((material(&flat).bump_map, flat.warnings.as_slice()), (None, &[][..]));
}

#[test]
fn sheets_and_depths_have_their_colours() {
    let of = |text: &str| match material(&world(&format!("{text} Shape \"sphere\""))).kind.clone() {
        MaterialKind::OpenPbr(surface) => surface,
        other => panic!("{other:?}"),
    };
    let sheet = of(
        "Material \"diffusetransmission\" \"rgb reflectance\" [.2 .1 0] \"rgb transmittance\" [.6 \
            .6 .6]",
    );
    let through = sheet.subsurface_color.factor * sheet.subsurface_weight.factor;
    let back = sheet.base_color.factor * (1.0 - sheet.subsurface_weight.factor);
    assert!(
        sheet.geometry_thin_walled
            && close(through.r, 0.6)
            && close(back.r, 0.2)
            && close(back.g, 0.1)
    );
    let skin =
        of("Material \"subsurface\" \"rgb reflectance\" [.8 .5 .3] \"rgb mfp\" [2 1 .5] \"float \
            scale\" 3");
    assert_eq!(
        (skin.subsurface_radius.factor, skin.subsurface_radius_scale.factor),
        (6.0, Rgb::new(1.0, 0.5, 0.25))
    );
    let ketchup = of("Material \"subsurface\" \"string name\" \"Ketchup\"").subsurface_color.factor;
    assert!(ketchup.r > 4.0 * ketchup.g, "{ketchup:?}");
}

#[test]
fn mixes_are_layers_with_their_shares() {
    let scene = world(
        "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" MakeNamedMaterial \"b\" \"string \
            type\" \"conductor\"\n\
        Material \"mix\" \"string materials\" [ \"a\" \"b\" ] \"float amount\" 0.25 Shape \
        \"sphere\"",
    );
    let layers: Vec<_> = scene.materials.iter().map(|m| (m.kind.name(), m.alpha.factor)).collect();
    assert_eq!(layers, [("conductor", 0.25), ("diffuse", 1.0)]);
}

#[test]
fn alpha_makes_surfaces_of_one_material_differ() {
    let scene = world(
        "Material \"diffuse\" Shape \"sphere\" Shape \"sphere\" \"float alpha\" 0.25 Shape \
            \"sphere\" \"float alpha\" 0.25",
    );
    let alphas: Vec<f32> = scene.materials.iter().map(|m| m.alpha.factor).collect();
    assert_eq!(alphas, [1.0, 0.25]);
}

#[test]
fn colours_of_other_spaces_are_converted() {
    let color = |space: &str, rgb: &str| {
        let scene = world(&format!(
            "ColorSpace \"{space}\" Material \"diffuse\" \"rgb reflectance\" [{rgb}] Shape \
                \"sphere\""
        ));
        diffuse(material(&scene)).to_array()
    };
    for space in ["srgb", "rec2020", "dci-p3", "aces2065-1"] {
        let white = color(space, "1 1 1");
        assert!(white.iter().all(|c| (c - 1.0).abs() < 1e-3), "{space}: {white:?}");
    }
    let red = color("rec2020", "1 0 0");
    assert!(red[0] > 1.5 && red[1] == 0.0, "{red:?}");
}

#[test]
fn spectra_become_colours() {
    let color = |spectrum: &str| {
        diffuse(material(&world(&format!(
            "Material \"diffuse\" \"spectrum reflectance\" [{spectrum}] Shape \"sphere\""
        ))))
        .to_array()
    };
    let grey = color("300 .5 900 .5");
    assert!(grey.iter().all(|c| (c - 0.5).abs() < 1e-3), "{grey:?}");
    let red = color("300 0 590 0 600 1 900 1");
    assert!(red[0] > 0.5 && red[1] < 0.2 && red[2] < 0.05, "{red:?}");
}

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
fn media_fill_what_their_interface_says() {
    use snell_scene::medium::Medium;
    let scene = world(
        "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [1 2 3] \"rgb \
            sigma_s\" [4 5 6] \"float scale\" 2 \"rgb Le\" [1 1 1]\n\
         MediumInterface \"fog\" \"\"\nMaterial \"interface\" Shape \"sphere\"\nMediumInterface \
         \"\" \"fog\"\nMaterial \"dielectric\" Shape \"sphere\" \"float radius\" 0.5",
    );
    let Medium::Homogeneous(fog) = &scene.media[0] else { panic!("not homogeneous") };
    assert_eq!((fog.sigma_a, fog.sigma_s), (Rgb::new(2.0, 4.0, 6.0), Rgb::new(8.0, 10.0, 12.0)));
    // Emission is proportional to absorption.
    assert_eq!(fog.emission, Rgb::new(2.0, 4.0, 6.0));
    let insides: Vec<_> =
        scene.materials.iter().map(|m| m.interior.map(|i| i.medium.map(|m| m.0))).collect();
    assert_eq!(insides, [Some(Some(0)), Some(None)]);
    let around = super::scene(
        "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\"\nMediumInterface \"\" \
            \"fog\"\nCamera \"perspective\"\nWorldBegin",
    );
    assert_eq!(around.medium.map(|m| m.0), Some(0));
}

#[test]
fn media_on_grids_have_the_colours_of_their_cells() {
    use snell_math::ColorMode;
    use snell_scene::medium::Medium;
    let grid = |text: &str| {
        let scene = world(&format!(
            "MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"point3 p0\" [ 1 0 0 ] \"point3 \
                p1\" [ 5 1 1 ] \"integer nx\" 2 {text}\n\
             MediumInterface \"m\" \"\"\nMaterial \"interface\" Shape \"sphere\""
        ));
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let [Medium::Grid(grid)] = &scene.media[..] else { panic!("one grid") };
        // The centres of the cells; mirrored in x, as pbrt's scenes are.
        [-2.0, -4.0].map(|x| grid.properties(Vec3::new(x, 0.5, 0.5), ColorMode::Rgb))
    };
    let colors = "\"rgb sigma_a\" [ 1 2 3 0 8 1 ] \"rgb sigma_s\" [ 5 0 1 2 0 4 ] \"rgb Le\" [ 1 1 \
        1 7 0 2 ]";
    let [a, b] =
        grid(&format!("{colors} \"float scale\" 2 \"float Lescale\" 0.5 \"float g\" 0.25"));
    let close = |found: snell_math::SampledSpectrum, expected: [f32; 3]| {
        assert!(
            (0..3).all(|c| (found[c] - expected[c]).abs() < 1e-5),
            "{found:?} is not {expected:?}"
        );
    };
    close(a.sigma_a, [2.0, 4.0, 6.0]);
    close(b.sigma_a, [0.0, 16.0, 2.0]);
    close(a.sigma_s, [10.0, 0.0, 2.0]);
    close(b.sigma_s, [4.0, 0.0, 8.0]);
    // Emission is proportional to absorption.
    close(a.emission, [1.0, 2.0, 3.0]);
    close(b.emission, [0.0, 0.0, 2.0]);
    // Missing grids are 1.
    let [a, b] = grid("\"rgb sigma_s\" [ 5 0 1 0 0 0 ]");
    close(a.sigma_a, [1.0; 3]);
    close(b.sigma_t(), [1.0; 3]);
    for wrong in
        ["\"rgb sigma_s\" [ 5 0 1 ]", "", "\"rgb sigma_a\" [ 1 2 3 0 8 1 ] \"rgb Le\" [ 1 1 1 ]"]
    {
        let text = format!(
            "WorldBegin MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"integer nx\" 2 {wrong}"
        );
        let error = fault(&text);
        assert!(error.contains("give one for each cell"), "{error}");
    }
    let error =
        fault("WorldBegin MakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"integer nx\" -2");
    assert!(
        error.contains("nx is -2, but a grid has at least one cell; write a whole number above 0"),
        "{error}"
    );
}

#[test]
fn hair_has_its_absorption_its_colour_or_its_pigments() {
    let hair = |text: &str| {
        let scene = scene(&format!("WorldBegin Material \"hair\" {text} Shape \"sphere\""));
        let MaterialKind::Hair(hair) = scene.materials[0].kind.clone() else { panic!("hair") };
        (hair, scene.warnings.len())
    };
    let (brown, _) =
        hair("\"float beta_m\" 0.2 \"float beta_n\" 0.4 \"float alpha\" 3 \"float eta\" 1.6");
    assert_eq!((brown.eumelanin, brown.scale_tilt, brown.ior), (1.3.into(), 3.0, 1.6));
    assert_eq!((brown.longitudinal_roughness, brown.azimuthal_roughness), (0.2.into(), 0.4.into()));
    let (red, _) = hair("\"float pheomelanin\" 2");
    assert_eq!((red.eumelanin, red.pheomelanin), (0.0.into(), 2.0.into()));
    let (dyed, warnings) = hair("\"rgb reflectance\" [0.5 0.25 0.125]");
    assert_eq!(
        (dyed.color.factor, dyed.eumelanin, warnings),
        (Rgb::new(0.5, 0.25, 0.125), 0.0.into(), 0)
    );
    let (absorbing, warnings) = hair("\"rgb sigma_a\" [0.5 1 4] \"float eumelanin\" 1");
    assert_eq!(
        (absorbing.sigma_a.factor, absorbing.eumelanin, warnings),
        (Rgb::new(0.5, 1.0, 4.0), 0.0.into(), 1)
    );
}

/// The value of texture 0 of a scene at a point of the file's world, on a surface that faces up.
fn shown(scene: &Scene, place: [f64; 3], footprint: f32) -> [f32; 3] {
    let position =
        scene.nodes[scene.root.index()].transform.transform_point3(DVec3::from(place)).as_vec3();
    let set = snell_scene::TextureSet::new(&scene.textures, &scene.images);
    let surface = snell_scene::texture::surface_at(position, Vec3::Y, Vec2::ZERO);
    let [r, g, b, _] =
        set.lookup(snell_scene::TextureId(scene.textures.len() as u32 - 1), &surface, footprint);
    [r, g, b]
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

/// The error of a text.
fn fault(text: &str) -> String {
    read_text(&READER, text).expect_err(text).to_string()
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
        ("\"mix\" \"texture amount\" \"t\"", "there is no float texture \"t\" so far"),
        ("\"scale\" \"texture tex\" \"none\"", "there is no spectrum texture \"none\" so far"),
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

#[test]
fn integrators_of_pbrt_2_are_read_and_what_else_it_had_is_named() {
    let text = "Renderer \"sampler\" SurfaceIntegrator \"directlighting\" VolumeIntegrator \
            \"emission\"\nWorldBegin Shape \"sphere\"
        Volume \"homogeneous\" \"point p0\" [0 0 0]";
    assert_eq!(scene(text).settings.integrator.as_deref(), Some("direct"));
    let said = warnings(text);
    for what in ["Renderer \"sampler\"", "VolumeIntegrator \"emission\"", "Volume \"homogeneous\""]
    {
        assert!(said.contains(&format!("{what} of pbrt 2 is left out")), "{what}: {said}");
    }
}
