"""Resuming a study in its store: what it can use, and what is left to compute."""

from __future__ import annotations

import json
import os
import re
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import StoreError
from rubhpc.models import ABSENT, MODELS, default_of
from rubhpc.schema import DIVERGED, DONE
from rubhpc.storage.growth import finish_growth, grow
from rubhpc.storage.lock import remove_drafts
from rubhpc.storage.manifest import Manifest, manifests, no_store
from rubhpc.storage.measures import added_measures
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.storage.store import ELSEWHERE, Store
from rubhpc.storage.tidy import tidy
from rubhpc.study.axes import meanings_of
from rubhpc.study.cases import CaseGrid
from rubhpc.study.identity import WHOLE
from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from rubhpc.schema import Variable
    from rubhpc.storage.ledger import Ledger
    from rubhpc.study.cases import Block
    from rubhpc.study.study import Study

_AS_KEY = {
    "normal": '[contact] normal = "{}"',
    "friction_law": '[contact] friction_law = "{}"',
    "geometry": '[override] "stator.geometry" = "{}"',
}
_MOST = 3  # differences of a subject that are shown


def differences(stored: Manifest, asked: Manifest) -> list[str]:
    """What keeps a study out of a store, a text each.

    Its axes may have grown, anywhere, and the order of their values may be another.
    """
    has_other_axes = stored.dims != asked.dims
    found = _by_subject(
        [
            leaf
            for leaf in _leaves(stored.parts, asked.parts)
            if leaf[1] != leaf[2] and not (has_other_axes and leaf[0].startswith("axes."))
        ]
    )
    if has_other_axes:
        return [f"axes were {', '.join(stored.dims)}, are {', '.join(asked.dims)}", *found]
    for dim in stored.dims:
        lost = sorted(set(stored.points.along(dim)) - set(asked.points.along(dim)))
        own = [axis for axis in stored.axes if axis.dimension == dim]
        if lost and len(own) == 1:
            rest = f" and {len(lost) - 3} more" if len(lost) > 3 else ""
            words, unit = meanings_of(own[0].name), own[0].unit
            values = ", ".join(words[int(v)] if words else typed_quantity(v, unit) for (v,) in lost[:3])
            found.append(f"axis {own[0].name} lacks {values}{rest}, which is stored")
        elif lost and not any(WHOLE in text for text in found):
            n_mine, n_yours = (dict(zip(m.dims, m.shape, strict=True))[dim] for m in (stored, asked))
            why = "n can only grow" if n_yours < n_mine else "this SALib or SciPy draws other points"
            found.append(f"the sample lacks {len(lost)} of its {n_mine} cases ({why})")
    room, needed = (manifest.sizes.get("revolution", 0) for manifest in (stored, asked))
    if not found and room != needed:
        found.append(f"run_up.time: its arrays have room for {room} revolutions, and a case needs {needed}")
    is_same = (stored.identity, stored.keep, stored.sizes) == (asked.identity, asked.keep, asked.sizes)
    if not found and not is_same:
        found.append("its identity")
    return found


def is_other_version(stored: Manifest, asked: Manifest) -> bool:
    """Whether nothing keeps a study out of a store but the version of the physics."""
    same = {**stored.parts, "physics": asked.parts["physics"]}
    return stored.parts != same and not differences(
        replace(stored, parts=same, identity=asked.identity), asked
    )


def what_to_add(stored: Manifest, asked: Manifest) -> str:
    """Return the keys with whose defaults a store was made, where nothing else keeps a study out of it.

    "" where something does, or the study has keys of its own that differ.
    """
    leaves = [leaf for leaf in _leaves(stored.parts, asked.parts) if leaf[1] != leaf[2]]
    other = {key.rpartition(".")[2]: (mine, yours) for key, mine, yours in leaves if key != "physics"}
    if any(key not in ABSENT or yours != default_of(key) for key, (_, yours) in other.items()):
        return ""
    made_with = ABSENT | stored.parts["contact"] | {key: mine for key, (mine, _) in other.items()}
    model = next((n for n, keys in MODELS.items() if keys.items() <= made_with.items()), "")
    if other and model:
        return f'[contact] model = "{model}"'
    keys = (_AS_KEY[key].format(mine) for key, (mine, _) in other.items())
    return " and ".join(keys)


def _by_subject(leaves: list[tuple[str, Any, Any]]) -> list[str]:
    """Texts of a few leaves of each subject, such as rig.rotor, and how many more there are."""
    subjects: dict[str, list[tuple[str, Any, Any]]] = {}
    for leaf in leaves:
        parts = leaf[0].split(".")
        subjects.setdefault(".".join(parts[: 1 + (parts[0] == "rig")]), []).append(leaf)
    texts = []
    for subject, members in subjects.items():
        grouped = _grouped(members)
        n_more = len(grouped) - _MOST
        texts += grouped[:_MOST] + ([f"{n_more} more of {subject}"] if n_more > 0 else [])
    return texts


