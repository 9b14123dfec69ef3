"""Data of maps: a measure, the regime or the status of every case over two axes of the study."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from postproc.store.attributes import table_of
from postproc.store.axes import axes_of, drawn_axes, find_axis, refusal
from postproc.store.run_ups import STEADY, is_run_up
from postproc.store.select import narrow
from postproc.store.units import in_words, meanings
from postproc.store.variables import require_variables
from rubhpc.models import may_reverse
from rubhpc.schema import HAS_VALUES, REGIME, SETTLED, VARIABLES, role_of
from rubhpc.study.axes import SPEED_AXES, coordinate_of
from rubhpc.validity import MONITORS, STEADY_SLIP, counted, words

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rubhpc.validity import Monitor

_ROLES = ("measure", "flag", "setting")
MAPPABLE = tuple(n for n, v in VARIABLES.items() if v.role in _ROLES)
_FRICTION_LAW = "contact_friction_law"  # where it is an axis: under some laws slip may reverse
MOST_FACETS, MOST_PANELS = 2, 6


def is_mappable(name: str) -> bool:
    """Whether a variable of this name, also of a probe, has a value for every case."""
    return role_of(name) in _ROLES


def default_axes(
    store: xr.Dataset, x: str | None = None, y: str | None = None, facets: Sequence[str] = ()
) -> tuple[str, str]:
    """Return the axes across and up of a map: those named, and else the longest that are no facets."""
    named = [find_axis(store, name) for name in (x, y) if name]
    if len(set(named)) < len(named):
        raise refusal(store, f"--x and --y are both {named[0]}; a map needs two axes")
    axes = axes_of(store)
    taken = {*named, *(find_axis(store, name) for name in facets)}
    free = [a for a in axes if store.sizes[a] > 1 and a not in taken]
    free.sort(key=lambda a: -store.sizes[a])  # stable: of two equal ones the first in the grid
    if len(named) + len(free) < 2:
        sizes = ", ".join(f"{a} ({store.sizes[a]})" for a in axes) or "none"
        other = "open rubhpc report" if is_run_up(store) else "draw rubhpc bifurcation or open rubhpc report"
        advice = f"over one axis, {other}"
        raise refusal(store, f"a map needs two axes of several values; there is {sizes}; {advice}")
    across = named.pop(0) if x else free.pop(0)
    return across, named.pop(0) if y else free.pop(0)


def scatter_axes(store: xr.Dataset, x: str | None = None, y: str | None = None) -> tuple[str, str]:
    """Return the drawn quantities across and up: those named, else a speed and then the first others.

    InputError where one that is named was not drawn, or both are the same.
    """
    drawn = drawn_axes(store)
    named = [coordinate_of(name) if name else None for name in (x, y)]
    for name in named:
        if name is not None and name not in drawn:
            what = "is an axis: name it with --facet" if name in axes_of(store) else "was not drawn"
            raise refusal(store, f"{name}: {what}; the sample has {', '.join(drawn)}")
    in_order = dict.fromkeys(name for name in (*SPEED_AXES, *drawn) if name in drawn)
    free = [name for name in in_order if name not in named]
    across, up = (name or free.pop(0) for name in named)
    if across == up:
        raise refusal(store, f"{across} is on both axes; name another one")
    return across, up


def facet_axes(store: xr.Dataset, names: Sequence[str], taken: Sequence[str]) -> list[str]:
    """Return the axes of small multiples, down and across: at most two, of at most six values each.

    InputError where there is no such axis, there are more, or the maps spread over one already.
    """
    facets = [find_axis(store, name) for name in names]
    if len(facets) > MOST_FACETS or len({*facets, *taken}) < len(facets) + len(taken):
        raise refusal(store, f"--facet: give one or two axes other than {' or '.join(taken)}")
    for axis in facets:
        if store.sizes[axis] > MOST_PANELS:
            raise refusal(
                store,
                f"--facet {axis}: {store.sizes[axis]} values are more than {MOST_PANELS}; "
                f"keep some with --select {axis}=...",
            )
    return facets[::-1]


def map_data(store: xr.Dataset, value: str, spread: Sequence[str], facets: Sequence[str] = ()) -> xr.Dataset:
    """Return what a map shows, loaded: no more than this measure, the status and the validity monitors.

    Parameters
    ----------
    store : Dataset
        All other axes of more than one value must have been selected.
    spread : sequence of str
        The axes x and y of a map, or the one along which the cases of a sample lie.

    Returns
    -------
    Dataset over (*facets, y, x), or (*facets, case)
        The value, `status`, `settled` where the store has it (0: the record shows a transient), and
        `validity`: 0 within the model's range, else a sum of bits, one for each monitor that is out of range.
    """
    if not is_mappable(value):
        require_variables(store, [value])
        lacking = STEADY if is_run_up(store) else ()
        known = ", ".join(n for n in map(str, store.data_vars) if is_mappable(n) and n not in lacking)
        raise refusal(store, f"{value}: not a measure of a case; choose {known}")
    if is_run_up(store):
        if value in STEADY:
            raise refusal(store, f"{value}: is of a steady speed; choose another measure")
        store = store.drop_vars(STEADY, errors="ignore")
    store = store.assign(validity=validity(store))
    marks = ["status", "validity", *(n for n in ("settled",) if n in store)]  # older stores lack the last
    data = narrow(store, dict.fromkeys([value, *marks]), spread=[*spread, *facets])
    over = [*facets, *reversed(spread)]
    loaded: xr.Dataset = data.broadcast_like(store[over]).transpose(*over).load()
    return loaded


def monitors(store: xr.Dataset) -> dict[str, Monitor]:
    """Return the monitors that hold for a store: without steady sliding slip may reverse."""
    contact = table_of(store, "study").get("contact", {})
    is_free = may_reverse(contact.get("friction_law"))
    return {n: monitor for n, monitor in MONITORS.items() if not (is_free and n == STEADY_SLIP)}


def validity(store: xr.Dataset) -> xr.DataArray:
    """Return how each case leaves the model's range, over the axes: 0, or a sum of bits of `MONITORS`."""
    found = xr.zeros_like(store["status"], dtype=np.int16)
    watched = monitors(store)
    for i, (name, monitor) in enumerate(MONITORS.items()):
        if name in watched and name in store:
            bad = monitor.is_out(store[name])
            # A case is out of range where one of its stators is, whichever is drawn.
            bad = bad.any([d for d in ("stator",) if d in bad.dims])
            if name == STEADY_SLIP and _FRICTION_LAW in store.coords:
                laws = meanings(store[_FRICTION_LAW])
                bad &= store[_FRICTION_LAW].isin([i for i, law in enumerate(laws) if not may_reverse(law)])
            found = found | np.int16(1 << i) * bad.astype(np.int16)
    legend = ", ".join(
        f"{1 << i} ({monitor.name} out of range)"
        for i, (name, monitor) in enumerate(MONITORS.items())
        if name in watched
    )
    return found.rename("validity").assign_attrs(units="1", long_name=f"sum of {legend}")


