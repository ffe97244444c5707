use super::*;
use crate::{ReadOptions, read_scene};
use snell_intersect::shape::BoxShape;
use snell_intersect::{Curves, StrandBasis, TriangleMesh, first_uv_set};
use snell_math::spectrum::Metal;
use snell_math::{ColorMode, DAffine3, DMat3, DVec2, DVec3, Rgb, Vec2, Vec3, Vec4};
use snell_scene::builtin::BUILTINS;
use snell_scene::framing::{FramingOptions, prepare};
use snell_scene::light::{Attenuation, IntensityTable, Point, Profile, Projector, Slide};
use snell_scene::material::{
    BumpMap, ColorParam, Conductor, ConductorSpectrum, Diffuse, HeightUnit, Interface, Interior,
    MaterialKind, MetallicRoughness,
};
use snell_scene::medium::{Grid, Homogeneous, Medium};
use snell_scene::{
    Encoding, Geometry, Image, ImageTexture, Light, Material, Node, Pixels, Surface,
};
use std::sync::Arc;

/// A textured quad of two materials, twice under a rotated parent, with a camera and every light.
fn scene() -> Scene {
    let mut scene = Scene::new("two quads");
    let pixels = Pixels::U8((0..4 * 4 * 3).map(|i| i * 5).collect());
    let image = Image { width: 4, height: 4, channels: 3, pixels, encoding: Encoding::Srgb };
    let image = scene.add_image(Arc::new(image));
    let texture = scene.add_texture(ImageTexture {
        uv_transform: [[2.0, 0.0, 0.25], [0.0, -1.0, 1.0]],
        ..ImageTexture::new(image, Encoding::Srgb)
    });
    let color = ColorParam::textured(Rgb::WHITE, Some(texture));
    let paper = scene.add_material(Material::new("paper", Diffuse { reflectance: color }));
    let shiny = MetallicRoughness::new(Rgb::new(0.5, 0.25, 1.0), 1.0, 0.5);
    let metal = scene.add_material(Material::new("metal", shiny));
    let mesh = TriangleMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.5), Vec3::Y],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        normals: vec![Vec3::Z; 4],
        uvs: first_uv_set(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]),
        material_slots: vec![0, 1],
        ..TriangleMesh::default()
    };
    let surface = Surface {
        geometry: Geometry::Mesh(Arc::new(mesh)),
        materials: vec![Some(paper), Some(metal)],
    };
    let quad = scene.add_node(Node { surfaces: vec![surface], ..Node::named("quad") });
    for x in [0.0, 3.0] {
        let transform = DAffine3::from_rotation_z(0.5) * DAffine3::from_translation(DVec3::X * x);
        let root = scene.root;
        scene.add_child(root, Node { transform, children: vec![quad], ..Node::named("place") });
    }
    scene.cameras.push(snell_scene::Camera::look_at(
        Vec3::new(2.0, 1.0, 9.0),
        Vec3::ZERO,
        Vec3::Y,
        0.4,
    ));
    scene.lights = Light::examples();
    scene
}

fn written(extension: &str, scene: &Scene) -> (tempfile::TempDir, Written, Scene) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(format!("out.{extension}"));
    let written = write_scene_as(&path, scene, false).expect("it can be written");
    let read = read_scene(&path, &ReadOptions::default()).expect("it can be read");
    (folder, written, read)
}

fn triangles(scene: &Scene) -> Vec<[Vec3; 3]> {
    let mut output = Output::new(Path::new("x.ply"), Available::UNKNOWN);
    let meshes = flat::world_meshes(scene, &mut output, flat::Digits::Any).expect("a small scene");
    meshes
        .iter()
        .flat_map(|(_, mesh)| (0..mesh.indices.len()).map(|i| mesh.corners(i)).collect::<Vec<_>>())
        .collect()
}

fn assert_same_triangles(extension: &str, a: &Scene, b: &Scene) {
    let sorted = |scene: &Scene| {
        let mut all = triangles(scene);
        all.sort_by(|a, b| format!("{a:?}").cmp(&format!("{b:?}")));
        all
    };
    let (a, b) = (triangles(a), sorted(b));
    assert_eq!(a.len(), b.len(), "{extension}");
    for triangle in a {
        let near = |other: &[Vec3; 3]| {
            (0..3).all(|k| (0..3).any(|j| (other[j] - triangle[k]).length() < 1e-5))
        };
        assert!(b.iter().any(near), "{extension}: {triangle:?} is not there");
    }
}

