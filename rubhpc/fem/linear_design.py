"""Linear design of a rotor: what one needs to know before it touches anything, in one dataset."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble, model_at
from rubhpc.fem.critical_speeds import CriticalSpeed, campbell, find_critical_speeds, follow_modes
from rubhpc.fem.response import (
    check_response_node,
    first_lateral_frequency,
    lateral_at_nodes,
    response_nodes,
)
from rubhpc.fem.separation_margin import (
    amplitude_over_speed,
    grid_through,
    response_peaks,
    unbalance_response,
)
from rubhpc.fem.stability import logarithmic_decrement, threshold_speed
from rubhpc.rig.rotors import Rotor
from rubhpc.schema import columns, described
from rubhpc.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from rubhpc.fem.model import Model
    from rubhpc.fem.modes import Mode
    from rubhpc.rig.rig import Rig

N_SPEED = 61  # on which modes are followed; the response has more, close to its peaks
MOST_RATIO = 6.0  # of the first lateral frequency, where the range ends by default


@on_one_thread
def linear_design(
    rig: Rig,
    speed_range: tuple[float, float] | None = None,
    *,
    operating: tuple[float, float] | None = None,
    nodes: Sequence[int] | None = None,
    probes: Sequence[float] = (0.0, math.pi / 2),
    n_speed: int = N_SPEED,
) -> xr.Dataset:
    """Return modes, critical speeds, unbalance response, static sag and stability of a rig's rotor.

    Parameters
    ----------
    rig : Rig
    speed_range : tuple of (lowest, highest), optional
        Spin, rad/s, none negative. By default from 0 to six times the first lateral frequency, or over the
        tables of bearings.
    operating : tuple of (least, greatest), optional
        Operating speeds, rad/s, from which the separation margins of API 617 count.
    nodes : sequence of int, optional
        Nodes at which peaks of the response are sought; by default the recorded one.
    probes : sequence of float
        Angles of displacement probes, rad, from straight up with the spin.
    n_speed : int
        Speeds at which the modes are computed.

    Returns
    -------
    xarray.Dataset
        Over (mode, speed): `frequency` and `damped_frequency` (Hz), `damping_ratio`, `logarithmic_decrement`,
        `growth_rate` (1/s, positive where a motion grows), `whirl`; over mode: `kind`; over node:
        `position` (m).

        Over (response_speed, node): what `unbalance_response` returns. Over (speed, node): `sag_vertical` and
        `sag_horizontal` (m), under gravity and constant loads.

        Over critical: `critical_speed` (rad/s), `critical_mode`, `critical_whirl`, `critical_damping_ratio`,
        `excitation` and `is_excited` by the unbalance (see `CriticalSpeed`), and with node and part (real,
        imaginary) its mode shape, `shape_vertical` and `shape_horizontal`, of greatest displacement 1.

        Over peak: `peak_node`, `peak_speed` (rad/s), `peak_amplitude` (m, major semi-axis),
        `lower_half_power_speed`, `upper_half_power_speed` (rad/s), `amplification_factor`; with `operating`
        also `separation_margin`, `required_margin` (shares) and `is_separated`.

        `threshold_speed` (rad/s): where the rotor begins to be unstable; NaN where it is stable.

        Attributes: `rig`, its name; `speed_range` and, where given, `operating` (rad/s); `bearing_nodes`, the
        nodes with bearings or seals.

    Raises
    ------
    InputError
        When a node does not move sideways, or a bearing has no coefficients at a speed.
    """
    model = assemble(rig)
    low, high = checked_range(model, speed_range)
    _check_operating(operating)
    nodes = [model.output_node] if nodes is None else list(nodes)
    for node in nodes:
        check_response_node(model, node)
    speeds = _speeds(model, low, high, n_speed)
    tracks = follow_modes(model.rotor, speeds)
    critical = find_critical_speeds(model, speeds, tracks)
    grid = grid_through(low, high, critical)
    response = unbalance_response(model, grid, probes=probes).rename(speed="response_speed")
    design = xr.merge(
        [
            _modes(model, speeds, tracks),
            _positions(rig, model),
            response,
            _sag(model, speeds),
            _critical(model, critical),
            _peaks(model, grid, nodes, operating),
        ],
        join="exact",
        combine_attrs="drop_conflicts",
    )
    threshold = threshold_speed(model.rotor, speeds, tracks)
    design["threshold_speed"] = ((), threshold, described("rad s-1", "Threshold speed of instability"))
    bearings = sorted({rig.rotor.node_of(bearing) for bearing in rig.rotor.bearing})
    design.attrs = {"rig": rig.name, "speed_range": [low, high], "bearing_nodes": bearings}
    if operating is not None:
        design.attrs["operating"] = list(operating)
    return design


def checked_range(model: Model, speed_range: tuple[float, float] | None) -> tuple[float, float]:
    """Return lowest and highest speed of a range, rad/s: the one given, once checked, or the default one."""
    tabulated = model.rotor.tabulated_speeds
    if speed_range is None:
        highest = MOST_RATIO * first_lateral_frequency(model)
        return (tabulated[0], tabulated[-1]) if tabulated else (0.0, highest)
    low, high = speed_range
    if not 0.0 <= low < high < math.inf:
        problem = f"{low:g} to {high:g} rad/s is not a range of speeds"
        raise InputError(f"range: {problem}; give a lowest speed, at least 0, and a higher one")
    return float(low), float(high)


def _check_operating(operating: tuple[float, float] | None) -> None:
    if operating is not None and not 0.0 < operating[0] <= operating[1] < math.inf:
        problem = f"{operating[0]:g} to {operating[1]:g} rad/s is not a range of speeds"
        raise InputError(f"operating: {problem}; give the least speed, above 0, and the greatest")


def _speeds(model: Model, low: float, high: float, n_speed: int) -> NDArray[np.float64]:
    """Evenly spaced speeds, and those of the tables between them, at which coefficients bend."""
    inner = [speed for speed in model.rotor.tabulated_speeds if low < speed < high]
    return np.unique(np.append(np.linspace(low, high, n_speed), inner))


def _modes(model: Model, speeds: NDArray[np.float64], tracks: Sequence[tuple[Mode, ...]]) -> xr.Dataset:
    curves = campbell(model.rotor, speeds, tracks)
    for name, value, unit, title in (
        ("damped_frequency", lambda mode: mode.damped_frequency, "Hz", "Damped natural frequency"),
        ("logarithmic_decrement", logarithmic_decrement, "1", "Logarithmic decrement"),
        ("growth_rate", lambda mode: mode.eigenvalue.real, "s-1", "Growth rate"),
    ):
        values = [[value(mode) for mode in track] for track in tracks]
        curves[name] = (("mode", "speed"), values, described(unit, title))
    return curves.assign_coords(mode=("mode", np.arange(1, len(tracks) + 1), {"long_name": "Mode"}))


def _positions(rig: Rig, model: Model) -> xr.Dataset:
    """Place of every node along the shaft, m; NaN for a rotor of matrices, which does not say."""
    nodes = response_nodes(model)
    positions = np.full(len(nodes), np.nan)
    if isinstance(rig.rotor, Rotor):
        positions = rig.rotor.positions[np.array(nodes) - 1]
    place = ("node", positions, described("m", "Position along the shaft"))
    return xr.Dataset(coords={"node": nodes, "position": place})


def _sag(model: Model, speeds: NDArray[np.float64]) -> xr.Dataset:
    sag = lateral_at_nodes(model, np.stack([model_at(model, float(speed)).sag for speed in speeds]))
    parts = {
        f"sag_{direction}": (sag[:, i], "m", f"Static sag, {direction}")
        for i, direction in enumerate(("vertical", "horizontal"))
    }
    return xr.Dataset(columns(("speed", "node"), parts), coords={"node": response_nodes(model)})


def _critical(model: Model, critical: Sequence[CriticalSpeed]) -> xr.Dataset:
    nodes = response_nodes(model)
    shapes = np.zeros((len(critical), 2, len(nodes)), dtype=np.complex128)
    for i, found in enumerate(critical):
        shapes[i] = lateral_at_nodes(model, found.mode.shape)
        shapes[i] /= np.abs(shapes[i]).max() or 1.0
    parts = np.stack([shapes.real, shapes.imag], axis=-1)
    modes = [found.mode for found in critical]
    values = {
        "critical_speed": ([found.speed for found in critical], "rad s-1", "Critical speed"),
        "critical_damping_ratio": ([mode.damping_ratio for mode in modes], "1"),
        "excitation": ([found.excitation for found in critical], "1"),
    }
    of_nodes = {
        "shape_vertical": (parts[:, 0], "1", "Mode shape, vertical"),
        "shape_horizontal": (parts[:, 1], "1", "Mode shape, horizontal"),
    }
    words = {
        "critical_mode": ("critical", [found.number for found in critical]),
        "critical_whirl": ("critical", np.array([mode.whirl for mode in modes], dtype=str)),
        "is_excited": ("critical", np.array([found.is_excited for found in critical], dtype=bool)),
    }
    return xr.Dataset(
        words | columns("critical", values) | columns(("critical", "node", "part"), of_nodes),
        coords={"node": nodes, "part": ["real", "imaginary"]},
    )


def _peaks(
    model: Model,
    grid: NDArray[np.float64],
    nodes: Sequence[int],
    operating: tuple[float, float] | None,
) -> xr.Dataset:
    found = [(n, peak) for n in nodes for peak in response_peaks(amplitude_over_speed(model, n), grid)]
    peaks = [peak for _, peak in found]
    about = {
        "peak_speed": ([peak.speed for peak in peaks], "rad s-1", "Speed of the peak"),
        "peak_amplitude": ([peak.amplitude for peak in peaks], "m", "Amplitude of the peak"),
        "lower_half_power_speed": ([peak.half_power_speeds[0] for peak in peaks], "rad s-1", "N1"),
        "upper_half_power_speed": ([peak.half_power_speeds[1] for peak in peaks], "rad s-1", "N2"),
        "amplification_factor": ([peak.amplification_factor for peak in peaks], "1", "Amplification factor"),
    }
    if operating is not None:
        margins = [peak.separation_margin(operating) for peak in peaks]
        required = [peak.required_margin(operating) for peak in peaks]
        about["separation_margin"] = (margins, "1", "Separation margin")
        about["required_margin"] = (required, "1", "Separation margin required by API 617")
    table = xr.Dataset(columns("peak", about))
    table["peak_node"] = ("peak", np.array([node for node, _ in found], dtype=int))
    if operating is not None:
        separated = [peak.is_separated(operating) for peak in peaks]
        table["is_separated"] = ("peak", np.array(separated, dtype=bool))
    return table
