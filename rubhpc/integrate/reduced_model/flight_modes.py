"""The collocation integrator's view of a reduced model: flight modes, local motions, signals and tables."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.reduced_model.curved_library import _outputs, motion_rows
from rubhpc.kernels._jit import plain
from rubhpc.kernels.collocation.observing import Signals
from rubhpc.kernels.collocation.structures import (
    ACROSS,
    ALONG,
    BENDING,
    FIXED,
    HARD,
    HERTZ,
    PENALTY,
    ROUND,
    TWIST,
    Bodies,
    Nodes,
    Tables,
    lobatto_nodes,
)
from rubhpc.kernels.contact_modes import LATERAL_RATE, LATERAL_ROW, N_ROTOR_ROW, TWIST_ACCELERATION_ROW
from rubhpc.kernels.contact_pairs import rim_sense
from rubhpc.kernels.laws import STRIBECK, TABLE, is_set_valued

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

NODES_HARD, NODES_SPRING = 4, 5
LONGEST_PART = 64  # longest step: a revolution over this
SHORTEST_LEVEL = 6  # ticks of the shortest step, as a power of two
MOST_SLOTS = 16
RESTING = 1e-9  # of the largest exponent: smaller sums of two exponents count as zero
ENOUGH = 0.3  # of the accuracy: share of the foreshortening that may be missed
UNSEEN = 1e-14  # of the largest: eigenvalues of damping and skew stiffness that are rounding


@dataclass(frozen=True, eq=False)
class FlightModes:
    """Modes with every pair open of one set-up, and what all its cases share."""

    setup: ModalSetup

    @cached_property
    def order(self) -> tuple[Floats, int]:
        """Modes in the order of the coordinates, as places among those of the open contact mode.

        And the number of complex ones; the last of these is the response to the unbalance.
        """
        m = self.setup._opened.n_eigenmode
        exponent = self.setup._opened.exponent[:m]
        turning = np.flatnonzero(exponent.imag != 0.0)
        return np.concatenate([turning, [m], np.flatnonzero(exponent.imag == 0.0)]), turning.size + 1

    @cached_property
    def exponent(self) -> Complexes:
        """Exponents (nm,), 1/s."""
        return np.ascontiguousarray(self.setup._opened.exponent[self.order[0]])

    @cached_property
    def shape(self) -> Complexes:
        """Reduced displacements, then velocities (2 n, nm)."""
        return self.setup._opened.motion[:, self.order[0]]

    @cached_property
    def enter(self) -> Complexes:
        """Modes from reduced displacements and velocities, less the response to the unbalance (nm, 2 n)."""
        (order, n_complex), mode = self.order, self.setup._opened
        enter = np.zeros((order.size, mode.enter.shape[1]), dtype=complex)
        enter[: n_complex - 1], enter[n_complex:] = mode.enter[order[: n_complex - 1]], mode.enter[order[n_complex:]]
        return enter

    def rows(self, values: Complexes) -> Floats:
        """Rows over the coordinates (r, nx) of rows over the modes (r, nm)."""
        n = self.order[1]
        rows: Floats = np.concatenate([values[:, :n].real, -values[:, :n].imag, values[:, n:].real], axis=1)
        return np.ascontiguousarray(rows)

    @cached_property
    def motion(self) -> Floats:
        """Reduced motion (2 n, nx) of the coordinates."""
        return self.rows(self.shape)

    def coordinates(self, motion: Floats, cosine: float = 1.0, sine: float = 0.0) -> Floats:
        """Coordinates (nx,) of a reduced motion (2 n,) at the shaft's angle."""
        n, response = self.order[1], self.shape[:, self.order[1] - 1]
        z = self.enter @ (motion - (response.real * cosine - response.imag * sine))
        z[n - 1] = cosine + 1j * sine
        return np.concatenate([z[:n].real, z[:n].imag, z[n:].real])

    @cached_property
    def sense(self) -> float:
        """1 or -1: direction in which the rim slides."""
        return plain(rim_sense)(self.setup.spin)

    @cached_property
    def local(self) -> Floats:
        """Local motions of all pairs from the reduced displacements (R, n)."""
        setup = self.setup
        given = motion_rows(setup.reduced, setup.model)
        radius = np.array([stator.radius for stator in setup.model.stators])
        bending = [foreshortening_rows(rows, setup.reduced.stiffness, setup.accuracy) for rows in given]
        local = np.zeros((len(given), BENDING + max(map(len, bending)), given.shape[2]))
        local[:, ALONG], local[:, ACROSS] = given[:, 0], self.sense * given[:, 1]
        local[:, TWIST] = self.sense * radius[:, None] * given[:, -1]
        for pair, rows in zip(local, bending, strict=True):
            pair[BENDING : BENDING + len(rows)] = rows
        return local.reshape(-1, given.shape[2])

    @cached_property
    def n_local(self) -> int:
        """Local motions of a pair."""
        return len(self.local) // len(self.setup.model.stators)

    @cached_property
    def kicks(self) -> Complexes:
        """Rates of the modes by unit loads on the local motions (R, nm)."""
        n = self.local.shape[1]
        return np.ascontiguousarray((self.enter[:, n:] @ self.local.T).T)

    def bodies(self, friction: float, clearance: Floats) -> Bodies:
        """Bodies and pairs of a case; clearance (q,) at rest, m."""
        return self._bodies._replace(clearance=clearance, friction=np.full(clearance.size, friction))

    @cached_property
    def _bodies(self) -> Bodies:
        setup, law, n = self.setup, self.setup.law, self.local.shape[1]
        q, n_complex = len(setup.model.stators), self.order[1]
        displaced, moving = self.local @ self.shape[:n], self.local @ self.shape[n:]
        kick = np.concatenate([self.kicks[:, :n_complex].real, self.kicks[:, :n_complex].imag, self.kicks[:, n_complex:].real], axis=1)
        radius = np.array([stator.radius for stator in setup.model.stators])
        return Bodies(
            exponent=self.exponent,
            n_complex=n_complex,
            n_local=self.n_local,
            local=np.concatenate([self.rows(displaced), self.rows(moving), self.rows(moving * self.exponent)]),
            load=self.kicks,
            kick=np.ascontiguousarray(kick),
            bend=np.abs(moving * self.exponent),
            compliance=self.local @ self.local.T,
            kind=np.full(q, ROUND if setup.is_updated else FIXED),
            radius=radius,
            clearance=np.zeros(q),
            aside=self.sense * sag_at_stators(setup.model)[1],
            rim_speed=radius * abs(setup.spin),
            friction=np.zeros(q),
            normal_law=np.full(q, self.normal_law),
            stiffness=np.full(q, law.stiffness),
            damping=np.full(q, law.damping),
            restitution=np.full(q, law.restitution),
            law=law,
            is_sticky=bool(plain(is_set_valued)(law)),
            is_varied=law.friction_law in (STRIBECK, TABLE),
            translations=self.rows(setup.reduced.translations @ self.shape[:n]),
            displacement_limit=setup.displacement_limit,
        )

    @property
    def normal_law(self) -> int:
        """Law of the normal force."""
        return PENALTY if self.setup.law.stiffness > 0.0 else HARD

    @cached_property
    def nodes(self) -> Nodes:
        """Nodes of a step."""
        return lobatto_nodes(NODES_HARD if self.normal_law == HARD else NODES_SPRING)

    @cached_property
    def tables(self) -> Tables:
        """Tables of steps, filled when first taken."""
        setup, s, n_row = self.setup, self.nodes.at.size, len(self.local)
        turn = 2.0 * math.pi / abs(setup.spin)
        longest = math.floor(math.log2(turn / LONGEST_PART / setup.tick))
        first = max(SHORTEST_LEVEL, longest - MOST_SLOTS + 1)
        k, n_y, n_x = longest - first + 1, (2 * s - 1) * n_row, self.motion.shape[1]
        return Tables(
            first_level=first,
            tick=setup.tick,
            fading_time=setup.tick * 2.0**longest,
            is_filled=np.zeros(k, dtype=np.bool_),
            turn=np.zeros((k, self.exponent.size), dtype=complex),
            free=np.zeros((k, n_y, n_x)),
            forced=np.zeros((k, s * n_row, n_y)),
            end=np.zeros((k, s * n_row, n_x)),
            fade=np.zeros((k, s, 4)),
        )

    @cached_property
    def power(self) -> Complexes:
        """Exponentials of the modes over 2^level ticks (n_level, nm)."""
        level = np.arange(self.setup.n_level)
        return np.exp(np.outer(self.setup.tick * 2.0**level, self.exponent))

    @cached_property
    def signals(self) -> Signals:
        """Rows of the signals of a record."""
        reduced, n, s, n_row = self.setup.reduced, self.local.shape[1], self.nodes.at.size, len(self.local)
        at, moving, driven = _outputs(reduced)
        displaced, going = self.shape[:n], self.shape[n:]
        pushed = going * self.exponent
        rough = np.flatnonzero(driven.any(axis=1))
        tips = N_ROTOR_ROW + 3 * np.arange(self.setup.model.n_place)
        rates = {0: 3, 1: 4, 2: 5} | {int(tip) + LATERAL_ROW: int(tip) + LATERAL_RATE for tip in tips}
        smooth = np.setdiff1d(np.arange(len(at)), np.concatenate([rough, list(rates.values())]).astype(int))
        left, right, sign, n_loss, power = self._powers()
        tables, n_x = self.tables, self.motion.shape[1]
        k, n_seen = tables.is_filled.size, (s - 1) * (smooth.size + rough.size + len(power)) + smooth.size
        gained, drift = energy_forms(self.exponent, self.order[1], power, left, right, sign, n_loss)
        return Signals(
            value=self.rows(at @ displaced + moving @ going + driven @ pushed),
            direct=np.ascontiguousarray(driven @ self.local.T),
            smooth=smooth,
            rate_place=np.array([rates.get(int(row), -1) for row in smooth]),
            rate=self.rows((at @ going + moving @ pushed)[smooth]),
            rate_direct=np.ascontiguousarray((moving @ self.local.T)[smooth]),
            rough=rough,
            power=power,
            left=left,
            right=right,
            sign=sign,
            n_loss=n_loss,
            gained=gained,
            drift=drift,
            is_filled=np.zeros(k, dtype=np.bool_),
            free=np.zeros((k, n_seen, n_x)),
            forced=np.zeros((k, s * n_row, n_seen)),
        )

    def _powers(self) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats, int, Floats]:
        """Powers as products of rows over the coordinates: losses by damping, then works of the unbalance.

        Returns the places of both factors of each product, its sign, the number of losses, and the rows.
        """
        reduced, n = self.setup.reduced, self.local.shape[1]
        displaced, going = self.shape[:n], self.shape[n:]
        size, shape = np.linalg.eigh(0.5 * (reduced.damping + reduced.damping.T))
        keep = np.abs(size) > UNSEEN * max(np.abs(size).max(), UNSEEN)
        dampers = (np.sqrt(np.abs(size)) * shape).T[keep]
        skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
        u, circulation, v = np.linalg.svd(skew)
        round_ = circulation > UNSEEN * np.abs(reduced.stiffness).max()
        d, c = len(dampers), int(round_.sum())
        turned = np.zeros((2, self.exponent.size), dtype=complex)
        turned[:, self.order[1] - 1] = 1.0, -1j
        rows = [dampers @ going, u.T[round_] @ going, (circulation[:, None] * v)[round_] @ displaced]
        forces = np.array([reduced.force[0], reduced.force[1]])
        rows += [forces @ going, turned]
        first = d + 2 * c
        left = np.concatenate([np.arange(d + c), [first, first + 1]])
        right = np.concatenate([np.arange(d), d + c + np.arange(c), [first + 2, first + 3]])
        sign = np.concatenate([np.sign(size[keep]), np.ones(c + 2)])
        return left, right, sign, d + c, self.rows(np.concatenate(rows))


