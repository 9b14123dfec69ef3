"""Keys of [contact] as axes of a grid, so that one study compares laws.

A word on such an axis is stored as its place in the list of its key's choices ("lagrange" 0, "penalty" 1).
"""

from __future__ import annotations

import itertools
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any, Protocol

from rubhpc.errors import InputError, located
from rubhpc.input.messages import nearest
from rubhpc.study.contact_keys import LAWS_OF, Contact, ContactKeys

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from dataclasses import Field

PREFIX = "contact."
_FIELDS: dict[str, Field[Any]] = {
    PREFIX + declared.name: declared
    for declared in fields(Contact)
    if declared.metadata["kind"] != "series" and declared.name != "model"
}


class Tried(Protocol):
    """What is needed of an axis."""

    @property
    def name(self) -> str:
        """Key in the study."""
        ...

    @property
    def tried(self) -> tuple[float, ...]:
        """Values, or the ends of the range that they are drawn from."""
        ...


def contact_field(name: str) -> Field[Any]:
    """Return the declaration of a key such as "contact.law".

    Raises
    ------
    InputError
        There is no such key.
    """
    if name not in _FIELDS:
        raise InputError(f"unknown axis; {nearest(name, _FIELDS)}")
    return _FIELDS[name]


def choices_of(name: str) -> tuple[str, ...]:
    """Return the words that values 0, 1, ... on an axis stand for; () where they are quantities."""
    found: tuple[str, ...] = _FIELDS[name].metadata.get("of", ()) if name in _FIELDS else ()
    return found


def laws_of(stated: ContactKeys, axes: Sequence[Tried], key: str) -> list[str]:
    """Return the laws that the cases of a study take, by a key of [contact]."""
    words = choices_of(PREFIX + key)
    on_axis = [words[int(value)] for axis in axes if axis.name == PREFIX + key for value in axis.tried]
    return on_axis or [getattr(stated, key)]


def contact_at(stated: ContactKeys, values: Mapping[str, float]) -> Contact:
    """Return the contact of the cases with these values on the contact axes.

    Parameters
    ----------
    stated : ContactKeys
        What [contact] gives for all cases; what does not apply to the law of these cases is left out.
    values : mapping of axis name to value

    Raises
    ------
    InputError
        There is no such contact: a penalty without stiffness, a multiplier with one.
    """
    if not values:
        return stated if isinstance(stated, Contact) else Contact(**asdict(stated))
    set_here: dict[str, Any] = {}
    for name, value in values.items():
        words = choices_of(name)
        set_here[name.removeprefix(PREFIX)] = words[int(value)] if words else value
    keys = asdict(stated) | set_here
    for key, (other, laws) in LAWS_OF.items():  # a key of [contact] holds for the cases of its laws only
        if key not in set_here and keys[other] not in laws:
            keys[key] = None
    return Contact(**keys)


def check_contacts(stated: ContactKeys, axes: Sequence[Tried]) -> list[Contact]:
    """Return the contacts of a study, of ranges those at their ends.

    Contact axes are refused some of whose combinations cannot be, and keys of [contact] that no case uses.

    Raises
    ------
    InputError
        Names the values on the axes, or the key.
    """
    found = []
    ends = [axis.tried if choices_of(axis.name) else (min(axis.tried), max(axis.tried)) for axis in axes]
    for values in itertools.product(*ends):
        at = {axis.name: value for axis, value in zip(axes, values, strict=True)}
        where = ", ".join(f"{name} = {_word(name, value)}" for name, value in at.items())
        with located(f"[grid] {where}: [contact] " if at else "[contact] "):
            found.append(contact_at(stated, at))
    for key, value in asdict(stated).items():
        if value is not None and all(getattr(contact, key) is None for contact in found):
            kind, laws = LAWS_OF[key]
            listed = " or ".join(f'"{law}"' for law in laws)
            raise InputError(f"[contact] {key}: no case has {kind} = {listed}; leave it out")
    return found


def _word(name: str, value: float) -> str:
    words = choices_of(name)
    return words[int(value)] if words else f"{value:g}"
