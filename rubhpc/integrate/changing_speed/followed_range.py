"""Ranges of speed over which contact modes may follow those of three speeds (`followed_modes`).

At both ends of a range, within it and where it meets a resonance the modes followed are held against the
matrices themselves: by what unbalance and forces on the rotor at its contacts make of every signal. Held
matrices err by the first order of a range, the modes followed by the third.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.changing_speed.followed_modes import EQUAL, EXACT, JUDGED, NODES, aligned, between
from rubhpc.integrate.changing_speed.held_matrices import NARROWEST
from rubhpc.integrate.reduced_model.coupling import coupled_rows
from rubhpc.integrate.reduced_model.standstill import cutoff_frequency
from rubhpc.kernels.contact_pairs import TORSION, V, W

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Complexes = NDArray[np.complex128]
    Matrices = Callable[[float], tuple[Floats, Floats]]  # stiffness and damping at a speed, rad/s

PASSING = 0.01  # growth over the speed, 1/rad, at which a passage meets a resonance
STRUCK = 0.1  # the same of motions that contacts excite, which they strike again and again
ORDERS, HIGHEST = 0.5, 16.0  # of the speed: between frequencies at which these are judged, and at most
AT_ENDS = 0.5  # error at the ends of a range over the accuracy, of which the third order leaves little inside
BY_ACCELERATION = 1.0  # the same by the acceleration, at the ends of its range
PLACES = -1.0, -0.8, -0.4, 0.4, 0.8, 1.0  # between those of the modes, where a range is judged
LEAK = 1.0  # of it by which an event may change a motion, over the accuracy
SAFE = 0.9  # share of the range that would just do
LEAST, MOST = 0.5, 0.85  # factors by which a range shrinks
STEEPEST = 5.0  # power of the range with which its error is taken to grow
CLOSE = 1.2  # ratio of a range that will not do and one that does, to be left at that


class Rotor(NamedTuple):
    """What moves with the speed's matrices, in reduced degrees, as signals and forces see it."""

    matrices: Matrices
    phasor: Complexes  # (n,), unbalance
    force: Floats  # (n_force, n), unit forces of contacts
    seen: Floats  # (3, n_signal, n), what signals see of displacements, velocities and accelerations
    top: float  # rad/s, frequency up to which signals are to be met


class Reach(NamedTuple):
    """A range of speeds and of accelerations."""

    half: float  # rad/s
    swing: float  # rad/s^2, by which the acceleration may change where nothing goes with it
    judge: Judge | None = None  # where modes go with the acceleration too


class AtPlace(NamedTuple):
    """What a range has at one of its speeds."""

    speed: float  # rad/s
    matrices: tuple[Floats, Floats]  # stiffness and damping
    modes: tuple[Complexes, Complexes]  # exponents and shapes that follow the speed
    inverse: Complexes  # of the shapes, as it follows


class Judge:
    """Says which accelerations, rad/s^2, modes may follow that go evenly from one acceleration to another.

    Parameters
    ----------
    nodes : list of (exponents, shapes)
        Modes at `NODES`, the middle first, and last those in the middle at the other acceleration.
    momentum : (n, n)
        Change of the stiffness with the acceleration, per rad/s^2.
    at : (float, float, float)
        Speed in the middle and half of the range, rad/s, and acceleration there, rad/s^2.
    rise : float, rad/s^2
        Other acceleration less that.
    accuracy : float
        Relative error of each signal.
    """

    def __init__(
        self,
        rotor: Rotor,
        nodes: list[tuple[Complexes, Complexes]],
        momentum: Floats,
        at: tuple[float, float, float],
        *,
        rise: float,
        accuracy: float,
    ) -> None:
        self.rise = rise
        self._rotor, self._nodes, self._momentum = rotor, nodes, momentum
        self._middle, self._half, self._acceleration = at
        self._accuracy = accuracy
        self._known: dict[float, bool] = {}

    def serves(self, acceleration: float) -> bool:
        """Whether modes hold their accuracy all over the range."""
        if acceleration not in self._known:
            self._known[acceleration] = self.error(acceleration) <= BY_ACCELERATION * self._accuracy
        return self._known[acceleration]

    def error(self, acceleration: float) -> float:
        """Relative error of the worst signal in the range."""
        change = acceleration - self._acceleration
        share = change / self.rise
        (exponent_by, shape_by), inverse_by = self._risen_by
        worst = 0.0
        for speed, (stiffness, damping), (exponent, shape), inverse in self._at_places:
            matrices = stiffness + change * self._momentum, damping
            modes = exponent + share * exponent_by, shape + share * shape_by
            worst = max(worst, _lost(modes[1], inverse + share * inverse_by, self._middle) / LEAK)
            growth = min(PASSING * speed, abs(acceleration) / self._half)
            worst = max(worst, _off(self._rotor, matrices, modes, speed, growth))
        return worst

    @cached_property
    def _risen_by(self) -> tuple[tuple[Complexes, Complexes], Complexes]:
        """Change of exponents, shapes and their inverse to the other acceleration."""
        (exponent, shape), risen = self._nodes[0], self._nodes[-1]
        return (risen[0] - exponent, risen[1] - shape), _inverse(risen[1]) - _inverse(shape)

    @cached_property
    def _at_places(self) -> list[AtPlace]:
        """What the range has where it is judged, at the acceleration in its middle."""
        nodes, middle, half = self._nodes[:-1], self._middle, self._half
        exponents, shapes = [node[0] for node in nodes], [node[1] for node in nodes]
        inverses, found = _inverses(shapes), []
        for place in (*PLACES, 0.0, *_resonances(nodes, middle, half)):
            speed = middle + place * half
            modes = between(exponents, place), between(shapes, place)
            found.append(AtPlace(speed, self._rotor.matrices(speed), modes, between(inverses, place)))
        return found


