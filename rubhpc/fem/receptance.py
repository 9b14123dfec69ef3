"""Receptances for rotating forces: motion of a point over a force on it that turns at a whirl frequency.

A force `f exp(i w t)` in the complex plane v + i w turns with the frequency w, forward where w is positive.
The forward part of the response is `alpha(w) f exp(i w t)` with

    alpha(w) = 1/2 (1, i) A(i w) (1, -i)^T,   A(s) = L (M s^2 + (D + spin G) s + K)^-1 L^T,

which is the whole response of an isotropic body. Of an anisotropic one it is the mean over all directions,
and the backward part is left out. As a sum over modes, `alpha(w) = sum residue / (i w - pole)`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.modes import EPS, first_order, modal_form

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Body

    Floats = NDArray[np.float64]
    Complex = NDArray[np.complex128]

FORWARD = np.array([1.0, 1j])  # v + i w of (v, w)
_RESOLVED = 0.05  # change of a receptance over its size, within a cell of `cells`
_NARROWEST = 1e-9  # width of a cell over its frequency
_UNDAMPED = 1e-8  # least ratio of damping, for the sake of numbers
_SEEN = 1e-9  # share in a receptance at its own resonance, below which a mode is left out
_ANISOTROPIC = 1e-7  # backward over forward response, from which a body is called anisotropic
_FILL = np.array([10.0, 20.0])  # rates of decay of what replaces fast modes, over the limit
# Frequency over the lowest one that a rigid-body mode is given: a double pole has no sum of modes.
_SOFT = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Receptance:
    """A receptance as a sum over modes.

    Attributes
    ----------
    pole : (n,) complex
        Eigenvalues, rad/s.
    residue : (n,) complex
        m/(N s), or rad/(N m s).
    is_mean : bool
        Whether it leaves a backward response out: the body is anisotropic.
    """

    pole: Complex
    residue: Complex
    is_mean: bool = False

    def __add__(self, other: Receptance) -> Receptance:
        return Receptance(
            pole=np.append(self.pole, other.pole),
            residue=np.append(self.residue, other.residue),
            is_mean=self.is_mean or other.is_mean,
        )

    def scaled(self, factor: float) -> Receptance:
        """Return the receptance multiplied by a factor."""
        return Receptance(pole=self.pole, residue=factor * self.residue, is_mean=self.is_mean)

    def reduced(self, limit: float) -> Receptance:
        """Return the receptance with two real poles in place of all those faster than a limit (rad/s).

        The two have the static flexibility of those that they replace, and the same sum of residues: a force
        still moves the body by its inertia alone at first.
        """
        is_fast = np.abs(self.pole) > limit
        if is_fast.sum() <= len(_FILL):
            return self
        pole, fast = -limit * _FILL, self.residue[is_fast]
        asked = np.array([fast.sum(), (fast / self.pole[is_fast]).sum()])
        filling = np.linalg.solve(np.stack([np.ones(len(pole)), 1.0 / pole]), asked)
        return Receptance(
            pole=np.append(self.pole[~is_fast], pole),
            residue=np.append(self.residue[~is_fast], filling),
            is_mean=self.is_mean,
        )

    def at(self, frequency: float | Floats) -> Complex:
        """Return the receptance at whirl frequencies (rad/s), an array of their shape, m/N."""
        found: Complex = self.derivatives(frequency, 0)[0]
        return found

    def derivatives(self, frequency: float | Floats, order: int) -> Complex:
        """Return the receptance and its derivatives with the frequency, (order + 1, ...)."""
        term = 1.0 / (1j * np.asarray(frequency, dtype=float)[..., np.newaxis] - self.pole)
        power, factor = term, self.residue
        found = [term @ factor]
        for k in range(1, order + 1):
            power, factor = power * term, factor * (-1j * k)
            found.append(power @ factor)
        return np.array(found)

    def cells(self, low: float, high: float) -> tuple[Floats, Floats]:
        """Return intervals that hold all frequencies with Re alpha < 0: their lower and upper ends, (n,).

        In each the receptance changes by less than 5 % of its size. This is a bound, from the first two
        derivatives in the middle and the poles: no resonance, however narrow, is between the ends unseen.
        """
        size = np.abs(self.residue)
        ends = np.unique(np.clip([low, 0.0, high], low, high))
        lower, upper = ends[:-1], ends[1:]
        kept_lower, kept_upper = [], []
        while lower.size:
            middle, half = (lower + upper) / 2, (upper - lower) / 2
            value, slope, bend = self.derivatives(middle, 2)
            apart = np.maximum(np.abs(middle[:, np.newaxis] - self.pole.imag) - half[:, np.newaxis], 0.0)
            square = apart**2 + self.pole.real**2
            with np.errstate(divide="ignore"):
                third = (1.0 / square**2) @ size  # a sixth of a bound of the third derivative
            change = half * (np.abs(slope) + half * (np.abs(bend) / 2 + half * third))
            may_press = value.real <= change
            is_fine = (change <= _RESOLVED * np.abs(value)) | (half <= _NARROWEST * np.abs(middle))
            kept_lower.append(lower[may_press & is_fine])
            kept_upper.append(upper[may_press & is_fine])
            left = may_press & ~is_fine
            lower, upper = (
                np.concatenate([lower[left], middle[left]]),
                np.concatenate([middle[left], upper[left]]),
            )
        lower, upper = (np.concatenate(kept) if kept else np.zeros(0) for kept in (kept_lower, kept_upper))
        order = np.argsort(lower)
        return lower[order], upper[order]


RIGID = Receptance(pole=np.zeros(0, dtype=np.complex128), residue=np.zeros(0, dtype=np.complex128))


def turning_receptances(body: Body, places: Sequence[tuple[int, int]]) -> list[Receptance]:
    """Return the receptances of points of a body for forces that turn about the shaft.

    Parameters
    ----------
    body : Body
        With the damping matrix `D + spin G` as its `damping`.
    places : sequence of (v, w)
        Rows of the displacements up and horizontally of each point; -1 where there is none.
    """
    rows = np.unique([row for place in places for row in place if row >= 0])
    if not rows.size:
        return [RIGID] * len(places)
    pole, left, right = _modal(body, rows)
    found = []
    for place in places:
        is_free = np.array(place) >= 0
        at = np.searchsorted(rows, np.array(place)[is_free])
        gain, push = FORWARD[is_free] @ left[at], right[:, at] @ FORWARD[is_free].conj()
        whole = Receptance(pole=pole, residue=0.5 * gain * push)
        back = Receptance(pole=pole, residue=0.5 * (FORWARD[is_free].conj() @ left[at]) * push)
        is_seen = _seen(whole)
        tried = 1.01 * np.abs(pole[is_seen])
        scale = np.abs(whole.residue / pole).sum()
        is_mean = (np.abs(back.at(tried)) > _ANISOTROPIC * scale).any()
        found.append(
            Receptance(
                pole=pole[is_seen],
                residue=whole.residue[is_seen],
                is_mean=bool(is_mean) or not is_free.all(),
            )
        )
    return found


def twist_receptance(body: Body, row: int) -> Receptance:
    """Return the receptance of a rotation about the shaft for a torque; nothing where `row` is -1."""
    if row < 0:
        return RIGID
    pole, left, right = _modal(body, np.array([row]))
    whole = Receptance(pole=pole, residue=left[0] * right[:, 0])
    is_seen = _seen(whole)
    return Receptance(pole=pole[is_seen], residue=whole.residue[is_seen])


def _modal(body: Body, rows: NDArray[np.int64]) -> tuple[Complex, Complex, Complex]:
    """Poles (n,), and what displacements at rows (q, n) and forces there (n, q) are of each mode."""
    part = np.flatnonzero(np.isin(body.part, body.part[rows]))
    block = np.ix_(part, part)
    here = np.searchsorted(part, rows)
    shapes, sigma, stiffness, damping = modal_form(
        body.mass[block], body.damping[block], body.stiffness[block]
    )
    is_free = np.diag(stiffness) == 0.0
    stiffness[is_free, is_free] = (_SOFT * sigma[~is_free].min(initial=sigma.max())) ** 2
    pole, vectors = np.linalg.eig(first_order(sigma, stiffness, damping))
    is_undamped = np.abs(pole.real) < _UNDAMPED * np.abs(pole)
    pole[is_undamped] = 1j * pole[is_undamped].imag - _UNDAMPED * np.abs(pole[is_undamped])
    n = len(part)
    left = (shapes[here] / sigma) @ vectors[:n]
    right = np.linalg.solve(vectors, np.vstack([np.zeros((n, len(rows))), shapes[here].T]))
    return pole, left, right


def _seen(whole: Receptance) -> NDArray[np.bool_]:
    """Which modes matter at their own resonance."""
    size, pole = np.abs(whole.residue), whole.pole
    there = np.abs(whole.at(pole.imag + EPS * np.abs(pole)))
    found: NDArray[np.bool_] = (size > _SEEN * there * np.abs(pole.real)) & (
        size > EPS * size.max(initial=0.0)
    )
    return found
