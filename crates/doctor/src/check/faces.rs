//! Faces that should not be there.

use super::counted;
use crate::topology::Duplicate;
use crate::{Report, Severity, Subject};

/// Finds degenerate faces, and copies of faces.
pub fn faces(subject: &Subject, report: &mut Report) {
    for body in &subject.bodies {
        let topology = &body.topology;
        if let Some(&first) = topology.degenerate.first() {
            let count = topology.degenerate.len();
            let message = format!("{} without an area; rays miss them", counted(count, "face"));
            let finding = report.add(
                Severity::Note,
                subject.body_name(body),
                message,
                "nothing; or remove them, which saves a little memory",
            );
            (finding.face, finding.count) = (Some(first), count as u64);
            finding.position = subject.face_position(body, first);
        }
        let (alike, back_to_back): (Vec<&Duplicate>, Vec<&Duplicate>) =
            topology.duplicates.iter().partition(|d| d.is_wound_alike);
        if let Some(first) = alike.first() {
            let message = format!(
                "{} in the place of another face, such as face {} in that of face {}",
                match alike.len() {
                    1 => "1 face is".into(),
                    n => format!("{n} faces are"),
                },
                first.face,
                first.of
            );
            let finding =
                report.add(Severity::Warning, subject.body_name(body), message, "merge or remove the doubled faces");
            (finding.face, finding.count) = (Some(first.face), alike.len() as u64);
            finding.position = subject.face_position(body, first.face);
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
                true => (Severity::Warning, "remove one of each pair, or give the sheet a thickness"),
                false => (Severity::Note, "nothing; one face and a two-sided material would do"),
            };
            let finding = report.add(severity, subject.body_name(body), message, remedy);
            (finding.face, finding.count) = (Some(first.face), back_to_back.len() as u64);
            finding.position = subject.face_position(body, first.face);
        }
    }
}