def rotor_of(setup: ModalSetup, matrices: Matrices, phasor: Complexes, seen: Floats) -> Rotor:
    """What moves with the speed's matrices, of a set-up; `seen` are its signals, to which contacts come."""
    touched = setup.reduced.degree[:, [V, W, TORSION]].reshape(-1, phasor.size)
    touched = np.unique(touched[np.any(touched != 0.0, axis=1)], axis=0)
    near = np.stack([touched, 0.0 * touched, 0.0 * touched])
    top = cutoff_frequency(setup.model, setup.spin, setup.accuracy)
    return Rotor(matrices, phasor, touched, np.concatenate([seen, near], axis=1), top)


def followed_reach(
    rotor: Rotor,
    speed: float,
    acceleration: float,
    momentum: Floats,
    widest: float,
    *,
    accuracy: float,
    others: tuple[float, float],
) -> Reach:
    """The widest range that begins at a speed (rad/s) and goes on as the acceleration does.

    Parameters
    ----------
    acceleration : float, rad/s^2
    momentum : (n, n)
        Change of the stiffness with the acceleration, per rad/s^2.
    widest : float, rad/s
        Half of the range, at most.
    accuracy : float
        Relative error of each signal at the ends of the range of accelerations; half of it by the speed.
    others : (float, float), rad/s^2
        Least and greatest acceleration that may occur.
    """
    sense = float(np.sign(acceleration))
    part = _part(rotor, speed, speed + (sense or 1.0) * widest)
    if not part.size:
        return Reach(widest, _swing(rotor, speed, momentum, accuracy))
    of_part = _of_part(rotor, part)
    half, nodes = _widest_within(of_part, speed, sense, widest, abs(acceleration), AT_ENDS * accuracy)
    middle = speed + sense * half
    turning = momentum[np.ix_(part, part)]
    swing = _swing(of_part, middle, turning, accuracy)
    rise = max((other - acceleration for other in others), key=abs)
    if nodes is None or abs(rise) <= swing:
        return Reach(half, swing)
    stiffness, damping = of_part.matrices(middle)
    risen = _in_order(nodes[0], _modes(stiffness + rise * turning, damping))
    if risen is None:
        return Reach(half, swing)
    at = middle, half, acceleration
    judge = Judge(of_part, [*nodes, risen], turning, at, rise=rise, accuracy=accuracy)
    return Reach(half, swing, judge)


