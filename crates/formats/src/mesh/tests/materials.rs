//! Materials and textures of OBJ files.

use super::*;
use snell_math::Rgb;
use snell_scene::Material;
use snell_scene::material::{AlphaMode, HeightUnit, MaterialKind};

/// Reads an OBJ file that uses the material `m` of this MTL file.
fn scene_with(mtl: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a folder for the test");
    std::fs::write(folder.path().join("some library.mtl"), mtl).expect("the folder is writable");
    let obj = "usemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nmtllib some library.mtl\n";
    read_scene_bytes("a.obj", obj.into(), folder.path(), &ReadOptions::default())
        .unwrap_or_else(|e| panic!("{e}"))
}

fn material(mtl: &str) -> Material {
    let scene = scene_with(mtl);
    assert_eq!(scene.warnings, [], "{mtl}");
    scene.materials[0].clone()
}

#[test]
fn a_material_without_highlight_is_diffuse() {
    let MaterialKind::Diffuse(diffuse) = material("newmtl m\nKd 0.1 0.2 0.3\nKs 0\nillum 2\n").kind
    else {
        panic!("not diffuse")
    };
    assert_eq!(diffuse.reflectance.factor, Rgb::new(0.1, 0.2, 0.3));
}

#[test]
fn a_colour_may_be_cie_xyz() {
    let white = "newmtl m\nKd xyz 0.9505 1 1.089\n";
    let MaterialKind::Diffuse(diffuse) = material(white).kind else { panic!("not diffuse") };
    let apart = diffuse.reflectance.factor.map(|x| (x - 1.0).abs());
    assert!(apart.max_element() < 1e-3, "{apart:?}");
    let warnings = scene_with("newmtl m\nKd spectral red.rfl 1\n").warnings;
    assert!(warnings[0].message.contains(".mtl:2:1"), "{warnings:?}");
}

#[test]
fn a_material_with_highlight_is_phong_and_mirrors_by_illum_3() {
    for (illum, reflection) in [(2, 0.0), (3, 0.5)] {
        let mtl = format!("newmtl m\nKd 0.4 0.4 0.4\nKs 0.5 0.5 0.5\nNs 20\nillum {illum}\n");
        let MaterialKind::Phong(phong) = material(&mtl).kind else { panic!("not Phong") };
        assert_eq!((phong.shininess, phong.specular.factor), (20.0, Rgb::splat(0.5)));
        assert_eq!(phong.reflection.factor, Rgb::splat(reflection));
    }
}

#[test]
fn glass_is_dielectric_and_not_blended() {
    let glass = material("newmtl m\nNi 1.33\nd 0.2\nillum 4\nTf 1 0.5 1\n");
    let MaterialKind::Dielectric(dielectric) = &glass.kind else { panic!("not glass") };
    assert_eq!((dielectric.ior, dielectric.tint.factor), (1.33.into(), Rgb::new(1.0, 0.5, 1.0)));
    assert_eq!(glass.alpha_mode, AlphaMode::Opaque);
}

#[test]
fn the_pbr_extension_gives_metallic_roughness() {
    let MaterialKind::MetallicRoughness(pbr) = material("newmtl m\nKd 1 1 1\nPr 0.3\nPm 1\n").kind
    else {
        panic!("not metallic-roughness")
    };
    assert_eq!((pbr.roughness.factor, pbr.metallic.factor), (0.3, 1.0));
}

#[test]
fn d_and_tr_are_opposites() {
    for mtl in ["newmtl m\nd 0.25\n", "newmtl m\nTr 0.75\n", "newmtl m\nd -halo 0.25\n"] {
        let material = material(mtl);
        assert_eq!((material.alpha.factor, material.alpha_mode), (0.25, AlphaMode::Blend), "{mtl}");
    }
}

#[test]
fn ke_is_emitted_radiance() {
    assert_eq!(material("newmtl m\nKe 17 12 4\n").emission.factor, Rgb::new(17.0, 12.0, 4.0));
}

#[test]
fn texture_options_move_the_image_and_v_points_up() {
    let scene = scene_with(
        "newmtl m\nKd 0 0 0\nmap_Kd -clamp on -s 2 3 -o 0.5 0.25 0 -mm 0 1 no such picture.png\n",
    );
    let MaterialKind::Diffuse(diffuse) = &scene.materials[0].kind else { panic!("not diffuse") };
    assert_eq!(diffuse.reflectance.factor, Rgb::WHITE);
    let texture = &scene.textures[diffuse.reflectance.texture.expect("a texture").index()]
        .as_image()
        .expect("an image");
    assert_eq!(texture.uv_transform, [[2.0, 0.0, 0.5], [0.0, -3.0, 0.75]]);
    assert_eq!(scene.warnings.len(), 1);
    assert!(
        scene.warnings[0].message.contains("no such picture.png"),
        "{}",
        scene.warnings[0].message
    );
}