#[test]
fn every_format_keeps_the_triangles_where_they_are() {
    let scene = scene();
    for extension in ["snell", "glb", "gltf", "pbrt", "obj", "ply", "stl", "off"] {
        let (_folder, written, read) = written(extension, &scene);
        let lights = Scene { lights: Vec::new(), ..read.clone() };
        let shown = if extension == "pbrt" { without_panels(&lights) } else { lights };
        assert_same_triangles(extension, &scene, &shown);
        assert_eq!(read.warnings, [], "{extension}");
        assert_eq!(
            written.losses.is_empty(),
            extension == "snell",
            "{extension}: {:?}",
            written.losses
        );
    }
}

#[test]
fn strands_stay_strands_where_a_format_has_them_and_are_tubes_elsewhere() {
    let point = |i: u8| Vec4::new(f32::from(i), f32::from(i % 3), 0.5, 0.1 + 0.05 * f32::from(i));
    let curves = Curves::new(StrandBasis::Bezier, (0..11).map(point).collect(), vec![4, 7])
        .expect("three segments");
    let curves = Arc::new(curves);
    let mut scene = Scene::new("fur");
    let paper = scene.add_material(Material::new("paper", Diffuse::new(Rgb::splat(0.25))));
    let surface = Surface::with_material(Geometry::Curves(curves.clone()), paper);
    let fur = scene.add_node(Node { surfaces: vec![surface], ..Node::named("fur") });
    for x in [0.0, 30.0] {
        let root = scene.root;
        let transform = DAffine3::from_translation(DVec3::X * x);
        scene.add_child(root, Node { transform, children: vec![fur], ..Node::named("place") });
    }
    let strands = |scene: &Scene| -> Vec<Arc<Curves>> {
        let surfaces = scene.nodes.iter().flat_map(|n| &n.surfaces);
        surfaces
            .filter_map(
                |s| if let Geometry::Curves(c) = &s.geometry { Some(c.clone()) } else { None },
            )
            .collect()
    };
    let (_folder, own, read) = written("snell", &scene);
    assert_eq!(own.losses, []);
    assert_eq!(strands(&read), std::slice::from_ref(&curves));
    let (_folder, _, read) = written("pbrt", &scene);
    let [found] = &strands(&read)[..] else { panic!("one object, used twice") };
    assert_eq!(found.strands(), [4; 3]);
    for segment in 0..3 {
        let (a, b) =
            (found.bezier(segment).expect("a curve"), curves.bezier(segment).expect("a curve"));
        assert!(
            a.iter().zip(b).all(|(a, b)| (*a - b).abs().max_element() < 1e-5),
            "{a:?}, not {b:?}"
        );
    }
    for extension in ["glb", "obj", "ply", "stl"] {
        let (_folder, written, read) = written(extension, &scene);
        assert_same_triangles(extension, &scene, &read);
        assert!(
            written.losses.iter().any(|l| l.message.contains("strands became tubes")),
            "{:?}",
            written.losses
        );
    }
}

/// A scene without the panels for invisible lights.
fn without_panels(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for node in &mut scene.nodes {
        let materials = &scene.materials;
        node.surfaces
            .retain(|s| !s.materials.iter().flatten().any(|m| materials[m.index()].is_emissive()));
    }
    scene
}

