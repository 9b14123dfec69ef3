"""Errors of signals where contact modes follow the speed, compared with the matrices.

They are the errors of the response of every signal to unbalance and to forces at the contacts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rubhpc.integrate.changing_speed.mode_courses import EQUAL, EXACT, JUDGED, between

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]
    Matrices = Callable[[float], tuple[Floats, Floats]]  # stiffness and damping at a speed, rad/s

PASSING = 0.01  # growth over the speed, 1/rad, at which a passage meets a resonance
STRUCK = 0.1  # the same for motions that contacts excite repeatedly
ORDERS, HIGHEST = 0.5, 16.0  # of the speed: step and end of the frequencies at which these are tested
PLACES = 1.0, -1.0, -0.4, 0.4, -0.8, 0.8  # where a range is tested: its ends, where errors are large, first


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
