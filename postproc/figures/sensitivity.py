"""Sobol indices of a measure: two bars an axis of the study, with their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
import xarray as xr

from postproc.cases.sensitivity import sensitivity as sobol_indices
from postproc.figures.drawing import Drawing
from postproc.store.units import short_name

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes

    from postproc.figures.options import Bounds, Seed, Share

_BAR = 0.36  # of the distance between two axes of the study
_STYLES = (("total", "Total, with interactions", "#BBD7EA", -1), ("first_order", "First order", "C0", 1))


def sensitivity(
    cases: xr.Dataset,
    measure: str = "peak_contact_force",
    *,
    confidence: Share = 0.95,
    draws: Annotated[int, Bounds(least=2)] = 500,
    seed: Seed = 1,
) -> Drawing:
    """Sobol indices of a measure over the axes of the study.

    First-order and total indices are drawn with intervals. They are exact on the levels of a grid, with equal
    weights; an interval shows what the same number of other levels in the range could have given. Those of a
    sampled study are estimates, with SALib. Cases without a value are counted, and reported.

    Parameters
    ----------
    cases
        All cases of a grid or a sample.
    measure
        A measure or setting of a case; of several stators, the worst.
    confidence
        Confidence of the intervals.
    draws
        Draws of levels or points for the intervals.
    seed
        Seed of the draws.
    """
    found = sobol_indices(cases, measure, n_draw=draws, confidence=confidence, seed=seed)
    return Drawing(
        shown=found,
        draw=lambda axes: draw_bars(found, axes[0]),
        height=24.0 + 10.0 * found.sizes["axis"],  # bars are equally thick however many there are
        lines=tuple(_table(found)),
    )


def draw_bars(indices: xr.Dataset, ax: Axes) -> Axes:
    """Draw the indices of `postproc.cases.sensitivity`, the axis that matters most at the top."""
    at = -np.arange(indices.sizes["axis"], dtype=float)
    for name, label, colour, side in _STYLES:
        share = indices[name].values
        ends = [share - indices[f"{name}_low"].values, indices[f"{name}_high"].values - share]
        place = at + side * _BAR / 2
        ax.barh(place, share, _BAR, color=colour, label=label, zorder=2)
        ax.errorbar(share, place, xerr=ends, fmt="none", ecolor="k", elinewidth=0.7, capsize=2, zorder=3)
    named = zip(indices["axis"].values, indices["axis_name"].values, strict=True)
    ax.set_yticks(at, [short_name(xr.DataArray(name=n, attrs={"long_name": text})) for n, text in named])
    ax.tick_params(axis="y", length=0)
    about = indices.attrs
    named_after = {"long_name": about["measure_name"], "of_stators": about["of_stators"]}
    measure = xr.DataArray(name=about["measure"], attrs=named_after)
    subtitle = f"{about['interactions']:.0%} interactions, {about['confidence']:.0%} intervals"
    # To the left of the panel there is room that long names of axes take.
    gap = "\n" if about["of_stators"] else " "
    ax.set_title(f"{short_name(measure)}{gap}({subtitle})", fontsize=7, loc="right")
    low, high = (indices[[f"first_order_{e}", f"total_{e}"]].to_dataarray() for e in ("low", "high"))
    ends_at = min(0.0, 1.1 * float(low.min())), max(1.0, 1.03 * float(high.max()))  # of estimates
    ax.set(xlim=ends_at, xlabel="Share of the variance")
    ax.xaxis.grid(visible=True, zorder=0)
    handles, labels = ax.get_legend_handles_labels()
    ax.figure.legend(handles[::-1], labels[::-1], loc="outside lower center", ncols=2)
    return ax


def _table(found: xr.Dataset) -> Iterator[str]:
    about = found.attrs
    unit = "" if about["units"] == "1" else f" {about['units']}"
    of_stators = f", {about['of_stators']}" if about["of_stators"] else ""
    yield (
        f"{about['measure']}{of_stators}: mean {about['mean']:.6g}{unit}, standard deviation "
        f"{about['standard_deviation']:.6g}{unit}, {about['cases']} cases"
    )
    yield from about["notes"].splitlines()
    name = "levels" if "levels" in found else "drawn_from"
    over = [str(text) for text in found[name].values]
    width = max(map(len, [name, *over]))
    yield f"{'axis':<28} {name.replace('_', ' '):>{width}}  {'first order':<22}  total"
    for i, axis in enumerate(found["axis"].values):
        cells = []
        for name in ("first_order", "total"):
            share, low, high = (float(found[n][i]) for n in (name, f"{name}_low", f"{name}_high"))
            cells.append(f"{share:.3f} [{low:.3f}, {high:.3f}]")
        yield f"{axis:<28} {over[i]:>{width}}  {cells[0]:<22}  {cells[1]}"
    yield f"interactions: {about['interactions']:.3f}"
