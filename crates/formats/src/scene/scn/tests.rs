use super::*;
use crate::scene::testing::{
    self, data, error_of, files, geometries, meshes, read_in, read_text, summary,
};
use snell_intersect::{AnyShape, Shape};
use snell_math::{DVec3, Rgb};
use snell_scene::light::{Directional, Disk, Point, Rectangle, Spot};
use snell_scene::material::{MaterialKind, Phong};
use snell_scene::{Background, Geometry, Light, NodeId, Projection};

const MATERIAL: &str = "material .1 .2 .3  1 0 0  .5 .5 .5  0 0 0  0 0 0  20 1.5 0\n";

fn scene(text: &str) -> Scene {
    read_text(&READER, text).expect("the scene is well-formed")
}

fn phong(scene: &Scene, id: MaterialId) -> Phong {
    match &scene.materials[id.index()].kind {
        MaterialKind::Phong(phong) => phong.clone(),
        other => panic!("expected a Phong material, found {}", other.name()),
    }
}

/// World bounds and material of every surface, in the order of a depth-first walk.
fn placed(scene: &Scene) -> Vec<(DVec3, DVec3, Option<MaterialId>)> {
    fn walk(
        scene: &Scene,
        id: NodeId,
        world: snell_math::DAffine3,
        material: Option<MaterialId>,
        all: &mut Vec<(DVec3, DVec3, Option<MaterialId>)>,
    ) {
        let node = &scene.nodes[id.index()];
        let world = world * node.transform;
        let material = node.material.or(material);
        for surface in &node.surfaces {
            let placed = snell_math::Transform::new(world)
                .expect("not singular")
                .bounds(&surface.geometry.bounds());
            let own = surface.materials.first().copied().flatten();
            all.push((placed.min, placed.max, own.or(material)));
        }
        for &child in &node.children {
            walk(scene, child, world, material, all);
        }
    }
    let mut all = Vec::new();
    walk(scene, scene.root, snell_math::DAffine3::IDENTITY, None, &mut all);
    all
}

