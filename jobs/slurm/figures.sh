#!/usr/bin/env bash
# Check a finished store, and draw its maps of peak contact force and of the regime; with options, a cascade too.
#
#     sbatch jobs/slurm/figures.sh map.zarr figures
#     sbatch jobs/slurm/figures.sh map.zarr figures --select clearance_ratio=0.7 --select friction=0.3
#     sbatch --dependency=afterok:JOB jobs/slurm/figures.sh map.zarr      # once the sweep JOB is complete
#
# The folder is `figures` by default. What follows it are options of `rubhpc cascade`.

#SBATCH --job-name=rubhpc-figures
#SBATCH --ntasks=1
#SBATCH --time=00:30:00
#SBATCH --output=%x-%j.out

set -euo pipefail

if [ $# -eq 0 ]; then
    echo "figures.sh: which store? sbatch jobs/slurm/figures.sh STORE [FOLDER [OPTION...]]" >&2
    exit 2
fi
store=$1
folder=${2:-figures}

mkdir -p "$folder"
rubhpc status "$store"
rubhpc verify "$store"
rubhpc map "$store" --figure "$folder/contact_force.png" --data "$folder/contact_force.csv"
rubhpc map "$store" --value regime --figure "$folder/regime.png"
if [ $# -gt 2 ]; then
    rubhpc cascade "$store" --figure "$folder/cascade.png" "${@:3}"
fi
