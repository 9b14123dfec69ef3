"""Cases, or the revolutions of cases whose speed changes, as a table: one row each, without waveforms."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.store.axes import axes_of, refusal
from postproc.store.export import complete, heading
from postproc.store.select import worst_of_stators
from rubhpc.errors import InputError
from rubhpc.schema import VARIABLES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

TABLES = (".csv", ".parquet")
_ROW = "row"
_ALONG = "revolution"
_ALWAYS = ("speed", "time")
_ABOUT = ("title", "study", "rig", "versions", "identity")


def case_table(store: xr.Dataset, names: Sequence[str] = ()) -> xr.Dataset:
    """Return the cases of a store as columns over `row`, loaded, in the order of the grid.

    The values of axes come first, then what was drawn or selected, then settings, flags (in words) and
    measures: the variables `names`, or all that have one value a case or one a stator. Of several stators a
    column has the worst (`postproc.store.select`), and the last ones, named as `peak_contact_force_stator_3`,
    have each of them. InputError where a variable has many values a case.
    """
    axes = axes_of(store)
    known = [str(n) for n, v in store.data_vars.items() if set(v.dims) <= {*axes, "stator"}]
    for name in names:
        if name not in known:
            raise refusal(
                store,
                f"{name}: has many values a case, and a table has one row a case; export it as .h5 or .nc",
            )
    chosen = [name for name in known if not names or name in names]
    data = worst_of_stators(store, chosen)
    several = store.sizes.get("stator", 1) > 1
    wanted = {
        str(label): coordinate
        for label, coordinate in store.coords.items()
        if set(coordinate.dims) <= set(axes) and coordinate.dtype.kind in "fiu"
    }
    each: dict[str, xr.DataArray] = {}
    for name in chosen:
        wanted[name] = data[name]
        if several and "stator" in store[name].dims:
            for i in range(store.sizes["stator"]):
                each[f"{name}_stator_{int(store['stator'][i])}"] = store[name].isel(stator=i)
    wanted |= each
    in_order = dict.fromkeys(n for n in (*axes, *wanted) if n in wanted)  # points are no coordinate
    table = _table({name: wanted[name] for name in in_order}, store, store["status"].transpose(*axes))
    return table.map(lambda column: _in_words(column, wanted[str(column.name)]), keep_attrs=True)


def _table(found: Mapping[str, xr.DataArray], store: xr.Dataset, shape: xr.DataArray) -> xr.Dataset:
    """Return variables as columns, (n_row,), of the cells of an array."""
    columns = {}
    for name, values in found.items():
        one = values.squeeze([d for d in ("stator",) if d in values.dims])
        column = one.broadcast_like(shape).transpose(*shape.dims).values.ravel()
        about = {k: str(v) for k, v in values.attrs.items() if k in ("units", "long_name")}
        columns[name] = (_ROW, column, about)
    return xr.Dataset(columns, attrs=metadata_of(store))


def metadata_of(store: xr.Dataset) -> dict[str, str]:
    """Return what a file says of the store that it is made of: title, study, rig, versions and identity."""
    given = {name: store.attrs[name] for name in _ABOUT if name in store.attrs}
    return {name: value if isinstance(value, str) else json.dumps(value) for name, value in given.items()}


def write_table(table: xr.Dataset, path: Path) -> None:
    """Write a table of `case_table` as CSV, or Parquet; it gets its name once it is complete.

    In CSV the unit is in the heading, as in `clearance (m)`; in Parquet it is in the metadata of each column,
    with its long name, and study and rig are in those of the file. InputError where pyarrow is not installed.
    """
    with complete(path) as partial:
        if path.suffix.lower() == ".csv":
            frame = table.to_dataframe()[list(table.data_vars)]
            headings = {str(name): heading(str(name), column) for name, column in table.items()}
            frame.rename(columns=headings).to_csv(partial, index=False)
        else:
            _write_parquet(table, path.name, partial)


def import_parquet(file: str, instead: str = "") -> tuple[Any, Any]:
    """Return pyarrow and its Parquet module; InputError with what to do `instead` where there are none."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise InputError(
            f"{file}: Parquet needs the package {error.name}; install it with "
            f"pip install 'rubhpc[parquet]'{instead}"
        ) from error
    return pyarrow, parquet


def _write_parquet(table: xr.Dataset, file: str, path: Path) -> None:
    pyarrow, parquet = import_parquet(file, ", or export .csv")
    arrays, fields = [], []
    for name, column in table.items():
        values = column.values
        # A number that is missing is null, as readers of tables expect.
        mask = np.isnan(values) if values.dtype.kind == "f" else None
        arrays.append(pyarrow.array(values.tolist() if values.dtype.kind == "O" else values, mask=mask))
        fields.append(pyarrow.field(str(name), arrays[-1].type, metadata=dict(column.attrs)))
    schema = pyarrow.schema(fields, metadata=table.attrs)
    parquet.write_table(pyarrow.table(arrays, schema=schema), path, compression="zstd")


def _in_words(column: xr.DataArray, source_of: xr.DataArray) -> xr.DataArray:
    """Return the values of a flag or a direction in words, others as they are; -1 of integers becomes NaN."""
    variable = VARIABLES.get(str(column.name))
    words = variable.flags if variable is not None else ()
    words = words or tuple(str(source_of.attrs.get("flag_meanings", "")).split())
    if words:
        named = [words[i] if 0 <= i < len(words) else "" for i in column.values.astype(int)]
        return column.copy(data=np.array(named, dtype=object))
    if variable is not None and variable.role == "measure" and variable.dtype.startswith("int"):
        return column.copy(data=np.where(column.values == -1, math.nan, column.values))
    return column


def has_revolutions(store: xr.Dataset, names: Sequence[str]) -> bool:
    """Whether these variables, one at least, are all of the revolutions of cases whose speed changes."""
    return bool(names) and all(_ALONG in store[name].dims for name in names)


def revolution_table(store: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Return revolutions as columns over `row`, loaded: case after case, as far as each has turned.

    Axes come first, then the number of the revolution, its mean speed and when it begins, then the variables
    `names`, all of revolutions: `phase_vertical_order_0.5` of an order, `..._stator_3` of one of
    several stators.
    """
    axes = axes_of(store)
    rows = (*axes, _ALONG)
    shape = store["speed"].transpose(*rows)
    found: dict[str, xr.DataArray] = {name: store[name] for name in (*axes, _ALONG, *_ALWAYS)}
    for name in names:
        within = [dim for dim in store[name].dims if dim not in rows]
        if all(store.sizes[dim] == 1 for dim in within):
            found[name] = store[name].squeeze(within)
            continue
        for dim in within:  # one at most: orders or stators
            for i, label in enumerate(store[dim].values):
                found[f"{name}_{dim}_{label:.3g}"] = store[name].isel({dim: i})
    return _table(found, store, shape).isel({_ROW: np.isfinite(shape.values).ravel()})