def out_of_range(data: xr.Dataset) -> tuple[str, bool]:
    """Return what is out of the model's range in `map_data`, in words, and whether most cases are.

    The words name the monitors and count the cases, of those that have values.
    """
    has_values = np.isin(data["status"].values, HAS_VALUES)
    validity = np.where(has_values, data["validity"].values, 0)
    n, n_all = np.count_nonzero(validity), np.count_nonzero(has_values)
    count = f"all {n} cases" if n == n_all else f"{n} of {n_all} cases"
    return f"out of range in {count}: {counted(validity)}", bool(n > 0.5 * n_all)


def verdict_of(cases: xr.Dataset) -> tuple[str, ...]:
    """Return what a caption says of a single case that is done; nothing of several cases.

    That is its regime or period, whether it had not settled, and the monitors that are out of range.
    """
    if "status" not in cases or any(cases.sizes[axis] != 1 for axis in axes_of(cases)):
        return ()
    names = [n for n in ("status", "regime", "period", "settled", *MONITORS) if n in cases]
    case = cases[names].isel(dict.fromkeys(axes_of(cases), 0)).load()
    if int(case["status"]) not in HAS_VALUES:
        return ()
    found = []
    regime, period = (int(case[n]) if n in case else -1 for n in ("regime", "period"))
    if regime >= 0:
        is_periodic = period > 0 and REGIME[regime] == "periodic"
        found.append(f"period {period}" if is_periodic else in_words(REGIME[regime]))
    if "settled" in case and int(case["settled"]) == SETTLED.index("not_settled"):
        found.append("not settled")
    code = int(validity(case))
    return (*found, *(f"out of range: {words(code)}".split(", ") if code else ()))
