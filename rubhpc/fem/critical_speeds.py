"""Critical speeds: where the spin equals a lateral natural frequency, and what the unbalance excites."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from rubhpc.fem.campbell import continued, follow_modes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.fem.modes import Mode

EXCITED = 1e-3  # share of the unbalance's work on a mode, below which it is taken for none
_TOLERANCE = 1e-10  # of a speed


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
        Spin, rad/s, rising or falling: the grid on which modes are followed. A crossing is then solved for.
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
    found = []
    for i_mode, track in enumerate(tracks):
        if track[0].kind != "lateral":
            continue
        excess = np.abs(speeds) - np.array([abs(mode.eigenvalue) for mode in track])
        oscillates = np.array([mode.eigenvalue.imag > 0.0 for mode in track])
        crosses = (excess[:-1] < 0.0) != (excess[1:] < 0.0)
        for i in np.flatnonzero(crosses & (oscillates[:-1] | oscillates[1:])):
            before = [other[i] for other in tracks]

            def beyond(spin: float, before: list[Mode] = before, i_mode: int = i_mode) -> float:
                return abs(spin) - abs(continued(body, before, spin)[i_mode].eigenvalue)

            ends = float(speeds[i]), float(speeds[i + 1])
            speed = (
                float(brentq(beyond, *ends, rtol=_TOLERANCE))
                if beyond(ends[0]) * beyond(ends[1]) <= 0
                else ends[1]
            )
            mode = continued(body, before, speed)[i_mode]
            if mode.eigenvalue.imag > 0.0:
                found.append(
                    CriticalSpeed(
                        speed=speed, number=i_mode + 1, mode=mode, excitation=_excitation(model, mode, speed)
                    )
                )
    return sorted(found, key=lambda critical: abs(critical.speed))


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
