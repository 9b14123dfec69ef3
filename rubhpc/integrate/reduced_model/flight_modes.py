"""The collocation integrator's view of a reduced model: flight modes, local motions, signals and tables."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.packing import normal_laws
from rubhpc.kernels._jit import plain
from rubhpc.kernels.collocation.observing import Signals
from rubhpc.kernels.collocation.structures import (
    ACROSS,
    ALONG,
    BENDING,
    FIXED,
    ROUND,
    TWIST,
    Bodies,
    Nodes,
    Tables,
    lobatto_nodes,
)
from rubhpc.kernels.contact_modes import LATERAL_RATE, LATERAL_ROW, N_ROTOR_ROW
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL, TORSION, V, W, rim_sense
from rubhpc.kernels.laws import LAGRANGE, depends_on_slip, may_stick

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model, StatorModel
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.laws import Law

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

NODES_HARD, NODES_SPRING = 4, 5
LONGEST_LEVEL = 7  # of a revolution, longest step: over 2^7; also of any step with a tangent
LONGER_IN_BORES = 2  # levels by which it is longer where contact may last and the force only turn
SHORTEST_LEVEL = 6  # ticks of the shortest step, as a power of two
QUIET = 3e-4  # m/s2, of a rotor that bores catch, by the rounding of its displacement in the shortest step
MOST_SLOTS = 16
RESTING = 1e-9  # of the largest exponent: smaller sums of two exponents count as zero
ENOUGH = 0.3  # of the accuracy: share of the foreshortening that may be missed
UNBENT = 1e-8  # bending displacement over the largest of a stator; smaller ones count as zero
UNSEEN = 1e-14  # of the largest: eigenvalues of damping and skew stiffness that are rounding


class Settings(Protocol):
    """What a `modal_setup.ModalSetup` has."""

    @property
    def model(self) -> Model:
        """The model."""

    @property
    def reduced(self) -> ReducedModel:
        """The same in reduced coordinates."""

    @property
    def law(self) -> Law:
        """Laws of contact and friction."""

    @property
    def is_updated(self) -> bool:
        """Whether the normal follows the line of centres."""

    @property
    def spin(self) -> float:
        """Speed, rad/s."""

    @property
    def accuracy(self) -> float:
        """Accuracy asked for."""

    @property
    def displacement_limit(self) -> float:
        """Displacement beyond which a motion has diverged, m."""

    @property
    def tick(self) -> float:
        """Resolution of events, s."""

    @property
    def has_energies(self) -> bool:
        """Whether records have the losses by damping and the works of turning forces."""

    @property
    def local_motions(self) -> Floats:
        """Local motions of each pair (`motion_rows`)."""

    @property
    def n_level(self) -> int:
        """Levels for which exponentials are tabulated."""


@dataclass(frozen=True, eq=False)
class FlightModes:
    """Modes with every pair open of one set-up, and what all its cases share.

    Attributes
    ----------
    eigenvalue : (m,), 1/s
    eigenmotion : (2 n, m)
        Reduced displacements, then velocities: the real part is the motion.
    entry : (m, 2 n)
        Modes from reduced displacements and velocities.
    is_complex : (m,)
        The other modes are real.
    turning : complex, 1/s
        Exponent of the unbalance force.
    orders : (f,)
        Multiples of it that are exponents of forces: 1 of the unbalance, then those of harmonics.
    response : (2 n, f)
        Motions under them.
    corrections : int
        Of coordinates: what enters modes that are interpolated is not quite their inverse.
    """

    setup: Settings
    eigenvalue: Complexes
    eigenmotion: Complexes
    entry: Complexes
    is_complex: NDArray[np.bool_]
    turning: complex
    orders: NDArray[np.int64]
    response: Complexes
    corrections: int = 0

    @cached_property
    def n_complex(self) -> int:
        """Number of complex modes, of which the responses to turning forces are the last."""
        return int(np.count_nonzero(self.is_complex)) + self.orders.size

    @cached_property
    def exponent(self) -> Complexes:
        """Exponents (nm,) in the order of the coordinates, 1/s."""
        turns = self.is_complex
        return np.concatenate([self.eigenvalue[turns], self.orders * self.turning, self.eigenvalue[~turns]])

    @cached_property
    def shape(self) -> Complexes:
        """Reduced displacements, then velocities (2 n, nm)."""
        turns = self.is_complex
        return np.column_stack([self.eigenmotion[:, turns], self.response, self.eigenmotion[:, ~turns]])

    @cached_property
    def enter(self) -> Complexes:
        """Modes from reduced displacements and velocities, less the responses to forces (nm, 2 n)."""
        turns = self.is_complex
        none = np.zeros((self.orders.size, self.entry.shape[1]))
        return np.concatenate([self.entry[turns], none, self.entry[~turns]])

    def rows(self, values: Complexes) -> Floats:
        """Rows over the coordinates (r, nx) of rows over the modes (r, nm)."""
        n = self.n_complex
        rows: Floats = np.concatenate([values[:, :n].real, -values[:, :n].imag, values[:, n:].real], axis=1)
        return np.ascontiguousarray(rows)

    @cached_property
    def motion(self) -> Floats:
        """Reduced motion (2 n, nx) of the coordinates."""
        return self.rows(self.shape)

    def coordinates(self, motion: Floats, cosine: float = 1.0, sine: float = 0.0) -> Floats:
        """Coordinates (nx,) of a reduced motion (2 n,) at the shaft's angle."""
        n, turned = self.n_complex, (cosine + 1j * sine) ** self.orders
        response = (self.response.real * turned.real - self.response.imag * turned.imag).sum(axis=1)
        z = self._corrected(self.enter @ (motion - response), motion - response, max(self.corrections, 1))
        z[n - self.orders.size : n] = turned
        return np.concatenate([z[:n].real, z[:n].imag, z[n:].real])

    def _corrected(self, z: Complexes, motions: Floats, count: int) -> Complexes:
        """Coordinates (nm, ...) of reduced motions (2 n, ...), refined so many times."""
        for _ in range(count):
            z += self.enter @ (motions - (self.shape @ z).real)
        return z

    @cached_property
    def sense(self) -> float:
        """1 or -1: direction in which the rim slides."""
        return plain(rim_sense)(self.setup.spin)

    @cached_property
    def local(self) -> Floats:
        """Local motions of all pairs from the reduced displacements (R, n)."""
        local = self.setup.local_motions.copy()
        local[:, ACROSS] *= self.sense
        local[:, TWIST] *= self.sense
        return local.reshape(-1, local.shape[2])

    @cached_property
    def n_local(self) -> int:
        """Local motions of a pair."""
        return len(self.local) // len(self.setup.model.stators)

    @cached_property
    def kicks(self) -> Complexes:
        """Rates of the modes by unit loads on the local motions (R, nm)."""
        n = self.local.shape[1]
        rates = np.concatenate([np.zeros((n, len(self.local))), self.local.T])
        kicks = self._corrected(self.enter[:, n:] @ self.local.T, rates, self.corrections)
        return np.ascontiguousarray(kicks.T)

    def bodies(self, friction: float, clearance: Floats) -> Bodies:
        """Bodies and pairs of a case; clearance (q,) at rest, m."""
        stators, bodies = self.setup.model.stators, self._bodies
        nearer = sag_at_stators(self.setup.model)[0]
        is_bore = np.array([stator.is_bore for stator in stators])
        return bodies._replace(
            clearance=clearance,
            radius=np.where(is_bore, -(clearance + nearer), bodies.radius),
            friction=friction * np.array([stator.friction_factor for stator in stators]),
        )

    @cached_property
    def _bodies(self) -> Bodies:
        setup, law, n = self.setup, self.setup.law, self.local.shape[1]
        q, n_complex = len(setup.model.stators), self.n_complex
        displaced, moving = self.local @ self.shape[:n], self.local @ self.shape[n:]
        kick = np.concatenate(
            [self.kicks[:, :n_complex].real, self.kicks[:, :n_complex].imag, self.kicks[:, n_complex:].real],
            axis=1,
        )
        radius = np.array([stator.radius for stator in setup.model.stators])
        return Bodies(
            exponent=self.exponent,
            n_complex=n_complex,
            n_local=self.n_local,
            local=np.concatenate(
                [self.rows(displaced), self.rows(moving), self.rows(moving * self.exponent)]
            ),
            load=self.kicks,
            kick=np.ascontiguousarray(kick),
            bend=np.abs(moving * self.exponent),
            compliance=self.local @ self.local.T,
            reach=np.abs(moving) @ np.abs(self.kicks).T,
            kind=np.full(q, ROUND if setup.is_updated else FIXED),
            is_straight=not setup.is_updated and self.n_local == BENDING,
            radius=radius,
            clearance=np.zeros(q),
            aside=self.sense * sag_at_stators(setup.model)[1],
            space=self._space,
            rim_speed=radius * abs(setup.spin),
            friction=np.zeros(q),
            **normal_laws(setup.model, law),
            law=law,
            may_stick=bool(plain(may_stick)(law)),
            depends_on_slip=bool(plain(depends_on_slip)(law)),
            translations=self.rows(setup.reduced.translations @ self.shape[:n]),
            displacement_limit=setup.displacement_limit,
        )

    @property
    def _space(self) -> Floats:
        angle = np.array([stator.angle for stator in self.setup.model.stators])
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -self.sense * s], [s, self.sense * c]]).transpose(2, 0, 1).copy()

    @cached_property
    def nodes(self) -> Nodes:
        """Nodes of a step."""
        is_hard = np.all(self._bodies.normal_law == LAGRANGE)
        return lobatto_nodes(NODES_HARD if is_hard else NODES_SPRING)

    @cached_property
    def tables(self) -> Tables:
        """Tables of steps, filled when first taken."""
        setup, s, n_row = self.setup, self.nodes.at.size, len(self.local)
        turn = 2.0 * math.pi / abs(setup.spin)
        longest = math.floor(math.log2(turn / setup.tick)) - LONGEST_LEVEL
        first = max(SHORTEST_LEVEL, longest - MOST_SLOTS + 1)
        sag = float(np.abs(setup.model.sag).max(initial=0.0))
        if setup.model.rotor.softness and sag:  # it rests metres away: shorter steps see the rounding of that
            least = math.sqrt(np.finfo(float).eps * sag / QUIET)
            first = min(max(first, math.ceil(math.log2(least / setup.tick))), longest)
        longest += self._n_longer
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

    @property
    def _n_longer(self) -> int:
        """Levels by which steps without a tangent are longer."""
        return LONGER_IN_BORES if any(stator.is_bore for stator in self.setup.model.stators) else 0

    @cached_property
    def tangent_tables(self) -> Tables:
        """Those of the steps that a tangent takes: the error of forces does not see that of small changes."""
        tables, n = self.tables, self._n_longer
        arrays = {name: value for name, value in tables._asdict().items() if isinstance(value, np.ndarray)}
        return tables._replace(**{name: value[: len(value) - n] for name, value in arrays.items()})

    @cached_property
    def power(self) -> Complexes:
        """Exponentials of the modes over 2^level ticks (n_level, nm)."""
        level = np.arange(self.setup.n_level)
        power: Complexes = np.exp(np.outer(self.setup.tick * 2.0**level, self.exponent))
        return power

    @cached_property
    def signals(self) -> Signals:
        """Rows of the signals of a record."""
        reduced, n, s, n_row = self.setup.reduced, self.local.shape[1], self.nodes.at.size, len(self.local)
        at, moving, driven = output_rows(reduced)
        displaced, going = self.shape[:n], self.shape[n:]
        pushed = going * self.exponent
        rough = np.flatnonzero(driven.any(axis=1))
        tips = N_ROTOR_ROW + 3 * np.arange(self.setup.model.n_place)
        rates = {0: 3, 1: 4, 2: 5} | {int(tip) + LATERAL_ROW: int(tip) + LATERAL_RATE for tip in tips}
        smooth = np.setdiff1d(np.arange(len(at)), np.concatenate([rough, list(rates.values())]).astype(int))
        left, right, sign, n_loss, power = self._powers()
        tables, n_x = self.tables, self.motion.shape[1]
        k, n_seen = tables.is_filled.size, (s - 1) * (smooth.size + rough.size + len(power)) + smooth.size
        gained, drift = np.zeros((2, 2, n_x, n_x))
        if len(power):
            gained, drift = energy_forms(self.exponent, self.n_complex, power, left, right, sign, n_loss)
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
        """Powers as products of rows over the coordinates: losses by damping, then works of turning forces.

        Returns the places of both factors of each product, its sign, the number of losses, and the rows.
        """
        reduced, n = self.setup.reduced, self.local.shape[1]
        if not self.setup.has_energies:
            none = np.zeros(0, dtype=np.int64)
            return none, none, np.zeros(0), 0, np.zeros((0, self.motion.shape[1]))
        displaced, going = self.shape[:n], self.shape[n:]
        size, shape = np.linalg.eigh(0.5 * (reduced.damping + reduced.damping.T))
        keep = np.abs(size) > UNSEEN * max(np.abs(size).max(), UNSEEN)
        dampers = (np.sqrt(np.abs(size)) * shape).T[keep]
        skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
        u, circulation, v = np.linalg.svd(skew)
        round_ = circulation > UNSEEN * np.abs(reduced.stiffness).max()
        d, c = len(dampers), int(round_.sum())
        rows = [dampers @ going, u.T[round_] @ going, (circulation[:, None] * v)[round_] @ displaced]
        basis = reduced.basis[: self.setup.model.rotor.n_dof]
        forces = [
            *reduced.force,
            *(part @ basis for _, f in self.setup.model.harmonics for part in (f.real, -f.imag)),
        ]
        turned = np.zeros((len(forces), self.exponent.size), dtype=complex)
        at = self.n_complex - self.orders.size + np.arange(self.orders.size)
        turned[::2][np.arange(at.size), at], turned[1::2][np.arange(at.size), at] = 1.0, -1j
        rows += [np.array(forces) @ going, turned]
        first, n_force = d + 2 * c, len(forces)
        works = first + np.arange(n_force)
        left = np.concatenate([np.arange(d + c), works])
        right = np.concatenate([np.arange(d), d + c + np.arange(c), works + n_force])
        sign = np.concatenate([np.sign(size[keep]), np.ones(c + n_force)])
        return left, right, sign, d + c, self.rows(np.concatenate(rows))