def _widest_within(
    rotor: Rotor, speed: float, sense: float, widest: float, acceleration: float, allowed: float
) -> tuple[float, list[tuple[Complexes, Complexes]] | None]:
    """Half of the widest range whose error is allowed, at most `widest` (rad/s), and its modes.

    Narrower ranges are asked until one will do, and then those between it and the last that will not.
    """
    half, too_wide, least = widest, math.inf, NARROWEST * speed
    best: tuple[float, list[tuple[Complexes, Complexes]]] | None = None
    while True:
        middle = speed + sense * half
        nodes = _nodes(rotor, middle, half)
        error = _error(rotor, nodes, middle, half, acceleration) if nodes else np.inf
        if nodes and error <= allowed:
            best = half, nodes
        elif half <= least:
            return half, nodes
        else:
            too_wide = half
        if best is None:
            half *= float(np.clip(SAFE * (allowed / error) ** (1.0 / STEEPEST), LEAST, MOST))
        elif CLOSE * best[0] < too_wide < np.inf:
            half = math.sqrt(best[0] * too_wide)
        else:
            return best


def _part(rotor: Rotor, speed: float, other: float) -> Ints:
    """Degrees that matrices which go with the speed couple."""
    (stiffness, damping), (next_stiffness, next_damping) = rotor.matrices(speed), rotor.matrices(other)
    moved = (stiffness != next_stiffness) | (damping != next_damping)
    linked = (stiffness != 0.0) | (damping != 0.0) | moved
    parts = [rows for rows in coupled_rows(linked) if moved[np.ix_(rows, rows)].any()]
    return np.sort(np.concatenate(parts)) if parts else np.zeros(0, dtype=np.int64)


def _of_part(rotor: Rotor, part: Ints) -> Rotor:
    inside = np.ix_(part, part)

    def matrices(speed: float) -> tuple[Floats, Floats]:
        stiffness, damping = rotor.matrices(speed)
        return stiffness[inside], damping[inside]

    force = rotor.force[:, part]
    return rotor._replace(
        matrices=matrices,
        phasor=rotor.phasor[part],
        force=force[np.any(force != 0.0, axis=1)],
        seen=rotor.seen[..., part],
    )


def _nodes(rotor: Rotor, middle: float, half: float) -> list[tuple[Complexes, Complexes]] | None:
    """Modes at `NODES`, the middle first; None where they cannot be followed."""
    first, *others = (_modes(*rotor.matrices(middle + place * half)) for place in NODES)
    nodes = [first]
    for other in others:
        if (found := _in_order(first, other)) is None:
            return None
        nodes.append(found)
    return nodes


def _error(
    rotor: Rotor,
    nodes: list[tuple[Complexes, Complexes]],
    middle: float,
    half: float,
    acceleration: float,
) -> float:
    """Relative error of the worst signal in a range."""
    exponents, shapes = [node[0] for node in nodes], [node[1] for node in nodes]
    worst = _leak(shapes, middle) * AT_ENDS / LEAK
    for place in (*PLACES, *_resonances(nodes, middle, half)):
        speed = middle + place * half
        growth = min(PASSING * speed, acceleration / half)
        modes = between(exponents, place), between(shapes, place)
        worst = max(worst, _off(rotor, rotor.matrices(speed), modes, speed, growth))
    return worst


def _off(
    rotor: Rotor,
    matrices: tuple[Floats, Floats],
    modes: tuple[Complexes, Complexes],
    speed: float,
    growth: float,
) -> float:
    """Relative error of the worst signal by exponents (2 n,) and shapes (2 n, 2 n) in place of matrices."""
    exponent, shape = modes
    n = rotor.phasor.size
    at, load = _asked(rotor, speed, growth)
    true = _signals(rotor, at, _answers(*matrices, at, load))
    modal = np.linalg.solve(shape, np.vstack([np.zeros_like(load), load]))
    motion = shape @ (modal / (at[:, np.newaxis, np.newaxis] - exponent[:, np.newaxis]))
    own = _signals(rotor, at, motion[:, :n], motion[:, n:])
    return _relative(own - true, true)


def _leak(shapes: list[Complexes], speed: float) -> float:
    """What a motion gains or loses, over it, as it enters shapes by what stands for their inverse."""
    inverses = _inverses(shapes)
    return max(_lost(between(shapes, place), between(inverses, place), speed) for place in JUDGED)


def _inverses(shapes: list[Complexes]) -> list[Complexes]:
    """Inverses at `EXACT` of what goes through shapes."""
    return [_inverse(between(shapes, place)) for place in EXACT]


def _inverse(shape: Complexes) -> Complexes:
    return np.linalg.inv(shape).astype(np.complex128)


