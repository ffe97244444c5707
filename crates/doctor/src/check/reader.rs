//! What the reader had to say.

use crate::{Report, Severity, Subject};

/// Words by which remarks of readers are known that tell of a choice, not of a flaw.
const CHOICES: &[&str] = &[
    "is shown",
    "are shown where",
    "have no surface and are not shown",
    "are divided by 683",
    "was taken as opaque",
    "is not animated",
    "stays as it is",
    "stand where they are at the start",
    "its place at the start was used",
    "use snell",
    "give --",
    "use --",
    "became an equirectangular one",
    "is known; it does not matter",
    "bound no medium are not seen",
    "is not drawn",
    "are not surfaces",
    "the integrator path was used",
];

/// What a message of a file that is not there has.
const MISSING: [&str; 4] = ["stands in for this texture", "checkerboard", "does not exist", "cannot open"];

/// Hands on the reader's warnings: missing files are errors.
pub fn reader(subject: &Subject, report: &mut Report) {
    for warning in &subject.scene.warnings {
        // The check of numbers says it with the place.
        if warning.message.contains("is not finite; triangles that use such vertices") {
            continue;
        }
        let message = warning.message.clone();
        let (severity, remedy) = if MISSING.iter().any(|words| message.contains(words)) {
            (Severity::Error, "put the file where the scene names it, or correct the name")
        } else if CHOICES.iter().any(|words| message.contains(words)) {
            (Severity::Note, "nothing, if that is what you want")
        } else {
            (Severity::Warning, "see whether the picture is what you want, or change the file")
        };
        report.add(severity, "", message, remedy).count = warning.count;
    }
}
