"""The shaft centreline: where the shaft's mean position goes while the speed changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.figures.drawing import Drawing
from postproc.figures.run_up_marks import draw_rotation, name_speeds
from postproc.signals.run_up_spectra import mean_positions
from postproc.signals.waveforms import seen_by_two
from rubhpc.units import scale_for

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


def centreline(cases: xr.Dataset, *, probes: tuple[str, str] | None = None) -> Drawing:
    """Shaft centreline of a run-up: the mean position of every revolution.

    Parameters
    ----------
    cases
        One case of a study with [run_up].
    probes
        Names of two probes at one place, whose position is drawn in place of the disc's.
    """
    seen = cases if probes is None else seen_by_two(cases, probes, others=["speed"])
    shown = mean_positions(seen, ["vertical", "horizontal"])
    where = "the disc" if probes is None else str(seen["vertical"].attrs["of_probes"])
    return Drawing(shown=shown, draw=lambda axes: draw_centreline(shown, axes[0], where), height=85)


def draw_centreline(data: xr.Dataset, ax: Axes, where: str = "the disc") -> Axes:
    """Draw the mean position, vertical over horizontal; positive spin turns clockwise."""
    x, y, speed = (data[name].values for name in ("horizontal", "vertical", "speed"))
    scale = scale_for("m", float(np.nanmax(np.hypot(x, y))))
    x, y = x * scale.factor, y * scale.factor
    reach = 0.62 * max(float(np.ptp(x)), float(np.ptp(y)), 1e-3 * float(np.abs([x, y]).max()))
    middle = 0.5 * (x.max() + x.min()), 0.5 * (y.max() + y.min())
    ax.set(
        xlim=(middle[0] - reach, middle[0] + reach),
        ylim=(middle[1] - reach, middle[1] + reach),
        aspect="equal",
        xlabel=scale.label("Horizontal mean position"),
        ylabel=scale.label("Vertical mean position"),
    )
    ax.plot(x, y, linewidth=0.9)
    name_speeds(ax, [(x, y)], speed)
    draw_rotation(ax)
    ax.set_title(f"Centreline of {where}, speeds in rpm", fontsize=8)
    return ax
