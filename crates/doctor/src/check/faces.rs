//! Faces without an area, and copies of faces.

use super::counted;
use crate::topology::Duplicate;
use crate::{Report, Severity, Subject};

/// Finds faces without an area, and faces in the place of others.
pub fn faces(subject: &Subject, report: &mut Report) {
    for body in &subject.bodies {
        let topology = &body.topology;
        if let Some(&first) = topology.degenerate.first() {
            let count = topology.degenerate.len();
            let message = format!("{} without an area; rays miss them", counted(count, "face"));
            let remedy = "nothing; or remove them, which saves a little memory";
            report.add_at_face(Severity::Note, subject, body, (first, count), message, remedy);
        }
        let (same_side, back_to_back): (Vec<&Duplicate>, Vec<&Duplicate>) =
            topology.duplicates.iter().partition(|d| d.has_same_winding);
        if let Some(first) = same_side.first() {
            let message = format!(
                "{} in the place of another face, such as face {} in that of face {}",
                match same_side.len() {
                    1 => "1 face is".into(),
                    n => format!("{n} faces are"),
                },
                first.face,
                first.of
            );
            let remedy = "merge or remove the doubled faces";
            report.add_at_face(
                Severity::Warning,
                subject,
                body,
                (first.face, same_side.len()),
                message,
                remedy,
            );
        }
        if let Some(first) = back_to_back.first() {
            let message = format!(
                "{} back to back with another face, such as face {} with face {}",
                match back_to_back.len() {
                    1 => "1 face is".into(),
                    n => format!("{n} faces are"),
                },
                first.face,
                first.of
            );
            let (severity, remedy) = match body.role.bounds_inside {
                true => {
                    (Severity::Warning, "remove one of each pair, or give the sheet a thickness")
                }
                false => (Severity::Note, "nothing; one face and a two-sided material would do"),
            };
            report.add_at_face(
                severity,
                subject,
                body,
                (first.face, back_to_back.len()),
                message,
                remedy,
            );
        }
    }
}
