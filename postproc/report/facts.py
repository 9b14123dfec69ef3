"""The texts of the page: the study, its settings and state, failures, where the model leaves its range."""

from __future__ import annotations

import dataclasses
import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.cases.maps import monitors
from postproc.cases.sobol import drawn_ranges
from postproc.report.grid import plain
from postproc.store.attributes import KEYS, table_of
from postproc.store.axes import axes_of, drawn_axes
from postproc.store.rig_of_case import model_of
from postproc.store.units import short_name
from rubhpc.integrate.record import MOST_RESIDUAL
from rubhpc.schema import DIVERGED, DONE, FAILED, INFERRED, MISSING, STATUS, VARIABLES, WAVEFORM
from rubhpc.units import Scale, scale_for
from rubhpc.validity import MONITORS

if TYPE_CHECKING:
    from collections.abc import Iterable

    import xarray as xr
    from numpy.typing import NDArray

    from postproc.report.grid import Measures

_MOST_FAILURES = 200  # listed, of each kind

# The measure leaves the range of steady sliding only; the store's friction law covers it.
_FOLLOWED = {"minimum_slip_speed": "no limit of the model; below 0 the rim slips back (Coulomb's law)"}
_OF_ONE_SPEED = ("transient", "transient_limit", "transient_tolerance", "revolutions")  # of [record]


def counts(status: NDArray[np.float64]) -> list[dict[str, Any]]:
    """Return state and number of cases, the done ones first."""
    return [
        {"state": STATUS[code], "n": int((status == code).sum())}
        for code in (DONE, FAILED, DIVERGED, INFERRED, MISSING)
        if code != INFERRED or (status == code).any()
    ]


def _shown(axis: dict[str, Any]) -> list[str]:
    """Return the values of an axis as text, without their unit."""
    return axis["names"] or [f"{value:.6g}" for value in axis["values"]]


def case_text(axes: list[dict[str, Any]], flat: int) -> str:
    """Return the axis values of a case, as in `speed ratio 1.7, clearance 84 µm`."""
    at = np.unravel_index(flat, [len(axis["values"]) for axis in axes]) if axes else ()
    places = (
        f"{axis['label'][:1].lower()}{axis['label'][1:]} {_shown(axis)[i]} {axis['unit']}".rstrip()
        for axis, i in zip(axes, at, strict=True)
    )
    return ", ".join(places)


