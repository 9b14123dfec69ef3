"""A figure of simulated and measured signals: over one another where possible, else next to one another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.figures.drawing import Drawing
from postproc.signals.spectra import samples_per_revolution
from postproc.store.axes import axes_of
from postproc.store.run_ups import is_run_up
from postproc.store.select import narrow
from postproc.store.variables import require_variables
from rubhpc.errors import InputError
from rubhpc.schema import AMPLITUDE, DONE, PHASE, TURNED, is_signal

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from postproc.catalogue import Figure

ORIGIN = "motion"  # the axis of what is simulated and what is measured
_ORIGINS = ("simulated", "measured")
_OF_RUN_UPS, _OF_CASES = ("speed", "time"), ("spin_speed", "period")
_PAGE = 180.0  # mm, the width of two figures


def figure_beside(
    figure: Figure, cases: xr.Dataset, found: xr.Dataset, words: Mapping[str, Any], *, has_data: bool = False
) -> Drawing:
    """Return the drawing of some cases and of what was measured; `has_data`: its data are written too.

    One case at a constant speed and a record of that kind, or two run-ups, are drawn over one another where
    the figure has the option `over`. InputError where the figure cannot be drawn of one of the two.
    """
    signals = [str(name) for name in found.data_vars if is_signal(str(name)) and name in cases]
    if not signals:
        theirs = ", ".join(str(name) for name in found.data_vars if is_signal(str(name)))
        raise InputError(f"--measured: {theirs}: the store has no signal of that name; name one as there")
    given = words.get("signal") or ()
    require_variables(found, (given,) if isinstance(given, str) else given)
    if "signal" in figure.options and not given and not words.get("full"):
        words = {**words, "signal": tuple(signals) if figure.name == "waveform" else signals[0]}
    if (
        "over" in figure.options
        and is_run_up(cases) == is_run_up(found)
        and _is_one(cases)
        and _is_one(found)
    ):
        if words.get("over"):
            raise InputError("--over conflicts with --measured, which is drawn over one case; leave out one")
        return figure.of(together(cases, found, signals), **{**words, "over": ORIGIN})
    if has_data:
        problem = "two drawings next to one another have no data in common"
        raise InputError(f"--measured: {problem}; leave out --data, or draw each by itself")
    return _next_to(figure.of(cases, **words), figure.of(found, **words))


def samples_of(cases: xr.Dataset) -> int:
    """Return the samples a revolution of some cases, to which measured signals are to be resampled."""
    name = TURNED if TURNED in cases.coords else "revolution"
    if name not in cases.coords or "sample" not in cases[name].dims:
        raise InputError("--measured: this store has no waveforms; draw the measured file by itself")
    return samples_per_revolution(cases)


def _is_one(cases: xr.Dataset) -> bool:
    return all(cases.sizes[axis] == 1 for axis in axes_of(cases))


def together(cases: xr.Dataset, found: xr.Dataset, signals: Sequence[str]) -> xr.Dataset:
    """Return the signals that one case and a measured record share, along the axis `motion`.

    A run-up has NaN beyond its end, as in a store; at a constant speed both have as many revolutions.
    """
    names = [*signals, *(name for name in (*_OF_RUN_UPS, *_OF_CASES) if name in cases and name in found)]
    names += [what + name for what in (AMPLITUDE, PHASE) for name in signals if what + name in cases]
    rows = [narrow(one, names).load() for one in (cases, found)]
    if not is_run_up(cases):
        least = min(one.sizes["sample"] for one in rows)
        rows = [one.isel(sample=slice(-least, None)) for one in rows]
    of_samples = TURNED if is_run_up(cases) else "revolution"
    longest = max(rows, key=lambda one: one.sizes["sample"])[of_samples]
    rows = [one.drop_vars([n for n, at in one.coords.items() if n not in one.dims]) for one in rows]
    rows = [one.assign_coords(sample=np.arange(one.sizes["sample"])) for one in rows]
    both = xr.concat(rows, ORIGIN, join="outer", combine_attrs="override").drop_vars("sample")
    about = {"flag_meanings": " ".join(_ORIGINS), "units": "1"}
    both = both.transpose(ORIGIN, ...).assign_coords({ORIGIN: (ORIGIN, np.arange(2), about)})
    both[of_samples] = "sample", longest.values - longest.values[0], longest.attrs
    both = both.set_coords(of_samples)
    both["status"] = ORIGIN, np.full(2, DONE, dtype=np.int8)
    if "clearance" in cases:
        both["clearance"] = cases["clearance"].squeeze(drop=True)
    both.attrs = dict(cases.attrs)
    both.encoding["source"] = cases.encoding.get("source", "this store")
    return both


def _next_to(left: Drawing, right: Drawing) -> Drawing:
    """Two drawings of one figure on a page."""
    rows, columns = left.panels or (1, 1)

    def draw(axes: list[Axes]) -> None:
        for i, (one, name) in enumerate(zip((left, right), _ORIGINS, strict=True)):
            own = [axes[row * 2 * columns + i * columns + k] for row in range(rows) for k in range(columns)]
            one.draw(own)
            title = own[0].get_title()
            own[0].set_title(f"{name}\n{title}" if title else name, fontsize=8)

    lines = [
        f"{name}: {line}" for one, name in ((left, "simulated"), (right, "measured")) for line in one.lines
    ]
    return Drawing(
        shown=left.shown,
        draw=draw,
        panels=(rows, 2 * columns),
        is_shared=False,
        height=left.height,
        width=_PAGE,
        lines=tuple(lines),
    )