#[test]
fn textures_and_materials_survive_where_the_format_has_them() {
    let scene = scene();
    for extension in ["glb", "gltf", "pbrt", "obj"] {
        let (_folder, _, read) = written(extension, &scene);
        let texel = |scene: &Scene, uv: Vec2| {
            let textures = snell_scene::texture::TextureSet::new(&scene.textures, &scene.images);
            textures.lookup_at(snell_scene::TextureId(0), uv, 0.0)
        };
        for (u, v) in [(0.1, 0.2), (0.6, 0.7), (0.3, 0.9)] {
            // The pbrt reader flips v.
            let found = texel(&read, Vec2::new(u, v));
            let expected = texel(&scene, Vec2::new(u, v));
            for c in 0..3 {
                assert!(
                    (found[c] - expected[c]).abs() < 2e-3,
                    "{extension}: {found:?}, expected {expected:?}"
                );
            }
        }
        let metal = read
            .materials
            .iter()
            .find(|m| m.name.starts_with("metal"))
            .expect("the metal is there");
        let color = match &metal.kind {
            MaterialKind::OpenPbr(surface) => {
                (surface.base_color.factor, surface.specular_roughness.factor)
            }
            MaterialKind::MetallicRoughness(kind) => {
                (kind.base_color.factor, kind.roughness.factor)
            }
            MaterialKind::Conductor(conductor) => {
                (material::metal_color(&conductor.spectrum).factor, conductor.roughness.factor)
            }
            other => panic!("{extension}: {other:?}"),
        };
        assert_eq!(color.0, Rgb::new(0.5, 0.25, 1.0), "{extension}");
        assert!((color.1 - 0.5).abs() < 1e-6, "{extension}: {}", color.1);
    }
}

#[test]
fn bump_maps_survive_where_the_format_has_their_unit_and_their_loss_is_said_elsewhere() {
    for (unit, keeps, loses) in
        [(HeightUnit::Scene, "pbrt", "obj"), (HeightUnit::Picture, "obj", "pbrt")]
    {
        let mut scene = scene();
        let image = scene.add_image(Arc::new(Image::from_f32(4, 1, 1, vec![0.0, 0.25, 0.5, 1.0])));
        let texture = scene.add_texture(ImageTexture::new(image, Encoding::Linear));
        let used = scene
            .nodes
            .iter()
            .flat_map(|n| &n.surfaces)
            .find_map(|s| s.materials.iter().flatten().next());
        let material = used.expect("there are materials").index();
        scene.materials[material].bump_map =
            Some(BumpMap { texture, channel: Some(0), height: 0.125, unit });
        let (_folder, _, again) = written(keeps, &scene);
        let map = again.materials.iter().find_map(|m| m.bump_map).expect("a map");
        assert_eq!((map.height, map.unit), (0.125, unit), "{keeps}");
        for format in [loses, "gltf"] {
            let (_folder, written, _) = written(format, &scene);
            assert!(
                written.losses.iter().any(|l| l.message.contains("bump")),
                "{format}: {:?}",
                written.losses
            );
        }
    }
}

#[test]
fn cameras_and_lights_survive_in_gltf_and_pbrt() {
    let scene = scene();
    for extension in ["glb", "pbrt"] {
        let (_folder, _, read) = written(extension, &scene);
        let (found, expected) = (&read.cameras[0], &scene.cameras[0]);
        for point in [DVec3::ZERO, DVec3::new(1.0, 0.5, 0.0)] {
            let [a, b] =
                [found, expected].map(|c| c.project(point, [960, 720]).expect("it is seen"));
            assert!((a - b).length() < 1e-3, "{extension}: {a}, expected {b}");
        }
        let at =
            |scene: &Scene, name: &str| scene.lights.iter().filter(|l| l.name() == name).count();
        assert_eq!(
            (at(&read, "point"), at(&read, "spot"), at(&read, "directional")),
            (2, 3, 1),
            "{extension}"
        );
        assert_eq!(read.lights[0], scene.lights[0], "{extension}");
    }
}

/// The irradiance by a light at a place that faces it.
fn irradiance(light: &Light, place: DVec3) -> Rgb {
    let sample = light.sample(place.as_vec3(), Vec2::splat(0.5), ColorMode::Rgb);
    sample.map_or(Rgb::BLACK, |s| Rgb::new(s.radiance.0[0], s.radiance.0[1], s.radiance.0[2]))
}

