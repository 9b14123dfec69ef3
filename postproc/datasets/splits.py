"""Which split each case is in: train, validation or test; no motion is in two."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.errors import InputError
from rubhpc.study.axes import CLEARANCE_AXES, DIRECTION, coordinate_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

SPLITS = ("train", "validation", "test")
_OF_START = coordinate_of("initial.")
_OF_GAP = ("friction", *CLEARANCE_AXES)
_OF_CONTACT = (coordinate_of("contact."), "stator_", "carrier_")


def check_shares(shares: Sequence[float]) -> None:
    """Refuse shares that are not those of three splits."""
    if (
        len(shares) != len(SPLITS)
        or not all(0 <= share <= 1 for share in shares)
        or abs(sum(shares) - 1) > 1e-9
    ):
        given = " ".join(f"{share:g}" for share in shares)
        raise InputError(f"split: {given}: are not three shares with the sum 1; give such as 0.7 0.15 0.15")


def keys_of(
    parameters: Mapping[str, NDArray[Any]], touches: NDArray[np.bool_]
) -> tuple[list[int], list[int]]:
    """Return a number for each case and one for each group of cases that must not be separated.

    Both follow from the parameters alone, so that they stay what they are when a store grows. Cases that may
    have the same motion are one group: those that differ only in their start or in the direction of a sweep,
    and, of cases without contact, those that differ only in what acts in contact. `parameters` are what was
    varied, (n_case,) each, and `touches` says which cases have any contact.
    """
    of_motion = [name for name in parameters if name != DIRECTION and not name.startswith(_OF_START)]
    of_free = [name for name in of_motion if name not in _OF_GAP and not name.startswith(_OF_CONTACT)]
    keys, groups = [], []
    for i, touching in enumerate(touches.tolist()):
        keys.append(_number(*(column[i] for column in parameters.values())))
        groups.append(
            _number(touching, *(parameters[name][i] for name in (of_motion if touching else of_free)))
        )
    return keys, groups


def split_cases(
    groups: Sequence[int], touches: NDArray[np.bool_], shares: Sequence[float], seed: int
) -> NDArray[np.intp]:
    """Return the split of each case, (n_case,): 0, 1 or 2.

    Groups with contact and groups without are shared out separately, so that all splits have both. InputError
    where a split with a share above 0 would have no case.
    """
    members: dict[int, list[int]] = {}
    for i, group in enumerate(groups):
        members.setdefault(group, []).append(i)
    found = np.zeros(len(groups), dtype=np.intp)
    for kind in (False, True):
        alike = [group for group, cases in members.items() if bool(touches[cases].any()) == kind]
        alike.sort(key=lambda group: _number(seed, group))
        bounds = np.rint(np.cumsum(shares) * len(alike)).astype(int)
        for place, group in enumerate(alike):
            found[members[group]] = min(int(np.searchsorted(bounds, place, side="right")), len(SPLITS) - 1)
    for i, (name, share) in enumerate(zip(SPLITS, shares, strict=True)):
        if share and not (found == i).any():
            fix = "take more cases, or set its share to 0"
            raise InputError(
                f"split: a share of {share:g} of {len(groups)} cases leaves {name} without one; {fix}"
            )
    return found


def _number(*values: object) -> int:
    """A number of 64 bits that depends on these values alone."""
    text = ",".join(map(str, values))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "little")
