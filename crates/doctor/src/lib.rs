//! Finds flaws of a scene that spoil pictures. Each finding has its place and a remedy.
//!
//! [`examine`] runs all of [`CHECKS`] over a scene graph and changes nothing. To add a check: a new
//! file in `check/`, and its line in the list. A check reads a [`Subject`], which holds data that
//! several checks share, and adds findings to a [`Report`].
//!
//! The rule for severities: a flaw that makes the picture wrong is an error, a flaw that probably
//! does is a warning, and a flaw that may only surprise is a note. A mesh with holes is not
//! reported unless it is glass.

#![forbid(unsafe_code)]

mod check;
mod finding;
mod subject;
mod topology;

pub use finding::{Finding, Report, Severity};
pub use subject::Subject;
pub use topology::Topology;

use snell_scene::Scene;

/// A check.
#[derive(Clone, Copy)]
pub struct Check {
    /// Short name, which is the `check` of the findings.
    pub name: &'static str,
    /// The flaws that the check finds, in one line.
    pub description: &'static str,
    run: fn(&Subject, &mut Report),
}

/// All checks, in the order in which their findings are listed.
pub const CHECKS: &[Check] = &[
    Check {
        name: "reader",
        description: "files that are missing, and what the reader could not express",
        run: check::reader,
    },
    Check {
        name: "numbers",
        description: "numbers that are not finite, in meshes, materials, lights and cameras",
        run: check::numbers,
    },
    Check {
        name: "faces",
        description: "faces without an area, and faces that are there twice",
        run: check::faces,
    },
    Check {
        name: "holes",
        description: "holes and loose edges in surfaces that bound glass or a medium",
        run: check::holes,
    },
    Check {
        name: "winding",
        description: "faces that are turned over, and bodies that are inside out",
        run: check::winding,
    },
    Check {
        name: "coplanar",
        description: "surfaces of different objects in one plane",
        run: check::coplanar,
    },
    Check {
        name: "textures",
        description: "textures on meshes without coordinates, and images that are not there",
        run: check::textures,
    },
    Check {
        name: "materials",
        description: "reflectances above 1, and parameters out of range",
        run: check::materials,
    },
    Check { name: "lights", description: "lights that light nothing", run: check::lights },
    Check {
        name: "cameras",
        description: "cameras inside of things, and cameras that see nothing",
        run: check::cameras,
    },
    Check {
        name: "scale",
        description: "absurd sizes, distances and transforms",
        run: check::scale,
    },
];

/// Returns all findings, check by check, and the severe ones of each check first. Fails for scenes
/// with cycles or invalid ids, and for scenes that are too large to examine.
pub fn examine(scene: &Scene) -> Result<Vec<Finding>, String> {
    let subject = Subject::new(scene)?;
    let mut findings = Vec::new();
    for check in CHECKS {
        let mut report = Report::new(check.name);
        (check.run)(&subject, &mut report);
        findings.extend(report.into_findings());
    }
    Ok(findings)
}

#[cfg(test)]
mod tests;