#[test]
fn every_public_scene_loads_with_all_it_holds() {
    let Some(folder) = data("scn/scenes") else { return };
    let mut lines = Vec::new();
    for file in files(&folder, "scn") {
        let scene = crate::read_scene(&file, &Default::default()).unwrap_or_else(|e| panic!("{e}"));
        lines.push(format!("{}: {}", scene.name, summary(&scene)));
    }
    insta::assert_snapshot!(lines.join("\n"), @r##"
    box: 1 box, 1 material, lights [point], 1 camera
    caustic: 1 box, 1 sphere, 2 material, lights [point], 1 camera
    cornell: 3 mesh, 1 sphere, 10 triangle, 4 material, lights [point], 1 camera
    cylinder: 1 cylinder, 1 material, lights [point point], 1 camera
    debug: 1 sphere, 1 material, lights [point], 1 camera, 12x "`line` has no surface and is not drawn"
    dirlight1: 1 box, 1 sphere, 1 material, lights [directional], 1 camera
    dirlight2: 1 box, 1 sphere, 1 material, lights [directional directional directional], 1 camera
    distributed: 4 mesh, 3 sphere, 12 triangle, 6 material, lights [point], 1 camera
    fourspheres: 4 sphere, 4 material, lights [point], 1 camera
    glass_spheres: 1 mesh, 4 sphere, 1 triangle, 5 material, lights [spot], 1 camera
    ico: 1 mesh, 20 triangle, 1 material, lights [point], 1 camera
    jensen: 4 mesh, 2 sphere, 12 triangle, 6 material, lights [rectangle], 1 camera
    lights: 8 sphere, 1 material, lights [point point spot], 1 camera
    lines: 0 material, lights [directional directional], 1 camera, 12x "`line` has no surface and is not drawn"
    pointlight1: 1 box, 1 sphere, 1 material, lights [point], 1 camera
    pointlight2: 1 box, 1 sphere, 1 material, lights [point point point], 1 camera
    refraction: 5 sphere, 5 material, lights [point], 1 camera
    shininess: 4 sphere, 4 material, lights [point], 1 camera
    softshadow: 1 box, 2 sphere, 3 material, lights [disk], 1 camera
    specular: 1 box, 2 sphere, 3 material, lights [point directional], 1 camera
    sphere: 1 sphere, 1 material, lights [point], 1 camera
    spotlight1: 1 box, 1 sphere, 1 material, lights [spot], 1 camera
    spotlight2: 1 box, 1 sphere, 1 material, lights [spot spot spot], 1 camera, background 0.9 0.9 0.9
    stack: 1 box, 5 mesh, 7260 triangle, 2 material, lights [point point point directional], 1 camera
    teapot: 1 mesh, 1452 triangle, 1 material, lights [point], 1 camera
    transform: 7 sphere, 4 material, lights [directional directional], 1 camera
    transmission: 5 sphere, 5 material, lights [directional directional], 1 camera
    "##);
}

#[test]
fn a_material_keeps_all_its_numbers() {
    let scene =
        scene("material 1 2 3  4 5 6  7 8 9  10 11 12  13 14 15  16 17 0\nsphere 0  0 0 0 1");
    let phong = phong(&scene, MaterialId(0));
    assert_eq!(phong.ambient.factor, Rgb::new(1.0, 2.0, 3.0));
    assert_eq!(phong.diffuse.factor, Rgb::new(4.0, 5.0, 6.0));
    assert_eq!(phong.specular.factor, Rgb::new(7.0, 8.0, 9.0));
    assert_eq!(phong.reflection.factor, Rgb::new(7.0, 8.0, 9.0));
    assert_eq!(phong.transmission.factor, Rgb::new(10.0, 11.0, 12.0));
    assert_eq!((phong.shininess, phong.ior), (16.0, 17.0));
    let material = &scene.materials[0];
    assert_eq!(material.emission.factor, Rgb::new(13.0, 14.0, 15.0));
    assert!(material.emits_on_both_sides);
}

#[test]
fn what_names_no_material_gets_the_grey_of_the_assignment_once() {
    let scene = scene("sphere -1  0 0 0 1\nbox -7  0 0 0  1 1 1");
    assert_eq!(scene.materials.len(), 1);
    assert_eq!(placed(&scene).iter().map(|p| p.2).collect::<Vec<_>>(), [Some(MaterialId(0)); 2]);
    let grey = phong(&scene, MaterialId(0));
    assert_eq!((grey.ambient.factor, grey.diffuse.factor), (Rgb::splat(0.2), Rgb::splat(0.5)));
    assert_eq!((grey.specular.factor, grey.transmission.factor), (Rgb::splat(0.5), Rgb::BLACK));
    assert_eq!((grey.shininess, grey.ior), (10.0, 1.0));
}

#[test]
fn solids_stand_centered_on_their_point() {
    let scene = scene("cylinder -1  1 2 3  .5 4\ncone -1  -1 -2 -3  1 2\nsphere -1  0 0 9  2");
    let bounds: Vec<_> = placed(&scene).into_iter().map(|(min, max, _)| (min, max)).collect();
    let expected = [
        (DVec3::new(0.5, 0.0, 2.5), DVec3::new(1.5, 4.0, 3.5)),
        (DVec3::new(-2.0, -3.0, -4.0), DVec3::new(0.0, -1.0, -2.0)),
        (DVec3::new(-2.0, -2.0, 7.0), DVec3::new(2.0, 2.0, 11.0)),
    ];
    assert_eq!(bounds, expected);
}

#[test]
fn a_cone_points_up() {
    let scene = scene("cone -1  0 0 0  1 2");
    let Geometry::Shape(cone) = &geometries(&scene)[0] else { panic!("expected a shape") };
    // A ray through the axis of a cone at 3/4 of its height passes a quarter of the base's radius
    // away from it.
    let ray = snell_math::DRay {
        origin: DVec3::new(-5.0, 0.5, 0.0),
        direction: DVec3::X,
        t_min: 0.0,
        t_max: f64::INFINITY,
    };
    let hit = cone.closest(&ray).expect("the ray meets the cone");
    assert!((hit.t - 4.75).abs() < 1e-12, "{}", hit.t);
}

#[test]
fn a_circle_faces_along_its_normal() {
    let scene = scene("circle -1  1 2 3  0 5 0  2");
    let (min, max, _) = placed(&scene)[0];
    assert!(min.distance(DVec3::new(-1.0, 2.0, 1.0)) < 1e-12, "{min}");
    assert!(max.distance(DVec3::new(3.0, 2.0, 5.0)) < 1e-12, "{max}");
}

#[test]
fn the_corners_of_a_box_may_come_in_any_order() {
    let scene = scene("box -1  1 -1 -1  3 -3 1");
    let (min, max, _) = placed(&scene)[0];
    assert_eq!((min, max), (DVec3::new(1.0, -3.0, -1.0), DVec3::new(3.0, -1.0, 1.0)));
}

#[test]
fn triangles_of_a_group_and_material_become_one_mesh() {
    let tri = |m: i32, x: i32| format!("tri {m}  {x} 0 0  {x} 1 0  {x} 0 1\n");
    let text = format!(
        "{MATERIAL}{}{}sphere 0 0 0 0 1 {}{}begin -1 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 {} end",
        tri(0, 1),
        tri(0, 2),
        tri(-1, 3),
        tri(0, 4),
        tri(0, 5)
    );
    let sizes: Vec<_> = meshes(&scene(&text)).iter().map(|m| m.indices.len()).collect();
    assert_eq!(sizes, [1, 1, 3], "the group, the default material, material 0");
    let mesh = &meshes(&scene(&tri(-1, 7)))[0];
    assert_eq!(
        mesh.corners(0).map(|p| p.to_array()),
        [[7.0, 0.0, 0.0], [7.0, 1.0, 0.0], [7.0, 0.0, 1.0]]
    );
}

#[test]
fn transforms_nest_outer_first_and_matrices_are_row_by_row() {
    let text = "begin -1  1 0 0 10  0 1 0 0  0 0 1 0  0 0 0 1
                begin -1  2 0 0 1   0 2 0 0  0 0 2 0  0 0 0 1
                sphere -1  0 0 0  1  end end";
    let (min, max, _) = placed(&scene(text))[0];
    assert_eq!((min, max), (DVec3::new(9.0, -2.0, -2.0), DVec3::new(13.0, 2.0, 2.0)));
}

#[test]
fn a_matrix_is_divided_by_its_last_element() {
    let (min, max, _) =
        placed(&scene("begin -1  1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 2 sphere -1 0 0 0 1 end"))[0];
    assert_eq!((min.x, max.x), (-0.5, 0.5));
}

#[test]
fn a_group_passes_its_material_on_to_what_has_none() {
    const IDENTITY: &str = "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1";
    let text = format!(
        "{MATERIAL}{MATERIAL}begin 1 {IDENTITY} sphere -1 0 0 0 1  sphere 0 0 0 0 2
         begin -1 {IDENTITY} sphere -1 0 0 0 3 end end sphere -1 0 0 0 4"
    );
    let scene = scene(&text);
    let mut by_radius: Vec<_> =
        placed(&scene).iter().map(|(_, max, m)| (max.x, m.expect("a material").0)).collect();
    by_radius.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The default material is stored when it is first needed, so it is the third.
    assert_eq!(by_radius, [(1.0, 1), (2.0, 0), (3.0, 1), (4.0, 2)]);
}

#[test]
fn lights_and_camera_stand_in_the_world_whatever_group_is_open() {
    let text = "begin -1  2 0 0 10  0 2 0 0  0 0 2 0  0 0 0 1
                point_light 1 1 1  1 2 3  0 0 1
                camera 4 5 6  0 0 -2  0 3 1  .3  .1 9 end";
    let scene = scene(text);
    let Light::Point(Point { position, .. }) = scene.lights[0] else { panic!("no point light") };
    assert_eq!(position, DVec3::new(1.0, 2.0, 3.0));
    let camera = &scene.cameras[0];
    assert_eq!((camera.eye, camera.towards), (DVec3::new(4.0, 5.0, 6.0), DVec3::NEG_Z));
    assert_eq!(camera.up, DVec3::Y);
}

#[test]
fn the_field_of_view_is_half_of_the_horizontal_angle() {
    let scene = scene("camera 0 0 0  0 0 -1  0 1 0  0.25  .1 9");
    assert_eq!(
        scene.cameras[0].projection,
        Projection::Perspective { tan_half_fov: [Some(0.25f64.tan()), None] }
    );
    assert_eq!(scene.settings.size, Some([256, 256]));
    assert!(scene.settings.raw_display);
    assert_eq!(scene.settings.integrator.as_deref(), Some("whitted"));
}

#[test]
fn the_last_camera_counts() {
    let scene = scene("camera 1 0 0  0 0 -1  0 1 0  .2 .1 9 camera 2 0 0  0 0 -1  0 1 0  .2 .1 9");
    assert_eq!(scene.cameras.iter().map(|c| c.eye.x).collect::<Vec<_>>(), [2.0]);
}

#[test]
fn without_a_camera_the_scene_is_framed_from_the_front() {
    let scene = scene("box -1  0 0 0  2 2 4");
    let radius = 6f64.sqrt();
    let camera = &scene.cameras[0];
    assert!(camera.eye.distance(DVec3::new(1.0, 1.0, 2.0 + 3.0 * radius)) < 1e-12);
    assert_eq!((camera.towards, camera.up), (DVec3::NEG_Z, DVec3::Y));
    assert_eq!(
        camera.projection,
        Projection::Perspective { tan_half_fov: [Some(0.25f64.tan()), None] }
    );
    assert!(self::scene("").cameras.is_empty(), "nothing to frame");
}

#[test]
fn without_lights_there_are_two_and_with_one_there_is_one() {
    let two = scene("sphere -1 0 0 0 1").lights;
    let pi = std::f32::consts::PI;
    let expected =
        [(-DVec3::new(3.0, 4.0, 5.0), 1.0), (DVec3::new(3.0, 2.0, 3.0), 0.5)].map(|(d, c)| {
            Directional { direction: d.normalize(), irradiance: Rgb::splat(c * pi) }.into()
        });
    assert_eq!(two, expected);
    assert_eq!(scene("point_light 0 0 0  0 0 0  0 0 1").lights.len(), 1, "a black light counts");
}

#[test]
fn colors_of_lights_are_radiometric() {
    let scene = scene(
        "dir_light 1 2 3  0 -2 0
         spot_light 1 2 3  0 0 0  0 0 3  1 2 3  .5 7
         area_light 1 2 3  0 0 0  0 0 3  .5  1 2 3
         rect_light 1 2 3  0 0 0  3 0 0  0 3 0  4 5  1 2 3",
    );
    let pi = std::f32::consts::PI;
    let color = Rgb::new(pi, 2.0 * pi, 3.0 * pi);
    let attenuation = snell_scene::light::Attenuation([1.0, 2.0, 3.0]);
    let falloff = snell_scene::light::SpotFalloff::Power { cutoff: 0.5, exponent: 7.0 };
    let (origin, z) = (DVec3::ZERO, DVec3::Z);
    let expected = [
        Directional { direction: DVec3::NEG_Y, irradiance: color }.into(),
        Spot { position: origin, direction: z, intensity: color, attenuation, falloff }.into(),
        Disk { position: origin, direction: z, radius: 0.5, emission: color, attenuation }.into(),
        Rectangle {
            center: origin,
            axes: [DVec3::X, DVec3::Y],
            lengths: [4.0, 5.0],
            emission: color,
            attenuation,
        }
        .into(),
    ];
    assert_eq!(scene.lights, expected);
}

#[test]
fn background_and_ambient_are_colors_as_they_stand() {
    let scene = scene("background .1 .2 .3 # blue\nambient 4 5 6");
    assert_eq!(scene.background, Background::Color(Rgb::new(0.1, 0.2, 0.3)));
    assert_eq!(scene.ambient, Rgb::new(4.0, 5.0, 6.0));
}

#[test]
fn a_singular_group_is_left_out_but_its_lights_are_not() {
    let scene = scene(
        "begin -1 1 0 0 0  0 0 0 0  0 0 1 0  0 0 0 1 sphere -1 0 0 0 1 dir_light 1 1 1 0 0 1 end",
    );
    assert!(geometries(&scene).is_empty());
    assert_eq!((scene.lights.len(), scene.warnings.len()), (1, 1));
}

#[test]
fn lines_are_not_drawn_but_framed() {
    let scene = scene("line -1  -1 -1 -1  1 1 1\nline -1 0 0 0 1 1 1");
    assert_eq!(scene.warnings.iter().map(|w| w.count).collect::<Vec<_>>(), [2]);
    assert!((scene.cameras[0].eye.z - 3.0 * 3f64.sqrt()).abs() < 1e-12);
}

#[test]
fn an_included_file_has_materials_of_its_own_in_the_current_group() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("parts")).expect("a folder");
    let part = format!(
        "{MATERIAL}sphere 0  0 0 0 1\nsphere -1  0 0 0 2\ninclude deeper.scn\nambient 1 2 3"
    );
    std::fs::write(folder.path().join("parts/part.scn"), part).expect("written");
    std::fs::write(folder.path().join("parts/deeper.scn"), "dir_light 1 1 1  0 0 1")
        .expect("written");
    let text = format!(
        "{MATERIAL}{MATERIAL}begin 1  1 0 0 5  0 1 0 0  0 0 1 0  0 0 0 1  include parts/part.scn \
            end  sphere 1 0 0 0 3"
    );
    let scene = read_in(&READER, folder.path(), &text).expect("the scene is well-formed");
    let mut all: Vec<_> = placed(&scene)
        .iter()
        .map(|(min, max, m)| (min.x, max.x, m.expect("a material").0))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(
        all,
        [(-3.0, 3.0, 1), (3.0, 7.0, 3), (4.0, 6.0, 2)],
        "the default material is the fourth"
    );
    assert_eq!(scene.ambient, Rgb::new(1.0, 2.0, 3.0));
    assert_eq!(
        scene.lights.len(),
        1,
        "no default lights from an include that ends before the first light"
    );
}

