//! A script for Slurm.

use super::Job;
use crate::command::plan::shell;

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
worker=
told=
code=1
trap 'told=yes; if [ -n \"$worker\" ]; then kill -TERM \"$worker\" 2>/dev/null; fi' TERM
snell work \"$plan\" --name \"slurm-$SLURM_ARRAY_JOB_ID-$SLURM_ARRAY_TASK_ID\" \\
    --threads \"${{SLURM_CPUS_PER_TASK:-1}}\" &
worker=$!
if [ -n \"$told\" ]; then kill -TERM \"$worker\" 2>/dev/null; fi
# A signal ends a wait, and the next one has the code of the worker. 127: its code is known already.
while
    told=
    wait \"$worker\"
    last=$?
    if [ $last -ne 127 ]; then code=$last; fi
    [ -n \"$told\" ]
do :; done
# 130: it was told to end, and what is done is saved. The rest is for the next run. 143: it was told
# so before it had begun.
if [ \"$code\" -eq 130 ] || [ \"$code\" -eq 143 ]; then
    if [ -n \"$SLURM_JOB_ID\" ]; then scontrol requeue \"$SLURM_JOB_ID\"; fi
fi
exit \"$code\"
",
        name = job.name,
        workers = job.workers,
        plan = shell(&job.plan),
        merge =
            shell(&format!("snell merge {} --output {}", shell(&job.plan), shell(&job.picture))),
    )
}