#[test]
fn lights_with_tables_and_slides_shine_as_before_in_pbrt() {
    let mut scene = scene();
    let turned = DMat3::from_rotation_y(0.4) * DMat3::from_rotation_x(1.1);
    let polar: Vec<f64> = (0..=18).map(|i| f64::from(i) * 10.0f64.to_radians()).collect();
    let azimuth: Vec<f64> = (0..=8).map(|i| f64::from(i) * 45.0f64.to_radians()).collect();
    let value = |theta: &f64, phi: &f64| 2.0 + theta.cos() + 0.5 * theta.sin() * phi.cos();
    let pairs = azimuth.iter().flat_map(|phi| polar.iter().map(move |theta| (theta, phi)));
    let values = pairs.map(|(theta, phi)| Rgb::splat(value(theta, phi) as f32)).collect();
    let table = IntensityTable::new(polar.clone(), azimuth.clone(), values).expect("a table");
    let profile = Profile {
        position: DVec3::new(1.0, 2.0, 3.0),
        world_from_light: turned,
        scale: Rgb::new(1.0, 0.5, 2.0),
        table,
    };
    let values = (0..8 * 4).flat_map(|i| [i as f32, 1.0, 40.0 - i as f32]).collect();
    let slide = Slide::new(&Image::from_f32(8, 4, 3, values), DVec2::new(0.5, 0.25));
    let projector = |even| Projector {
        position: DVec3::new(-1.0, 2.0, 3.0),
        world_from_light: turned,
        scale: Rgb::new(1.0, 0.5, 2.0),
        even,
        slide: slide.clone().expect("a slide"),
    };
    scene.lights = vec![profile.into(), projector(false).into(), projector(true).into()];
    let (_folder, output, read) = written("pbrt", &scene);
    assert!(!output.losses.iter().any(|l| l.message.contains("light ")), "{:?}", output.losses);
    assert_eq!(read.lights.len(), 3);
    for (i, (a, b)) in scene.lights.iter().zip(&read.lights).enumerate() {
        for (x, y) in (-4..=4).flat_map(|x| (-4..=4).map(move |y| (x, y))) {
            let own = DVec3::new(f64::from(x) * 0.11, f64::from(y) * 0.055, 1.0);
            let all =
                if i == 0 { vec![own, -own, DVec3::new(own.z, own.x, own.y)] } else { vec![own] };
            for own in all {
                let position = match a {
                    Light::Profile(profile) => profile.position,
                    Light::Projector(projector) => projector.position,
                    _ => panic!("another light"),
                };
                let place = position + turned * own * 2.0;
                let [a, b] = [a, b].map(|light| irradiance(light, place));
                let error = (a + b * -1.0).map(f32::abs).max_element();
                assert!(
                    error < 0.02 * a.max_element() + 1e-6,
                    "light {i}, {own}: {a:?}, now {b:?}"
                );
            }
        }
    }
}

#[test]
fn pbrt_files_have_the_view_and_the_light_that_a_scene_lacks() {
    let mut scene = scene();
    scene.cameras.clear();
    scene.lights.clear();
    let (_folder, output, read) = written("pbrt", &scene);
    let mut framed = scene.clone();
    let options = FramingOptions { size: [960, 720], ..FramingOptions::default() };
    prepare(&mut framed, &options).expect("a scene");
    let [a, b] = [&framed, &read].map(|scene| {
        scene.cameras[0].project(DVec3::new(1.0, 0.5, 0.0), [960, 720]).expect("it is seen")
    });
    assert!((a - b).length() < 1e-3 && read.environment.is_some(), "{a} {b}");
    for said in ["no camera: the one that Snell", "no light: the sky that Snell"] {
        assert!(output.losses.iter().any(|l| l.message.contains(said)), "{:?}", output.losses);
    }
}

#[test]
fn lights_that_do_not_fade_are_as_bright_in_the_middle_of_a_pbrt_scene() {
    let mut scene = scene();
    let lamp = |attenuation| Point {
        position: DVec3::new(1.0, 7.0, 2.0),
        intensity: Rgb::new(3.0, 2.0, 1.0),
        attenuation,
        body_radius: 0.0,
    };
    scene.lights = vec![lamp(Attenuation::NONE).into()];
    let (_folder, output, read) = written("pbrt", &scene);
    assert!(output.losses.iter().any(|l| l.message.contains("as bright as before")));
    let meshes = triangles(&scene);
    let all = meshes.iter().flatten();
    let (low, high) = all.fold((Vec3::MAX, Vec3::MIN), |(a, b), p| (a.min(*p), b.max(*p)));
    let middle = ((low + high) * 0.5).as_dvec3();
    let [a, b] = [&scene, &read].map(|scene| irradiance(&scene.lights[0], middle));
    assert!((a.r - b.r).abs() < 0.05 * a.r, "{a:?} {b:?}");
}