#[test]
fn a_file_that_includes_itself_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("a.scn"), "include b.scn").expect("written");
    std::fs::write(folder.path().join("b.scn"), "\n include a.scn").expect("written");
    let error = crate::read_scene(&folder.path().join("a.scn"), &Default::default())
        .expect_err("a cycle")
        .to_string();
    assert!(
        error.ends_with(
            "b.scn:2:10: the file includes itself through \"a.scn\"; remove this include"
        ),
        "{error}"
    );
}

#[test]
fn a_mesh_used_twice_is_stored_once() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("t.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
        .expect("written");
    let scene = read_in(&READER, folder.path(), "mesh -1 t.off\nmesh -1 t.off")
        .expect("the scene is well-formed");
    let meshes = meshes(&scene);
    assert_eq!(meshes.len(), 2);
    assert!(Arc::ptr_eq(&meshes[0], &meshes[1]));
}

#[test]
fn a_texture_multiplies_the_diffuse_color_and_is_read_once() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("t.ppm"), b"P6 1 1 255\n\xff\x80\x00").expect("written");
    let material = "material 0 0 0  .5 1 1  0 0 0  0 0 0  0 0 0  1 1 t.ppm\n";
    let scene =
        read_in(&READER, folder.path(), &material.repeat(2)).expect("the scene is well-formed");
    assert_eq!((scene.textures.len(), scene.images.len()), (1, 1));
    for id in 0..2 {
        let diffuse = phong(&scene, MaterialId(id)).diffuse;
        assert_eq!(
            (diffuse.factor, diffuse.texture),
            (Rgb::new(0.5, 1.0, 1.0), Some(snell_scene::TextureId(0)))
        );
    }
    let missing = read_in(&READER, folder.path(), &material.replace("t.ppm", "none.ppm"))
        .expect_err("no such file");
    assert!(missing.to_string().starts_with("test:1:50: "), "{missing}");
}

