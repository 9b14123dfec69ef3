"""What a new store is made for: the manifest of a grid of cases, and how its blocks are packed."""

from __future__ import annotations

import json
import math
from dataclasses import fields
from typing import TYPE_CHECKING

from rubhpc.schema import (
    BRANCH,
    MULTIPLIERS,
    ORDERS,
    RUN_UP,
    STATE,
    WAVEFORM,
    case_measures,
    drive_measures,
    lyapunov_variables,
    probe_variables,
)
from rubhpc.storage.manifest import AxisRecord, Manifest
from rubhpc.study.refine import table_of

if TYPE_CHECKING:
    from rubhpc.study.cases import CaseGrid

_MOST_BLOCKS = 256  # of more blocks, one file each would be too many for file systems with a quota of files
_SHARDS = 48  # of an array, at most, when the store is made: with some 17 arrays, under 1000 files


def manifest_of(grid: CaseGrid) -> Manifest:
    """Return the manifest of a new store for `grid`, without its files."""
    study = grid.study
    recording = study.recording
    return Manifest(
        title=study.title,
        identity=grid.identity,
        parts=json.loads(json.dumps(grid.identity_parts)),  # tuples become lists, as in a file
        axes=tuple(
            AxisRecord(**{f.name: getattr(axis, f.name) for f in fields(AxisRecord)}) for axis in study.axes
        ),
        chunk=tuple(grid.chunk),
        shard=shard_of(grid.shape, grid.chunk),
        sizes=_sizes(grid),
        keep=_kept(grid),
        files={},
        measures=(
            *case_measures(),
            *(v for v in probe_variables(recording.probed).values() if v.role == "measure"),
            *lyapunov_variables(recording.lyapunov).values(),
            *(drive_measures() if study.drive else ()),
        ),
        refine=None if study.refine is None else table_of(study.refine, study.axes),
    )


def _sizes(grid: CaseGrid) -> dict[str, int]:
    """Lengths of the dimensions after the axes."""
    study, recording = grid.study, grid.study.recording
    n_sample = recording.revolutions * recording.samples_per_revolution
    sizes = {
        "stator": grid.n_stator,
        "sample": n_sample,
        "order": n_sample // 2 + 1,
        "section": recording.revolutions,
    }
    if study.changes_speed:
        sizes["sample"] = grid.most_revolutions * recording.samples_per_revolution
        sizes["revolution"] = grid.most_revolutions
        sizes["order"] = len(ORDERS)
    if grid.n_degree:
        sizes["degree"] = grid.n_degree
    if study.branch:
        sizes["point"] = study.branch.points
        sizes["multiplier"] = MULTIPLIERS
        sizes["point_section"] = study.branch.longest
    return sizes


def _kept(grid: CaseGrid) -> tuple[str, ...]:
    """Roles of the arrays that are stored for every case."""
    study = grid.study
    if study.branch is not None:
        return (BRANCH,)
    if study.changes_speed:
        return (RUN_UP, *(role for role in study.recording.keep if role == WAVEFORM))
    return tuple(sorted({*study.recording.keep, *([STATE] if grid.continuation else [])}))


def shard_of(shape: tuple[int, ...], chunk: tuple[int, ...]) -> tuple[int, ...]:
    """Cases of a shard along each dimension: whole blocks, along the last dimensions first; () without."""
    n_block = [-(-n // c) for n, c in zip(shape, chunk, strict=True)]
    if math.prod(n_block) <= _MOST_BLOCKS:
        return ()
    ratio = [1] * len(shape)
    for i in reversed(range(len(shape))):
        before = math.prod(n_block[:i])  # shards that are left if this dimension is spanned whole
        ratio[i] = n_block[i] if before >= _SHARDS else -(-n_block[i] // (_SHARDS // before))
        if before < _SHARDS:
            break
    return tuple(r * c for r, c in zip(ratio, chunk, strict=True))
