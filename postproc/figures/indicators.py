"""The rub indicators: how often each, and all together, detect rub as noise grows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from postproc.cases.detection import TOGETHER, judge, require_both_kinds
from postproc.figures.drawing import Drawing
from postproc.signals.indicators import CHANNELS, LEVELS, indicator_scores
from postproc.store.export import check_data_path
from postproc.store.variables import require_variables

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr
    from matplotlib.axes import Axes

    from postproc.figures.options import Count, File, Seed

NAMES = {
    "torsion_harmonics": "Torsion harmonics",
    "lateral_subharmonics": "Lateral sub-harmonics",
    "stator_resonance": "Stator resonance",
    "contact_periodicity": "Periodic bursts",
    TOGETHER: "All together",
}
_MARKS = ("o", "s", "^", "v", "D")


def indicators(
    cases: xr.Dataset,
    *,
    noise: Sequence[float] = (),
    draws: Count = 3,
    false_alarms: float = 0.05,
    seed: Seed = 1,
    scores: File | None = None,
) -> Drawing:
    """Detection rates of rub indicators under measurement noise.

    They are indicators of torsion, whirl and stator vibration. Noise of level 1 is as strong as the median
    vibration of the cases that touch. Thresholds for one half of the cases come from those of the other half
    that do not touch.

    Parameters
    ----------
    cases
        At least some of them without contact.
    noise
        Level of noise; may be repeated.
    draws
        Draws of the noise for each case.
    false_alarms
        Share of false alarms that sets the thresholds.
    seed
        Seed of the noise and of the random halves.
    scores
        Write every case's scores and verdict: .zarr or .nc.
    """
    path = check_data_path(scores) if scores else None
    levels = tuple(sorted(set(noise))) or LEVELS
    require_variables(cases, [*CHANNELS, "regime", "status"])
    require_both_kinds(cases, seed)
    judged = judge(indicator_scores(cases, levels, draws, seed), false_alarms, seed)
    return Drawing(
        shown=judged[["detection_rate", "false_alarm_rate", "area_under_curve"]],
        draw=lambda axes: draw_panels(judged, axes),
        panels=(2, 1),
        height=110,
        lines=tuple(_table(judged)),
        files={path: judged} if path else {},
    )


def draw_panels(judged: xr.Dataset, axes: Sequence[Axes]) -> list[Axes]:
    """Draw detection rates above, and areas under the receiver operating curves below, over the noise."""
    false = float(judged["false_alarm_rate"].sel(indicator=TOGETHER).mean())
    panels = (
        ("detection_rate", "Detection rate", false, 0.0),
        ("area_under_curve", "Area under ROC curve", 0.5, 0.45),
    )
    for ax, (value, label, chance, floor) in zip(axes, panels, strict=True):
        for i, name in enumerate(judged["indicator"].values):
            is_together = name == TOGETHER
            style: dict[str, Any] = {"color": "k" if is_together else f"C{i}", "marker": _MARKS[i]}
            style |= {"linewidth": 1.4 if is_together else 0.8, "zorder": 4 if is_together else 3}
            rate = judged[value].sel(indicator=name)
            ax.plot(judged["level"].values, rate.values, label=NAMES[str(name)], **style)
        ax.axhline(chance, color="0.6", linewidth=0.6, linestyle=":", zorder=1)
        ax.set(xscale="log", ylim=(floor, 1.03), xlabel="Noise over median vibration in rub", ylabel=label)
        ax.label_outer()
    axes[0].figure.align_ylabels(list(axes))
    axes[0].figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return list(axes)


def _table(judged: xr.Dataset) -> Iterator[str]:
    done = judged["verdict"].notnull().all(("indicator", "level"))
    n_rub, n_free = int((done & judged["rub"]).sum()), int((done & ~judged["rub"]).sum())
    yield f"Detection rate and area under the ROC curve, of {n_rub} cases with rub and {n_free} without"
    names = [str(name) for name in judged["indicator"].values]
    yield f"{'noise':>6}" + "".join(f"{name:>22}" for name in names)
    for level in judged["level"].values:
        row = judged.sel(level=level)
        cells = zip(row["detection_rate"].values, row["area_under_curve"].values, strict=True)
        yield f"{level:6g}" + "".join(f"{f'{rate:.3f}  {area:.3f}':>22}" for rate, area in cells)