def failures(store: xr.Dataset, axes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the cases that failed, and those that diverged: how many, and the first of them with reasons."""
    reasons = store.attrs.get("reasons", {})
    status = store["status"].values.ravel()
    groups = []
    for code, meaning in (
        (FAILED, "failed: no result"),
        (
            DIVERGED,
            "diverged: the motion grew without bound, or its contact has no solution; this is a result",
        ),
    ):
        flats = np.flatnonzero(status == code)
        if flats.size:
            listed = [
                {
                    "flat": int(i),
                    "case": case_text(axes, int(i)),
                    "reason": reasons.get(int(i), "not recorded"),
                }
                for i in flats[:_MOST_FAILURES]
            ]
            groups.append(
                {"meaning": meaning, "n": flats.size, "cases": listed, "more": flats.size - len(listed)}
            )
    return groups


def validity_rows(
    store: xr.Dataset, measures: Measures, axes: list[dict[str, Any]], n_done: int
) -> list[dict[str, Any]]:
    """Return a row for each monitor: its limit, how many cases are beyond it, and the worst of them."""
    rows = []
    watched = monitors(store)
    for name, monitor in MONITORS.items():
        if name not in measures.names:
            continue
        values = measures.values(name)
        bad = monitor.is_out(values)  # NaN is beyond nothing
        worst = np.nanargmin if VARIABLES[name].worst == "min" else np.nanargmax
        limit = f"{monitor.name}, {monitor.text}" if name in watched else _FOLLOWED[name]
        rows.append(_row(measures, axes, name, bad, worst, n_done, limit))
    if "energy_residual" in measures.names:
        bad = measures.values("energy_residual") > MOST_RESIDUAL
        limit = "no limit of the model; above 1 %, check the step and the sampling"
        rows.append(_row(measures, axes, "energy_residual", bad, np.nanargmax, n_done, limit))
    return rows


def _row(
    measures: Measures,
    axes: list[dict[str, Any]],
    name: str,
    bad: NDArray[np.bool_],
    worst: Any,
    n_done: int,
    limit: str,
) -> dict[str, Any]:
    values = measures.values(name)
    by_stator = measures.is_by_stator(name)
    n_bad = int((bad.any(axis=-1) if by_stator else bad).sum())
    row: dict[str, Any] = {"name": name, "label": measures.label(name), "limit": limit, "n": n_bad}
    row |= {"share": f"{100 * n_bad / n_done:.3g} %" if n_done else "", "worst": "", "flat": None}
    if np.isfinite(values).any():
        place = int(worst(values))
        flat = place // values.shape[-1] if by_stator else place
        scale = measures.scale(name)
        number = f"{values.ravel()[place] * scale.factor:.3g} {scale.unit}".rstrip()
        row |= {"worst": number, "flat": flat, "case": case_text(axes, flat)}
    return row


def axis_rows(axes: list[dict[str, Any]]) -> list[dict[str, str]]:
    """Return name, values and their number of each axis."""
    rows = []
    for axis in axes:
        shown = _shown(axis)
        text = ", ".join(shown) if len(shown) <= 8 else f"{shown[0]}, {shown[1]}, … {shown[-1]}"
        rows.append(
            {"label": axis["label"], "listed": f"{text} {axis['unit']}".rstrip(), "n": str(len(shown))}
        )
    return rows


def drawn_rows(store: xr.Dataset) -> list[dict[str, str]]:
    """Return name and range of what a sampled study has drawn."""
    drawn = zip(drawn_axes(store), drawn_ranges(store), strict=True)
    return [
        {"label": plain(short_name(store[name])), "listed": f"drawn, {text}", "n": ""} for name, text in drawn
    ]


def study_rows(store: xr.Dataset) -> list[tuple[str, str]]:
    """Return how speed, contact, integration and recording were set, from the attributes of the store."""
    model = model_of(store).removeprefix("model ")
    return [("Model", model)] * bool(model) + setting_rows(table_of(store, "study"))


def run_rows(store: xr.Dataset, measures: Measures) -> list[tuple[str, str]]:
    """Return machine, versions and times of what ran, as far as the store contains them."""
    rows = []
    for run in store.attrs.get("runs", []):
        began, wrote = (time.strftime("%Y-%m-%d %H:%M", time.localtime(run[k])) for k in ("began", "wrote"))
        ranks = f"{run['n_rank']} rank{'s' if run['n_rank'] > 1 else ''}"
        machine = f"{run['host']}: {run['processor']}, {run['n_core']} cores, {run['system']}"
        lasted = seconds_text(max(run["wrote"] - run["began"], 0.0))
        end = wrote if wrote[:10] != began[:10] else wrote[11:]
        text = f"{ranks} on {machine}; {began} to {end} ({lasted}), rubhpc {run['version']}"
        rows.append((f"Run {run['number']}", text))
    if versions := table_of(store, "versions"):
        rows.append(("Store made with", ", ".join(f"{name} {number}" for name, number in versions.items())))
    if "wall_time" in measures.names:
        wall = measures.values("wall_time")
        wall = wall[np.isfinite(wall)]
        if wall.size:
            total, median, most = (seconds_text(float(f(wall))) for f in (np.sum, np.median, np.max))
            spread = f"; median {median}, most {most}" if wall.size > 1 else ""
            cases = f"{wall.size} case{'s' if wall.size > 1 else ''}"
            rows.append(("Computing time", f"{total} of one core for {cases}{spread}"))
    if "identity" in store.attrs:
        rows.append(("Identity", str(store.attrs["identity"])))
    return rows


def seconds_text(seconds: float) -> str:
    """Return a duration as text."""
    if seconds < 100:
        scale = scale_for("s", seconds) if seconds else Scale(1.0, "s")
        return f"{seconds * scale.factor:.3g} {scale.unit}"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"


def free_axes(store: xr.Dataset) -> list[str]:
    """Return the axes of several values, the longest first."""
    return sorted((a for a in axes_of(store) if store.sizes[a] > 1), key=lambda a: -store.sizes[a])


def setting_rows(study: dict[str, Any]) -> list[tuple[str, str]]:
    """Return how speed, contact, integration and recording were set, from the study in a store."""
    unused = _OF_ONE_SPEED if any(isinstance(study.get(name), dict) for name in ("run_up", "drive")) else ()
    rows = []
    for table in ("run_up", "drive", "contact", "integrator", "record"):
        settings = study.get(table)
        if isinstance(settings, dict):
            shown = {k: v for k, v in settings.items() if table != "record" or k not in unused}
            if table == "record" and unused and isinstance(shown.get("keep"), list):
                shown["keep"] = [name for name in shown["keep"] if name == WAVEFORM]
            rows.append((table.replace("_", "-").capitalize(), _text(table, shown)))
    return rows


def _text(table: str, settings: dict[str, Any]) -> str:
    units = {
        field.name: field.metadata.get("unit", field.metadata.get("units", ""))
        for field in dataclasses.fields(KEYS[table])
    }
    parts = []
    for key, value in settings.items():
        if value is None or value == []:
            continue
        if key in KEYS and isinstance(value, list):
            parts += [f"{key} ({_text(key, one)})" for one in value]
        else:
            parts.append(f"{key.replace('_', ' ')} {_value(value, units.get(key, ''))}")
    return ", ".join(parts)


def _value(value: object, unit: str | tuple[str, str]) -> str:
    if isinstance(value, list):
        if isinstance(unit, tuple):
            return " and ".join(" at ".join(map(_value, pair[::-1], unit[::-1])) for pair in value)
        return _listed(_value(v, unit) for v in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or isinstance(unit, tuple):
        return str(value)
    if unit == "rad/s":
        return f"{value * 30.0 / math.pi:.6g} rpm"
    if unit == "rad":
        return f"{math.degrees(value):.6g}°"
    scale = scale_for(unit, abs(value))
    return f"{value * scale.factor:.6g} {scale.unit.replace('*', ' ')}".rstrip()


def _listed(words: Iterable[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last
