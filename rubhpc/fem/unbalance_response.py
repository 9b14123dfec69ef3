"""Steady unbalance response over the speed: amplitude and phase at every node, no stator touching."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from rubhpc.fem.response import check_response_node, response_nodes, steady_response

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model


def unbalance_response(
    model: Model,
    speeds: Sequence[float] | NDArray[np.float64],
    nodes: Sequence[int] | None = None,
    probes: Sequence[float] = (0.0, math.pi / 2),
) -> xr.Dataset:
    """Return the steady response to the rotor's unbalance over a range of speeds.

    Parameters
    ----------
    model : Model
    speeds : (n_speed,)
        Spin, rad/s.
    nodes : sequence of int, optional
        By default all that move sideways.
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
        When a node does not move sideways, a bearing has no coefficients at a speed, or the rotor resonates
        without damping.

    Notes
    -----
    `v + i w = F exp(i spin t) + conj(B) exp(-i spin t)`, a forward and a backward circle; the semi-axes are
    |F| + |B| and |F| - |B|.
    """
    nodes = response_nodes(model) if nodes is None else list(nodes)
    for node in nodes:
        check_response_node(model, node)
    rows = np.array([[model.rotor.index(node, name) for name in ("v", "w")] for node in nodes])
    response = np.stack([steady_response(model, float(speed)) for speed in speeds])
    v, w = np.moveaxis(np.where(rows >= 0, response[:, rows], 0.0), -1, 0)
    forward, backward = np.abs(v + 1j * w) / 2, np.abs(v - 1j * w) / 2
    seen = np.stack([v * math.cos(angle) + w * math.sin(angle) for angle in probes], axis=-1)
    phase = np.full(seen.shape, np.nan)  # where nothing moves there is none
    moves = np.asarray(speeds) != 0.0
    phase[moves] = np.unwrap(np.angle(seen[moves]), axis=0)
    over = ("speed", "node")
    return xr.Dataset(
        {
            "major_axis": (over, forward + backward, _unit("m", "Major semi-axis of the orbit")),
            "minor_axis": (over, forward - backward, _unit("m", "Minor semi-axis of the orbit")),
            "amplitude": ((*over, "probe"), np.abs(seen), _unit("m", "Amplitude at the probe")),
            "phase": ((*over, "probe"), phase, _unit("rad", "Phase lead at the probe")),
        },
        coords={
            "speed": ("speed", np.asarray(speeds, dtype=np.float64), _unit("rad s-1", "Spin speed")),
            "node": ("node", nodes, {"long_name": "Node of the rotor"}),
            "probe": ("probe", np.asarray(probes, dtype=np.float64), _unit("rad", "Angle of the probe")),
        },
    )


def _unit(units: str, name: str) -> dict[str, str]:
    return {"units": units, "long_name": name}