def energy_forms(
    exponent: Complexes,
    n_complex: int,
    power: Floats,
    left: NDArray[np.int64],
    right: NDArray[np.int64],
    sign: Floats,
    n_loss: int,
) -> tuple[Floats, Floats]:
    """Quadratic forms of the coordinates whose growth in flight is a work, and those that grow in time.

    A power `x' P x` of modes with the exponents a and b has the primitive `P_ab / (a + b)`; where the sum is
    zero it is constant.
    """
    n_x = n_complex + exponent.size
    values = np.concatenate([exponent[:n_complex], exponent[:n_complex].conj(), exponent[n_complex:]])
    total = values[:, None] + values
    is_resting = np.abs(total) <= RESTING * np.abs(exponent).max() * 1e-3
    gained, drift = np.zeros((2, 2, n_x, n_x))
    for kind, these in enumerate([slice(0, n_loss), slice(n_loss, None)]):
        works = power[left[these]].T @ (sign[these, None] * power[right[these]])
        form = _in_modes(_in_modes(0.5 * (works + works.T), n_complex).T, n_complex)
        grown = np.where(is_resting, 0.0, form / np.where(is_resting, 1.0, total))
        gained[kind] = _in_parts(_in_parts(grown, n_complex).T, n_complex).real
        drift[kind] = _in_parts(_in_parts(np.where(is_resting, form, 0.0), n_complex).T, n_complex).real
    return gained, drift


