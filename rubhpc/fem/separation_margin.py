"""Peaks of the unbalance response, their amplification factor and separation margin as API 617 defines them.

API Standard 617, 8th ed. (2014), Part 1, 4.8.2, and API Recommended Practice 684, 2nd ed. (2005), 2.6.2 and
SP6.8.2: a critical speed is a peak at N_c of the amplitude, N_1 < N_c < N_2 are where the amplitude is 0.707
of it, and `AF = N_c / (N_2 - N_1)`. Below AF = 2.5 the rotor is critically damped and needs no margin.
Otherwise the speed is to stay away from the operating range, below it by `17 (1 - 1 / (AF - 1.5))` percent of
the least operating speed, at most 16 percent, and above it by `10 + 17 (1 - 1 / (AF - 1.5))` percent of the
greatest one, at most 26 percent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.optimize import brentq, minimize_scalar

from rubhpc.fem.response import contact_free_amplitude, lateral_at_nodes, response_nodes, steady_response
from rubhpc.schema import described

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.critical_speeds import CriticalSpeed
    from rubhpc.fem.model import Model


def unbalance_response(
    model: Model,
    speeds: Sequence[float] | NDArray[np.float64],
    probes: Sequence[float] = (0.0, math.pi / 2),
) -> xr.Dataset:
    """Return the steady response to the rotor's unbalance over a range of speeds, at all nodes it moves.

    Parameters
    ----------
    model : Model
    speeds : (n_speed,)
        Spin, rad/s.
    probes : sequence of float
        Angles of displacement probes, rad, from straight up with the spin: 0 sees v, pi / 2 sees w.

    Returns
    -------
    xarray.Dataset
        Over (speed, node): `major_axis` and `minor_axis`, the semi-axes of the orbit, m; the minor one is
        negative where the orbit turns against the spin. Over (speed, node, probe): `amplitude`, m, zero to
        peak, and `phase`, rad, by which the displacement at the probe leads the shaft's angle, unwrapped
        along the speed, NaN at standstill. The displacement is `amplitude cos(spin t + phase)`; a lag is
        negative.

    Raises
    ------
    InputError
        When a bearing has no coefficients at a speed, or the rotor resonates without damping.

    Notes
    -----
    `v + i w = F exp(i spin t) + conj(B) exp(-i spin t)`, a forward and a backward circle; the semi-axes are
    |F| + |B| and |F| - |B|.
    """
    response = np.stack([steady_response(model, float(speed)) for speed in speeds])
    v, w = np.moveaxis(lateral_at_nodes(model, response), -2, 0)
    forward, backward = np.abs(v + 1j * w) / 2, np.abs(v - 1j * w) / 2
    seen = np.stack([v * math.cos(angle) + w * math.sin(angle) for angle in probes], axis=-1)
    phase = np.full(seen.shape, np.nan)  # where nothing moves there is none
    moves = np.asarray(speeds) != 0.0
    phase[moves] = np.unwrap(np.angle(seen[moves]), axis=0)
    over = ("speed", "node")
    return xr.Dataset(
        {
            "major_axis": (over, forward + backward, described("m", "Major semi-axis of the orbit")),
            "minor_axis": (over, forward - backward, described("m", "Minor semi-axis of the orbit")),
            "amplitude": ((*over, "probe"), np.abs(seen), described("m", "Amplitude at the probe")),
            "phase": ((*over, "probe"), phase, described("rad", "Phase lead at the probe")),
        },
        coords={
            "speed": ("speed", np.asarray(speeds, dtype=np.float64), described("rad s-1", "Spin speed")),
            "node": ("node", response_nodes(model), {"long_name": "Node of the rotor"}),
            "probe": ("probe", np.asarray(probes, dtype=np.float64), described("rad", "Angle of the probe")),
        },
    )


HALF_POWER = math.sqrt(0.5)
CRITICALLY_DAMPED = 2.5  # amplification factor below which no margin is asked for
_ACROSS = np.array([-8.0, -4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 8.0])  # half widths of a resonance
_N_SPEED = 301  # evenly spaced ones
_NARROWEST = 1e-8  # half width of a resonance without damping, whose response is unbounded, over its speed


@dataclass(frozen=True, kw_only=True)
class ResponsePeak:
    """A peak of the amplitude over the speed.

    Attributes
    ----------
    speed : float
        N_c, rad/s.
    amplitude : float
        m.
    half_power_speeds : tuple of float
        N_1 and N_2, rad/s; NaN where the amplitude does not fall to 0.707 of the peak within the range, or
        rises above the peak before.
    """

    speed: float
    amplitude: float
    half_power_speeds: tuple[float, float]

    @property
    def amplification_factor(self) -> float:
        """AF = N_c / (N_2 - N_1); NaN where one of them is."""
        below, above = self.half_power_speeds
        return self.speed / (above - below) if above != below else math.inf

    def separation_margin(self, operating: tuple[float, float]) -> float:
        """Distance from the operating range as a share of its nearer end; 0 within it.

        Parameters
        ----------
        operating : tuple of (least, greatest)
            Speeds, rad/s.
        """
        low, high = operating
        if self.speed < low:
            return (low - self.speed) / low
        return max(self.speed - high, 0.0) / high

    def required_margin(self, operating: tuple[float, float]) -> float:
        """Separation margin that API 617 asks for, a share of the nearer end of the operating range.

        Of a peak whose amplification factor is not known, the most that it can ask for. Within the operating
        range the margin for a peak above it counts, which none meets.
        """
        is_below = self.speed < operating[0]
        base, most = (0.0, 0.16) if is_below else (0.10, 0.26)
        factor = self.amplification_factor
        if math.isnan(factor):
            return most
        if factor < CRITICALLY_DAMPED:
            return 0.0
        return min(most, base + 0.17 * (1.0 - 1.0 / (factor - 1.5)))

    def is_separated(self, operating: tuple[float, float]) -> bool:
        """Whether the margin is at least the required one."""
        return self.separation_margin(operating) >= self.required_margin(operating)


def amplitude_over_speed(model: Model, node: int) -> Callable[[float], float]:
    """Return the function that gives the major semi-axis of a node's orbit, m, for a spin (rad/s)."""
    unbalanced = replace(model, harmonics=())
    return lambda spin: contact_free_amplitude(unbalanced, spin, node)


