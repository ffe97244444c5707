//! Files that are no scenes, meshes or pictures, but are often taken for some: what they are, and
//! how to get the file that was meant.

/// What a file is, and what to do, if it is of a known kind that has no reader.
pub(crate) fn known_kind(bytes: &[u8], extension: &str) -> Option<(String, &'static str)> {
    let start = bytes[..bytes.len().min(512)].trim_ascii_start();
    let begins =
        |mark: &[u8]| start.len() >= mark.len() && start[..mark.len()].eq_ignore_ascii_case(mark);
    if begins(b"version https://git-lfs.github.com/spec/") {
        let what = "this is a pointer of Git LFS, in place of the file itself";
        return Some((what.into(), "get the file with git lfs pull"));
    }
    if begins(b"<!doctype html") || begins(b"<html") {
        let what = "this is a web page, which a server sent in place of the file";
        return Some((what.into(), "look at it in a browser, and download the file again"));
    }
    const CONVERT: &str = "convert it to glTF, for example with Blender";
    const SURFACES: &str = "convert it to glTF or STL, for example with FreeCAD";
    let by_content: [(&[u8], &str, &str); 8] = [
        (b"Kaydara FBX Binary", "FBX", CONVERT),
        (b"; FBX", "FBX", CONVERT),
        (b"BLENDER", "Blender", "export it as glTF from Blender"),
        (b"Ogawa", "Alembic", CONVERT),
        (b"#VRML", "VRML", CONVERT),
        (b"ISO-10303-21", "STEP or IFC", SURFACES),
        (b"Extended Binary", "3D Studio", CONVERT),
        (b"M3DFILE", "Maxwell", CONVERT),
    ];
    let by_name = [
        ("fbx", "FBX", CONVERT),
        ("dae", "Collada", CONVERT),
        ("3ds", "3D Studio", CONVERT),
        ("max", "3ds Max", "export it as glTF from 3ds Max"),
        ("ma", "Maya", "export it as USD from Maya"),
        ("mb", "Maya", "export it as USD from Maya"),
        ("c4d", "Cinema 4D", "export it as glTF from Cinema 4D"),
        ("skp", "SketchUp", "export it as glTF from SketchUp"),
        ("3dm", "Rhino", "export it as glTF from Rhino"),
        ("3mf", "3MF", "convert it to glTF or STL, for example with Blender or a slicer"),
        ("amf", "AMF", "convert it to STL, for example with a slicer"),
        ("x3d", "X3D", CONVERT),
        ("wrl", "VRML", CONVERT),
        ("step", "STEP", SURFACES),
        ("stp", "STEP", SURFACES),
        ("iges", "IGES", SURFACES),
        ("igs", "IGES", SURFACES),
        ("ifc", "IFC", SURFACES),
        ("splat", "Gaussian splats", "there are no surfaces in it"),
        ("spz", "Gaussian splats", "there are no surfaces in it"),
        ("las", "LAS", "make a mesh of the points, for example with CloudCompare"),
        ("laz", "LAS", "make a mesh of the points, for example with CloudCompare"),
        ("vdb", "OpenVDB", "convert it to NanoVDB with nanovdb_convert"),
        ("pov", "POV-Ray", "there is no converter that we know; describe it for another program"),
        ("zip", "ZIP archive", "unpack it, and name the scene in it"),
        ("rar", "RAR archive", "unpack it, and name the scene in it"),
        ("7z", "7-Zip archive", "unpack it, and name the scene in it"),
    ];
    let named = by_name.into_iter().find(|(name, ..)| *name == extension);
    let (what, remedy) = by_content
        .into_iter()
        .find(|(mark, ..)| begins(mark))
        .map(|(_, what, remedy)| (what, remedy))
        .or(named.map(|(_, what, remedy)| (what, remedy)))?;
    Some((format!("this is a file of {what}, which Snell does not read"), remedy))
}

#[cfg(test)]
mod tests {
    use crate::image::read_image;
    use crate::{Input, ReadOptions, read_scene_bytes};
    use std::path::Path;

    fn said(name: &str, content: &[u8]) -> String {
        let options = ReadOptions::default();
        let read = read_scene_bytes(name, content.to_vec(), Path::new("."), &options);
        read.expect_err(name).to_string()
    }

    #[test]
    fn files_taken_for_scenes_are_told_by_what_they_are() {
        let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:46\nsize 3285844\n";
        for name in ["a.glb", "a.gltf", "a.obj", "a.ply", "a.stl", "a.usdz", "a"] {
            assert!(said(name, pointer).contains("git lfs pull"), "{}", said(name, pointer));
            let page = said(name, b"\n<!DOCTYPE html>\n<html><body>Not found</body></html>");
            assert!(page.contains("a web page"), "{page}");
        }
        assert!(said("a.fbx", b"Kaydara FBX Binary  \0").contains("a file of FBX"));
        assert!(said("a", b"BLENDER-v300").contains("export it as glTF from Blender"));
        assert!(said("a.3mf", b"PK\x03\x04").contains("a file of 3MF"));
        let input =
            Input::from_bytes("a.png", pointer.to_vec(), Path::new("."), &Default::default());
        let error = read_image(&input).expect_err("no picture").to_string();
        assert!(error.contains("git lfs pull"), "{error}");
    }
}
