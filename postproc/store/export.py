"""Cases, or the data behind a figure, as a file in SI units: csv, json, zarr or HDF5 by its extension."""

from __future__ import annotations

import json
import math
import os
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError, writing

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

HDF5 = (".nc", ".h5", ".hdf5")
_COMPRESSED = {"zlib": True, "complevel": 4, "shuffle": True}  # any HDF5 library has these filters
FORMATS = (".csv", ".json", ".zarr", *HDF5)


def check_folder(path: str | Path, formats: tuple[str, ...]) -> Path:
    """Return `path` if its extension is one of the formats and its folder is there; InputError if not."""
    path = Path(path)
    if path.suffix.lower() not in formats:
        raise InputError(f"{path}: unknown format; choose one of {', '.join(formats)}")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no directory {path.parent}; make it first")
    return path


def check_data_path(path: str | Path) -> Path:
    """Return `path` if data can be written to it; InputError with the remedy if not."""
    path = check_folder(path, FORMATS)
    if path.suffix.lower() == ".zarr" and path.exists():
        raise InputError(f"{path}: exists already; choose another --data, or remove it")
    return path


def write_data(data: xr.Dataset, path: str | Path) -> Path:
    """Write a dataset, in csv one line a point, and return its path; InputError where it cannot be."""
    path = check_data_path(path)
    kind = path.suffix.lower()
    data = data.copy()
    data.attrs = {k: v for k, v in data.attrs.items() if isinstance(v, str | int | float)}
    with writing(path, "--data"):
        if kind == ".csv":
            _write_csv(data, path)
        elif kind == ".json":
            path.write_text(json.dumps(_plain(data.to_dict()), allow_nan=False))
        elif kind == ".zarr":
            data.drop_encoding().to_zarr(path, zarr_format=3, consolidated=False)
        else:
            write_hdf5(data, path)
    return path


def heading(name: str, column: xr.DataArray | xr.Variable) -> str:
    """Return the heading of a column of a table: its name, with the unit in brackets."""
    unit = str(column.attrs.get("units", "1"))
    return f"{name} ({unit})" if unit not in ("", "1") else name


def _write_csv(data: xr.Dataset, path: Path) -> None:
    """Write one column a variable, the dimensions first."""
    table = data.to_dataframe().reset_index()
    columns = [*(d for d in data.dims if d in table), *(c for c in table.columns if c not in data.dims)]
    headings = {str(n): heading(str(n), v) for n, v in data.variables.items()}
    table[columns].rename(columns=headings).to_csv(path, index=False)


@contextmanager
def complete(path: Path) -> Iterator[Path]:
    """Yield where a file is to be written; it gets its name once it is complete."""
    partial = path.with_name(f".{path.name}.part")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def write_hdf5(data: xr.Dataset, path: Path) -> None:
    """Write an HDF5 file that is netCDF 4 too, compressed; it gets its name once it is complete.

    Tables of attributes (study, rig, versions) become text in JSON.
    """
    data = data.drop_encoding()  # without the compression and chunks of the store that it came from
    data.attrs = {
        k: v if isinstance(v, str | int | float) else json.dumps(_plain(v)) for k, v in data.attrs.items()
    }
    packed = {n: _COMPRESSED for n, v in data.variables.items() if v.ndim and v.dtype.kind in "fiu"}
    with complete(path) as partial:
        data.to_netcdf(partial, engine="h5netcdf", encoding=packed)


def _plain(value: Any) -> Any:
    """Return nested dicts and lists with null for numbers that are not finite."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, str | int | float | bool | None) else str(value)
