"""The rig that a case ran on, as its store tells it: natural frequencies, and where the stators stand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import xarray as xr

from postproc.load import source
from rubhpc.errors import InputError
from rubhpc.rig import Rig, rig_from_dict, with_keys

if TYPE_CHECKING:
    from collections.abc import Mapping

_MODES = {"lateral": "lateral", "torsional": "torsional"}  # kind of a mode: its name in figures


def rig_of(case: xr.Dataset, values: Mapping[str, float] | None = None) -> Rig:
    """Return the rig of one case: the store's, with the rig keys among its axes at their selected values.

    Parameters
    ----------
    values : mapping of dimension to value, optional
        Of axes that are not selected.

    Raises
    ------
    InputError
        The store tells no rig, or not one that this version reads.
    """
    table = case.attrs.get("rig")
    if not isinstance(table, dict):
        raise InputError(f"{source(case)}: tells no rig; only a store that rubhpc has written does")
    rig = rig_from_dict(table, f"{source(case)}: rig")
    chosen = {
        str(n): float(c.values) for n, c in case.coords.items() if c.ndim == 0 and c.dtype.kind in "fiu"
    }
    chosen |= values or {}
    return with_keys(rig, {key: chosen[dim] for dim, key in _rig_axes(case).items() if dim in chosen})


def natural_frequencies(case: xr.Dataset, along: str | None = None) -> dict[str, xr.DataArray]:
    """Return the first lateral and the first torsional natural frequency of the rotor at standstill, Hz.

    Where `along` is an axis of the rig, such as a bearing's stiffness, each is an array over it.
    """
    from rubhpc.fem.assemble import assemble
    from rubhpc.fem.modes import modes

    is_rig_axis = along in _rig_axes(case) and along in case.dims
    points: list[dict[str, float]] = (
        [{along: float(v)} for v in case[along].values] if is_rig_axis and along else [{}]
    )
    found: dict[str, list[float]] = {}
    for point in points:
        rotor = modes(assemble(rig_of(case, point)).rotor)
        for kind, name in _MODES.items():
            frequencies = [m.frequency for m in rotor if m.kind == kind and m.frequency > 0]
            if frequencies:
                found.setdefault(name, []).append(min(frequencies))
    dims = (along,) if is_rig_axis and along else ()
    return {
        name: xr.DataArray(values if dims else values[0], dims=dims, attrs={"units": "Hz"})
        for name, values in found.items()
        if len(values) == len(points)
    }


def stator_places(case: xr.Dataset) -> list[tuple[float, float]]:
    """Return angle (rad, from straight up with the spin) and clearance offset (m) of the stators at the disc.

    The disc is the one whose motion is recorded, at the node of the first stator; others touch another disc.
    """
    if "rig" not in case.attrs:
        return []
    stators = rig_of(case).stator
    return [(s.angle, s.clearance_offset) for s in stators if s.node == stators[0].node]


def _rig_axes(case: xr.Dataset) -> dict[str, str]:
    """Return the axes of the study that are keys of the rig: dimension to dotted key."""
    study: dict[str, Any] = case.attrs.get("study", {})
    return {name.replace(".", "_"): name for name in study.get("grid", {}) if "." in name}
