//! A job template of Open Job Description (specification 2023-09, with the extension
//! TASK_CHUNKING).

use super::{Job, quoted};
use std::path::Path;

/// A scheduler gives a session about this much work at a time, in seconds.
const CHUNK_SECONDS: u32 = 300;

/// The template: one step renders, the other waits for it and merges.
pub fn template(job: &Job) -> String {
    let (parameter, arguments) = match job.tasks() {
        Some(tasks) => (
            format!(
                "    - name: Task
      type: CHUNK[INT]
      range: \"0-{}\"
      chunks:
        defaultTaskCount: 1
        targetRuntimeSeconds: {CHUNK_SECONDS}
        rangeConstraint: CONTIGUOUS",
                tasks.saturating_sub(1)
            ),
            "[work, \"{{Param.Plan}}\", --tasks, \"{{Task.Param.Task}}\", --openjd]",
        ),
        // Tasks depend on those before, so every task of the job is a worker.
        None => (
            format!(
                "    - name: Worker
      type: INT
      range: \"1-{}\"",
                job.workers
            ),
            "[work, \"{{Param.Plan}}\", --name, \"{{Task.Param.Worker}}\", --openjd]",
        ),
    };
    let extensions = if job.tasks().is_some() { "\nextensions: [TASK_CHUNKING]" } else { "" };
    format!(
        "specificationVersion: jobtemplate-2023-09{extensions}
name: {name}
parameterDefinitions:
- name: Plan
  type: PATH
  objectType: DIRECTORY
  dataFlow: INOUT{plan}
  description: Folder of the plan that snell plan has made
- name: Picture
  type: PATH
  objectType: FILE
  dataFlow: OUT{picture}
  description: Picture that is written at the end
- name: Snell
  type: STRING
  default: snell
  description: The command
steps:
- name: Render
  parameterSpace:
    taskParameterDefinitions:
{parameter}
  script:
    actions:
      onRun:
        command: \"{{{{Param.Snell}}}}\"
        args: {arguments}
        cancelation:
          mode: NOTIFY_THEN_TERMINATE
- name: Merge
  dependencies:
  - dependsOn: Render
  script:
    actions:
      onRun:
        command: \"{{{{Param.Snell}}}}\"
        args: [merge, \"{{{{Param.Plan}}}}\", --output, \"{{{{Param.Picture}}}}\"]
",
        name = quoted(&job.name),
        plan = default(job, &job.plan),
        picture = default(job, &job.picture),
    )
}

/// The default of a path parameter, which must be relative to the template's folder. Without one,
/// who submits the job must give the path.
fn default(job: &Job, path: &str) -> String {
    match Path::new(path).strip_prefix(&job.base) {
        Ok(inside) => format!("\n  default: {}", quoted(&inside.to_string_lossy())),
        Err(_) => String::new(),
    }
}
