"""Critical speeds: where the spin equals a lateral natural frequency, and what the unbalance excites."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.optimize import brentq, linear_sum_assignment

from rubhpc.fem.modes import KINDS, modes
from rubhpc.schema import columns, described

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Body, Model
    from rubhpc.fem.modes import Mode


def campbell(
    body: Body,
    speeds: Sequence[float] | NDArray[np.float64],
    tracks: Sequence[tuple[Mode, ...]] | None = None,
) -> xr.Dataset:
    """Return frequency, damping ratio and whirl of every mode of a body over the speed.

    Modes at successive speeds are matched so that the sum of the changes of shape and eigenvalue is least:
    where two curves cross, each keeps its shape.

    Parameters
    ----------
    body : Body
    speeds : (n_speed,)
        Spin, rad/s, in order.
    tracks : sequence of tuple of Mode, optional
        Result of `follow_modes` for these speeds, if available.

    Returns
    -------
    xarray.Dataset
        `frequency` (Hz), `damping_ratio` and `whirl` (mode, speed), with the coordinates `kind` (mode) and
        `speed` (rad/s). Modes are numbered by their natural frequency at the first speed.
    """
    tracks = follow_modes(body, speeds) if tracks is None else tracks
    frequency, ratio, whirl = (
        [[getattr(mode, name) for mode in track] for track in tracks]
        for name in ("frequency", "damping_ratio", "whirl")
    )
    of_modes = {
        "frequency": (frequency, "Hz", "Natural frequency"),
        "damping_ratio": (ratio, "1", "Damping ratio"),
    }
    over = ("mode", "speed")
    return xr.Dataset(
        columns(over, of_modes) | {"whirl": (over, whirl)},
        coords={
            "kind": ("mode", [track[0].kind for track in tracks]),
            "speed": ("speed", np.asarray(speeds, dtype=float), described("rad s-1", "Spin speed")),
        },
    )


def follow_modes(body: Body, speeds: Sequence[float] | NDArray[np.float64]) -> list[tuple[Mode, ...]]:
    """Return every mode of a body as a tuple over the speeds (rad/s, in order)."""
    followed = [modes(body, float(speeds[0]))]
    known = followed[0]  # of each track, the last state that is its own
    for speed in speeds[1:]:
        found = modes(body, float(speed))
        followed.append([found[i] for i in matches(body, known, found)])
        is_shared = np.any(_twins(followed[-1]), axis=1)
        known = [
            old if shared else new for old, new, shared in zip(known, followed[-1], is_shared, strict=True)
        ]
    return list(zip(*followed, strict=True))


def matches(body: Body, before: Sequence[Mode], after: Sequence[Mode]) -> NDArray[np.intp]:
    """Return the number in `after` of the match of each mode in `before`, (n_mode,), at a nearby speed.

    The shapes of modes of one eigenvalue are arbitrary; their matches are in the order of their frequencies.
    """
    likeness = np.abs(
        np.stack([mode.shape.conj() for mode in before])
        @ body.mass
        @ np.stack([mode.shape for mode in after], axis=1)
    )
    here = np.array([mode.eigenvalue for mode in before])[:, np.newaxis]
    there = np.array([mode.eigenvalue for mode in after])
    change = np.abs(here - there) / np.maximum(np.abs(here) + np.abs(there), 1e-300)
    order: NDArray[np.intp] = linear_sum_assignment(change - likeness**2)[1]
    for one, other in np.argwhere(np.triu(_twins(before))):
        order[[one, other]] = np.sort(order[[one, other]])
    return order


def _twins(found: Sequence[Mode]) -> NDArray[np.bool_]:
    """Which modes have one eigenvalue and thus arbitrary shapes, (n_mode, n_mode)."""
    values = np.array([mode.eigenvalue for mode in found])
    planar = np.array([mode.whirl == "planar" for mode in found])
    near = np.abs(values[:, np.newaxis] - values) <= 1e-9 * np.abs(values)
    twins: NDArray[np.bool_] = near & planar & planar[:, np.newaxis] & ~np.eye(len(found), dtype=bool)
    return twins


EXCITED = 1e-3  # share of the unbalance's work on a mode, below which it is taken for none
_TOLERANCE = 1e-10  # of a speed
_BARELY = 1e-5  # share of an eigenvalue that oscillates, at both ends of an interval: overdamped modes alike
_PER_INTERVAL = 8  # of a bearing's table, in which crossings are sought


@dataclass(frozen=True, kw_only=True, eq=False)
class CriticalSpeed:
    """A spin that equals the natural frequency of a lateral mode.

    Attributes
    ----------
    speed : float
        rad/s.
    number : int
        Of the mode, from 1, by rising natural frequency at the first speed of the range.
    mode : Mode
        At that speed.
    excitation : float
        Share of the greatest work that unbalances of these sizes could do on the mode, 0 to 1: 0 for the
        backward whirl of an isotropic rotor, at nodes of the mode, or where the unbalances cancel. NaN
        without an unbalance.
    """

    speed: float
    number: int
    mode: Mode
    excitation: float

    @property
    def is_excited(self) -> bool:
        """Whether the unbalance excites the mode; without an unbalance: whether it is not a backward one."""
        if math.isnan(self.excitation):
            return self.mode.whirl != "backward"
        return self.excitation > EXCITED


def find_critical_speeds(
    model: Model,
    speeds: Sequence[float] | NDArray[np.float64],
    tracks: Sequence[tuple[Mode, ...]] | None = None,
) -> list[CriticalSpeed]:
    """Return all critical speeds within a range, rising.

    Parameters
    ----------
    model : Model
    speeds : (n_speed,)
        Spin, rad/s, rising or falling: the grid on which modes are followed, to number them. Crossings are
        solved for and depend on its ends alone.
    tracks : sequence of tuple of Mode, optional
        What `follow_modes` returned for these speeds, if it is known.

    Returns
    -------
    list of CriticalSpeed
        Forward, backward and planar ones; of lateral modes that oscillate there, and at a speed of the grid
        beside it.
    """
    body = model.rotor
    speeds = np.asarray(speeds, dtype=np.float64)
    tracks = follow_modes(body, speeds) if tracks is None else tracks
    lateral = body.rows(KINDS["lateral"])  # torsion and axial motion may cross the line the other way
    numbered = [(n, track) for n, track in enumerate(tracks, start=1) if track[0].shape[lateral].any()]
    known = {
        speed: list(found) for speed, *found in zip(speeds.tolist(), *(t for _, t in numbered), strict=True)
    }

    def modes_at(spin: float) -> list[Mode]:
        if spin not in known:
            known[spin] = [mode for mode in modes(body, spin) if mode.shape[lateral].any()]
        return known[spin]

    found = []
    for speed, places in _crossings(_search_grid(body, speeds), modes_at):
        listed = modes_at(speed)
        # of the states on the grid, the nearest but for standstill, where modes may be degenerate
        near = int(np.argmin(np.where(speeds == 0.0, np.inf, np.abs(speeds - speed))))
        order = matches(body, [track[near] for _, track in numbered], listed)
        number = {int(i): n for i, (n, _) in zip(order, numbered, strict=True)}
        for i in np.unique(_sizes(listed)[1][places]).tolist():
            if _may_be_critical(listed[i]):
                excitation = _excitation(model, listed[i], speed)
                found.append(
                    CriticalSpeed(speed=speed, number=number[i], mode=listed[i], excitation=excitation)
                )
    return sorted(found, key=lambda critical: abs(critical.speed))


def _search_grid(body: Body, speeds: NDArray[np.float64]) -> list[float]:
    """The speeds given, and some in each interval of the bearings' tables, where a curve may turn back."""
    low, high = float(speeds.min()), float(speeds.max())
    inner = {
        a + (b - a) * i / _PER_INTERVAL
        for a, b in pairwise(body.tabulated_speeds)
        for i in range(_PER_INTERVAL)
    }
    return sorted({*speeds.tolist(), *(speed for speed in inner if low < speed < high)})


