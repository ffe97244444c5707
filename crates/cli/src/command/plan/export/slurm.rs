//! A script for Slurm.

use super::Job;

/// The script: an array of workers, which take tasks by leases. A worker that is requeued takes
/// what is left.
pub fn script(job: &Job) -> String {
    format!(
        "#!/bin/bash
# Renders a plan of snell with an array of workers. Submit it, and the merge after it, with
#   id=$(sbatch --parsable FILE)
#   sbatch --dependency=afterok:$id --job-name={name}-merge --wrap={merge}
# Workers may be killed, requeued and added (sbatch FILE again) at any time.
#SBATCH --job-name={name}
#SBATCH --array=1-{workers}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:TERM@60
#SBATCH --nodes=1
#SBATCH --ntasks=1
plan={plan}
snell work \"$plan\" --name \"slurm-$SLURM_ARRAY_JOB_ID-$SLURM_ARRAY_TASK_ID\" \\
    --threads \"${{SLURM_CPUS_PER_TASK:-1}}\" &
worker=$!
trap 'kill -TERM $worker' TERM
wait $worker
code=$?
# The first wait ends with the signal, the second with the worker.
if kill -0 $worker 2>/dev/null; then wait $worker; code=$?; fi
# 130: it was told to end, and what is done is saved. The rest is for the next run.
if [ $code -eq 130 ] && [ -n \"$SLURM_JOB_ID\" ]; then scontrol requeue \"$SLURM_JOB_ID\"; fi
exit $code
",
        name = job.name,
        workers = job.workers,
        plan = shell(&job.plan),
        merge =
            shell(&format!("snell merge {} --output {}", shell(&job.plan), shell(&job.picture))),
    )
}

/// A text as one word of a shell.
fn shell(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}
