#!/usr/bin/env bash
# Check a finished store and draw its cascade and its map of peak contact force.
#
#     sbatch jobs/slurm/figures.sh map.zarr [FOLDER]
#     sbatch --dependency=afterok:JOB jobs/slurm/figures.sh map.zarr      # once the sweep JOB is complete

#SBATCH --job-name=rubhpc-figures
#SBATCH --ntasks=1
#SBATCH --time=00:30:00
#SBATCH --output=%x-%j.out

set -euo pipefail

if [ $# -eq 0 ]; then
    echo "figures.sh: which store? sbatch jobs/slurm/figures.sh STORE [FOLDER]" >&2
    exit 2
fi
store=$1
folder=${2:-figures}

mkdir -p "$folder"
rubhpc status "$store"
rubhpc verify "$store"
rubhpc cascade "$store" --figure "$folder/cascade.png"
rubhpc map "$store" --figure "$folder/map.png" --data "$folder/map.csv"
