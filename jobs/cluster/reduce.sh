#!/usr/bin/env bash
# Reduce the spectra of a store on the workers of many Slurm jobs; this one job drives them.
#
#     sbatch jobs/cluster/reduce.sh map.zarr --what envelope --over friction
#     sbatch jobs/cluster/reduce.sh map.zarr --workers 128 --cores 32 --memory "64 GB" --queue short
#
# What follows the store are options of jobs/cluster/reduce.py. Where jobs may not submit jobs, run that script
# on the login node, or in one job with `--on processes --workers "$SLURM_CPUS_PER_TASK"`.

#SBATCH --job-name=rubhpc-reduce
#SBATCH --ntasks=1
#SBATCH --mem=4G
#SBATCH --time=02:00:00
#SBATCH --output=%x-%j.out

set -euo pipefail

if [ $# -eq 0 ]; then
    echo "reduce.sh: which store? sbatch jobs/cluster/reduce.sh STORE [OPTION]..." >&2
    exit 2
fi

# Slurm runs a copy of this script from its spool: paths are relative to where it was submitted.
exec python jobs/cluster/reduce.py "$@" --on slurm
