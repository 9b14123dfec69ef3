"""Eigenmodes with one more contact, from those without it, by the zeros of a secular function."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.reduced_model.products import times_real

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


class Contact(NamedTuple):
    """A closed pair, or a sticking slip."""

    row: Floats  # (n,), constrained or pressed quantity, by displacements
    force: Floats  # (n,), of a unit contact force
    stiffness: float = 0.0  # N/m; with neither stiffness nor damping, `row` is a constraint
    damping: float = 0.0  # N s/m


class Eigenmodes(NamedTuple):
    """Eigenmodes of n coordinates, one per conjugate pair: `x = Re(shape @ z)`, `z = inverse @ (x, v)`."""

    exponent: Complexes  # (m,), 1/s
    shape: Complexes  # (n, m), displacements, doubled for one of a pair
    inverse: Complexes  # (m, 2 n)


def with_contact(modes: Eigenmodes, contact: Contact) -> Eigenmodes | None:
    """Eigenmodes with one more contact; None where the method fails.

    With `A` the system without it, `b` the input of its force and `c` its row, the force is that of a
    constraint `c x = 0`, or `-(k + d s) c x`. Exponents are then the zeros of

        a + sum over j of r_j / (s - l_j),    r_j = (k + d l_j) c_j b_j,   a = 1,

    over all exponents `l_j` of A, b and c by its eigenmodes; of a constraint a = 0 and `r_j = c_j b_j`, and
    two zeros are infinite. At a zero s the shape is `inv(s - A) b` and the inverse `c inv(s - A)`. Zeros are
    represented as distances to an exponent, which makes both as accurate as the eigenmodes of A (Gu and
    Eisenstat, SIAM J. Matrix Anal. Appl. 15 (1994) 1266-1276). Converged, distinct zeros in the expected
    number are complete.
    """
    n = len(contact.row)
    is_held = contact.stiffness == 0.0 and contact.damping == 0.0
    half = np.where(modes.exponent.imag == 0.0, 1.0, 0.5)
    seen = _without_rounding(contact.row, modes.shape.T) * half
    moved = _without_rounding(contact.force, modes.inverse[:, n:])
    if not is_held:
        seen = seen * (contact.stiffness + contact.damping * modes.exponent)
    is_active = (seen != 0.0) | (moved != 0.0)
    active, rest = np.flatnonzero(is_active), np.flatnonzero(~is_active)
    poles = _Poles.of(modes.exponent[active], seen[active], moved[active], is_held)
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
    constant: float  # a
    apart: Complexes  # (k, p), differences; infinite for itself and coinciding poles
    nearest: Floats  # (k,), least distance to another pole

    @classmethod
    def of(cls, upper: Complexes, seen: Complexes, moved: Complexes, is_held: bool) -> _Poles | None:
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
            0.0 if is_held else 1.0,
            apart,
            np.sqrt(square.min(axis=1, initial=np.inf)),
        )

    def zeros(self) -> _Zeros | None:
        """All zeros by Newton's method; None where it does not converge to as many."""
        n_pole = self.upper.size
        with np.errstate(divide="ignore", invalid="ignore"):  # not finite: strong
            first = -self.residue[:n_pole] / (self.constant + (1.0 / self.apart) @ self.residue)
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
            value, slope = self.constant + inverse @ self.residue, -(inverse * inverse) @ self.residue
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
        constant = self.constant - still[others].sum().real
        n_zero = chosen.size - (2 if self.constant == 0.0 else 0)
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
        coupling = residue / self.constant if self.constant else np.outer(pole, weight / weight.sum())
        return np.asarray(np.linalg.eigvals(np.diag(pole) - coupling), dtype=np.complex128)

    def shapes(self, zeros: _Zeros) -> tuple[Complexes, Complexes] | None:
        """Shapes and inverses in terms of those of the poles, (z, p) each; None where nearly orthogonal."""
        inverse = 1.0 / (self.apart[zeros.own] + zeros.distance[:, None])
        value = self.constant + inverse @ self.residue
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