#[test]
fn bodies_within_others_name_the_medium_around_them_in_pbrt() {
    let mut scene = Scene::new("nested");
    let mut part = |half: f64, at: f64| {
        let fog = Homogeneous::absorbing(Rgb::splat(half as f32));
        let medium = Some(scene.add_medium(fog));
        let interior = Some(Interior { medium, ..Interior::default() });
        let material = Material { interior, ..Material::new("", Interface {}) };
        let id = scene.add_material(material);
        let shape = BoxShape { min: DVec3::splat(-half), max: DVec3::splat(half) };
        let transform = DAffine3::from_translation(DVec3::X * at);
        let surfaces = vec![Surface::shape(shape, id)];
        scene.add_child(scene.root, Node { transform, surfaces, ..Node::default() });
    };
    part(4.0, 0.0);
    part(1.0, 0.5);
    part(2.0, 0.0);
    part(1.0, 9.0);
    let mut output = Output::new(Path::new("x.pbrt"), Available::UNKNOWN);
    (pbrt::WRITER.write)(&scene, &mut output).expect("it can be written");
    let text = String::from_utf8(output.main).expect("text");
    for (inside, outside) in [(0, ""), (1, "medium-2"), (2, "medium-0"), (3, "")] {
        let line = format!("MediumInterface \"medium-{inside}\" \"{outside}\"\n");
        assert!(text.contains(&line), "{line} is not in {text}");
    }
}

#[test]
fn metals_keep_their_tint_and_their_direction_in_pbrt() {
    let gold = Metal::named("Au").expect("gold");
    let conductor = Conductor {
        anisotropy: (-0.6f32).into(),
        tint: Rgb::splat(0.3).into(),
        ..Conductor::new(ConductorSpectrum::Metal(gold), 0.5)
    };
    let mut scene = scene();
    let id = scene.add_material(Material::new("gold", conductor.clone()));
    let shape = BoxShape { min: DVec3::ZERO, max: DVec3::splat(0.1) };
    scene.nodes[1].surfaces.push(Surface::shape(shape, id));
    // A black back of another surface.
    let back = Material { double_sided: false, ..Material::new("back", Diffuse::new(Rgb::BLACK)) };
    let id = scene.add_material(back);
    scene.nodes[1].surfaces.push(Surface::shape(shape, id));
    let (_folder, output, read) = written("pbrt", &scene);
    let said = |text: &str| output.losses.iter().any(|l| l.message.contains(text));
    assert!(said("the tint of the reflection became a part") && said("black back sides"));
    assert!(!read.materials.iter().any(|m| m.name.contains("back")));
    let found = read.materials.iter().find(|m| m.name.contains("gold")).expect("gold");
    let MaterialKind::Conductor(found) = &found.kind else { panic!("{found:?}") };
    let ConductorSpectrum::Color(color) = &found.spectrum else { panic!("{found:?}") };
    let Rgb { r, g, b } = color.factor;
    assert!((0.27..0.3).contains(&r) && g < r && b < g, "{color:?}");
    assert!((found.roughness.factor - conductor.roughness.factor).abs() < 1e-3);
    assert!((found.anisotropy.factor - conductor.anisotropy.factor).abs() < 1e-3);
}

#[test]
fn every_built_in_scene_can_be_written_in_every_format_and_read_again() {
    for builtin in BUILTINS {
        let scene = (builtin.make)();
        // A small scene is as good a test as a large one.
        if snell_scene::placed::placement_count(&scene).is_ok_and(|n| n > 100) {
            continue;
        }
        for writer in WRITERS {
            let path = Path::new("out").with_extension(writer.extensions[0]);
            let mut output = Output::new(&path, Available::UNKNOWN);
            (writer.write)(&scene, &mut output)
                .unwrap_or_else(|e| panic!("{} as {}: {e}", builtin.name, writer.name));
            if !output.files.is_empty() {
                continue;
            }
            let read = crate::read_scene_bytes(
                writer.name,
                output.main,
                Path::new("."),
                &ReadOptions::default(),
            );
            read.unwrap_or_else(|e| panic!("{} as {}: {e}", builtin.name, writer.name));
        }
    }
}