#[test]
fn bumps_are_heights_unless_their_picture_shows_normals() {
    let folder = tempfile::tempdir().expect("a folder for the test");
    let write = |name: &str, content: &str| {
        std::fs::write(folder.path().join(name), content).expect("it is writable")
    };
    write("heights.pgm", "P2 2 1 255 0 255");
    write("normals.ppm", "P3 2 1 255 128 128 255 100 150 240");
    write("m.mtl", "newmtl a\nmap_Bump -bm 3 heights.pgm\nnewmtl b\nbump -bm 0.5 normals.ppm\n");
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib m.mtl\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n";
    let scene = read_scene_bytes("a.obj", obj.into(), folder.path(), &ReadOptions::default())
        .expect("it is whole");
    assert_eq!(scene.warnings, []);
    let [a, b] =
        ["a", "b"].map(|name| scene.materials.iter().find(|m| m.name == name).expect("it is used"));
    let map = a.bump_map.expect("heights");
    assert_eq!(
        (map.height, map.unit),
        (3.0 * crate::mesh::obj::HEIGHT_OF_BUMPS, HeightUnit::Picture)
    );
    assert_eq!((a.normal_map, b.bump_map, b.normal_map.map(|m| m.scale)), (None, None, Some(0.5)));
}

#[test]
fn a_library_outside_of_the_folder_is_an_error() {
    let error = read("a.obj", "mtllib ../../etc/passwd\nv 0 0 0\n").expect_err("outside");
    assert!(error.to_string().contains("--confine"), "{error}");
}

#[test]
fn a_library_that_is_none_is_named_with_the_materials_it_lacks() {
    let folder = tempfile::tempdir().expect("a folder for the test");
    std::fs::write(folder.path().join("m.txt"), "root:x:0:0\n").expect("it is writable");
    let obj = "mtllib m.txt\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let scene = read_scene_bytes("a.obj", obj.into(), folder.path(), &ReadOptions::default())
        .expect("it is whole");
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.message.contains("\"a\"; no newmtl is in "), "{}", warning.message);
    assert!(warning.message.ends_with("m.txt: is it a material library?"), "{}", warning.message);
}

#[test]
fn statements_that_make_no_sense_are_warnings_with_their_line() {
    let scene = scene_with("newmtl m\nKd red\nfoo\n");
    let messages: Vec<_> =
        scene.warnings.iter().map(|w| w.message.rsplit('/').next().unwrap_or("")).collect();
    assert_eq!(messages.len(), 2);
    assert!(messages[0].contains(".mtl:2:1"), "{messages:?}");
    assert!(messages[1].contains(".mtl:3:1"), "{messages:?}");
}

#[test]
fn warnings_about_materials_name_them() {
    let folder = tempfile::tempdir().expect("a folder for the test");
    let write = |name: &str, content: &str| {
        std::fs::write(folder.path().join(name), content).expect("it is writable")
    };
    write("m.mtl", "newmtl a\nKd 1 0 0\nnewmtl b\nTr 1\nnewmtl c\nTr 1\nnewmtl a\nKd 0 1 0\n");
    write("n.mtl", "newmtl a\nKd 0 0 1\n");
    let uses = ["a", "b", "c", "d", "e"].map(|name| format!("usemtl {name}\nf 1 2 3\n")).concat();
    let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib m.mtl\nmtllib n.mtl\n{uses}");
    let scene = read_scene_bytes("a.obj", obj.into_bytes(), folder.path(), &ReadOptions::default())
        .expect("it is whole");
    let said: Vec<_> = scene.warnings.iter().map(|w| (w.message.as_str(), w.count)).collect();
    assert_eq!(said.len(), 3, "{said:?}");
    assert!(
        said[0].0.ends_with("m.mtl: of several materials of one name the last was taken: \"a\"")
    );
    assert!(
        said[1].0.ends_with("that are not defined: \"d\", \"e\"") && said[1].1 == 1,
        "{said:?}"
    );
    assert!(said[2].0.ends_with("taken as opaque: \"b\", \"c\"") && said[2].1 == 1, "{said:?}");
    let MaterialKind::Diffuse(last) = &scene.materials[0].kind else { panic!("not diffuse") };
    assert_eq!(last.reflectance.factor, Rgb::new(0.0, 1.0, 0.0));
}