def foreshortening_rows(motion: Floats, stiffness: Floats, accuracy: float) -> Floats:
    """Rows (b, n) whose squares add up to twice the foreshortening of a stator, for the accuracy asked for.

    They are those of the pencil of foreshortening and stiffness, the first ones in the order of what they
    add where a static force bends the stator. `motion` (3 + r, n) are its `motion_rows`.
    """
    rows = motion[2:-1][motion[2:-1].any(axis=1)]
    if not len(rows):
        return rows
    compliant = np.linalg.lstsq(stiffness, np.vstack([rows, motion[1]]).T, rcond=None)[0]
    turn = np.linalg.eigh(rows @ compliant[:, :-1])[1].T[::-1]
    share = np.square(turn @ rows @ compliant[:, -1])
    missed = share.sum() - np.cumsum(share)
    n_kept = 1 + int(np.count_nonzero(missed > ENOUGH * accuracy * share.sum()))
    kept: Floats = (turn @ rows)[:n_kept]
    return kept


def energy_forms(
    exponent: Complexes,
    n_complex: int,
    power: Floats,
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    sign: Floats,
    n_loss: int,
) -> tuple[Floats, Floats]:
    """Quadratic forms of the coordinates whose growth in free motion is a work, and those it grows by in time.

    A power `x' P x` of modes with the exponents a and b has the primitive `P_ab / (a + b)`; where the sum is
    zero it is constant.
    """
    n_x = n_complex + exponent.size
    values = np.concatenate([exponent[:n_complex], exponent[:n_complex].conj(), exponent[n_complex:]])
    to_modes = np.zeros((n_x, n_x), dtype=complex)
    i = np.arange(n_complex)
    to_modes[i, i], to_modes[i, n_complex + i] = 1.0, 1j
    to_modes[n_complex + i, i], to_modes[n_complex + i, n_complex + i] = 1.0, -1j
    j = np.arange(2 * n_complex, n_x)
    to_modes[j, j] = 1.0
    from_modes = np.linalg.inv(to_modes)
    total = values[:, None] + values
    is_resting = np.abs(total) <= RESTING * np.abs(exponent).max() * 1e-3
    gained, drift = np.zeros((2, 2, n_x, n_x))
    for kind, these in enumerate([slice(0, n_loss), slice(n_loss, None)]):
        form = power[left[these]].T @ (sign[these, None] * power[right[these]])
        form = from_modes.T @ (0.5 * (form + form.T)) @ from_modes
        grown = np.where(is_resting, 0.0, form / np.where(is_resting, 1.0, total))
        gained[kind] = (to_modes.T @ grown @ to_modes).real
        drift[kind] = (to_modes.T @ np.where(is_resting, form, 0.0) @ to_modes).real
    return gained, drift