#[test]
fn every_material_can_be_written_and_what_changes_is_said() {
    for extension in ["glb", "pbrt", "obj"] {
        let mut scene = scene();
        for (i, kind) in MaterialKind::examples().into_iter().enumerate() {
            let id = scene.add_material(Material::new(format!("number {i}"), kind));
            // The boxes are small, because the tests below do not look at their triangles.
            let small = BoxShape { min: DVec3::ZERO, max: DVec3::splat(0.1) };
            scene.nodes[1].surfaces.push(Surface::shape(small, id));
        }
        let (_folder, _, read) = written(extension, &scene);
        // pbrt has no interface without a medium.
        let warnings: Vec<_> =
            read.warnings.iter().filter(|w| !w.message.contains("bound no medium")).collect();
        assert!(
            read.materials.len() + 2 >= scene.materials.len() && warnings.is_empty(),
            "{extension}: {warnings:?}"
        );
    }
}

#[test]
fn fire_shines_as_pbrt_too_where_nothing_is_burnt() {
    let scene = snell_scene::builtin::builtin("smoke").expect("the scene is built in");
    let (_folder, Written { losses, .. }, read) = written("pbrt", &scene);
    assert!(losses.iter().any(|l| l.message.contains("where it emits")), "{losses:?}");
    let [Medium::Grid(before), Medium::Grid(after)] = [&scene.media[0], &read.media[0]] else {
        panic!("grids")
    };
    let shine = |grid: &Grid| {
        let scale = grid.emission_scale.as_ref().expect("it shines in places");
        scale.values().iter().map(|s| s * grid.emission.r).collect::<Vec<_>>()
    };
    let (a, b) = (shine(before), shine(after));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-4 * a.abs()), "it shines as before");
    let denser = before
        .density
        .values()
        .iter()
        .zip(after.density.values())
        .map(|(a, b)| b - a)
        .fold(0.0, f32::max);
    assert!((0.0..2e-3).contains(&denser), "{denser}");
}

#[test]
fn smoke_of_many_colours_has_them_in_pbrt_too() {
    use snell_scene::medium::{ColorGrid, ScalarGrid};
    let numbers = |n: usize, step: usize| (0..n).map(move |i| (i * step % 7) as f32 / 7.0);
    let colors = |step: usize| {
        let colors =
            numbers(12, step).zip(numbers(12, 4)).map(|(a, b)| Rgb::new(a, b, 1.0)).collect();
        ColorGrid::new([2, 3, 2], colors).map(Arc::new)
    };
    let density =
        ScalarGrid::new([2, 3, 2], (1..13).map(|i| i as f32).collect()).expect("as many as cells");
    let place =
        DAffine3::from_translation(DVec3::X) * DAffine3::from_scale(DVec3::new(2.0, 3.0, 4.0));
    let grid = Grid {
        emission: Rgb::new(1.0, 0.0, 2.0),
        sigma_s_tint: colors(3),
        emission_tint: colors(5),
        ..Grid::new(Rgb::new(0.5, 1.0, 2.0), Rgb::splat(3.0), 0.25, density, place)
    };
    let mut scene = scene();
    let medium = scene.add_medium(grid.clone());
    let boundary = scene.add_material(Material::interface("smoke", medium));
    scene.nodes[1]
        .surfaces
        .push(Surface::shape(BoxShape { min: DVec3::ZERO, max: DVec3::ONE }, boundary));
    let (_folder, _, read) = written("pbrt", &scene);
    let [Medium::Grid(read)] = &read.media[..] else { panic!("one grid: {:?}", read.media) };
    for i in 0..12 {
        let p = DVec3::new(
            (i % 2) as f64 / 2.0 + 0.25,
            (i / 2 % 3) as f64 / 3.0 + 1.0 / 6.0,
            (i / 6) as f64 / 2.0 + 0.25,
        );
        let [a, b] = [&grid, read].map(|grid| {
            grid.properties(
                grid.world_from_grid.transform_point3(p).as_vec3(),
                snell_math::ColorMode::Rgb,
            )
        });
        for (a, b) in [(a.sigma_a, b.sigma_a), (a.sigma_s, b.sigma_s), (a.emission, b.emission)] {
            assert!(
                (0..3).all(|c| (a[c] - b[c]).abs() <= 1e-4 * a[c].abs().max(1.0)),
                "cell {i}: {a:?} became {b:?}"
            );
        }
    }
}

