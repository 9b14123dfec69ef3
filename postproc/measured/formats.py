"""Columns of numbers from the files of data loggers, whatever their format.

A file is data: nothing in it is evaluated or run. Only the columns that are asked for are kept.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rubhpc.errors import InputError
from rubhpc.input.messages import nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_HEAD = 200  # lines of a text in which its heading is sought
_SEPARATORS = (";", "\t", ",", None)  # None: white space; a comma may be that of decimals
_SHOWN = 12  # columns in a message
_UNIT = re.compile(r"\s*[\[(].*")  # of a heading, as in "y (um)"
_PART = re.compile(r"(.+)\[(\d+)\]")  # one column of a matrix: y[2]


class Columns(NamedTuple):
    """Columns of a file, and what it says of their times."""

    values: dict[str, Floats]
    rate: float | None = None  # Hz


def read_columns(path: Path, names: Sequence[str]) -> Columns:
    """Return columns of a file by its extension, NaN where there is no number.

    In HDF5 and MATLAB files a name is a path such as "run/y", or "run/y[2]" for one column of a matrix;
    elsewhere that in the heading, or the number of a column from 1. InputError where there is no such file,
    format or column, or it cannot be read.
    """
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise InputError(f"{path}: unknown format; convert it to one of {', '.join(FORMATS)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file; check the path of the data")
    try:
        return FORMATS[kind](path, tuple(dict.fromkeys(names)))
    except InputError:
        raise
    except ImportError as error:
        package = (error.name or "").partition(".")[0]
        raise InputError(
            f"{path}: needs the package {package}; install it with pip install 'rubhpc[measured]'"
        ) from None
    except Exception as error:  # of a file that may come from anybody, each library raises its own kinds
        reason = str(error).partition("\n")[0][:120] or type(error).__name__
        raise InputError(f"{path}: cannot be read as {kind} ({reason}); export it again") from None


def _missing(path: Path, name: str, known: Sequence[str]) -> InputError:
    shown = [*known[:_SHOWN], "..."] if len(known) > _SHOWN else known
    fix = nearest(name, shown) if known else "it has no columns of numbers"
    return InputError(f"{path}: no column {name}; {fix}")


def _picked(path: Path, name: str, known: Sequence[str]) -> int:
    """Return the place of a column, by name or by number from 1."""
    if name in known:
        return known.index(name)
    bare = [_UNIT.sub("", heading) for heading in known]
    if bare.count(name) == 1:
        return bare.index(name)
    if name.isdigit() and 1 <= int(name) <= len(known):
        return int(name) - 1
    raise _missing(path, name, known)


def _numbers(values: Any) -> Floats:
    """Return an array of numbers, NaN where a cell is none; dates and times become seconds."""
    import pandas

    column = pandas.Series(np.ravel(values) if isinstance(values, np.ndarray) else values)
    if column.dtype.kind in "fiub":
        return np.asarray(column, dtype=float)
    if column.dtype.kind != "M":
        found = pandas.to_numeric(column, errors="coerce")
        if found.notna().any():
            return np.asarray(found, dtype=float)
        column = pandas.to_datetime(column, errors="coerce", format="ISO8601")
        if not column.notna().any():
            return np.full(column.size, np.nan)
    return np.asarray((column - column.iloc[0]).dt.total_seconds(), dtype=float)


def _read_text(path: Path, names: tuple[str, ...]) -> Columns:
    """CSV, with any separator, heading and sign of decimals; lines above the heading are skipped."""
    import pandas

    with path.open(encoding="utf-8-sig", errors="replace") as file:
        lines = [line.rstrip("\r\n") for _, line in zip(range(_HEAD), file, strict=False)]
    first, separator, decimal = _first_row(path, lines)
    n = len(_cells(lines[first], separator))
    headings = [_heading(line, separator) for line in lines[:first]]
    whole = [cells for cells in headings if len(cells) == n]
    # Of two lines of the right length, as of names and units, the one with the names that are asked for.
    known = max(reversed(whole), key=lambda cells: len({*names} & {*cells}), default=[])
    known = known or [str(i) for i in range(1, n + 1)]
    places = [_picked(path, name, known) for name in names]
    frame = pandas.read_csv(
        path,
        sep=separator or r"\s+",
        decimal=decimal,
        header=None,
        skiprows=first,
        usecols=sorted({*places}),
        names=list(range(n)),
        index_col=False,
        encoding="utf-8-sig",
        encoding_errors="replace",
        skip_blank_lines=True,
        on_bad_lines="skip",
        low_memory=False,
    )
    return Columns({name: _numbers(frame[i]) for name, i in zip(names, places, strict=True)})


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.split(separator)]


def _heading(line: str, separator: str | None) -> list[str]:
    cells = _cells(line.lstrip("#%").strip() if separator is None else line.lstrip("#% "), separator)
    return cells[:-1] if cells and not cells[-1] else cells


def _first_row(path: Path, lines: Sequence[str]) -> tuple[int, str | None, str]:
    """Return the first line of numbers, the separator and the sign of decimals."""
    for i, line in enumerate(lines):
        for separator in _SEPARATORS:
            cells = _cells(line, separator)
            decimal = "," if separator not in (",", None) and "." not in line and "," in line else "."
            plain = [cell.replace(",", ".") if decimal == "," else cell for cell in cells]
            filled = [cell for cell in plain if cell]
            is_row = filled and sum(_is_number(cell) for cell in filled) > len(filled) / 2
            if is_row and (len(cells) > 1 or separator is None):
                return i, separator, decimal
    raise InputError(f"{path}: no line of numbers in its first {_HEAD}; export it as columns of numbers")


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _read_parquet(path: Path, names: tuple[str, ...]) -> Columns:
    from pyarrow import parquet

    known = parquet.read_schema(path).names
    places = {name: known[_picked(path, name, known)] for name in names}
    found = parquet.read_table(path, columns=list(dict.fromkeys(places.values())))
    return Columns({name: _numbers(found[at].to_pandas()) for name, at in places.items()})


def _read_hdf5(path: Path, names: tuple[str, ...]) -> Columns:
    import h5py

    with h5py.File(path, "r") as file:
        known: dict[str, Any] = {}
        file.visititems(
            lambda at, entry: known.update({at: entry} if isinstance(entry, h5py.Dataset) else {})
        )
        return Columns({name: _numbers(_of_arrays(path, name, known)) for name in names})


def _read_matlab(path: Path, names: tuple[str, ...]) -> Columns:
    import h5py
    from scipy.io import loadmat

    if h5py.is_hdf5(path):  # of version 7.3
        return _read_hdf5(path, names)
    known: dict[str, Any] = {}
    _walk(loadmat(path, simplify_cells=True), "", known)
    return Columns({name: _numbers(_of_arrays(path, name, known)) for name in names})


def _walk(held: Mapping[str, Any], above: str, found: dict[str, Any]) -> None:
    """Collect the arrays of nested structures by their paths."""
    for name, value in held.items():
        if isinstance(value, Mapping):
            _walk(value, f"{above}{name}/", found)
        elif not name.startswith("__") and isinstance(value, np.ndarray):
            found[above + name] = value


def _of_arrays(path: Path, name: str, known: Mapping[str, Any]) -> Any:
    """Return a vector, or one column of a matrix, of named arrays."""
    part = None if name in known else _PART.fullmatch(name)
    at = part[1] if part else name
    at = at if at in known else at.replace(".", "/").strip("/")
    if at not in known:
        raise _missing(path, name, [n for n, values in known.items() if np.size(values) > 1])
    values = np.asarray(known[at][()])
    if values.ndim == 2 and min(values.shape) > 1:
        values = values if values.shape[0] > values.shape[1] else values.T
        if part is None:
            fix = f"name one of its columns, {at}[1] to {at}[{values.shape[1]}]"
            raise InputError(f"{path}: {name}: is a matrix of {values.shape[1]} columns; {fix}")
        if not 1 <= int(part[2]) <= values.shape[1]:
            raise InputError(f"{path}: {name}: there are {values.shape[1]} columns; choose one of them")
        values = values[:, int(part[2]) - 1]
    elif part is not None and part[2] != "1":
        raise InputError(f"{path}: {name}: {at} has one column; leave out [{part[2]}]")
    return np.ravel(values)


def _read_universal(path: Path, names: tuple[str, ...]) -> Columns:
    """Universal File Format, data sets 58: named by their first line, or numbered from 1."""
    import pyuff

    file = pyuff.UFF(str(path))
    kinds = file.get_set_types()
    places = [i for i, kind in enumerate(np.atleast_1d(kinds)) if int(kind) == 58]
    if not places:
        raise InputError(f"{path}: contains no data set 58; export time responses")
    sets = [file.read_sets(i) for i in places]
    known = [" ".join(str(one.get("id1", "")).split()) for one in sets]
    known = [name if name and known.count(name) == 1 else str(i) for i, name in enumerate(known, 1)]
    found, steps = {}, set()
    for name in names:
        one = sets[_picked(path, name, known)]
        if np.iscomplexobj(one["data"]) or int(one["func_type"]) not in (0, 1):
            raise InputError(f"{path}: {name}: is no time response; export the signal over the time")
        found[name] = np.asarray(one["data"], dtype=float)
        steps.add(float(one.get("abscissa_inc") or 0.0) or float(np.median(np.diff(one["x"]))))
    if len(steps) > 1 and max(steps) > min(steps) * 1.000001:
        raise InputError(f"{path}: its data sets have different sampling rates; export them at one rate")
    step = steps.pop() if steps else 0.0
    return Columns(found, 1.0 / step if step > 0.0 else None)


def _read_wave(path: Path, names: tuple[str, ...]) -> Columns:
    """WAV: channels from 1, the largest sample as 1."""
    from scipy.io import wavfile

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of chunks with remarks
        rate, data = wavfile.read(path)
    data = data[:, np.newaxis] if data.ndim == 1 else data
    known = [str(i) for i in range(1, data.shape[1] + 1)]
    kind = data.dtype
    zero, top = (
        (128.0, 128.0) if kind == np.uint8 else (0.0, 1.0 if kind.kind == "f" else -np.iinfo(kind).min)
    )
    values = {name: (data[:, _picked(path, name, known)] - zero) / top for name in names}
    return Columns(values, float(rate))


FORMATS: dict[str, Callable[[Path, tuple[str, ...]], Columns]] = {
    ".csv": _read_text,
    ".txt": _read_text,
    ".parquet": _read_parquet,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".nc": _read_hdf5,
    ".mat": _read_matlab,
    ".uff": _read_universal,
    ".unv": _read_universal,
    ".wav": _read_wave,
}
