"""What a store was made for: the study's identity, axes and chunks, and how another study differs from it."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any, Self

from rubhpc.errors import StoreError
from rubhpc.schema import KEEPABLE, VARIABLES
from rubhpc.storage.disk import write_whole
from rubhpc.storage.journal import Header

if TYPE_CHECKING:
    from pathlib import Path

    from rubhpc.schema import Variable
    from rubhpc.sweep import Sweep

_FORMAT = 1
PRIVATE = ".rubhpc"  # the directory of a store that zarr does not look into


@dataclass(frozen=True, kw_only=True)
class AxisRecord:
    """An axis of the grid as the manifest keeps it."""

    name: str
    dimension: str
    unit: str
    long_name: str
    values: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """What a store was made for.

    Attributes
    ----------
    identity, parts
        Hash of what changes results, and what went into it.
    axes : tuple of AxisRecord
        The grid; the only part that may grow.
    chunk : tuple of int
        Cases of one block along each axis, fixed for the life of the store.
    sizes : dict
        Lengths of the dimensions after the axes: stator, sample, order, section.
    keep : tuple of str
        Roles of the arrays stored for every case.
    static : dict
        Name of each coordinate and setting -> CRC-32 of its values.
    """

    title: str
    identity: str
    parts: dict[str, Any]
    axes: tuple[AxisRecord, ...]
    chunk: tuple[int, ...]
    sizes: dict[str, int]
    keep: tuple[str, ...]
    static: dict[str, int]

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of the grid."""
        return tuple(axis.dimension for axis in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cases along each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def n_case(self) -> int:
        """Cases of the grid."""
        return math.prod(self.shape)

    @property
    def header(self) -> Header:
        """Header of the journals of this store."""
        return Header(
            identity=self.identity,
            axes=tuple(axis.values for axis in self.axes),
            n_stator=self.sizes["stator"],
        )

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The arrays stored for every case and written block by block, in the order of their checksum."""
        return tuple(v for v in VARIABLES.values() if v.role in KEEPABLE and v.role in self.keep)

    def extent(self, variable: Variable) -> tuple[int, ...]:
        """Shape of a variable after the axes."""
        return tuple(self.sizes[dim] for dim in variable.dims)

    def name_case(self, flat: int) -> str:
        """Coordinates of a case, as in `friction=0.3, clearance_ratio=0.7`."""
        places = []
        for axis in reversed(self.axes):
            flat, i = divmod(flat, len(axis.values))
            places.append(
                f"{axis.name}={axis.values[i]:.6g}" + (f" {axis.unit}" if axis.unit not in ("", "1") else "")
            )
        return ", ".join(reversed(places))

    @classmethod
    def of(cls, sweep: Sweep, *, static: dict[str, int] | None = None) -> Self:
        """The manifest of a store for `sweep`."""
        study = sweep.study
        recording = study.recording
        n_sample = recording.revolutions * recording.samples_per_revolution
        return cls(
            title=study.title,
            identity=sweep.identity,
            parts=json.loads(json.dumps(sweep.identity_parts)),  # tuples become lists, as in a file
            axes=tuple(
                AxisRecord(**{f.name: getattr(axis, f.name) for f in fields(AxisRecord)})
                for axis in study.axes
            ),
            chunk=tuple(sweep.chunk),
            sizes={
                "stator": sweep.n_stator,
                "sample": n_sample,
                "order": n_sample // 2 + 1,
                "section": recording.revolutions,
            },
            keep=tuple(sorted(recording.keep)),
            static=static or {},
        )

    def write(self, store: Path) -> None:
        """Put the manifest into a store."""
        text = json.dumps({"format": _FORMAT, **asdict(self)}, indent=1)
        write_whole(store / PRIVATE / "manifest.json", text.encode())

    @classmethod
    def read(cls, store: Path) -> Self:
        """The manifest of a store.

        Raises
        ------
        StoreError
            There is no store, it is not one of this program, or its manifest is damaged.
        """
        path = store / PRIVATE / "manifest.json"
        try:
            told = json.loads(path.read_bytes())
            if told.pop("format") != _FORMAT:
                raise StoreError(
                    f"{store}: made by another version of rubhpc; use that one or another --output"
                )
            told["axes"] = tuple(
                AxisRecord(**{**axis, "values": tuple(axis["values"])}) for axis in told["axes"]
            )
            return cls(**{**told, "chunk": tuple(told["chunk"]), "keep": tuple(told["keep"])})
        except FileNotFoundError:
            what = "is not a rubhpc store" if store.exists() else "no such store"
            raise StoreError(f"{store}: {what}; give the directory that a study was run into") from None
        except NotADirectoryError:
            raise StoreError(f"{store}: is not a rubhpc store but a file") from None
        except (ValueError, KeyError, TypeError) as error:
            raise StoreError(
                f"{store}: its manifest is damaged ({error}); run into another --output"
            ) from None

    def differences(self, other: Manifest) -> list[str]:
        """What keeps the study of `other` out of this store, a text each; its axes may have grown."""
        found = [
            f"{key} was {_short(mine)}, is {_short(yours)}"
            for key, mine, yours in _leaves(self.parts, other.parts)
            if mine != yours
        ]
        if self.dims != other.dims:
            found.append(f"axes were {', '.join(self.dims)}, are {', '.join(other.dims)}")
            return found
        for mine, yours in zip(self.axes, other.axes, strict=True):
            if mine.unit != yours.unit or yours.values[: len(mine.values)] != mine.values:
                found.append(f"axis {mine.name} no longer begins with its {len(mine.values)} old values")
        if not found and (
            self.identity != other.identity or self.keep != other.keep or self.sizes != other.sizes
        ):
            found.append("its identity")
        return found


def _leaves(mine: Any, yours: Any, key: str = "") -> list[tuple[str, Any, Any]]:
    """Every leaf of two nested objects, side by side, by its dotted key."""
    if isinstance(mine, dict) and isinstance(yours, dict):
        names = [*mine, *(name for name in yours if name not in mine)]
        return [
            leaf
            for name in names
            for leaf in _leaves(mine.get(name), yours.get(name), f"{key}.{name}" if key else str(name))
        ]
    if isinstance(mine, list) and isinstance(yours, list) and len(mine) == len(yours):
        return [
            leaf
            for i, pair in enumerate(zip(mine, yours, strict=True), 1)
            for leaf in _leaves(*pair, f"{key}.{i}" if key else str(i))
        ]
    return [(key, mine, yours)]


def _short(value: Any) -> str:
    text = "absent" if value is None else json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
