//! Numbers that are not finite.

use super::{counted, material_name};
use crate::{Report, Severity, Subject};
use snell_math::Transform;
use snell_math::parameters::{Value, find};

const REMEDY: &str = "correct the number in the file";

/// Checks meshes, transforms, materials, lights, cameras and media.
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
        check(report, material_name(i, material), material);
    }
    for (i, light) in scene.lights.iter().enumerate() {
        check(report, format!("light {i} ({})", light.name()), light);
    }
    for (i, camera) in scene.cameras.iter().enumerate() {
        check(report, format!("camera {i} \"{}\"", camera.name), camera);
    }
    for (i, medium) in scene.media.iter().enumerate() {
        check(report, format!("medium {i} ({})", medium.name()), medium);
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
        let kinds: [(&str, Option<usize>); 7] = [
            (
                "normal",
                mesh.normals.iter().position(|n| !n.is_finite() || n.length_squared() == 0.0),
            ),
            ("tangent", mesh.tangents.iter().position(|t| !t.is_finite())),
            ("texture coordinate", mesh.uvs[0].iter().position(|uv| !uv.is_finite())),
            ("second texture coordinate", mesh.uvs[1].iter().position(|uv| !uv.is_finite())),
            ("third texture coordinate", mesh.uvs[2].iter().position(|uv| !uv.is_finite())),
            ("fourth texture coordinate", mesh.uvs[3].iter().position(|uv| !uv.is_finite())),
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

/// Reports the first parameter that is not finite in a declared value.
fn check(report: &mut Report, object: String, thing: &impl Value) {
    let mut message = None;
    find(thing, &mut |found| {
        if let Some(x) = found.numbers().into_iter().find(|x| !x.is_finite())
            && message.is_none()
        {
            let what = if x.is_nan() { "not a number" } else { "infinite" };
            message = Some(format!("{} is {what}", found.name()));
        }
    });
    if let Some(message) = message {
        report.add(Severity::Error, object, message, REMEDY);
    }
}
