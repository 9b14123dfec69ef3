"""How a study differs from the one that a store was made for."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rubhpc.study.axes import meanings_of
from rubhpc.study.identity import WHOLE
from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from rubhpc.storage.manifest import Manifest

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
    if len(found) > 1:  # the version of the physics depends on the study
        found = [text for text in found if not text.startswith("physics ")]
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
    return [(key, mine, yours)]


def _short(value: Any) -> str:
    text = "absent" if value is None else json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."
