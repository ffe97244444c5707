//! The findings of a check.

use crate::Subject;
use crate::subject::Body;

/// How severe a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The picture is wrong.
    Error,
    /// The picture probably is not what was meant.
    Warning,
    /// Information; nothing is wrong.
    Note,
}

impl Severity {
    /// The name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        }
    }
}

/// A flaw.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Name of the check.
    pub check: &'static str,
    /// The severity of the finding.
    pub severity: Severity,
    /// The object of the scene: a node, a material, a light; empty for the whole scene.
    pub object: String,
    /// Number of the first face concerned, from 0, in the order of the mesh in memory.
    pub face: Option<u32>,
    /// The position of the flaw in the world, if that helps to find it.
    pub position: Option<[f64; 3]>,
    /// Number of faces, edges or objects concerned.
    pub count: u64,
    /// The message.
    pub message: String,
    /// The remedy.
    pub remedy: &'static str,
}

/// Collects the findings of a check.
#[derive(Debug)]
pub struct Report {
    check: &'static str,
    findings: Vec<Finding>,
}

/// Maximum number of findings of one check.
const MAX_FINDINGS: usize = 200;

impl Report {
    /// An empty report.
    pub fn new(check: &'static str) -> Self {
        Self { check, findings: Vec::new() }
    }

    /// Adds a finding and returns it, so that the caller can add details.
    pub fn add(
        &mut self,
        severity: Severity,
        object: impl Into<String>,
        message: impl Into<String>,
        remedy: &'static str,
    ) -> &mut Finding {
        self.findings.push(Finding {
            check: self.check,
            severity,
            object: object.into(),
            face: None,
            position: None,
            count: 1,
            message: message.into(),
            remedy,
        });
        let last = self.findings.len() - 1;
        &mut self.findings[last]
    }

    /// Adds a finding about `count` edges or faces of a body; the first of them is at `face`.
    pub fn add_at_face(
        &mut self,
        severity: Severity,
        subject: &Subject,
        body: &Body,
        (face, count): (u32, usize),
        message: impl Into<String>,
        remedy: &'static str,
    ) {
        let finding = self.add(severity, subject.body_name(body), message, remedy);
        (finding.face, finding.count) = (Some(face), count as u64);
        finding.position = subject.face_position(body, face);
    }

    /// The findings, the severe ones first.
    pub fn into_findings(mut self) -> Vec<Finding> {
        self.findings.sort_by_key(|f| f.severity);
        if self.findings.len() > MAX_FINDINGS {
            let rest = self.findings.split_off(MAX_FINDINGS);
            let message = format!("there are {} more findings of this kind", rest.len());
            let worst = rest.iter().map(|f| f.severity).min().unwrap_or(Severity::Note);
            self.add(worst, "", message, "fix these first, then check again").count =
                rest.len() as u64;
        }
        self.findings
    }
}