def _in_modes(form: Floats | Complexes, n_complex: int) -> Complexes:
    """Rows of a form of real and imaginary parts of `n_complex` modes as those of modes and conjugates."""
    real, imaginary = form[:n_complex], form[n_complex : 2 * n_complex]
    halves = 0.5 * (real - 1j * imaginary), 0.5 * (real + 1j * imaginary)
    return np.concatenate([*halves, form[2 * n_complex :]])


def _in_parts(form: Complexes, n_complex: int) -> Complexes:
    """Inverse of `_in_modes`."""
    direct, conjugate = form[:n_complex], form[n_complex : 2 * n_complex]
    return np.concatenate([direct + conjugate, 1j * (direct - conjugate), form[2 * n_complex :]])


def motion_rows(reduced: ReducedModel, model: Model, accuracy: float) -> Floats:
    """Local motions of each pair with the reduced coordinates, (q, 3 + b, n).

    Of the tip against the disc along the stator's axis and across it, of the rim by the torsion, and the
    bending displacements of the stator.
    """
    angle = np.array([stator.angle for stator in model.stators])[:, None]
    ey, ez = np.cos(angle), np.sin(angle)
    v, w, torsion, axial, lateral = (reduced.degree[:, a] for a in (V, W, TORSION, AXIAL, LATERAL))
    across = lateral + ez * v - ey * w
    bending = foreshortening_rows(
        [bending_rows(stator, reduced, model, i) for i, stator in enumerate(model.stators)],
        across,
        reduced.stiffness,
        accuracy,
    )
    rows = np.zeros((len(bending), BENDING + max(map(len, bending)), v.shape[1]))
    rows[:, ALONG], rows[:, ACROSS] = axial - ey * v - ez * w, across
    rows[:, TWIST] = np.array([stator.radius for stator in model.stators])[:, None] * torsion
    for pair, those in zip(rows, bending, strict=True):
        pair[BENDING : BENDING + len(those)] = those
    return rows