def _grouped(leaves: list[tuple[str, Any, Any]]) -> list[str]:
    """A text for each leaf, but one for the same change in many members of a list, as in a ring."""
    members: dict[tuple[str, str, str], list[str]] = {}
    for key, mine, yours in leaves:
        anywhere = re.sub(r"\.\d+(?=\.|$)", ".*", key)
        members.setdefault((anywhere, _short(mine), _short(yours)), []).append(key)
    return [
        f"{keys[0] if len(keys) == 1 else f'{anywhere} ({len(keys)} of them)'} was {mine}, is {yours}"
        for (anywhere, mine, yours), keys in members.items()
    ]


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
    meant = ABSENT.get(key.rpartition(".")[2])  # where a store lacks the key
    return [(key, meant if mine is None else mine, meant if yours is None else yours)]


def _short(value: Any) -> str:
    text = "absent" if value is None else json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."


def is_store(path: Path) -> bool:
    """Whether `path` is a store of this program."""
    return any(os.path.isfile(place) for place in manifests(path))  # a name too long is none


def grid_for(study: Study, *, accept_version: bool = False) -> CaseGrid:
    """The study's grid, with the blocks of the store it resumes.

    Raises
    ------
    StoreError
        The store at the study's output is of another study, or of another version of the physics that is
        not accepted; the text lists the differences. Or there is something else.
    """
    grid = CaseGrid(study)
    if not is_store(study.output):
        if os.path.isdir(study.output) and any(os.scandir(study.output)):
            raise StoreError(no_store(study.output, ELSEWHERE))
        return grid
    manifest = Manifest.read(study.output)
    _refuse_other(manifest, manifest_of(grid), study.output, accept_version=accept_version)
    return grid if grid.chunk == manifest.chunk else CaseGrid(study, chunk=manifest.chunk)


def _refuse_other(mine: Manifest, yours: Manifest, path: Path, *, accept_version: bool) -> None:
    found = differences(mine, yours)
    is_version = is_other_version(mine, yours)
    if not found or (is_version and accept_version):
        return
    listed = "; ".join(found)
    added = what_to_add(mine, yours)
    advice = f"add {added} to the study, or choose" if added else "choose"
    if is_version:
        raise StoreError(
            f"{path}: was computed by another version of the physics: {listed}; "
            "--accept-version keeps its cases and continues, another --output starts a new store"
        )
    raise StoreError(f"{path}: is the store of another study: {listed}; {advice} another --output")


def open_store(grid: CaseGrid) -> Store:
    """The store of the study, made if it is not there."""
    path = grid.study.output
    if is_store(path):
        return Store(path)
    try:
        return Store.create(path, grid)
    except StoreError:
        if is_store(path):  # another run was quicker
            return Store(path)
        raise


def bring_up_to_date(store: Store, grid: CaseGrid, *, accept_version: bool = False) -> str:
    """Grow the store to the axes of `grid`, add new measures, repair damaged metadata, remove partial files.

    Returns a note on the measures that were added, "" without any.
    """
    tidy(store.path, store.manifest)
    with suppress(OSError):  # the directory may be closed to this user
        remove_drafts(store.path, is_made=True)
    finish_growth(store.path)
    store.reopen()
    must_grow = must_be_grown(store, grid, accept_version=accept_version)
    added = added_measures(store.manifest.measures)
    note = _note_on(added, store) if added else ""
    if must_grow:
        grow(store, grid)
    store.refine(manifest_of(grid).refine)
    store.repair_files(grid)
    return note


def must_be_grown(store: Store, grid: CaseGrid, *, accept_version: bool) -> bool:
    """Whether the store lacks values or measures of `grid`, or has another order of them.

    Raises
    ------
    StoreError
        It is of another study.
    """
    mine, wanted = store.manifest, manifest_of(grid)
    _refuse_other(mine, wanted, store.path, accept_version=accept_version)
    is_same = mine.axes == wanted.axes and mine.identity == wanted.identity
    return not is_same or bool(added_measures(mine.measures))


def _note_on(added: tuple[Variable, ...], store: Store) -> str:
    names = ", ".join(variable.name for variable in added)
    what = f"measure {names}" if len(added) == 1 else f"measures {names}"
    n_case = int(np.isin(store.replay(with_measures=False).status, (DONE, DIVERGED)).sum())
    them = "it" if len(added) == 1 else "them"
    lack = f"its {n_case} cases have none; only new cases have {them}"
    return f"{store.path}: was made before the {what} existed: {lack}"


def cases_without_files(store: Store, ledger: Ledger) -> list[int]:
    """Flat indices of the cases that have been stored, but whose files are missing or empty."""
    gone: list[int] = []
    if not store.manifest.variables:
        return gone
    stored = (ledger.status == DONE) | (ledger.status == DIVERGED)
    for start in store.blocks():
        flat = store.flat(start)
        if stored[flat].any() and not store.has_files(start):
            gone += flat[stored[flat]].tolist()
    return gone


def missing_share(block: Block, missing: NDArray[np.bool_]) -> float:
    """Share of a block that is missing; `missing` has the grid's shape."""
    window = tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))
    return float(missing[window].mean())
