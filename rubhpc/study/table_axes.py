"""Keys of [contact] and [initial] as axes of a grid, so that one study compares laws, or starts.

A word on such an axis is stored as its place in the list of its key's choices ("lagrange" 0, "penalty" 1).
"""

from __future__ import annotations

import itertools
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from rubhpc.errors import InputError, located
from rubhpc.study.axes import meanings_of, stated
from rubhpc.study.contact_keys import LAWS_OF, Contact, ContactKeys

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from rubhpc.study.axes import Axis
    from rubhpc.study.initial import Initial


def laws_of(keys: ContactKeys, axes: Sequence[Axis], key: str) -> list[str]:
    """Return the laws that the cases of a study take, by a key of [contact]."""
    name = f"contact.{key}"
    on_axis = [str(stated(name, value)) for axis in axes if axis.name == name for value in axis.tried]
    return on_axis or [getattr(keys, key)]


def contact_at(keys: ContactKeys, values: Mapping[str, float]) -> Contact:
    """Return the contact of the cases with these values on the contact axes.

    Parameters
    ----------
    keys : ContactKeys
        What [contact] gives for all cases; what does not apply to the law of these cases is left out.
    values : mapping of axis name to value
    """
    if not values:
        return keys if isinstance(keys, Contact) else Contact(**asdict(keys))
    set_here = _set(values)
    whole = asdict(keys) | set_here
    for key, (other, laws) in LAWS_OF.items():  # a key of [contact] holds for the cases of its laws only
        if key not in set_here and whole[other] not in laws:
            whole[key] = None
    return Contact(**whole)


def initial_at(keys: Initial, values: Mapping[str, float]) -> Initial:
    """Return where the cases start that have these values on the initial axes, and what [initial] gives."""
    return replace(keys, **_set(values)) if values else keys


def _set(values: Mapping[str, float]) -> dict[str, Any]:
    """Values on axes, by name, as the keys of their table state them."""
    return {name.partition(".")[2]: stated(name, value) for name, value in values.items()}


def _tried(axes: Sequence[Axis]) -> Iterator[tuple[dict[str, float], str]]:
    """All words and ends of some axes, by name, and as a message writes them."""
    ends = [axis.tried if meanings_of(axis.name) else (min(axis.tried), max(axis.tried)) for axis in axes]
    for values in itertools.product(*ends):
        at = {axis.name: value for axis, value in zip(axes, values, strict=True)}
        shown = {
            name: stated(name, value) if meanings_of(name) else f"{value:g}" for name, value in at.items()
        }
        yield at, ", ".join(f"{name} = {text}" for name, text in shown.items())


def check_contacts(keys: ContactKeys, axes: Sequence[Axis]) -> list[Contact]:
    """Return the contacts of a study, of ranges those at their ends.

    Contact axes are refused some of whose combinations cannot be, and keys of [contact] that no case uses.
    """
    found = []
    for at, where in _tried(axes):
        with located(f"[grid] {where}: [contact] " if at else "[contact] "):
            found.append(contact_at(keys, at))
    for key, value in asdict(keys).items():
        if value is not None and all(getattr(contact, key) is None for contact in found):
            kind, laws = LAWS_OF[key]
            listed = " or ".join(f'"{law}"' for law in laws)
            raise InputError(f"[contact] {key}: no case has {kind} = {listed}; leave it out")
    return found


def check_initials(keys: Initial, axes: Sequence[Axis]) -> None:
    """Refuse values on initial axes that cannot be, and keys of [initial] that change nothing."""
    names = {axis.key for axis in axes}
    if keys.impulse == 0.0 and "impulse" not in names:
        for key in ("impulse_angle", "impulse_node"):
            if key in names or getattr(keys, key):
                where = f"[grid] initial.{key}" if key in names else f"[initial] {key}"
                raise InputError(f'{where}: there is no impulse; give one, such as impulse = "0.1 N*s"')
    for at, where in _tried(axes):
        with located(f"[grid] {where}: "):
            initial_at(keys, at)
