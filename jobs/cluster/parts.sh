#!/usr/bin/env bash
# One study as an array of Slurm jobs without MPI: each computes one part, whenever and wherever it gets a core.
#
#     sbatch --array=1-64 jobs/cluster/parts.sh 64 jobs/map.toml
#     sbatch --array=3,17-20 jobs/cluster/parts.sh 64 jobs/map.toml    # parts that were cancelled or lost
#
# The first argument is the number of parts, the others are those of rubhpc. The study's output must be on a disk that
# all nodes share. For several cores a part: sbatch --cpus-per-task=8 ... 64 jobs/map.toml --workers 8
#
# Two minutes before the time is up Slurm sends USR1 to this script, which hands it to rubhpc; a part that stopped early,
# with code 75, is put back into the queue and goes on where it was. `rubhpc status STORE` shows all parts.

#SBATCH --job-name=rubhpc-part
#SBATCH --array=1-64
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%A_%a.out

set -uo pipefail

if [ $# -lt 2 ]; then
    echo "parts.sh: how many parts, of which study? sbatch --array=1-N jobs/cluster/parts.sh N STUDY.toml [OPTION]..." >&2
    exit 2
fi
total=$1
shift

part=
caught=
is_cancelled=no
hand_on() {
    caught=$1
    if [ -n "$part" ]; then
        kill -s "$1" "$part" 2>/dev/null
    fi
}
trap 'hand_on USR1' USR1
trap 'is_cancelled=yes; hand_on TERM' TERM

rubhpc "$@" --part "${SLURM_ARRAY_TASK_ID:-}/$total" &
part=$!
if [ -n "$caught" ]; then # before the part had a number
    kill -s "$caught" "$part" 2>/dev/null
fi

# A signal ends `wait` before rubhpc has ended: wait until none does.
while :; do
    caught=
    wait "$part"
    code=$?
    if [ -z "$caught" ]; then
        break
    fi
done

if [ "$code" -eq 75 ] && [ "$is_cancelled" = no ]; then
    scontrol requeue "${SLURM_JOB_ID:-}" || echo "parts.sh: submit this part once more" >&2
fi
exit "$code"
