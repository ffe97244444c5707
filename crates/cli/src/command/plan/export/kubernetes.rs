//! Jobs of Kubernetes (batch/v1).

use super::{Job, quoted};
use std::path::Path;

/// Where the volume is mounted.
const MOUNT: &str = "/renders";

/// An Indexed Job of workers, and a suspended one that merges.
pub fn manifest(job: &Job) -> String {
    let in_volume = |path: &str| {
        let name = Path::new(path).file_name().unwrap_or_default().to_string_lossy().into_owned();
        quoted(&format!("{MOUNT}/{name}"))
    };
    let (plan, picture) = (in_volume(&job.plan), in_volume(&job.picture));
    let container = |command: String| {
        format!(
            "      restartPolicy: Never
      containers:
      - name: snell
        image: {image}
        command: [{command}]
        volumeMounts:
        - name: renders
          mountPath: {MOUNT}
      volumes:
      - name: renders
        persistentVolumeClaim:
          claimName: {claim}",
            image = quoted(job.image),
            claim = quoted(job.claim),
        )
    };
    format!(
        "# Renders a plan of snell. The volume of the claim holds the folder of the plan at its top.
# When the workers are complete (kubectl wait --for=condition=complete job/{name}), start the merge:
#   kubectl patch job {name}-merge --type=merge -p '{{\"spec\":{{\"suspend\":false}}}}'
apiVersion: batch/v1
kind: Job
metadata:
  name: {name}
spec:
  completionMode: Indexed
  completions: {workers}
  parallelism: {workers}
  backoffLimitPerIndex: 20
  podFailurePolicy:
    rules:
    # 2: wrong usage, another version, another plan. Trying again never helps.
    - action: FailJob
      onExitCodes:
        containerName: snell
        operator: In
        values: [2]
    # A node went away, or the worker was told to end (130). Its task is done by another.
    - action: Ignore
      onPodConditions:
      - type: DisruptionTarget
        status: \"True\"
    - action: Ignore
      onExitCodes:
        containerName: snell
        operator: In
        values: [130]
  template:
    spec:
{work}
---
apiVersion: batch/v1
kind: Job
metadata:
  name: {name}-merge
spec:
  suspend: true
  backoffLimit: 2
  template:
    spec:
{merge}
",
        name = job.name,
        workers = job.workers,
        work = container(format!("snell, work, {plan}")),
        merge = container(format!("snell, merge, {plan}, --output, {picture}")),
    )
}
