"""Campbell diagram: modes tracked over the speed, and the speeds at which an order meets them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.optimize import linear_sum_assignment

from rubhpc.fem.modes import modes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Body
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
    return xr.Dataset(
        {
            "frequency": (
                ("mode", "speed"),
                [[mode.frequency for mode in track] for track in tracks],
                {"units": "Hz", "long_name": "Natural frequency"},
            ),
            "damping_ratio": (
                ("mode", "speed"),
                [[mode.damping_ratio for mode in track] for track in tracks],
                {"units": "1", "long_name": "Damping ratio"},
            ),
            "whirl": (("mode", "speed"), [[mode.whirl for mode in track] for track in tracks]),
        },
        coords={
            "kind": ("mode", [track[0].kind for track in tracks]),
            "speed": (
                "speed",
                np.asarray(speeds, dtype=float),
                {"units": "rad s-1", "long_name": "Spin speed"},
            ),
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


def critical_speeds(curves: xr.Dataset, order: float = 1.0) -> list[tuple[int, float]]:
    """Return the spins at which a multiple of the spin frequency equals the frequency of a lateral mode.

    Parameters
    ----------
    curves : xarray.Dataset
        From `campbell`.
    order : float
        Multiple of the spin frequency; 1 for unbalance.

    Returns
    -------
    list of (mode, speed)
        Number of the mode and spin (rad/s), interpolated linearly; by rising speed.
    """
    speeds = curves["speed"].values
    excess = order * speeds / (2 * math.pi) - curves["frequency"].values
    excess[curves["kind"].values != "lateral"] = np.nan
    crossings = []
    for i_mode, i_speed in zip(*np.nonzero((excess[:, :-1] < 0.0) & (excess[:, 1:] >= 0.0)), strict=True):
        before, after = excess[i_mode, i_speed : i_speed + 2]
        step = speeds[i_speed + 1] - speeds[i_speed]
        crossings.append((int(i_mode), float(speeds[i_speed] - before / (after - before) * step)))
    return sorted(crossings, key=lambda crossing: crossing[1])


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
