//! Concise builders of test scenes.

use snell_intersect::shape::{BoxShape, Plane, Rectangle, Sphere};
use snell_intersect::{AnyShape, TriangleMesh};
use snell_math::{DAffine3, DMat3, DVec2, DVec3, Rgb, Vec2, Vec3};
use snell_scene::camera::Projection;
use snell_scene::light::{Attenuation, Directional, Point};
use snell_scene::material::{
    AlphaMode, Black, ColorParam, Conductor, Dielectric, Diffuse, MetallicRoughness, Mirror,
    NormalMap, Phong, Plastic, ScalarParam,
};
use snell_scene::{
    Camera, Encoding, Environment, Geometry, Image, ImageTexture, Material, MaterialId, Node,
    Scene, Surface,
};
use std::sync::Arc;

/// Puts a shape into the scene.
pub fn put(
    scene: &mut Scene,
    shape: impl Into<AnyShape>,
    transform: DAffine3,
    material: MaterialId,
) {
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

/// A translation by these coordinates.
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

/// A camera that sees a unit square of the ground around `(x, 0, z)` from just above it, below all
/// lamps.
pub fn over_ground(x: f64, z: f64) -> Camera {
    let eye = DVec3::new(x, 0.25, z);
    let projection = Projection::Orthographic { half_size: [Some(0.5), Some(0.5)] };
    Camera::from_direction(eye, DVec3::NEG_Y, DVec3::NEG_Z, projection)
}

/// A camera that looks in all directions, for places inside of objects.
pub fn all_around(eye: DVec3) -> Camera {
    Camera::from_direction(eye, DVec3::NEG_Z, DVec3::Y, Projection::Panoramic)
}

/// A rectangle of this size.
pub fn rectangle(width: f64, height: f64) -> Rectangle {
    Rectangle { half_size: DVec2::new(width / 2.0, height / 2.0) }
}

/// An image from a function of the column and row.
pub fn image(
    width: u32,
    height: u32,
    channels: u32,
    f: impl Fn(u32, u32) -> Vec<f32>,
) -> Arc<Image> {
    let values = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .flat_map(|(x, y)| f(x, y))
        .collect();
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

/// A scene with many features: textures, instances of instances, cut-out and blended surfaces, a
/// normal map, glass, metals, an emissive mesh, lights of several kinds, an environment image. The
/// camera sees all of it.
pub fn everything() -> (Scene, Camera) {
    let mut scene = Scene::new("everything");
    let checks = image(8, 8, 4, |x, y| {
        let bright = (x + y) % 2 == 0;
        vec![
            if bright { 0.9 } else { 0.2 },
            0.5,
            if bright { 0.3 } else { 0.7 },
            if bright { 1.0 } else { 0.2 },
        ]
    });
    let bumps = image(4, 4, 3, |x, y| vec![0.4 + 0.06 * x as f32, 0.4 + 0.06 * y as f32, 1.0]);
    let (checks, bumps) = (scene.add_image(checks), scene.add_image(bumps));
    let checks = scene.add_texture(ImageTexture::new(checks, Encoding::Linear));
    let bumps = scene.add_texture(ImageTexture::new(bumps, Encoding::Linear));
    let textured = ColorParam::textured(Rgb::WHITE, Some(checks));
    let alpha = ScalarParam { factor: 1.0, texture: Some((checks, 3)) };

    let floor = Material::new("floor", Diffuse { reflectance: textured });
    let floor = scene.add_material(floor);
    let mask = Material {
        alpha_mode: AlphaMode::Mask(0.5),
        alpha,
        ..Material::new("mask", Diffuse { reflectance: textured })
    };
    let mask = scene.add_material(mask);
    let veil = Material::new("veil", Diffuse::new(Rgb::new(0.2, 0.4, 0.9)));
    let veil =
        scene.add_material(Material { alpha_mode: AlphaMode::Blend, alpha: 0.4.into(), ..veil });
    let bumpy = Material::new("bumpy", MetallicRoughness::new(Rgb::new(0.9, 0.6, 0.2), 0.5, 0.3));
    let bumpy =
        scene.add_material(Material { normal_map: Some(NormalMap::new(bumps, 1.0)), ..bumpy });
    let glass = scene.add_material(Material::new("glass", Dielectric::smooth(1.5)));
    let frosted = scene.add_material(Material::new("frosted", Dielectric::rough(1.4, 0.4)));
    let gold = scene.add_material(Material::new("gold", Conductor::gold(0.3)));
    let mirror = scene.add_material(Material::new("mirror", Mirror::new(Rgb::splat(0.9))));
    let coat =
        scene.add_material(Material::new("coat", Plastic::new(Rgb::new(0.1, 0.5, 0.2), 0.2)));
    let phong = Phong {
        reflection: Rgb::splat(0.3).into(),
        specular: Rgb::splat(0.2).into(),
        ..Phong::default()
    };
    let phong = scene.add_material(Material::new("phong", phong));
    let glow = scene.add_material(
        Material::new("glow", Diffuse::new(Rgb::splat(0.3))).emitting(Rgb::new(9.0, 7.0, 4.0)),
    );

    put(&mut scene, rectangle(8.0, 8.0), facing(DVec3::ZERO, DVec3::Y), floor);
    put_mesh(&mut scene, quad(), at(-1.5, 0.8, 1.2), mask);
    put(&mut scene, rectangle(1.0, 1.0), at(1.4, 0.8, 1.5), veil);
    put_mesh(
        &mut scene,
        quad(),
        at(0.0, 2.6, 0.0) * DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2),
        glow,
    );
    put(
        &mut scene,
        BoxShape { min: DVec3::new(-2.6, 0.0, -1.5), max: DVec3::new(-1.8, 1.4, -0.7) },
        DAffine3::IDENTITY,
        bumpy,
    );
    // A cluster of balls of several materials is visible twice, the second time inside another
    // group.
    let mut cluster = Node::named("cluster");
    for (i, material) in [glass, frosted, gold, mirror, coat, phong].into_iter().enumerate() {
        let angle = i as f64;
        let transform = at(0.7 * angle.cos(), 0.35, 0.7 * angle.sin());
        let surfaces = vec![Surface::shape(Sphere { radius: 0.33 }, material)];
        cluster.children.push(scene.add_node(Node { transform, surfaces, ..Node::default() }));
    }
    let cluster = scene.add_node(cluster);
    let turned = at(0.2, 0.7, 0.0)
        * DAffine3::from_rotation_y(0.5)
        * DAffine3::from_scale(DVec3::new(0.7, 0.9, 0.7));
    let inner =
        scene.add_node(Node { transform: turned, children: vec![cluster], ..Node::named("inner") });
    let placed = |scene: &mut Scene, transform, child| {
        scene.add_child(scene.root, Node { transform, children: vec![child], ..Node::default() });
    };
    placed(&mut scene, at(-0.9, 0.0, 0.0), cluster);
    placed(&mut scene, at(1.2, 0.0, -0.3), inner);
    placed(&mut scene, at(1.6, 0.0, -1.5), inner);

    let (intensity, attenuation) = (Rgb::new(2.0, 2.0, 3.0), Attenuation::INVERSE_SQUARE);
    scene.add_light(Point {
        position: DVec3::new(2.0, 3.0, 2.0),
        intensity,
        attenuation,
        body_radius: 0.0,
    });
    scene.add_light(Directional {
        direction: DVec3::new(-0.6, -0.8, 0.0),
        irradiance: Rgb::splat(0.4),
    });
    let image = sky(32, |d| [0.3 + 0.2 * d.y as f32, 0.4, 0.5 + if d.x > 0.9 { 3.0 } else { 0.0 }]);
    let world_from_environment = DAffine3::from_rotation_y(0.3);
    scene.environment =
        Some(Environment::Image { image, scale: Rgb::splat(0.7), world_from_environment });
    scene.ambient = Rgb::splat(0.1);
    let camera = Camera::look_at(Vec3::new(0.3, 2.0, 5.0), Vec3::new(0.0, 0.6, 0.0), Vec3::Y, 0.42);
    (scene, camera.with_lens(0.02, 5.0))
}

/// A unit square of two triangles around the origin in the plane z = 0, with normals and texture
/// coordinates.
pub fn quad() -> TriangleMesh {
    let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
    TriangleMesh {
        positions: corners.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        normals: vec![Vec3::Z; 4],
        uvs: snell_intersect::first_uv_set(
            corners.map(|(x, y)| Vec2::new(x + 0.5, 0.5 - y)).to_vec(),
        ),
        ..TriangleMesh::default()
    }
}
