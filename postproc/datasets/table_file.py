"""A Parquet file that is written row group by row group."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.datasets.columns import WAVE
from postproc.store.case_table import import_parquet

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from postproc.datasets.columns import Column

_ROWS = 512  # of a group


class TableFile:
    """A file of windows, one a row; unit and meaning of each column are in its metadata.

    Parameters
    ----------
    n_sample : int
        Of a window.
    about : mapping of text
        Metadata of the file.
    """

    def __init__(
        self, path: Path, columns: Sequence[Column], n_sample: int, about: Mapping[str, str]
    ) -> None:
        self._arrow, parquet = import_parquet(str(path))
        self._columns, self._n_sample = columns, n_sample
        fields = [
            self._arrow.field(c.name, self._type(c.kind), metadata={"units": c.unit, "long_name": c.meaning})
            for c in columns
        ]
        self._schema = self._arrow.schema(fields, metadata=dict(about))
        coded = [column.name for column in columns if column.kind != WAVE]  # samples hardly repeat
        self._writer = parquet.ParquetWriter(path, self._schema, compression="zstd", use_dictionary=coded)
        self._rows: list[dict[str, Any]] = []
        self._cases: set[int] = set()
        self._n_row = self._n_contact = 0

    def add(self, rows: Iterable[dict[str, Any]]) -> None:
        """Append windows, each with a value for every column."""
        self._rows += rows
        if len(self._rows) >= _ROWS:
            self._flush()

    def close(self) -> tuple[int, int, int]:
        """Complete the file; returns its cases, its windows, and those of them with contact."""
        if self._rows:
            self._flush()
        self._writer.close()
        return len(self._cases), self._n_row, self._n_contact

    def _flush(self) -> None:
        arrays = [self._array(column, [row[column.name] for row in self._rows]) for column in self._columns]
        self._writer.write_table(
            self._arrow.table(arrays, schema=self._schema), row_group_size=len(self._rows)
        )
        self._cases |= {row["case"] for row in self._rows}
        self._n_row += len(self._rows)
        self._n_contact += sum(row["contact"] for row in self._rows)
        self._rows = []

    def _type(self, kind: str) -> Any:
        if kind == WAVE:
            return self._arrow.list_(self._arrow.float32(), self._n_sample)
        return self._arrow.type_for_alias(kind)

    def _array(self, column: Column, values: list[Any]) -> Any:
        if column.kind == WAVE:
            flat = self._arrow.array(np.concatenate(values))
            return self._arrow.FixedSizeListArray.from_arrays(flat, self._n_sample)
        return self._arrow.array(values, self._type(column.kind))
