//! Scenes in few words.

use snell_intersect::AnyShape;
use snell_intersect::TriangleMesh;
use snell_intersect::shape::{Plane, Rectangle};
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb};
use snell_scene::camera::Projection;
use snell_scene::material::{Black, Diffuse};
use snell_scene::{Camera, Geometry, Image, Material, MaterialId, Node, Scene, Surface};
use std::sync::Arc;

/// Puts a shape into the scene.
pub fn put(scene: &mut Scene, shape: impl Into<AnyShape>, transform: DAffine3, material: MaterialId) {
    let surfaces = vec![Surface::shape(shape, material)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::default() });
}

/// Puts a mesh into the scene.
pub fn put_mesh(scene: &mut Scene, mesh: TriangleMesh, transform: DAffine3, material: MaterialId) {
    let surfaces = vec![Surface::with_material(Geometry::Mesh(Arc::new(mesh)), material)];
    scene.add_child(scene.root, Node { transform, surfaces, ..Node::default() });
}

/// A matte material of one reflectance.
pub fn matte(scene: &mut Scene, reflectance: f32) -> MaterialId {
    scene.add_material(Material::new("matte", Diffuse::new(Rgb::splat(reflectance))))
}

/// A lamp: emits on its outer side and reflects nothing.
pub fn lamp(scene: &mut Scene, radiance: f32) -> MaterialId {
    scene.add_material(Material::new("lamp", Black {}).emitting(Rgb::splat(radiance)))
}

/// A translation.
pub fn at(x: f64, y: f64, z: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, y, z))
}

/// A frame at `position` whose z axis is `z`.
pub fn facing(position: DVec3, z: DVec3) -> DAffine3 {
    let z = z.normalize();
    let (x, y) = z.any_orthonormal_pair();
    DAffine3 { matrix3: DMat3::from_cols(x, y, z), translation: position }
}

/// A matte plane y = 0 with the normal upwards.
pub fn ground(scene: &mut Scene, reflectance: f32) {
    let material = matte(scene, reflectance);
    put(scene, Plane {}, facing(DVec3::ZERO, DVec3::Y), material);
}

/// A camera that sees a unit square of the ground around `(x, 0, z)` from just above it, below all lamps.
pub fn over_ground(x: f64, z: f64) -> Camera {
    let eye = DVec3::new(x, 0.25, z);
    let projection = Projection::Orthographic { half_size: [Some(0.5), Some(0.5)] };
    Camera::from_direction(eye, DVec3::NEG_Y, DVec3::NEG_Z, projection)
}

/// A camera inside of things that looks into all directions.
pub fn all_around(eye: DVec3) -> Camera {
    Camera::from_direction(eye, DVec3::NEG_Z, DVec3::Y, Projection::Panoramic)
}

/// A rectangle of this size.
pub fn rectangle(width: f64, height: f64) -> Rectangle {
    Rectangle { half_size: DVec2::new(width / 2.0, height / 2.0) }
}

/// An image from a function of the column and row.
pub fn image(width: u32, height: u32, channels: u32, f: impl Fn(u32, u32) -> Vec<f32>) -> Arc<Image> {
    let values = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| f(x, y)).collect();
    Arc::new(Image::from_f32(width, height, channels, values))
}

/// An environment image from a function of the direction in the environment's coordinates.
pub fn sky(width: u32, radiance: impl Fn(DVec3) -> [f32; 3]) -> Arc<Image> {
    use std::f64::consts::{PI, TAU};
    let height = width / 2;
    image(width, height, 3, |x, y| {
        let (sin_phi, cos_phi) = ((f64::from(x) + 0.5) / f64::from(width) * TAU - PI).sin_cos();
        let (sin, cos) = ((f64::from(y) + 0.5) / f64::from(height) * PI).sin_cos();
        radiance(DVec3::new(sin * sin_phi, cos, -sin * cos_phi)).to_vec()
    })
}
