"""A Parquet file that is written row group by row group."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from postproc.datasets.columns import WAVE
from postproc.store.case_table import import_parquet

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from postproc.datasets.columns import Column

_ROWS = 512  # of a group


class TableFile:
    """A file of windows of `n_sample` samples, one a row, with units and meanings in its metadata."""

    def __init__(
        self, path: Path, columns: Sequence[Column], n_sample: int, about: Mapping[str, str]
    ) -> None:
        self._arrow, parquet = import_parquet(str(path))
        arrow, wave = self._arrow, self._arrow.list_(self._arrow.float32(), n_sample)
        fields = [
            arrow.field(
                column.name,
                wave if column.kind == WAVE else arrow.type_for_alias(column.kind),
                metadata={"units": column.unit, "long_name": column.meaning},
            )
            for column in columns
        ]
        self._schema = arrow.schema(fields, metadata=about)
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
        self._flush()
        self._writer.close()
        return len(self._cases), self._n_row, self._n_contact

    def _flush(self) -> None:
        if self._rows:
            table = self._arrow.Table.from_pylist(self._rows, self._schema)
            self._writer.write_table(table, row_group_size=len(self._rows))
        self._cases |= {row["case"] for row in self._rows}
        self._n_row += len(self._rows)
        self._n_contact += sum(row["contact"] for row in self._rows)
        self._rows = []
