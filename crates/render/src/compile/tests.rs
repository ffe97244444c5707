//! Tests that sharing, inherited materials and node paths survive compiling.

mod motion;

use super::*;
use snell_intersect::shape::{AnyShape, Sphere};
use snell_intersect::{AcceptAll, Curves, StrandBasis, TriangleMesh};
use snell_math::{DAffine3, DVec3, Rgb, Vec2};
use snell_scene::light::Directional;
use snell_scene::material::Diffuse;
use snell_scene::{Geometry, Node, Surface};

/// A square of `n` by `n` cells over `[-1, 1]^2` at `z = 0`.
fn square(n: u32) -> Arc<TriangleMesh> {
    let mut mesh = TriangleMesh::default();
    for i in 0..=n {
        for j in 0..=n {
            let p = Vec2::new(i as f32, j as f32) * (2.0 / n as f32) - 1.0;
            mesh.positions.push(p.extend(0.0));
        }
    }
    for i in 0..n {
        for j in 0..n {
            let a = i * (n + 1) + j;
            mesh.indices.extend([[a, a + n + 1, a + 1], [a + 1, a + n + 1, a + n + 2]]);
        }
    }
    Arc::new(mesh)
}

fn moved(x: f64, name: &str) -> Node {
    Node { transform: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)), ..Node::named(name) }
}

fn look_down(x: f32) -> Ray {
    Ray::new(Vec3::new(x, 0.1, 5.0), Vec3::NEG_Z)
}

/// A scene whose root has two pairs. Each pair holds the same leaf twice; the second passes a
/// material on to its leaves.
fn nested(mesh: Arc<TriangleMesh>) -> Scene {
    let mut scene = Scene::new("nested");
    let red = scene.add_material(Material::new("red", Diffuse::new(Rgb::new(1.0, 0.0, 0.0))));
    let leaf = scene.add_node(Node {
        surfaces: vec![Surface::new(Geometry::Mesh(mesh))],
        ..Node::named("leaf")
    });
    let pair = scene.add_node(Node::named("pair"));
    for (x, name) in [(-3.0, "left"), (3.0, "right")] {
        let place = scene.add_child(pair, moved(x, name));
        scene.nodes[place.index()].children.push(leaf);
    }
    for (x, name, material) in [(-10.0, "first", None), (10.0, "second", Some(red))] {
        let place = scene.add_child(scene.root, Node { material, ..moved(x, name) });
        scene.nodes[place.index()].children.push(pair);
    }
    scene
}

#[test]
fn a_shared_subtree_is_stored_once_at_any_depth() {
    for (mesh, copies) in [(square(2), 1), (square(10), 1)] {
        let triangles = mesh.indices.len() as u64;
        let compiled =
            CompiledScene::new(&nested(mesh), &BuildOptions::default()).expect("a valid scene");
        assert_eq!(compiled.world.triangle_count(), triangles * copies);
        assert_eq!(compiled.world.instanced_triangle_count(), triangles * 4);
        for x in [-13.0, -7.0, 7.0, 13.0] {
            assert!(
                compiled.world.closest_one(&look_down(x), &AcceptAll).is_hit(),
                "the copy at {x}"
            );
        }
    }
}

#[test]
fn a_hit_knows_its_nodes_and_the_material_handed_down() {
    let scene = nested(square(10));
    let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
    let names = |x: f32| {
        let hit = compiled.world.closest_one(&look_down(x), &AcceptAll);
        let path = compiled.node_path(&hit);
        let names: Vec<_> = path.iter().map(|n| scene.nodes[n.index()].name.clone()).collect();
        (names.join("/"), compiled.material(compiled.material_id(&hit)).name.clone())
    };
    assert_eq!(names(-13.0), ("root/first/pair/left/leaf".into(), "default".into()));
    assert_eq!(names(13.0), ("root/second/pair/right/leaf".into(), "red".into()));
}

#[test]
fn a_singular_node_is_left_out_with_a_warning() {
    let mut scene = nested(square(2));
    let first = scene.nodes[scene.root.index()].children[0];
    scene.nodes[first.index()].transform = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
    assert!(!compiled.world.closest_one(&look_down(-13.0), &AcceptAll).is_hit());
    assert!(compiled.world.closest_one(&look_down(13.0), &AcceptAll).is_hit());
    assert!(
        compiled.warnings.iter().any(|w| w.message.contains("singular")),
        "{:?}",
        compiled.warnings
    );
}

#[test]
fn a_vertex_so_far_out_that_all_rays_are_slow_is_told() {
    for (x, is_warned) in [(1e11, false), (3e38, true)] {
        let mut mesh = TriangleMesh::clone(&square(2));
        mesh.positions[0].x = -x;
        let compiled = CompiledScene::new(&nested(Arc::new(mesh)), &BuildOptions::default())
            .expect("a valid scene");
        let warned = compiled
            .warnings
            .iter()
            .any(|w| w.message.starts_with("coordinates reach 3.0e38, and beyond 1e12 "));
        assert_eq!(warned, is_warned, "{:?}", compiled.warnings);
    }
}

#[test]
fn things_smaller_than_the_steps_of_coordinates_so_far_out_are_told() {
    for (radius, is_warned) in [(1e4, false), (4_294_967_295.0, true)] {
        let mut scene = Scene::new("far");
        for i in 0..80 {
            let transform =
                DAffine3::from_translation(DVec3::new(f64::from(i % 9), f64::from(i / 9), 0.0));
            let sphere = AnyShape::from(Sphere { radius: if i == 40 { radius } else { 0.1 } });
            let surface =
                Surface { geometry: Geometry::Shape(Arc::new(sphere)), materials: Vec::new() };
            scene.add_child(
                scene.root,
                Node { transform, surfaces: vec![surface], ..Node::named("ball") },
            );
        }
        let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
        let warned = compiled
            .warnings
            .iter()
            .any(|w| w.message.starts_with("coordinates reach 4.3e9, where single"));
        assert_eq!(warned, is_warned, "{:?}", compiled.warnings);
    }
}

