"""`rubhpc export`: cases of a store as one file, HDF5 or a table."""

from __future__ import annotations

from pathlib import Path

import click

from rubhpc.commands.selection import SELECT, open_cases
from rubhpc.errors import InputError, reason_of


@click.command()
@click.argument("store")
@SELECT
@click.option("--value", "names", multiple=True, metavar="NAME", help="A variable [default: all of them].")
@click.option(
    "--output", metavar="FILE", help="The file, .h5, .hdf5, .nc, .csv or .parquet [default: STORE.h5 here]."
)
def export(store: str, selection: tuple[str, ...], names: tuple[str, ...], output: str | None) -> None:
    """Write cases of STORE as one file, by its extension.

    HDF5 (.h5, .hdf5, .nc), compressed, has all variables with names, dimensions, units and coordinates of the
    store, study and rig as attributes; h5py, MATLAB, and xarray as netCDF 4 read it. A table (.csv, .parquet)
    has one row a case, with axes, settings and measures, or one a revolution where each --value is of the
    revolutions of run-ups; Parquet needs `pip install 'rubhpc[parquet]'`.
    """
    from postproc.store.case_table import TABLES, case_table, has_revolutions, revolution_table, write_table
    from postproc.store.export import HDF5, check_folder, write_hdf5
    from rubhpc.input.messages import nearest

    cases = open_cases(store, selection)
    for name in names:
        if name not in cases.data_vars:
            raise InputError(f"{store}: no variable {name}; {nearest(name, map(str, cases.data_vars))}")
    path = check_folder(output or f"{Path(store).resolve().stem}.h5", (*HDF5, *TABLES))
    try:
        if path.suffix.lower() in TABLES:
            rows = revolution_table if has_revolutions(cases, names) else case_table
            write_table(rows(cases, names), path)
        else:
            write_hdf5(cases[list(names)] if names else cases, path)
    except OSError as error:
        reason = reason_of(error, path)
        raise InputError(f"{path}: cannot be written: {reason}; choose another --output") from error
    click.echo(f"{path} ({path.stat().st_size / 1e6:.1f} MB)")
