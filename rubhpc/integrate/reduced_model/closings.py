"""Eigenmodes with contacts closed one after another; sets share the results of common first contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.reduced_model.secular_modes import Contact, Eigenmodes, with_contact

if TYPE_CHECKING:
    from collections.abc import Sequence

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]
MOST = 64  # sets whose eigenmodes are kept


class Closings:
    """Eigenmodes of bodies with contacts, each set computed from the set without its last contact.

    Parameters
    ----------
    opened : Eigenmodes
        Of all n coordinates without contacts.
    part : (n,)
        Number of the body of each coordinate; bodies are uncoupled without contacts.
    """

    def __init__(self, opened: Eigenmodes, part: Ints) -> None:
        self._opened, self.part = opened, part
        self._of_mode = part[(opened.shape != 0.0).argmax(axis=0)]
        self._known: dict[tuple[bytes, ...], tuple[Ints, Eigenmodes] | None] = {}

    def within(self, rows: Ints) -> Within:
        """The same restricted to these coordinates, which are those of whole bodies."""
        return Within(self, rows)

    def among(self, rows: Ints, contacts: tuple[Contact, ...]) -> Eigenmodes | None:
        """Eigenmodes of these coordinates with these contacts of all n; None where the method fails."""
        found = self._closed(contacts)
        return self._enlarged(*found, rows) if found else None

    def _closed(self, contacts: tuple[Contact, ...]) -> tuple[Ints, Eigenmodes] | None:
        """Coordinates that the contacts couple, and their eigenmodes."""
        if not contacts:
            none = np.zeros(0, dtype=np.int64)
            return none, Eigenmodes(*np.zeros((1, 0), dtype=complex), *np.zeros((2, 0, 0), dtype=complex))
        name = tuple(_name_of(contact) for contact in contacts)
        if name not in self._known:
            before, last = self._closed(contacts[:-1]), contacts[-1]
            self._known[name] = self._with_last(*before, last) if before else None
            while len(self._known) > MOST:
                self._known.pop(next(iter(self._known)))
        return self._known[name]

    def _with_last(self, rows: Ints, modes: Eigenmodes, contact: Contact) -> tuple[Ints, Eigenmodes] | None:
        """The same with one more contact and the bodies that it couples."""
        seen = np.flatnonzero((contact.row != 0.0) | (contact.force != 0.0))
        every = np.flatnonzero(np.isin(self.part, self.part[np.concatenate([rows, seen])]))
        last = contact._replace(row=contact.row[every], force=contact.force[every])
        found = with_contact(self._enlarged(rows, modes, every), last)
        return (every, found) if found else None

    def _enlarged(self, rows: Ints, modes: Eigenmodes, every: Ints) -> Eigenmodes:
        """Eigenmodes of the coordinates `every`; those of `rows` are known."""
        if rows.size == every.size:
            return modes
        new = np.setdiff1d(every, rows, assume_unique=True)
        columns = np.flatnonzero(np.isin(self._of_mode, self.part[new]))
        m, n, opened = modes.exponent.size, every.size, self._opened
        shape = np.zeros((n, m + columns.size), dtype=np.complex128)
        inverse = np.zeros((m + columns.size, 2 * n), dtype=np.complex128)
        for at, first, values, entering in (
            (np.searchsorted(every, rows), 0, modes.shape, modes.inverse),
            (
                np.searchsorted(every, new),
                m,
                opened.shape[new[:, None], columns],
                opened.inverse[columns[:, None], _states(new, self.part.size)],
            ),
        ):
            last = first + values.shape[1]
            shape[at, first:last] = values
            inverse[first:last, _states(at, n)] = entering
        return Eigenmodes(np.concatenate([modes.exponent, opened.exponent[columns]]), shape, inverse)


class Within(NamedTuple):
    """Bodies that closed contacts couple."""

    closings: Closings
    rows: Ints  # (k,), their coordinates

    def with_contacts(self, contacts: Sequence[Contact]) -> Eigenmodes | None:
        """Their eigenmodes with these contacts, whose rows are (k,); None where the method fails."""
        return self.closings.among(self.rows, tuple(self._of_all(contact) for contact in contacts))

    def _of_all(self, contact: Contact) -> Contact:
        """A contact expressed in all coordinates."""
        wide = np.zeros((2, self.closings.part.size))
        wide[:, self.rows] = contact.row, contact.force
        return contact._replace(row=wide[0], force=wide[1])


def _name_of(contact: Contact) -> bytes:
    """Key of a contact."""
    springs = np.array([contact.stiffness, contact.damping])
    return contact.row.tobytes() + contact.force.tobytes() + springs.tobytes()


def _states(rows: Ints, n: int) -> Ints:
    """Coordinates and their rates among displacements, then velocities, of n coordinates."""
    return np.concatenate([rows, n + rows])
