"""Ranges of speed over which contact modes are interpolated from three speeds (`mode_courses`).

At both ends of a range, within it and at resonances the interpolated modes are compared with the matrices
(`signal_error`). Their errors are of the third order in the range.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.changing_speed.mode_courses import EQUAL, EXACT, JUDGED, NODES, aligned, between
from rubhpc.integrate.reduced_model.coupling import coupled_rows
from rubhpc.integrate.reduced_model.truncation import cutoff_frequency
from rubhpc.kernels.contact_pairs import TORSION, V, W

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rubhpc.integrate.modal_setup import ModalSetup

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]
    Ints = NDArray[np.int64]
    Matrices = Callable[[float], tuple[Floats, Floats]]  # stiffness and damping at a speed, rad/s


PASSING = 0.01  # growth over the speed, 1/rad, at which a passage meets a resonance
STRUCK = 0.1  # the same for motions that contacts excite repeatedly
ORDERS, HIGHEST = 0.5, 16.0  # of the speed: step and end of the frequencies at which these are tested
PLACES = 1.0, -1.0, -0.4, 0.4, -0.8, 0.8  # where a range is tested: its ends, where errors are large, first

NARROWEST = 1e-4  # half of the range over the speed
AT_ENDS = 0.5  # error at the ends of a range over the accuracy; inside it is smaller
SAFE = 0.9  # share of the widest accurate range
LEAST, MOST = 0.5, 0.85  # factors by which a range shrinks
STEEPEST = 5.0  # assumed power of the error in the range
CLOSE = 1.2  # ratio of an inaccurate and an accurate range at which the search ends
NEARLY = 1.1  # factor by which an accurate range may be widened by its error, below which the search ends
GREATEST = 2.0  # factor by which it is widened


class Rotor(NamedTuple):
    """Degrees whose matrices depend on the speed, reduced, with signals and forces."""

    matrices: Matrices
    phasor: Complexes  # (n,), unbalance
    force: Floats  # (n_force, n), unit forces of contacts
    seen: Floats  # (3, n_signal, n), weights of displacements, velocities and accelerations
    top: float  # rad/s, frequency up to which signals must be accurate


def signal_error(
    rotor: Rotor,
    matrices: tuple[Floats, Floats],
    modes: tuple[Complexes, Complexes],
    speed: float,
    growth: float,
) -> float:
    """Relative error of the worst signal by exponents (2 n,) and shapes (2 n, 2 n) in place of matrices."""
    exponent, shape = modes
    n = rotor.phasor.size
    at, load = asked(rotor, speed, growth)
    true = signals_of(rotor, at, answers(*matrices, at, load))
    modal = np.linalg.solve(shape, np.vstack([np.zeros_like(load), load]))
    motion = shape @ (modal / (at[:, np.newaxis, np.newaxis] - exponent[:, np.newaxis]))
    own = signals_of(rotor, at, motion[:, :n], motion[:, n:])
    return relative(own - true, true)


def leak(shapes: list[Complexes], speed: float) -> float:
    """Relative change of a motion that enters shapes (2 n, 2 n) by the interpolated inverse."""
    inverses = [np.linalg.inv(between(shapes, place)).astype(np.complex128) for place in EXACT]
    n = len(shapes[0])
    scale = np.repeat([speed, 1.0], n // 2)
    lost = [between(shapes, place) @ between(inverses, place) - np.eye(n) for place in JUDGED]
    return max(float(np.abs(off * scale[:, np.newaxis] / scale).max()) for off in lost)


def resonances(nodes: list[tuple[Complexes, Complexes]], middle: float, half: float) -> list[float]:
    """Places in the range at which the speed meets a frequency."""
    places = np.linspace(-1.0, 1.0, 21)
    exponents = [node[0] for node in nodes]
    met = [between(exponents, place).imag - middle - place * half for place in places.tolist()]
    apart = np.array(met)
    before, mode = np.nonzero((apart[:-1] < 0.0) != (apart[1:] < 0.0))
    low, high = apart[before, mode], apart[before + 1, mode]
    found: list[float] = (places[before] + 0.1 * low / (low - high)).tolist()
    return found


def asked(rotor: Rotor, speed: float, growth: float) -> tuple[Complexes, Complexes]:
    """Exponents (f,), that of the unbalance first, and loads (n, 1 + n_force), unbalance first."""
    orders = np.arange(0.0, min(rotor.top, HIGHEST * speed), ORDERS * speed)
    at: Complexes = np.concatenate([[complex(growth, speed)], 1j * orders + STRUCK * speed])
    return at, np.column_stack([rotor.phasor, rotor.force.T.astype(np.complex128)])


def answers(stiffness: Floats, damping: Floats, at: Complexes, load: Complexes) -> Complexes:
    """Displacements (f, n, loads) under loads times exp(at t)."""
    s = at[:, np.newaxis, np.newaxis]
    matrices = stiffness + s * damping + s**2 * np.eye(len(stiffness))
    loads = np.broadcast_to(load, (at.size, *load.shape))
    return np.asarray(np.linalg.solve(matrices, loads), dtype=np.complex128)


def signals_of(
    rotor: Rotor, at: Complexes, displacement: Complexes, velocity: Complexes | None = None
) -> Complexes:
    """Signals (f, n_signal, loads)."""
    s = at[:, np.newaxis, np.newaxis]
    rate = s * displacement if velocity is None else velocity
    positions, rates, accelerations = rotor.seen
    found: Complexes = positions @ displacement + rates @ rate + s * (accelerations @ rate)
    return found


def relative(error: Complexes, true: Complexes) -> float:
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


def rotor_of(setup: ModalSetup, matrices: Matrices, phasor: Complexes, seen: Floats) -> Rotor:
    """Degrees of a set-up whose matrices depend on the speed; `seen` are its signals, besides contacts."""
    touched = setup.reduced.degree[:, [V, W, TORSION]].reshape(-1, phasor.size)
    touched = np.unique(touched[np.any(touched != 0.0, axis=1)], axis=0)
    near = np.stack([touched, 0.0 * touched, 0.0 * touched])
    top = cutoff_frequency(setup.model, setup.spin, setup.accuracy)
    return Rotor(matrices, phasor, touched, np.concatenate([seen, near], axis=1), top)


def interpolated_reach(
    rotor: Rotor,
    speed: float,
    acceleration: float,
    momentum: Floats,
    widest: float,
    *,
    sense: float,
    accuracy: float,
    guess: float | None = None,
) -> tuple[float, float]:
    """Half of the widest range that begins at a speed or is about it, rad/s, and of accelerations, rad/s^2.

    Parameters
    ----------
    speed, acceleration : float, rad/s, rad/s^2
    momentum : (n, n)
        Change of the stiffness with the acceleration, per rad/s^2.
    widest : float, rad/s
        Half of the range, at most.
    sense : float
        1 where the speed rises from there, -1 where it falls, 0 where it is in the middle.
    accuracy : float
        Relative error of each signal by the acceleration; half of it by the speed.
    guess : float, optional, rad/s
        Half of the range tried first; by default the widest.
    """
    part = _part(rotor, speed, speed + (sense or 1.0) * widest)
    if not part.size:
        return widest, _swing(rotor, speed, momentum, accuracy)
    of_part = _of_part(rotor, part)
    half = _widest_within(of_part, speed, sense, widest, abs(acceleration), AT_ENDS * accuracy, guess)
    return half, _swing(of_part, speed + sense * half, momentum[np.ix_(part, part)], accuracy)


def _widest_within(
    rotor: Rotor,
    speed: float,
    sense: float,
    widest: float,
    acceleration: float,
    allowed: float,
    guess: float | None,
) -> float:
    """Half of the widest accurate range, at most `widest` (rad/s).

    The first range tried (`guess`, or the widest) is narrowed or widened by its error, until one is nearly as
    wide as possible: by its error, or compared with one that was too wide.
    """
    half, too_wide, least = min(widest, guess or widest), math.inf, NARROWEST * speed
    best: float | None = None
    while True:
        middle = speed + sense * half
        nodes = _nodes(rotor, middle, half)
        enough = allowed if best else allowed * (SAFE / LEAST) ** STEEPEST  # more says nothing more
        error = _error(rotor, nodes, middle, half, acceleration, enough) if nodes else np.inf
        by_error = SAFE * (allowed / error) ** (1.0 / STEEPEST) if error > 0.0 else np.inf
        if nodes and error <= allowed:
            best = half
            if half >= widest or by_error <= NEARLY:
                return best
            half = min(widest, half * min(by_error, GREATEST))
        elif half <= least:
            return half
        else:
            too_wide = half
            half *= float(np.clip(by_error, LEAST, MOST))
        if best and too_wide < np.inf:
            if too_wide <= CLOSE * best:
                return best
            half = math.sqrt(best * too_wide)


def _part(rotor: Rotor, speed: float, other: float) -> Ints:
    """Degrees coupled by matrices that depend on the speed."""
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
    """Modes at `NODES`, the middle first; None where they cannot be interpolated."""
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
    enough: float,
) -> float:
    """Relative error of the worst signal in a range, or one above `enough`."""
    exponents, shapes = [node[0] for node in nodes], [node[1] for node in nodes]
    worst = 0.0
    for place in (*PLACES, *resonances(nodes, middle, half)):
        speed = middle + place * half
        growth = min(PASSING * speed, acceleration / half)
        modes = between(exponents, place), between(shapes, place)
        worst = max(worst, signal_error(rotor, rotor.matrices(speed), modes, speed, growth))
        if worst > enough:
            return worst
    return max(worst, leak(shapes, middle) * AT_ENDS)


def _swing(rotor: Rotor, speed: float, momentum: Floats, accuracy: float) -> float:
    """By how much the acceleration may change, rad/s^2."""
    stiffness, damping = rotor.matrices(speed)
    if not momentum.any():
        return np.inf
    step = speed**2 * 1e-3
    at, load = asked(rotor, speed, PASSING * speed)
    true = signals_of(rotor, at, answers(stiffness, damping, at, load))
    other = signals_of(rotor, at, answers(stiffness + step * momentum, damping, at, load))
    error = relative(other - true, true)
    return accuracy * step / error if error > 0.0 else np.inf


def _modes(stiffness: Floats, damping: Floats) -> tuple[Complexes, Complexes]:
    """Exponents and shapes of the first-order system."""
    n = len(stiffness)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    exponent, shape = np.linalg.eig(system)
    return exponent.astype(np.complex128), shape.astype(np.complex128)


def _in_order(
    middle: tuple[Complexes, Complexes], other: tuple[Complexes, Complexes]
) -> tuple[Complexes, Complexes] | None:
    """Modes of another speed in order, length and phase of those in the middle; None without a match."""
    seen: Complexes = np.linalg.solve(middle[1], other[1]).astype(np.complex128)
    found = aligned(seen, middle[0])
    if found is None:
        return None
    place, turn = found
    return other[0][place], other[1][:, place] @ np.linalg.inv(turn)
