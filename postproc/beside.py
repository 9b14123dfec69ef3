"""A figure of simulated and measured signals: over one another where possible, else next to one another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from postproc.figures.drawing import Drawing
from postproc.measured.measured import measured
from postproc.store.axes import axes_of
from postproc.store.run_ups import is_run_up
from postproc.store.select import narrow
from rubhpc.errors import InputError
from rubhpc.schema import AMPLITUDE, DONE, PHASE, TURNED, is_signal

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from matplotlib.axes import Axes

    from postproc.catalogue import Figure

ORIGIN = "motion"  # the axis of what is simulated and what is measured
_ORIGINS = ("simulated", "measured")
_PAGE = 180.0  # mm, the width of two figures


def figure_beside(
    figure: Figure, cases: xr.Dataset, path: str, words: Mapping[str, Any], *, has_data: bool = False
) -> Drawing:
    """Return the drawing of some cases and of a measured file; `has_data`: its data are written too.

    One case at a constant speed and a record of that kind, or two run-ups, are drawn over one another where
    the figure has the option `over`.

    Raises
    ------
    InputError
        The figure cannot be drawn of one of the two.
    """
    found = measured(path, samples_per_revolution=_samples_of(cases))
    signals = [str(name) for name in found.data_vars if is_signal(str(name)) and name in cases]
    if not signals:
        theirs = ", ".join(str(name) for name in found.data_vars if is_signal(str(name)))
        raise InputError(f"--measured: {theirs}: the store has no signal of that name; name one as there")
    if "signal" in figure.options and not words.get("signal") and not words.get("full"):
        is_many = figure.options["signal"].form == "many"
        words = {**words, "signal": tuple(signals) if is_many else signals[0]}
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


def _samples_of(cases: xr.Dataset) -> int:
    """Samples a revolution of the cases, to which the measured signals are resampled."""
    name = TURNED if TURNED in cases.coords else "revolution"
    if name not in cases.coords or "sample" not in cases[name].dims:
        raise InputError("--measured: this store has no waveforms; draw the measured file by itself")
    at = cases[name].values
    return round(1.0 / float(at[1] - at[0]))


def _is_one(cases: xr.Dataset) -> bool:
    return all(cases.sizes[axis] == 1 for axis in axes_of(cases))


def together(cases: xr.Dataset, found: xr.Dataset, signals: Sequence[str]) -> xr.Dataset:
    """Return the signals that one case and a measured record share, along the axis `motion`."""
    if is_run_up(cases):
        names = ["speed", "time", *signals]
        names += [p + name for p in (AMPLITUDE, PHASE) for name in signals if p + name in cases]
        lengths = {dim: max(cases.sizes[dim], found.sizes[dim]) for dim in ("sample", "revolution")}
        rows = [_padded(one, lengths) for one in (_one(cases, names), found[names])]
    else:
        names = [*signals, "spin_speed", *(name for name in ("period",) if name in cases)]
        least = min(cases.sizes["sample"], found.sizes["sample"])
        rows = [one.isel(sample=slice(-least, None)) for one in (_one(cases, names), found[names])]
        rows = [
            one.assign_coords(revolution=rows[0]["revolution"] - rows[0]["revolution"][0]) for one in rows
        ]
    rows = [one.drop_vars([n for n, at in one.coords.items() if not at.dims]) for one in rows]
    both = xr.concat(
        rows, ORIGIN, combine_attrs="override", coords="minimal", compat="override", join="override"
    )
    both = both.transpose(ORIGIN, ...)
    about = {"flag_meanings": " ".join(_ORIGINS), "units": "1"}
    both = both.assign_coords({ORIGIN: (ORIGIN, np.arange(2), about)})
    both["status"] = ORIGIN, np.full(2, DONE, dtype=np.int8)
    if "clearance" in cases:
        both["clearance"] = cases["clearance"].squeeze(drop=True)
    both.attrs = dict(cases.attrs)
    both.encoding["source"] = cases.encoding.get("source", "this store")
    return both


def _one(cases: xr.Dataset, names: Iterable[str]) -> xr.Dataset:
    return (narrow(cases, names) if "status" in cases else cases[list(names)]).load()


def _padded(one: xr.Dataset, lengths: Mapping[str, int]) -> xr.Dataset:
    """A run-up with NaN beyond its end, as a store has them."""
    own, n = one.drop_vars([TURNED, "revolution"]), _samples_of(one)
    padded = own.pad({dim: (0, length - own.sizes[dim]) for dim, length in lengths.items()})
    return padded.assign_coords(
        {
            TURNED: ("sample", np.arange(lengths["sample"]) / n, one[TURNED].attrs),
            "revolution": np.arange(lengths["revolution"]),
        }
    )


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