def grid_through(low: float, high: float, critical: Sequence[CriticalSpeed] = ()) -> NDArray[np.float64]:
    """Return speeds from low to high, rad/s, some within the half width of each critical speed.

    None is at a critical speed without damping, where the response is unbounded, nor near one that the
    unbalance does not excite, where it is rounding.
    """
    grid = np.linspace(low, high, _N_SPEED)
    for c in critical:
        speed, width = abs(c.speed), abs(c.speed) * max(abs(c.mode.damping_ratio), _NARROWEST)
        is_damped = abs(c.mode.damping_ratio) >= _NARROWEST
        if is_damped or c.is_excited:
            grid = np.append(grid, speed + _ACROSS * width)
        if not is_damped:
            grid = grid[np.abs(grid - speed) > 0.25 * width]
    return np.unique(grid[(grid >= low) & (grid <= high)])


def response_peaks(
    amplitude: Callable[[float], float], speeds: Sequence[float] | NDArray[np.float64]
) -> list[ResponsePeak]:
    """Return the peaks of an amplitude within a range of speeds, rising in speed.

    Parameters
    ----------
    amplitude : function
        Of the spin, rad/s; m.
    speeds : (n_speed,)
        Rising, rad/s: no two peaks lie between neighbours. From `grid_through`, for instance.
    """
    grid = np.asarray(speeds, dtype=np.float64)
    values = np.array([amplitude(float(speed)) for speed in grid])
    inner = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:])) + 1
    return [_peak(amplitude, grid, values, i) for i in inner.tolist()]


def _peak(
    amplitude: Callable[[float], float], grid: NDArray[np.float64], values: NDArray[np.float64], i: int
) -> ResponsePeak:
    ends = float(grid[i - 1]), float(grid[i + 1])
    speed, height = float(grid[i]), float(values[i])
    if ends[1] - ends[0] > 4 * _NARROWEST * ends[1]:
        best = minimize_scalar(
            lambda spin: -amplitude(spin), bounds=ends, method="bounded", options={"xatol": 1e-9 * ends[1]}
        )
        if -best.fun >= height:
            speed, height = float(best.x), -float(best.fun)

    def crossing(step: int) -> float:
        inside = speed
        for at in range(i, len(grid) if step > 0 else -1, step):
            outside, value = float(grid[at]), values[at]
            if (outside - speed) * step <= 0.0:
                continue
            if value > height:
                return math.nan
            if value <= HALF_POWER * height:
                root = brentq(
                    lambda spin: amplitude(spin) - HALF_POWER * height,
                    *sorted((inside, outside)),
                    xtol=1e-12 * speed,
                )
                return float(root)
            inside = outside
        return math.nan

    return ResponsePeak(speed=speed, amplitude=height, half_power_speeds=(crossing(-1), crossing(1)))