#[test]
fn textures_are_upright_on_meshes_as_on_shapes() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    std::fs::write(folder.path().join("t.obj"), text).expect("written");
    let scene = read_in(&READER, folder.path(), "mesh -1 t.obj").expect("the scene is well-formed");
    let mesh = &meshes(&scene)[0];
    // The upper corner shows the first row of the image.
    let top = mesh.positions.iter().position(|p| p.y == 1.0).expect("the upper corner");
    assert_eq!(mesh.uvs[0][top].to_array(), [0.0, 0.0]);
}

#[test]
fn equal_shapes_are_stored_once() {
    let shapes = geometries(&scene("sphere -1  0 0 0 1\nsphere -1  5 0 0 1"));
    let [Geometry::Shape(a), Geometry::Shape(b)] = &shapes[..] else {
        panic!("expected two shapes")
    };
    assert!(Arc::ptr_eq(a, b));
    assert!(matches!(**a, AnyShape::Sphere(_)));
}

#[test]
fn comments_stand_only_where_a_command_could() {
    assert_eq!(
        geometries(&scene("# sphere\n#sphere -1 0 0 0 1\nsphere -1 0 0 0 1 # a ball\n")).len(),
        1
    );
    insta::assert_snapshot!(error_of(&READER, "sphere -1 0 0\n # center\n 0 \
        1"), @r##"test:2:2: found "#", expected the center of the sphere, a number; move the comment to where a command could start"##);
}

#[test]
fn errors_name_the_place_and_the_way_out() {
    let errors = [
        "sphere -1 0 0 0 1\n  spere -1 0 0 0 1",
        "particle 1 2 3",
        "\nsphere -1 0 0 zero 1",
        "sphere 0.5 0 0 0 1",
        "camera 0 0 0  0 0 -1  0 1 0  .25 .1",
        "sphere -1 0 0 0 -1",
        "sphere -1 1e300 0 0 1",
        "sphere -1 nan 0 0 1",
        "sphere 0 0 0 0 1",
        "material 0 0 0  0 0 0  0 0 0  0 0 0  0 0 0  0 1 0\nsphere 3  0 0 0 1",
        "begin -1 1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\nsphere -1 0 0 0 1\n",
        "sphere -1 0 0 0 1 end",
        "begin -1 1 0 0 0  0 1 0 0  0 0 1 0  0 0 .1 1 end",
        "camera 0 0 0  0 0 -1  0 1 0  1.6 .1 100",
        "camera 0 0 0  0 0 0  0 1 0  .6 .1 100",
        "dir_light 1 1 1  0 0 0",
        "rect_light 1 1 1  0 0 0  1 0 0  2 0 0  1 1  0 0 1",
        "mesh -1 no-such-file.off",
        "include no-such-file.scn",
        "include ../../../../etc/passwd",
    ];
    let messages: Vec<_> = errors.iter().map(|text| error_of(&READER, text)).collect();
    insta::assert_snapshot!(messages.join("\n"), @r##"
    test:2:3: unknown command "spere"; check the number of arguments of the command before it; the commands are ambient, area_light, background, begin, box, camera, circle, cone, cylinder, dir_light, end, include, line, material, mesh, point_light, rect_light, sphere, spot_light, tri
    test:1:1: unknown command "particle"; remove it: particle systems belong to another assignment
    test:2:15: found "zero", expected the center of the sphere, a number; write it as: sphere material center(3) radius
    test:1:8: found "0.5", expected a material id, a whole number; write it as: sphere material center(3) radius
    test:1: the file ends where the near or far distance was expected; write it as: camera eye(3) towards(3) up(3) xfov neardist fardist
    test:1:17: the radius of the sphere is negative (-1); use a positive number
    test:1:11: the center of the sphere is "1e300", which is not a number that can be rendered; use a finite number below 3.4e38
    test:1:11: the center of the sphere is "nan", which is not a number that can be rendered; use a finite number below 3.4e38
    test:1:8: material 0 is used, but this file has defined none so far; define the material above its first use, or use -1 for the group's material
    test:2:8: material 3 is used, but so far this file has defined only material 0; define the material above its first use, or use -1 for the group's material
    test:1:1: this `begin` has no `end`; close the group with `end`; is the file cut off?
    test:1:19: this `end` has no `begin`; remove it
    test:1:10: the last row of the group's matrix is [0, 0, 0.1, 1], a projection; use an affine matrix: four rows of four numbers, the last row 0 0 0 1
    test:1:30: the half-angle of view is 1.6; use radians above 0 and below pi / 2 for half of the horizontal angle of view
    test:1:15: the view direction is the zero vector, which points nowhere; give at least one coordinate that is not 0
    test:1:18: the direction of the light is the zero vector, which points nowhere; give at least one coordinate that is not 0
    test:1:26: the axes of the light are parallel and span no rectangle; use perpendicular axes
    test:1:9: ./no-such-file.off: cannot open: No such file or directory (os error 2); check the name and that you may read it
    test:1:9: ./no-such-file.scn: cannot open: No such file or directory (os error 2); check the name and that you may read it
    test:1:9: it names the file "../../../../etc/passwd", which lies outside of the scene's folder; move the file into the folder, or leave out --confine (confine=True)
    "##);
}

#[test]
fn nesting_beyond_the_limit_is_refused() {
    let text = "begin -1 1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1\n".repeat(100_000);
    let error = error_of(&READER, &text);
    assert!(
        error.starts_with("test:513:1: groups and includes are nested deeper than 512"),
        "{error}"
    );
}

#[test]
fn the_language_is_recognised_by_its_first_command() {
    for text in
        [MATERIAL, "# hi\n\n  camera 0 0 1 0 0 0", "sphere -1 0 0 0 1", "background\n.1 .1 .1"]
    {
        assert!((READER.recognises)(text.as_bytes()), "{text}");
    }
    for text in [
        "",
        "v 1 2 3",
        "OFF 3 1 0",
        "Camera \"perspective\"",
        "material gold",
        "v\nfrom 1 2 3",
        "{}",
    ] {
        assert!(!(READER.recognises)(text.as_bytes()), "{text}");
    }
}

#[test]
fn broken_files_end_in_errors() {
    let seed = format!(
        "{MATERIAL}camera 0 0 5  0 0 -1  0 1 0  .25 .1 9\nbegin 0  1 0 0 1  0 2 0 0  0 0 1 0  0 0 \
            0 1\n\
         tri -1 0 0 0 1 0 0 0 1 0\ncone -1 0 0 0 1 2\ncircle 0 0 0 0 0 0 1 2\n# done\nend\nline -1 \
         0 0 0 1 1 1\n\
         spot_light 1 1 1  0 0 0  0 0 3  1 2 3  .5 7\nmesh 0 x.off\n"
    );
    testing::read_broken_versions(&READER, seed.as_bytes(), Path::new("."));
}

use std::path::Path;