#[test]
fn nothing_foreign_is_replaced_unless_wished() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a b.obj");
    write_scene_as(&path, &scene(), false).expect("nothing is there");
    write_scene_as(&path, &scene(), false).expect("the same is there");
    let beside = folder.path().join("a_b-files/materials.mtl");
    std::fs::write(&beside, "mine").expect("the folder is writable");
    let error =
        write_scene_as(&path, &scene(), false).expect_err("another file is there").to_string();
    assert!(
        error.contains("materials.mtl: the file exists") && error.contains("--force"),
        "{error}"
    );
    assert_eq!(std::fs::read(&beside).expect("it is there"), b"mine");
    write_scene_as(&path, &scene(), true).expect("it may be replaced");
    assert!(check_scene_path(&path, false).is_err() && check_scene_path(&path, true).is_ok());
    assert!(check_scene_path(&folder.path().join("a.xyz"), true).is_err());
}

#[test]
fn too_many_instances_are_an_error() {
    let mut scene = scene();
    let mut below = scene.root;
    for _ in 0..40 {
        below = scene.add_node(Node { children: vec![below, below], ..Node::default() });
    }
    scene.root = below;
    for writer in WRITERS.iter().filter(|w| w.name != "snell") {
        let mut output = Output::new(Path::new("out.x"), Available::UNKNOWN);
        let error = (writer.write)(&scene, &mut output).expect_err("a billion quads");
        assert!(error.contains("limit"), "{error}");
    }
}

#[test]
fn what_does_not_fit_into_memory_is_refused_before_it_is_made() {
    let mut scene = Scene::new("a million spheres");
    let ball = Geometry::Shape(Arc::new(snell_intersect::shape::Sphere { radius: 1.0 }.into()));
    let mut below = scene.add_node(Node { surfaces: vec![Surface::new(ball)], ..Node::default() });
    for _ in 0..5 {
        below = scene.add_node(Node { children: vec![below; 10], ..Node::default() });
    }
    scene.root = below;
    let available = Available { bytes: 100_000_000, limit: crate::memory::Limit::Machine };
    for writer in WRITERS.iter().filter(|w| !matches!(w.name, "snell" | "pbrt")) {
        let mut output = Output::new(Path::new("out.x"), available);
        let error = (writer.write)(&scene, &mut output).expect_err("more than a hundred megabytes");
        let parts = ["instances counted each", "nodes and surfaces", ".snell"];
        assert!(
            parts[..2].iter().any(|part| error.contains(part)) && error.contains(parts[2]),
            "{error}"
        );
    }
}

/// A scene with a sphere of each pattern: as reflectance, and one of them as roughness.
fn patterns() -> Scene {
    use snell_scene::texture::Pattern;
    let mut scene = Scene::new("patterns");
    let examples = Pattern::examples();
    for (i, pattern) in examples.into_iter().enumerate() {
        let id = scene.add_texture(pattern);
        let reflectance =
            snell_scene::material::ColorParam::textured(Rgb::new(0.5, 0.75, 0.5), Some(id));
        let kind = snell_scene::material::Diffuse { reflectance };
        let id = scene.add_material(Material::new(format!("number {i}"), kind));
        let surface = Surface::shape(snell_intersect::shape::Sphere { radius: 0.1 }, id);
        scene.nodes[0].surfaces.push(surface);
    }
    scene
}

