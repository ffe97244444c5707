//! Numbers that are not finite.

use super::{counted, material_name};
use crate::{Report, Severity, Subject};
use snell_math::Transform;
use snell_scene::Material;

const REMEDY: &str = "correct the number in the file";

/// Looks at meshes, transforms, materials, lights, cameras and media.
pub fn numbers(subject: &Subject, report: &mut Report) {
    meshes(subject, report);
    let scene = subject.scene;
    for (i, node) in scene.nodes.iter().enumerate() {
        if !node.transform.is_finite() {
            let name = format!("node {i} \"{}\"", node.name);
            report.add(
                Severity::Error,
                name,
                "its transform is not finite, so nothing of it is shown",
                REMEDY,
            );
        } else if Transform::new(node.transform).is_none()
            && (!node.surfaces.is_empty() || !node.children.is_empty())
        {
            let name = format!("node {i} \"{}\"", node.name);
            let message = "its transform flattens everything (its determinant is 0), so nothing of \
                it is shown";
            report.add(Severity::Warning, name, message, "give it a scale other than 0");
        }
    }
    for (i, material) in scene.materials.iter().enumerate() {
        // Names are words, and may be any.
        let nameless = Material { name: String::new(), ..material.clone() };
        tell(report, material_name(i, material), &format!("{nameless:?}"));
    }
    for (i, light) in scene.lights.iter().enumerate() {
        tell(report, format!("light {i} ({})", light.name()), &format!("{light:?}"));
    }
    for (i, camera) in scene.cameras.iter().enumerate() {
        let nameless = snell_scene::Camera { name: String::new(), ..camera.clone() };
        tell(report, format!("camera {i} \"{}\"", camera.name), &format!("{nameless:?}"));
    }
    for (i, medium) in scene.media.iter().enumerate() {
        if !matches!(medium, snell_scene::Medium::Grid(_)) {
            tell(report, format!("medium {i} ({})", medium.name()), &format!("{medium:?}"));
        }
    }
}

fn meshes(subject: &Subject, report: &mut Report) {
    for (place, problem) in &subject.broken {
        report.add(Severity::Error, subject.name(*place), problem.clone(), "export the mesh again");
    }
    for body in &subject.bodies {
        let faces = &body.topology.non_finite;
        if let Some(&first) = faces.first() {
            let message = format!(
                "{} with a vertex that is not finite; such faces are never hit",
                counted(faces.len(), "face")
            );
            let finding = report.add(
                Severity::Error,
                subject.body_name(body),
                message,
                "correct or remove the vertices",
            );
            (finding.face, finding.count) = (Some(first), faces.len() as u64);
        }
        let mesh = body.mesh;
        let kinds: [(&str, Option<usize>); 5] = [
            (
                "normal",
                mesh.normals.iter().position(|n| !n.is_finite() || n.length_squared() == 0.0),
            ),
            ("tangent", mesh.tangents.iter().position(|t| !t.is_finite())),
            ("texture coordinate", mesh.uvs[0].iter().position(|uv| !uv.is_finite())),
            ("second texture coordinate", mesh.uvs[1].iter().position(|uv| !uv.is_finite())),
            ("vertex colour", mesh.colors.iter().position(|c| !c.iter().all(|x| x.is_finite()))),
        ];
        for (what, at) in kinds.into_iter().filter_map(|(what, at)| Some((what, at?))) {
            let message = format!(
                "the {what} of vertex {at} (counted from 0) is not finite or has no direction"
            );
            report.add(
                Severity::Warning,
                subject.body_name(body),
                message,
                "export the mesh again",
            );
        }
    }
}

/// Tells of numbers in the debug form of a value that are not finite.
fn tell(report: &mut Report, object: String, debug: &str) {
    let mut field = "";
    let mut previous = "";
    for word in debug.split([' ', ',', '(', ')', '[', ']', '{', '}']).filter(|w| !w.is_empty()) {
        if let Some(name) = word.strip_suffix(':') {
            previous = field;
            field = name;
        }
        if matches!(word, "NaN" | "inf" | "-inf") {
            let generic = matches!(field, "r" | "g" | "b" | "factor" | "x" | "y" | "z");
            let shown = if generic { previous } else { field };
            let message =
                format!("{shown} is {}", if word == "NaN" { "not a number" } else { "infinite" });
            report.add(Severity::Error, object, message, REMEDY);
            return;
        }
    }
}
