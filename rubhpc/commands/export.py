"""`rubhpc export`: cases of a store as one HDF5 file."""

from __future__ import annotations

from pathlib import Path

import click

from rubhpc.commands.selection import SELECT, open_cases
from rubhpc.errors import InputError


@click.command()
@click.argument("store")
@SELECT
@click.option("--value", "names", multiple=True, metavar="NAME", help="A variable [default: all of them].")
@click.option("--output", metavar="FILE", help="The file, .h5, .hdf5 or .nc [default: STORE.h5 here].")
def export(store: str, selection: tuple[str, ...], names: tuple[str, ...], output: str | None) -> None:
    """Write cases of STORE as one HDF5 file, which h5py, MATLAB, and xarray as netCDF 4 read.

    Names, dimensions, units and coordinates are those of the store; study and rig are attributes.
    """
    from postproc.store.export import HDF5, check_data_path, write_hdf5
    from rubhpc.input.fields import nearest

    cases = open_cases(store, selection)
    for name in names:
        if name not in cases.data_vars:
            raise InputError(f"{store}: no variable {name}; {nearest(name, map(str, cases.data_vars))}")
    path = check_data_path(output or f"{Path(store).resolve().stem}.h5")
    if path.suffix.lower() not in HDF5:
        raise InputError(f"{path}: an export is HDF5; name it {path.stem}.h5")
    try:
        write_hdf5(cases[list(names)] if names else cases, path)
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{path}: cannot be written: {reason}; choose another --output") from error
    click.echo(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")
