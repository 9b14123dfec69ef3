"""Eigenmodes with one more contact, from those without it, by the zeros of a secular function."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.reduced_model.products import times_real

if TYPE_CHECKING:
    from collections.abc import Sequence


Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]

FEWEST = 28  # coordinates from which this method is faster for one contact
WEAK = 0.25  # of the distance to the next exponent: one that moves by less is found from its old value
MOST_STRONG = 0.5  # of the eigenmodes; with more, solving the whole system is as fast
PASSES = 12
CONVERGED = 1e-9  # relative step, whose error Newton's method squares
SAME = 1e-13  # of an exponent: nearer ones are equal
WORST = 1e-8  # cosine between a shape and its inverse below which exponents coincide
ROUNDING = 8.0 * np.finfo(np.float64).eps

MOST = 64  # sets whose eigenmodes are kept


class Contact(NamedTuple):
    """A closed pair, whose gap is a constraint."""

    row: Floats  # (n,), gap by displacements
    force: Floats  # (n,), of a unit contact force


class Eigenmodes(NamedTuple):
    """Eigenmodes of n coordinates, one per conjugate pair: `x = Re(shape @ z)`, `z = inverse @ (x, v)`."""

    exponent: Complexes  # (m,), 1/s
    shape: Complexes  # (n, m), displacements, doubled for one of a pair
    inverse: Complexes  # (m, 2 n)


def with_contact(modes: Eigenmodes, contact: Contact) -> Eigenmodes | None:
    """Eigenmodes with one more contact; None where the method fails.

    With `A` the system without it, `b` the input of its force and `c` its row, the force is that of a
    constraint `c x = 0`. Exponents are then the zeros of

        sum over j of r_j / (s - l_j),    r_j = c_j b_j,

    over all exponents `l_j` of A, b and c by its eigenmodes; two zeros are infinite. At a zero s the shape is
    `inv(s - A) b` and the inverse `c inv(s - A)`. Zeros are represented as distances to an exponent, which
    makes both as accurate as the eigenmodes of A (Gu and Eisenstat, SIAM J. Matrix Anal. Appl. 15 (1994)
    1266-1276). Converged, distinct zeros in the expected number are complete.
    """
    n = len(contact.row)
    half = np.where(modes.exponent.imag == 0.0, 1.0, 0.5)
    seen = _without_rounding(contact.row, modes.shape.T) * half
    moved = _without_rounding(contact.force, modes.inverse[:, n:])
    is_active = (seen != 0.0) | (moved != 0.0)
    active, rest = np.flatnonzero(is_active), np.flatnonzero(~is_active)
    poles = _Poles.of(modes.exponent[active], seen[active], moved[active])
    zeros = poles.zeros() if poles else None
    if poles is None or zeros is None:
        return None
    found = poles.shapes(zeros)
    if found is None:
        return None
    right, left = found
    shape = poles.combined(right, (modes.shape[:, active] * half[active]).T)
    inverse = poles.combined(left, modes.inverse[active])
    size = np.sqrt(_squares(shape).sum(axis=1) * (1.0 + _squares(zeros.exponent)))
    shape *= (np.where(zeros.is_real, 1.0, 2.0) / size)[:, None]
    inverse *= (size / (right * left).sum(axis=1))[:, None]
    return Eigenmodes(
        np.concatenate([zeros.exponent, modes.exponent[rest]]),
        np.hstack([shape.T, modes.shape[:, rest]]),
        np.vstack([inverse, modes.inverse[rest]]),
    )


def _upper(zeros: Complexes) -> Complexes:
    """The real ones among zeros, and the upper one of each conjugate pair."""
    are_real = np.abs(zeros.imag) <= CONVERGED * np.abs(zeros)
    return np.concatenate([zeros[are_real].real, zeros[~are_real & (zeros.imag > 0.0)]])


def _without_rounding(row: Floats, values: Complexes) -> Complexes:
    """Products of a row (n,) with values (m, n), with rounding errors set to zero."""
    product = times_real(values, row)
    product[np.abs(product) <= ROUNDING * (np.abs(values) @ np.abs(row))] = 0.0
    return product


def _squares(values: Complexes) -> Floats:
    """Squares of absolute values."""
    return np.asarray(values.real**2 + values.imag**2)


class _Zeros(NamedTuple):
    """Zeros of a secular function, the upper one of each conjugate pair."""

    exponent: Complexes  # (z,)
    distance: Complexes  # (z,), to the exponent at `own`
    own: Ints  # (z,)
    is_real: NDArray[np.bool_]  # (z,)


class _Poles(NamedTuple):
    """A secular function: its k poles and the conjugates of those that are complex, p in all."""

    upper: Complexes  # (k,)
    every: Complexes  # (p,)
    turned: Ints  # poles with a conjugate, among the k
    seen: Complexes  # (p,), c_j
    moved: Complexes  # (p,), b_j
    residue: Complexes  # (p,), r_j
    apart: Complexes  # (k, p), differences; infinite for itself and coinciding poles
    nearest: Floats  # (k,), least distance to another pole

    @classmethod
    def of(cls, upper: Complexes, seen: Complexes, moved: Complexes) -> _Poles | None:
        """None where poles coincide and are coupled."""
        turned = np.flatnonzero(upper.imag != 0.0)
        every, every_seen, every_moved = (
            np.concatenate([values, values[turned].conj()]) for values in (upper, seen, moved)
        )
        apart = upper[:, None] - every
        square = _squares(apart)
        same = square <= (SAME * np.abs(upper)[:, None]) ** 2
        own = np.arange(upper.size)
        same[own, own] = False
        if np.any(same & ((seen[:, None] * every_moved != 0.0) | (moved[:, None] * every_seen != 0.0))):
            return None
        same[own, own] = True
        apart[same] = square[same] = np.inf
        return cls(
            upper,
            every,
            turned,
            every_seen,
            every_moved,
            every_seen * every_moved,
            apart,
            np.sqrt(square.min(axis=1, initial=np.inf)),
        )

    def zeros(self) -> _Zeros | None:
        """All zeros by Newton's method; None where it does not converge to as many."""
        n_pole = self.upper.size
        with np.errstate(divide="ignore", invalid="ignore"):  # not finite: strong
            first = -self.residue[:n_pole] / ((1.0 / self.apart) @ self.residue)
        weak = np.abs(first) <= WEAK * self.nearest
        strong = np.flatnonzero(~weak)
        started = self._start(strong)
        if started is None:
            return None
        distances = np.abs(started[:, None] - self.upper[strong])
        nearest = strong[distances.argmin(axis=1)] if strong.size else strong
        own = np.concatenate([np.flatnonzero(weak), nearest])
        distance = np.concatenate([first[weak], started - self.upper[nearest]])
        is_real = np.concatenate([self.upper[weak].imag == 0.0, started.imag == 0.0])
        residue = self.residue[own]
        moving = np.flatnonzero(residue != 0.0)
        left = moving
        for _ in range(PASSES):
            inverse = 1.0 / (self.apart[own[left]] + distance[left, None])
            value, slope = inverse @ self.residue, -(inverse * inverse) @ self.residue
            at_zero = distance[left] * value + residue[left]
            rate = value + distance[left] * slope
            shared = left >= own.size - started.size
            if np.any(shared):
                others = self._from_others(own, distance, is_real, left[shared])
                rate[shared] += at_zero[shared] * (inverse[shared].sum(axis=1) - others)
            if not np.all(np.isfinite(rate)):  # two have met
                return None
            step = at_zero / rate
            distance[left] -= step
            left = left[np.abs(step) > CONVERGED * np.abs(distance[left])]
            if not left.size:
                break
        exponent = self.upper[own] + distance
        exponent.imag[is_real] = 0.0
        away = _squares(exponent[moving, None] - exponent[moving])
        np.fill_diagonal(away, np.inf)
        are_new = np.all(away > (SAME * np.abs(exponent[moving])[:, None]) ** 2)
        are_complex = np.all(exponent.imag[~is_real] > CONVERGED * np.abs(exponent[~is_real]))
        return _Zeros(exponent, distance, own, is_real) if not left.size and are_new and are_complex else None

    def _from_others(self, own: Ints, distance: Complexes, is_real: NDArray[np.bool_], at: Ints) -> Complexes:
        """Sum of 1 / (z - z_j) over all zeros other than z, and their conjugates, for the zeros `at`."""
        zeros = self.upper[own] + distance
        away = zeros[at, None] - np.concatenate([zeros, zeros[~is_real].conj()])
        away[np.arange(at.size), at] = np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((1.0 / away).sum(axis=1))

    def _start(self, strong: Ints) -> Complexes | None:
        """First zeros among the strong poles: those of a small system, with a constant sum of the others.

        Beyond all other poles their sum is negligible.
        """
        if strong.size > MOST_STRONG * self.upper.size:
            return None
        partners = self.upper.size + np.flatnonzero(np.isin(self.turned, strong))
        chosen = np.concatenate([strong, partners])
        others = np.ones(self.every.size, dtype=bool)
        others[chosen] = False
        still = self.residue / self.every
        constant = -still[others].sum().real
        n_zero = chosen.size - 2
        if n_zero < 0 or np.abs(constant) <= CONVERGED * np.abs(still).sum():
            return None
        found = np.linalg.eigvals(np.diag(self.every[chosen]) - self.residue[chosen] / constant)
        far = np.abs(self.every[others]).max(initial=0.0)
        beyond = self._zeros_alone(chosen) if np.any(np.abs(self.every[chosen]) > far) else found[:0]
        merged = np.concatenate([found[np.abs(found) <= far], beyond[np.abs(beyond) > far]])
        nearest = found[np.argsort(np.abs(found), kind="stable")[:n_zero]]
        started = _upper(merged if merged.size == n_zero else nearest)
        return started if started.size + np.count_nonzero(started.imag) == n_zero else None

    def _zeros_alone(self, chosen: Ints) -> Complexes:
        """Zeros of the function with these poles alone, and one at zero so that residues sum to zero."""
        pole, residue = self.every[chosen], self.residue[chosen]
        weight = residue * pole
        coupling = np.outer(pole, weight / weight.sum())
        return np.asarray(np.linalg.eigvals(np.diag(pole) - coupling), dtype=np.complex128)

    def shapes(self, zeros: _Zeros) -> tuple[Complexes, Complexes] | None:
        """Shapes and inverses in terms of those of the poles, (z, p) each; None where nearly orthogonal."""
        inverse = 1.0 / (self.apart[zeros.own] + zeros.distance[:, None])
        value = inverse @ self.residue
        right = (-self.seen[zeros.own] / value)[:, None] * self.moved * inverse
        left = (-self.moved[zeros.own] / value)[:, None] * self.seen * inverse
        at = np.arange(zeros.own.size), zeros.own
        right[at] = left[at] = 1.0
        sizes = np.linalg.norm(right, axis=1) * np.linalg.norm(left, axis=1)
        return (right, left) if np.all(np.abs((right * left).sum(axis=1)) > WORST * sizes) else None

    def combined(self, weights: Complexes, values: Complexes) -> Complexes:
        """Sum over all poles of weights (z, p) times values (k, n) and their conjugates: (z, n)."""
        found: Complexes = weights @ np.concatenate([values, values[self.turned].conj()])
        return found


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
    return contact.row.tobytes() + contact.force.tobytes()


def _states(rows: Ints, n: int) -> Ints:
    """Coordinates and their rates among displacements, then velocities, of n coordinates."""
    return np.concatenate([rows, n + rows])