def bending_rows(stator: StatorModel, reduced: ReducedModel, model: Model, i: int) -> Floats:
    """Displacements (b, n) whose squares add up to twice the foreshortening of a stator."""
    if stator.squared_slope is None:
        return np.zeros((0, reduced.stiffness.shape[0]))
    first = model.stator_start[i]
    basis = reduced.basis[first : first + stator.body.n_dof]
    square, shape = np.linalg.eigh(stator.squared_slope)
    _, size, turn = np.linalg.svd((np.sqrt(np.maximum(square, 0.0)) * shape).T @ basis, full_matrices=False)
    keep = size > UNBENT * size.max()
    rows: Floats = size[keep, None] * turn[keep]
    return rows


def output_rows(reduced: ReducedModel) -> Floats:
    """Rows of outputs, as `kernels.contact_modes` numbers them, of displacements and their derivatives."""
    still = np.zeros_like(reduced.output[:1])
    rows = [[one, 0 * one, 0 * one] for one in reduced.output]
    rows += [[0 * one, one, 0 * one] for one in reduced.output]
    rows.append([still[0], still[0], reduced.output[2]])
    places = [degree[[AXIAL, LATERAL]] for degree in reduced.degree] + list(reduced.carrier)
    for axial, lateral in places:
        rows += [[axial, 0 * axial, 0 * axial], [lateral, 0 * lateral, 0 * lateral]]
        rows.append([0 * lateral, lateral, 0 * lateral])
    rows += [list(one) for one in np.swapaxes(reduced.probe, 0, 1)]
    return np.ascontiguousarray(np.swapaxes(np.array(rows), 0, 1))


def foreshortening_rows(
    rows: list[Floats], across: Floats, stiffness: Floats, accuracy: float
) -> list[Floats]:
    """Rows (b, n) whose squares add up to twice the foreshortening of each stator, as accuracy requires.

    They are those of the pencil of foreshortening and stiffness, the first ones in the order of what they
    add where a static force across the axis, (q, n), bends the stator. `rows` are those of `bending_rows`.
    """
    if not any(map(len, rows)):
        return rows
    ends = np.cumsum([1 + len(of_pair) for of_pair in rows])
    forces = np.vstack([row for pair in zip(rows, across, strict=True) for row in pair])
    compliant = np.linalg.lstsq(stiffness, forces.T, rcond=None)[0]
    kept = []
    for of_pair, moved in zip(rows, np.split(compliant, ends[:-1], axis=1), strict=True):
        turn = np.linalg.eigh(of_pair @ moved[:, :-1])[1].T[::-1]
        share = np.square(turn @ of_pair @ moved[:, -1])
        missed = share.sum() - np.cumsum(share)
        n_kept = 1 + int(np.count_nonzero(missed > ENOUGH * accuracy * share.sum()))
        kept.append((turn @ of_pair)[:n_kept])
    return kept