def _lost(shape: Complexes, entered: Complexes, speed: float) -> float:
    """The same of shapes (2 n, 2 n) and their inverse."""
    n = len(shape)
    scale = np.repeat([speed, 1.0], n // 2)
    off = (shape @ entered - np.eye(n)) * scale[:, np.newaxis] / scale
    return float(np.abs(off).max())


def _resonances(nodes: list[tuple[Complexes, Complexes]], middle: float, half: float) -> list[float]:
    """Places in the range at which the speed meets a frequency."""
    places = np.linspace(-1.0, 1.0, 21)
    exponents = [node[0] for node in nodes]
    met = [between(exponents, place).imag - middle - place * half for place in places.tolist()]
    apart = np.array(met)
    before, mode = np.nonzero((apart[:-1] < 0.0) != (apart[1:] < 0.0))
    low, high = apart[before, mode], apart[before + 1, mode]
    found: list[float] = (places[before] + 0.1 * low / (low - high)).tolist()
    return found


def _swing(rotor: Rotor, speed: float, momentum: Floats, accuracy: float) -> float:
    """By how much the acceleration may change, rad/s^2."""
    stiffness, damping = rotor.matrices(speed)
    if not momentum.any():
        return np.inf
    step = speed**2 * 1e-3
    at, load = _asked(rotor, speed, PASSING * speed)
    true = _signals(rotor, at, _answers(stiffness, damping, at, load))
    other = _signals(rotor, at, _answers(stiffness + step * momentum, damping, at, load))
    error = _relative(other - true, true)
    return BY_ACCELERATION * accuracy * step / error if error > 0.0 else np.inf


def _asked(rotor: Rotor, speed: float, growth: float) -> tuple[Complexes, Complexes]:
    """Exponents (f,), that of the unbalance first, and loads (n, 1 + n_force), unbalance first."""
    orders = np.arange(0.0, min(rotor.top, HIGHEST * speed), ORDERS * speed)
    at: Complexes = np.concatenate([[complex(growth, speed)], 1j * orders + STRUCK * speed])
    return at, np.column_stack([rotor.phasor, rotor.force.T.astype(np.complex128)])


def _answers(stiffness: Floats, damping: Floats, at: Complexes, load: Complexes) -> Complexes:
    """Displacements (f, n, loads) under loads times exp(at t)."""
    s = at[:, np.newaxis, np.newaxis]
    matrices = stiffness + s * damping + s**2 * np.eye(len(stiffness))
    loads = np.broadcast_to(load, (at.size, *load.shape))
    return np.asarray(np.linalg.solve(matrices, loads), dtype=np.complex128)


def _signals(
    rotor: Rotor, at: Complexes, displacement: Complexes, velocity: Complexes | None = None
) -> Complexes:
    """Signals (f, n_signal, loads)."""
    s = at[:, np.newaxis, np.newaxis]
    rate = s * displacement if velocity is None else velocity
    positions, rates, accelerations = rotor.seen
    found: Complexes = positions @ displacement + rates @ rate + s * (accelerations @ rate)
    return found


def _relative(error: Complexes, true: Complexes) -> float:
    """Worst relative error: under unbalance at its speed, under forces over all frequencies."""
    off, own = np.abs(error), np.abs(true)
    pairs = (
        (off[0, :, 0], own[0, :, 0]),
        (np.linalg.norm(off[1:, :, 1:], axis=(0, 2)), np.linalg.norm(own[1:, :, 1:], axis=(0, 2))),
    )
    worst = 0.0
    for lost, heard in pairs:
        is_heard = heard > EQUAL * heard.max(initial=0.0)
        worst = max(worst, float((lost[is_heard] / heard[is_heard]).max(initial=0.0)))
    return worst


def _modes(stiffness: Floats, damping: Floats) -> tuple[Complexes, Complexes]:
    """Exponents and shapes of the first-order system."""
    n = len(stiffness)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    exponent, shape = np.linalg.eig(system)
    return exponent.astype(np.complex128), shape.astype(np.complex128)


def _in_order(
    middle: tuple[Complexes, Complexes], other: tuple[Complexes, Complexes]
) -> tuple[Complexes, Complexes] | None:
    """Another speed's modes in order, length and phase of those in the middle; None where they are others."""
    seen: Complexes = np.linalg.solve(middle[1], other[1]).astype(np.complex128)
    found = aligned(seen, middle[0])
    if found is None:
        return None
    place, turn = found
    return other[0][place], other[1][:, place] @ np.linalg.inv(turn)
