#!/usr/bin/env bash
# Reduce the spectra of a store on the workers of many Slurm jobs, which this job submits.
#
#     sbatch jobs/cluster/reduce.sh map.zarr --what envelope --over friction
#     sbatch jobs/cluster/reduce.sh map.zarr --workers 128 --cores 32 --memory "64 GB" --queue short
#
# The arguments are those of `rubhpc reduce`. Where jobs may not submit jobs, run that command on the login node
# with `--on slurm`, or in one job with `--on processes --workers "$SLURM_CPUS_PER_TASK"`.

#SBATCH --job-name=rubhpc-reduce
#SBATCH --ntasks=1
#SBATCH --mem=4G
#SBATCH --time=02:00:00
#SBATCH --output=%x-%j.out

set -euo pipefail

if [ $# -eq 0 ]; then
    echo "reduce.sh: no store given; run sbatch jobs/cluster/reduce.sh STORE [OPTION]..." >&2
    exit 2
fi

exec rubhpc reduce "$@" --on slurm
