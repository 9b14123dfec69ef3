"""The rig of one case, from the attributes of its store: natural frequencies and positions of the stators."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import xarray as xr

from postproc.store.attributes import MEASURED, table_of
from postproc.store.axes import refusal, source
from rubhpc.models import ABSENT, in_words
from rubhpc.rig.reading import rig_from_dict, with_keys
from rubhpc.rig.stators import Stator, geometries
from rubhpc.schema import BORE_MEASURES
from rubhpc.study.axes import axis_table, coordinate_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from rubhpc.rig.rig import Rig

Place = tuple[float | None, float, float, float]  # of a stator: `stator_places`
ROTOR_MODES = ("lateral", "torsional")


def rig_of(case: xr.Dataset, values: Mapping[str, float] | None = None) -> Rig:
    """Return the rig of one case: the store's, with the rig keys among its axes at their selected values.

    `values` are those of axes that are not selected. InputError where the store contains no rig, or one that
    this version cannot read.
    """
    table = table_of(case, "rig")
    if not table:
        fix = (
            "add rig to the measured file"
            if MEASURED in case.attrs
            else "give a store that rubhpc has written"
        )
        raise refusal(case, f"contains no rig; {fix}")
    rig = rig_from_dict(table, f"{source(case)}: rig")
    chosen = {
        str(n): float(c.values.item())
        for n, c in case.coords.items()
        if c.size == 1 and c.dtype.kind in "fiu"
    }
    chosen |= values or {}
    return with_keys(rig, {key: chosen[dim] for dim, key in rig_axes(case).items() if dim in chosen})


def model_of(store: xr.Dataset) -> str:
    """Return the normal, friction law and geometry of stators that a study uses, in words; "" without one."""
    study = table_of(store, "study")
    if "contact" not in study or not table_of(store, "rig"):
        return ""
    contact, grid = ABSENT | study["contact"], study.get("grid", {})
    normals, laws = (
        [str(word) for word in grid.get(f"contact.{key}", {}).get("values", [contact[key]])]
        for key in ("normal", "friction_law")
    )
    return in_words(normals, laws, geometries(rig_from_dict(table_of(store, "rig")).stator))


def natural_frequencies(case: xr.Dataset, along: str | None = None) -> dict[str, xr.DataArray]:
    """Return the first lateral and the first torsional natural frequency of the rotor at standstill, Hz.

    Where keys of the rig lie on the dimension `along`, such as a bearing's stiffness on its own or all that
    was drawn on that of a sample, each is an array over it.
    """
    return _over_rig(case, along, lambda rig: _first_of_kinds(_assembled(rig).rotor, ROTOR_MODES))


def frequencies_at_speed(case: xr.Dataset, spin: float) -> dict[str, list[float]]:
    """Return the natural frequencies (Hz) of the rotor of a case at a speed (rad/s), by kind."""
    from rubhpc.fem.modes import modes

    found: dict[str, list[float]] = {}
    for mode in modes(_assembled(rig_of(case)).rotor, spin):
        if mode.frequency > 0.0:
            found.setdefault(mode.kind, []).append(mode.frequency)
    return found


def stator_frequencies(case: xr.Dataset, along: str | None = None) -> dict[str, xr.DataArray]:
    """Return the first lateral natural frequency of the stator selected, or of the first, Hz; see above."""
    chosen = case.coords.get("stator")
    i_stator = int(chosen) - 1 if chosen is not None and chosen.ndim == 0 else 0

    def of_stator(rig: Rig) -> dict[str, float]:
        return _first_of_kinds(_assembled(rig).stators[i_stator].held.body, ("lateral",))

    return _over_rig(case, along, of_stator)


def _assembled(rig: Rig) -> Any:
    """The matrices of a rig; few figures need the library behind them."""
    from rubhpc.fem.assemble import assemble

    return assemble(rig)


def _first_of_kinds(body: Any, kinds: Sequence[str]) -> dict[str, float]:
    """The lowest natural frequency above 0 of a body at standstill, Hz, of each kind that it has."""
    from rubhpc.fem.modes import modes

    found = [mode for mode in modes(body) if mode.frequency > 0]
    present = {mode.kind for mode in found}
    return {kind: min(m.frequency for m in found if m.kind == kind) for kind in kinds if kind in present}


def _over_rig(
    case: xr.Dataset, along: str | None, frequencies_of: Callable[[Rig], dict[str, float]]
) -> dict[str, xr.DataArray]:
    """Return the frequencies of a case's rig, Hz, as arrays over `along` where keys of the rig lie on it.

    None of a machine that was measured and has no rig.
    """
    if MEASURED in case.attrs and "rig" not in case.attrs:
        return {}
    keys = [key for key in rig_axes(case) if key in case.coords and case[key].dims == (along,)]
    points: list[dict[str, float]] = [
        {key: float(v) for key, v in zip(keys, values, strict=True)}
        for values in zip(*(case[key].values for key in keys), strict=True)
    ] or [{}]
    found: dict[str, list[float]] = {}
    for point in points:
        for name, frequency in frequencies_of(rig_of(case, point)).items():
            found.setdefault(name, []).append(frequency)
    dims = (along,) if keys else ()
    return {
        name: xr.DataArray(values if dims else values[0], dims=dims, attrs={"units": "Hz"})
        for name, values in found.items()
        if len(values) == len(points)
    }


def has_place(case: xr.Dataset) -> bool:
    """Whether it is known at which node the motion is: what was measured may not say."""
    return isinstance(case.attrs.get("node"), int) or "rig" in case.attrs


def recorded_node(case: xr.Dataset) -> int:
    """Return the node whose motion is drawn: the attribute `node` of the case, or else that of its rig.

    There it is recorded at the first stator, unless the rotor names another node.
    """
    if isinstance(node := case.attrs.get("node"), int):
        return node
    rig = rig_of(case)
    return rig.rotor.recorded_node([stator.node for stator in rig.stator])


def stators_around(case: xr.Dataset) -> list[int]:
    """Return which stators, from 0, stand around the node whose motion is drawn."""
    if "rig" not in case.attrs:
        return []
    node = recorded_node(case)
    return [i for i, stator in enumerate(rig_of(case).stator) if stator.node == node]


def stator_places(case: xr.Dataset) -> list[Place]:
    """Return angle (rad, from straight up with the spin) and clearance offset (m) of the stators around.

    Then follow the horizontal and the vertical position, m, about which they are set. A bore has no angle.
    """
    around = stators_around(case)
    if not around:
        return []
    rig = rig_of(case)
    stators = [rig.stator[i] for i in around]
    centres = [(0.0, 0.0)] * len(stators)
    if rig.rotor.aligned_at is not None or any(stator.is_bore for stator in stators):
        models = _assembled(rig).stators
        centres = [models[i].centre for i in around]
    return [
        (None if s.is_bore else s.angle, s.clearance_offset, across, up)
        for s, (up, across) in zip(stators, centres, strict=True)
    ]


def bores_around(case: xr.Dataset) -> list[int]:
    """Return which bores, by their place among the stators from 0, are around the node that is drawn."""
    around = stators_around(case)
    stators = rig_of(case).stator if around else ()
    return [i for i in around if stators[i].is_bore]


def unused_monitors(case: xr.Dataset) -> set[str]:
    """Return the measures that compare with what no part of the rig has; none where the rig is not known.

    These are a length and an Euler load, which beams have, the strength of a stator and the clearance of a
    bearing; and measures of bores.
    """
    if not table_of(case, "rig"):
        return set()
    rig = rig_of(case)
    is_used = {
        "force_over_euler_load": any(isinstance(stator, Stator) for stator in rig.stator),
        "tip_deflection_ratio": any(isinstance(stator, Stator) for stator in rig.stator),
        "force_over_strength": any(stator.strength is not None for stator in rig.stator),
        "bearing_clearance_ratio": any(
            bearing.clearance is not None for bearing in getattr(rig.rotor, "bearing", ())
        ),
    }
    is_used |= dict.fromkeys(BORE_MEASURES, any(stator.is_bore for stator in rig.stator))
    return {name for name, used in is_used.items() if not used}


def is_carried(case: xr.Dataset) -> bool:
    """Whether stators around the node whose motion is drawn stand on a carrier, with which they move."""
    return any(rig_of(case).stator[i].carrier is not None for i in stators_around(case))


def rig_axes(case: xr.Dataset) -> dict[str, str]:
    """Return the axes of the study that are keys of the rig: coordinate to dotted key."""
    keys = (name for name in table_of(case, "study").get("grid", {}) if "." in name and not axis_table(name))
    return {coordinate_of(key): key for key in keys}