/// The reflectance of a material at a few points in space.
fn reflectances(scene: &Scene, material: &Material) -> Vec<Rgb> {
    let textures = snell_scene::TextureSet::new(&scene.textures, &scene.images);
    let MaterialKind::Diffuse(kind) = &material.kind else { panic!("{material:?}") };
    // The pbrt reader mirrors a scene whose camera would be mirrored.
    let root = scene.nodes[scene.root.index()].transform;
    let colors = (0..50u32).map(|i| {
        let (a, b) =
            (snell_math::rng::uniform2([i, 1, 0, 0]), snell_math::rng::uniform2([i, 2, 0, 0]));
        let normal =
            root.transform_vector3(snell_math::sampling::uniform_sphere(a).as_dvec3()).as_vec3();
        let position = Vec3::new(a.x, a.y, b.x) * 4.0 - 2.0;
        let position = root.transform_point3(position.as_dvec3()).as_vec3();
        let surface = snell_scene::texture::surface_at(position, normal, b);
        let (mode, footprint) = (snell_math::ColorMode::Rgb, 0.0);
        let point = snell_scene::material::ShadingPoint {
            surface: &surface,
            footprint,
            textures: &textures,
            mode,
            outside_ior: 1.0,
        };
        kind.reflectance.at(&point).rgb
    });
    colors.collect()
}

#[test]
fn patterns_are_the_same_in_pbrt_and_in_snells_own_format() {
    let scene = patterns();
    for extension in ["snell", "pbrt"] {
        let (_folder, Written { losses, .. }, read) = written(extension, &scene);
        if extension == "snell" {
            assert!(losses.is_empty() && read.textures == scene.textures, "{losses:?}");
        }
        assert!(read.warnings.is_empty(), "{:?}", read.warnings);
        for material in &scene.materials {
            // The materials read are named after the number of the written one, in the order of the
            // spheres.
            let found = read.materials.iter().find(|m| {
                m.name.starts_with(&material.name) && {
                    let rest = &m.name[material.name.len()..];
                    rest.is_empty() || rest.starts_with(' ')
                }
            });
            let found = found.unwrap_or_else(|| panic!("{extension}: {}", material.name));
            let texture = match &material.kind {
                MaterialKind::Diffuse(kind) => kind.reflectance.texture.expect("it has one"),
                _ => unreachable!("all are diffuse"),
            };
            let pattern = &scene.textures[texture.index()];
            for (a, b) in reflectances(&scene, material).into_iter().zip(reflectances(&read, found))
            {
                let close = a
                    .to_array()
                    .iter()
                    .zip(b.to_array())
                    .all(|(a, b)| (a - b).abs() < 2e-3 * (1.0 + a.abs()));
                // The amount of a mix is a number in pbrt, and so is the tint of marble; losses
                // report both.
                let is_lost =
                    losses.iter().any(|l| l.message.contains(&format!("\"{}\"", material.name)));
                assert!(close || is_lost, "{extension}: {pattern:?}: {a:?} {b:?}; {losses:?}");
            }
        }
    }
}

#[test]
fn other_formats_say_which_patterns_they_lack() {
    let scene = patterns();
    for extension in ["gltf", "obj"] {
        let (_folder, Written { losses, .. }, read) = written(extension, &scene);
        let said = |what: &str| losses.iter().any(|loss| loss.message.contains(what));
        assert!(
            said("(marble) is a pattern in space")
                && said("(checkerboard) is drawn into a picture"),
            "{losses:?}"
        );
        assert!(read.textures.iter().all(|texture| texture.as_image().is_some()));
    }
}

#[test]
fn a_mesh_far_from_zero_keeps_its_shape_in_every_format() {
    let obj = "v 500000.25 4649776.5 100\nv 500000.55 4649776.5 100\nv 500000.55 4649776.8 100\n\
        f 1 2 3\n";
    let options = ReadOptions::default();
    let scene = crate::read_scene_bytes("a.obj", obj.into(), Path::new("."), &options);
    let scene = scene.unwrap_or_else(|e| panic!("{e}"));
    for extension in ["snell", "glb", "pbrt", "obj", "ply", "stl", "off"] {
        let (_folder, written, read) = written(extension, &scene);
        let bounds = read.bounds().expect("no cycle");
        let size = bounds.max - bounds.min;
        assert!(
            (size - snell_math::DVec3::new(0.3, 0.3, 0.0)).length() < 1e-5,
            "{extension}: {size}"
        );
        let is_moved = bounds.min.abs().max_element() < 10.0;
        let is_told = written.losses.iter().any(|loss| loss.message.contains("moved by -500000"));
        assert_eq!(is_moved, is_told, "{extension}: {:?}", written.losses);
    }
}