#[test]
fn a_mesh_of_faces_without_an_area_is_told_and_one_with_a_good_face_is_not() {
    for (flat, is_degenerate, is_warned) in [(1, false, false), (2, false, true), (1, true, true)] {
        let mut mesh = TriangleMesh::clone(&square(1));
        let triangles = mesh.indices.len();
        assert_eq!(triangles, 2);
        if is_degenerate {
            mesh.indices[1] = [0; 3];
        }
        for i in 0..flat {
            // Three different corners on a line.
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([0.0, 0.3, 1.0].map(|x| Vec3::new(x, 0.0, 0.0)));
            mesh.indices[i] = [first, first + 1, first + 2];
        }
        let compiled = CompiledScene::new(&nested(Arc::new(mesh)), &BuildOptions::default())
            .expect("a valid scene");
        let warned = compiled
            .warnings
            .iter()
            .any(|w| w.message.starts_with("no face of a mesh has an area"));
        assert_eq!(warned, is_warned, "{:?}", compiled.warnings);
    }
}

#[test]
fn a_changed_scene_is_the_scene_compiled_anew() {
    let before = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
    let compiled = CompiledScene::new(&before, &BuildOptions::default()).expect("a valid scene");
    let mut scene = before.clone();
    for definition in ["material.white.reflectance.factor=[0.1,0.5,0.2]", "ambient=[0.1,0.1,0.1]"] {
        snell_scene::overrides::apply(&mut scene, definition).expect("the scene has them");
    }
    scene.materials[1].emission = snell_scene::material::ColorParam::constant(Rgb::splat(2.0));
    let changed =
        compiled.changed(&before, &scene).expect("a valid scene").expect("the structure stays");
    assert!(Arc::ptr_eq(&changed.world, &compiled.world));
    let rebuilt = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
    assert!(
        changed.lights().len() > compiled.lights().len()
            && changed.lights().len() == rebuilt.lights().len()
    );
    let settings = crate::Settings { size: [16, 12], spp: 4, ..crate::Settings::default() };
    let picture =
        |scene| crate::Job::new(scene, &before.cameras[0], &settings).run(2, &|_| true).0.image();
    assert_eq!(picture(&changed), picture(&rebuilt));

    scene.materials[0].double_sided = false;
    assert!(compiled.changed(&before, &scene).expect("a valid scene").is_none());
}

#[test]
fn it_is_known_whether_light_comes_from_all_around() {
    let mut scene = snell_scene::builtin::builtin("cornell-box").expect("the scene is built in");
    let is_even = |scene: &Scene| {
        CompiledScene::new(scene, &BuildOptions::default()).expect("a valid scene").is_evenly_lit()
    };
    assert!(!is_even(&scene), "the lamp is all the light");
    scene.environment = Some(snell_scene::Environment::Constant(Rgb::splat(1e-4)));
    assert!(!is_even(&scene), "the lamp is most of the light");
    scene.environment = Some(snell_scene::Environment::Constant(Rgb::splat(1e4)));
    assert!(is_even(&scene), "the sky is most of the light");
    scene.add_light(Directional { direction: -DVec3::Y, irradiance: Rgb::splat(1e6) });
    assert!(!is_even(&scene), "the sun is most of the light");
}

#[test]
fn strands_are_stored_once_keep_their_materials_and_are_passed_from_within() {
    let points = [-1.0, -0.3, 0.3, 1.0].map(|y| Vec3::new(0.0, y, 0.0).extend(0.5)).to_vec();
    let strand = Arc::new(Curves::new(StrandBasis::Bezier, points, vec![4]).expect("a segment"));
    let mut scene = Scene::new("strands");
    let root = scene.root;
    for (x, name) in [(0.0, "here"), (3.0, "there"), (6.0, "shining")] {
        let material = Material::new(name, Diffuse::new(Rgb::WHITE));
        let shines = if name == "shining" { Rgb::WHITE } else { Rgb::BLACK };
        let material = scene.add_material(material.emitting(shines));
        let surfaces = vec![Surface::with_material(Geometry::Curves(strand.clone()), material)];
        scene.add_child(root, Node { surfaces, ..moved(x, name) });
    }
    let compiled = CompiledScene::new(&scene, &BuildOptions::default()).expect("a valid scene");
    for (x, material) in [(0.0, 0), (3.0, 1), (6.0, 2)] {
        let ray = look_down(x);
        let hit = compiled.world.closest_one(&ray, &AcceptAll);
        assert_eq!((hit.t, compiled.material_id(&hit)), (4.5, MaterialId(material)));
        let surface = compiled.interaction(&ray, 0.0, &hit);
        assert!(
            surface.on_curve
                && surface.geometric_normal.z > 0.99
                && surface.dpdu.normalize().y > 0.99
        );
        assert!((surface.uv[0].x - 0.55).abs() < 0.01);
        let within = Ray::new(surface.ray_origin(Vec3::NEG_Z), Vec3::NEG_Z);
        assert!(!compiled.world.closest_one(&within, &AcceptAll).is_hit(), "the way out is free");
    }
    assert!(
        compiled.warnings.iter().any(|w| w.message.contains("curves that shine")),
        "{:?}",
        compiled.warnings
    );
}
