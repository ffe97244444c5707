//! Transforms, attributes and objects.

use super::*;
use snell_intersect::Shape;
use snell_math::DVec3;
use snell_scene::Geometry;

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
