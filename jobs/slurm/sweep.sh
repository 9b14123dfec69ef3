#!/usr/bin/env bash
# One study as one Slurm job that goes on, over as many job times as it takes, until the study is complete.
#
#     sbatch jobs/slurm/sweep.sh jobs/map.toml
#     sbatch --ntasks=128 --time=08:00:00 jobs/slurm/sweep.sh my-study.toml --output /scratch/my-study.zarr
#
# Two minutes before the time is up Slurm sends USR1 to this script, which hands it to the ranks. They finish or drop
# the blocks in progress and end with 75, "stopped early"; the job is then put back into the queue under its own number.
# A job that waits for this one, `sbatch --dependency=afterok:JOB`, so starts when the study is complete.
#
# Settings, by `sbatch --export=ALL,NAME=VALUE`:
#     RUBHPC_LAUNCHER       what starts the ranks; "mpirun" where rubhpc's MPI was not built for srun
#     RUBHPC_MOST_RESTARTS  job times to take at most, 100 by default
#
# To stop for good: scancel. (A file STOP in the store ends this job time only.)

#SBATCH --job-name=rubhpc
#SBATCH --ntasks=32
#SBATCH --cpus-per-task=1
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.out

set -uo pipefail

if [ $# -eq 0 ]; then
    echo "sweep.sh: which study? sbatch jobs/slurm/sweep.sh STUDY.toml [OPTION]..." >&2
    exit 2
fi

# All ranks end together. Should one be killed, the others hang in MPI: srun ends them a minute later.
# shellcheck disable=SC2206 # a launcher may have options
launcher=(${RUBHPC_LAUNCHER:-srun --kill-on-bad-exit=0 --wait=60})

step=
caught=
is_cancelled=no
hand_on() {
    caught=$1
    if [ -n "$step" ]; then
        kill -s "$1" "$step" 2>/dev/null
    fi
}
trap 'hand_on USR1' USR1
trap 'is_cancelled=yes; hand_on TERM' TERM

"${launcher[@]}" rubhpc "$@" &
step=$!
if [ -n "$caught" ]; then # before the step had a number
    kill -s "$caught" "$step" 2>/dev/null
fi

# A signal ends `wait` before the step has ended: wait until none does.
while :; do
    caught=
    wait "$step"
    code=$?
    if [ -z "$caught" ]; then
        break
    fi
done

if [ "$code" -eq 75 ] && [ "$is_cancelled" = no ]; then
    restarts=${SLURM_RESTART_COUNT:-0}
    if [ "$restarts" -ge "${RUBHPC_MOST_RESTARTS:-100}" ]; then
        echo "sweep.sh: stopped early for the $((restarts + 1)). time; not queued again (RUBHPC_MOST_RESTARTS)" >&2
    elif scontrol requeue "${SLURM_JOB_ID:-}"; then
        echo "sweep.sh: stopped early; job $SLURM_JOB_ID goes on when it is its turn again"
    else
        echo "sweep.sh: stopped early and cannot be queued again; submit the same job once more" >&2
    fi
fi
exit "$code"
