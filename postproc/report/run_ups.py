"""Run-ups and driven rotors on the page: speed, Bode plot and waterfall of each case."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.figures.bode import bode
from postproc.figures.speed import speed
from postproc.figures.waterfall import waterfall
from postproc.report.pictures import MOST_DRAWN, picture
from postproc.store.axes import axes_of
from postproc.store.run_ups import is_run_up
from postproc.store.units import written_value
from rubhpc.schema import AMPLITUDE, DONE, PROBE

if TYPE_CHECKING:
    import xarray as xr

_FEWEST, _WINDOW = 4, 32  # revolutions: of a Bode plot, of a spectrum


def run_up_facts(store: xr.Dataset) -> dict[str, Any]:
    """Return what the page shows of cases whose speed changes.

    Returns
    -------
    dict
        `text`: how many cases are drawn and of which signal, "" where the store has none; `cases`: of the
        first that are done `label`, the values of their axes, and `pictures`: names and addresses that
        contain them.
    """
    if not is_run_up(store) or "status" not in store:
        return {"text": "", "cases": []}
    done = np.argwhere(store["status"].values == DONE)
    if not len(done):
        return {"text": "", "cases": []}
    signal = _signal(store)
    axes = axes_of(store)
    cases = []
    for place in done[:MOST_DRAWN].tolist():
        case = store.isel(dict(zip(axes, place, strict=True)))
        varied = [name for name in axes if store.sizes[name] > 1 and name in case.coords]
        n = int(np.isfinite(case["speed"].values).sum())
        pictures = [("Speed", picture(speed(case), is_shared=True))]
        if n >= _FEWEST:
            pictures.append(("Bode plot", picture(bode(case, signal), is_shared=True)))
        if n > _WINDOW and signal in case:
            pictures.append(("Waterfall", picture(waterfall(case, signal=signal))))
        cases.append(
            {
                "label": ", ".join(written_value(case[name]).replace("$", "") for name in varied),
                "pictures": [{"name": name, "address": address} for name, address in pictures],
            }
        )
    left = f"; the first {MOST_DRAWN} of {len(done)} cases are drawn" if len(done) > MOST_DRAWN else ""
    named = signal.removeprefix(PROBE).replace("_", " ")
    named = f"the probe {named}" if signal.startswith(PROBE) else f"the {named} motion"
    return {"text": f"Speed, and Bode plot and waterfall of {named}{left}.", "cases": cases}


def _signal(store: xr.Dataset) -> str:
    """The signal that is drawn: of the first probe, if possible of a displacement, or the vertical motion."""
    prefix = AMPLITUDE + PROBE
    probes = [str(name).removeprefix(AMPLITUDE) for name in store.data_vars if str(name).startswith(prefix)]
    displaced = [name for name in probes if store[AMPLITUDE + name].attrs.get("units") == "m"]
    return (displaced or probes or ["vertical"])[0]