def _crossings(
    grid: Sequence[float], modes_at: Callable[[float], list[Mode]]
) -> Iterator[tuple[float, list[int]]]:
    """Yield the spins that equal the size of an eigenvalue, and its places among all sizes, which rise.

    The sizes in their order are continuous functions of the spin, whichever modes cross or are degenerate, so
    that no mode has to be followed.
    """

    def excess(spin: float, place: int) -> float:
        return abs(spin) - float(_sizes(modes_at(spin))[0][place])

    roots = []
    for one, other in pairwise(grid):
        (before, owner), (after, later) = _sizes(modes_at(one)), _sizes(modes_at(other))
        for place in np.flatnonzero((before > abs(one)) != (after > abs(other))).tolist():
            ends = modes_at(one)[owner[place]], modes_at(other)[later[place]]
            if any(_may_be_critical(mode, _BARELY) for mode in ends):
                roots.append((float(brentq(excess, one, other, args=(place,), rtol=_TOLERANCE)), place))
    roots.sort()
    while roots:
        speed = roots[0][0]
        equal = [place for root, place in roots if root - speed <= 4 * _TOLERANCE * abs(speed)]
        yield speed, equal
        roots = roots[len(equal) :]


def _sizes(found: Sequence[Mode]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Sizes of all eigenvalues, rising, rad/s, and the mode that each belongs to, (2 n_mode,) both."""
    slow = np.array([abs(mode.eigenvalue) for mode in found])
    product = np.array([(2 * math.pi * mode.frequency) ** 2 for mode in found])
    oscillates = np.array([mode.eigenvalue.imag > 0.0 for mode in found])
    fast = np.where(oscillates, slow, product / np.where(slow > 0.0, slow, np.inf))
    sizes = np.concatenate([slow, fast])
    order = np.argsort(sizes, kind="stable")
    return sizes[order], order % len(found)


def _may_be_critical(mode: Mode, least: float = 0.0) -> bool:
    """Whether a mode is lateral and oscillates, by more than a share of its eigenvalue."""
    return mode.kind == "lateral" and mode.eigenvalue.imag > least * abs(mode.eigenvalue)


def _excitation(model: Model, mode: Mode, spin: float) -> float:
    """Work of the unbalance on a mode, over the most that unbalances of these sizes could do anywhere.

    Of the forces on (v, w) of a node and its part x of the shape, no phase does more work than |f| |x|.
    """
    body = model.rotor
    force = model.unbalance_cosine - 1j * model.unbalance_sine
    shape = mode.shape if spin >= 0.0 else mode.shape.conj()
    size: dict[int, float] = {}
    reach: dict[int, float] = {}
    for row, (node, name) in enumerate(body.degrees):
        if name in ("v", "w"):
            size[node] = math.hypot(size.get(node, 0.0), abs(force[row]))
            reach[node] = math.hypot(reach.get(node, 0.0), abs(shape[row]))
    most = sum(size.values()) * max(reach.values(), default=0.0)
    return float(abs(shape.conj() @ force)) / most if most > 0.0 else math.nan
