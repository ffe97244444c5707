//! The warnings of the reader.

use crate::{Report, Severity, Subject};
use snell_scene::WarningKind;

/// Forwards the reader's warnings: missing files are errors.
pub fn reader(subject: &Subject, report: &mut Report) {
    for warning in &subject.scene.warnings {
        let (severity, remedy) = match warning.kind {
            WarningKind::Missing => {
                (Severity::Error, "put the file where the scene names it, or correct the name")
            }
            WarningKind::Changed => {
                (Severity::Warning, "see whether the picture is what you want, or change the file")
            }
            WarningKind::Choice => (Severity::Note, "nothing, if that is what you want"),
            // The check of numbers reports such values with their place.
            WarningKind::NotFinite => continue,
        };
        report.add(severity, "", warning.message.clone(), remedy).count = warning.count;
    }
}
