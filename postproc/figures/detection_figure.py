"""Rub indicators as a figure: how well each, and all together, tell rub from no rub as noise grows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from postproc.cases.detection import TOGETHER

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr
    from matplotlib.axes import Axes

NAMES = {
    "torsion_harmonics": "Torsion harmonics",
    "lateral_subharmonics": "Lateral sub-harmonics",
    "stator_resonance": "Stator resonance",
    "contact_periodicity": "Periodic bursts",
    TOGETHER: "All together",
}
_MARKS = ("o", "s", "^", "v", "D")


def detection_rates(judged: xr.Dataset, ax: Axes, value: str = "detection_rate") -> Axes:
    """Draw a rate of `judge` over the level of noise, one curve an indicator."""
    for i, name in enumerate(judged["indicator"].values):
        is_together = name == TOGETHER
        style: dict[str, Any] = {"color": "k" if is_together else f"C{i}", "marker": _MARKS[i]}
        style |= {"linewidth": 1.4 if is_together else 0.8, "zorder": 4 if is_together else 3}
        rate = judged[value].sel(indicator=name)
        ax.plot(judged["level"].values, rate.values, label=NAMES[str(name)], **style)
    if value == "detection_rate":
        chance = float(judged["false_alarm_rate"].sel(indicator=TOGETHER).mean())
        label, floor = "Detection rate", 0.0
    else:
        chance, label, floor = 0.5, "Area under ROC curve", 0.45
    ax.axhline(chance, color="0.6", linewidth=0.6, linestyle=":", zorder=1)
    ax.set(xscale="log", ylim=(floor, 1.03), xlabel="Noise over median vibration in rub", ylabel=label)
    return ax


def panels(judged: xr.Dataset, axes: Sequence[Axes]) -> list[Axes]:
    """Draw detection rates above and areas under the receiver operating curves below."""
    for ax, value in zip(axes, ("detection_rate", "area_under_curve"), strict=True):
        detection_rates(judged, ax, value)
        ax.label_outer()
    axes[0].figure.align_ylabels(list(axes))
    axes[0].figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return list(axes)
